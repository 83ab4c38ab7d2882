"""Method `classic` beside the plant: `step` and `finish`, pure functions on a state of numbers.

Each sample is filtered, the states are estimated in two ways and blended, each output is predicted and compared; from
the alarm on a model of every tested set does the same with parameters that it estimates.
Source: thesis 4.5.2, chapters 5 and 6.
"""

from dataclasses import replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.samples import Report, Sample, Status
from faultbond.contract.spec import EngineSpec
from faultbond.thesis.online.estimate import healthy_misfits, improve, start_factors
from faultbond.thesis.online.indices import add_error, exceeds, indices_of, trust_in_samples, weights_of
from faultbond.thesis.online.models import (
    FilteredSample,
    outputs_from_before,
    parameters_of,
    spread_parameters,
    states_from_before,
    states_from_samples,
)
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.prefilter import filtered
from faultbond.thesis.online.ranking import current_limits, noise_of, rank
from faultbond.thesis.online.settings import WORKING, Erratum
from faultbond.thesis.online.state import ClassicState, begin_anew

GAP = 20  # samples without any output after which the states are no longer known; longer where the prefilter is


def step(spec: EngineSpec, plan: ClassicPlan, state: ClassicState, sample: Sample) -> tuple[ClassicState, Report]:
    """Take one sample.

    Parameters
    ----------
    spec, plan : the model
    state : ClassicState
        Before the sample; not changed.
    sample : Sample
        Missing values are nan.

    Returns
    -------
    state, report : ClassicState, Report
        `expected`, `cusum` (the error index of each output) and `variance` (that of the sensors' noise) are of the
        sample half a parabola ago, `state.at`.
    """
    with np.errstate(all="ignore"):
        state = _received(spec, plan, state, sample)
        state = _filtered(spec, plan, state)
        if not np.isfinite(state.held_inputs).all():
            return _silent(spec, state, Status.WAITING)
        if not np.isfinite(state.frames).all():
            return _silent(spec, state, Status.STARTING)
        if state.running < 0:
            state = _begun(spec, plan, state)
            return _silent(spec, state, Status.STARTING)
        return _judged(spec, plan, _watched(spec, plan, state))


def _silent(spec: EngineSpec, state: ClassicState, status: Status) -> tuple[ClassicState, Report]:
    nothing = np.full(len(spec.outputs), np.nan)
    slow = np.full(len(spec.slow_errors), np.nan)
    none = np.zeros(len(spec.outputs), dtype=bool)
    report = Report(status=status, expected=nothing, variance=nothing, cusum=nothing, slow=slow, left_out=none)
    return replace(state, index=state.index + 1), report


def _received(spec: EngineSpec, plan: ClassicPlan, state: ClassicState, sample: Sample) -> ClassicState:
    """Put a sample into the window, and look for steps of inputs."""
    held = np.where(np.isfinite(sample.u), sample.u, state.held_inputs)
    moved = np.abs(held - state.held_inputs)
    peak = np.fmax(state.peak, np.abs(held))
    limits = np.array([max(item.step, item.step_part * peak[k]) for k, item in enumerate(spec.inputs)])
    return replace(
        state,
        time=sample.time,
        held_inputs=held,
        peak=peak,
        since_step=np.where(moved > limits, 0.0, state.since_step + sample.dt),
        raw=np.vstack([state.raw[1:], np.concatenate([sample.u, sample.y])]),
        raw_times=np.append(state.raw_times[1:], sample.time),
    )


