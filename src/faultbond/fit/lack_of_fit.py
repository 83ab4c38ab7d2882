"""Where a model is wrong: regions of the inputs and of the readings, and moments, in which the scores are off."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.fit.certainty import long_run_variance
from faultbond.fit.innovations import LOST, Watch
from faultbond.fit.samples import HealthyRecording

PARTS = 3  # of the range of an input or a reading
SURE = 4.0  # standard errors of a mean that is not chance
OFF = 0.15  # standard deviations; a smaller mean does not matter to the detector
WILD = 1.4  # times the declared spread
FEW = 12  # samples of a region that are too few to speak of
AFTER = 10  # samples after a step of an input
STEP = 0.05  # of an input's range, a change within a sample that is a step
MOST_MOMENTS = 5
LOW = 0.3  # of the limit; a smaller climb is no moment to show


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
    """A climb of a sum of a sensor: from when to when (s), and its height as a part of the limit.

    side: 1 where it reads more than expected, -1 less; 0: it scatters more than declared.
    """

    recording: str
    sensor: str
    begin: float
    end: float
    height: float
    side: int


def wrong_regions(
    spec: EngineSpec, records: Sequence[HealthyRecording], watches: Sequence[Watch]
) -> tuple[Region, ...]:
    """Give the regions in which sensors are off, the worst first; where a filter is lost nothing tells where."""
    u, y = (np.concatenate([getattr(item, name) for item in records]) for name in ("u", "y"))
    steps = np.concatenate([_after_steps(item.u) for item in records])
    scores = np.concatenate([np.where(item.scores < LOST, item.scores, np.nan) for item in watches])
    names = [*(item.name for item in spec.inputs), *(item.name for item in spec.outputs)]
    places: list[tuple[str, float, float, BoolArray, bool]] = []  # of what, from where to where, which, after a step
    for name, values in zip(names, np.hstack([u, y]).T, strict=True):
        here = values[np.isfinite(values)]
        if not len(here) or np.ptp(here) <= 0.0:
            continue
        edges = np.linspace(float(here.min()), float(here.max()), PARTS + 1)
        for k, (low, high) in enumerate(pairwise(edges.tolist())):
            upper = values <= high if k == PARTS - 1 else values < high
            places.append((name, low, high, (values >= low) & upper, False))
    places += [(item.name, np.nan, np.nan, steps[:, k], True) for k, item in enumerate(spec.inputs)]
    everywhere = ("", np.nan, np.nan, np.ones(len(scores), dtype=bool), False)
    found = [
        _off(output.name, scores[:, j], *place)
        for some in ([everywhere], places)
        for j, output in enumerate(spec.outputs)
        for place in some
    ]
    wrong = [item for item in found if item is not None]
    return tuple(sorted(wrong, key=lambda item: max(abs(item.mean) / OFF, item.spread / WILD), reverse=True))


def _after_steps(u: FloatArray) -> BoolArray:
    """Tell which samples come soon after a step of each input, (N, n_inputs)."""
    moved = np.abs(np.diff(u, axis=0, prepend=u[:1]))
    jumps = moved > STEP * np.maximum(np.ptp(u, axis=0), 1e-300)
    rare = jumps.mean(axis=0) < 0.5 / AFTER  # an input that jumps all the time has no steps to look behind
    last = np.maximum.accumulate(np.where(jumps, np.arange(len(u))[:, None], -AFTER - 1), axis=0)
    return np.asarray((np.arange(len(u))[:, None] - last < AFTER) & rare)


def _off(
    sensor: str, scores: FloatArray, of: str, low: float, high: float, inside: BoolArray, after: bool
) -> Region | None:
    """Give the region if its scores are off, by their mean or by their spread."""
    values = scores[inside & np.isfinite(scores)]
    if len(values) < FEW:
        return None
    mean, spread, count = float(values.mean()), float(values.std()), len(values)
    error = float(np.sqrt(max(long_run_variance((values - mean)[:, None])[0, 0], 1e-12))) / count
    biased = abs(mean) > OFF and abs(mean) > SURE * error
    if not biased and spread < WILD:
        return None
    return Region(sensor=sensor, of=of, low=low, high=high, after_step=after, mean=mean, spread=spread, samples=count)


def moments(spec: EngineSpec, records: Sequence[HealthyRecording], watches: Sequence[Watch]) -> tuple[Moment, ...]:
    """Give the highest climbs of the sums of each sensor, the highest first."""
    found: list[Moment] = []
    limit = spec.thresholds.cusum_limit
    for record, seen in zip(records, watches, strict=True):
        for j, output in enumerate(spec.outputs):
            for side, sums in zip((1, -1, 0), seen.climbs[:, :, j], strict=True):
                above = np.concatenate([[False], sums > 0.0, [False]])
                for first, end in np.flatnonzero(np.diff(above)).reshape(-1, 2):
                    top = int(first + np.argmax(sums[first:end]))
                    if sums[top] > LOW * limit:
                        found.append(
                            Moment(
                                recording=record.name,
                                sensor=output.name,
                                begin=float(record.time[first]),
                                end=float(record.time[top]),
                                height=float(sums[top]) / limit,
                                side=side,
                            )
                        )
    return tuple(sorted(found, key=lambda item: item.height, reverse=True)[:MOST_MOMENTS])
