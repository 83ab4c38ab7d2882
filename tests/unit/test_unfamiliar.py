"""An alarm under an operation that was in no recording of the fit: the verdict says so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultbond.app.unfamiliar import BEFORE, READ, Unfamiliar, unfamiliar_sentence, unfamiliar_signals
from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.contract.findings import Detection
from faultbond.contract.samples import Sample
from faultbond.errors import ModelError
from faultbond.io.grid import PointBlock
from faultbond.model.amend import amended
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.report.fit_result import with_seen_ranges
from made import EXAMPLES

TEXT = (EXAMPLES / "tank" / "model.yaml").read_text(encoding="utf-8")
ALARM = Detection(time=500.0, sample=500, change_time=480.0, signals=("flow",))


def fitted(ends: str = "[20 percent, 60 percent]") -> BondGraph:
    """The tank, whose inlet valve was open by so much in the recordings of a fit."""
    return parse_model(amended(TEXT, [(("inputs", "u_in", "fitted_range"), ends)]))


def course(u_in: FloatArray, y: FloatArray | None = None) -> list[PointBlock]:
    """Points of 1 s with these openings of the inlet valve, and perhaps readings, in two blocks."""
    n = len(u_in)
    whole = PointBlock(
        index=np.arange(n),
        time=np.arange(n, dtype=np.float64),
        dt=np.ones(n),
        u=np.stack([u_in, np.full(n, 99.0)], axis=1),
        y=np.zeros((n, 2)) if y is None else y,
        resumes=np.zeros(n, dtype=bool),
    )
    names = ("index", "time", "dt", "u", "y", "resumes")
    return [PointBlock(**{name: getattr(whole, name)[part] for name in names}) for part in (slice(450), slice(450, n))]


@pytest.mark.parametrize(
    ("first", "last", "value", "told"),
    [
        (490, 495, 70.0, True),  # between onset and alarm
        (501 - BEFORE, 402, 70.0, True),
        (300, 500 - BEFORE, 70.0, False),  # long before
        (501, 600, 70.0, False),  # after the alarm
        (490, 495, 61.9, False),  # within a twentieth of the range beside it
        (490, 495, 62.9, True),
        (490, 495, 10.0, True),
        (490, 495, np.nan, False),
    ],
)
def test_what_was_never_seen_up_to_the_alarm_is_told(first: int, last: int, value: float, told: bool) -> None:
    """An input beyond where it was in the recordings of the fit, from the onset or shortly before the alarm on."""
    u_in = np.full(600, 40.0)
    u_in[first : last + 1] = value
    found = unfamiliar_signals(fitted(), course(u_in), ALARM)
    assert [(item.signal.name, item.value) for item in found] == ([("u_in", value)] if told else [])


@pytest.mark.parametrize(
    ("first", "last", "value", "told"),
    [
        (480 - BEFORE, 479, 9.0, True),
        (380, 431, 9.0, True),  # most of the readings before the onset
        (380, 420, 9.0, False),
        (480, 500, 9.0, False),  # what the fault may have moved
        (480 - BEFORE, 479, 7.82, False),  # within a twentieth of the range beside it
        (480 - BEFORE, 479, 6.0, True),
    ],
)
def test_a_sensor_counts_as_it_read_before_anything_changed(first: int, last: int, value: float, told: bool) -> None:
    """A set point that no input has: of a tank fitted at 7 to 7.8 kPa, that alarmed at 9 kPa."""
    graph = parse_model(amended(TEXT, [(("sensors", "pressure", "fitted_range"), "[7 kPa, 7.8 kPa]")]))
    place = [item.name for item in graph.sensors].index("pressure")
    y = np.full((600, 2), np.nan)
    y[:, place] = 7500.0
    y[first : last + 1, place] = 1000.0 * value
    found = unfamiliar_signals(graph, course(np.full(600, 40.0), y), ALARM)
    assert [(item.signal.name, item.value) for item in found] == ([("pressure", 1000.0 * value)] if told else [])
    y[: 480 - READ + 1, place] = np.nan  # too few readings
    assert unfamiliar_signals(graph, course(np.full(600, 40.0), y), ALARM) == ()
    assert unfamiliar_signals(graph, course(np.full(600, 40.0), y), replace(ALARM, change_time=0.0)) == ()


def test_the_zero_of_a_unit_is_that_of_its_range() -> None:
    """24 degC are far beyond 9.5 to 20.2 degC, however little that is of 293 K."""
    graph = parse_model(
        "name: wall\nsample_time: 1 s\ninputs: {t: {unit: degC, fitted_range: [9.5 degC, 20.2 degC]}}\n"
        "components: {s: {type: Se, law: e = t}, r: {type: R, law: e = R*f, parameters: {R: 1 K/W}}}\n"
        "junctions: {j: 1}\nbonds: [s -> j -> r]\nsensors: {q: {reads: j.f, unit: W, noise: 1 W}}\n"
    )
    for celsius, told in ((20.6, False), (21.0, True), (24.0, True), (8.0, True)):
        points = [
            PointBlock(
                index=np.arange(600),
                time=np.arange(600.0),
                dt=np.ones(600),
                u=np.full((600, 1), celsius + 273.15),
                y=np.zeros((600, 1)),
                resumes=np.zeros(600, dtype=bool),
            )
        ]
        assert bool(unfamiliar_signals(graph, points, ALARM)) is told, celsius


def test_an_onset_long_before_the_alarm_counts_from_there() -> None:
    """A slow fault may come from an operation of hours ago."""
    u_in = np.full(600, 40.0)
    u_in[250] = 90.0
    early = Detection(time=500.0, sample=500, change_time=200.0, signals=("flow",))
    assert [item.value for item in unfamiliar_signals(fitted(), course(u_in), early)] == [90.0]
    assert unfamiliar_signals(fitted(), course(u_in), ALARM) == ()


def test_where_nothing_is_known_nothing_is_told() -> None:
    """Of a model that was not fitted, and of inputs that were where they are."""
    assert unfamiliar_signals(parse_model(TEXT), course(np.full(600, 90.0)), ALARM) == ()
    assert unfamiliar_signals(fitted("[90 percent, 90 percent]"), course(np.full(600, 91.0)), ALARM) == ()
    assert unfamiliar_sentence(()) == ""


def test_it_is_said_after_the_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Text, page and standard error; a paragraph of its own."""
    model, page = tmp_path / "model.yaml", tmp_path / "page.html"
    model.write_text(fitted("[0 percent, 12 percent]").text, encoding="utf-8")
    rows = (EXAMPLES / "tank" / "fault_pipe.csv").read_text().splitlines()[:1950]
    recording = tmp_path / "fault_pipe.csv"
    recording.write_text("\n".join([*rows, ""]))
    assert main(["run", str(model), str(recording), "--report", str(page)]) == 1
    said = capsys.readouterr()
    told = "(0 to 12 percent in the recordings of the fit): there the model was never compared with the plant"
    assert told in said.err
    for text in (said.out, page.read_text(encoding="utf-8").replace("\u00a0", " ")):
        verdict, behind = " ".join(text.split()).split(told)
        assert verdict.rindex("Most likely the pipe changed") < verdict.rindex("Up to the alarm u_in was")
        assert "Most likely" not in behind.split("</p>")[0]
    assert "\n\nUp to the alarm u_in was" in said.out
    assert '<p class="caveat">Up to the alarm u_in was' in page.read_text(encoding="utf-8").replace("\u00a0", " ")


