"""The sums of the detector: CUSUMs of the innovations, slow and fast, and of their scatter; for arrays of any shape.

A sum with a small drift finds small faults; one with a large drift and a low limit finds large ones in half the time.
The latter alarms only where a time between false alarms is promised: a few wild values in a row, which real sensors
have, are enough for it. They also scatter in bursts, of some hundred samples; so the sum of the scatter has patience.

What watches a plant, what asks for the smallest fault and what foretells false alarms take these sums from here.

Source: Page, Biometrika 41 (1954) 100.
"""

from dataclasses import dataclass
from math import isfinite, log, prod, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import BoolArray
from faultbond.contract.spec import Thresholds

LAGS = 4  # innovations with which each new one is compared
SQRT2 = sqrt(2.0)  # standard deviation of a difference of innovations as declared

Floats = NDArray[Any]  # float64, or float32 where many realisations are summed up at once


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sums:
    """The sums after a sample; the axes behind the first are those of its innovations.

    slow, fast: (2, ...), up and down. scatter: (LAGS, ...), and `before`, alike, the last innovations, the newest
    first, in their standard deviations; nan: nothing to compare with.
    """

    slow: Floats
    fast: Floats
    scatter: Floats
    before: Floats


def no_sums(*shape: int) -> Sums:
    """Give the sums before the first sample of innovations of some shape."""
    sides, lags = (2, *shape), (LAGS, *shape)
    return Sums(slow=np.zeros(sides), fast=np.zeros(sides), scatter=np.zeros(lags), before=np.full(lags, np.nan))


def clip(settings: Thresholds, score: Floats) -> Floats:
    """Limit what one sample contributes."""
    return np.minimum(np.maximum(score, -settings.cusum_clip), settings.cusum_clip)


def climb(sums: Floats, score: Floats, drift: float) -> Floats:
    """Take one clipped sample into two-sided sums (2, ...)."""
    return np.maximum(sums + (np.array([score, -score]) - drift), 0.0)


def scatter_gain(settings: Thresholds, apart: Floats) -> Floats:
    """Give the log-likelihood ratio of `scatter_ratio` times the declared noise, for differences of two innovations.

    They are differences to each of the last ones, since a bias, or what the model gets wrong slowly, is no noise; nor
    is an oscillation, which returns to where it was after some samples.
    """
    apart = np.minimum(np.abs(apart), SQRT2 * settings.cusum_clip)
    return 0.25 * (1.0 - settings.scatter_ratio**-2) * apart * apart - log(settings.scatter_ratio)


def added(settings: Thresholds, sums: Sums, score: Floats, use: BoolArray, forget: BoolArray | None = None) -> Sums:
    """Take one sample into the sums.

    Parameters
    ----------
    settings : limits and drifts
    sums : before
    score : array, shape (...,)
        Innovations in their standard deviations.
    use : array of bool that broadcasts to `score`
        False leaves the sums as they are; so does a score that is no number.
    forget : array of bool that broadcasts to `score`
        True where the next score is compared with none so far, as after a step of an input.
    """
    limited = clip(settings, score)
    slow = climb(sums.slow, limited, settings.cusum_drift)
    fast = climb(sums.fast, limited, settings.fast_drift)
    gained = np.maximum(sums.scatter + scatter_gain(settings, score - sums.before), 0.0)
    scatter = np.where(np.isfinite(gained), gained, sums.scatter)
    before = np.concatenate([score[None], sums.before[:-1]])
    use = use & np.isfinite(score)
    if not np.all(use):
        slow, fast = np.where(use, slow, sums.slow), np.where(use, fast, sums.fast)
        scatter, before = np.where(use, scatter, sums.scatter), np.where(use, before, sums.before)
    if forget is not None and np.any(forget):
        before = np.where(forget, np.nan, before)
    return Sums(slow=slow, fast=fast, scatter=scatter, before=before)


def heights_along(settings: Thresholds, scores: Floats, use: BoolArray, forget: BoolArray, anew: BoolArray) -> Floats:
    """Give `heights_of` the sums after each of many samples, (3, n, ...): as if they were `added` one after the other.

    A sum that stays above 0 is its steps summed up, less the least of these totals so far, or 0.

    Parameters
    ----------
    settings : limits and drifts
    scores, use, forget : arrays, shape (n, ...), or what broadcasts to it
        As in `added`, of each sample.
    anew : array of bool, alike
        True where a score is compared with none before it, as after a gap.
    """
    shape, flat = scores.shape, (len(scores), prod(scores.shape[1:]))
    use = use & np.isfinite(scores)
    limited = clip(settings, scores)
    slow, fast = (
        [_climbed(np.where(use, side * limited - drift, 0.0)) for side in (1.0, -1.0)]
        for drift in (settings.cusum_drift, settings.fast_drift)
    )
    breaks: Floats = np.cumsum(anew, axis=0) + np.cumsum(forget, axis=0) - forget
    part = np.broadcast_to(breaks, shape).reshape(flat)
    gained = np.zeros((LAGS, *part.shape))
    for j, (values, used) in enumerate(zip(scores.reshape(flat).T, use.reshape(flat).T, strict=True)):
        at = np.flatnonzero(used)
        for lag in range(1, LAGS + 1):
            gain = scatter_gain(settings, values[at[lag:]] - values[at[:-lag]])
            gained[lag - 1, at[lag:], j] = np.where(part[at[lag:], j] == part[at[:-lag], j], gain, 0.0)
    scatter = _climbed(gained.reshape(LAGS, *shape), axis=1)
    by_fast, by_scatter = scales(settings)
    sides = [np.maximum(one, by_fast * other) for one, other in zip(slow, fast, strict=True)]
    return np.stack([*sides, by_scatter * np.min(scatter, axis=0)])


def _climbed(steps: Floats, axis: int = 0) -> Floats:
    """Give sums that stay above 0 after each of their steps."""
    total = np.cumsum(steps, axis=axis)
    return np.asarray(total - np.minimum(np.minimum.accumulate(total, axis=axis), 0.0))


def height_of(settings: Thresholds, sums: Sums) -> Floats:
    """Give the largest of the sums, (...,), in the scale of the slow ones: above `cusum_limit` is an alarm."""
    return np.asarray(np.max(heights_of(settings, sums), axis=0))


def heights_of(settings: Thresholds, sums: Sums) -> Floats:
    """Give the largest sums up, down, and of the scatter, (3, ...), in the scale of the slow ones.

    The scatter counts as far as it is seen against each of the last innovations.
    """
    fast, scatter = scales(settings)
    sides = np.maximum(sums.slow, fast * sums.fast)
    return np.concatenate([sides, scatter * np.min(sums.scatter, axis=0, keepdims=True)])


def scales(settings: Thresholds) -> tuple[float, float]:
    """Give the limit of the slow sums in those of the fast ones and of the scatter."""
    limit = settings.cusum_limit
    return (limit / settings.fast_limit, limit / settings.scatter_limit) if isfinite(limit) else (1.0, 1.0)
