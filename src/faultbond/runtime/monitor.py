"""The on-line part: `step`, a pure function on a state of numbers. No clock, file or socket.

Each sample passes the healthy filter; CUSUMs of each sensor (Page 1954), of its error and of its scatter, and the slow
errors decide on an alarm; from the alarm on the bank runs beside it. Thesis 4.5.2 calls this part the universal
algorithms.
"""

from dataclasses import replace
from math import inf
from typing import Any

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Diagnosis, Unexplained
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
    Clock,
    Healthy,
    Report,
    Sample,
    State,
    Status,
    init,
    no_detector_sums,
)
from faultbond.runtime.trail import Trail, bursts, wildness_of
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
    sample = corrected(state.normal, sample)
    u = np.where(np.isfinite(sample.u), sample.u, state.inputs.held)
    if not np.all(np.isfinite(u)):
        waiting = replace(state, inputs=replace(state.inputs, held=u))
        return _after(waiting, time=sample.time), _silent(spec, Status.WAITING)
    moving = drifting(spec, engine, state.normal.rates, state.normal.wander)
    before, packed, state, wild = admit(spec, moving, state, sample)
    state = replace(state, clock=replace(state.clock, time=sample.time))
    if not state.clock.running:
        return _gather(spec, moving, _kept(spec, moving, state, packed, np.zeros(spec.n_numbers), 0.0))
    lane, innovations = moving.advance(before.healthy.lane, packed[None, :])
    if before.sensors.spent.any() or surprising(spec, packed, innovations[0, :, 0]):
        smooth = without_spike(spec, moving, before, packed)
        if smooth is not packed:
            lane, innovations = moving.advance(before.healthy.lane, smooth[None, :])
            wild += 1
        packed, sensors, n_wild = judged(spec, state, smooth, innovations[0, :, 0])
        if n_wild:
            lane, innovations = moving.advance(before.healthy.lane, packed[None, :])
            wild += n_wild
    else:
        sensors = seen(state.sensors, *_readings(spec, packed))
    state = replace(state, sensors=sensors)
    state = _kept(spec, moving, state, packed, lane[:, 0], wildness_of(spec, packed, innovations[0, :, 0]))
    if not np.all(np.isfinite(lane)):
        return _lost(spec, state), replace(_silent(spec, Status.LOST), wild=wild)
    state, report = _judge(spec, moving, state, lane, packed, innovations[0, :, 0])
    return state, replace(report, wild=wild) if wild else report


def _after(state: State, **changes: Any) -> State:
    """Give the state as it is for the next sample, with other changes of its clock."""
    return replace(state, clock=replace(state.clock, index=state.clock.index + 1, **changes))


def _kept(
    spec: EngineSpec, engine: Engine, state: State, packed: FloatArray, lane: FloatArray, wildness: float
) -> State:
    """Give the state with a packed sample and the healthy lane (n_numbers,) in its past, and the bank after it."""
    clock = state.clock
    past = state.past.followed(clock.index, packed, lane, clock.time, wildness)
    if clock.alarm < 0:
        return replace(state, past=past)
    use = counted(spec, state, packed)
    return replace(state, past=past, bank=advance_bank(spec, engine, state.bank, packed, use, clock.index))


def _lost(spec: EngineSpec, state: State) -> State:
    """Give the state with which the filter starts anew; where a lost one believed the plant it has not been."""
    fresh = init(spec)
    return replace(
        _after(state, begun=-1, running=0),
        inputs=replace(state.inputs, odd=fresh.inputs.odd),
        sensors=replace(state.sensors, **no_detector_sums(len(spec.outputs))),
        healthy=replace(state.healthy, travel=fresh.healthy.travel),
    )


def _silent(spec: EngineSpec, status: Status) -> Report:
    nothing = np.full(len(spec.outputs), np.nan)
    return Report(
        status=status, expected=nothing, variance=nothing, cusum=nothing, slow=np.full(len(spec.slow_errors), np.nan)
    )


