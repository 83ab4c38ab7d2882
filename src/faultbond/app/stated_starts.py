"""Recordings that begin where the model says that no plant does: `start` stated, of a plant that was in motion.

Filter and fit believe a stated start, so they lay what the plant then does to something else: of a current that had
long come to rest, begun at zero with an `sd` of next to nothing, the sensor was "stuck", more than 99.9 % sure, and a
fit found a lag and a curve.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.model.graph import BondGraph, Sensor
from faultbond.report.numbers import join, with_unit
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor

READINGS = 3  # of a sensor, the first, each of which by itself contradicts what is stated
FAR = 6.0  # sd with which each is expected
SOUGHT = 20  # samples in which a start that is not stated is sought
OPEN = 1e4  # times its variance as found: what was found beside a wrong start may be wrong


@dataclass(frozen=True, slots=True, kw_only=True)
class Contradiction:
    """A sensor's first reading, and what the stated start lets it be, with its sd, SI."""

    sensor: Sensor
    reading: float
    expected: float
    sd: float


def contradictions(graph: BondGraph, core: Core, samples: Sequence[Sample]) -> tuple[Contradiction, ...]:
    """Give sensors whose first readings are none of a plant that begins as stated; none where no start is stated.

    Parameters
    ----------
    graph : the plant
    core : of its model
    samples : the first of a recording
    """
    if all(item.start_sd is None for item in core.spec.states):
        return ()
    mean, variances = _begun(core, samples[:SOUGHT])
    lane, found = core.healthy_lane(mean, np.diag(variances)), []
    for sample in samples[:READINGS]:
        monitor = Monitor(core, quiet=True)
        monitor.go_on(lane)
        report = monitor.step(sample)
        found.append((sample.y, report.expected, np.sqrt(report.variance)))
    if len(found) < READINGS:
        return ()
    readings, expected, sd = np.moveaxis(np.array(found), 1, 0)
    far = np.all(np.abs(readings - expected) > FAR * sd, axis=0)  # what has no value is none
    return tuple(
        Contradiction(sensor=sensor, reading=reading, expected=said, sd=spread)
        for sensor, reading, said, spread, told in zip(
            graph.sensors, *(x[0].tolist() for x in (readings, expected, sd)), far, strict=True
        )
        if told
    )


def _begun(core: Core, samples: Sequence[Sample]) -> tuple[FloatArray, FloatArray]:
    """Give the states in which a plant begins, and their variances, (n_states,) each: stated, else sought."""
    stated = np.array([item.start_sd is not None for item in core.spec.states])
    mean, variances = np.array([item.start_mean for item in core.spec.states]), core.spec.stated_variances
    if stated.all():
        return mean, variances
    monitor = Monitor(core, quiet=True)
    rows = [row for row in map(monitor.pack, samples) if row is not None]  # none before every input has had a value
    sought, covariance = core.solve_start(np.array(rows).reshape(-1, core.spec.n_sample))
    spread = OPEN * np.diag(covariance)[: len(mean)] + sought**2
    return np.where(stated, mean, sought), np.where(stated, variances, spread)


def start_sentence(graph: BondGraph, recording: str, found: Sequence[Contradiction]) -> str:
    """Say that a recording does not begin as stated, and what to do; empty where it may."""
    if not found:
        return ""
    first, stores = found[0], join([item.name for item in graph.components if item.start is not None])
    unit = first.sensor.unit
    reading, said = (
        with_unit(unit.from_si(value), unit.text, sd=first.sd / unit.factor)
        for value in (first.reading, first.expected)
    )
    return (
        f"{recording} begins with {first.sensor.name} at {reading}, where the stated `start` of {stores} says {said}. "
        "If the plant was in motion, leave out `start`, and it is found from the first readings, or state an `sd` that "
        "is as large."
    )
