"""`run` on networks without time: every row is an observation, diagnosed with all since the first contradiction."""

import sys
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from hashlib import sha256
from importlib.metadata import version
from math import nan
from pathlib import Path
from typing import TextIO

import numpy as np

from faultbond.app.rows import texts_of
from faultbond.app.signals import Stopping
from faultbond.app.wishes import Wanted
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.json_records import detection_record, diagnosis_record, end_record, run_record
from faultbond.errors import ModelError, RecordingError
from faultbond.io.files import STANDARD_INPUT
from faultbond.io.grid import Counts, Grid, GridPoint, on_grid
from faultbond.io.memory_table import MemoryTable, Recording
from faultbond.io.out import Out
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.logic import LogicNetwork, TimedObservation
from faultbond.networks.logic.dxc import read_circuit, read_scenario
from faultbond.types import Method, Verdict

_Event = Detection | Diagnosis


@dataclass(frozen=True, slots=True, kw_only=True)
class _Network:
    """What a run on a network without time is about: for the records, and for people."""

    name: str
    sha256: str
    sensors: tuple[str, ...]
    graph: BondGraph | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Ending:
    """What there was of rows: their counts, how many had a reading, and the time of the last."""

    counts: Counts
    watched: int
    time: float


@dataclass(frozen=True, slots=True, kw_only=True)
class NetworkRun:
    """A run on a network without time that is over; there is nothing in it to draw.

    diagnosis: the last one, with all smallest diagnoses of all rows since the detection. texts: what the recording has
    where numbers belong, in words. stopped: what ended it before the end of its rows.
    """

    _about: _Network
    _end: _Ending
    detection: Detection | None = None
    diagnosis: Diagnosis | None = None
    texts: tuple[str, ...] = ()
    stopped: KeyboardInterrupt | None = None

    @property
    def verdict(self) -> Verdict:
        """What it says of the network."""
        if self.detection is not None:
            return Verdict.FAULT
        return Verdict.NONE if self.no_verdict else Verdict.HEALTHY

    @property
    def no_verdict(self) -> str:
        """Why it says nothing; empty where it does."""
        return "" if self._end.watched else "no row has a value of a sensor"

    @property
    def record(self) -> dict[str, object]:
        """The record of its end."""
        return _end_of(self._end, self.detection)

    def tell(self, report: Path | None, out: Out) -> None:
        """Print what was found, where somebody reads it; of a report, see `refuse_report`."""
        refuse_report(report, self._about.name)
        for told in self.texts:
            out.warn(f"{told}.")
        if self.no_verdict and not (out.text is not None and out.text.isatty()):  # there the text says it
            sys.stderr.write(f"faultbond: no verdict: {self.no_verdict}.\n")
        if out.text is not None:
            self.show(out.text)

    def show(self, stream: TextIO) -> None:
        """Print what was found."""
        from rich.console import Console  # noqa: PLC0415 - slow to load

        from faultbond.report.observed import Observed, print_observed  # noqa: PLC0415 - loads rich

        seen = Observed(
            name=self._about.name,
            sensors=self._about.sensors,
            rows=self._end.counts.samples,
            watched=self._end.watched,
            detection=self.detection,
            diagnosis=self.diagnosis,
            graph=self._about.graph,
        )
        print_observed(Console(file=stream), seen)


def watch_circuit(circuit: Path, scenario: Recording, *, wanted: Wanted, out: Out) -> NetworkRun:
    """Diagnose the observations of a logic circuit.

    Raises
    ------
    RecordingError
        Where they are not in a file.
    """
    refuse_report(wanted.report, str(circuit))
    if isinstance(scenario, MemoryTable):
        raise RecordingError(f"{scenario}: a logic circuit takes its observations from a file. Give the path of it.")
    from faultbond.networks.logic.hypotheses import watch_logic  # noqa: PLC0415 - loads clingo

    network, rows = read_circuit(circuit), read_scenario(scenario).observations
    about = _Network(name=network.name, sha256=sha256(circuit.read_bytes()).hexdigest(), sensors=network.outputs)
    out.settle()  # all is read
    return _pass(about, watch_logic(network, rows), lambda: _ending_of(network, rows), wanted.method, out)


def _ending_of(network: LogicNetwork, rows: tuple[TimedObservation, ...]) -> _Ending:
    """Give what there is of observations; ports without a value are missing."""
    ports = {*network.inputs, *network.outputs}
    missing = sum(not ports <= row.values.keys() for row in rows)
    watched = sum(not row.values.keys() <= {*network.inputs} for row in rows)
    return _Ending(counts=Counts(samples=len(rows), missing=missing), watched=watched, time=rows[-1].time)


def watch_static(graph: BondGraph, recording: Recording, *, wanted: Wanted, out: Out) -> NetworkRun:
    """Diagnose the observations of a static network."""
    refuse_report(wanted.report, graph.file)
    from faultbond.networks.detection import watch  # noqa: PLC0415 - loads sympy and clingo

    stopping, texts = Stopping(), texts_of(recording)
    grid, last, watched = Grid(None, live=str(recording) == STANDARD_INPUT, steady=True), nan, 0

    def points() -> Iterator[GridPoint]:
        nonlocal last, watched
        rows = stopping.between(read_rows(recording, columns_of(graph), texts))
        for point in on_grid(rows, grid):
            out.settle()
            last, watched = point.time, watched + bool(np.isfinite(point.y).any())
            yield point

    def ending() -> _Ending:
        if not grid.counts.samples and stopping.noted is None:
            raise RecordingError(f"{recording}: no row can be read. Check its columns.")
        return _Ending(counts=grid.counts, watched=watched, time=last)

    about = _Network(
        name=graph.name, sha256=graph.sha256, sensors=tuple(item.name for item in graph.sensors), graph=graph
    )
    with stopping:
        run = _pass(about, watch(graph, points()), ending, wanted.method, out)
    return replace(run, texts=texts.sentences())


def _pass(
    about: _Network, events: Iterable[_Event], ending: Callable[[], _Ending], method: Method, out: Out
) -> NetworkRun:
    """Write the records as they come."""
    out.record(
        run_record(
            model=about.name,
            model_sha256=about.sha256,
            method=method,
            version=version("faultbond"),
            sample_time=None,
        )
    )
    detection: Detection | None = None
    diagnosis: Diagnosis | None = None
    stopped: KeyboardInterrupt | None = None
    try:
        for event in events:
            if isinstance(event, Detection):
                detection = event
                out.record(detection_record(event))
            else:
                diagnosis = event
                out.record(diagnosis_record(event))
    except KeyboardInterrupt as signalled:
        out.settle()
        stopped = signalled
    run = NetworkRun(_about=about, _end=ending(), detection=detection, diagnosis=diagnosis, stopped=stopped)
    out.record(run.record)
    return run


def _end_of(end: _Ending, detection: Detection | None) -> dict[str, object]:
    """Give the last record."""
    return end_record(
        time=end.time,
        samples=end.counts.samples,
        watched=end.watched,
        detections=int(detection is not None),
        missing=end.counts.missing,
        late=end.counts.late,
        duplicate=end.counts.duplicate,
        untimed=end.counts.untimed,
        saturated=end.counts.saturated,
    )


def refuse_report(report: Path | None, model: str) -> None:
    """Refuse a report of a network.

    Raises
    ------
    ModelError
        Where one is asked for.
    """
    if report is not None:
        raise ModelError(f"{model}: a network without time has no curves to draw; leave out --report")
