"""What each verb does, by composing the layers below. Large libraries are loaded when a verb needs them."""

import secrets
import shutil
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path

import numpy as np

from faultbond.errors import GenerationError, RecordingError
from faultbond.io.examples import example
from faultbond.io.faults import FaultRequest
from faultbond.io.grid import Counts, Grid, GridPoint, Row, on_grid
from faultbond.io.out import Out
from faultbond.io.recording import STANDARD_INPUT, columns_of, read_rows, write_recording
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.monitor import START_SAMPLES, Sample, State, Status, finish, init, step
from faultbond.runtime.records import detection_record, diagnosis_record, end_record, run_record
from faultbond.runtime.start import solve_start
from faultbond.runtime.trace import Trace
from faultbond.spec import Engine, EngineSpec
from faultbond.types import EngineChoice, Method

DEMO_RECORDING = "fault_pipe.csv"
DEMO_TRUTH = "What was made: at 1500 s the resistance K1 of the pipe rose to 1.85 times its value."
NO_COMPILER = (
    "The engine `c` cannot be built: there is no C compiler that works. "
    "Install gcc or clang, or `pip install 'faultbond[compiler]'`, or take the engine `vm`."
)

Follow = Callable[[Iterable[Row]], Iterable[Row]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Imperfections:
    """What a simulated plant has and its model leaves out.

    spread: healthy parameters differ from nominal by up to this part. lag: s, of inputs with a declared settling.
    curve: largest error, as a part, of the curve of an input in percent.
    """

    spread: float = 0.0
    lag: float = 0.0
    curve: float = 0.0


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
    model: Path,
    *,
    inputs: str,
    faults: tuple[FaultRequest, ...],
    seed: int | None,
    imperfections: Imperfections,
    start: Mapping[str, float],
    output: Path,
    out: Out,
) -> None:
    """Write a recording of the simulated plant; `inputs` is a path or `-`, `start` gives SI values by state."""
    graph = load_model(model)
    points, held = _inputs(graph, inputs)
    begin = {**_solved_start(graph, inputs), **start}
    from faultbond import simulate as plant  # noqa: PLC0415 - loads casadi and scipy

    seed = secrets.randbelow(2**31) if seed is None else seed
    simulation = plant.simulate(
        graph,
        plant.Inputs(time=np.array([point.time for point in points]), values=np.array([point.u for point in points])),
        [plant.fault_in_si(fault, graph) for fault in faults],
        seed=seed,
        effects=plant.Effects(spread=imperfections.spread, lag=imperfections.lag, curve=imperfections.curve),
        start=begin,
    )
    write_recording(output, plant.columns(graph, simulation, digits=9))
    rows = len(simulation.time)
    out.record(
        {"record": "simulate", "model": graph.name, "output": str(output), "samples": rows, "seed": seed}
        | {"held": held, "start": begin}
    )
    out.say(f"{output}: {rows} rows, {simulation.time[0]:.9g} s to {simulation.time[-1]:.9g} s; seed {seed}")
    for name, value in begin.items():
        source = "as given" if name in start else f"solved from the first rows of {inputs}"
        out.say(f"start of {name}: {value:.6g} (SI), {source}")
    if held:
        out.say(f"{held} samples lacked an input: its last value was held")


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
        raise RecordingError(_no_time(recording))
    detected = outcome.state.alarm >= 0
    reason = _no_verdict(spec, outcome)
    if reason and not (out.text is not None and out.text.isatty()):  # there the text says it
        sys.stderr.write(f"faultbond: no verdict: {reason}.\n")
    if trace is not None:
        _tell(graph, spec, built, trace, outcome, reason, report, out)
    return detected


def demo(*, report: Path, engine: EngineChoice, out: Out) -> None:
    """Find a fault in the built-in water tank and write the report."""
    folder = example("tank")
    model, recording = (_near(folder / name) for name in ("model.yaml", DEMO_RECORDING))
    out.say(f"The built-in water tank: {recording}, 82 minutes, in which a fault was made at 1500 s.")
    out.say(f"Engine: {_engine_title(engine)}.")
    out.say()
    if out.text is not None:
        out.text.flush()
    run(model, str(recording), method=Method.BANK, report=report, engine=engine, out=out)
    out.say(f"\n{DEMO_TRUTH}")
    out.say(f"Open {report} in a browser. Then try:")
    program, healthy = _program(), _near(folder / "healthy.csv")
    out.say(f"  {program} check {model}")
    out.say(f"  {program} run {model} {healthy}")
    out.say(f"  {program} simulate {model} --inputs {healthy} --fault K6=x8@2460 --seed 1 -o leak.csv")
    out.say(f"  {program} run {model} leak.csv --report leak.html")


def _program() -> str:
    """Give how this program is called from here."""
    if shutil.which("faultbond"):
        return "faultbond"
    called = Path(sys.argv[0])
    if called.name == "__main__.py":
        return "python -m faultbond"
    return str(_near(called)) if called.name.startswith("faultbond") else "faultbond"


def _near(path: Path) -> Path:
    """Give a path as short as it can be written from here."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _inputs(graph: BondGraph, recording: str) -> tuple[list[GridPoint], int]:
    """Give the inputs of a recording on the grid, with absent values held, and at how many points one was absent."""
    points: list[GridPoint] = []
    held = 0
    last = np.full(len(graph.inputs), np.nan)
    rows = read_rows(recording, columns_of(graph, sensors=False))
    for point in on_grid(rows, Grid(graph.sample_time)):
        absent = ~np.isfinite(point.u)
        held += bool(absent.any())
        last = np.where(absent, last, point.u)
        points.append(replace(point, u=last))
    if not points:
        raise RecordingError(_no_time(recording))
    return points, held


def _solved_start(graph: BondGraph, recording: str) -> dict[str, float]:
    """Give the start of the states that the model leaves open, if the recording shows what the sensors saw."""
    known = {item.name for item in graph.components if item.start is not None}
    try:
        rows = read_rows(recording, columns_of(graph)) if recording != STANDARD_INPUT else iter(())
        points = list(islice(on_grid(rows, Grid(graph.sample_time)), START_SAMPLES - 1))
    except RecordingError:  # no sensors in it
        return {}
    from faultbond.synthesis.engine import build_engine, build_model  # noqa: PLC0415 - loads casadi

    model = build_model(graph)
    stores = model.plant.network.states
    if not points or all(store.component in known for store in stores):
        return {}
    spec, engine = build_engine(graph, compiled=False)
    state = init(spec)
    for point in points:
        state, _ = step(spec, engine, state, _sample(point))
    mean, _ = solve_start(spec, engine, state.trail_samples[max(state.begun, 0) : state.index])
    contents = model.contents(mean, [item.nominal for item in graph.parameters]).full()[:, 0]
    return {
        store.name: float(content)
        for store, content in zip(stores, contents, strict=True)
        if store.component not in known
    }


def _no_time(recording: str) -> str:
    return f"{recording}: no row has a time that can be read. Check the column and unit of `time`."


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
