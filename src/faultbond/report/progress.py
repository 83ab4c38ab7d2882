"""A progress bar on standard error; it leaves nothing behind."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, Progress, SpinnerColumn, TaskProgressColumn, TextColumn, TimeRemainingColumn

_Item = TypeVar("_Item")
REFRESH = 64  # items between two updates


@contextmanager
def progress_bar(total: int | None) -> Iterator[Callable[[Iterable[_Item]], Iterator[_Item]]]:
    """Show that the engine is being built, then how many of the items are done.

    Parameters
    ----------
    total : number of items; None: not known

    Returns
    -------
    a function that passes items on and counts them
    """
    columns = (SpinnerColumn(), TextColumn("{task.description}"), BarColumn(), TaskProgressColumn())
    with Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("building the engine", total=None)

        def follow(items: Iterable[_Item]) -> Iterator[_Item]:
            bar.update(task, description="watching", total=total)
            for number, item in enumerate(items, start=1):
                yield item
                if number % REFRESH == 0:
                    bar.update(task, completed=number)

        yield follow
