"""What imperfections would gain: likelihoods of many declarations at once, and of recordings that were held back."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.fit.ascent import Finish, ascend
from faultbond.fit.objective import BLOCK, LOG_2_PI, FitPoint, FittedPlant, Scored, score_recordings
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.side_by_side import side_by_side
from faultbond.fit.unknowns import Unknowns

_NONE = np.zeros(0)
_AT_ONCE = 64  # ways to declare
_MOST_SAMPLES = 16 * BLOCK // _AT_ONCE  # as compiled code hears no signal
_TURNS = 12  # of the climb to the starts alone
CLOSE_ENOUGH = 0.2  # nats that a further step would bring to a climb that compares
_FAR = 25.0  # square of the sd beyond which an error counts less
_PLACES = 50  # moments of a recording at which signals are looked at


def likelihoods(
    plant: FittedPlant, records: Sequence[HealthyRecording], starts: FloatArray, declared: FloatArray
) -> FloatArray:
    """Give the logarithm of the likelihood of recordings for each way to declare, (n,), see `tempered`.

    Parameters
    ----------
    plant, records : what is asked
    starts : (n_records, n_own), see `FitPoint`
    declared : float array, shape (n, n_q); q of each way, see `Layout`
    """
    total = np.zeros(len(declared))
    if not len(declared):
        return total
    for record, start in zip(records, starts, strict=True):
        begun = plant.lanes(declared, np.tile(start, (len(declared), 1)))
        parts = [begun[:, first : first + _AT_ONCE] for first in range(0, len(declared), _AT_ONCE)]
        total += np.concatenate([_NONE, *side_by_side(partial(_told_by, plant, record), parts)])
    return np.where(np.isfinite(total), total, -np.inf)


def _told_by(plant: FittedPlant, record: HealthyRecording, lanes: FloatArray) -> FloatArray:
    """Give the logarithm of the likelihood of a recording for each filter, (n,)."""
    total, n_y = np.zeros(lanes.shape[1]), plant.layout.n_y
    with np.errstate(all="ignore"):
        for first in range(0, len(record.time), _MOST_SAMPLES):
            part = slice(first, first + _MOST_SAMPLES)
            lanes, found = plant.engine.advance(lanes, record.samples[part])
            use = record.use[part][:, :, None]
            e, s = found[:, :n_y], found[:, n_y:]
            total -= 0.5 * np.where(use, tempered(e**2 / s) + np.log(s) + LOG_2_PI, 0.0).sum(axis=(0, 1))
    return total


def tempered(squares: FloatArray) -> FloatArray:
    """Give squares of errors (n, ...), in sd, with those beyond five sd as their logarithm grows, as thick tails do.

    Else a model that lacks something much is judged by few readings alone: without the speed of a gate, which moved
    far twice in the recording that was held back, 3500 rows of a power station differed by 3.4 million nats from all
    that could do without, however it did, and nothing else counted.

    Source: Huber, Robust Statistics, 1981, section 4.5, with the tail of a Student distribution.
    """
    return np.where(squares <= _FAR, squares, _FAR * (1.0 + np.log(np.maximum(squares, _FAR) / _FAR)))


def evidence_of(found: Sequence[Scored]) -> float:
    """Give the logarithm of the likelihood of recordings as they are seen, see `tempered`."""
    if not all(np.isfinite(item.value) for item in found):
        return -np.inf
    parts = (tempered(x.innovations**2 / x.variances) + np.log(x.variances) + LOG_2_PI for x in found)
    return -0.5 * float(sum(np.nansum(item) for item in parts))


def joint_courses(plant: FittedPlant, record: HealthyRecording, start: FloatArray, q: FloatArray) -> FloatArray:
    """Give inputs and joint vectors [x, b, factors, input noise] at some moments, (n_moments, n_u + n_v)."""
    layout, lanes, found = plant.layout, plant.lanes(q[None], start[None]), []
    n_known = layout.n_x + layout.n_b
    ends = np.unique(np.linspace(0, len(record.time), _PLACES + 1).astype(int))
    for first, last in pairwise(ends.tolist()):
        lanes, _ = plant.engine.advance(lanes, record.samples[first:last])
        mean = lanes[: layout.n_mean, 0]
        found.append(np.concatenate([record.u[last - 1], mean[:n_known], q[: layout.n_p], mean[n_known:]]))
    return np.array(found)


def all_known(plant: FittedPlant, q: FloatArray) -> FittedPlant:
    """Give the plant with all numbers q (n_q,) known, so that nothing but starts is to be found."""
    nothing = Unknowns(
        places=np.zeros(0, dtype=np.intp),
        parameters=(),
        logarithmic=np.zeros(0, dtype=bool),
        nominal=_NONE,
        prior=_NONE,
        lower=_NONE,
        upper=_NONE,
    )
    return replace(plant, base=q, unknowns=nothing)


def foretold(
    plant: FittedPlant, records: Sequence[HealthyRecording], begin: FitPoint, q: FloatArray
) -> tuple[Scored, ...]:
    """Give what recordings show that were held back: all of q (n_q,) is known but where they start."""
    known = all_known(plant, q)
    return score_recordings(known, records, begun_likeliest(known, records, replace(begin, values=_NONE)))


def begun_likeliest(plant: FittedPlant, records: Sequence[HealthyRecording], begin: FitPoint) -> FitPoint:
    """Give a point with the likeliest starts of recordings, all else as it stands there."""
    known = all_known(plant, plant.unknowns.fill(plant.base, begin.values)[0])
    finish = Finish(CLOSE_ENOUGH)
    summit = ascend(known, records, replace(begin, values=_NONE), _NONE, turns=_TURNS, finish=finish)
    return replace(summit.point, values=begin.values)
