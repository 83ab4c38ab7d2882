"""Lanes with a slot: begun at the alarm, carried on sample by sample.

Drifts and faults of instruments begin at the onsets that the bank tries (`faultbond.runtime.stepped`). A fault that
comes and goes needs no onset: each of its pairs of lanes, fault there and fault gone, begins healthy at the oldest
sample kept, and before each sample every lane of a pair becomes the mixture of both, as likely as the fault is to come
or go.
Source: Blom and Bar-Shalom, IEEE Trans. Automatic Control 33 (1988) 780 (interacting multiple models).
"""

from collections.abc import Sequence
from math import log, log1p

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.slots import WANDER, SlotPlan, plan_slots
from faultbond.contract.spec import Engine, EngineSpec, covariance_place, pack, unpack
from faultbond.runtime.onsets import onsets
from faultbond.runtime.stepped import LOWEST, Mixture, forget_slow_errors, mix, mixed, relinearised
from faultbond.runtime.trail import Trail
from faultbond.types import FaultKind

SWITCHING = 1.0 / 300.0  # probability per sample that a fault that comes and goes does so
WALK = 12  # steps in which the bias of an input comes up that takes a while to settle


def begin_slots(spec: EngineSpec, engine: Engine, trail: Trail, change: int, peak: FloatArray) -> FloatArray:
    """Give the lanes with a slot, having seen all samples of the trail.

    Parameters
    ----------
    spec, engine : the model
    trail : Trail
        Its last sample is that of the alarm.
    change : int
        Index in the trail of the onset that the detector estimates.
    peak : float array, shape (n_inputs,)
        Largest size of each input so far, SI.

    Returns
    -------
    float array, shape (n_numbers of slot lanes, n_lanes)
    """
    plan = plan_slots(spec)
    if not plan.n_lanes:
        return np.zeros((spec.slotted.n_numbers, 0))
    samples = relinearised(spec, trail.samples)
    from_onset = _from_onsets(spec, engine, plan, trail, samples, change, peak)
    return np.concatenate([from_onset, _switched(spec, engine, plan, trail, samples, peak)], axis=1)


