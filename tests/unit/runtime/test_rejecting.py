"""What a rejection rules out: the set itself and every set that contains it, now and later."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from faultbond.contract.findings import Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.errors import FaultbondError
from faultbond.runtime.accepting import find_hypothesis, reject, without
from faultbond.runtime.monitor import finish
from faultbond.runtime.state import State
from faultbond.simulate import Fault
from made import changed, plant, recorded, run

_, MOTOR, ENGINE = plant("dc_motor_current")
SINGLES = tuple((k,) for k in range(5))
PAIRS = tuple(combinations(range(5), 2))
TRIPLES = tuple(combinations(range(5), 3))
WHOLE = replace(MOTOR, hypotheses=(*SINGLES, *PAIRS, *TRIPLES), reserve=())
WAITING = replace(MOTOR, hypotheses=SINGLES, reserve=(*PAIRS, *TRIPLES))
ROWS = recorded("dc_motor_current", 480, Fault(parameter="R", factor=2.0, start=3.0))


@cache
def alarmed(spec: EngineSpec, later: int = 25) -> State:
    """The state some samples after the alarm."""
    state, _ = run(spec, ENGINE, ROWS[:240])
    assert state.clock.alarm > 0
    return run(spec, ENGINE, ROWS[: state.clock.alarm + later])[0]


def concluded(spec: EngineSpec, state: State) -> Diagnosis:
    """The diagnosis, which there is."""
    diagnosis = finish(spec, state)
    assert diagnosis is not None
    return diagnosis


def likely(diagnosis: Diagnosis) -> dict[frozenset[str], float]:
    """Probabilities of the candidates that have any, by parameters."""
    return {frozenset(item.parameters): item.probability for item in diagnosis.candidates if item.probability > 0.0}


def test_sets_that_contain_a_rejected_one_go_too() -> None:
    """Of a component that is healthy no set is left; all others keep their ratios and share what these had."""
    state = alarmed(WHOLE)
    before = likely(concluded(WHOLE, state))
    after = likely(concluded(WHOLE, reject(WHOLE, state, find_hypothesis(WHOLE, ["R"]))[0]))
    assert before.keys() - after.keys() == {item for item in before if "R" in item}
    rest = sum(share for chosen, share in before.items() if "R" not in chosen)
    for chosen, share in after.items():
        assert share == pytest.approx(before[chosen] / rest, rel=1e-6, abs=1e-12)


def test_parts_of_a_rejected_set_stay() -> None:
    """That not both of a pair are at fault leaves either alone, and triples with one of them."""
    state, candidate = reject(WHOLE, alarmed(WHOLE), find_hypothesis(WHOLE, ["R", "K"]))
    assert set(candidate.parameters) == {"R", "K"}
    gone = {
        frozenset(WHOLE.parameters[k].name for k in WHOLE.members(int(i))) for i in np.flatnonzero(state.bank.rejected)
    }
    assert gone == {frozenset({"R", "K"} | more) for more in (set(), {"L"}, {"J"}, {"C"})}


def test_a_healthy_instrument_rules_out_itself_only() -> None:
    """A sensor is tested alone, so nothing else goes with it; and no set of parameters rules a sensor out."""
    sensor = find_hypothesis(WHOLE, ["omega"])
    state, _ = reject(WHOLE, alarmed(WHOLE), sensor)
    assert np.flatnonzero(state.bank.rejected).tolist() == [sensor]
    state, _ = reject(WHOLE, alarmed(WHOLE), 0)
    assert not np.any(state.bank.rejected[len(WHOLE.hypotheses) :])


def test_what_was_rejected_before_stays_so() -> None:
    """Several rejections add up, in any order."""
    chosen = [find_hypothesis(WHOLE, names) for names in (["R"], ["K", "L"], ["omega"])]
    found = []
    for order in (chosen, chosen[::-1]):
        state = alarmed(WHOLE)
        for hypothesis in order:
            state, _ = reject(WHOLE, state, hypothesis)
        found.append(state.bank.rejected)
    assert np.array_equal(found[0], found[1])


def test_sets_of_the_reserve_that_contain_it_are_not_grown(monkeypatch: pytest.MonkeyPatch) -> None:
    """After a rejection, before any set was chosen or between two renewals, its supersets take none of the places."""
    monkeypatch.setattr("faultbond.runtime.growing.GROWN", 3)
    small = replace(WAITING, model="with few places")  # so that no plan of another size is remembered
    for later in (25, 60):
        state, _ = reject(small, alarmed(small, later), find_hypothesis(small, ["R"]))
        state, _ = run(small, ENGINE, ROWS[state.clock.index : state.clock.alarm + 120], state)
        assert np.all(state.bank.grown >= 0.0)
        assert not np.any(state.bank.rejected[small.n_begun + state.bank.grown.astype(int)])
        assert all("R" not in chosen for chosen in likely(concluded(small, state)))


def test_the_last_one_cannot_be_rejected() -> None:
    """A rejection that would leave nothing is refused, also where only sets that were not begun would be left."""
    rejected = np.zeros(WAITING.n_hypotheses)
    tested = np.arange(WAITING.n_hypotheses) < WAITING.n_begun
    rejected[[k for k in range(WAITING.n_begun) if k != 2]] = 1.0
    with pytest.raises(FaultbondError, match="last hypothesis"):
        without(WAITING, rejected, 2, tested)
    with pytest.raises(FaultbondError, match="last hypothesis"):
        reject(WAITING, changed(alarmed(WAITING), rejected=rejected), 2)
