"""What a run found, in words and in table rows: made once, and shown by the terminal and the page."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

from faultbond.contract.findings import (
    Candidate,
    Decider,
    Decision,
    Detection,
    Diagnosis,
    History,
    Suspect,
    Walk,
)
from faultbond.contract.silence import SENSOR, Silent, unwatched
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.report.checks import CheckRow, action, check_rows
from faultbond.report.numbers import (
    Notation,
    clock_text,
    duration_text,
    join,
    probability_text,
)
from faultbond.report.reservations import (
    CONTRADICTED,
    NEGLIGIBLE,
    beside,
    certainty,
    course_sentences,
    even_share,
    reason_for_none,
    unexplained_sentence,
)
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
NAMED_SETS = 4  # candidates of a group named in a sentence
MOVES = " (this value still moves)"
HARDLY = 0.001  # of its value by which what is accepted changes at least
IMPROBABLE = 0.01  # probability of what is accepted below which that is worth a word
NOTES = 6  # sensors and inputs without a value of which a sentence each is said
RANKED_SETS = 8  # candidates of the ranking after a rejection
_ENDINGS = {
    FaultKind.STEP: "",
    FaultKind.DRIFT: " drifting",
    FaultKind.RAMP: " changed over a while",
    FaultKind.INTERMITTENT: " coming and going",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RunCounts:
    """Samples of a run: grid points passed, and defects of the recording. Keys of the `end` record.

    no_verdict: why the run says nothing about the plant; empty where it does. disorder: the same where rows are so
    much out of order that an alarm says nothing either. silent: sensors and inputs that gave no value, hardly any, or
    none for long. texts: what stands where numbers belong, in words. hints: sentences on what else an alarm may come
    from, such as a wrong unit, which are told first. remarks: on what the verdict does not cover, told after it.
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
    outside: int = 0
    sensors_outside: int = 0
    no_verdict: str = ""
    disorder: str = ""
    silent: tuple[Silent, ...] = ()
    texts: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()

    def defects(self) -> str:
        """Say what was wrong with the recording, `3 missing, 1 late`; empty where nothing was."""
        names = ("missing", "late", "duplicate", "untimed", "unused", "saturated", "frozen", "wild")
        found = [(getattr(self, name), name) for name in names]
        found.append((self.clock_jumps, "clock jump" if self.clock_jumps == 1 else "clock jumps"))
        found.append((self.outside, "not judged (`valid_when`)"))
        readings = "reading of a sensor" if self.sensors_outside == 1 else "readings of sensors"
        found.append((self.sensors_outside, f"{readings} not judged (their `valid_when`)"))
        return ", ".join(f"{number} {name}" for number, name in found if number)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRow:
    """One candidate of the ranked table; where the data contradict all of them none has a probability to be told."""

    suspects: tuple[SuspectRow, ...]
    kinds: tuple[str, ...]  # lines: the kind of fault, or several with their shares
    probability: float
    percent: str
    group: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RunView:
    """All that is said of a run, in one notation, as terminal and page show it.

    state: `fault`, `open`, `partial` or `healthy`. notes: what was not watched. remarks: what the verdict does not
    cover, a paragraph each. period, span: first and last time, and how long that is. events: alarms, that they are
    over, and what was accepted or rejected, in the order of time; True: an alarm. diagnosis: of the fault that is open,
    with its rows and checks. several: whether candidates cannot be told from the best. remainder, left_out: candidates
    that the rows leave out, and what may be true beside all candidates. contradicted: that the data contradict all of
    them; empty where they do not.
    """

    state: str
    verdict: str
    sensors: str
    step: str
    period: str
    span: str
    defects: str
    events: tuple[tuple[str, bool], ...]
    diagnosis: Diagnosis | None
    diagnosed_at: str = ""
    rows: tuple[TableRow, ...] = ()
    several: bool = False
    remainder: str = ""
    left_out: str = ""
    contradicted: str = ""
    checks: tuple[CheckRow, ...] = ()
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()


