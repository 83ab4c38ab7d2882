"""`accept` and `reject`: what a person makes of the candidates of a kept run."""

from dataclasses import dataclass, replace
from pathlib import Path

from faultbond.app.kept_run import read_before
from faultbond.app.method_face import Watcher
from faultbond.app.methods import build_method
from faultbond.contract.findings import Decider, Decision, Diagnosis
from faultbond.contract.json_records import decision_record, diagnosis_record
from faultbond.errors import FaultbondError, RecordingError
from faultbond.io.files import locked
from faultbond.io.out import Out
from faultbond.io.record_file import holds_records
from faultbond.io.saved import FoundSoFar, Saved, write_saved
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.names import find_hypothesis
from faultbond.types import TimeGrid

NO_ALARM = "There is no alarm to explain, so nothing to accept or reject."


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Opened:
    """A kept run, with its method as it stood and what it says."""

    graph: BondGraph
    watcher: Watcher
    saved: Saved
    diagnosis: Diagnosis

    def write(self, state: Path, found: FoundSoFar) -> None:
        """Write it as it stands now."""
        write_saved(state, replace(self.saved, numbers=self.watcher.save(), found=found))


def accept(model: Path, state: Path, names: tuple[str, ...], *, repaired: bool, out: Out) -> None:
    """Take a candidate of a kept run, without names the best, as the new healthy model, or as one that is mended."""
    with locked(state):
        opened, accepted = _accepted(model, state, names, repaired, out)
    out.record(decision_record(accepted))
    if out.text is not None:
        from faultbond.report.verdict import accepted_sentence  # noqa: PLC0415 - loads rich

        out.say(accepted_sentence(opened.graph, accepted))


def _accepted(model: Path, state: Path, names: tuple[str, ...], repaired: bool, out: Out) -> tuple[_Opened, Decision]:
    opened = _opened(model, state, out)
    best = opened.diagnosis.candidates[0].hypothesis
    chosen = find_hypothesis(opened.watcher.spec, names) if names else best
    candidate = opened.watcher.accept(chosen, repaired=repaired)
    accepted = Decision(time=opened.diagnosis.time, candidate=candidate, by=Decider.PERSON, repaired=repaired)
    opened.write(state, opened.saved.found.with_accepted(accepted))
    return opened, accepted


def reject(model: Path, state: Path, names: tuple[str, ...], *, out: Out) -> None:
    """Rule a candidate of a kept run out, and with it all sets that contain it."""
    with locked(state):
        opened, rejected = _rejected(model, state, names, out)
    left = opened.watcher.finish() or opened.diagnosis
    out.record(decision_record(rejected, rejected=True))
    out.record(diagnosis_record(left))
    if out.text is not None:
        from faultbond.report.verdict import ranking_text, rejected_sentence  # noqa: PLC0415 - loads rich

        out.say(rejected_sentence(opened.graph, rejected))
        out.say(ranking_text(opened.graph, left))


def _rejected(model: Path, state: Path, names: tuple[str, ...], out: Out) -> tuple[_Opened, Decision]:
    opened = _opened(model, state, out)
    chosen = find_hypothesis(opened.watcher.spec, names)
    rejected = Decision(time=opened.diagnosis.time, candidate=opened.watcher.reject(chosen), by=Decider.PERSON)
    opened.write(state, opened.saved.found.with_rejected(rejected))
    return opened, rejected


def _opened(model: Path, state: Path, out: Out) -> _Opened:
    """Read model and file, and let the method stand as it stood."""
    graph = load_model(model)
    if graph.grid is TimeGrid.NONE:
        raise FaultbondError(f"{model}: a run on a network without time is not kept, so nothing can be decided in it.")
    saved = read_before(state, graph)
    if saved is None:
        raise RecordingError(f"{state}: there is no such file. `faultbond run MODEL REC --state {state}` writes it.")
    if out.replaces is not None and saved.records is not None and holds_records(out.replaces, saved.records):
        raise FaultbondError(f"{out.replaces}: there are the records of the run in {state}. Name another file.")
    watcher = build_method(graph, saved.method, saved.numbers)
    diagnosis = watcher.finish()
    if diagnosis is None or not diagnosis.candidates:
        raise FaultbondError(NO_ALARM)
    return _Opened(graph=graph, watcher=watcher, saved=saved, diagnosis=diagnosis)
