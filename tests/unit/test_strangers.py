"""Plants of strangers in the benchmarks: they simulate, their models load, and what a run says is judged rightly."""

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.plants import EXAMPLES
from benchmarks.trust.strangers.faults import ORDER, STRUCK, TO_TUNE, Fault, Kind, fault_of
from benchmarks.trust.strangers.judge import Outcome, Verdict, far_off, judged
from benchmarks.trust.strangers.ready import HERE, records_of, told_of
from benchmarks.trust.strangers.rig import Change, Form, Input, Recording, Rig, Sensor, record
from benchmarks.trust.strangers.table import calibration, keep, read, rig_of, rows, rows_of_kinds

from faultbond.model.text import load_model

FAULT = Fault(
    kind=Kind.STEP, changes=(), truth={"K": (Form.FACTOR, -0.2)}, onset=100.0
)  # of a nominal of 10, so the true value is 8


def suspect(estimate: float = 8.0, sd: float = 0.1, nominal: float = 10.0) -> dict[str, float]:
    """Give what is said of a suspect."""
    return {"estimate": estimate, "sd": sd, "nominal": nominal}


def candidate(name: str, *numbers: float, probability: float, group: bool = True) -> dict[str, Any]:
    """Give a candidate of one suspect."""
    return {"parameters": {name: suspect(*numbers)}, "probability": probability, "group": group}


def told(*candidates: dict[str, Any], time: float = 900.0, unexplained: bool = False) -> list[dict[str, Any]]:
    """Give the records of a run with an alarm at 150 s and one diagnosis."""
    what = {"signal": "y", "sd": 1.0} if unexplained else None
    diagnosis = {"record": "diagnosis", "time": time, "candidates": list(candidates), "unexplained": what}
    return [{"record": "run"}, {"record": "detection", "time": 150.0}, diagnosis, {"record": "end"}]


def judge(records: list[dict[str, Any]], fault: Fault | None = FAULT) -> Outcome:
    """Judge records of a plant sampled once a second."""
    return judged("pump_skid", 1, fault, records, 1.0)


RIGHT, WRONG = candidate("K", probability=0.97), candidate("flow.bias", 3.0, probability=0.97)


def test_the_truth_first_is_right_and_its_delay_counts_from_the_fault() -> None:
    """First, neither wrong, 50 s after the fault."""
    found = judge(told(RIGHT))
    assert (found.verdict, found.delay, found.wrong_name, found.wrong_value) == (Verdict.FIRST, 50.0, False, False)


def test_another_set_that_is_sure_is_sure_and_wrong() -> None:
    """More than 95 % for another set, which nothing calls into question."""
    found = judge(told(WRONG, replace_group(RIGHT)))
    assert (found.verdict, found.wrong_name, found.named) == (Verdict.OTHER, True, ("flow.bias",))
    assert not judge(told({**WRONG, "probability": 0.94})).wrong_name


def replace_group(item: dict[str, Any]) -> dict[str, Any]:
    """Give a candidate that is not in the group."""
    return {**item, "group": False}


def test_a_truth_that_is_not_first_is_in_the_group_or_not() -> None:
    """The group counts, whatever the rank."""
    assert judge(told({**WRONG, "probability": 0.6}, {**RIGHT, "probability": 0.4})).verdict is Verdict.GROUP
    assert judge(told(WRONG, replace_group(RIGHT))).verdict is Verdict.OTHER


def test_what_is_said_to_explain_nothing_is_honest() -> None:
    """It is not sure, so it cannot be sure and wrong, and its percentages are no claims."""
    found = judge(told(WRONG, unexplained=True))
    assert (found.verdict, found.wrong_name, found.claims) == (Verdict.UNEXPLAINED, False, ())


def test_no_alarm_is_missed_and_one_before_the_fault_is_false() -> None:
    """A run without a detection; one with it too early; a healthy one with it."""
    assert judge([{"record": "run"}, {"record": "end"}]).verdict is Verdict.MISSED
    assert judge(told(RIGHT), replace(FAULT, onset=151.0)).verdict is Verdict.EARLY
    assert judge(told(RIGHT), None).verdict is Verdict.EARLY
    assert judge([{"record": "run"}, {"record": "end"}], None).verdict is Verdict.QUIET