def _gather(spec: EngineSpec, engine: Engine, state: State) -> tuple[State, Report]:
    """Collect the first samples, then solve the start and filter what was collected."""
    clock = state.clock
    count = clock.index - clock.begun + 1
    used = state.past.samples[-count:, spec.sample_fields["use"]] > 0
    again = bool(np.any(state.healthy.lane))  # the filter ran before: the start that the model gives is long past
    unknown = again or any(item.start_sd is None for item in spec.states)
    if count < START_SAMPLES or (unknown and count < START_PATIENCE and not np.all(used.any(axis=0))):
        return _after(state), _silent(spec, Status.STARTING)
    if count > START_SAMPLES and all(item.start_sd is None for item in spec.states):
        # Enough of them, with the last value of each sensor: over all of a long wait nominal parameters would not hold.
        last = [int(np.flatnonzero(column)[-1]) for column in used.T if np.any(column)]
        begun = clock.begun + min([count - START_SAMPLES, *last])
        state = replace(state, clock=replace(clock, begun=begun))
        count = clock.index - begun + 1
    count = min(count, len(state.past.rows))
    known = state.normal.lane if clock.accepted >= 0 else None
    found = begin(spec, engine, state, state.past.samples[-count:], known, again=again)
    state = found.state
    lane = healthy_lane(spec, found.mean, found.covariance, known)
    sensors = replace(state.sensors, shown=init(spec).sensors.shown)
    lanes, wildness = np.zeros((count, spec.n_numbers)), np.zeros(count)
    innovations = np.zeros((1, 2 * len(spec.outputs), 1))
    for k, sample in enumerate(found.samples):
        lane, innovations = engine.advance(lane, sample[None, :])
        lanes[k], wildness[k] = lane[:, 0], wildness_of(spec, sample, innovations[0, :, 0])
        sensors = seen(sensors, *_readings(spec, sample))
    state = replace(
        state,
        clock=replace(state.clock, running=1),
        sensors=sensors,
        healthy=replace(state.healthy, lane=lane),
        past=state.past.mended(found.samples, lanes, wildness),
    )
    report = _report(spec, state, Status.WARMING, found.samples[-1], innovations[0, :, 0])
    return _after(state), replace(report, wild=found.wild)


