"""The JSON Schema of the model file."""

import copy
import inspect
import json
from pathlib import Path
from typing import Any

import jsonschema
import pytest
import yaml

from faultbond.model.builder import ModelBuilder
from faultbond.model.keys import BLOCK_KEYS, CHECK_KEYS, COMPONENT_KEYS, INPUT_KEYS, SENSOR_KEYS, SLOW_ERROR_KEYS, Keys
from faultbond.model.schema import model_schema

ROOT = Path(__file__).parents[3]
EXAMPLES = sorted([*(ROOT / "examples").glob("*/model.yaml"), *(ROOT / "examples" / "thesis").glob("*.yaml")])


def schema_text() -> str:
    """Give the schema as the text of `docs/model.schema.json`."""
    return json.dumps(model_schema(), indent=2) + "\n"


def validate(model: Any) -> None:
    """Raise where a model does not fit the schema."""
    jsonschema.Draft202012Validator(model_schema()).validate(model)


def test_schema_is_a_schema() -> None:
    """The schema itself is valid JSON Schema 2020-12."""
    jsonschema.Draft202012Validator.check_schema(model_schema())


def test_published_copy_is_current() -> None:
    """`docs/model.schema.json` is what the code gives."""
    assert (ROOT / "docs" / "model.schema.json").read_text() == schema_text()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_examples_fit(path: Path) -> None:
    """Every example fits, read as an editor reads it."""
    validate(yaml.safe_load(path.read_text()))


@pytest.mark.parametrize(
    "place",
    [
        *((), ("inputs", "u_in"), ("components", "pump"), ("components", "leak", "parameters", "K6")),
        *(("sensors", "flow"), ("junctions",)),
    ],
)
def test_unknown_keys_do_not_fit(place: tuple[str, ...]) -> None:
    """A misspelt key is refused at every level (as a junction type, where every key is a name)."""
    model = copy.deepcopy(yaml.safe_load((ROOT / "examples" / "tank" / "model.yaml").read_text()))
    inner = model
    for key in place:
        inner = inner[key]
    inner["colour"] = "green"
    with pytest.raises(jsonschema.ValidationError, match=r"colour|green|not valid under any"):
        validate(model)


@pytest.mark.parametrize("key", ["sample_time", "components", "bonds", "sensors"])
def test_needed_keys(key: str) -> None:
    """What the loader needs, the schema needs."""
    model = yaml.safe_load((ROOT / "examples" / "tank" / "model.yaml").read_text())
    del model[key]
    with pytest.raises(jsonschema.ValidationError, match=f"'{key}' is a required property"):
        validate(model)


def test_block_networks() -> None:
    """A block network needs no components and has none; its sensors need noise unless it is static."""
    adder = yaml.safe_load((ROOT / "examples" / "thesis" / "fig_3_7.yaml").read_text())
    store = yaml.safe_load((ROOT / "examples" / "thesis" / "fig_3_18.yaml").read_text())
    for model, change, message in (
        (adder, {"bonds": ["a -> b"]}, "False schema"),
        (adder, {"blocks": {}}, "non-empty|too short|enough properties"),
        (adder, {"blocks": {"b": {"signals": ["y"]}}}, "'law' is a required property"),
        (store, {"sensors": {"y": {"reads": "y"}}}, "'noise' is a required property"),
        (store, {"blocks": {"b": {"law": "der(y) = x", "start": {"y": "1"}}}}, "'sd' is a required property"),
    ):
        validate(model)
        with pytest.raises(jsonschema.ValidationError, match=message):
            validate({**model, **change})


def test_schema_is_plain_json() -> None:
    """The text of the schema reads back as the schema."""
    assert json.loads(schema_text()) == model_schema()


@pytest.mark.parametrize(
    ("method", "keys"),
    [
        ("input", INPUT_KEYS),
        ("component", COMPONENT_KEYS),
        ("block", BLOCK_KEYS),
        ("sensor", SENSOR_KEYS),
        ("slow_error", SLOW_ERROR_KEYS),
        ("check", CHECK_KEYS),
    ],
)
def test_the_builder_takes_the_keys_of_the_file(method: str, keys: Keys) -> None:
    """What can be stated of a thing in a file can be stated of it in Python, and nothing else."""
    arguments = inspect.signature(getattr(ModelBuilder, method)).parameters
    assert arguments.keys() - {"self", "name", "target"} == keys.known.keys()
