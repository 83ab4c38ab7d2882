"""The monitor's healthy filter along a recording, all samples in one call, with sizes of noise and accuracies varied.

What the detector sums up is that of `runtime.monitor`, number for number; accuracies, noise and slow errors enter as
data, so that none of the variants needs another engine.
"""

from dataclasses import dataclass, replace

import numpy as np

from faultbond.contract.spec import Engine, EngineSpec
from faultbond.fit.likelihood import Layout
from faultbond.fit.samples import Record
from faultbond.runtime.monitor import START_PATIENCE, START_SAMPLES
from faultbond.runtime.start import healthy_lane, solve_start
from faultbond.types import BoolArray, FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Variant:
    """What is declared, in what the model declares: accuracies, noise of sensors, sizes of slow errors."""

    accuracy: float = 1.0
    noise: float = 1.0
    slow: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Watch:
    """What the detector saw; nan where it looked at nothing.

    scores (N, n_outputs): innovations in their standard deviations, from the end of the warm-up; cusum (2, N,
    n_outputs): up, down; slow (N, n_slow): slow errors in their declared sizes.
    """

    scores: FloatArray
    cusum: FloatArray
    slow: FloatArray

    @property
    def peak(self) -> float:
        """The largest CUSUM."""
        return float(np.max(self.cusum, initial=0.0))


def watch(spec: EngineSpec, engine: Engine, record: Record, layout: Layout, variant: Variant | None = None) -> Watch:
    """Give what the detector sees of a recording, alarms or not.

    Parameters
    ----------
    spec, engine : the model as the monitor runs it
    record, layout : the recording
    variant : what is declared otherwise
    """
    variant = variant or Variant()
    samples = _packed(spec, record, layout, variant)
    varied = replace(
        spec,
        parameters=tuple(replace(item, accuracy=variant.accuracy * item.accuracy) for item in spec.parameters),
        slow_errors=tuple(replace(item, sd=variant.slow * item.sd) for item in spec.slow_errors),
    )
    mean, covariance = solve_start(varied, engine, samples[: _start_length(spec, record)])
    lane = healthy_lane(varied, mean, covariance)
    n_y = len(spec.outputs)
    slow, innovations = _advanced(varied, engine, lane, samples)
    score = innovations[:, :n_y] / np.sqrt(innovations[:, n_y:])
    warm = np.arange(len(samples)) >= spec.thresholds.warm_up_samples
    use = record.use & warm[:, None]
    return Watch(
        scores=np.where(use, score, np.nan),
        cusum=_sums(spec, score, use),
        slow=np.where(warm[:, None], slow, np.nan),
    )


def _packed(spec: EngineSpec, record: Record, layout: Layout, variant: Variant) -> FloatArray:
    """Give the samples as the monitor packs them; settling readings are there, but count little."""
    own, place = layout.sample_fields, spec.sample_fields
    packed = np.zeros((len(record.time), spec.n_sample))
    for name in ("dt", "u_before", "u", "y", "kick"):
        packed[:, place[name]] = record.samples[:, own[name]]
    present = np.isfinite(record.y)
    packed[:, place["use"]] = present
    settling = present & ~record.use
    packed[:, place["scale"]] = variant.noise**2 * np.where(settling, spec.thresholds.blank_factor, 1.0)
    warm = np.arange(len(packed)) >= spec.thresholds.warm_up_samples
    packed[:, place["bound"]] = np.where(warm, spec.thresholds.learning_bound, 0.0)[:, None]
    for k, error in enumerate(spec.slow_errors):
        decay = np.exp(-record.samples[:, own["dt"]][:, 0] / error.memory)
        more = (variant.slow**2 - 1.0) * error.sd**2 * (1.0 - decay**2)
        column = place["kick"].start + k
        packed[:, column] = variant.slow**2 * packed[:, column] + more
    return packed


def _start_length(spec: EngineSpec, record: Record) -> int:
    """Give how many samples the monitor gathers to solve the start."""
    if all(item.start_sd is not None for item in spec.states):
        return 1
    seen = np.isfinite(record.y)
    needed = max(int(np.argmax(seen[:, j])) for j in range(seen.shape[1])) + 1
    return int(min(max(START_SAMPLES, min(needed, START_PATIENCE)), len(record.time)))


def _advanced(spec: EngineSpec, engine: Engine, lane: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give slow errors in their declared sizes and innovations with variances, sample by sample."""
    n_y = len(spec.outputs)
    if not any(item.alarms for item in spec.slow_errors):  # no need to stop at each sample
        _, found = engine.advance(lane, samples)
        return np.zeros((len(samples), len(spec.slow_errors))), found[:, : 2 * n_y, 0]
    slow, innovations = np.zeros((len(samples), len(spec.slow_errors))), np.zeros((len(samples), 2 * n_y))
    for t in range(len(samples)):
        lane, found = engine.advance(lane, samples[t : t + 1])
        slow[t], innovations[t] = lane[spec.slow_slice, 0] / spec.slow_sizes, found[0, : 2 * n_y, 0]
    return slow, innovations


def _sums(spec: EngineSpec, scores: FloatArray, use: BoolArray) -> FloatArray:
    """Give the two-sided CUSUM after each sample, (2, N, n_outputs)."""
    settings = spec.thresholds
    clipped = np.clip(np.nan_to_num(scores), -settings.cusum_clip, settings.cusum_clip)
    sums = np.zeros((2, *scores.shape))
    now = np.zeros((2, scores.shape[1]))
    for t in range(len(scores)):
        grown = np.maximum(now + np.array([clipped[t], -clipped[t]]) - settings.cusum_drift, 0.0)
        now = np.where(use[t], grown, now)
        sums[:, t] = now
    return sums
