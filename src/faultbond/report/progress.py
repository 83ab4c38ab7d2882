"""A progress bar on standard error; it leaves nothing behind."""

from collections.abc import Callable, Iterable, Iterator, Sized
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn

_Item = TypeVar("_Item", bound=Sized)
REFRESH = 64  # rows between two updates


@contextmanager
def progress_bar(total: int | None) -> Iterator[Callable[[Iterable[_Item]], Iterator[_Item]]]:
    """Show that the engine is being built, then how many of the rows are done.

    Parameters
    ----------
    total : number of rows; None: not known

    Returns
    -------
    a function that passes blocks of rows on and counts their rows
    """
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("building the engine", total=None)

        def follow(items: Iterable[_Item]) -> Iterator[_Item]:
            bar.update(task, description="watching", total=total)
            number = shown = 0
            for item in items:
                yield item
                number += len(item)
                if number - shown >= REFRESH:
                    bar.update(task, completed=number)
                    shown = number

        yield follow
