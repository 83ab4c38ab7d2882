"""Saved states that are damaged or forged: one clear line, or a run as usual, and never more memory than the file."""

import json
import shutil
import tracemalloc
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.app.classic import Classic
from faultbond.app.method_face import Numbers, Watcher
from faultbond.app.methods import BankWatcher, build_method
from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.contract.samples import Samples
from faultbond.errors import RecordingError
from faultbond.io.archive import read_archive, write_archive
from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.io.saved import read_saved, write_saved
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.types import Method

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
        options = ["--method", method, "--state", str(place / method)]
        assert main(["run", str(MODEL), str(place / "first.csv"), *options]) in (0, 1)
    return place


def goes_on(folder: Path, state: Path) -> int:
    """Go on from a state and give the exit code."""
    options = ["--state", str(state)]
    return main(["run", str(MODEL), str(folder / "later.csv"), *options])


WRONG = (np.nan, np.inf, -np.inf, -1.5, -1e300, 1e300, 2.0**62, 1e15)
WRONG_COUNTS = (-(2**63), -2, 2, 10**15, 2**53, 2**62)
PAST_TIME = "past.time"
HEAD = 6  # words before the fields: mark, format, hash of the model


@pytest.fixture(scope="module")
def later(folder: Path) -> list[Samples]:
    """Give the samples after the saved ones, one by one."""
    graph = load_model(MODEL)
    points = on_grid(read_rows(folder / "later.csv", columns_of(graph)), Grid(graph.sample_time))
    return [
        Samples(time=np.array([item.time]), dt=np.array([item.dt]), u=item.u[None], y=item.y[None])
        for item in islice(points, 5)
    ]


@cache
def fresh(method: Method) -> Watcher:
    """Give a method at its beginning."""
    return build_method(load_model(MODEL), method)


def core() -> Core:
    """Give the core of the model."""
    watcher = fresh(Method.BANK)
    assert isinstance(watcher, BankWatcher)
    return watcher._monitor.core


def place_of(name: str) -> slice:
    """Give where the numbers of a field, or the time of the first row of the past, stand in what the core saves."""
    fields, begin = core().fields, HEAD
    for other, field in fields.items():
        if other == name:
            break
        begin += field.count
    if name == PAST_TIME:
        begin += core().spec.n_sample + core().spec.n_numbers
        return slice(begin, begin + 1)
    return slice(begin, begin + fields[name].count)


def sealed(words: FloatArray) -> FloatArray:
    """Give a state as the core saves it with the checksum that fits the words before."""
    whole = words.copy()
    whole.view(np.uint64)[-1] = zlib.crc32(whole[:-1].tobytes())
    return whole


def forged(saved: Numbers, **fields: float) -> Numbers:
    """Give what the bank saved with other numbers of some fields, the points of whose names are two underscores."""
    words = saved["state"].copy()
    for name, value in fields.items():
        field = name.replace("__", ".")
        whole = field in core().fields and core().fields[field].whole
        words.view(np.int64 if whole else np.float64)[place_of(field)] = value
    return {"state": sealed(words)}


def bank_forgeries(saved: Numbers, random: np.random.Generator) -> Iterator[Numbers]:
    """Yield what the bank saved with half the numbers of each field wrong, then of the rows and lanes behind them."""
    end = HEAD
    for name, field in core().fields.items():
        place, words = place_of(name), saved["state"].copy()
        values = words.view(np.int64 if field.whole else np.float64)[place]
        values[random.random(field.count) < max(0.5, 1.0 / field.count)] = random.choice(
            WRONG_COUNTS if field.whole else WRONG
        )
        yield {"state": sealed(words)}
        end = place.stop
    for part in (0.5, 0.01):
        words = saved["state"].copy()
        wrong = np.flatnonzero(random.random(len(words) - 1 - end) < part) + end
        words[wrong] = random.choice(WRONG, len(wrong))
        yield {"state": sealed(words)}


def classic_forgeries(saved: Numbers, random: np.random.Generator) -> Iterator[Numbers]:
    """Yield what the other method saved with half of the numbers of each array wrong."""
    for name, values in saved.items():
        wrong = values.copy()
        wrong[random.random(wrong.shape) < 0.5] = random.choice(WRONG)
        yield {**saved, name: wrong}


@pytest.mark.parametrize("method", list(Method))
def test_no_number_of_a_state_is_an_internal_error(method: Method, folder: Path, later: list[Samples]) -> None:
    """Whatever stands in a state, it is refused, or the run goes on without a warning to its verdict."""
    refused, made = 0, {Method.BANK: bank_forgeries, Method.CLASSIC: classic_forgeries}[method]
    for numbers in made(read_saved(folder / method.value).numbers, np.random.default_rng(5)):
        try:
            watcher = like(fresh(method), numbers)
        except RecordingError as error:
            assert str(error).startswith("the saved state is damaged")  # noqa: PT017 - not all are refused
            refused += 1
            continue
        for sample in later:
            watcher.take(sample)
        watcher.finish()
    assert refused >= 5


