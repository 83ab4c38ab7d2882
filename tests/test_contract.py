"""What all of a kind have to keep: methods, engines, sources of recordings, reports. Each is found by inspection.

A new member of a family that nothing here can make fails in a table that is not complete.
"""

import io
import os
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache
from importlib import import_module
from inspect import getmembers, isclass, isfunction, signature
from pathlib import Path
from pkgutil import iter_modules
from threading import Thread
from typing import Any, get_type_hints

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from rich.console import Console

import faultbond.contract.json_records
import faultbond.report
from fake import counts_of, tank_graph, tank_history
from faultbond.app import classic, methods
from faultbond.app.method_face import Watcher
from faultbond.app.methods import build_method
from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Candidate, Decider, Decision, Detection, Diagnosis, History
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.samples import Report, Sample, Samples, Status
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.io.grid import Row
from faultbond.io.recording import Columns, columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.report.numbers import Notation
from faultbond.runtime.core import Core
from faultbond.simulate import Fault
from faultbond.types import Method
from lanes import slot_lanes, suspect_lanes
from made import graph_of, plant, recorded, spec_of

MOTOR = ("dc_motor_current", 250, Fault(parameter="K", factor=0.6, start=2.4))
TANK = ("tank", 260, Fault(parameter="K1", factor=3.0, start=230.0))
RUNS = [(method, MOTOR) for method in Method] + [(Method.BANK, TANK)]
Run = tuple[str, int, Fault]


def told(value: object) -> object:
    """Give a result as what can be compared to the last bit: nan equals nan, and a list is not changed later."""
    match value:
        case np.ndarray():
            return value.shape, value.tobytes()
        case float():
            return repr(value)
        case dict():
            return {key: told(item) for key, item in value.items()}
        case tuple() | list():
            return [told(item) for item in value]
    if is_dataclass(value) and not isinstance(value, type):
        return [told(getattr(value, item.name)) for item in fields(value)]
    return value


# Methods: all members of `Method`. What a watcher holds is all that it knows, and samples are all that it learns from.


@pytest.fixture(scope="module", autouse=True)
def built_once() -> Iterator[None]:
    """Build what does not change in a run once for a model."""
    with pytest.MonkeyPatch.context() as patch:
        for module, name in ((methods, "build_watcher"), (classic, "build_classic")):
            patch.setattr(module, name, cache(getattr(module, name)))
        yield


def watcher(method: Method, run: Run, saved: Any = None) -> Watcher:
    """Give a method at work on a plant."""
    return build_method(graph_of(run[0]), method, saved)


@dataclass(frozen=True, kw_only=True)
class Whole:
    """What a method said of a run, its last words, and what it had saved before each sample; sample of the alarm."""

    reports: list[object]
    end: object
    saved: list[dict[str, Any]]
    alarm: int


def said(at_work: Watcher, sample: Sample) -> Report:
    """Pass one sample through a method."""
    time, dt = np.array([sample.time]), np.array([sample.dt])
    return at_work.take(Samples(time=time, dt=dt, u=sample.u[None], y=sample.y[None])).last


def watched(at_work: Watcher, samples: Sequence[Sample]) -> Whole:
    """Pass samples through a method."""
    reports, saved, alarm = [], [dict(at_work.save())], -1
    for k, sample in enumerate(samples):
        report = said(at_work, sample)
        reports.append(told(report))
        saved.append(dict(at_work.save()))
        alarm = k if alarm < 0 and report.detection is not None else alarm
    return Whole(reports=reports, end=told((at_work.finish(), saved[-1])), saved=saved, alarm=alarm)


@cache
def whole(method: Method, run: Run) -> Whole:
    """Give what a method says of a run."""
    random.seed(1)
    np.random.seed(1)  # noqa: NPY002 - nobody may draw from it
    return watched(watcher(method, run), recorded(*run))


@pytest.mark.parametrize(("method", "run"), RUNS)
def test_a_method_is_repeatable(method: Method, run: Run) -> None:
    """The same samples give the same reports and memory to the last bit, whatever was drawn at random elsewhere."""
    before = told(recorded(*run))
    first = whole(method, run)
    random.seed(2)
    np.random.seed(2)  # noqa: NPY002 - nobody may draw from it
    again = watched(watcher(method, run), recorded(*run))
    assert first.alarm > 0
    assert (again.reports, again.end) == (first.reports, first.end)
    assert told(recorded(*run)) == before


