"""What a person, or a rule, makes of a diagnosis of method `classic`: accept, reject; and going on after a pause.

Source: thesis 5.4, last part: the new value of a parameter is put into the model, and monitoring begins again.
"""

from dataclasses import replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Candidate
from faultbond.contract.spec import EngineSpec
from faultbond.errors import FaultbondError
from faultbond.runtime.names import hypothesis_names
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.ranking import rank
from faultbond.thesis.online.state import ClassicState, begin_anew, with_nothing_sure


def accept(
    spec: EngineSpec, plan: ClassicPlan, state: ClassicState, hypothesis: int, *, repaired: bool = False
) -> tuple[ClassicState, Candidate]:
    """Take a hypothesis as the new healthy model, or as repaired; give the state and the candidate as it stood.

    Raises
    ------
    FaultbondError
        Where there is no alarm to explain, or the hypothesis is not among the candidates.
    """
    candidate = _candidate(spec, plan, state, hypothesis)
    healthy = state.healthy.copy()
    for index, suspect in zip(spec.hypotheses[hypothesis], candidate.suspects, strict=True):
        healthy[index] = spec.parameters[index].nominal if repaired else suspect.estimate
    accepted = replace(
        with_nothing_sure(after_pause(replace(state, alarm=-1))),
        healthy=healthy,
        misfits=0.0 * state.misfits,
        misfit_counts=0.0 * state.misfits,
    )
    return accepted, candidate


def reject(spec: EngineSpec, plan: ClassicPlan, state: ClassicState, hypothesis: int) -> tuple[ClassicState, Candidate]:
    """Rule a hypothesis out until the next alarm, with all that contain it; give the state and the candidate.

    Raises
    ------
    FaultbondError
        Where there is no alarm to explain, the hypothesis is not among the candidates, or nothing would be left.
    """
    candidate = _candidate(spec, plan, state, hypothesis)
    rejected = _without(spec, state.rejected, hypothesis, np.ones(len(state.rejected), dtype=bool))
    return replace(with_nothing_sure(state), rejected=rejected), candidate


def after_pause(state: ClassicState) -> ClassicState:
    """Give the state with which a run goes on after a time of unknown length: monitoring begins anew, unless it tests.

    What the plant's signals are like, and what was accepted, is kept.
    """
    if state.alarm >= 0:
        return state
    return replace(
        begin_anew(state), raw=np.full_like(state.raw, np.nan), raw_times=np.full_like(state.raw_times, np.nan)
    )


def _candidate(spec: EngineSpec, plan: ClassicPlan, state: ClassicState, hypothesis: int) -> Candidate:
    if state.alarm < 0:
        raise FaultbondError("There is no alarm to explain, so nothing to accept or reject.")
    for item in rank(spec, plan, state).candidates:
        if item.hypothesis == hypothesis:
            return item
    raise FaultbondError("That hypothesis was rejected, or is not among the candidates that are listed.")


def _without(spec: EngineSpec, rejected: FloatArray, hypothesis: int, tested: BoolArray) -> FloatArray:
    """Give what is rejected after one more hypothesis, with all that contain it.

    Parameters
    ----------
    spec : the model
    rejected : float array, shape (n_hypotheses,)
        1 for each hypothesis that is rejected.
    hypothesis : the one that a person rejects
    tested : bool array, shape (n_hypotheses,)
        Those that have a score now.

    Raises
    ------
    FaultbondError
        Where no tested hypothesis would be left.
    """
    chosen = frozenset(spec.members(hypothesis))
    after = rejected.copy()
    after[hypothesis] = 1.0
    if chosen:  # an instrument is in no set but its own
        after[[chosen <= frozenset(spec.members(k)) for k in range(len(after))]] = 1.0
    if np.all(after[tested] > 0):
        names = ", ".join(sorted(hypothesis_names(spec, hypothesis)))
        raise FaultbondError(f"{names}: the last hypothesis cannot be rejected, and all that are left contain this.")
    return after
