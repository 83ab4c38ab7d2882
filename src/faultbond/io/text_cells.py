"""Text where numbers belong: of each column the first, with its line, and how many there are."""

from collections.abc import Callable
from dataclasses import dataclass

from faultbond.io.times import is_not_finite

NOTHING = frozenset({"", "null"})  # beside `nan`: a value that is not there, and is written as that
SHOWN = 40  # characters of a text
MOST = 6  # columns of which a sentence each is said
SWITCHES = frozenset({"on", "off", "true", "false", "yes", "no", "open", "closed", "running", "stopped"})


@dataclass(frozen=True, slots=True, kw_only=True)
class TextCell:
    """The first text of a column, which a model needs as `role`; `line` of the file, or row of a table."""

    column: str
    role: str
    line: int
    text: str


class TextCells:
    """Collects cells of a recording that hold text, and so count as missing, while it is read.

    Parameters
    ----------
    place : what a cell's line is called: `line` of a file, `row` of a table
    tell : takes what is to be said at once

    passed_over: how many records were no rows
    """

    def __init__(self, place: str = "line", tell: Callable[[str], None] = lambda why: None) -> None:
        self.place, self._tell = place, tell
        self._first: dict[str, TextCell] = {}
        self._numbers: dict[str, int] = {}
        self.passed_over = 0

    def add(self, column: str, role: str, line: int, value: object) -> None:
        """Take a cell without a number; one that is empty, or says that there is no value, is left alone."""
        if not isinstance(value, str):
            return
        text = value.strip()
        if text.lower() in NOTHING or is_not_finite(text):
            return
        self._numbers[column] = self._numbers.get(column, 0) + 1
        if column not in self._first:
            self._first[column] = TextCell(column=column, role=role, line=line, text=text)

    def pass_over(self, why: str) -> None:
        """Take a record that is no row, and is passed over; which is said of the first."""
        if not self.passed_over:
            self._tell(f"{why} The line is passed over.")
        self.passed_over += 1

    def sentences(self) -> tuple[str, ...]:
        """Say of each column which text came first, where, and how many cells of text it has; of many the first."""
        told = [self._sentence(item) for item in self._first.values()]
        more = len(told) - MOST
        return (*told[:MOST], f"so with {more} more columns") if more > 1 else tuple(told)

    def first(self, role: str) -> str:
        """Give the first text of what a model needs as that, with its line, to go on with; empty without one."""
        found = next((item for item in self._first.values() if item.role == role), None)
        return (
            f": {self.place} {found.line} of {found.column!r} has {found.text[:SHOWN]!r}" if found is not None else ""
        )

    def _sentence(self, item: TextCell) -> str:
        more = self._numbers[item.column] - 1
        is_time = item.role == "time"
        where = f"column {item.column!r}{'' if is_time else f' ({item.role})'}, {self.place} {item.line}"
        what, lost = ("time", "its row is not used") if is_time else ("number", "it counts as missing")
        if not is_time and item.text.lower() in SWITCHES:
            what = "number, write 1 or 0 for it"
        if more:
            lost = f"{lost}, and so with {more} more cell{'s' * (more > 1)} of text there"
        return f"{where}: {item.text[:SHOWN]!r} is no {what}; {lost}"
