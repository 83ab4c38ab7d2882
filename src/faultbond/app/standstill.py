"""Sensors that stood still to the last digit for long: stuck they may be, where their noise is too large to tell."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.app.presence import SHARE_OF_SILENCE
from faultbond.arrays import FloatArray
from faultbond.io.frozen import FINE, FROZEN_AFTER
from faultbond.io.grid import PointBlock
from faultbond.model.graph import BondGraph, Sensor
from faultbond.report.numbers import clock_text, figure, join, unit_text


@dataclass(frozen=True, slots=True, kw_only=True)
class Standstill:
    """A sensor that read the same `value`, SI, from `since` to `until`, s."""

    sensor: Sensor
    value: float
    since: float
    until: float


def standing_still(graph: BondGraph, points: Iterable[PointBlock]) -> tuple[Standstill, ...]:
    """Give sensors of which the longest run of one value is a tenth of the recording or more.

    As in the count of frozen values a sensor must have moved by much less than its declared noise, and have repeated
    itself often.

    Parameters
    ----------
    graph : the plant
    points : of the recording
    """
    blocks = [(block.time, block.y) for block in points]
    time, y = (np.concatenate(part) for part in zip(*blocks, strict=True))
    found = (_longest(sensor, time, y[:, k]) for k, sensor in enumerate(graph.sensors))
    return tuple(item for item in found if item is not None)


def _longest(sensor: Sensor, time: FloatArray, read: FloatArray) -> Standstill | None:
    """Give the longest run of one value in what a sensor read (n,), nan where nothing; None where it is no matter."""
    there = np.flatnonzero(np.isfinite(read))
    steps = np.abs(np.diff(read[there]))
    moved = np.flatnonzero(steps)
    if not len(moved) or steps[moved].min() >= FINE * sensor.noise:
        return None
    ends = np.append(moved, len(there) - 1)  # the last value of each run
    begins = np.append(0, moved + 1)
    k = int(np.argmax(ends - begins))
    first, last = there[begins[k]], there[ends[k]]
    if ends[k] - begins[k] + 1 < max(FROZEN_AFTER, len(time) / SHARE_OF_SILENCE):
        return None
    return Standstill(sensor=sensor, value=float(read[first]), since=float(time[first]), until=float(time[last]))


def standstill_sentence(found: Sequence[Standstill]) -> str:
    """Say which sensors stood still, where, and when; empty where none did."""
    if not found:
        return ""
    told = join([_words(item) for item in found])
    return (
        f"{told}: stuck, unless nothing moved then. A sensor that is stuck is found once what it should show is off by "
        "more than its declared noise."
    )


def _words(item: Standstill) -> str:
    unit = item.sensor.unit
    value = f"{figure(unit.from_si(item.value)).number()} {unit_text(unit.text)}".rstrip()
    return (
        f"{item.sensor.name} read {value}, the same to the last digit, from {clock_text(item.since)} to "
        f"{clock_text(item.until)}"
    )
