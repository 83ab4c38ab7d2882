"""Wild values: readings and inputs far beyond all that was seen before, which count as missing.

A reading is wild if it lies far from what the healthy filter expects and far from all that the sensor has shown. What
goes on is let in after some samples, since a fault may bring about what was never seen before: then the alarm and the
bank judge it. Of an input nothing is expected; so one that is far from all it has been is held, and what feels it at
once is not judged. At the next sample it is believed, unless the readings follow the past without it, or do not tell
and it has come back. Where the model states a range nothing within it is wild.
"""

from dataclasses import replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime.packing import pack_sample, trusted
from faultbond.runtime.state import Sample, SensorMemory, State
from faultbond.runtime.unseen import allowed, doubt, is_restless, travelled

FAR = 3.0  # widths of what was seen by which a value must lie beyond it,
NOISES = 100.0  # of a sensor at least so many sd of its noise wide,
SURPRISE = 20.0  # and sd by which a reading must lie off what is expected
LIMIT = 10.0  # widths beyond what was seen at which a value counts that goes on: wilder ones only teach nonsense
PATIENCE = 5.0  # wild readings of a sensor that are refused,
RECOVERY = 50.0  # and samples after which it is one more again
PENDING = 20  # samples for which an input that goes on may wait for the readings to tell
TELLING = 9.0  # difference of the sums of squares, in sd, that decides between two pasts
SPIKE, BACK = 4.0, 0.5  # sd of an innovation that may be due to one; part of the way that an input may be off after it
CAP = 20.0  # sd of an innovation beyond which it counts no more there
ABSURD = 100.0  # sizes of a state beyond which no past is believed to have taken it

OnePast = tuple[FloatArray, FloatArray]  # a lane, and a packed sample as it is after that past


def admit(spec: EngineSpec, engine: Engine, state: State, sample: Sample) -> tuple[State, FloatArray, State, int]:
    """Give the state before a sample, the sample as the engine takes it, the state after, and how many inputs are wild.

    While an input is refused a second filter, the rival, runs beside as if its value were real, until the readings tell
    which of the two is right. If the rival is, it is the healthy filter from then on.

    Parameters
    ----------
    spec, engine : the model
    state : State
        Before the sample; every input has had a value.
    sample : Sample
        Without the faults that were accepted.
    """
    inputs, odd = state.inputs, np.isfinite(state.inputs.odd)
    if not (state.clock.running and odd.any()):
        packed, after = _packed(spec, engine, state, sample)
        return state, packed, after, 0
    decided = replace(state, inputs=replace(inputs, odd=np.full(len(spec.inputs), np.nan)))
    packed, after = _packed(spec, engine, decided, sample)
    length = state.clock.index - inputs.odd_since
    real = replace(state, healthy=replace(state.healthy, lane=inputs.rival)) if length > 1 else state
    other, if_real = _packed(spec, engine, _believing(spec, real), sample)
    one, two = (state.healthy.lane, packed), (real.healthy.lane, other)
    rival, gain = _compared(spec, engine, one, two)
    gain += inputs.gain
    n_wild = length * int(odd.sum())
    if gain < -TELLING:
        return state, packed, after, n_wild
    if gain <= TELLING:  # the readings do not tell
        again, missing = np.isfinite(after.inputs.odd), ~np.isfinite(sample.u)
        if (again | missing)[odd].all():
            if length < PENDING:
                still = np.where(odd & missing, inputs.odd, after.inputs.odd)
                later = replace(after.inputs, odd=still, odd_since=inputs.odd_since, rival=rival, gain=gain)
                return state, packed, replace(after, inputs=later), 0
            if (missing & is_restless(inputs))[odd].any():  # usually told, and never told again
                return state, packed, after, n_wild
        back = np.abs(sample.u - inputs.held) < BACK * np.abs(inputs.odd - inputs.held)
        if back[odd].all():
            return state, _doubting(spec, engine, one, two, state), after, n_wild
    return real, other, if_real, 0