def advance_slots(
    spec: EngineSpec, engine: Engine, slots: FloatArray, packed: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Give lanes and innovations after one more packed sample, shape (n_sample,)."""
    if not slots.shape[1]:
        return slots, np.zeros((2 * len(spec.outputs), 0))
    switched = plan_slots(spec).switched
    ready = np.concatenate([slots[:, :switched], interacted(spec, slots[:, switched:])], axis=1)
    lanes, innovations = engine.slot.advance(ready, relinearised(spec, packed[None, :]))
    found = innovations[0].copy()
    found[:, switched:] = _of_pairs(found[:, switched:], ready[-1, switched:])
    return lanes, found


def _of_pairs(innovations: FloatArray, likelihoods: FloatArray) -> FloatArray:
    """Give both lanes of a pair the innovations of their mixture: while the fault is gone, one of them does not fit."""
    n_y = len(innovations) // 2
    first, second = likelihoods[0::2], likelihoods[1::2]
    weight = np.exp(first - np.logaddexp(first, second))
    one, two = innovations[:, 0::2], innovations[:, 1::2]
    mixture = np.where(weight > 0.0, weight * one, 0.0) + np.where(weight < 1.0, (1.0 - weight) * two, 0.0)
    apart = np.where((weight > 0.0) & (weight < 1.0), one[:n_y] - two[:n_y], 0.0)
    mixture[n_y:] += weight * (1.0 - weight) * apart**2
    return np.repeat(mixture, 2, axis=1)


def renew_slots(spec: EngineSpec, engine: Engine, trail: Trail, slots: FloatArray, peak: FloatArray) -> FloatArray:
    """Begin one lane of each drift of a parameter and bias of an input again, from what the best of them has found.

    Only where it begins, and so where it linearises, is what was found; the spread is that of one of its starts. It
    takes the place of the least likely of these lanes, if it is likelier; see `renew_steps`. `peak` (n_inputs,) is
    the largest size of each input so far.
    """
    plan = plan_slots(spec)
    groups = renewed_groups(plan)
    if not groups:
        return slots
    found = np.nan_to_num(slots[-1], nan=-np.inf)
    best, worst = (np.array([group[end(found[group])] for group in groups]) for end in (np.argmax, np.argmin))
    spread = [_spread(plan, group, int(place)) for group, place in zip(groups, worst, strict=True)]
    size, rate = slots[spec.slotted.slot_slice][:, best]
    samples, place = relinearised(spec, trail.samples), spec.slotted.slot_slice.start
    elapsed = np.cumsum(samples[::-1, 0])[::-1]  # from before each sample to now
    mixture: Mixture | None = None
    for onset, width in onsets(spec, trail, trail.alarmed):
        healthy = forget_slow_errors(spec, trail.lanes[onset - 1])
        lanes = slot_lanes(spec, plan, spread, healthy, samples[:onset], peak, trail.old)
        then = size - rate * elapsed[onset]
        lanes[place], lanes[place + 1] = then, rate
        lanes[-1] = trail.lanes[onset - 1, -1]
        mixture = mix(mixture, engine.slot.advance(lanes, samples[onset:])[0], width)
    again, renewed = mixed(spec, mixture), slots.copy()
    better = np.nan_to_num(again[-1], nan=-np.inf) > found[worst]
    renewed[:, worst[better]] = again[:, better]
    return renewed


def renewed_groups(plan: SlotPlan) -> list[IntArray]:
    """Give the lanes (n,) of each drift of a parameter, and of each bias of an input."""
    groups: dict[int, list[int]] = {}
    for k, lane in enumerate(plan.lanes[: plan.switched]):
        if lane.input >= 0 or (lane.kind is FaultKind.DRIFT and lane.parameter >= 0):
            groups.setdefault(lane.hypothesis, []).append(k)
    return [np.array(group, dtype=np.intp) for group in groups.values()]


def _spread(plan: SlotPlan, group: IntArray, worst: int) -> int:
    """Give the lane whose spread a renewed lane has: of a bias the widest, else what was found would count twice."""
    biased = plan.lanes[worst].input >= 0
    return max(group.tolist(), key=lambda lane: plan.lanes[lane].size_sd) if biased else worst


def _from_onsets(
    spec: EngineSpec,
    engine: Engine,
    plan: SlotPlan,
    trail: Trail,
    samples: FloatArray,
    change: int,
    peak: FloatArray,
) -> FloatArray:
    chosen = range(plan.switched)
    settling = _settling(spec, plan)
    mixture: Mixture | None = None
    for onset, width in onsets(spec, trail, change):
        healthy = forget_slow_errors(spec, trail.lanes[onset - 1])
        lanes = slot_lanes(spec, plan, chosen, healthy, samples[:onset], peak, trail.old)
        lanes[-1] = trail.lanes[onset - 1, -1]
        following = engine.slot.advance(lanes, samples[onset:])[0]
        for lag, own in settling.items():
            following[:, own] = _settled(spec, engine, lanes[:, own], samples[onset:], lag)
        mixture = mix(mixture, following, width)
    return mixed(spec, mixture)


def _settling(spec: EngineSpec, plan: SlotPlan) -> dict[float, list[int]]:
    """Give the lanes of inputs that settle in sight of a sensor that they reach directly, by the time that it takes."""
    seen = {index for output in spec.outputs for index in output.direct_inputs}
    found: dict[float, list[int]] = {}
    for k, lane in enumerate(plan.lanes[: plan.switched]):
        if lane.input in seen and spec.inputs[lane.input].settling > 0.0:
            found.setdefault(spec.inputs[lane.input].settling, []).append(k)
    return found


def _settled(spec: EngineSpec, engine: Engine, lanes: FloatArray, samples: FloatArray, lag: float) -> FloatArray:
    """Advance lanes of biases that come up within `lag` seconds, in which the size walks at random from where it is.

    All steps of the walk together are as wide as the start of a lane says.
    """
    size = spec.slotted.slot_slice.start
    place = covariance_place(spec.slotted, size, size)
    meanwhile = int(np.sum(np.cumsum(samples[:, spec.sample_fields["dt"]]) <= lag))
    steps = np.array_split(np.arange(meanwhile), max(min(meanwhile, WALK), 1))
    now, variance = lanes.copy(), lanes[place] / len(steps)
    now[place] = 0.0
    for rows in steps:
        now[place] += variance
        now = engine.slot.advance(now, samples[rows])[0] if len(rows) else now
    return engine.slot.advance(now, samples[meanwhile:])[0] if meanwhile < len(samples) else now


def _switched(
    spec: EngineSpec, engine: Engine, plan: SlotPlan, trail: Trail, samples: FloatArray, peak: FloatArray
) -> FloatArray:
    chosen = range(plan.switched, plan.n_lanes)
    healthy = forget_slow_errors(spec, trail.lanes[0])
    lanes = slot_lanes(spec, plan, chosen, healthy, samples[:1], peak)
    lanes[-1] = trail.lanes[0, -1]
    lanes[-1, 0::2] = LOWEST  # healthy so far
    for sample in samples[1:]:
        lanes = engine.slot.advance(interacted(spec, lanes), sample[None, :])[0]
    return lanes


def slot_lanes(
    spec: EngineSpec,
    plan: SlotPlan,
    chosen: Sequence[int],
    healthy: FloatArray,
    seen: FloatArray,
    peak: FloatArray,
    old: FloatArray | None = None,
) -> FloatArray:
    """Give chosen lanes of a plan, begun from a healthy lane (n_numbers,) after the samples `seen` (n, n_sample)."""
    wide = spec.slotted
    lane = widened(spec, healthy)
    lanes = np.repeat(lane[:, None], len(chosen), axis=1)
    if old is not None:
        lanes[:, [plan.lanes[index].old for index in chosen]] = widened(spec, unlearned(spec, healthy, old))[:, None]
    lanes[wide.loop_slice.stop : -1] = plan.roles[:, list(chosen)]
    size, rate = wide.slot_slice.start, wide.slot_slice.start + 1
    dt = spec.sample_time or float(np.mean(seen[:, spec.sample_fields["dt"]])) or 1.0
    for column, index in enumerate(chosen):
        item = plan.lanes[index]
        unit = 1.0
        if item.parameter >= 0 and spec.parameters[item.parameter].healthy:
            unit = healthy[spec.parameter_slice.start + item.parameter]
        elif item.input >= 0:
            unit = peak[item.input] or 1.0
        start = item.size * unit
        if item.sticks:
            start = _last_reading(spec, seen, item.output) / spec.outputs[item.output].noise
        lanes[size, column] = start
        lanes[covariance_place(wide, size, size), column] = (item.size_sd * unit) ** 2
        lanes[covariance_place(wide, rate, rate), column] = (item.rate_sd * unit / dt) ** 2
        if item.span:
            wander = WANDER * (item.rate_sd * unit / dt) ** 2 / (item.span * dt)
            lanes[wide.role_fields["wander"], column] = wander
    return lanes


def unlearned(spec: EngineSpec, healthy: FloatArray, old: FloatArray) -> FloatArray:
    """Give a lane with the states of `healthy` and the parameters of `old`, (n_numbers,) each, uncorrelated."""
    place, lane = spec.parameter_slice, healthy.copy()
    lane[place] = old[place]
    full, before = unpack(spec, healthy[spec.covariance_slice]), unpack(spec, old[spec.covariance_slice])
    full[place, :] = full[:, place] = 0.0
    full[place, place] = before[place, place]
    lane[spec.covariance_slice] = pack(full)
    return lane


def _last_reading(spec: EngineSpec, seen: FloatArray, output: int) -> float:
    """Give the last value of a sensor; 0 if it has had none."""
    fields = spec.sample_fields
    used = np.flatnonzero(seen[:, fields["use"].start + output])
    return float(seen[used[-1], fields["y"].start + output]) if len(used) else 0.0


def widened(spec: EngineSpec, lane: FloatArray) -> FloatArray:
    """Give a lane (n_numbers,) as one with an empty slot; its roles are zero."""
    wide, own = spec.slotted, shared(spec)
    result = np.zeros(wide.n_numbers)
    result[own] = lane[: spec.n_joint]
    full = np.zeros((wide.n_joint, wide.n_joint))
    full[np.ix_(own, own)] = unpack(spec, lane[spec.covariance_slice])
    result[wide.covariance_slice] = pack(full)
    result[wide.loop_slice] = lane[spec.loop_slice]
    return result


def shared(spec: EngineSpec) -> IntArray:
    """Give the places (n_joint,) in z of a slot lane of what a lane without a slot, of `spec`, holds too."""
    wide = spec.slotted
    return np.concatenate([np.arange(wide.slot_slice.start), np.arange(wide.slot_slice.stop, wide.n_joint)])


def interacted(spec: EngineSpec, lanes: FloatArray) -> FloatArray:
    """Let the two lanes of each pair mix: each becomes what both say of a plant that is now in its mode.

    The lanes (n_numbers, n_lanes) have a slot; those of a pair are side by side, that with the fault first.
    """
    there, gone = lanes[:, 0::2], lanes[:, 1::2]
    stay, switch = log1p(-SWITCHING), log(SWITCHING)
    one, two = (np.where(np.isfinite(item[-1]), item[-1], LOWEST) for item in (there, gone))
    result = lanes.copy()
    for k, (own, other) in enumerate(((one, two), (two, one))):
        total = np.logaddexp(own + stay, other + switch)
        weight = np.exp(own + stay - total)
        first, second = (there, gone) if k == 0 else (gone, there)
        result[:, k::2] = _merged(spec.slotted, first, second, weight)
        result[-1, k::2] = total
    return result


def _merged(spec: EngineSpec, first: FloatArray, second: FloatArray, weight: FloatArray) -> FloatArray:
    """Give the mean and covariance of mixtures; roles are those of `first`. A lane of weight 0 may hold anything."""
    n = spec.n_joint
    with np.errstate(invalid="ignore", over="ignore"):
        mixture = np.where(weight > 0.0, weight * first, 0.0) + np.where(weight < 1.0, (1.0 - weight) * second, 0.0)
        apart = np.where((weight > 0.0) & (weight < 1.0), first[:n] - second[:n], 0.0)
    rows, columns = np.triu_indices(n)
    mixture[spec.covariance_slice] += weight * (1.0 - weight) * apart[rows] * apart[columns]
    mixture[spec.loop_slice.stop :] = first[spec.loop_slice.stop :]
    return mixture
