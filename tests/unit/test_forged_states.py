"""Saved states that are damaged or forged: one clear line, or a run as usual, and never more memory than the file."""

import json
import shutil
import tracemalloc
import zipfile
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.app.classic import Classic
from faultbond.app.method_face import Numbers, Watcher
from faultbond.app.methods import BankWatcher, build_method
from faultbond.app.rows import sample_of
from faultbond.cli import main
from faultbond.errors import RecordingError
from faultbond.io.archive import read_archive, write_archive
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.io.saved import read_saved, write_saved
from faultbond.model.text import load_model
from faultbond.types import EngineChoice, Method

MODEL = Path(__file__).parents[2] / "examples" / "rc" / "model.yaml"
ROWS, CUT = 220, 200


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with a recording of a fault, its end, and the states of both methods before that."""
    place = tmp_path_factory.mktemp("states")
    rows = [f"{k * 0.02:.2f},{(5, 9, 3)[k // 40 % 3]}" for k in range(ROWS)]
    (place / "inputs.csv").write_text("\n".join(["time,V", *rows]) + "\n")
    common = ["simulate", str(MODEL), "--inputs", str(place / "inputs.csv"), "--seed", "1", "--fault", "C=160@2"]
    assert main([*common, "-o", str(place / "all.csv")]) == 0
    lines = (place / "all.csv").read_text().splitlines(keepends=True)
    (place / "first.csv").write_text("".join(lines[: CUT + 1]))
    (place / "later.csv").write_text("".join([lines[0], *lines[CUT + 1 :]]))
    for method in ("bank", "classic"):
        options = ["--method", method, "--state", str(place / method), "--engine", "vm"]
        assert main(["run", str(MODEL), str(place / "first.csv"), *options]) in (0, 1)
    return place


def goes_on(folder: Path, state: Path) -> int:
    """Go on from a state and give the exit code."""
    options = ["--state", str(state), "--engine", "vm"]
    return main(["run", str(MODEL), str(folder / "later.csv"), *options])


WRONG = (np.nan, np.inf, -np.inf, -1.5, -1e300, 1e300, 2.0**62, 1e15)


@pytest.fixture(scope="module")
def points(folder: Path) -> list[GridPoint]:
    """Give the samples after the saved ones."""
    graph = load_model(MODEL)
    return list(on_grid(read_rows(folder / "later.csv", columns_of(graph)), Grid(graph.sample_time)))[:5]


@pytest.mark.parametrize("method", list(Method))
def test_no_number_of_a_state_is_an_internal_error(method: Method, folder: Path, points: list[GridPoint]) -> None:
    """Whatever stands in an array, it is refused, or the run goes on without a warning to its verdict."""
    random, refused = np.random.default_rng(5), 0
    saved, graph = read_saved(folder / method.value).numbers, load_model(MODEL)
    fresh = build_method(graph, method, EngineChoice.MACHINE)
    for name, values in saved.items():
        forged = values.copy()
        forged[random.random(forged.shape) < 0.5] = random.choice(WRONG)
        try:
            watcher = like(fresh, {**saved, name: forged})
        except RecordingError as error:
            assert str(error).startswith("the saved state is damaged: ")  # noqa: PT017 - not all are refused
            refused += 1
            continue
        for point in points:
            watcher.step(sample_of(point))
        watcher.finish()
    assert refused >= 5


def like(watcher: Watcher, saved: Numbers) -> Watcher:
    """Give the same method as it was saved, without building its engine again."""
    if isinstance(watcher, BankWatcher):
        return BankWatcher(watcher.spec, watcher._engine, saved)
    assert isinstance(watcher, Classic)
    return Classic(watcher.spec, watcher._plan, saved)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("clock.index", np.nan),
        ("clock.index", 0.5),
        ("clock.alarm", 1e300),
        ("clock.begun", 2.0**40),
        ("bank.misfit.since", np.nan),
        ("sensors.cusum_start", -2.0),
        ("past.times", np.inf),
        ("normal.gain", np.nan),
        ("normal.rates", np.inf),
    ],
)
def test_a_number_that_no_run_has_is_refused(
    name: str, value: float, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Counts are whole, places are in reach, and numbers are finite where a run keeps them so."""
    saved = read_saved(folder / "bank")
    write_saved(tmp_path / "x", replace(saved, numbers={**saved.numbers, name: saved.numbers[name] * 0.0 + value}))
    assert goes_on(folder, tmp_path / "x") == 2
    assert "the saved state is damaged" in capsys.readouterr().err


