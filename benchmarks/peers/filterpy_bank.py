"""A bank of FilterPy's extended Kalman filters, as somebody builds it who knows the field and has our model at hand.

- The model is ours: the same step in time with the same slopes, the same noise of sensors and inputs, slow errors,
  accuracies, noise of a sensor whose input has just been stepped, and first states, solved from 20 samples.
- While healthy, one filter estimates states, slow errors, parameters and input noise. A two-sided CUSUM of its
  innovations (Page 1954; drift and clip as ours) raises the alarm at a limit that healthy runs decide.
- At the alarm one filter per set that faultbond tests (Magill 1965) begins from the healthy one as it stood where the
  CUSUM began to rise, and takes up the samples since then. The parameters of the set get a quarter of their declared
  change as standard deviation, and the states, which may have jumped, their own usual size. With wider parameters,
  or states that go on, or from the alarm on, it is worse (motor and circuit, seeds 300 to 305). Cost per suspect,
  group, and range of the parameters are ours.

It has no mixture of onsets, no several starts per parameter, no second linearisation, no bound on what the healthy
filter learns, and no alarm of slow errors. Weights are summed in logarithms, since those of `MMAEFilterBank` underflow.
All filters are predicted in one call of the model, which is faster; the filtering itself is FilterPy's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np
from filterpy.kalman import ExtendedKalmanFilter

from benchmarks.shared.play import EPSILON, passed, samples
from benchmarks.trust.figures import Watched
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import Candidate, Detection, Diagnosis, Suspect
from faultbond.contract.spec import EngineSpec, unpack
from faultbond.equations.step import StepModel
from faultbond.runtime.core import Core
from faultbond.simulate import Simulation

START_SAMPLES, DIAGNOSIS_EVERY = (round(core_settings()[name]) for name in ("START_SAMPLES", "DIAGNOSIS_EVERY"))
CHANGE_PART = 0.25  # sd of a suspected parameter, of its declared change


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reading:
    """One sample: s since the one before, the inputs then and now, the readings, and factors on their variances."""

    dt: float
    before: FloatArray
    u: FloatArray
    y: FloatArray
    scale: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Snapshot:
    """A filter at one sample: mean (n_joint,), covariance, solutions of implicit relations."""

    mean: FloatArray
    covariance: FloatArray
    implicit: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bank:
    """Filters, their solutions of implicit relations (n_z, n), log-likelihoods (n,), and the model for all of them."""

    spec: EngineSpec
    predict: ca.Function
    measure: ca.Function
    filters: tuple[ExtendedKalmanFilter, ...]
    implicit: FloatArray
    likelihood: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Alarm:
    """Where the sum crossed its limit (None: nowhere), where it began to rise, and the filter just before that.

    usual: root mean square of each state up to the alarm. peaks: largest sum at each sample.
    """

    sample: int | None
    change: int
    before: Snapshot
    usual: FloatArray
    signals: tuple[str, ...]
    peaks: FloatArray


def watch(
    model: StepModel,
    limit: float,
    spec: EngineSpec,
    core: Core,
    recording: Simulation,
    onset: float | None,
    until: float,
) -> Watched:
    """Pass a recording through the healthy filter, and from the alarm on through the bank.

    Parameters
    ----------
    model : the step model of the specification
    limit : of the CUSUM
    spec, core : what is tested, and what solves the start
    recording : what is watched
    onset : moment of the fault, s; None: there is none
    until : how long the bank runs after the alarm, s
    """
    readings = readings_of(spec, recording)
    start = start_of(spec, core, recording)
    alarm = wait(model, spec, readings, start, limit)
    before = alarm.peaks if onset is None else alarm.peaks[recording.time[: alarm.peaks.size] < onset]
    cusum = float(before.max(initial=0.0))
    if alarm.sample is None:
        return Watched(detection=None, diagnoses=(), cusum=cusum, slow=0.0)
    detection = Detection(
        time=float(recording.time[alarm.sample]),
        sample=alarm.sample,
        change_time=float(recording.time[alarm.change]),
        signals=alarm.signals,
    )
    bank, diagnoses = begin(model, spec, alarm.before, alarm.usual), []
    last = int(np.searchsorted(recording.time, detection.time + until + EPSILON)) - 1
    for k in range(alarm.change, last + 1):
        bank, _, _ = advance(bank, readings[k])
        if k == last or (k >= alarm.sample and (k - alarm.sample) % DIAGNOSIS_EVERY == 0):
            diagnoses.append(rank(bank, float(recording.time[k])))
    return Watched(detection=detection, diagnoses=tuple(diagnoses), cusum=cusum, slow=0.0)


def wait(model: StepModel, spec: EngineSpec, readings: Sequence[Reading], start: Snapshot, limit: float) -> Alarm:
    """Pass readings through the healthy filter until its CUSUM crosses the limit."""
    settings, n_y = spec.thresholds, len(spec.outputs)
    bank, trail = bank_of(model, spec, [start]), [start]
    sums, zero = np.zeros((2, n_y)), np.full((2, n_y), settings.warm_up_samples - 1)
    peaks = np.zeros(len(readings))
    for k in range(START_SAMPLES, len(readings)):
        bank, innovation, sd = advance(bank, readings[k])
        if k >= settings.warm_up_samples:
            score = np.clip(innovation / sd, -settings.cusum_clip, settings.cusum_clip)
            grown = np.maximum(sums + np.array([score, -score]) - settings.cusum_drift, 0.0)
            sums = np.where(readings[k].scale == 1.0, grown, sums)
            zero = np.where(sums <= 0.0, k, zero)
            peaks[k] = sums.max()
        if peaks[k] > limit:
            side, leading = np.unravel_index(int(np.argmax(sums)), sums.shape)
            change = max(int(zero[side, leading]), k - settings.history_samples, START_SAMPLES)
            return Alarm(
                sample=k,
                change=change,
                before=trail[change - START_SAMPLES],
                usual=_usual(spec, trail),
                signals=(spec.outputs[int(leading)].name,),
                peaks=peaks[: k + 1],
            )
        trail.append(_snapshot(bank))
    return Alarm(sample=None, change=0, before=start, usual=_usual(spec, trail), signals=(), peaks=peaks)


def _usual(spec: EngineSpec, trail: Sequence[Snapshot]) -> FloatArray:
    squares = np.array([item.mean[: len(spec.states)] ** 2 for item in trail])
    return np.asarray(np.sqrt(squares.mean(axis=0)))


def _snapshot(bank: Bank) -> Snapshot:
    only = bank.filters[0]
    return Snapshot(mean=only.x.copy(), covariance=only.P.copy(), implicit=bank.implicit[:, 0])


def bank_of(model: StepModel, spec: EngineSpec, snapshots: Sequence[Snapshot]) -> Bank:
    """Give filters that begin at some snapshots."""
    filters = []
    for snapshot in snapshots:
        made = ExtendedKalmanFilter(dim_x=spec.n_joint, dim_z=len(spec.outputs))
        made.x, made.P = snapshot.mean.copy(), snapshot.covariance.copy()
        made.predict_x = _leave  # the model predicts the means of all filters at once
        filters.append(made)
    return Bank(
        spec=spec,
        predict=model.predict.map(len(filters)),
        measure=model.measure.map(len(filters)),
        filters=tuple(filters),
        implicit=np.column_stack([snapshot.implicit for snapshot in snapshots]),
        likelihood=np.zeros(len(filters)),
    )


def _leave(_: object) -> None:
    """Predict nothing."""


def advance(bank: Bank, reading: Reading) -> tuple[Bank, FloatArray, FloatArray]:
    """Take one reading; the filters change.

    Parameters
    ----------
    bank : the filters
    reading : the sample

    Returns
    -------
    bank, innovations (n_outputs,) of its first filter, and their standard deviations; in units of the noise
    """
    spec, n = bank.spec, bank.spec.n_joint
    means, implicit = _predict(bank, reading)
    read, slopes, implicit = _called(bank.measure, means, _repeated(reading.u, means), implicit)
    unit, variances = spec.output_noise[:, None], np.diag(reading.scale)  # FilterPy inverts what it is given: no SI
    lower = np.array([item.lower for item in spec.parameters])
    upper = np.array([item.upper for item in spec.parameters])
    gained = np.zeros(len(bank.filters))
    for k, item in enumerate(bank.filters):
        slope, expected = slopes[:, k * n : (k + 1) * n] / unit, read[:, k] / spec.output_noise
        item.update(
            reading.y / spec.output_noise, _constant, _constant, R=variances, args=(slope,), hx_args=(expected,)
        )
        item.x[spec.parameter_slice] = np.clip(item.x[spec.parameter_slice], lower, upper)
        spread = np.linalg.slogdet(2.0 * np.pi * item.S)[1]
        gained[k] = -0.5 * (item.y @ item.SI @ item.y + spread)
    first = bank.filters[0]
    after = replace(bank, implicit=implicit, likelihood=bank.likelihood + gained)
    return after, first.y, np.sqrt(np.diag(first.S))


def _constant(_: object, value: FloatArray) -> FloatArray:
    """Give what the model said of all filters at once."""
    return value


def _predict(bank: Bank, reading: Reading) -> tuple[FloatArray, FloatArray]:
    """Move means and covariances to the sample; give the means (n_joint, n), and solutions of implicit relations."""
    spec, n_x, n = bank.spec, len(bank.spec.states), bank.spec.n_joint
    means = np.column_stack([item.x for item in bank.filters])
    moved, slopes, implicit = _called(
        bank.predict, means, _repeated(reading.before, means), bank.implicit, np.full((1, means.shape[1]), reading.dt)
    )
    stay, noise = _others(spec, reading.dt)
    means = np.concatenate([moved, (stay[:, None] * means)[n_x:]])
    for k, item in enumerate(bank.filters):
        item.F = np.concatenate([slopes[:, k * n : (k + 1) * n], np.diag(stay)[n_x:]])
        item.Q = noise
        item.x = means[:, k]
        item.predict()
    return means, implicit


def _called(function: ca.Function, *arguments: FloatArray) -> list[FloatArray]:
    return [np.asarray(item.full()) for item in function(*arguments)]


def _repeated(values: FloatArray, means: FloatArray) -> FloatArray:
    return np.repeat(values[:, None], means.shape[1], axis=1)


def _others(spec: EngineSpec, dt: float) -> tuple[FloatArray, FloatArray]:
    """Give what is left after dt of each coordinate that is no state, and the noise of all, (n_joint, n_joint)."""
    stay, noise = np.ones(spec.n_joint), np.zeros(spec.n_joint)
    noise[: len(spec.states)] = [item.noise**2 for item in spec.states]
    decay = np.exp(-dt / np.array([item.memory for item in spec.slow_errors], dtype=float))
    stay[spec.slow_slice], noise[spec.slow_slice] = decay, spec.slow_sizes**2 * (1.0 - decay**2)
    stay[spec.noise_slice] = 0.0
    noise[spec.noise_slice] = [spec.inputs[k].noise ** 2 for k in spec.noisy_inputs]
    return stay, np.diag(noise)


def readings_of(spec: EngineSpec, recording: Simulation) -> list[Reading]:
    """Give the samples of a recording; after a step of an input that settles, sensors that it reaches are noisy."""
    settling = np.array([item.settling for item in spec.inputs])
    since, peak, made = np.full(len(spec.inputs), np.inf), np.zeros(len(spec.inputs)), []
    before = recording.inputs[0]
    for sample in samples(recording):
        u, dt = sample.u, sample.dt
        peak = np.maximum(peak, np.abs(u))
        least = np.array([max(item.step, item.step_part * peak[k]) for k, item in enumerate(spec.inputs)])
        since = np.where(np.abs(u - before) > least, 0.0, since + dt)
        moving = since < settling
        unsettled = [bool(moving[list(item.direct_inputs)].any()) for item in spec.outputs]
        scale = np.where(unsettled, spec.thresholds.blank_factor, 1.0)
        made.append(Reading(dt=dt, before=before, u=u, y=sample.y, scale=scale))
        before = u
    return made


def start_of(spec: EngineSpec, core: Core, recording: Simulation) -> Snapshot:
    """Give the healthy filter after the first samples, as our monitor finds it."""
    monitor = passed(core, samples(recording)[:START_SAMPLES])
    lane, loops = monitor.numbers("healthy.lane"), spec.n_joint + spec.n_packed
    return Snapshot(
        mean=lane[: spec.n_joint],
        covariance=unpack(spec, lane[spec.covariance_slice]),
        implicit=lane[loops : loops + len(spec.loops)],
    )


def begin(model: StepModel, spec: EngineSpec, healthy: Snapshot, usual: FloatArray) -> Bank:
    """Give one filter per tested set, from the healthy one before the change; states are off by their usual size."""
    n_x = len(spec.states)
    snapshots = []
    for chosen in spec.hypotheses:
        covariance = healthy.covariance.copy()
        covariance[:n_x, :n_x] += np.diag(usual**2)
        for index in chosen:
            k, parameter = spec.parameter_slice.start + index, spec.parameters[index]
            size = abs(healthy.mean[k]) if parameter.healthy else 1.0
            covariance[k, :] = covariance[:, k] = 0.0
            covariance[k, k] = (CHANGE_PART * parameter.change * size) ** 2
        snapshots.append(replace(healthy, covariance=covariance))
    return bank_of(model, spec, snapshots)


def rank(bank: Bank, time: float) -> Diagnosis:
    """Give the ranked sets, best first."""
    spec = bank.spec
    sizes = np.array([len(chosen) for chosen in spec.hypotheses])
    score = np.nan_to_num(bank.likelihood, nan=-1e300) - spec.thresholds.cost_per_suspect * sizes
    weight = np.exp(score - score.max())
    probability = weight / weight.sum()
    candidates = tuple(
        Candidate(
            suspects=tuple(_suspect(bank, int(k), index) for index in spec.hypotheses[k]),
            probability=float(probability[k]),
            group=bool(score[k] >= score.max() - spec.thresholds.group_nats),
        )
        for k in np.argsort(-score, kind="stable")
    )
    return Diagnosis(time=time, candidates=candidates)


def _suspect(bank: Bank, hypothesis: int, index: int) -> Suspect:
    parameter, item = bank.spec.parameters[index], bank.filters[hypothesis]
    k = bank.spec.parameter_slice.start + index
    return Suspect(
        parameter=parameter.name,
        component=parameter.component,
        nominal=parameter.nominal,
        estimate=float(parameter.scale * item.x[k]),
        sd=float(abs(parameter.scale) * np.sqrt(max(item.P[k, k], 0.0))),
    )
