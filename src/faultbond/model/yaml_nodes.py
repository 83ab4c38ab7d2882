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

from faultbond.model.document import MAX_BYTES
from faultbond.model.source import Entry, Items, Node, Source, Table, Text, shown

MAX_ENTRIES = 5000
MAX_LEVELS = 10
RECORDINGS = (".csv", ".parquet", ".pq")

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
        raise source.error(0, f"the {source.what} has more than {MAX_BYTES} bytes; {source.smaller}")
    text = text.removeprefix("\ufeff")
    _check_letters(text, source)
    try:
        return _Composer(source, yaml.parse(text, Loader=_LOADER)).document()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        problem = str(getattr(error, "problem", None) or getattr(error, "reason", None) or "cannot be read")
        line, advice = int(mark.line) + 1 if mark else 0, "check indentation, quotes and brackets"
        if (
            "cannot start any token" in problem
            and mark is not None
            and text.split("\n")[mark.line].lstrip(" ")[:1] == "\t"
        ):
            problem, advice = "a tab begins the line", "indent with blanks"
        raise source.error(line, f"not YAML: {shown(problem)}; {advice}") from None
    except (ValueError, OverflowError, RecursionError):
        raise source.error(0, "not YAML: an escape in a quoted text cannot be read; write plain text") from None


def _check_letters(text: str, source: Source, line: int = 0) -> None:
    """Refuse what cannot stand in a model; `line` is that of the whole text, 0 for all of the file."""
    bad = _NOT_TEXT.search(text)
    if bad:
        line = line or text.count("\n", 0, bad.start()) + 1
        raise source.error(line, f"character U+{ord(bad[0]):04X} cannot stand in a {source.what}; remove it")


class _Composer:
    """Makes the tree from the parser's events."""

    def __init__(self, source: Source, events: Iterator[Event]) -> None:
        self.source, self.events = source, events

    def document(self) -> Table:
        next(self.events)
        start = next(self.events)
        if isinstance(start, StreamEndEvent):
            raise self.source.error(1, f"the {self.source.what} is empty; start with `name:`")
        if isinstance(start, DocumentStartEvent) and (start.tags or start.version):
            raise self.source.error(1, f"a `%` directive; remove it, a {self.source.what} is plain YAML")
        top = self.node(next(self.events), 1)
        next(self.events)
        if not isinstance(next(self.events), StreamEndEvent):
            raise self.source.error(0, f"more than one document (`---`); put each {self.source.what} into its own file")
        if not isinstance(top, Table):
            problem = f"a {self.source.what} is a table of `key: value`; start with `name:`"
            if self.source.label.lower().endswith(RECORDINGS):
                problem = f"this seems to be a recording; name the {self.source.what} before it"
            raise self.source.error(top.line or 1, problem)
        return top

    def node(self, event: Event, depth: int) -> Node:
        line = event.start_mark.line + 1 if event.start_mark else 0
        if isinstance(event, AliasEvent):
            raise self.source.error(line, f"alias `*{shown(str(event.anchor))}`; write the value out")
        if isinstance(event, NodeEvent) and event.anchor is not None:
            raise self.source.error(line, f"anchor `&{shown(str(event.anchor))}`; remove it and write values out")
        tag = getattr(event, "tag", None)
        if tag is not None:
            raise self.source.error(line, f"tag `{shown(str(tag))}`; remove it, every value is plain text")
        if depth > MAX_LEVELS:
            raise self.source.error(line, f"more than {MAX_LEVELS} levels of nesting; a {self.source.what} needs 5")
        if isinstance(event, ScalarEvent):
            text = str(event.value)
            _check_letters(text, self.source, line)  # escapes in quotation marks may have put them there
            return Text(text, line)
        if isinstance(event, SequenceStartEvent):
            return Items(tuple(self.counted(depth, SequenceEndEvent)), line)
        if isinstance(event, MappingStartEvent):
            return Table(tuple(self.entries(depth)), line)
        raise self.source.error(line, "not YAML: a value is missing; check indentation, quotes and brackets")

    def counted(self, depth: int, end: type[Event]) -> Iterator[Node]:
        """Give the items of a list, or the keys of a table."""
        count = 0
        while not isinstance(event := next(self.events), end):
            count += 1
            if count > MAX_ENTRIES:
                line = event.start_mark.line + 1 if event.start_mark else 0
                problem = f"more than {MAX_ENTRIES} entries in one list or table; {self.source.smaller}"
                raise self.source.error(line, problem)
            yield self.node(event, depth + 1)

    def entries(self, depth: int) -> Iterator[Entry]:
        lines: dict[str, int] = {}
        for key in self.counted(depth, MappingEndEvent):
            if not isinstance(key, Text):
                problem = "a key must be a plain word, not a list or table; put quotes round it"
                raise self.source.error(key.line, problem)
            if key.value in lines:
                first = f"line {lines[key.value]}" if lines[key.value] != key.line else "the same line"
                raise self.source.error(key.line, f"`{shown(key.value)}` stands twice, first on {first}; remove one")
            lines[key.value] = key.line
            yield Entry(key.value, self.node(next(self.events), depth + 1), key.line)