def like(watcher: Watcher, saved: Numbers) -> Watcher:
    """Give the same method as it was saved, without building its engine again."""
    if isinstance(watcher, BankWatcher):
        return BankWatcher(watcher._monitor.core, saved)
    assert isinstance(watcher, Classic)
    return Classic(watcher.spec, watcher._plan, saved)


def refusal(folder: Path, state: Path, numbers: Numbers, capsys: pytest.CaptureFixture[str]) -> str:
    """Give the line with which a run from a state with other numbers is refused."""
    write_saved(state, replace(read_saved(folder / "bank"), numbers=numbers))
    capsys.readouterr()
    assert goes_on(folder, state) == 2
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1
    assert shown.endswith("Delete its file to begin anew.\n")
    return shown


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("clock.index", -1),
        ("clock.index", 2**53),
        ("clock.alarm", 2**50),
        ("clock.alarm", -2),
        ("clock.begun", 2**40),
        ("clock.running", 2),
        ("clock.time", np.nan),
        ("bank.since", np.nan),
        ("bank.grown", 5),
        ("bank.rejected", 2),
        ("sensors.cusum_start", -2.0),
        ("sensors.nis", -1.0),
        ("normal.gain", np.nan),
        ("normal.rates", np.inf),
        ("inputs.habit", 1.5),
        (PAST_TIME, np.inf),
    ],
)
def test_a_number_that_no_run_has_is_refused(
    name: str, value: float, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Counts are whole, places are in reach, and numbers are finite where a run keeps them so."""
    numbers = forged(read_saved(folder / "bank").numbers, **{name.replace(".", "__"): value})
    assert "the saved state is damaged" in refusal(folder, tmp_path / "x", numbers, capsys)


def test_what_is_no_state_of_the_core_is_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Words that are gone, more, or changed; another format or model; other arrays: each is refused in one line."""
    words = read_saved(folder / "bank").numbers["state"]
    changed, mark, form, model = (words.copy() for _ in range(4))
    changed[300] += 1.0
    mark.view(np.uint64)[0] += 1
    form.view(np.uint64)[1] += 1
    model.view(np.uint64)[HEAD - 1] += 1
    for state, told in (
        (changed, "damaged"),
        (words[:-1], "damaged"),
        (sealed(words[:-1]), "damaged"),
        (words[:3], "damaged"),
        (sealed(np.append(words, 0.0)), "damaged"),
        (words[:0], "no state of faultbond"),
        (words[:1], "no state of faultbond"),
        (sealed(mark), "no state of faultbond"),
        (sealed(form), "another version"),
        (sealed(model), "another model"),
        (words[None, :], "another version"),
        (words[0], "another version"),
    ):
        assert told in refusal(folder, tmp_path / "x", {"state": np.array(state)}, capsys)
    for numbers in ({}, {"state": words, "more": words}, {"clock.index": words}):
        assert "another version" in refusal(folder, tmp_path / "x", numbers, capsys)


def test_samples_that_would_fill_the_memory(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A filter that is said to have gathered samples for years would look for all of them."""
    numbers = read_saved(folder / "bank").numbers
    wrong = forged(numbers, clock__index=10**9, clock__begun=0, clock__running=0, clock__alarm=-1)
    assert "damaged" in refusal(folder, tmp_path / "x", wrong, capsys)


def test_what_is_refused_changes_nothing(folder: Path) -> None:
    """A monitor that refuses a state goes on as it was."""
    saved = read_saved(folder / "bank").numbers
    monitor = Monitor(core(), np.ascontiguousarray(saved["state"]).view(np.uint8))
    before = monitor.save()
    for wrong in (forged(saved, normal__gain=np.nan), forged(saved, clock__begun=2**40)):
        with pytest.raises(RecordingError, match="damaged"):
            monitor._restore(wrong["state"].view(np.uint8))
        assert np.array_equal(monitor.save(), before)


def test_sums_that_begin_in_the_future(folder: Path) -> None:
    """Sums of lanes that are said to begin long after the last sample are no internal error."""
    saved = read_saved(folder / "bank").numbers
    diagnosis = like(fresh(Method.BANK), forged(saved, bank__since=2.0**40, bank__sums=99.0)).finish()
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
        stream.write(b"PK")
        stream.truncate(2**40)
    with pytest.raises(RecordingError, match="or it is damaged"):
        read_saved(tmp_path / "x")


def test_a_state_of_another_run_is_whole(folder: Path, tmp_path: Path) -> None:
    """What was not touched goes on."""
    shutil.copy(folder / "bank", tmp_path / "x")
    assert goes_on(folder, tmp_path / "x") == 1
