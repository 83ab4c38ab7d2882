"""Samples as the engine takes them after a gap."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.contract.spec import EngineSpec
from faultbond.runtime.packing import GAP, PAUSES, UNUSUAL, corrected, pack_sample
from faultbond.runtime.state import Sample, State, init
from faultbond.runtime.unseen import AGAIN, FAR, LONGEST, MOVES, doubt
from made import changed, plant, recorded


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
    u = np.where(np.isfinite(sample.u), sample.u, state.inputs.held)
    row, after = pack_sample(spec, changed(state, astray=np.zeros_like(state.healthy.astray)), sample, u)
    gap = row[spec.sample_fields["gap"]][0] / spec.states[0].drift
    return changed(after, index=state.clock.index + 1), round(gap)


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
    assert state.clock.pause == pytest.approx(2.0, rel=1.5)


def test_states_may_be_where_they_have_been_after_a_gap() -> None:
    """Up to twenty samples in proportion, then all the way; what is left is added again, ever less, down to nothing."""
    spec = plant("dc_motor")[1]
    whole, size = recorded("dc_motor", 1)[0], np.array([400.0, 600.0])
    away = changed(init(spec), travel=np.stack([-0.25 * size, 0.75 * size]), held=whole.u)
    none = replace(whole, u=np.full_like(whole.u, np.nan), y=np.full_like(whole.y, np.nan))
    for rows, part in ((2, 0.0), (5, 0.25), (10, 0.5), (FAR, 1.0), (40, 1.0)):
        state = away
        for _ in range(rows):
            state = pack_sample(spec, state, none, state.inputs.held)[1]
        found = []
        for _ in range(12):
            row, state = pack_sample(spec, state, whole, whole.u)
            found.append(row[spec.sample_fields["gap"]])
        assert found[0] == pytest.approx(part * size)
        assert found[1] == pytest.approx(AGAIN * part * size)
        assert found[2] == pytest.approx(AGAIN**2 * part * size)
        assert not np.any(found[-1])
        assert not np.any(state.healthy.astray)


def told(words: str, spec: EngineSpec) -> tuple[State, list[tuple[float, float]]]:
    """Tell a motor's voltage word by word, and what is doubted; `?`: only the sensor has a value, `-`: nothing has."""
    whole = recorded("dc_motor", 1)[0]
    state, found = init(spec), []
    for word in words:
        u = np.array([np.nan if word in "?-" else float(word)])
        sample = replace(whole, u=u, y=np.full(len(spec.outputs), np.nan if word == "-" else 0.0))
        held = np.where(np.isfinite(u), u, state.inputs.held)
        change, count = doubt(state.inputs, sample, held)
        found.append((float(change[0]), float(count[0])))
        state = pack_sample(spec, state, sample, held)[1]
    return state, found


def test_what_inputs_may_have_done_unseen() -> None:
    """Told again, an input changed at any sample since; while only sensors are seen, it is off by its usual move."""
    spec = plant("dc_motor")[1]
    state, found = told("8833??2---99-9", spec)
    usual = 5.0 * np.sqrt(1.0 / MOVES) * np.sqrt(1.0 - 1.0 / MOVES)  # one move by 5, and a sample without any
    assert found[:5] == [(0.0, 0.0)] * 5
    assert found[5] == pytest.approx((usual, 1.0))
    assert found[6] == (-1.0, 2.0)
    assert found[7:10] == [(0.0, 0.0)] * 3
    assert found[10] == (7.0, 3.0)
    assert found[11:] == [(0.0, 0.0), (0.0, 0.0), (0.0, 1.0)]
    assert (state.inputs.lowest.tolist(), state.inputs.highest.tolist()) == ([2.0], [9.0])
    assert told("12" + 200 * "-" + "9", spec)[1][-1] == (7.0, LONGEST)
    jumped, _ = told("2222" + 200 * "-" + "9999", spec)
    assert jumped.inputs.leap.tolist() == [0.0]  # nobody knows in how many steps it went over a gap
    loose, rows = replace(spec, sample_time=None), recorded("dc_motor", 1)[0]
    state = init(loose)
    for dt, value in ((0.0, 2.0), *((1.0, 2.0),) * 9, (90.0, 9.0)):  # rows are the grid, and one comes late
        u = np.array([value])
        state = pack_sample(loose, state, replace(rows, u=u, dt=dt), u)[1]
    assert state.inputs.leap.tolist() == [0.0]


def test_an_input_that_is_logged_when_it_changes_is_known_between() -> None:
    """Where an input is told in few samples only, its empty cells are no doubt; where it mostly is, they are."""
    spec = plant("dc_motor")[1]
    _, found = told("12" + "?????????3?????????1" * 60, spec)
    assert found[11] == (1.0, 9.0)
    assert found[-30:] == [(0.0, 0.0)] * 30
    _, found = told("12" + "1212121?2" * 20, spec)
    assert (1.0, 1.0) in found[-9:]


def test_a_sensor_whose_input_is_unknown_says_nothing() -> None:
    """What a sensor feels of an input at once is not held against the model while that input is missing."""
    spec = plant("tank")[1]
    flow = [item.name for item in spec.outputs].index("flow")
    whole, state = recorded("tank", 1)[0], init(spec)
    for value in (50.0, 51.0, 51.0):
        state = pack_sample(spec, state, whole, np.array([value, 20.0]))[1]
    state = changed(state, since_step=np.full(2, np.inf))
    missing = replace(whole, u=np.array([np.nan, 20.0]))
    row, _ = pack_sample(spec, state, missing, np.array([51.0, 20.0]))
    blank = row[spec.sample_fields["scale"]] == spec.thresholds.blank_factor
    assert [k for k, item in enumerate(blank) if item] == [flow]


def test_nothing_is_added_while_nothing_is_measured() -> None:
    """Between two gaps with a row between them, states do not stray farther at each sample without any value."""
    spec = plant("dc_motor")[1]
    whole, far = recorded("dc_motor", 1)[0], np.array([[0.0, 0.0], [400.0, 600.0]])
    none = replace(whole, u=np.full_like(whole.u, np.nan), y=np.full_like(whole.y, np.nan))
    blind = replace(whole, y=np.full_like(whole.y, np.nan))
    state, found = changed(init(spec), travel=far, held=whole.u), []
    for sample in [none] * 40 + [whole] + [none] * 30 + [blind] * 3 + [whole] * 2:
        row, state = pack_sample(spec, state, sample, whole.u)
        found.append(row[spec.sample_fields["gap"]][1] / 600.0)
    assert found[40:41] == pytest.approx([1.0])
    assert not any(found[41:71])
    assert found[71:76] == pytest.approx([1.0, 0.0, 0.0, AGAIN, AGAIN**2])


def test_accepted_faults_of_instruments_are_corrected() -> None:
    """What acts is the input and its offset; a reading loses its offset and gain; a sensor out of use is missing."""
    _, spec, _ = plant("dc_motor_current")
    normal = replace(
        init(spec).normal,
        input_offset=np.array([0.5]),
        gain=np.array([2.0, 1.0]),
        offset=np.array([0.3, 0.0]),
        noise=np.array([1.0, np.inf]),
    )
    found = corrected(normal, Sample(time=1.0, dt=0.02, u=np.array([4.0]), y=np.array([6.3, 1.0])))
    assert found.u.tolist() == [4.5]
    assert found.y[0] == pytest.approx(3.0)
    assert np.isnan(found.y[1])
