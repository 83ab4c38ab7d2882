"""The bank of FilterPy's filters in the benchmarks: the model it gets, its alarm, its ranking, its lines."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of what it imports
    pytest.importorskip("filterpy")

from benchmarks.peers import filterpy_bank, rivals
from benchmarks.peers.filterpy_bank import START_SAMPLES
from benchmarks.shared.plants import case
from benchmarks.shared.play import engine_of
from benchmarks.trust.figures import Outcome, Reading, watch

from faultbond.simulate import Fault, Simulation


def recorded(folder: str, seconds: float, *faults: Fault) -> Simulation:
    """Record an example plant."""
    return case(folder, 3, faults, seconds=seconds).recording


@pytest.mark.parametrize(("folder", "seconds"), [("tank", 700.0), ("rlc", 10.0)])
def test_healthy_filter_is_ours(folder: str, seconds: float) -> None:
    """FilterPy's filter has our model: its sums are ours, steps of valves and slow errors included."""
    spec, core = engine_of(folder)
    recording, never = recorded(folder, seconds), float("inf")
    theirs = filterpy_bank.watch(rivals.model_of(folder), never, spec, core, recording, None, 0.0)
    assert theirs.detection is None
    assert theirs.cusum > 2.0
    assert theirs.cusum == pytest.approx(watch(spec, core, recording, None, 0.0).cusum, rel=1e-6)


def test_bank_finds_a_fault() -> None:
    """A winding of twice the resistance is seen, first, and about twice; nothing is told before the alarm."""
    spec, core = engine_of("dc_motor")
    recording = recorded("dc_motor", 25.0, Fault(parameter="R", factor=2.0, start=10.0))
    seen = filterpy_bank.watch(rivals.model_of("dc_motor"), 20.0, spec, core, recording, 10.0, 8.0)
    assert seen.detection is not None
    assert 10.0 < seen.detection.change_time < seen.detection.time < 12.0
    assert seen.cusum < 20.0
    last = seen.diagnoses[-1]
    assert last.time == pytest.approx(seen.detection.time + 8.0, abs=0.03)
    assert last.candidates[0].parameters == ("R",)
    assert last.candidates[0].suspects[0].estimate == pytest.approx(6.0, rel=0.1)
    assert sum(item.probability for item in last.candidates) == pytest.approx(1.0)
    assert len(last.candidates) == 15


def test_filter_before_the_change_is_taken() -> None:
    """The bank begins from the healthy filter as it stood one sample before the sum began to rise."""
    spec, core = engine_of("rlc")
    recording, model = recorded("rlc", 8.0, Fault(parameter="C", factor=1.5, start=5.0)), rivals.model_of("rlc")
    readings, start = filterpy_bank.readings_of(spec, recording), filterpy_bank.start_of(spec, core, recording)
    alarm = filterpy_bank.wait(model, spec, readings, start, 15.0)
    assert alarm.sample is not None
    assert START_SAMPLES < alarm.change < alarm.sample
    bank = filterpy_bank.bank_of(model, spec, [start])
    for reading in readings[START_SAMPLES : alarm.change]:
        bank, _, _ = filterpy_bank.advance(bank, reading)
    np.testing.assert_allclose(alarm.before.mean, bank.filters[0].x, rtol=1e-12)
    assert alarm.peaks[-1] > 15.0 >= alarm.peaks[:-1].max()


def test_readings_that_settle_do_not_count() -> None:
    """However far off a reading is, no sum grows while an input step settles; else it does."""
    spec, core = engine_of("rlc")
    recording, model = recorded("rlc", 2.0), rivals.model_of("rlc")
    start = filterpy_bank.start_of(spec, core, recording)
    readings = [replace(item, y=item.y + 50.0) for item in filterpy_bank.readings_of(spec, recording)]
    settling = [replace(item, scale=np.array([spec.thresholds.blank_factor])) for item in readings]
    assert filterpy_bank.wait(model, spec, settling, start, 5.0).peaks.max() == 0.0
    assert filterpy_bank.wait(model, spec, readings, start, 5.0).sample is not None


def test_how_the_bank_begins() -> None:
    """Suspects are as wide as a quarter of their change and alone, states off by their usual size, the rest stays."""
    spec, core = engine_of("dc_motor")
    start = filterpy_bank.start_of(spec, core, recorded("dc_motor", 2.0))
    usual = np.array([2.0, 3.0])
    bank = filterpy_bank.begin(rivals.model_of("dc_motor"), spec, start, usual)
    for chosen, item in zip(spec.hypotheses, bank.filters, strict=True):
        places = [spec.parameter_slice.start + index for index in chosen]
        wide = [0.25 * spec.parameters[index].change * start.mean[k] for index, k in zip(chosen, places, strict=True)]
        np.testing.assert_allclose(item.P[np.ix_(places, places)], np.diag(np.square(wide)))
        np.testing.assert_allclose(np.diag(item.P)[:2], np.diag(start.covariance)[:2] + usual**2)
        others = np.delete(np.arange(2, spec.n_joint), np.array(places) - 2)
        np.testing.assert_array_equal(item.P[np.ix_(others, others)], start.covariance[np.ix_(others, others)])
        np.testing.assert_array_equal(item.x, start.mean)
    shares = {item.parameters: item.probability for item in filterpy_bank.rank(bank, 1.0).candidates}
    assert shares[("R",)] / shares[("R", "L")] == pytest.approx(np.exp(spec.thresholds.cost_per_suspect))


def test_ranges_of_parameters_are_kept() -> None:
    """Whatever is read, estimates stay in the range of the model; without their limits they would not."""
    spec, core = engine_of("rlc")
    recording = recorded("rlc", 3.0)
    start = filterpy_bank.start_of(spec, core, recording)
    bank = filterpy_bank.begin(rivals.model_of("rlc"), spec, start, np.ones(2))
    lower, upper = (np.array([getattr(item, side) for item in spec.parameters]) for side in ("lower", "upper"))
    reached = False
    for reading in filterpy_bank.readings_of(spec, recording)[20:80]:
        bank, _, _ = filterpy_bank.advance(bank, replace(reading, y=reading.y + 300.0))
        factors = np.array([item.x[spec.parameter_slice] for item in bank.filters])
        assert np.all((factors >= lower) & (factors <= upper))
        reached |= bool(np.any((factors == lower) | (factors == upper)))
    assert reached


def outcome(alarm: float, rank: int) -> Outcome:
    """One run of the circuit with a fault at 20 s."""
    reading = Reading(rank=rank, error=0.01)
    early = alarm < 20.0
    return Outcome(
        key="rlc.C",
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
