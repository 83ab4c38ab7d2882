"""A parameter that wanders: what the model file says of it, what filter, alarm, diagnosis and analysis make of it."""

import json
import re
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.trust.wandering import MODEL, STEP, WANDER, WANDERING, R, course, part, watched

from faultbond.analysis.false_alarm_trials import windows_of
from faultbond.analysis.operation import operate
from faultbond.analysis.smallest import SmallestFault, smallest_faults
from faultbond.app.realisations import compiled_detector
from faultbond.cli import DONE, main
from faultbond.contract.samples import Sample, Samples
from faultbond.errors import ModelError
from faultbond.fit.foothold import Added
from faultbond.fit.imperfections import Kind, possible, with_imperfections
from faultbond.io.recording import write_recording
from faultbond.model.dump import dump_model
from faultbond.model.graph import SlowError
from faultbond.model.text import parse_model
from faultbond.report.quiet_result import amended_text
from faultbond.runtime.core import Core
from faultbond.runtime.fleet import Fleet
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Effects, Inputs, simulate
from faultbond.synthesis.engine import build_engine, build_model

HOUR = 3600.0


@cache
def core(text: str) -> Core:
    """Give the core of a model."""
    return build_engine(parse_model(text))[1]


def test_it_is_read_and_written() -> None:
    """A wander is read beside the accuracy, and the canonical text has it again."""
    graph = parse_model(WANDERING)
    wander = graph.wanders[0]
    assert wander == SlowError(
        target="R", sd=0.05, relative=True, memory=HOUR, wanders=True, unit=wander.unit, line=wander.line
    )
    assert replace(parse_model(dump_model(graph)).wanders[0], line=0) == replace(wander, line=0)
    sized = parse_model(WANDERING.replace(WANDER, "wander: 1e5 Pa*s/m^3 over 90 min")).wanders[0]
    assert (sized.sd, sized.relative, sized.memory) == (1e5, False, 5400.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("wander: 5 %", r"parameter R.*wander: `5 %` is not a wander; write its .* and its memory"),
        ("wander: 5 % over 0 s", "R.*has no memory"),
        ("wander: 0 % over 1 h", "R.*its size must be above 0"),
        ("wander: 5 Pa over 1 h", "R.*is in .*, but .* is expected"),
        ("wander: 5 % over 1e13 s", "R.*longer than any plant runs"),
        ("wanders: 5 % over 1 h", "unknown key `wanders`; did you mean `wander`"),
    ],
)
def test_what_is_no_wander_is_refused(text: str, message: str) -> None:
    """Errors name the parameter and say what was expected."""
    with pytest.raises(ModelError, match=message):
        parse_model(WANDERING.replace(WANDER, text))


def test_a_part_of_nothing_is_refused() -> None:
    """A parameter whose nominal value is 0 wanders by a size of its own."""
    text = WANDERING.replace("nominal: 2e6 Pa*s/m^3, accuracy: 3 %", "nominal: 0 Pa*s/m^3, accuracy: 2, change: 3")
    with pytest.raises(ModelError, match=r"R.*a part of 0 is nothing; write a size, such as `2 Pa\*s/m\^3 over 6 h`"):
        parse_model(text.replace("accuracy: 2, change: 3", "accuracy: 2 Pa*s/m^3, change: 3 Pa*s/m^3"))


def test_where_nothing_moves_in_time_it_is_refused() -> None:
    """A static network has no time to wander in."""
    gain = "{law: y = K*u, parameters: {K: {nominal: 2, wander: 3 % over 1 h}}}"
    text = f"sample_time: none\ninputs: {{u: {{}}}}\nblocks: {{K: {gain}}}\nsensors: {{y: {{reads: y}}}}\n"
    with pytest.raises(ModelError, match=r"K.*`sample_time: none` .* nothing wanders"):
        parse_model(text)