def test_samples_that_would_fill_the_memory(folder: Path, tmp_path: Path) -> None:
    """A filter that is said to have gathered samples for years would look for all of them."""
    saved = read_saved(folder / "bank")
    forged = {"index": 1e9, "begun": 0.0, "running": 0.0, "alarm": -1.0}
    clock = {f"clock.{name}": np.array(value) for name, value in forged.items()}
    write_saved(tmp_path / "x", replace(saved, numbers={**saved.numbers, **clock}))
    assert goes_on(folder, tmp_path / "x") == 2


def test_sums_that_begin_in_the_future(folder: Path) -> None:
    """Sums of lanes that are said to begin long after the last sample are no internal error."""
    saved = read_saved(folder / "bank").numbers
    later = {"bank.misfit.since": 2.0**40, "bank.misfit.sums": 99.0}
    forged = {**saved, **{name: np.full_like(saved[name], value) for name, value in later.items()}}
    diagnosis = like(build_method(load_model(MODEL), Method.BANK, EngineChoice.MACHINE), forged).finish()
    assert diagnosis is not None
    assert diagnosis.unexplained is not None


def told(key: str, change: Callable[[Any], Any]) -> Callable[[dict[str, Any]], None]:
    """Give what changes a value of the JSON text, the last of the keys with points between."""

    def apply(about: dict[str, Any]) -> None:
        *way, last = key.split(".")
        place: Any = about
        for name in way:
            place = place[name]
        place[int(last) if isinstance(place, list) else last] = change(
            place[int(last) if isinstance(place, list) else last]
        )

    return apply


