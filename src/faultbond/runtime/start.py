"""The start of the plant, solved from the first samples where the model does not give it.

Least squares over the first samples with nominal parameters; the engine itself predicts (with every measurement
switched off), so no other form of the model is needed. A state that these samples do not show is taken from where the
nominal plant would settle under the first inputs, and is as uncertain as it is large.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.spec import Engine, EngineSpec, pack, unpack

_ITERATIONS = 12
_SECANTS = 8
_DOUBLINGS = 12
_ABSURD = 1e12
_ASTRAY = 1e3  # sizes of a state that a settled value may lie off; farther ones the plant did not reach by itself
_PART = 0.1  # of what a parameter may be off, over which slopes are taken
RUN_AWAY = 1e6  # misfit, sd of the noise, of a plant that has run away
_STEEPEST = 1e100  # slope that can still be squared
_WIDER = 3.0  # the start's sd is taken this much wider than the fit says: the same samples are filtered again
_NOTHING = 1e-9  # part of the size of a state below which it is zero but for rounding, which says nothing of its size
_REACH = 2.0  # a state is at most about this many times what the measured outputs suggest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Data:
    """The model, packed samples, shape (n_samples, n_sample), and the lane whose parameters hold, if not nominal."""

    spec: EngineSpec
    engine: Engine
    samples: FloatArray
    known: FloatArray | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fitted:
    """States that fit: (n_states,), covariance of the free ones, what a change of the misfits does to them, cost."""

    state: FloatArray
    covariance: FloatArray
    gain: FloatArray
    cost: float


def healthy_lane(
    spec: EngineSpec, mean: FloatArray, covariance: FloatArray, known: FloatArray | None = None
) -> FloatArray:
    """Give the lane, shape (n_numbers, 1), of a healthy plant with states `mean`, `covariance`.

    `covariance` is that of the states, or of states, slow errors and parameters, as `solve_start` gives it.
    `known` (n_numbers, 1) is a lane whose parameters are taken in place of the nominal ones: those that were accepted.
    """
    n = spec.n_joint
    joint = np.zeros(n)
    full = np.zeros((n, n))
    n_x = len(spec.states)
    joint[:n_x] = mean
    for k, error in enumerate(spec.slow_errors):
        full[n_x + k, n_x + k] = error.sd**2
    for k, parameter in enumerate(spec.parameters, spec.parameter_slice.start):
        joint[k] = parameter.healthy
        full[k, k] = parameter.accuracy**2
    for k, index in enumerate(spec.noisy_inputs, spec.noise_slice.start):
        full[k, k] = spec.inputs[index].noise ** 2
    if known is not None:
        place = spec.parameter_slice
        joint[place] = known[place, 0]
        full[place, place] = unpack(spec, known[spec.covariance_slice, 0])[place, place]
    full[: len(covariance), : len(covariance)] = covariance
    return np.concatenate([joint, pack(full), spec.loops, [0.0]])[:, None]


def solve_start(
    spec: EngineSpec, engine: Engine, samples: FloatArray, known: FloatArray | None = None, *, again: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Give the states before the first sample, (n_states,), SI, and a covariance.

    The covariance, of shape (n, n), is that of states, slow errors and parameters: a start that was found with
    parameters that are off is off with them.

    Parameters
    ----------
    spec, engine : the model
    samples : float array, shape (n_samples, n_sample)
        The first packed samples.
    known : float array, shape (n_numbers, 1)
        A lane whose parameters hold; None: the nominal ones do.
    again : bool
        Whether the plant has run before, so that what the model says of the start does not hold.
    """
    given = np.array([state.start_sd is not None and not again for state in spec.states], dtype=bool)
    mean = np.array([state.start_mean for state in spec.states])
    sd = _stated_sds(spec)
    data = _Data(spec=spec, engine=engine, samples=samples, known=known)
    unknown = np.flatnonzero(~given)
    if not len(unknown):
        return mean, _with_parameters(data, np.diag(sd**2))
    with np.errstate(over="ignore", invalid="ignore"):  # absurd values are possible, and lose
        centre, size = np.where(given, mean, _settled(data, mean)), np.where(given, sd, 1.0)
        size[unknown] = _sizes(data, mean, centre, unknown)
        centre = np.where(np.abs(centre - mean) > _ASTRAY * size, mean, centre)
        free = np.flatnonzero(size > 0.0)  # what is stated may be off too, and would put the others off
        guesses = _guesses(mean, centre, free, size[free])
        best = min((_fit(data, guess, centre, free, size[free]) for guess in guesses), key=lambda found: found.cost)
        led = np.zeros((len(mean), spec.parameter_slice.stop - len(mean)))
        led[free] = best.gain @ _by_what_is_unknown(data, best.state)
    covariance = np.zeros((len(mean), len(mean)))
    covariance[np.ix_(free, free)] = _WIDER**2 * best.covariance
    return best.state, _with_parameters(data, covariance, led)


