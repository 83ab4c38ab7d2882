"""FMUs: valid by the standard, and what they say is what `run` says."""

import io
import json
import math
import re
import shutil
import subprocess
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import numpy as np
import pytest

from faultbond.cli import main
from faultbond.errors import ModelError
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.fmu import FmuParts, fmu_archive, fmu_files, fmu_parts, fmu_sources, fmu_title
from faultbond.synthesis.fmu_description import model_description
from faultbond.synthesis.fmu_variables import fmu_variables
from fmu_bench import Bench, Bird
from made import EXAMPLES, graph_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="there is no C compiler")
WARNINGS = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-Wno-psabi")
FAULTS = {"tank": ("fault_pipe.csv", 1600), "dc_motor": ("fault_winding.csv", 1300)}  # and how many rows of it
BOTH = pytest.mark.parametrize("fmi", [2, 3])


@cache
def parts_of(name: str) -> FmuParts:
    """What the FMU of a built-in plant is made of."""
    return fmu_parts(graph_of(name))


@cache
def archive_of(name: str, fmi: int) -> bytes:
    """The FMU of a built-in plant."""
    return fmu_archive(fmu_files(fmi, parts_of(name)))


def told_names(graph: BondGraph) -> list[str]:
    """The names of what an FMU is told: inputs, then sensors."""
    return [*(item.name for item in graph.inputs), *(item.name for item in graph.sensors)]


@cache
def rows_of(name: str) -> tuple[tuple[float, dict[str, float]], ...]:
    """The first rows of a faulty recording: time, and what an FMU is told then."""
    graph, (file, count) = graph_of(name), FAULTS[name]
    names = told_names(graph)
    rows = [row for row, _ in zip(read_rows(EXAMPLES / name / file, columns_of(graph)), range(count), strict=False)]
    return tuple((row.time, dict(zip(names, (*row.u, *row.y), strict=True))) for row in rows)


def bench_of(name: str, fmi: int, folder: Path) -> Bench:
    """The FMU of a built-in plant, unpacked in a folder."""
    path = folder / f"{name}{fmi}.fmu"
    path.write_bytes(archive_of(name, fmi))
    return Bench(path, folder / f"{name}{fmi}")


def records_of(
    name: str, folder: Path, columns: Sequence[str], rows: Sequence[Sequence[object]]
) -> list[dict[str, Any]]:
    """What `run` says of a recording with these columns and rows."""
    path, found = folder / "recording.csv", folder / "records.jsonl"
    path.write_text("\n".join(",".join(map(str, row)) for row in [columns, *rows]) + "\n")
    assert main(["run", str(EXAMPLES / name / "model.yaml"), str(path), "--json", str(found)]) in (0, 1)
    return [json.loads(line) for line in found.read_text().splitlines()]


def recording_of(name: str) -> tuple[list[str], list[list[str]]]:
    """The columns of the faulty recording of a plant, and its first rows."""
    file, count = FAULTS[name]
    header, *lines = (EXAMPLES / name / file).read_text().splitlines()[: count + 1]
    return header.split(","), [line.split(",") for line in lines]


def says(bird: Bird, diagnosis: dict[str, Any], graph: BondGraph) -> None:
    """Check that the outputs of an instance are those of a diagnosis."""
    found, best = bird.all(), diagnosis["candidates"][0]
    assert found["diagnosis_time"] == diagnosis["time"]
    suspects = sorted(name.partition(".")[0] for name in best["parameters"])
    assert sorted(name.split()[-1] for name in found["best_name"].split(", ")) == suspects
    words = {item.value: item.name for item in bird.bench.about.typeDefinitions[1].items}
    assert words[str(found["best"])] == found["best_name"]
    assert found["group"] == sum(item["group"] for item in diagnosis["candidates"])
    told = [best["probability"], diagnosis["within_accuracy"], diagnosis["mismatch"]]
    assert [found[name] for name in ("probability", "within_accuracy", "mismatch")] == pytest.approx(told, abs=1e-9)
    for item in graph.parameters:
        value = best["parameters"].get(item.name, {"estimate": item.nominal, "sd": item.accuracy})
        assert found[f"{item.name}.estimate"] == pytest.approx(value["estimate"], rel=1e-9)
        assert found[f"{item.name}.sd"] == pytest.approx(value["sd"], rel=1e-9)
    sizes = {name.partition(".")[0]: value for name, value in best["parameters"].items() if "." in name}
    for name in told_names(graph):
        value = sizes.get(name, {"estimate": 0.0, "sd": 0.0})
        size = [found[f"{name}.size"], found[f"{name}.size_sd"]]
        assert size == pytest.approx([value["estimate"], value["sd"]], rel=1e-9)