@pytest.mark.parametrize(
    ("estimate", "sd", "wrong"),
    [(8.1, 0.01, False), (10.1, 0.4, True), (10.1, 0.6, False), (9.9, 0.01, False), (5.9, 0.1, True)],
)
def test_a_value_is_far_off_by_both_four_sd_and_a_quarter(estimate: float, sd: float, wrong: bool) -> None:
    """The truth is 8: a quarter of it is 2."""
    assert far_off("K", suspect(estimate, sd), FAULT) is wrong
    assert judge(told(candidate("K", estimate, sd, probability=0.99))).wrong_value is wrong
    assert not judge(told(candidate("K", estimate, sd, probability=0.9))).wrong_value


def test_the_value_of_a_sensor_is_its_bias() -> None:
    """A bias is compared with the truth; a gain, or a kind without a size, is not."""
    fault = replace(FAULT, truth={"flow": (Form.SHIFT, 3.0)})
    assert far_off("flow.bias", suspect(4.0, 0.1, 0.0), fault)
    assert not far_off("flow.bias", suspect(3.5, 0.1, 0.0), fault)
    assert not far_off("flow.gain", suspect(4.0, 0.1, 1.0), fault)
    assert not far_off("flow.bias", suspect(9.0, 0.1, 0.0), replace(FAULT, truth={"flow": (Form.STUCK, None)}))


def test_records_of_a_run_are_read_as_they_are_written() -> None:
    """The capacitor of the example is named at the end, at a value that is right by what the command says."""
    folder = EXAMPLES / "rc"
    records = records_of(folder / "model.yaml", folder / "fault_capacitor.csv")
    last = [item for item in records if item["record"] == "diagnosis"][-1]["candidates"][0]["parameters"]["C"]
    part = last["estimate"] / last["nominal"] - 1.0
    right = replace(FAULT, truth={"C": (Form.FACTOR, part)}, onset=0.1)
    found = judged("rc", 0, right, records, 0.02)
    assert (found.verdict, found.named, found.wrong_value) == (Verdict.FIRST, ("C",), False)
    assert found.claims[-1].right
    assert judged("rc", 0, replace(right, truth={"C": (Form.FACTOR, 3.0)}), records, 0.02).wrong_value


def test_claims_count_from_some_time_after_the_alarm() -> None:
    """By tenths, the mean claim and what was right of it; those earlier than 200 samples are none."""
    early, late = told({**WRONG, "probability": 0.9}, time=349.0), told({**WRONG, "probability": 0.62})
    outcomes = [judge(early), judge(late), judge(told({**RIGHT, "probability": 0.66})), judge(told(RIGHT))]
    assert calibration(outcomes) == [("60 to 70 %", "64.0 %", "50.0 %", "2"), ("90 to 100 %", "97.0 %", "100.0 %", "1")]


def test_the_tables_count_runs_and_outcomes_are_read_as_they_were_kept(tmp_path: Path) -> None:
    """A line a plant, a sum for those to tune on, a line a kind."""
    found = [judge(told(RIGHT)), judge(told(WRONG)), judge([]), judge([], None), judge(told(RIGHT), None)]
    line = ("1 of 2", "3", "0", "1", "1", "0", "0", "1", "1", "0", "50")
    assert rows(found) == [("pump_skid (to tune on)", *line), ("all to tune on", *line)]
    assert rows_of_kinds(found) == [("component: step", "", *line[1:])]
    assert list(keep(iter(found), tmp_path / "runs.jsonl")) == found
    assert list(read([tmp_path / "runs.jsonl"])) == found


@pytest.mark.parametrize("plant", STRUCK)
def test_every_plant_simulates_as_its_model_names_it(plant: str) -> None:
    """Columns as the model wants them, finite, alike for a seed, and each kind of fault strikes something there is."""
    rig, graph = replace(rig_of(plant), rows=40), load_model(HERE / f"{plant}.yaml")
    found, again, other = record(rig, (), 3), record(rig, (), 3), record(rig, (), 4)
    names = [*(item.name for item in graph.inputs), *(item.name for item in graph.sensors)]
    assert list(found.columns) == ["time", *names] == ["time", *rig.inputs, *rig.sensors]
    assert rig.step == graph.sample_time
    for name, column in found.columns.items():
        assert np.all(np.isfinite(column))
        np.testing.assert_array_equal(column, again.columns[name])
    assert any(np.any(found.columns[name] != other.columns[name]) for name in names)
    suspects = {item.name for item in graph.parameters if item.suspect}
    suspects |= {item.name for item in graph.inputs if item.suspect} | {s.name for s in graph.sensors if s.suspect}
    faults = [fault_of(rig, seed) for seed in range(len(ORDER))]
    assert {item.kind for item in faults} == set(Kind)
    assert set().union(*(item.truth for item in faults)) <= suspects


