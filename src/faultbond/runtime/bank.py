"""The bank: one joint filter per hypothesis and start, begun at the alarm from what was known before the change.

Source: design evidence, bank items 4, 7, 12. Parameters and their covariance come from a snapshot before the change;
the slow errors start anew; the states are predicted from the snapshot, because after a fault neither they nor a sensor
under suspicion can be trusted.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.runtime.lanes import LanePlan, Start, plan_lanes
from faultbond.spec import Engine, EngineSpec, pack, unpack
from faultbond.types import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trail:
    """The last samples and healthy lanes, oldest first: `samples` (n, n_sample), `lanes` (n, n_numbers)."""

    samples: FloatArray
    lanes: FloatArray


def begin_bank(spec: EngineSpec, engine: Engine, trail: Trail, change: int) -> FloatArray:
    """Give the lanes of all hypotheses, having seen all samples of the trail from where the bank begins.

    Parameters
    ----------
    spec, engine : the model
    trail : Trail
        Its last sample is that of the alarm.
    change : int
        Index in the trail of the estimated onset.

    Returns
    -------
    float array, shape (n_numbers, n_lanes)
    """
    settings = spec.thresholds
    alarm = len(trail.samples) - 1
    begin = change if alarm - change > settings.lead_samples else alarm
    before = max(0, min(change, begin - 1) - settings.lead_samples)
    blind = trail.samples.copy()
    blind[:, spec.sample_fields["use"]] = 0.0
    healthy = _fresh(spec, trail.lanes[before])
    onset = max(before, min(change, begin - 1))
    if onset > before:
        healthy, _ = engine.advance(healthy, blind[before + 1 : onset + 1])
    plan = plan_lanes(spec)
    lanes = suspect_lanes(spec, plan, healthy[:, 0])
    if begin - 1 > onset:
        gap = blind[onset + 1 : begin]
        reached, _ = engine.advance(lanes, gap)
        later, _ = engine.advance(healthy, gap)
        lanes = _widen(spec, suspect_lanes(spec, plan, later[:, 0]), reached)
    lanes, _ = engine.advance(lanes, trail.samples[begin:])
    return lanes


def _widen(spec: EngineSpec, lanes: FloatArray, reached: FloatArray) -> FloatArray:
    """Make the states uncertain by the whole effect of the fault since the onset.

    The onset is not known well, so the fault acted over some part of the time: the state lies between that of the
    healthy plant (`lanes`) and that of one that was faulty all along (`reached`).
    """
    wide = lanes.copy()
    for k in range(len(spec.states)):
        wide[_diagonal(spec, k)] += (reached[k] - lanes[k]) ** 2
    return wide


def _diagonal(spec: EngineSpec, k: int) -> int:
    """Place of a variance in a lane."""
    return spec.n_joint + k * spec.n_joint - k * (k - 1) // 2


def _fresh(spec: EngineSpec, numbers: FloatArray) -> FloatArray:
    """Forget slow errors and likelihood of a healthy lane; give shape (n_numbers, 1)."""
    fresh = numbers.copy()
    full = unpack(spec, fresh[spec.covariance_slice])
    slow = spec.slow_slice
    fresh[slow] = 0.0
    full[slow, :] = 0.0
    full[:, slow] = 0.0
    full[slow, slow] = np.diag([error.sd**2 for error in spec.slow_errors])
    fresh[spec.covariance_slice] = pack(full)
    fresh[-1] = 0.0
    return fresh[:, None]


def suspect_lanes(spec: EngineSpec, plan: LanePlan, healthy: FloatArray) -> FloatArray:
    """Give one lane per start: the suspects wide about their start, the rest as in `healthy` (n_numbers,)."""
    covariance = unpack(spec, healthy[spec.covariance_slice])
    lanes = np.repeat(healthy[:, None], plan.n_lanes, axis=1)
    for lane, starts in enumerate(plan.starts):
        full = covariance.copy()
        for index, start in starts:
            _suspect(spec, index, start, lanes[:, lane], full)
        for state in np.flatnonzero(plan.carry[lane]):
            _carry(spec, int(state), starts, healthy, lanes[:, lane], full)
        lanes[spec.covariance_slice, lane] = pack(full)
    return lanes


def _suspect(spec: EngineSpec, index: int, start: Start, lane: FloatArray, full: FloatArray) -> None:
    """Set one suspect of a lane to its start, independent of all else; changes `lane` and `full`."""
    k = spec.parameter_slice.start + index
    limits = spec.parameters[index]
    value = lane[k] + start.value if start.additive else lane[k] * start.value
    full[k, :] = 0.0
    full[:, k] = 0.0
    full[k, k] = (start.sd * (1.0 if start.additive else abs(lane[k]))) ** 2
    lane[k] = np.clip(value, limits.lower, limits.upper)


def _carry(
    spec: EngineSpec,
    state: int,
    starts: tuple[tuple[int, Start], ...],
    healthy: FloatArray,
    lane: FloatArray,
    full: FloatArray,
) -> None:
    """Let a store follow its suspects so that its effort or flow goes on; changes `lane` and `full`.

    The content x becomes x * factor**exponent, so it is as uncertain as the factor, and correlated with it.
    """
    suspects = dict(starts)
    scale = 1.0
    for index, exponent in spec.states[state].carries:
        if index in suspects:
            k = spec.parameter_slice.start + index
            scale *= (lane[k] / healthy[k]) ** exponent if healthy[k] else 1.0
    row = full[state].copy() * scale
    full[state, :] = row
    full[:, state] = row
    full[state, state] = row[state] * scale
    lane[state] *= scale
    for index, exponent in spec.states[state].carries:
        if index in suspects:
            k = spec.parameter_slice.start + index
            slope = exponent * lane[state] / lane[k]
            full[state, state] += slope**2 * full[k, k]
            full[state, k] = full[k, state] = slope * full[k, k]
