"""The on-line part: `step`, a pure function on a state of numbers. No clock, file or socket.

Each sample passes the healthy filter; CUSUMs of each sensor (Page 1954), of its error and of its scatter, and the slow
errors decide on an alarm; from the alarm on the bank runs beside it. Thesis 4.5.2 calls this part the universal
algorithms.
"""

from dataclasses import replace
from math import inf

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Detection, Diagnosis, Unexplained
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime.alarm import accumulated, counted, detect, slow_ratios, statistic
from faultbond.runtime.bank import Bank, advance_bank, begin_bank, renew_bank
from faultbond.runtime.drifting import drifting
from faultbond.runtime.estimates import Absorbed
from faultbond.runtime.outliers import begin
from faultbond.runtime.packing import corrected
from faultbond.runtime.ranking import leading_lane, rank, scores, table_of
from faultbond.runtime.start import healthy_lane
from faultbond.runtime.state import (
    SNAPSHOT_EVERY,
    Changes,
    Report,
    Sample,
    State,
    Status,
    bank_fields,
    init,
    no_scatter,
)
from faultbond.runtime.trail import Trail, bursts
from faultbond.runtime.untested import untested
from faultbond.runtime.wild import admit, judged, seen, surprising, without_spike

START_SAMPLES = 20  # gathered before an unknown start is solved
START_PATIENCE = 300  # samples for which a sensor without any value holds up the start
RENEWALS = (30, 100, 200)  # samples after the alarm at which the bank begins again from what it has found
DIAGNOSIS_EVERY = 20  # samples between diagnoses
FOLLOWED = 10.0  # nats by which a drift that follows nearly anything fits better than what does not: nothing else fits


def quiet(spec: EngineSpec) -> EngineSpec:
    """Give the specification with the alarms off, and only as much history as the start may need."""
    limits = replace(spec.thresholds, cusum_limit=inf, fast_limit=inf, slow_error_limit=inf)
    return replace(spec, thresholds=replace(limits, history_samples=START_PATIENCE + 2))


def step(spec: EngineSpec, engine: Engine, state: State, sample: Sample) -> tuple[State, Report]:
    """Take one sample.

    Parameters
    ----------
    spec, engine : the model
    state : State
        Before the sample; not changed.
    sample : Sample
        Missing values are nan.

    Returns
    -------
    state, report : State, Report
        Nothing raises on data; what was missing shows in the report's status and nan values.
    """
    sample = corrected(state, sample)
    u = np.where(np.isfinite(sample.u), sample.u, state.held)
    if not np.all(np.isfinite(u)):
        return replace(state, index=state.index + 1, time=sample.time, held=u), _silent(spec, Status.WAITING)
    moving = drifting(spec, engine, state.rates, state.wander)
    state, packed, changes, wild = admit(spec, moving, state, sample)
    changes["time"] = sample.time
    if not state.running:
        return _gather(spec, engine, _kept(spec, moving, state, packed, changes))
    lane, innovations = moving.advance(state.lane, packed[None, :])
    if state.spent.any() or surprising(spec, packed, innovations[0, :, 0]):
        lane, innovations, packed, more, changes = _mended(spec, moving, state, packed, changes, lane, innovations)
        wild += more
    else:
        changes |= seen(state, *_readings(spec, packed))
    state = _kept(spec, moving, state, packed, changes)
    if not np.all(np.isfinite(lane)):
        zero = np.zeros_like(state.cusum)
        sums: Changes = {"cusum": zero, "fast": zero, "scatter": no_scatter(len(spec.outputs))}
        nowhere = init(spec).travel  # where a lost filter believed the plant is no place where it has been
        odd = np.full_like(state.odd, np.nan)
        lost = replace(state, index=state.index + 1, begun=-1, running=0, travel=nowhere, odd=odd, **sums)
        return lost, replace(_silent(spec, Status.LOST), wild=wild)
    state, report = _judge(spec, moving, state, lane, packed, innovations[0, :, 0])
    return state, replace(report, wild=wild) if wild else report


