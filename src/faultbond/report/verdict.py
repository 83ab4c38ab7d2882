"""What a run found, in words and in table rows; the terminal and the page print the same."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from faultbond.contract.findings import Candidate, Decider, Decision, Detection, Diagnosis, History, Unexplained
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.report.advising import action
from faultbond.report.numbers import Notation, certainty_text, clock_text, duration_text, figure, probability_text
from faultbond.report.suspects import (
    OTHERWISE,
    SuspectRow,
    change_of,
    instrument_of,
    otherwise,
    owner_of,
    rows_of,
    with_article,
)
from faultbond.types import FaultKind

TABLE_ROWS = 8
NEGLIGIBLE = 0.001  # candidates below are listed only to fill the first three rows
LISTED_SETS = 4  # candidates of a group named in a sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCounts:
    """Samples of a run: grid points passed, and defects of the recording. Keys of the `end` record.

    no_verdict: why the run says nothing about the plant; empty where it does.
    """

    samples: int
    missing: int = 0
    late: int = 0
    duplicate: int = 0
    untimed: int = 0
    unused: int = 0
    clock_jumps: int = 0
    saturated: int = 0
    frozen: int = 0
    wild: int = 0
    no_verdict: str = ""

    def defects(self) -> str:
        """Say what was wrong with the recording, `3 missing, 1 late`; empty where nothing was."""
        names = ("missing", "late", "duplicate", "untimed", "unused", "saturated", "frozen", "wild")
        found = [(getattr(self, name), name) for name in names]
        found.append((self.clock_jumps, "clock jump" if self.clock_jumps == 1 else "clock jumps"))
        return ", ".join(f"{number} {name}" for number, name in found if number)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRow:
    """One candidate of the ranked table."""

    suspects: tuple[SuspectRow, ...]
    kinds: tuple[str, ...]  # lines: the kind of fault, or several with their shares
    probability: float
    percent: str
    group: bool


def last_diagnosis(history: History) -> Diagnosis | None:
    """Give the last diagnosis that names a candidate."""
    named = [diagnosis for diagnosis in history.diagnoses if diagnosis.candidates]
    return named[-1] if named else None


def open_diagnosis(history: History) -> Diagnosis | None:
    """Give the last diagnosis of the fault for which nothing was accepted yet."""
    began, last = history.open, last_diagnosis(history)
    return last if began is not None and last is not None and last.time >= began.time else None


def best_group(diagnosis: Diagnosis) -> tuple[Candidate, ...]:
    """Give the best candidate and all that cannot be told from it."""
    first, *others = diagnosis.candidates
    return (first, *(candidate for candidate in others if candidate.group))


def component_probabilities(diagnosis: Diagnosis | None) -> dict[str, float]:
    """Give for each component the probability that it is among the changed ones; instruments are left out."""
    return _probabilities(diagnosis, instruments=False)


def instrument_probabilities(diagnosis: Diagnosis | None) -> dict[str, float]:
    """Give for each suspected sensor or input the probability that it is at fault."""
    return _probabilities(diagnosis, instruments=True)


def _probabilities(diagnosis: Diagnosis | None, *, instruments: bool) -> dict[str, float]:
    totals: dict[str, float] = {}
    for candidate in diagnosis.candidates if diagnosis else ():
        chosen = [item for item in candidate.suspects if bool(instrument_of(item.parameter)[0]) is instruments]
        for component in dict.fromkeys(item.component for item in chosen):
            totals[component] = min(1.0, totals.get(component, 0.0) + candidate.probability)
    return totals


def detection_sentence(detection: Detection) -> str:
    """Say when the alarm came, in which signals, and how long after the onset."""
    where = f" in {join(detection.signals)}" if detection.signals else ""
    delay = duration_text(detection.time - detection.change_time)
    return (
        f"Fault detected at {clock_text(detection.time)}{where}; "
        f"it began at about {clock_text(detection.change_time)} (delay {delay})."
    )


def verdict_sentence(graph: BondGraph, history: History, counts: RunCounts, notation: Notation) -> str:
    """Say in plain words what a run found."""
    if history.open is None and counts.no_verdict:
        return f"No verdict: {counts.no_verdict}."
    if history.open is None and history.detections:
        return f"Accepted as the new normal: {decided_text(graph, history.accepted)}. No other fault was found."
    if history.open is None:
        span = duration_text(span_of(history))
        return f"No fault found in {counts.samples} samples ({span})."
    diagnosis = open_diagnosis(history)
    if diagnosis is None:
        return "A fault was detected; there is no diagnosis yet."
    group = best_group(diagnosis)
    if diagnosis.unexplained is not None:
        return f"{unexplained_sentence(diagnosis.unexplained)} {_nearest(graph, diagnosis, notation)}"
    return _sure(graph, diagnosis, notation) if len(group) == 1 else _unsure(graph, diagnosis, notation)


def decided_text(graph: BondGraph, decided: Sequence[Decision]) -> str:
    """Name what was accepted or rejected, and when: `pipe K1 at 1885 s and leak K6 at 3900 s`; empty for none."""
    return join([f"{_set_and_kind(graph, item.candidate)} at {clock_text(item.time)}" for item in decided])


def accepted_sentence(graph: BondGraph, accepted: Decision) -> str:
    """Say what was accepted, when, and by whom."""
    told = f"{_set_and_kind(graph, accepted.candidate)} ({probability_text(accepted.candidate.probability)} %)"
    by = " by rule" if accepted.by is Decider.RULE else ""
    return f"Accepted{by} at {clock_text(accepted.time)}: {told}. It is the new normal."


def unexplained_sentence(found: Unexplained) -> str:
    """Say that no candidate fits, and where the best one is off."""
    size = figure(found.sd, digits=2).number(Notation.FILE)
    return (
        f"None of the modelled faults explains this: the best fit is still {size} standard deviations off in "
        f"{found.signal} between {clock_text(found.since)} and {clock_text(found.until)}, on average."
    )


def span_of(history: History) -> float:
    """Give the length of the recording in seconds."""
    return float(history.time[-1] - history.time[0]) if len(history.time) else 0.0


def _sure(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> str:
    best = diagnosis.candidates[0]
    owners = _owners(graph, best)
    one = len(best.components) == 1
    event = {
        FaultKind.STEP: f"{owners} changed",
        FaultKind.DRIFT: f"{owners} {'drifts' if one else 'drift'}",
        FaultKind.INTERMITTENT: f"a fault of {owners} comes and goes",
    }.get(best.kind, "")
    if not event or (_has_instrument(best) and best.kind is not FaultKind.INTERMITTENT):
        event = f"{owners} {'is' if one else 'are'} at fault"
    return f"Most likely {event}: {_changes(graph, diagnosis, notation)}{_certainty(diagnosis)}.{otherwise(best)}"


def _certainty(diagnosis: Diagnosis) -> str:
    """Say how sure the best candidate is, sets that were not tested included; empty where nothing is a chance."""
    best, left = diagnosis.candidates[0], diagnosis.untested
    if not best.kinds:  # the method `classic` knows an order only
        return ""
    sure = certainty_text(best.probability)
    if left is None or not left.sets:
        return f", {sure}"
    if left.probability >= 1.0:
        return f", {sure} among the sets tested"
    least = certainty_text(best.probability * (1.0 - left.probability))
    return f", {sure}" if least == sure else f", at least {least}"


def _owners(graph: BondGraph, candidate: Candidate) -> str:
    return join(list(dict.fromkeys(with_article(owner_of(graph, suspect)) for suspect in candidate.suspects)))


def _has_instrument(candidate: Candidate) -> bool:
    return any(instrument_of(suspect.parameter)[0] for suspect in candidate.suspects)


def _changes(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> str:
    best = diagnosis.candidates[0]
    return "; ".join(change_of(graph, best, suspect, diagnosis.time, notation) for suspect in best.suspects)


def _nearest(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> str:
    """Name what comes nearest where nothing fits, without a claim."""
    group = best_group(diagnosis)
    if len(group) > 1:
        return f"Nearest come {_listed([set_name(graph, candidate) for candidate in group])}."
    best = group[0]
    plain = best.kind is FaultKind.STEP and not _has_instrument(best)
    what = {FaultKind.DRIFT: "a drift"}.get(best.kind, "a change" if plain else "a fault")
    return f"Nearest comes {what} of {_owners(graph, best)}: {_changes(graph, diagnosis, notation)}."


def _unsure(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> str:
    group = best_group(diagnosis)
    listed = _listed([f"{_set_and_kind(graph, item)} ({100.0 * item.probability:.0f} %)" for item in group])
    shared = [suspect for suspect in group[0].suspects if all(suspect.parameter in other.parameters for other in group)]
    common = join([f"{suspect.parameter} of {with_article(owner_of(graph, suspect))}" for suspect in shared])
    hint = f" All contain {common}." if shared else ""
    if not diagnosis.advice:
        return f"Cannot yet be told apart: {listed}; more data, or a change of input, would be needed.{hint}"
    best = diagnosis.advice[0]
    return f"Cannot yet be told apart: {listed}.{hint} Best next: {action(graph, best, notation)}."


def _set_and_kind(graph: BondGraph, candidate: Candidate) -> str:
    """Name a candidate, and its kind of fault where that is not a step: `pipe K1 drifting`."""
    words = {FaultKind.STEP: "", FaultKind.DRIFT: " drifting", FaultKind.INTERMITTENT: " coming and going"}
    return set_name(graph, candidate) + words.get(candidate.kind, f" {candidate.kind.value}")


def _listed(names: Sequence[str]) -> str:
    more = len(names) - LISTED_SETS
    return join([*names[:LISTED_SETS], f"{more} more"] if more > 0 else names)


def set_name(graph: BondGraph, candidate: Candidate) -> str:
    """Name a candidate: `pipe K1`, `pipe K1 with leak K6`, or `flow sensor`."""
    names = []
    for suspect in candidate.suspects:
        owner = owner_of(graph, suspect)
        plain = suspect.component == suspect.parameter or instrument_of(suspect.parameter)[0]
        names.append(owner if plain else f"{owner} {suspect.parameter}")
    return " with ".join(names)


def set_key(candidate: Candidate) -> tuple[str, ...]:
    """Give what a candidate is called throughout a run, while the kind of fault of an instrument may change."""
    return tuple(suspect.parameter.split(".")[0] + "." * ("." in suspect.parameter) for suspect in candidate.suspects)


def unfalsifiable_text(spec: EngineSpec) -> str:
    """Name the sets that are not tested since no data can contradict them: `{A, B}, {A, C} and 3 more`."""
    return _listed(["{" + ", ".join(spec.parameters[k].name for k in chosen) + "}" for chosen in spec.explain_anything])


def join(words: Sequence[str]) -> str:
    """Join words with commas and a last `and`."""
    return " and ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


def table_rows(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> tuple[TableRow, ...]:
    """Give the rows of the ranked table that are worth a look, best first."""
    shown = [
        candidate
        for place, candidate in enumerate(diagnosis.candidates[:TABLE_ROWS])
        if place < 3 or candidate.group or candidate.probability >= NEGLIGIBLE
    ]
    return tuple(
        TableRow(
            suspects=tuple(
                row
                for number, suspect in enumerate(candidate.suspects)
                for row in rows_of(graph, suspect, notation, "+ " if number else "")
            ),
            kinds=_kinds(candidate),
            probability=candidate.probability,
            percent=probability_text(candidate.probability),
            group=candidate.group or place == 0,
        )
        for place, candidate in enumerate(shown)
    )


def remainder_text(diagnosis: Diagnosis, rows: Sequence[TableRow]) -> str:
    """Say how many candidates the table leaves out and how improbable they are; empty where it shows all."""
    left = diagnosis.candidates[len(rows) :]
    if not left:
        return ""
    bound = max(candidate.probability for candidate in left)
    limit = 0.1 if bound < 0.001 else math.ceil(1000.0 * bound + 1e-9) / 10.0
    return f"... and {len(left)} more below {limit:g} %"


def untested_sentence(diagnosis: Diagnosis) -> str:
    """Say how many sets were too many to be tested, and what that may hide; empty where all were tested."""
    left = diagnosis.untested
    if left is None or not left.sets:
        return ""
    many = f"Another {left.sets} sets were too many to be tested"
    if left.probability >= 1.0:
        return f"{many}; how likely it is that the truth is among them cannot be told."
    return f"{many}; the truth is among them with at most {math.ceil(1000.0 * left.probability - 1e-9) / 10.0:.1f} %."


def _kinds(candidate: Candidate) -> tuple[str, ...]:
    """Give the kind of fault, or the kinds that it may be with their shares, and that a fault is gone now."""
    told = [(kind, share) for kind, share in candidate.kinds if share >= OTHERWISE]
    several = [f"{kind.value} {100.0 * share:.0f} %" for kind, share in told] if len(told) > 1 else []
    return (*(several or [candidate.kind.value]), *([] if candidate.present else ["now gone"]))
