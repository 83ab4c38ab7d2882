"""One sample of the joint filter as a CasADi SX graph, for machines without a compiler, and to check the core by.

Extended Kalman filter over [states, slow errors, parameter factors, input noise]. Covariance as a packed triangle (it
cannot become asymmetric), measurements one at a time (no matrix inverse), a second measurement iteration where the
readings are not linear. The log-likelihood is that of the first iteration. Thesis 6.2 estimates parameters by least
squares on propagated signals; the joint filter replaces it, since that estimate is biased by noise in the regressors.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import casadi as ca
import numpy as np

from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel

_NO_BOUND = 1e6  # standard deviations
_SAYS_MUCH = 0.1  # variance of what a sensor is expected to read, in that of its noise, from which a sample says much
LOG_2_PI = float(np.log(2.0 * np.pi))


def build_filter(spec: EngineSpec, model: StepModel) -> ca.Function:
    """Give the function (lane, sample) -> (lane, innovations) of one sample of one lane.

    Parameters
    ----------
    spec : what a lane holds
    model : the plant in discrete time; with an error of every input where lanes have a slot
    """
    lane = ca.SX.sym("lane", spec.n_numbers)
    sample = ca.SX.sym("sample", spec.n_sample)
    fields = {name: sample[place] for name, place in spec.sample_fields.items()}
    view = LanePlant(spec=spec, model=model, roles={name: lane[place] for name, place in spec.role_fields.items()})
    mean = lane[: spec.n_joint]
    triangle, covariance = lane[spec.covariance_slice], ca.SX(spec.n_joint, spec.n_joint)
    for k, (i, j) in enumerate(combinations_with_replacement(range(spec.n_joint), 2)):
        covariance[i, j] = covariance[j, i] = triangle[k]
    implicit, likelihood = lane[spec.loop_slice], lane[-1]

    mean, covariance, implicit = _time_update(view, mean, covariance, implicit, fields)
    mean, covariance, implicit, gain, innovations = _measurement_update(view, mean, covariance, implicit, fields)
    packed = [covariance[i, j] for i, j in combinations_with_replacement(range(spec.n_joint), 2)]
    roles = lane[spec.loop_slice.stop : -1]
    result = ca.vertcat(mean, *packed, implicit, roles, likelihood + gain)
    return ca.Function(
        "filter_step",
        [lane, sample],
        [ca.densify(result), ca.densify(innovations)],
        ["lane", "sample"],
        ["lane_next", "innovations"],
        {"cse": True},
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LanePlant:
    """The plant as a lane sees it: values and slopes by the joint vector z, with the fault in the slot at work."""

    spec: EngineSpec
    model: StepModel
    roles: dict[str, ca.SX]  # empty without a slot

    def predict(self, z: ca.SX, u: ca.SX, implicit: ca.SX, dt: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Give the states after `dt`, their slopes by z, and the implicit signals."""
        x, slope, implicit = self.model.predict(self._joint(z), u, implicit, dt)
        return x, self._slope(slope), implicit

    def measure(self, z: ca.SX, u: ca.SX, implicit: ca.SX) -> tuple[ca.SX, ca.SX, ca.SX]:
        """Give the readings, their slopes by z, and the implicit signals."""
        plain, by, implicit = self.model.measure(self._joint(z), u, implicit)
        slope = self._slope(by)
        if not self.roles:
            return plain, slope, implicit
        place, n_y = self.spec.slot_slice.start, len(self.spec.outputs)
        size = z[place]
        factor = self.roles["reads"] + self.roles["gain"] * size
        reading = plain * factor + self.roles["bias"] * size
        own = ca.SX(n_y, self.spec.n_joint)
        own[:, place] = self.roles["bias"] + self.roles["gain"] * plain
        return reading, ca.diag(factor) @ slope + own, implicit

    def noise(self, output: int, scale: ca.SX) -> ca.SX:
        """Give the noise variance of an output at a sample; while it is blanked, whatever noise it has is nothing."""
        declared = self.spec.outputs[output].noise ** 2 * scale[output]
        if not self.roles:
            return declared
        return declared * ca.if_else(scale[output] < self.spec.thresholds.blank_factor, self.roles["noise"][output], 1)

    @property
    def is_linear(self) -> bool:
        """Whether the readings are linear in z, so that a second update says nothing new."""
        return self.model.measure_is_linear and not self.roles

    def _joint(self, z: ca.SX) -> ca.SX:
        """Give the vector v of the step model."""
        if not self.roles:
            return z
        spec = self.spec
        size = z[spec.slot_slice.start]
        factors = _clipped(spec, z[spec.parameter_slice] + self.roles["theta"] * size)
        errors = self.roles["input"] * size
        for k, index in enumerate(spec.noisy_inputs):
            errors[index] = errors[index] + z[spec.noise_slice.start + k]
        return ca.vertcat(z[: spec.parameter_slice.start], factors, errors)

    def _slope(self, slope: ca.SX) -> ca.SX:
        """Give slopes by z of what has these slopes by v."""
        if not self.roles:
            return slope
        spec, first = self.spec, self.spec.slot_slice.start
        by_errors = slope[:, first:]
        by_size = slope[:, spec.parameter_slice] @ self.roles["theta"] + by_errors @ self.roles["input"]
        return ca.horzcat(slope[:, :first], by_size, ca.SX(slope.shape[0], 1), by_errors[:, list(spec.noisy_inputs)])