@pytest.mark.parametrize(("method", "run"), RUNS)
def test_a_method_is_pure(method: Method, run: Run) -> None:
    """No sample changes what was saved before it, nor is it changed itself, from the start to behind the alarm."""
    at_work = watcher(method, run)
    for k, sample in enumerate(recorded(*run)):
        saved, given = dict(at_work.save()), told(sample)
        kept = told(saved)
        said(at_work, sample)
        assert told(saved) == kept, k
        assert told(sample) == given, k


@pytest.mark.parametrize(("method", "run"), RUNS)
def test_a_method_remembers_the_same_amount(method: Method, run: Run) -> None:
    """What is saved keeps its names, shapes and kinds from before the first sample to the last."""
    sizes = [
        {name: (np.shape(item), np.asarray(item).dtype.kind) for name, item in saved.items()}
        for saved in whole(method, run).saved
    ]
    assert all(item == sizes[0] for item in sizes)


@pytest.mark.parametrize(("method", "run"), RUNS)
def test_a_method_goes_on_where_it_was_saved(method: Method, run: Run) -> None:
    """Saved to a file and restored, at the start, before, at and after the alarm, it says what it would have said."""
    samples, expected = recorded(*run), whole(method, run)
    alarm = expected.alarm
    at_work = watcher(method, run)
    for k, sample in enumerate(samples):
        if k in {0, 1, 7, 19, 20, 21, alarm // 2, alarm, alarm + 1, alarm + 15, len(samples) - 1}:
            file = io.BytesIO()
            np.savez(file, **at_work.save())  # type: ignore[arg-type]  # the stub takes the names for options
            file.seek(0)
            with np.load(file) as saved:
                at_work = watcher(method, run, dict(saved))
            assert told(dict(at_work.save())) == told(expected.saved[k]), k
        assert told(said(at_work, sample)) == expected.reports[k], k
    assert told((at_work.finish(), dict(at_work.save()))) == expected.end


HOLES: dict[str, Callable[[Sample], Sample]] = {
    "no output": lambda item: replace(item, y=np.full_like(item.y, np.nan)),
    "no input": lambda item: replace(item, u=np.full_like(item.u, np.nan)),
    "nothing": lambda item: replace(item, u=np.full_like(item.u, np.nan), y=np.full_like(item.y, np.nan)),
    "infinite": lambda item: replace(item, u=np.full_like(item.u, np.inf), y=np.full_like(item.y, -np.inf)),
}


def is_number(words: FloatArray) -> BoolArray:
    """Which of the words that are remembered are finite numbers; -1 is one of those that are whole."""
    finite: BoolArray = np.isfinite(words) | (words.view(np.int64) == -1)
    return finite


AS_READ = {"raw"}  # numbers in which a method keeps readings as they came


@pytest.mark.parametrize("hole", HOLES)
@pytest.mark.parametrize("method", Method)
def test_a_method_bears_missing_values(method: Method, hole: str) -> None:
    """Whatever is missing, for one sample or for thirty, at the start or after an alarm, nothing is raised.

    Nor is anything left of it among the numbers that are remembered, and after one sample the method goes on at once.
    """
    samples, before = recorded(*MOTOR), whole(method, MOTOR)
    for first, count in ((0, 1), (5, 30), (80, 1), (90, 30), (before.alarm, 1), (before.alarm + 4, 30)):
        at_work = watcher(method, MOTOR, before.saved[first])
        spoilt = [HOLES[hole](item) for item in samples[first : first + count]]
        reports = [said(at_work, item) for item in (*spoilt, *samples[first + count : first + count + 12])]
        at_work.finish()
        if first >= 80:
            after, usual = at_work.save(), before.saved[min(first + count + 12, len(samples))]
            lost = [name for name in usual if np.any(is_number(usual[name]) & ~is_number(after[name]))]
            assert set(lost) <= AS_READ, first
            for report in reports if count == 1 else reports[-1:]:
                assert np.all(np.isfinite(report.expected)), first
                assert count > 1 or report.status in (Status.WATCHING, Status.DIAGNOSING), first


@pytest.mark.parametrize("method", Method)
def test_a_method_bears_a_sensor_that_is_never_there(method: Method) -> None:
    """A sensor without any value, or all of them, is no alarm and no error."""
    for gone in ([0], [1], [0, 1]):
        at_work = watcher(method, MOTOR)
        for item in recorded(*MOTOR)[:100]:
            y = item.y.copy()
            y[gone] = np.nan
            assert said(at_work, replace(item, y=y)).detection is None
        assert at_work.finish() is None


@pytest.mark.parametrize(("method", "run"), RUNS)
def test_order_of_the_columns_does_not_matter_to_a_method(method: Method, run: Run) -> None:
    """With inputs and sensors declared the other way round the alarm is the same, and so are the probabilities.

    Sensors are taken one after the other, so where laws are not linear the last digits depend on the order.
    """
    graph, expected = graph_of(run[0]), whole(method, run)
    turned = replace(graph, inputs=graph.inputs[::-1], sensors=graph.sensors[::-1])
    one, two = watcher(method, run, expected.saved[-1]), build_method(turned, method)
    reports = [said(two, replace(item, u=item.u[::-1].copy(), y=item.y[::-1].copy())) for item in recorded(*run)]
    assert next(k for k, report in enumerate(reports) if report.detection is not None) == expected.alarm
    assert probabilities(two.finish()) == pytest.approx(probabilities(one.finish()), abs=1e-3)


def probabilities(diagnosis: Diagnosis | None) -> dict[str, float]:
    """Give the probability of each candidate that has one worth naming, by its parameters."""
    assert diagnosis is not None
    named = {", ".join(sorted(item.parameters)): item.probability for item in diagnosis.candidates}
    return {name: value for name, value in named.items() if value > 0.01}


# Engines: all classes with the face of `Engine`. They are pure functions of arrays.


def engine_classes() -> set[type]:
    """Give the classes of the package that advance lanes."""
    found = set()
    for room in ("runtime", "synthesis"):
        package = import_module(f"faultbond.{room}")
        for item in iter_modules(package.__path__, f"{package.__name__}."):
            for _, kind in getmembers(import_module(item.name), isclass):
                own = kind.__module__.startswith("faultbond.") and not getattr(kind, "_is_protocol", False)
                found |= {kind} if own and {"advance", "slot", "title"} <= set(dir(kind)) else set()
    return found


@cache
def engines() -> dict[str, Core]:
    """Give an engine of each class that can be made here."""
    made = plant(MOTOR[0])[2]
    return {type(made).__name__: made}


ENGINES = [(name, slot) for name in sorted(kind.__name__ for kind in engine_classes()) for slot in (False, True)]


def stand(name: str, slot: bool) -> tuple[EngineSpec, Engine, FloatArray, FloatArray]:
    """Give specification, engine, lanes and 40 samples."""
    spec = spec_of(MOTOR[0])
    samples, place, n_x = np.zeros((40, spec.n_sample)), spec.sample_fields, len(spec.states)
    for k, item in enumerate(recorded(*MOTOR)[:40]):
        samples[k, place["dt"]], samples[k, place["u"]], samples[k, place["y"]] = item.dt, item.u, item.y
        samples[k, place["u_before"]] = recorded(*MOTOR)[max(k - 1, 0)].u
    samples[:, place["use"]] = np.random.default_rng(1).random((40, len(spec.outputs))) > 0.2
    samples[:, place["scale"]] = 1.0
    samples[:, place["fresh"]] = spec.input_variance
    healthy = engines()[name].healthy_lane(np.zeros(n_x), np.eye(n_x))
    if not slot:
        lanes = np.concatenate([healthy, suspect_lanes(spec, plan_lanes(spec), healthy[:, 0])[:, :4]], axis=1)
        return spec, engines()[name], lanes, samples
    peak = np.abs(samples[:, place["u"]]).max(axis=0)
    lanes = slot_lanes(
        spec, plan_slots(spec), range(5), healthy[:, 0], peak, samples[0, place["y"]], samples[0, place["u"]]
    )
    return spec.slotted, engines()[name].slot, lanes, samples


@pytest.mark.parametrize(("name", "slot"), ENGINES)
def test_an_engine_is_pure(name: str, slot: bool) -> None:
    """It changes no argument, gives the same twice, and what it gave is not changed by what it gives later."""
    _, engine, lanes, samples = stand(name, slot)
    for count in (1, 5):  # one lane is laid out like its transpose
        given, before = lanes[:, :count].copy(), (lanes[:, :count].copy(), samples.copy())
        first = engine.advance(given, samples)
        kept = told(first)
        assert told(engine.advance(given, samples)) == kept
        engine.advance(given, samples[:7])
        assert told(first) == kept
        assert told((given, samples)) == told(before)
        assert np.all(np.isfinite(first[0]))
        assert not np.array_equal(first[0], given)


@pytest.mark.parametrize(("name", "slot"), ENGINES)
def test_an_engine_takes_blocks_as_samples(name: str, slot: bool) -> None:
    """A block gives what its samples give one by one; a block of none changes nothing."""
    _, engine, lanes, samples = stand(name, slot)
    at_once, seen = engine.advance(lanes, samples)
    current = lanes
    for k in range(len(samples)):
        current, found = engine.advance(current, samples[k : k + 1])
        assert np.array_equal(found[0], seen[k]), k
    assert np.array_equal(current, at_once)
    assert np.array_equal(engine.advance(lanes, samples[:0])[0], lanes)


@pytest.mark.parametrize(("name", "slot"), ENGINES)
def test_lanes_know_nothing_of_each_other(name: str, slot: bool) -> None:
    """Each lane alone, or in another place, gives what it gives among others; one that is lost harms no other."""
    _, engine, lanes, samples = stand(name, slot)
    together, seen = engine.advance(lanes, samples)
    for k in range(lanes.shape[1]):
        alone, found = engine.advance(lanes[:, k : k + 1].copy(), samples)
        assert alone[:, 0] == pytest.approx(together[:, k], rel=1e-12, abs=1e-300)
        assert found[:, :, 0] == pytest.approx(seen[:, :, k], rel=1e-9, abs=1e-9)
    turned, _ = engine.advance(lanes[:, ::-1].copy(), samples)
    assert turned[:, ::-1] == pytest.approx(together, rel=1e-12, abs=1e-300)
    lost = lanes.copy()
    lost[:, 2] = np.nan
    after, _ = engine.advance(lost, samples)
    others = [k for k in range(lanes.shape[1]) if k != 2]
    assert np.array_equal(after[:, others], together[:, others])
    none, nothing = engine.advance(lanes[:, :0].copy(), samples)
    assert (none.shape, nothing.shape) == ((lanes.shape[0], 0), (len(samples), seen.shape[1], 0))


@pytest.mark.parametrize(("name", "slot"), ENGINES)
def test_an_engine_does_not_look_at_what_is_switched_off(name: str, slot: bool) -> None:
    """A reading that is not used may be any number."""
    spec, engine, lanes, samples = stand(name, slot)
    place = spec.sample_fields
    other = samples.copy()
    other[:, place["y"]] += np.where(samples[:, place["use"]] > 0, 0.0, 77.0)
    assert np.array_equal(engine.advance(lanes, other)[0], engine.advance(lanes, samples)[0])


# Sources of recordings: files of either kind, a pipe, standard input. All give the same rows.

HEADER = ("time", "V", "V_C")
TABLE = [("0.02", "5", "1.5"), ("0.04", "", "1.25"), ("0.06", "7.5", ""), ("0.08", "", ""), ("0.10", "nan", "-2e-3")]
Source = Callable[[Path, Sequence[str], Sequence[Sequence[str]]], AbstractContextManager[str]]


def csv_text(header: Sequence[str], table: Sequence[Sequence[str]], comma: str = ",") -> str:
    """Give a table as text."""
    return "".join(f"{comma.join(row)}\n" for row in (header, *table))


def csv_file(folder: Path, header: Sequence[str], table: Sequence[Sequence[str]]) -> AbstractContextManager[str]:
    """A file of text."""
    (folder / "rows.csv").write_text(csv_text(header, table))
    return nullcontext(str(folder / "rows.csv"))


def semicolon_file(folder: Path, header: Sequence[str], table: Sequence[Sequence[str]]) -> AbstractContextManager[str]:
    """A file of text as half of the world writes it."""
    (folder / "semi.csv").write_text(csv_text(header, table, ";"))
    return nullcontext(str(folder / "semi.csv"))


def parquet_file(folder: Path, header: Sequence[str], table: Sequence[Sequence[str]]) -> AbstractContextManager[str]:
    """A file of columns."""
    columns = {
        name: pa.array([float(row[k]) if row[k] else None for row in table], pa.float64())
        for k, name in enumerate(header)
    }
    pq.write_table(pa.table(columns), folder / "rows.parquet")
    return nullcontext(str(folder / "rows.parquet"))


@contextmanager
def named_pipe(folder: Path, header: Sequence[str], table: Sequence[Sequence[str]]) -> Iterator[str]:
    """A pipe with a name, which can be read once."""
    path = folder / f"pipe{len(list(folder.iterdir()))}"
    os.mkfifo(path)
    writer = Thread(target=path.write_text, args=(csv_text(header, table),))
    writer.start()
    yield str(path)
    writer.join()


@contextmanager
def standard_input(folder: Path, header: Sequence[str], table: Sequence[Sequence[str]]) -> Iterator[str]:
    """What another program writes."""
    del folder
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(csv_text(header, table).encode())))
        yield "-"