def view_of(graph: BondGraph, history: History, counts: RunCounts, notation: Notation) -> RunView:
    """Give all that is to be said of a run."""
    history = judged(history, counts)
    events = [
        (item.time, detection_sentence(item, is_known_to_alarm=graph.false_alarms > 0), True)
        for item in history.detections
    ]
    events += [(item.time, accepted_sentence(graph, item), False) for item in history.accepted]
    events += [(item.time, rejected_sentence(graph, item), False) for item in history.rejected]
    diagnosis = open_diagnosis(history)
    rows = table_rows(graph, diagnosis, notation) if diagnosis else ()
    return RunView(
        state=_state(history, counts),
        verdict=" ".join(
            (
                *counts.hints,
                verdict_sentence(graph, history, counts, notation),
                *course_sentences(graph, history, diagnosis),
            )
        ),
        sensors=", ".join(sensor.name for sensor in graph.sensors),
        step=step_text(graph),
        period=" to ".join(clock_text(float(history.time[end])) for end in (0, -1)) if len(history.time) else "",
        span=duration_text(_span(graph, history, counts)),
        defects=counts.defects(),
        events=tuple((text, alarm) for _, text, alarm in sorted(events, key=lambda event: event[0])),
        diagnosis=diagnosis,
        diagnosed_at=clock_text(diagnosis.time) if diagnosis else "",
        rows=rows,
        several=sum(row.group for row in rows) > 1,
        remainder=remainder_text(diagnosis, rows) if diagnosis else "",
        left_out=beside(diagnosis) if diagnosis else "",
        contradicted=CONTRADICTED if diagnosis is not None and diagnosis.unexplained is not None else "",
        checks=check_rows(graph, diagnosis, notation) if diagnosis else (),
        notes=_notes(counts),
        remarks=counts.remarks,
    )


def judged(history: History, counts: RunCounts) -> History:
    """Give what a run found that counts: no alarm in rows that are too much out of order."""
    return replace(history, detections=(), diagnoses=(), open=None) if counts.disorder else history


def _state(history: History, counts: RunCounts) -> str:
    """Give how a run stands, in a word."""
    if history.detections:
        return "fault"
    if counts.no_verdict:
        return "open"
    return "partial" if unwatched(counts.silent) else "healthy"


def _notes(counts: RunCounts) -> tuple[str, ...]:
    """Say where text stands for a number, which sensors and inputs gave no value, and what follows."""
    told = [item.sentence(clock_text) for item in counts.silent]
    more = len(told) - NOTES
    told = [*told[:NOTES], f"so with {more} more sensors and inputs"] if more > 1 else told
    return tuple(f"{text[0].upper()}{text[1:]}." for text in (*counts.texts, *told))


def step_text(graph: BondGraph) -> str:
    """Say how often a plant is sampled."""
    return f"every {duration_text(graph.sample_time)}" if graph.sample_time else "as the rows come"


def last_diagnosis(history: History) -> Diagnosis | None:
    """Give the last diagnosis that names a candidate."""
    return next((diagnosis for diagnosis in reversed(history.diagnoses) if diagnosis.candidates), None)


def open_diagnosis(history: History) -> Diagnosis | None:
    """Give the last diagnosis of the alarm that is open."""
    began, last = history.open, last_diagnosis(history)
    return last if began is not None and last is not None and last.time >= began.time else None


def best_group(diagnosis: Diagnosis) -> tuple[Candidate, ...]:
    """Give the best candidate and all that cannot be told from it."""
    first, *others = diagnosis.candidates
    return (first, *(candidate for candidate in others if candidate.group))


def fault_probabilities(diagnosis: Diagnosis, *, instruments: bool) -> dict[str, float]:
    """Give for each component, or each suspected sensor or input, the probability that it is among those at fault."""
    totals: dict[str, float] = {}
    for candidate in diagnosis.candidates:
        chosen = [item for item in candidate.suspects if bool(instrument_of(item.parameter)[0]) is instruments]
        for component in dict.fromkeys(item.component for item in chosen):
            totals[component] = min(1.0, totals.get(component, 0.0) + candidate.probability)
    return totals


def detection_sentence(detection: Detection, *, is_known_to_alarm: bool = False) -> str:
    """Say when the alarm came, in which signals or by which walk, and how long after the onset.

    Of a model that is known to alarm on healthy data an alarm is no fault by itself.
    """
    what = "Alarm" if is_known_to_alarm else "Fault detected"
    if detection.walk is not None:
        return _walk_sentence(what, detection, detection.walk)
    where = f" in {join(detection.signals)}" if detection.signals else ""
    delay = detection.time - detection.change_time
    after = f"delay {duration_text(delay)}" if delay >= 0.0 else "by the clock as it was before it was set back"
    return (
        f"{what} at {clock_text(detection.time)}{where}; "
        f"it has shown since about {clock_text(detection.change_time)} ({after})."
    )


