"""What method `classic` remembers: numbers only, of fixed size, so that a run can be saved and gone on with."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.allowed import ANYTHING, COUNT, COUNT_OR_NONE, FLAG, POSITIVE, Allowed
from faultbond.thesis.online.plan import ClassicPlan

ALLOWED = {
    **dict.fromkeys(("index", "absent"), COUNT),
    **dict.fromkeys(("running", "alarm"), COUNT_OR_NONE),
    **dict.fromkeys(("present", "rejected"), FLAG),
    **dict.fromkeys(("peak", "counts", "misfit_counts"), POSITIVE),
    "since_step": Allowed(least=0.0, infinite=True),
    **dict.fromkeys(("raw", "raw_times", "frames", "held_inputs"), Allowed(nan=True)),
    **dict.fromkeys(  # of models that may have run away
        (
            "squares",
            "spread_states",
            "spread_sums",
            "samples_states",
            "before_states",
            "states",
            "rates",
            "expected",
            "sums",
            "index_before",
            "factors",
            "covariance",
            "misfits",
        ),
        ANYTHING,
    ),
}
_WHOLE = ("index", "running", "alarm", "absent")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClassicState:
    """The numbers; lane 0 is the healthy model, the others are the tested sets.

    index : samples taken
    running : samples since monitoring began, T of the thesis; -1: not yet
    alarm : sample of the alarm; -1: none
    absent : samples since any output was there
    time, at : of the newest sample, and of the sample that was last worked on, which the prefilter delays; s
    raw : newest samples as they came, oldest first, shape (window, n_signals); raw_times : (window,)
    frames : filtered samples, newest first, missing ones held, shape (depth, n_signals)
    present : whether each signal of the newest frame was there
    held_inputs, peak, since_step : to find steps of inputs, (n_inputs,)
    squares : mean square of each output, (n_outputs,); counts : samples in it
    healthy : values of the parameters while healthy, (n_parameters,), SI; nominal until something is accepted
    spread_states : states of models with one parameter off by its declared accuracy, (n_states, n_parameters)
    spread_sums : numerator and denominator of the error index of such models, all together, (2, n_outputs)
    rejected : 1 for each hypothesis that a person has ruled out, (n_hypotheses,)
    samples_states, before_states, states : A, B and their blend, (n_states, n_lanes)
    rates : change of the blend in a second, (n_states, n_lanes)
    trust : P_A
    expected : predicted outputs, (n_outputs, n_lanes)
    sums : numerator and denominator of the error index, (2, n_outputs, n_lanes)
    index_before : error index one sample earlier, (n_outputs, n_lanes)
    quiet_at : time at which each output was last below half its limit, (n_outputs,)
    factors : estimated parameters over their scale, (n_slots, n_lanes)
    covariance : of the factors, (n_slots, n_slots, n_lanes)
    misfits : mean square of what is left over of each law while healthy, (n_sides,); misfit_counts : samples in it
    """

    index: int
    running: int
    alarm: int
    absent: int
    time: float
    at: float
    trust: float
    raw: FloatArray
    raw_times: FloatArray
    frames: FloatArray
    present: FloatArray
    held_inputs: FloatArray
    peak: FloatArray
    since_step: FloatArray
    squares: FloatArray
    counts: FloatArray
    healthy: FloatArray
    spread_states: FloatArray
    spread_sums: FloatArray
    rejected: FloatArray
    samples_states: FloatArray
    before_states: FloatArray
    states: FloatArray
    rates: FloatArray
    expected: FloatArray
    sums: FloatArray
    index_before: FloatArray
    quiet_at: FloatArray
    factors: FloatArray
    covariance: FloatArray
    misfits: FloatArray
    misfit_counts: FloatArray

    def save(self) -> dict[str, FloatArray]:
        """Give all numbers by name, for `numpy.savez`."""
        return {field.name: np.asarray(getattr(self, field.name), dtype=float) for field in fields(self)}

    @staticmethod
    def restore(saved: dict[str, FloatArray]) -> "ClassicState":
        """Give the state that `save` wrote."""
        numbers: dict[str, Any] = {name: int(saved[name]) for name in _WHOLE}
        numbers |= {name: float(saved[name]) for name in ("time", "at", "trust")}
        return ClassicState(**({name: np.asarray(saved[name]) for name in saved} | numbers))


def begin_anew(state: ClassicState) -> ClassicState:
    """Give the state with which monitoring begins again; what the plant's signals are like is kept."""
    return replace(
        state,
        running=-1,
        sums=np.zeros_like(state.sums),
        index_before=np.zeros_like(state.index_before),
        spread_sums=np.zeros_like(state.spread_sums),
        frames=np.full_like(state.frames, np.nan),
    )


def init(spec: EngineSpec, plan: ClassicPlan, t0: float = 0.0) -> ClassicState:
    """Give the state before the first sample, at time `t0` (s)."""
    n_u, n_y, n_x, lanes = len(spec.inputs), len(spec.outputs), len(plan.states), plan.n_lanes
    window = 2 * plan.delay + 1
    return ClassicState(
        index=0,
        running=-1,
        alarm=-1,
        absent=0,
        time=t0,
        at=t0,
        trust=1.0,
        raw=np.full((window, n_u + n_y), np.nan),
        raw_times=np.full(window, np.nan),
        frames=np.full((plan.depth, n_u + n_y), np.nan),
        present=np.zeros(n_u + n_y),
        held_inputs=np.full(n_u, np.nan),
        peak=np.zeros(n_u),
        since_step=np.full(n_u, np.inf),
        squares=np.zeros(n_y),
        counts=np.zeros(n_y),
        healthy=np.array([item.nominal for item in spec.parameters]),
        spread_states=np.zeros((n_x, len(spec.parameters))),
        spread_sums=np.zeros((2, n_y)),
        rejected=np.zeros(len(spec.hypotheses)),
        samples_states=np.zeros((n_x, lanes)),
        before_states=np.zeros((n_x, lanes)),
        states=np.zeros((n_x, lanes)),
        rates=np.zeros((n_x, lanes)),
        expected=np.full((n_y, lanes), np.nan),
        sums=np.zeros((2, n_y, lanes)),
        index_before=np.zeros((n_y, lanes)),
        quiet_at=np.full(n_y, t0),
        factors=np.zeros((plan.n_slots, lanes)),
        covariance=np.zeros((plan.n_slots, plan.n_slots, lanes)),
        misfits=np.zeros(len(plan.sides)),
        misfit_counts=np.zeros(len(plan.sides)),
    )