@pytest.mark.parametrize(
    "change",
    [
        told("counts.samples", lambda n: n + 1),
        told("counts.late", lambda _: -1),
        told("counts.late", lambda _: 10**400),
        told("counts.late", lambda _: True),
        told("clock.0", lambda _: 10**12),
        told("clock.1", lambda _: -1e11),
        told("clock.1", lambda _: float("nan")),
        told("clock.3", lambda _: 10**15),
        told("clock.4", lambda _: 1e18),
        told("clock.4", lambda _: "0"),
        told("clock", lambda clock: clock[:4]),
        told("method", lambda _: "best"),
        told("found.open.signals", lambda _: ["nobody"]),
        told("found.open.time", lambda _: float("inf")),
        told("found.open", lambda _: {}),
        told("found.sure.hypothesis", lambda _: "C"),
        told("found.accepted", lambda _: [1]),
        told("found", lambda found: found | {"more": 1}),
        told("format", lambda _: 1),
        told("model", lambda _: None),
        told("version", lambda _: json.loads("[" * 500 + "]" * 500)),
    ],
)
def test_what_a_state_tells_is_checked(
    change: Callable[[dict[str, Any]], None], folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Counts, times, names and words of another kind, or such as no grid comes to, are refused in one line."""
    about, arrays = read_archive(folder / "bank")
    change(about)
    with (tmp_path / "x").open("wb") as stream:
        write_archive(stream, about, arrays)
    assert goes_on(folder, tmp_path / "x") == 2
    shown = capsys.readouterr().err
    assert "this is not a state that this version of faultbond saved, or it is damaged" in shown
    assert shown.count("\n") == 1


def test_rows_and_frozen_values_of_other_shapes(folder: Path, tmp_path: Path) -> None:
    """The last rows have a value of each input and sensor, their times are in order, and there is one at least."""
    about, arrays = read_archive(folder / "bank")
    for name, values in {
        "rows.u": np.zeros((len(arrays["rows.u"]), 7)),
        "rows.time": arrays["rows.time"][::-1],
        "rows.y": arrays["rows.y"][:3],
        "frozen": np.zeros((3, 9)),
    }.items():
        with (tmp_path / "x").open("wb") as stream:
            write_archive(stream, about, {**arrays, name: values})
        assert goes_on(folder, tmp_path / "x") == 2
    with (tmp_path / "x").open("wb") as stream:
        write_archive(stream, about, arrays | {name: arrays[name][:0] for name in ("rows.time", "rows.u", "rows.y")})
    assert goes_on(folder, tmp_path / "x") == 2


def test_damage_is_noticed(folder: Path, tmp_path: Path) -> None:
    """A file cut short, or with a byte changed, is refused, or it was a byte that says nothing."""
    whole = (folder / "bank").read_bytes()
    random, state, refused = np.random.default_rng(3), tmp_path / "x", 0
    for number in range(200):
        place = int(random.integers(len(whole)))
        flipped = bytes([whole[place] ^ int(random.integers(1, 256))])
        state.write_bytes(whole[:place] + (flipped + whole[place + 1 :] if number % 4 else b""))
        try:
            again = read_saved(state)
        except RecordingError:
            refused += 1
        else:
            write_saved(tmp_path / "y", again)
            assert read_archive(tmp_path / "y")[1].keys() == read_archive(folder / "bank")[1].keys()
    assert refused > 180


def zipped(path: Path, members: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> None:
    """Write an archive of other members."""
    with zipfile.ZipFile(path, "w", method) as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def header(shape: tuple[int, ...], kind: str = "<f8") -> bytes:
    """Give the header of an array."""
    stream = BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": kind, "fortran_order": False, "shape": shape})
    return stream.getvalue()


@pytest.mark.parametrize(
    ("members", "method"),
    [
        ({"x.npy": header((10**8,)) + bytes(10**8)}, zipfile.ZIP_DEFLATED),
        ({"x.npy": header((10**12,)) + bytes(8)}, zipfile.ZIP_STORED),
        ({"x.npy": header((-1,)) + bytes(8)}, zipfile.ZIP_STORED),
        ({"x.npy": header((2,), "|O") + bytes(16)}, zipfile.ZIP_STORED),
        ({"x.npy": b"\x93NUMPY\x02\x00\xff\xff\xff\x7f{}"}, zipfile.ZIP_STORED),
        ({"x.npy": b"\x93NUMPY\x01\x00\x10\x00{1:" + bytes(20)}, zipfile.ZIP_STORED),
        ({"x": bytes(8)}, zipfile.ZIP_STORED),
        ({}, zipfile.ZIP_STORED),
    ],
)
def test_no_memory_is_given_on_trust(members: dict[str, bytes], method: int, tmp_path: Path) -> None:
    """An archive that tells of more than it holds is refused before memory is asked for it."""
    zipped(tmp_path / "x", members, method)
    tracemalloc.start()
    with pytest.raises(RecordingError, match="or it is damaged"):
        read_saved(tmp_path / "x")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50_000_000  # what python itself may load at the first error


def test_a_file_of_any_size(tmp_path: Path) -> None:
    """A file that is larger than any state is not read."""
    with (tmp_path / "x").open("wb") as stream:
        stream.truncate(2**40)
    with pytest.raises(RecordingError, match="or it is damaged"):
        read_saved(tmp_path / "x")


def test_a_state_of_another_run_is_whole(folder: Path, tmp_path: Path) -> None:
    """What was not touched goes on."""
    shutil.copy(folder / "bank", tmp_path / "x")
    assert goes_on(folder, tmp_path / "x") == 1
