"""What a run found, in words and in table rows; the terminal and the page print the same."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from faultbond.model.graph import BondGraph, Parameter, Unit
from faultbond.report.numbers import (
    Notation,
    certainty_text,
    change_text,
    clock_text,
    duration_text,
    figure,
    probability_text,
    unit_text,
)
from faultbond.runtime.history import Candidate, Detection, Diagnosis, History, Suspect
from faultbond.spec import EngineSpec

UNDETERMINED = "not determined by the data"
UNDETERMINED_SHARE = 0.9  # of the sd that a faulty value has before the data are seen
TABLE_ROWS = 8
NEGLIGIBLE = 0.001  # candidates below are listed only to fill the first three rows
LISTED_SETS = 4  # candidates of a group named in a sentence


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """Samples of a run: grid points passed, and defects of the recording. Keys of the `end` record.

    no_verdict: why the run says nothing about the plant; empty where it does.
    """

    samples: int
    missing: int = 0
    late: int = 0
    duplicate: int = 0
    no_verdict: str = ""

    def defects(self) -> str:
        """Say what was wrong with the recording, `3 missing, 1 late`; empty where nothing was."""
        found = ((self.missing, "missing"), (self.late, "late"), (self.duplicate, "duplicate"))
        return ", ".join(f"{number} {name}" for number, name in found if number)


@dataclass(frozen=True, slots=True, kw_only=True)
class SuspectRow:
    """One suspect of a table row, all text."""

    component: str
    parameter: str
    nominal: str
    estimate: str  # value ± sd, or that the data do not determine it
    unit: str
    change: str  # of nominal; empty where that says nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One candidate of the ranked table."""

    suspects: tuple[SuspectRow, ...]
    probability: float
    percent: str
    group: bool


def unit_of(graph: BondGraph, name: str) -> Unit:
    """Give the model file's unit of a suspect; of `flow.bias` the unit of the sensor or input `flow`."""
    for parameter in graph.parameters:
        if parameter.name == name:
            return parameter.unit
    signal, _, kind = name.partition(".")
    if kind == "bias":
        units = {sensor.name: sensor.unit for sensor in graph.sensors}
        units |= {item.name: item.unit for item in graph.inputs}
        if signal in units:
            return Unit(units[signal].text, units[signal].factor)
    return Unit("")


def is_undetermined(graph: BondGraph, suspect: Suspect) -> bool:
    """Tell whether the data left the suspect as uncertain as a faulty value is beforehand."""
    if not (math.isfinite(suspect.sd) and math.isfinite(suspect.estimate)):
        return True
    known: dict[str, Parameter] = {item.name: item for item in graph.parameters}
    parameter = known.get(suspect.parameter)
    return parameter is not None and suspect.sd >= UNDETERMINED_SHARE * parameter.change


def last_diagnosis(history: History) -> Diagnosis | None:
    """Give the last diagnosis that names a candidate."""
    named = [diagnosis for diagnosis in history.diagnoses if diagnosis.candidates]
    return named[-1] if named else None


def best_group(diagnosis: Diagnosis) -> tuple[Candidate, ...]:
    """Give the best candidate and all that cannot be told from it."""
    first, *others = diagnosis.candidates
    return (first, *(candidate for candidate in others if candidate.group))


def component_probabilities(diagnosis: Diagnosis | None) -> dict[str, float]:
    """Give for each component the probability that it is among the changed ones."""
    totals: dict[str, float] = {}
    for candidate in diagnosis.candidates if diagnosis else ():
        for component in candidate.components:
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


def verdict_sentence(graph: BondGraph, history: History, counts: Counts, notation: Notation) -> str:
    """Say in plain words what a run found."""
    if not history.detections and counts.no_verdict:
        return f"No verdict: {counts.no_verdict}."
    if not history.detections:
        span = duration_text(span_of(history))
        return f"No fault found in {counts.samples} samples ({span})."
    diagnosis = last_diagnosis(history)
    if diagnosis is None:
        return "A fault was detected; there is no diagnosis yet."
    group = best_group(diagnosis)
    return _sure(graph, group[0], notation) if len(group) == 1 else _unsure(group)


def span_of(history: History) -> float:
    """Give the length of the recording in seconds."""
    return float(history.time[-1] - history.time[0]) if len(history.time) else 0.0


