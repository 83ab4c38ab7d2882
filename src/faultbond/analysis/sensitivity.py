"""How the readings depend on the parameters and on the start, to rounding.

The plant is unrolled in time by backward Euler,

    x[k] = x[k-1] + dt[k] rates(x[k], u[k], theta, z[k]),  gap(x[k], u[k], theta, z[k]) = 0,  dt[0] = 0,

each step solved by Newton's method until nothing moves any more, and the derivatives follow from the implicit function
theorem with Jacobians by automatic differentiation. Both belong to the same equations, so a combination of parameters
that never acts shows as zero to rounding: a rank can be read off. Slow errors are taken as zero.

Source: thesis 4.2 (backward Euler over past samples); Griewank and Walther, Evaluating Derivatives, section 15.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.equations.plant import Plant
from faultbond.errors import StructureError

_ITERATIONS = 40
_PARTS = (1 / 1024, 1 / 64, 1 / 16, 1 / 4, 4.0, 16.0, 64.0)  # of Newton's step
_SETTLED = 1e-9  # relative size of a Newton step after which, converging by squares, rounding is reached
_FAST = 0.1  # a step that leaves no more of the misfit than this is as Newton's should be
_FLAT = 1e-10  # a misfit below this part of its terms need not fall any more
_TINY = 1e-300
_HUGE = 1e120
_REACHES = (1.0, 0.1, 10.0)  # of what the rates before a step bring within it
_GUESSES = (0.0, *(sign * 10.0**k for k in range(-6, 7) for sign in (1.0, -1.0)))  # of implicit signals, SI


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiment:
    """One run of the plant, all SI.

    start: (n_states,), stored quantities. inputs: (n_samples, n_inputs). dt: (n_samples,), seconds since the sample
    before, 0 for the first. theta: (n_parameters,). implicit: (n_z,), a first guess of the implicit signals.
    """

    start: FloatArray
    inputs: FloatArray
    dt: FloatArray
    theta: FloatArray
    implicit: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """A trajectory and its derivatives; arrays are read-only.

    theta: (n_parameters,), SI. x: (n_samples, n_states), stored quantities. y: (n_samples, n_outputs), SI.
    by_theta: (n_samples, n_outputs, n_parameters), change of y for a change of a parameter by its step, dy/dtheta
    times `steps` (n_parameters,): its value, so that by_theta is dy/dlog(theta), or its `scale` where the nominal is 0.
    by_start: (n_samples, n_outputs, n_states), dy/dx0.
    """

    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    states: tuple[str, ...]
    times: FloatArray
    inputs: FloatArray
    x: FloatArray
    y: FloatArray
    theta: FloatArray
    steps: FloatArray
    by_theta: FloatArray
    by_start: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recursion:
    """The equations of one step, as CasADi functions of (x, z, x before, u, theta, dt).

    misfit -> (residuals, slope by [x, z]); slopes -> (slope by [x, z], by theta, y, y by [x, z], y by theta).
    """

    plant: Plant
    misfit: ca.Function
    slopes: ca.Function


def build_recursion(plant: Plant) -> Recursion:
    """Give the backward-Euler step of a plant."""
    before, dt = ca.SX.sym("before", plant.x.numel()), ca.SX.sym("dt")
    rates, readings, gap = ca.substitute(
        [plant.rates, plant.readings, plant.gap], [plant.b], [ca.SX.zeros(plant.b.shape)]
    )
    unknown = ca.vertcat(plant.x, plant.z)
    residual = ca.vertcat(plant.x - before - dt * rates, gap)
    arguments = [plant.x, plant.z, before, plant.u, plant.theta, dt]
    slope = ca.jacobian(residual, unknown)
    parts = [slope, ca.jacobian(residual, plant.theta), readings]
    parts += [ca.jacobian(readings, unknown), ca.jacobian(readings, plant.theta)]
    return Recursion(
        plant=plant,
        misfit=ca.Function("misfit", arguments, [ca.densify(residual), ca.densify(slope)], {"cse": True}),
        slopes=ca.Function("slopes", arguments, [ca.densify(part) for part in parts], {"cse": True}),
    )


def sensitivity(recursion: Recursion, experiment: Experiment) -> Sensitivity:
    """Give the trajectory of one experiment and its derivatives.

    Raises
    ------
    StructureError
        Where the equations have no finite solution along the way.
    """
    found = sensitivities(recursion, [experiment])[0]
    if found is None:
        graph = recursion.plant.graph
        raise StructureError(
            f"{graph.file}: the equations of {graph.name} have no finite solution along this run; "
            "check the laws, the inputs and the start"
        )
    return found


def sensitivities(recursion: Recursion, experiments: Sequence[Experiment]) -> tuple[Sensitivity | None, ...]:
    """Give the trajectories of experiments of equal length, side by side; None for one without a finite solution."""
    runs = _Runs(recursion, experiments)
    with np.errstate(all="ignore"):  # a run that blows up is found and dropped
        for k in range(runs.n_samples):
            runs.step(k)
    return tuple(runs.result(lane) if runs.good[lane] else None for lane in range(len(experiments)))


_Lanes = Callable[..., list[FloatArray]]


def _in_lanes(function: ca.Function, n: int) -> _Lanes:
    """Give a function of columns as one of arrays (n, rows) with results (n, rows, columns), without CasADi's matrices.

    Those would be made of and turned into lists of Python's numbers.
    """
    buffer: Any  # its methods take one argument less than CasADi's types say
    buffer, run = function.map(n).buffer()
    slots = [np.zeros((n, function.size1_in(k))) for k in range(function.n_in())]
    results = [np.zeros((n, function.size2_out(k), function.size1_out(k))) for k in range(function.n_out())]

    def call(*arguments: FloatArray) -> list[FloatArray]:
        for k, (slot, argument) in enumerate(zip(slots, arguments, strict=True)):
            slot[...] = argument
            buffer.set_arg(k, slot.reshape(-1).data)
        for k, result in enumerate(results):
            buffer.set_res(k, result.reshape(-1).data)
        run()
        return [result.transpose(0, 2, 1).copy() for result in results]

    return call


class _Runs:
    """Experiments in lanes: arrays have the lane as their first axis."""

    def __init__(self, recursion: Recursion, experiments: Sequence[Experiment]) -> None:
        plant = recursion.plant
        n, self.n_samples = len(experiments), len(experiments[0].dt)
        self.plant = plant
        self.n_x, self.n_z, self.n_p = plant.x.numel(), plant.z.numel(), plant.theta.numel()
        n_y = plant.readings.numel()
        self.misfit_of, self.slopes_of = _in_lanes(recursion.misfit, n), _in_lanes(recursion.slopes, n)
        self.inputs = np.array([item.inputs for item in experiments]).reshape(n, self.n_samples, plant.u.numel())
        self.theta = np.array([item.theta for item in experiments]).reshape(n, self.n_p)
        self.dt = np.array([item.dt for item in experiments]).reshape(n, self.n_samples)
        start = np.array([item.start for item in experiments]).reshape(n, self.n_x)
        self.w = np.hstack([start, np.array([item.implicit for item in experiments]).reshape(n, self.n_z)])
        self.size = np.hstack([np.abs(start), np.zeros((n, self.n_z))])  # largest so far, the measure of a change
        self.good = np.ones(n, dtype=bool)
        self.moved = np.concatenate([np.zeros((n, self.n_x, self.n_p)), np.tile(np.eye(self.n_x), (n, 1, 1))], axis=2)
        self.x = np.empty((n, self.n_samples, self.n_x))
        self.y = np.empty((n, self.n_samples, n_y))
        self.by = np.empty((n, self.n_samples, n_y, self.n_p + self.n_x))
        scale = np.array([item.scale for item in plant.graph.parameters])
        zero = np.array([item.nominal == 0.0 for item in plant.graph.parameters], dtype=bool)
        self.steps = np.where(zero, scale, self.theta) if self.n_p else self.theta

    def step(self, k: int) -> None:
        """Solve sample k and carry the derivatives to it."""
        before = self.w[:, : self.n_x].copy()
        self.w, solved = self._solve_first(before) if k == 0 else self._solve(before, k)
        self.good &= solved
        self.w[~self.good] = 0.0
        self.size = np.maximum(self.size, np.abs(self.w))
        slope, by_theta, y, y_by_w, y_by_theta = self._call(self.slopes_of, self.w, before, k)
        right = np.concatenate([-by_theta * self.steps[:, None, :], np.zeros((*self.w.shape, self.n_x))], axis=2)
        right[:, : self.n_x] += self.moved
        found = self._divide(slope, right)
        self.good &= _sane(found) & _sane(y)
        self.moved = found[:, : self.n_x]
        self.x[:, k], self.y[:, k] = self.w[:, : self.n_x], y[:, :, 0]
        self.by[:, k] = y_by_w @ found
        self.by[:, k, :, : self.n_p] += y_by_theta * self.steps[:, None, :]
        self.good &= _sane(self.by[:, k])

    def result(self, lane: int) -> Sensitivity:
        """Give what was found in one lane."""
        network = self.plant.network
        return Sensitivity(
            outputs=tuple(item.name for item in self.plant.graph.sensors),
            parameters=tuple(item.name for item in self.plant.graph.parameters),
            states=tuple(item.name for item in network.states),
            times=_still(np.cumsum(self.dt[lane])),
            inputs=_still(self.inputs[lane].copy()),
            x=_still(self.x[lane].copy()),
            y=_still(self.y[lane].copy()),
            theta=_still(self.theta[lane].copy()),
            steps=_still(self.steps[lane].copy()),
            by_theta=_still(self.by[lane, :, :, : self.n_p].copy()),
            by_start=_still(self.by[lane, :, :, self.n_p :].copy()),
        )

    def _call(self, function: _Lanes, w: FloatArray, before: FloatArray, k: int) -> list[FloatArray]:
        """Evaluate a function in all lanes; each result has shape (n_lanes, rows, columns)."""
        x, z = w[:, : self.n_x], w[:, self.n_x :]
        return function(x, z, before, self.inputs[:, k], self.theta, self.dt[:, k, None])

    def _solve_first(self, start: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Solve the implicit signals at the start from the given guess, else from guesses over many sizes."""
        w, solved = self._newton(self.w, start, 0)
        for size in _GUESSES if self.n_z else ():
            if solved.all():
                break
            trial, good = self._newton(np.hstack([start, np.full((len(w), self.n_z), size)]), start, 0)
            w = np.where((good & ~solved)[:, None], trial, w)
            solved = solved | good
        return w, solved

    def _solve(self, before: FloatArray, k: int) -> tuple[FloatArray, BoolArray]:
        """Solve from where the last sample ended, else from places unlike each other that the step may reach.

        Where tanks in a row are all empty, a turbulent pipe between equal levels has an endless slope: Newton's method
        does not get away from there by itself.
        """
        w, solved = self._newton(self.w, before, k)
        if solved[self.good].all():
            return w, solved
        moved = -self._call(self.misfit_of, self.w, before, k)[0][:, : self.n_x, 0]
        unlike = 1.0 + np.arange(self.n_x) / max(1, self.n_x)
        moved = np.where(np.isfinite(moved), moved, 0.0) * unlike
        most = np.max(np.abs(moved), axis=1, initial=0.0, keepdims=True) * unlike
        for part in _REACHES:
            for way in (moved, np.abs(moved), most):
                near = np.hstack([before + part * way, self.w[:, self.n_x :]])
                trial, good = self._newton(near, before, k)
                w = np.where((good & ~solved)[:, None], trial, w)
                solved = solved | good
                if solved[self.good].all():
                    return w, solved
        return w, solved

    def _newton(self, w: FloatArray, before: FloatArray, k: int) -> tuple[FloatArray, BoolArray]:
        """Give [x, z] of sample k, and whether nothing moves any more."""
        settled = np.zeros(len(w), dtype=bool)
        misfit, slope = self._call(self.misfit_of, w, before, k)
        for _ in range(_ITERATIONS):
            move = -self._divide(slope, misfit)[:, :, 0]
            size = np.abs(w) + np.maximum(self.size, np.abs(w + move))
            settled = settled | (np.abs(move) <= _SETTLED * size).all(axis=1)
            w, misfit, slope = self._search(w, move, before, k, misfit, slope)
            if (settled | ~np.isfinite(move).all(axis=1) | ~self.good).all():
                break
        return w, settled & np.isfinite(w).all(axis=1)

    def _search(
        self, w: FloatArray, move: FloatArray, before: FloatArray, k: int, misfit: FloatArray, slope: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Take Newton's step where it does what it should, else the best of its parts and multiples.

        Parts, since an exponential is overshot from its flat side; multiples, since from its steep side Newton's step
        is ever the same small one.
        """
        terms = np.abs(slope) @ np.maximum(self.size, np.abs(w))[:, :, None] + np.abs(misfit) + _TINY
        old = np.max(np.abs(misfit) / terms, axis=(1, 2), initial=0.0)
        best, trial = self._try(w + move, before, k, terms)
        if (best <= np.maximum(_FAST * old, _FLAT))[self.good].all():
            return trial
        for part in _PARTS:
            merit, other = self._try(w + part * move, before, k, terms)
            better = merit < best
            best = np.where(better, merit, best)
            trial = (
                np.where(better[:, None], other[0], trial[0]),
                np.where(better[:, None, None], other[1], trial[1]),
                np.where(better[:, None, None], other[2], trial[2]),
            )
        return trial

    def _try(
        self, w: FloatArray, before: FloatArray, k: int, terms: FloatArray
    ) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray]]:
        """Give the misfit as a part of its terms, infinite where it is not a number, and (w, misfit, slope) there."""
        misfit, slope = self._call(self.misfit_of, w, before, k)
        part = np.max(np.abs(misfit) / terms, axis=(1, 2), initial=0.0)
        return np.where(np.isfinite(part), part, np.inf), (w, misfit, slope)

    def _divide(self, matrix: FloatArray, right: FloatArray) -> FloatArray:
        """Solve matrix @ solution = right in each lane, rows and columns scaled to like sizes; nan where singular."""
        column = np.where(self.size > 0, self.size, 1.0)
        scaled = matrix * column[:, None, :]
        row = np.max(np.abs(scaled), axis=2, initial=0.0, keepdims=True)
        row = np.where(row > 0, row, 1.0)
        bad = np.asarray(~(np.isfinite(scaled).all(axis=(1, 2)) & np.isfinite(right).all(axis=(1, 2))))
        scaled = np.where(bad[:, None, None], np.eye(matrix.shape[1]), scaled / row)
        try:
            found = np.linalg.solve(scaled, right / row)
        except np.linalg.LinAlgError:
            bad = bad | np.asarray(np.linalg.matrix_rank(scaled) < matrix.shape[1])
            found = np.linalg.solve(np.where(bad[:, None, None], np.eye(matrix.shape[1]), scaled), right / row)
        return np.where(bad[:, None, None], np.nan, found * column[:, :, None])


def _sane(array: FloatArray) -> BoolArray:
    """Whether all numbers of a lane are finite, and small enough that sums of their squares are."""
    return np.asarray((np.abs(array) < _HUGE).all(axis=(1, 2)))


def _still(array: FloatArray) -> FloatArray:
    """Make an array read-only: a frozen class does not freeze what it holds."""
    array.setflags(write=False)
    return array
