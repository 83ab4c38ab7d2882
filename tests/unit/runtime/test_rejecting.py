"""What a rejection rules out: the set itself and every set that contains it, now and later."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.errors import FaultbondError
from faultbond.runtime.monitor import Monitor
from faultbond.runtime.names import find_hypothesis
from faultbond.simulate import Fault
from made import changed, recorded, run
from motor_sets import FEW, WHOLE, core_of

ROWS = recorded("dc_motor_current", 480, Fault(parameter="R", factor=2.0, start=3.0))
GROWN = 3  # fewer than there are sets in reserve


@cache
def alarmed(spec: EngineSpec, later: int = 25) -> Monitor:
    """The monitor some samples after the alarm; not to be changed."""
    core = core_of(spec, GROWN)
    alarm = int(run(core, ROWS[:240])[0].number("clock.alarm"))
    assert alarm > 0
    return run(core, ROWS[: alarm + later])[0]


def rejected(monitor: Monitor, *hypotheses: int) -> Monitor:
    """A copy of the monitor that has rejected these."""
    after = monitor.copy()
    for hypothesis in hypotheses:
        after.reject(hypothesis)
    return after


def out(monitor: Monitor) -> list[int]:
    """Hypotheses that are rejected."""
    found: list[int] = np.flatnonzero(monitor.numbers("bank.rejected")).tolist()
    return found


def concluded(monitor: Monitor) -> Diagnosis:
    """The diagnosis, which there is."""
    diagnosis = monitor.finish()
    assert diagnosis is not None
    return diagnosis


def likely(diagnosis: Diagnosis) -> dict[frozenset[str], float]:
    """Probabilities of the candidates that have any, by parameters."""
    return {frozenset(item.parameters): item.probability for item in diagnosis.candidates if item.probability > 0.0}


def test_sets_that_contain_a_rejected_one_go_too() -> None:
    """Of a component that is healthy no set is left; all others keep their ratios and share what these had."""
    monitor = alarmed(WHOLE)
    before = likely(concluded(monitor))
    after = likely(concluded(rejected(monitor, find_hypothesis(WHOLE, ["R"]))))
    assert before.keys() - after.keys() == {item for item in before if "R" in item}
    rest = sum(share for chosen, share in before.items() if "R" not in chosen)
    for chosen, share in after.items():
        assert share == pytest.approx(before[chosen] / rest, rel=1e-6, abs=1e-12)


def test_parts_of_a_rejected_set_stay() -> None:
    """That not both of a pair are at fault leaves either alone, and triples with one of them."""
    monitor = alarmed(WHOLE).copy()
    candidate = monitor.reject(find_hypothesis(WHOLE, ["R", "K"]))
    assert set(candidate.parameters) == {"R", "K"}
    gone = {frozenset(WHOLE.parameters[k].name for k in WHOLE.members(i)) for i in out(monitor)}
    assert gone == {frozenset({"R", "K"} | more) for more in (set(), {"L"}, {"J"}, {"C"})}


def test_a_healthy_instrument_rules_out_what_contains_it() -> None:
    """With a sensor its sets with one more suspect fall, no others; a parameter rules no sensor out by itself."""
    sensor = find_hypothesis(WHOLE, ["omega"])
    with_it = [find_hypothesis(WHOLE, ["omega", name]) for name in ("R", "L", "K", "J", "C", "i", "V")]
    assert out(rejected(alarmed(WHOLE), sensor)) == sorted([sensor, *with_it])
    instruments = range(len(WHOLE.hypotheses), WHOLE.n_begun)
    assert not set(instruments) & set(out(rejected(alarmed(WHOLE), 0)))
    assert find_hypothesis(WHOLE, ["omega", "R"]) in out(rejected(alarmed(WHOLE), 0))


def test_what_was_rejected_before_stays_so() -> None:
    """Several rejections add up, in any order; each is refused a second time, alone or in a set."""
    chosen = [find_hypothesis(WHOLE, names) for names in (["R"], ["K", "L"], ["omega"])]
    one, two = (rejected(alarmed(WHOLE), *order) for order in (chosen, chosen[::-1]))
    assert out(one) == out(two)
    assert set(chosen) < set(out(one))
    for hypothesis in (*chosen, find_hypothesis(WHOLE, ["R", "J"])):
        with pytest.raises(FaultbondError, match="rejected already"):
            one.reject(hypothesis)
    assert out(one) == out(two)


def test_sets_of_the_reserve_that_contain_it_are_not_grown() -> None:
    """After a rejection, before any set was chosen or between two renewals, its supersets take none of the places."""
    for later in (25, 60):
        monitor = rejected(alarmed(FEW, later), find_hypothesis(FEW, ["R"]))
        first, alarm = (int(monitor.number(f"clock.{name}")) for name in ("index", "alarm"))
        monitor, _ = run(monitor.core, ROWS[first : alarm + 120], monitor)
        grown = monitor.numbers("bank.grown").astype(int)
        assert len(grown) == GROWN
        assert np.all(grown >= 0)
        assert not {int(FEW.n_begun + row) for row in grown} & set(out(monitor))
        assert all("R" not in chosen for chosen in likely(concluded(monitor)))


def test_the_last_one_cannot_be_rejected() -> None:
    """A rejection that would leave nothing is refused, also where only sets that were not begun would be left."""
    gone = np.zeros(FEW.n_hypotheses)
    gone[[k for k in range(FEW.n_begun) if k != 2]] = 1.0
    monitor = changed(alarmed(FEW), rejected=gone)
    with pytest.raises(FaultbondError, match="last hypothesis"):
        monitor.reject(2)
    assert out(monitor) == np.flatnonzero(gone).tolist()
