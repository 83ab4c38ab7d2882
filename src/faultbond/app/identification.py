"""`fit`: parameters and noise of a model from healthy recordings."""

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from faultbond.app.disorder import refuse_disorder
from faultbond.app.engine import build_trial
from faultbond.app.likelihood import likelihood_engine
from faultbond.app.model_check import write
from faultbond.app.presence import silent_of
from faultbond.app.rows import naming, no_time, pace_of, sample_of, texts_of
from faultbond.app.section import Section
from faultbond.app.signals import SIGNALLED, Stopped, last_of
from faultbond.app.stated_starts import contradictions, start_sentence
from faultbond.app.wishes import FitWishes
from faultbond.contract.samples import Sample
from faultbond.contract.silence import INPUT, SENSOR, seconds
from faultbond.errors import FaultbondError, ModelError, RecordingError
from faultbond.io.files import replaced_text
from faultbond.io.grid import Grid, on_grid
from faultbond.io.memory_table import Recording
from faultbond.io.out import Out
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.document import ModelFile, read_document
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model
from faultbond.types import STEP, TimeGrid

if TYPE_CHECKING:
    from rich.console import Console

    from faultbond.report.fit_result import Fitted

_SILENT = 60.0  # s without a word, where standard error is no terminal
_AGAIN = 60.0  # s after which a step is told there


