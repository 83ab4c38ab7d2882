"""A sample as the engine takes it: inputs held, steps blanked, missing values off, accepted faults corrected.

After a gap, and after values of inputs that are missing, states are uncertain: docs/method.md, "The joint filter".
"""

from dataclasses import replace

import numpy as np

from faultbond.runtime.state import Changes, Sample, State
from faultbond.spec import EngineSpec
from faultbond.types import BoolArray, FloatArray

GAP = 3  # samples without any value from which on the states are uncertain after them,
UNUSUAL = 3.0  # beside so many times the usual number, since rows may come more slowly than samples
PAUSES = 20  # rows over which the usual number is a mean; longer pauses do not count as more
UNKNOWN_GAP = 1000  # samples; a gap of unknown length counts as one of so many
FAR = 20  # samples of a gap in which a state may go as far as it has ever been
AGAIN, NOTHING = 0.3, 1e-3  # part of this that the next sample adds again, and part that is not worth it
LONGEST = 50  # samples without an input, after which the plant has felt most of what it does
MOVES, HABIT = 300.0, 1000.0  # samples over which the moves, and the presence, of inputs are means
RARELY = 0.5  # presence of an input that is logged when it changes
CHANGE_MEMORY = 16.0  # seconds for which a change of an input disturbs the slow errors that follow it


