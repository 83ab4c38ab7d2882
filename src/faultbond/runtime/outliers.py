"""The first samples without their wild values, and the start of the plant from the others.

Before the filter runs nothing is known of what the sensors and inputs usually show. So the first samples judge each
other: a reading is wild if it lies far from the start that all others are fitted with, and of an input that leaves the
others for a moment the readings decide whether it did. Huber and Ronchetti, *Robust Statistics*, 2009.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime.packing import pack_sample
from faultbond.runtime.start import RUN_AWAY, misfits, solve_start
from faultbond.runtime.state import Sample, State, init
from faultbond.runtime.wild import SPIKE, TELLING, said_for_second

FAR = 10.0  # sd of its noise, or usual misfits, that a reading may lie from the start that the others give
APART = 3.0  # usual distances from the middle that an input may lie from it
MOST = 0.45  # part of the values of a column that may be wild; where more are, the model is off
SHORT = 0.25  # part of an input's values that is held for wild also where the readings do not tell
HUBER = 1.5  # usual misfits from which on a reading counts less,
PASSES = 5  # and how often such weights are found anew
SPIKES = 3  # values of an input that are tried as off for one sample, where a misfit may be due to that
USUAL = 1.5  # median misfits that are one sd


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Begun:
    """Where the plant began, and the first samples without what was wild.

    state : State
        With what these samples tell of the inputs.
    samples : float array, shape (n_samples, n_sample)
    mean, covariance : of the states before the first sample, SI
    wild : number of values that were taken out
    """

    state: State
    samples: FloatArray
    mean: FloatArray
    covariance: FloatArray
    wild: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fit:
    """A start, how far the readings are from it (sd, all that are there), and which of them are not used."""

    samples: FloatArray
    mean: FloatArray
    covariance: FloatArray
    misfit: FloatArray
    left_out: BoolArray


def begin(
    spec: EngineSpec, engine: Engine, state: State, samples: FloatArray, known: FloatArray | None, *, again: bool
) -> Begun:
    """Solve the start from the first samples, with the wild values among them missing.

    Parameters
    ----------
    spec, engine : the model
    state : State
        After the last of the samples; `begun` is the number of the first.
    samples : float array, shape (n_samples, n_sample)
        Packed.
    known, again : see `faultbond.runtime.start.solve_start`
    """
    refused, scale = np.zeros((len(samples), len(spec.inputs)), dtype=bool), spec.sample_fields["scale"]
    fit = _fitted(spec, engine, samples, known, again=again)
    off = np.any(fit.misfit > SPIKE) and not _runs_away(spec, fit)
    strays, spikes = list(_strays(spec, samples)), _spikes(spec, samples) if off else ()
    for column, first, last in dict.fromkeys([*strays, *spikes]):
        without = refused.copy()
        without[first : last + 1, column] = True
        other_state, other = _packed_again(spec, state, samples, without)
        trial = _fitted(spec, engine, other, known, again=again)
        same = fit.samples[:, scale] == trial.samples[:, scale]  # no more blanked in one past than in the other
        gain = said_for_second(fit.misfit, trial.misfit, same)
        ends = last == len(samples) - 1
        short = last - first < SHORT * len(samples)
        unseen = (column, first, last) in strays and short and (not ends or first == last)
        if gain > (-TELLING if unseen else TELLING):
            refused, fit, kept = without, trial, other_state
    if refused.any():
        odd = np.where(refused[-1], samples[-1, spec.sample_fields["u"]], np.nan)
        state = replace(kept, inputs=replace(kept.inputs, odd=odd, odd_since=state.clock.index))
        refused[-1] = False  # whether that one is wild, the next sample tells
    return Begun(
        state=state,
        samples=fit.samples,
        mean=fit.mean,
        covariance=fit.covariance,
        wild=int(fit.left_out.sum() + refused.sum()),
    )


def _fitted(spec: EngineSpec, engine: Engine, samples: FloatArray, known: FloatArray | None, *, again: bool) -> _Fit:
    """Fit the start to all readings, and if some lie far off, anew without those that are far from a robust fit."""
    there = samples[:, spec.sample_fields["use"]] > 0
    nothing = np.zeros_like(there)
    first = _fit(spec, engine, samples, nothing, np.ones(there.shape), known, again=again)
    if np.max(first.misfit, initial=0.0) <= FAR or _runs_away(spec, first):
        return first
    alone, fit = _alone(spec, samples), first
    weighted = np.where(alone, 1.0, np.maximum(1.0, first.misfit / HUBER))
    for _ in range(PASSES):  # Huber's weights, as a larger variance
        fit = _fit(spec, engine, samples, alone, weighted, known, again=again)
        weighted = np.maximum(1.0, fit.misfit / (HUBER * _usual(fit.misfit, there)))
    far = there & (fit.misfit > FAR * _usual(fit.misfit, there))
    far &= far.sum(axis=0) <= MOST * there.sum(axis=0)
    return _fit(spec, engine, samples, far, np.ones(there.shape), known, again=again) if far.any() else first


def _fit(
    spec: EngineSpec,
    engine: Engine,
    samples: FloatArray,
    left_out: BoolArray,
    weighted: FloatArray,
    known: FloatArray | None,
    *,
    again: bool,
) -> _Fit:
    """Fit the start without some readings, others with a variance that is so many times larger."""
    place = spec.sample_fields
    used, trial = samples.copy(), samples.copy()
    used[:, place["use"]] = (samples[:, place["use"]] > 0) & ~left_out
    trial[:, place["use"]] = used[:, place["use"]]
    trial[:, place["scale"]] *= weighted
    mean, covariance = solve_start(spec, engine, trial, known, again=again)
    misfit = np.abs(misfits(spec, engine, samples, mean, known))
    return _Fit(samples=used, mean=mean, covariance=covariance, misfit=misfit, left_out=left_out)


def _runs_away(spec: EngineSpec, fit: _Fit) -> bool:
    """Whether the plant runs away from everywhere, so that no reading is to blame."""
    return bool(np.all(fit.misfit[fit.samples[:, spec.sample_fields["use"]] > 0] == RUN_AWAY))


def _usual(misfit: FloatArray, used: BoolArray) -> FloatArray:
    """Give the usual misfit of each sensor, (n_outputs,), in sd; 1 or more."""
    columns = zip(misfit.T, used.T, strict=True)
    return np.array(
        [max(1.0, USUAL * float(np.median(each[chosen]))) if chosen.any() else 1.0 for each, chosen in columns]
    )


def _alone(spec: EngineSpec, samples: FloatArray) -> BoolArray:
    """Tell which readings are so far from all others that not even a fit should see them, (n_samples, n_outputs)."""
    y, there = samples[:, spec.sample_fields["y"]], samples[:, spec.sample_fields["use"]] > 0
    found = np.zeros_like(there)
    for k, noise in enumerate(spec.output_noise):
        apart, usual = _distances(y[:, k], there[:, k], MOST)
        found[:, k] = there[:, k] & (apart > FAR * max(usual, noise))
    return found


def _distances(values: FloatArray, there: BoolArray, most: float) -> tuple[FloatArray, float]:
    """Give how far values are from the middle of those that are there, and how far all but a part of these are."""
    if not there.any():
        return np.zeros(len(values)), 0.0
    apart = np.abs(values - np.median(values[there]))
    return apart, float(np.sort(apart[there])[int((1.0 - most) * np.count_nonzero(there))])


def _strays(spec: EngineSpec, samples: FloatArray) -> Iterator[tuple[int, int, int]]:
    """Give column, first and last sample of each run in which an input leaves its other values."""
    place, whole = spec.sample_fields["u"], len(samples)
    everywhere = np.ones(whole, dtype=bool)
    for column, item in enumerate(spec.inputs):
        for least, most in ((0.0, SHORT), (SHORT, MOST)):
            apart, usual = _distances(samples[:, place][:, column], everywhere, most)
            stray = apart > APART * max(usual, item.noise)
            edges = np.flatnonzero(np.diff(stray, prepend=False, append=False))
            for first, end in edges.reshape(-1, 2).tolist():
                if least * whole <= end - first < most * whole:
                    yield column, first, end - 1


def _spikes(spec: EngineSpec, samples: FloatArray) -> Iterator[tuple[int, int, int]]:
    """Give column and sample, as first and last, of the values of each input that stand out most from both beside."""
    inputs = samples[:, spec.sample_fields["u"]]
    for column, u in enumerate(inputs.T):
        before, after = np.r_[u[1], u[:-1]], np.r_[u[1:], u[-2]]
        apart = np.abs(u - 0.5 * (before + after)) - np.abs(before - after)
        for k in np.argsort(-apart)[:SPIKES]:
            if apart[k] > 0.0 and 0 < k < len(u) - 1:
                yield column, int(k), int(k)


def _packed_again(spec: EngineSpec, state: State, samples: FloatArray, refused: BoolArray) -> tuple[State, FloatArray]:
    """Pack the first samples anew as if the refused inputs had been missing, and give the state after them."""
    place, fresh = spec.sample_fields, init(spec)
    forgotten = ("held", "lowest", "highest", "leap", "guessed", "habit", "since_step", "change")
    inputs = replace(state.inputs, **{name: getattr(fresh.inputs, name) for name in forgotten})
    past, clock = replace(state, inputs=inputs), replace(state.clock, silent=0)
    told = np.where(refused, np.nan, samples[:, place["u"]])
    for column in told.T:  # before the first value that is good, that holds
        good = np.flatnonzero(np.isfinite(column))
        column[: good[0]] = column[good[0]]
    rows = np.zeros_like(samples)
    for k, old in enumerate(samples):
        y = np.where(old[place["use"]] > 0, old[place["y"]], np.nan)
        sample = Sample(time=clock.time, dt=float(old[place["dt"]][0]), u=told[k], y=y)
        u = np.where(np.isfinite(told[k]), told[k], past.inputs.held)
        past = replace(past, clock=replace(clock, index=state.clock.begun + k))
        rows[k], past = pack_sample(spec, past, sample, u)
        rows[k, place["gap"]] = old[place["gap"]]
        clock = past.clock
    return replace(past, clock=replace(clock, index=state.clock.index)), rows
