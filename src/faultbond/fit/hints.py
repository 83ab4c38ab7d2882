"""What errors of a model look like: they come with changes of an input, or a sensor moves the other way round.

What lags by T is behind by about T times its rate, so errors go with the last changes of what it follows. Where
rows hold what acted until then, and not from then on, a sensor moves in the row of the change itself. Where a bond or a
sign is turned round, the plant alone moves against the readings.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.fit.innovations import Watch
from faultbond.fit.samples import HealthyRecording

BEHIND = 6  # samples
AGO = (0, 1, 3, 7, 15, 31, 63)  # samples; changes between one and the next are summed up
CLEAR = 30.0  # nats that changes of an input must explain
LEAST_PART = 0.03  # of the scatter of the errors, and
FADED = 0.5  # part of the largest error that is left of it at the end
WINDOWS = (1, 4, 16, 64)  # samples over which moves are compared
MOVES = 3.0  # times the noise of a sensor: a move that is one
AGAINST = -0.5  # correlation of moves that are turned round


@dataclass(frozen=True, slots=True, kw_only=True)
class Late:
    """A sensor that follows the changes of an input later than the model says.

    part: of the scatter of its errors. by: how much later, s; None: that does not show.
    """

    sensor: str
    of: str
    part: float
    by: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Early:
    """A sensor that moves in the very row in which an input does, which it cannot feel yet by the model.

    part: of the scatter of its errors.
    """

    sensor: str
    of: str
    part: float


def last_changes(course: FloatArray) -> FloatArray:
    """Give the last changes of something (N,), the newest first, (N, n)."""
    change = np.diff(course, prepend=course[:1])
    return np.column_stack([np.concatenate([np.zeros(lag), change[: len(change) - lag]]) for lag in range(BEHIND)])


def _changes_ago(course: FloatArray) -> FloatArray:
    """Give how far something (N,) has moved in spans of the past, the newest first, (N, n)."""
    padded = np.concatenate([np.full(AGO[-1], course[0]), course])
    past = [padded[AGO[-1] - ago : len(padded) - ago] for ago in AGO]
    return np.column_stack([new - old for new, old in pairwise(past)])


def explained(off: FloatArray, changes: FloatArray) -> float:
    """Give how many nats it is worth that errors (N,), in standard deviations, go with changes (N, n)."""
    found = _regressed(off, changes)
    return 0.0 if found is None else found[1]


def _regressed(off: FloatArray, changes: FloatArray) -> tuple[FloatArray, float, int] | None:
    """Give slopes (n,) in standard deviations of the changes, the nats they are worth and the number of samples."""
    here = np.isfinite(off) & np.isfinite(changes).all(axis=1)
    scale = changes[here].std(axis=0) if here.any() else np.zeros(1)
    if here.sum() <= 2 * BEHIND or not np.all(scale > 0.0):
        return None
    columns, values = changes[here] / scale, off[here]
    slopes: FloatArray = np.asarray(np.linalg.lstsq(columns, values, rcond=None)[0], dtype=np.float64)
    left = values - columns @ slopes
    gain = float(0.5 * here.sum() * np.log(max(np.sum(values**2), 1e-300) / max(np.sum(left**2), 1e-300)))
    return slopes, gain, int(here.sum())


def late_sensors(spec: EngineSpec, records: Sequence[HealthyRecording], watches: Sequence[Watch]) -> tuple[Late, ...]:
    """Give which sensors come late, each with the input that tells most; of recordings and what was seen of them."""
    found = []
    for j, output in enumerate(spec.outputs):
        scores = np.concatenate([item.scores[:, j] for item in watches])
        best = Late(sensor=output.name, of="", part=LEAST_PART)
        for k, known in enumerate(spec.inputs):
            changes = np.concatenate([_changes_ago(item.u[:, k]) for item in records])
            if k not in output.direct_inputs:
                changes = changes[:, 1:]  # what it does in the very row may follow the noise of the reading
            if (seen := _regressed(scores, changes)) is None or seen[1] < CLEAR:
                continue
            slopes, part = seen[0], 1.0 - float(np.exp(-2.0 * seen[1] / seen[2]))
            way = sum(float(item.ways[j, k]) for item in watches)
            fades = np.abs(slopes[-1]) < FADED * np.max(np.abs(slopes))
            if part > best.part and fades and _largest(slopes) * way < 0.0:
                by = _seconds_later(records, watches, j, k)
                best = Late(sensor=output.name, of=known.name, part=part, by=by)
        found += [best] if best.of else []
    return tuple(sorted(found, key=lambda item: item.part, reverse=True))


def early_sensors(spec: EngineSpec, records: Sequence[HealthyRecording], watches: Sequence[Watch]) -> tuple[Early, ...]:
    """Give which sensors come a row early, each with the input that tells most."""
    found = []
    for j, output in enumerate(spec.outputs):
        best = Early(sensor=output.name, of="", part=LEAST_PART)
        for k, known in enumerate(spec.inputs):
            if k in output.direct_inputs:
                continue
            parts = zip(records, watches, strict=True)
            seen = [told_early(item.scores[:, j], float(item.ways[j, k]), record.u[:, k]) for record, item in parts]
            part = clear_part(seen)
            if part > best.part:
                best = Early(sensor=output.name, of=known.name, part=part)
        found += [best] if best.of else []
    return tuple(sorted(found, key=lambda item: item.part, reverse=True))


def clear_part(seen: Sequence[tuple[float, int]]) -> float:
    """Give the part of the scatter that is told by nats and samples of each recording; 0 where the nats are few."""
    nats, count = sum(item[0] for item in seen), sum(item[1] for item in seen)
    return 1.0 - float(np.exp(-2.0 * nats / max(count, 1))) if nats >= CLEAR else 0.0


def told_early(off: FloatArray, way: float, u: FloatArray) -> tuple[float, int]:
    """Give how many nats it is worth that errors go with what an input did in the very row, and how many samples tell.

    What goes the other way than the plant is a controller's doing, which answers the reading, and tells nothing.

    Parameters
    ----------
    off : errors of a sensor that does not feel the input at once (N,), in standard deviations
    way : how far the sensor moves on the whole where the input is larger
    u : the input (N,)
    """
    slope, nats, count = _in_the_row(off, u)
    return (nats if slope * way > 0.0 else 0.0), count


def answered(off: FloatArray, u: FloatArray) -> float:
    """Give how many nats it is worth that an input goes with errors (N,) of the very row, as told by `told_early`.

    Of a sensor that does not feel it at once: it answers what that reads, noise and all, or comes a row late.
    """
    return _in_the_row(off, u)[1]


def _in_the_row(off: FloatArray, u: FloatArray) -> tuple[float, float, int]:
    """Give the slope of errors over what an input did in the very row, the nats that is worth, and how many tell."""
    changes = _changes_ago(u)
    both, before = _regressed(off, changes), _regressed(off, changes[:, 1:])
    if both is None or before is None:
        return 0.0, 0.0, int(np.isfinite(off).sum())
    return float(both[0][0]), max(both[1] - before[1], 0.0), both[2]


def _seconds_later(records: Sequence[HealthyRecording], watches: Sequence[Watch], j: int, k: int) -> float | None:
    """Give by how much sensor j follows input k later than the plant alone does, s; None where that does not show.

    After a step of the input the difference between the two adds up to the further lag times what the step brings.
    """
    changes = np.concatenate([_changes_ago(item.u[:, k]) for item in records])
    alone = np.concatenate([_moved(item.alone[:, j]) for item in watches])
    off = np.concatenate([item.y[:, j] - seen.alone[:, j] for item, seen in zip(records, watches, strict=True)])
    behind, course = _responses(off, changes), _responses(alone, changes)
    if behind is None or course is None:
        return None
    step = float(np.median(np.concatenate([np.diff(item.time) for item in records])))
    by = -step * float(np.diff(AGO) @ behind) / course[-1] if course[-1] else np.nan
    return float(by) if 0.0 < by < 0.5 * step * AGO[-1] else None


def _responses(values: FloatArray, changes: FloatArray) -> FloatArray | None:
    """Give how values (N,) go with changes (N, n), per unit of each, (n,); None where too few are there."""
    found, here = _regressed(values, changes), np.isfinite(values)
    return None if found is None else np.asarray(found[0] / changes[here].std(axis=0))


def _largest(slopes: FloatArray) -> float:
    """Give the largest of some slopes (n,), with its sign."""
    return float(slopes[np.argmax(np.abs(slopes))])


def _moved(course: FloatArray) -> FloatArray:
    """Give how far something (N,) has moved within the samples looked at, (N,)."""
    far = AGO[-1]
    return np.concatenate([np.zeros(min(far, len(course))), course[far:] - course[:-far]])


def mirrored_sensors(
    spec: EngineSpec, records: Sequence[HealthyRecording], watches: Sequence[Watch]
) -> tuple[str, ...]:
    """Give the sensors that move against what the plant alone does."""
    return tuple(
        output.name
        for j, output in enumerate(spec.outputs)
        if _is_mirrored(
            [item.y[:, j] for item in records], [item.alone[:, j] for item in watches], MOVES * output.noise
        )
    )


def _is_mirrored(readings: Sequence[FloatArray], alone: Sequence[FloatArray], least: float) -> bool:
    """Tell whether readings move against what was expected, over every span of time in which both move enough."""
    found = []
    for window in WINDOWS:
        pairs = [(y[window:] - y[:-window], x[window:] - x[:-window]) for y, x in zip(readings, alone, strict=True)]
        moves = np.concatenate([np.column_stack(pair) for pair in pairs])
        moves = moves[np.isfinite(moves).all(axis=1)]
        if len(moves) > WINDOWS[-1] and np.all(moves.std(axis=0) > least):
            found.append(float(np.corrcoef(moves.T)[0, 1]))
    return bool(found) and max(found) < 0.0 and min(found) < AGAINST
