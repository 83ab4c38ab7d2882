"""Samples as the filters take them, next to formulas over all that came before."""

from collections.abc import Iterable

import numpy as np
import pytest

from bare_core import CELL, FOLLOWING, Bare, bare
from faultbond.arrays import FloatArray
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
CALLS = """
static Filters filters;
static Trial trial;
void t_correct(State *state, Sample *sample) { correct(&state->normal, sample); }
void t_resume(State *state) { resume(&state->clock); }
void t_pack(State *state, const Sample *sample, double *packed)
{
    pack_sample(state, sample, &state->clock, &state->inputs, state->healthy.astray, packed);
    state->clock.index++;
}
void t_doubt(State *state, const Sample *sample, double *change, double *count)
{
    for (int k = 0; k < N_INPUTS; k++) change[k] = doubt(&state->inputs, sample, k, &count[k]);
}
void t_allow(State *state, const double *change, const double *count, double *packed)
{
    prepare_filters(&filters);
    allow(&state->healthy, &state->normal, change, count, packed, &trial, &filters.plain);
}
int64_t t_unknown(State *state) { return any_unknown(&state->inputs); }
"""
DT, NONE = 0.5, (np.nan, np.nan)
SIZES = np.array([2.0, 0.5])  # of the inputs V, W


def row(u: Iterable[float] = (2.0, 0.5), y: Iterable[float] = (0.1, 1.0), dt: float = DT) -> FloatArray:
    """A sample."""
    return np.array([0.0, dt, *u, *y])


def packed(core: Bare, sample: FloatArray) -> dict[str, FloatArray]:
    """Pack the next sample; gives it by field."""
    found = np.full(core.spec.n_sample, 9.9)
    core.call("t_pack", sample, found)
    return {name: found[place] for name, place in core.spec.sample_fields.items()}


def gaps(core: Bare, pattern: str, dt: float = DT) -> list[int]:
    """The gap that each sample tells of; `.` is one without any value, `y` and `u` have only sensors or inputs."""
    found = []
    for letter in "x" + pattern:
        core["healthy.astray"] = 0.0
        sample = row(SIZES if letter in "xu" else NONE, (0.1, 1.0) if letter in "xy" else NONE, dt)
        found.append(round(packed(core, sample)["gap"][0] / core.spec.states[0].drift))
    return found[1:]


def test_a_sample_after_a_gap_tells_how_long_it_was() -> None:
    """Three samples or more without any value are a gap; it is told once, by the sample after it."""
    assert gaps(bare(CALLS), "xxx...xxx") == [0] * 6 + [3, 0, 0]
    assert gaps(bare(CALLS), "xxx" + 200 * "." + "x") == [0] * 203 + [200]
    assert not any(gaps(bare(CALLS), "xx..xx" + 50 * "y" + "x" + 50 * "u" + "x"))
    core = bare(CALLS)
    assert gaps(core, "x") == [0]
    core.call("t_resume")
    assert gaps(core, "") == []
    assert core["clock.silent"] == 0
    core.call("t_resume")
    assert round(packed(core, row())["gap"][0] / core.spec.states[0].drift) == 1000


def test_rows_that_come_slowly_are_no_gaps() -> None:
    """Where each row is five samples after the one before, only more than three times that is a gap."""
    found = gaps(bare(CALLS), 60 * "....x")
    assert found[4] == 4
    assert not any(found[100:])
    assert gaps(bare(CALLS), "....x" * 60 + 12 * "." + "x")[-1] == 0
    assert gaps(bare(CALLS), "....x" * 60 + 20 * "." + "x")[-1] == 20
    assert gaps(bare(CALLS), 500 * "." + "x...x" + "x" * 60 + "...x")[-1] == 3


def test_rows_that_are_absent_from_a_variable_grid() -> None:
    """Where rows are the grid, a long time without any is a gap of so many of the usual ones."""
    core = bare(CALLS, CELL.replace("sample_time: 0.5 s", "sample_time: variable"))
    steps, drift = [0.0, *[2.0] * 40, 200.0, 2.0, 8.0, 2.0, 14.0, 2.0], core.spec.states[0].drift
    found = []
    for dt in steps:
        core["healthy.astray"] = 0.0
        found.append(round(packed(core, row(dt=dt))["gap"][0] / drift))
    assert found == [0] * 41 + [99] + [0] * 5
    assert core["clock.pause"] == pytest.approx(2.0, rel=1.5)
    assert core["inputs.leap"].tolist() == [0.0, 0.0]
    core["healthy.astray"] = 0.0
    core.call("t_resume")  # for how long there was none nobody knows
    assert round(packed(core, row(dt=2.0))["gap"][0] / drift) == 1000