def test_it_is_read_and_written() -> None:
    """In the unit of the input; what is no range of two values in order is refused."""
    graph = fitted("[0.2, 60 percent]")
    assert graph.input("u_in").fitted_range == (0.2, 60.0)
    assert parse_model(graph.text).input("u_in").fitted_range == (0.2, 60.0)
    for wrong in ("[60 percent, 20 percent]", "[0 percent, inf]"):
        with pytest.raises(ModelError, match="two values in order are expected"):
            fitted(wrong)
    found = Unfamiliar(signal=graph.input("u_in"), value=71.0)
    told = unfamiliar_sentence([found])
    assert told.startswith("Up to the alarm u_in was 71 percent (0.2 to 60 percent in the recordings of the fit): ")
    assert told.endswith("Fit it to healthy recordings of such operation too.")
    graph = parse_model(amended(graph.text, [(("sensors", "pressure", "fitted_range"), "[7 kPa, 7.8 kPa]")]))
    assert parse_model(graph.text).sensors == graph.sensors
    (sensor,) = (item for item in graph.sensors if item.name == "pressure")
    assert sensor.fitted_range == (7000.0, 7800.0)
    told = unfamiliar_sentence([found, Unfamiliar(signal=sensor, value=9000.0)])
    both = "recordings of the fit) and before anything changed pressure read 9000 Pa (7000 to 7800 Pa in the "
    assert both in told
    assert told.endswith("If the plant was healthy then, fit the model to such recordings too.")


def test_what_is_beyond_the_range_of_an_input_was_nowhere() -> None:
    """A logger writes -999 where it has nothing; what an input or sensor cannot be is not where it was."""
    ends = {("inputs", "u_in", "range"): "[0 percent, 100 percent]", ("sensors", "pressure", "range"): "[0 Pa, 30 kPa]"}
    text = amended(TEXT, [*ends.items()])
    graph = parse_model(text)
    rows = [(30.04, 0.0), (-999.0, 0.0), (np.nan, 0.0), (72.0, 0.0)]
    levels = [7010.0, np.nan, 7790.0, -2e9]
    read = [
        [
            Sample(time=float(k), dt=1.0, u=np.array(u), y=np.array([np.nan, level]))
            for k, (u, level) in enumerate(zip(rows, levels, strict=True))
        ]
    ]
    seen = parse_model(with_seen_ranges(text, graph, read))
    assert seen.input("u_in").fitted_range == pytest.approx((30.0, 72.0))
    assert seen.input(graph.inputs[1].name).fitted_range == (0.0, 0.0)
    assert [item.name for item in graph.sensors] == ["flow", "pressure"]
    assert seen.sensors[0].fitted_range is None
    assert seen.sensors[1].fitted_range == pytest.approx((7010.0, 7790.0))
    assert parse_model(with_seen_ranges(text, graph, [read[0][1:3]])).input("u_in").fitted_range is None
