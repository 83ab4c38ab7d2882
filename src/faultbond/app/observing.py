"""`run` on networks without time: every row is an observation, diagnosed with all since the first contradiction."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from hashlib import sha256
from importlib.metadata import version
from math import nan
from pathlib import Path

from faultbond.errors import ModelError, RecordingError
from faultbond.io.circuits import read_circuit, read_scenario
from faultbond.io.grid import Counts, Grid, GridPoint, on_grid
from faultbond.io.out import Out
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.runtime.history import Detection, Diagnosis
from faultbond.runtime.records import detection_record, diagnosis_record, end_record, run_record
from faultbond.types import Method

Event = Detection | Diagnosis


@dataclass(frozen=True, slots=True, kw_only=True)
class _Network:
    """What a run on a network without time is about: for the records, and for people."""

    name: str
    sha256: str
    sensors: tuple[str, ...]
    graph: BondGraph | None = None


def run_circuit(circuit: Path, scenario: str, *, method: Method, report: Path | None, out: Out) -> bool:
    """Diagnose the observations of a logic circuit, and tell whether they contradict it."""
    _refuse_report(report, str(circuit))
    from faultbond.analysis.static.logic import watch_logic  # noqa: PLC0415 - loads clingo

    network, rows = read_circuit(circuit), read_scenario(scenario).observations
    about = _Network(name=network.name, sha256=sha256(circuit.read_bytes()).hexdigest(), sensors=network.outputs)
    counts, last = Counts(samples=len(rows)), rows[-1].time
    return _pass(about, watch_logic(network, rows), lambda: (counts, last), method, out)


def run_static(graph: BondGraph, recording: str, *, method: Method, report: Path | None, out: Out) -> bool:
    """Diagnose the observations of a static network, and tell whether they contradict it."""
    _refuse_report(report, graph.file)
    from faultbond.analysis.static.watch import watch  # noqa: PLC0415 - loads sympy and clingo

    grid, last = Grid(None), [nan]

    def points() -> Iterator[GridPoint]:
        for point in on_grid(read_rows(recording, columns_of(graph)), grid):
            last[0] = point.time
            yield point

    def ending() -> tuple[Counts, float]:
        if not grid.counts.samples:
            raise RecordingError(f"{recording}: no row can be read. Check its columns.")
        return grid.counts, last[0]

    about = _Network(
        name=graph.name, sha256=graph.sha256, sensors=tuple(item.name for item in graph.sensors), graph=graph
    )
    return _pass(about, watch(graph, points()), ending, method, out)


def _pass(
    about: _Network, events: Iterable[Event], ending: Callable[[], tuple[Counts, float]], method: Method, out: Out
) -> bool:
    """Write the records as they come, and the last diagnosis for people."""
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
    for event in events:
        if isinstance(event, Detection):
            detection = event
            out.record(detection_record(event))
        else:
            diagnosis = event
            out.record(diagnosis_record(event))
    counts, last = ending()
    out.record(
        end_record(
            time=last,
            samples=counts.samples,
            watched=counts.samples - counts.missing,
            detections=int(detection is not None),
            missing=counts.missing,
            late=counts.late,
            duplicate=counts.duplicate,
        )
    )
    if out.text is not None:
        from rich.console import Console  # noqa: PLC0415 - slow to load

        from faultbond.report.observed import Observed, print_observed  # noqa: PLC0415 - loads rich

        seen = Observed(
            name=about.name,
            sensors=about.sensors,
            rows=counts.samples,
            detection=detection,
            diagnosis=diagnosis,
            graph=about.graph,
        )
        print_observed(Console(file=out.text), seen)
    return detection is not None


def _refuse_report(report: Path | None, model: str) -> None:
    if report is not None:
        raise ModelError(f"{model}: a network without time has no curves to draw; leave out --report")