SOURCES: list[Source] = [csv_file, semicolon_file, parquet_file, named_pipe, standard_input]


@cache
def columns() -> Columns:
    """Give the columns of the model."""
    return columns_of(graph_of("rc"))


def rows(source: Source, folder: Path, header: Sequence[str] = HEADER, table: Any = TABLE) -> list[Row]:
    """Give the rows of a table that comes from a source."""
    with source(folder, header, table) as place:
        return list(read_rows(place, columns()))


def values(found: list[Row]) -> object:
    """Give rows without where they stood."""
    return [told((row.time, row.u, row.y, row.saturated)) for row in found]


@pytest.mark.parametrize("source", SOURCES)
def test_a_source_gives_the_rows_of_the_table(source: Source, tmp_path: Path) -> None:
    """Every source gives the same rows, one after the other, and the same again; what is missing is nan."""
    found = rows(source, tmp_path)
    nan = float("nan")
    numbers = [(row.time, *row.u, *row.y) for row in found]
    expected = [(0.02, 5, 1.5), (0.04, nan, 1.25), (0.06, 7.5, nan), (0.08, nan, nan), (0.1, nan, -2e-3)]
    assert np.array_equal(numbers, expected, equal_nan=True)
    assert values(rows(source, tmp_path)) == values(found)
    assert [row.line - found[0].line for row in found] == list(range(len(TABLE)))


