"""How the readings depend on the parameters and on the start, to rounding.

The plant is unrolled in time by backward Euler,

    x[k] = x[k-1] + dt[k] rates(x[k], u[k], theta, z[k]),  gap(x[k], u[k], theta, z[k]) = 0,  dt[0] = 0,

each step solved by Newton's method until nothing moves any more, and the derivatives follow from the implicit function
theorem with Jacobians by automatic differentiation. Both belong to the same equations, so a combination of parameters
that never acts shows as zero to rounding: a rank can be read off. Slow errors are taken as zero.

Source: thesis 4.2 (backward Euler over past samples); Griewank and Walther, Evaluating Derivatives, section 15.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from faultbond.analysis.batch import Batch
from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.equations.plant import Plant
from faultbond.errors import StructureError
from faultbond.types import FaultKind

TINY = 1e-300
BIAS, GAIN = f".{FaultKind.BIAS.value}", f".{FaultKind.GAIN.value}"  # behind the name of an instrument
_HUGE = 1e120
_ITERATIONS = 40
_PARTS = np.array([1 / 1024, 1 / 64, 1 / 16, 1 / 4, 4.0, 16.0, 64.0])[:, None, None]  # of Newton's step
_SETTLED = 1e-9  # relative size of a Newton step after which, converging by squares, rounding is reached
_FAST = 0.1  # a step that leaves no more of the misfit than this is as Newton's should be
_FLAT = 1e-10  # a misfit below this part of its terms need not fall any more
_REACHES = (1.0, 0.1, 10.0)  # of what the rates before a step bring within it
_GUESSES = (0.0, *(sign * 10.0**k for k in range(-6, 7) for sign in (1.0, -1.0)))  # of implicit signals, SI


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Experiment:
    """One run of the plant, all SI.

    start: (n_states,), stored quantities. inputs: (n_samples, n_inputs). dt: (n_samples,), seconds since the sample
    before, 0 for the first. theta: (n_parameters,). implicit: (n_z,), a first guess of the implicit signals. onset: the
    sample from which parameters and instruments change; 0: they are what they are from the first sample on.
    """

    start: FloatArray
    inputs: FloatArray
    dt: FloatArray
    theta: FloatArray
    implicit: FloatArray
    onset: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sensitivity:
    """A trajectory and its derivatives; arrays are read-only.

    theta: (n_parameters,), SI. x: (n_samples, n_states), stored quantities. y: (n_samples, n_outputs), SI.
    by_theta: (n_samples, n_outputs, n_parameters), change of y for a change of a parameter by its step, dy/dtheta
    times `steps` (n_parameters,): its value, so that by_theta is dy/dlog(theta), or its `scale` where the nominal is 0.
    by_start: (n_samples, n_outputs, n_states), dy/dx0. by_unknown: (n_samples, n_outputs, n_samples * n_unknown), what
    unknown inputs do, that move at each sample by themselves.
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
    by_unknown: FloatArray

    @property
    def by_free(self) -> FloatArray:
        """What the start and unknown inputs do, none of which is known, (n_samples, n_outputs, n)."""
        return np.concatenate([self.by_start, self.by_unknown], axis=2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recursion:
    """The equations of one step, as functions of (x, z, x before, u, theta, dt).

    misfit -> (residuals, slope by [x, z]); slopes -> (slope by [x, z], by theta, y, y by [x, z], y by theta); by_inputs
    -> (slope of the residuals by u, of y by u); by_unknown -> the same by unknown inputs, n_unknown of them.
    """

    plant: Plant
    misfit: Batch
    slopes: Batch
    by_inputs: Batch
    by_unknown: Batch
    n_unknown: int


def build_recursion(plant: Plant) -> Recursion:
    """Give the backward-Euler step of a plant."""
    before, dt = ca.SX.sym("before", plant.x.numel()), ca.SX.sym("dt")
    names = {item.name for item in plant.graph.unknown_inputs}
    places = [k for k, item in enumerate(plant.graph.slow_errors) if item.wanders and item.target in names]
    free = ca.SX.sym("free", len(places))
    none = ca.SX.zeros(plant.b.shape)
    for j, k in enumerate(places):
        none[k] = free[j]
    rates, readings, gap = ca.substitute([plant.rates, plant.readings, plant.gap], [plant.b], [none])
    unknown = ca.vertcat(plant.x, plant.z)
    residual = ca.vertcat(plant.x - before - dt * rates, gap)
    arguments = [plant.x, plant.z, before, plant.u, plant.theta, dt]
    by_unknown, residual, readings = _at_rest([residual, readings], free)
    slope = ca.jacobian(residual, unknown)
    parts = [slope, ca.jacobian(residual, plant.theta), readings]
    parts += [ca.jacobian(readings, unknown), ca.jacobian(readings, plant.theta)]
    return Recursion(
        plant=plant,
        misfit=Batch(ca.Function("misfit", arguments, [ca.densify(residual), ca.densify(slope)], {"cse": True})),
        slopes=Batch(ca.Function("slopes", arguments, [ca.densify(part) for part in parts], {"cse": True})),
        by_inputs=Batch(
            ca.Function(
                "by_inputs", arguments, [ca.densify(ca.jacobian(item, plant.u)) for item in (residual, readings)]
            )
        ),
        by_unknown=Batch(ca.Function("by_unknown", arguments, by_unknown)),
        n_unknown=len(places),
    )


def _at_rest(values: list[ca.SX], free: ca.SX) -> tuple[list[ca.SX], ca.SX, ca.SX]:
    """Give the slopes of two values by unknown inputs, and the values, all where these are at their usual values."""
    slopes = [ca.densify(ca.jacobian(item, free)) for item in values]
    residual, readings, *by = ca.substitute([*values, *slopes], [free], [ca.SX.zeros(free.shape)])
    return [ca.densify(item) for item in by], residual, readings


def sensitivity(recursion: Recursion, experiment: Experiment) -> Sensitivity:
    """Give the trajectory of one experiment and its derivatives.

    Raises
    ------
    StructureError
        Where the equations have no finite solution along the way.
    """
    found = sensitivities(recursion, [experiment])[0]
    if found is None:
        raise no_solution(recursion)
    return found


def no_solution(recursion: Recursion) -> StructureError:
    """Give the error of a run along which there is no finite solution."""
    graph = recursion.plant.graph
    return StructureError(
        f"{graph.file}: the equations of {graph.name} have no finite solution along this run; "
        "check the laws, the inputs and the start"
    )


def sensitivities(
    recursion: Recursion, experiments: Sequence[Experiment], *, instruments: bool = False
) -> tuple[Sensitivity | None, ...]:
    """Give the trajectories of experiments of equal length, side by side; None for one without a finite solution.

    With `instruments`, what may be wrong with those that may fail stands behind the parameters: a bias of each, as
    `flow.bias`, of a sensor in its noise, of an input in the largest value that it has; then a gain of each input.
    """
    plant, n, m = recursion.plant, len(experiments), len(experiments[0].dt)
    n_x, n_p = plant.x.numel(), plant.theta.numel()
    inputs = np.array([item.inputs for item in experiments]).reshape(n, m, plant.u.numel())
    dt = np.array([item.dt for item in experiments]).reshape(n, m)
    theta = np.array([item.theta for item in experiments]).reshape(n, n_p)
    start = np.array([item.start for item in experiments]).reshape(n, n_x)
    implicit = np.array([item.implicit for item in experiments]).reshape(n, plant.z.numel())
    begun = np.array([item.onset for item in experiments])
    zero = np.array([item.nominal == 0.0 for item in plant.graph.parameters], dtype=bool)
    steps = np.where(zero, [item.scale for item in plant.graph.parameters], theta)
    off = _instruments(plant, inputs) if instruments else _no_instruments(plant, n)
    n_f = n_p + len(off.names)
    march = March(recursion, inputs, dt, theta, np.hstack([start, implicit]), _SETTLED)
    x, y = np.empty((n, m, n_x)), np.empty((n, m, plant.readings.numel()))
    n_v, n_s = recursion.n_unknown, n_f + n_x
    by = np.empty((*y.shape, n_s + m * n_v))
    moved = np.tile(np.eye(n_x, n_s + m * n_v, n_f), (n, 1, 1))  # of the contents, by what may fail and what is free
    with np.errstate(all="ignore"):  # a run that blows up is found and dropped
        for k in range(m):
            before = march.step(k)
            x[:, k] = march.w[:, :n_x]
            arguments = (x[:, k], march.w[:, n_x:], before, inputs[:, k], theta, dt[:, k, None])
            slope, by_theta, readings, by_w, y_by_theta = recursion.slopes(*arguments)
            there = (k >= begun)[:, None, None]
            still_there = np.zeros((*march.w.shape, n_s - n_p + m * n_v))
            right = np.concatenate([-by_theta * steps[:, None, :], still_there], axis=2)
            shown = np.concatenate([y_by_theta * steps[:, None, :], off.by_sensor], axis=2)
            if off.inputs:
                more = off.acts_more(inputs[:, k])[:, None, :]
                by_u, y_by_u = (item[:, :, off.inputs] * more for item in recursion.by_inputs(*arguments))
                right[:, :, n_f - len(off.inputs) : n_f] = -by_u
                shown = np.concatenate([shown, y_by_u], axis=2)
            right *= there
            right[:, :n_x] += moved
            if n_v:
                by_v, y_by_v = recursion.by_unknown(*arguments)
                right[:, :, n_s + k * n_v : n_s + (k + 1) * n_v] -= by_v
            found, regular = solve_scaled(slope, right, march.size)
            moved = found[:, :n_x]
            y[:, k], by[:, k] = readings[:, :, 0], by_w @ found
            by[:, k, :, :n_f] += shown * there
            if n_v:
                by[:, k, :, n_s + k * n_v : n_s + (k + 1) * n_v] += y_by_v
            march.good &= regular & sane(found, readings, by[:, k])
    return tuple(
        Sensitivity(
            outputs=tuple(item.name for item in plant.graph.sensors),
            parameters=(*(item.name for item in plant.graph.parameters), *off.names),
            states=tuple(item.name for item in plant.network.states),
            times=still(np.cumsum(dt[lane])),
            inputs=still(inputs[lane].copy()),
            x=still(x[lane].copy()),
            y=still(y[lane].copy()),
            theta=still(np.append(theta[lane], off.healthy)),
            steps=still(np.append(steps[lane], off.steps[lane])),
            by_theta=still(by[lane, :, :, :n_f].copy()),
            by_start=still(by[lane, :, :, n_f:n_s].copy()),
            by_unknown=still(by[lane, :, :, n_s:].copy()),
        )
        if march.good[lane]
        else None
        for lane in range(n)
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Instruments:
    """What may be wrong with instruments: biases of sensors, biases of inputs, gains of inputs, in this order.

    names: (n,). healthy: (n,), what they are while nothing is wrong; steps: (lanes, n), SI. by_sensor: (lanes,
    n_outputs, n_sensors), what biases of sensors do to the readings. inputs: of the others which, biases then gains.
    largest, zeros: (lanes, n_inputs), (n_inputs,), sizes of these inputs and where their unit is 0, SI.
    """

    names: tuple[str, ...]
    healthy: FloatArray
    steps: FloatArray
    by_sensor: FloatArray
    inputs: list[int]
    largest: FloatArray
    zeros: FloatArray

    def acts_more(self, inputs: FloatArray) -> FloatArray:
        """Give what acts more for a step of each, (lanes, 2 n_inputs), SI; inputs: (lanes, n), those of the sample.

        Of a bias less, since an input that reads too much is one that acts too little. A gain multiplies what an input
        is in its own unit.
        """
        return np.hstack([-self.largest, inputs[:, self.inputs[len(self.zeros) :]] - self.zeros])


def _instruments(plant: Plant, inputs: FloatArray) -> _Instruments:
    """Give what may be wrong with what may fail; inputs: (lanes, n_samples, n_inputs), SI."""
    graph, lanes = plant.graph, len(inputs)
    sensors = [k for k, item in enumerate(graph.sensors) if item.suspect]
    driven = [k for k, item in enumerate(graph.inputs) if item.suspect]
    noise = np.array([graph.sensors[k].noise or 1.0 for k in sensors])
    largest = np.max(np.abs(inputs[:, :, driven]), axis=1, initial=0.0)
    largest = np.where(largest > 0.0, largest, 1.0)
    by_sensor = np.zeros((len(graph.sensors), len(sensors)))
    by_sensor[sensors, np.arange(len(sensors))] = noise
    biased = [*(graph.sensors[k].name for k in sensors), *(graph.inputs[k].name for k in driven)]
    return _Instruments(
        names=(*(f"{name}{BIAS}" for name in biased), *(f"{graph.inputs[k].name}{GAIN}" for k in driven)),
        healthy=np.concatenate([np.zeros(len(biased)), np.ones(len(driven))]),
        steps=np.hstack([np.tile(noise, (lanes, 1)), largest, np.ones_like(largest)]),
        by_sensor=np.tile(by_sensor, (lanes, 1, 1)),
        inputs=[*driven, *driven],
        largest=largest,
        zeros=np.array([graph.inputs[k].unit.offset for k in driven]),
    )


def _no_instruments(plant: Plant, lanes: int) -> _Instruments:
    """Give none, for so many lanes."""
    return _Instruments(
        names=(),
        healthy=np.zeros(0),
        steps=np.zeros((lanes, 0)),
        by_sensor=np.zeros((lanes, plant.readings.numel(), 0)),
        inputs=[],
        largest=np.zeros((lanes, 0)),
        zeros=np.zeros(0),
    )


class March:
    """Plants side by side, solved sample by sample; arrays have the lane as their first axis.

    w: (lanes, n_w), contents and implicit signals at the last sample, SI; 0 in lanes that are not good. size: alike,
    the largest so far, the measure of a change. good: (lanes,), whether there is a solution so far.

    Parameters
    ----------
    recursion : the plant
    inputs : float array, shape (lanes, n_samples, n_inputs), SI
    dt : float array, shape (lanes, n_samples), s
    theta : float array, shape (lanes, n_parameters), SI
    begin : float array, shape (lanes, n_w), contents at the start and a first guess of the implicit signals, SI
    settled : relative size of a Newton step after which nothing moves any more
    """

    def __init__(
        self,
        recursion: Recursion,
        inputs: FloatArray,
        dt: FloatArray,
        theta: FloatArray,
        begin: FloatArray,
        settled: float,
    ) -> None:
        self.misfit_of, self.n_x = recursion.misfit, recursion.plant.x.numel()
        self.inputs, self.dt, self.theta, self.settled = inputs, dt, theta, settled
        self.w, self.good = begin.copy(), np.ones(len(begin), dtype=bool)
        self.size = np.where(np.arange(begin.shape[1]) < self.n_x, np.abs(begin), 0.0)

    def step(self, k: int) -> FloatArray:
        """Solve sample `k`, and give the contents before it, (lanes, n_states), SI."""
        before, live = self.w[:, : self.n_x].copy(), np.flatnonzero(self.good)
        w, solved = self._newton(k, live, before[live], self.w[live])
        if not solved.all():
            for guess in self._elsewhere(k, before):
                lost = np.flatnonzero(~solved)
                if not len(lost):
                    break
                w[lost], solved[lost] = self._newton(k, live[lost], before[live[lost]], guess[live[lost]])
        self.w, self.good[live] = np.zeros_like(self.w), solved
        self.w[live[solved]] = w[solved]
        self.size = np.maximum(self.size, np.abs(self.w))
        return before

    def _elsewhere(self, k: int, before: FloatArray) -> Iterator[FloatArray]:
        """Give places (lanes, n_w) to begin at: implicit signals of many sizes at the start, later what may be reached.

        Where tanks in a row are all empty, a turbulent pipe between equal levels has an endless slope: Newton's method
        does not get away from there by itself. So these places are unlike each other.
        """
        implicit = self.w[:, self.n_x :]
        if k == 0:
            for size in _GUESSES if implicit.shape[1] else ():
                yield np.hstack([before, np.full_like(implicit, size)])
            return
        moved = -self._misfit(k, np.arange(len(before)), before, self.w)[0][:, : self.n_x, 0]
        unlike = 1.0 + np.arange(self.n_x) / max(1, self.n_x)
        moved = np.where(np.isfinite(moved), moved, 0.0) * unlike
        most = np.max(np.abs(moved), axis=1, initial=0.0, keepdims=True) * unlike
        for part in _REACHES:
            for way in (moved, np.abs(moved), most):
                yield np.hstack([before + part * way, implicit])

    def _newton(self, k: int, lanes: IntArray, before: FloatArray, guess: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Give [x, z] of sample `k` in some lanes, and whether nothing moves any more."""
        w, settled, live = guess.copy(), np.zeros(len(guess), dtype=bool), np.arange(len(guess))
        misfit, slope = self._misfit(k, lanes, before, w)
        for _ in range(_ITERATIONS):
            if not len(live):
                break
            size = np.maximum(self.size[lanes[live]], np.abs(w[live]))
            found, regular = solve_scaled(slope, -misfit, size)
            move = found[:, :, 0]
            sound = regular & np.isfinite(move).all(axis=1)
            done = sound & (np.abs(move) <= self.settled * (size + np.abs(w[live]))).all(axis=1)
            settled[live[done]] = True
            w[live[done]] += move[done]
            on = sound & ~done
            live, move, size, misfit, slope = live[on], move[on], size[on], misfit[on], slope[on]
            w[live], misfit, slope = self._search(k, lanes[live], before[live], w[live], move, misfit, slope, size)
        return w, settled & np.isfinite(w).all(axis=1)

    def _search(
        self,
        k: int,
        lanes: IntArray,
        before: FloatArray,
        w: FloatArray,
        move: FloatArray,
        misfit: FloatArray,
        slope: FloatArray,
        size: FloatArray,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Take Newton's step where it does what it should, else the best of its parts and multiples.

        Parts, since an exponential is overshot from its flat side; multiples, since from its steep side Newton's step
        is ever the same small one.
        """
        terms = np.abs(slope) @ size[:, :, None] + np.abs(misfit) + TINY
        old = np.max(np.abs(misfit) / terms, axis=(1, 2), initial=0.0)
        found = w + move
        misfit, slope = self._misfit(k, lanes, before, found)
        best = _part(misfit, terms)
        slow = np.flatnonzero(best > np.maximum(_FAST * old, _FLAT))
        if not len(slow):
            return found, misfit, slope
        trial = (w[slow] + _PARTS * move[slow]).reshape(-1, w.shape[1])
        again = np.tile(slow, len(_PARTS))
        new_misfit, new_slope = self._misfit(k, lanes[again], before[again], trial)
        merit = _part(new_misfit, terms[again]).reshape(len(_PARTS), -1)
        choice, every = np.argmin(merit, axis=0), np.arange(len(slow))
        better = merit[choice, every] < best[slow]
        rows, won = (choice * len(slow) + every)[better], slow[better]
        found[won], misfit[won], slope[won] = trial[rows], new_misfit[rows], new_slope[rows]
        return found, misfit, slope

    def _misfit(self, k: int, lanes: IntArray, before: FloatArray, w: FloatArray) -> list[FloatArray]:
        x, z, inputs = w[:, : self.n_x], w[:, self.n_x :], self.inputs[lanes, k]
        return self.misfit_of(x, z, before, inputs, self.theta[lanes], self.dt[lanes, k, None])


def _part(misfit: FloatArray, terms: FloatArray) -> FloatArray:
    """Give the misfit as a part of its terms, infinite where it is not a number."""
    part = np.max(np.abs(misfit) / terms, axis=(1, 2), initial=0.0)
    return np.where(np.isfinite(part), part, np.inf)


def solve_scaled(matrix: FloatArray, right: FloatArray, size: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Solve matrix @ solution = right, and say where there is a solution.

    Parameters
    ----------
    matrix : float array, shape (..., n, n)
    right : float array, shape (..., n, m)
    size : float array, shape (..., n), sizes of the solution; rows and columns are scaled by them to like sizes

    Returns
    -------
    float array, shape (..., n, m), and bool array, shape (...,)
    """
    column = np.where(size > TINY, size, 1.0)
    scaled = matrix * column[..., None, :]
    row = np.max(np.abs(scaled), axis=-1, initial=0.0, keepdims=True)
    regular = np.asarray((np.isfinite(row) & (row > 0)).all(axis=(-2, -1)))
    row = np.where(regular[..., None, None], row, 1.0)
    unit = np.eye(matrix.shape[-1])
    scaled = np.where(regular[..., None, None], scaled / row, unit)
    try:
        found = np.linalg.solve(scaled, right / row)
    except np.linalg.LinAlgError:
        regular = regular & (np.linalg.slogdet(scaled)[0] != 0.0)
        found = np.linalg.solve(np.where(regular[..., None, None], scaled, unit), right / row)
    return np.asarray(found * column[..., None]), np.asarray(regular)


def sane(*arrays: FloatArray) -> BoolArray:
    """Whether all numbers of arrays (n_lanes, ...) are finite, and so small that sums of squares are, (n_lanes,)."""
    return np.asarray(np.all([(np.abs(item) < _HUGE).reshape(len(item), -1).all(axis=1) for item in arrays], axis=0))


def still(array: FloatArray) -> FloatArray:
    """Make an array (...,) read-only: a frozen class does not freeze what it holds."""
    array.setflags(write=False)
    return array
