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
from faultbond.analysis.sensitivity import Experiment, Recursion
from faultbond.arrays import BoolArray, FloatArray, IntArray

SETTLED = 1e-7  # relative size of a step after which, converging by squares, little more than rounding is left
_ITERATIONS = 9  # on a whole run
_ITERATIONS_ALONE = 40  # on a single sample
_SLOW = 0.9  # a step this part of the one before is no progress
_PARTS = (1 / 1024, 1 / 64, 1 / 16, 1 / 4, 4.0, 16.0, 64.0)  # of Newton's step
_FAST = 0.1  # a step that leaves no more of the misfit than this is as Newton's should be
_FLAT = 1e-10  # a misfit below this part of its terms need not fall any more
_TINY = 1e-300
_HUGE = 1e120
_GUESSES = (0.0, *(sign * 10.0**k for k in range(-6, 7) for sign in (1.0, -1.0)))  # of implicit signals, SI
MOST_NUMBERS = 3 * 10**6  # in the slopes of one batch of lanes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lanes:
    """Plants side by side: theta (lanes, n_parameters), start (lanes, n_states), both SI.

    places: (lanes, k), positions of the parameters by which derivatives are wanted; -1: none.
    """

    theta: FloatArray
    start: FloatArray
    places: IntArray

    def only(self, chosen: IntArray | BoolArray) -> "Lanes":
        """Give some of the lanes."""
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
        self.run = run
        self.inputs = np.ascontiguousarray(run.inputs)
        self.n_x, self.n_z, self.n_p = plant.x.numel(), plant.z.numel(), plant.theta.numel()
        self.n_w, self.n_y, self.n_samples = self.n_x + self.n_z, plant.readings.numel(), len(run.dt)
        self.misfit_of, self.slopes_of = Batch(recursion.misfit), Batch(recursion.slopes)
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

    def follow(
        self, lanes: Lanes, guess: FloatArray, *, patient: bool = False, stop: Callable[[], bool] | None = None
    ) -> Paths:
        """Give what the lanes do.

        Parameters
        ----------
        lanes : the plants
        guess : (lanes, samples, n_w), trajectories nearby
        patient : whether lanes that do not settle from there are solved sample by sample
        stop : whether to give up; then nothing is good
        """
        stop = stop or never
        with np.errstate(all="ignore"):
            w, inverse, good = self._together(lanes, guess)
            lost = np.flatnonzero(~good)
            if patient and len(lost) and not stop():
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
        live = np.arange(n)
        for _ in range(_ITERATIONS):
            misfit, slope = self._call(self.misfit_of, lanes.only(live), w[live])
            size = np.maximum(np.max(np.abs(w[live]), axis=1, keepdims=True, initial=0.0), _TINY)
            inverse[live], regular = _inverse(slope, size)
            move = self._forward(inverse[live], -misfit[..., 0])
            w[live] += move
            far = np.max(np.abs(move) / (size + np.abs(w[live])), axis=(1, 2), initial=0.0)
            sane = regular & np.isfinite(far)
            good[live] = sane & (far <= SETTLED)
            keep = sane & ~good[live] & ((far < _SLOW * left[live]) | (far > 0.1))
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
        _, by_theta, y, y_by_w, y_by_theta = self._call(self.slopes_of, lanes, w)
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
        sane = [(np.abs(part) < _HUGE).reshape(n, -1).all(axis=1) for part in (w, y, w_by, y_by)]
        return Paths(w=w, y=y[..., 0], w_by=w_by, y_by=y_by, good=good & np.all(sane, axis=0))

    def _call(self, function: Batch, lanes: Lanes, w: FloatArray) -> list[FloatArray]:
        """Evaluate a function at all samples; each result has shape (lanes, samples, rows, columns)."""
        n, m = len(w), self.n_samples
        x = np.ascontiguousarray(w[:, :, : self.n_x])
        before = np.concatenate([lanes.start[:, None], x[:, :-1]], axis=1)
        arguments = (
            x.reshape(n * m, self.n_x),
            np.ascontiguousarray(w[:, :, self.n_x :]).reshape(n * m, self.n_z),
            before.reshape(n * m, self.n_x),
            np.tile(self.inputs, (n, 1)),
            np.repeat(lanes.theta, m, axis=0),
            np.tile(self.run.dt[:, None], (n, 1)),
        )
        return [item.reshape(n, m, *item.shape[1:]) for item in function(*arguments)]

    def _one_by_one(self, lanes: Lanes, stop: Callable[[], bool]) -> tuple[FloatArray, BoolArray]:
        """Solve one sample after another."""
        n = len(lanes.start)
        w = np.zeros((n, self.n_samples, self.n_w))
        good, size = np.ones(n, dtype=bool), np.hstack([np.abs(lanes.start), np.zeros((n, self.n_z))])
        now = np.hstack([lanes.start, np.tile(self.run.implicit, (n, 1))])
        with np.errstate(all="ignore"):
            for k in range(self.n_samples):
                live = np.flatnonzero(good)
                if not len(live) or stop():
                    return w, np.zeros(n, dtype=bool)
                sample = _Sample(self, lanes.only(live), now[live, : self.n_x].copy(), size[live], k)
                now[live], good[live] = sample.solve(now[live])
                w[:, k] = now
                size = np.maximum(size, np.abs(now))
        return w, good