def test_a_store_that_wanders_keeps_its_content() -> None:
    """As the capacity grows by a part the pressure falls by it: the filter's coordinate is the usual pressure."""
    text = MODEL.replace("accuracy: 2 %", "accuracy: 2 %, wander: 10 % over 1 h")
    model = build_model(parse_model(text))
    joint = np.array([1000.0, 0.1, 1.0, 1.0])
    shown = model.measure(joint, np.zeros(1), np.zeros(0))[0].full()[:, 0]
    assert shown == pytest.approx([1000.0 / 1.1, 1000.0 / 1.1 / R])


@pytest.mark.parametrize("seed", [11, 12, 13, 14])
def test_with_it_the_plant_is_quiet_and_without_it_is_not(seed: int) -> None:
    """Over 4000 samples, 11 memories long, the pipe that wanders by 5 % alarms only where nobody declared it."""
    samples = course(seed).samples
    assert watched(Monitor(core(MODEL)), samples)[0] is not None
    alarm, _, off = watched(Monitor(core(WANDERING)), samples)
    assert alarm is None
    seen = off[300:, 0]
    assert 0.5 < np.sqrt(np.mean(seen**2)) < 1.6  # as far as declared


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_a_step_beyond_it_is_found_and_named(seed: int) -> None:
    """A pipe that is 30 % narrower is found at once, it alone, by the value about which it wanders from then on."""
    plant = course(seed, 2400, factor=1.3, at=2000)
    alarm, found, _ = watched(Monitor(core(WANDERING)), plant.samples)
    assert alarm is not None
    assert 2000 <= alarm.sample < 2060
    assert found is not None
    first = found.candidates[0]
    assert [item.parameter for item in first.suspects] == ["R"]
    assert first.probability > 0.9
    (pipe,) = first.suspects
    assert abs(pipe.estimate - plant.usual) < 3.0 * pipe.sd
    assert pipe.estimate == pytest.approx(plant.usual, rel=0.12)
    assert 0.02 * R < pipe.sd < 0.08 * R  # known as well as a value about which it wanders can be


def test_a_gap_of_hours_lets_it_wander() -> None:
    """What was known of it is forgotten as its memory says: after one memory it may be 0.93 of its size off."""
    spec = core(WANDERING).spec
    monitor = Monitor(core(WANDERING))
    samples = course(31, 600).samples
    watched(monitor, samples)
    place = spec.slow_slice.start
    first = spec.n_joint + sum(spec.n_joint - k for k in range(place))
    known = monitor.numbers("healthy.lane")[first]
    for k in range(600, 960):
        nothing = Sample(time=k * STEP, dt=STEP, u=np.array([np.nan]), y=np.full(2, np.nan))
        monitor.step(nothing)
    grown = monitor.numbers("healthy.lane")[first]
    decay = np.exp(-2.0)
    assert known < 0.3 * 0.05**2
    assert grown == pytest.approx(decay * known + (1.0 - decay) * 0.05**2, rel=1e-6)


def test_saved_and_in_fleets_it_is_the_same() -> None:
    """A monitor that was saved goes on as it was, and an asset of a fleet is watched as a monitor watches it."""
    samples = course(41, 900).samples
    whole, halves = Monitor(core(WANDERING)), Monitor(core(WANDERING))
    whole.take(samples)
    halves.take(part(samples, 0, 500))
    halves = Monitor(core(WANDERING), halves.save())
    halves.take(part(samples, 500))
    fleet = Fleet(build_engine(parse_model(WANDERING), fleets=True)[1], 8)
    u, y = (np.repeat(values[None], 8, axis=0) for values in (samples.u, samples.y))
    assert not fleet.block(samples.time, u, y)
    expected = whole.numbers("healthy.lane")
    np.testing.assert_array_equal(halves.numbers("healthy.lane"), expected)
    assert abs(expected[core(WANDERING).spec.slow_slice][0]) > 0.005
    np.testing.assert_allclose(fleet.copy(5).numbers("healthy.lane"), expected, rtol=1e-6, atol=1e-9)


