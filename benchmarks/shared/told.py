"""A lane that is told of a fault: which parameter steps, and how far. The filters of the bank are told less."""

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, pack, unpack


def relinearised(spec: EngineSpec, samples: FloatArray) -> FloatArray:
    """Give packed samples (n, n_sample) as lanes of the bank take them: linearised twice, with a bound of their own."""
    again = samples.copy()
    again[:, spec.sample_fields["again"]] = 1.0
    again[:, spec.sample_fields["bound"]] = spec.thresholds.bank_bound
    return again


def without_slow_errors(spec: EngineSpec, lane: FloatArray) -> FloatArray:
    """Begin the slow errors of a lane (n_numbers,) anew."""
    fresh, slow = lane.copy(), spec.slow_slice
    full = unpack(spec, fresh[spec.covariance_slice])
    fresh[slow] = full[slow, :] = full[:, slow] = 0.0
    full[slow, slow] = np.diag(spec.slow_sizes**2)
    fresh[spec.covariance_slice] = pack(full)
    return fresh


def told_lane(
    spec: EngineSpec, healthy: FloatArray, name: str, factor: float, sd: float, *, kept: bool = False
) -> FloatArray:
    """Give the lane (n_numbers, 1) of a plant whose parameter has just stepped.

    Parameters
    ----------
    spec : the model
    healthy : float array, shape (n_numbers,)
        The lane before the fault.
    name : the parameter
    factor : by which it steps; added where it is 0 while healthy
    sd : of that factor
    kept : whether a store of that parameter keeps its content; else its effort or flow goes on

    The state x of a store that keeps its content becomes x times factor**exponent, and goes with the factor.
    """
    index = [item.name for item in spec.parameters].index(name)
    k, item, n = spec.parameter_slice.start + index, spec.parameters[index], spec.n_joint
    lane, full = healthy.copy(), unpack(spec, healthy[spec.covariance_slice])
    jumps = [(state, power) for state, of in enumerate(spec.states) for j, power in of.jumps if j == index]
    jumps = jumps if kept and item.healthy else []
    for state, power in jumps:  # what the state owes to its factor goes, the rest is what the content says
        slope = power * healthy[state] / healthy[k]
        full[state, :] -= slope * full[k, :]
        full[:, state] -= slope * full[:, k]
    full[k, :] = full[:, k] = 0.0
    full[k, k] = (sd * abs(healthy[k]) if item.healthy else sd) ** 2
    lane[k] = np.clip(healthy[k] * factor if item.healthy else healthy[k] + factor, item.lower, item.upper)
    for state, power in jumps:
        scale = (lane[k] / healthy[k]) ** power
        full[state, :] *= scale
        full[:, state] *= scale
        lane[state] *= scale
        slope = power * lane[state] / lane[k]
        full[state, :] += slope * full[k, :]
        full[:, state] += slope * full[:, k]
    lane[n : n + spec.n_packed] = pack(full)
    return lane[:, None]
