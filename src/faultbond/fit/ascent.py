"""The most probable values: Fisher's scoring with damping, from several places where the hill is folded.

Each step solves (information + prior + damping) step = slope; the damping rises until the step leads higher. Source:
Levenberg 1944, Marquardt 1963; Ljung 1999, section 10.2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile

import numpy as np
from scipy.optimize import lsq_linear

from faultbond.arrays import BoolArray, FloatArray
from faultbond.fit.objective import (
    Evaluation,
    FitPoint,
    FittedPlant,
    evaluate_likelihood,
    likelihood_values,
    score_recordings,
)
from faultbond.fit.samples import HealthyRecording

TURNS = 60  # steps at most
RISE, AT_ONCE = 8.0, 8  # by which the damping rises from one step that is tried to the next; as many as one costs
PATIENCE = 2  # times so many
SETTLED = 1e-4  # nats that the next step would still bring
SOFT, STIFF = 1e-2, 1e2  # damping below which a step is nearly Newton's; the largest a step begins with
POOR, FAIR = 0.25, 0.75  # of the promise kept: the damping rises below, and falls above
LEAST_DAMPING = 1e-7
IDLE = 2  # steps in a row that bring less than what settles: a fold
BENT = 0.1  # of its gain, by which a step may differ from one along a parabola
STEPS_SEEN, LEAST_BENT = 6, 0.05  # steps whose curvature counts; the least of it, beside what was expected
LONGEST = 1.5  # step of a logarithm at most
FLAT = 1e-15  # of the largest curvature, below which there is none
START_PRIOR = 1e3  # sd of a free start, in its unit; it only keeps what does not show where it is
NOISE_ROUNDS = 4
SHAKES = 4  # rounds, where a climb is stuck
PLACES = 6  # tried in each
SHORT = 6  # steps from each
SHAKEN = 0.3  # standard errors by which they are away
NEAR = 30.0  # nats below, from where it is worth to climb
WORTH = 0.05  # nats; less is no higher place
LATELY = 4  # steps, as much as which all that are left are taken to bring at most


@dataclass(frozen=True, slots=True)
class Finish:
    """When a climb ends: where its next step would bring less than `nats`, or than `part` of what it has gained.

    Also where there is no more time for a further step, as `in_time` says.
    """

    nats: float = SETTLED
    part: float = 0.0
    in_time: Callable[[], bool] = lambda: True

    def least(self, gained: float) -> float:
        """Give how many nats are worth a step, where so many were gained."""
        return max(self.nats, self.part * gained)


TO_THE_TOP = Finish()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Summit:
    """Where a climb ended.

    posterior: logarithm of likelihood and prior; precision (m, m): information and prior; settled: whether it stands
    still; steps: evaluations used; course: posteriors after each step of the climb as the slope leads.
    """

    point: FitPoint
    evaluation: Evaluation
    posterior: float
    precision: FloatArray
    settled: bool
    steps: int
    course: tuple[float, ...] = ()

    @property
    def gained(self) -> float:
        """Nats since the climb began."""
        return self.posterior - self.course[0] if self.course else 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Step:
    """A step from somewhere: where it leads, and what it would bring if the hill were as it looks from there, nats."""

    damping: float
    point: FitPoint
    promise: float


def ascend(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    prior: FloatArray,
    *,
    anchor: FloatArray | None = None,
    turns: int | None = None,
    finish: Finish = TO_THE_TOP,
    rival: Summit | None = None,
    tell: Callable[[str], None] = lambda step: None,
) -> Summit:
    """Climb from a point.

    A law with `max` or `abs` folds the hill: on a fold the slope leads nowhere although it is not zero. So a climb that
    is stuck goes on from places around, as far away as the values are uncertain, as long as that leads higher.

    Parameters
    ----------
    plant, records : what is fitted to what
    begin : where to start
    prior : sd of each unknown about its nominal value, (n,)
    anchor : (n_records, n_own), what was known of what recordings have for themselves; None: as at `begin`
    turns : steps at most, from `begin` alone; None: as many as it takes, and from places around where it is stuck
    finish : what a further step, and a place around, has to bring
    rival : another climb: this one ends, too, where it is behind that after as many steps, and would stay below its end
        if all steps that are left brought as much as the last few
    tell : takes which step of how many comes, and what those before it have gained
    """
    hill = _Hill(plant, records, begin.starts if anchor is None else anchor, prior, tell)
    now = hill.at(begin)
    hill.foot = now.posterior
    now = _straight(hill, now, TURNS if turns is None else turns, finish, rival=rival)
    if turns is not None:
        return replace(now, steps=hill.calls)
    course = now.course
    rng = np.random.default_rng(len(prior))
    for shake in range(SHAKES):
        if now.settled or not np.isfinite(now.posterior) or not finish.in_time():
            break
        best = now
        for place in range(PLACES):
            trial = hill.at(hill.moved(now.point, hill.random_move(now, rng)))
            if trial.posterior > now.posterior - NEAR:
                around = f" from place {shake * PLACES + place + 1} of at most {SHAKES * PLACES} around"
                trial = _straight(hill, trial, SHORT, finish, around)
            best = max(best, trial, key=lambda item: item.posterior)
        worse = best.posterior - now.posterior < max(WORTH, finish.least(now.posterior - hill.foot))
        now = replace(best if worse else _straight(hill, best, TURNS, finish), settled=worse)
    return replace(now, steps=hill.calls, course=course)


def _straight(
    hill: "_Hill", now: Summit, most: int, finish: Finish, begun: str = "", rival: Summit | None = None
) -> Summit:
    """Climb as the slope leads, so many steps at most, until a step would bring too little.

    begun : says where, for who is told of the steps
    """
    heights = [now.posterior]
    damping, seen, idle, settled, wary = 1e-3, list[tuple[FloatArray, FloatArray]](), 0, 0.0, False
    for turn in range(most):
        behind = _stays_behind(heights, most - turn, rival)
        if not np.isfinite(now.posterior) or idle >= IDLE or behind or not finish.in_time():
            break
        hill.tell(f"{turn + 1} of at most {most}{begun}, {now.posterior - hill.foot:.0f} nats gained")
        slope, damping, precision = hill.slope(now), min(damping, STIFF), as_bent(now.precision, seen)
        settled = max(settled, finish.least(now.posterior - hill.foot))
        step = hill.step(now, precision, slope, damping)
        if step.promise <= settled and damping <= SOFT:  # damping also holds what the data hardly fix
            step = hill.step(now, precision, slope, LEAST_DAMPING)
        if step.promise <= settled and step.damping <= SOFT:
            return replace(now, settled=True, course=tuple(heights))
        trial = None if wary else hill.at(step.point)
        if trial is None or not trial.posterior > now.posterior:
            first = step.damping if trial is None else RISE * step.damping
            found = _highest(hill, now, precision, slope, first, settled)
            if found is None:
                still = first <= SOFT and hill.step(now, precision, slope, SOFT).promise <= settled
                return replace(now, settled=still, course=tuple(heights))
            step, trial, wary = found, hill.at(found.point), trial is not None or found.damping > first
        gain = trial.posterior - now.posterior
        if not gain > 0.0:
            break
        damping, kept = step.damping, gain / max(step.promise, 1e-300)
        if kept < POOR:
            damping *= 4.0
        elif kept > FAIR:
            damping = max(damping / RISE, LEAST_DAMPING)
        idle = idle + 1 if gain < settled else 0
        moved, after = hill.away(trial.point) - hill.away(now.point), hill.slope(trial)
        parabola = abs(0.5 * float(moved @ (slope + after)) - gain) <= BENT * gain
        seen = [*seen[1 - STEPS_SEEN :], (moved, slope - after)] if parabola else []
        now = trial
        heights.append(now.posterior)
    return replace(now, settled=False, course=tuple(heights))


def _highest(
    hill: "_Hill", now: Summit, precision: FloatArray, slope: FloatArray, damping: float, settled: float
) -> _Step | None:
    """Give which of many steps leads highest, from one with so much damping on; None: none leads higher.

    Slopes cost several times as much as a height, and the heights of AT_ONCE steps as much as that of one.
    """
    for _ in range(PATIENCE):
        tried = [hill.step(now, precision, slope, damping * RISE**k) for k in range(AT_ONCE)]
        steps = [*takewhile(lambda step: step.promise > settled or step.damping > SOFT, tried)]
        if not steps:
            return None
        heights = hill.heights([item.point for item in steps])
        if heights.max() > now.posterior:
            return steps[int(np.argmax(heights))]
        damping *= RISE**AT_ONCE
    return None


def _stays_behind(heights: Sequence[float], left: int, rival: Summit | None) -> bool:
    """Tell whether a climb is behind another one, and stays so if each step that is left brings as much as the last."""
    if rival is None or len(heights) <= LATELY:
        return False
    lately = (heights[-1] - heights[-1 - LATELY]) / LATELY
    then = rival.course[min(len(heights), len(rival.course)) - 1]
    return heights[-1] < then and heights[-1] + left * lately < rival.posterior


def as_bent(precision: FloatArray, seen: Sequence[tuple[FloatArray, FloatArray]]) -> FloatArray:
    """Give a precision (m, m) with the curvature that steps have seen: each the move, and by what the slope fell.

    The information is what is expected if the model is right; where errors go with each other the hill is another one.
    Source: formula of Broyden, Fletcher, Goldfarb and Shanno; Nocedal and Wright 2006, (6.19).
    """
    for moved, fell in seen:
        along, bent = precision @ moved, float(moved @ fell)
        if bent > LEAST_BENT * float(moved @ along) > 0.0:
            precision = precision - np.outer(along, along) / (moved @ along) + np.outer(fell, fell) / bent
    return precision


class _Hill:
    """The posterior over the unknowns and what recordings have for themselves."""

    def __init__(
        self,
        plant: FittedPlant,
        records: Sequence[HealthyRecording],
        anchor: FloatArray,
        prior: FloatArray,
        tell: Callable[[str], None],
    ) -> None:
        self.tell, self.foot = tell, 0.0  # foot: where the climb begins
        self.plant, self.records, self.anchor = plant, records, anchor
        self.n, self.calls = len(prior), 0
        n_own = anchor.size
        self.weight = 1.0 / np.concatenate([prior, np.full(n_own, START_PRIOR)]) ** 2
        self.logarithmic = np.concatenate([plant.unknowns.logarithmic, np.zeros(n_own, dtype=bool)])
        self.plain: BoolArray = np.ones(self.n + n_own, dtype=bool)  # parameters and starts; the others are noise
        self.plain[plant.unknowns.n_theta : self.n] = False

    def away(self, point: FitPoint) -> FloatArray:
        """Give how far a point lies from what was known, in units of the unknowns."""
        starts = ((point.starts - self.anchor) / point.sizes).ravel()
        return np.concatenate([point.values - self.plant.unknowns.nominal, starts])

    def heights(self, points: Sequence[FitPoint]) -> FloatArray:
        """Give the posterior alone, (n,)."""
        off = np.array([np.sum(self.weight * self.away(point) ** 2) for point in points])
        return likelihood_values(self.plant, self.records, points) - 0.5 * off

    def at(self, point: FitPoint) -> Summit:
        self.calls += 1
        found = evaluate_likelihood(self.plant, self.records, point)
        return Summit(
            point=point,
            evaluation=found,
            posterior=found.value - 0.5 * float(np.sum(self.weight * self.away(point) ** 2)),
            precision=found.information + np.diag(self.weight),
            settled=False,
            steps=self.calls,
        )

    def slope(self, now: Summit) -> FloatArray:
        return now.evaluation.score - self.weight * self.away(now.point)

    def step(self, now: Summit, precision: FloatArray, slope: FloatArray, damping: float) -> _Step:
        """Give a step with so much damping."""
        move, promise = self.move(now, precision, slope, damping)
        return _Step(damping, self.moved(now.point, move), promise)

    def move(self, now: Summit, precision: FloatArray, slope: FloatArray, damping: float) -> tuple[FloatArray, float]:
        """Give the step, and what it would bring if the hill were as it looks from here.

        It is the highest place of that hill, made steeper by the damping, among those that it may reach: of what the
        data hardly fix it may lie anywhere, and must not make the way of the others short.
        """
        if not len(slope):
            return np.zeros(0), 0.0
        least, most = self.ends(now.point)
        scale = np.sqrt(np.maximum(np.diag(precision), 1e-300))
        matrix = precision / np.outer(scale, scale)
        matrix[np.diag_indices_from(matrix)] += damping
        values, vectors = np.linalg.eigh(matrix)
        root = np.sqrt(np.maximum(values, FLAT * values[-1]))
        aim = vectors.T @ (slope / scale) / root
        found = lsq_linear(root[:, None] * vectors.T, aim, (least * scale, most * scale), method="bvls")
        step = np.asarray(found.x) / scale
        return step, float(step @ slope - 0.5 * step @ precision @ step)

    def ends(self, point: FitPoint) -> tuple[FloatArray, FloatArray]:
        """Give how far each unknown may go down, and up, in one step."""
        longest = np.where(self.logarithmic, LONGEST, np.inf)
        least, most = -longest, longest.copy()
        least[: self.n] = np.maximum(least[: self.n], self.plant.unknowns.lower - point.values)
        most[: self.n] = np.minimum(most[: self.n], self.plant.unknowns.upper - point.values)
        return least, most

    def random_move(self, now: Summit, rng: np.random.Generator) -> FloatArray:
        """Give a move of parameters and starts about as long as they are uncertain."""
        precision = now.precision[np.ix_(self.plain, self.plain)]
        scale = 1.0 / np.sqrt(np.maximum(np.diag(precision), 1e-300))
        values, vectors = np.linalg.eigh(precision * np.outer(scale, scale))
        spread = vectors @ (rng.standard_normal(len(scale)) / np.sqrt(np.maximum(values, 1e-9)))
        move = np.zeros(len(self.plain))
        move[self.plain] = SHAKEN * scale * spread
        return move

    def moved(self, point: FitPoint, move: FloatArray) -> FitPoint:
        unknowns = self.plant.unknowns
        starts = point.starts + move[self.n :].reshape(point.starts.shape) * point.sizes
        return replace(
            point, values=np.clip(point.values + move[: self.n], unknowns.lower, unknowns.upper), starts=starts
        )


def spread_noise(plant: FittedPlant, records: Sequence[HealthyRecording], point: FitPoint) -> FitPoint:
    """Give the point with the noise of the sensors as large as what the plant leaves unexplained there.

    Far from the truth the declared noise would make a hill of cliffs.
    """
    unknowns, n_p = plant.unknowns, plant.layout.n_p
    places = {int(place): k for k, place in enumerate(unknowns.places)}
    for _ in range(NOISE_ROUNDS):
        found = score_recordings(plant, records, point)
        if not all(np.isfinite(item.value) and item.innovations.size for item in found):
            return point
        ratios = np.nanmean(np.concatenate([item.standardised**2 for item in found]), axis=0)
        values = point.values.copy()
        for j, ratio in enumerate(ratios):
            if n_p + j in places and np.isfinite(ratio):
                values[places[n_p + j]] += 0.5 * np.log(np.clip(ratio, 1e-4, 1e12))
        point = replace(point, values=np.clip(values, unknowns.lower, unknowns.upper))
        if np.all(np.abs(np.log(ratios)) < 0.1):
            break
    return point
