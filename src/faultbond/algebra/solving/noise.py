"""How much a route amplifies the noise of what it uses.

The equations of a route, differentiated at a backward-Euler record of the nominal plant, give the change of each result
by each sample, whether or not there is a closed form. The noise of different samples is independent.
Source: thesis 4.2.6 (a route that takes a small difference of large signals); analysis of 4.4.1 (which route is best).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf
from statistics import median

import numpy as np

from faultbond.algebra.route import Route
from faultbond.algebra.solving.backward_euler import FrameRecord, NumericPlant, random_inputs, simulate_frames
from faultbond.algebra.solving.problem import SINGULAR, Problem, prepare, reciprocal_condition, slope_matrix
from faultbond.arrays import FloatArray
from faultbond.equations.component_network import SAMPLE_TIME, ComponentNetwork
from faultbond.equations.numeric import Real
from faultbond.errors import StructureError

N_INSTANTS = 15


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseGain:
    """Standard deviation of the results of a route at the stated noise of inputs and sensors.

    Parameters
    ----------
    deviations : by target; of a parameter relative to its value, of a signal, and of a parameter that is 0, in SI;
        median over instants, inf where the equations are singular at most of them
    relative : the targets whose deviation is relative to their value
    main : by target, the sample that brings the largest part of it, as `omega_0`; empty where nothing is noisy
    """

    deviations: Mapping[str, float]
    main: Mapping[str, str]
    relative: frozenset[str]

    @property
    def worst(self) -> float:
        """The largest deviation, by which routes are compared."""
        return max(self.deviations.values(), default=0.0)


def nominal_record(
    network: ComponentNetwork, plant: NumericPlant, frames: int, instants: int = N_INSTANTS
) -> FrameRecord:
    """Give a record of the nominal plant, long enough for routes of so many frames at so many instants.

    Inputs jump at every sample within their usual range: noise is judged against what excites well.
    """
    n = 2 * frames + instants
    inputs = random_inputs(plant, n, seed=0)
    values = {name: float(value) for name, value in plant.values.items()}
    start = {name: float(value) for name, value in plant.start.items()}
    series = {name: tuple(map(float, given)) for name, given in inputs.items()}
    return simulate_frames(network, values, series, float(plant.sample_time), start, n)


def noise_gain(
    network: ComponentNetwork,
    route: Route,
    plant: NumericPlant,
    record: FrameRecord | None = None,
    instants: int = N_INSTANTS,
) -> NoiseGain:
    """Give the noise gain of a route.

    Parameters
    ----------
    network, route : what is computed from what
    plant : its `sds` are the noise of inputs and sensors
    record : of the nominal plant, to judge several routes by; made here if None
    instants : newest samples of the record that are looked at

    Raises
    ------
    StructureError
        Where the nominal plant cannot be simulated.
    """
    problem = prepare(network, route, plant)
    record = record or nominal_record(network, plant, problem.frames, instants)
    length = min(len(series) for series in record.values())
    chosen = range(length - 1, max(length - 1 - instants, problem.frames - 2), -1)
    if not chosen:
        raise StructureError(f"{problem.name}: a record of {length} samples is too short for {problem.frames} frames")
    parts = []
    for position in chosen:
        values: dict[str, Real] = {name: float(value) for name, value in plant.values.items()}
        values[SAMPLE_TIME] = float(plant.sample_time)
        values |= {name: record[signal][position - frame] for name, (signal, frame) in problem.signals.items()}
        parts.append(_contributions(problem, plant, values))
    deviations, main = {}, {}
    for row, target in enumerate(problem.targets):
        squares = np.array([part[row] ** 2 for part in parts])
        deviations[target] = float(median(np.sqrt(squares.sum(axis=1))))
        typical = np.median(squares, axis=0) if problem.samples else np.zeros(0)
        main[target] = problem.samples[int(typical.argmax())] if typical.any() else ""
    relative = frozenset(name for name in problem.targets if name not in problem.signals and plant.values[name])
    return NoiseGain(deviations=deviations, main=main, relative=relative)


def _contributions(problem: Problem, plant: NumericPlant, values: Mapping[str, Real]) -> FloatArray:
    """Give the standard deviation that each sample brings to each target, shape (n_targets, n_samples)."""
    sizes = np.array([_size(values[name]) for name in problem.unknown])
    unknown = slope_matrix(problem.residuals, problem.unknown, values) * sizes
    noise = np.array([plant.sds.get(problem.signals[name][0], 0.0) for name in problem.samples])
    known = slope_matrix(problem.residuals, problem.samples, values) * noise
    wanted = [problem.unknown.index(target) for target in problem.targets]
    changes = _solve_rows(unknown, known, wanted)
    units = [1.0 if target in problem.signals else 1.0 / _size(values[target]) for target in problem.targets]
    result: FloatArray = np.abs(changes) * (sizes[wanted] * np.array(units))[:, None]
    return result


def _size(value: Real) -> float:
    return abs(float(value)) or 1.0


def _solve_rows(unknown: FloatArray, known: FloatArray, wanted: Sequence[int]) -> FloatArray:
    """Give the wanted rows of -unknown^-1 known; inf where that is singular."""
    failed = np.full((len(wanted), known.shape[1]), inf)
    weights = np.abs(unknown).max(axis=1, keepdims=True, initial=0.0)
    if not (np.all(np.isfinite(unknown)) and np.all(np.isfinite(known)) and np.all(weights > 0.0)):
        return failed
    balanced = unknown / weights
    if reciprocal_condition(balanced) <= SINGULAR:
        return failed
    rows = np.linalg.solve(balanced.T, np.eye(len(unknown))[:, list(wanted)]).T
    result: FloatArray = rows @ (known / weights)
    return result
