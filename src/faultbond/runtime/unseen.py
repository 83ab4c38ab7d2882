"""What nobody saw: where states may have gone in a gap, and inputs while their values are missing.

An input that is missing is held. If it usually is told, and moves, it may stand elsewhere, so the states are less
certain. Formulas: docs/method.md, "The joint filter".
"""

from dataclasses import replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime.state import InputMemory, Sample, State

FAR = 20  # samples of a gap in which a state may go as far as it has ever been
AGAIN, NOTHING = 0.3, 1e-3  # part of this that the next sample adds again, and part that is not worth it
LONGEST = 50  # samples without an input, after which the plant has felt most of what it does
MOVES, HABIT = 300.0, 1000.0  # samples over which the moves, and the presence, of inputs are means
LOST = 3  # samples for which an input has not been told from which on it is unknown where it stands
RARELY = 0.5  # presence of an input that is logged when it changes


def wandered(spec: EngineSpec, state: State, gap: float) -> FloatArray:
    """Give the sd that states gain by a gap of so many samples before this one: by chance, or to where they have been.

    From so far off one linear update leads to near the truth only. So the samples that follow add a part of it again,
    each of them a step of Newton's method, down to what counts as nothing.
    """
    astray = state.healthy.astray
    if not gap and not astray.any():
        return astray
    far = travelled(state)
    drift, noise = (np.array([getattr(item, name) for item in spec.states]) for name in ("drift", "noise"))
    again = np.where(AGAIN * astray > np.maximum(noise, NOTHING * far), AGAIN * astray, 0.0)
    return np.asarray(np.maximum.reduce([gap * drift, min(gap / FAR, 1.0) * far, again]))


def travelled(state: State) -> FloatArray:
    """Give how far each state has ever moved."""
    return np.asarray(np.maximum(state.healthy.travel[1] - state.healthy.travel[0], 0.0))


def told_inputs(
    inputs: InputMemory, told: BoolArray, u: FloatArray, moved: FloatArray, gap: float, *, silent: bool
) -> InputMemory:
    """Give what is known of the inputs after a sample in which some were told, are `u`, and moved by so much.

    An input that is mostly not told is one that is logged when it changes: between, its value is known after all.
    """
    whole = told & (inputs.guessed == 0.0) & (gap == 0.0)  # both ends of the move were seen
    leap = np.hypot(np.sqrt(1.0 - 1.0 / MOVES) * inputs.leap, np.sqrt(1.0 / MOVES) * moved)
    habit = inputs.habit + (told - inputs.habit) / HABIT
    return replace(
        inputs,
        lowest=np.where(told, np.minimum(inputs.lowest, u), inputs.lowest),
        highest=np.where(told, np.maximum(inputs.highest, u), inputs.highest),
        leap=np.where(whole, leap, inputs.leap),
        guessed=np.where(told, 0.0, inputs.guessed + 1.0),
        habit=inputs.habit if silent else habit,
    )


def is_restless(inputs: InputMemory) -> BoolArray:
    """Tell which inputs are usually told, and move; where these stand while they are not told nobody knows."""
    return np.asarray((inputs.leap > 0.0) & (inputs.habit > RARELY))


def unknown_inputs(inputs: InputMemory) -> BoolArray:
    """Tell which inputs have been missing for some samples, though they usually are told and do move; (n_inputs,)."""
    return np.asarray((inputs.guessed >= LOST) & is_restless(inputs))


def doubt(inputs: InputMemory, sample: Sample, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give by how much each input may have been off before a sample, SI, and over how many samples.

    An input whose value is missing is held. When it is told again, it may have changed at any sample since; while it is
    not, and sensors are, it may be off by as much as it usually moves.
    """
    told = np.isfinite(sample.u)
    if not np.any(told) and not np.any(np.isfinite(sample.y)):
        return np.zeros(len(u)), np.zeros(len(u))
    doubted = (inputs.guessed > 0.0) & (inputs.habit > RARELY)
    size = np.where(told, u - inputs.held, inputs.leap)
    count = np.where(told, np.minimum(inputs.guessed, LONGEST), 1.0)
    return np.where(doubted, size, 0.0), np.where(doubted, count, 0.0)


def allowed(
    spec: EngineSpec, engine: Engine, state: State, packed: FloatArray, doubted: tuple[FloatArray, FloatArray]
) -> FloatArray:
    """Let states be as uncertain as what inputs may have done unseen makes them, by one step of the healthy filter.

    `doubted`: by how much each input may have been off, and over how many samples, (n_inputs,) each. No state goes
    farther by that than it ever has, unless one step takes it there.
    """
    change, count = doubted
    if not np.any(change):
        return packed
    place, n_x, far = spec.sample_fields, len(spec.states), travelled(state)
    blind = packed.copy()
    blind[place["use"]] = 0.0
    base = engine.advance(state.healthy.lane, blind[None, :])[0][:n_x, 0]
    total = np.square(packed[place["gap"]])
    for index in np.flatnonzero(change):
        trial = blind.copy()
        trial[place["u_before"].start + index] += change[index]
        step = np.abs(engine.advance(state.healthy.lane, trial[None, :])[0][:n_x, 0] - base)
        total += np.where(np.isfinite(step), np.minimum(count[index] * step, np.maximum(far, step)), far) ** 2
    packed = packed.copy()
    packed[place["gap"]] = np.sqrt(total)
    return packed
