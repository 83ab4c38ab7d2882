"""Integration of a plant over the rows of a recording, to an accuracy far below any noise.

It shares the plant's equations with the engine, not its discretisation. Two methods of fixed step: the classical
Runge-Kutta method of order 4, and where that would need steps too short, Radau IIA of order 5 (stiff plants). The
number of substeps per row is doubled until the states of the whole run no longer change. Implicit relations are solved
to convergence at every stage.

Source: Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, table II.1.2; Hairer and Wanner, II,
table IV.5.6.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from math import pi, sqrt
from typing import Any, cast

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.plant import Plant
from faultbond.errors import StructureError

TOLERANCE = 1e-8  # change by the last doubling, relative to the largest size of each state
NOT_STIFF = 1e-4  # to which explicit steps come near; what keeps them from more are kinks of the laws, for any method
SUBSTEPS_EXPLICIT = (1, 2, 4, 8, 16, 32, 64)
SUBSTEPS_IMPLICIT = (1, 2, 4, 8, 16)
_ROOT_STEPS = 15
_STAGE_STEPS = 8
_PARTS = (1 / 64, 1 / 16, 1 / 4, 1.0, 4.0, 16.0)  # of Newton's step, also beyond it: see dynamics.step
_ROOT_TOLERANCE = 1e-8  # relative change by the last Newton step; it converges by squares

_S6 = sqrt(6.0)
_NODES = ((4 - _S6) / 10, (4 + _S6) / 10, 1.0)
_WEIGHTS = (
    ((88 - 7 * _S6) / 360, (296 - 169 * _S6) / 1800, (-2 + 3 * _S6) / 225),
    ((296 + 169 * _S6) / 1800, (88 + 7 * _S6) / 360, (-2 - 3 * _S6) / 225),
    ((16 - _S6) / 36, (16 + _S6) / 36, 1.0 / 9.0),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Segments:
    """Stretches of time without an event inside.

    length: (n,), s. inputs, climb: (n, n_inputs), at the begin and what they gain linearly up to the end. left, right:
    (n, n_parameters), at both ends, linear between. All SI.
    """

    length: FloatArray
    inputs: FloatArray
    climb: FloatArray
    left: FloatArray
    right: FloatArray


@dataclass(frozen=True, slots=True)
class IntegrationMethod:
    """An integration method: implicit or not, and substeps per segment."""

    implicit: bool
    substeps: int


class Integrator:
    """The equations of one plant with its actuators, ready to be integrated.

    The state s holds the plant's states, the lagged inputs, and the last solution of the implicit relations.

    Parameters
    ----------
    plant : equations
    lagged : numbers of the inputs behind a lag
    lag : its time constant, s
    curves : relative curve error, one per input

    Attributes
    ----------
    step : for a method (s, length, u, climb, left, right) -> (s after one segment, change by the last Newton step)
    rates : (moving, z, u, theta) -> (rates of what moves, gap of the implicit relations), SI
    root : (moving, z, u, theta) -> (z without a gap, change by the last Newton step)
    read : (s, u, theta) -> readings, SI
    """

    def __init__(self, plant: Plant, lagged: tuple[int, ...], lag: float, curves: tuple[float, ...]) -> None:
        self.plant = plant
        self.lagged = lagged
        self.n_x = plant.x.numel()
        self.n_y = plant.readings.numel()
        self.n_moving = self.n_x + len(lagged)
        self.n_z = plant.z.numel()
        self.step: Callable[[IntegrationMethod], ca.Function] = cache(self._make_step)
        moving = ca.SX.sym("moving", self.n_moving)
        acting = []  # the inputs behind their lag, through their curve
        for k, curve in enumerate(curves):
            value = moving[self.n_x + lagged.index(k)] if k in lagged else plant.u[k]
            acting.append(value * (1 + curve * ca.sin(2 * pi * value / 100)) if curve else value)
        old = ca.vertcat(plant.x, plant.u, plant.b)
        new = ca.vertcat(moving[: self.n_x], *(acting or [ca.SX(0, 1)]), ca.SX.zeros(plant.b.numel()))
        rates, readings, gap = ca.substitute([plant.rates, plant.readings, plant.gap], [old], [new])
        chase = [(plant.u[k] - moving[self.n_x + j]) / lag for j, k in enumerate(lagged)]
        around = [moving, plant.z, plant.u, plant.theta]
        self.rates = ca.Function("rates", around, [ca.vertcat(rates, *chase), gap])
        self.root = _root(around, gap)
        self.read = self._make_read(ca.Function("readings", around, [readings]))

    def start(self, x: FloatArray, u: FloatArray, theta: FloatArray) -> FloatArray:
        """Give the first s, (n_s,): states `x` (n_states,), actuators at rest at `u` (n_inputs,), all SI.

        The implicit relations are solved with `theta` (n_parameters,). What lags, if `x` has nan there, is where it
        settles: an input with a lag where it stands, a sensor with one at what it reads.

        Raises
        ------
        StructureError
            Where the implicit relations have no solution there.
        """
        graph, stores = self.plant.graph, self.plant.network.states
        inputs = dict(zip((item.name for item in graph.inputs), u.tolist(), strict=True))
        moving, late = np.concatenate([x, u[list(self.lagged)]]), []
        for k in np.flatnonzero(np.isnan(moving)).tolist():
            moving[k] = inputs.get(stores[k].source, 0.0)
            late += [] if stores[k].source else [k]
        s = self._solved(moving, u, theta)
        if late:  # T/n der(s) = r - s, so that where s is 0 what is read is T/n der(s)
            times = {item.name: value for item, value in zip(graph.parameters, theta.tolist(), strict=True)}
            orders = {item.name: item.order for item in graph.sensors}
            rates = self.rates(s[: self.n_moving], s[self.n_moving :], u, theta)[0].full()[:, 0]
            for owner in dict.fromkeys(stores[k].owner for k in late):
                stages = [k for k in late if stores[k].owner == owner]
                s[stages] = times[stores[stages[0]].lag] / orders[owner] * rates[stages[0]]
        return s

    def _solved(self, moving: FloatArray, u: FloatArray, theta: FloatArray) -> FloatArray:
        """Give s with the implicit relations solved."""
        if not self.n_z:
            return moving
        for size in (0.0, *(sign * 10.0**k for k in range(-6, 7) for sign in (1.0, -1.0))):
            z, change = self.root(moving, np.full(self.n_z, size), u, theta)
            if _converged(change.full(), z.full()):
                return np.concatenate([moving, z.full()[:, 0]])
        raise StructureError(
            f"{self.plant.graph.file}: {', '.join(self.plant.implicit)}: the laws have no solution at the first row; "
            "check them, or give another start"
        )

    def integrate(self, first: FloatArray, segments: Segments) -> tuple[FloatArray, IntegrationMethod, float]:
        """Integrate to the accuracy wanted, or as near to it as the plant's kinks permit.

        Parameters
        ----------
        first : float array, shape (n_s,)
        segments : n of them

        Returns
        -------
        states : float array, shape (n + 1, n_s)
        method : what was needed
        error : change by the last doubling, relative to the largest size of each state

        Raises
        ------
        StructureError
            Where no method gives finite numbers.
        """
        best: tuple[FloatArray, IntegrationMethod, float] | None = None
        for implicit, counts in ((False, SUBSTEPS_EXPLICIT), (True, SUBSTEPS_IMPLICIT)):
            before: FloatArray | None = None
            for count in counts:
                method = IntegrationMethod(implicit, count)
                states = self._run(method, first, segments)
                error = np.inf if before is None or states is None else self._difference(states, before)
                if states is not None and (best is None or error < best[2]):
                    best = states, method, error
                if error <= TOLERANCE:
                    break
                before = states
            if best is not None and best[2] <= NOT_STIFF:
                return best
        if best is None:
            raise StructureError(
                f"{self.plant.graph.file}: the plant cannot be integrated from this start with these inputs: a signal "
                "grows without limit or a law has no solution; check units, laws, start and faults"
            )
        return best

    def outputs(self, states: FloatArray, inputs: FloatArray, theta: FloatArray) -> FloatArray:
        """Give the readings without noise, (n, n_outputs), SI, of `states` (n, n_s), `inputs`, `theta` at n rows."""
        if not len(states):
            return np.zeros((0, self.n_y))
        return np.asarray(self.read.map(len(states))(states.T, inputs.T, theta.T).full().T)

    def _difference(self, states: FloatArray, before: FloatArray) -> float:
        """Give the largest difference of two runs, relative to the largest size of each state."""
        if not self.n_moving:
            return 0.0
        size = np.max(np.abs(states[:, : self.n_moving]), axis=0)
        gap = np.max(np.abs(states - before)[:, : self.n_moving], axis=0)
        return float(np.max(gap / np.where(size > 0, size, 1.0)))

    def _run(self, method: IntegrationMethod, first: FloatArray, segments: Segments) -> FloatArray | None:
        """Give the states at all ends of segments; None where they are not finite or a root was not found."""
        n = segments.length.size
        if not n:
            return first[None, :]
        many = self.step(method).mapaccum(n)
        try:
            columns = (segments.inputs.T, segments.climb.T, segments.left.T, segments.right.T)
            s, change = many(first, segments.length[None, :], *columns)
        except RuntimeError:  # casadi's word for a singular stage matrix
            return None
        states = np.vstack([first, s.full().T])
        good = bool(np.all(np.isfinite(states))) and _converged(change.full().T, states)
        return states if good else None

    def _parts(self, s: ca.SX | ca.MX) -> tuple[Any, Any]:
        """Give what moves and what is solved of s."""
        moving, z = ca.vertsplit(s, [0, self.n_moving, self.n_moving + self.n_z])
        return moving, z

    def _make_read(self, readings: ca.Function) -> ca.Function:
        """Give (s, u, theta) -> readings; without roots as one flat list of operations, which runs faster."""
        s = ca.MX.sym("s", self.n_moving + self.n_z)
        u, theta = ca.MX.sym("u", self.plant.u.numel()), ca.MX.sym("theta", self.plant.theta.numel())
        moving, z = self._parts(s)
        solved, _ = self.root(moving, z, u, theta)
        function = ca.Function("read", [s, u, theta], [ca.densify(readings(moving, solved, u, theta))])
        return function if self.n_z else function.expand()

    def _make_step(self, method: IntegrationMethod) -> ca.Function:
        """Give (s, length, u, climb, left, right) -> (s after one segment, change by the last Newton step)."""
        s = ca.MX.sym("s", self.n_moving + self.n_z)
        length, (u, climb) = ca.MX.sym("length"), (ca.MX.sym(name, self.plant.u.numel()) for name in ("u", "climb"))
        left, right = (ca.MX.sym(name, self.plant.theta.numel()) for name in ("left", "right"))
        moving, z = self._parts(s)
        advance = self._radau() if method.implicit else self._runge_kutta
        change = ca.MX.zeros(self.n_moving + self.n_z)
        h = length / method.substeps
        for number in range(method.substeps):

            def around(part: float, number: int = number) -> tuple[ca.MX, ca.MX]:
                gone = (number + part) / method.substeps
                return u + climb * gone, left + (right - left) * gone

            moving, z, last = advance(moving, z, h, around)
            change = ca.fmax(change, last)
        function = ca.Function(
            "step", [s, length, u, climb, left, right], [ca.densify(ca.vertcat(moving, z)), ca.densify(change)]
        )
        return function if self.n_z or method.implicit else function.expand()

    def _runge_kutta(
        self, moving: ca.MX, z: ca.MX, h: ca.MX, around: Callable[[float], tuple[ca.MX, ca.MX]]
    ) -> tuple[ca.MX, ca.MX, ca.MX]:
        total = slope = ca.MX.zeros(self.n_moving)
        last = ca.MX.zeros(self.n_z)
        for part, weight in ((0.0, 1 / 6), (0.5, 1 / 3), (0.5, 1 / 3), (1.0, 1 / 6)):
            here = moving + part * h * slope
            z, change = self.root(here, z, *around(part))
            last = ca.fmax(last, change)
            slope, _ = self.rates(here, z, *around(part))
            total = total + weight * slope
        return moving + h * total, z, ca.vertcat(ca.MX.zeros(self.n_moving), last)

    def _radau(self) -> Callable[..., tuple[ca.MX, ca.MX, ca.MX]]:
        """Three stages solved together by Newton's method; unknowns: states and implicit signals of each stage."""
        n = self.n_moving + self.n_z
        start, h = ca.SX.sym("start", self.n_moving), ca.SX.sym("h")
        stages, thetas = ca.SX.sym("stages", n, 3), ca.SX.sym("thetas", self.plant.theta.numel(), 3)
        u = ca.SX.sym("u", self.plant.u.numel(), 3)
        found = [
            self.rates(stages[: self.n_moving, i], stages[self.n_moving :, i], u[:, i], thetas[:, i]) for i in range(3)
        ]
        residuals = []
        for i in range(3):
            moved = sum(_WEIGHTS[i][j] * found[j][0] for j in range(3))
            residuals += [self._parts(stages[:, i])[0] - start - h * moved, found[i][1]]
        residual, unknown = ca.vertcat(*residuals), ca.vec(stages)
        system = ca.Function("system", [stages, start, h, u, thetas], [ca.jacobian(residual, unknown), residual])

        def advance(
            moving: ca.MX, z: ca.MX, h: ca.MX, around: Callable[[float], tuple[ca.MX, ca.MX]]
        ) -> tuple[ca.MX, ca.MX, ca.MX]:
            guess = ca.repmat(ca.vertcat(moving, z), 1, 3)
            acting, parts = (ca.horzcat(*item) for item in zip(*(around(node) for node in _NODES), strict=True))
            move = ca.MX.zeros(n, 3)
            for _ in range(_STAGE_STEPS):
                slope, misfit = system(guess, moving, h, acting, parts)
                move = ca.reshape(ca.solve(slope, -misfit, "qr"), n, 3)
                guess = guess + move
            return *self._parts(guess[:, 2]), ca.fabs(move[:, 2])

        return advance


