"""An alarm that is over by itself, since nothing was at fault for long, and the fault that comes after it."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from faultbond.app.plant import find_plant
from faultbond.app.wishes import Wanted
from faultbond.cli import main
from faultbond.contract.samples import Sample
from faultbond.equations.plant import build_plant
from faultbond.io.recording import read_blocks
from faultbond.io.row_block import joined_rows
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.service.alarm import AlarmState
from faultbond.service.asset import Asset
from faultbond.service.shown import events_of
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_core
from made import EXAMPLES, changed, graph_of, in_full, plant, recorded, run, samples_of, spec_of
from watching import Said, assert_same, ran, watched

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
MODEL = EXAMPLES / "rc" / "model.yaml"
ROWS, BURST, FAULTY = 2600, range(400, 500), 44.0  # samples at which the reading is 1.2 sd off; s, when C rises
OVER = 600  # samples for which nothing was at fault before


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording with a burst by which there is an alarm, and a fault half a minute later."""
    folder = tmp_path_factory.mktemp("over")
    inputs, target = folder / "inputs.csv", folder / "recording.csv"
    inputs.write_text("\n".join(["time,V", *(f"{k * 0.02:.2f},{(5, 9, 3)[k // 40 % 3]}" for k in range(ROWS))]) + "\n")
    common = ["simulate", str(MODEL), "--inputs", str(inputs), "--seed", "5", "--fault", f"C=160@{FAULTY:g}"]
    assert main([*common, "-o", str(target)]) == 0
    header, *rows = target.read_text().splitlines()
    place = header.split(",").index("V_C")
    for k in BURST:
        cells = rows[k].split(",")
        cells[place] = f"{float(cells[place]) + 0.12:.6f}"
        rows[k] = ",".join(cells)
    target.write_text("\n".join([header, *rows]) + "\n")
    return target


@pytest.fixture(scope="module")
def said(recording: Path) -> Said:
    """What a run says to it."""
    return ran(MODEL, recording.read_bytes())


def test_the_fault_behind_it_is_found(said: Said) -> None:
    """The alarm of the burst is over after 600 samples, and the fault gets an alarm and a diagnosis of its own."""
    first, over, second = (record for record in said.records if record["record"] in {"detection", "accepted"})
    assert [item["record"] for item in (first, over, second)] == ["detection", "accepted", "detection"]
    assert first["sample"] in BURST
    assert (over["components"], over["parameters"], over["kind"], over["by"]) == ([], {}, None, "rule")
    assert OVER * 0.02 <= over["time"] - first["time"] < (OVER + 200) * 0.02
    assert 0.0 < second["time"] - FAULTY < 1.0
    last = said.records[-2]
    assert last["candidates"][0]["components"] == ["C"]
    assert last["candidates"][0]["parameters"]["C"]["estimate"] == pytest.approx(160e-6, rel=0.05)
    assert last["within_accuracy"] < 0.01


def test_no_diagnosis_is_told_between(said: Said) -> None:
    """The record of it comes right behind a diagnosis of the same time, and then all is as before an alarm."""
    kinds = [record["record"] for record in said.records]
    at = kinds.index("accepted")
    assert kinds[at - 1 : at + 2] == ["diagnosis", "accepted", "detection"]
    assert said.records[at - 1]["time"] == said.records[at]["time"]
    assert said.records[at - 1]["within_accuracy"] == said.records[at]["probability"] > 0.9


def test_a_program_says_the_same(said: Said, recording: Path, programs: Callable[[str], Path]) -> None:
    """Record by record."""
    assert_same(watched(programs("rc"), recording.read_bytes()), said)


@pytest.mark.parametrize("cut", [900, 1500])
def test_a_run_that_is_cut_says_the_same(cut: int, said: Said, recording: Path, tmp_path: Path) -> None:
    """Before it is over, and after."""
    header, *rows = recording.read_bytes().splitlines(keepends=True)
    state = str(tmp_path / "run.state")
    parts = [ran(MODEL, b"".join([header, *part]), "--state", state) for part in (rows[:cut], rows[cut:])]
    told = [line for part in parts for line in part.of("detection", "accepted")]
    assert told == said.of("detection", "accepted")


