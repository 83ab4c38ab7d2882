"""Three tanks of a laboratory, twelve faults that others made under feedback.

The recordings are not part of the project.
"""

import os
from pathlib import Path

import numpy as np
import pytest
from benchmarks.peers.dts200 import BEGIN, CLOSE, FIRST_MODEL, MADE, MODEL, Made, Run, cells, judged, summary, watch
from benchmarks.peers.recordings import Outcome, Rig, build_rig

from faultbond.contract.findings import Candidate, Detection, Diagnosis, Suspect, Unexplained
from faultbond.model.text import load_model
from faultbond.types import FaultKind

DATA = os.environ.get("FAULTBOND_DATA")
FOLDER = Path(DATA or "") / "three_tanks"
needs_data = pytest.mark.skipif(not DATA, reason="FAULTBOND_DATA is not set")
OF = {made.number: made for made in MADE}
LEAK = OF["07"]
ALIKE = {"07": ("L1", "Q1.bias"), "11": ("a2", "Q2.bias")}


@pytest.fixture(scope="module")
def rig() -> Rig:
    """The model of the example with its core."""
    return build_rig(MODEL)


def found(name: str, estimate: float, *, alarm: float = 300.0, probability: float = 0.99, sure: bool = True) -> Outcome:
    """Give what a run brought that ends with one candidate."""
    suspect = Suspect(parameter=name, component="part", nominal=0.0, estimate=estimate, sd=1e-6)
    best = Candidate(suspects=(suspect,), probability=probability, group=True, kind=FaultKind.DRIFT)
    doubt = None if sure else Unexplained(signal="h1", sd=5.0, since=400.0, until=500.0)
    return Outcome(
        detection=Detection(time=alarm, sample=int(alarm), change_time=BEGIN, signals=("h1",)),
        diagnoses=(Diagnosis(time=2000.0, candidates=(best,), unexplained=doubt),),
        cusum=np.zeros(3),
        slow=np.zeros(3),
    )


def run_of(name: str, estimate: float, made: Made = LEAK, **words: float | bool) -> Run:
    """Judge such a run."""
    return judged(found(name, estimate, **words), made, BEGIN, 2000.0)  # type: ignore[arg-type]


def test_the_models_name_their_suspects() -> None:
    """Names of parameters and columns are what users and scripts rely on, before the fit and after it."""
    for path in (FIRST_MODEL, MODEL):
        graph = load_model(path)
        assert {item.name for item in graph.parameters} == {"a1", "a2", "a3", "L1", "L2", "L3"}
        assert [item.column for item in graph.inputs] == ["Q1", "Q2"]
        assert [item.column for item in graph.sensors] == ["h1", "h2", "h3"]


def test_the_fit_changed_numbers_only() -> None:
    """What is documented stays: sections, ranges and changes; the fit adds slow errors."""
    first, fitted = load_model(FIRST_MODEL), load_model(MODEL)
    assert not first.slow_errors
    assert {item.target for item in fitted.slow_errors} >= {"pump1.f"}
    for before in first.parameters:
        after = fitted.parameter(before.name)
        assert abs(after.nominal - before.nominal) <= before.accuracy
        assert (after.lower, after.upper) == (before.lower, before.upper)


def test_a_run_is_judged_by_name_and_size() -> None:
    """A leak of 0.09 cm2 at the end is right by name within 3 %; an instrument counts whatever its kind."""
    right = run_of("L1", 0.092e-4)
    assert right.first
    assert right.alarm == 100.0
    assert right.error == pytest.approx(0.02 / 0.9)
    assert cells(right)[2:8] == ("100 s", "L1", "0.990", "0.092 cm2", "0.09 cm2", "2.2 %")
    stuck = run_of("Q1.stuck", 20e-6, OF["02"])
    assert stuck.first
    assert stuck.error is None


def test_sure_and_wrong_is_counted() -> None:
    """Another name with more than 95 % is, unless it is said not to explain the data; so is an alarm too early."""
    wrong, doubted = run_of("Q1.bias", -25e-6), run_of("Q1.bias", -25e-6, sure=False)
    assert wrong.sure_and_wrong
    assert not doubted.sure_and_wrong
    early = run_of("L1", 0.099e-4, alarm=150.0)
    words = summary([wrong, doubted, early])
    assert "it came first in 1, was in the group in 1, and its value was within 3 % in 0" in words
    assert "Another thing with more than 95 %: 1 of 3. Alarms before the fault: 1." in words


@needs_data
def test_healthy_is_quiet(rig: Rig) -> None:
    """100 min, from which the model was fitted."""
    assert rig.watch(rig.read(FOLDER / "healthy.csv"), to_alarm=True).alarm is None


@needs_data
@pytest.mark.parametrize("number", [made.number for made in MADE if made.name and made.number not in ALIKE])
def test_one_fault_is_named_with_its_size(rig: Rig, number: str) -> None:
    """What grows from 200 s on is found later than that and comes first, within 3 % of its true size."""
    run = watch(rig, FOLDER / f"fault{number}.csv", OF[number])
    assert run.alarm is not None
    assert 0.0 < run.alarm < 300.0
    assert run.first
    assert not run.unexplained
    assert run.error is not None
    assert run.error < CLOSE


@needs_data
@pytest.mark.parametrize("number", ALIKE)
def test_what_leaves_a_tank_and_its_pump_are_not_told_apart(rig: Rig, number: str) -> None:
    """The level is held, so more or less that leaves and what comes are the same: both are told, neither sure."""
    run = watch(rig, FOLDER / f"fault{number}.csv", OF[number])
    assert set(run.group) == {(name,) for name in ALIKE[number]}
    assert run.probability < 0.8


@needs_data
def test_two_inputs_that_swing_are_unexplained(rig: Rig) -> None:
    """No fault of the model swings; an input comes nearest, and is said not to explain it."""
    run = watch(rig, FOLDER / "fault01.csv", OF["01"])
    assert run.unexplained
    assert {name.partition(".")[0] for name in run.best} <= {"Q1", "Q2"}
