"""A fault that was mended: nominal again, with all else as it was known before."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from faultbond.cli import main
from faultbond.contract.findings import Candidate
from faultbond.contract.samples import Status
from faultbond.contract.spec import unpack
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from made import EXAMPLES, changed, plant, recorded

MODEL = EXAMPLES / "rc" / "model.yaml"
ROWS, MENDED = 600, 300  # at 50 Hz; C is 160 uF from 2 s to 6 s


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with a recording before and after C was mended."""
    place = tmp_path_factory.mktemp("recordings")
    rows = [f"{k * 0.02:.2f},{(5, 9, 3)[k // 40 % 3]}" for k in range(ROWS)]
    (place / "inputs.csv").write_text("\n".join(["time,V", *rows]) + "\n")
    common = ["simulate", str(MODEL), "--inputs", str(place / "inputs.csv"), "--seed", "1", "--fault", "C=160@2,4"]
    assert main([*common, "-o", str(place / "all.csv")]) == 0
    header, *rows = (place / "all.csv").read_text().splitlines(keepends=True)
    (place / "before.csv").write_text("".join([header, *rows[:MENDED]]))
    (place / "after.csv").write_text("".join([header, *rows[MENDED:]]))
    return place


def gone_on(folder: Path, *decision: str, code: int) -> list[str]:
    """What a run says after C was mended, if a person decided so after the run before; without diagnoses."""
    state, target = folder / f"{len(decision)}.state", folder / "records.jsonl"
    state.unlink(missing_ok=True)
    target.unlink(missing_ok=True)
    assert main(["run", str(MODEL), str(folder / "before.csv"), "--state", str(state)]) == 1
    assert main(["accept", str(MODEL), str(state), *decision]) == 0
    assert main(["run", str(MODEL), str(folder / "after.csv"), "--state", str(state), "--json", str(target)]) == code
    found = [json.loads(line)["record"] for line in target.read_text(encoding="utf-8").splitlines()]
    return [word for word in found if word != "diagnosis"]