@cache
def healthy_one(plant: str) -> tuple[Rig, Recording]:
    """Give a plant that is recorded for a short time, and what is recorded."""
    rig = replace(rig_of(plant), rows=700)
    return rig, record(rig, (), 5)


@pytest.mark.parametrize("plant", STRUCK)
@pytest.mark.parametrize("kind", [Kind.STEP, Kind.SENSOR_RAMP, Kind.INPUT_STUCK, Kind.INPUT_LAG, Kind.SENSORS])
def test_a_fault_changes_a_recording_from_its_onset_on(plant: str, kind: Kind) -> None:
    """Before it every number is that of the healthy recording; after it some are not."""
    rig, healthy = healthy_one(plant)
    fault = fault_of(rig, ORDER.index(kind))
    faulty = record(rig, fault.changes, 5)
    before = healthy.columns["time"] < fault.onset
    assert 0.25 < before.mean() < 0.5
    assert all(np.array_equal(c[before], faulty.columns[n][before]) for n, c in healthy.columns.items())
    assert any(np.any(c[~before] != faulty.columns[n][~before]) for n, c in healthy.columns.items())


def rate(x: Any, u: Any, p: Any) -> list[float]:
    """Give the rate of a state that follows its input."""
    return [p["k"] * (u[0] - x[0])]


SIMPLE = Rig(
    name="simple",
    step=1.0,
    rows=60,
    substeps=4,
    parameters={"k": 0.5},
    inputs={"u": Input(lag=2.0)},
    sensors={},
    begin=lambda _: ([0.0], lambda time, _: [float(time >= 10.0)]),
    rate=rate,
    reads=lambda x, u, p: [],
)


def test_a_change_grows_in_a_straight_line_and_stays() -> None:
    """At once where it begins and ends at the same time."""
    ramp = Change(target="k", form=Form.SHIFT, size=2.0, start=10.0, end=20.0)
    np.testing.assert_allclose(ramp.part(np.array([9.0, 10.0, 15.0, 20.0, 30.0])), [0.0, 0.0, 0.5, 1.0, 1.0])
    step = replace(ramp, end=10.0)
    np.testing.assert_allclose(step.part(np.array([9.9, 10.0, 10.1]))[[0, 2]], [0.0, 1.0])


def test_an_actuator_lags_and_may_stick() -> None:
    """Two seconds of lag and a plant of two seconds; stuck before the step nothing moves."""
    rig = replace(SIMPLE, sensors={"x": Sensor(noise=0.0)}, reads=lambda x, u, p: [x[0]])
    free = record(rig, (), 1).columns["x"]
    assert free[10] == 0.0
    assert 0.3 < free[14] < 0.9
    assert free[-1] == pytest.approx(1.0, abs=1e-6)
    stuck = record(rig, (Change(target="u", form=Form.STUCK, start=5.0, end=5.0),), 1)
    assert np.all(stuck.columns["x"] == 0.0)
    assert stuck.columns["u"][-1] == 1.0
    slow = record(rig, (Change(target="u", form=Form.LAG, size=10.0, start=5.0, end=5.0),), 1).columns["x"]
    assert np.all(slow[12:] < free[12:])


def test_it_is_told_what_was_done_to_a_model() -> None:
    """What was added, raised and lowered stands there, and whether that was enough."""
    added = [{"kind": "lag", "of": "P"}, {"kind": "slow error", "of": "q"}]
    raised = [{"what": "noise of L1", "times": 1.5625}]
    lowered = [{"what": "slow error of q", "times": 0.394}]
    found = {"added": added, "raised": raised, "lowered": lowered, "quiet": True}
    sizes = "noise of L1 times 1.6; slow error of q times 0.39"
    assert told_of(found) == f"fitted; lag of P; slow error of q; {sizes}; quiet"
    assert told_of({"added": [], "raised": [], "lowered": [], "quiet": False}) == "fitted; not quiet on all of them"


def test_three_plants_are_kept_for_the_report() -> None:
    """Half of them are to tune on."""
    assert len(STRUCK) == 6
    assert len(TO_TUNE) == 3
    assert set(TO_TUNE) < set(STRUCK)
