"""JSON Schema of the model file, for editors: keys, forms and names. The loader checks much more."""

import json
from typing import Any

from faultbond.model.blocks import BLOCK_KEYS
from faultbond.model.checks import CHECK_KEYS
from faultbond.model.elements import DEFAULT_LAWS, OWN_SIGNALS
from faultbond.model.measured import SENSOR_KEYS, SLOW_ERROR_KEYS
from faultbond.model.resolve import MAX_FAULTS, MODEL_KEYS
from faultbond.model.source import NAME
from faultbond.model.values import INPUT_KEYS, PARAMETER_KEYS
from faultbond.model.wiring import COMPONENT_KEYS

Schema = dict[str, Any]

_NAME = f"^{NAME.pattern}$"
_SIGNAL = f"^{NAME.pattern}(\\.{NAME.pattern})?$"
_TEXT: Schema = {"type": "string", "minLength": 1}
_VALUE: Schema = {"type": ["string", "number"], "description": "a number, or a number and a unit, such as `64650 Pa`"}
_STATIC: Schema = {"properties": {"sample_time": {"const": "none"}}}
_NUMBER = r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?"


def model_schema() -> Schema:
    """Give the JSON Schema (2020-12) of the model file."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "faultbond model",
        "description": "A plant as a bond graph (components, junctions, bonds) or as a block network (blocks).",
        **_table(_model_keys(), required=("sample_time", "sensors")),
        "if": {"required": ["blocks"]},
        "then": {"properties": dict.fromkeys(("components", "junctions", "bonds"), False)},
        "else": {"required": ["components", "bonds"]},
        "allOf": [
            {"if": _STATIC, "else": {"properties": {"sensors": {"additionalProperties": {"required": ["noise"]}}}}}
        ],
    }


def schema_text() -> str:
    """Give the schema as the text of `docs/model.schema.json`."""
    return json.dumps(model_schema(), indent=2) + "\n"


def _table(properties: Schema, required: tuple[str, ...] = ()) -> Schema:
    found: Schema = {"type": "object", "properties": properties, "additionalProperties": False}
    return {**found, "required": list(required)} if required else found


def _named(value: Schema, description: str, pattern: str = _NAME) -> Schema:
    names = {"propertyNames": {"pattern": pattern}, "additionalProperties": value}
    return {"type": "object", "description": description, **names}


def _described(schema: Schema, description: str) -> Schema:
    return {**schema, "description": description}


def _one_or_more(item: Schema, description: str) -> Schema:
    return {"description": description, "anyOf": [item, {"type": "array", "items": item, "minItems": 1}]}


def _chosen(known: tuple[str, ...], properties: Schema) -> Schema:
    """Give the properties in the loader's order; a key without a schema is an error of ours (KeyError)."""
    return {key: properties[key] for key in known}


def _model_keys() -> Schema:
    time = _table({"column": _TEXT, "unit": _described(_TEXT, "a unit of time; default s")})
    properties: Schema = {
        "name": _described(_TEXT, "default: the file's name"),
        "sample_time": _described(
            _TEXT, "the engine's grid, `1 s`; `variable` for rows as they come, `none` for a static block network"
        ),
        "max_faults": {
            "description": "largest set of simultaneous faults that is tested; default 2",
            "anyOf": [{"type": "integer", "minimum": 1, "maximum": MAX_FAULTS}, {"type": "string"}],
        },
        "accuracy": _described(_TEXT, "standard deviation of each healthy parameter, relative; default `3 %`"),
        "warm_up": _described(_TEXT, "time without alarms after the start, `180 s`"),
        "time": {"description": "where time stands in a recording; default column `time` in s", "anyOf": [time, _NONE]},
        "constants": _named(_VALUE, "trusted numbers, never suspects"),
        "inputs": _named(_input(), "measured or commanded inputs"),
        "components": {**_named(_component(), "elements with their laws and parameters"), "minProperties": 1},
        "blocks": {**_named(_block(), "blocks of a block network with their laws"), "minProperties": 1},
        "junctions": _named({"enum": [0, 1, "0", "1"]}, "0: one effort, flows sum to 0; 1: one flow, efforts sum to 0"),
        "bonds": _one_or_more({"type": "string", "pattern": "->"}, "`a -> b -> c`; power counts positive along `->`"),
        "sensors": {**_named(_sensor(), "measured outputs"), "minProperties": 1},
        "slow_error": _named(_slow_error(), "known imperfections of signals and sensors", _SIGNAL),
        "instrument_faults": _yes_or_no("`no` trusts every sensor and input that does not state `suspect`"),
        "time_between_false_alarms": _described(_TEXT, "mean time between false alarms of a healthy plant, `30 days`"),
        "checks": _named(_check(), "what can be checked by hand: a component, an input, or a new name with `reads`"),
    }
    return _chosen(MODEL_KEYS, properties)


_NONE: Schema = {"const": "none", "description": "row number times sample_time"}


