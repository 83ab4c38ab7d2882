"""How often a healthy plant would alarm, from what the detector saw of it; and what must be declared for a promise.

The CUSUM of scores with mean m, long-run variance v and drift k climbs to h about every
(exp(w) - 1 - w) v / (2 d^2) samples, with d = m - k (for the lower side, -m - k), w = -2 d (h + b) / v,
b = 1.166 sqrt(v): Brownian motion with a correction for steps. One is counted for each side of each sensor, slow and
fast, and one for the sum of its scatter. That is of scores that are alike all the time; where a model is wrong for a
while, as after each step of an input, few climbs are far higher than mean and variance say. So the highest climbs tell
of it too: by how much climbs pass a level is exponential, and the time is the shorter of the two. A slow error alarms
when its estimate leaves its limit; the time between is that of a Gaussian process with the spread and the memory seen.

Source: Siegmund, Sequential Analysis, 1985, section 10.2 (the approximation); Pickands, Ann. Statist. 3 (1975) 119
(peaks over a threshold); Rice, Bell Syst. Tech. J. 24 (1945) 46.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, Thresholds
from faultbond.fit.certainty import long_run_variance
from faultbond.fit.cusum import LAGS, clip, scatter_gain
from faultbond.fit.innovations import Watch

OVERSHOOT = 1.166  # standard deviations
LEAST_VARIANCE = 0.02  # scores of a plant that declares too much are small; still they are not nothing
STILL = 1e-9
FLATTEST, STEEPEST = 1e-6, 16.0  # exponents; below, rounding decides; above, crossings are rare for ever
SENSOR = "sensor"  # the kind of a statistic
FARTHEST = 1e30  # s; longer is for ever
HIGHEST = 20  # climbs whose heights tell how rare higher ones are, of twice as many at least


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """What one statistic does while the plant is healthy.

    name: the sensor, or what is in error or wanders; kind: `sensor`, `slow error` or `wander`; peak: its largest value
    as a part of the limit; between: expected seconds between false alarms; mean, spread: of the scores of a sensor, 0
    and 1 if all is as declared; memory: seconds; longer: how many times as long `between` may be, since it is told
    from what never came near the limit: the more, the rarer an alarm and the shorter the recordings.
    """

    name: str
    kind: str
    peak: float
    between: float
    mean: float
    spread: float
    memory: float
    longer: float = 1.0

    @property
    def words(self) -> str:
        """What it is, with its name."""
        return self.name if self.kind == SENSOR else f"{self.kind} of {self.name}"


def alarm_rates(spec: EngineSpec, watches: Sequence[Watch], step: float) -> tuple[Rate, ...]:
    """Give the rate of each sensor, and of each slow error that can alarm: what has alarmed does so at least as often.

    Parameters
    ----------
    spec : the model
    watches : what the detector saw of each recording
    step : seconds between samples
    """
    sensors = (_sensor_rate(spec, watches, j, step) for j in range(len(spec.outputs)))
    slow = (_slow_rate(spec, watches, k, step) for k, item in enumerate(spec.slow_errors) if item.alarms)
    watched = step * sum(len(item.scores) for item in watches)
    return tuple(
        replace(item, between=min(item.between, watched)) if item.peak > 1.0 else item for item in (*sensors, *slow)
    )


def between_alarms(found: Sequence[Rate]) -> float:
    """Give the expected seconds between false alarms of all statistics together."""
    total = sum(1.0 / item.between for item in found)
    return 1.0 / total if total > 0.0 else np.inf


def _sensor_rate(spec: EngineSpec, watches: Sequence[Watch], j: int, step: float) -> Rate:
    settings = spec.thresholds
    wild = [item.scores[np.isfinite(item.scores[:, j]), j] for item in watches]
    scores = [clip(settings, item) for item in wild]
    every = np.concatenate(scores) if scores else np.zeros(0)
    heights = [item.height[:, j] for item in watches]
    peak = max((float(np.max(item, initial=0.0)) for item in heights), default=0.0)
    if len(every) < 2:
        return Rate(name=spec.outputs[j].name, kind=SENSOR, peak=0.0, between=np.inf, mean=0.0, spread=0.0, memory=0.0)
    mean, spread = float(every.mean()), float(every.std())
    variance = max(_variance(scores), LEAST_VARIANCE)
    samples = [
        cusum_time(side * mean - drift, variance, limit)
        for drift, limit in ((settings.cusum_drift, settings.cusum_limit), (settings.fast_drift, settings.fast_limit))
        for side in (1.0, -1.0)
    ]
    # The sum of the scatter alarms where it is high against each of the last innovations: not before the slowest.
    samples.append(max(scatter_time(settings, wild, lag) for lag in range(1, LAGS + 1)))
    by_sums, by_climbs = 1.0 / sum(1.0 / item for item in samples), climb_time(heights, settings.cusum_limit)
    memory = max(variance / max(spread**2, 1e-12), 1.0)
    apart = len(every) / memory  # scores that are not alike
    longer = (_longer(by_sums, 0.5 * apart), _longer(by_climbs * HIGHEST / len(every), HIGHEST))
    return Rate(
        name=spec.outputs[j].name,
        kind=SENSOR,
        peak=peak / settings.cusum_limit,
        between=step * min(by_sums, by_climbs),
        mean=mean,
        spread=spread,
        memory=step * memory,
        longer=longer[by_climbs < by_sums],
    )


def _longer(times: float, count: float) -> float:
    """Give how many times as rare an alarm may be that is found `times` as rare as what was seen.

    That is exp(h / s) for a size s, a mean of `count`; by chance it is too large by two sd of s / sqrt(count).
    """
    by_chance = min(2.0 / np.sqrt(max(count, 1.0)), 1.0 - STILL)
    return float(np.exp(min(np.log(max(times, 1.0)) * by_chance / (1.0 - by_chance), 70.0)))


def _variance(series: Sequence[FloatArray]) -> float:
    """Give the long-run variance of several series about their common mean."""
    every = np.concatenate(series)
    total = sum(float(long_run_variance((item - every.mean())[:, None])[0, 0]) for item in series if len(item) > 3)
    return total / len(every)


def cusum_time(drift: float, variance: float, limit: float) -> float:
    """Give the expected samples until a one-sided CUSUM climbs to its limit.

    Parameters
    ----------
    drift : mean of a score, less what the CUSUM takes off
    variance : long-run variance of the scores
    limit : of the CUSUM
    """
    height = limit + OVERSHOOT * np.sqrt(variance)
    if abs(drift) < STILL:
        return float(height**2 / variance)
    with np.errstate(over="ignore"):
        w = -2.0 * drift * height / variance
        return float(min((np.exp(min(w, 700.0)) - 1.0 - w) * variance / (2.0 * drift**2), FARTHEST))


def climb_time(heights: Sequence[FloatArray], limit: float) -> float:
    """Give the expected samples until a climb comes to the limit, from the highest of those seen.

    Parameters
    ----------
    heights : arrays (N,), of the sums sample by sample
    limit : of the sums
    """
    climbs = np.sort(np.concatenate([_climbs(item) for item in heights]))[::-1]
    if len(climbs) < 2 * HIGHEST:
        return FARTHEST
    level, samples = climbs[HIGHEST], sum(map(len, heights))
    beyond = max(float(np.mean(climbs[:HIGHEST] - level)), STILL)
    return float(min(samples / HIGHEST * np.exp(min((limit - level) / beyond, 70.0)), FARTHEST))


def _climbs(height: FloatArray) -> FloatArray:
    """Give how high each climb goes from 0 until it is there again, of heights (N,)."""
    begins = np.flatnonzero((height > 0.0) & (np.concatenate([[0.0], height[:-1]]) <= 0.0))
    return np.maximum.reduceat(height, begins) if len(begins) else np.zeros(0)


def scatter_time(settings: Thresholds, scores: Sequence[FloatArray], lag: int) -> float:
    """Give the expected samples until the sum of the scatter, against the innovation `lag` samples before, alarms.

    `scores` are arrays (N,), in standard deviations. What the sum gains is skewed, so the exponent r with which
    crossings become rare is that of Lundberg, mean(exp(r g)) = 1; gains that come together make it smaller, as their
    long-run variance is larger.
    """
    gains = [scatter_gain(settings, item[lag:] - item[:-lag]) for item in scores if len(item) > lag]
    every = np.concatenate(gains) if gains else np.zeros(0)
    if len(every) < 2:
        return FARTHEST
    mean, variance = float(every.mean()), max(_variance(gains), LEAST_VARIANCE)
    if mean < -STILL:
        together = max(_variance(gains) / max(float(every.var()), STILL), 1.0)
        variance = -2.0 * mean * together / _lundberg(every)
    return cusum_time(mean, variance, settings.scatter_limit)


def _lundberg(gains: FloatArray) -> float:
    """Give the root r > 0 of mean(exp(r g)) = 1 of gains with a negative mean, within what is tried."""

    def excess(exponent: float) -> float:
        return float(np.mean(np.exp(exponent * gains))) - 1.0

    high = STEEPEST
    if excess(high) < 0.0:
        return high
    low = high
    while excess(low) >= 0.0:
        if low < FLATTEST:
            return low
        low /= 2.0
    return float(brentq(excess, low, 2.0 * low))


def _slow_rate(spec: EngineSpec, watches: Sequence[Watch], k: int, step: float) -> Rate:
    limit = float(spec.slow_limits[k])
    paths = [item.slow[np.isfinite(item.slow[:, k]), k] for item in watches]
    paths = [item for item in paths if len(item) > 2]
    every = np.concatenate(paths) if paths else np.zeros(1)
    peak = float(np.max(np.abs(every), initial=0.0)) / limit
    size = float(np.sqrt(np.mean(every**2)))
    moves = float(np.sqrt(np.mean(np.concatenate([np.diff(item) for item in paths]) ** 2))) / step if paths else 0.0
    between = FARTHEST
    if size > STILL and moves > 0.0:
        with np.errstate(over="ignore"):
            between = float(min(np.pi * size / moves * np.exp(min(0.5 * (limit / size) ** 2, 70.0)), FARTHEST))
    return Rate(
        name=spec.slow_errors[k].name,
        kind="wander" if spec.slow_errors[k].wanders else "slow error",
        peak=peak,
        between=between,
        mean=float(every.mean()),
        spread=size,
        memory=spec.slow_errors[k].memory,
        longer=_longer(between * moves / (np.pi * max(size, STILL)), len(every) * step / spec.slow_errors[k].memory),
    )
