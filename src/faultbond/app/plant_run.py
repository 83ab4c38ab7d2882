"""`run` on a plant in time: every sample passes the monitor."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, TextIO

from faultbond.app.course import Course, Finding, Following
from faultbond.app.kept_run import Keeper, read_before, stamp_of
from faultbond.app.method_face import Watcher
from faultbond.app.methods import BankWatcher, build_method, prepared_bank
from faultbond.app.plant import WatchedPlant
from faultbond.app.rows import begun, called, naming, no_time, pace_of, portions, progress, sample_of, texts_of
from faultbond.app.signals import Stopping
from faultbond.app.wishes import Wanted
from faultbond.contract.findings import History
from faultbond.contract.json_records import run_record
from faultbond.contract.silence import Silent, seconds
from faultbond.contract.spec import EngineSpec
from faultbond.errors import GenerationError, RecordingError
from faultbond.io.files import STANDARD_INPUT, replaced_text
from faultbond.io.grid import Grid, GridClock, GridPoint, PointBlock, RowBlock, blocks_of_points
from faultbond.io.memory_table import MemoryTable, Recording
from faultbond.io.out import Out
from faultbond.io.recording import Columns, read_blocks
from faultbond.io.saved import Saved
from faultbond.runtime.trace import Trace
from faultbond.types import Method, Verdict


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlantRun:
    """A run on a plant in time that is over.

    trace: what it saw, None where nobody asked for it. hints: sentences on what else an alarm may come from. remarks:
    on what the verdict does not cover. texts: what the recording has where numbers belong, in words. stopped: what
    ended it before the end of its rows.
    """

    plant: WatchedPlant
    watcher: Watcher
    course: Course
    trace: Trace | None
    hints: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    texts: tuple[str, ...] = ()
    stopped: KeyboardInterrupt | None = None

    @property
    def verdict(self) -> Verdict:
        """What it says of the plant."""
        return self.course.verdict

    @property
    def no_verdict(self) -> str:
        """Why it says nothing; empty where it does."""
        return self.course.no_verdict()

    @property
    def silent(self) -> tuple[Silent, ...]:
        """Sensors, then inputs, that gave no value, hardly any, or none for long; none where nothing was judged."""
        return () if self.no_verdict else self.course.silent

    def tell(self, report: Path | None, out: Out) -> None:
        """Say what was found, and on standard error what was not watched, where the text is not seen."""
        if not (out.text is not None and out.text.isatty()):
            for told in self.texts:
                sys.stderr.write(f"faultbond: {told}.\n")
            for item in self.silent:
                sys.stderr.write(f"faultbond: {item.sentence(seconds)}.\n")
            for told in (*self.hints, *self.remarks):
                sys.stderr.write(f"faultbond: {told}\n")
            if self.no_verdict:
                sys.stderr.write(f"faultbond: no verdict: {self.no_verdict}.\n")
        if self.trace is None:
            return
        if out.text is not None:
            try:
                self.show(out.text)
            except BrokenPipeError:
                raise
            except OSError as error:  # the exit code and the report still come
                out.lose_text(error)
        if report is not None:
            page = self.page()
            try:
                with replaced_text(report) as stream:
                    stream.write(page)
            except OSError as error:  # the verdict stands all the same
                out.warn(f"{report}: the report cannot be written: {error.strerror or error}.")
                return
            out.say(f"Report: {report}")

    def show(self, stream: TextIO) -> None:
        """Print what was found."""
        from rich.console import Console  # noqa: PLC0415 - slow to load

        from faultbond import report as pages  # noqa: PLC0415 - loads rich and jinja2

        untested, counts = pages.unfalsifiable_text(self.watcher.spec), self.counts()
        history, title = self._history(), self.watcher.title
        console = Console(file=stream)
        pages.print_diagnosis(console, self.plant.graph, history, engine_title=title, counts=counts, untested=untested)

    def page(self) -> str:
        """Give the report, a page of HTML."""
        from faultbond import report as pages  # noqa: PLC0415 - loads rich and jinja2
        from faultbond.equations.causality import assign_causality  # noqa: PLC0415

        graph, spec = self.plant.graph, self.watcher.spec
        strokes = dict(assign_causality(graph).strokes)
        return pages.render_report(graph, self._history(), strokes, self.watcher.title, spec.version, self.counts())

    def _history(self) -> History:
        if self.trace is None:
            raise ValueError("nobody asked for what the run saw")
        return self.trace.history()

    def counts(self) -> Any:
        """Give what `faultbond.report` says of the rows."""
        from faultbond.report import RunCounts  # noqa: PLC0415 - not all need it

        course = self.course
        more = {"wild": course.wild, "outside": course.outside, "sensors_outside": course.sensors_outside}
        return RunCounts(
            **asdict(course.counts),
            **more,
            no_verdict=self.no_verdict,
            disorder=course.disorder if self.verdict is Verdict.NONE else "",
            silent=self.silent,
            texts=self.texts,
            hints=self.hints,
            remarks=self.remarks,
        )


def watch_plant(
    plant: WatchedPlant, recording: Recording, *, wanted: Wanted, out: Out, curves: bool = True
) -> PlantRun:
    """Watch a recording of a plant in time, and write the records as they come; see `any_run.watch_any`.

    Raises
    ------
    RecordingError
        Where the recording cannot be read, or has no row with a time, or none later than the end of the saved run.
    """
    stamp = stamp_of(wanted.state)
    before = read_before(wanted.state, plant.graph, wanted.method) if wanted.state is not None else None
    live = str(recording) == STANDARD_INPUT
    texts = texts_of(recording)
    blocks = read_blocks(recording, columns_after(plant, before), texts)
    if not live:
        blocks = begun(blocks, recording)  # a wrong file is refused before the engine is built
    with progress(recording, out) as follow:
        begun_run = begin(plant, wanted, before, out=out, live=live, curves=curves)
        run, grid = begun_run.run, begun_run.grid
        course, records = run.course, before.records if before else None
        if before is not None:
            out.go_on(records)
        out.record(_run_record(run.watcher.spec, wanted.method, before))
        keeper = Keeper(wanted.state, course, wanted.method, out, records, stamp) if wanted.state else None
        with naming(recording):
            stopped = _pass(course, follow(portions(blocks)), grid, keeper, out, live=live)
    if not course.counts.samples:
        if stopped is not None:
            raise stopped
        passed = course.counts.duplicate and before
        raise RecordingError(_nothing_new(recording, passed) if passed else no_time(recording, texts))
    paced = () if live or before is not None else pace_of(grid, run.watcher.spec.sample_time)
    remarks = () if live else _slowness(course.pace, run.watcher.spec.sample_time)
    run = replace(run, texts=(*texts.sentences(), *paced), remarks=remarks, stopped=stopped)
    if live or before is not None or stopped is not None:
        return run
    if not isinstance(recording, MemoryTable) and not Path(recording).is_file():
        return run  # what can be read once only
    return _looked_at_again(plant, recording, _with_reservations(plant, recording, run))


def _with_reservations(plant: WatchedPlant, recording: Recording, run: PlantRun) -> PlantRun:
    """Give a run that says which sensors stood still for long, and where nothing was found, which faults would hide."""
    told = [_standstills(plant, recording, run)]
    if run.verdict is Verdict.HEALTHY and any(item.healthy_change for item in run.watcher.spec.parameters):
        from faultbond.report.shortcomings import unclaimed_sentence  # noqa: PLC0415 - hardly ever

        told.append(unclaimed_sentence(run.watcher.spec))
    return replace(run, remarks=(*filter(None, told), *run.remarks))


def _standstills(plant: WatchedPlant, recording: Recording, run: PlantRun) -> str:
    """Say which sensors stood still for long; empty where none did."""
    if not run.course.counts.frozen or run.no_verdict:
        return ""

    from faultbond.app.standstill import standing_still, standstill_sentence  # noqa: PLC0415 - hardly ever

    with suppress(RecordingError):  # it was read before: what has become of it since is no matter of this run
        return standstill_sentence(standing_still(plant.graph, _points_again(plant, recording, run)))
    return ""


def _points_again(plant: WatchedPlant, recording: Recording, run: PlantRun) -> Iterator[PointBlock]:
    """Give the grid points of a recording that was watched."""
    return _points(read_blocks(recording, plant.columns), new_grid(run.watcher.spec, live=False))


def _looked_at_again(plant: WatchedPlant, recording: Recording, run: PlantRun) -> PlantRun:
    """Give a run with what else its alarm may come from: a sign, numbers for no value, other units, new operation."""
    watcher, alarm = run.watcher, run.course.found.open
    if not isinstance(watcher, BankWatcher) or alarm is None or run.verdict is not Verdict.FAULT:
        return run

    from faultbond.app.markers import marker_sentence, markers_in  # noqa: PLC0415 - after an alarm only
    from faultbond.app.stated_starts import SOUGHT, contradictions, start_sentence  # noqa: PLC0415 - after an alarm only
    from faultbond.app.unfamiliar import unfamiliar_sentence, unfamiliar_signals  # noqa: PLC0415 - after an alarm only
    from faultbond.app.unit_guess import guess_units, sentence_of  # noqa: PLC0415 - loads the units
    from faultbond.report.shortcomings import active_sentence, hidden_sentence  # noqa: PLC0415 - after an alarm only

    def points() -> Iterator[PointBlock]:
        return _points_again(plant, recording, run)

    with suppress(RecordingError):  # it was read before: what has become of it since is no matter of this run
        told = sentence_of(guess_units(iter(watcher.unnamed, None), points(), alarm))
        stood = unfamiliar_sentence(unfamiliar_signals(plant.graph, points(), alarm))
        marked = marker_sentence(markers_in(plant.graph, points()))
        hidden = hidden_sentence(watcher.spec)
        first = tuple(map(sample_of, islice((point for block in points() for point in block.points()), SOUGHT)))
        beginning = start_sentence(plant.graph, "The recording", contradictions(plant.graph, watcher.core, first))
        hints, remarks = (active_sentence(plant.graph), beginning, marked, told), (stood, hidden)
        return replace(run, hints=tuple(filter(None, hints)), remarks=(*filter(None, remarks), *run.remarks))
    return run


def _slowness(pace: float | None, step: float | None) -> tuple[str, ...]:
    """Say that samples of an alarm take longer, s, than the time between two; nothing where they do not."""
    if pace is None or step is None or pace <= step:
        return ()
    return (
        f"While there was an alarm a sample took {pace:.2g} s on this machine, and one comes every {step:.3g} s: "
        "beside the plant it would fall behind. `max_faults: 1`, `suspect: no` of what no fault is sought in, or a "
        "longer `sample_time` make it faster.",
    )


def _points(blocks: Iterable[RowBlock], grid: Grid) -> Iterator[PointBlock]:
    """Give the grid points of a recording."""
    for rows in blocks:
        yield from grid.push_block(rows)
    yield from blocks_of_points(grid.finish())


def new_grid(spec: EngineSpec, *, live: bool, clock: GridClock | None = None, same: bool = False) -> Grid:
    """Give the grid on which rows of a plant are put; see `Grid`."""
    return Grid(
        spec.sample_time,
        live=live,
        noise=[item.noise for item in spec.outputs],
        clock=clock,
        same=same,
        row_time=spec.row_time,
        held=[not item.linear for item in spec.inputs],
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BegunRun:
    """A run before its first row, and the grid that rows are put on."""

    run: PlantRun
    grid: Grid


def begin(
    plant: WatchedPlant,
    wanted: Wanted,
    before: Saved | None,
    *,
    out: Out,
    live: bool,
    curves: bool,
    hear: Callable[[Finding], None] | None = None,
) -> BegunRun:
    """Make a run ready for its first row.

    Parameters
    ----------
    plant : what is watched
    wanted : how
    before : the run that this one goes on from
    out : where the records go
    live : whether rows are to be answered at once
    curves : whether all samples are kept; else what people are told in words, where somebody reads it
    hear : is given what is found
    """
    watcher = watcher_of(plant, wanted, before)
    spec = watcher.spec
    grid = new_grid(spec, live=live, clock=before.clock if before else None)
    trace = Trace(spec, curves=curves, lag=watcher.lag) if curves or out.text is not None else None
    following = Following(out=out, trace=trace, level=wanted.accept, hear=hear, document=plant.document)
    course = Course(watcher, grid, following, before)
    return BegunRun(run=PlantRun(plant=plant, watcher=watcher, course=course, trace=trace), grid=grid)


def watcher_of(plant: WatchedPlant, wanted: Wanted, before: Saved | None) -> Watcher:
    """Give the method, from what the cache knows of the plant where it can be loaded."""
    numbers = before.numbers if before is not None else None
    if plant.prepared is not None:
        with suppress(GenerationError):
            return prepared_bank(plant.prepared, numbers)
    return build_method(plant.graph, wanted.method, numbers, plant.identity)


def columns_after(plant: WatchedPlant, before: Saved | None) -> Columns:
    """Give the columns to read after another run; without a time column the clock goes on from the run before."""
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


def _nothing_new(recording: Recording, before: Saved) -> str:
    return (
        f"{called(recording)}: no row is later than {before.clock.last_time:.15g} s, where the saved run ended. "
        "Give a recording that goes on from there, or another state file."
    )


def _pass(
    course: Course, blocks: Iterable[RowBlock], grid: Grid, keeper: Keeper | None, out: Out, *, live: bool
) -> KeyboardInterrupt | None:
    """Pass all rows through the method and write the records as they come; give what stopped it before their end.

    To be stopped is an end like another; so is an error in a stream, which nobody can mend and give again.
    """
    with Stopping() as stopping:
        try:
            for rows in stopping.between(blocks):
                if live and keeper is not None:
                    _take_kept(course, rows, grid, keeper, out)
                else:
                    _take(course, grid.push_block(rows), out)
            stopped = None
        except KeyboardInterrupt as signalled:
            out.settle()
            stopped = signalled
        except RecordingError:
            if live and course.counts.samples:
                out.settle()
                _end(course, grid, keeper, out, live=live)
            raise
        _end(course, grid, keeper, out, live=live)
        return stopped


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