def _time_update(
    view: LanePlant, mean: ca.SX, covariance: ca.SX, implicit: ca.SX, fields: dict[str, ca.SX]
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """From the previous sample to this one; the input was held at `u_before`."""
    spec = view.spec
    n_x, n_b = len(spec.states), len(spec.slow_errors)
    dt = fields["dt"]
    x_next, slope, implicit = view.predict(mean, fields["u_before"], implicit, dt)
    n = spec.n_joint
    transition = ca.SX(n, n)  # sparse on purpose: structural zeros cost nothing
    transition[:n_x, :] = slope
    noise = ca.SX(n, n)
    moves = dt > 0  # the first sample has no step before it
    for k, state in enumerate(spec.states):
        noise[k, k] = state.noise**2 * moves + fields["gap"][k] ** 2
    for k, error in enumerate(spec.slow_errors):
        decay = ca.exp(-dt / error.memory)
        transition[n_x + k, n_x + k] = decay
        noise[n_x + k, n_x + k] = error.sd**2 * (1 - decay * decay) + fields["kick"][k]
    for k in range(spec.parameter_slice.start, spec.slot_slice.stop):
        transition[k, k] = 1
    # Not by slices: of a joint vector with one entry, an empty one is a row.
    places = [0, spec.parameter_slice.start, spec.parameter_slice.stop, spec.slot_slice.stop, n]
    _, factors, slot, _ = ca.vertsplit(mean, places)
    if spec.slot:
        transition[spec.slot_slice.start, spec.slot_slice.start + 1] = dt
        slot = ca.vertcat(slot[0] + dt * slot[1], slot[1])
        rate = spec.slot_slice.start + 1
        noise[rate, rate] = view.roles["wander"] * dt
    for k, index in zip(range(spec.noise_slice.start, n), spec.noisy_inputs, strict=True):
        noise[k, k] = spec.inputs[index].noise ** 2
    moved = ca.vertcat(
        x_next,
        *(mean[n_x + k] * transition[n_x + k, n_x + k] for k in range(n_b)),
        factors,
        slot,
        ca.SX.zeros(len(spec.noisy_inputs)),
    )
    spread = (transition @ covariance) @ transition.T + noise
    return moved, ca.triu2symm(ca.triu(spread)), implicit


def _measurement_update(
    view: LanePlant, mean: ca.SX, covariance: ca.SX, implicit: ca.SX, fields: dict[str, ca.SX]
) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX, ca.SX]:
    """Update with all sensors, one after the other; missing ones have use = 0.

    Where the readings are not linear, lanes of the bank (`again`) update a second time, linearised at the first result,
    if the sample says much. If it says little, the first result differs from the mean by little but noise: slopes taken
    there go with the noise they are to weigh, and thousands of such samples drag the estimates away. The healthy lane
    never does: after a fault the first result lies far off, and there the readings depend on parameters along which the
    covariance is still wide, so that a second update would explain any fault away.
    """
    reading, slope, implicit = view.measure(mean, fields["u"], implicit)
    rows = [slope[j, :] for j in range(len(view.spec.outputs))]
    variances = [row @ covariance @ row.T + view.noise(j, fields["scale"]) for j, row in enumerate(rows)]
    innovations = ca.vertcat(fields["y"] - reading, *variances)  # of each sensor by itself, as CUSUM and plots want it
    guess, spread, likelihood = _sequential(view, fields, mean, covariance, reading, slope)
    guess = _clip(view.spec, guess)
    if view.is_linear:
        return guess, spread, implicit, likelihood, innovations
    places = [0, view.spec.parameter_slice.start, view.spec.slot_slice.stop, mean.numel()]
    before, _, after = ca.vertsplit(mean, places)
    middle = ca.vertcat(
        before, ca.vertsplit(guess, places)[1], after
    )  # the mean with parameters, and slot, of the guess
    reading, slope, better = view.measure(middle, fields["u"], implicit)
    expected = reading + slope @ (mean - middle)
    second, spread_2, _ = _sequential(view, fields, mean, covariance, expected, slope)
    again = ca.logic_and(fields["again"] > 0, _foretold(view, fields, innovations) > _SAYS_MUCH)
    return (
        ca.if_else(again, _clip(view.spec, second), guess),
        ca.if_else(again, spread_2, spread),
        ca.if_else(again, better, implicit) if implicit.numel() else implicit,
        likelihood,
        innovations,
    )


