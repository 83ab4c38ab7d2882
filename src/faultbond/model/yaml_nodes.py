"""YAML as plain text: a tree of texts, lists and tables with their lines, and nothing else.

We read the parser's events only, so no tag, alias or type of YAML can make an object; what is not plain is refused.
"""

import re
from collections.abc import Iterator

import yaml
from yaml.events import (
    AliasEvent,
    DocumentStartEvent,
    Event,
    MappingEndEvent,
    MappingStartEvent,
    NodeEvent,
    ScalarEvent,
    SequenceEndEvent,
    SequenceStartEvent,
    StreamEndEvent,
)

from faultbond.model.source import Entry, Items, Node, Source, Table, Text, shown

MAX_BYTES = 2**20
MAX_ENTRIES = 5000
MAX_DEPTH = 10

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_NOT_TEXT = re.compile("[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]")


def read_yaml(text: str, source: Source) -> Table:
    """Give the top table of a YAML text.

    Raises
    ------
    ModelError
        if the text is longer than 1 MiB, is not one YAML table, or has tags, anchors, aliases, duplicate keys, more
        than 5000 entries in one list or table, or more than 10 levels.
    """
    if len(text) > MAX_BYTES or len(text.encode("utf-8", "replace")) > MAX_BYTES:
        raise source.error(0, f"the model has more than {MAX_BYTES} bytes; split the plant into several models")
    text = text.removeprefix("\ufeff")
    bad = _NOT_TEXT.search(text)
    if bad:
        line = text.count("\n", 0, bad.start()) + 1
        raise source.error(line, _misplaced(bad[0]))
    try:
        return _Composer(source, yaml.parse(text, Loader=_LOADER)).document()
    except yaml.YAMLError as error:
        raise source.error(
            _line_of(error), f"not YAML: {_problem_of(error)}; check indentation, quotes and brackets"
        ) from None
    except (ValueError, OverflowError, RecursionError):
        raise source.error(0, "not YAML: an escape in a quoted text cannot be read; write plain text") from None


def _misplaced(letter: str) -> str:
    return f"character U+{ord(letter):04X} cannot stand in a model; remove it"


def _line(event: Event) -> int:
    return event.start_mark.line + 1 if event.start_mark else 0


def _line_of(error: yaml.YAMLError) -> int:
    mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
    return int(mark.line) + 1 if mark else 0


def _problem_of(error: yaml.YAMLError) -> str:
    return shown(str(getattr(error, "problem", None) or getattr(error, "reason", None) or "cannot be read"))


class _Composer:
    """Makes the tree from the parser's events."""

    def __init__(self, source: Source, events: Iterator[Event]) -> None:
        self.source, self.events = source, events

    def next(self) -> Event:
        return next(self.events)

    def document(self) -> Table:
        self.next()
        start = self.next()
        if isinstance(start, StreamEndEvent):
            raise self.source.error(1, "the model is empty; start with `name:`")
        if isinstance(start, DocumentStartEvent) and (start.tags or start.version):
            raise self.source.error(1, "a `%` directive; remove it, a model is plain YAML")
        top = self.node(self.next(), 1)
        self.next()
        if not isinstance(self.next(), StreamEndEvent):
            raise self.source.error(0, "more than one document (`---`); put each model into its own file")
        if not isinstance(top, Table):
            raise self.source.error(top.line or 1, "a model is a table of `key: value`; start with `name:`")
        return top

    def node(self, event: Event, depth: int) -> Node:
        line = _line(event)
        if isinstance(event, AliasEvent):
            raise self.source.error(line, f"alias `*{shown(str(event.anchor))}`; write the value out")
        if isinstance(event, NodeEvent) and event.anchor is not None:
            raise self.source.error(line, f"anchor `&{shown(str(event.anchor))}`; remove it and write values out")
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise self.source.error(line, f"tag `{shown(str(tag))}`; remove it, every value is plain text")
        if depth > MAX_DEPTH:
            raise self.source.error(line, f"more than {MAX_DEPTH} levels of nesting; a model needs 5")
        if isinstance(event, ScalarEvent):
            return Text(self.plain(str(event.value), line), line)
        if isinstance(event, SequenceStartEvent):
            return Items(tuple(self.elements(depth)), line)
        if isinstance(event, MappingStartEvent):
            return Table(tuple(self.entries(depth)), line)
        raise self.source.error(line, "not YAML: a value is missing; check indentation, quotes and brackets")

    def plain(self, text: str, line: int) -> str:
        """Refuse what escapes in quotation marks may have put into a text."""
        bad = _NOT_TEXT.search(text)
        if bad:
            raise self.source.error(line, _misplaced(bad[0]))
        return text

    def elements(self, depth: int) -> Iterator[Node]:
        count = 0
        while not isinstance(event := self.next(), SequenceEndEvent):
            count += 1
            self.check_count(count, event)
            yield self.node(event, depth + 1)

    def entries(self, depth: int) -> Iterator[Entry]:
        lines: dict[str, int] = {}
        while not isinstance(event := self.next(), MappingEndEvent):
            key = self.node(event, depth + 1)
            if not isinstance(key, Text):
                raise self.source.error(
                    key.line, "a key must be a plain word, not a list or table; put quotes round it"
                )
            if key.value in lines:
                first = f"line {lines[key.value]}" if lines[key.value] != key.line else "the same line"
                raise self.source.error(key.line, f"`{shown(key.value)}` stands twice, first on {first}; remove one")
            lines[key.value] = key.line
            self.check_count(len(lines), event)
            yield Entry(key.value, self.node(self.next(), depth + 1), key.line)

    def check_count(self, count: int, event: Event) -> None:
        if count > MAX_ENTRIES:
            line = _line(event)
            raise self.source.error(line, f"more than {MAX_ENTRIES} entries in one list or table; split the plant")
