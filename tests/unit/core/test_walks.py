"""How far the parameters of the healthy filter walk: against the same written down plainly, and what alarms."""

from collections.abc import Sequence
from math import sqrt

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.spec import covariance_place
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SETTINGS = core_settings()
EVERY, WALKS, RATIO, SETTLES = (int(SETTINGS[name]) for name in ("WALK_EVERY", "WALKS", "WALK_RATIO", "WALK_SETTLES"))
LIMIT, START_LIMIT, USUAL, TRUST, MOST, LEAST, DEGREES = (
    SETTINGS[name]
    for name in ("WALK_LIMIT", "START_LIMIT", "WALK_USUAL", "WALK_TRUST", "WALK_MOST", "WALK_LEAST", "WALK_DEGREES")
)
CALLS = """
void t_remember(State *state, const double *lane)
{
    double walks[FB_ROOM(TRIANGLE(N_PARAMETERS))];
    remember(state, lane, walks);
}
void t_start(State *state, const double *lane)
{
    memcpy(state->healthy.snapshots[AT_START], lane, PLAIN_NUMBERS * sizeof *lane);
}
int64_t t_together(State *state, const double *old, const double *rates, double *found)
{
    double matrix[FB_ROOM(TRIANGLE(N_PARAMETERS))];
    *found = walk_together(&state->healthy, old, rates, n_together(rates), matrix);
    return n_together(rates);
}
int64_t t_detect(State *state) { return detect(state); }
int64_t t_is_alarming(State *state) { return is_alarming(&state->clock, &state->sensors, &state->healthy); }
"""


def lane_of(core: Bare, values: FloatArray, variances: FloatArray) -> FloatArray:
    """A healthy lane whose parameters have these values and variances, each (n_parameters,)."""
    lane, where = np.zeros(core.spec.n_numbers), core.spec.parameter_slice
    lane[where] = values
    lane[[covariance_place(core.spec, k, k) for k in range(where.start, where.stop)]] = variances
    return lane


def begun(text: str = CELL, **clock: int) -> Bare:
    """A core that runs since sample 0, whose parameters start at 1 with a variance of 1."""
    core = bare(CALLS, text)
    for name, value in {"begun": 0, "running": 1, **clock}.items():
        core[f"clock.{name}"] = value
    n = len(core.spec.parameters)
    core.call("t_start", lane_of(core, np.ones(n), np.ones(n)))
    return core


def walked(core: Bare, values: FloatArray, variances: FloatArray) -> list[tuple[float, int]]:
    """Let the parameters go this way, (rows, n_parameters), one row each EVERY samples; gives the largest walks."""
    found = []
    for value, variance in zip(values, variances, strict=True):
        core.call("t_remember", lane_of(core, value, variance))
        found.append((float(core["healthy.walk"][0]), int(core["healthy.walker"][0])))
        core["clock.index"] += EVERY
    return found


def limit_together(n: int) -> float:
    """The root of a mean of n squares that is as rare as a normal number of LIMIT."""
    degrees = min(n, DEGREES)
    return float((1.0 - 2.0 / (9.0 * degrees) + LIMIT * sqrt(2.0 / (9.0 * degrees))) ** 1.5)


