"""Slow errors of sensors that last as long as what alarms on healthy recordings.

A likelihood goes by single samples, of which errors that last one or two are as many as there are samples; those that
last a hundred are few, and what they gain is little. So the slow error that foretells best may be one of a sample or
two, much like noise, while what adds up to an alarm is one of minutes. Noise that hides that has to be several times as
large as an error that lasts.
"""

from math import hypot

import numpy as np

from faultbond.fit.imperfections import Imperfection, Kind
from faultbond.fit.trial import LASTING, ROOM, Health
from faultbond.model.graph import BondGraph, SlowError

LONGEST = 0.25  # of a recording: what stays longer is a parameter


def lasting_errors(graph: BondGraph, health: Health) -> tuple[tuple[Imperfection, SlowError | None], ...]:
    """Give slow errors of sensors that come too near to an alarm by their mean, each with the one that it replaces.

    As long as the highest climb of the sensor's sums took, and as large as its noise, or as what it replaces: that is
    as short as noise, and becomes part of it. None of a sensor whose slow error lasts already, is a part of what it
    reads, or goes with moves of an input.
    """
    known = {item.target: item for item in graph.slow_errors}
    found = []
    for j, (sensor, rate) in enumerate(zip(graph.sensors, health.rates, strict=False)):
        before, lasted, least = known.get(sensor.name), _lasted(health, j), LASTING * health.step
        is_other = before is not None and (before.memory >= least or before.relative or bool(before.after))
        if rate.peak <= ROOM or lasted is None or is_other:
            continue
        longest = LONGEST * min(float(np.ptp(item.time)) for item in health.records)
        new = Imperfection(
            kind=Kind.ABSOLUTE,
            place=sensor.name,
            is_sensor=True,
            size=max(sensor.noise, before.sd if before else 0.0),
            memory=min(max(lasted, least), longest),
        )
        found.append((new, before))
    return tuple(found)


def as_noise(noise: float, replaced: SlowError | None) -> float:
    """Give how many times as large a noise is together with a slow error that is as short."""
    return hypot(noise, replaced.sd) / noise if replaced is not None and noise > 0.0 else 1.0


def _lasted(health: Health, j: int) -> float | None:
    """Give how long the highest climb of the sums of sensor j took, s; None where that is one of its scatter."""
    most, lasted = 0.0, None
    for record, seen in zip(health.records, health.watches, strict=True):
        for side, sums in enumerate(seen.climbs[:, :, j]):
            top = int(np.argmax(sums))
            if not sums[top] > most:
                continue
            most = float(sums[top])
            began = int(np.flatnonzero(sums[: top + 1] <= 0.0)[-1]) if (sums[: top + 1] <= 0.0).any() else 0
            lasted = float(record.time[top] - record.time[began]) if side < 2 else None
    return lasted