def test_it_is_said(recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """On the terminal with the alarms, and by the verdict where no other alarm follows; the page has a mark."""
    page, short = tmp_path / "page.html", tmp_path / "short.csv"
    short.write_text("".join(recording.read_text().splitlines(keepends=True)[:2000]))
    assert main(["run", str(MODEL), str(short), "--report", str(page)]) == 1
    told = " ".join(capsys.readouterr().out.split())
    assert "Over by itself at 22.6 s: for long nothing was further off than healthy parts may be." in told
    assert "The alarm was over by itself: nothing was further off than healthy parts may be. No fault is" in told
    assert '"over"' in page.read_text()


def test_the_alarm_of_an_asset_returns_to_normal(recording: Path) -> None:
    """By itself, and unacknowledged, where nobody has seen it; the journal says why."""
    found = find_plant(MODEL, Wanted())
    asset = Asset("rc", found)
    block = joined_rows(list(read_blocks(str(recording), found.columns)))
    records = [*asset.take(block.part(slice(900))).records]
    assert asset.alarm.state(0.0) is AlarmState.UNACKNOWLEDGED
    records += asset.take(block.part(slice(900, 1500))).records
    assert asset.alarm.state(0.0) is AlarmState.RETURNED
    assert asset.detection is None
    assert asset.diagnosis is None
    ended, raised = events_of([item for item in records if item.kind in {"detection", "accepted"}])
    assert ended["text"] == "Alarm ended by itself: for long nothing was further off than healthy parts may be."
    assert (ended["alarm"], raised["alarm"]) == (False, True)
    asset.take(block.part(slice(1500, ROWS)))
    assert asset.alarm.active


@cache
def motor_core() -> Core:
    """A motor whose R is known to 20 %."""
    spec = spec_of("dc_motor_current")
    known = tuple(replace(item, accuracy=0.2) if item.name == "R" else item for item in spec.parameters)
    with in_full():
        return build_core(build_plant(graph_of("dc_motor_current")), replace(spec, parameters=known))


@cache
def motor_samples() -> tuple[Sample, ...]:
    """Of it, R rises by 8 % at 6 s, and J by half at 36 s."""
    time = np.asarray(0.02 * np.arange(2600), dtype=np.float64)
    u = random_steps(time, np.random.default_rng(6), low=2, high=12, shortest=0.4, longest=1.2)[:, None]
    faults = [Fault(parameter="R", factor=1.08, start=6.0), Fault(parameter="J", factor=1.5, start=36.0)]
    made = simulate(graph_of("dc_motor_current"), Inputs(time=time, values=u), faults, seed=2)
    return samples_of(time, made.inputs, made.outputs)


def watch(monitor: Monitor, begin: int, end: int) -> tuple[list[int], list[int]]:
    """Pass some samples; gives those at which there was an alarm, and at which one was over."""
    raised, over = list[int](), list[int]()
    for k, sample in enumerate(motor_samples()[begin:end], begin):
        report = monitor.step(sample)
        raised += [k] * (report.detection is not None)
        over += [k] * (report.diagnosis is not None and report.diagnosis.over)
    return raised, over


def test_what_changed_within_its_accuracy_is_the_new_normal() -> None:
    """R has risen by 8 of 20 %: it is learned, raises no other alarm, and the next fault has its true value."""
    monitor = Monitor(motor_core())
    (first,), (over,) = watch(monitor, 0, 1200)
    assert over - first >= OVER
    assert int(monitor.number("clock.over")) == over
    place = [item.name for item in monitor.spec.parameters].index("R")
    assert monitor.numbers("healthy.lane")[monitor.spec.parameter_slice][place] == pytest.approx(1.08, abs=0.02)
    assert watch(monitor, 1200, 1800) == ([], [])
    assert len(watch(monitor, 1800, 2600)[0]) == 1
    best = monitor.conclude().candidates[0]
    assert best.parameters == ("J",)
    assert best.probability > 0.99
    assert best.suspects[0].estimate == pytest.approx(2.25, abs=0.03)


@pytest.mark.parametrize(
    "known",
    [{"settled.hypothesis": 0}, {"settled.harmless_since": 800}, {"bank.sums": 1e3}],
    ids=lambda item: next(iter(item)),
)
def test_it_is_not_over(known: dict[str, float]) -> None:
    """Where something was sure before, which is for a person to decide; earlier; where nothing explains the data."""
    monitor = Monitor(motor_core())
    watch(monitor, 0, 1000)
    assert watch(monitor.copy(), 1000, 1100)[1] != []
    assert watch(changed(monitor, **known), 1000, 1100)[1] == []


def test_what_the_healthy_filter_summed_up_is_forgotten() -> None:
    """It was off, and what goes on is another: there is no alarm by what it was off."""
    monitor = Monitor(motor_core())
    watch(monitor, 0, 1000)
    off = changed(monitor, **{"sensors.cusum": 1e3})
    raised, over = watch(off, 1000, 1200)
    assert (raised, len(over)) == ([], 1)


@pytest.mark.parametrize("contradicted", [False, True])
def test_what_the_data_contradict_is_not_learned(contradicted: bool) -> None:
    """Then the healthy filter goes on where it stands."""
    _, spec, core = plant("rc")
    samples = [replace(one, y=one.y + 0.15 * (400 <= k < 460)) for k, one in enumerate(recorded("rc", 1200))]
    monitor, _ = run(core, samples[:1100])
    sums = monitor.numbers("bank.sums").reshape(2, len(spec.outputs), -1)
    if contradicted:
        sums[:, :, : monitor._steps] = 1e4
    monitor, moved = changed(monitor, **{"bank.sums": sums}), []
    for sample in samples[1100:]:
        before = monitor.numbers("healthy.lane")[spec.parameter_slice]
        report = monitor.step(sample)
        if report.diagnosis is not None and report.diagnosis.over:
            moved.append(np.abs(monitor.numbers("healthy.lane")[spec.parameter_slice] - before).max())
    assert [move < 1e-3 for move in moved] == [contradicted]


def test_it_is_not_over_while_a_slow_error_alarms() -> None:
    """It would be raised again at the next sample: with limits next to nothing the slow errors of a healthy tank do."""
    spec = spec_of("tank")
    tight = replace(spec, slow_errors=tuple(replace(item, limit=1e-9) for item in spec.slow_errors))
    monitor, reports = run(build_core(build_plant(graph_of("tank")), tight), recorded("tank", 2000))
    told = [report.diagnosis for report in reports if report.diagnosis is not None]
    assert 0 < monitor.number("clock.alarm") < 700
    assert min(item.within_accuracy for item in told[5:]) > 0.9
    assert not any(item.over for item in told)


def test_no_filter_of_the_next_alarm_begins_before_it() -> None:
    """What the healthy filter was until then is not what goes on."""
    monitor = Monitor(motor_core())
    _, (over,) = watch(monitor, 0, 1042)
    for sample in motor_samples()[1042:1300]:
        monitor.step(replace(sample, y=sample.y + np.array([0.0, 0.25])))
    assert monitor.number("clock.alarm") > 0
    begun = monitor.numbers("bank.onset")
    assert begun[begun > 0].min() >= over


def test_what_is_not_judged_does_not_count(recording: Path, tmp_path: Path) -> None:
    """Six seconds at which the model does not hold put it off by as much."""
    model, held = tmp_path / "model.yaml", tmp_path / "held.csv"
    model.write_text(MODEL.read_text() + "valid_when: V > 1\n")
    header, *rows = recording.read_text().splitlines()
    place = header.split(",").index("V")
    for k in range(700, 1000):
        cells = rows[k].split(",")
        cells[place] = "0"
        rows[k] = ",".join(cells)
    held.write_text("\n".join([header, *rows]) + "\n")
    (usual,), (later,) = (
        [item["time"] for item in ran(name, path.read_bytes()).records if item["record"] == "accepted"]
        for name, path in ((MODEL, recording), (model, held))
    )
    assert later - usual == pytest.approx(6.0, abs=1.0)


def test_of_a_model_that_is_known_to_alarm_it_is_over_too(recording: Path, tmp_path: Path) -> None:
    """Half of each diagnosis is left to one more false alarm; what is left says that nothing is at fault."""
    model = tmp_path / "model.yaml"
    model.write_text(MODEL.read_text() + "false_alarms: 1\n")
    told = ran(model, recording.read_bytes()).records
    last, over = next((one, two) for one, two in pairwise(told) if two["record"] == "accepted")
    assert last["mismatch"] == 0.5
    assert 0.45 < last["within_accuracy"] < 0.5
    assert over["time"] == last["time"]
