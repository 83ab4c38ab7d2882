"""Numbers that recorders write where they have no value, as -9999: taken for readings they raise an alarm."""

import re
from collections.abc import Iterable, Sequence
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
    blocks = [np.concatenate([block.u, block.y], axis=1) for block in points]
    if not blocks:
        return ()
    columns: tuple[Input | Sensor, ...] = (*graph.inputs, *graph.sensors)
    found = (_marker(item, values) for item, values in zip(columns, np.concatenate(blocks).T, strict=True))
    return tuple(item for item in found if item is not None)


def _marker(column: Input | Sensor, values: FloatArray) -> Marker | None:
    """Give what marks missing values in a column (n_samples,) of SI; None where nothing seems to."""
    known, times = np.unique(values[np.isfinite(values)], return_counts=True)
    if len(known) < 2:
        return None
    for k in (0, len(known) - 1):
        others = np.delete(known, k)
        if times[k] < TIMES:
            continue
        text = f"{column.unit.from_si(float(known[k])):.9g}"
        away = float(np.min(np.abs(others - known[k])))
        if NINES.fullmatch(text) and away > FAR * float(np.ptp(others)):
            return Marker(column=column, text=text, times=int(times[k]))
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
