"""The bank: one joint filter per hypothesis and start, begun at the alarm from what was known before the change.

The onset is not known, so every lane is begun at several places before the alarm, from the healthy filter as it stood
there; up to its onset a lane's likelihood is that of the healthy plant, after it its own. All onsets have thus seen the
same samples, and the likelihood of a lane is the mean over its onsets (a change-point mixture); from the alarm on, the
best onset of each lane goes on. Reasons and figures: docs/decisions/006-onset-mixture.md.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.lanes import LanePlan, extremes, found_lanes, plan_lanes
from faultbond.contract.spec import Engine, EngineSpec, covariance_place, pack, unpack
from faultbond.runtime.onsets import onsets
from faultbond.runtime.trail import Trail

ASTRAY = 10.0  # nats by which a lane that begins from closer may be less likely, as chance has it
IN_REACH = 20.0  # nats by which a filter, or a hypothesis, may lag behind the best and still come to lead
SAME, TINY = 0.3, 1e-12  # standard deviations by which two filters that found the same may differ; and rounding
LOWEST = -1e300  # likelihood of a lane that is no number
_Jump = tuple[int, int, float, IntArray]  # state, parameter, exponent, lanes


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mixture:
    """Lanes over several onsets.

    lanes : (n_numbers, n_lanes), those of the best onset of each
    best, total : (n_lanes,), log-likelihood of the best onset, and of all together
    """

    lanes: FloatArray
    best: FloatArray
    total: FloatArray


def begin_steps(
    spec: EngineSpec, engine: Engine, trail: Trail, change: int, plan: LanePlan | None = None
) -> FloatArray:
    """Give the lanes of all hypotheses, having seen all samples of the trail.

    Parameters
    ----------
    spec, engine : the model
    trail : Trail
        Its last sample is that of the alarm.
    change : int
        Index in the trail of the onset that the detector estimates; one of the onsets tried.
    plan : LanePlan
        The lanes to begin; those of the specification if not given.

    Returns
    -------
    float array, shape (n_numbers, n_lanes)
    """
    chosen = plan_lanes(spec) if plan is None else plan
    samples = relinearised(spec, trail.samples)

    def begun(onset: int) -> FloatArray:
        before = trail.lanes[onset - 1]
        lanes = _begin_lanes(spec, engine, chosen, forget_slow_errors(spec, before), samples[onset])
        lanes[-1] = before[-1]
        return engine.advance(lanes, _without_step(spec, samples[onset:]))[0]

    mixture: Mixture | None = None
    for onset, width in onsets(spec, trail, change):
        mixture = mix(mixture, begun(onset), width)
    return mixed(spec, mixture)


def advance_steps(
    spec: EngineSpec, engine: Engine, lanes: FloatArray, packed: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Give lanes and innovations (2 * n_outputs, n_lanes) after one more packed sample, shape (n_sample,)."""
    following, innovations = engine.advance(lanes, relinearised(spec, packed[None, :]))
    return following, innovations[0]


def relinearised(spec: EngineSpec, samples: FloatArray) -> FloatArray:
    """Let filters that may be far from the truth linearise twice, and learn from nearly any innovation.

    `samples` are packed, (n, n_sample), and so is what is given.
    """
    again = samples.copy()
    again[:, spec.sample_fields["again"]] = 1.0
    again[:, spec.sample_fields["bound"]] = spec.thresholds.bank_bound
    return again


def renew_steps(spec: EngineSpec, engine: Engine, trail: Trail, bank: FloatArray) -> FloatArray:
    """Begin one filter per hypothesis again at the onset, from what the best of its filters has found by now.

    A filter that began far from the truth has linearised there, and may be stuck; the same samples, taken again from
    nearby, say more. It takes the place of the least likely filter of its hypothesis, if it is likelier. `bank` is
    (n_numbers, n_lanes), and so is what is given.
    """
    plan = plan_lanes(spec)
    best, worst = extremes(plan, bank[-1])
    starts = found_lanes(spec, plan, bank, best, trail.lanes[0][spec.parameter_slice])
    again = begin_near(spec, engine, trail, starts)
    better = _likelihoods(again) > _likelihoods(bank[:, worst])
    renewed = bank.copy()
    renewed[:, worst[better]] = again[:, better]
    return renewed


