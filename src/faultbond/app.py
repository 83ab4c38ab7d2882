"""What each verb does, by composing the layers below. Large libraries are loaded when a verb needs them."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np

from faultbond.errors import FaultbondError, GenerationError, RecordingError
from faultbond.io.faults import FaultRequest
from faultbond.io.grid import Counts, Grid, GridPoint, Row, on_grid
from faultbond.io.out import Out
from faultbond.io.recording import STANDARD_INPUT, columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.monitor import Sample, State, Status, finish, init, step
from faultbond.runtime.records import detection_record, diagnosis_record, end_record, run_record
from faultbond.runtime.trace import Trace
from faultbond.spec import Engine, EngineSpec
from faultbond.types import EngineChoice, Method

NO_COMPILER = (
    "The engine `c` cannot be built: there is no C compiler that works. "
    "Install gcc or clang, or `pip install 'faultbond[compiler]'`, or take the engine `vm`."
)

Follow = Callable[[Iterable[Row]], Iterable[Row]]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Outcome:
    """How a run ended: the state at its end, and what was counted on the way."""

    state: State
    counts: Counts
    watched: int  # grid points with a measured value at which the alarms were on


def check(model: Path, *, engine: EngineChoice, out: Out) -> None:
    """Tell what was understood of a model."""
    graph = load_model(model)
    title = _engine_title(engine)
    from faultbond.report.understanding import Understanding, check_record  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.engine import build_model  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.specify import build_spec  # noqa: PLC0415 - loads casadi

    step_model = build_model(graph)
    seen = Understanding(graph=graph, model=step_model, spec=build_spec(step_model), engine=title)
    out.record(check_record(seen))
    if out.text is not None:
        from rich.console import Console  # noqa: PLC0415 - slow to load

        from faultbond.report.listing import print_check  # noqa: PLC0415 - loads rich

        print_check(Console(file=out.text), seen)


def simulate(
    model: Path, *, inputs: str, faults: tuple[FaultRequest, ...], seed: int | None, output: Path, out: Out
) -> None:
    """Write a recording of the simulated plant; `inputs` is a path or `-`."""
    raise FaultbondError("`simulate` is not built yet.")


def run(model: Path, recording: str, *, method: Method, report: Path | None, engine: EngineChoice, out: Out) -> bool:
    """Watch a recording, a path or `-`, and tell whether a fault was detected."""
    graph = load_model(model)
    live = recording == STANDARD_INPUT
    rows: Iterable[Row] = read_rows(recording, columns_of(graph))
    if not live:
        rows = _begun(iter(rows))  # a wrong file is refused before the engine is built
    with _progress(recording, out) as follow:
        spec, built = _build(graph, engine)
        trace = Trace(spec, curves=report is not None) if report is not None or out.text is not None else None
        out.record(run_record(spec, method))
        outcome = _watch(spec, built, follow(rows), Grid(spec.sample_time, live=live), trace, out)
    if not outcome.counts.samples:
        raise RecordingError(f"{recording}: no row has a time that can be read. Check the column and unit of `time`.")
    detected = outcome.state.alarm >= 0
    reason = _no_verdict(spec, outcome)
    if reason:
        sys.stderr.write(f"faultbond: no verdict: {reason}.\n")
    if trace is not None:
        _tell(graph, spec, built, trace, outcome, reason, report, out)
    return detected


def demo(*, report: Path, engine: EngineChoice, out: Out) -> None:
    """Find a fault in the built-in water tank and write the report."""
    raise FaultbondError("`demo` is not built yet.")


def _begun(rows: Iterator[Row]) -> Iterator[Row]:
    """Read the first row now."""
    return chain([next(rows)], rows)


def _build(graph: BondGraph, choice: EngineChoice) -> tuple[EngineSpec, Engine]:
    """Build the engine that was chosen."""
    from faultbond.synthesis.engine import build_engine  # noqa: PLC0415 - loads casadi

    spec, engine = build_engine(graph, compiled=choice is not EngineChoice.MACHINE)
    if choice is EngineChoice.COMPILED and not hasattr(engine, "compiler"):
        raise GenerationError(NO_COMPILER)
    return spec, engine


def _engine_title(choice: EngineChoice) -> str:
    """Say which engine would be taken, without building it."""
    from faultbond.synthesis.compile import cache_folder, find_compiler  # noqa: PLC0415 - only for `check`

    compiler = None if choice is EngineChoice.MACHINE else find_compiler()
    if compiler is not None:
        return f"compiled C ({compiler[0]}), built at the first run and kept in {cache_folder()}"
    if choice is EngineChoice.COMPILED:
        raise GenerationError(NO_COMPILER)
    return "CasADi virtual machine (no C compiler used)"


def _progress(recording: str, out: Out) -> AbstractContextManager[Follow]:
    """Give a progress bar for a file where somebody sees it."""
    mixed = out.json is not None and out.json.isatty()
    if recording == STANDARD_INPUT or mixed or not sys.stderr.isatty():
        return nullcontext(iter)
    from faultbond.report.progress import progress_bar  # noqa: PLC0415 - loads rich

    return progress_bar(_count_lines(Path(recording)))


def _count_lines(path: Path) -> int | None:
    """Give the number of rows of a CSV file, about; None of another."""
    if path.suffix.lower() in (".parquet", ".pq"):
        return None
    with path.open("rb") as stream:
        return sum(block.count(b"\n") for block in iter(lambda: stream.read(2**20), b"")) - 1


def _watch(
    spec: EngineSpec, engine: Engine, rows: Iterable[Row], grid: Grid, trace: Trace | None, out: Out
) -> _Outcome:
    """Pass all rows through the monitor and write the records as they come."""
    state = init(spec)
    watched, told = 0, -1
    for point in on_grid(rows, grid):
        sample = _sample(point)
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


def _sample(point: GridPoint) -> Sample:
    return Sample(time=point.time, dt=point.dt, u=point.u, y=point.y)


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
        pages.print_diagnosis(console, graph, history, engine_title=engine.title, counts=counts)
    if report is not None:
        strokes = dict(assign_causality(graph).strokes)
        page = pages.render_report(graph, history, strokes, engine.title, spec.version, counts)
        report.write_text(page, encoding="utf-8")
        out.say(f"Report: {report}")
