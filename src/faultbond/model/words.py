"""The words of a model file as values of Python, and the text of a file that has them."""

from collections.abc import Iterator, Mapping, Sequence

import yaml

from faultbond.errors import ModelError
from faultbond.model.parser import number_text
from faultbond.model.source import Entry, Items, Node, Source, Table, Text, shown
from faultbond.model.text import stated_in

LINES = 2  # levels of tables with a line for each entry; those inside stand in one
WIDTH = 120


def stated_node(value: object, what: str, source: Source) -> Node:
    """Give a value of Python as the texts, lists and tables that a file would give.

    Raises
    ------
    ModelError
        Where it is nothing that a file can have.
    """
    if isinstance(value, str):
        return Text(value)
    if isinstance(value, bool):
        return Text("yes" if value else "no")
    if isinstance(value, int | float):
        return Text(number_text(float(value)))
    if isinstance(value, Mapping):
        stated = ((str(key), item) for key, item in value.items() if item is not None)
        return Table(tuple(Entry(key, stated_node(item, what, source)) for key, item in stated))
    if isinstance(value, Sequence):
        return Items(tuple(stated_node(item, what, source) for item in value))
    problem = f"{what}: a {type(value).__name__} cannot stand here; give a text such as `5 Pa`, or a number"
    raise ModelError(source.at(0) + problem)


def text_of_words(words: Mapping[str, object]) -> str:
    """Give the text of a model file with these words at its top.

    Raises
    ------
    ModelError
        At the first thing that is no model, by its words, since there is no line.

    Example
    -------
    >>> inputs, laws = {"u": {}}, {"amplifier": {"law": "y = K*u", "parameters": {"K": 2}}}
    >>> words = {"sample_time": "none", "inputs": inputs, "blocks": laws, "sensors": {"v": {"reads": "y"}}}
    >>> print(text_of_words(words), end="")
    sample_time: none
    inputs:
      u: {}
    blocks:
      amplifier: {law: y = K*u, parameters: {K: 2}}
    sensors:
      v: {reads: y}
    """
    source = Source(f"model {shown(str(words.get('name', '')))}".rstrip(), has_lines=False)
    stated = words.items()
    table = Table(tuple(Entry(key, stated_node(value, key, source)) for key, value in stated if value is not None))
    stated_in(table, source, "model")
    begin, end = [yaml.StreamStartEvent(), yaml.DocumentStartEvent()], [yaml.DocumentEndEvent(), yaml.StreamEndEvent()]
    return str(yaml.emit([*begin, *_events(table, LINES), *end], allow_unicode=True, width=WIDTH))


def _events(node: Node, lines: int) -> Iterator[yaml.Event]:
    """Give what YAML is made of, without quotes where none are needed: every scalar is read as text."""
    if isinstance(node, Text):
        yield yaml.ScalarEvent(None, None, (True, True), node.value)
    elif isinstance(node, Items):
        yield yaml.SequenceStartEvent(None, None, True, flow_style=True)
        for item in node.items:
            yield from _events(item, 0)
        yield yaml.SequenceEndEvent()
    else:
        yield yaml.MappingStartEvent(None, None, True, flow_style=lines <= 0)
        for entry in node.entries:
            yield from (*_events(Text(entry.key), 0), *_events(entry.value, lines - 1))
        yield yaml.MappingEndEvent()