def plainly(values: FloatArray, variances: FloatArray) -> list[tuple[float, int]]:
    """The same, written down plainly from the definition."""
    rows, n = values.shape
    sums, windows, found = np.zeros((WALKS, n + 1)), np.zeros(WALKS), []
    usuals = np.full((rows, WALKS, n + 1), np.nan)

    def usual(window: int) -> FloatArray:
        told = np.full(n + 1, USUAL)
        for w in range(window + 1):
            told = (TRUST * told + sums[w]) / (TRUST + windows[w])
        return told

    for row in range(rows):
        scores = np.zeros((2 * WALKS + 1, n))
        for window in range(WALKS):
            length = RATIO**window
            before = (-(-row // length) - 2) * length
            if before * EVERY < SETTLES:
                continue
            shrunk = np.maximum(variances[before] - variances[row], LEAST * variances[row])
            moved = (values[row] - values[before]) ** 2
            together = np.mean(moved / (variances[before] - (1.0 - LEAST) * variances[row]))
            square = np.append(moved / shrunk, together)
            walks = np.sqrt(square / np.maximum(usuals[before, window], 1.0))
            scores[window] = walks[:n] / LIMIT
            scores[WALKS + 1 + window, int(np.argmax(walks[:n]))] = walks[n] / limit_together(n)
            windows[window] += 1.0 / (row - before)
            sums[window] += np.minimum(square, MOST * np.maximum(usual(window), 1.0)) / (row - before)
        if row * EVERY >= SETTLES:
            left = variances[row]
            gone, most = np.maximum(1.0 - left, LEAST), np.maximum(usual(WALKS - 1)[:n], 1.0)
            scores[WALKS] = np.abs(values[row] - 1.0) / np.sqrt(gone * (gone + most * left)) / START_LIMIT
        for window in range(WALKS):
            usuals[row, window] = usual(window)
        k = int(np.argmax(scores))
        found.append((float(scores.flat[k]), k if scores.flat[k] > 0.0 else 0))
    return found


def steady(rows: int, n: int, seed: int = 1, learned: float = 0.02) -> tuple[FloatArray, FloatArray]:
    """Estimates of constants that move half as far as they may: a row brings 1 / learned^2 of information."""
    generator = np.random.default_rng(seed)
    variances = 1.0 / (1.0 + np.arange(1, rows + 1) / learned**2)
    steps = np.sqrt(-np.diff(variances, prepend=1.0))[:, None] * generator.standard_normal((rows, n))
    return 1.0 + 0.5 * np.cumsum(steps, axis=0), np.repeat(variances[:, None], n, axis=1)


def test_walks_are_judged_as_written_down_plainly() -> None:
    """Over all windows and since the start, with what is usual as it was before each window."""
    core = begun(quiet=1)
    n = len(core.spec.parameters)
    values, variances = steady(700, n)
    values[400:, 0] += 0.002 * np.arange(300)
    found, expected = walked(core, values, variances), plainly(values, variances)
    assert [walk for walk, _ in found] == pytest.approx([walk for walk, _ in expected], rel=1e-9)
    assert [walker for _, walker in found] == [walker for _, walker in expected]
    assert {walker // n for _, walker in found} >= {0, 1, 2, 3, 4}


def test_what_parameters_walk_together_is_that_of_dense_algebra() -> None:
    """d' (P_s - P_t)^-1 d by their number, of those that can move and do not by themselves."""
    core, generator = begun(), np.random.default_rng(5)
    n, where = len(core.spec.parameters), core.spec.parameter_slice
    places = [
        [covariance_place(core.spec, *sorted((i, j))) for j in range(where.start, where.stop)]
        for i in range(where.start, where.stop)
    ]
    for moving in (None, 0, n - 1):
        root, loss = (generator.standard_normal((n, n)) for _ in range(2))
        left, values = root @ root.T, generator.standard_normal((2, n))
        before = left + 0.3 * loss @ loss.T
        old, now, found = np.zeros(core.spec.n_numbers), np.zeros(core.spec.n_numbers), np.zeros(1)
        old[where], now[where] = values
        old[places], now[places] = before, left
        core["healthy.lane"] = now
        rates = np.zeros(n)
        if moving is not None:
            rates[moving] = 1e-3
        kept = np.flatnonzero(rates == 0.0)
        count = core.call("t_together", old, rates, found)
        moved, matrix = (values[1] - values[0])[kept], (before - (1.0 - LEAST) * left)[np.ix_(kept, kept)]
        assert count == len(kept)
        assert found[0] == pytest.approx(moved @ np.linalg.solve(matrix, moved) / count, rel=1e-8)


def test_parameters_that_are_not_parted_count_once() -> None:
    """Of two that the data know as one, and have not learned, what their walks differ by says nothing."""
    core = begun()
    n, where = len(core.spec.parameters), core.spec.parameter_slice
    old, now, found = np.zeros(core.spec.n_numbers), np.zeros(core.spec.n_numbers), np.zeros(1)
    for lane, variance in ((old, 2.0), (now, 1.0)):
        for i in range(where.start, where.stop):
            for j in range(i, where.stop):
                lane[covariance_place(core.spec, i, j)] = variance
    now[where] = 1.0 + 1e-3 * np.arange(n)
    core["healthy.lane"] = now
    core.call("t_together", old, np.zeros(n), found)
    assert found[0] == pytest.approx(1.0 / (1.0 + LEAST) / n)


def test_a_walk_that_parameters_share_alarms_where_none_does_alone() -> None:
    """Each moves by less than its limit; the alarm knows that it was by all, and over which window."""
    core = begun()
    n = len(core.spec.parameters)
    values, variances = steady(400, n)
    values = 1.0 + 0.1 * (values - 1.0)
    values[20:] += 0.003 * np.arange(380)[:, None]
    found = walked(core, values, variances)
    first = next(k for k, (walk, _) in enumerate(found) if walk > 1.0)
    assert first > 20
    assert found[first][1] // n > WALKS


def test_a_constant_that_is_learned_raises_no_alarm() -> None:
    """Of ten that move as their variances allow none alarms; one that moves on alarms, with its name."""
    most = []
    for seed in range(10):
        core = begun()
        values, variances = steady(400, len(core.spec.parameters), seed)
        most.append(max(walk for walk, _ in walked(core, values, variances)))
    assert max(most) < 1.0
    assert min(most) > 0.1
    core = begun()
    values, variances = steady(400, len(core.spec.parameters))
    values[200:, 1] += 0.003 * np.arange(200)
    found = walked(core, values, variances)
    first = next(k for k, (walk, _) in enumerate(found) if walk > 1.0)
    assert first > 200
    assert found[first][1] % len(core.spec.parameters) == 1


def test_what_was_found_of_a_parameter_on_healthy_data_is_no_start_that_is_off() -> None:
    """A value that is off from the start counts in the width of what is known and of what it was found to move by."""
    moves, off, rows = 0.5, 2.0, 6
    told = CELL.replace("{R1: 10 ohm}", f"{{R1: {{nominal: 10 ohm, healthy_change: {100.0 * moves} %}}}}")
    assert told != CELL
    found = []
    for text in (CELL, told):
        core = begun(text)
        n = len(core.spec.parameters)
        values, variances = np.ones((rows, n)), np.full((rows, n), 1e-6)
        values[:, [item.name for item in core.spec.parameters].index("R1")] += off
        found.append(walked(core, values, variances)[-1][0])
    assert found[0] == pytest.approx(off / START_LIMIT, rel=1e-4)
    assert found[1] == pytest.approx(off / sqrt(1.0 + moves**2) / START_LIMIT, rel=1e-4)


def test_what_walks_by_nature_is_let_walk() -> None:
    """A parameter that has always walked far is not as loud as one that begins to."""
    loud = []
    for from_row in (3, 300):
        core = begun()
        n = len(core.spec.parameters)
        values, variances = steady(600, n, 3)
        wild = np.random.default_rng(4).standard_normal(600 - from_row) * 3.0
        values[from_row:, 0] += wild * np.sqrt(variances[from_row:, 0] * 0.2)
        loud.append(max(walk for walk, _ in walked(core, values, variances)))
    assert loud[0] < loud[1]


@pytest.mark.parametrize(("off", "alarms"), [(3.0, False), (5.0, True)])
def test_what_was_off_from_the_first_sample_is_found(off: float, alarms: bool) -> None:
    """Where a parameter turns out to lie so many accuracies off, and has walked no more since it was found."""
    core = begun(quiet=1)
    n = len(core.spec.parameters)
    values, variances = steady(60, n)
    values[:, 0] += off
    walks = walked(core, values, variances)
    assert (max(walk for walk, _ in walks) > 1.0) == alarms
    assert max(walks)[1] == WALKS * n


def alarm_at(core: Bare, walk: float, walker: int) -> list[int]:
    """Judge a walk at sample 5000; the onset, whose it is, its window, and the lane that counts as old; -1: none."""
    core["clock.index"], core["healthy.walk"], core["healthy.walker"] = 5000, walk, walker
    onset = core.call("t_detect")
    assert core.call("t_is_alarming") == (walk > 1.0)
    return [onset, *(int(core[f"alarm.{name}"][0]) for name in ("walker", "window", "old"))]


def test_the_alarm_knows_which_parameter_walked_and_since_when() -> None:
    """Only of a walk that began before the trail does the bank begin with the parameters of before."""
    n, history = len(begun().spec.parameters), begun().spec.thresholds.history_samples
    oldest = 5000 - history
    assert alarm_at(begun(), 0.9, 0)[0] == -1
    assert alarm_at(begun(), 1.2, 1) == [4800 if history >= 200 else oldest, 1, 0, -1]
    assert alarm_at(begun(), 1.2, 2 * n) == [oldest, 0, 2, 4 + 4 % 2]
    assert alarm_at(begun(), 1.2, (WALKS + 1 + 2) * n) == [oldest, 0, WALKS + 1 + 2, 4 + 4 % 2]
    assert alarm_at(begun(), 1.2, WALKS * n + 1) == [oldest, 1, WALKS, 2 * WALKS]


def test_after_an_alarm_or_what_was_accepted_walks_begin_anew() -> None:
    """Nothing is judged while an alarm is open; what was accepted starts the windows again, and has no start."""
    values, variances = steady(60, len(begun().spec.parameters))
    values[:, 0] += 9.0
    assert max(walk for walk, _ in walked(begun(alarm=1), values, variances)) == 0.0
    found = walked(begun(accepted=1000), values, variances)
    assert max(walk for walk, _ in found) < 1.0
    first = next(k for k, (walk, _) in enumerate(found) if walk > 0.0)
    assert first * EVERY > 1000 + SETTLES


def kept_by(core: Bare, samples: Sequence[int]) -> FloatArray:
    """Which lanes are kept after some samples: the times of all, 0 where there is none."""
    for index in samples:
        core["clock.index"], core["clock.time"] = index, 1000.0 + index
        core.call("t_remember", np.full(core.spec.n_numbers, 0.5))
    width = core.spec.n_numbers + len(core.spec.parameters) + 2
    return np.array(core["healthy.snapshots"]).reshape(-1, width)[:, -1]


def test_at_an_alarm_the_lane_stays_with_which_it_was_compared() -> None:
    """It is that from which lanes begin, and its time that of the onset."""
    kept = []
    for far in (0.0, 9.0):
        core = begun()
        values, variances = steady(10, len(core.spec.parameters))
        values[9] += far
        for row in range(10):
            core["clock.time"] = 1000.0 + row * EVERY
            walked_one = walked(core, values[row : row + 1], variances[row : row + 1])
        width = core.spec.n_numbers + len(core.spec.parameters) + 2
        kept.append((walked_one[0][0] > 1.0, np.array(core["healthy.snapshots"]).reshape(-1, width)[:2, -1].tolist()))
    assert kept == [(False, [1800.0, 1900.0]), (True, [1800.0, 1700.0])]


def test_two_lanes_of_each_window_are_kept() -> None:
    """At multiples of the window, the last two, with their times."""
    kept = kept_by(begun(), range(1, 1801))
    expected = np.zeros(2 * WALKS + 1)
    for window in range(WALKS):
        length = EVERY * RATIO**window
        for number in (1800 // length - 1, 1800 // length):
            if number * length >= SETTLES:
                expected[2 * window + number % 2] = 1000.0 + number * length
    assert kept.tolist() == expected.tolist()


@pytest.mark.parametrize(
    ("changes", "walker"), [((5.0, 5.0), None), ((5.0, 3.5), 0), ((3.5, 5.0), 1), ((0.7, -0.7), 0)]
)
def test_what_goes_together_walks_together(changes: tuple[float, float], walker: int | None) -> None:
    """Five accuracies of both are none of either beside the other; 1.5 in their ratio are eight of those of the ratio.

    changes : of both parameters since the start, in accuracies, of which little is then left open
    """
    core = bare(CALLS, CELL + "correlations: {R1: {C1: 0.98}}\n")
    for name, value in {"begun": 0, "running": 1}.items():
        core[f"clock.{name}"] = value
    prior = np.array([[1.0, 0.98], [0.98, 1.0]])

    def lane(at: FloatArray, left: float) -> FloatArray:
        numbers = lane_of(core, 1.0 + 0.03 * at, np.full(2, 0.03**2 * left))
        first = core.spec.parameter_slice.start
        numbers[covariance_place(core.spec, first, first + 1)] = 0.03**2 * left * prior[0, 1]
        return numbers

    core.call("t_start", lane(np.zeros(2), 1.0))
    walks = []
    for _ in range(12):
        core.call("t_remember", lane(np.array(changes), 0.01))
        walks.append((float(core["healthy.walk"][0]), int(core["healthy.walker"][0])))
        if walks[-1][0] > 1.0:  # an alarm
            break
        core["clock.index"] += EVERY
    most, who = max(walks)
    assert (most > 1.0) == (walker is not None)
    if walker is not None:
        off = abs(changes[walker] - 0.98 * changes[1 - walker]) / np.sqrt(1.0 - 0.98**2)
        calm, wild = (off / np.sqrt(0.99 * (0.99 + usual * 0.01)) / START_LIMIT for usual in (1.0, USUAL))
        assert wild <= most <= calm
        assert who == walker + len(prior) * WALKS
