"""The plain tree between a model's text and its meaning: texts, lists and tables, each with its line.

The YAML file and the Python builder both give this tree, so both are checked by the same code.
"""

import difflib
import re
from collections.abc import Iterable
from dataclasses import dataclass

from faultbond.errors import ModelError

NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]{0,63}")
MAX_SHOWN = 60
SMALLER = "split the plant into several models"


@dataclass(frozen=True, slots=True)
class Text:
    """A scalar, as written."""

    value: str
    line: int = 0


@dataclass(frozen=True, slots=True)
class Items:
    """A list."""

    items: tuple["Node", ...]
    line: int = 0


@dataclass(frozen=True, slots=True)
class Entry:
    """One `key: value` of a table."""

    key: str
    value: "Node"
    line: int = 0


@dataclass(frozen=True, slots=True)
class Table:
    """A mapping; its keys are unique and keep their order."""

    entries: tuple[Entry, ...]
    line: int = 0


Node = Text | Items | Table


def shown(text: str) -> str:
    """Give a user's text for a one-line message: short and printable."""
    text = " ".join(text[: 4 * MAX_SHOWN].split())
    text = "".join(letter if letter.isprintable() else "?" for letter in text)
    return text if len(text) <= MAX_SHOWN else f"{text[: MAX_SHOWN - 3]}..."


def closest(word: str, known: Iterable[str]) -> str:
    """Give `did you mean ...` for the known word nearest to a misspelt one, or nothing."""
    known = list(known)
    by_case = [item for item in known if item.lower() == word.lower()]
    near = by_case or difflib.get_close_matches(word[:64], known[:3000], n=1, cutoff=0.6)
    return f"did you mean `{near[0]}`?" if near else ""


def choice(word: str, known: Iterable[str]) -> str:
    """Give advice on a word that is none of the known ones: the nearest, else all of them."""
    known = list(known)
    return closest(word, known) or f"known: {', '.join(known)}"


@dataclass(frozen=True, slots=True)
class Source:
    """Where a model, or another file of its kind, comes from; starts every message about it.

    what: the word for such a file. smaller: what to do where it is too large.
    """

    label: str
    has_lines: bool = True
    what: str = "model"
    smaller: str = SMALLER

    def at(self, place: Node | Entry | int) -> str:
        """Give the start of a message: `model.yaml:12: ` or `model pump: `."""
        line = place if isinstance(place, int) else place.line
        return f"{shown_path(self.label)}:{line}: " if self.has_lines and line else f"{shown_path(self.label)}: "

    def error(self, place: Node | Entry | int, problem: str) -> ModelError:
        """Give the exception for a problem at a place."""
        return ModelError(self.at(place) + problem)


def kind(node: Node) -> str:
    """Give the user's word for a node's kind."""
    return {Text: "text", Items: "list", Table: "table"}[type(node)]


def shown_path(label: str) -> str:
    """Give a file name for a one-line message, in full."""
    return "".join(letter if letter.isprintable() else "?" for letter in label)