@BOTH
@pytest.mark.parametrize("name", FAULTS)
def test_it_says_what_run_says(name: str, fmi: int, tmp_path: Path) -> None:
    """Alarm and each diagnosis, the last one at the end too, are those of `run`, at the same samples."""
    records = records_of(name, tmp_path, *recording_of(name))
    bench = bench_of(name, fmi, tmp_path)
    alarm = next(item for item in records if item["record"] == "detection")
    diagnoses = {round(item["time"] / bench.step): item for item in records if item["record"] == "diagnosis"}
    bird = bench.instance()
    for k, (_, told) in enumerate(rows_of(name)):
        assert bird.ask("alarm") == [k > alarm["sample"]]
        bird.tell(told)
        bird.go()
        if k in diagnoses and k + 1 < len(rows_of(name)):
            says(bird, diagnoses[k], graph_of(name))
    assert bird.ask("alarm", "alarm_time", "change_time") == [True, alarm["time"], alarm["change_time"]]
    assert bird.ask("samples") == [len(rows_of(name))]
    bird.made.terminate()
    assert len(diagnoses) > 3
    says(bird, diagnoses[max(diagnoses)], graph_of(name))
    assert bench.messages == []


@BOTH
def test_it_is_valid(fmi: int, tmp_path: Path) -> None:
    """FMPy finds nothing wrong, and simulates it as its users do."""
    bench = bench_of("tank", fmi, tmp_path)
    path = str(tmp_path / f"tank{fmi}.fmu")
    assert bench.fmpy.validation.validate_fmu(path) == []
    rows = rows_of("tank")[:50]
    inputs = np.array(
        [(time, *told.values()) for time, told in rows], [(name, float) for name in ("time", *rows[0][1])]
    )
    result = bench.fmpy.simulate_fmu(path, stop_time=50.0, output_interval=1.0, input=inputs)
    assert result["samples"].tolist() == list(range(51))
    assert result["status"][[0, 1, -1]].tolist() == [0, 1, 2]  # waiting, starting, warming


def course(bird: Bird, rows: Sequence[tuple[float, dict[str, float]]]) -> Iterator[dict[str, Any]]:
    """Give the outputs after each row."""
    for _, told in rows:
        bird.tell(told)
        bird.go()
        yield bird.all()


@BOTH
def test_instances_and_states(fmi: int, tmp_path: Path) -> None:
    """Instances do not know of each other; from a state, or its bytes, all goes on the same, and so after a reset."""
    bench, rows = bench_of("dc_motor", fmi, tmp_path), rows_of("dc_motor")
    alarm = next(k for k, found in enumerate(course(bench.instance(), rows)) if found["alarm"])
    middle, last = alarm + 30, alarm + 110  # while the filters of the hypotheses begin
    one, other = bench.instance(), bench.instance()
    for k in range(middle):
        one.tell(rows[k][1])
        one.go()
        if k < alarm - 20:
            other.tell(rows[k][1])
            other.go()
    state = one.made.getFMUState()
    serialize = one.made.serializeFMUState if fmi == 3 else one.made.serializeFMUstate
    saved = serialize(state)
    after = list(course(one, rows[middle:last]))
    assert after[-1]["best"] >= 0
    assert other.ask("alarm", "samples") == [False, alarm - 20]

    for bird, kept in ((one, state), (other, _read(other, saved))):
        bird.made.setFMUState(kept)
        bird.time = middle * bench.step
        assert list(course(bird, rows[middle:last])) == after
        bird.made.freeFMUState(kept)
    one.made.reset()
    one.begin(0.0)
    assert [found["alarm"] for found in course(one, rows[: alarm + 1])] == [False] * alarm + [True]


