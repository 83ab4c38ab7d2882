"""The most probable values: scoring with damping, from several starts.

Each step solves (information + prior + damping) step = slope; the damping rises until the posterior does. Source:
Levenberg 1944, Marquardt 1963; Fisher's scoring as in Ljung 1999, section 10.2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.analysis.identify.evaluate import Evaluation, Plant, Point, course, evaluate
from faultbond.analysis.identify.samples import Record
from faultbond.types import BoolArray, FloatArray

ITERATIONS = 60
PATIENCE = 12  # rises of the damping in a row
SETTLED = 1e-5  # nats that the next step would still bring
LONGEST = 1.5  # step of a logarithm at most
START_PRIOR = 1e3  # sd of a free start, in its unit; it only keeps what does not show where it is
NOISE_ROUNDS = 4

Objective = Callable[[Point], Evaluation]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Summit:
    """Where a climb ended.

    posterior: logarithm of likelihood and prior; precision (m, m): information and prior; settled: whether it stands
    still; steps: evaluations used.
    """

    point: Point
    evaluation: Evaluation
    posterior: float
    precision: FloatArray
    settled: bool
    steps: int


def climb(plant: Plant, records: Sequence[Record], begin: Point, prior: FloatArray, most: int = ITERATIONS) -> Summit:
    """Climb from a point.

    Parameters
    ----------
    plant, records : what is fitted to what
    begin : where to start
    prior : sd of each unknown about its nominal value, (n,)
    most : steps at most
    """
    hill = _Hill(plant, records, begin, prior)
    now = hill.at(begin)
    damping, steps, settled = 1e-3, 1, False
    while steps < most and np.isfinite(now.posterior):
        found, damping, used, gain = _step(hill, now, damping)
        steps += used
        settled = gain <= SETTLED
        if found is None or settled:
            settled = settled or gain <= 1e2 * SETTLED
            now = found or now
            break
        now = found
    return replace(now, settled=settled, steps=steps)


def _step(hill: "_Hill", now: Summit, damping: float) -> tuple[Summit | None, float, int, float]:
    """Give a higher point, the damping to go on with, evaluations used, and what Newton's step promises; None: none."""
    slope = hill.slope(now)
    held = hill.held(now, slope)
    promise = np.inf
    for tried in range(1, PATIENCE + 1):
        move, promise = hill.move(now, slope, held, damping)
        if promise <= SETTLED and damping <= 1e-3:
            return None, damping, tried - 1, promise
        trial = hill.at(hill.moved(now.point, move))
        if trial.posterior > now.posterior:
            return trial, max(damping / 10.0, 1e-9), tried, np.inf
        damping *= 8.0
    return None, damping, PATIENCE, promise


class _Hill:
    """The posterior over the unknowns and the starts."""

    def __init__(self, plant: Plant, records: Sequence[Record], begin: Point, prior: FloatArray) -> None:
        self.plant, self.records = plant, records
        self.n = len(begin.values)
        self.anchor = begin.starts
        n_starts = begin.starts.size
        self.weight = 1.0 / np.concatenate([prior, np.full(n_starts, START_PRIOR)]) ** 2
        self.logarithmic = np.concatenate([plant.unknowns.logarithmic, np.zeros(n_starts, dtype=bool)])

    def away(self, point: Point) -> FloatArray:
        """Give how far a point lies from what was known, in units of the unknowns."""
        starts = ((point.starts - self.anchor) / point.sizes).ravel()
        return np.concatenate([point.values - self.plant.unknowns.nominal, starts])

    def at(self, point: Point) -> Summit:
        found = evaluate(self.plant, self.records, point)
        penalty = 0.5 * float(np.sum(self.weight * self.away(point) ** 2))
        return Summit(
            point=point,
            evaluation=found,
            posterior=found.value - penalty,
            precision=found.information + np.diag(self.weight),
            settled=False,
            steps=1,
        )

    def slope(self, now: Summit) -> FloatArray:
        return now.evaluation.score - self.weight * self.away(now.point)

    def held(self, now: Summit, slope: FloatArray) -> BoolArray:
        """Whether an unknown stands at the end of its range and would leave it."""
        unknowns, values = self.plant.unknowns, now.point.values
        stuck: BoolArray = np.zeros(len(slope), dtype=bool)
        stuck[: self.n] = ((values >= unknowns.upper) & (slope[: self.n] > 0)) | (
            (values <= unknowns.lower) & (slope[: self.n] < 0)
        )
        return stuck

    def move(self, now: Summit, slope: FloatArray, held: BoolArray, damping: float) -> tuple[FloatArray, float]:
        """Give the step, and what it would bring if the hill were as it looks from here."""
        free = ~held
        scale = np.sqrt(np.maximum(np.diag(now.precision), 1e-300))[free]
        matrix = now.precision[np.ix_(free, free)] / np.outer(scale, scale)
        matrix[np.diag_indices_from(matrix)] += damping
        step = np.zeros(len(slope))
        step[free] = np.linalg.lstsq(matrix, slope[free] / scale, rcond=None)[0] / scale
        longest = np.max(np.abs(step[self.logarithmic]), initial=0.0)
        return step * min(1.0, LONGEST / max(longest, 1e-300)), 0.5 * float(step @ slope)

    def moved(self, point: Point, move: FloatArray) -> Point:
        unknowns = self.plant.unknowns
        starts = point.starts + move[self.n :].reshape(point.starts.shape) * point.sizes
        return replace(
            point, values=np.clip(point.values + move[: self.n], unknowns.lower, unknowns.upper), starts=starts
        )


def spread_noise(plant: Plant, records: Sequence[Record], point: Point) -> Point:
    """Give the point with the noise of the sensors as large as what the plant leaves unexplained there.

    Far from the truth the declared noise would make a hill of cliffs.
    """
    unknowns, n_p = plant.unknowns, plant.layout.n_p
    places = {int(place): k for k, place in enumerate(unknowns.places)}
    for _ in range(NOISE_ROUNDS):
        ratios = _unexplained(plant, records, point)
        if ratios is None:
            return point
        values = point.values.copy()
        for j, ratio in enumerate(ratios):
            if n_p + j in places and np.isfinite(ratio):
                values[places[n_p + j]] += 0.5 * np.log(np.clip(ratio, 1e-4, 1e12))
        point = replace(point, values=np.clip(values, unknowns.lower, unknowns.upper))
        if np.all(np.abs(np.log(ratios)) < 0.1):
            break
    return point


def _unexplained(plant: Plant, records: Sequence[Record], point: Point) -> FloatArray | None:
    """Give for each sensor the mean square of the standardised innovations; None where the plant has no course."""
    squares = []
    for r, record in enumerate(records):
        found = course(plant, record, point, r)
        if not np.isfinite(found.value) or not found.innovations.size:
            return None
        squares.append(found.standardised**2)
    return np.asarray(np.nanmean(np.concatenate(squares), axis=0))