def _input() -> Schema:
    properties: Schema = {
        "unit": _described(_TEXT, "unit of its column, such as `percent`; `logic` for 0 and 1"),
        "column": _described(_TEXT, "column of a recording; default its name"),
        "noise": _described(_VALUE, "standard deviation; default 0"),
        "settling": _described(_TEXT, "after a step the model may be off for so long; default `0 s`"),
        "range": _range("what it can be; a value beyond is not used; default any"),
        "suspect": _yes_or_no("`no` trusts the input"),
    }
    return {"anyOf": [_table(_chosen(INPUT_KEYS, properties)), {"type": "null"}]}


def _component() -> Schema:
    laws = {element.value: " and ".join(texts) for element, texts in DEFAULT_LAWS.items()}
    defaults = "; ".join(f"{element} `{law}`" for element, law in laws.items())
    properties: Schema = {
        "type": {"enum": [element.value for element in OWN_SIGNALS]},
        "law": _one_or_more(_TEXT, f"`left = right`; default with one parameter X: {defaults}"),
        "parameters": _named(_parameter(), "numbers that a fault may change"),
        "start": {
            "description": "known start of a store; default: solved from the first samples",
            **_table({"q": _VALUE, "p": _VALUE, "sd": _VALUE}, required=("sd",)),
        },
    }
    return _table(_chosen(COMPONENT_KEYS, properties), required=("type",))


def _block() -> Schema:
    store = {"propertyNames": {"pattern": _NAME}, "required": ["sd"], "minProperties": 2, "maxProperties": 2}
    properties: Schema = {
        "law": _one_or_more(_TEXT, "`y = K*x` defines signal y, `der(y) = x/P` makes it a store, or any equation"),
        "parameters": _named(_parameter(), "numbers that a fault may change"),
        "signals": _one_or_more({"type": "string", "pattern": _NAME}, "unknown signals that no law defines"),
        "start": {
            "description": "known start of its store, `{y: 2 m, sd: 1 cm}`; default: solved from the first samples",
            "type": "object",
            "additionalProperties": _VALUE,
            **store,
        },
        "suspect": _yes_or_no("`no` trusts the block and its parameters"),
    }
    return _table(_chosen(BLOCK_KEYS, properties), required=("law",))


def _yes_or_no(description: str) -> Schema:
    return {"description": description, "enum": [True, False, "yes", "no", "true", "false"]}


def _parameter() -> Schema:
    limits = {"type": "array", "items": _VALUE, "minItems": 1, "maxItems": 2}
    properties: Schema = {
        "nominal": _described(_VALUE, "healthy value"),
        "accuracy": _described(_VALUE, "standard deviation while healthy, relative or absolute"),
        "change": _described(_VALUE, "standard deviation of a faulty value about the nominal; default `200 %`"),
        "range": _range("default: the sign of the nominal"),
        "limit": {"description": "value at which a drift matters, or one on each side", "anyOf": [_VALUE, limits]},
        "suspect": _yes_or_no("`no` trusts the parameter"),
    }
    return {"anyOf": [_VALUE, _table(_chosen(PARAMETER_KEYS, properties), required=("nominal",))]}


def _range(description: str) -> Schema:
    ends = {"type": "array", "items": {"type": ["string", "number"]}, "minItems": 2, "maxItems": 2}
    return {"description": description, "anyOf": [ends, {"const": "any"}]}


def _sensor() -> Schema:
    properties: Schema = {
        "reads": _described(_TEXT, "a law of signals, such as `vessel.e`"),
        "unit": _described(_TEXT, "unit of its column; default SI; `logic` for 0 and 1"),
        "noise": _described(_VALUE, "standard deviation, `180 Pa` or `2 % of 8.9 kPa`; default 0 in a static network"),
        "column": _described(_TEXT, "column of a recording; default its name"),
        "range": _range("measuring range; a value at an end or beyond is not used; default any"),
        "suspect": _yes_or_no("`no` trusts the sensor"),
    }
    return _table(_chosen(SENSOR_KEYS, properties), required=("reads",))


def _check() -> Schema:
    cost = {"type": ["string", "number"], "description": "cost in any measure; default 1"}
    properties: Schema = {
        "cost": cost,
        "move": _described(_VALUE, "of an input: size of the change, `10 percent`"),
        "reads": _described(_TEXT, "a law of signals: what is measured by hand"),
        "unit": _described(_TEXT, "unit of what is measured; default SI"),
        "noise": _described(_VALUE, "standard deviation of what is measured"),
    }
    return {"anyOf": [cost, _table(_chosen(CHECK_KEYS, properties)), {"type": "null"}]}


def _slow_error() -> Schema:
    size: Schema = {
        "type": "string",
        "pattern": rf"^\s*{_NUMBER}.*\sover\s",
        "description": "standard deviation and memory, `2 % over 600 s`",
    }
    properties: Schema = {
        "size": size,
        "after": _one_or_more({"type": "string", "pattern": _NAME}, "inputs after whose changes it is larger"),
        "each": _described(_VALUE, "how much larger for each unit of a change"),
    }
    return {"anyOf": [size, _table(_chosen(SLOW_ERROR_KEYS, properties), required=("size",))]}