def _readings(spec: EngineSpec, packed: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Give the readings of a packed sample and which of them are there, (n_outputs,) each."""
    return packed[spec.sample_fields["y"]], packed[spec.sample_fields["use"]] > 0


def _remembered(state: State, lane: FloatArray) -> Healthy:
    """Give the healthy filter after a sample, with what is kept of it for long."""
    clock, before = state.clock, state.healthy
    travel, snapshots = before.travel, before.snapshots
    x, (low, high) = lane[: travel.shape[1], 0], travel
    if ((x < low) | (x > high)).any() and not before.astray.any():  # else the states are sought, and not known well
        travel = np.stack([np.minimum(low, x), np.maximum(high, x)])
    number, rest = divmod(clock.index - _learned_from(clock), SNAPSHOT_EVERY)
    if rest == 0 and number >= 0:
        snapshots = snapshots.copy()
        snapshots[number % len(snapshots)] = lane[:, 0]
    return replace(before, lane=lane, travel=travel, snapshots=snapshots)


def _learned_from(clock: Clock) -> int:
    """Give the sample from which healthy lanes are kept for long: a while after the start, or what was accepted."""
    return max(clock.begun, clock.accepted) + SNAPSHOT_EVERY


def _oldest(state: State) -> FloatArray | None:
    """Give the oldest healthy lane that is kept; None before the first, and where that is of after the alarm."""
    clock, snapshots = state.clock, state.healthy.snapshots
    first = _learned_from(clock)
    number = (clock.index - first) // SNAPSHOT_EVERY
    oldest = max(number - len(snapshots) + 1, 0)
    if number < 0 or 0 <= clock.alarm < first + oldest * SNAPSHOT_EVERY:
        return None
    lane: FloatArray = snapshots[oldest % len(snapshots)]
    return lane


def _report(spec: EngineSpec, state: State, status: Status, packed: FloatArray, innovations: FloatArray) -> Report:
    n_y = len(spec.outputs)
    present = packed[spec.sample_fields["use"]] > 0
    measured = np.where(present, packed[spec.sample_fields["y"]], 0.0)
    scale = packed[spec.sample_fields["scale"]]  # while a sensor is blanked, no part of what the model expects
    blank = np.where(scale >= spec.thresholds.blank_factor, scale - 1.0, 0.0) * spec.output_noise**2
    return Report(
        status=status,
        expected=measured - innovations[:n_y],
        variance=innovations[n_y:] - blank,
        cusum=statistic(spec, state.sensors),
        slow=slow_ratios(spec, state.healthy.lane),
    )


def _judge(
    spec: EngineSpec, engine: Engine, state: State, lane: FloatArray, packed: FloatArray, innovations: FloatArray
) -> tuple[State, Report]:
    """Update the statistics, raise the alarm, run the bank."""
    clock = state.clock
    warm = clock.index - clock.begun >= spec.thresholds.warm_up_samples
    sensors = accumulated(spec, state, packed, innovations) if warm else state.sensors
    state = replace(state, healthy=_remembered(state, lane), sensors=sensors)
    status = Status.DIAGNOSING if clock.alarm >= 0 else (Status.WATCHING if warm else Status.WARMING)
    report, bank = _report(spec, state, status, packed, innovations), state.bank
    if clock.alarm >= 0:
        since = clock.index - clock.alarm
        if since in RENEWALS and clock.alarm > clock.begun:  # of a filter that was lost, no lanes are kept
            trail, _ = _cut_trail(state, clock.alarm)
            last = since == RENEWALS[-1]
            bank = renew_bank(spec, engine, trail, bank, clock.index, state.inputs.peak, last=last)
    elif warm:
        detection, change = detect(spec, state, report.cusum)
        if detection is not None:
            clock = replace(clock, alarm=clock.index, detections=clock.detections + 1)
            bank = begin_bank(spec, engine, *_cut_trail(state, change), state.inputs.peak, clock.index)
            report = replace(report, status=Status.DIAGNOSING, detection=detection)
    state = replace(state, clock=clock, bank=bank)
    if clock.alarm >= 0 and (clock.index - clock.alarm) % DIAGNOSIS_EVERY == 0:
        report = replace(report, diagnosis=conclude(spec, state))
    return _after(state), report


def _cut_trail(state: State, change: int) -> tuple[Trail, int]:
    """Give the trail up to now, oldest first, and the place of the onset in it."""
    clock, past = state.clock, state.past
    oldest = max(clock.begun, clock.accepted, clock.index - len(past.rows) + 1)
    first, alarm = past.place(oldest), (clock.alarm if clock.alarm >= 0 else clock.index) - oldest
    return Trail(
        samples=past.samples[first:],
        lanes=past.lanes[first:],
        old=_oldest(state),
        alarm=alarm,
        bursts=bursts(past.wildness[first:][: alarm + 1]),
    ), change - oldest


def conclude(spec: EngineSpec, state: State) -> Diagnosis:
    """Give the diagnosis of now, after a detection; without candidates where nothing is a suspect."""
    if not spec.n_hypotheses:
        return Diagnosis(time=state.clock.time, candidates=())
    bank = _not_rejected(spec, state.bank)
    steady = _steady(spec, bank)
    followed = float(np.max(scores(spec, bank)) - np.max(scores(spec, steady))) > FOLLOWED
    unexplained = _unexplained(spec, state, leading_lane(spec, steady), followed=followed)
    since = state.clock.index - state.clock.alarm
    fresh = any(0 <= since - begun <= RENEWALS[0] for begun in (0, *RENEWALS))
    bounded = (
        unexplained is None and state.clock.alarm >= 0 and not fresh
    )  # sums of what began just now tell nothing yet
    return replace(
        rank(
            spec,
            state.clock.time,
            bank,
            Absorbed(rates=state.normal.rates, noise=state.normal.noise * state.sensors.nis),
        ),
        unexplained=unexplained,
        untested=untested(spec, bank, state.clock.index, bounded=bounded),
    )


def _steady(spec: EngineSpec, bank: Bank) -> Bank:
    """Give the bank without drifts whose rate may change: these follow nearly anything, so their fit says little."""
    slots = bank.slots.copy()
    slots[-1, [lane.span > 0.0 for lane in plan_slots(spec).lanes]] = -np.inf
    return replace(bank, slots=slots)


def _not_rejected(spec: EngineSpec, bank: Bank) -> Bank:
    """Give the bank without the hypotheses that were rejected."""
    if not np.any(bank.rejected):
        return bank
    out = bank.rejected[table_of(spec, bank).hypothesis] > 0
    steps, slots, n = bank.steps.copy(), bank.slots.copy(), bank.steps.shape[1]
    steps[-1, out[:n]] = slots[-1, out[n:]] = -np.inf
    return replace(bank, steps=steps, slots=slots)


def _unexplained(spec: EngineSpec, state: State, lane: int, *, followed: bool) -> Unexplained | None:
    """Tell where the best lane does not fit, if the detector would raise an alarm on it.

    followed : whether a drift whose rate may change fits better by far; then this lane does not fit anyhow
    """
    sums, clock = state.bank.misfit.sums[:, :, lane], state.clock
    side, signal = np.unravel_index(int(np.argmax(sums)), sums.shape)
    if sums[side, signal] <= spec.thresholds.cusum_limit and not followed:
        return None
    past, length = state.past, clock.index - int(state.bank.misfit.since[side, signal, lane])
    return Unexplained(
        signal=spec.outputs[signal].name,
        sd=float(sums[side, signal] / max(length, 1) + spec.thresholds.cusum_drift),
        since=float(past.times[past.place(min(clock.index - min(length, len(past.rows) - 1), past.last))]),
        until=clock.time,
    )


def finish(spec: EngineSpec, state: State) -> Diagnosis | None:
    """Give the last diagnosis, if a fault was detected."""
    return conclude(spec, state) if state.clock.alarm >= 0 else None