def _read(bird: Bird, saved: bytes) -> Any:
    return (bird.made.deserializeFMUState if bird.bench.fmi == 3 else bird.made.deSerializeFMUstate)(saved)


@BOTH
def test_damaged_states_are_refused(fmi: int, tmp_path: Path) -> None:
    """A state that is cut short, changed anywhere, or of another FMU is refused in words, and nothing changes."""
    bench = bench_of("dc_motor", fmi, tmp_path)
    bird = bench.instance()
    list(course(bird, rows_of("dc_motor")[:10]))
    state, before = bird.made.getFMUState(), bird.all()
    saved = (bird.made.serializeFMUState if fmi == 3 else bird.made.serializeFMUstate)(state)
    middle, end = len(saved) // 2, len(saved) - 60
    spoiled = [saved[:-1], saved[:20], b""]
    spoiled += [saved[:k] + bytes([saved[k] ^ 1]) + saved[k + 1 :] for k in (3, 30, middle, end, len(saved) - 8)]
    for wrong in spoiled:
        with pytest.raises(bench.fmpy.fmi1.FMICallException):
            _read(bird, wrong)
        assert bench.messages.pop() == "this is no state of this FMU, or it is damaged"
    assert bird.all() == before
    assert bench.messages == []


def test_nan_is_a_missing_value(tmp_path: Path) -> None:
    """A reading that is NaN is one that a recording does not have, and so are those between long steps."""
    columns, rows = recording_of("dc_motor")
    place = columns.index("omega")
    for k in (50, 51, 1200):
        rows[k][place] = ""
    bench = bench_of("dc_motor", 3, tmp_path)
    rows_told = [
        told | ({} if rows[k][place] else {"omega": math.nan}) for k, (_, told) in enumerate(rows_of("dc_motor"))
    ]
    bird = bench.instance()
    for told in rows_told:
        bird.tell(told)
        bird.go()
    bird.made.terminate()
    says(bird, records_of("dc_motor", tmp_path, columns, rows)[-2], graph_of("dc_motor"))

    slow = bench.instance()
    for k in range(0, len(rows), 4):
        slow.tell(rows_told[k])
        slow.go(4)
        for row in rows[k + 1 : k + 4]:
            row[1:] = [rows[k][j] if j != place else "" for j in range(1, len(row))]
    slow.made.terminate()
    says(slow, records_of("dc_motor", tmp_path, columns, rows)[-2], graph_of("dc_motor"))


def test_faults_of_sensors(tmp_path: Path) -> None:
    """A sensor that is off is named, with the size and kind of its fault, as `run` has them."""
    columns, rows = recording_of("dc_motor")
    place, first = columns.index("omega"), 600
    bench = bench_of("dc_motor", 2, tmp_path)
    bird = bench.instance()
    for k, (_, told) in enumerate(rows_of("dc_motor")[:1000]):
        bird.tell(told | {"omega": told["omega"] + 0.8 * (k >= first)})
        bird.go()
        rows[k][place] = repr(float(told["omega"] + 0.8 * (k >= first)))
    bird.made.terminate()
    diagnosis = records_of("dc_motor", tmp_path, columns, rows[:1000])[-2]
    says(bird, diagnosis, graph_of("dc_motor"))
    kinds = {int(item.value): item.name for item in bench.about.typeDefinitions[2].items}
    assert kinds[bird.ask("kind")[0]] == diagnosis["candidates"][0]["kind"] == "bias"
    assert bird.ask("best_name") == ["sensor omega"]
    assert bird.ask("omega.size") == [pytest.approx(0.8, abs=0.1)]


