"""Headings, labelled lines and tables on a terminal; the same in every listing."""

import re
import textwrap
from collections.abc import Callable, Collection, Iterable, Sequence
from typing import IO, Any, cast

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from faultbond.report.numbers import NO_BREAK, kept_together

LONG_WORD = 24  # columns of a word that is broken where there is too little room
PLAIN_WIDTH = 100  # columns where the output is a file or a pipe
MOST_LABEL = 0.45  # of the width; of a label that is longer the rest stands below


class _Trimmed:
    """A file in which no line ends with blanks, as a table's and a paragraph's do on a terminal."""

    def __init__(self, file: IO[str]) -> None:
        self._file = file

    def write(self, text: str) -> int:
        """Write whole lines."""
        return self._file.write(re.sub(" +$", "", text, flags=re.MULTILINE))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._file, name)


def set_plain(console: Console) -> None:
    """Set a console that is no terminal to `PLAIN_WIDTH` columns, and let no line there end with blanks."""
    if console.is_terminal:
        return
    console.width = PLAIN_WIDTH
    if not isinstance(console.file, _Trimmed):
        console.file = cast(IO[str], _Trimmed(console.file))


def headline(console: Console, name: str, file: str) -> None:
    """Print what a listing is about: a model and its file."""
    set_plain(console)
    console.print(Text.assemble((name, "bold"), (f"  {file}", "dim")))


def facts(console: Console, items: Iterable[tuple[str, str]]) -> None:
    """Print what was watched: labels of the same width, and texts."""
    for label, text in items:
        console.print(Text.assemble((f"{label:<9}", "dim"), text), highlight=False)
    console.print()


def title(console: Console, text: str, note: str = "") -> None:
    """Print the heading of a section."""
    console.print()
    console.print(Text.assemble((text, "bold underline"), (f"  {note}" if note else "", "dim")))


def lines(console: Console, items: Iterable[tuple[str, str]], style: str = "") -> None:
    """Print labels and texts that wrap beside them, these in a style; long labels wrap too and leave the texts room."""
    items = list(items)
    longest = max((cell_len(label) for label, _ in items), default=0)
    width = min(longest, int(MOST_LABEL * console.width))
    edge, gap = 1, 2
    grid = Table.grid(padding=(0, gap))
    grid.add_column(style="dim", overflow="fold", width=width)
    grid.add_column(overflow="fold")
    for label, text in items:
        grid.add_row(Text(label), Text(wrapped(text, console.width - edge - width - gap), style=style))
    console.print(Padding(grid, (0, 0, 0, edge)))


def wrapped(text: str, width: int) -> str:
    """Put a text into lines of so many columns, broken between words only; each line that it has stays one."""
    return "\n".join(map(_filled(max(width, 1)), kept_together(text).split("\n"))).replace(NO_BREAK, " ")


def _filled(width: int) -> Callable[[str], str]:
    """Give what breaks a line where it is longer than a width."""
    wrapper = textwrap.TextWrapper(
        width, expand_tabs=False, replace_whitespace=False, break_long_words=False, break_on_hyphens=False
    )
    return wrapper.fill


def under(label: str, texts: Iterable[str]) -> list[tuple[str, str]]:
    """Give lines for several texts under one label."""
    return [(label if k == 0 else "", text) for k, text in enumerate(texts)]


def table(
    console: Console,
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    *,
    right: Collection[str] = (),
    whole: Collection[str] = (),
    styles: Sequence[str] = (),
) -> None:
    """Print a table, its texts wrapped between words; where it is too wide for that, a block of lines for each row.

    Parameters
    ----------
    console : where to print
    header : names of the columns
    rows : their texts
    right, whole : columns that stand at the right, and those that are not wrapped
    styles : of each row; none: no row has one
    """
    body = [tuple(row) for row in rows]
    style_of = [*styles, *[""] * (len(body) - len(styles))]
    for padding in (1, 0):  # columns that stand nearer to each other before there is no table at all
        gaps = (len(header) - 1) * (1 + 2 * padding)
        widths = _widths(header, body, whole, console.width - 2 - gaps)  # one column is left free at each side
        if widths is not None:
            break
    else:
        for row, style in zip(body, style_of, strict=True):
            if row[0]:
                console.print()
            lines(console, [(name, text) for name, text in zip(header, row, strict=True) if text], style)
        return
    made = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, padding), header_style="dim")
    for name, width in zip(header, widths, strict=True):
        made.add_column(name, justify="right" if name in right else "left", overflow="fold", width=width)
    for row, style in zip(body, style_of, strict=True):
        made.add_row(*(Text(wrapped(cell, width)) for cell, width in zip(row, widths, strict=True)), style=style)
    console.print(made)


def _widths(
    header: Sequence[str], rows: Sequence[Sequence[str]], whole: Collection[str], room: int
) -> list[int] | None:
    """Give the width of each column with which only very long words are broken; None: there is too little room."""
    wanted, least = [], []
    for name, *cells in zip(header, *rows, strict=True):
        lines_ = [line for cell in (name, *cells) for line in cell.splitlines()]
        words = [word for line in lines_ for word in kept_together(line).split(" ")]
        wanted.append(max(map(cell_len, lines_), default=1))
        least.append(wanted[-1] if name in whole else min(max(map(cell_len, words), default=1), LONG_WORD))
    if sum(wanted) <= room:
        return wanted
    if sum(least) > room:
        return None
    spare, missing = room - sum(least), sum(wanted) - sum(least)
    return [few + spare * (many - few) // missing for few, many in zip(least, wanted, strict=True)]


def print_refusal(console: Console, heading: str, message: str) -> None:
    """Print that a section cannot be told."""
    title(console, heading[0].upper() + heading[1:])
    lines(console, [("cannot be told", message)])
