"""Likelihood, its slopes and its information over recordings."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.fit.likelihood import Layout, Likelihood
from faultbond.fit.response import raised_inputs, way_between, with_raised
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.side_by_side import side_by_side
from faultbond.fit.unknowns import Unknowns

BLOCK = 4096  # samples whose innovations are held at a time
FIRST_BLOCK = 128  # of the first ones, each twice as long as the one before
BACK = 1e-4  # standard deviations by a unit of a start; what shows less is nothing beside what the first samples tell
LOG_2_PI = float(np.log(2.0 * np.pi))
# Of an unknown, for slopes: what a difference leaves out is less than a thousandth of a standard error.
NUDGE = 1e-5
UNHEARD = 1e6  # times the noise of a sensor, of which nothing is learned
LEAST_NUDGE = 1e-9  # part of a start; less would be lost in rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedPlant:
    """All that an evaluation needs of a plant.

    begin: see `build_begin`; base: (n_q,), q as the model file states it, see `Layout`; free: states whose start is to
    be found; own: places in q of parameters that each recording has for itself, with the sd before the data, factors.
    """

    sensors: tuple[str, ...]
    layout: Layout
    engine: Likelihood
    begin: ca.Function
    base: FloatArray
    unknowns: Unknowns
    free: tuple[int, ...]
    own: tuple[tuple[int, float], ...] = ()

    @property
    def n_own(self) -> int:
        """How many unknowns each recording has for itself."""
        return len(self.free) + len(self.own)

    def lanes(self, q: FloatArray, starts: FloatArray) -> FloatArray:
        """Give lanes (n_numbers, n) before the first sample of a recording, for each row of q (n, n_q).

        starts : (n, n_own), what the recording has for itself, see `FitPoint`
        """
        n_free = len(self.free)
        x = np.zeros((len(q), self.layout.n_x))
        x[:, list(self.free)] = starts[:, :n_free]
        q = q.copy()
        q[:, [place for place, _ in self.own]] = starts[:, n_free:]
        return np.asarray(self.begin(q.T, x.T).full())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FitPoint:
    """Values of the unknowns, (n,), and what each recording has for itself.

    starts (n_records, n_own): starts of the free states, SI, then factors of its own parameters; sizes alike: the units
    in which they are found.
    """

    values: FloatArray
    starts: FloatArray
    sizes: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """What the recordings say at a point; unknowns first, then what each recording has for itself.

    value: logarithm of the likelihood, -inf where the plant has no finite course; score (m,); information (m, m),
    expected (Fisher).
    """

    value: float
    score: FloatArray
    information: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scored:
    """One recording at a point, per sample.

    innovations, variances : (N, n_outputs), SI, each given the past and the sensors before it; nan where not used, and
        from where the plant has no finite course any more (value: -inf)
    scores : (N, n), by the unknowns and what this recording has for itself
    information : (n, n)
    """

    innovations: FloatArray
    variances: FloatArray
    scores: FloatArray
    information: FloatArray
    value: float

    def part(self, count: int) -> "Scored":
        """Give what its first samples say; of the value, and of scores and information, all."""
        return replace(self, innovations=self.innovations[:count], variances=self.variances[:count])

    @property
    def standardised(self) -> FloatArray:
        """Innovations in their standard deviations, (N, n_outputs); white with sd 1 if the model is right."""
        return np.asarray(self.innovations / np.sqrt(self.variances))


def evaluate_likelihood(plant: FittedPlant, records: Sequence[HealthyRecording], point: FitPoint) -> Evaluation:
    """Give likelihood, score and information of all recordings."""
    n, n_own = len(point.values), plant.n_own
    total = n + n_own * len(records)
    value, score, information = 0.0, np.zeros(total), np.zeros((total, total))
    for r, found in enumerate(_run_all(plant, records, point, keep=False)):
        places = np.concatenate([np.arange(n), n + n_own * r + np.arange(n_own)])
        value += found.value
        if not np.isfinite(value):
            break
        score[places] += found.scores.sum(axis=0)
        information[np.ix_(places, places)] += found.information
    sane = bool(np.isfinite(value) and np.all(np.isfinite(score)) and np.all(np.isfinite(information)))
    return Evaluation(value=value if sane else -np.inf, score=score, information=information)


def likelihood_value(plant: FittedPlant, records: Sequence[HealthyRecording], point: FitPoint) -> float:
    """Give the logarithm of the likelihood of all recordings alone; -inf where the plant has no finite course."""
    return float(likelihood_values(plant, records, [point])[0])


def likelihood_values(
    plant: FittedPlant, records: Sequence[HealthyRecording], points: Sequence[FitPoint]
) -> FloatArray:
    """Give the same at several points, (n,); eight cost as much as one, which is a fraction of what slopes do."""
    q = np.array([plant.unknowns.fill(plant.base, point.values)[0] for point in points])
    starts = np.array([point.starts for point in points])

    def values_of(record: HealthyRecording, lanes: FloatArray) -> FloatArray:
        values = np.zeros(len(points))
        with np.errstate(all="ignore"):
            for part, seen in _blocks(plant, lanes, record.samples):
                values += _values_of(*_seen(seen, record.use[part]), record.use[part])
        return values

    begun = [(record, plant.lanes(q, starts[:, r])) for r, record in enumerate(records)]
    values = np.sum(list(side_by_side(lambda item: values_of(*item), begun)), axis=0)
    return np.where(np.isfinite(values), values, -np.inf)


def innovations_of(
    plant: FittedPlant, record: HealthyRecording, point: FitPoint, number: int
) -> tuple[FloatArray, FloatArray]:
    """Give innovations and variances of one recording, (N, n_outputs), SI; 0 and 1 where they do not count."""
    with np.errstate(all="ignore"):
        blocks = list(_blocks(plant, _begun_alone(plant, point, number), record.samples))
    e, s = _seen(np.concatenate([seen for _, seen in blocks]), record.use)
    return e[:, :, 0], s[:, :, 0]


def _blocks(plant: FittedPlant, lanes: FloatArray, samples: FloatArray) -> Iterator[tuple[slice, FloatArray]]:
    """Give block by block which samples they are, and what lanes (n_numbers, n) see of them."""
    for first in range(0, len(samples), BLOCK):
        part = slice(first, first + BLOCK)
        lanes, seen = plant.engine.advance(lanes, samples[part])
        yield part, seen


def _seen(seen: FloatArray, use: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Give innovations and variances of a block, (n, n_outputs, n_lanes) each; 0 and 1 where they do not count."""
    e, s = np.split(seen, 2, axis=1)
    return np.where(use[:, :, None], e, 0.0), np.where(use[:, :, None], s, 1.0)