def test_a_run_begins_at_the_first_sample_or_after_a_gap_before_the_filter_runs() -> None:
    """The first sample has no length and moves nothing; innovations are bounded once the filter is warm."""
    core = bare(CALLS)
    core["clock.index"] = 7
    first = packed(core, row())
    assert (first["dt"][0], core["clock.begun"][0], first["u_before"].tolist()) == (0.0, 7, SIZES.tolist())
    for _ in range(4):
        packed(core, row(NONE, NONE))
    packed(core, row())
    assert core["clock.begun"] == 12
    core["clock.running"] = 1
    for _ in range(4):
        packed(core, row(NONE, NONE))
    core["clock.index"] = 12 + core.spec.thresholds.warm_up_samples - 1
    assert packed(core, row())["bound"] == 0.0
    assert packed(core, row())["bound"] == core.spec.thresholds.learning_bound
    assert core["clock.begun"] == 12


def test_states_may_be_where_they_have_been_after_a_gap() -> None:
    """Up to twenty samples in proportion, then all the way; what is left is added again, ever less, down to nothing."""
    for rows, part in ((2, 0.0), (5, 0.25), (10, 0.5), (20, 1.0), (40, 1.0)):
        core, found = bare(CALLS), []
        core["healthy.travel"], core["inputs.held"] = (-100.0, 300.0), SIZES
        for _ in range(rows):
            assert not packed(core, row(NONE, NONE))["gap"].any()
        for _ in range(12):
            found.append(packed(core, row())["gap"][0])
            assert not packed(core, row(SIZES, NONE))["gap"].any()  # a sample in which states are not looked for
        assert found[:3] == pytest.approx([part * 400.0, 0.3 * part * 400.0, 0.09 * part * 400.0])
        assert not core["healthy.astray"].any()
        assert found[-1] == 0.0


