"""The on-line part: `init` and `step`, pure functions on a state of numbers. No clock, file or socket.

Each sample passes the healthy filter; a CUSUM per sensor (Page 1954) and the slow errors decide on an alarm; from the
alarm on the bank runs beside it. Thesis 4.5.2 calls this part the universal algorithms.
"""

from dataclasses import dataclass, fields, replace
from enum import Enum
from typing import Any

import numpy as np

from faultbond.runtime.bank import Bank, advance_bank, begin_bank, no_bank, renew_bank
from faultbond.runtime.history import Detection, Diagnosis, Unexplained
from faultbond.runtime.misfit import Misfit
from faultbond.runtime.ranking import leading_lane, rank
from faultbond.runtime.start import healthy_lane, solve_start
from faultbond.runtime.stepped import Trail
from faultbond.spec import Engine, EngineSpec
from faultbond.types import BoolArray, FloatArray

START_SAMPLES = 20  # gathered before an unknown start is solved
START_PATIENCE = 300  # samples for which a sensor without any value holds up the start
RENEWALS = (30, 100, 200)  # samples after the alarm at which the bank begins again from what it has found
DIAGNOSIS_EVERY = 20  # samples between diagnoses
CHANGE_MEMORY = 16.0  # seconds for which a change of an input disturbs the slow errors that follow it


Changes = dict[str, Any]  # fields of the state, by name
_COUNTS = ("index", "begun", "running", "alarm", "detections", "accepted")


class Status(Enum):
    """What the monitor is doing; the value is the message."""

    WAITING = "waiting for a first value of every input"
    STARTING = "gathering samples to solve the start"
    WARMING = "learning the parameters; alarms are off"
    WATCHING = "watching"
    DIAGNOSING = "a fault was detected; the bank is running"
    LOST = "the healthy filter lost the plant; it starts anew"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """One grid point: `time` and `dt` since the one before (s), `u` (n_inputs,), `y` (n_outputs,); SI; nan: missing."""

    time: float
    dt: float
    u: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """What one sample brought. Arrays are per output; `slow` is per slow error, in declared sd."""

    status: Status
    expected: FloatArray
    variance: FloatArray
    cusum: FloatArray
    slow: FloatArray
    detection: Detection | None = None
    diagnosis: Diagnosis | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """Numbers only, of fixed size; -1: not yet.

    What was accepted as the new normal: a sensor's reading is `reading_gain` times the true one plus `reading_offset`,
    with `reading_noise` times the declared variance (inf: it is no longer used); `input_offset` is added to an input
    (SI), and parameters move on at `rates` (factors per second).
    """

    index: int  # samples seen
    begun: int  # first sample with a value of every input
    running: int  # 1 once the filter runs
    alarm: int  # sample of the alarm
    detections: int  # alarms so far
    accepted: int  # sample at which a diagnosis was accepted last
    time: float
    held: FloatArray  # last input values
    peak: FloatArray  # largest size of each input
    since_step: FloatArray  # s since the last step of each input
    change: FloatArray  # change of each input that is still felt
    lane: FloatArray  # healthy filter
    cusum: FloatArray  # (2, n_outputs): up, down
    cusum_start: FloatArray  # (2, n_outputs): sample at which the run began
    trail_samples: FloatArray
    trail_lanes: FloatArray
    trail_times: FloatArray
    steps: FloatArray  # lanes of the bank
    slots: FloatArray
    misfit: FloatArray
    misfit_since: FloatArray
    rejected: FloatArray  # (n_hypotheses,): 1 where a person has ruled it out
    reading_gain: FloatArray
    reading_offset: FloatArray
    reading_noise: FloatArray
    input_offset: FloatArray
    rates: FloatArray

    @property
    def bank(self) -> Bank:
        """The bank."""
        return Bank(steps=self.steps, slots=self.slots, misfit=Misfit(sums=self.misfit, since=self.misfit_since))

    def save(self) -> dict[str, FloatArray]:
        """Give all numbers by name, for `numpy.savez`."""
        return {field.name: np.asarray(getattr(self, field.name), dtype=float) for field in fields(self)}

    @staticmethod
    def restore(saved: dict[str, FloatArray]) -> "State":
        """Give the state that `save` wrote."""
        numbers: dict[str, Any] = {name: int(saved[name]) for name in _COUNTS}
        numbers["time"] = float(saved["time"])
        return State(**({name: np.asarray(saved[name]) for name in saved} | numbers))


