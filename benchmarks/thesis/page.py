"""What stands on the page: what the thesis prints or says beside what the program gives, in tables, below figures."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeAlias

import sympy as sp

from benchmarks.shared.page import as_markdown
from benchmarks.thesis.chart import Panel, draw

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "images" / "thesis"
HEADER = ("", "thesis", "faultbond", "remark")
COLUMNS = ("", "thesis", "classic", "bank", "remark")
NOT_PRINTED = "-"
SAME, DIFFERS = "same", "differs: "

Value: TypeAlias = "int | float | Fraction | sp.Expr"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """One value of the thesis beside ours, or one thing that it says of a figure.

    bank : of figures, what method `bank` gives; `ours` is then of `classic`
    same : whether ours agrees, a number to the digits that are printed; None where there is nothing to compare with
    remark : what else is to be known. otherwise : where a difference comes from, shown only where there is one
    """

    what: str
    printed: str
    ours: str
    bank: str | None = None
    same: bool | None
    remark: str = ""
    otherwise: str = ""

    def __post_init__(self) -> None:
        if self.same is False and not (self.remark or self.otherwise):
            raise ValueError(f"{self.what}: {self.ours}, printed {self.printed}, and no remark says why")

    @property
    def cells(self) -> tuple[str, ...]:
        """What is printed of it."""
        verdict = SAME if self.same else f"{DIFFERS}{self.otherwise}" if self.same is False and self.otherwise else ""
        values = (self.ours,) if self.bank is None else (self.ours or NOT_PRINTED, self.bank or NOT_PRINTED)
        return self.what, self.printed or NOT_PRINTED, *values, "; ".join(filter(None, (verdict, self.remark)))


@dataclass(frozen=True, slots=True)
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
        place = f"Thesis {self.source}. {self.words}"
        return "\n\n".join(filter(None, (f"### {self.title}", place, table, self.after)))


@dataclass(frozen=True, slots=True, eq=False)
class Figure:
    """A figure under its number, `5.13`; caption : in our words. words : what was done, where it is not plain."""

    number: str
    caption: str
    source: str
    panels: tuple[Panel, ...]
    rows: tuple[Line, ...]
    words: str = ""
    columns: int = 2

    @property
    def name(self) -> str:
        """Name of the picture."""
        return f"figure_{self.number.replace('.', '_')}.svg"

    @property
    def picture(self) -> str:
        """The SVG."""
        return draw(self.panels, self.columns)

    @property
    def text(self) -> str:
        """The figure in Markdown, with its heading."""
        image = f"![{self.caption}](images/thesis/{self.name})"
        place = f"Thesis {self.source}. {self.words}".strip()
        table = as_markdown(COLUMNS, [row.cells for row in self.rows])
        return f"### Figure {self.number}: {self.caption}\n\n{place}\n\n{image}\n\n{table}"


Shown = Table | Figure
Parts = Iterator[str | Line | Panel]
P = ParamSpec("P")


def table(source: str) -> Callable[[Callable[P, Parts]], Callable[P, Table]]:
    """Make a table of a function that yields its words, its lines and what stands below; its docstring is the title."""

    def make(parts: Callable[P, Parts]) -> Callable[P, Table]:
        @wraps(parts)
        def whole(*given: P.args, **named: P.kwargs) -> Table:
            words, *found = parts(*given, **named)
            lines = tuple(item for item in found if isinstance(item, Line))
            after = "".join(item for item in found if isinstance(item, str))
            return Table(_doc(parts), source, str(words), lines, after)

        return whole

    return make


def figure(source: str, columns: int = 2) -> Callable[[Callable[[], Parts]], Callable[[], Figure]]:
    """Make figure 5.13 of a function `figure_5_13` that yields words, panels, lines; its docstring is the caption."""

    def make(parts: Callable[[], Parts]) -> Callable[[], Figure]:
        @wraps(parts)
        def whole() -> Figure:
            number, caption = parts.__name__.removeprefix("figure_").replace("_", "."), _doc(parts)
            return drawn(number, caption[0].lower() + caption[1:], source, parts(), columns)

        return whole

    return make


def drawn(number: str, caption: str, source: str, parts: Parts, columns: int = 2) -> Figure:
    """Make a figure of its words, panels and lines."""
    found = list(parts)
    panels = tuple(item for item in found if isinstance(item, Panel))
    rows = tuple(item for item in found if isinstance(item, Line))
    words = "".join(item for item in found if isinstance(item, str))
    return Figure(number, caption, source, panels, rows, words, columns)


def _doc(parts: Callable[P, Parts]) -> str:
    return (parts.__doc__ or "").removesuffix(".")


def write_pictures(shown: Sequence[Shown]) -> None:
    """Write the pictures of those that have one."""
    for item in shown:
        if isinstance(item, Figure):
            (FOLDER / item.name).write_text(item.picture, encoding="utf-8")


def as_text(shown: Iterable[Shown]) -> str:
    """Give tables and figures one below the other."""
    return "\n\n".join(item.text for item in shown)


def row(
    text: str, classic: str = "", bank: str = "", *, same: bool | None = None, remark: str = "", otherwise: str = ""
) -> Line:
    """Give a line of a figure; text : what is compared, and, behind ` | `, what the thesis says of it."""
    (what, _, printed), told = text.partition(" | "), None if same is None else bool(same)
    return Line(what=what, printed=printed, ours=classic, bank=bank, same=told, remark=remark, otherwise=otherwise)


def short(value: float) -> str:
    """Write a number to three digits as the thesis does: 4.45e11."""
    return f"{value:.3g}".replace("e+", "e").replace("e-0", "e-")


def percent(value: float, digits: int = 0) -> str:
    """Write a part as per cent."""
    return f"{100 * value:.{digits}f} %"


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
