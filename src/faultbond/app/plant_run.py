"""`run` on a plant in time: every sample passes the monitor."""

import sys
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict, replace
from pathlib import Path

from faultbond.app.course import Course, Following
from faultbond.app.kept_run import Keeper, read_before, stamp_of
from faultbond.app.method_face import Watcher
from faultbond.app.methods import build_method, prepared_bank
from faultbond.app.plant import WatchedPlant
from faultbond.app.rows import begun, no_time, portions, progress
from faultbond.app.signals import Stopping
from faultbond.app.wishes import Wanted
from faultbond.contract.json_records import run_record
from faultbond.contract.spec import EngineSpec
from faultbond.errors import GenerationError, RecordingError
from faultbond.io.files import STANDARD_INPUT, replaced_text
from faultbond.io.grid import Grid, GridPoint, PointBlock, RowBlock, blocks_of_points
from faultbond.io.out import Out
from faultbond.io.recording import Columns, read_blocks
from faultbond.io.saved import Saved
from faultbond.runtime.trace import Trace
from faultbond.types import Method, Verdict


def run_plant(plant: WatchedPlant, recording: str, *, wanted: Wanted, out: Out) -> Verdict:
    """Watch a recording of a plant in time, and give the verdict.

    Raises
    ------
    RecordingError
        Where the recording cannot be read, or has no row with a time, or none later than the end of the saved run.
    """
    stamp = stamp_of(wanted.state)
    before = read_before(wanted.state, plant.graph, wanted.method) if wanted.state is not None else None
    live = recording == STANDARD_INPUT
    blocks = read_blocks(recording, _columns(plant, before))
    if not live:
        blocks = begun(blocks, recording)  # a wrong file is refused before the engine is built
    with progress(recording, out) as follow:
        watcher = _watcher(plant, wanted, before)
        grid = Grid(
            watcher.spec.sample_time,
            live=live,
            noise=[item.noise for item in watcher.spec.outputs],
            clock=before.clock if before else None,
            row_time=watcher.spec.row_time,
            held=[not item.linear for item in watcher.spec.inputs],
        )
        curves = wanted.report is not None
        trace = Trace(watcher.spec, curves=curves, lag=watcher.lag) if curves or out.text is not None else None
        course = Course(watcher, grid, Following(out=out, trace=trace, level=wanted.accept), before)
        records = before.records if before else None
        if before is not None:
            out.go_on(records)
        out.record(_run_record(watcher.spec, wanted.method, before))
        keeper = Keeper(wanted.state, course, wanted.method, out, records, stamp) if wanted.state else None
        _pass(course, follow(portions(blocks)), grid, keeper, out, live=live)
    if not course.counts.samples:
        passed = course.counts.duplicate and before
        raise RecordingError(_nothing_new(recording, passed) if passed else no_time(recording))
    _conclude(plant, watcher, course, trace, wanted, out)
    return course.verdict


def _watcher(plant: WatchedPlant, wanted: Wanted, before: Saved | None) -> Watcher:
    """Give the method, from what the cache knows of the plant where it can be loaded."""
    numbers = before.numbers if before is not None else None
    if plant.prepared is not None:
        with suppress(GenerationError):
            return prepared_bank(plant.prepared, numbers)
    return build_method(plant.graph, wanted.method, numbers, plant.identity)


def _columns(plant: WatchedPlant, before: Saved | None) -> Columns:
    """Give the columns to read; without a time column the clock goes on from the run before."""
    columns = plant.columns
    if before is None:
        return columns
    return replace(columns, first_time=before.clock.last_time + (columns.sample_time or 1.0))


def _run_record(spec: EngineSpec, method: Method, before: Saved | None) -> dict[str, object]:
    return run_record(
        model=spec.model,
        model_sha256=spec.model_sha256,
        method=method,
        version=spec.version,
        sample_time=spec.sample_time,
        explain_anything=[[spec.parameters[k].name for k in chosen] for chosen in spec.explain_anything],
        continues=before.clock.last_time if before is not None else None,
    )


def _nothing_new(recording: str, before: Saved) -> str:
    return (
        f"{recording}: no row is later than {before.clock.last_time:.15g} s, where the saved run ended. "
        "Give a recording that goes on from there, or another state file."
    )