def init(spec: EngineSpec, t0: float = 0.0) -> State:
    """Give the state before the first sample, at time `t0` (s)."""
    n_u, n_y, depth = len(spec.inputs), len(spec.outputs), _depth(spec)
    return State(
        index=0,
        begun=-1,
        running=0,
        alarm=-1,
        detections=0,
        accepted=-1,
        time=t0,
        held=np.full(n_u, np.nan),
        peak=np.zeros(n_u),
        since_step=np.full(n_u, np.inf),
        change=np.zeros(n_u),
        lane=np.zeros((spec.n_numbers, 1)),
        cusum=np.zeros((2, n_y)),
        cusum_start=np.zeros((2, n_y)),
        trail_samples=np.zeros((depth, spec.n_sample)),
        trail_lanes=np.zeros((depth, spec.n_numbers)),
        trail_times=np.zeros(depth),
        rejected=np.zeros(spec.n_hypotheses),
        reading_gain=np.ones(n_y),
        reading_offset=np.zeros(n_y),
        reading_noise=np.ones(n_y),
        input_offset=np.zeros(n_u),
        rates=np.zeros(len(spec.parameters)),
        **bank_fields(no_bank(spec)),
    )


def bank_fields(bank: Bank) -> Changes:
    """Give a bank as fields of the state."""
    return {
        "steps": bank.steps,
        "slots": bank.slots,
        "misfit": bank.misfit.sums,
        "misfit_since": bank.misfit.since,
    }


def _depth(spec: EngineSpec) -> int:
    return spec.thresholds.history_samples + 2


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
    sample = _corrected(state, sample)
    u = np.where(np.isfinite(sample.u), sample.u, state.held)
    if not np.all(np.isfinite(u)):
        return replace(state, index=state.index + 1, time=sample.time, held=u), _silent(spec, Status.WAITING)
    packed, changes = _pack_sample(spec, state, sample, u)
    slot = state.index % len(state.trail_times)
    samples, times = state.trail_samples.copy(), state.trail_times.copy()
    samples[slot], times[slot] = packed, sample.time
    state = replace(state, trail_samples=samples, trail_times=times, time=sample.time, **changes)
    if not state.running:
        return _gather(spec, engine, state)
    state = _drifted(spec, state, float(packed[0]))
    lane, innovations = engine.advance(state.lane, packed[None, :])
    if not np.all(np.isfinite(lane)):
        lost = replace(state, index=state.index + 1, begun=-1, running=0, cusum=np.zeros_like(state.cusum))
        return lost, _silent(spec, Status.LOST)
    return _judge(spec, engine, state, lane, packed, innovations[0, :, 0])