@pytest.mark.parametrize("source", SOURCES)
def test_order_of_the_columns_does_not_matter_to_a_source(source: Source, tmp_path: Path) -> None:
    """Columns are found by their names, and those that no model names are passed over."""
    turned = [(row[2], "3", row[0], row[1]) for row in TABLE]
    found = rows(source, tmp_path, ("V_C", "other", "time", "V"), turned)
    assert values(found) == values(rows(csv_file, tmp_path))


@pytest.mark.parametrize("source", SOURCES)
def test_a_source_bears_empty_columns(source: Source, tmp_path: Path) -> None:
    """Columns without a value are nan from the first row to the last."""
    found = rows(source, tmp_path, HEADER, [(row[0], "", "") for row in TABLE])
    assert np.all(np.isnan([(*row.u, *row.y) for row in found]))
    assert len(found) == len(TABLE)


@pytest.mark.parametrize("source", [csv_file, semicolon_file, parquet_file])
def test_a_source_is_left_as_it_was(source: Source, tmp_path: Path) -> None:
    """Reading a file changes nothing of it, and rows that are kept stay as they were given."""
    with source(tmp_path, HEADER, TABLE) as place:
        before = Path(place).read_bytes()
        kept = [(row, told(row)) for row in read_rows(place, columns())]
        assert Path(place).read_bytes() == before
    assert all(told(row) == words for row, words in kept)


