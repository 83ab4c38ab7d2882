"""A model that is off: what counts as healthy under every hypothesis raised the alarm by its walk."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from bare_core import CELL, bare
from diagnosed import SPEC, Diagnosed
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
TRUSTED, SUSPECT, OTHER = 0, 1, 2
PAIR_LANE = 15  # the first of the set (0, 1)
LOAD_LANE = int(plan_lanes(SPEC).first[SPEC.hypotheses.index((OTHER,))])
SETTINGS = core_settings()
WALKS = int(SETTINGS["WALKS"])
OTHERS = replace(
    SPEC,
    hypotheses=tuple(chosen for chosen in SPEC.hypotheses if TRUSTED not in chosen),
    reserve=tuple(chosen for chosen in SPEC.reserve if TRUSTED not in chosen),
)


@cache
def diagnosed(
    walker: int, window: int = WALKS, false_alarms: int = 0, *, unfamiliar: bool = False
) -> tuple[float, tuple[float, ...], float]:
    """The probabilities that the model is off, of all sets, and of nothing at fault; one lane explains the data."""
    state = Diagnosed(replace(OTHERS, false_alarms=false_alarms))
    state.far_off()
    state.only(0)
    state["alarm.walker"], state["alarm.window"], state["alarm.unfamiliar"] = walker, window, unfamiliar
    found = state.diagnose()
    rows = found["candidates"][: found["n_candidates"]]
    return float(found["mismatch"]), tuple(map(float, rows["probability"])), float(found["within_accuracy"])


def elsewhere(parameter: int, off: float, false_alarms: int) -> tuple[float, tuple[float, ...], float, list[int]]:
    """The same where no set changed by more than it may, and one parameter is so many accuracies off; which is told."""
    state = Diagnosed(replace(OTHERS, false_alarms=false_alarms))
    state.only(0)
    lane, first = state.lane("step", 0), SPEC.parameter_slice.start
    for k, item in enumerate(SPEC.parameters):
        state["bank.healthy"][first + k] = lane[first + k] = item.healthy
    lane[first + parameter] += off * SPEC.parameters[parameter].accuracy
    found = state.diagnose()
    rows = found["candidates"][: found["n_candidates"]]
    sets = tuple(map(float, rows["probability"]))
    return (
        float(found["mismatch"]),
        sets,
        float(found["within_accuracy"]),
        found["elsewhere"][: found["n_elsewhere"]].tolist(),
    )


@pytest.mark.parametrize(("window", "name"), [(WALKS, "OFF_FROM_START"), (2, "OFF_SINCE")])
def test_what_counts_as_healthy_and_walks_leaves_the_most_to_a_model_that_is_off(window: int, name: str) -> None:
    """However well a set explains the data, as that has to make up for what was moved; less where it moved late."""
    off, sets, within = diagnosed(TRUSTED, window)
    usual, surely, before = diagnosed(-1)
    assert off == SETTINGS[name]
    assert SETTINGS["OFF_FROM_START"] > SETTINGS["OFF_SINCE"] >= 0.5
    assert usual == 0.0
    assert surely[0] > 0.99
    assert sets == pytest.approx([(1.0 - off) * probability + off / len(surely) for probability in surely])
    assert within == pytest.approx((1.0 - off) * before)
    assert sum(sets) == pytest.approx(1.0)


@pytest.mark.parametrize("false_alarms", [0, 1])
@pytest.mark.parametrize(("off", "is_far"), [(9.0, True), (-9.0, True), (7.0, False)])
def test_what_counts_as_healthy_and_is_elsewhere_is_no_healthy_plant(
    off: float, false_alarms: int, *, is_far: bool
) -> None:
    """Where no suspect changed, and what is trusted is eight accuracies away, the model is off, with all of that."""
    before = elsewhere(TRUSTED, 0.0, false_alarms)
    found = elsewhere(TRUSTED, off, false_alarms)
    assert before[2] > 0.4
    assert found[1] == before[1]  # each set keeps its share
    assert found[0] == pytest.approx(before[0] + before[2] if is_far else before[0])
    assert found[2] == (0.0 if is_far else before[2])
    assert (before[3], found[3]) == ([], [TRUSTED] if is_far else [])
    assert elsewhere(OTHER, off, false_alarms) == before  # some set has it, and says so itself


def strained(
    moved: float, since: float, *, component: str = "two", healthy_change: float = 0.0
) -> tuple[float, float, list[int]]:
    """Give the probabilities that the model is off, and of the load that explains the data, and what it strains.

    The parameter SUSPECT, of a component, is so many accuracies from where it is declared, and from where it was.
    """
    parameters = list(SPEC.parameters)
    parameters[SUSPECT] = replace(parameters[SUSPECT], component=component, healthy_change=healthy_change)
    state = Diagnosed(replace(SPEC, parameters=tuple(parameters)))
    state.far_off()
    state.only(LOAD_LANE)
    at, item = SPEC.parameter_slice.start + SUSPECT, parameters[SUSPECT]
    now = item.healthy + moved * item.accuracy
    state.lane("step", LOAD_LANE)[at] = now
    state["bank.healthy"][at] = now - since * item.accuracy
    found = state.diagnose()
    first = found["candidates"][0]
    assert first["hypothesis"] == SPEC.hypotheses.index((OTHER,))
    return float(found["mismatch"]), float(first["probability"]), found["strained"][: found["n_strained"]].tolist()


@pytest.mark.parametrize(("moved", "since", "is_far"), [(4.5, 4.5, True), (-9.0, -5.0, True), (3.5, 8.0, False)])
def test_what_has_to_move_what_it_leaves_healthy_is_not_claimed(moved: float, since: float, *, is_far: bool) -> None:
    """Of another part, far from where it was at the alarm and is declared: it changed, or the model is off."""
    off, best, told = strained(moved, since)
    assert told == ([SUSPECT] if is_far else [])
    assert off == (SETTINGS["OFF_STRAINED"] if is_far else 0.0)
    assert (best > 0.9) != is_far
    assert best > 0.4


def test_what_was_far_at_the_alarm_or_is_of_the_part_at_fault_strains_nothing() -> None:
    """The former the healthy plant has moved; the latter a fault may move."""
    assert strained(9.0, 1.0)[2] == []
    assert strained(9.0, 9.0, component="load")[2] == []
    assert strained(9.0, 9.0)[2] == [SUSPECT]


def test_what_may_change_while_healthy_strains_nothing_by_as_much() -> None:
    """Four such changes, where these are larger than the accuracy."""
    usual = SPEC.parameters[SUSPECT].accuracy
    assert strained(9.0, 9.0, healthy_change=3.0 * usual)[2] == []
    assert strained(13.0, 13.0, healthy_change=3.0 * usual)[2] == [SUSPECT]


def test_what_may_be_at_fault_and_walks_is_asked_as_before() -> None:
    """A walk of what some tested set has is no mismatch of the model."""
    assert diagnosed(SUSPECT) == diagnosed(-1)


def test_a_walk_where_the_model_was_never_fitted_is_as_likely_a_law_that_is_off() -> None:
    """An alarm by what sensors read at once is none of it, nor does it make a trusted parameter any likelier."""
    off, sets, _ = diagnosed(SUSPECT, unfamiliar=True)
    _, surely, _ = diagnosed(-1)
    assert off == SETTINGS["OFF_UNFAMILIAR"] == 0.5
    assert sets == pytest.approx([(1.0 - off) * probability + off / len(surely) for probability in surely])
    assert diagnosed(-1, unfamiliar=True) == diagnosed(-1)
    assert diagnosed(TRUSTED, unfamiliar=True) == diagnosed(TRUSTED)


@pytest.mark.parametrize("known", [1, 3, 40])
def test_false_alarms_that_are_known_leave_the_most_to_a_model_that_is_off(known: int) -> None:
    """Of so many and this one a single one is taken to be true; sets keep their order, and share what is left."""
    off, sets, within = diagnosed(-1, false_alarms=known)
    _, surely, before = diagnosed(-1)
    assert off == pytest.approx(known / (known + 1.0))
    assert sets == pytest.approx([(1.0 - off) * probability + off / len(surely) for probability in surely])
    assert within == pytest.approx((1.0 - off) * before)
    assert diagnosed(TRUSTED, false_alarms=known)[0] == max(off, SETTINGS["OFF_FROM_START"])


@pytest.mark.parametrize(
    ("sure", "is_superseded"), [(("one",), False), (("one", "two"), False), (("load",), True), (("one", "load"), True)]
)
def test_what_was_sure_is_superseded_by_what_lacks_it(sure: tuple[str, ...], *, is_superseded: bool) -> None:
    """A likeliest set that has all that was sure, beside something else or not, forgets nothing."""
    pair = SPEC.hypotheses.index((0, 1))  # the resistors `one` and `two`
    before = SPEC.hypotheses.index((2,))  # far behind it
    state = Diagnosed()
    state.far_off()
    state.only(PAIR_LANE)
    state["settled.hypothesis"], state["settled.n_parts"], state["settled.until"] = before, len(sure), 40.0
    state["settled.parts"] = [*(SPEC.parts.index(name) for name in sure), 0, 0][:3]
    found = state.diagnose()
    assert found["candidates"][0]["hypothesis"] == pair
    told = tuple(SPEC.parts[k] for k in found["superseded"][: found["n_superseded"]])
    assert told == (sure if is_superseded else ())
    assert found["mismatch"] == (SETTINGS["OFF_SUPERSEDED"] if is_superseded else 0.0)


def test_what_was_beyond_the_fit_counts_for_a_walk_since_the_start() -> None:
    """Of one that began later the input of now tells; one that has no value yet is nowhere."""
    text = CELL.replace("{V: {unit: V, settling: 3 s}", "{V: {unit: V, settling: 3 s, fitted_range: [1 V, 9 V]}")
    core = bare(
        """
        void t_unfamiliar(State *state, const double *inputs, const double *ever, double *found)
        {
            state->inputs.lowest[0] = inputs[0];
            state->inputs.highest[0] = inputs[1];
            state->inputs.held[0] = inputs[2];
            found[0] = is_unfamiliar(&state->inputs, ever[0] > 0.0);
        }
        """,
        text,
    )
    cases = {(1.0, 9.0, 5.0): (0, 0), (1.0, 9.5, 5.0): (0, 1), (0.4, 9.0, 0.4): (1, 1), (1.0, 9.5, np.nan): (0, 1)}
    for inputs, told in cases.items():
        for ever in (0, 1):
            found = np.zeros(1)
            core.call("t_unfamiliar", np.array(inputs), np.array([float(ever)]), found)
            assert found[0] == told[ever], (inputs, ever)
