"""Sets that are too many to be tested at once: which of them to test later, and what is missed by not testing the rest.

A lane knows more than its own set: every other parameter j has a narrow prior N(m, a^2) in it and a posterior N(p, v).
What the data say of j beside this set is therefore known, an information l = 1/v - 1/a^2 about a change d, and so is
how much likelier the data are if j is a suspect too, with the wide prior N(m, w^2) of one:

    log (likelihood with j / without) = (log (1 + l a^2) - log (1 + l w^2)
                                         + d^2 l (1 / (1 + l a^2) - 1 / (1 + l w^2))) / 2,      d = (p - m) / (v l)

exactly so where the plant is linear. The likeliest sets of the reserve are then tested in lanes of their own.
Source: the ratio of evidences of nested Gaussian models, Kass and Raftery, J. American Statistical Association 90
(1995) 773.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.lanes import START_SPREAD, LanePlan
from faultbond.contract.spec import Engine, EngineSpec, covariance_place
from faultbond.runtime.stepped import begin_near
from faultbond.runtime.trail import Trail

GROWN = 32  # sets of the reserve that are tested
PER_SET = (
    3  # lanes of each: two from the closed form (effort or flow goes on, or content does), one from healthy values
)
NEUTRAL_SD = 0.6  # of the last, in healthy factors
_LEAST_SD = 0.1


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tested:
    """Sets that have lanes: their likelihoods (n,), and of their best lanes all parameters (n, n_parameters)."""

    sets: tuple[tuple[int, ...], ...]
    likelihood: FloatArray
    mean: FloatArray
    variance: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Extended:
    """Of each set of the reserve its likelihood by the closed form, (n,), and values of all parameters, (n, n_p)."""

    likelihood: FloatArray
    values: FloatArray


def n_grown(spec: EngineSpec) -> int:
    """Give the number of sets of the reserve that can be tested."""
    return min(GROWN, len(spec.reserve))


def factors(spec: EngineSpec, lanes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give means and variances of the parameters of lanes (n_numbers, n), shape (n, n_parameters) each."""
    places = range(spec.parameter_slice.start, spec.parameter_slice.stop)
    return lanes[spec.parameter_slice].T, lanes[[covariance_place(spec, k, k) for k in places]].T


def extend(spec: EngineSpec, tested: Tested, healthy: FloatArray) -> Extended:
    """Give the sets of the reserve as tested ones with one more suspect, each from the best of those it may come from.

    Parameters
    ----------
    spec : the model
    tested : sets that have lanes
    healthy : float array, shape (n_numbers,)
        The healthy lane before the fault.
    """
    (mean,), (variance,) = factors(spec, healthy[:, None])
    size = np.array([abs(m) if item.healthy else 1.0 for m, item in zip(mean, spec.parameters, strict=True)])
    wide = (size * np.array([item.change for item in spec.parameters])) ** 2
    gain, change = _gains(tested, mean, variance, wide)
    place = {chosen: k for k, chosen in enumerate(tested.sets)}
    likelihood, values = np.full(len(spec.reserve), -np.inf), np.tile(mean, (len(spec.reserve), 1))
    for row, chosen in enumerate(spec.reserve):
        for index in chosen:
            k = place.get(tuple(i for i in chosen if i != index))
            if k is not None and tested.likelihood[k] + gain[k, index] > likelihood[row]:
                likelihood[row] = tested.likelihood[k] + gain[k, index]
                values[row] = tested.mean[k]
                values[row, index] = mean[index] + change[k, index]
    return Extended(likelihood=likelihood, values=values)


