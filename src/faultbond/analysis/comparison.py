"""Where plants are compared by their outputs without noise: a run, the plant along it, and the time that there is."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from time import thread_time

import numpy as np

from faultbond.analysis.equilibrium import moving_inputs, reference, reference_levels, times
from faultbond.analysis.experiment import random_experiments
from faultbond.analysis.levenberg_marquardt import fit_lanes
from faultbond.analysis.sensitivity import Experiment, Recursion, build_recursion
from faultbond.analysis.testable import generic_run, no_run
from faultbond.analysis.trajectories import Trajectory, lanes_of, never
from faultbond.arrays import BoolArray, FloatArray
from faultbond.equations.step import StepModel
from faultbond.errors import ModelError, StructureError
from faultbond.model.graph import BondGraph

GENTLE = 0.3  # part of an input by which it moves
NO_TIME = "no time left; raise --budget"  # why something was not looked at
_GRACE = 1.5  # times the time that there is, for what has been begun


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance:
    """How much processor time there is, in seconds; None: enough.

    Processor time, so that what is found does not depend on what else the machine does.
    """

    seconds: float | None
    begun: float = field(default_factory=thread_time)

    @property
    def left(self) -> float:
        """What is left, s; may be negative."""
        return np.inf if self.seconds is None else self.begun + self.seconds - thread_time()

    def over(self) -> bool:
        """Whether nothing is left."""
        return self.left <= 0.0

    def long_over(self) -> bool:
        """Whether even what was begun must end."""
        return self.seconds is not None and self.left <= (1.0 - _GRACE) * self.seconds


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedLane:
    """Where one fit ended: theta (n_parameters,) and start (n_states,), SI; exact, home, done as of `FarthestFit`."""

    theta: FloatArray
    start: FloatArray
    exact: bool
    home: bool
    done: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bench:
    """A plant, a run, and the nominal trajectory (n_samples, n_w) along it."""

    graph: BondGraph
    course: Trajectory
    nominal: FloatArray

    def inside(self, theta: FloatArray) -> bool:
        """Whether all parameters, theta (n_parameters,), SI, are in their ranges."""
        return all(item.lower <= value <= item.upper for item, value in zip(self.graph.parameters, theta, strict=True))

    def outputs(self, thetas: Sequence[FloatArray], clock: Allowance) -> tuple[FloatArray, BoolArray]:
        """Give the outputs of plants along the run, (n, n_samples, n_outputs), SI, and which have some."""
        course = self.course
        y = np.zeros((len(thetas), course.n_samples, course.n_y))
        good = np.zeros(len(thetas), dtype=bool)
        for first in range(0, len(thetas), course.most_lanes):
            part = slice(first, first + course.most_lanes)
            lanes = lanes_of(thetas[part], course.run.start, [()] * len(thetas[part]))
            guess = np.tile(self.nominal, (len(lanes.theta), 1, 1))
            paths = course.follow(lanes, guess, clock.over)
            if clock.over():
                break
            y[part], good[part] = paths.y, paths.good
        return y, good

    def fits(
        self,
        places: Sequence[Sequence[int]],
        factors: Sequence[Sequence[float]],
        data: Sequence[FloatArray],
        known: Sequence[FloatArray] | None = None,
        *,
        stop: Callable[[], bool] = never,
    ) -> Iterator[FittedLane]:
        """Fit sets of parameters, each to its own outputs; see `fit_lanes`.

        Parameters
        ----------
        places : positions of the parameters of each set
        factors : of their nominals, where the fits begin
        data : outputs, shape (n_samples, n_outputs) each, SI
        known : solutions that need not be found again, shape (n_parameters,) each, SI
        stop : whether the time is over
        """
        for first in range(0, len(places), self.course.most_lanes):
            part = slice(first, first + self.course.most_lanes)
            thetas = [changed(self.graph, *item) for item in zip(places[part], factors[part], strict=True)]
            lanes = lanes_of(thetas, self.course.run.start, places[part])
            old = None if known is None else np.array(known[part])
            found = fit_lanes(self.course, lanes, self.nominal, np.array(data[part]), known=old, stop=stop)
            for lane, theta in enumerate(found.theta[0]):
                yield FittedLane(
                    theta=theta,
                    start=found.start[lane],
                    exact=bool(found.exact[lane]),
                    home=bool(found.home[lane]),
                    done=bool(found.done[lane]),
                )

    def distance(self, one: FloatArray, other: FloatArray) -> float:
        """Give the largest relative difference of two theta (n_parameters,), SI; where the nominal is 0, in scales."""
        scale = np.abs(self.course.scale)
        least = np.maximum(np.minimum(np.abs(one), np.abs(other)), 1e-12 * scale)
        return float(np.max(np.abs(one - other) / np.where(self.course.linear, scale, least), initial=0.0))


def short_benches(model: StepModel) -> Iterator[Bench]:
    """Give benches with random runs: first that which shows most, then the others, then one whose inputs move gently.

    Raises
    ------
    StructureError
        Where the plant has no finite solution along any of them.
    """
    recursion = build_recursion(model.plant)
    runs = _nominal_runs(model, recursion)
    with suppress(StructureError):
        best = generic_run(model, recursion).inputs
        runs.sort(key=lambda item: not np.array_equal(item.inputs, best))
    some = False
    for bench in _benches(model, recursion, runs, runs[0]):
        some = True
        yield bench
    if not some:
        raise no_run(model.plant.graph)


def long_benches(model: StepModel) -> Iterator[Bench]:
    """Give benches with longer runs: all random runs one after another, then each, then the gentle one."""
    recursion = build_recursion(model.plant)
    runs = _nominal_runs(model, recursion)
    inputs, dt = np.vstack([item.inputs for item in runs]), np.concatenate([item.dt for item in runs])
    yield from _benches(model, recursion, [replace(runs[0], inputs=inputs, dt=dt), *runs], runs[0])


def _nominal_runs(model: StepModel, recursion: Recursion) -> list[Experiment]:
    """Give the random runs, done by the nominal plant from its reference state, and the first moved gently."""
    nominal, start = np.array([item.nominal for item in model.plant.graph.parameters]), reference(model).contents
    return [replace(item, theta=nominal, start=start) for item in random_experiments(model, recursion)]


def _benches(model: StepModel, recursion: Recursion, runs: Sequence[Experiment], last: Experiment) -> Iterator[Bench]:
    """Give benches along those of some runs that have a solution, then along `last` with inputs that move gently."""
    moves = np.random.default_rng(0).uniform(-GENTLE, GENTLE, last.inputs.shape) * moving_inputs(model)
    gentle = replace(last, inputs=times(model, reference_levels(model), 1.0 + moves))
    for run in (*runs, gentle):
        course = Trajectory(recursion, run)
        nominal = course.alone(run.theta)
        if nominal is not None:
            yield Bench(graph=model.plant.graph, course=course, nominal=nominal)


def bench_for(model: StepModel, thetas: Sequence[FloatArray]) -> tuple[Bench, FloatArray]:
    """Give a bench along which all these plants have a finite solution, and their outputs (plants, samples, outputs).

    Raises
    ------
    StructureError
        Where there is none.
    """
    for bench in long_benches(model):
        y, good = bench.outputs(thetas, Allowance(seconds=None))
        if good.all():
            return bench, y
    graph = model.plant.graph
    raise StructureError(
        f"{graph.file}: the equations of {graph.name} have no finite solution along random inputs, or not with other "
        "values of the parameters; check the laws and their units, or narrow the ranges of the parameters"
    )


def places_of(graph: BondGraph, names: Sequence[str]) -> list[int]:
    """Give the positions of parameters.

    Raises
    ------
    ModelError
        Where one is unknown.
    """
    known = [item.name for item in graph.parameters]
    for name in names:
        if name not in known:
            raise ModelError(f"{graph.file}: no parameter {name}; there are {', '.join(known)}")
    return [known.index(name) for name in names]


def changed(graph: BondGraph, places: Sequence[int], factors: Sequence[float]) -> FloatArray:
    """Give theta (n_parameters,), SI, with some changed; where the nominal is 0 by factor - 1 of the scale."""
    theta = np.array([item.nominal for item in graph.parameters])
    for place, factor in zip(places, factors, strict=True):
        item = graph.parameters[place]
        theta[place] = item.nominal * factor if item.nominal != 0.0 else item.scale * (factor - 1.0)
    return theta