def _pass(
    course: Course, blocks: Iterable[RowBlock], grid: Grid, keeper: Keeper | None, out: Out, *, live: bool
) -> None:
    """Pass all rows through the method and write the records as they come; to be stopped is an end like another."""
    with Stopping() as stopping:
        try:
            for rows in stopping.between(blocks):
                if live and keeper is not None:
                    _take_kept(course, rows, grid, keeper, out)
                else:
                    _take(course, grid.push_block(rows), out)
        except KeyboardInterrupt:
            out.settle()
            _end(course, grid, keeper, out, live=live)
            raise
        _end(course, grid, keeper, out, live=live)


def _end(course: Course, grid: Grid, keeper: Keeper | None, out: Out, *, live: bool) -> None:
    """Pass what was held back, write the last records, and keep the run."""
    _take(course, blocks_of_points(grid.finish()), out)
    if not course.counts.samples and not live:
        return
    if live and keeper is not None:
        keeper.look()  # what a person decided since the last row
    course.finish()
    if keeper is not None:
        keeper.write(last=True)


def _take(course: Course, blocks: Iterable[PointBlock], out: Out) -> None:
    for points in blocks:
        out.settle()  # now that there is something to watch
        course.take(points)


def _take_kept(course: Course, rows: RowBlock, grid: Grid, keeper: Keeper, out: Out) -> None:
    """Take rows of a live run that is kept; once there is an alarm, a person may decide between any two of them."""
    first = 0
    while first < len(rows):
        if course.found.open is None:
            first += _take_to_alarm(course, rows.part(slice(first, None)), grid, out)
        else:
            _take(course, grid.push_block(rows.part(slice(first, first + 1))), out)
            first += 1
        keeper.look()


def _take_to_alarm(course: Course, rows: RowBlock, grid: Grid, out: Out) -> int:
    """Take rows up to one with which there is an alarm, all its points among them; give how many rows that are."""
    before, n_points = grid.copy(), 0
    for points in grid.push_block(rows):
        out.settle()
        n_points += course.take(points, to_alarm=True)
        if course.found.open is not None:
            break
    else:
        return len(rows)
    grid.go_back(before)  # what is kept of the run, its clock among it, is of one moment
    n_rows, rest = 0, list[GridPoint]()
    while n_points > 0:
        again = list(grid.push(rows.row(n_rows)))
        n_rows, n_points, rest = n_rows + 1, n_points - len(again), again[n_points:]
    _take(course, blocks_of_points(rest), out)
    return n_rows


def _conclude(
    plant: WatchedPlant, watcher: Watcher, course: Course, trace: Trace | None, wanted: Wanted, out: Out
) -> None:
    """Say what was found, and on standard error that nothing can be said, where the text does not."""
    reason = course.no_verdict()
    if reason and not (out.text is not None and out.text.isatty()):
        sys.stderr.write(f"faultbond: no verdict: {reason}.\n")
    if trace is not None:
        _tell(plant, watcher, course, trace, wanted.report, out)


def _tell(plant: WatchedPlant, watcher: Watcher, course: Course, trace: Trace, report: Path | None, out: Out) -> None:
    """Print the result, and write the report where one is asked for."""
    from rich.console import Console  # noqa: PLC0415 - slow to load

    from faultbond import report as pages  # noqa: PLC0415 - loads rich and jinja2

    graph = plant.graph
    more = {"wild": course.wild, "outside": course.outside, "sensors_outside": course.sensors_outside}
    counts = pages.RunCounts(**asdict(course.counts), **more, no_verdict=course.no_verdict())
    history, title = trace.history(), watcher.title
    if out.text is not None:
        console = Console(file=out.text)
        untested = pages.unfalsifiable_text(watcher.spec)
        try:
            pages.print_diagnosis(console, graph, history, engine_title=title, counts=counts, untested=untested)
        except BrokenPipeError:
            raise
        except OSError as error:  # the exit code and the report still come
            out.lose_text(error)
    if report is not None:
        from faultbond.equations.causality import assign_causality  # noqa: PLC0415

        strokes = dict(assign_causality(graph).strokes)
        page = pages.render_report(graph, history, strokes, title, watcher.spec.version, counts)
        try:
            with replaced_text(report) as stream:
                stream.write(page)
        except OSError as error:  # the verdict stands all the same
            out.warn(f"{report}: the report cannot be written: {error.strerror or error}.")
            return
        out.say(f"Report: {report}")