def _packed(spec: EngineSpec, engine: Engine, state: State, sample: Sample) -> tuple[FloatArray, State]:
    """Pack a sample with inputs far beyond their range held, for as long as there is patience."""
    u, told, screened, inputs = sample.u, sample, state, state.inputs
    guessed = state.clock.running and inputs.guessed.any()
    if guessed or (state.clock.running and ((u < inputs.lowest) | (u > inputs.highest)).any()):
        told, screened = _screened(spec, state, sample)
    packed, after = pack_sample(spec, screened, told, np.where(np.isfinite(told.u), told.u, inputs.held))
    if told is not sample:  # what feels a refused input at once cannot be judged yet
        refused = np.isfinite(screened.inputs.odd)
        blind = [bool(np.any(refused[list(output.direct_inputs)])) for output in spec.outputs]
        scale = spec.sample_fields["scale"]
        packed[scale] = np.where(blind, spec.thresholds.blank_factor, packed[scale])
    if guessed:
        packed = allowed(spec, engine, state, packed, doubt(inputs, told, u))
    return packed, after


def _screened(spec: EngineSpec, state: State, sample: Sample) -> tuple[Sample, State]:
    """Give the sample without inputs that are refused, and the state that knows of them."""
    u, inputs = sample.u, state.inputs
    low, high = inputs.lowest, inputs.highest
    size = np.maximum(high - low, inputs.peak)
    known = (low <= high) & ~np.array([item.ranged for item in spec.inputs], dtype=bool)
    far = known & np.isfinite(u) & ((u < low - FAR * size) | (u > high + FAR * size))
    told = replace(sample, u=np.where(far, np.nan, u)) if far.any() else sample
    refused = replace(inputs, odd=np.where(far, u, np.nan), odd_since=state.clock.index, gain=0.0)
    return told, replace(state, inputs=refused)


def _believing(spec: EngineSpec, state: State) -> State:
    """Give the state as it would be if the inputs that were refused at the last sample were real."""
    inputs, odd = state.inputs, np.isfinite(state.inputs.odd)
    held = np.where(odd, inputs.odd, inputs.held)
    believed = replace(
        inputs,
        held=held,
        lowest=np.minimum(inputs.lowest, held),
        highest=np.maximum(inputs.highest, held),
        guessed=np.where(odd, 0.0, inputs.guessed),
        since_step=np.where(odd, 0.0, inputs.since_step),
        change=inputs.change + held - inputs.held,
        odd=np.full(len(spec.inputs), np.nan),
    )
    return replace(state, inputs=believed)


def _compared(spec: EngineSpec, engine: Engine, one: OnePast, two: OnePast) -> tuple[FloatArray, float]:
    """Take a sample after two pasts: give the lane of the second, and what the readings that both trust say for it."""
    n_y = len(spec.outputs)
    both = trusted(spec, one[1]) & trusted(spec, two[1])
    scores = []
    for lane, packed in (one, two):
        after, innovations = engine.advance(lane, packed[None, :])
        with np.errstate(all="ignore"):
            scores.append(innovations[0, :n_y, 0] / np.sqrt(innovations[0, n_y:, 0]))
    return after, said_for_second(scores[0], scores[1], both)


def said_for_second(one: FloatArray, two: FloatArray, counted: BoolArray) -> float:
    """Give how much readings speak for the second of two pasts: the difference of their sums of squares, sd^2.

    Parameters
    ----------
    one, two : float arrays of one shape
        What each past leaves of the readings, in sd; what is no number counts as far off.
    counted : bool array of this shape
        Which readings are compared.
    """
    first, second = (np.minimum(np.nan_to_num(np.abs(item), nan=CAP, posinf=CAP), CAP) ** 2 for item in (one, two))
    return float(np.sum(first - second, where=counted))


def surprising(spec: EngineSpec, packed: FloatArray, innovations: FloatArray) -> bool:
    """Whether a reading lies so far from what is expected that it, or an input before it, may be wild."""
    n_y = len(spec.outputs)
    off = np.abs(innovations[:n_y]) > SPIKE * np.sqrt(np.maximum(innovations[n_y:], 0.0))
    return bool(off.any()) and bool((off & (packed[spec.sample_fields["use"]] > 0)).any())


