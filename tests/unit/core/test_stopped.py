"""Records that have stopped, or never begun: what is learned of them, and what they say for an instrument."""

from math import log

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SETTINGS = core_settings()
TURNS, MOST = SETTINGS["TURNS"], SETTINGS["STOPPED_NATS"]
NOISY = CELL.replace("W: {unit: A}", "W: {unit: A, noise: 0.01 A}")
STEP = 0.5  # s
W = 1  # of the inputs V, W
CALLS = """
static Ranking ranking;
static Diagnosis found;
void t_take(State *state, const Sample *sample)
{
    double packed[N_SAMPLE];
    Sample smooth = *sample;
    smooth_inputs(&state->inputs, &smooth);
    pack_sample(state, &smooth, &state->clock, &state->inputs, state->healthy.astray, packed);
    state->clock.index++;
}
static int64_t bias_of_w(void)
{
    int64_t slot = 0;
    while (SLOT_INPUT[slot] != 1 || SLOT_KIND[slot] != KIND_BIAS) slot++;
    return slot;
}
void t_accept(State *state) { absorb(state, bias_of_w(), KIND_BIAS, 0.2, 0.0, 0.0); }
void t_renew(State *state)
{
    state->normal.input_gain[1] = 1.0;
    state->normal.input_offset[1] = -0.2;
    renew_instrument(state, bias_of_w());
}
void t_says(State *state, double *found)
{
    for (int64_t k = 0; k < N_HYPOTHESES; k++) found[k] = log_of_records(state, k);
}
void t_stopped(State *state, double *time) { *time = stopped_at(state, 1); }
int64_t t_unexplained(State *state, const double *best)
{
    memset(&found, 0, sizeof found);
    found.n_candidates = 1;
    found.candidates[0].n_suspects = (int64_t)best[0];
    found.candidates[0].suspects[0].stopped = best[1];
    state->bank.sums[0][0][0] = 2.0 * CUSUM_LIMIT;
    find_unexplained(state, 0, &found);
    return found.is_unexplained;
}
void t_score(State *state, double *found)
{
    score_all(state, OUT_NONE, &ranking);
    memcpy(found, ranking.score, sizeof ranking.score);
}
"""


def watched(record: FloatArray, noise: str = "0.01 A") -> Bare:
    """A core that has seen these values of W, (n,), and no alarm."""
    core = bare(CALLS, NOISY.replace("noise: 0.01 A", f"noise: {noise}"))
    core["clock.alarm"], core["inputs.held"], core["inputs.earlier"] = -1, np.nan, np.nan
    core["inputs.lowest"], core["inputs.highest"], core["sensors.nis"] = np.inf, -np.inf, 1.0
    core["inputs.record"], core["inputs.habit"] = np.nan, 1.0
    core["sensors.shown"] = np.repeat([-1.0, 1.0], len(core.spec.outputs))
    see(core, record)
    return core


def see(core: Bare, record: FloatArray) -> None:
    """Go on with these values of W; nan: it is not told."""
    for value in record:
        time = STEP * float(core["clock.index"][0])
        core.call("t_take", np.array([time, STEP, 2.0, value, 0.1, 1.0, 0.0, 0.0]))


def stopped_at(core: Bare) -> float:
    """The time at which the record of W stopped; nan: it goes on."""
    found = np.zeros(1)
    core.call("t_stopped", found)
    return float(found[0])


def said(core: Bare) -> float:
    """What the record of W says for its meter; for all others it says nothing."""
    found = np.zeros(len(core.spec.hypotheses) + len(core.spec.instruments))
    core.call("t_says", found)
    at = len(core.spec.hypotheses) + next(
        k for k, item in enumerate(core.spec.instruments) if not item.is_output and item.index == W
    )
    others = np.delete(found, at)
    assert not others.any()
    return float(found[at])


def scattering(n: int = 1000, quantum: float = 0.01) -> FloatArray:
    """Readings of a meter that scatters."""
    return np.round(np.random.default_rng(4).normal(0.5, 0.01, n) / quantum) * quantum


def test_of_a_record_that_scatters_its_stretches_and_its_turns_are_counted() -> None:
    core = watched(np.array([1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0, 2.0, 2.0, np.nan, np.nan, 2.0, 4.0]))
    assert core["inputs.stood"][0] == 2  # of 2, of which it is not known when it was not told
    assert core["inputs.turns"][0] == 1  # at 2, but not at 3, which was an end
    assert core["inputs.still"][0] == 0
    see(core, np.array([4.0, 4.0]))
    assert core["inputs.still"][0] == 2
    core["clock.alarm"] = core["clock.index"].copy()
    see(core, np.array([4.0] * 10 + [3.0, 4.0]))
    assert core["inputs.stood"][0] == 2  # after the alarm nothing is learned
    assert core["inputs.turns"][0] == 1


def test_what_is_logged_when_it_changes_stands_where_it_is_not_told() -> None:
    core = watched(scattering())
    core["inputs.habit"] = 0.01
    see(core, np.array([0.49, np.nan, np.nan, np.nan, 0.5]))
    see(core, np.full(20, np.nan))
    assert core["inputs.still"][0] == 20


def test_of_a_record_that_is_smoothed_the_record_counts() -> None:
    core = watched(scattering(), noise="0.01 A, noise_of: record")
    assert core["inputs.turns"][0] >= TURNS
    longest = core["inputs.stood"][0]
    see(core, np.full(300, 0.5))
    assert longest < core["inputs.still"][0] == 299  # its mean went on for long