def _mended(
    spec: EngineSpec,
    engine: Engine,
    state: State,
    packed: FloatArray,
    changes: Changes,
    lane: FloatArray,
    innovations: FloatArray,
) -> tuple[FloatArray, FloatArray, FloatArray, int, Changes]:
    """Pass a sample through the healthy filter once more without what is wild in it.

    Gives the lane, the innovations, the packed sample, the number of wild values, and what changes in the state.
    """
    smooth = without_spike(spec, engine, state, packed)
    if smooth is not packed:
        lane, innovations = engine.advance(state.lane, smooth[None, :])
    mended, more, readings = judged(spec, state, changes, smooth, innovations[0, :, 0])
    if readings:
        lane, innovations = engine.advance(state.lane, mended[None, :])
    return lane, innovations, mended, readings + (smooth is not packed), changes | more


def _kept(spec: EngineSpec, engine: Engine, state: State, packed: FloatArray, changes: Changes) -> State:
    """Give the state with its changes, a packed sample in its trail, and the bank after it."""
    slot = state.index % len(state.trail_times)
    samples, times = state.trail_samples.copy(), state.trail_times.copy()
    samples[slot], times[slot] = packed, changes["time"]
    kept = replace(state, trail_samples=samples, trail_times=times, **changes)
    if state.alarm < 0:
        return kept
    use = counted(spec, kept, packed)
    return replace(kept, **bank_fields(advance_bank(spec, engine, state.bank, packed, use, state.index)))


def _silent(spec: EngineSpec, status: Status) -> Report:
    nothing = np.full(len(spec.outputs), np.nan)
    return Report(
        status=status, expected=nothing, variance=nothing, cusum=nothing, slow=np.full(len(spec.slow_errors), np.nan)
    )


def _gather(spec: EngineSpec, engine: Engine, state: State) -> tuple[State, Report]:
    """Collect the first samples, then solve the start and filter what was collected."""
    count = state.index - state.begun + 1
    again = bool(np.any(state.lane))  # the filter ran before: the start that the model gives is long past
    unknown = again or any(item.start_sd is None for item in spec.states)
    if count < START_SAMPLES or (unknown and count < START_PATIENCE and not _all_seen(spec, state)):
        return replace(state, index=state.index + 1), _silent(spec, Status.STARTING)
    if count > START_SAMPLES and all(item.start_sd is None for item in spec.states):
        state = replace(state, begun=_recent(spec, state))
    chosen = np.arange(state.begun, state.index + 1) % len(state.trail_times)
    known = state.normal if state.accepted >= 0 else None
    found = begin(spec, engine, state, state.trail_samples[chosen], known, again=again)
    lane = healthy_lane(spec, found.mean, found.covariance, known)
    samples, lanes = state.trail_samples.copy(), state.trail_lanes.copy()
    samples[chosen] = found.samples
    state = replace(found.state, trail_samples=samples, shown=init(spec).shown)
    innovations = np.zeros((1, 2 * len(spec.outputs), 1))
    for slot, sample in zip(chosen, found.samples, strict=True):
        lane, innovations = engine.advance(lane, sample[None, :])
        lanes[slot] = lane[:, 0]
        state = replace(state, **seen(state, *_readings(spec, sample)))
    state = replace(state, lane=lane, trail_lanes=lanes, running=1)
    last = found.samples[-1]
    report = _report(spec, state, Status.WARMING, last, innovations[0, :, 0], statistic(spec, state))
    return replace(state, index=state.index + 1), replace(report, wild=found.wild)


