"""The alarm: sums of the innovations of each sensor (`cusum`), and slow errors beyond their declared size."""

from dataclasses import replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Detection
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.cusum import Sums, added, clip, height_of, scales
from faultbond.runtime.packing import trusted
from faultbond.runtime.state import SensorMemory, State
from faultbond.runtime.unseen import unknown_inputs

NIS_TRUST, NIS_MEMORY = 1000, 10_000  # samples for which the declaration counts; over which squares are a mean
NIS_RANGE = (0.25, 4.0)


def accumulated(spec: EngineSpec, state: State, packed: FloatArray, innovations: FloatArray) -> SensorMemory:
    """CUSUMs of the normalised innovations and of their scatter; missing and blanked values leave them as they are.

    So do all while an input is unknown for several samples: it may stand elsewhere, and then errs to one side.
    """
    settings, place, n_y = spec.thresholds, spec.sample_fields, len(spec.outputs)
    score = innovations[:n_y] / np.sqrt(innovations[n_y:])
    use, blanked = counted(spec, state, packed), (packed[place["use"]] > 0) & ~trusted(spec, packed)
    sensors = state.sensors
    sums, index = sums_of(sensors), float(state.clock.index)
    after = added(settings, sums, score, use, blanked)
    scatter, before = after.scatter, after.before
    if state.healthy.astray.any():  # after a gap
        scatter, before = sums.scatter, np.full_like(before, np.nan)
    asleep = float(state.clock.begun + settings.warm_up_samples - 1)  # the last sample before the sums began
    learning = state.clock.alarm < 0
    return replace(
        sensors,
        cusum=after.slow,
        cusum_start=np.where(after.slow <= 0.0, index, np.maximum(sensors.cusum_start, asleep)),
        fast=after.fast,
        scatter=scatter,
        scatter_start=np.where(scatter <= 0.0, index, sensors.scatter_start),
        before=before,
        nis=usual_squares(state, np.where(use, clip(settings, score), np.nan)) if learning else sensors.nis,
    )


def counted(spec: EngineSpec, state: State, packed: FloatArray) -> BoolArray:
    """Tell of which sensors the sums take a sample, (n_outputs,)."""
    return trusted(spec, packed) & ~unknown_inputs(state.inputs).any()


def sums_of(sensors: SensorMemory) -> Sums:
    """Give the sums of the detector."""
    return Sums(slow=sensors.cusum, fast=sensors.fast, scatter=sensors.scatter, before=sensors.before)


def usual_squares(state: State, score: FloatArray) -> FloatArray:
    """Give the usual squares of the normalised innovations after one more, (n_outputs,); nan: not to be counted.

    Declared noises and slow errors are bounds more often than facts. Likelihoods reckon with the squares that are seen
    while the plant is healthy: else a hypothesis would win by the size of what it foretells, sample by sample.
    """
    memory = min(NIS_TRUST + state.clock.index - state.clock.begun, NIS_MEMORY)
    nis = state.sensors.nis
    after = nis + (score * score - nis) / memory
    return np.asarray(np.clip(np.where(np.isfinite(score), after, nis), *NIS_RANGE))


def detect(spec: EngineSpec, state: State, peak: FloatArray) -> tuple[Detection | None, int]:
    """Give the detection, if a statistic crossed, and the sample of the estimated onset; `peak`: see `statistic`."""
    settings, clock = spec.thresholds, state.clock
    crossed = peak > settings.cusum_limit
    if not crossed.any() and not _slow_error_alarms(spec, state):
        return None, 0
    leading = int(np.argmax(peak))
    oldest = max(clock.begun, clock.accepted + 1, clock.index - settings.history_samples)
    change = int(np.clip(_start(spec, state.sensors, leading), oldest, clock.index))
    signals = [output.name for k, output in enumerate(spec.outputs) if crossed[k]] or [spec.outputs[leading].name]
    return Detection(
        time=clock.time,
        sample=clock.index,
        change_time=float(state.past.times[state.past.place(change)]),
        signals=tuple(signals),
    ), change


def _start(spec: EngineSpec, sensors: SensorMemory, leading: int) -> float:
    """Give the sample after which the largest sum of a sensor began to grow."""
    side = int(np.argmax(sensors.cusum[:, leading]))
    scattered = scales(spec.thresholds)[1] * np.min(sensors.scatter[:, leading]) > sensors.cusum[side, leading]
    return float(np.min(sensors.scatter_start[:, leading]) if scattered else sensors.cusum_start[side, leading])


def statistic(spec: EngineSpec, sensors: SensorMemory) -> FloatArray:
    """Give the largest sum of each sensor, (n_outputs,); how far others are on their way counts."""
    return height_of(spec.thresholds, sums_of(sensors))


def _slow_error_alarms(spec: EngineSpec, state: State) -> bool:
    """Whether a slow error has left its declared size.

    It counts once it has been watched for as long as its memory: until then it stands for parameters that the filter
    has not learned yet.
    """
    clock = state.clock
    watched = (clock.index - max(clock.begun, clock.accepted)) * (spec.sample_time or clock.pause)
    beyond = np.abs(slow_ratios(spec, state.healthy.lane)) > spec.thresholds.slow_error_limit
    return any(beyond[k] and error.alarms and watched >= error.memory for k, error in enumerate(spec.slow_errors))


def slow_ratios(spec: EngineSpec, lane: FloatArray) -> FloatArray:
    """Give the slow errors of a lane (n_numbers, 1) in units of their declared sd, (n_slow_errors,)."""
    return np.asarray(lane[spec.slow_slice, 0] / spec.slow_sizes)
