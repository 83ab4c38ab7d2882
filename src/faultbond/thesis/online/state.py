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
    **dict.fromkeys(("running", "alarm", "sure", "sure_since", "clear_since"), COUNT_OR_NONE),
    **dict.fromkeys(("present", "rejected"), FLAG),
    **dict.fromkeys(("peak", "counts", "misfit_counts"), POSITIVE),
    "since_step": Allowed(least=0.0, infinite=True),
    **dict.fromkeys(("raw", "raw_times", "frames", "held_inputs"), Allowed(nan=True)),
    **dict.fromkeys(  # of models that may have run away
        ("squares", "spread_states", "spread_sums", "samples_states", "before_states", "states", "rates"), ANYTHING
    ),
    **dict.fromkeys(("expected", "sums", "index_before", "factors", "covariance", "misfits"), ANYTHING),
}
_WHOLE = ("index", "running", "alarm", "absent", "sure", "sure_since", "clear_since")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClassicState:
    """The numbers, SI; lane 0 is the healthy model, the others are the tested sets."""

    index: int  # samples taken
    running: int  # samples since monitoring began, T of the thesis; -1: not yet
    alarm: int  # sample of the alarm; -1: none
    absent: int  # samples since any output was there
    sure: int  # hypothesis that the rule has in mind, which accepts without a person; -1: none
    sure_since: int  # sample since which it has been sure,
    clear_since: int  # and since which its kind has been, too; -1: it is not
    time: float  # of the newest sample, s
    at: float  # of the sample that was last worked on, which the prefilter delays, s
    trust: float  # P_A
    raw: FloatArray  # (window, n_signals): newest samples as they came, oldest first
    raw_times: FloatArray  # (window,), s
    frames: FloatArray  # (depth, n_signals): filtered samples, newest first, missing ones held
    present: FloatArray  # (n_signals,): whether each signal of the newest frame was there
    held_inputs: FloatArray  # (n_inputs,): this and the next two to find steps of inputs
    peak: FloatArray  # (n_inputs,)
    since_step: FloatArray  # (n_inputs,), s
    squares: FloatArray  # (n_outputs,): mean square of each output
    counts: FloatArray  # (n_outputs,): samples in it
    healthy: FloatArray  # (n_parameters,): values while healthy; nominal until something is accepted
    spread_states: FloatArray  # (n_states, n_parameters): of models with one parameter off by its declared accuracy
    spread_sums: FloatArray  # (2, n_outputs): numerator and denominator of the error index of all these together
    rejected: FloatArray  # (n_hypotheses,): 1 for each that a person has ruled out
    samples_states: FloatArray  # (n_states, n_lanes): A,
    before_states: FloatArray  # (n_states, n_lanes): B,
    states: FloatArray  # (n_states, n_lanes): and their blend
    rates: FloatArray  # (n_states, n_lanes): change of the blend in a second
    expected: FloatArray  # (n_outputs, n_lanes): predicted outputs
    sums: FloatArray  # (2, n_outputs, n_lanes): numerator and denominator of the error index
    index_before: FloatArray  # (n_outputs, n_lanes): error index one sample earlier
    quiet_at: FloatArray  # (n_outputs,): time at which each output was last below half its limit, s
    factors: FloatArray  # (n_slots, n_lanes): estimated parameters over their scale
    covariance: FloatArray  # (n_slots, n_slots, n_lanes): of the factors
    misfits: FloatArray  # (n_sides,): mean square of what is left over of each law while healthy
    misfit_counts: FloatArray  # (n_sides,): samples in it

    def save(self) -> dict[str, FloatArray]:
        """Give all numbers by name, each in its shape above, for `numpy.savez`."""
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


def with_nothing_sure(state: ClassicState) -> ClassicState:
    """Give the state in which the rule has nothing in mind, as after each decision."""
    return replace(state, sure=-1, sure_since=-1, clear_since=-1)


def init(spec: EngineSpec, plan: ClassicPlan, t0: float = 0.0) -> ClassicState:
    """Give the state before the first sample, at time `t0` (s)."""
    n_u, n_y, n_x, lanes = len(spec.inputs), len(spec.outputs), len(plan.states), plan.n_lanes
    window = 2 * plan.delay + 1
    return ClassicState(
        index=0,
        running=-1,
        alarm=-1,
        absent=0,
        sure=-1,
        sure_since=-1,
        clear_since=-1,
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
