"""The bank of FilterPy's filters in the benchmarks: the model it gets, its alarm, its ranking, its lines."""

import warnings

import numpy as np
import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of what it imports
    pytest.importorskip("filterpy")

from benchmarks import filterpy_bank, rivals
from benchmarks.plants import case
from benchmarks.play import Outcome, Reading, engine_of, watch

from faultbond.simulate import Fault, Simulation


def recorded(folder: str, seconds: float, *faults: Fault) -> Simulation:
    """Record an example plant."""
    return case(folder, 3, faults, seconds=seconds).recording


@pytest.mark.parametrize(("folder", "seconds"), [("tank", 700.0), ("rlc", 10.0)])
def test_healthy_filter_is_ours(folder: str, seconds: float) -> None:
    """FilterPy's filter has our model: its sums are ours, steps of valves and slow errors included."""
    spec, engine = engine_of(folder)
    recording, never = recorded(folder, seconds), float("inf")
    theirs = filterpy_bank.watch(rivals.model_of(folder), never, spec, engine, recording, None, 0.0)
    assert theirs.detection is None
    assert theirs.cusum > 2.0
    assert theirs.cusum == pytest.approx(watch(spec, engine, recording, None, 0.0).cusum, rel=1e-6)


def test_bank_finds_a_fault() -> None:
    """A winding of twice the resistance is seen, first, and about twice; nothing is told before the alarm."""
    spec, engine = engine_of("dc_motor")
    recording = recorded("dc_motor", 25.0, Fault(parameter="R", factor=2.0, start=10.0))
    seen = filterpy_bank.watch(rivals.model_of("dc_motor"), 20.0, spec, engine, recording, 10.0, 8.0)
    assert seen.detection is not None
    assert 10.0 < seen.detection.change_time < seen.detection.time < 12.0
    assert seen.cusum < 20.0
    last = seen.diagnoses[-1]
    assert last.time == pytest.approx(seen.detection.time + 8.0, abs=0.03)
    assert last.candidates[0].parameters == ("R",)
    assert last.candidates[0].suspects[0].estimate == pytest.approx(6.0, rel=0.1)
    assert sum(item.probability for item in last.candidates) == pytest.approx(1.0)
    assert len(last.candidates) == 15


def test_ranges_of_parameters_are_kept() -> None:
    """However wide a parameter is at the alarm, its estimate stays in the range of the model."""
    spec, engine = engine_of("rlc")
    recording = recorded("rlc", 3.0)
    start = filterpy_bank.start_of(spec, engine, recording)
    bank = filterpy_bank.begin(rivals.model_of("rlc"), spec, start, np.ones(2))
    for reading in filterpy_bank.readings_of(spec, recording)[20:60]:
        bank, _, _ = filterpy_bank.advance(bank, reading)
    factors = np.array([item.x[spec.parameter_slice] for item in bank.filters])
    assert np.all(factors >= [item.lower for item in spec.parameters])
    assert np.all(factors <= [item.upper for item in spec.parameters])


def outcome(alarm: float, rank: int) -> Outcome:
    """One run of the circuit with a fault at 20 s."""
    reading = Reading(after=20.0, rank=rank, probability=0.5, group=True, error=0.01, winner="C", winner_probability=1)
    early = alarm < 20.0
    return Outcome(
        key="rlc.C",
        seed=1,
        onset=20.0,
        counted_from=20.0,
        alarm=alarm,
        delay=None if early else alarm - 20.0,
        early=early,
        cusum=3.0,
        slow=0.0,
        readings=() if early else (reading,) * 3,
    )


def test_lines_of_the_table() -> None:
    """Both stand side by side, an early alarm is counted."""
    lines = rivals.rows_of_both("rlc.C", [(outcome(21.0, 1), outcome(22.0, 2)), (outcome(21.5, 1), outcome(15.0, 1))])
    assert lines[0][1:] == ("1.6 s", "1.5 s (median 1 s; none missed)", "never (median 2 s; 1 missed)", "better")
    assert lines[1][2:] == ("2 of 2 (100 %)", "0 of 2 (0 %)", "better")
    assert lines[2][2:] == ("1 % (median 1 %)", "none (median 1 %)", "better")
    assert lines[-1] == ("rlc, C x1.34: alarms before the fault", "0", "0", "1", "better")
    turned = rivals.rows_of_both("rlc.C", [(outcome(22.0, 1), outcome(21.0, 1))])
    assert [line[-1] for line in turned] == ["worse", "equal", "equal", "equal"]
