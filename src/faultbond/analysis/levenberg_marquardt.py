"""Fits of parameters to noise-free outputs, many at a time, with exact derivatives.

Levenberg-Marquardt in logarithms of the parameters, each fit in a lane of its own. The start of the plant is free as
well, since nobody knows it. Each iteration begins at the trajectory that the last one predicts. Source: Levenberg 1944,
Marquardt 1963 (damping scaled by the columns).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from faultbond.analysis.trajectories import Lanes, Paths, Trajectory, never
from faultbond.arrays import BoolArray, FloatArray, IntArray

ITERATIONS = 45
SAME = 1e-8  # misfit, in sizes of the outputs, below which outputs are the same
_ENOUGH = 1e-12  # misfit below which no further iteration is worth it
_MOST_STEP = 1.5  # in logarithms
_STALLED = 4  # iterations without gain after which a lane rests
_GAIN = 0.99
_FAR = 6.0  # logarithms from where it began; a lane so far away is given up
_HOME = 1e-2  # a lane so near to values that are known, and falling, ends there
_FALLING = 1e-3  # misfit of such a lane


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FarthestFit:
    """Where each lane ended: one theta (lanes, n_parameters) per side, start (lanes, n_states) of the first side.

    misfit: (lanes,), in sizes of the outputs; inf without a solution. home: (lanes,), whether the lane was on its way
    to the known values and was stopped. done: (lanes,), whether it ended before the time was over.
    """

    theta: tuple[FloatArray, ...]
    start: FloatArray
    misfit: FloatArray
    home: BoolArray
    done: BoolArray

    @property
    def exact(self) -> BoolArray:
        """Whether the outputs are the same, (lanes,)."""
        return np.asarray(self.misfit < SAME)


def fit_lanes(
    course: Trajectory,
    lanes: Lanes,
    guess: FloatArray,
    data: FloatArray,
    *,
    known: FloatArray | None = None,
    stop: Callable[[], bool] = never,
) -> FarthestFit:
    """Fit each lane to its own outputs.

    Parameters
    ----------
    course : the run
    lanes : where the fits begin; `places` may move
    guess : float array, shape (lanes, n_samples, n_w) or (n_samples, n_w); a trajectory nearby
    data : float array, shape (lanes, n_samples, n_outputs), SI
    known : float array, shape (lanes, n_parameters); a solution that need not be found again
    stop : whether the time is over
    """
    return _LevenbergMarquardt(course, (lanes,), guess, data, known, stop).run()


def fit_together(
    course: Trajectory, one: Lanes, other: Lanes, guess: FloatArray, *, stop: Callable[[], bool] = never
) -> FarthestFit:
    """Move both plants of each lane until their outputs are the same; `guess` (n_samples, n_w), SI, is that of both."""
    return _LevenbergMarquardt(course, (one, other), guess, None, None, stop).run()


class _LevenbergMarquardt:
    """All lanes at once. An unknown is a logarithm, or where the nominal is 0 a multiple of the scale, or a start."""

    def __init__(
        self,
        course: Trajectory,
        sides: tuple[Lanes, ...],
        guess: FloatArray,
        data: FloatArray | None,
        known: FloatArray | None,
        stop: Callable[[], bool],
    ) -> None:
        self.course, self.sides, self.data, self.known, self.stop = course, sides, data, known, stop
        self.n_lanes = len(sides[0].theta)
        self.widths: list[int] = [side.places.shape[1] for side in sides]
        starts = np.ones((self.n_lanes, course.n_x), dtype=bool)
        self.active = np.hstack([part for side in sides for part in (side.places >= 0, starts)])
        self.is_value = np.hstack([part for width in self.widths for part in (np.ones(width), np.zeros(course.n_x))])
        parts = []
        for side in sides:
            log = np.log(np.maximum(np.abs(side.theta), 1e-300))
            parts += [np.take_along_axis(np.where(course.linear, side.theta / course.scale, log), side.places, axis=1)]
            parts += [side.start]
        self.points = np.hstack(parts)
        self.w = [np.broadcast_to(guess, (self.n_lanes, course.n_samples, course.n_w)).copy() for _ in sides]
        self.w_by: list[FloatArray] = []
        self.size = np.ones(course.n_y)

    def run(self) -> FarthestFit:
        """Iterate until every lane is exact, or rests."""
        n, points, course = self.n_lanes, self.points.copy(), self.course
        every = np.arange(n)
        first = [self._follow(points, side, every, self.w[side]) for side in range(len(self.sides))]
        self.w, self.w_by = [path.w for path in first], [path.w_by for path in first]
        outputs = self.data if self.data is not None else first[0].y[first[0].good]
        if len(outputs):  # sizes of the outputs, of all lanes together
            self.size = np.sqrt(np.mean(outputs**2, axis=(0, 1))) + 1e-300
        misfit, slope = self._misfit(first, every)
        cost, damping, idle = _cost(misfit), np.full(n, 1e-2), np.zeros(n, dtype=int)
        home, gone = np.zeros(n, dtype=bool), ~np.isfinite(cost)
        for _ in range(ITERATIONS):
            lanes = np.flatnonzero((cost > _ENOUGH) & (idle < _STALLED) & ~home & ~gone)
            if not len(lanes) or self.stop():
                break
            step = self._step(misfit[lanes], slope[lanes], damping[lanes], lanes)
            trial = points[lanes] + step
            paths = []
            for side, width in enumerate(self.widths):
                place = slice(self._first(side), self._first(side) + width + self.course.n_x)
                moved = np.einsum("lkwj,lj->lkw", self.w_by[side][lanes], step[:, place])
                paths.append(self._follow(trial, side, lanes, self.w[side][lanes] + moved))
            new_misfit, new_slope = self._misfit(paths, lanes)
            new_cost = _cost(new_misfit)
            better = new_cost < cost[lanes]
            idle[lanes] = np.where(new_cost < _GAIN * cost[lanes], 0, idle[lanes] + 1)
            won = lanes[better]
            points[won], misfit[won], slope[won], cost[won] = (
                item[better] for item in (trial, new_misfit, new_slope, new_cost)
            )
            for side, path in enumerate(paths):
                self.w[side][won], self.w_by[side][won] = path.w[better], path.w_by[better]
            damping[lanes] = np.clip(np.where(better, damping[lanes] / 8, damping[lanes] * 5), 1e-12, 1e8)
            if self.known is not None:  # so near the known values, and falling, a lane ends there
                reached, known = self._theta(points[won], 0, won), self.known[won]
                away = np.abs(reached - known) / np.where(course.linear, np.abs(course.scale), np.abs(known))
                home[won] = (np.max(away, axis=1, initial=0.0) < _HOME) & (cost[won] < _FALLING)
            gone[won] = np.max(np.abs(points - self.points)[won] * self.is_value, axis=1, initial=0.0) > _FAR
        done = ~((cost > _ENOUGH) & (idle < _STALLED) & ~home & ~gone) | (not self.stop())
        theta = tuple(self._theta(points, side, every) for side in range(len(self.sides)))
        start = points[:, self.widths[0] : self.widths[0] + self.course.n_x]
        return FarthestFit(theta=theta, start=start, misfit=cost, home=home, done=done)

    def _theta(self, points: FloatArray, side: int, lanes: IntArray) -> FloatArray:
        """Give all parameters (lanes, n_parameters) of one side; `points` are those of the lanes."""
        course, mine = self.course, self.sides[side].only(lanes)
        first = self._first(side)
        theta = mine.theta.copy()
        for column in range(self.widths[side]):
            place = mine.places[:, column]
            rows = np.flatnonzero(place >= 0)
            value, chosen = points[rows, first + column], place[rows]
            sign = np.sign(mine.theta[rows, chosen])
            grown = sign * np.exp(np.where(course.linear[chosen], 0.0, value))
            theta[rows, chosen] = np.where(course.linear[chosen], value * course.scale[chosen], grown)
        return theta

    def _first(self, side: int) -> int:
        return side * int(self.widths[0] + self.course.n_x)

    def _follow(self, points: FloatArray, side: int, lanes: IntArray, guess: FloatArray) -> Paths:
        start = self._first(side) + self.widths[side]
        mine = Lanes(
            theta=self._theta(points, side, lanes),
            start=np.ascontiguousarray(points[:, start : start + self.course.n_x]),
            places=self.sides[side].places[lanes],
        )
        return self.course.follow(mine, guess, self.stop)

    def _misfit(self, paths: list[Paths], lanes: IntArray) -> tuple[FloatArray, FloatArray]:
        """Give misfits (lanes, rows), inf without a solution, and slopes (lanes, rows, unknowns), in output sizes."""
        target = self.data[lanes] if self.data is not None else paths[1].y
        good = np.all([path.good for path in paths], axis=0)
        misfit = ((paths[0].y - target) / self.size).reshape(len(lanes), -1)
        slopes = [(1 - 2 * side) * path.y_by / self.size[:, None] for side, path in enumerate(paths)]
        slope = np.concatenate(slopes, axis=3).reshape(len(lanes), misfit.shape[1], -1)
        slope = np.where(good[:, None, None], slope, 0.0) * self.active[lanes][:, None, :]
        return np.where(good[:, None], misfit, np.inf), slope

    def _step(self, misfit: FloatArray, slope: FloatArray, damping: FloatArray, lanes: IntArray) -> FloatArray:
        length = np.sqrt(np.sum(slope**2, axis=1))
        length = np.where(length > 0, length, 1.0)
        unit = slope / length[:, None, :]
        normal = unit.transpose(0, 2, 1) @ unit
        normal += (damping[:, None, None] + 1e-14) * np.eye(normal.shape[1])
        right = -(unit.transpose(0, 2, 1) @ misfit[:, :, None])
        step = np.linalg.solve(normal, right)[:, :, 0] / length * self.active[lanes]
        longest = np.max(np.abs(step * self.is_value), axis=1, initial=1e-300)
        return np.asarray(step * np.minimum(1.0, _MOST_STEP / longest)[:, None])


def _cost(misfit: FloatArray) -> FloatArray:
    with np.errstate(over="ignore"):
        return np.asarray(np.sqrt(np.mean(misfit**2, axis=1)))
