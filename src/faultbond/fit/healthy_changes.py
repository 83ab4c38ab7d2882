"""How far parameters seem to change, and instruments to be off, on healthy data, since no model is exact.

After an alarm a suspect is let free, and found anew from the samples that follow. The same is done here while the
plant is healthy: window by window each parameter, and the bias of each sensor and input, is let free by itself. What it
is found off by, beyond what its variance allows, is what the model gets wrong; a fault must change it by more.

Source: test and size are those of Cochran, Biometrics 10 (1954) 101, and of Paule and Mandel, J. Research of the
National Bureau of Standards 87 (1982) 377.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtri

from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.slots import plan_slots, with_slot
from faultbond.contract.spec import EngineSpec, covariance_place, pack, unpack
from faultbond.fit.innovations import Taken, take_recordings
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.side_by_side import side_by_side
from faultbond.runtime.core import Core
from faultbond.types import FaultKind

PARTS = (0.25, 0.5, 1.0)  # lengths of windows, in the samples that tell as much as ever so many do
LEAST_WINDOWS = 4  # in all recordings; of fewer nothing is said
FREE = 0.3  # sd, in factors, of a parameter that is let free: from a wider start what is found depends on the start
BY_CHANCE = 0.01  # probability with which an exact model is taken for one that is not
HALVINGS = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Believed:
    """What is believed beside what the model declares, by name.

    values, accuracies : of parameters, SI; noise : of sensors, by how much it is larger
    """

    values: Mapping[str, float] = field(default_factory=dict)
    accuracies: Mapping[str, float] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)


def healthy_changes(
    core: Core, records: Sequence[HealthyRecording], believed: Believed | None = None
) -> dict[str, float]:
    """Give the standard deviation by which each suspect seems to change while healthy, SI; none of too few samples.

    Of sensors and inputs that of their bias. That of the windows of which it is the largest counts, since a value is
    told after any of them.

    Parameters
    ----------
    core : of the model, as the monitor runs it
    records : healthy recordings
    believed : what a fit has found
    """
    taken = take_recordings(core, records)
    found: dict[str, float] = {}
    for part in PARTS:
        length = int(part * core_settings()["AS_MANY"])
        for name, size in _over_windows(core, taken, believed or Believed(), length).items():
            found[name] = max(size, found.get(name, 0.0))
    return found


def _over_windows(core: Core, recordings: Sequence[Taken], believed: Believed, length: int) -> dict[str, float]:
    """Give the same over windows of so many samples alone."""
    seen = side_by_side(lambda taken: _windows(replace(core), taken, believed, length), recordings)
    found = [item for windows in seen for item in windows]
    if not found:
        return {}
    off, variance = (np.array(part) for part in zip(*found, strict=True))
    known = np.isfinite(off) & (variance > 0.0)
    return {
        name: scale * spread_beyond(off[known[:, k], k], variance[known[:, k], k])
        for k, (name, scale) in enumerate(_scales(core.spec))
        if known[:, k].sum() >= LEAST_WINDOWS
    }


def spread_beyond(off: FloatArray, variance: FloatArray) -> float:
    """Give s for which off (n,), with its variance (n,) and s**2, is as large as usual; 0 where it may be without."""

    def size(square: float) -> float:
        return float(np.sum(off**2 / (variance + square)))

    if size(0.0) <= chdtri(len(off), BY_CHANCE):
        return 0.0
    low, high = 0.0, float(np.max(off**2))
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if size(middle) > len(off) else (low, middle)
    return float(np.sqrt(high))


def _suspects(spec: EngineSpec) -> list[int]:
    return [k for k, item in enumerate(spec.parameters) if item.suspect]


def _scales(spec: EngineSpec) -> list[tuple[str, float]]:
    """Give names and SI scales of what is let free: parameters, then sensors and inputs."""
    parameters = [(spec.parameters[k].name, abs(spec.parameters[k].scale)) for k in _suspects(spec)]
    return parameters + [(item.name, 1.0) for item in spec.instruments]


def _windows(core: Core, taken: Taken, believed: Believed, length: int) -> list[tuple[FloatArray, FloatArray]]:
    """Give what suspects are found off by in each window of a recording, in their scales, and its variance, alike."""
    spec, suspects, rows = core.spec, _suspects(core.spec), taken.rows.copy()
    if not (suspects or spec.instruments) or len(rows) < length + spec.thresholds.warm_up_samples:
        return []
    rows[:, spec.sample_fields["scale"]] *= [believed.noise.get(item.name, 1.0) ** 2 for item in spec.outputs]
    known = _known(core, believed)
    lane, place, found = core.healthy_lane(*core.solve_start(rows[: taken.started], known), known), 0, []
    usual, peak = known[spec.parameter_slice, 0], np.abs(rows[:, spec.sample_fields["u"]]).max(axis=0)
    for first in range(spec.thresholds.warm_up_samples, len(rows) - length + 1, length):
        lane, place = core.advance(lane, rows[place:first])[0], first
        window = _relinearised(spec, rows[first : first + length])
        ends = core.advance(_freed(spec, lane[:, 0], suspects), window)[0]
        columns = range(len(suspects))
        at = [spec.parameter_slice.start + k for k in suspects]
        own = ends[[covariance_place(spec, k, k) for k in at], columns]
        bias, variance = _biases(core, lane[:, 0], window, peak)
        found.append((np.r_[ends[at, columns] - usual[suspects], bias], np.r_[own, variance]))
    return found


def _biases(core: Core, healthy: FloatArray, window: FloatArray, peak: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give the bias of each instrument over a window, (n_instruments,), SI, and its variance.

    healthy : lane before it, (n_numbers,); peak : largest size of each input, (n_inputs,), SI
    """
    spec, wide, plan = core.spec, core.spec.slotted, plan_slots(core.spec)
    size, chosen = wide.slot_slice.start, list[int]()
    own = covariance_place(wide, size, size)
    for hypothesis in range(len(spec.hypotheses), spec.n_begun):
        biases = [
            k for k, item in enumerate(plan.lanes) if (item.hypothesis, item.kind) == (hypothesis, FaultKind.BIAS)
        ]
        chosen.append(max(biases, key=lambda k: plan.lanes[k].size_sd))
    if not chosen:
        return np.zeros(0), np.zeros(0)
    units = [peak[item.index] if not item.is_output else 1.0 for item in spec.instruments]
    scales = [1.0 if not item.is_output else spec.outputs[item.index].noise for item in spec.instruments]
    lanes = np.repeat(with_slot(spec, healthy)[:, None], len(chosen), axis=1)
    lanes[wide.loop_slice.stop : -1] = plan.roles[:, chosen]
    lanes[own] = [(plan.lanes[k].size_sd * unit) ** 2 for k, unit in zip(chosen, units, strict=True)]
    ends = core.slot.advance(lanes, window)[0]
    return ends[size] * scales, ends[own] * np.square(scales)


