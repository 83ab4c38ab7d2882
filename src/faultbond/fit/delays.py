"""Which inputs and sensors seem to lag, and which inputs seem to be another between rows, by what errors go with."""

from collections.abc import Sequence

import numpy as np

from faultbond.fit.foothold import Footing
from faultbond.fit.hints import explained, last_changes, told_early
from faultbond.fit.imperfections import KIND_HOLDS, Imperfection, Kind
from faultbond.fit.samples import HealthyRecording

HINT = 5.0  # nats that a lag or a hold must seem to explain to be tried
RESTLESS = 0.5  # of the rows, in which an input moves that is no command in steps


def late_ones(stand: Footing, records: Sequence[HealthyRecording]) -> list[tuple[Imperfection, float]]:
    """Give inputs and sensors that seem to lag, with about how many nats that explains, the best first.

    What lags by T is behind by about T times its rate: errors go with the last changes of what is expected of a
    sensor, or of an input.
    """
    found = []
    for k, sensor in enumerate(stand.graph.sensors):
        parts = zip(stand.innovations, stand.expected, strict=True)
        gain = sum(explained(off[:, k], last_changes(expected[:, k])) for off, expected in parts)
        found.append((Imperfection(kind=Kind.LAG, place=sensor.name, is_sensor=True), gain))
    for k, item in enumerate(stand.graph.inputs):
        found.append((Imperfection(kind=Kind.LAG, place=item.name), _gone_with(stand, records, k)))
    return sorted(found, key=lambda item: item[1], reverse=True)


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
        gains[Kind.NEXT] = sum(
            told_early(off[:, j], float(stand.ways[j, k]), record.u[:, k])[0]
            for off, record in zip(stand.innovations, records, strict=True)
            for j in range(off.shape[1])
            if k not in direct[j]
        )
        found += [
            (gain, Imperfection(kind=kind, place=item.name))
            for kind, gain in gains.items()
            if gain > HINT and item.hold is not KIND_HOLDS[kind]
        ]
    return [item for _, item in sorted(found, key=lambda one: one[0], reverse=True)]


def _gone_with(stand: Footing, records: Sequence[HealthyRecording], k: int) -> float:
    """Give about how many nats the last changes of input k explain."""
    parts = zip(stand.innovations, (record.u[:, k] for record in records), strict=True)
    return sum(explained(column, last_changes(u)) for off, u in parts for column in off.T)
