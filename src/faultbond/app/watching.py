"""`run`: every sample of a plant passes the monitor."""

import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.app.engines import build_watcher
from faultbond.app.observing import run_circuit, run_static
from faultbond.app.rows import begun, no_time, progress, sample_of
from faultbond.errors import RecordingError
from faultbond.io.circuits import is_circuit
from faultbond.io.grid import Counts, Grid, Row, on_grid
from faultbond.io.out import Out
from faultbond.io.recording import STANDARD_INPUT, columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.monitor import finish, step
from faultbond.runtime.records import detection_record, diagnosis_record, end_record, run_record
from faultbond.runtime.state import State, Status, init
from faultbond.runtime.trace import Trace
from faultbond.spec import Engine, EngineSpec
from faultbond.types import EngineChoice, Method, TimeGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """How a run ended: the state at its end, and what was counted on the way."""

    state: State
    counts: Counts
    watched: int  # grid points with a measured value at which the alarms were on


def run(model: Path, recording: str, *, method: Method, report: Path | None, engine: EngineChoice, out: Out) -> bool:
    """Watch a recording, a path or `-`, and tell whether a fault was detected."""
    if is_circuit(model):
        return run_circuit(model, recording, method=method, report=report, out=out)
    graph = load_model(model)
    if graph.grid is TimeGrid.NONE:
        return run_static(graph, recording, method=method, report=report, out=out)
    live = recording == STANDARD_INPUT
    rows: Iterable[Row] = read_rows(recording, columns_of(graph))
    if not live:
        rows = begun(iter(rows))  # a wrong file is refused before the engine is built
    with progress(recording, out) as follow:
        spec, built = build_watcher(graph, engine)
        trace = Trace(spec, curves=report is not None) if report is not None or out.text is not None else None
        out.record(
            run_record(
                model=spec.model,
                model_sha256=spec.model_sha256,
                method=method,
                version=spec.version,
                sample_time=spec.sample_time,
                explain_anything=[[spec.parameters[k].name for k in chosen] for chosen in spec.explain_anything],
            )
        )
        grid = Grid(spec.sample_time, live=live, noise=[item.noise for item in graph.sensors])
        outcome = _watch(spec, built, follow(rows), grid, trace, out)
    if not outcome.counts.samples:
        raise RecordingError(no_time(recording))
    detected = outcome.state.alarm >= 0
    reason = _no_verdict(spec, outcome)
    if reason and not (out.text is not None and out.text.isatty()):  # there the text says it
        sys.stderr.write(f"faultbond: no verdict: {reason}.\n")
    if trace is not None:
        _tell(graph, spec, built, trace, outcome, reason, report, out)
    return detected


def _watch(
    spec: EngineSpec, engine: Engine, rows: Iterable[Row], grid: Grid, trace: Trace | None, out: Out
) -> _Outcome:
    """Pass all rows through the monitor and write the records as they come."""
    state = init(spec)
    watched, told = 0, -1
    for point in on_grid(rows, grid):
        sample = sample_of(point)
        state, report = step(spec, engine, state, sample)
        watched += report.status in (Status.WATCHING, Status.DIAGNOSING) and bool(np.isfinite(sample.y).any())
        if trace is not None:
            trace.add(sample, report)
        if report.detection is not None:
            out.record(detection_record(report.detection))
        if report.diagnosis is not None:
            out.record(diagnosis_record(report.diagnosis))
            told = point.index
    last = finish(spec, state) if told != grid.counts.samples - 1 else None
    if last is not None:
        out.record(diagnosis_record(last))
        if trace is not None:
            trace.conclude(last)
    outcome = _Outcome(state=state, counts=grid.counts, watched=watched)
    out.record(_end(outcome))
    return outcome


def _end(outcome: _Outcome) -> dict[str, object]:
    counts = outcome.counts
    return end_record(
        time=outcome.state.time if counts.samples else None,
        samples=counts.samples,
        watched=outcome.watched,
        detections=int(outcome.state.alarm >= 0),
        missing=counts.missing,
        late=counts.late,
        duplicate=counts.duplicate,
        untimed=counts.untimed,
        unused=counts.unused,
        clock_jumps=counts.clock_jumps,
        saturated=counts.saturated,
        frozen=counts.frozen,
    )


def _no_verdict(spec: EngineSpec, outcome: _Outcome) -> str:
    """Say why a run says nothing about the plant; empty where it does."""
    if outcome.watched:
        return ""
    samples = outcome.counts.samples
    absent = [item.name for item, value in zip(spec.inputs, outcome.state.held, strict=True) if not np.isfinite(value)]
    if absent:
        return f"no row has a value of the input {absent[0]}"
    needed = spec.thresholds.warm_up_samples + 1
    if samples - max(outcome.state.begun, 0) < needed:
        return f"the recording ended after {samples} samples, and the alarms are off for the first {needed - 1}"
    return "no row has a value of a sensor once the alarms are on"


def _tell(
    graph: BondGraph,
    spec: EngineSpec,
    engine: Engine,
    trace: Trace,
    outcome: _Outcome,
    reason: str,
    report: Path | None,
    out: Out,
) -> None:
    """Print the result, and write the report where one is asked for."""
    from rich.console import Console  # noqa: PLC0415 - slow to load

    from faultbond import report as pages  # noqa: PLC0415 - loads rich and jinja2
    from faultbond.structure.causality import assign_causality  # noqa: PLC0415

    counted = outcome.counts
    counts = pages.Counts(
        samples=counted.samples,
        missing=counted.missing,
        late=counted.late,
        duplicate=counted.duplicate,
        no_verdict=reason,
    )
    history = trace.history()
    if out.text is not None:
        console = Console(file=out.text)
        untested = pages.unfalsifiable_text(spec)
        pages.print_diagnosis(console, graph, history, engine_title=engine.title, counts=counts, untested=untested)
    if report is not None:
        strokes = dict(assign_causality(graph).strokes)
        page = pages.render_report(graph, history, strokes, engine.title, spec.version, counts)
        report.write_text(page, encoding="utf-8")
        out.say(f"Report: {report}")