# Reports: all functions of `faultbond.report` that tell a history, and all records of what was found.


def story_of(name: str) -> History:
    """Give a made-up run; in one all curves are missing, in one there is nothing but its first row."""
    history = tank_history(tank_graph(), samples=900, fault=name != "healthy")
    if name == "nothing there":
        curves = ("measured", "expected", "expected_sd", "inputs", "cusum", "slow")
        history = replace(history, **{item: np.full_like(getattr(history, item), np.nan) for item in curves})
    if name == "no numbers":
        best = history.diagnoses[-1]
        spoilt = [
            replace(item, suspects=tuple(replace(one, estimate=np.nan, sd=np.inf) for one in item.suspects))
            for item in best.candidates
        ]
        history = replace(history, diagnoses=(*history.diagnoses[:-1], replace(best, candidates=tuple(spoilt))))
    return history


STORIES = ["faulty", "healthy", "nothing there", "no numbers"]


def tellers() -> dict[str, Callable[..., Any]]:
    """Give the public functions of the report that take a history."""
    listed = {name: getattr(faultbond.report, name) for name in faultbond.report.__all__}
    return {name: item for name, item in listed.items() if isfunction(item) and "history" in signature(item).parameters}


def page(name: str, history: History) -> str:
    """Give what a report says of a run."""
    graph: BondGraph = tank_graph()
    stream = io.StringIO()
    known: dict[str, Any] = {
        "console": Console(file=stream, width=100),
        "graph": graph,
        "history": history,
        "strokes": None,
        "engine_title": "an engine",
        "version": "1",
        "counts": counts_of(history),
        "notation": Notation.FILE,
    }
    teller = tellers()[name]
    wanted = {
        key: known[key]
        for key, item in signature(teller).parameters.items()
        if key in known or item.default is item.empty
    }
    text = teller(**wanted)
    return stream.getvalue() if text is None else str(text)


