"""The monitor's healthy filter along a recording, with sizes of noise and accuracies varied.

The monitor itself, its alarms off, says what its filter takes and what its sums count; accuracies, noise and slow
errors enter as data, so that none of the variants needs another engine, and each is one call of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.fit.samples import HealthyRecording
from faultbond.runtime.cusum import added, height_of, no_sums
from faultbond.runtime.monitor import quiet, step
from faultbond.runtime.packing import trusted
from faultbond.runtime.start import healthy_lane, solve_start
from faultbond.runtime.state import init
from faultbond.runtime.unseen import unknown_inputs


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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Taken:
    """What the monitor's filter took of n samples, those from its start on.

    rows: (n, n_sample), packed; started: how many of them it gathered for its start. use, settling: (n, n_outputs),
    whether the sums take the reading, or forget those before. astray: (n,), whether a gap is felt.
    """

    rows: FloatArray
    started: int
    use: BoolArray
    settling: BoolArray
    astray: BoolArray


def watch_recording(
    spec: EngineSpec, engine: Engine, record: HealthyRecording, variants: Sequence[Variant] = (Variant(),)
) -> tuple[Watch, ...]:
    """Give what the detector sees of a recording, alarms or not, for each way to declare.

    Parameters
    ----------
    spec, engine : the model as the monitor runs it
    record : the recording
    variants : what is declared otherwise
    """
    taken, count = _taken(spec, engine, record), len(record.time)
    shape, first = (len(variants), count, len(spec.outputs)), count - len(taken.rows)
    scores, slow = np.full(shape, np.nan), np.full((*shape[:2], len(spec.slow_errors)), np.nan)
    for k, variant in enumerate(variants):
        scores[k, first:], slow[k, first:] = _filtered(spec, engine, taken, variant)
    warm = first + spec.thresholds.warm_up_samples
    scores[:, :warm], slow[:, :warm] = np.nan, np.nan
    cusum, height = np.zeros((2, *shape)), np.zeros(shape)
    sums = no_sums(shape[0], shape[2])
    for t in range(warm, count):
        row = t - first
        if taken.astray[row]:  # after a gap the scatter is compared with nothing before it
            sums = replace(sums, before=np.full_like(sums.before, np.nan))
        forget = taken.settling[row] | taken.astray[row]
        sums = added(spec.thresholds, sums, scores[:, t], taken.use[row], forget)
        cusum[:, :, t], height[:, t] = sums.slow, height_of(spec.thresholds, sums)
    scores[:, first:][:, ~taken.use] = np.nan
    return tuple(
        Watch(scores=scores[k], cusum=cusum[:, k], height=height[k], slow=slow[k]) for k in range(len(variants))
    )


def _taken(spec: EngineSpec, engine: Engine, record: HealthyRecording) -> _Taken:
    """Run the monitor with its alarms off."""
    watched = quiet(spec)
    state, started = init(watched), 0
    rows, known, astray = list[FloatArray](), list[bool](), list[bool]()
    for point in record.points:
        before = state.clock.running
        state, _ = step(watched, engine, state, point)
        if state.clock.running and not before and not started:
            rows = list(state.past.samples[state.past.place(state.clock.begun) :].copy())
            started = len(rows)
        elif started:
            rows.append(state.past.samples[-1].copy())
        new = len(rows) - len(known)
        known += [not unknown_inputs(state.inputs).any()] * new
        astray += [bool(state.healthy.astray.any())] * new
    packed = np.array(rows).reshape(-1, spec.n_sample)
    use = trusted(spec, packed.T).T
    return _Taken(
        rows=packed,
        started=started,
        use=use & np.array(known, dtype=bool)[:, None],
        settling=(packed[:, spec.sample_fields["use"]] > 0) & ~use,
        astray=np.array(astray, dtype=bool),
    )


def _filtered(spec: EngineSpec, engine: Engine, taken: _Taken, variant: Variant) -> tuple[FloatArray, FloatArray]:
    """Give innovations in their sd (n, n_outputs), and slow errors in their declared sizes (n, n_slow)."""
    rows, place, n_y = taken.rows.copy(), spec.sample_fields, len(spec.outputs)
    slow = np.zeros((len(rows), len(spec.slow_errors)))
    if not len(rows):
        return np.zeros((0, n_y)), slow
    rows[:, place["scale"]] *= variant.noise**2
    for k, error in enumerate(spec.slow_errors):
        decay = np.exp(-rows[:, place["dt"]][:, 0] / error.memory)
        more = (variant.slow**2 - 1.0) * error.sd**2 * (1.0 - decay**2)
        column = place["kick"].start + k
        rows[:, column] = variant.slow**2 * rows[:, column] + more
    varied = replace(
        spec,
        parameters=tuple(replace(item, accuracy=variant.accuracy * item.accuracy) for item in spec.parameters),
        slow_errors=tuple(replace(item, sd=variant.slow * item.sd) for item in spec.slow_errors),
    )
    lane = healthy_lane(varied, *solve_start(varied, engine, rows[: taken.started]))
    if not any(item.alarms for item in spec.slow_errors):  # no need to stop at each sample
        found = engine.advance(lane, rows)[1][:, :, 0]
    else:
        found = np.zeros((len(rows), 2 * n_y))
        for t in range(len(rows)):
            lane, innovations = engine.advance(lane, rows[t : t + 1])
            slow[t], found[t] = lane[varied.slow_slice, 0] / varied.slow_sizes, innovations[0, : 2 * n_y, 0]
    return found[:, :n_y] / np.sqrt(found[:, n_y : 2 * n_y]), slow
