"""The start of the plant, solved from the first samples where the model does not give it.

Least squares over the first samples with nominal parameters; the engine itself predicts (with every measurement
switched off), so no other form of the model is needed. A state that these samples do not show is taken from where the
nominal plant would settle under the first inputs, and is as uncertain as it is large.
"""

import numpy as np

from faultbond.spec import Engine, EngineSpec, pack
from faultbond.types import FloatArray, IntArray

_ITERATIONS = 12
_SECANTS = 8
_DOUBLINGS = 12
_ABSURD = 1e12
_STEEPEST = 1e100  # slope that can still be squared
_WIDER = 3.0  # the start's sd is taken this much wider than the fit says: the same samples are filtered again
_REACH = 2.0  # a state is at most about this many times what the measured outputs suggest


def healthy_lane(spec: EngineSpec, mean: FloatArray, covariance: FloatArray) -> FloatArray:
    """Give the lane, shape (n_numbers, 1), of a healthy plant with states `mean`, `covariance`."""
    n = spec.n_joint
    joint = np.zeros(n)
    full = np.zeros((n, n))
    n_x = len(spec.states)
    joint[:n_x] = mean
    full[:n_x, :n_x] = covariance
    for k, error in enumerate(spec.slow_errors):
        full[n_x + k, n_x + k] = error.sd**2
    for k, parameter in enumerate(spec.parameters, spec.parameter_slice.start):
        joint[k] = parameter.healthy
        full[k, k] = parameter.accuracy**2
    for k, index in enumerate(spec.noisy_inputs, spec.noise_slice.start):
        full[k, k] = spec.inputs[index].noise ** 2
    return np.concatenate([joint, pack(full), spec.loops, [0.0]])[:, None]


