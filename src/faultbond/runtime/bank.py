"""The bank: one joint filter per hypothesis and start, begun at the alarm from what was known before the change.

Source: design evidence, bank items 4, 7, 12. Parameters and their covariance come from a snapshot before the change;
the slow errors start anew; the states are predicted from the snapshot, because after a fault neither they nor a sensor
under suspicion can be trusted.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.runtime.lanes import LanePlan, plan_lanes
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
        lanes = _predict(spec, engine, healthy, lanes, blind[onset + 1 : begin])
    lanes, _ = engine.advance(lanes, trail.samples[begin:])
    return lanes


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
    first = spec.parameter_slice.start
    lanes = np.repeat(healthy[:, None], plan.n_lanes, axis=1)
    for lane, starts in enumerate(plan.starts):
        full = covariance.copy()
        for index, start in starts:
            k = first + index
            full[k, :] = 0.0
            full[:, k] = 0.0
            size = 1.0 if start.additive else abs(healthy[k])
            full[k, k] = (start.sd * size) ** 2
            value = healthy[k] + start.value if start.additive else healthy[k] * start.value
            limits = spec.parameters[index]
            lanes[k, lane] = np.clip(value, limits.lower, limits.upper)
        lanes[spec.covariance_slice, lane] = pack(full)
    return lanes


def _predict(spec: EngineSpec, engine: Engine, healthy: FloatArray, lanes: FloatArray, blind: FloatArray) -> FloatArray:
    """Predict the states from the onset to the first sample used, uncertain by the fault's whole possible effect.

    The onset is not known well, so the fault acted over some part of the time: the state lies between that of the
    healthy plant and that of the faulty one.
    """
    n_x = len(spec.states)
    without, _ = engine.advance(healthy, blind)
    with_fault, _ = engine.advance(lanes, blind)
    result = lanes.copy()
    result[-1] = 0.0
    base = unpack(spec, without[spec.covariance_slice, 0])
    for lane in range(lanes.shape[1]):
        effect = with_fault[:n_x, lane] - without[:n_x, 0]
        full = unpack(spec, lanes[spec.covariance_slice, lane])
        full[:n_x, :n_x] = base[:n_x, :n_x] + np.diag(effect**2)
        full[:n_x, n_x:] = 0.0
        full[n_x:, :n_x] = 0.0
        result[:n_x, lane] = without[:n_x, 0]
        result[spec.covariance_slice, lane] = pack(full)
    loops = slice(spec.n_joint + spec.n_packed, spec.n_numbers - 1)
    result[loops] = without[loops]
    return result
