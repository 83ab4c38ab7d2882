"""A model file with other numbers: only the changed values are replaced, all else stays as it was written."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

import yaml

from faultbond.errors import ModelError
from faultbond.model.graph import BondGraph
from faultbond.model.parser import number_text

MARK = "# Fitted to "  # how the first line begins
_NUMBER = re.compile(r"\s*[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")


@dataclass(frozen=True, slots=True, kw_only=True)
class NewParameter:
    """A parameter and what is to be written of it: `nominal` first, then other keys, as text."""

    name: str
    nominal: str
    others: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSize:
    """The noise of a sensor, a slow error, or how far a parameter wanders, and how many times larger it is to be."""

    name: str
    times: float
    kind: str = "noise"  # or `slow_error`, or `wander`


_Edit = tuple[int, int, str]  # replace what stands between two places by a text


def rewrite(
    text: str, graph: BondGraph, parameters: Iterable[NewParameter], sizes: Iterable[NewSize], remark: str = ""
) -> str:
    """Give a model text with other nominal values, accuracies and noise.

    Parameters
    ----------
    text : of the model file
    graph : read from it
    parameters, sizes : what is to be written
    remark : a comment for the first line, in place of the one that an earlier call wrote; without it that stays

    Raises
    ------
    ModelError
        Where a value does not stand in the text as a plain value.
    """
    text = text.removeprefix("\ufeff")
    top = yaml.compose(text, Loader=yaml.SafeLoader)
    if top is None:
        raise ModelError(f"{graph.file}: the model is empty")
    edits: list[_Edit] = []
    for item in parameters:
        path = parameter_path(graph, item.name)
        edits += _parameter_edits(
            text, _at(top, path, graph), item, "value" if path[0] in ("inputs", "sensors") else "nominal"
        )
    for size in sizes:
        node = _at(top, _size_path(graph, size), graph)
        node = _values(node).get("size", node)
        edits.append(_put(node, " + ".join(_scaled(part, size.times) for part in str(node.value).split(" + "))))
    for first, end, new in sorted(edits, reverse=True, key=lambda edit: edit[0]):
        text = text[:first] + new + text[end:]
    if remark and text.startswith(MARK):
        text = text.partition("\n")[2]
    return f"{MARK}{remark}\n{text}" if remark else text


def _scaled(text: str, times: float) -> str:
    """Give a size that is so many times larger; what follows the number stays, as of `2 % of 8.9 kPa over 600 s`."""
    match = _NUMBER.match(text)
    return number_text(float(f"{float(match[0]) * times:.3g}")) + text[match.end() :] if match else text


def _size_path(graph: BondGraph, size: NewSize) -> tuple[str, ...]:
    """Give where a size stands."""
    if size.kind == "wander" and size.name in {item.name for item in graph.unknown_inputs}:
        return "inputs", size.name, "unknown"
    if size.kind == "wander":
        return (*parameter_path(graph, size.name), "wander")
    return ("slow_error", size.name) if size.kind == "slow_error" else ("sensors", size.name, "noise")


def parameter_path(graph: BondGraph, name: str) -> tuple[str, ...]:
    """Give where a parameter stands, by keys from the top of the file."""
    lags = {item.lag: ("inputs", item.name, "lag") for item in graph.inputs}
    lags |= {item.rate_limit: ("inputs", item.name, "rate_limit") for item in graph.inputs if item.rate_limit}
    lags |= {item.lag: ("sensors", item.name, "lag") for item in graph.sensors}
    section = "blocks" if graph.is_block_network else "components"
    return lags.get(name) or (section, graph.parameter(name).owner, "parameters", name)


def _at(node: yaml.Node, path: tuple[str, ...], graph: BondGraph) -> yaml.Node:
    """Give the node at a path of keys."""
    for key in path:
        found = _values(node).get(key)
        if found is None:
            raise ModelError(f"{graph.file}: `{'.'.join(path)}` does not stand in it as a value that can be replaced")
        node = found
    return node


def _values(node: yaml.Node) -> dict[str, yaml.Node]:
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    return {str(key.value): value for key, value in pairs}


def _put(node: yaml.Node, text: str) -> _Edit:
    return node.start_mark.index, node.end_mark.index, text


def _parameter_edits(text: str, node: yaml.Node, item: NewParameter, first: str) -> list[_Edit]:
    """Replace the nominal, whose key is `first`, and other keys, whichever way the parameter is written."""
    if not isinstance(node, yaml.MappingNode):
        entries = ", ".join(f"{key}: {value}" for key, value in ((first, item.nominal), *item.others))
        return [_put(node, f"{{{entries}}}")]
    values = _values(node)
    nominal = values[first]
    edits = [_put(values[key], value) for key, value in item.others if key in values]
    added = [f"{key}: {value}" for key, value in item.others if key not in values]
    if node.flow_style:
        return [*edits, _put(nominal, ", ".join([item.nominal, *added]))]
    column = next(key.start_mark.column for key, _ in node.value if key.value == first)
    line_end = text.find("\n", nominal.end_mark.index)
    line_end = len(text) if line_end < 0 else line_end
    new_lines = "".join(f"\n{' ' * column}{entry}" for entry in added)
    return [*edits, _put(nominal, item.nominal), (line_end, line_end, new_lines)]
