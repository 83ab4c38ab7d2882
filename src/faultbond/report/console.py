"""Headings, labelled lines and tables on a terminal; the same in every listing."""

from collections.abc import Iterable, Sequence

from rich import box
from rich.console import Console
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

PLAIN_WIDTH = 100  # columns where the output is a file or a pipe


def set_width(console: Console) -> None:
    """Set a console that is no terminal to `PLAIN_WIDTH` columns."""
    if not console.is_terminal:
        console.width = PLAIN_WIDTH


def headline(console: Console, name: str, file: str) -> None:
    """Print what a listing is about: a model and its file."""
    set_width(console)
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


def lines(console: Console, items: Iterable[tuple[str, str]]) -> None:
    """Print labels and texts that wrap beside them."""
    grid = Table.grid(padding=(0, 2))
    grid.add_column(style="dim", no_wrap=True)
    grid.add_column(overflow="fold")
    for label, text in items:
        grid.add_row(Text(label), Text(text))
    console.print(Padding(grid, (0, 0, 0, 1)))


def under(label: str, texts: Iterable[str]) -> list[tuple[str, str]]:
    """Give lines for several texts under one label."""
    return [(label if k == 0 else "", text) for k, text in enumerate(texts)]


def bare_table() -> Table:
    """Give a table without columns, in the style of all."""
    return Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), header_style="dim")


def table(console: Console, header: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table."""
    made = bare_table()
    for name in header:
        made.add_column(name, overflow="fold")
    for row in rows:
        made.add_row(*(Text(cell) for cell in row))
    console.print(made)


def print_refusal(console: Console, heading: str, message: str) -> None:
    """Print that a section cannot be told."""
    title(console, heading[0].upper() + heading[1:])
    lines(console, [("cannot be told", message)])
