"""Couples: which there are, what they are called, and how many are tested."""

from dataclasses import replace

import pytest

from faultbond.contract.couples import BOTH, DRIFTING, MIXED, n_coupled, plan_couples
from faultbond.errors import FaultbondError
from faultbond.runtime.names import find_hypothesis, hypothesis_names
from made import spec_of

MOTOR = spec_of("dc_motor_current")
SENSORS, PARAMETERS = ("omega", "i"), ("R", "L", "K", "J", "C")


def test_each_instrument_goes_with_each_parameter() -> None:
    """Sensors and inputs are tested with every parameter that may fail, and each two, after all other hypotheses."""
    couples = plan_couples(MOTOR)
    first = len(MOTOR.hypotheses) + 3 + len(MOTOR.reserve)
    found = {couple.hypothesis: couple for couple in couples if couple.hypothesis >= first}
    assert sorted(found) == list(range(first, MOTOR.n_hypotheses))
    assert MOTOR.n_hypotheses - first == 15 + 3
    named = [hypothesis_names(MOTOR, k) for k in range(first, MOTOR.n_hypotheses)]
    assert named[:15] == [{thing, name} for thing in (*SENSORS, "V") for name in PARAMETERS]
    assert named[15:] == [{"omega", "i"}, {"omega", "V"}, {"i", "V"}]
    for k, couple in found.items():
        beside = couple.beside
        other = MOTOR.parameters[couple.parameter].name if beside < 0 else min(hypothesis_names(MOTOR, beside))
        assert {*hypothesis_names(MOTOR, couple.slot), other} == hypothesis_names(MOTOR, k)
        assert find_hypothesis(MOTOR, sorted(hypothesis_names(MOTOR, k))) == k


def test_a_drift_beside_a_step_is_a_kind_of_the_set_of_both() -> None:
    """Of each tested pair either may drift; the hypothesis is that of both as steps."""
    drifts = [couple for couple in plan_couples(MOTOR) if couple.slot < len(MOTOR.hypotheses)]
    pairs = [chosen for chosen in (*MOTOR.hypotheses, *MOTOR.reserve) if len(chosen) == 2]
    assert len(drifts) == 2 * len(pairs)
    for couple in drifts:
        (drifting,) = MOTOR.members(couple.slot)
        assert sorted(MOTOR.members(couple.hypothesis)) == sorted((drifting, couple.parameter))


def test_where_one_fault_at_most_is_asked_for_there_are_none() -> None:
    """With `max_faults: 1` nothing is tested together, and no more hypotheses are there."""
    alone = replace(MOTOR, coupled=False)
    assert plan_couples(alone) == ()
    assert alone.n_hypotheses == alone.n_begun + len(alone.reserve)
    assert spec_of("rc").coupled is False
    assert MOTOR.coupled is True
    with pytest.raises(FaultbondError, match="omega, R: no candidate has just these components"):
        find_hypothesis(alone, ["omega", "R"])


def test_no_more_are_tested_than_there_is_room_for() -> None:
    """Of many couples some are tested, of few all."""
    assert n_coupled(MOTOR) == (15, 3, DRIFTING)
    many = replace(MOTOR, outputs=MOTOR.outputs * 3)
    assert n_coupled(many)[0] == MIXED < len(many.mixed)
    assert n_coupled(many)[1] == BOTH < len(many.both)
    assert n_coupled(replace(MOTOR, coupled=False)) == (0, 0, 0)