def test_a_promise_has_a_limit_for_it() -> None:
    """With a promised time between false alarms the limit follows from size and memory, else it is 5 sizes."""
    promised = build_engine(parse_model(f"time_between_false_alarms: 30 days\n{WANDERING}"))[1].spec
    assert core(WANDERING).spec.slow_limits.tolist() == [5.0]
    assert 3.5 < promised.slow_limits[0] < 4.5


@cache
def analysed(text: str) -> dict[str, SmallestFault]:
    """Give the smallest faults that are found."""
    model, engine = build_model(parse_model(text)), core(text)
    samples = course(51, 900, size=0.0).samples
    rows = [
        Sample(time=t, dt=dt, u=u, y=y)
        for t, dt, u, y in zip(samples.time, samples.dt, samples.u, samples.y, strict=True)
    ]
    return {
        item.parameter: item
        for item in smallest_faults(
            model, engine.spec, engine, compiled_detector(engine.spec.thresholds), samples=rows, seconds=None
        )
    }


def test_smallest_faults_are_beyond_it() -> None:
    """The pipe's smallest fault is several sizes of its wander, that of the tank much as before."""
    still, moving = analysed(MODEL), analysed(WANDERING)
    assert moving["R"].value is not None
    assert still["R"].value is not None
    assert still["R"].value < 0.1 * R
    assert 0.15 * R < moving["R"].value < 0.5 * R


def test_simulated_it_is_as_large_and_long_as_declared() -> None:
    """Asked for, it wanders; the noise stays what it was, and by itself nothing wanders."""
    graph = parse_model(WANDERING)
    time = np.arange(0.0, 60.0 * HOUR, 60.0)
    inputs = Inputs(time=time, values=np.full((time.size, 1), 8e-3))
    usual = simulate(graph, inputs, seed=3)
    moving = simulate(graph, inputs, seed=3, effects=Effects(wander=True))
    np.testing.assert_array_equal(usual.parameters[:, 1], R)
    np.testing.assert_array_equal(moving.inputs, usual.inputs)
    path = moving.parameters[:, 1] / R - 1.0
    assert np.std(path) == pytest.approx(0.05, rel=0.3)
    assert np.corrcoef(path[:-60], path[60:])[0, 1] == pytest.approx(np.exp(-1.0), abs=0.25)
    shown = moving.outputs[100:, 0] / moving.outputs[100:, 1]
    assert np.corrcoef(shown, moving.parameters[100:, 1])[0, 1] > 0.95


def test_simulated_by_the_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`simulate --wander` is refused where nothing wanders, and else changes the recording."""
    recording = tmp_path / "inputs.csv"
    recording.write_text("time,inflow\n" + "".join(f"{10 * k},8\n" for k in range(100)))
    for name, text in (("still", MODEL), ("moving", WANDERING)):
        (tmp_path / f"{name}.yaml").write_text(text)
    outputs = []
    for words in ([], ["--wander"]):
        output = tmp_path / "made.csv"
        command = ["simulate", str(tmp_path / "moving.yaml"), "--inputs", str(recording), "--seed", "1", *words]
        assert main([*command, "-o", str(output)]) == DONE
        outputs.append(np.loadtxt(output, delimiter=",", skiprows=1))
    assert np.all(outputs[0][:, :2] == outputs[1][:, :2])
    assert np.max(np.abs(outputs[0][:, 2] - outputs[1][:, 2])) > 100.0
    capsys.readouterr()
    command = ["simulate", str(tmp_path / "still.yaml"), "--inputs", str(recording), "--wander"]
    assert main([*command, "-o", str(tmp_path / "none.csv")]) != DONE
    assert "still.yaml: nothing wanders in it" in capsys.readouterr().err


def fitted(folder: Path, recordings: dict[str, Samples], text: str, *words: str) -> dict[str, dict[str, Any]]:
    """Fit a model to recordings by the command; give its records by kind."""
    (folder / "model.yaml").write_text(text)
    for name, item in recordings.items():
        columns = {
            "time": item.time,
            "inflow": item.u[:, 0] * 1e3,
            "pressure": item.y[:, 0],
            "flow": item.y[:, 1] * 1e3,
        }
        write_recording(folder / name, columns)
    names = [str(folder / name) for name in recordings]
    output = ["-o", str(folder / "new.yaml"), "--json", str(folder / "found.jsonl")]
    assert main(["fit", str(folder / "model.yaml"), *names, *words, *output]) == DONE
    found = map(json.loads, (folder / "found.jsonl").read_text().splitlines())
    return {item["record"]: item for item in found}


def test_fit_proposes_a_wander_within_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A pipe that wanders by 5 % over an hour, in 8 hours: about that, and the text says how to declare it."""
    plant = course(73, 3000, plant=7)
    spread = float(np.std(plant.resistance) / plant.usual)
    (wander,) = fitted(tmp_path, {"a.csv": plant.samples}, MODEL)["fit"]["wanders"]
    assert wander["parameter"] == "R"
    assert wander["size"] == pytest.approx(spread, rel=0.25)
    assert wander["memory"] == pytest.approx(36.0 * 60.0, rel=0.4)  # 36 min is the likeliest for this very path
    said = " ".join(capsys.readouterr().out.split())
    assert re.search(r"wanders R, as it seems: .* declare `wander: \d(\.\d)? % over \d+(\.\d)? (min|h)`", said)


