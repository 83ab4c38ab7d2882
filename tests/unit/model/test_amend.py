"""Values put into a model text: it reads as before, but for them, in whatever style it is written."""

import copy
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from faultbond.model.amend import amended

NAMES = st.sampled_from(["law", "parameters", "unit", "pump", "line", "reads"])
TEXTS = st.sampled_from(
    ["1 ohm", "a = b*c", "12", "a long text of words, with: what yaml sees", "# no remark", "l1\nl2\n"]
)
TABLES = st.recursive(
    TEXTS | st.lists(TEXTS, min_size=1, max_size=3),
    lambda inner: st.dictionaries(NAMES, inner, min_size=1, max_size=3),
    max_leaves=12,
)


class Lines(yaml.SafeDumper):
    """Writes texts of several lines as people do."""


def _text(dumper: yaml.SafeDumper, value: str) -> yaml.ScalarNode:
    return dumper.represent_scalar("tag:yaml.org,2002:str", value, style="|" if "\n" in value else None)


Lines.add_representer(str, _text)


def put(table: dict[str, Any], path: tuple[str, ...], value: object) -> dict[str, Any]:
    """Give the table with a value at a path, the slow obvious way."""
    whole = copy.deepcopy(table)
    inner = whole
    for key in path[:-1]:
        inner = inner.setdefault(key, {})
    inner[path[-1]] = value
    return whole


@given(
    st.dictionaries(NAMES, TABLES, min_size=1, max_size=4),
    st.lists(NAMES, min_size=1, max_size=3),
    st.booleans() | st.none(),
    st.sampled_from([("7 Pa", "7 Pa"), ("[1, 2]", [1, 2]), ("{a: 1, b: [2]}", {"a": 1, "b": [2]})]),
)
def test_it_reads_as_before_but_for_the_value(
    table: dict[str, Any], keys: list[str], flow: bool | None, new: tuple[str, object]
) -> None:
    """Whether tables and lists stand in lines or in brackets, and texts in one line or several."""
    path, inner = [], table
    for key in keys:
        path.append(key)
        if not isinstance(inner.get(key), dict):
            break
        inner = inner[key]
    text = yaml.dump(table, Dumper=Lines, default_flow_style=flow, sort_keys=False, width=60)
    assert yaml.safe_load(text) == table
    assert yaml.safe_load(amended(text, [(tuple(path), new[0])])) == put(table, tuple(path), new[1])


STYLES = [
    "blocks:\n  a:\n    law:\n      - x = 1\n      - y = 2\n    parameters: {K: 1}\nname: n\n",
    "blocks:\n  a:\n    law:\n    - x = 1\n    - y = 2  # a remark\n    # another\n    parameters: {K: 1}\nname: n\n",
    "blocks:\n  a:\n    law: |\n      x = 1\n      y = 2\n    parameters: {K: 1}\nname: n\n",
    "blocks: {a: {law: [x = 1, y = 2], parameters: {K: 1}}}\nname: n\n",
    "blocks:\n  a:\n    parameters: {K: 1}\n    law:\n      - x = 1\n      - y = 2\nname: n\n",
    "blocks:\n  a:\n    parameters: {K: 1}\n    law: |\n      x = 1\n      y = 2\nname: n\n",
]


@pytest.mark.parametrize("text", STYLES)
def test_a_law_and_a_parameter_stand_where_they_belong(text: str) -> None:
    """A law of several lines is replaced as a whole, and what comes behind it stays; so does a key that is new."""
    new = [(("blocks", "a", "law"), "[x = 1, y = 2 + o]"), (("blocks", "a", "parameters", "o"), "{nominal: 1}")]
    found = yaml.safe_load(amended(text, new))
    law, parameters = ["x = 1", "y = 2 + o"], {"K": 1, "o": {"nominal": 1}}
    assert found == {"blocks": {"a": {"law": law, "parameters": parameters}}, "name": "n"}
    assert yaml.safe_load(amended(text, [(("blocks", "a", "range"), "any")]))["blocks"]["a"]["range"] == "any"
    assert yaml.safe_load(amended(text, [(("blocks", "a", "range"), "any")]))["name"] == "n"
