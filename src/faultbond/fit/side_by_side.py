"""Calls that do not need each other, as many at a time as there are processors.

Threads do, as compiled code runs without the interpreter's lock. The recordings of a fit are filtered at once, and so
are the filters of each, as there may be more processors than recordings, and recordings of other lengths.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import TypeVar

T = TypeVar("T")
R = TypeVar("R")


def side_by_side(call: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
    """Give what a call gives of each item, in order; where one fails, those that had not begun are not begun."""
    return _at_once("fit", call, items)


def parts_side_by_side(call: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
    """Give the same of calls that are parts of one that may itself be one of several; they must do without others.

    They have threads of their own: where all of `side_by_side` wait for their parts, these still run.
    """
    return _at_once("part", call, items)


def in_background(call: Callable[[], R]) -> Callable[[], R]:
    """Begin a call beside what goes on, and give what waits for it; where there is one processor it begins then."""
    return _threads("begun").submit(call).result if _processors() > 1 else call


def _at_once(threads: str, call: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
    return _threads(threads).map(call, items) if len(items) > 1 and _processors() > 1 else map(call, items)


def _processors() -> int:
    """Give how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _threads(name: str) -> ThreadPoolExecutor:
    """Give threads by what they are for: those that begin what is needed later are in the way of nothing else."""
    return ThreadPoolExecutor(_processors(), thread_name_prefix=name)
