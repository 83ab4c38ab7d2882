"""Which inputs and sensors seem to lag, and which inputs seem to be another between rows, by what errors go with."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from faultbond.fit.foothold import Footing
from faultbond.fit.hints import LEAST_PART, answered, clear_part, explained, last_changes, told_early
from faultbond.fit.imperfections import KIND_HOLDS, Imperfection, Kind
from faultbond.fit.samples import HealthyRecording
from faultbond.model.graph import BondGraph, Input, Sensor
from faultbond.types import Hold

HINT = 5.0  # nats that a lag or a hold must seem to explain to be tried
ORDERS = (1, 2, 4, 8)  # of a lag
RESTLESS = 0.5  # of the rows, in which an input moves that is no command in steps


def late_ones(stand: Footing, records: Sequence[HealthyRecording]) -> list[tuple[Imperfection, float]]:
    """Give inputs and sensors that seem to lag, with about how many nats that explains, the best first.

    What lags by T is behind by about T times its rate: errors go with the last changes of what is expected of a
    sensor, or of an input. Where it lags already it does so otherwise: in several stages, or at a highest rate.
    """
    found: list[tuple[Imperfection, float]] = []
    for k, sensor in enumerate(stand.graph.sensors):
        parts = zip(stand.innovations, stand.expected, strict=True)
        gain = sum(explained(off[:, k], last_changes(expected[:, k])) for off, expected in parts)
        found += [(item, gain) for item in _ways(sensor)]
    for k, known in enumerate(stand.graph.inputs):
        gain = _gone_with(stand, records, k)
        found += [(item, gain) for item in _ways(known)]
    most = max((gain for _, gain in found), default=0.0)
    limits = tuple(_limits(stand.graph, records))  # where one is asked for, so is the lag that it has in it
    found = [(item, most if any(other.is_more_than(item) for other in limits) else gain) for item, gain in found]
    found += [(item, most) for item in limits]
    return sorted(found, key=lambda item: item[1], reverse=True)


def in_a_loop(
    stand: Footing, records: Sequence[HealthyRecording], direct: Sequence[Sequence[int]]
) -> frozenset[tuple[str, str]]:
    """Give the sensors that an input answers in the very row, as a controller's command does, each with that input.

    Such an input moves as far as the reading scatters, so it seems as if the sensor scattered after its moves. See
    `other_holds` for what is asked.
    """
    return frozenset(
        (sensor.name, item.name)
        for j, sensor in enumerate(stand.graph.sensors)
        for k, item in enumerate(stand.graph.inputs)
        if k not in direct[j] and _answers(stand, records, j, k) > HINT
    )


def _answers(stand: Footing, records: Sequence[HealthyRecording], j: int, k: int) -> float:
    parts = zip(stand.innovations, records, strict=True)
    return sum(answered(off[:, j], record.u[:, k]) for off, record in parts)


def _ways(item: Input | Sensor) -> list[Imperfection]:
    """Give the ways in which an input or a sensor may come behind, or come behind otherwise."""
    lag = Imperfection(kind=Kind.LAG, place=item.name, is_sensor=isinstance(item, Sensor))
    if not item.lag:
        return [lag]
    fewer, more = [n for n in ORDERS if n < item.order][-1:], [n for n in ORDERS if n > item.order][:1]
    return [replace(lag, kind=Kind.ORDER, size=float(order)) for order in (*fewer, *more)]


def _limits(graph: BondGraph, records: Sequence[HealthyRecording]) -> Iterator[Imperfection]:
    """Give the highest rates of inputs that are commands, each as large as the largest move from row to row.

    What is off by a noise, or goes linearly, is measured, and no command. A long way at such a rate goes with changes
    of the command long ago, so those of a few rows hardly tell; what comes behind elsewhere may be it.
    """
    for k, item in enumerate(graph.inputs):
        rates = [np.abs(np.diff(record.u[:, k])) / np.diff(record.time) for record in records]
        most = max(float(np.max(rate, initial=0.0)) for rate in rates)
        if not (item.rate_limit or item.linear or item.noise) and most > 0.0:
            yield Imperfection(kind=Kind.RATE_LIMIT, place=item.name, size=most)


def other_holds(
    stand: Footing, records: Sequence[HealthyRecording], direct: Sequence[Sequence[int]]
) -> list[Imperfection]:
    """Give inputs that seem to be another between two rows than the model says, the likeliest first.

    One that moves all the time may go on linearly. Where a sensor moves in the very row of a change, which it cannot
    feel yet, a row holds what acted until then.

    Parameters
    ----------
    stand : where the search stands
    records : to which it was fitted
    direct : for each sensor the inputs that it feels at once
    """
    found = []
    for k, item in enumerate(stand.graph.inputs):
        moves = float(np.mean(np.concatenate([np.diff(record.u[:, k]) != 0.0 for record in records])))
        gains = {Kind.HOLD: _gone_with(stand, records, k) if moves > RESTLESS else 0.0}
        gains[Kind.NEXT] = sum(nats for seen in _in_the_row(stand, records, direct, k) for nats, _ in seen)
        found += [
            (gain, Imperfection(kind=kind, place=item.name))
            for kind, gain in gains.items()
            if gain > HINT and item.hold is not KIND_HOLDS[kind]
        ]
    return [item for _, item in sorted(found, key=lambda one: one[0], reverse=True)]


def held_late(
    stand: Footing, records: Sequence[HealthyRecording], direct: Sequence[Sequence[int]]
) -> list[Imperfection]:
    """Give inputs whose rows clearly hold what acted until then: a sensor moves in the very row, as `check` tells it.

    Where a model lacks something else a sensor may seem to, a little. Of the arguments see `other_holds`.
    """
    return [
        Imperfection(kind=Kind.NEXT, place=item.name)
        for k, item in enumerate(stand.graph.inputs)
        if item.hold is not Hold.NEXT
        and any(clear_part(seen) > LEAST_PART for seen in _in_the_row(stand, records, direct, k))
    ]


def _in_the_row(
    stand: Footing, records: Sequence[HealthyRecording], direct: Sequence[Sequence[int]], k: int
) -> Iterator[list[tuple[float, int]]]:
    """Give what each sensor that does not feel input k at once says of moves in its very row, see `told_early`."""
    for j in range(len(stand.graph.sensors)):
        if k not in direct[j]:
            parts = zip(stand.innovations, records, strict=True)
            yield [told_early(off[:, j], float(stand.ways[j, k]), record.u[:, k]) for off, record in parts]


def _gone_with(stand: Footing, records: Sequence[HealthyRecording], k: int) -> float:
    """Give about how many nats the last changes of input k explain."""
    parts = zip(stand.innovations, (record.u[:, k] for record in records), strict=True)
    return sum(explained(column, last_changes(u)) for off, u in parts for column in off.T)
