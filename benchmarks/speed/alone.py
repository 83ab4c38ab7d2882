"""The filters of a bank alone: the lanes of a monitor, taken through its last samples, and nothing else."""

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.shared.told import relinearised
from benchmarks.shared.turns import Work
from faultbond.arrays import FloatArray
from faultbond.runtime.core import LANES, at
from faultbond.runtime.monitor import Monitor

TOGETHER = 8 * LANES  # lanes of one call: as near to each other in memory as in the core, and few calls


def filters_alone(monitor: Monitor, count: int) -> Work:
    """Give the work of the last `count` samples on all filters of a bank, sample by sample as they come."""
    last = int(monitor.number("clock.index"))
    rows = relinearised(monitor.spec, np.array([monitor.row(k)[0] for k in range(last - count, last)]))
    return Work(prepare=partial(_lanes, monitor), run=partial(_advance, monitor, rows), count=count)


def n_filters(monitor: Monitor) -> int:
    """Give the number of filters of a bank."""
    return len(monitor.numbers("bank.sums")) // (2 * len(monitor.spec.outputs))


def _lanes(monitor: Monitor) -> list[FloatArray]:
    """Give the lanes in groups that a call takes, (n_numbers, TOGETHER)."""
    lanes = [monitor.lane(k) for k in range(n_filters(monitor))]
    groups: list[list[FloatArray]] = []
    for lane in lanes:
        if not groups or len(groups[-1]) == TOGETHER or len(groups[-1][0]) != len(lane):
            groups.append([])
        groups[-1].append(lane)
    return [np.ascontiguousarray(np.array(_filled(group)).T) for group in groups]


def _filled(group: list[FloatArray]) -> list[FloatArray]:
    """Fill a group up to whole blocks by its first lane."""
    return group + group[:1] * (-len(group) % LANES)


def _advance(monitor: Monitor, rows: FloatArray, groups: list[FloatArray]) -> None:
    library, work, n_plain = monitor.core.library, at(monitor.core.work), monitor.spec.n_numbers
    innovations = np.empty((2 * len(monitor.spec.outputs), TOGETHER))
    calls: list[Callable[[int], object]] = []
    for group in groups:
        call = library.fb_advance_plain if len(group) == n_plain else library.fb_advance_wide
        calls.append(partial(_call, call, group.shape[1], at(group), at(innovations), work))
    for row in rows:
        sample = at(row)
        for advance in calls:
            advance(sample)


def _call(call: Callable[..., object], n: int, numbers: int, innovations: int, work: int, sample: int) -> None:
    call(n, 1, sample, numbers, innovations, work)
