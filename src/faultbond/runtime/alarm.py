"""The alarm: CUSUMs of the innovations of each sensor and of their scatter, and slow errors beyond their declared size.

A sum with a small drift finds small faults; one with a large drift and a low limit finds large ones in half the time.
The latter alarms only where a time between false alarms is promised: a few wild values in a row, which real sensors
have, are enough for it. They also scatter in bursts, of some hundred samples; so the sum of the scatter has patience.

Source: Page, Biometrika 41 (1954) 100.
"""

from math import isfinite, log, sqrt

import numpy as np

from faultbond.contract.findings import Detection
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.state import Changes, State
from faultbond.runtime.unseen import unknown_inputs
from faultbond.types import FloatArray

NIS_TRUST, NIS_MEMORY = 1000, 10_000  # samples for which the declaration counts; over which squares are a mean
NIS_RANGE = (0.25, 4.0)
SQRT2 = sqrt(2.0)  # standard deviation of a difference of innovations as declared


def accumulated(spec: EngineSpec, state: State, packed: FloatArray, innovations: FloatArray) -> Changes:
    """CUSUMs of the normalised innovations and of their scatter; missing and blanked values leave them as they are.

    So do all while an input is unknown for several samples: it may stand elsewhere, and then errs to one side.
    """
    settings, place, n_y = spec.thresholds, spec.sample_fields, len(spec.outputs)
    whole = innovations[:n_y] / np.sqrt(innovations[n_y:])
    score = np.minimum(np.maximum(whole, -settings.cusum_clip), settings.cusum_clip)
    present, settled = packed[place["use"]] > 0, packed[place["scale"]] < settings.blank_factor
    use = present & settled
    if unknown_inputs(state).any():
        use = np.zeros_like(use)
    sides = np.array([score, -score])
    cusum = np.maximum(state.cusum + (sides - settings.cusum_drift), 0.0)
    fast = np.maximum(state.fast + (sides - settings.fast_drift), 0.0)
    scatter = _scattered(spec, state, whole)
    if np.count_nonzero(use) < n_y:
        cusum, fast = np.where(use, cusum, state.cusum), np.where(use, fast, state.fast)
        scatter = np.where(use, scatter, state.scatter)
        scatter[2, :, present & ~settled] = np.nan
    if state.astray.any():  # after a gap
        scatter = state.scatter.copy()
        scatter[2] = np.nan
    asleep = float(state.begun + settings.warm_up_samples - 1)  # the last sample before the sums began
    start = np.where(cusum <= 0.0, float(state.index), np.maximum(state.cusum_start, asleep))
    nis = state.nis if state.alarm >= 0 else usual_squares(state, np.where(use, score, np.nan))
    return {"cusum": cusum, "cusum_start": start, "fast": fast, "scatter": scatter, "nis": nis}


def usual_squares(state: State, score: FloatArray) -> FloatArray:
    """Give the usual squares of the normalised innovations after one more, (n_outputs,); nan: not to be counted.

    Declared noises and slow errors are bounds more often than facts. Likelihoods reckon with the squares that are seen
    while the plant is healthy: else a hypothesis would win by the size of what it foretells, sample by sample.
    """
    memory = min(NIS_TRUST + state.index - state.begun, NIS_MEMORY)
    after = state.nis + (score * score - state.nis) / memory
    return np.asarray(np.clip(np.where(np.isfinite(score), after, state.nis), *NIS_RANGE))


def _scattered(spec: EngineSpec, state: State, score: FloatArray) -> FloatArray:
    """CUSUMs of the log-likelihood ratio of `scatter_ratio` times the noise and that declared.

    They take differences to each of the last innovations, since a bias, or what the model gets wrong slowly, is no
    noise; nor is an oscillation, which returns to where it was after some samples.
    """
    settings, changed = spec.thresholds, state.scatter.copy()
    sums, start, before = changed
    apart = np.minimum(np.abs(score - before), SQRT2 * settings.cusum_clip)
    slope, cost = 0.25 * (1.0 - settings.scatter_ratio**-2), log(settings.scatter_ratio)
    gained = slope * apart * apart - cost
    np.copyto(sums, np.maximum(sums + gained, 0.0), where=np.isfinite(apart))  # nan: nothing to compare with
    np.copyto(start, state.index, where=sums <= 0.0)
    before[1:] = before[:-1].copy()
    before[0] = score
    return changed


def detect(spec: EngineSpec, state: State, peak: FloatArray) -> tuple[Detection | None, int]:
    """Give the detection, if a statistic crossed, and the sample of the estimated onset; `peak`: see `statistic`."""
    settings = spec.thresholds
    crossed = peak > settings.cusum_limit
    if not crossed.any() and not _slow_error_alarms(spec, state):
        return None, 0
    leading = int(np.argmax(peak))
    oldest = max(state.begun, state.accepted + 1, state.index - settings.history_samples)
    change = int(np.clip(_start(spec, state, leading), oldest, state.index))
    signals = [output.name for k, output in enumerate(spec.outputs) if crossed[k]] or [spec.outputs[leading].name]
    return Detection(
        time=state.time,
        sample=state.index,
        change_time=float(state.trail_times[change % len(state.trail_times)]),
        signals=tuple(signals),
    ), change


def _start(spec: EngineSpec, state: State, leading: int) -> float:
    """Give the sample after which the largest sum of a sensor began to grow."""
    side = int(np.argmax(state.cusum[:, leading]))
    sums, starts, _ = state.scatter[..., leading]
    scattered = _scales(spec)[1] * np.min(sums) > state.cusum[side, leading]
    return float(np.min(starts) if scattered else state.cusum_start[side, leading])


def statistic(spec: EngineSpec, state: State) -> FloatArray:
    """Give the largest sum of each sensor, (n_outputs,); how far others are on their way counts."""
    fast, scatter = _scales(spec)
    largest = np.maximum(np.maximum(*state.cusum), fast * np.maximum(*state.fast))
    return np.asarray(np.maximum(largest, scatter * state.scatter[0].min(axis=0)))


def _scales(spec: EngineSpec) -> tuple[float, float]:
    """Give the limit of the CUSUM in those of the fast sum and of that of the scatter."""
    settings = spec.thresholds
    limit = settings.cusum_limit
    return (limit / settings.fast_limit, limit / settings.scatter_limit) if isfinite(limit) else (1.0, 1.0)


def _slow_error_alarms(spec: EngineSpec, state: State) -> bool:
    """Whether a slow error has left its declared size.

    It counts once it has been watched for as long as its memory: until then it stands for parameters that the filter
    has not learned yet.
    """
    watched = (state.index - max(state.begun, state.accepted)) * (spec.sample_time or state.pause)
    beyond = np.abs(slow_ratios(spec, state)) > spec.thresholds.slow_error_limit
    return any(beyond[k] and error.alarms and watched >= error.memory for k, error in enumerate(spec.slow_errors))


def slow_ratios(spec: EngineSpec, state: State) -> FloatArray:
    """Give the slow errors in units of their declared sd."""
    return np.asarray(state.lane[spec.slow_slice, 0] / spec.slow_sizes)