def _sure(graph: BondGraph, candidate: Candidate, notation: Notation) -> str:
    owners = join([f"the {name}" for name in candidate.components])
    changes = "; ".join(_change(graph, suspect, notation) for suspect in candidate.suspects)
    return f"Most likely {owners} changed: {changes}, {certainty_text(candidate.probability)}."


def _change(graph: BondGraph, suspect: Suspect, notation: Notation) -> str:
    if is_undetermined(graph, suspect):
        return f"{suspect.parameter} is {UNDETERMINED}"
    unit = unit_of(graph, suspect.parameter)
    label = unit_text(unit.text, notation)
    after = f" {label}" if label else ""
    nominal = figure(unit.from_si(suspect.nominal)).number(notation)
    estimate = figure(unit.from_si(suspect.estimate), unit.difference_from_si(suspect.sd)).number(notation)
    if abs(suspect.estimate - suspect.nominal) < 2.0 * suspect.sd:
        return f"{suspect.parameter} may still be {nominal}{after}"
    verb = "rose" if suspect.estimate > suspect.nominal else "fell"
    change = change_text(suspect.nominal, suspect.estimate, suspect.sd)
    return f"{suspect.parameter} {verb} from {nominal} to {estimate}{after}" + (f" ({change})" if change else "")


def _unsure(group: Sequence[Candidate]) -> str:
    names = [f"{set_name(candidate)} ({100.0 * candidate.probability:.0f} %)" for candidate in group]
    more = len(names) - LISTED_SETS
    listed = join([*names[:LISTED_SETS], f"{more} more"] if more > 0 else names)
    shared = [suspect for suspect in group[0].suspects if all(suspect.parameter in other.parameters for other in group)]
    common = join([f"{suspect.parameter} of the {suspect.component}" for suspect in shared])
    hint = f" All contain {common}." if shared else ""
    return f"Cannot yet be told apart: {listed}; more data, or a change of input, would be needed.{hint}"


def set_name(candidate: Candidate) -> str:
    """Name a candidate: `pipe K1`, or `pipe K1 with leak K6`."""
    return " with ".join(
        suspect.component if suspect.component == suspect.parameter else f"{suspect.component} {suspect.parameter}"
        for suspect in candidate.suspects
    )


def unfalsifiable_text(spec: EngineSpec) -> str:
    """Name the sets that are not tested since no data can contradict them: `{A, B}, {A, C} and 3 more`."""
    sets = ["{" + ", ".join(spec.parameters[k].name for k in chosen) + "}" for chosen in spec.explain_anything]
    more = len(sets) - LISTED_SETS
    return join([*sets[:LISTED_SETS], f"{more} more"] if more > 0 else sets)


def join(words: Sequence[str]) -> str:
    """Join words with commas and a last `and`."""
    return " and ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


def table_rows(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> tuple[Row, ...]:
    """Give the rows of the ranked table that are worth a look, best first."""
    shown = [
        candidate
        for place, candidate in enumerate(diagnosis.candidates[:TABLE_ROWS])
        if place < 3 or candidate.group or candidate.probability >= NEGLIGIBLE
    ]
    return tuple(
        Row(
            suspects=tuple(_suspect_row(graph, suspect, notation) for suspect in candidate.suspects),
            probability=candidate.probability,
            percent=probability_text(candidate.probability),
            group=candidate.group or place == 0,
        )
        for place, candidate in enumerate(shown)
    )


def remainder_text(diagnosis: Diagnosis, rows: Sequence[Row]) -> str:
    """Say how many candidates the table leaves out and how improbable they are; empty where it shows all."""
    left = diagnosis.candidates[len(rows) :]
    if not left:
        return ""
    bound = max(candidate.probability for candidate in left)
    limit = 0.1 if bound < 0.001 else math.ceil(1000.0 * bound + 1e-9) / 10.0
    return f"... and {len(left)} more below {limit:g} %"


def _suspect_row(graph: BondGraph, suspect: Suspect, notation: Notation) -> SuspectRow:
    unit = unit_of(graph, suspect.parameter)
    unknown = is_undetermined(graph, suspect)
    estimate = figure(unit.from_si(suspect.estimate), unit.difference_from_si(suspect.sd)).both(notation)
    return SuspectRow(
        component=suspect.component,
        parameter=suspect.parameter,
        nominal=figure(unit.from_si(suspect.nominal)).number(notation),
        estimate=UNDETERMINED if unknown else estimate,
        unit=unit_text(unit.text, notation),
        change="" if unknown else change_text(suspect.nominal, suspect.estimate, suspect.sd),
    )