def without_spike(spec: EngineSpec, engine: Engine, state: State, packed: FloatArray) -> FloatArray:
    """Give a packed sample as if inputs that left their value for one sample had not, if the readings say so.

    The packed sample is the same array if they do not.

    Parameters
    ----------
    spec, engine : the model
    state : State
        Before the sample.
    packed : float array, shape (n_sample,)
    """
    place = spec.sample_fields
    u, before, earlier = packed[place["u"]], packed[place["u_before"]], state.inputs.earlier
    spike = np.abs(u - earlier) < BACK * np.abs(before - earlier)
    if not spike.any():
        return packed
    other = packed.copy()
    other[place["u_before"]] = np.where(spike, earlier, before)
    _, gain = _compared(spec, engine, (state.healthy.lane, packed), (state.healthy.lane, other))
    return other if gain > TELLING else packed


def _doubting(spec: EngineSpec, engine: Engine, one: OnePast, two: OnePast, state: State) -> FloatArray:
    """Give the sample of the first past, with states as uncertain as the two pasts lead them apart."""
    place, n_x = spec.sample_fields, len(spec.states)
    reached = []
    for lane, packed in (one, two):
        blind = packed.copy()
        blind[place["use"]] = 0.0
        reached.append(engine.advance(lane, blind[None, :])[0][:n_x, 0])
    most = ABSURD * np.maximum(travelled(state), np.abs(reached[0]))
    with np.errstate(all="ignore"):
        apart = np.minimum(np.nan_to_num(np.abs(reached[1] - reached[0]), nan=0.0), most)
    unsure = one[1].copy()
    unsure[place["gap"]] = np.hypot(unsure[place["gap"]], apart)
    return unsure


def judged(
    spec: EngineSpec, state: State, packed: FloatArray, innovations: FloatArray
) -> tuple[FloatArray, SensorMemory, int]:
    """Give a packed sample without wild readings, what is known of the sensors then, and how many there were.

    The packed sample is the same array where there are none.

    Parameters
    ----------
    spec : the model
    state : State
        After packing the sample.
    packed : float array, shape (n_sample,)
    innovations : float array, shape (2 * n_outputs,)
        Of the healthy filter, see `Engine.advance`.
    """
    n_y, place = len(spec.outputs), spec.sample_fields
    y, used, spent = packed[place["y"]], packed[place["use"]] > 0, state.sensors.spent
    wild = used & (np.abs(innovations[:n_y]) > SURPRISE * np.sqrt(np.maximum(innovations[n_y:], 0.0)))
    low, high = _reach(spec, state.sensors, FAR)
    if state.clock.index - state.clock.begun >= spec.thresholds.warm_up_samples:  # before, the range is not known yet
        wild &= (y < low) | (y > high)
    wild &= ~np.array([output.ranged for output in spec.outputs], dtype=bool)
    refused = wild & (spent <= PATIENCE - 1.0)
    bounded = np.clip(y, *_reach(spec, state.sensors, LIMIT))
    cut = wild & ~refused & (bounded != y)
    patience = np.where(wild, spent + refused, np.maximum(spent - 1.0 / RECOVERY, 0.0))
    sensors = replace(seen(state.sensors, y, used & ~refused & ~cut), spent=patience)
    if not wild.any():
        return packed, sensors, 0
    mended = packed.copy()
    mended[place["use"]] = used & ~refused
    mended[place["y"]] = np.where(refused, 0.0, np.where(cut, bounded, y))
    return mended, sensors, int(wild.sum())


def _reach(spec: EngineSpec, sensors: SensorMemory, widths: float) -> tuple[FloatArray, FloatArray]:
    """Give the ends of what each sensor has shown, and so many widths of it more; infinite where it showed nothing."""
    known = sensors.shown[0] <= sensors.shown[1]
    low, high = np.where(known, sensors.shown, 0.0)
    beyond = widths * np.maximum(high - low, NOISES * spec.output_noise)
    return np.where(known, low - beyond, -np.inf), np.where(known, high + beyond, np.inf)


def seen(sensors: SensorMemory, y: FloatArray, used: BoolArray) -> SensorMemory:
    """Give what is known of the sensors after readings `y`, SI, of which some were `used`; (n_outputs,) each."""
    low, high = sensors.shown
    beyond = (y < low) | (y > high)
    if not beyond.any() or not (beyond & used).any():
        return sensors
    new = beyond & used
    shown = np.stack([np.where(new, np.minimum(low, y), low), np.where(new, np.maximum(high, y), high)])
    return replace(sensors, shown=shown)