@BOTH
def test_what_it_refuses(fmi: int, tmp_path: Path) -> None:
    """Steps that are no multiple of the sample time, or follow no other, and calls out of turn are refused in words."""
    bench = bench_of("dc_motor", fmi, tmp_path)
    bird, refused = bench.instance(begun=False), pytest.raises(bench.fmpy.fmi1.FMICallException)
    with refused:
        bird.go()
    bird.begin(5.0)
    for steps in (0.5, 0.0, -1.0, 1.3, math.nan, math.inf):
        with refused:
            bird.made.doStep(5.0, steps * bench.step)
    for time in (4.0, 5.0 + bench.step, math.nan):
        with refused:
            bird.made.doStep(time, bench.step)
    with refused:
        bird.tell({"alarm_time": 1.0})
    assert bench.messages == [
        "only an instance that was initialized can make a step",
        *(
            f"a communication step of {steps * 0.02:.15g} s; take a multiple of the model's sample_time, 0.02 s"
            for steps in (0.5, 0.0, -1.0, 1.3, math.nan, math.inf)
        ),
        *(
            f"the step begins at {time:.15g} s, but the one before ended at 5 s; steps follow each other"
            for time in (4.0, 5.02, math.nan)
        ),
        "there is no variable of this type and value reference that can be read or set so",
    ]
    bird.go(3)
    assert bird.ask("samples") == [3]
    bench.messages.clear()
    bench.about.guid = "another"
    with pytest.raises(Exception, match="Failed to instantiate"):
        bench.instance()
    assert bench.messages == [
        f"the {'guid' if fmi == 2 else 'instantiation token'} is that of another FMU; unpack it anew"
    ]


@BOTH
def test_sources(fmi: int, tmp_path: Path) -> None:
    """The sources compile without a warning, and their functions are those of the standard's own headers."""
    for name, text in fmu_sources(fmi, parts_of("dc_motor")).items():
        (tmp_path / name).write_text(text)
    compiler = shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("there is neither gcc nor clang")
    check = (compiler, "-std=c99", "-fsyntax-only", *WARNINGS)
    for name in ("watcher.c", f"fmi{fmi}.c"):
        done = subprocess.run([*check, name], cwd=tmp_path, capture_output=True, text=True, check=False)
        assert (done.returncode, done.stderr) == (0, "")
    headers = Path(pytest.importorskip("fmpy").__file__).parent / "c-code"
    theirs = (f'-DFMI_HEADER="fmi{fmi}Functions.h"', f"-I{headers}", f"fmi{fmi}.c")
    done = subprocess.run([*check, *theirs], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


@BOTH
def test_same_bytes(fmi: int) -> None:
    """The same model gives the same archive, without a date; its token tells of the model, not of the standard."""
    files = fmu_files(fmi, fmu_parts(graph_of("dc_motor")))
    assert fmu_archive(dict(reversed(files.items()))) == archive_of("dc_motor", fmi)
    with ZipFile(io.BytesIO(archive_of("dc_motor", fmi))) as archive:
        assert {item.date_time[0] for item in archive.infolist()} == {1980}
        assert archive.namelist() == sorted(files)
    (library,) = (name for name in files if name.startswith("binaries/"))
    assert library.split("/")[-1].startswith("DC_motor.")
    tokens = [fmu_sources(k, parts_of("dc_motor"))["variables.h"].split('"')[1] for k in (2, 3)]
    assert tokens[0] == tokens[1] != fmu_sources(2, parts_of("tank"))["variables.h"].split('"')[1]


def changed(name: str, old: str, new: str) -> BondGraph:
    """A built-in plant whose text was changed."""
    text = (EXAMPLES / name / "model.yaml").read_text()
    assert old in text
    return parse_model(text.replace(old, new), file="model.yaml")


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "sample_time: 1 s",
            "sample_time: variable",
            r"model\.yaml: sample_time is variable.*Give the model a sample_time",
        ),
        ("sample_time: 1 s", "sample_time: 1 s\nrow_time: 0.1 s", r"model\.yaml: samples are means of rows"),
    ],
)
def test_models_that_do_not_fit(old: str, new: str, words: str) -> None:
    """A model without a fixed time between samples, or whose samples are means, is refused in one line."""
    with pytest.raises(ModelError, match=words):
        fmu_parts(changed("tank", old, new))


def test_networks_do_not_fit() -> None:
    """A network without time is refused, and it is told what there is for it."""
    with pytest.raises(ModelError, match=r"fig_6_1\.yaml: .* has no time .*; `run` diagnoses its observations\.$"):
        fmu_parts(load_model(EXAMPLES / "thesis" / "fig_6_1.yaml"))


