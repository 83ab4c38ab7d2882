"""Plants side by side along one run, with derivatives by a few of their parameters and by the start.

The equations are those of `sensitivity`. Here all samples are solved together: Newton's method on the whole run, whose
equations couple each sample to the one before, begun at a trajectory nearby. A lane that does not settle so is solved
sample by sample. This is what fits need, which ask the same again and again, a little further on each time.

Source: Bock 1987 (simulation and sensitivities along one linearised trajectory); Griewank and Walther, section 15.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.analysis.batch import Batch
from faultbond.analysis.sensitivity import TINY, Experiment, March, Recursion, sane, solve_scaled
from faultbond.arrays import BoolArray, FloatArray, IntArray

SETTLED = 1e-7  # relative size of a step after which, converging by squares, little more than rounding is left
_ITERATIONS = 9  # on a whole run
_SLOW = 0.9  # a step this part of the one before is no progress
MOST_NUMBERS = 3 * 10**6  # in the slopes of one batch of lanes


def never() -> bool:
    """Say no: there is time."""
    return False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lanes:
    """Plants side by side: theta (lanes, n_parameters), start (lanes, n_states), both SI.

    places: (lanes, k), positions of the parameters by which derivatives are wanted; -1: none.
    """

    theta: FloatArray
    start: FloatArray
    places: IntArray

    def only(self, chosen: IntArray | BoolArray) -> "Lanes":
        """Give some of the lanes, by their positions or by a mask (lanes,)."""
        return Lanes(theta=self.theta[chosen], start=self.start[chosen], places=self.places[chosen])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Paths:
    """What the lanes do: w (lanes, samples, n_w), contents and implicit signals; y (lanes, samples, n_outputs).

    w_by, y_by: (.., k + n_states), by the parameters of `places`, for a change by their `step`, and by the start.
    good: (lanes,), whether there is a solution; the numbers of other lanes mean nothing.
    """

    w: FloatArray
    y: FloatArray
    w_by: FloatArray
    y_by: FloatArray
    good: BoolArray


class Trajectory:
    """A run with the plant's equations along it."""

    def __init__(self, recursion: Recursion, run: Experiment) -> None:
        plant = recursion.plant
        self.recursion, self.run, self.inputs = recursion, run, run.inputs
        self.n_x, self.n_z, self.n_p = plant.x.numel(), plant.z.numel(), plant.theta.numel()
        self.n_w, self.n_y, self.n_samples = self.n_x + self.n_z, plant.readings.numel(), len(run.dt)
        parameters = plant.graph.parameters
        self.linear = np.array([item.nominal == 0.0 for item in parameters], dtype=bool)
        self.scale = np.array([item.scale for item in parameters])

    @property
    def most_lanes(self) -> int:
        """How many lanes fit into one batch."""
        return max(1, MOST_NUMBERS // (self.n_samples * max(1, self.n_w * (self.n_w + self.n_p))))

    def alone(self, theta: FloatArray) -> FloatArray | None:
        """Give the trajectory (samples, n_w) of one plant from the start of the run, or None."""
        lanes = Lanes(theta=theta[None], start=self.run.start[None], places=np.zeros((1, 0), dtype=np.intp))
        w, good = self._one_by_one(lanes, never)
        return w[0] if good[0] else None

    def follow(self, lanes: Lanes, guess: FloatArray, stop: Callable[[], bool] = never) -> Paths:
        """Give what the lanes do.

        Parameters
        ----------
        lanes : the plants
        guess : float array, shape (lanes, samples, n_w), trajectories nearby, SI
        stop : whether to give up; then nothing is good that these do not lead to
        """
        with np.errstate(all="ignore"):
            w, inverse, good = self._together(lanes, guess)
            lost = np.flatnonzero(~good)
            if len(lost) and not stop():
                w[lost], good[lost] = self._one_by_one(lanes.only(lost), stop)
                found = np.flatnonzero(good[lost])
                if len(found):
                    again = lanes.only(lost[found])
                    _, inverse[lost[found]], good[lost[found]] = self._together(again, w[lost[found]])
            return self._derivatives(lanes, w, inverse, good)

    def _together(self, lanes: Lanes, guess: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """Solve all samples of all lanes; give trajectories, inverse slopes and whether they settled."""
        w, n = guess.copy(), len(guess)
        good, left = np.zeros(n, dtype=bool), np.full(n, np.inf)
        inverse = np.zeros((n, self.n_samples, self.n_w, self.n_w))
        live, unit = np.arange(n), np.eye(self.n_w)
        for _ in range(_ITERATIONS):
            misfit, slope = self._call(self.recursion.misfit, lanes.only(live), w[live])
            size = np.maximum(np.max(np.abs(w[live]), axis=1, keepdims=True, initial=0.0), TINY)
            inverse[live], each = solve_scaled(slope, unit, size)
            regular = each.all(axis=1)
            move = self._forward(inverse[live], -misfit[..., 0])
            w[live] += move
            far = np.max(np.abs(move) / (size + np.abs(w[live])), axis=(1, 2), initial=0.0)
            sound = regular & np.isfinite(far)
            good[live] = sound & (far <= SETTLED)
            keep = sound & ~good[live] & ((far < _SLOW * left[live]) | (far > 0.1))
            left[live] = far
            live = live[keep]
            if not len(live):
                break
        return w, inverse, good

    def _forward(self, inverse: FloatArray, right: FloatArray) -> FloatArray:
        """Solve the linearised run: slope[k] move[k] = right[k] + move[k-1] of the states."""
        moves, before = np.zeros_like(right), np.zeros_like(right[:, 0])
        for k in range(self.n_samples):
            now = right[:, k].copy()
            now[:, : self.n_x] += before[:, : self.n_x]
            before = moves[:, k] = (inverse[:, k] @ now[:, :, None])[:, :, 0]
        return moves

    def _derivatives(self, lanes: Lanes, w: FloatArray, inverse: FloatArray, good: BoolArray) -> Paths:
        n, width = len(w), lanes.places.shape[1]
        _, by_theta, y, y_by_w, y_by_theta = self._call(self.recursion.slopes, lanes, w)
        steps = np.where(self.linear, self.scale, lanes.theta)
        steps = np.where(lanes.places >= 0, np.take_along_axis(steps, lanes.places, axis=1), 0.0)[:, None, None, :]
        places = np.broadcast_to(lanes.places[:, None, None, :], (n, self.n_samples, 1, width))
        chosen = -np.take_along_axis(by_theta, places, axis=3) * steps
        w_by = np.zeros((n, self.n_samples, self.n_w, width + self.n_x))
        before = np.tile(np.eye(self.n_x, width + self.n_x, width), (n, 1, 1))
        for k in range(self.n_samples):
            right = np.zeros((n, self.n_w, width + self.n_x))
            right[:, :, :width] = chosen[:, k]
            right[:, : self.n_x] += before
            w_by[:, k] = inverse[:, k] @ right
            before = w_by[:, k, : self.n_x]
        y_by = y_by_w @ w_by
        y_by[..., :width] += np.take_along_axis(y_by_theta, places, axis=3) * steps
        return Paths(w=w, y=y[..., 0], w_by=w_by, y_by=y_by, good=good & sane(w, y, w_by, y_by))

    def _call(self, function: Batch, lanes: Lanes, w: FloatArray) -> list[FloatArray]:
        """Evaluate a function at all samples; each result has shape (lanes, samples, rows, columns)."""
        n, m = len(w), self.n_samples
        x, z = w[:, :, : self.n_x], w[:, :, self.n_x :]
        before = np.concatenate([lanes.start[:, None], x[:, :-1]], axis=1)
        arguments = (
            x.reshape(n * m, self.n_x),
            z.reshape(n * m, self.n_z),
            before.reshape(n * m, self.n_x),
            np.tile(self.inputs, (n, 1)),
            np.repeat(lanes.theta, m, axis=0),
            np.tile(self.run.dt[:, None], (n, 1)),
        )
        return [item.reshape(n, m, *item.shape[1:]) for item in function(*arguments)]

    def _one_by_one(self, lanes: Lanes, stop: Callable[[], bool]) -> tuple[FloatArray, BoolArray]:
        """Solve one sample after another; give trajectories and whether there are any."""
        n, m = len(lanes.start), self.n_samples
        inputs, dt = np.broadcast_to(self.inputs, (n, *self.inputs.shape)), np.broadcast_to(self.run.dt, (n, m))
        begin = np.hstack([lanes.start, np.tile(self.run.implicit, (n, 1))])
        march = March(self.recursion, inputs, dt, lanes.theta, begin, SETTLED)
        w = np.zeros((n, m, self.n_w))
        with np.errstate(all="ignore"):
            for k in range(m):
                if not march.good.any() or stop():
                    return w, np.zeros(n, dtype=bool)
                march.step(k)
                w[:, k] = march.w
        return w, march.good


def lanes_of(thetas: Sequence[FloatArray], start: FloatArray, places: Sequence[Sequence[int]]) -> Lanes:
    """Give lanes that begin at one start (n_states,), with sets of any size to be moved."""
    width = max((len(item) for item in places), default=0)
    filled = np.full((len(places), width), -1, dtype=np.intp)
    for row, item in enumerate(places):
        filled[row, : len(item)] = item
    return Lanes(theta=np.array(thetas), start=np.tile(start, (len(thetas), 1)), places=filled)
