"""What a store keeps of a period: its journal as text or records, its measurements as a recording, and a report of it.

A recording has the names and units of the model file, and every digit, so `run` on it reads what the service read. A
report comes from passing the period again, with what people decided in it. An alarm from before it that was not
repaired bears on it, so then the rows pass from before the first such alarm on.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from faultbond.app.course import Course, Following
from faultbond.app.decision import chosen_hypothesis
from faultbond.app.plant import find_plant
from faultbond.app.plant_run import PlantRun, begin
from faultbond.app.wishes import Wanted
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection
from faultbond.contract.json_records import Record
from faultbond.errors import FaultbondError, RecordingError
from faultbond.io.files import replaced, replaced_text
from faultbond.io.grid import Grid
from faultbond.io.out import Out
from faultbond.io.recording import write_recording
from faultbond.io.row_block import RowBlock, joined_rows
from faultbond.model.document import ModelDocument
from faultbond.model.graph import BondGraph, Unit
from faultbond.model.text import parse_model
from faultbond.report.numbers import clock_text, probability_text
from faultbond.runtime.trace import Trace
from faultbond.service.contract.messages import DECISIONS, Action, AuditEntry, Deed, NamedRecord
from faultbond.service.contract.store import Enrolment, LogStore
from faultbond.types import Method

SHORT = (15, 12)  # digits, of which the fewest that do are written, as somebody wrote them
PARQUET, PAGE = (".parquet", ".pq"), (".html", ".htm")
_TURNS = ("detection", "accepted")  # kinds of records with which an alarm is raised, and ends
LEAD = 3600  # samples before an alarm from which on it is watched again, for a filter that has settled
QUALITY = ".quality"  # behind the header of a column: that of its qualities
ARRIVED = ".arrived"  # behind that of the time: when rows came
_NOBODY = Out(text=None, json=None)
KINDS_OF_FILES = "FILE.csv, FILE.parquet or FILE.html"


@dataclass(frozen=True, slots=True, kw_only=True)
class Excerpt:
    """A part of a store. asset: None: of all. begin, end: on the clock of the rows; None: the first, the last."""

    asset: str | None = None
    begin: float | None = None
    end: float | None = None


def tell_history(store: LogStore, wanted: Excerpt, *, output: Path | None, out: Out) -> None:
    """List the journal of a period; with a file write the measurements or the report of it instead.

    Parameters
    ----------
    store : what is read
    wanted : which part of it
    output : file to write, of which the name's ending says what it is to be; None: none
    out : where text and records go

    Raises
    ------
    FaultbondError
        Where there is no such asset, no row in the period, or a file of another kind is wanted.
    """
    if wanted.begin is not None and wanted.end is not None and wanted.begin > wanted.end:
        raise FaultbondError("The period begins behind its end.")
    assets = _assets(store, wanted.asset)
    if output is None:
        _list(store.journal(wanted.asset, begin=wanted.begin, end=wanted.end), out)
        if wanted == Excerpt():  # it is about no asset, and about no moment of a recording
            _list_audit(store.audit(), out)
        return
    if output.suffix.lower() not in (".csv", *PARQUET, *PAGE):
        raise FaultbondError(f"{output}: what to write is told by the name's ending: {KINDS_OF_FILES}.")
    if len(assets) > 1:
        raise FaultbondError(
            f"The store has the assets {', '.join(assets)}; name the one that {output.name} is to be of."
        )
    enrolment = _in_force(store, assets[0], wanted)
    if output.suffix.lower() in PAGE:
        page = replayed(store, enrolment, wanted).page()
        with replaced_text(output) as stream:
            stream.write(page)
    else:
        graph = parse_model(enrolment.text, file=enrolment.label)
        log = store.log_between(assets[0], wanted.begin, wanted.end, enrolment.model_sha256)
        _write_columns(output, columns_in_units(graph, log))
    out.say(f"{assets[0]}: {output}")
    out.record({"record": "history", "asset": assets[0], "output": str(output), "model": enrolment.label})


def _list(journal: Iterable[NamedRecord | Deed], out: Out) -> None:
    """Tell all that is in a journal; as text a diagnosis that says what the one before said is left out."""
    said: dict[str, str] = {}
    for item in journal:
        if isinstance(item, NamedRecord):
            words = item.kind + _content_text(item.content)
            is_news = item.kind != "diagnosis" or said.get(item.asset) != words
            said[item.asset] = words
        if not isinstance(item, NamedRecord) or is_news:
            out.say(line_of(item))
        out.record(record_of(item))


def _list_audit(entries: Iterable[AuditEntry], out: Out) -> None:
    """Tell what people did that is about no asset."""
    for item in entries:
        about = ", ".join(f"{key} {_plain(value)}" for key, value in item.about.items() if value not in ("", []))
        out.say(f"{clock_text(item.at)}  audit {item.number}, {item.who}: {item.what}, {about}")
        told = {"number": item.number, "at": item.at, "who": item.who, "what": item.what, "about": dict(item.about)}
        out.record({"record": "audit", **told})


def _plain(value: object) -> str:
    return " ".join(map(str, value)) if isinstance(value, list) else str(value)


def line_of(item: NamedRecord | Deed) -> str:
    """Give a record, or what a person did, as a line of text."""
    if isinstance(item, NamedRecord):
        kind = "repaired" if item.content.get("repaired") else item.kind
        return f"{clock_text(item.time)}  {item.asset}  {kind}{_content_text(item.content)}"
    what = " ".join(filter(None, (item.action.value, " ".join(item.target))))
    if item.undone is not None:
        what = f"{what} entry {item.undone}"
    if item.until is not None:
        what = f"{what} until {clock_text(item.until)}"
    comment = f": {item.comment}" if item.comment else ""
    return f"{clock_text(item.at)}  {item.asset}  entry {item.number}, {item.who}: {what}{comment}"


def record_of(item: NamedRecord | Deed) -> Record:
    """Give a record with its id and asset, or what a person did as a record `deed`."""
    if isinstance(item, NamedRecord):
        return {**item.content, "id": item.id, "asset": item.asset}
    return {
        "record": "deed",
        "asset": item.asset,
        "number": item.number,
        "at": item.at,
        "who": item.who,
        "action": item.action.value,
        "target": list(item.target),
        "comment": item.comment,
        "until": item.until,
        "undone": item.undone,
        "rows": item.rows,
    }


def columns_in_units(graph: BondGraph, log: Iterable[RowBlock | Deed]) -> dict[str, FloatArray]:
    """Give the rows of a log as columns of a recording by header, (n_rows,) each, in the units of the model file.

    A column of which the source called a value uncertain or bad has one more beside it, of its `Quality` as a number;
    last comes when each row did, s since 1970.
    """
    blocks = [item for item in log if isinstance(item, RowBlock)]
    rows = joined_rows(blocks)
    columns = {}
    if graph.time.column is not None:
        columns[graph.time.column] = _in_unit(rows.time, graph.time.unit)
    for k, (item, values) in enumerate(zip(graph.instruments, np.hstack([rows.u, rows.y]).T, strict=True)):
        columns[item.column] = _in_unit(values, item.unit)
        if rows.quality is not None and rows.quality[:, k].any():
            columns[f"{item.column}{QUALITY}"] = rows.quality[:, k].astype(np.float64)
    if rows.arrived is not None:
        columns[f"{graph.time.column or ''}{ARRIVED}".lstrip(".")] = rows.arrived
    return columns


def replayed(store: LogStore, enrolment: Enrolment, wanted: Excerpt) -> PlantRun:
    """Pass a period of a log once more, as live: its rows, and the decisions in it that were not taken back.

    Where an alarm from before it was not repaired, the rows pass from before the first such alarm on, for what it left
    behind, and the run of the period goes on from there. Where an alarm that stood open live does not show in them, as
    where they are forgotten, that is said.
    """
    document = ModelDocument(label=enrolment.label, data=enrolment.text.encode())
    begun = begin(find_plant(document, Wanted()), Wanted(), None, out=_NOBODY, live=True, curves=False)
    run, asset, model = begun.run, enrolment.asset, enrolment.model_sha256
    deeds = [item for item in store.journal(asset, kinds=_TURNS, end=wanted.end) if isinstance(item, Deed)]
    gone = frozenset(item.undone for item in deeds if item.undone is not None)
    before = _Alarms()
    if wanted.begin is not None:
        ends = float(np.nextafter(wanted.begin, -inf))
        before = _alarms(store.journal(asset, kinds=_TURNS, end=ends), f"{asset}/{model[:12]}/")
        if before.unrepaired:
            alarm = _detection_of(before.unrepaired[0])
            first = min(alarm.time, alarm.change_time) - LEAD * (run.watcher.spec.sample_time or 1.0)
            _pass(run, begun.grid, store.log_between(asset, first, ends, model), gone)
    saved, trace = run.course.saved(Method.BANK), Trace(run.watcher.spec, lag=run.watcher.lag)
    course = Course(run.watcher, begun.grid, Following(out=_NOBODY, trace=trace), saved)
    run = replace(run, course=course, trace=trace)
    if before.open is not None and course.found.open is None:
        trace.before([_detection_of(before.open)], (), ())
        run = replace(run, hints=(_unseen_sentence(store, before.open, wanted),))
    _pass(run, begun.grid, store.log_between(asset, wanted.begin, wanted.end, model), gone)
    course.finish()
    return run


def _pass(run: PlantRun, grid: Grid, log: Iterable[RowBlock | Deed], gone: Collection[int]) -> None:
    """Let rows and decisions pass, but those that were taken back."""
    for item in log:
        if isinstance(item, RowBlock):
            for points in grid.push_block(item):
                run.course.take(points)
        elif item.action in DECISIONS and item.number not in gone:
            with suppress(FaultbondError):
                _decide(run, item)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Alarms:
    """Alarms of before. unrepaired: what they found is accepted, or open yet. open: which of them is; None: none."""

    unrepaired: tuple[NamedRecord, ...] = ()
    open: NamedRecord | None = None


def _alarms(journal: Iterable[NamedRecord | Deed], of: str) -> _Alarms:
    """Give the alarms with which a journal ends, of records whose ids begin so."""
    now, before = _Alarms(), list[_Alarms]()  # before: each decision that can be taken back
    for item in journal:
        if isinstance(item, Deed):
            if item.action in DECISIONS:
                before.append(now)
            elif item.action is Action.UNDO and before:
                now = before.pop()
        elif not item.id.startswith(of):
            continue
        elif item.kind == "detection":
            now = _Alarms(unrepaired=(*now.unrepaired, item), open=item)
        else:
            is_gone = item.content["repaired"] or not item.content["components"]
            now = _Alarms(unrepaired=now.unrepaired[:-1] if is_gone else now.unrepaired)
    return now


def _detection_of(record: NamedRecord) -> Detection:
    """Give the alarm of a record, without what else raised it."""
    told: Mapping[str, Any] = record.content
    return Detection(
        time=record.time, sample=record.sample, change_time=told["change_time"], signals=tuple(told["signals"])
    )


def _unseen_sentence(store: LogStore, alarm: NamedRecord, wanted: Excerpt) -> str:
    """Say of an alarm that the rows which are kept do not show what was found live."""
    found = next(store.records(alarm.asset, kinds=("diagnosis",), begin=alarm.time, end=wanted.end, newest=1), None)
    named = ", ".join(_words(found.content)) if found is not None else ""
    live = f", and what was found live was {named}" if named else ""
    return (
        f"The alarm of {clock_text(alarm.time)} stood open when this period began{live}. "
        "The rows that are kept do not show it any more."
    )


def _decide(run: PlantRun, deed: Deed) -> None:
    """Decide as a person did."""
    course = run.course
    diagnosis = course.diagnosis
    if diagnosis is None or not diagnosis.candidates:
        return
    chosen = chosen_hypothesis(run.watcher, diagnosis, deed.target)
    if deed.action is Action.REJECT:
        course.reject(chosen)
    else:
        course.accept(chosen, repaired=deed.action is Action.REPAIRED)


def _assets(store: LogStore, name: str | None) -> list[str]:
    """Give the names of the assets that are meant, one at least."""
    known = list(dict.fromkeys(item.asset for item in store.enrolments()))
    if not known:
        raise FaultbondError("The store has no asset yet; `faultbond serve` begins one.")
    if name is None:
        return known
    if name not in known:
        raise FaultbondError(f"{name}: the store has no such asset; it has {', '.join(known)}.")
    return [name]


def _in_force(store: LogStore, asset: str, wanted: Excerpt) -> Enrolment:
    """Give the model with rows in a period, of several that which was enrolled last."""
    for enrolment in reversed([*store.enrolments(asset)]):
        log = store.log_between(asset, wanted.begin, wanted.end, enrolment.model_sha256)
        if any(isinstance(item, RowBlock) for item in log):
            return enrolment
    begin = "the beginning" if wanted.begin is None else clock_text(wanted.begin)
    end = "now" if wanted.end is None else clock_text(wanted.end)
    kept = next((item for item in store.log_between(asset) if isinstance(item, RowBlock)), None)
    there = f"; what is kept begins at {clock_text(float(np.nanmin(kept.time)))}" if kept is not None else ""
    raise RecordingError(f"{asset}: there is no row from {begin} to {end}{there}.")


def _in_unit(values: FloatArray, unit: Unit) -> FloatArray:
    """Give SI values (n,) in a unit so that they become the same again, to the last bit where a number does so."""
    found = np.asarray((values - unit.offset) / unit.factor)
    for direction in (-inf, inf):
        other = np.nextafter(found, direction)
        better = (unit.factor * found + unit.offset != values) & (unit.factor * other + unit.offset == values)
        found = np.where(better, other, found)
    for digits in SHORT:
        short = np.array([float(f"{value:.{digits}g}") for value in found.tolist()])
        found = np.where(unit.factor * short + unit.offset == values, short, found)
    return found


def _write_columns(path: Path, columns: Mapping[str, FloatArray]) -> None:
    """Write a recording."""
    if path.suffix.lower() not in PARQUET:
        write_recording(path, columns, digits=None)
        return
    try:
        import pyarrow  # noqa: PLC0415 - optional
        import pyarrow.parquet  # noqa: PLC0415 - optional
    except ImportError as error:
        advice = "Install it with: pip install 'faultbond[parquet]', or write a .csv"
        raise RecordingError(f"{path}: writing Parquet needs pyarrow. {advice}") from error
    table = pyarrow.table({name: pyarrow.array(values, from_pandas=True) for name, values in columns.items()})
    with replaced(path) as stream:
        pyarrow.parquet.write_table(table, stream)


def _content_text(content: Record) -> str:
    """Give what a record says in a few words."""
    return "".join(f", {text}" for text in _words(content))


def _words(content: Mapping[str, Any]) -> Iterator[str]:
    if content.get("signals"):
        yield f"by {' '.join(content['signals'])}"
    if content.get("change_time") is not None:
        yield f"begun about {clock_text(content['change_time'])}"
    for candidate in [item for item in content.get("candidates", ()) if item.get("group")]:
        yield f"{_suspects(candidate)} {probability_text(candidate['probability'])} %"
    if content.get("by"):
        yield f"{_suspects(content)}, by {content['by']}"


def _suspects(told: Mapping[str, Any]) -> str:
    """Give the suspects of a candidate or decision."""
    return " ".join(told.get("parameters") or told.get("components") or ("nothing",))
