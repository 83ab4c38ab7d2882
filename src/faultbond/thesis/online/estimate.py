"""Parameters of suspended components by recursive least squares on the two sides of their laws.

Misfit of a law, linear in the parameter of most: zero at the value sought. It is weighed by its size while the plant
was healthy. A parameter that does not act linearly is linearised anew at each sample (Gauss-Newton).
Source: thesis 6.2.2; 4.2.2 (signals on either side). Ours: weights, several suspects at once.
"""

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.thesis.online.models import FilteredSample, misfits_of, parameters_of, states_from_samples
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.settings import Erratum
from faultbond.thesis.online.state import ClassicState

STEP = 1e-6  # of a factor, for slopes
LARGEST = 0.3  # change of a factor by one sample
FLOOR = 1e-9  # of a slope; a misfit below that is rounding


def start_factors(spec: EngineSpec, plan: ClassicPlan, healthy: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give the factors of all suspects while healthy, and their covariance: a fault of the size of `change`."""
    chosen = plan.slots.astype(int)
    factors = np.append(healthy / np.array([item.scale for item in spec.parameters]), 0.0)
    change = np.array([item.change for item in spec.parameters] + [0.0])
    covariance = np.zeros((plan.n_slots, *chosen.shape))
    for slot in range(plan.n_slots):
        covariance[slot, slot] = change[chosen[slot]] ** 2
    return factors[chosen], covariance


def healthy_misfits(plan: ClassicPlan, state: ClassicState, moment: FilteredSample) -> FloatArray:
    """Give the misfit of each law by the healthy model, (n_sides,)."""
    return _misfits(plan, state, moment, 1)[:, 0]


def improve(
    spec: EngineSpec, plan: ClassicPlan, state: ClassicState, moment: FilteredSample, resting: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Take one sample into the estimates of all lanes.

    Parameters
    ----------
    spec, plan : the model
    state : with the blended states of this sample
    moment : the sample, with the parameters so far
    resting : laws that are left out, shape (n_sides,), as while an actuator settles

    Returns
    -------
    factors, covariance : (n_slots, n_lanes), (n_slots, n_slots, n_lanes)
    """
    lanes, slots = moment.n_lanes, plan.n_slots
    moved = STEP * (1.0 + np.abs(state.factors))
    stacked = np.concatenate(
        [parameters_of(spec, plan, state.healthy, item) for item in _moved(state.factors, moved)], axis=1
    )
    all_ = _misfits(plan, state, FilteredSample(dt=moment.dt, frames=moment.frames, parameters=stacked), 1 + slots)
    all_ = all_.reshape(len(plan.sides), 1 + slots, lanes)
    factors, covariance = state.factors.copy(), state.covariance.copy()
    for side in np.flatnonzero(~resting & (state.misfit_counts > 0)):
        slope = (all_[side, 1:] - all_[side, :1]) / moved
        _take(plan, state, int(side), all_[side, 0], slope, factors, covariance)
    return within_ranges(factors, covariance, *_ranges(spec, plan)), covariance


def within_ranges(factors: FloatArray, covariance: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Bring factors back into their ranges; the other suspects of a set follow, so that they still fit together.

    Parameters
    ----------
    factors : (n_slots, n_lanes)
    covariance : (n_slots, n_slots, n_lanes)
    lower, upper : (n_slots, n_lanes)
    """
    for slot in range(len(factors)):
        over = np.clip(factors[slot], lower[slot], upper[slot]) - factors[slot]
        if over.any():
            own = covariance[slot, slot]
            factors = factors + np.where(own > 0.0, covariance[slot] / np.where(own > 0.0, own, 1.0), 0.0) * over
    return np.clip(factors, lower, upper)


def _moved(factors: FloatArray, moved: FloatArray) -> list[FloatArray]:
    """Give the factors, then again with each slot moved a little."""
    found = [factors]
    for slot in range(len(factors)):
        other = factors.copy()
        other[slot] += moved[slot]
        found.append(other)
    return found


def _misfits(plan: ClassicPlan, state: ClassicState, moment: FilteredSample, times: int) -> FloatArray:
    lanes = moment.n_lanes // times
    states, rates = np.tile(state.states[:, :lanes], times), np.tile(state.rates[:, :lanes], times)
    if Erratum.SIGNALS in plan.settings.printed:
        states, rates = _propagated(plan, moment, states)
    return misfits_of(plan, moment, states, rates)


def _propagated(plan: ClassicPlan, moment: FilteredSample, otherwise: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give the states and rates that propagating samples gives, as printed."""
    earlier = FilteredSample(
        dt=moment.dt, frames=np.vstack([moment.frames[1:], moment.frames[-1:]]), parameters=moment.parameters
    )
    now, before = (states_from_samples(plan, item, otherwise) for item in (moment, earlier))
    return now, (now - before) / moment.dt


def _take(
    plan: ClassicPlan,
    state: ClassicState,
    side: int,
    misfit: FloatArray,
    slope: FloatArray,
    factors: FloatArray,
    covariance: FloatArray,
) -> None:
    """Take the misfit of one law into factors and covariance, in place."""
    usable = plan.used[side, : misfit.size] & np.isfinite(misfit) & np.isfinite(slope).all(axis=0)
    size = max(float(np.sqrt(state.misfits[side])), FLOOR * float(np.max(np.abs(slope[:, usable]), initial=0.0)))
    if size == 0.0 or not usable.any():
        return
    g = np.where(usable, slope / size, 0.0)
    spread = np.einsum("ijl,jl->il", covariance, g)
    gain = spread / (1.0 + np.einsum("il,il->l", g, spread))
    rest = np.where(usable, misfit / size, 0.0) + np.einsum("il,il->l", g, factors - state.factors)
    change = -gain * np.where(usable, rest, 0.0)
    over = np.max(np.abs(change) / (LARGEST * np.maximum(np.abs(factors), 1.0)), axis=0)
    factors += change / np.maximum(over, 1.0)
    covariance -= np.where(over <= 1.0, gain[:, None] * spread[None], 0.0)  # too far to trust the slopes: not yet sure


def _ranges(spec: EngineSpec, plan: ClassicPlan) -> tuple[FloatArray, FloatArray]:
    chosen = plan.slots.astype(int)
    lower = np.array([item.lower for item in spec.parameters] + [-np.inf])
    upper = np.array([item.upper for item in spec.parameters] + [np.inf])
    return lower[chosen], upper[chosen]
