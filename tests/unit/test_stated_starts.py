"""Recordings that do not begin where the model states: told by `run`, `check --data` and `fit`, and else nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultbond.app.engine import build_watcher
from faultbond.app.rows import sample_of
from faultbond.app.stated_starts import contradictions
from faultbond.cli import main
from faultbond.contract.samples import Sample
from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.text import load_model
from made import EXAMPLES

MODEL = """
name: motor
sample_time: 0.02 s
accuracy: 3 %
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 3 ohm}}
  L: {type: I, parameters: {L: {nominal: 2.5 H, accuracy: 5 %}}, start: {p: 0 V*s, sd: 0.001 V*s}}
  second: {type: R, parameters: {G: 5 ohm}}
  coil: {type: I, parameters: {C: 2 H}}
junctions: {armature: 1, other: 1, both: 0}
bonds: [source -> both, both -> armature -> R, armature -> L, both -> other -> second, other -> coil]
sensors: {i: {reads: armature.f, unit: A, noise: 50 mA}, j: {reads: other.f, unit: A, noise: 50 mA}}
"""
SAID = "begins with i at 0.6"
STATED = "the stated `start` of L says 0"


def write(folder: Path, begins: float, *, wild: int = 0, rows: int = 600) -> list[str]:
    """Write the model, and a recording at 2 V: one current begins at a part of where it ends, some readings wild."""
    rng = np.random.default_rng(5)
    time = 0.02 * np.arange(rows)
    i = 2.0 / 3.0 * (1.0 - (1.0 - begins) * np.exp(-time * 3.0 / 2.5)) + 0.05 * rng.standard_normal(rows)
    j = 0.4 + 0.05 * rng.standard_normal(rows)
    i[:wild] = 9.0
    cells = [f"{t:.9g},2,{a:.9g},{b:.9g}" for t, a, b in zip(time, i, j, strict=True)]
    (folder / "recording.csv").write_text("\n".join(["time,V,i,j", *cells, ""]))
    (folder / "model.yaml").write_text(MODEL)
    return [str(folder / "model.yaml"), str(folder / "recording.csv")]


def samples_of(model: str, recording: str) -> list[Sample]:
    """The samples of a recording."""
    graph = load_model(model)
    return [sample_of(point) for point in on_grid(read_rows(recording, columns_of(graph)), Grid(graph.sample_time))]


@pytest.mark.parametrize("words", [("run",), ("check", "--data")])
def test_a_plant_in_motion_that_is_stated_to_be_at_rest_is_told(
    words: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With the reading, what the model says, and what to do; the other coil, whose start is open, begins anywhere."""
    model, recording = write(tmp_path, begins=1.0)
    main([words[0], model, *words[1:], recording])
    said = " ".join(capsys.readouterr().err.split())
    assert SAID in said
    assert STATED in said
    assert "leave out `start`" in said


def test_a_fit_tells_it_before_it_fits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """By the name of the recording."""
    model, recording = write(tmp_path, begins=1.0)
    main(["fit", model, recording, "--starts", "1"])
    assert f"{recording} {SAID}" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(("begins", "wild"), [(0.0, 0), (0.0, 2)])
def test_of_what_begins_as_stated_nothing_is_told(begins: float, wild: int, tmp_path: Path) -> None:
    """Nor where the first reading or two are wild: it is three that have to say so."""
    model, recording = write(tmp_path, begins, wild=wild)
    graph = load_model(model)
    samples = samples_of(model, recording)
    assert not contradictions(graph, build_watcher(graph), samples)
    assert contradictions(graph, build_watcher(graph), samples[60:])  # by then the current has come up


def test_before_an_input_has_a_value_nothing_is_known(tmp_path: Path) -> None:
    """Of a plant that waits nothing is expected yet."""
    model, recording = write(tmp_path, begins=1.0)
    graph = load_model(model)
    waiting = [replace(item, u=np.full(1, np.nan)) for item in samples_of(model, recording)]
    assert not contradictions(graph, build_watcher(graph), waiting)
    assert not contradictions(graph, build_watcher(graph), [])


def test_of_a_sensor_that_has_values_later_only_nothing_is_told(tmp_path: Path) -> None:
    """By then a plant that began as stated may be anywhere."""
    model, recording = write(tmp_path, begins=1.0)
    graph = load_model(model)
    late = [replace(item, y=item.y * [np.nan, 1.0]) for item in samples_of(model, recording)[:2]]
    samples = [*late, *samples_of(model, recording)[2:]]
    assert not contradictions(graph, build_watcher(graph), samples)


@pytest.mark.parametrize("name", ["tank", "dc_motor_current", "rlc"])
def test_examples_begin_as_their_models_state(name: str) -> None:
    """Healthy or not."""
    model = str(EXAMPLES / name / "model.yaml")
    graph = load_model(model)
    for recording in sorted((EXAMPLES / name).glob("*.csv")):
        assert not contradictions(graph, build_watcher(graph), samples_of(model, str(recording)))