def _foretold(view: LanePlant, fields: dict[str, ca.SX], innovations: ca.SX) -> ca.SX:
    """Give the variance of what is expected of the sensors that are used, in that of their noise; the largest."""
    n_y, found = len(view.spec.outputs), ca.SX(0)
    for j in range(n_y):
        noise = view.noise(j, fields["scale"])
        found = ca.fmax(found, fields["use"][j] * (innovations[n_y + j] / noise - 1))
    return found


def _sequential(
    view: LanePlant, fields: dict[str, ca.SX], mean: ca.SX, covariance: ca.SX, expected: ca.SX, slope: ca.SX
) -> tuple[ca.SX, ca.SX, ca.SX]:
    """Scalar updates; gives mean, covariance and the gain in log-likelihood.

    Once warm, the healthy lane learns from an innovation only up to a bound (Huber's): a fault, or a wild value, must
    not drag it along before the alarm. Lanes of the bank have a wide bound, beyond which likelihoods do not fall any
    more: one reading that nothing explains must not decide between them.
    """
    wildest = view.spec.thresholds.bank_bound**2
    shift = ca.SX.zeros(view.spec.n_joint)
    likelihood = ca.SX(0)
    for j, output in enumerate(view.spec.outputs):
        row = slope[j, :]
        cross = covariance @ row.T
        variance = row @ cross + view.noise(j, fields["scale"])
        innovation = fields["y"][j] - expected[j] - row @ shift
        use = fields["use"][j]
        weight = cross * (use / variance)
        most = ca.if_else(fields["bound"] > 0, fields["bound"], _NO_BOUND) * ca.sqrt(variance)
        shift = shift + weight * ca.fmin(ca.fmax(innovation, -most), most)
        covariance = ca.triu2symm(ca.triu(covariance - weight @ cross.T))
        # In units of the sensor's noise, so that likelihoods keep a sensible size whatever the unit.
        relative = variance / output.noise**2
        misfit = ca.fmin(innovation**2 / variance, wildest)
        usual = ca.if_else(fields["nis"][j] > 0, fields["nis"][j], 1)
        likelihood = likelihood - 0.5 * use * (misfit + usual * ca.log(relative) + LOG_2_PI) / ca.fmax(usual, 1)
    return mean + shift, covariance, likelihood


def _clip(spec: EngineSpec, mean: ca.SX) -> ca.SX:
    """Keep parameters in their range."""
    place = spec.parameter_slice
    before, factors, after = ca.vertsplit(mean, [0, place.start, place.stop, mean.numel()])
    return ca.vertcat(before, _clipped(spec, factors), after)


def _clipped(spec: EngineSpec, factors: ca.SX) -> ca.SX:
    """Keep factors in the range of their parameters."""
    entries = ca.vertsplit(factors)
    for k, parameter in enumerate(spec.parameters):
        if np.isfinite(parameter.lower):
            entries[k] = ca.fmax(entries[k], parameter.lower)
        if np.isfinite(parameter.upper):
            entries[k] = ca.fmin(entries[k], parameter.upper)
    return ca.vertcat(*entries) if entries else factors