def contradiction_sentence(detection: Detection) -> str:
    """Say of a network without time which row contradicts it, and which readings do."""
    return f"row {detection.sample} contradicts the healthy network: {join(detection.signals)}."


def _walk_sentence(what: str, detection: Detection, walk: Walk) -> str:
    """Say that the healthy filter had to follow a parameter too far."""
    named = f"{walk.parameter} and others, which" if walk.together else f"{walk.parameter}, which"
    told = f"{what} at {clock_text(detection.time)}, by {named} the healthy model had to move"
    began = clock_text(detection.change_time)
    if walk.from_start:
        return f"{told} {walk.sd:.1f} times as far as its accuracy: it was there from {began} on."
    return (
        f"{told} {walk.sd:.1f} times as far as is usual; it began after {began}, "
        "too slowly for the sensors to show it at once."
    )


def accepted_sentence(graph: BondGraph, accepted: Decision) -> str:
    """Say what was accepted, with its values, when, and by whom."""
    if accepted.is_of_nothing:
        when = clock_text(accepted.time)
        return f"Over by itself at {when}: for long nothing was further off than healthy parts may be."
    told = f"{_set_and_kind(graph, accepted.candidate)} ({probability_text(accepted.candidate.probability)} %)"
    if accepted.repaired:
        return f"Repaired at {clock_text(accepted.time)}: {told}. It is as the model file says again."
    by, found = " by rule" if accepted.by is Decider.RULE else "", accepted.candidate
    changes = [change_of(graph, found, item, accepted.time, Notation.FILE) for item in found.suspects]
    values = f"; {join(changes)}" if changes else ""
    return f"Accepted{by} at {clock_text(accepted.time)}: {told}{values}. It is the new normal.{_doubt_of(found)}"


def _doubt_of(accepted: Candidate) -> str:
    """Say of what was accepted that it changes next to nothing, or that the data speak against it; mostly empty."""
    if all(
        item.nominal and item.rate is None and abs(item.estimate - item.nominal) < HARDLY * abs(item.nominal)
        for item in accepted.suspects
    ):
        return f" It is within {100.0 * HARDLY:g} % of what was normal before, so the next alarm may be the same one."
    if accepted.probability < IMPROBABLE and not accepted.group:
        return " The data speak against it, so the next alarm may be the same one."
    return ""


def rejected_sentence(graph: BondGraph, rejected: Decision) -> str:
    """Say what was ruled out."""
    candidate = rejected.candidate
    named = f"{set_name(graph, candidate)}, {candidate.kind.value} ({probability_text(candidate.probability)} %)"
    is_mixed = _has_instrument(candidate) and len(candidate.suspects) > 1  # contained in no other
    more = "" if is_mixed else ", and every set that contains it"
    return f"Rejected at {clock_text(rejected.time)}: {named}{more}."


def decided_text(graph: BondGraph, decided: Sequence[Decision]) -> str:
    """Name what was accepted or rejected, and when: `pipe K1 at 1885 s and leak K6 at 3900 s`; empty for none."""
    named = [item for item in decided if not item.is_of_nothing]
    return join([f"{_set_and_kind(graph, item.candidate)} at {clock_text(item.time)}" for item in named])


def ranking_text(graph: BondGraph, diagnosis: Diagnosis) -> str:
    """Give a line for each of the best candidates after a rejection, and what else may be true."""
    left = [item for item in diagnosis.candidates if item.probability > 0.0]
    told = ["What is left:"]
    told += [
        f"{probability_text(item.probability):>6} %  {set_name(graph, item)}, {item.kind.value}"
        for item in left[:RANKED_SETS]
    ]
    if len(left) > RANKED_SETS:
        told.append(f"         ... and {len(left) - RANKED_SETS} more")
    if diagnosis.unexplained is not None:
        told.append(unexplained_sentence(diagnosis.unexplained))
    return "\n".join([*told, *filter(None, [beside(diagnosis)])])