def test_how_long_a_record_was_wrong_is_no_measure_of_healthy_ones() -> None:
    for call in ("t_accept", "t_renew"):
        core = watched(scattering(), noise="0.01 A, noise_of: record")
        longest = core["inputs.stood"][0]
        see(core, np.full(300, 0.5))
        before = core["inputs.trends"].copy().reshape(9, -1)
        core.call(call)
        after = core["inputs.trends"].reshape(9, -1)
        assert core["inputs.held"][W] == pytest.approx(before[0, 0] + 0.2, abs=0.01)
        assert after[:, 0] == pytest.approx(before[:, 0] + 0.2)  # what acts is not changed by knowing of it
        assert np.array_equal(after[:, 1:], before[:, 1:])
        see(core, np.array([0.5, 0.51, 0.49]))
        assert core["inputs.stood"][0] == longest


def test_a_record_that_stopped_before_the_alarm_says_how_seldom_it_stands_for_so_long() -> None:
    core = watched(scattering())
    see(core, np.full(2, 0.5))
    longest, turns = core["inputs.stood"][0], core["inputs.turns"][0]
    assert turns >= TURNS
    core["clock.alarm"] = core["clock.index"].copy()
    core["inputs.still"] = 1.5 * longest
    assert said(core) == pytest.approx(0.5 * log(turns))
    core["inputs.still"] = longest
    assert said(core) == 0.0
    core["inputs.still"] = 100 * longest
    assert said(core) == MOST


def test_what_stops_only_after_the_alarm_or_at_an_end_or_is_a_command_says_nothing() -> None:
    core = watched(scattering())
    core["clock.alarm"] = core["clock.index"].copy()
    see(core, np.full(300, 0.5))
    core["inputs.still"] = 299
    assert said(core) == 0.0
    core["inputs.still"] = 300
    assert said(core) == MOST
    core["inputs.held"][W] = core["inputs.highest"][W]
    assert said(core) == 0.0
    core["inputs.held"][W] = 0.5
    core["inputs.turns"] = TURNS - 1
    assert said(core) == 0.0


def test_a_command_that_stands_longer_than_before_says_nothing() -> None:
    steps = np.random.default_rng(5).uniform(0.2, 0.8, 300)
    core = watched(np.concatenate([[0.1, 0.9], np.repeat(steps, 10), np.full(500, 0.5)]))
    core["clock.alarm"] = core["clock.index"].copy()
    assert core["inputs.turns"][0] >= TURNS
    assert core["inputs.stood"][0] == 9
    assert said(core) == 0.0


def switched(draws: int, rest: int) -> FloatArray:
    """Readings of a meter that scatters while it is on, and shows 0 while it is off, for longer."""
    generator = np.random.default_rng(6)
    on = [np.round(generator.normal(generator.uniform(0.3, 0.9), 0.02, 30), 2) for _ in range(draws)]
    return np.concatenate([np.concatenate([np.zeros(rest), record]) for record in on])


def test_what_is_switched_off_rests_and_tells_nothing_of_how_its_record_scatters() -> None:
    record = switched(20, 700)
    core = watched(np.concatenate([record, [0.5] * 40]))
    assert core["inputs.stood"][0] < 8  # while it is on; off it stands for 700
    assert core["inputs.idle"][0] == pytest.approx(20 * 700, abs=30)
    core["clock.alarm"] = core["clock.index"].copy()
    assert said(core) == MOST
    again = watched(np.concatenate([record[:-30], [0.0] * 5000]))  # off for much longer than before
    again["clock.alarm"] = again["clock.index"].copy()
    assert said(again) == 0.0
    valve = watched(np.concatenate([np.tile([0.0, 1.0], 500), np.full(500, 0.5)]))  # a hand takes over
    valve["clock.alarm"] = valve["clock.index"].copy()
    assert said(valve) == 0.0


def test_it_is_told_since_when_a_record_stands_where_that_is_sure() -> None:
    core = watched(scattering())
    see(core, np.full(200, 0.5))
    core["clock.alarm"] = core["clock.index"].copy()
    assert stopped_at(core) == 1000 * STEP
    core["inputs.still"] = 1.2 * core["inputs.stood"]
    assert np.isnan(stopped_at(core))


def test_nothing_speaks_against_an_input_of_which_it_is_not_known_what_acts() -> None:
    core = watched(scattering())
    for best, expected in (((1.0, 123.0), 0), ((1.0, np.nan), 1), ((2.0, 123.0), 1)):
        assert core.call("t_unexplained", np.array(best)) == expected


def test_no_set_is_likely_that_blames_a_sensor_that_has_never_read() -> None:
    core = watched(scattering())
    core["clock.alarm"] = core["clock.index"].copy()
    core["sensors.shown"] = np.repeat([np.inf, -np.inf], len(core.spec.outputs))
    found = np.zeros(len(core.spec.hypotheses) + len(core.spec.instruments))
    core.call("t_score", found)
    blames = [False] * len(core.spec.hypotheses) + [item.is_output for item in core.spec.instruments]
    assert np.array_equal(np.isneginf(found), blames)


def test_the_score_of_a_set_has_what_its_records_say() -> None:
    core = watched(scattering())
    core["clock.alarm"] = core["clock.index"].copy()
    n = len(core.spec.hypotheses) + len(core.spec.instruments)
    scores = []
    for still in (1.0, 400.0):
        core["inputs.still"] = still
        found = np.zeros(n)
        core.call("t_score", found)
        scores.append(found)
    gained = scores[1] - scores[0]
    assert np.count_nonzero(gained) == 1
    assert gained.max() == pytest.approx(MOST)
