"""Parameters of suspended components by recursive least squares on the two sides of their laws.

Misfit of a law, linear in the parameter of most: zero at the value sought. It is weighed by its size while the plant
was healthy. A parameter that does not act linearly is linearised anew at each sample (Gauss-Newton).
Source: thesis 6.2.2; 4.2.2 (signals on either side). Ours: weights, several suspects at once.
"""

from dataclasses import replace

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
    """Give the factors of all suspects while healthy, and their covariance: a fault of the size of `change`.

    healthy: (n_parameters,), SI. Shapes: (n_slots, n_lanes), (n_slots, n_slots, n_lanes).
    """
    chosen = plan.slots.astype(int)
    factors = np.append(healthy / np.array([item.scale for item in spec.parameters]), 0.0)
    change = np.array([item.change for item in spec.parameters] + [0.0])
    covariance = np.zeros((plan.n_slots, *chosen.shape))
    for slot in range(plan.n_slots):
        covariance[slot, slot] = change[chosen[slot]] ** 2
    return factors[chosen], covariance


def healthy_misfits(plan: ClassicPlan, state: ClassicState, moment: FilteredSample) -> FloatArray:
    """Give the misfit of each law by the healthy model, (n_sides,), SI."""
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
    steps = STEP * (1.0 + np.abs(state.factors))
    moved = np.repeat(state.factors[None], 1 + slots, axis=0)  # the factors, then again with each slot moved a little
    for slot in range(slots):
        moved[1 + slot, slot] += steps[slot]
    stacked = np.concatenate([parameters_of(spec, plan, state.healthy, item) for item in moved], axis=1)
    misfits = _misfits(plan, state, replace(moment, parameters=stacked), 1 + slots)
    misfits = misfits.reshape(len(plan.sides), 1 + slots, lanes)
    factors, covariance = state.factors.copy(), state.covariance.copy()
    for side in np.flatnonzero(~resting & (state.misfit_counts > 0)):
        misfit, slope = misfits[side, 0], (misfits[side, 1:] - misfits[side, :1]) / steps
        usable = plan.used[side, :lanes] & np.isfinite(misfit) & np.isfinite(slope).all(axis=0)
        size = max(float(np.sqrt(state.misfits[side])), FLOOR * float(np.max(np.abs(slope[:, usable]), initial=0.0)))
        if size == 0.0 or not usable.any():
            continue
        g = np.where(usable, slope / size, 0.0)
        spread = np.einsum("ijl,jl->il", covariance, g)
        gain = spread / (1.0 + np.einsum("il,il->l", g, spread))
        rest = np.where(usable, misfit / size, 0.0) + np.einsum("il,il->l", g, factors - state.factors)
        change = -gain * np.where(usable, rest, 0.0)
        over = np.max(np.abs(change) / (LARGEST * np.maximum(np.abs(factors), 1.0)), axis=0)
        factors += change / np.maximum(over, 1.0)
        # Where it is too far to trust the slopes, the estimate is not yet sure.
        covariance -= np.where(over <= 1.0, gain[:, None] * spread[None], 0.0)
    chosen = plan.slots.astype(int)
    lower = np.array([item.lower for item in spec.parameters] + [-np.inf])[chosen]
    upper = np.array([item.upper for item in spec.parameters] + [np.inf])[chosen]
    return within_ranges(factors, covariance, lower, upper), covariance


def within_ranges(factors: FloatArray, covariance: FloatArray, lower: FloatArray, upper: FloatArray) -> FloatArray:
    """Bring factors back into their ranges; the other suspects of a set follow, so that they still fit together.

    Parameters
    ----------
    factors : (n_slots, n_lanes), parameters over their scale
    covariance : (n_slots, n_slots, n_lanes)
    lower, upper : (n_slots, n_lanes)
    """
    for slot in range(len(factors)):
        over = np.clip(factors[slot], lower[slot], upper[slot]) - factors[slot]
        if over.any():
            own = covariance[slot, slot]
            factors = factors + np.where(own > 0.0, covariance[slot] / np.where(own > 0.0, own, 1.0), 0.0) * over
    return np.clip(factors, lower, upper)


def _misfits(plan: ClassicPlan, state: ClassicState, moment: FilteredSample, times: int) -> FloatArray:
    """Give the misfit of each law (n_sides, n_lanes), of lanes that stand there so many times.

    As printed, from the states and rates that propagating samples gives.
    """
    lanes = moment.n_lanes // times
    states, rates = np.tile(state.states[:, :lanes], times), np.tile(state.rates[:, :lanes], times)
    if Erratum.SIGNALS in plan.settings.printed:
        earlier = replace(moment, frames=np.vstack([moment.frames[1:], moment.frames[-1:]]))
        now, before = (states_from_samples(plan, item, states) for item in (moment, earlier))
        states, rates = now, (now - before) / moment.dt
    return misfits_of(plan, moment, states, rates)