def verdict_sentence(graph: BondGraph, history: History, counts: RunCounts, notation: Notation) -> str:
    """Say in plain words what a run found."""
    if history.open is None and counts.no_verdict:
        return f"No verdict: {counts.no_verdict}."
    if history.open is None and history.detections:
        repaired, taken = (
            decided_text(graph, [item for item in history.accepted if item.repaired is is_so])
            for is_so in (True, False)
        )
        told = [f"Repaired: {repaired}."] if repaired else []
        told += [f"Accepted as the new normal: {taken}."] if taken else []
        if told:
            return " ".join([*told, "No other fault was found."])
        which = "The alarm was" if len(history.detections) == 1 else "Each alarm was"
        return f"{which} over by itself: nothing was further off than healthy parts may be. No fault is claimed."
    if history.open is None:
        span = duration_text(_span(graph, history, counts))
        return f"No fault found {_watched(graph, counts)}in {counts.samples} samples ({span})."
    diagnosis = open_diagnosis(history)
    if diagnosis is None:
        return "A fault was detected; there is no diagnosis yet."
    group = best_group(diagnosis)
    best = group[0]
    owners = _joined_owners(graph, best.suspects)
    changes = "; ".join(
        change_of(graph, best, suspect, diagnosis.time, notation)
        + (MOVES if suspect.moved and suspect.stopped is None else "")
        for suspect in best.suspects
    )
    off = reason_for_none(graph, diagnosis, history.open)
    if off and diagnosis.elsewhere:
        return off  # no suspect changed, so none is near
    if off:  # what comes nearest
        if len(group) > 1 or diagnosis.unexplained is not None:  # what does not explain the data has no value either
            named = _listed([set_name(graph, candidate) for candidate in group])
            return f"{off} Nearest {'comes' if len(group) == 1 else 'come'} {named}."
        changed = (
            "a change" if best.kind in (FaultKind.STEP, FaultKind.RAMP) and not _has_instrument(best) else "a fault"
        )
        what = "a drift" if best.kind is FaultKind.DRIFT and not _is_couple(best) else changed
        return f"{off} Nearest comes {what} of {owners}: {changes}."
    if len(group) > 1:
        listed = _listed([f"{_set_and_kind(graph, item)} ({100.0 * item.probability:.0f} %)" for item in group])
        shared = [item for item in best.suspects if all(item.parameter in other.parameters for other in group)]
        common = join([f"{item.parameter} of {_joined_owners(graph, [item])}" for item in shared])
        hint = f" All contain {common}." if shared else ""
        if not diagnosis.advice:
            return f"Cannot yet be told apart: {listed}; more data, or a change of input, would be needed.{hint}"
        best_next = "To tell what else, best" if shared else "Best"
        return (
            f"Cannot yet be told apart: {listed}.{hint} "
            f"{best_next} next: {action(graph, diagnosis.advice[0], notation)}."
        )
    return f"Most likely {_event(best, owners)}: {changes}{certainty(graph, diagnosis)}.{otherwise(best)}"


def _event(best: Candidate, owners: str) -> str:
    """Say of the best candidate that it changed, drifts, comes and goes, or is at fault."""
    one = len(best.components) == 1
    if best.kind is FaultKind.INTERMITTENT and not _has_stopped(best):
        return f"a fault of {owners} comes and goes"
    is_moved = best.kind in (FaultKind.STEP, FaultKind.RAMP, FaultKind.DRIFT)
    if is_moved and not (_has_instrument(best) or _is_couple(best)):
        return f"{owners} " + ("changed" if best.kind is not FaultKind.DRIFT else "drifts" if one else "drift")
    return f"{owners} {'is' if one else 'are'} at fault"


def _watched(graph: BondGraph, counts: RunCounts) -> str:
    """Say which sensors have watched the plant: `by flow `; empty where all have."""
    never = {item.name for item in counts.silent if item.role == SENSOR and not item.values}
    heard = [sensor.name for sensor in graph.sensors if sensor.name not in never]
    if not never or not heard:
        return ""
    return f"by {join(heard)} " if len(heard) <= NAMED_SETS else f"by {len(heard)} of {len(graph.sensors)} sensors "


def unfalsifiable_text(spec: EngineSpec) -> str:
    """Name the sets that are not tested since no data can contradict them: `{A, B}, {A, C} and 3 more`."""
    return _listed(["{" + ", ".join(spec.parameters[k].name for k in chosen) + "}" for chosen in spec.explain_anything])


def set_name(graph: BondGraph, candidate: Candidate) -> str:
    """Name a candidate: `pipe K1`, `pipe K1 with leak K6`, or `flow sensor`."""
    return " with ".join(_suspect_name(graph, suspect) for suspect in candidate.suspects)


