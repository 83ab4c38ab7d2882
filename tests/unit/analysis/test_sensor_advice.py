"""Advice on further sensors."""

import numpy as np
import pytest

from faultbond.analysis import sensor_advice as sensors
from faultbond.analysis.sensor_advice import advise_sensors, readable_signals, restricted
from faultbond.analysis.testable import generic_run
from plants import TANK_SENSORS, circuit, example, named, stated


def test_candidates_are_what_a_sensor_could_read() -> None:
    """Every effort, flow and stored quantity that has a name and is not read yet, those of junctions first."""
    found = readable_signals(example("dc_motor"))
    assert found == ("armature.f", "source.e", "R.e", "L.e", "K.e1", "K.e2", "J.e", "C.e", "L.p", "J.p")
    assert "armature.f" not in readable_signals(example("dc_motor_current"))


def test_the_motor_wants_its_current_measured() -> None:
    """With the current two more combinations of the motor's parameters show, and no pair of sets stays near."""
    found = advise_sensors(example("dc_motor"))
    assert (found.now.rank, found.now.testable, found.now.classes) == (3, 15, 15)
    advised = {item.sensors: item for item in found.further}
    assert advised["armature.f",].rank == 5
    assert advised["armature.f",].near == 0 < found.now.near
    assert found.further[0].rank == 5


def test_a_sensor_splits_a_group() -> None:
    """Where only R C shows nothing is testable; with the current R and C are told apart."""
    model = example("rc")
    found = advise_sensors(model)
    assert (found.now.testable, found.now.classes) == (0, 0)
    assert named(model, found.now.groups[0].sets) == [("R",), ("C",)]
    best = {item.sensors: item for item in found.further}["loop.f",]
    assert (best.testable, best.classes, best.groups) == (2, 2, ())


def test_sensors_that_show_nothing_are_not_advised() -> None:
    """A source's own effort tells nothing of the parameters, nor does what another sensor shows already."""
    model = example("tank", (TANK_SENSORS, TANK_SENSORS.replace("sqrt(orifice.e/K_meter)", "line.f")))
    advised = [item.sensors for item in advise_sensors(model).further]
    assert ("orifice.e",) in advised
    assert ("pipe.e",) in advised  # either tells K1 and K2 apart
    assert ("tank.f",) not in advised[:2]
    assert not any("source.e" in item.sensors for item in advise_sensors(example("rc")).further)


def test_a_plant_that_shows_everything_needs_no_sensor() -> None:
    """The motor with its current measured gets no advice, and nothing is left untried."""
    found = advise_sensors(example("dc_motor_current"))
    assert (found.further, found.left_out) == ((), 0)


def two_stages() -> str:
    """Two low-pass stages apart, only the sum of their voltages read: one sensor more does not tell all."""
    parts = "".join(
        f"  S{k}: {{type: Se, law: e = V}}\n  R{k}: {{type: R, parameters: {{R{k}: {k} ohm}}}}\n"
        f"  C{k}: {{type: C, parameters: {{C{k}: {k + 1} F}}}}\n"
        for k in (1, 2)
    )
    return (
        "name: two stages\nsample_time: 0.1 s\nmax_faults: 1\ninputs: {V: {unit: V}}\ncomponents:\n"
        f"{parts}junctions: {{l1: 1, l2: 1}}\n"
        "bonds: [S1 -> l1 -> R1, l1 -> C1, S2 -> l2 -> R2, l2 -> C2]\n"
        "sensors: {v: {reads: C1.e + C2.e, unit: V, noise: 1 mV}}\n"
    )


def test_two_sensors_where_one_does_not_do() -> None:
    """Two stages of which only time constants show need a current each: pairs are advised that beat any single one."""
    found = advise_sensors(stated(two_stages()))
    assert found.now.classes == 2
    singles = [item for item in found.further if len(item.sensors) == 1]
    pairs = [item for item in found.further if len(item.sensors) == 2]
    assert {item.classes for item in singles} == {3}
    assert {item.classes for item in pairs} == {4}
    assert ("l1.f", "l2.f") in [item.sensors for item in pairs]


def test_the_number_of_trials_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond a number of combinations, or of numbers in memory, the rest is counted, not tried."""
    model = stated(two_stages())
    names = readable_signals(model)
    monkeypatch.setattr(sensors, "MOST_TRIED", 6)
    found = advise_sensors(model)
    shown = len(names) - 2  # the two sources
    assert found.left_out == shown + shown * (shown - 1) // 2 - 6
    monkeypatch.setattr(sensors, "MOST_NUMBERS", 1)
    assert len({name for item in advise_sensors(model).further for name in item.sensors}) <= 1


def test_many_sets_are_compared_by_small_ones_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are too many sets to compare for nearness, those of the largest sizes are left aside."""
    model = example("dc_motor")
    assert advise_sensors(model).now.near > 0
    monkeypatch.setattr(sensors, "MOST_COMPARED", 14)
    assert advise_sensors(model).now.near == 0  # no two of the motor's single suspects are near


def test_large_sets_are_left_aside_where_there_are_many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are too many sets to judge in each trial, the largest sizes are not counted, and that is said."""
    model = example("dc_motor")
    assert advise_sensors(model).largest == 2
    monkeypatch.setattr(sensors, "MOST_SETS", 14)
    found = advise_sensors(model)
    assert (found.largest, found.now.testable, found.now.classes) == (1, 5, 5)


def test_the_work_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """The larger the plant, the fewer combinations are tried; the others are counted."""
    model = stated(two_stages())
    shown = len(readable_signals(model)) - 2
    monkeypatch.setattr(sensors, "MOST_WORK", 1)
    assert advise_sensors(model).left_out == shown + shown * (shown - 1) // 2 - 1


def test_groups_that_are_left_are_named() -> None:
    """What still looks alike with the advised sensors is told with the reason."""
    advised = {item.sensors: item for item in advise_sensors(stated(two_stages())).further}
    assert [group.reason for group in advised["l1.f",].groups] == ["only R2*C2 acts"]


def test_a_run_restricted_to_some_outputs() -> None:
    """The outputs chosen are kept in the order asked for."""
    whole = generic_run(example("dc_motor_current"))
    found = restricted(whole, (1,))
    assert found.outputs == ("i",)
    assert np.array_equal(found.y[:, 0], whole.y[:, 1])
    assert np.array_equal(found.by_start[:, 0], whole.by_start[:, 1])


def test_signals_without_a_name_are_no_candidates() -> None:
    """The effort between two 1-junctions belongs to a bond only: no law can read it, so no sensor is advised there."""
    model = circuit(
        "  R: {type: R, parameters: {R: 10 ohm}}\n  C: {type: C, parameters: {C: 10 mF}}",
        "one: 1, two: 1",
        "source -> one -> R, one -> two -> C",
        "v: {reads: C.e, unit: V, noise: 1 mV}",
    )
    assert any("->" in name for name in model.plant.network.signals)
    assert not any("->" in name for name in readable_signals(model))
