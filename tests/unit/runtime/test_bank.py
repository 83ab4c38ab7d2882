"""The bank of all lanes: steps first, then those with a slot, each with its own sums."""

from functools import cache

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.slots import plan_slots
from faultbond.runtime.bank import Bank, advance_bank, begin_bank, no_bank, renew_bank
from faultbond.runtime.misfit import add_misfit
from faultbond.runtime.packing import trusted
from faultbond.runtime.slotted import advance_slots, renewed_groups
from faultbond.runtime.state import State
from faultbond.runtime.stepped import advance_steps
from faultbond.runtime.trail import Trail
from faultbond.simulate import Fault
from made import plant, recorded, run

_, SPEC, ENGINE = plant("dc_motor_current")
FAULT = Fault(parameter="K", factor=0.6, start=2.4)


@cache
def alarmed(rows: int) -> State:
    """The motor after a number of samples, its alarm among them."""
    state, _ = run(SPEC, ENGINE, recorded("dc_motor_current", 201, FAULT)[:rows])
    assert 0 <= state.clock.alarm < rows
    return state


def trail_of(state: State, first: int) -> Trail:
    """Samples and healthy lanes from `first` on."""
    place, past = state.past.place(first), state.past
    return Trail(samples=past.samples[place:], lanes=past.lanes[place:], alarm=state.clock.alarm - first)


def last_sample(state: State) -> FloatArray:
    """The last packed sample."""
    return np.asarray(state.past.samples[-1])


def test_a_bank_that_has_not_begun_has_the_size_of_one_that_has() -> None:
    """Before the alarm the state holds a bank of zeros of the size that it will have, so that its size is fixed."""
    empty, full = no_bank(SPEC), alarmed(200).bank
    for name in ("steps", "slots"):
        assert getattr(empty, name).shape == getattr(full, name).shape
        assert not np.any(getattr(empty, name))
    assert empty.misfit.sums.shape == full.misfit.sums.shape == (2, 2, len(full.likelihoods))


def test_likelihoods_of_steps_come_first() -> None:
    """The likelihoods of all lanes are those of steps, then those of lanes with a slot."""
    bank = alarmed(200).bank
    n = bank.steps.shape[1]
    assert np.array_equal(bank.likelihoods[:n], bank.steps[-1])
    assert np.array_equal(bank.likelihoods[n:], bank.slots[-1])


def test_sums_begin_at_the_alarm() -> None:
    """A bank has no misfit at the alarm: what it has seen by then has chosen its onsets."""
    state = alarmed(200)
    trail = trail_of(state, state.clock.alarm - 60)
    bank = begin_bank(SPEC, ENGINE, trail, 55, state.inputs.peak, 777)
    assert not np.any(bank.misfit.sums)
    assert np.all(bank.misfit.since == 777.0)


def test_a_sample_takes_all_lanes_further() -> None:
    """After a sample steps, lanes with a slot and the sums of both are what their own functions give, in this order."""
    before, after = alarmed(200), alarmed(201)
    packed = last_sample(after)
    bank = advance_bank(SPEC, ENGINE, before.bank, packed, trusted(SPEC, packed), 200)
    steps, one = advance_steps(SPEC, ENGINE, before.bank.steps, packed)
    slots, two = advance_slots(SPEC, ENGINE, before.bank.slots, packed)
    pairs = one.shape[1] + plan_slots(SPEC).switched
    misfit = add_misfit(
        SPEC, before.bank.misfit, trusted(SPEC, packed), np.concatenate([one, two], axis=1), 200, switched=pairs
    )
    for found in (bank, after.bank):
        assert np.array_equal(found.steps, steps)
        assert np.array_equal(found.slots, slots)
        assert np.array_equal(found.misfit.sums, misfit.sums)
        assert np.array_equal(found.misfit.since, misfit.since)


def differing_lanes(one: Bank, two: Bank) -> BoolArray:
    """Which lanes differ, steps first."""
    pairs = ((one.steps, two.steps), (one.slots, two.slots))
    return np.concatenate([np.any(a != b, axis=0) for a, b in pairs])


def test_only_lanes_that_begin_again_lose_their_sums() -> None:
    """Renewed lanes have empty sums from that sample on; of the lanes with a slot only drifts and input biases are."""
    state = alarmed(200)
    bank = state.bank
    renewed = renew_bank(SPEC, ENGINE, trail_of(state, state.clock.alarm - 5), bank, 888, state.inputs.peak)
    changed = differing_lanes(renewed, bank)
    assert 0 < changed.sum() < bank.steps.shape[1]
    renewable = np.concatenate(renewed_groups(plan_slots(SPEC))) + bank.steps.shape[1]
    assert set(np.flatnonzero(changed[bank.steps.shape[1] :]) + bank.steps.shape[1]) <= set(renewable)
    assert not np.any(renewed.misfit.sums[:, :, changed])
    assert np.all(renewed.misfit.since[:, :, changed] == 888.0)
    assert np.array_equal(renewed.misfit.sums[:, :, ~changed], bank.misfit.sums[:, :, ~changed])
    assert np.array_equal(renewed.misfit.since[:, :, ~changed], bank.misfit.since[:, :, ~changed])
