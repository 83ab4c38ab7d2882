"""Curves of a run of method `classic`, as the figures of thesis chapters 5 to 7 show them. Not needed by the method."""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.thesis.online.indices import indices_of
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.ranking import current_limits, reason
from faultbond.thesis.online.state import ClassicState


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurvePoint:
    """What is plotted of one sample; SI.

    time : of the sample worked on, s; told_at : of the newest one, at which it was known
    trust : P_A (figure 5.6)
    samples, before, states : A, B and their blend, (n_states,) (figures 5.4, 5.5, 5.9, 5.10)
    measured, expected : filtered output and its prediction by the healthy model, (n_outputs,) (5.8, 7.7, 7.8, 7.12)
    index, limit : error index of the healthy model and its limit, (n_outputs,) (5.12 to 5.15, 7.9, 7.14, 7.19)
    estimates : parameters of each tested set, (n_slots, n_tested), nan where there is none (6.7, 6.8, 7.20, 7.27)
    predicted : outputs as each tested set predicts them, (n_outputs, n_tested) (6.9, 6.10)
    errors : error index of each tested set, averaged over the outputs, (n_tested,) (6.11, 6.12, 7.21, 7.28, 7.34)
    hitting : hitting index of each hypothesis, (n_hypotheses,) (7.22, 7.29, 7.35, 7.36, 7.40)
    averages : estimate of each parameter as mean over the tested sets that contain it, (n_parameters,) (7.37)

    The last five are nan until the alarm.
    """

    time: float
    told_at: float
    trust: float
    samples: FloatArray
    before: FloatArray
    states: FloatArray
    measured: FloatArray
    expected: FloatArray
    index: FloatArray
    limit: FloatArray
    estimates: FloatArray
    predicted: FloatArray
    errors: FloatArray
    hitting: FloatArray
    averages: FloatArray


def point_of(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> CurvePoint:
    """Give what is plotted of the sample that a state was left by."""
    testing = state.alarm >= 0
    scales = np.array([item.scale for item in spec.parameters] + [np.nan])
    estimates = scales[plan.slots[:, 1:].astype(int)] * state.factors[:, 1:]
    nothing = np.full(len(plan.tested), np.nan)
    found = reason(spec, plan, state) if testing and plan.tested else None
    return CurvePoint(
        time=state.at,
        told_at=state.time,
        trust=state.trust,
        samples=state.samples_states[:, 0],
        before=state.before_states[:, 0],
        states=state.states[:, 0],
        measured=np.where(state.present > 0, state.frames[0], np.nan)[len(spec.inputs) :],
        expected=state.expected[:, 0],
        index=indices_of(state.sums)[:, 0],
        limit=current_limits(spec, plan, state),
        estimates=estimates if testing else np.full_like(estimates, np.nan),
        predicted=state.expected[:, 1:] if testing else np.full((len(spec.outputs), len(plan.tested)), np.nan),
        errors=found.error if found is not None else nothing,
        hitting=found.hitting if found is not None else np.full(len(spec.hypotheses), np.nan),
        averages=averages_of(len(spec.parameters), plan, estimates)
        if testing
        else np.full(len(spec.parameters), np.nan),
    )


def averages_of(n_parameters: int, plan: ClassicPlan, estimates: FloatArray) -> FloatArray:
    """Give the mean estimate of each parameter over the tested sets that contain it, nan where none does.

    Source
    ------
    Thesis 7.4, figure 7.37.
    """
    chosen = plan.slots[:, 1:].astype(int)
    found = np.full(n_parameters, np.nan)
    for index in range(n_parameters):
        own = estimates[chosen == index]
        if own.size:
            found[index] = own.mean()
    return found


def stacked(points: list[CurvePoint]) -> dict[str, FloatArray]:
    """Give the curves by name, one row for each point."""
    return {name: np.array([getattr(point, name) for point in points]) for name in CurvePoint.__slots__}
