"""Lanes of a bank, begun from a healthy lane as a hypothesis says, in matrices: something for filters to work on."""

from collections.abc import Sequence

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.lanes import LanePlan
from faultbond.contract.slots import SlotPlan, with_slot
from faultbond.contract.spec import EngineSpec, covariance_place, pack, unpack


def relinearised(spec: EngineSpec, samples: FloatArray) -> FloatArray:
    """Samples (n, n_sample) as lanes of the bank take them: readings are linearised again, innovations bounded."""
    again = samples.copy()
    again[:, spec.sample_fields["again"]] = 1.0
    again[:, spec.sample_fields["bound"]] = spec.thresholds.bank_bound
    return again


def suspect_lanes(spec: EngineSpec, plan: LanePlan, healthy: FloatArray) -> FloatArray:
    """One lane per start, (n_numbers, n_lanes): suspects wide about it, all else as in `healthy` (n_numbers,)."""
    lanes = np.repeat(healthy[:, None], plan.n_lanes, axis=1)
    for lane in range(plan.n_lanes):
        full = unpack(spec, healthy[spec.covariance_slice])
        for index in np.flatnonzero(plan.suspected[:, lane]):
            k, item = spec.parameter_slice.start + int(index), spec.parameters[index]
            value, is_added = plan.values[index, lane], item.healthy == 0.0
            full[k, :] = full[:, k] = 0.0
            full[k, k] = (plan.sds[index, lane] * (1.0 if is_added else abs(healthy[k]))) ** 2
            lanes[k, lane] = np.clip(healthy[k] + value if is_added else healthy[k] * value, item.lower, item.upper)
        lanes[spec.covariance_slice, lane] = pack(full)
    return lanes


def shared(spec: EngineSpec) -> IntArray:
    """Places (n_joint,) in z of a lane with a slot of what a lane without one, of `spec`, holds too."""
    wide = spec.slotted
    return np.concatenate([np.arange(wide.slot_slice.start), np.arange(wide.slot_slice.stop, wide.n_joint)])


def slot_lanes(
    spec: EngineSpec,
    plan: SlotPlan,
    chosen: Sequence[int],
    healthy: FloatArray,
    peak: FloatArray,
    readings: FloatArray,
    inputs: FloatArray,
) -> FloatArray:
    """Chosen lanes of a plan, (n_numbers, n); `peak`, `inputs` (n_inputs,): sizes of inputs, and what they are."""
    wide, dt = spec.slotted, spec.sample_time or 1.0
    lanes = np.repeat(with_slot(spec, healthy)[:, None], len(chosen), axis=1)
    lanes[wide.loop_slice.stop : -1] = plan.roles[:, list(chosen)]
    size, rate = wide.slot_slice.start, wide.slot_slice.start + 1
    for column, index in enumerate(chosen):
        item, unit = plan.lanes[index], 1.0
        per = item.lag or dt  # s for which rates are stated
        if item.parameter >= 0 and spec.parameters[item.parameter].healthy:
            unit = healthy[spec.parameter_slice.start + item.parameter]
        elif item.input >= 0 and not item.scales:
            unit = peak[item.input] or 1.0
        stuck = inputs[item.input] if item.input >= 0 else readings[item.output] / spec.outputs[item.output].noise
        lanes[size, column] = stuck if item.sticks else item.size * unit
        lanes[rate, column] = item.rate * unit / per
        lanes[covariance_place(wide, size, size), column] = (item.size_sd * unit) ** 2
        lanes[covariance_place(wide, rate, rate), column] = (item.rate_sd * unit / per) ** 2
    return lanes
