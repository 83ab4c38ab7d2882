"""Accepting and rejecting a candidate: what a person, or a rule, makes of a diagnosis.

An accepted candidate becomes the healthy model: its lane goes on as the healthy filter, what is wrong with an
instrument is corrected from then on, and the alarms are on again. A rejected one is out until the next alarm, and with
it all sets that contain it: that all of a set are at fault is claimed by each of these too.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.contract.slots import SlotLane, plan_slots
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.errors import FaultbondError
from faultbond.runtime.bank import no_bank
from faultbond.runtime.monitor import conclude
from faultbond.runtime.ranking import best_lanes, scores
from faultbond.runtime.slotted import shared
from faultbond.runtime.state import State, no_detector_sums
from faultbond.types import FaultKind

WANDER = 0.5  # of what an accepted drift moves in a sample, the parameter may move otherwise
MOST_NOISE = 0.25  # of the variance of a sensor that is blanked: one that is accepted with more would count as that
SURE_SAMPLES = 200  # for which a candidate has been the sure one before a rule accepts it


def find_hypothesis(spec: EngineSpec, components: Sequence[str]) -> int:
    """Give the index of the hypothesis with these components, or parameters, or of this sensor or input.

    Raises
    ------
    FaultbondError
        Where there is none, or several.
    """
    wanted = frozenset(components)
    found = [
        k
        for k, chosen in enumerate(map(spec.members, range(spec.n_hypotheses)))
        if wanted
        in (
            frozenset(spec.parameters[i].component for i in chosen),
            frozenset(spec.parameters[i].name for i in chosen),
        )
    ]
    found += [k for k, item in enumerate(spec.instruments, len(spec.hypotheses)) if wanted == {item.name}]
    if len(found) == 1:
        return found[0]
    words = ", ".join(components)
    if found:
        raise FaultbondError(f"{words}: several hypotheses have these components. Name their parameters instead.")
    raise FaultbondError(
        f"{words}: no hypothesis has just these components. Name those of one candidate of the diagnosis."
    )


def accept(spec: EngineSpec, state: State, hypothesis: int) -> tuple[State, Candidate]:
    """Take a hypothesis as the new healthy model; give the state and the candidate as it stood.

    Raises
    ------
    FaultbondError
        Where there is no alarm to explain, or it is not among the candidates.
    """
    candidate = candidate_of(spec, state, hypothesis)
    lane = int(best_lanes(spec, state.bank)[hypothesis])
    steps = state.bank.steps.shape[1]
    if lane < steps:
        changed, healthy = state, state.bank.steps[:, lane]
    else:
        item = plan_slots(spec).lanes[lane - steps]
        changed, healthy = _absorbed(
            spec, state, item, state.bank.slots[:, lane - steps], candidate.suspects[0].estimate
        )
    last, past = state.clock.index - 1, state.past
    accepted = replace(
        changed,
        clock=replace(state.clock, alarm=-1, accepted=last),
        sensors=replace(changed.sensors, **no_detector_sums(len(spec.outputs), last)),
        healthy=replace(state.healthy, lane=healthy[:, None].copy()),
        past=past.mended(past.samples[-1:], healthy[None, :], past.wildness[-1:]),
        bank=no_bank(spec),
        normal=replace(changed.normal, lane=healthy[:, None].copy()),
    )
    return accepted, candidate


def reject(spec: EngineSpec, state: State, hypothesis: int) -> tuple[State, Candidate]:
    """Rule a hypothesis out until the next alarm, with all sets that contain it; the others share their probability.

    Raises
    ------
    FaultbondError
        Where there is no alarm to explain, it is not among the candidates, it is rejected already, or nothing would be
        left.
    """
    candidate = candidate_of(spec, state, hypothesis)
    if state.bank.rejected[hypothesis] > 0:
        names = ", ".join(sorted(hypothesis_names(spec, hypothesis)))
        raise FaultbondError(f"{names}: rejected already, alone or with a set that it contains.")
    rejected = without(spec, state.bank.rejected, hypothesis, scores(spec, state.bank) > -np.inf)
    return replace(state, bank=replace(state.bank, rejected=rejected)), candidate


def without(spec: EngineSpec, rejected: FloatArray, hypothesis: int, tested: BoolArray) -> FloatArray:
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


def candidate_of(spec: EngineSpec, state: State, hypothesis: int) -> Candidate:
    """Give the candidate of a hypothesis as it stands now.

    Raises
    ------
    FaultbondError
        Where there is no alarm to explain, or it is not among the candidates.
    """
    if state.clock.alarm < 0:
        raise FaultbondError("There is no alarm to explain, so nothing to accept or reject.")
    if not 0 <= hypothesis < spec.n_hypotheses:
        raise FaultbondError(f"{spec.model}: there is no candidate of the number {hypothesis}.")
    found = (item for item in conclude(spec, state).candidates if item.hypothesis == hypothesis)
    candidate = next(found, None)
    if candidate is None:
        names = hypothesis_names(spec, hypothesis)
        raise FaultbondError(f"{', '.join(sorted(names))}: not among the candidates that are listed.")
    return candidate


def hypothesis_names(spec: EngineSpec, hypothesis: int) -> frozenset[str]:
    """Give the parameters of a hypothesis, or its sensor or input."""
    members = spec.members(hypothesis)
    if members:
        return frozenset(spec.parameters[i].name for i in members)
    return frozenset({spec.instruments[hypothesis - len(spec.hypotheses)].name})


def candidate_names(candidate: Candidate) -> frozenset[str]:
    """Give the parameters of a candidate, or its sensor or input."""
    return frozenset(name.partition(".")[0] for name in candidate.parameters)


def is_sure(diagnosis: Diagnosis, level: float) -> bool:
    """Whether the best candidate and its kind are likely enough, it is alone in its group, and explains the data."""
    if not diagnosis.candidates:
        return False
    best = diagnosis.candidates[0]
    alone = sum(item.group for item in diagnosis.candidates) == 1
    share = best.kinds[0][1] if best.kinds else 1.0
    return best.probability * share >= level and alone and diagnosis.unexplained is None


def _absorbed(
    spec: EngineSpec, state: State, item: SlotLane, lane: FloatArray, estimate: float
) -> tuple[State, FloatArray]:
    """Give the state and the healthy lane with what a slot holds made part of the plant or its instruments.

    `estimate`: value that the diagnosis tells of it, SI.
    """
    wide = spec.slotted
    size, rate = (float(value) for value in lane[wide.slot_slice])
    if item.parameter >= 0:
        return _absorbed_parameter(spec, state, item, lane, rate)
    changed = state
    if item.input >= 0:
        offset, held, acting = state.normal.input_offset.copy(), state.inputs.held.copy(), size * item.acts
        offset[item.input] += acting
        held[item.input] += acting  # what acts is not changed by knowing of it
        normal = replace(state.normal, input_offset=offset)
        changed = replace(state, normal=normal, inputs=replace(state.inputs, held=held))
    elif item.acts:
        changed = _absorbed_sensor(spec, state, item, size, estimate)
    return changed, _narrowed(spec, lane, np.zeros(wide.n_joint), -1)


def _absorbed_sensor(spec: EngineSpec, state: State, item: SlotLane, size: float, estimate: float) -> State:
    """Correct a sensor, or do without it where it no longer follows the plant, drifts, or errs at times."""
    j, normal = item.output, state.normal
    gain, offset, noise, nis = (part.copy() for part in (normal.gain, normal.offset, normal.noise, state.sensors.nis))
    match item.kind:
        case FaultKind.BIAS:
            offset[j] += gain[j] * size * spec.outputs[j].noise
        case FaultKind.GAIN:
            gain[j] *= 1.0 + size
        case FaultKind.NOISE:
            noise[j] = min((estimate / spec.outputs[j].noise) ** 2, MOST_NOISE * spec.thresholds.blank_factor)
            nis[j] = 1.0  # the noise that was found is what squares are now taken in
        case _:
            noise[j] = np.inf
    return replace(
        state,
        normal=replace(normal, gain=gain, offset=offset, noise=noise),
        sensors=replace(state.sensors, nis=nis),
    )


def _absorbed_parameter(
    spec: EngineSpec, state: State, item: SlotLane, lane: FloatArray, rate: float
) -> tuple[State, FloatArray]:
    """Let a parameter be what it and the slot add up to, and go on as it drifts."""
    wide, changed = spec.slotted, state
    weights = np.zeros(wide.n_joint)
    weights[wide.slot_slice.start] = float(item.acts)
    if item.kind is FaultKind.DRIFT:
        rates, wander = state.normal.rates.copy(), state.normal.wander.copy()
        rates[item.parameter] += rate
        wander[item.parameter] = abs(WANDER * rate)
        changed = replace(state, normal=replace(state.normal, rates=rates, wander=wander))
    return changed, _narrowed(spec, lane, weights, item.parameter)


def _narrowed(spec: EngineSpec, lane: FloatArray, weights: FloatArray, parameter: int) -> FloatArray:
    """Give a lane without its slot; `weights` (n_joint of slot lanes) times z is added to a parameter."""
    wide, own = spec.slotted, shared(spec)
    take = np.zeros((spec.n_joint, wide.n_joint))
    take[np.arange(len(own)), own] = 1.0
    if parameter >= 0:
        take[spec.parameter_slice.start + parameter] += weights
    covariance = take @ unpack(wide, lane[wide.covariance_slice]) @ take.T
    mean = take @ lane[: wide.n_joint]
    return np.concatenate([mean, pack(covariance), lane[wide.loop_slice], lane[-1:]])