def test_packed_samples_follow_from_all_that_came_before() -> None:
    """Held inputs, blanked sensors, kicks, and what is known of the inputs, by formulas over the whole past."""
    generator, core, n = np.random.default_rng(5), bare(CALLS, FOLLOWING), 400
    u = np.repeat(generator.uniform(0.5, 1.0, (n // 20, 2)), 20, axis=0) * SIZES * [1.0, -1.0]
    y = generator.normal(0.0, 1.0, (n, 2))
    u[generator.random(u.shape) < [0.1, 0.7]] = np.nan
    y[generator.random(y.shape) < 0.3] = np.inf
    u[0] = SIZES
    core["normal.noise"], core["sensors.nis"] = (4.0, 1.0), (0.7, 1.3)
    told, there = np.isfinite(u), np.isfinite(y)
    held = np.array([[column[: k + 1][told[: k + 1, c]][-1] for c, column in enumerate(u.T)] for k in range(n)])
    moved = np.diff(held, axis=0, prepend=held[:1])
    step, ages = np.zeros((n, 2), dtype=bool), DT * np.arange(n)
    each, memory = dict(core.spec.slow_errors[1].after), core.spec.slow_errors[1].memory
    assert (each, memory) == ({0: 2e-3, 1: 30e-3}, 6.0)
    leap, habit = np.zeros(2), np.ones(2)
    for k in range(n):
        found = packed(core, row(u[k], y[k]))
        peak = np.nanmax(np.abs(u[: k + 1]), axis=0)
        step[k] = np.abs(moved[k]) > [
            max(item.step, item.step_part * p) for item, p in zip(core.spec.inputs, peak, strict=True)
        ]
        felt = np.sum(moved[: k + 1] * np.exp(-ages[: k + 1][::-1, None] / memory), axis=0)
        kick = (1.0 - np.exp(-2.0 * DT / memory)) * sum((weight * felt[c]) ** 2 for c, weight in each.items())
        settling = bool(step[max(k - 5, 0) : k + 1, 0].any())
        unseen = not told[k, 0] and leap[0] > 0.0
        assert found["u_before"] == pytest.approx(held[max(k - 1, 0)])
        assert found["u"] == pytest.approx(held[k])
        assert found["y"] == pytest.approx(np.where(there[k], y[k], 0.0))
        assert found["use"].tolist() == there[k].tolist()
        assert found["nis"].tolist() == [0.7, 1.3]
        blank = core.spec.thresholds.blank_factor
        scale = [blank if settling or unseen else 4.0 if there[k, 0] else 1.0, 1.0]
        assert found["scale"].tolist() == scale, k
        assert found["kick"] == pytest.approx([0.0, kick if k else 0.0], rel=1e-9)
        guessed = np.array([k - np.flatnonzero(told[:k, c])[-1] - 1 if k else 0 for c in range(2)])
        whole = told[k] & (guessed == 0)
        leap = np.where(whole, np.sqrt((1.0 - 1.0 / 300.0) * leap**2 + moved[k] ** 2 / 300.0), leap)
        habit += (told[k] - habit) / 1000.0 * (told[k].any() or there[k].any())
    assert core["inputs.leap"] == pytest.approx(leap)
    assert core["inputs.habit"] == pytest.approx(habit)
    assert core["inputs.lowest"] == pytest.approx(np.nanmin(u, axis=0))
    assert core["inputs.highest"] == pytest.approx(np.nanmax(u, axis=0))
    assert core["inputs.change"] == pytest.approx([felt[c] for c in each])


def test_what_inputs_may_have_done_unseen() -> None:
    """Told again, an input changed at any sample since; while only sensors are seen, it is off by its usual move."""
    core, found, unknown = bare(CALLS), [], []
    for word in "8833??2---99-9??????9":
        sample = row((np.nan if word in "?-" else float(word), 0.5 if word not in "?-" else np.nan))
        sample[4:] = NONE if word == "-" else (0.0, 0.0)
        change, count = np.full(2, 9.9), np.full(2, 9.9)
        core.call("t_doubt", sample, change, count)
        found.append((change[0], count[0]))
        assert change[1] == 0.0  # an input that never moves is where it was
        packed(core, sample)
        unknown.append(core.call("t_unknown"))
    usual = 5.0 * np.sqrt(1.0 / 300.0) * np.sqrt(1.0 - 1.0 / 300.0)  # one move by 5, and a sample without any
    assert found[:5] == [(0.0, 0.0)] * 5
    assert found[5] == pytest.approx((usual, 1.0))
    assert found[6:14] == [(-1.0, 2.0), *[(0.0, 0.0)] * 3, (7.0, 3.0), *[(0.0, 0.0)] * 2, (0.0, 1.0)]
    assert unknown == [0] * 9 + [1] + [0] * 6 + [1] * 4 + [0]
    core["inputs.guessed"] = 200.0
    change, count = np.zeros(2), np.zeros(2)
    core.call("t_doubt", row((11.0, 0.5)), change, count)
    assert (change[0], count[0]) == (2.0, 50.0)
    core["inputs.habit"] = 0.5  # one that is logged when it changes
    core.call("t_doubt", row((11.0, 0.5)), change, count)
    assert (change[0], count[0]) == (0.0, 0.0)


def allowed(change: Iterable[float], count: Iterable[float], travel: float, gap: float) -> float:
    """What the charge is uncertain by after inputs may have changed; with how far it ever moved, and sd before."""
    core = bare(CALLS)
    core.begin(np.array([1.0]))
    core["healthy.travel"], core["inputs.held"] = (0.0, travel), SIZES
    found = np.zeros(core.spec.n_sample)
    core.call("t_pack", row(), found)
    place = core.spec.sample_fields["gap"]
    found[place] = gap
    before = found.copy()
    core.call("t_allow", np.array([*change]), np.array([*count]), found)
    assert np.array_equal(np.delete(found, place), np.delete(before, place))
    return float(found[place][0])


def test_what_an_unseen_move_does_to_the_states() -> None:
    """As far as one step takes the charge under each move, times the samples, at most as far as it ever moved."""
    one = 3.0 / 10.0 * DT * (1.0 - 0.5 * DT / 10.0)  # of V, through 10 ohm into 1 F; to second order
    assert allowed((3.0, 0.0), (1.0, 1.0), 1e3, 0.0) == pytest.approx(one, rel=1e-3)
    one = allowed((3.0, 0.0), (1.0, 1.0), 1e3, 0.0)
    other = allowed((0.0, -0.4), (1.0, 1.0), 1e3, 0.0)
    assert other == pytest.approx(0.4 * DT, rel=0.03)
    assert allowed((3.0, 0.0), (7.0, 1.0), 1e3, 0.0) == pytest.approx(7.0 * one)
    assert allowed((3.0, 0.0), (7.0, 1.0), 3.0 * one, 0.0) == pytest.approx(3.0 * one)
    assert allowed((3.0, 0.0), (7.0, 1.0), 0.0, 0.0) == pytest.approx(one)
    assert allowed((3.0, -0.4), (1.0, 7.0), 1e3, 2.0) == pytest.approx(np.sqrt(4.0 + one**2 + 49.0 * other**2))
    assert allowed((np.inf, 0.0), (1.0, 1.0), 5.0, 0.0) == 5.0
    assert allowed((0.0, 0.0), (7.0, 7.0), 1e3, 2.0) == 2.0


def test_accepted_faults_of_instruments_are_corrected() -> None:
    """What acts is the input and its offset; a reading loses its offset and gain; a sensor out of use is missing."""
    core, sample = bare(CALLS), row((4.0, np.nan), (6.3, 1.0))
    core["normal.input_offset"], core["normal.gain"] = (0.5, 1.0), (2.0, 1.0)
    core["normal.offset"], core["normal.noise"] = (0.3, 0.0), (1.0, np.inf)
    core.call("t_correct", sample)
    assert sample == pytest.approx(row((4.5, np.nan), (3.0, np.nan)), nan_ok=True)
    core["normal.input_gain"], sample = (1.0, 0.0), row((4.0, np.nan))
    core.call("t_correct", sample)
    assert sample[2:4].tolist() == [4.5, 1.0]  # of one that stuck it is known without its record