def renew_all_steps(spec: EngineSpec, engine: Engine, trail: Trail, bank: FloatArray) -> FloatArray:
    """Begin every filter that may come to lead again at the onset, from what it has found itself.

    These are the best of each hypothesis and, of hypotheses within reach of the best, all within reach of its best.
    What a filter has once linearised far from the truth stays in its covariance. It then follows the data too well, and
    over thousands of samples its likelihood passes that of filters which began nearer. It is kept as it was where the
    new beginning led astray. All others go on from the best of their hypothesis, as little likely as they were.
    `bank` is (n_numbers, n_lanes), and so is what is given.
    """
    plan, likelihoods = plan_lanes(spec), _likelihoods(bank)
    best, _ = extremes(plan, likelihoods)
    found = likelihoods[best]
    reach = np.where(found > np.max(found, initial=LOWEST) - IN_REACH, IN_REACH, 0.0)
    near = np.flatnonzero(likelihoods >= (found - reach)[plan.hypothesis])
    begun, stands_for = np.unique(_alike(spec, plan, bank, near), return_inverse=True)
    starts = found_lanes(spec, plan, bank, begun, trail.lanes[0][spec.parameter_slice])
    again = begin_near(spec, engine, trail, starts)[:, stands_for]
    kept = _likelihoods(again) > likelihoods[near] - ASTRAY
    renewed = bank.copy()
    renewed[:, near[kept]] = again[:, kept]
    far = np.setdiff1d(np.arange(plan.n_lanes), near)
    renewed[:-1, far] = renewed[:-1, best[plan.hypothesis[far]]]
    return renewed


def _alike(spec: EngineSpec, plan: LanePlan, bank: FloatArray, lanes: IntArray) -> IntArray:
    """Give for each of some lanes the likeliest of its hypothesis that found the same and begins in the same way."""
    place, found = spec.parameter_slice, lanes.copy()
    diagonal = [covariance_place(spec, k, k) for k in range(place.start, place.stop)]
    values, sds = bank[place], np.sqrt(np.maximum(bank[diagonal], 0.0))
    first: dict[tuple[int, bytes], list[int]] = {}
    for k in np.argsort(-_likelihoods(bank)[lanes], kind="stable"):
        lane = int(lanes[k])
        known = first.setdefault((int(plan.hypothesis[lane]), plan.jumps[lane].tobytes()), [])
        apart = [np.max(np.abs(values[:, lane] - values[:, other]) / (SAME * sds[:, other] + TINY)) for other in known]
        same = next((other for other, off in zip(known, apart, strict=True) if off <= 1.0), lane)
        found[k] = same
        if same == lane:
            known.append(lane)
    return found


def begin_near(spec: EngineSpec, engine: Engine, trail: Trail, starts: LanePlan) -> FloatArray:
    """Give the lanes (n_numbers, n_lanes) of starts that were found, as `begin_steps` does.

    A jump that is tied to its factor says much and is linearised: where a store jumps, the lane begins a second time,
    from what it then knows, and stays so unless that led astray.
    """
    lanes = begin_steps(spec, engine, trail, trail.alarmed, starts)
    jumping = np.flatnonzero(starts.jumps.any(axis=1))
    if len(jumping):
        closer = found_lanes(spec, starts, lanes, jumping, trail.lanes[0][spec.parameter_slice])
        again = begin_steps(spec, engine, trail, trail.alarmed, closer)
        kept = _likelihoods(again) > _likelihoods(lanes[:, jumping]) - ASTRAY
        lanes[:, jumping[kept]] = again[:, kept]
    return lanes


def _begin_lanes(
    spec: EngineSpec, engine: Engine, plan: LanePlan, healthy: FloatArray, sample: FloatArray
) -> FloatArray:
    """Give lanes predicted to the sample of the onset, before its measurements.

    The fault came at some moment since the sample before, so the states lie between those of a fault from that sample
    on (`early`) and of one that comes only now (`late`).
    """
    blind = sample[None, :].copy()
    blind[:, spec.sample_fields["use"]] = 0.0
    early, _ = engine.advance(suspect_lanes(spec, plan, healthy), blind)
    later, _ = engine.advance(healthy[:, None], blind)
    late = suspect_lanes(spec, plan, later[:, 0])
    n_x = len(spec.states)
    half = np.nan_to_num(0.5 * (early[:n_x] - late[:n_x]), nan=0.0, posinf=0.0, neginf=0.0)
    late[:n_x] += half
    for i in range(n_x):
        for j in range(i, n_x):
            late[covariance_place(spec, i, j)] += half[i] * half[j]
    return late


def _without_step(spec: EngineSpec, samples: FloatArray) -> FloatArray:
    """Let no time pass before the first of these samples: the lanes stand there already."""
    still = samples.copy()
    still[0, spec.sample_fields["dt"]] = 0.0
    still[0, spec.sample_fields["kick"]] = 0.0
    still[0, spec.sample_fields["gap"]] = 0.0
    return still


def _likelihoods(lanes: FloatArray) -> FloatArray:
    return np.where(np.isfinite(lanes[-1]), lanes[-1], LOWEST)


