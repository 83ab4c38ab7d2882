"""The functions of the plan run for the healthy model and the model of every tested set at once, a lane each."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.runtime.classic.plan import ClassicPlan
from faultbond.runtime.classic.tape import Program, evaluate
from faultbond.spec import EngineSpec
from faultbond.types import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moment:
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


def parameters_of(spec: EngineSpec, plan: ClassicPlan, factors: FloatArray) -> FloatArray:
    """Give the parameters of lanes, (n_parameters, n_lanes), from the factors of their suspects, (n_slots, n_lanes)."""
    lanes = factors.shape[1]
    found = np.repeat(np.array([[item.nominal] for item in spec.parameters]), lanes, axis=1)
    scales = np.array([item.scale for item in spec.parameters])
    for slot, chosen in enumerate(plan.slots[:, :lanes].astype(int)):
        lane = np.flatnonzero(chosen >= 0)
        found[chosen[lane], lane] = scales[chosen[lane]] * factors[slot, lane]
    return found


def states_from_samples(plan: ClassicPlan, moment: Moment, otherwise: FloatArray) -> FloatArray:
    """Give A, the states from several samples, (n_states, n_lanes); where there is no value the states `otherwise`."""
    environment = _environment(plan, moment)
    return _run(plan.from_samples, environment, otherwise)


def states_from_before(plan: ClassicPlan, moment: Moment, before: FloatArray) -> FloatArray:
    """Give B, the states from those one sample `before`, (n_states, n_lanes), and one sample; nan: no value."""
    environment = _environment(plan, moment)
    _place(environment, plan.before, before)
    return _run(plan.from_before, environment, np.full(before.shape, np.nan))


def outputs_from_before(plan: ClassicPlan, moment: Moment, before: FloatArray) -> FloatArray:
    """Give the outputs expected from the states one sample `before` and all else, (n_outputs, n_lanes)."""
    environment = _environment(plan, moment)
    _place(environment, plan.before, before)
    return _run(plan.expected, environment, np.full((len(plan.expected), moment.n_lanes), np.nan))


def misfits_of(plan: ClassicPlan, moment: Moment, states: FloatArray, rates: FloatArray) -> FloatArray:
    """Give what is left over of each law between the signals on its sides, (n_sides, n_lanes)."""
    environment = _environment(plan, moment)
    _place(environment, plan.rates, rates)
    _place(environment, plan.now, states)
    programs = [side.program for side in plan.sides]
    return _run(programs, environment, np.full((len(programs), moment.n_lanes), np.nan))


def _environment(plan: ClassicPlan, moment: Moment) -> list[FloatArray]:
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


def _run(programs: Sequence[Program | None], environment: Sequence[FloatArray], otherwise: FloatArray) -> FloatArray:
    found = otherwise.copy()
    for k, program in enumerate(programs):
        if program is not None:
            value = evaluate(program, environment)[0]
            found[k] = np.where(np.isfinite(value), value, otherwise[k])
    return found
