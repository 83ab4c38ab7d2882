"""The functions of the plan run for the healthy model and the model of every tested set at once, a lane each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.thesis.online.newton import solve_torn
from faultbond.thesis.online.plan import ClassicPlan, Programs
from faultbond.thesis.online.tape import NewtonTape, run_program


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
    healthy : values while healthy, (n_parameters,), SI
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
    """Give A, the states from several samples, (n_states, n_lanes), SI; where there is no value `otherwise`."""
    return _run(plan, plan.from_samples, moment, otherwise)


def states_from_before(plan: ClassicPlan, moment: FilteredSample, before: FloatArray) -> FloatArray:
    """Give B, the states from those one sample `before`, (n_states, n_lanes), SI, and one sample; nan: no value."""
    return _run(plan, plan.from_before, moment, np.full(before.shape, np.nan), (plan.before, before))


def outputs_from_before(plan: ClassicPlan, moment: FilteredSample, before: FloatArray) -> FloatArray:
    """Give the outputs expected from the states one sample `before` and all else, (n_outputs, n_lanes), SI."""
    nothing = np.full((len(plan.algebraic), moment.n_lanes), np.nan)
    return _run(plan, plan.expected, moment, nothing, (plan.before, before))


def misfits_of(plan: ClassicPlan, moment: FilteredSample, states: FloatArray, rates: FloatArray) -> FloatArray:
    """Give what is left over of each law between the signals on its sides, (n_sides, n_lanes), SI.

    states, rates : (n_states, n_lanes), SI
    """
    nothing = np.full((len(plan.sides), moment.n_lanes), np.nan)
    return _run(plan, plan.misfits, moment, nothing, (plan.rates, rates), (plan.now, states))


def _run(
    plan: ClassicPlan,
    programs: Programs,
    moment: FilteredSample,
    otherwise: FloatArray,
    *given: tuple[Sequence[int], FloatArray],
) -> FloatArray:
    """Give the results of programs, and `otherwise` where they have none.

    Known are sample time, parameters and samples, and what is given by its places; the rest is nan.
    """
    environment = [np.array([np.nan])] * len(plan.names)
    environment[0] = np.array([moment.dt])
    for signal, own in enumerate(plan.sample_places):
        for frame, place in enumerate(own):
            environment[place] = moment.frames[frame, signal : signal + 1]
    for places, values in ((plan.parameter_places, moment.parameters), *given):
        for place, row in zip(places, values, strict=True):
            if place >= 0:
                environment[place] = row
    found = otherwise.copy()
    for program, rows in programs:
        if isinstance(program, NewtonTape):
            value = solve_torn(program, environment, found.shape[1])
        else:
            value = run_program(program, environment)
        finite = np.isfinite(value)
        found[list(rows)] = value if finite.all() else np.where(finite, value, otherwise[list(rows)])
    return found
