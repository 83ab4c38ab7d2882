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
from faultbond.model.document import ModelFile
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


def accept(model: ModelFile, state: Path, names: tuple[str, ...], *, repaired: bool, out: Out) -> None:
    """Take a candidate of a kept run, without names the best, as the new healthy model, or as one that is mended."""
    graph, accepted = accepted_in(model, state, names, repaired=repaired, replaces=out.replaces)
    out.record(decision_record(accepted))
    if out.text is not None:
        from faultbond.report.verdict import accepted_sentence  # noqa: PLC0415 - loads rich

        out.say(accepted_sentence(graph, accepted))


def accepted_in(
    model: ModelFile, state: Path, names: tuple[str, ...], *, repaired: bool, replaces: Path | None = None
) -> tuple[BondGraph, Decision]:
    """Accept a candidate in the file of a kept run; gives the model, too. `replaces`: a file that is written then."""
    with locked(state):
        opened = _opened(model, state, replaces)
        chosen = chosen_hypothesis(opened.watcher, opened.diagnosis, names)
        candidate = opened.watcher.accept(chosen, repaired=repaired)
        accepted = Decision(time=opened.diagnosis.time, candidate=candidate, by=Decider.PERSON, repaired=repaired)
        opened.write(state, opened.saved.found.with_accepted(accepted))
    return opened.graph, accepted


def chosen_hypothesis(watcher: Watcher, diagnosis: Diagnosis, names: tuple[str, ...]) -> int:
    """Give the hypothesis that a person named, without names the best one."""
    return find_hypothesis(watcher.spec, names) if names else diagnosis.candidates[0].hypothesis


def reject(model: ModelFile, state: Path, names: tuple[str, ...], *, out: Out) -> None:
    """Rule a candidate of a kept run out, and with it all sets that contain it."""
    graph, rejected, left = rejected_in(model, state, names, replaces=out.replaces)
    out.record(decision_record(rejected, rejected=True))
    out.record(diagnosis_record(left))
    if out.text is not None:
        from faultbond.report.verdict import ranking_text, rejected_sentence  # noqa: PLC0415 - loads rich

        out.say(rejected_sentence(graph, rejected))
        out.say(ranking_text(graph, left))


def rejected_in(
    model: ModelFile, state: Path, names: tuple[str, ...], *, replaces: Path | None = None
) -> tuple[BondGraph, Decision, Diagnosis]:
    """Rule a candidate out in the file of a kept run; gives the model, and what is left, too."""
    with locked(state):
        opened = _opened(model, state, replaces)
        chosen = find_hypothesis(opened.watcher.spec, names)
        rejected = Decision(time=opened.diagnosis.time, candidate=opened.watcher.reject(chosen), by=Decider.PERSON)
        opened.write(state, opened.saved.found.with_rejected(rejected))
    return opened.graph, rejected, opened.watcher.finish() or opened.diagnosis


def _opened(model: ModelFile, state: Path, replaces: Path | None) -> _Opened:
    """Read model and file, and let the method stand as it stood."""
    graph = load_model(model)
    if graph.grid is TimeGrid.NONE:
        raise FaultbondError(
            f"{graph.file}: a run on a network without time is not kept, so nothing can be decided in it."
        )
    saved = read_before(state, graph)
    if saved is None:
        raise RecordingError(f"{state}: there is no such file. `faultbond run MODEL REC --state {state}` writes it.")
    if replaces is not None and saved.records is not None and holds_records(replaces, saved.records):
        raise FaultbondError(f"{replaces}: there are the records of the run in {state}. Name another file.")
    watcher = build_method(graph, saved.method, saved.numbers)
    diagnosis = watcher.finish()
    if diagnosis is None or not diagnosis.candidates:
        raise FaultbondError(NO_ALARM)
    return _Opened(graph=graph, watcher=watcher, saved=saved, diagnosis=diagnosis)