def solve_start(spec: EngineSpec, engine: Engine, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give mean (n_states,) and covariance (n_states, n_states), SI, of the states before the first sample.

    Parameters
    ----------
    spec, engine : the model
    samples : float array, shape (n_samples, n_sample)
        The first packed samples.
    """
    known = np.array([state.start_sd is not None for state in spec.states], dtype=bool)
    mean = np.array([state.start_mean for state in spec.states])
    sd = np.array([state.start_sd or 0.0 for state in spec.states])
    free = np.flatnonzero(~known)
    if not len(free):
        return mean, np.diag(sd**2)
    with np.errstate(over="ignore", invalid="ignore"):  # absurd values are possible, and lose
        centre = _settled(spec, engine, samples[0], mean)
        size = _sizes(spec, engine, samples, mean, centre, free)
        best = min(
            (_fit(spec, engine, samples, guess, centre, free, size) for guess in _guesses(mean, centre, free, size)),
            key=lambda found: found[2],
        )
    covariance = np.diag(sd**2)
    covariance[np.ix_(free, free)] = _WIDER**2 * best[1]
    return best[0], covariance


def _guesses(mean: FloatArray, centre: FloatArray, free: IntArray, size: FloatArray) -> list[FloatArray]:
    """Give first guesses: settled, and away from zero on the positive side."""
    guesses = [centre]
    for part in (0.0, 0.3, 1.0):
        guess = mean.copy()
        guess[free] += part * size / _REACH
        guesses.append(guess)
    return guesses


def _settled(spec: EngineSpec, engine: Engine, sample: FloatArray, mean: FloatArray) -> FloatArray:
    """Give the states of the nominal plant after a long while under the first inputs; `mean` where they run away."""
    fields = spec.sample_fields
    still = sample.copy()
    still[fields["use"]] = 0.0
    still[fields["kick"]] = 0.0
    still[fields["dt"]] = spec.sample_time or 1.0
    still[fields["u_before"]] = still[fields["u"]]
    n_x = len(mean)
    lane = healthy_lane(spec, mean, np.zeros((n_x, n_x)))
    lane[spec.covariance_slice] = 0.0
    for _ in range(_DOUBLINGS):  # ever longer steps: the step is L-stable, so this settles what can settle
        lane, _ = engine.advance(lane, np.repeat(still[None, :], 4, axis=0))
        still[fields["dt"]] *= 2.0
    reached = lane[:n_x, 0]
    return np.where(np.isfinite(reached) & (np.abs(reached) < _ABSURD), reached, mean)


def _misfits(spec: EngineSpec, engine: Engine, samples: FloatArray, states: FloatArray) -> FloatArray:
    """Give measured minus predicted in noise units, shape (n_samples * n_outputs, n_guesses); 0 where missing."""
    fields = spec.sample_fields
    off = samples.copy()
    off[:, fields["use"]] = 0.0
    n = spec.n_joint
    lanes = np.concatenate([healthy_lane(spec, state, np.zeros((len(state),) * 2)) for state in states.T], axis=1)
    lanes[n : n + spec.n_packed] = 0.0
    _, found = engine.advance(lanes, off)
    noise = np.array([output.noise for output in spec.outputs])
    weight = samples[:, fields["use"]] / np.sqrt(samples[:, fields["scale"]]) / noise
    misfit = found[:, : len(spec.outputs), :] * weight[:, :, None]
    return np.asarray(np.nan_to_num(misfit.reshape(-1, states.shape[1]), nan=1e6, posinf=1e6, neginf=-1e6))


def _slopes(
    spec: EngineSpec,
    engine: Engine,
    samples: FloatArray,
    state: FloatArray,
    free: IntArray,
    move: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Give the misfit at a state and its slopes by the free states, by differences of size `move`."""
    guesses = np.repeat(state[:, None], len(free) + 1, axis=1)
    guesses[free, np.arange(1, len(free) + 1)] += move
    misfit = _misfits(spec, engine, samples, guesses)
    return misfit[:, 0], (misfit[:, 1:] - misfit[:, :1]) / move


def _sizes(
    spec: EngineSpec, engine: Engine, samples: FloatArray, state: FloatArray, centre: FloatArray, free: IntArray
) -> FloatArray:
    """Give the size of each free state at which it would explain outputs as large as the measured ones.

    By secants of that size, not by slopes: at rest the slope of a turbulent flow says nothing about the plant in use.
    """
    fields = spec.sample_fields
    noise = np.array([output.noise for output in spec.outputs])
    measured = samples[:, fields["y"]] * samples[:, fields["use"]] / noise
    total = float(np.linalg.norm(measured)) + np.sqrt(measured.size)
    size = np.ones(len(free))
    for _ in range(_SECANTS):
        _, slope = _slopes(spec, engine, samples, state, free, size)
        effect = np.linalg.norm(slope, axis=0) * size
        size = size * np.clip(total / np.maximum(effect, 1e-300), 1e-3, 1e3)
    usual = np.abs(centre[free])
    hidden = (size / total > usual) & (usual > 0.0)  # even its whole settled value would drown in noise
    unseen = np.where(usual > 0.0, usual, 1.0)
    return np.asarray(np.where(effect <= 0.0, unseen, np.where(hidden, usual, size * _REACH)))


def _fit(
    spec: EngineSpec,
    engine: Engine,
    samples: FloatArray,
    guess: FloatArray,
    centre: FloatArray,
    free: IntArray,
    size: FloatArray,
) -> tuple[FloatArray, FloatArray, float]:
    """Levenberg-Marquardt from one guess: state, covariance of its free part, cost.

    Free states count in units of `size`, in which what is known of them beforehand is a unit matrix: with least squares
    on the slopes themselves, not on their squares, no direction is lost however precise the sensors are.
    """
    state, damping, slope = guess.copy(), 1e-3, np.zeros((0, len(free)))

    def cost_of(trial: FloatArray) -> float:
        misfit = _misfits(spec, engine, samples, trial[:, None])[:, 0]
        away = (trial[free] - centre[free]) / size
        return float(misfit @ misfit + away @ away)

    cost = cost_of(state)
    for _ in range(_ITERATIONS):
        move = np.maximum(1e-6 * np.abs(state[free]), 1e-6 * size)
        misfit, steep = _slopes(spec, engine, samples, state, free, move)
        slope = np.clip(np.nan_to_num(steep * size), -_STEEPEST, _STEEPEST)
        trial = state.copy()
        trial[free] += size * _step(slope, misfit, (state[free] - centre[free]) / size, damping)
        trial_cost = cost_of(trial)
        if trial_cost < cost:
            state, cost, damping = trial, trial_cost, max(damping / 10.0, 1e-9)
        else:
            damping = min(damping * 10.0, 1e9)
    return state, size[:, None] * _spread(slope) * size, cost


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