def _known(core: Core, believed: Believed) -> FloatArray:
    """Give a healthy lane (n_numbers, 1) of the plant as it is believed to be."""
    spec, n_x = core.spec, len(core.spec.states)
    lane = core.healthy_lane(np.zeros(n_x), np.zeros((n_x, n_x)))
    for k, item in enumerate(spec.parameters, start=spec.parameter_slice.start):
        if item.name in believed.values:
            lane[k] = believed.values[item.name] / item.scale
        if item.name in believed.accuracies:
            lane[covariance_place(spec, k, k)] = (believed.accuracies[item.name] / item.scale) ** 2
    return lane


def _freed(spec: EngineSpec, healthy: FloatArray, suspects: Sequence[int]) -> FloatArray:
    """Give a lane (n_numbers, n) for each suspect in which it is free, all else as in `healthy` (n_numbers,)."""
    lanes = np.repeat(healthy[:, None], len(suspects), axis=1)
    for column, index in enumerate(suspects):
        k, full = spec.parameter_slice.start + index, unpack(spec, healthy[spec.covariance_slice])
        full[k, :] = full[:, k] = 0.0
        full[k, k] = min(spec.parameters[index].change, FREE) ** 2
        lanes[spec.covariance_slice, column] = pack(full)
    return lanes


def _relinearised(spec: EngineSpec, samples: FloatArray) -> FloatArray:
    """Give samples (n, n_sample) as lanes of the bank take them."""
    again = samples.copy()
    again[:, spec.sample_fields["again"]] = 1.0
    again[:, spec.sample_fields["bound"]] = spec.thresholds.bank_bound
    return again
