"""The alarm: two-sided CUSUMs of the innovations of each sensor, and slow errors that leave their declared size.

A sum with a small drift finds small faults; one with a large drift and a low limit finds large ones in half the time.
The latter alarms only where a time between false alarms is promised: a few wild values in a row, which real sensors
have, are enough for it.

Source: Page, Biometrika 41 (1954) 100.
"""

import numpy as np

from faultbond.runtime.history import Detection
from faultbond.runtime.state import Changes, State
from faultbond.spec import EngineSpec
from faultbond.types import FloatArray


def accumulated(spec: EngineSpec, state: State, packed: FloatArray, innovations: FloatArray) -> Changes:
    """Two-sided CUSUM of the normalised innovations; missing and blanked values leave it as it is."""
    settings, place, n_y = spec.thresholds, spec.sample_fields, len(spec.outputs)
    score = np.clip(innovations[:n_y] / np.sqrt(innovations[n_y:]), -settings.cusum_clip, settings.cusum_clip)
    use = (packed[place["use"]] > 0) & (packed[place["scale"]] < settings.blank_factor)
    sides = np.array([score, -score])
    cusum = np.where(use, np.maximum(state.cusum + sides - settings.cusum_drift, 0.0), state.cusum)
    fast = np.where(use, np.maximum(state.fast + sides - settings.fast_drift, 0.0), state.fast)
    asleep = float(state.begun + settings.warm_up_samples - 1)  # the last sample before the sums began
    start = np.where(cusum <= 0.0, float(state.index), np.maximum(state.cusum_start, asleep))
    return {"cusum": cusum, "cusum_start": start, "fast": fast}


def detect(spec: EngineSpec, state: State) -> tuple[Detection | None, int]:
    """Give the detection, if a statistic crossed, and the sample of the estimated onset."""
    settings = spec.thresholds
    peak = statistic(spec, state)
    crossed = peak > settings.cusum_limit
    if not crossed.any() and not _slow_error_alarms(spec, state):
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


def statistic(spec: EngineSpec, state: State) -> FloatArray:
    """Give the largest sum of each sensor, (n_outputs,); a fast one counts as far as it is on the way to its limit."""
    settings = spec.thresholds
    scale = settings.cusum_limit / settings.fast_limit if np.isfinite(settings.cusum_limit) else 1.0
    return np.asarray(np.maximum(state.cusum.max(axis=0), scale * state.fast.max(axis=0)))


def _slow_error_alarms(spec: EngineSpec, state: State) -> bool:
    """Whether a slow error has left its declared size.

    It counts once it has been watched for as long as its memory: until then it stands for parameters that the filter
    has not learned yet.
    """
    watched = (state.index - max(state.begun, state.accepted)) * (spec.sample_time or 1.0)
    beyond = np.abs(slow_ratios(spec, state)) > spec.thresholds.slow_error_limit
    return any(beyond[k] and error.alarms and watched >= error.memory for k, error in enumerate(spec.slow_errors))


def slow_ratios(spec: EngineSpec, state: State) -> FloatArray:
    """Give the slow errors in units of their declared sd."""
    return np.asarray(state.lane[spec.slow_slice, 0] / spec.slow_sizes)
