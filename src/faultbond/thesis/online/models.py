"""The functions of the plan run for the healthy model and the model of every tested set at once, a lane each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.thesis.online.newton import solve
from faultbond.thesis.online.plan import Batch, ClassicPlan
from faultbond.thesis.online.tape import NewtonTape, evaluate


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FilteredSample:
    """One filtered sample with those before it, and the parameters of all lanes.

    dt : s. frames : newest first, (depth, n_signals). parameters : (n_parameters, n_lanes).
    """

    dt: float
    frames: FloatArray
    parameters: FloatArray

    @property
    def n_lanes(self) -> int:
        """Number of models."""
        return int(self.parameters.shape[1])


def parameters_of(spec: EngineSpec, plan: ClassicPlan, healthy: FloatArray, factors: FloatArray) -> FloatArray:
    """Give the parameters of lanes, (n_parameters, n_lanes).

    Parameters
    ----------
    spec, plan : the model
    healthy : values while healthy, (n_parameters,)
    factors : of the suspects of each lane, (n_slots, n_lanes)
    """
    lanes = factors.shape[1]
    found = np.repeat(healthy[:, None], lanes, axis=1)
    scales = np.array([item.scale for item in spec.parameters])
    for slot, chosen in enumerate(plan.slots[:, :lanes].astype(int)):
        lane = np.flatnonzero(chosen >= 0)
        found[chosen[lane], lane] = scales[chosen[lane]] * factors[slot, lane]
    return found


def spread_parameters(spec: EngineSpec, healthy: FloatArray) -> FloatArray:
    """Give the healthy parameters, then again with each off by its accuracy, (n_parameters, 1 + n_parameters)."""
    off = np.diag([item.accuracy * abs(item.scale) for item in spec.parameters])
    return np.asarray(healthy[:, None] + np.hstack([np.zeros((len(healthy), 1)), off]))


def states_from_samples(plan: ClassicPlan, moment: FilteredSample, otherwise: FloatArray) -> FloatArray:
    """Give A, the states from several samples, (n_states, n_lanes); where there is no value the states `otherwise`."""
    environment = _environment(plan, moment)
    return _run(plan.from_samples, environment, otherwise)


def states_from_before(plan: ClassicPlan, moment: FilteredSample, before: FloatArray) -> FloatArray:
    """Give B, the states from those one sample `before`, (n_states, n_lanes), and one sample; nan: no value."""
    environment = _environment(plan, moment)
    _place(environment, plan.before, before)
    return _run(plan.from_before, environment, np.full(before.shape, np.nan))


def outputs_from_before(plan: ClassicPlan, moment: FilteredSample, before: FloatArray) -> FloatArray:
    """Give the outputs expected from the states one sample `before` and all else, (n_outputs, n_lanes)."""
    environment = _environment(plan, moment)
    _place(environment, plan.before, before)
    return _run(plan.expected, environment, np.full((len(plan.algebraic), moment.n_lanes), np.nan))


def misfits_of(plan: ClassicPlan, moment: FilteredSample, states: FloatArray, rates: FloatArray) -> FloatArray:
    """Give what is left over of each law between the signals on its sides, (n_sides, n_lanes)."""
    environment = _environment(plan, moment)
    _place(environment, plan.rates, rates)
    _place(environment, plan.now, states)
    return _run(plan.misfits, environment, np.full((len(plan.sides), moment.n_lanes), np.nan))


def _environment(plan: ClassicPlan, moment: FilteredSample) -> list[FloatArray]:
    """Give the places with sample time, parameters and samples; the rest is nan."""
    nothing = np.array([np.nan])
    environment = [nothing] * len(plan.names)
    environment[0] = np.array([moment.dt])
    for place, values in zip(plan.parameter_places, moment.parameters, strict=True):
        environment[place] = values
    for signal, places in enumerate(plan.sample_places):
        for frame, place in enumerate(places):
            environment[place] = moment.frames[frame, signal : signal + 1]
    return environment


def _place(environment: list[FloatArray], places: Sequence[int], values: FloatArray) -> None:
    for place, row in zip(places, values, strict=True):
        if place >= 0:
            environment[place] = row


def _run(batch: Batch, environment: Sequence[FloatArray], otherwise: FloatArray) -> FloatArray:
    found = otherwise.copy()
    for program, rows in batch:
        if isinstance(program, NewtonTape):
            value = solve(program, environment, found.shape[1])
        else:
            value = evaluate(program, environment)
        finite = np.isfinite(value)
        found[list(rows)] = value if finite.all() else np.where(finite, value, otherwise[list(rows)])
    return found