def _values_of(e: FloatArray, s: FloatArray, use: BoolArray) -> FloatArray:
    """Give what innovations, and their variances, of a block say, (n_lanes,)."""
    told = -0.5 * np.where(use[:, :, None], e**2 / s + np.log(s) + LOG_2_PI, 0.0).sum(axis=(0, 1))
    return np.where(np.all(s > 0.0, axis=(0, 1)), told, -np.inf)


def score_recordings(plant: FittedPlant, records: Sequence[HealthyRecording], point: FitPoint) -> tuple[Scored, ...]:
    """Give what each recording says sample by sample."""
    return tuple(_run_all(plant, records, point, keep=True))


def follow_alone(
    plant: FittedPlant, record: HealthyRecording, point: FitPoint, number: int, more: FloatArray | None = None
) -> FloatArray:
    """Give what the plant shows under the inputs of one recording alone, (N, n_outputs), SI; nan: it has no value.

    Where sensors read only at times as stated the filter asks them what they read where they do: it is told that they
    scatter so much that it learns nothing.

    more: (n_inputs,), by which each is larger, SI.
    """
    lanes, place, asks = _begun_alone(plant, point, number), plant.layout.sample_fields, plant.layout.n_held > 0
    lanes[plant.layout.output_variances] *= UNHEARD**2
    samples, found = record.samples.copy(), np.full(record.use.shape, np.nan)
    samples[:, place["use"]] = record.use if asks else 0.0
    if more is not None:
        samples = with_raised(samples, place, more)
    with np.errstate(all="ignore"):
        for part, seen in _blocks(plant, lanes, samples):
            found[part] = samples[part][:, place["y"]] - seen[:, : plant.layout.n_y, 0]
    return np.where(record.use, found, np.nan) if asks else found


def ways_of(plant: FittedPlant, records: Sequence[HealthyRecording], point: FitPoint) -> FloatArray:
    """Give how far outputs move on the whole where an input is a little larger, (n_outputs, n_inputs), SI."""
    total = np.zeros((plant.layout.n_y, plant.layout.n_u))
    for r, record in enumerate(records):
        alone = follow_alone(plant, record, point, r)
        raised = (follow_alone(plant, record, point, r, more) for more in raised_inputs(record.u))
        total += np.column_stack([way_between(alone, item) for item in raised])
    return total