def _filtered(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> ClassicState:
    """Filter the sample in the middle of the window; what is missing there is held, and marked."""
    centre = plan.delay
    if not np.isfinite(state.raw_times[centre]):
        return state
    settings = plan.settings
    noises = [*(item.noise for item in spec.inputs), *(item.noise for item in spec.outputs)]
    row = state.raw[centre].copy()
    relative = Erratum.BAND in settings.printed
    noise = noise_of(spec, plan, state)
    ratios = np.concatenate([np.full(len(spec.inputs), noise.mean()), noise])
    for k, points in enumerate(plan.points):
        if points > 1:
            first = centre - points // 2
            window = state.raw[first : first + points, k]
            band = ratios[k] if relative else settings.band * noises[k]
            row[k] = filtered(window, points // 2, band, relative=relative)
    present = np.isfinite(row)
    newest = np.where(present, row, state.frames[0])
    absent = 0 if present[len(spec.inputs) :].any() else state.absent + 1
    if absent > max(GAP, 2 * centre) and state.alarm < 0:
        state = begin_anew(state)
        newest = np.where(present, row, np.nan)
    return replace(
        state,
        frames=np.vstack([newest, state.frames[:-1]]),
        present=present.astype(float),
        absent=absent,
        at=float(state.raw_times[centre]),
    )


def _begun(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> ClassicState:
    """Begin with the states that several samples give."""
    moment = _moment(spec, plan, state, 1)
    starts = {item.name: item.start_mean for item in spec.states}
    otherwise = np.array([starts.get(name, 0.0) for name in plan.states], dtype=float)[:, None]
    states = np.repeat(states_from_samples(plan, moment, otherwise), plan.n_lanes, axis=1)
    return replace(
        state,
        running=0,
        spread_states=np.repeat(states[:, :1], len(spec.parameters), axis=1),
        states=states,
        samples_states=states,
        before_states=states,
        quiet_at=np.full_like(state.quiet_at, state.at),
    )


def _moment(spec: EngineSpec, plan: ClassicPlan, state: ClassicState, lanes: int) -> FilteredSample:
    """Give the newest filtered sample for the models of the first lanes."""
    parameters = parameters_of(spec, plan, state.healthy, state.factors[:, :lanes])
    return FilteredSample(dt=_interval(spec, plan, state), frames=state.frames, parameters=parameters)


def _interval(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> float:
    """Give the time from the filtered sample before to that in the middle of the window, s."""
    centre = plan.delay
    before = state.raw_times[centre - 1] if centre > 0 else np.nan
    if not np.isfinite(before):
        return spec.sample_time or 1.0
    return float(state.raw_times[centre] - before)


def _watched(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> ClassicState:
    """Estimate the states, predict the outputs and take their errors in, for all lanes that run.

    After the alarm the healthy model runs and one of each tested set; until then the healthy one, and with it those
    whose parameters are off by their declared accuracy.
    """
    testing = state.alarm >= 0
    own, past = _moment(spec, plan, state, plan.n_lanes if testing else 1), state.states
    moment = own
    if not testing:
        moment = replace(own, parameters=spread_parameters(spec, state.healthy))
        past = np.hstack([state.states[:, :1], state.spread_states])
    expected = outputs_from_before(plan, moment, past)
    before = states_from_before(plan, moment, past)
    samples = states_from_samples(plan, moment, before)
    samples = np.where(np.isfinite(samples), samples, past)
    before = np.where(np.isfinite(before), before, samples)
    if not testing:
        y, present = state.frames[0, len(spec.inputs) :], state.present[len(spec.inputs) :] > 0
        squares, counts = _mean_squares(state.squares, state.counts, y, present)
        state = replace(state, squares=squares, counts=counts)
    running = state.running + 1
    noise = float(noise_of(spec, plan, state).mean())
    trust = trust_in_samples(plan.settings, noise, plan.accuracy, running)
    states = trust * samples + (1.0 - trust) * before
    if not testing:
        state = _spread(spec, plan, state, expected, states)
        expected, before, samples, states, past = (item[:, :1] for item in (expected, before, samples, states, past))
    sums = add_error(plan.settings, state.sums[:, :, : states.shape[1]], *_errors(spec, plan, state, expected))
    state = replace(
        state,
        running=running,
        trust=trust,
        samples_states=_merged(state.samples_states, samples),
        before_states=_merged(state.before_states, before),
        states=_merged(state.states, states),
        rates=_merged(state.rates, (states - past) / own.dt),
        expected=_merged(state.expected, expected),
        index_before=indices_of(state.sums),
        sums=_merged(state.sums, sums),
    )
    return _estimated(spec, plan, state, own)


def _spread(
    spec: EngineSpec, plan: ClassicPlan, state: ClassicState, expected: FloatArray, states: FloatArray
) -> ClassicState:
    """Take in how far off the models are whose parameters are off: the model-error/signal ratio of each output."""
    off = expected[:, 1:] - expected[:, :1]
    size = np.sqrt(np.sum(np.where(np.isfinite(off), off, 0.0) ** 2, axis=1))
    measured, _, weight = _errors(spec, plan, state, expected)
    working = replace(plan.settings, printed=WORKING)
    sums = add_error(working, state.spread_sums[..., None], measured, size[:, None], weight)
    return replace(state, spread_states=states[:, 1:], spread_sums=sums[..., 0])


def _mean_squares(
    squares: FloatArray, counts: FloatArray, values: FloatArray, use: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Take the values that are used into their mean squares, and into the numbers of samples in these."""
    counts = counts + use
    return squares + np.where(use, (values**2 - squares) / np.maximum(counts, 1.0), 0.0), counts


def _merged(whole: FloatArray, part: FloatArray) -> FloatArray:
    """Give an array with its first lanes replaced."""
    return np.concatenate([part, whole[..., part.shape[-1] :]], axis=-1)


def _errors(
    spec: EngineSpec, plan: ClassicPlan, state: ClassicState, expected: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give the outputs, the error of each prediction, and the weight of each output.

    A model that has no prediction for a sample is wrong by all of it.
    """
    n_u = len(spec.inputs)
    measured = state.frames[0, n_u:]
    error = np.abs(measured[:, None] - expected)
    error = np.where(np.isfinite(error), error, np.abs(measured)[:, None])
    small = plan.settings.small * noise_of(spec, plan, state) * np.sqrt(state.squares)
    weight = weights_of(plan.settings, np.abs(measured), small)
    still = _settling(spec, plan, state)
    blanked = np.array([bool(still[list(item.direct_inputs)].any()) for item in spec.outputs], dtype=bool)
    return measured, error, np.where((state.present[n_u:] > 0) & ~blanked, weight, 0.0)


def _settling(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> BoolArray:
    """Tell which inputs have stepped so lately that what they reach may be off, (n_inputs,).

    A filtered step begins half a parabola early and ends as much late, besides the time that the actuator takes. An
    input that settles at once and is filtered as the outputs are needs no rest.
    """
    if Erratum.STEPS in plan.settings.printed:
        return np.zeros(len(spec.inputs), dtype=bool)
    filtered_ = np.array(plan.points[: len(spec.inputs)]) > 1
    settling = np.array([item.settling for item in spec.inputs])
    smear = 2.0 * plan.delay * _interval(spec, plan, state)
    return np.asarray((state.since_step < settling + smear) & ((settling > 0.0) | ~filtered_))


def _estimated(spec: EngineSpec, plan: ClassicPlan, state: ClassicState, moment: FilteredSample) -> ClassicState:
    """While healthy learn how large the misfits of the laws are; later estimate the parameters of all sets."""
    still = _settling(spec, plan, state)
    resting = np.array([bool(still[list(side.inputs)].any()) for side in plan.sides], dtype=bool)
    if state.alarm < 0:
        if state.running <= plan.settings.patience:
            return state
        misfits = healthy_misfits(plan, state, moment)
        squares, counts = _mean_squares(state.misfits, state.misfit_counts, misfits, np.isfinite(misfits) & ~resting)
        return replace(state, misfits=squares, misfit_counts=counts)
    if state.index - state.alarm <= plan.settings.patience:
        return state
    factors, covariance = improve(spec, plan, state, moment, resting)
    return replace(state, factors=factors, covariance=covariance)


def _judged(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> tuple[ClassicState, Report]:
    """Compare the error indices of the healthy model with their limits, raise the alarm, rank.

    The onset is taken to be when the leading output was last below half its limit.
    """
    index = indices_of(state.sums)[:, 0]
    limit = current_limits(spec, plan, state)
    warm = state.running >= spec.thresholds.warm_up_samples
    state = replace(state, quiet_at=np.where(index <= 0.5 * limit, state.at, state.quiet_at))
    detection, diagnosis = None, None
    if state.alarm >= 0:
        if (state.index - state.alarm) % int(core_settings()["DIAGNOSIS_EVERY"]) == 0:
            diagnosis = rank(spec, plan, state)
    elif warm:
        above = exceeds(plan.settings, index, state.index_before[:, 0], limit)
        if above.any():
            leading = int(np.argmax(np.where(above, index / limit, -np.inf)))
            detection = Detection(
                time=state.time,
                sample=state.index,
                change_time=float(state.quiet_at[leading]),
                signals=tuple(item.name for k, item in enumerate(spec.outputs) if above[k]),
            )
            state = _suspected(spec, plan, state)
            diagnosis = rank(spec, plan, state)
    status = Status.DIAGNOSING if state.alarm >= 0 else (Status.WATCHING if warm else Status.WARMING)
    report = Report(
        status=status,
        expected=state.expected[:, 0].copy(),
        variance=spec.output_noise**2,
        cusum=index,
        slow=np.full(len(spec.slow_errors), np.nan),
        left_out=np.zeros(len(spec.outputs), dtype=bool),
        detection=detection,
        diagnosis=diagnosis,
    )
    return replace(state, index=state.index + 1), report


def _suspected(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> ClassicState:
    """Let a model of every tested set begin, with the states that several samples give and no errors yet."""
    others = plan.n_lanes - 1
    states = np.concatenate([state.states[:, :1], np.repeat(state.samples_states[:, :1], others, axis=1)], axis=1)
    sums = state.sums.copy()
    sums[:, :, 1:] = 0.0
    factors, covariance = start_factors(spec, plan, state.healthy)
    return replace(
        state,
        alarm=state.index,
        states=states,
        sums=sums,
        factors=factors,
        covariance=covariance,
        rejected=np.zeros_like(state.rejected),
    )


def finish(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> Diagnosis | None:
    """Give the last diagnosis, if a fault was detected."""
    return rank(spec, plan, state) if state.alarm >= 0 else None
