"""Calls that do not need each other, as many at a time as there are processors.

Threads do, as compiled code runs without the interpreter's lock, and the recordings of a fit are about as long as each
other.
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
    return _pool().map(call, items) if len(items) > 1 and _processors() > 1 else map(call, items)


def in_background(call: Callable[[], R]) -> Callable[[], R]:
    """Begin a call beside what goes on, and give what waits for it; where there is one processor it begins then."""
    return _others().submit(call).result if _processors() > 1 else call


def _processors() -> int:
    """Give how many processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_processors(), thread_name_prefix="fit")


@cache
def _others() -> ThreadPoolExecutor:
    """Give threads for what was begun before it is needed, so that it is in the way of nothing else."""
    return ThreadPoolExecutor(_processors(), thread_name_prefix="begun")