def _run_all(
    plant: FittedPlant, records: Sequence[HealthyRecording], point: FitPoint, *, keep: bool
) -> Iterator[Scored]:
    """Run all recordings; with `keep` what each sample says is kept, else the sum of the scores in one row."""
    begun = [(record, *_begun(plant, point, r)) for r, record in enumerate(records)]
    return side_by_side(lambda item: _run(plant, *item, keep=keep), begun)


def _run(plant: FittedPlant, record: HealthyRecording, lanes: FloatArray, moves: FloatArray, *, keep: bool) -> Scored:
    """Run one recording from where it begins; moves (n,): by how much unknowns differ in all lanes but the first.

    Of a start only the first samples tell: a lane that has come back to the first one is followed no further.
    """
    n_y, count, kept = plant.layout.n_y, len(moves), len(record.time) if keep else 0
    information, value, left = np.zeros((count, count)), 0.0, np.arange(count)
    scores, errors, variances = np.zeros((kept or 1, count)), np.full((kept, n_y), np.nan), np.full((kept, n_y), np.nan)
    with np.errstate(all="ignore"):
        for part in _parts_of(len(record.time)):
            use = record.use[part]
            lanes, seen = plant.engine.advance(lanes, record.samples[part])
            first, scatter = _seen(seen[:, :, :1], use)
            value += float(_values_of(first, scatter, use)[0])
            e, s = first[:, :, 0], scatter[:, :, 0]
            if not np.isfinite(value):
                value = -np.inf
                break
            if keep:
                errors[part], variances[part] = np.where(use, e, np.nan), np.where(use, s, np.nan)
            slopes = (seen[:, :, 1:] - seen[:, :, :1]) / moves[left]
            e, s, use = e[:, :, None], s[:, :, None], use[:, :, None]
            e_by, s_by = (np.where(use, item, 0.0) for item in np.split(slopes, 2, axis=1))
            by_e, by_s = (item.reshape(e.size, len(left)) for item in (e_by / np.sqrt(s), s_by / s))
            information[np.ix_(left, left)] += by_e.T @ by_e + 0.5 * by_s.T @ by_s
            ratio = e / s
            score = (-ratio * e_by + 0.5 * (ratio**2 - 1.0 / s) * s_by).sum(axis=1)
            if keep:
                scores[part, left] = score
            else:
                scores[0, left] += score.sum(axis=0)
            apart = ~_has_come_back(plant, lanes) | (left < count - plant.n_own) | (left >= count - len(plant.own))
            lanes, left = lanes[:, np.concatenate([[True], apart])], left[apart]
    return Scored(innovations=errors, variances=variances, scores=scores, information=information, value=value)


def _parts_of(count: int) -> Iterator[slice]:
    """Give parts of so many samples, the first ones shorter: what a start does is over soon."""
    first, length = 0, FIRST_BLOCK
    while first < count:
        yield slice(first, first + length)
        first, length = first + length, min(2 * length, BLOCK)


def _has_come_back(plant: FittedPlant, lanes: FloatArray) -> BoolArray:
    """Tell of all lanes but the first whether they are where that is, (n,), as far as a slope by a start can show."""
    n, diagonal = plant.layout.n_mean, plant.layout.variances
    off = np.abs(lanes[:n, 1:] - lanes[:n, :1])
    return np.asarray((off**2 <= (BACK * NUDGE) ** 2 * lanes[diagonal, :1]).all(axis=0))


def _begun_alone(plant: FittedPlant, point: FitPoint, number: int) -> FloatArray:
    """Give the lane (n_numbers, 1) at the begin of a recording."""
    return plant.lanes(plant.unknowns.fill(plant.base, point.values)[0][None], point.starts[number : number + 1])


def _begun(plant: FittedPlant, point: FitPoint, number: int) -> tuple[FloatArray, FloatArray]:
    """Give lanes (n_numbers, 1 + n) at the begin of a recording: as it is, then each unknown nudged; by how much (n,).

    In the units of the unknowns; of what the recording has for itself, in its sizes.
    """
    values, starts, sizes = point.values, point.starts[number], point.sizes[number]
    own = NUDGE * sizes
    own[: len(plant.free)] = np.maximum(own, LEAST_NUDGE * np.abs(starts))[: len(plant.free)]
    n, moves = len(values), np.concatenate([np.full(len(values), NUDGE), own / sizes])
    q = np.tile(plant.unknowns.fill(plant.base, values)[0], (1 + len(moves), 1))
    for k in range(n):
        q[1 + k] = plant.unknowns.fill(plant.base, values + NUDGE * (np.arange(n) == k))[0]
    all_starts = np.tile(starts, (1 + len(moves), 1))
    all_starts[1 + n + np.arange(len(own)), np.arange(len(own))] += own
    return plant.lanes(q, all_starts), moves