def _with_parameters(data: _Data, states: FloatArray, led: FloatArray | None = None) -> FloatArray:
    """Give the covariance of states, slow errors and parameters; `led`: slopes of the fitted states by the latter."""
    spec, n_x = data.spec, len(states)
    lane = healthy_lane(spec, np.zeros(n_x), states, data.known)
    full = unpack(spec, lane[spec.covariance_slice, 0])[: spec.parameter_slice.stop, : spec.parameter_slice.stop]
    if led is not None:
        cross = led @ full[n_x:, n_x:]
        full[:n_x, :n_x] += cross @ led.T
        full[:n_x, n_x:], full[n_x:, :n_x] = cross, cross.T
    return full


def misfits(
    spec: EngineSpec, engine: Engine, samples: FloatArray, state: FloatArray, known: FloatArray | None = None
) -> FloatArray:
    """Give measured minus predicted, in sd of the noise, of a nominal plant that began at a state; 0 where missing.

    Parameters
    ----------
    spec, engine : the model
    samples : float array, shape (n_samples, n_sample)
        The first packed samples.
    state : float array, shape (n_states,), SI
    known : float array, shape (n_numbers, 1)
        A lane whose parameters hold; None: the nominal ones do.

    Returns
    -------
    float array, shape (n_samples, n_outputs)
    """
    data = _Data(spec=spec, engine=engine, samples=samples, known=known)
    with np.errstate(over="ignore", invalid="ignore"):
        return _misfits(data, state[:, None])[:, 0].reshape(len(samples), len(spec.outputs))


def _stated_sds(spec: EngineSpec) -> FloatArray:
    """Give the sd of the stated starts, (n_states,); contents are stated, so the parameters of the stores count too."""
    accuracy = [item.accuracy for item in spec.parameters]
    full = [sum((item.start_mean * power * accuracy[j]) ** 2 for j, power in item.jumps) for item in spec.states]
    return np.asarray(np.sqrt(np.array([(item.start_sd or 0.0) ** 2 for item in spec.states]) + np.array(full)))


def _guesses(mean: FloatArray, centre: FloatArray, free: IntArray, size: FloatArray) -> list[FloatArray]:
    """Give first guesses: settled, and away from zero on the positive side."""
    guesses = [centre]
    for part in (0.0, 0.3, 1.0):
        guess = mean.copy()
        guess[free] += part * size / _REACH
        guesses.append(guess)
    return guesses


def _settled(data: _Data, mean: FloatArray) -> FloatArray:
    """Give the states of the nominal plant after a long while under the first inputs; `mean` where they run away."""
    spec = data.spec
    fields, still = spec.sample_fields, data.samples[0].copy()
    still[fields["use"]] = 0.0
    still[fields["kick"]] = 0.0
    still[fields["gap"]] = 0.0
    still[fields["dt"]] = spec.sample_time or 1.0
    still[fields["u_before"]] = still[fields["u"]]
    n_x = len(mean)
    lane = healthy_lane(spec, mean, np.zeros((n_x, n_x)), data.known)
    lane[spec.covariance_slice] = 0.0
    for _ in range(_DOUBLINGS):  # ever longer steps: the step is L-stable, so this settles what can settle
        lane, _ = data.engine.advance(lane, np.repeat(still[None, :], 4, axis=0))
        still[fields["dt"]] *= 2.0
    reached = lane[:n_x, 0]
    return np.where(np.isfinite(reached) & (np.abs(reached) < _ABSURD), reached, mean)


def _misfits(data: _Data, states: FloatArray) -> FloatArray:
    """Give measured minus predicted in noise units, shape (n_samples * n_outputs, n_guesses); 0 where missing."""
    nothing = np.zeros((len(states),) * 2)
    lanes = [healthy_lane(data.spec, state, nothing, data.known) for state in states.T]
    return _predicted(data, np.concatenate(lanes, axis=1))


def _predicted(data: _Data, lanes: FloatArray) -> FloatArray:
    """Give the misfits, as `_misfits` does, of lanes (n_numbers, n_guesses)."""
    spec, samples = data.spec, data.samples
    fields, off = spec.sample_fields, samples.copy()
    off[:, fields["use"]] = 0.0
    sure = lanes.copy()
    sure[spec.covariance_slice] = 0.0
    _, found = data.engine.advance(sure, off)
    noise = np.array([output.noise for output in spec.outputs])
    weight = samples[:, fields["use"]] / np.sqrt(samples[:, fields["scale"]]) / noise
    misfit = found[:, : len(spec.outputs), :] * weight[:, :, None]
    found = misfit.reshape(-1, lanes.shape[1])
    return np.asarray(np.nan_to_num(found, nan=RUN_AWAY, posinf=RUN_AWAY, neginf=-RUN_AWAY))


