"""The monitor's healthy filter along a recording, all samples in one call, with sizes of noise and accuracies varied.

The sums are those of the monitor (`runtime.cusum`); accuracies, noise and slow errors enter as data, so that none of
the variants needs another engine.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.fit.likelihood import Layout
from faultbond.fit.samples import Record
from faultbond.runtime.cusum import added, height_of, no_sums
from faultbond.runtime.monitor import START_PATIENCE, START_SAMPLES
from faultbond.runtime.start import healthy_lane, solve_start


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
    n_outputs): up, down; height (N, n_outputs): the largest sum, see `runtime.cusum`; slow (N, n_slow): slow errors in
    their declared sizes.
    """

    scores: FloatArray
    cusum: FloatArray
    height: FloatArray
    slow: FloatArray


def watch(
    spec: EngineSpec, engine: Engine, record: Record, layout: Layout, variants: Sequence[Variant] = (Variant(),)
) -> tuple[Watch, ...]:
    """Give what the detector sees of a recording, alarms or not, for each way to declare.

    Parameters
    ----------
    spec, engine : the model as the monitor runs it
    record, layout : the recording
    variants : what is declared otherwise
    """
    seen = [_filtered(spec, engine, record, layout, variant) for variant in variants]
    warm = np.arange(len(record.time)) >= spec.thresholds.warm_up_samples
    use = record.use & warm[:, None]
    scores, slow = np.array([score for score, _ in seen]), [item for _, item in seen]
    cusum, height = _summed(spec, scores, use, np.isfinite(record.y) & ~record.use)
    return tuple(
        Watch(
            scores=np.where(use, scores[k], np.nan),
            cusum=cusum[:, k],
            height=height[k],
            slow=np.where(warm[:, None], slow[k], np.nan),
        )
        for k in range(len(variants))
    )


def _filtered(
    spec: EngineSpec, engine: Engine, record: Record, layout: Layout, variant: Variant
) -> tuple[FloatArray, FloatArray]:
    """Give innovations in their sd (N, n_outputs), and slow errors in their declared sizes (N, n_slow)."""
    samples, n_y = _packed(spec, record, layout, variant), len(spec.outputs)
    varied = replace(
        spec,
        parameters=tuple(replace(item, accuracy=variant.accuracy * item.accuracy) for item in spec.parameters),
        slow_errors=tuple(replace(item, sd=variant.slow * item.sd) for item in spec.slow_errors),
    )
    mean, covariance = solve_start(varied, engine, samples[: _start_length(spec, record)])
    slow, innovations = _advanced(varied, engine, healthy_lane(varied, mean, covariance), samples)
    return innovations[:, :n_y] / np.sqrt(innovations[:, n_y:]), slow


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


def _summed(spec: EngineSpec, scores: FloatArray, use: BoolArray, settling: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Give the slow sums after each sample, (2, n, N, n_outputs), and the largest of all, (n, N, n_outputs)."""
    n, _, n_y = scores.shape
    sums = no_sums(n, n_y)
    slow, height = np.zeros((2, *scores.shape)), np.zeros(scores.shape)
    for t in range(scores.shape[1]):
        sums = added(spec.thresholds, sums, scores[:, t], use[t], settling[t])
        slow[:, :, t], height[:, t] = sums.slow, height_of(spec.thresholds, sums)
    return slow, height