def _gains(tested: Tested, mean: FloatArray, variance: FloatArray, wide: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give what a further suspect would add to the likelihood of each set, and its change; (n, n_parameters) each."""
    information = np.maximum(1.0 / tested.variance - 1.0 / variance, 1e-9 / variance)
    change = (tested.mean - mean) / (tested.variance * information)
    narrow, broad = 1.0 + information * variance, 1.0 + information * wide
    fit = change**2 * information * (1.0 / narrow - 1.0 / broad)
    gain = 0.5 * (np.log(narrow) - np.log(broad) + fit)
    return np.nan_to_num(gain, nan=-np.inf), np.clip(change, -(wide**0.5), wide**0.5)


def grow(
    spec: EngineSpec,
    engine: Engine,
    trail: Trail,
    extended: Extended,
    before: FloatArray,
    grown: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Give lanes (n_numbers, PER_SET * n_grown) of the likeliest sets of the reserve, and which these are (n_grown,).

    A set that has lanes already counts by what they say, begins again from there, and keeps those that are likelier.

    Parameters
    ----------
    spec, engine : the model
    trail : Trail
        The lanes have seen all its samples.
    extended : what the closed form says of the sets
    before, grown : the lanes so far, and which sets they are of
    """
    likelihood, values = extended.likelihood.copy(), extended.values.copy()
    found = np.where(np.isfinite(before[-1]), before[-1], -np.inf).reshape(-1, PER_SET)
    place = {int(k): row for row, k in enumerate(grown) if k >= 0 and np.any(found[row] > -np.inf)}
    for k, row in place.items():
        likelihood[k] = found[row].max()
        values[k] = before[spec.parameter_slice, PER_SET * row + int(np.argmax(found[row]))]
    chosen = np.argsort(spec.reserve_costs - likelihood, kind="stable")[: n_grown(spec)]
    plan = _plan(spec, [spec.reserve[k] for k in chosen], values[chosen], trail.lanes[0][spec.parameter_slice])
    lanes = begin_near(spec, engine, trail, plan)
    for row, k in enumerate(chosen):
        if int(k) in place:
            new, old = (slice(PER_SET * at, PER_SET * (at + 1)) for at in (row, place[int(k)]))
            lanes[:, new] = np.where(lanes[-1, new] > found[place[int(k)]], lanes[:, new], before[:, old])
    return lanes, chosen.astype(np.float64)


def _plan(spec: EngineSpec, sets: list[tuple[int, ...]], values: FloatArray, healthy: FloatArray) -> LanePlan:
    """Give a plan of PER_SET lanes for each set, which start at these factors, (n_sets, n_parameters)."""
    shape = (len(spec.parameters), PER_SET * len(sets))
    suspected, jumps = np.zeros(shape, dtype=bool), np.zeros((shape[1], len(spec.states)), dtype=bool)
    for row, chosen in enumerate(sets):
        suspected[list(chosen), PER_SET * row : PER_SET * (row + 1)] = True
        jumps[PER_SET * row + 1] = [any(index in chosen for index, _ in state.jumps) for state in spec.states]
    additive = np.array([not item.healthy for item in spec.parameters])
    starts = np.where(additive, values - healthy, values / np.where(additive | (healthy == 0.0), 1.0, healthy))
    starts = np.repeat(starts.T, PER_SET, axis=1)
    spread = np.maximum(START_SPREAD * np.abs(starts), _LEAST_SD)
    changes = np.array([item.change for item in spec.parameters])
    starts[:, 2::PER_SET] = np.where(additive, 0.0, 1.0)[:, None]
    spread[:, 2::PER_SET] = np.where(additive, changes, np.minimum(changes, NEUTRAL_SD))[:, None]
    hypothesis: IntArray = np.repeat(np.arange(len(sets), dtype=np.intp), PER_SET)
    return LanePlan(
        hypothesis=hypothesis,
        suspected=suspected,
        values=np.where(suspected, starts, 1.0),
        sds=np.where(suspected, spread, 0.0),
        jumps=jumps,
        first=np.arange(0, shape[1], PER_SET, dtype=np.intp),
        sizes=np.array([len(chosen) for chosen in sets], dtype=np.float64),
    )
