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
from faultbond.runtime.state import Changes, Sample, State
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

Past = tuple[FloatArray, FloatArray]  # a lane, and a packed sample as it is after that past


def admit(spec: EngineSpec, engine: Engine, state: State, sample: Sample) -> tuple[State, FloatArray, Changes, int]:
    """Give the state before a sample, the sample as the engine takes it, what changes, and how many inputs were wild.

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
    packed, changes = _packed(spec, engine, state, sample)
    odd = np.isfinite(state.odd)
    if not (state.running and odd.any()):
        return state, packed, changes, 0
    length = state.index - state.odd_since
    real = replace(state, lane=state.rival) if length > 1 else state
    other, if_real = _packed(spec, engine, _believing(spec, real), sample)
    rival, gain = _compared(spec, engine, (state.lane, packed), (real.lane, other))
    gain += state.gain
    decided: Changes = {"odd": np.full(len(spec.inputs), np.nan)}
    refused = packed, decided | changes, length * int(odd.sum())
    if gain < -TELLING:
        return state, *refused
    if gain <= TELLING:  # the readings do not tell
        again, missing = np.isfinite(refused[1]["odd"]), ~np.isfinite(sample.u)
        if (again | missing)[odd].all():
            if length < PENDING:
                later: Changes = {"odd": np.where(odd & missing, state.odd, refused[1]["odd"])}
                later |= {"odd_since": state.odd_since, "rival": rival, "gain": gain}
                return state, packed, changes | later, 0
            if (missing & is_restless(state))[odd].any():  # usually told, and never told again
                return state, *refused
        back = np.abs(sample.u - state.held) < BACK * np.abs(state.odd - state.held)
        if back[odd].all():
            return state, _doubting(spec, engine, (state.lane, packed), (real.lane, other), state), *refused[1:]
    return real, other, decided | if_real, 0


def _packed(spec: EngineSpec, engine: Engine, state: State, sample: Sample) -> tuple[FloatArray, Changes]:
    """Pack a sample with inputs far beyond their range held, for as long as there is patience."""
    u, told = sample.u, sample
    changes: Changes = {}
    guessed = state.running and state.guessed.any()
    if guessed or (state.running and ((u < state.lowest) | (u > state.highest)).any()):
        told, changes = _screened(spec, state, sample)
    packed, packing = pack_sample(spec, state, told, np.where(np.isfinite(told.u), told.u, state.held))
    if told is not sample:  # what feels a refused input at once cannot be judged yet
        refused = np.isfinite(changes["odd"])
        blind = [bool(np.any(refused[list(output.direct_inputs)])) for output in spec.outputs]
        scale = spec.sample_fields["scale"]
        packed[scale] = np.where(blind, spec.thresholds.blank_factor, packed[scale])
    if guessed:
        packed = allowed(spec, engine, state, packed, doubt(state, told, u))
    return packed, packing | changes


def _screened(spec: EngineSpec, state: State, sample: Sample) -> tuple[Sample, Changes]:
    """Give the sample without inputs that are refused, and what changes."""
    u = sample.u
    size = np.maximum(state.highest - state.lowest, state.peak)
    known = (state.lowest <= state.highest) & ~np.array([item.ranged for item in spec.inputs], dtype=bool)
    far = known & np.isfinite(u) & ((u < state.lowest - FAR * size) | (u > state.highest + FAR * size))
    told = replace(sample, u=np.where(far, np.nan, u)) if far.any() else sample
    return told, {"odd": np.where(far, u, np.nan), "odd_since": state.index, "gain": 0.0}


def _believing(spec: EngineSpec, state: State) -> State:
    """Give the state as it would be if the inputs that were refused at the last sample were real."""
    odd = np.isfinite(state.odd)
    held = np.where(odd, state.odd, state.held)
    return replace(
        state,
        held=held,
        lowest=np.minimum(state.lowest, held),
        highest=np.maximum(state.highest, held),
        guessed=np.where(odd, 0.0, state.guessed),
        since_step=np.where(odd, 0.0, state.since_step),
        change=state.change + held - state.held,
        odd=np.full(len(spec.inputs), np.nan),
    )


def _compared(spec: EngineSpec, engine: Engine, one: Past, two: Past) -> tuple[FloatArray, float]:
    """Take a sample after two pasts: give the lane of the second, and how much the readings speak for it, in sd^2.

    That is the difference of the sums of squares of what both trust.
    """
    n_y = len(spec.outputs)
    both = trusted(spec, one[1]) & trusted(spec, two[1])
    costs = []
    for lane, packed in (one, two):
        after, innovations = engine.advance(lane, packed[None, :])
        with np.errstate(all="ignore"):
            score = np.abs(innovations[0, :n_y, 0]) / np.sqrt(innovations[0, n_y:, 0])
        costs.append(np.minimum(np.nan_to_num(score, nan=CAP, posinf=CAP), CAP) ** 2)
    return after, float(np.sum(costs[0] - costs[1], where=both))


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
    u, before, earlier = packed[place["u"]], packed[place["u_before"]], state.earlier
    spike = np.abs(u - earlier) < BACK * np.abs(before - earlier)
    if not spike.any():
        return packed
    other = packed.copy()
    other[place["u_before"]] = np.where(spike, earlier, before)
    _, gain = _compared(spec, engine, (state.lane, packed), (state.lane, other))
    return other if gain > TELLING else packed


def _doubting(spec: EngineSpec, engine: Engine, one: Past, two: Past, state: State) -> FloatArray:
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
    spec: EngineSpec, state: State, changes: Changes, packed: FloatArray, innovations: FloatArray
) -> tuple[FloatArray, Changes, int]:
    """Give a packed sample without wild readings, what changes in the state, and how many there were.

    The packed sample is the same array where there are none.

    Parameters
    ----------
    spec : the model
    state, changes : State, Changes
        Before the sample, and what changes by packing it.
    packed : float array, shape (n_sample,)
    innovations : float array, shape (2 * n_outputs,)
        Of the healthy filter, see `Engine.advance`.
    """
    n_y, place = len(spec.outputs), spec.sample_fields
    y, used, spent = packed[place["y"]], packed[place["use"]] > 0, state.spent
    wild = used & (np.abs(innovations[:n_y]) > SURPRISE * np.sqrt(np.maximum(innovations[n_y:], 0.0)))
    low, high = _reach(spec, state, FAR)
    if state.index - changes["begun"] >= spec.thresholds.warm_up_samples:  # before, the range is not known yet
        wild &= (y < low) | (y > high)
    wild &= ~np.array([output.ranged for output in spec.outputs], dtype=bool)
    refused = wild & (spent <= PATIENCE - 1.0)
    bounded = np.clip(y, *_reach(spec, state, LIMIT))
    cut = wild & ~refused & (bounded != y)
    patience = np.where(wild, spent + refused, np.maximum(spent - 1.0 / RECOVERY, 0.0))
    more = {"spent": patience} | seen(state, y, used & ~refused & ~cut)
    if not wild.any():
        return packed, more, 0
    mended = packed.copy()
    mended[place["use"]] = used & ~refused
    mended[place["y"]] = np.where(refused, 0.0, np.where(cut, bounded, y))
    return mended, more, int(wild.sum())


def _reach(spec: EngineSpec, state: State, widths: float) -> tuple[FloatArray, FloatArray]:
    """Give the ends of what each sensor has shown, and so many widths of it more; infinite where it showed nothing."""
    known = state.shown[0] <= state.shown[1]
    low, high = np.where(known, state.shown, 0.0)
    beyond = widths * np.maximum(high - low, NOISES * spec.output_noise)
    return np.where(known, low - beyond, -np.inf), np.where(known, high + beyond, np.inf)


def seen(state: State, y: FloatArray, used: BoolArray) -> Changes:
    """Give what the sensors have shown with these readings, (n_outputs,) each."""
    low, high = state.shown
    beyond = (y < low) | (y > high)
    if not beyond.any() or not (beyond & used).any():
        return {}
    new = beyond & used
    return {"shown": np.stack([np.where(new, np.minimum(low, y), low), np.where(new, np.maximum(high, y), high)])}