def _readings(spec: EngineSpec, packed: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Give the readings of a packed sample and which of them are there, (n_outputs,) each."""
    return packed[spec.sample_fields["y"]], packed[spec.sample_fields["use"]] > 0


def _recent(spec: EngineSpec, state: State) -> int:
    """Give the first of the samples that are enough: over all of a long wait the nominal parameters would not hold."""
    chosen = np.arange(state.begun, state.index + 1)
    used = state.trail_samples[chosen % len(state.trail_times)][:, spec.sample_fields["use"]] > 0
    last = [int(chosen[column][-1]) for column in used.T if np.any(column)]
    return min([state.index - START_SAMPLES + 1, *last])


def _all_seen(spec: EngineSpec, state: State) -> bool:
    """Whether every output has had a value among the samples gathered."""
    chosen = np.arange(state.begun, state.index + 1) % len(state.trail_times)
    return bool(np.all(np.any(state.trail_samples[chosen][:, spec.sample_fields["use"]] > 0, axis=0)))


def _remembered(state: State, lane: FloatArray) -> Changes:
    lanes = state.trail_lanes.copy()
    lanes[state.index % len(lanes)] = lane[:, 0]
    kept: Changes = {"lane": lane, "trail_lanes": lanes}
    x, (low, high) = lane[: state.travel.shape[1], 0], state.travel
    if ((x < low) | (x > high)).any() and not state.astray.any():  # else the states are sought, and not known well
        kept["travel"] = np.stack([np.minimum(low, x), np.maximum(high, x)])
    number, rest = divmod(state.index - _learned_from(state), SNAPSHOT_EVERY)
    if rest or number < 0:
        return kept
    snapshots = state.snapshots.copy()
    snapshots[number % len(snapshots)] = lane[:, 0]
    return kept | {"snapshots": snapshots}


def _learned_from(state: State) -> int:
    """Give the sample from which healthy lanes are kept for long: a while after the start, or what was accepted."""
    return max(state.begun, state.accepted) + SNAPSHOT_EVERY


def _oldest(state: State) -> FloatArray | None:
    """Give the oldest healthy lane that is kept; None before the first, and where that is of after the alarm."""
    first = _learned_from(state)
    number = (state.index - first) // SNAPSHOT_EVERY
    oldest = max(number - len(state.snapshots) + 1, 0)
    if number < 0 or 0 <= state.alarm < first + oldest * SNAPSHOT_EVERY:
        return None
    lane: FloatArray = state.snapshots[oldest % len(state.snapshots)]
    return lane


def _report(
    spec: EngineSpec,
    state: State,
    status: Status,
    packed: FloatArray,
    innovations: FloatArray,
    peak: FloatArray,
    *,
    detection: Detection | None = None,
    diagnosis: Diagnosis | None = None,
) -> Report:
    n_y = len(spec.outputs)
    present = packed[spec.sample_fields["use"]] > 0
    measured = np.where(present, packed[spec.sample_fields["y"]], 0.0)
    scale = packed[spec.sample_fields["scale"]]  # while a sensor is blanked, no part of what the model expects
    blank = np.where(scale >= spec.thresholds.blank_factor, scale - 1.0, 0.0) * spec.output_noise**2
    return Report(
        status=status,
        expected=measured - innovations[:n_y],
        variance=innovations[n_y:] - blank,
        cusum=peak,
        slow=slow_ratios(spec, state),
        detection=detection,
        diagnosis=diagnosis,
    )


def _judge(
    spec: EngineSpec, engine: Engine, state: State, lane: FloatArray, packed: FloatArray, innovations: FloatArray
) -> tuple[State, Report]:
    """Update the statistics, raise the alarm, run the bank."""
    warm = state.index - state.begun >= spec.thresholds.warm_up_samples
    sums = accumulated(spec, state, packed, innovations) if warm else {}
    state = replace(state, **_remembered(state, lane), **sums)
    peak = statistic(spec, state)
    detection, alarm, bank = None, state.alarm, state.bank
    if alarm >= 0:
        if state.index - alarm in RENEWALS and alarm > state.begun:  # of a filter that was lost, no lanes are kept
            trail, _ = _cut_trail(spec, engine, state, alarm)
            last = state.index - alarm == RENEWALS[-1]
            bank = renew_bank(spec, engine, trail, bank, state.index, state.rejected, state.peak, last=last)
    elif warm:
        detection, change = detect(spec, state, peak)
        if detection is not None:
            alarm = state.index
            bank = begin_bank(spec, engine, *_cut_trail(spec, engine, state, change), state.peak, state.index)
    due = alarm >= 0 and (state.index - alarm) % DIAGNOSIS_EVERY == 0
    report = _report(
        spec,
        state,
        Status.DIAGNOSING if alarm >= 0 else (Status.WATCHING if warm else Status.WARMING),
        packed,
        innovations,
        peak,
        detection=detection,
        diagnosis=conclude(spec, replace(state, **bank_fields(bank))) if due else None,
    )
    count = state.detections + (detection is not None)
    return replace(state, alarm=alarm, detections=count, index=state.index + 1, **bank_fields(bank)), report


def _cut_trail(spec: EngineSpec, engine: Engine, state: State, change: int) -> tuple[Trail, int]:
    """Give the trail up to now, oldest first, and the place of the onset in it."""
    depth = len(state.trail_times)
    oldest = max(state.begun, state.accepted, state.index - depth + 1)
    chosen = np.arange(oldest, state.index + 1) % depth
    samples, lanes = state.trail_samples[chosen], state.trail_lanes[chosen]
    alarm = (state.alarm if state.alarm >= 0 else state.index) - oldest
    wild = bursts(spec, engine, samples[: alarm + 1], lanes)
    return Trail(samples=samples, lanes=lanes, old=_oldest(state), alarm=alarm, bursts=wild), change - oldest


def conclude(spec: EngineSpec, state: State) -> Diagnosis:
    """Give the diagnosis of now, after a detection; without candidates where nothing is a suspect."""
    if not spec.n_hypotheses:
        return Diagnosis(time=state.time, candidates=())
    bank = _without(spec, state)
    steady = _steady(spec, bank)
    followed = float(np.max(scores(spec, bank)) - np.max(scores(spec, steady))) > FOLLOWED
    unexplained = _unexplained(spec, state, leading_lane(spec, steady), followed=followed)
    fresh = any(0 <= state.index - state.alarm - begun <= RENEWALS[0] for begun in (0, *RENEWALS))
    bounded = unexplained is None and state.alarm >= 0 and not fresh  # sums of what began just now tell nothing yet
    return replace(
        rank(spec, state.time, bank, Absorbed(rates=state.rates, noise=state.reading_noise * state.nis)),
        unexplained=unexplained,
        untested=untested(spec, bank, state.index, state.rejected, bounded=bounded),
    )


def _steady(spec: EngineSpec, bank: Bank) -> Bank:
    """Give the bank without drifts whose rate may change: these follow nearly anything, so their fit says little."""
    slots = bank.slots.copy()
    slots[-1, [lane.span > 0.0 for lane in plan_slots(spec).lanes]] = -np.inf
    return replace(bank, slots=slots)


def _without(spec: EngineSpec, state: State) -> Bank:
    """Give the bank without the hypotheses that were rejected."""
    if not np.any(state.rejected):
        return state.bank
    out = state.rejected[table_of(spec, state.bank).hypothesis] > 0
    steps, slots, n = state.steps.copy(), state.slots.copy(), state.steps.shape[1]
    steps[-1, out[:n]] = slots[-1, out[n:]] = -np.inf
    return replace(state.bank, steps=steps, slots=slots)


def _unexplained(spec: EngineSpec, state: State, lane: int, *, followed: bool) -> Unexplained | None:
    """Tell where the best lane does not fit, if the detector would raise an alarm on it.

    followed : whether a drift whose rate may change fits better by far; then this lane does not fit anyhow
    """
    sums = state.misfit[:, :, lane]
    side, signal = np.unravel_index(int(np.argmax(sums)), sums.shape)
    if sums[side, signal] <= spec.thresholds.cusum_limit and not followed:
        return None
    length = state.index - int(state.misfit_since[side, signal, lane])
    depth = len(state.trail_times)
    since = state.trail_times[(state.index - min(length, depth - 1)) % depth]
    return Unexplained(
        signal=spec.outputs[signal].name,
        sd=float(sums[side, signal] / max(length, 1) + spec.thresholds.cusum_drift),
        since=float(since),
        until=state.time,
    )


def finish(spec: EngineSpec, state: State) -> Diagnosis | None:
    """Give the last diagnosis, if a fault was detected."""
    return conclude(spec, state) if state.alarm >= 0 else None
