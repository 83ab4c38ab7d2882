"""Gaps one after the other, and inputs that are told seldom: what is doubted, and what is learned of their moves."""

from collections.abc import Iterable

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
CALLS = """
void t_next(State *state, const Sample *sample, double *packed, double *change, double *count)
{
    for (int k = 0; k < N_INPUTS; k++) change[k] = doubt(&state->inputs, sample, k, &count[k]);
    pack_sample(state, sample, &state->clock, &state->inputs, state->healthy.astray, packed);
    state->clock.index++;
}
"""
CURRENT = 0.5


def told(core: Bare, words: Iterable[str], dt: float = 0.5) -> tuple[list[tuple[float, float]], list[float]]:
    """Tell the voltage word by word; `?`: only sensors have a value, `-`: nothing has, `!`: only inputs have one.

    Gives what is doubted of it, and what is added to the sd of the charge.
    """
    doubts, gaps, place = [], [], core.spec.sample_fields["gap"]
    for word in words:
        u = (np.nan, np.nan) if word in "?-" else (2.0 if word == "!" else float(word), CURRENT)
        y = (np.nan, np.nan) if word in "-!" else (0.0, 0.0)
        packed, change, count = np.zeros(core.spec.n_sample), np.zeros(2), np.zeros(2)
        core.call("t_next", np.array([0.0, dt, *u, *y]), packed, change, count)
        doubts.append((float(change[0]), float(count[0])))
        gaps.append(float(packed[place][0]))
    return doubts, gaps


def test_nothing_is_added_while_nothing_is_measured() -> None:
    """Between two gaps with a row between them, states do not stray farther at each sample without any value."""
    core = bare(CALLS)
    core["healthy.travel"], core["inputs.held"] = (0.0, 600.0), (2.0, CURRENT)
    found = np.array(told(core, "-" * 40 + "2" + "-" * 30 + "!!!" + "22")[1]) / 600.0
    assert found[40] == pytest.approx(1.0)
    assert not found[41:71].any()
    assert found[71:] == pytest.approx([1.0, 0.0, 0.0, 0.3, 0.09])


def test_while_a_fault_is_sought_a_state_goes_no_farther_than_in_use() -> None:
    """Nor than it has moved, or is; before an alarm, and where nobody knows how large that is, it may be anywhere."""
    known = CELL.replace("{unit: V,", "{unit: V, range: [0 V, 40 mV],").replace(
        "{unit: A}", "{unit: A, range: [0 A, 2 mA]}"
    )
    reach, drift = bare(CALLS, known).spec.states[0].reach, 0.01
    assert drift < reach < 50.0 * drift
    expected = [(CELL, 5, 0.0, 1.0), (known, -1, 0.0, 1.0), (known, 5, 0.0, reach), (known, 5, 0.3, 0.3)]
    for text, alarm, content, most in expected:
        core = bare(CALLS, text)
        core["clock.alarm"], core["healthy.lane"][0] = alarm, content
        assert max(told(core, "2" * 10 + "-" * 100 + "2")[1]) == pytest.approx(most)


def test_a_move_over_a_gap_does_not_tell_how_inputs_move() -> None:
    """Nobody knows in how many steps an input went elsewhere while it was not told, nor when a row comes late."""
    core = bare(CALLS)
    assert told(core, "12" + 200 * "-" + "9")[0][-1] == (7.0, 50.0)
    core = bare(CALLS)
    told(core, "2222" + 200 * "-" + "9999")
    assert core["inputs.leap"].tolist() == [0.0, 0.0]
    told(core, "8")
    assert core["inputs.leap"][0] == pytest.approx(np.sqrt(1.0 / 300.0))
    core = bare(CALLS, CELL.replace("sample_time: 0.5 s", "sample_time: variable"))  # rows are the grid
    told(core, "2" * 10, 1.0)
    told(core, "9", 90.0)
    assert core["inputs.leap"].tolist() == [0.0, 0.0]


def test_an_input_that_is_logged_when_it_changes_is_known_between() -> None:
    """Where an input is told in few samples only, its empty cells are no doubt; where it mostly is, they are."""
    found, _ = told(bare(CALLS), "12" + "?????????3?????????1" * 60)
    assert found[11] == (1.0, 9.0)
    assert found[-30:] == [(0.0, 0.0)] * 30
    found, _ = told(bare(CALLS), "12" + "1212121?2" * 20)
    assert (1.0, 1.0) in found[-9:]