def test_names_of_the_user() -> None:
    """An input or a sensor that is called like another variable is refused; units and ranges are those of the model."""
    graph = changed("tank", "  pressure: {reads", "  alarm: {reads")
    spec = parts_of("tank").spec
    with pytest.raises(ModelError, match=r"model\.yaml:21: an FMU has another variable called `alarm`.*column: alarm"):
        fmu_variables(graph, spec)
    ranged = changed("tank", "unit: Pa, noise: 180 Pa", "unit: kPa, noise: 0.18 kPa, range: [0 kPa, 20 kPa]")
    parts = FmuParts(graph=ranged, spec=spec, model=parts_of("tank").model)
    text = model_description(3, fmu_title(parts), fmu_variables(ranged, spec), ()).decode()
    assert 'unit="Pa" displayUnit="kPa"' in text
    assert '<DisplayUnit name="kPa" factor="0.001" />' in text
    assert "READING_HIGHEST[] = {INFINITY, 19999.99998};" in fmu_sources(3, parts)["variables.h"]


@BOTH
def test_the_verb(fmi: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`generate --fmu` writes the FMU and tells of it; one that names no fault has no hypotheses."""
    model, path = str(EXAMPLES / "dc_motor" / "model.yaml"), tmp_path / "motor.fmu"
    assert main(["generate", model, "--fmu", str(fmi), "-o", str(path)]) == 0
    assert path.read_bytes() == archive_of("dc_motor", fmi)
    assert f"FMI {fmi}.0, co-simulation" in capsys.readouterr().out
    alarms_only = fmu_sources(fmi, fmu_parts(graph_of("dc_motor"), alarms_only=True))
    assert 'HYPOTHESIS_NAME[] = {\n    ""};' in alarms_only["variables.h"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["-o", "plant"], "plant: an FMU is one file. Name one that ends in .fmu."),
        (["-o", "a.fmu", "--target", "wasm32-wasi"], "--target: the library in an FMU is for this machine"),
        (["-o", "a.fmu", "--fmu", "1"], "--fmu 1: expected a whole number from 2 to 3"),
        (["-o", "none/a.fmu"], "none/a.fmu: No such file or directory"),
    ],
)
def test_mistakes(options: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    """What cannot be written is refused in one line."""
    assert main(["generate", str(EXAMPLES / "dc_motor" / "model.yaml"), "--fmu", "3", *options]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1


def test_the_page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The program in docs/fmu.md finds the fault, and its tables name each variable."""
    pytest.importorskip("fmpy")
    page = (EXAMPLES.parent / "docs" / "fmu.md").read_text()
    program, shown = re.search(r"```python\n(.*?)```.*?```text\n(.*?)```", page, re.DOTALL).groups()  # type: ignore[union-attr]
    (tmp_path / "examples").symlink_to(EXAMPLES)
    (tmp_path / "tank.fmu").write_bytes(archive_of("tank", 3))
    monkeypatch.chdir(tmp_path)
    exec(compile(program, "fmu.md", "exec"), {})  # noqa: S102 - the page's own program
    assert capsys.readouterr().out == shown
    named = {word for row in page.splitlines() if row[:1] == "|" for word in re.findall(r"`(\w+)`", row.split("|")[1])}
    own = {item.name for item in fmu_variables(graph_of("tank"), parts_of("tank").spec) if "." not in item.name}
    assert own - named == set(told_names(graph_of("tank")))


def test_a_file_that_is_no_fmu_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What holds something else is refused and stays; an FMU is written anew."""
    model, path = str(EXAMPLES / "rc" / "model.yaml"), tmp_path / "notes.fmu"
    path.write_text("what nobody has elsewhere")
    assert main(["generate", model, "--fmu", "3", "-o", str(path)]) == 2
    assert capsys.readouterr().err.startswith(f"{path}: this file is no FMU, and it stays as it is.")
    assert path.read_text() == "what nobody has elsewhere"
    path.write_bytes(archive_of("dc_motor", 3))
    assert main(["generate", model, "--fmu", "3", "-o", str(path)]) == 0
