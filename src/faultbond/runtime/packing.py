"""A sample as the engine takes it: inputs held, steps blanked, missing values off, accepted faults corrected."""

from dataclasses import replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.state import Clock, Normal, Sample, State
from faultbond.runtime.unseen import is_restless, told_inputs, wandered

GAP = 3  # samples without any value from which on the states are uncertain after them,
UNUSUAL = 3.0  # beside so many times the usual number, since rows may come more slowly than samples
PAUSES = 20  # rows over which the usual number is a mean; longer pauses do not count as more
UNKNOWN_GAP = 1000  # samples; a gap of unknown length counts as one of so many
CHANGE_MEMORY = 16.0  # seconds for which a change of an input disturbs the slow errors that follow it


def resumed(state: State) -> State:
    """Give the state with which a run goes on after a time of unknown length."""
    return replace(state, clock=replace(state.clock, silent=UNKNOWN_GAP))


def corrected(normal: Normal, sample: Sample) -> Sample:
    """Give a sample without the faults of instruments that were accepted; a sensor that is out of use is missing."""
    with np.errstate(divide="ignore", invalid="ignore"):
        y = (sample.y - normal.offset) / normal.gain
    return replace(sample, u=sample.u + normal.input_offset, y=np.where(np.isfinite(normal.noise), y, np.nan))


def pack_sample(spec: EngineSpec, state: State, sample: Sample, u: FloatArray) -> tuple[FloatArray, State]:
    """Pack a sample for the engine: hold inputs, blank after steps, kick slow errors, switch off missing values.

    Gives the packed sample, (n_sample,), and the state after it. What inputs may have done unseen is added by
    `faultbond.runtime.unseen.allowed`.
    """
    clock, inputs = state.clock, state.inputs
    first = not np.all(np.isfinite(inputs.held))
    before = u if first else inputs.held
    dt = 0.0 if first else sample.dt
    moved = u - before
    peak = np.maximum(inputs.peak, np.abs(u))
    limits = np.array([max(item.step, item.step_part * peak[k]) for k, item in enumerate(spec.inputs)])
    stepped = (np.abs(moved) > limits) & ~first
    since = np.where(stepped, 0.0, inputs.since_step + dt)
    change = inputs.change * np.exp(-dt / CHANGE_MEMORY) + moved
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
        _blanked(spec, state, sample, since), spec.thresholds.blank_factor, np.where(present, state.normal.noise, 1.0)
    )
    packed[place["kick"]] = [
        released * sum((each * change[k]) ** 2 for k, each in error.after) for error in spec.slow_errors
    ]
    packed[place["nis"]] = state.sensors.nis
    silent = 0 if np.any(np.isfinite(sample.u)) or np.any(present) else clock.silent + 1
    absent, usual, pause = (_empty_points if spec.sample_time else _absent_rows)(clock, dt)
    gap = absent if absent > GAP - 1 + UNUSUAL * usual and not silent else 0
    sought = bool(gap) or bool(np.any(present))  # else the states are not looked for
    astray = wandered(spec, state, gap) if sought else state.healthy.astray
    packed[place["gap"]] = astray if sought else 0.0
    begun = clock.index if clock.begun < 0 or (gap and not clock.running) else clock.begun
    if clock.index - begun >= spec.thresholds.warm_up_samples:
        packed[place["bound"]] = spec.thresholds.learning_bound
    told = np.isfinite(sample.u)
    inputs = told_inputs(inputs, told, u, moved, gap, silent=bool(silent))
    return packed, replace(
        state,
        clock=replace(clock, begun=begun, silent=silent, pause=clock.pause if silent else pause),
        inputs=replace(inputs, held=u, earlier=before, since_step=since, change=change),
        healthy=replace(state.healthy, astray=astray),
    )


def trusted(spec: EngineSpec, packed: FloatArray) -> BoolArray:
    """Tell which sensors have a value in a packed sample and are not blanked, (n_outputs,)."""
    place = spec.sample_fields
    return np.asarray((packed[place["use"]] > 0) & (packed[place["scale"]] < spec.thresholds.blank_factor))


def _empty_points(clock: Clock, _: float) -> tuple[float, float, float]:
    """Give how many grid points before this one had no value, how many usually have none, and this mean after it."""
    return clock.silent, clock.pause, clock.pause + (min(clock.silent, PAUSES) - clock.pause) / PAUSES


def _absent_rows(clock: Clock, dt: float) -> tuple[float, float, float]:
    """Give the same where rows are the grid: by the time since the row before, and with the usual time between rows."""
    if not clock.pause:
        return 0.0, 1.0, dt
    return dt / clock.pause - 1.0, 1.0, clock.pause + (min(dt, PAUSES * clock.pause) - clock.pause) / PAUSES


def _blanked(spec: EngineSpec, state: State, sample: Sample, since_step: FloatArray) -> BoolArray:
    """Whether an input that reaches a sensor directly is still settling after a step, or not known, per output."""
    settling = np.array([item.settling for item in spec.inputs])
    moving = since_step < settling
    missing = ~np.isfinite(sample.u)
    if missing.any():
        moving = moving | (missing & is_restless(state.inputs))
    return np.array([bool(np.any(moving[list(output.direct_inputs)])) for output in spec.outputs], dtype=bool)