def corrected(state: State, sample: Sample) -> Sample:
    """Give a sample without the faults of instruments that were accepted; a sensor that is out of use is missing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        y = (sample.y - state.reading_offset) / state.reading_gain
    return replace(sample, u=sample.u + state.input_offset, y=np.where(np.isfinite(state.reading_noise), y, np.nan))


def pack_sample(spec: EngineSpec, state: State, sample: Sample, u: FloatArray) -> tuple[FloatArray, Changes]:
    """Pack a sample for the engine: hold inputs, blank after steps, kick slow errors, switch off missing values.

    Gives the packed sample, and what changes in the state. What inputs may have done unseen is told by `doubt`.
    """
    first = not np.all(np.isfinite(state.held))
    before = u if first else state.held
    dt = 0.0 if first else sample.dt
    moved = u - before
    peak = np.maximum(state.peak, np.abs(u))
    limits = np.array([max(item.step, item.step_part * peak[k]) for k, item in enumerate(spec.inputs)])
    stepped = (np.abs(moved) > limits) & ~first
    since = np.where(stepped, 0.0, state.since_step + dt)
    change = state.change * np.exp(-dt / CHANGE_MEMORY) + moved
    released = 1.0 - np.exp(-2.0 * dt / CHANGE_MEMORY)  # adds up to 1 over the memory of a step
    present = np.isfinite(sample.y)
    packed = np.zeros(spec.n_sample)
    place = spec.sample_fields
    packed[place["dt"]] = dt
    packed[place["u_before"]] = before
    packed[place["u"]] = u
    packed[place["y"]] = np.where(present, sample.y, 0.0)
    packed[place["use"]] = present
    packed[place["scale"]] = np.where(
        _blanked(spec, state, sample, since), spec.thresholds.blank_factor, np.where(present, state.reading_noise, 1.0)
    )
    packed[place["kick"]] = [
        released * sum((each * change[k]) ** 2 for k, each in error.after) for error in spec.slow_errors
    ]
    silent = 0 if np.any(np.isfinite(sample.u)) or np.any(present) else state.silent + 1
    absent, usual, pause = (_empty_points if spec.sample_time else _absent_rows)(state, dt)
    gap = absent if absent > GAP - 1 + UNUSUAL * usual and not silent else 0
    sought = bool(gap) or bool(np.any(present))  # else the states are not looked for
    astray = _wandered(spec, state, gap) if sought else state.astray
    packed[place["gap"]] = astray if sought else 0.0
    begun = state.index if state.begun < 0 or (gap and not state.running) else state.begun
    if state.index - begun >= spec.thresholds.warm_up_samples:
        packed[place["bound"]] = spec.thresholds.learning_bound
    told = np.isfinite(sample.u)
    seen = {"begun": begun, "silent": silent, "pause": state.pause if silent else pause, "astray": astray}
    inputs = {"held": u, "peak": peak, "since_step": since, "change": change}
    return packed, inputs | seen | _watched(state, told, u, moved, gap, silent=bool(silent))


def _wandered(spec: EngineSpec, state: State, gap: float) -> FloatArray:
    """Give the sd that states gain by a gap of so many samples before this one: by chance, or to where they have been.

    From so far off one linear update leads to near the truth only. So the samples that follow add a part of it again,
    each of them a step of Newton's method, down to what counts as nothing.
    """
    if not gap and not state.astray.any():
        return state.astray
    far = travelled(state)
    drift, noise = (np.array([getattr(item, name) for item in spec.states]) for name in ("drift", "noise"))
    again = np.where(AGAIN * state.astray > np.maximum(noise, NOTHING * far), AGAIN * state.astray, 0.0)
    return np.asarray(np.maximum.reduce([gap * drift, min(gap / FAR, 1.0) * far, again]))


def travelled(state: State) -> FloatArray:
    """Give how far each state has ever moved."""
    return np.asarray(np.maximum(state.travel[1] - state.travel[0], 0.0))


def _watched(state: State, told: BoolArray, u: FloatArray, moved: FloatArray, gap: float, *, silent: bool) -> Changes:
    """Give what is known of the inputs `u` after a sample in which some were told and moved by so much.

    An input that is mostly not told is one that is logged when it changes: between, its value is known after all.
    """
    whole = told & (state.guessed == 0.0) & (gap == 0.0)  # both ends of the move were seen
    size = state.leap**2 + (moved**2 - state.leap**2) / MOVES
    habit = state.habit + (told - state.habit) / HABIT
    return {
        "lowest": np.where(told, np.minimum(state.lowest, u), state.lowest),
        "highest": np.where(told, np.maximum(state.highest, u), state.highest),
        "leap": np.where(whole, np.sqrt(size), state.leap),
        "guessed": np.where(told, 0.0, state.guessed + 1.0),
        "habit": state.habit if silent else habit,
    }


def unknown_inputs(state: State) -> BoolArray:
    """Tell which inputs have been missing for some samples, though they usually are told and do move; (n_inputs,)."""
    return np.asarray((state.guessed >= GAP) & (state.leap > 0.0) & (state.habit > RARELY))


def doubt(state: State, sample: Sample, u: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give by how much each input may have been off before a sample, SI, and over how many samples.

    An input whose value is missing is held. When it is told again, it may have changed at any sample since; while it is
    not, and sensors are, it may be off by as much as it usually moves.
    """
    told = np.isfinite(sample.u)
    if not np.any(told) and not np.any(np.isfinite(sample.y)):
        return np.zeros(len(u)), np.zeros(len(u))
    doubted = (state.guessed > 0.0) & (state.habit > RARELY)
    size = np.where(told, u - state.held, state.leap)
    count = np.where(told, np.minimum(state.guessed, LONGEST), 1.0)
    return np.where(doubted, size, 0.0), np.where(doubted, count, 0.0)


def _empty_points(state: State, _: float) -> tuple[float, float, float]:
    """Give how many grid points before this one had no value, how many usually have none, and this mean after it."""
    return state.silent, state.pause, state.pause + (min(state.silent, PAUSES) - state.pause) / PAUSES


def _absent_rows(state: State, dt: float) -> tuple[float, float, float]:
    """Give the same where rows are the grid: by the time since the row before, and with the usual time between rows."""
    if not state.pause:
        return 0.0, 1.0, dt
    return dt / state.pause - 1.0, 1.0, state.pause + (min(dt, PAUSES * state.pause) - state.pause) / PAUSES


def _blanked(spec: EngineSpec, state: State, sample: Sample, since_step: FloatArray) -> BoolArray:
    """Whether an input that reaches a sensor directly is still settling after a step, or not known, per output."""
    settling = np.array([item.settling for item in spec.inputs])
    moving = since_step < settling
    missing = ~np.isfinite(sample.u)
    if missing.any():
        moving = moving | (missing & (state.leap > 0.0) & (state.habit > RARELY))
    return np.array([bool(np.any(moving[list(output.direct_inputs)])) for output in spec.outputs], dtype=bool)
