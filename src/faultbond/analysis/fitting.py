"""Fits of parameters to noise-free outputs, many at a time, with exact derivatives.

Levenberg-Marquardt in logarithms of the parameters, each fit in a lane of its own. The start of the plant is free as
well, since nobody knows it. Source: Levenberg 1944, Marquardt 1963 (damping scaled by the columns).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.analysis.experiment import random_experiments
from faultbond.analysis.operation import reference_levels, times
from faultbond.analysis.sensitivity import Experiment, Recursion, sensitivities
from faultbond.dynamics.step import StepModel
from faultbond.errors import StructureError
from faultbond.types import BoolArray, FloatArray, IntArray

ITERATIONS = 45
GENTLE = 0.3  # part of an input by which it moves
EXACT = 1e-8  # misfit, in sizes of the outputs, below which outputs are the same
_HOPELESS = 1e3  # misfit of a lane without a solution
_MOST_STEP = 1.5  # in logarithms
_STALLED = 5  # iterations without gain after which a lane rests


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Side:
    """Plants to be fitted, one per lane: theta (lanes, n_parameters), SI; free, which of them may move; start."""

    theta: FloatArray
    free: BoolArray
    start: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """Where each lane ended: one theta (lanes, n_parameters) per side, and the misfit (lanes,)."""

    theta: tuple[FloatArray, ...]
    misfit: FloatArray

    @property
    def exact(self) -> BoolArray:
        """Whether the outputs are the same, by lane."""
        return np.asarray(self.misfit < EXACT)


def long_run(model: StepModel, recursion: Recursion, thetas: Sequence[FloatArray] = ()) -> Experiment:
    """Give a long run that excites all that the plant has: the random runs of `experiment`, one after another.

    Where not every plant has a finite solution along it, one of them, else one whose inputs move about their
    references.

    Parameters
    ----------
    model, recursion : the plant
    thetas : other parameters, (n_parameters,), with which it must have a solution too

    Raises
    ------
    StructureError
        Where there is none along any of them.
    """
    graph = model.plant.graph
    nominal = np.array([item.nominal for item in graph.parameters])
    start = model.contents(model.reference_state, nominal).full()[:, 0]
    runs = [replace(item, theta=nominal, start=start) for item in random_experiments(model, recursion)]
    joined = replace(
        runs[0],
        inputs=np.vstack([item.inputs for item in runs]),
        dt=np.concatenate([item.dt for item in runs]),
    )
    moves = np.random.default_rng(0).uniform(1.0 - GENTLE, 1.0 + GENTLE, runs[0].inputs.shape)
    gentle = replace(runs[0], inputs=times(model, reference_levels(model), moves))
    for trial in (joined, *runs, gentle):
        plants = [trial, *(replace(trial, theta=theta) for theta in thetas)]
        if all(item is not None for item in sensitivities(recursion, plants)):
            return trial
    raise StructureError(
        f"{graph.file}: the equations of {graph.name} have no finite solution along random inputs, or not with other "
        "values of the parameters; check the laws and their units, or narrow the ranges of the parameters"
    )


def fit(recursion: Recursion, run: Experiment, side: Side, data: FloatArray) -> Fit:
    """Fit each lane to its own outputs, shape (lanes, n_samples, n_outputs)."""
    return _LevenbergMarquardt(recursion, run, (side,), data).run()


def fit_together(recursion: Recursion, run: Experiment, one: Side, other: Side) -> Fit:
    """Move both plants of each lane until their outputs are the same."""
    return _LevenbergMarquardt(recursion, run, (one, other), None).run()


class _LevenbergMarquardt:
    """All lanes at once. An unknown is a logarithm, or where the nominal is 0 a multiple of the scale, or a start."""

    def __init__(self, recursion: Recursion, run: Experiment, sides: tuple[Side, ...], data: FloatArray | None) -> None:
        parameters = recursion.plant.graph.parameters
        self.recursion, self.run_along, self.sides, self.data = recursion, run, sides, data
        self.linear = np.array([item.nominal == 0.0 for item in parameters], dtype=bool)
        self.scale = np.array([item.scale for item in parameters])
        self.n_lanes, self.n_p = sides[0].theta.shape
        self.n_x = sides[0].start.shape[1]
        sample = sensitivities(recursion, [run])[0]
        if sample is None:
            raise StructureError(f"{recursion.plant.graph.file}: no finite solution along the run to be fitted")
        self.size = np.sqrt(np.mean(sample.y**2, axis=0)) + 1e-300
        self.n_rows = sample.y.size
        self.active = np.hstack(
            [np.hstack([side.free, np.ones((self.n_lanes, self.n_x), dtype=bool)]) for side in sides]
        )
        self.points = np.hstack([np.hstack([self._coordinates(side.theta), side.start]) for side in sides])
        self.signs = [np.where(self.linear, 1.0, np.sign(side.theta)) for side in sides]

    def run(self) -> Fit:
        """Iterate until every lane is exact, or rests."""
        points, damping = self.points, np.full(self.n_lanes, 1e-2)
        misfit, slope = self._misfit(points, np.arange(self.n_lanes))
        cost, idle = _cost(misfit), np.zeros(self.n_lanes, dtype=int)
        for _ in range(ITERATIONS):
            lanes = np.flatnonzero((cost > 1e-13) & (idle < _STALLED))
            if not len(lanes):
                break
            trial = points[lanes] + self._step(misfit[lanes], slope[lanes], damping[lanes], lanes)
            new_misfit, new_slope = self._misfit(trial, lanes)
            new_cost = _cost(new_misfit)
            better = new_cost < cost[lanes]
            won = lanes[better]
            idle[lanes] = np.where(new_cost < 0.99 * cost[lanes], 0, idle[lanes] + 1)
            points[won], misfit[won], slope[won], cost[won] = (
                item[better] for item in (trial, new_misfit, new_slope, new_cost)
            )
            damping[lanes] = np.clip(np.where(better, damping[lanes] / 8, damping[lanes] * 5), 1e-12, 1e8)
        return Fit(theta=tuple(self._theta(points, side) for side in range(len(self.sides))), misfit=cost)

    def _coordinates(self, theta: FloatArray) -> FloatArray:
        return np.where(self.linear, theta / self.scale, np.log(np.maximum(np.abs(theta), 1e-300)))

    def _theta(self, points: FloatArray, side: int, lanes: IntArray | slice = slice(None)) -> FloatArray:
        width = self.n_p + self.n_x
        part = points[:, side * width : side * width + self.n_p]
        signs = self.signs[side][lanes]
        return np.asarray(np.where(self.linear, part * self.scale, signs * np.exp(np.where(self.linear, 0.0, part))))

    def _misfit(self, points: FloatArray, lanes: IntArray) -> tuple[FloatArray, FloatArray]:
        """Give misfits (lanes, rows) and slopes (lanes, rows, unknowns) of some lanes, in sizes of the outputs."""
        width = self.n_p + self.n_x
        experiments = [
            replace(self.run_along, theta=theta, start=point[side * width + self.n_p : (side + 1) * width])
            for side in range(len(self.sides))
            for point, theta in zip(points, self._theta(points, side, lanes), strict=True)
        ]
        found = sensitivities(self.recursion, experiments)
        misfit = np.full((len(lanes), self.n_rows), _HOPELESS)
        slope = np.zeros((len(lanes), self.n_rows, len(self.sides) * width))
        for row, lane in enumerate(lanes):
            results = [found[row + side * len(lanes)] for side in range(len(self.sides))]
            good = [item for item in results if item is not None]
            if len(good) < len(results):
                continue
            target = self.data[lane] if self.data is not None else good[1].y
            misfit[row] = ((good[0].y - target) / self.size).reshape(-1)
            for side, item in enumerate(good):
                by = np.concatenate([item.by_theta, item.by_start], axis=2) / self.size[:, None]
                slope[row, :, side * width : (side + 1) * width] = (1 - 2 * side) * by.reshape(self.n_rows, width)
        return misfit, slope * self.active[lanes][:, None, :]

    def _step(
        self,
        misfit: FloatArray,
        slope: FloatArray,
        damping: FloatArray,
        lanes: IntArray,
    ) -> FloatArray:
        length = np.sqrt(np.sum(slope**2, axis=1))
        length = np.where(length > 0, length, 1.0)
        unit = slope / length[:, None, :]
        normal = unit.transpose(0, 2, 1) @ unit
        normal += damping[:, None, None] * np.eye(normal.shape[1]) + 1e-14 * np.eye(normal.shape[1])
        right = -(unit.transpose(0, 2, 1) @ misfit[:, :, None])
        step = np.linalg.solve(normal, right)[:, :, 0] / length * self.active[lanes]
        width = self.n_p + self.n_x
        moves = np.hstack([step[:, side * width : side * width + self.n_p] for side in range(len(self.sides))])
        longest = np.max(np.abs(moves), axis=1, initial=1e-300)
        return np.asarray(step * np.minimum(1.0, _MOST_STEP / longest)[:, None])


def _cost(misfit: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.mean(misfit**2, axis=1)))
