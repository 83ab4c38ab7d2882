"""Numbers that recorders write where they have no value, as -9999: taken for readings they raise an alarm."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.io.grid import PointBlock
from faultbond.model.graph import BondGraph, Input, Sensor
from faultbond.report.numbers import join, with_noun

NINES = re.compile(r"-?999+(\.9+)?")
TIMES = 3  # that it occurs
FAR = 0.25  # of the spread of all other values by which it lies beyond them


@dataclass(frozen=True, slots=True, kw_only=True)
class Marker:
    """A number in the unit of its column that stands for no value, and in how many samples it does."""

    column: Input | Sensor
    text: str
    times: int


def markers_in(graph: BondGraph, points: Iterable[PointBlock]) -> tuple[Marker, ...]:
    """Give numbers of nothing but nines that come again and lie far from all else in their column.

    Parameters
    ----------
    graph : the plant
    points : of the recording
    """
    ends: list[dict[float, int]] = [{} for _ in graph.instruments]
    for block in points:
        for of, values in zip(ends, np.concatenate([block.u, block.y], axis=1).T, strict=True):
            _take(of, values)
    found = (_marker(item, of) for item, of in zip(graph.instruments, ends, strict=True))
    return tuple(item for item in found if item is not None)


def _take(ends: dict[float, int], values: FloatArray) -> None:
    """Count more values (n,) of a column, of which no more are kept than the two lowest and the two highest."""
    known, times = np.unique(values[np.isfinite(values)], return_counts=True)
    for value, count in zip(known.tolist(), times.tolist(), strict=True):
        ends[value] = ends.get(value, 0) + count
    for value in sorted(ends)[2:-2]:
        del ends[value]


def _marker(column: Input | Sensor, ends: Mapping[float, int]) -> Marker | None:
    """Give what marks missing values in a column, of which the ends are known; None where nothing seems to."""
    if len(ends) < 2:
        return None
    low, *inner, high = sorted(ends)
    for value, others in ((low, (*inner, high)), (high, (low, *inner))):
        text = f"{column.unit.from_si(value):.9g}"
        away = min(abs(other - value) for other in others)
        if ends[value] >= TIMES and NINES.fullmatch(text) and away > FAR * (others[-1] - others[0]):
            return Marker(column=column, text=text, times=ends[value])
    return None


def marker_sentence(found: Sequence[Marker]) -> str:
    """Say which numbers seem to stand for no value; empty where none does."""
    if not found:
        return ""
    told = join([f"{item.column.name} is {item.text} in {with_noun(item.times, 'sample')}" for item in found])
    return (
        f"{told}: where that is how a recorder says that it has no value, leave such cells empty, or state the `range` "
        "beyond which there is none."
    )
