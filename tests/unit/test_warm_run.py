"""`run` where the cache knows the plant: it imports little, says the same, and trusts nothing that is damaged."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from faultbond.app import plant_run
from faultbond.cli import main
from faultbond.io import cache as folder
from faultbond.io import prepared
from faultbond.model.text import load_model
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build

CIRCUIT = Path(__file__).parents[2] / "examples" / "rc"
MODEL = CIRCUIT / "model.yaml"
DERIVING = {"casadi", "sympy", "scipy", "pint", "networkx"}
SHOWING = {"rich", "jinja2", "yaml"}
CHECKED = """checks:
  current: {reads: R.f, unit: A, noise: 1 uA, cost: 1}
"""

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


@pytest.fixture(scope="module")
def compiled() -> folder.Library:
    """The library of the circuit, which takes by far the longest to make."""
    return build(load_model(MODEL)).library


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, compiled: folder.Library, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own for each test, which knows no plant, but holds the library that the first run would make."""
    found = tmp_path / "cache"
    monkeypatch.setenv("FAULTBOND_CACHE", str(found))
    folder.write_kept(compiled.name, compiled.content)
    return found


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A circuit, in a file of its own."""
    path = tmp_path / "model.yaml"
    path.write_text(MODEL.read_text())
    return path


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Some rows of its faulty recording, with the alarm and some diagnoses."""
    lines = (CIRCUIT / "fault_capacitor.csv").read_text().splitlines(keepends=True)
    path = tmp_path / "recording.csv"
    path.write_text("".join([lines[0], *lines[700:1320]]))
    return path


def told(model: Path, recording: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, str, str]:
    """Run; give exit code, standard output and standard error."""
    code = main(["run", str(model), str(recording), *options])
    shown = capsys.readouterr()
    return code, shown.out, shown.err


def refuse_to_build(monkeypatch: pytest.MonkeyPatch) -> None:
    """From here on a plant that is not in the cache fails the test."""
    monkeypatch.setattr(plant_run, "build_method", lambda *_: pytest.fail("the engine was built"))


def prepared_file(cache: Path) -> Path:
    """Give the one file of a prepared plant."""
    (path,) = cache.glob(f"*{folder.PREPARED}")
    return path


@pytest.mark.parametrize("options", [(), ("--json", "-"), ("--accept", "0.9")])
def test_a_warm_run_says_the_same(
    options: tuple[str, ...],
    model: Path,
    recording: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The second run of a model builds nothing, and says to the last digit what the first one said."""
    first = told(model, recording, capsys, *options)
    assert "detect" in first[1]
    refuse_to_build(monkeypatch)
    assert told(model, recording, capsys, *options) == first


def test_a_warm_run_goes_on_from_another(
    model: Path, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A run that is kept goes on warm, and refuses the state of another model as a cold one does."""
    lines = recording.read_text().splitlines(keepends=True)
    (tmp_path / "one.csv").write_text("".join(lines[:300]))
    (tmp_path / "two.csv").write_text("".join([lines[0], *lines[300:]]))
    whole = told(model, recording, capsys, "--json", "-")
    refuse_to_build(monkeypatch)
    state = ("--state", str(tmp_path / "state"), "--json", "-")
    parts = [told(model, tmp_path / f"{name}.csv", capsys, *state) for name in ("one", "two")]
    assert parts[1][0] == whole[0]
    assert parts[1][1].splitlines()[1:] == whole[1].splitlines()[-len(parts[1][1].splitlines()) + 1 :]
    monkeypatch.undo()
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))
    model.write_text(model.read_text() + "# as before\n")
    assert told(model, tmp_path / "two.csv", capsys, *state)[0] == 2  # no row is later


