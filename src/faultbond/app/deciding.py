"""`accept` and `reject`: what a person makes of the candidates of a kept run."""

from dataclasses import replace
from pathlib import Path

from faultbond.app.keeping import read_before
from faultbond.app.methods import ONE_FAULT, restored
from faultbond.errors import FaultbondError, RecordingError
from faultbond.io.out import Out
from faultbond.io.saved import Saved, write_saved
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime import accepting
from faultbond.runtime.history import Accepted, Decider
from faultbond.runtime.monitor import conclude
from faultbond.runtime.records import decision_record, diagnosis_record
from faultbond.runtime.state import State
from faultbond.spec import EngineSpec
from faultbond.types import Method, TimeGrid


def accept(model: Path, state: Path, names: tuple[str, ...], *, out: Out) -> None:
    """Take a candidate of a kept run, without names the best, as the new healthy model."""
    graph, spec, saved, before = _opened(model, state)
    chosen = accepting.find_hypothesis(spec, names) if names else _best(spec, before)
    after, candidate = accepting.accept(spec, before, chosen)
    accepted = Accepted(time=before.time, candidate=candidate, by=Decider.PERSON)
    write_saved(state, replace(saved, numbers=after.save(), found=saved.found.with_accepted(accepted)))
    out.record(decision_record(accepted))
    if out.text is not None:
        from faultbond.report.verdict import accepted_sentence  # noqa: PLC0415 - loads rich

        out.say(accepted_sentence(graph, accepted))


def reject(model: Path, state: Path, names: tuple[str, ...], *, out: Out) -> None:
    """Rule a candidate of a kept run out."""
    graph, spec, saved, before = _opened(model, state)
    chosen = accepting.find_hypothesis(spec, names)
    after, candidate = accepting.reject(spec, before, chosen)
    write_saved(state, replace(saved, numbers=after.save(), found=saved.found.with_rejected(chosen)))
    diagnosis = conclude(spec, after)
    rejected = Accepted(time=before.time, candidate=candidate, by=Decider.PERSON)
    out.record(decision_record(rejected, rejected=True))
    out.record(diagnosis_record(diagnosis))
    if out.text is not None:
        from faultbond.report.decided import ranking_text, rejected_sentence  # noqa: PLC0415 - loads rich

        out.say(rejected_sentence(graph, rejected))
        out.say(ranking_text(graph, diagnosis))


def _opened(model: Path, state: Path) -> tuple[BondGraph, EngineSpec, Saved, State]:
    """Read model and file, and give the state in it."""
    graph = load_model(model)
    if graph.grid is TimeGrid.NONE:
        raise FaultbondError(f"{model}: a run on a network without time is not kept, so nothing can be decided in it.")
    saved = read_before(state, graph)
    if saved is None:
        raise RecordingError(f"{state}: there is no such file. `faultbond run MODEL REC --state {state}` writes it.")
    if saved.method is not Method.BANK:
        raise FaultbondError(f"{state}: {ONE_FAULT}")
    from faultbond.synthesis.engine import build_model  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.specify import build_spec  # noqa: PLC0415 - loads casadi

    spec = build_spec(build_model(graph))
    return graph, spec, saved, restored(spec, saved.numbers)


def _best(spec: EngineSpec, state: State) -> int:
    """Give the hypothesis of the best candidate."""
    if state.alarm < 0:
        raise FaultbondError("There is no alarm to explain, so nothing to accept.")
    return conclude(spec, state).candidates[0].hypothesis
