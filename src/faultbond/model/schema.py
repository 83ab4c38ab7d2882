"""JSON Schema of the model file, for editors: keys, forms and names. The loader checks much more."""

from typing import Any

from faultbond.model.keys import BESIDE_STRUCTURE, BOND_GRAPH_KEYS, MODEL_KEYS, Form, Key, Keys

Schema = dict[str, Any]


def model_schema() -> Schema:
    """Give the JSON Schema (2020-12) of the model file, the content of `docs/model.schema.json`."""
    static = {"properties": {"sample_time": {"const": "none"}}}
    noisy = {"properties": {"sensors": {"additionalProperties": {"required": ["noise"]}}}}
    keys = _of(MODEL_KEYS)
    with_laws = {
        "required": keys.pop("required"),
        "if": {"required": ["blocks"]},
        "then": {"properties": dict.fromkeys(BOND_GRAPH_KEYS, False)},
        "else": {"required": ["components", "bonds"]},
        "allOf": [{"if": static, "else": noisy}],
    }
    others = [key for key in MODEL_KEYS.known if key not in ("structure", *BESIDE_STRUCTURE)]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "faultbond model",
        "description": "A plant as a bond graph (components, junctions, bonds), as a block network (blocks), or as "
        "equations without laws (structure).",
        **keys,
        "if": {"required": ["structure"]},
        "then": {"properties": dict.fromkeys(others, False)},
        "else": with_laws,
    }


def _of(form: Form | Keys) -> Schema:
    """Give the schema of a form, or of a table with its short forms."""
    if not isinstance(form, Keys):
        return {key: _inside(value) for key, value in form.items()}
    table: Schema = {
        "type": "object",
        "properties": {name: _described(key) for name, key in form.known.items()},
        "additionalProperties": False,
    }
    required = [name for name, key in form.known.items() if key.required]
    table |= {"required": required} if required else {}
    short = [_of(form.known[form.short].form)] if form.short else []
    empty = [{"type": "null"}] if form.may_be_empty else []
    return {"anyOf": [*short, table, *empty]} if short or empty else table


def _inside(value: object) -> object:
    """Give a part of a form, with the tables in it as schemas."""
    if isinstance(value, dict | Keys):
        return _of(value)
    return [_inside(item) for item in value] if isinstance(value, list) else value


def _described(key: Key) -> Schema:
    """Give the schema of a key; its sentence stands first in a table, else where its form has a place for it."""
    if isinstance(key.form, Keys):
        return {"description": key.sentence, **_of(key.form)}
    return {**_of(key.form), "description": key.sentence} if key.sentence else _of(key.form)