def _suspect_name(graph: BondGraph, suspect: Suspect) -> str:
    owner = owner_of(graph, suspect)
    plain = suspect.component == suspect.parameter or instrument_of(suspect.parameter)[0]
    return owner if plain else f"{owner} {suspect.parameter}"


def table_rows(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> tuple[TableRow, ...]:
    """Give the rows of the ranked table that are worth a look, best first."""
    rows, worth, is_contradicted = [], NEGLIGIBLE + even_share(diagnosis), diagnosis.unexplained is not None
    for place, candidate in enumerate(diagnosis.candidates[:TABLE_ROWS]):
        if place < 3 or candidate.group or candidate.probability >= worth:
            suspects = [
                rows_of(graph, suspect, notation, "+ " if number else "")
                for number, suspect in enumerate(candidate.suspects)
            ]
            row = TableRow(
                suspects=tuple(chain.from_iterable(suspects)),
                kinds=_kinds_told(candidate),
                probability=0.0 if is_contradicted else candidate.probability,
                percent="" if is_contradicted else probability_text(candidate.probability),
                group=candidate.group or place == 0,
            )
            rows.append(row)
    return tuple(rows)


def _kinds_told(candidate: Candidate) -> tuple[str, ...]:
    """Give the kind of fault of a candidate, or several with their shares, a line each."""
    if _has_stopped(candidate):
        return ("record stands",)
    told = [(kind.value, share) for kind, share in candidate.kinds if share >= OTHERWISE]
    kinds = [f"{word} {100.0 * share:.0f} %" for word, share in told] if len(told) > 1 else [candidate.kind.value]
    return (*kinds, *([] if candidate.present else ["now gone"]))


def remainder_text(diagnosis: Diagnosis, rows: Sequence[TableRow]) -> str:
    """Say how many candidates the table leaves out and how improbable they are; empty where it shows all."""
    left = diagnosis.candidates[len(rows) :]
    if not left:
        return ""
    if diagnosis.unexplained is not None:
        return f"... and {len(left)} more"
    bound = max(candidate.probability for candidate in left)
    limit = 0.1 if bound < 0.001 else math.ceil(1000.0 * bound + 1e-9) / 10.0
    return f"... and {len(left)} more below {limit:g} %"


def _span(graph: BondGraph, history: History, counts: RunCounts) -> float:
    """Give the length of the recording in seconds; of its samples where the clock was set, or stood still for long."""
    span = float(history.time[-1] - history.time[0]) if len(history.time) else 0.0
    return counts.samples * graph.sample_time if counts.clock_jumps and graph.sample_time else max(span, 0.0)


def _joined_owners(graph: BondGraph, suspects: Sequence[Suspect]) -> str:
    return join(list(dict.fromkeys(with_article(owner_of(graph, suspect)) for suspect in suspects)))


def _has_instrument(candidate: Candidate) -> bool:
    return any(instrument_of(suspect.parameter)[0] for suspect in candidate.suspects)


def _has_stopped(candidate: Candidate) -> bool:
    """Whether it is an input whose record has stopped, and nothing else."""
    return len(candidate.suspects) == 1 and candidate.suspects[0].stopped is not None


def _is_couple(candidate: Candidate) -> bool:
    """Whether one of its suspects has another kind of fault than the others, which are steps."""
    return candidate.kind is FaultKind.DRIFT and any(suspect.rate is None for suspect in candidate.suspects)


def _set_and_kind(graph: BondGraph, candidate: Candidate) -> str:
    """Name a candidate, and the kind of each fault that is not a step: `flow sensor drifting with pipe K1`."""
    if len(candidate.suspects) == 1 or candidate.kind is FaultKind.INTERMITTENT:
        return set_name(graph, candidate) + _ENDINGS.get(candidate.kind, f" {candidate.kind.value}")
    return " with ".join(_suspect_name(graph, suspect) + _ending(suspect) for suspect in candidate.suspects)


def _ending(suspect: Suspect) -> str:
    """Say what kind of fault one of several suspects has, where that is not a step."""
    if suspect.rate is not None:
        return _ENDINGS[FaultKind.DRIFT]
    if suspect.began is not None:
        return _ENDINGS[FaultKind.RAMP]
    word = instrument_of(suspect.parameter)[1]
    return f" {word}" if word else ""


def _listed(names: Sequence[str]) -> str:
    more = len(names) - NAMED_SETS
    return join([*names[:NAMED_SETS], f"{more} more"] if more > 0 else names)
