"""Samples as the engine takes them after a gap."""

from dataclasses import replace

import numpy as np
import pytest
from made import plant, recorded

from faultbond.runtime.packing import AGAIN, FAR, GAP, LONGEST, PAUSES, UNUSUAL, corrected, doubt, pack_sample
from faultbond.runtime.state import Sample, State, init
from faultbond.spec import EngineSpec


def gaps(pattern: str) -> list[int]:
    """Give the gap that each sample tells of; `.` is one without any value, `y` and `u` have only sensors or inputs."""
    _, spec, _ = plant("rc")
    whole = recorded("rc", 1)[0]
    no_u, no_y = np.full_like(whole.u, np.nan), np.full_like(whole.y, np.nan)
    state, found = init(spec), []
    for letter in "x" + pattern:
        sample = replace(whole, u=whole.u if letter in "xu" else no_u, y=whole.y if letter in "xy" else no_y)
        state, gap = packed(spec, state, sample)
        found.append(gap)
    return found[1:]


def packed(spec: EngineSpec, state: State, sample: Sample) -> tuple[State, int]:
    """Pack a sample, and give the gap that it tells of, without what is left of one before."""
    u = np.where(np.isfinite(sample.u), sample.u, state.held)
    row, changes = pack_sample(spec, replace(state, astray=np.zeros_like(state.astray)), sample, u)
    gap = row[spec.sample_fields["gap"]][0] / spec.states[0].drift
    return replace(state, index=state.index + 1, **changes), round(gap)


def test_a_sample_after_a_gap_tells_how_long_it_was() -> None:
    """Three samples or more without any value are a gap; it is told once, by the sample after it."""
    assert gaps("xxx" + GAP * "." + "xxx") == [0] * (3 + GAP) + [GAP, 0, 0]
    assert gaps("xxx" + 200 * "." + "x") == [0] * 203 + [200]
    assert not any(gaps("xx" + (GAP - 1) * "." + "xx"))


def test_some_value_is_no_gap() -> None:
    """Inputs that are told only when they change, or sensors that are late, make no gap."""
    assert not any(gaps("x" + 50 * "y" + "x" + 50 * "u" + "x"))


def test_rows_that_come_slowly_are_no_gaps() -> None:
    """Where each row is five samples after the one before, only more than three times that is a gap."""
    found = gaps(60 * "....x")
    assert found[4] == 4
    assert not any(found[100:])
    usual = "....x" * 60
    assert gaps(usual + int(UNUSUAL * 4) * "." + "x")[-1] == 0
    assert gaps(usual + 20 * "." + "x")[-1] == 20
    assert gaps(500 * "." + "x" + GAP * "." + "x" * PAUSES * 3 + GAP * "." + "x")[-1] == GAP


def test_rows_that_are_absent_from_a_variable_grid() -> None:
    """Where rows are the grid, a long time without any is a gap of so many of the usual ones."""
    _, spec, _ = plant("rc")
    loose = replace(spec, sample_time=None)
    whole, state, found = recorded("rc", 1)[0], init(loose), []
    steps = [0.0, *[2.0] * 40, 200.0, 2.0, 8.0, 2.0, 14.0, 2.0]
    for time, dt in zip(np.cumsum(steps), steps, strict=True):
        state, gap = packed(loose, state, replace(whole, time=float(time), dt=dt))
        found.append(gap)
    assert found[:41] == [0] * 41
    assert found[41] == 99
    assert found[42:45] == [0, 0, 0]  # one of four intervals is no gap, nor does one long one change what is usual much
    assert state.pause == pytest.approx(2.0, rel=1.5)


def test_states_may_be_where_they_have_been_after_a_gap() -> None:
    """Up to twenty samples in proportion, then all the way; what is left is added again, ever less, down to nothing."""
    spec = plant("dc_motor")[1]
    whole, size = recorded("dc_motor", 1)[0], np.array([400.0, 600.0])
    away = replace(init(spec), travel=np.stack([-0.25 * size, 0.75 * size]), held=whole.u)
    none = replace(whole, u=np.full_like(whole.u, np.nan), y=np.full_like(whole.y, np.nan))
    for rows, part in ((2, 0.0), (5, 0.25), (10, 0.5), (FAR, 1.0), (40, 1.0)):
        state = away
        for _ in range(rows):
            state = replace(state, **pack_sample(spec, state, none, state.held)[1])
        found = []
        for _ in range(12):
            row, changes = pack_sample(spec, state, whole, whole.u)
            state = replace(state, **changes)
            found.append(row[spec.sample_fields["gap"]])
        assert found[0] == pytest.approx(part * size)
        assert found[1] == pytest.approx(AGAIN * part * size)
        assert found[2] == pytest.approx(AGAIN**2 * part * size)
        assert not np.any(found[-1])
        assert not np.any(state.astray)


def test_what_inputs_may_have_done_unseen() -> None:
    """Seen again, an input moved at any sample since; while only sensors are, by as much as it ever did at once."""
    spec = plant("dc_motor")[1]
    whole = replace(recorded("dc_motor", 1)[0], y=np.zeros(len(spec.outputs)))
    state, found = init(spec), []
    for word in "8833??5---99-9":  # ?: only sensors have values, -: nothing has
        u = np.array([np.nan if word in "?-" else float(word)])
        sample = replace(whole, u=u, y=np.full(len(spec.outputs), np.nan if word == "-" else 0.0))
        held = np.where(np.isfinite(u), u, state.held)
        found.append(float(doubt(state, sample, held)[0]))
        state = replace(state, **pack_sample(spec, state, sample, held)[1])
    assert found == [0, 0, 0, 0, 0, 5, 2, 0, 0, 0, 12, 0, 0, 0]
    assert (state.leap.tolist(), state.lowest.tolist(), state.highest.tolist()) == ([5.0], [3.0], [9.0])
    long = replace(state, guessed=np.array([1e6]))
    assert doubt(long, replace(whole, u=np.array([7.0])), np.array([7.0])).tolist() == [2.0 * LONGEST]


def test_accepted_faults_of_instruments_are_corrected() -> None:
    """What acts is the input and its offset; a reading loses its offset and gain; a sensor out of use is missing."""
    _, spec, _ = plant("dc_motor_current")
    state = replace(
        init(spec),
        input_offset=np.array([0.5]),
        reading_gain=np.array([2.0, 1.0]),
        reading_offset=np.array([0.3, 0.0]),
        reading_noise=np.array([1.0, np.inf]),
    )
    found = corrected(state, Sample(time=1.0, dt=0.02, u=np.array([4.0]), y=np.array([6.3, 1.0])))
    assert found.u.tolist() == [4.5]
    assert found.y[0] == pytest.approx(3.0)
    assert np.isnan(found.y[1])