def test_fit_proposes_a_wander_between_recordings(tmp_path: Path) -> None:
    """A pipe that is another one each day, by 5 %, and hardly moves within 50 minutes, has a memory of many hours."""
    days = {f"day{k}.csv": course(80 + k, 300, memory=200.0 * HOUR, plant=7) for k in range(6)}
    spread = float(np.std([np.mean(item.resistance) / item.usual for item in days.values()]))
    found = fitted(tmp_path, {name: item.samples for name, item in days.items()}, MODEL)["fit"]["wanders"]
    (wander,) = found
    assert wander["parameter"] == "R"
    assert 0.4 * spread < wander["size"] < 1.6 * spread
    assert wander["memory"] > 10.0 * HOUR


def test_fit_proposes_none_where_none_is(tmp_path: Path) -> None:
    """Of days with the same pipe nothing is said, nor where its wander is declared already."""
    days = {f"day{k}.csv": course(90 + k, 300, size=0.0, plant=7).samples for k in range(3)}
    assert fitted(tmp_path, days, MODEL)["fit"]["wanders"] == []
    assert fitted(tmp_path, {"a.csv": course(71, 1500).samples}, WANDERING)["fit"]["wanders"] == []


def test_until_quiet_has_it_among_what_may_be_missing() -> None:
    """Stores may wander; of the pipe the error of its signal says the same. What was added is written and read back."""
    graph = parse_model(MODEL)
    wanders = [item for item in possible(graph, ("pipe.f",)) if item.kind is Kind.WANDER]
    assert [item.place for item in wanders] == ["C"]
    found = replace(wanders[0], size=0.042, memory=1800.0)
    added = with_imperfections(graph, (found,))
    written = parse_model(amended_text(MODEL, graph, [Added(what=found, trained=9.0, held=9.0)]))
    assert [(item.target, item.sd, item.memory) for item in written.wanders] == [("C", 0.042, 1800.0)]
    assert replace(added.wanders[0], line=0) == replace(written.wanders[0], line=0)
    again = with_imperfections(written, (replace(found, size=0.1),))
    assert [item.sd for item in again.slow_errors] == [0.1]


def test_trials_of_the_analysis_let_it_wander() -> None:
    """In what noise alone does to the detector the estimates wander as far as those of the monitor do."""
    model, engine = build_model(parse_model(WANDERING)), core(WANDERING)
    samples = course(61, 1200).samples
    rows = [
        Sample(time=t, dt=dt, u=u, y=y)
        for t, dt, u, y in zip(samples.time, samples.dt, samples.u, samples.y, strict=True)
    ]
    operation = operate(model, engine.spec, engine, rows)
    seen = windows_of(engine.spec, operation, [500], 600)
    assert np.std(seen.slow) == pytest.approx(0.95, abs=0.15)
    assert np.std(seen.noise) == pytest.approx(1.0, abs=0.05)