def _by_what_is_unknown(data: _Data, state: FloatArray) -> FloatArray:
    """Give the slopes of the misfits by slow errors and parameters.

    Returns
    -------
    float array, shape (n_samples * n_outputs, n_slow_errors + n_parameters)
    """
    spec = data.spec
    lane = healthy_lane(spec, state, np.zeros((len(state),) * 2), data.known)
    places = np.arange(spec.slow_slice.start, spec.parameter_slice.stop)
    sds = np.sqrt(np.diag(unpack(spec, lane[spec.covariance_slice, 0]))[places])
    lanes = np.repeat(lane, len(places) + 1, axis=1)
    lanes[places, np.arange(1, len(places) + 1)] += _PART * sds
    misfit = _predicted(data, lanes)
    slopes = (misfit[:, 1:] - misfit[:, :1]) / np.where(sds > 0.0, _PART * sds, 1.0)
    near = np.maximum(np.abs(misfit[:, 1:]), np.abs(misfit[:, :1])) < RUN_AWAY
    return np.where(near, slopes, 0.0)


def _slopes(data: _Data, state: FloatArray, free: IntArray, move: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give the misfit at a state and its slopes by the free states, by differences of size `move`."""
    guesses = np.repeat(state[:, None], len(free) + 1, axis=1)
    guesses[free, np.arange(1, len(free) + 1)] += move
    misfit = _misfits(data, guesses)
    return misfit[:, 0], (misfit[:, 1:] - misfit[:, :1]) / move


def _sizes(data: _Data, state: FloatArray, centre: FloatArray, free: IntArray) -> FloatArray:
    """Give the size of each free state at which it would explain outputs as large as the measured ones.

    By secants of that size, not by slopes: at rest the slope of a turbulent flow says nothing about the plant in use.
    """
    fields, samples = data.spec.sample_fields, data.samples
    noise = data.spec.output_noise
    measured = samples[:, fields["y"]] * samples[:, fields["use"]] / noise
    total = float(np.linalg.norm(measured)) + np.sqrt(measured.size)
    size = np.ones(len(free))
    for _ in range(_SECANTS):
        _, slope = _slopes(data, state, free, size)
        effect = np.linalg.norm(slope, axis=0) * size
        size = size * np.clip(total / np.maximum(effect, 1e-300), 1e-3, 1e3)
    usual = np.where(np.abs(centre[free]) > _NOTHING * size, np.abs(centre[free]), 0.0)
    hidden = (size / total > usual) & (usual > 0.0)  # even its whole settled value would drown in noise
    unseen = np.where(usual > 0.0, usual, 1.0)
    return np.asarray(np.where(effect <= 0.0, unseen, np.where(hidden, usual, size * _REACH)))


def _fit(data: _Data, guess: FloatArray, centre: FloatArray, free: IntArray, size: FloatArray) -> _Fitted:
    """Levenberg-Marquardt from one guess.

    Free states count in units of `size`, in which what is known of them beforehand is a unit matrix: with least squares
    on the slopes themselves, not on their squares, no direction is lost however precise the sensors are.
    """
    state, damping, slope = guess.copy(), 1e-3, np.zeros((0, len(free)))

    def cost_of(trial: FloatArray) -> float:
        misfit = _misfits(data, trial[:, None])[:, 0]
        away = (trial[free] - centre[free]) / size
        return float(misfit @ misfit + away @ away)

    cost = cost_of(state)
    for _ in range(_ITERATIONS):
        move = np.maximum(1e-6 * np.abs(state[free]), 1e-6 * size)
        misfit, steep = _slopes(data, state, free, move)
        slope = np.clip(np.nan_to_num(steep * size), -_STEEPEST, _STEEPEST)
        trial = state.copy()
        trial[free] += size * _step(slope, misfit, (state[free] - centre[free]) / size, damping)
        trial_cost = cost_of(trial)
        if trial_cost < cost:
            state, cost, damping = trial, trial_cost, max(damping / 10.0, 1e-9)
        else:
            damping = min(damping * 10.0, 1e9)
    spread = _spread(slope)
    return _Fitted(
        state=state,
        covariance=size[:, None] * spread * size,
        gain=-size[:, None] * (spread @ slope.T),
        cost=cost,
    )


def _step(slope: FloatArray, misfit: FloatArray, away: FloatArray, damping: float) -> FloatArray:
    """Give the damped step to the least sum of squares of misfit and distance."""
    damped = np.diag(np.sqrt(damping * (1.0 + np.sum(slope**2, axis=0))))
    rows = np.concatenate([slope, np.eye(len(away)), damped])
    right = np.concatenate([misfit, away, np.zeros(len(away))])
    return np.asarray(-np.linalg.lstsq(rows, right, rcond=None)[0])


def _spread(slope: FloatArray) -> FloatArray:
    """Give the covariance that slopes and a unit prior leave."""
    _, found, directions = np.linalg.svd(slope)
    known = np.zeros(slope.shape[1])
    known[: len(found)] = found
    return np.asarray((directions.T / (1.0 + known**2)) @ directions)
