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

    time : of the sample worked on, s
    trust : P_A (figure 5.6)
    samples, before, states : A, B and their blend, (n_states,) (figures 5.4, 5.5, 5.9, 5.10)
    measured, expected : filtered output and its prediction by the healthy model, (n_outputs,) (5.8, 7.7, 7.8, 7.12)
    index, limit : error index of the healthy model and its limit, (n_outputs,) (5.12 to 5.15, 7.9, 7.14, 7.19)
    estimates : parameters of each tested set, (n_slots, n_tested), nan where there is none (6.7, 6.8, 7.20, 7.27)
    predicted : outputs as each tested set predicts them, (n_outputs, n_tested) (6.9, 6.10)
    errors : error index of each tested set, averaged over the outputs, (n_tested,) (6.11, 6.12, 7.21, 7.28, 7.34)
    hitting : hitting index of each hypothesis, (n_hypotheses,) (7.22, 7.29, 7.35, 7.36, 7.40)
    averages : estimate of each parameter as mean over the tested sets that contain it, (n_parameters,) (7.37)

    The last five are nan until the alarm. Source of the averages: thesis 7.4.
    """

    time: float
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
    found = reason(spec, plan, state) if state.alarm >= 0 and plan.tested else None
    scales = np.array([item.scale for item in spec.parameters] + [np.nan])
    chosen = plan.slots[:, 1:].astype(int)
    estimates = scales[chosen] * state.factors[:, 1:]
    averages = np.full(len(spec.parameters), np.nan)
    for index in np.unique(chosen[chosen >= 0]):
        averages[index] = estimates[chosen == index].mean()

    def tested(values: FloatArray) -> FloatArray:
        return values if state.alarm >= 0 else np.full_like(values, np.nan)

    return CurvePoint(
        time=state.at,
        trust=state.trust,
        samples=state.samples_states[:, 0],
        before=state.before_states[:, 0],
        states=state.states[:, 0],
        measured=np.where(state.present > 0, state.frames[0], np.nan)[len(spec.inputs) :],
        expected=state.expected[:, 0],
        index=indices_of(state.sums)[:, 0],
        limit=current_limits(spec, plan, state),
        estimates=tested(estimates),
        predicted=tested(state.expected[:, 1:]),
        errors=found.error if found else np.full(len(plan.tested), np.nan),
        hitting=found.hitting if found else np.full(len(spec.hypotheses), np.nan),
        averages=tested(averages),
    )


def stacked(points: list[CurvePoint]) -> dict[str, FloatArray]:
    """Give the curves by name, one row for each point, (n_points, ...)."""
    return {name: np.array([getattr(point, name) for point in points]) for name in CurvePoint.__slots__}