def _corrected(state: State, sample: Sample) -> Sample:
    """Give a sample without the faults of instruments that were accepted; a sensor that is out of use is missing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        y = (sample.y - state.reading_offset) / state.reading_gain
    return replace(sample, u=sample.u + state.input_offset, y=np.where(np.isfinite(state.reading_noise), y, np.nan))


def _drifted(spec: EngineSpec, state: State, dt: float) -> State:
    """Let parameters move on whose drift was accepted."""
    if not np.any(state.rates):
        return state
    moved = {}
    for name in ("lane", "steps", "slots"):
        moved[name] = getattr(state, name).copy()
        moved[name][spec.parameter_slice] += state.rates[:, None] * dt
    return replace(state, **moved)


def _silent(spec: EngineSpec, status: Status) -> Report:
    nothing = np.full(len(spec.outputs), np.nan)
    return Report(
        status=status, expected=nothing, variance=nothing, cusum=nothing, slow=np.full(len(spec.slow_errors), np.nan)
    )


def _pack_sample(spec: EngineSpec, state: State, sample: Sample, u: FloatArray) -> tuple[FloatArray, Changes]:
    """Pack a sample for the engine: hold inputs, blank after steps, kick slow errors, switch off missing values.

    Gives the packed sample, and what changes in the state.
    """
    first = not np.all(np.isfinite(state.held))
    before = u if first else state.held
    dt = 0.0 if first else sample.dt
    moved = u - before
    peak = np.maximum(state.peak, np.abs(u))
    limits = np.array([max(item.step, item.step_part * peak[k]) for k, item in enumerate(spec.inputs)])
    stepped = (np.abs(moved) > limits) & ~first
    since = np.where(stepped, 0.0, state.since_step + dt)
    change = state.change * np.exp(-dt / CHANGE_MEMORY) + moved
    released = 1.0 - np.exp(-2.0 * dt / CHANGE_MEMORY)  # adds up to 1 over the memory of a step
    present = np.isfinite(sample.y)
    packed = np.zeros(spec.n_sample)
    place = spec.sample_fields
    packed[place["dt"]] = dt
    packed[place["u_before"]] = before
    packed[place["u"]] = u
    packed[place["y"]] = np.where(present, sample.y, 0.0)
    packed[place["use"]] = present
    packed[place["scale"]] = np.where(
        _blanked(spec, since), spec.thresholds.blank_factor, np.where(present, state.reading_noise, 1.0)
    )
    packed[place["kick"]] = [
        released * sum((each * change[k]) ** 2 for k, each in error.after) for error in spec.slow_errors
    ]
    begun = state.index if state.begun < 0 else state.begun
    if state.index - begun >= spec.thresholds.warm_up_samples:
        packed[place["bound"]] = spec.thresholds.learning_bound
    return packed, {"held": u, "peak": peak, "since_step": since, "change": change, "begun": begun}


def _blanked(spec: EngineSpec, since_step: FloatArray) -> BoolArray:
    """Whether a step of an input that reaches a sensor directly is still settling, per output."""
    settling = np.array([item.settling for item in spec.inputs])
    moving = since_step < settling
    return np.array([bool(np.any(moving[list(output.direct_inputs)])) for output in spec.outputs], dtype=bool)


def _gather(spec: EngineSpec, engine: Engine, state: State) -> tuple[State, Report]:
    """Collect the first samples, then solve the start and filter what was collected."""
    count = state.index - state.begun + 1
    needed = START_SAMPLES if any(item.start_sd is None for item in spec.states) else 1
    if count < needed or (needed > 1 and count < START_PATIENCE and not _all_seen(spec, state)):
        return replace(state, index=state.index + 1), _silent(spec, Status.STARTING)
    chosen = np.arange(state.begun, state.index + 1) % len(state.trail_times)
    samples = state.trail_samples[chosen]
    mean, covariance = solve_start(spec, engine, samples)
    lane = healthy_lane(spec, mean, covariance)
    lanes = state.trail_lanes.copy()
    innovations = np.zeros((1, 2 * len(spec.outputs), 1))
    for slot, sample in zip(chosen, samples, strict=True):
        lane, innovations = engine.advance(lane, sample[None, :])
        lanes[slot] = lane[:, 0]
    state = replace(state, lane=lane, trail_lanes=lanes, running=1)
    report = _report(spec, state, Status.WARMING, samples[-1], innovations[0, :, 0])
    return replace(state, index=state.index + 1), report


def _all_seen(spec: EngineSpec, state: State) -> bool:
    """Whether every output has had a value among the samples gathered."""
    chosen = np.arange(state.begun, state.index + 1) % len(state.trail_times)
    return bool(np.all(np.any(state.trail_samples[chosen][:, spec.sample_fields["use"]] > 0, axis=0)))


def _remembered(state: State, lane: FloatArray) -> Changes:
    lanes = state.trail_lanes.copy()
    lanes[state.index % len(lanes)] = lane[:, 0]
    return {"lane": lane, "trail_lanes": lanes}


def _report(
    spec: EngineSpec,
    state: State,
    status: Status,
    packed: FloatArray,
    innovations: FloatArray,
    *,
    detection: Detection | None = None,
    diagnosis: Diagnosis | None = None,
) -> Report:
    n_y = len(spec.outputs)
    present = packed[spec.sample_fields["use"]] > 0
    measured = np.where(present, packed[spec.sample_fields["y"]], 0.0)
    blank = (packed[spec.sample_fields["scale"]] - 1.0) * spec.output_noise**2  # no part of what the model expects
    return Report(
        status=status,
        expected=measured - innovations[:n_y],
        variance=innovations[n_y:] - blank,
        cusum=state.cusum.max(axis=0),
        slow=_slow_ratios(spec, state),
        detection=detection,
        diagnosis=diagnosis,
    )


def _slow_ratios(spec: EngineSpec, state: State) -> FloatArray:
    return np.asarray(state.lane[spec.slow_slice, 0] / spec.slow_sizes)


def _judge(
    spec: EngineSpec, engine: Engine, state: State, lane: FloatArray, packed: FloatArray, innovations: FloatArray
) -> tuple[State, Report]:
    """Update the statistics, raise the alarm, run the bank."""
    warm = state.index - state.begun >= spec.thresholds.warm_up_samples
    sums = _accumulated(spec, state, packed, innovations) if warm else {}
    state = replace(state, **_remembered(state, lane), **sums)
    detection, alarm, bank = None, state.alarm, state.bank
    if alarm >= 0:
        bank = advance_bank(spec, engine, bank, packed, state.index)
        if state.index - alarm in RENEWALS:
            bank = renew_bank(spec, engine, _cut_trail(state, alarm)[0], bank, state.index)
    elif warm:
        detection, change = _detect(spec, state)
        if detection is not None:
            alarm, trail = state.index, _cut_trail(state, change)
            bank = begin_bank(spec, engine, *trail, state.peak, state.index)
    due = alarm >= 0 and (state.index - alarm) % DIAGNOSIS_EVERY == 0
    report = _report(
        spec,
        state,
        Status.DIAGNOSING if alarm >= 0 else (Status.WATCHING if warm else Status.WARMING),
        packed,
        innovations,
        detection=detection,
        diagnosis=conclude(spec, replace(state, **bank_fields(bank))) if due else None,
    )
    count = state.detections + (detection is not None)
    return replace(state, alarm=alarm, detections=count, index=state.index + 1, **bank_fields(bank)), report


def _accumulated(spec: EngineSpec, state: State, packed: FloatArray, innovations: FloatArray) -> Changes:
    """Two-sided CUSUM of the normalised innovations; missing and blanked values leave it as it is."""
    settings, place, n_y = spec.thresholds, spec.sample_fields, len(spec.outputs)
    score = np.clip(innovations[:n_y] / np.sqrt(innovations[n_y:]), -settings.cusum_clip, settings.cusum_clip)
    use = (packed[place["use"]] > 0) & (packed[place["scale"]] < settings.blank_factor)
    grown = np.maximum(state.cusum + np.array([score, -score]) - settings.cusum_drift, 0.0)
    cusum = np.where(use, grown, state.cusum)
    asleep = float(state.begun + settings.warm_up_samples - 1)  # the last sample before the sums began
    start = np.where(cusum <= 0.0, float(state.index), np.maximum(state.cusum_start, asleep))
    return {"cusum": cusum, "cusum_start": start}


def _detect(spec: EngineSpec, state: State) -> tuple[Detection | None, int]:
    """Give the detection, if a statistic crossed, and the sample of the estimated onset."""
    settings = spec.thresholds
    peak = state.cusum.max(axis=0)
    crossed = peak > settings.cusum_limit
    ratios = np.abs(_slow_ratios(spec, state))
    slow = any(error.alarms and ratios[k] > settings.slow_error_limit for k, error in enumerate(spec.slow_errors))
    if not crossed.any() and not slow:
        return None, 0
    leading = int(np.argmax(peak))
    side = int(np.argmax(state.cusum[:, leading]))
    oldest = max(state.begun, state.accepted + 1, state.index - settings.history_samples)
    change = int(np.clip(state.cusum_start[side, leading], oldest, state.index))
    signals = [output.name for k, output in enumerate(spec.outputs) if crossed[k]] or [spec.outputs[leading].name]
    return Detection(
        time=state.time,
        sample=state.index,
        change_time=float(state.trail_times[change % len(state.trail_times)]),
        signals=tuple(signals),
    ), change


def _cut_trail(state: State, change: int) -> tuple[Trail, int]:
    """Give the trail up to now, oldest first, and the place of the onset in it."""
    depth = len(state.trail_times)
    oldest = max(state.begun, state.accepted, state.index - depth + 1)
    chosen = np.arange(oldest, state.index + 1) % depth
    return Trail(samples=state.trail_samples[chosen], lanes=state.trail_lanes[chosen]), change - oldest


def conclude(spec: EngineSpec, state: State) -> Diagnosis:
    """Give the diagnosis of now, after a detection."""
    lane = leading_lane(spec, state.bank)
    return replace(rank(spec, state.time, state.bank), unexplained=_unexplained(spec, state, lane))


def _unexplained(spec: EngineSpec, state: State, lane: int) -> Unexplained | None:
    """Tell where the best lane does not fit, if the detector would raise an alarm on it."""
    sums = state.misfit[:, :, lane]
    side, signal = np.unravel_index(int(np.argmax(sums)), sums.shape)
    if sums[side, signal] <= spec.thresholds.cusum_limit:
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