def test_signals_measured_by_hand_are_told_warm(
    model: Path, recording: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the model names such signals, a warm run says the same without reading the model."""
    model.write_text(model.read_text() + CHECKED)
    recording.write_text("".join(recording.read_text().splitlines(keepends=True)[:313]))  # nothing is sure as yet
    first = told(model, recording, capsys, "--json", "-")
    assert '"current"' in first[1]
    refuse_to_build(monkeypatch)
    assert told(model, recording, capsys, "--json", "-") == first


def modules_of(*words: str) -> tuple[set[str], str]:
    """Run the program; give the top-level packages that it imported, and its standard output."""
    command = [sys.executable, "-X", "importtime", "-m", "faultbond", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = [line.rpartition("|")[2].strip() for line in done.stderr.splitlines() if line.startswith("import time:")]
    assert "faultbond.cli" in lines
    return {name.partition(".")[0] for name in lines}, done.stdout


def test_a_warm_run_imports_only_what_it_uses(model: Path, tmp_path: Path) -> None:
    """Nothing that derives a model is imported for a warm run; what shows text only where text is shown."""
    healthy = tmp_path / "healthy.csv"
    healthy.write_text("".join((CIRCUIT / "healthy.csv").read_text().splitlines(keepends=True)[:400]))
    words = ("run", str(model), str(healthy), "--json", "-")
    cold, first = modules_of(*words)
    assert {"casadi", "yaml"} <= cold
    warm, second = modules_of(*words)
    assert second == first
    assert json.loads(first.splitlines()[-1])["samples"] == 399
    assert warm & (DERIVING | SHOWING) == set()
    seen, text = modules_of(*words[:3])
    assert "No fault found in 399 samples" in text
    assert seen & DERIVING == set()
    assert "rich" in seen


def test_another_model_is_another_plant(
    model: Path, recording: Path, cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A model file with one byte more is built anew; its name counts too, since it may name the model."""
    told(model, recording, capsys)
    model.write_text(model.read_text() + "\n")
    told(model, recording, capsys)
    model.rename(model.with_name("other.yaml"))
    told(model.with_name("other.yaml"), recording, capsys)
    assert len(list(cache.glob(f"*{folder.PREPARED}"))) == 3
    assert len(list(cache.glob(f"*{folder.LIBRARY}"))) == 1  # the equations are the same
    refuse_to_build(monkeypatch)
    told(model.with_name("other.yaml"), recording, capsys)


def test_other_engines_and_methods_are_not_kept(
    model: Path, recording: Path, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The method `classic` neither writes to nor reads from what is kept for the bank."""
    told(model, recording, capsys, "--method", "classic")
    assert not list(cache.glob(f"*{folder.PREPARED}"))
    told(model, recording, capsys)
    path = prepared_file(cache)
    path.write_bytes(b"")
    told(model, recording, capsys, "--method", "classic")
    assert path.read_bytes() == b""


def swapped(path: Path) -> None:
    """Put another plant's file in its place."""
    other = path.with_name("other" + folder.PREPARED)
    folder.write_kept(other.name, path.read_bytes()[:-32])
    os.replace(other, path)


def linked(path: Path) -> None:
    """Put a link to the very same file in its place."""
    path.rename(path.with_name("elsewhere"))
    path.symlink_to(path.with_name("elsewhere"))


DAMAGES: dict[str, Callable[[Path], object]] = {
    "cut short": lambda path: os.truncate(path, 4096),
    "cut in the library": lambda path: os.truncate(path, path.stat().st_size - 5000),
    "empty": lambda path: os.truncate(path, 0),
    "one byte": lambda path: path.write_bytes(path.read_bytes()[:-9000] + b"?" + path.read_bytes()[-8999:]),
    "another's": swapped,
    "writable by all": lambda path: path.chmod(0o777),
    "a link": linked,
    "gone": Path.unlink,
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_damaged_is_built_anew_in_silence(
    damage: str, model: Path, recording: Path, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that is not whole, not this plant's or not only the user's is made again, and nobody notices."""
    first = told(model, recording, capsys)
    path = prepared_file(cache)
    whole = path.read_bytes()
    DAMAGES[damage](path)
    assert told(model, recording, capsys) == first
    again = prepared_file(cache)
    assert again.read_bytes() == whole
    assert not again.is_symlink()
    assert again.stat().st_mode & 0o077 == 0


def test_a_plant_whose_library_cannot_be_loaded_is_built(
    model: Path, recording: Path, cache: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the kept library is whole and yet none that this machine can load, the plant is built."""
    first = told(model, recording, capsys)
    path = prepared_file(cache)
    head, _, libraries = path.read_bytes()[:-32].partition(b"\n")
    folder.write_kept(path.name, head + b"\n" + bytes(len(libraries)))
    assert told(model, recording, capsys) == first


def test_without_a_cache_runs_say_the_same(
    model: Path, recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where no cache can be made, each run builds and says the same."""
    first = told(model, recording, capsys)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "file" / "cache"))
    assert told(model, recording, capsys) == first


def test_code_that_is_in_no_folder_is_not_known_again(
    model: Path, recording: Path, cache: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where the package cannot be looked through, as in an archive, each run builds."""
    monkeypatch.setattr(prepared, "_PACKAGE", Path("/nowhere.zip/faultbond"))
    assert told(model, recording, capsys)[0] == 1
    assert not list(cache.glob(f"*{folder.PREPARED}"))


def test_runs_at_once(model: Path, recording: Path, cache: Path) -> None:
    """Three programs that find an empty cache say the same, and leave a plant, a library and three parts of it."""
    shutil.rmtree(cache)
    command = [sys.executable, "-m", "faultbond", "run", str(model), str(recording), "--json", "-"]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) for _ in range(3)]
    ends = [item.communicate() for item in running]
    assert {item.returncode for item in running} == {1}
    assert len({out for out, _ in ends}) == 1
    assert {err for _, err in ends} == {b""}
    assert sorted(path.suffix for path in cache.iterdir()) == [folder.PREPARED, *[folder.LIBRARY] * 4]