def mix(mixture: Mixture | None, lanes: FloatArray, width: float) -> Mixture:
    """Add lanes (n_numbers, n_lanes) of one more onset, which stands for `width` samples, to the mixture."""
    likelihood = _likelihoods(lanes)
    if mixture is None:
        return Mixture(lanes=lanes, best=likelihood, total=likelihood + np.log(width))
    better = likelihood > mixture.best
    return Mixture(
        lanes=np.where(better, lanes, mixture.lanes),
        best=np.where(better, likelihood, mixture.best),
        total=np.logaddexp(mixture.total, likelihood + np.log(width)),
    )


def mixed(spec: EngineSpec, mixture: Mixture | None) -> FloatArray:
    """Give the best onset of each lane, (n_numbers, n_lanes), with the mean likelihood over the onsets."""
    if mixture is None:
        raise AssertionError("there is always an onset to try")
    lanes = mixture.lanes.copy()
    lanes[-1] = mixture.total - np.log(spec.thresholds.history_samples)
    return lanes


def forget_slow_errors(spec: EngineSpec, numbers: FloatArray) -> FloatArray:
    """Begin the slow errors of a lane (n_numbers,) anew: near the alarm they already hold a part of the fault."""
    fresh = numbers.copy()
    full = unpack(spec, fresh[spec.covariance_slice])
    slow = spec.slow_slice
    fresh[slow] = 0.0
    full[slow, :] = 0.0
    full[:, slow] = 0.0
    full[slow, slow] = np.diag([error.sd**2 for error in spec.slow_errors])
    fresh[spec.covariance_slice] = pack(full)
    return fresh


def suspect_lanes(spec: EngineSpec, plan: LanePlan, healthy: FloatArray) -> FloatArray:
    """Give one lane per start: the suspects wide about their start, the rest as in `healthy` (n_numbers,)."""
    n, n_lanes = spec.n_joint, plan.n_lanes
    means = np.repeat(healthy[:n, None], n_lanes, axis=1)
    full = np.repeat(unpack(spec, healthy[spec.covariance_slice])[:, :, None], n_lanes, axis=2)
    for state, index, exponent, lanes in _jumps(spec, plan, healthy):
        k = spec.parameter_slice.start + index
        slope = exponent * healthy[state] / healthy[k]  # of the state by its factor: the rest is what the content says
        full[state, :, lanes] -= slope * full[k, :, lanes]
        full[:, state, lanes] -= slope * full[:, k, lanes]
    for index, parameter in enumerate(spec.parameters):
        lanes = np.flatnonzero(plan.suspected[index])
        k = spec.parameter_slice.start + index
        value, sd = plan.values[index, lanes], plan.sds[index, lanes]
        size = 1.0 if parameter.healthy == 0.0 else abs(healthy[k])
        full[k, :, lanes] = 0.0
        full[:, k, lanes] = 0.0
        full[k, k, lanes] = (sd * size) ** 2
        start = healthy[k] + value if parameter.healthy == 0.0 else healthy[k] * value
        means[k, lanes] = np.clip(start, parameter.lower, parameter.upper)
    for jump in _jumps(spec, plan, healthy):
        _jump(spec, plan, jump, healthy, means, full)
    rows, columns = np.triu_indices(n)
    rest = np.repeat(healthy[n + spec.n_packed :, None], n_lanes, axis=1)
    return np.concatenate([means, full[rows, columns], rest])


def _jumps(spec: EngineSpec, plan: LanePlan, healthy: FloatArray) -> Iterator[_Jump]:
    """Give the stores whose content goes on while their own parameter changes, and in which lanes."""
    factors = healthy[spec.parameter_slice]
    for state, item in enumerate(spec.states):
        for index, exponent in item.jumps:
            lanes = np.flatnonzero(plan.jumps[:, state] & plan.suspected[index])
            if spec.parameters[index].healthy and factors[index] and len(lanes):
                yield state, index, exponent, lanes


def _jump(
    spec: EngineSpec, plan: LanePlan, jump: _Jump, healthy: FloatArray, means: FloatArray, full: FloatArray
) -> None:
    """Let the effort or flow of a store jump with its suspect where its content goes on; changes `means`, `full`.

    The state x becomes x * factor**exponent, and as uncertain as the factor makes it. From a wide start it is left
    uncorrelated with the factor: linear correlation over so wide a start would fix the factor, wrongly, at the first
    measurement of x. From what was found (`plan.tied`) it goes with the factor, else the two could part for good.
    """
    state, index, exponent, lanes = jump
    k = spec.parameter_slice.start + index
    scale = (means[k, lanes] / healthy[k]) ** exponent
    full[state, :, lanes] *= scale[:, None]
    full[:, state, lanes] *= scale
    means[state, lanes] *= scale
    slope = exponent * means[state, lanes] / means[k, lanes]
    if plan.tied:
        full[state, :, lanes] += slope[:, None] * full[k, :, lanes]
        full[:, state, lanes] += slope * full[:, k, lanes]
    else:
        full[state, state, lanes] += slope**2 * full[k, k, lanes]
