"""Where a model is wrong: regions of the inputs and of the readings, and moments, in which the scores are off."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.fit.certainty import long_run_variance
from faultbond.fit.innovations import Watch
from faultbond.fit.samples import HealthyRecording

PARTS = 3  # of the range of an input or a reading
SURE = 4.0  # standard errors of a mean that is not chance
OFF = 0.15  # standard deviations; a smaller mean does not matter to the detector
WILD = 1.4  # times the declared spread
FEW = 12  # samples of a region that are too few to speak of
AFTER = 10  # samples after a step of an input
STEP = 0.05  # of an input's range, a change within a sample that is a step
MOST_MOMENTS = 5
LOW = 0.3  # of the limit; a smaller climb of the CUSUM is no moment to show


@dataclass(frozen=True, slots=True, kw_only=True)
class Region:
    """Samples in which a sensor is off: of what, from where to where (SI), how far in standard deviations, how many."""

    sensor: str
    of: str
    low: float
    high: float
    after_step: bool
    mean: float
    spread: float
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Moment:
    """A climb of the CUSUM of a sensor: from when to when (s), its height as a part of the limit, its sign."""

    recording: str
    sensor: str
    begin: float
    end: float
    height: float
    side: int


def wrong_regions(
    spec: EngineSpec, records: Sequence[HealthyRecording], watches: Sequence[Watch]
) -> tuple[Region, ...]:
    """Give the regions in which sensors are off, the worst first."""
    found: list[Region] = []
    u, y = (np.concatenate([getattr(item, name) for item in records]) for name in ("u", "y"))
    steps = np.concatenate([_after_steps(item.u) for item in records])
    scores = np.concatenate([item.scores for item in watches])
    signals = [(item.name, u[:, k]) for k, item in enumerate(spec.inputs)]
    signals += [(item.name, y[:, k]) for k, item in enumerate(spec.outputs)]
    for j, output in enumerate(spec.outputs):
        for name, values in signals:
            for low, high, inside in _thirds(values):
                found += _off(output.name, name, low, high, scores[:, j], inside, after=False)
        for k, item in enumerate(spec.inputs):
            found += _off(output.name, item.name, np.nan, np.nan, scores[:, j], steps[:, k], after=True)
    whole = {
        output.name: _off(output.name, "", np.nan, np.nan, scores[:, j], np.ones(len(scores), dtype=bool), after=False)
        for j, output in enumerate(spec.outputs)
    }
    everywhere = [item for items in whole.values() for item in items]
    return tuple(sorted([*everywhere, *found], key=_badness, reverse=True))


def _badness(item: Region) -> float:
    return max(abs(item.mean) / OFF, item.spread / WILD)


def _thirds(values: FloatArray) -> list[tuple[float, float, BoolArray]]:
    """Cut the range of a signal into parts; none for one that does not move."""
    here = values[np.isfinite(values)]
    if not len(here) or np.ptp(here) <= 0.0:
        return []
    edges = np.linspace(float(here.min()), float(here.max()), PARTS + 1)
    parts = []
    for k in range(PARTS):
        upper = values <= edges[k + 1] if k == PARTS - 1 else values < edges[k + 1]
        parts.append((float(edges[k]), float(edges[k + 1]), (values >= edges[k]) & upper))
    return parts


def _after_steps(u: FloatArray) -> BoolArray:
    """Tell which samples come soon after a step of each input, (N, n_inputs)."""
    moved = np.abs(np.diff(u, axis=0, prepend=u[:1]))
    jumps = moved > STEP * np.maximum(np.ptp(u, axis=0), 1e-300)
    rare = jumps.mean(axis=0) < 0.5 / AFTER  # an input that jumps all the time has no steps to look behind
    last = np.maximum.accumulate(np.where(jumps, np.arange(len(u))[:, None], -AFTER - 1), axis=0)
    return np.asarray((np.arange(len(u))[:, None] - last < AFTER) & rare)


def _off(
    sensor: str, of: str, low: float, high: float, scores: FloatArray, inside: BoolArray, *, after: bool
) -> list[Region]:
    """Give the region if its scores are off, by their mean or by their spread."""
    values = scores[inside & np.isfinite(scores)]
    if len(values) < FEW:
        return []
    mean, spread = float(values.mean()), float(values.std())
    error = float(np.sqrt(max(long_run_variance((values - mean)[:, None])[0, 0], 1e-12))) / len(values)
    biased = abs(mean) > OFF and abs(mean) > SURE * error
    if not biased and spread < WILD:
        return []
    return [
        Region(
            sensor=sensor, of=of, low=low, high=high, after_step=after, mean=mean, spread=spread, samples=len(values)
        )
    ]


def moments(spec: EngineSpec, records: Sequence[HealthyRecording], watches: Sequence[Watch]) -> tuple[Moment, ...]:
    """Give the highest climbs of the CUSUM of each sensor, the highest first."""
    found: list[Moment] = []
    limit = spec.thresholds.cusum_limit
    for record, seen in zip(records, watches, strict=True):
        for j, output in enumerate(spec.outputs):
            for side in (0, 1):
                for first, last, height in _climbs(seen.cusum[side, :, j]):
                    if height > LOW * limit:
                        found.append(
                            Moment(
                                recording=record.name,
                                sensor=output.name,
                                begin=float(record.time[first]),
                                end=float(record.time[last]),
                                height=height / limit,
                                side=1 - 2 * side,
                            )
                        )
    return tuple(sorted(found, key=lambda item: item.height, reverse=True)[:MOST_MOMENTS])


def _climbs(sums: FloatArray) -> list[tuple[int, int, float]]:
    """Give begin, highest place and height of each run above zero."""
    above = np.concatenate([[False], sums > 0.0, [False]])
    begins, ends = np.flatnonzero(above[1:] & ~above[:-1]), np.flatnonzero(~above[1:] & above[:-1])
    return [
        (int(first), int(first + np.argmax(sums[first:end])), float(np.max(sums[first:end])))
        for first, end in zip(begins, ends, strict=True)
    ]