class Caller:
    """Calls a function of dense columns many times, one set of numbers at a time, without conversions.

    Parameters
    ----------
    function : what to call
    """

    def __init__(self, function: ca.Function) -> None:
        self._memory = cast(Any, function).buffer()  # holds addresses: it must live as long as the arrays below
        buffer = self._memory[0]
        self._arguments = [np.zeros(function.numel_in(k)) for k in range(function.n_in())]
        self._results = [np.zeros(function.numel_out(k)) for k in range(function.n_out())]
        for k, array in enumerate(self._arguments):
            if array.size:
                buffer.set_arg(k, array.data)
        for k, array in enumerate(self._results):
            if array.size:
                buffer.set_res(k, array.data)

    def __call__(self, *arguments: FloatArray | float) -> FloatArray:
        """Give a copy of the first result."""
        for own, given in zip(self._arguments, arguments, strict=True):
            own[:] = given
        self._memory[1]()
        return self._results[0].copy()


def _root(around: list[ca.SX], gap: ca.SX) -> ca.Function:
    """Give (moving, z, u, theta) -> (z with gap = 0, size of the last Newton step); shortened steps where needed."""
    moving, z, u, theta = around
    if not z.numel():
        return ca.Function("root", around, [z, z])
    size = ca.Function("size", around, [ca.sumsqr(gap)])
    full = -ca.solve(ca.jacobian(gap, z), gap)
    best, least = z, ca.sumsqr(gap)
    for part in _PARTS:
        trial = z + part * full
        found = size(moving, trial, u, theta)
        better = found < least  # false for nan, so a wild step is never taken
        best, least = ca.if_else(better, trial, best), ca.if_else(better, found, least)
    once = ca.Function("once", around, [best, ca.fabs(full)])
    s = [ca.MX.sym(name, item.numel()) for name, item in zip(("moving", "z", "u", "theta"), around, strict=True)]
    value, change = s[1], ca.MX.zeros(z.numel())
    for _ in range(_ROOT_STEPS):
        value, change = once(s[0], value, s[2], s[3])
    return ca.Function("root", s, [value, change])


def _converged(change: FloatArray, values: FloatArray) -> bool:
    """Whether the last Newton steps were small beside the largest size of each unknown; shapes (n, m) or (m, 1)."""
    if not change.size:
        return True
    size = np.max(np.abs(values), axis=0)
    return bool(np.all(np.max(np.abs(change), axis=0) <= _ROOT_TOLERANCE * np.where(size > 0, size, 1.0)))