def _silent(_: str) -> None:
    """Tell nobody."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Identified:
    """A model that was fitted.

    text: of the model file with what was found; stopped, failed: the signal or the error that ended it early
    """

    graph: BondGraph
    fitted: Any
    quieted: Any
    text: str
    stopped: int | None = None
    failed: Exception | None = None

    @property
    def unfinished(self) -> bool:
        """Whether it ended before it was done."""
        return self.stopped is not None or self.failed is not None

    def records(self, output: Path | None = None) -> list[dict[str, object]]:
        """Give the records; `output` is the model file that was written."""
        from faultbond.report.fit_result import fit_record  # noqa: PLC0415 - loads rich

        found = [fit_record(self.fitted, output, stopped=self.unfinished)]
        if self.quieted is not None:
            from faultbond.report.quiet_result import quiet_record  # noqa: PLC0415 - loads rich

            found.append(quiet_record(self.quieted))
        return found

    def show(self, console: "Console", output: Path | None = None) -> None:
        """Print what was found."""
        from faultbond.report.fit_result import print_fit  # noqa: PLC0415 - loads rich

        print_fit(console, self.fitted, output)
        if self.quieted is not None:
            from faultbond.report.quiet_result import print_quiet  # noqa: PLC0415 - loads rich

            print_quiet(console, self.graph, self.quieted)

    def page(self) -> str:
        """Give the report, a page of HTML."""
        from faultbond.report.fit_page import render_fit  # noqa: PLC0415 - loads jinja2

        return str(render_fit(self.fitted, self.graph, self.quieted))


def fit(
    model: ModelFile,
    recordings: tuple[Recording, ...],
    *,
    wishes: FitWishes,
    output: Path | None,
    report: Path | None,
    out: Out,
) -> int:
    """Fit a model to healthy recordings and write the model file that follows from them; give the exit code."""
    try:
        with _waiting(long=wishes.until_quiet) as status:
            found = identified(model, recordings, wishes=wishes, tell=status, warn=out.warn)
    except Stopped:
        out.warn("stopped before the first climb has ended, or once more after it: nothing is written.")
        raise
    refused: OSError | None = None
    try:
        if output is not None:
            _write(output, found.text)
    except OSError as error:  # what was found is told all the same
        output, refused = None, error
    for record in found.records(output):
        out.record(record)
    if out.text is not None:
        from rich.console import Console  # noqa: PLC0415 - slow to load

        found.show(Console(file=out.text), output)
    if report is not None:
        _write(report, found.page())
        out.say(f"Report: {report}")
    if refused is not None:
        raise refused
    if not found.unfinished:
        return 0
    where = f"is in {output}" if output is not None else "is told, and in no file"
    out.warn(f"stopped: the model as it was found by then {where}.")
    if found.failed is not None:
        raise found.failed
    return SIGNALLED + (found.stopped or 0)


def identified(
    model: ModelFile,
    recordings: tuple[Recording, ...],
    *,
    wishes: FitWishes,
    tell: Callable[[str], None] = _silent,
    warn: Callable[[str], None] = _silent,
) -> Identified:
    """Fit a model to healthy recordings.

    Parameters
    ----------
    model : the model file
    recordings : healthy recordings
    wishes : what is to be fitted, and how
    tell : is told what is being done
    warn : is told which sensors and inputs gave hardly a value, and, before a search, what the data do not show
    """
    document = read_document(model)
    graph = load_model(document)
    _refuse(graph, recordings)
    read = tuple((str(name), read_points(graph, name, warn)) for name in recordings)
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - needed here alone

    from faultbond.report.fit_result import with_seen_ranges  # noqa: PLC0415 - loads rich

    text = with_seen_ranges(document.text, graph, (points for _, points in read))
    graph = parse_model(text, file=graph.file)
    _doubt_starts(graph, read, warn)
    with threadpool_limits(1):  # matrices are small here, and threads would only wait
        if wishes.until_quiet:
            from faultbond.report.quiet_result import told_in_file  # noqa: PLC0415 - needed here alone

            quieted = _quieted(text, graph, read, wishes, tell, warn)
            return Identified(
                graph=graph,
                fitted=quieted.fitted,
                quieted=quieted,
                text=told_in_file(quieted),
                stopped=quieted.stopped,
                failed=quieted.failed,
            )
        fitted, ended = last_of(_stages(text, graph, read, wishes, tell))
        if ended is not None and fitted.alarms is None:  # by a model that is known to alarm `run` is to claim nothing
            with suppress(FaultbondError):  # what ended it may be that nothing can be compiled any more
                fitted = _asked(fitted, text, read, tell)
    return Identified(
        graph=graph,
        fitted=fitted,
        quieted=None,
        text=fitted.with_false_alarms(fitted.model_text(text)),
        stopped=ended.number if isinstance(ended, Stopped) else None,
        failed=ended if isinstance(ended, Exception) else None,
    )


def _stages(
    text: str,
    graph: BondGraph,
    read: tuple[tuple[str, list[Sample]], ...],
    wishes: FitWishes,
    tell: Callable[[str], None],
) -> Iterator[Any]:
    """Fit a model as it stands, a text; give what is found after each stage, so that who stops one has the others."""
    from faultbond.fit.healthy_changes import healthy_changes  # noqa: PLC0415 - loads scipy
    from faultbond.fit.identification import Halted, Prior, fit_plant  # noqa: PLC0415 - loads casadi and scipy
    from faultbond.fit.session import build_fit, free_parameters  # noqa: PLC0415 - loads casadi
    from faultbond.fit.wander import wanders_of  # noqa: PLC0415 - loads casadi
    from faultbond.report.doubts import earlier_doubt  # noqa: PLC0415 - needed here alone
    from faultbond.report.fit_result import fitted_model  # noqa: PLC0415 - loads rich
    from faultbond.synthesis.engine import build_model  # noqa: PLC0415 - loads casadi

    parameters = free_parameters(graph, wishes.fixed, wishes.free, wishes.own)
    step_model = build_model(graph)
    core = build_trial(graph)
    likelihood = likelihood_engine(step_model)
    plant, records, begin = build_fit(step_model, likelihood, core, read, parameters, wishes.own)
    prior, doubt, version = Prior(wishes.prior), earlier_doubt(text), core.spec.version
    try:
        found = fit_plant(plant, records, begin, prior=prior, starts=wishes.starts, seed=wishes.seed, tell=tell)
    except Halted as halted:
        yield replace(fitted_model(graph, halted.fit(), version), doubt=doubt)
        raise
    yield replace(fitted_model(graph, found, version), doubt=doubt)
    fitted = replace(
        fitted_model(graph, found, version, wanders_of(graph, found, likelihood_engine, tell)), doubt=doubt
    )
    yield fitted
    tell("asking how far parameters seem to move while healthy")
    fitted = replace(fitted, healthy_changes=healthy_changes(core, found.records, fitted.believed))
    yield fitted
    yield _asked(fitted, text, read, tell)


def _asked(
    fitted: "Fitted", text: str, read: tuple[tuple[str, list[Sample]], ...], tell: Callable[[str], None]
) -> "Fitted":
    """Give a fitted model, a text before, with the recordings on which it alarms."""
    from faultbond.app.quiet_fit import alarms_with  # noqa: PLC0415 - loads casadi and scipy

    tell("asking whether it alarms on the recordings")
    return replace(fitted, alarms=alarms_with(fitted.model_text(text), fitted.graph.file, read))


def _quieted(
    text: str,
    graph: BondGraph,
    read: tuple[tuple[str, list[Sample]], ...],
    wishes: FitWishes,
    tell: Callable[[str], None],
    warn: Callable[[str], None],
) -> Any:
    """Fit a model and add to it until the recordings are quiet."""
    from faultbond.app.quiet_fit import fit_until_quiet  # noqa: PLC0415 - loads casadi and scipy

    return fit_until_quiet(text, graph, read, wishes, tell, warn)


def _write(path: Path, text: str) -> None:
    with replaced_text(path) as stream:
        stream.write(text)


def check_data(model: ModelFile, recordings: tuple[Recording, ...], *, promise: float | None, out: Out) -> None:
    """Put a model on trial on healthy recordings, and tell what it gets wrong; see `tried`."""
    with _waiting() as status:
        found = tried(model, recordings, promise=promise, tell=status, warn=out.warn)
    write(found, out)


def tried(
    model: ModelFile,
    recordings: tuple[Recording, ...],
    *,
    promise: float | None = None,
    tell: Callable[[str], None] = _silent,
    warn: Callable[[str], None] = _silent,
) -> Section:
    """Put a model on trial on healthy recordings: what it gets wrong, and what it must declare.

    Parameters
    ----------
    model : the model file
    recordings : healthy recordings
    promise : seconds between false alarms that are wanted at least; None: as the model file says, else 30 days
    tell : is told what is being done
    warn : is told which sensors and inputs gave hardly a value
    """
    graph = load_model(model)
    _refuse(graph, recordings)
    read = tuple((str(name), read_points(graph, name, warn)) for name in recordings)
    from faultbond.fit.pace import slower_step  # noqa: PLC0415 - loads casadi
    from faultbond.fit.samples import healthy_recording  # noqa: PLC0415 - loads casadi
    from faultbond.fit.trial import MONTH, on_trial  # noqa: PLC0415 - loads scipy
    from faultbond.report.health import health_record, print_health  # noqa: PLC0415 - loads rich
    from faultbond.synthesis.engine import build_model  # noqa: PLC0415 - loads casadi

    core = build_trial(graph)
    _doubt_starts(graph, read, warn)
    tell("watching the recordings")
    records = tuple(healthy_recording(name, points, core) for name, points in read)
    found = on_trial(core, records, promise or graph.time_between_false_alarms or MONTH)
    slower = slower_step(build_model(graph), [item.u for item in records])
    record = health_record(graph, core.spec, found, slower)
    return Section(record=record, show=lambda console: print_health(console, graph, found, slower))


def _doubt_starts(graph: BondGraph, read: Sequence[tuple[str, Sequence[Sample]]], warn: Callable[[str], None]) -> None:
    """Say of which recordings the first readings contradict a stated start."""
    if all(item.start is None for item in graph.components):
        return
    core = build_trial(graph)
    for name, points in read:
        told = start_sentence(graph, name, contradictions(graph, core, points))
        if told:
            warn(told)


def read_points(graph: BondGraph, recording: Recording, warn: Callable[[str], None] = _silent) -> list[Sample]:
    """Give the grid points of a recording; `warn` is told which columns hold text, or gave hardly a value.

    Raises
    ------
    RecordingError
        Where it cannot be read or has no row with a time.
    """
    grid = Grid(graph.sample_time, steady=True, row_time=graph.row_time, held=graph.held_inputs)
    texts = texts_of(recording)
    with naming(recording):
        points = [sample_of(point) for point in on_grid(read_rows(recording, columns_of(graph), texts), grid)]
    if not points:
        raise RecordingError(no_time(recording, texts))
    refuse_disorder(grid, recording)
    for told in (*texts.sentences(), *pace_of(grid, graph.sample_time)):
        warn(f"{recording}: {told}.")
    _warn_of_silence(graph, recording, points, warn)
    return points


def _warn_of_silence(graph: BondGraph, recording: Recording, points: list[Sample], warn: Callable[[str], None]) -> None:
    """Say which columns gave hardly a value; one that gave none is refused later."""
    columns = {(SENSOR, item.name): item.column for item in graph.sensors}
    columns |= {(INPUT, item.name): item.column for item in graph.inputs}
    u, y = (np.array(values).reshape(len(points), -1) for values in ([p.u for p in points], [p.y for p in points]))
    time = np.array([point.time for point in points])
    for item in silent_of([i.name for i in graph.inputs], [s.name for s in graph.sensors], u, y, time):
        if item.values:
            warn(f"{recording}: column {columns[item.role, item.name]!r}: {item.fact(seconds)}.")


def _refuse(graph: BondGraph, recordings: tuple[Recording, ...]) -> None:
    """Refuse what cannot be fitted."""
    if graph.grid is TimeGrid.NONE:
        problem = "with `sample_time: none` there is no course in time to fit; `run` solves the parameters of each row"
        raise ModelError(f"{graph.file}: {problem}")
    twice = next((name for name in recordings if recordings.count(name) > 1), None)
    if twice is not None:
        raise RecordingError(f"{twice}: it is named twice; give each recording once")


def _waiting(*, long: bool = False) -> AbstractContextManager[Callable[[str], None]]:
    """Say what is being done: on a terminal in a line that moves, else in a line each, from when it takes long."""
    if not sys.stderr.isatty():
        return nullcontext(_lines(0.0 if long else _SILENT))
    from rich.console import Console  # noqa: PLC0415 - slow to load

    return _spinning(Console(stderr=True))


def _lines(silent: float) -> Callable[[str], None]:
    """Give what says in a line each what is being done, once so many seconds have gone; of its steps one a minute."""
    last, begin = "", monotonic()
    told = begin

    def tell(text: str) -> None:
        nonlocal last, told
        what, now = text.partition(STEP)[0], monotonic()
        if now - begin < silent:
            return
        if what != last or now - told >= _AGAIN:
            sys.stderr.write(f"faultbond: {what if what != last else text} ...\n")
            told = now
        last = what

    return tell


@contextmanager
def _spinning(console: Any) -> Iterator[Callable[[str], None]]:
    with console.status("building the engine ...") as status:
        yield lambda text: status.update(f"{text} ...")