class _Sample:
    """One sample of all lanes, solved by Newton's method with parts and multiples of its step."""

    def __init__(self, course: Trajectory, lanes: Lanes, before: FloatArray, size: FloatArray, k: int) -> None:
        self.course, self.lanes, self.before, self.size, self.k = course, lanes, before, size, k

    def solve(self, guess: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Give [x, z], and whether nothing moves any more."""
        w, solved = self._newton(guess)
        for value in _GUESSES if self.course.n_z and self.k == 0 else ():
            if solved.all():
                break
            trial = guess.copy()
            trial[:, self.course.n_x :] = value
            found, good = self._newton(trial)
            w = np.where((good & ~solved)[:, None], found, w)
            solved = solved | good
        return w, solved

    def _newton(self, guess: FloatArray) -> tuple[FloatArray, BoolArray]:
        w, settled = guess.copy(), np.zeros(len(guess), dtype=bool)
        live = np.arange(len(guess))
        misfit, slope = self._call(w, live)
        for _ in range(_ITERATIONS_ALONE):
            size = np.maximum(self.size[live], np.abs(w[live]))
            inverse, regular = _inverse(slope, size)
            move = -(inverse @ misfit)[:, :, 0]
            still = (np.abs(move) <= SETTLED * (size + np.abs(w[live]))).all(axis=1)
            settled[live] = still & regular
            go_on = regular & np.isfinite(move).all(axis=1)
            w[live[still & go_on]] += move[still & go_on]
            go_on &= ~still
            live, move, size = live[go_on], move[go_on], size[go_on]
            misfit, slope = misfit[go_on], slope[go_on]
            if not len(live):
                break
            w[live], misfit, slope = self._search(live, w[live], move, misfit, slope, size)
        return w, settled & np.isfinite(w).all(axis=1)

    def _search(
        self, live: IntArray, w: FloatArray, move: FloatArray, misfit: FloatArray, slope: FloatArray, size: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Take Newton's step where it does what it should, else the best of its parts and multiples.

        Parts, since an exponential is overshot from its flat side; multiples, since from its steep side Newton's step
        is ever the same small one.
        """
        terms = np.abs(slope) @ size[:, :, None] + np.abs(misfit) + _TINY
        old = np.max(np.abs(misfit) / terms, axis=(1, 2), initial=0.0)
        found = w + move
        misfit, slope = self._call(found, live)
        best = _part(misfit, terms)
        slow = np.flatnonzero(best > np.maximum(_FAST * old, _FLAT))
        if not len(slow):
            return found, misfit, slope
        parts = np.array(_PARTS)[:, None, None]
        trial = (w[slow] + parts * move[slow]).reshape(-1, w.shape[1])
        new_misfit, new_slope = self._call(trial, np.tile(live[slow], len(_PARTS)))
        merit = _part(new_misfit, np.tile(terms[slow], (len(_PARTS), 1, 1))).reshape(len(_PARTS), -1)
        choice = np.argmin(merit, axis=0)
        better = merit[choice, np.arange(len(slow))] < best[slow]
        rows, won = (choice * len(slow) + np.arange(len(slow)))[better], slow[better]
        found[won], misfit[won], slope[won] = trial[rows], new_misfit[rows], new_slope[rows]
        return found, misfit, slope

    def _call(self, w: FloatArray, live: IntArray) -> tuple[FloatArray, FloatArray]:
        course, n = self.course, len(live)
        misfit, slope = course.misfit_of(
            np.ascontiguousarray(w[:, : course.n_x]),
            np.ascontiguousarray(w[:, course.n_x :]),
            self.before[live],
            np.tile(course.inputs[self.k], (n, 1)),
            self.lanes.theta[live],
            np.full((n, 1), course.run.dt[self.k]),
        )
        return misfit, slope


def never() -> bool:
    """Say no: there is time."""
    return False


def lanes_of(thetas: Sequence[FloatArray], start: FloatArray, places: Sequence[Sequence[int]]) -> Lanes:
    """Give lanes that begin at one start (n_states,), with sets of any size to be moved."""
    width = max((len(item) for item in places), default=0)
    filled = np.full((len(places), width), -1, dtype=np.intp)
    for row, item in enumerate(places):
        filled[row, : len(item)] = item
    return Lanes(theta=np.array(thetas), start=np.tile(start, (len(thetas), 1)), places=filled)


def _part(misfit: FloatArray, terms: FloatArray) -> FloatArray:
    """Give the misfit as a part of its terms, infinite where it is not a number."""
    part = np.max(np.abs(misfit) / terms, axis=(1, 2), initial=0.0)
    return np.where(np.isfinite(part), part, np.inf)


def _inverse(slope: FloatArray, size: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Invert slopes (lanes, .., n_w, n_w), rows and columns scaled to like sizes; and say whether each lane's exist."""
    column = np.where(size > _TINY, size, 1.0)[..., None, :]
    scaled = slope * column
    row = np.max(np.abs(scaled), axis=-1, initial=0.0, keepdims=True)
    bad = ~(np.isfinite(row).all(axis=(-2, -1)) & (row > 0).all(axis=(-2, -1)))
    scaled = np.where(bad[..., None, None], np.eye(slope.shape[-1]), scaled / row)
    try:
        found = np.linalg.inv(scaled)
    except np.linalg.LinAlgError:
        bad = bad | (np.linalg.det(scaled) == 0.0)
        found = np.linalg.inv(np.where(bad[..., None, None], np.eye(slope.shape[-1]), scaled))
    row = np.where(bad[..., None, None], 1.0, row)
    result = found * column.swapaxes(-1, -2) / row.swapaxes(-1, -2)
    return result, ~bad.reshape(len(slope), -1).any(axis=1)
