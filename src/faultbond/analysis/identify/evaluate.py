"""Likelihood, its slopes and its information over recordings."""

from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from faultbond.analysis.identify.likelihood import Layout
from faultbond.analysis.identify.samples import Record
from faultbond.analysis.identify.unknowns import Unknowns
from faultbond.spec import Engine
from faultbond.types import BoolArray, FloatArray

BLOCK = 4096  # samples whose innovations are held at a time
LOG_2_PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """All that an evaluation needs of a plant. begin: see `build_begin`; free: states whose start is to be found."""

    sensors: tuple[str, ...]
    layout: Layout
    engine: Engine
    begin: ca.Function
    base: FloatArray
    implicit: FloatArray
    unknowns: Unknowns
    free: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Point:
    """Values of the unknowns, (n,), and the starts of the free states in each recording, (n_records, n_free), SI."""

    values: FloatArray
    starts: FloatArray
    sizes: FloatArray  # (n_records, n_free): the unit in which a start is found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Evaluation:
    """What the recordings say at a point; unknowns first, then the starts of each recording.

    value: logarithm of the likelihood; score (m,), information (m, m), expected (Fisher).
    """

    value: float
    score: FloatArray
    information: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """One recording at a point, per sample.

    innovations, variances : (N, n_outputs), SI, each given the past and the sensors before it; nan where not used
    scores : (N, n), by the unknowns and the starts of this recording
    information : (n, n)
    """

    innovations: FloatArray
    variances: FloatArray
    scores: FloatArray
    information: FloatArray
    value: float

    @property
    def standardised(self) -> FloatArray:
        """Innovations in their standard deviations; white with sd 1 if the model is right."""
        return np.asarray(self.innovations / np.sqrt(self.variances))


def evaluate(plant: Plant, records: Sequence[Record], point: Point) -> Evaluation:
    """Give likelihood, score and information of all recordings; -inf where the plant has no finite course."""
    n, n_free = len(point.values), len(plant.free)
    total = n + n_free * len(records)
    value, score, information = 0.0, np.zeros(total), np.zeros((total, total))
    for r, record in enumerate(records):
        places = np.concatenate([np.arange(n), n + n_free * r + np.arange(n_free)])
        found = _run(plant, record, point, r, keep=False)
        if not np.isfinite(found.value):
            return Evaluation(value=-np.inf, score=score, information=information)
        value += found.value
        score[places] += found.scores.sum(axis=0)
        information[np.ix_(places, places)] += found.information
    sane = bool(np.all(np.isfinite(score)) and np.all(np.isfinite(information)))
    return Evaluation(value=value if sane else -np.inf, score=score, information=information)


def course(plant: Plant, record: Record, point: Point, number: int) -> Course:
    """Give what one recording, the `number`th of the point, says sample by sample."""
    return _run(plant, record, point, number, keep=True)


def _run(plant: Plant, record: Record, point: Point, number: int, *, keep: bool) -> Course:
    lanes = _lanes(plant, point, number)
    count = lanes.shape[1]
    information, value, scores, seen = np.zeros((count, count)), 0.0, [], []
    with np.errstate(all="ignore"):
        for first in range(0, len(record.time), BLOCK):
            part = slice(first, first + BLOCK)
            lanes, found = plant.engine.advance(lanes, record.samples[part])
            block = _Block(found, record.use[part], plant.layout.n_y)
            value += block.value()
            if not np.isfinite(value):
                value = -np.inf
                break
            information += block.information()
            score = block.scores()
            scores.append(score if keep else score.sum(axis=0, keepdims=True))
            if keep:
                seen.append(block.seen())
    innovations, variances = (np.concatenate(item) for item in zip(*seen, strict=True)) if seen else (np.zeros(0),) * 2
    return Course(
        innovations=innovations,
        variances=variances,
        scores=np.concatenate(scores) if scores else np.zeros((1, count)),
        information=information,
        value=value,
    )


class _Block:
    """Sums over some samples: (samples, 4 n_outputs, lanes), one direction a lane."""

    def __init__(self, found: FloatArray, use: BoolArray, n_y: int) -> None:
        self.use = use[:, :, None]
        self.e, self.s = found[:, :n_y, :1], np.where(self.use, found[:, n_y : 2 * n_y, :1], 1.0)
        self.de = np.where(self.use, found[:, 2 * n_y : 3 * n_y], 0.0)
        self.ds = np.where(self.use, found[:, 3 * n_y :], 0.0)
        self.e = np.where(self.use, self.e, 0.0)

    def value(self) -> float:
        terms = np.where(self.use, self.e**2 / self.s + np.log(self.s) + LOG_2_PI, 0.0)
        return -0.5 * float(terms.sum()) if np.all(self.s > 0.0) else -np.inf

    def scores(self) -> FloatArray:
        ratio = self.e / self.s
        return np.asarray((-ratio * self.de + 0.5 * (ratio**2 - 1.0 / self.s) * self.ds).sum(axis=1))

    def information(self) -> FloatArray:
        count = self.de.shape[2]
        by_e = (self.de / np.sqrt(self.s)).reshape(-1, count)
        by_s = (self.ds / self.s).reshape(-1, count)
        return np.asarray(by_e.T @ by_e + 0.5 * by_s.T @ by_s)

    def seen(self) -> tuple[FloatArray, FloatArray]:
        used = self.use[:, :, 0]
        return np.where(used, self.e[:, :, 0], np.nan), np.where(used, self.s[:, :, 0], np.nan)


def _lanes(plant: Plant, point: Point, number: int) -> FloatArray:
    """Give lanes (n_numbers, n) at the begin of a recording, one for each unknown and each free start."""
    layout, unknowns = plant.layout, plant.unknowns
    q, slopes = unknowns.fill(plant.base, point.values)
    start = np.zeros(layout.n_x)
    start[list(plant.free)] = point.starts[number]
    begin, by_q, by_start = (item.full() for item in plant.begin(q, start))
    n, n_free = len(point.values), len(plant.free)
    count = max(n + n_free, 1)
    along = np.zeros((layout.n_q, count))
    along[unknowns.places, np.arange(n)] = slopes
    moved = by_q @ along
    moved[:, n : n + n_free] += by_start[:, list(plant.free)] * point.sizes[number]
    held = np.concatenate([begin[:, 0], q, plant.implicit])
    return np.concatenate([np.repeat(held[:, None], count, axis=1), moved, along])