def test_what_was_mended_is_healthy(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With `--repaired` the mended plant is quiet; accepted as the new normal, it raises an alarm."""
    assert gone_on(folder, "C", "--repaired", code=0) == ["run", "end"]
    said = capsys.readouterr().out
    assert "Repaired at 5.98 s: C (" in said
    assert "It is as the model file says again." in said
    assert gone_on(folder, "C", code=1) == ["run", "detection", "end"]


def test_the_record_says_so(folder: Path, tmp_path: Path) -> None:
    """The record of what was accepted tells whether it is mended."""
    state, target = tmp_path / "x.state", tmp_path / "x.jsonl"
    for options, repaired in (["--repaired"], True), ([], False):
        state.unlink(missing_ok=True)
        assert main(["run", str(MODEL), str(folder / "before.csv"), "--state", str(state)]) == 1
        assert main(["accept", str(MODEL), str(state), *options, "--json", str(target)]) == 0
        record = json.loads(target.read_text(encoding="utf-8"))
        assert (record["record"], record["repaired"], record["by"]) == ("accepted", repaired, "person")


@cache
def alarmed() -> Monitor:
    """A motor in alarm, all filters begun."""
    _, _, core = plant("dc_motor_current")
    monitor = Monitor(core)
    for sample in recorded("dc_motor_current", 400, Fault(parameter="K", factor=0.7, start=3.0)):
        monitor.step(sample)
    monitor.conclude()
    return monitor


def candidate(name: str) -> Candidate:
    """The candidate of one suspect, by its name."""
    found = alarmed().copy().conclude().candidates
    return next(item for item in found if [one.parameter.partition(".")[0] for one in item.suspects] == [name])


def test_a_parameter_is_as_declared() -> None:
    """Its factor is 1 and its sd the accuracy, and nothing else is known by it; the states are where they were."""
    chosen, spec = candidate("K"), alarmed().spec
    mended, taken = alarmed().copy(), alarmed().copy()
    assert repr(mended.accept(chosen.hypothesis, repaired=True).suspects) == repr(chosen.suspects)  # nan is no nan
    taken.accept(chosen.hypothesis)
    k = spec.parameter_slice.start + [item.name for item in spec.parameters].index("K")
    lane, other = mended.numbers("healthy.lane"), taken.numbers("healthy.lane")
    assert lane[k] == 1.0
    assert other[k] == pytest.approx(0.7, abs=0.05)
    covariance, before = (unpack(spec, item[spec.covariance_slice]) for item in (lane, other))
    assert covariance[k, k] == pytest.approx(0.03**2)
    assert np.count_nonzero(covariance[k]) == 1
    states = slice(0, spec.parameter_slice.start)
    assert np.array_equal(covariance[states, states], before[states, states])
    assert np.array_equal(lane[states], other[states])
    assert np.array_equal(mended.numbers("normal.lane"), lane)


def test_the_other_parameters_are_as_they_were_known_before_the_fault() -> None:
    """What they learned with the fault, or when it was gone already, is forgotten; but not where one drifts to."""
    chosen, spec, names = candidate("K").hypothesis, alarmed().spec, [item.name for item in alarmed().spec.parameters]
    before = alarmed().numbers("bank.healthy")
    mended = alarmed().copy()
    mended.accept(chosen, repaired=True)
    lane, rest = mended.numbers("healthy.lane"), np.array([name != "K" for name in names])
    known, was = (unpack(spec, item[spec.covariance_slice]) for item in (lane, before))
    learned, taken = np.flatnonzero(rest) + spec.parameter_slice.start, alarmed().copy()
    assert np.array_equal(lane[learned], before[learned])
    assert np.array_equal(known[np.ix_(learned, learned)], was[np.ix_(learned, learned)])
    taken.accept(chosen)
    assert not np.any(lane[learned] == taken.numbers("healthy.lane")[learned])

    drifting = changed(alarmed(), **{"normal.rates": np.where(np.arange(len(names)) == names.index("J"), 1e-6, 0.0)})
    drifting.accept(chosen, repaired=True)
    j, found = spec.parameter_slice.start + names.index("J"), drifting.numbers("healthy.lane")
    assert found[j] == taken.numbers("healthy.lane")[j]
    assert np.count_nonzero(unpack(spec, found[spec.covariance_slice])[j]) == 1


def test_an_instrument_is_believed_again() -> None:
    """What was taken off a sensor, or put onto an input, is no more; a sensor that was out of use is in use."""
    wrong = {"normal.gain": 1.2, "normal.offset": 3.0, "normal.noise": np.inf, "normal.input_offset": 2.0}
    monitor = changed(alarmed(), **wrong)
    held = monitor.numbers("inputs.held")[0]
    sensor = monitor.copy()
    sensor.accept(candidate("omega").hypothesis, repaired=True)
    assert [float(sensor.numbers(f"normal.{name}")[0]) for name in ("gain", "offset", "noise")] == [1.0, 0.0, 1.0]
    assert [float(sensor.numbers(f"normal.{name}")[1]) for name in ("gain", "offset", "noise")] == [1.2, 3.0, np.inf]
    assert sensor.in_use.tolist() == [True, False]
    source = monitor.copy()
    source.accept(candidate("V").hypothesis, repaired=True)
    assert source.number("normal.input_offset") == 0.0
    assert source.number("inputs.held") == pytest.approx(held - 2.0)


def test_the_mended_plant_may_stand_elsewhere() -> None:
    """The sample after it finds states that are as uncertain as after a gap of unknown length, and the alarms on."""
    mended, taken = alarmed().copy(), alarmed().copy()
    chosen = candidate("K").hypothesis
    mended.accept(chosen, repaired=True)
    taken.accept(chosen)
    sample = recorded("dc_motor_current", 401)[400]
    for monitor in (mended, taken):
        assert monitor.step(sample).status is Status.WATCHING
    place = mended.spec.sample_fields["gap"]
    assert np.all(mended.row(400)[0][place] > 0.0)
    assert np.all(taken.row(400)[0][place] == 0.0)