@pytest.mark.parametrize("story", STORIES)
@pytest.mark.parametrize("name", tellers())
def test_a_report_is_pure(name: str, story: str) -> None:
    """A report of any run, also of one without a number in it, can be made, is the same twice, and changes nothing."""
    history = story_of(story)
    before = told(history)
    first = page(name, history)
    assert page(name, history) == first
    assert told(history) == before
    assert first.strip()


@pytest.mark.parametrize("name", tellers())
def test_a_report_tells_runs_apart(name: str) -> None:
    """Runs that ended otherwise are told otherwise, one after the other."""
    assert len({page(name, story_of(story)) for story in ("faulty", "healthy")}) == 2


def records() -> dict[str, Callable[[Any], dict[str, Any]]]:
    """Give the functions that make a record of something found."""
    found: dict[str, Callable[[Any], dict[str, Any]]] = {}
    for name, item in getmembers(faultbond.contract.json_records, isfunction):
        kinds = [kind for key, kind in get_type_hints(item).items() if key != "return"]
        if name.endswith("_record") and kinds and is_dataclass(kinds[0]):
            found[name] = item
    return found


def finding(kind: object) -> object:
    """Give a made-up finding of a kind."""
    history = story_of("no numbers")
    candidate: Candidate = history.diagnoses[-1].candidates[0]
    known = {
        Detection: history.detections[0],
        Diagnosis: history.diagnoses[-1],
        Decision: Decision(time=1.0, candidate=candidate, by=Decider.PERSON),
    }
    return next(item for key, item in known.items() if key is kind)


@pytest.mark.parametrize("name", records())
def test_a_record_is_pure(name: str) -> None:
    """A record is the same twice, changes nothing of what it is made of, and shares nothing with it."""
    make = records()[name]
    kind = next(item for key, item in get_type_hints(make).items() if key != "return")
    given = finding(kind)
    before, first = told(given), make(given)
    words = told(first)
    assert told(make(given)) == words
    assert told(given) == before
    assert first["record"] == make(given)["record"]
    spoil(first)
    assert told(make(given)) == words


def spoil(value: object) -> None:
    """Take everything out of a record."""
    if isinstance(value, dict | list):
        for item in value.values() if isinstance(value, dict) else value:
            spoil(item)
        value.clear()


def test_everything_of_a_kind_was_found() -> None:
    """The lists above are not empty by mistake: what is known to be there is in them."""
    assert {kind.__name__ for kind in engine_classes()} == {"Core"}
    assert set(engines()) == {kind.__name__ for kind in engine_classes()}
    assert set(tellers()) == {"print_diagnosis", "render_report", "verdict_sentence"}
    assert set(records()) == {"detection_record", "diagnosis_record", "decision_record"}
    assert {method for method, _ in RUNS} == set(Method)
