"""Lines that compare what the thesis prints with what the program gives, and their tables in Markdown."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Protocol, TypeAlias

import sympy as sp

from benchmarks.shared.page import as_markdown

HEADER = ("", "thesis", "faultbond", "remark")
NOT_PRINTED = "-"
SAME = "same"

Value: TypeAlias = "int | float | Fraction | sp.Expr"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One value of the thesis beside ours.

    same : whether the two agree, to the digits that are printed; None where the thesis prints nothing, or only words
    remark : needed where they do not agree
    """

    what: str
    printed: str
    ours: str
    same: bool | None
    remark: str = ""

    def __post_init__(self) -> None:
        if self.same is False and not self.remark:
            raise ValueError(f"{self.what}: {self.ours}, printed {self.printed}, and no remark says why")

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """What is printed of it."""
        verdict = SAME if self.same else ""
        return self.what, self.printed or NOT_PRINTED, self.ours, "; ".join(filter(None, (verdict, self.remark)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """A table of the thesis, or what a section says, under its own number.

    source : sections and pages of the thesis. words : the system, its file, and what has to be known
    after : text below the table, such as a formula
    """

    title: str
    source: str
    words: str
    lines: tuple[Line, ...]
    after: str = ""

    @property
    def text(self) -> str:
        """The table in Markdown, with its heading."""
        table = as_markdown(HEADER, [line.cells for line in self.lines])
        return "\n\n".join(
            filter(None, (f"### {self.title}", f"Thesis {self.source}. {self.words}", table, self.after))
        )


class Shown(Protocol):
    """A table or a figure."""

    @property
    def text(self) -> str:
        """What stands on the page, in Markdown, with its heading."""


def as_text(tables: Iterable[Shown]) -> str:
    """Give tables and figures one below the other."""
    return "\n\n".join(table.text for table in tables)


def words(what: str, printed: str, ours: str, remark: str = "") -> Line:
    """Give a line of words, or of something that the thesis does not print; a reader compares."""
    return Line(what=what, printed=printed, ours=ours, same=None, remark=remark)


def equal(what: str, printed: str, ours: str, remark: str = "", *, same: bool | None = None) -> Line:
    """Give a line of texts that are to be the same, letter by letter unless `same` tells."""
    return Line(what=what, printed=printed, ours=ours, same=printed == ours if same is None else same, remark=remark)


def number(what: str, printed: str, value: Value, remark: str = "") -> Line:
    """Give a line of numbers: exact where the thesis prints a fraction, else to the digits that it prints."""
    same = is_printed(printed, value) if printed else None
    return Line(what=what, printed=printed, ours=value_text(value), same=same, remark=remark)


def numbers(what: str, printed: Sequence[str], values: Sequence[Value], remark: str = "") -> Line:
    """Give a line of several numbers."""
    pairs = zip(printed, values, strict=False)
    same = len(printed) == len(values) and all(is_printed(text, value) for text, value in pairs)
    ours = ", ".join(value_text(value) for value in values)
    return Line(what=what, printed=", ".join(printed), ours=ours, same=same if printed else None, remark=remark)


def sets(
    what: str, printed: Sequence[Iterable[str]], ours: Sequence[Iterable[str]], remark: str = "", order: str = ""
) -> Line:
    """Give a line of sets of names; order: of the names in a set, parted by blanks."""
    same = {frozenset(item) for item in printed} == {frozenset(item) for item in ours} if printed else None
    return Line(what=what, printed=sets_text(printed, order), ours=sets_text(ours, order), same=same, remark=remark)


def sets_text(given: Iterable[Iterable[str]], order: str = "") -> str:
    """Write sets; a tuple in its order, another set in that of `order` or of the alphabet."""
    return ", ".join(set_text(item, order) for item in given)


def set_text(names: Iterable[str], order: str = "") -> str:
    """Write a set."""
    places = {name: k for k, name in enumerate(order.split())}
    listed = names if isinstance(names, tuple) else sorted(names, key=lambda name: (places.get(name, 0), name))
    return f"{{{', '.join(listed)}}}"


def is_printed(printed: str, value: Value) -> bool:
    """Whether a value is the printed one: equal to a fraction, within half a unit of the last digit of a decimal."""
    wanted = printed_value(printed)
    if "." not in printed:
        return bool(sp.simplify(sp.sympify(value) - sp.Rational(wanted)) == 0)
    unit = Fraction(1, 10 ** len(printed.partition(".")[2]))
    return abs(Fraction(float(value)) - wanted) <= unit * Fraction(1001, 2000)


def printed_value(printed: str) -> Fraction:
    """Read a number as the thesis prints it: 8, 2.6368, 18/7, -5 1/3."""
    whole, _, part = printed.rpartition(" ")
    size = Fraction(part) if not whole else abs(Fraction(whole)) + Fraction(part)
    return -size if whole.startswith("-") else size


def value_text(value: Value) -> str:
    """Write a number: fractions and roots as they are, with their decimals; floating point to five digits."""
    if isinstance(value, float):
        return f"{value:.5g}"
    exact = sp.sympify(value)
    if exact.is_Integer:
        return str(exact)
    decimals = f"{float(exact):.5g}"
    is_whole = exact.is_Rational and sp.Rational(decimals) == exact
    return f"{exact} {'=' if is_whole else '≈'} {decimals}"
