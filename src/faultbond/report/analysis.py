"""What the analysis of a plant found, section by section: keys of its record, and text for people.

Records are plain mappings ready for JSON, in SI units; percent stays percent.
"""

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass

from rich.console import Console

from faultbond.analysis.capability import CapabilityView
from faultbond.analysis.comparison import NO_TIME
from faultbond.analysis.groups import Group, NearGroup
from faultbond.analysis.input_advice import Stimulus
from faultbond.analysis.other_roots import OtherSolutions
from faultbond.analysis.sensitivity import BIAS, GAIN
from faultbond.analysis.sensor_advice import SensorAdvice, SensorChoice
from faultbond.analysis.smallest import SmallestFault
from faultbond.analysis.testable import SetVerdict
from faultbond.analysis.twins import Comparison
from faultbond.contract.json_records import Record
from faultbond.diagnosability.isolability import Isolability
from faultbond.model.expression import names
from faultbond.model.graph import BondGraph, Component, Unit
from faultbond.model.units import measure
from faultbond.report.console import lines, table, title, under
from faultbond.report.names import LISTED, braced, listed, some
from faultbond.report.numbers import (
    clock_text,
    duration_text,
    figure,
    join,
    share_text,
    unit_text,
    with_noun,
    with_unit,
)
from faultbond.report.structure import causality_record, inseparable
from faultbond.types import ElementType

LISTED_SENSORS = 4
NO_EFFECT = 1e-3  # noise standard deviations below which an effect is none


@dataclass(frozen=True, slots=True, kw_only=True)
class StructuralTests:
    """How many minimal sets of equations can be checked (MSO), and the faults that each of the MTES responds to."""

    n_sets: int
    faults: tuple[tuple[str, ...], ...]


def groups_record(view: CapabilityView) -> Record:
    """Give what cannot be told apart, and why."""
    near = [{"sets": _named(view.names, item), "angle": item.angle, "reason": item.reason} for item in view.near_groups]
    return {
        "rank": view.judgement.rank.value,
        "groups": [_named(view.names, group) for group in view.groups],
        "group_reasons": [group.reason for group in view.groups],
        "sudden_groups": [_named(view.names, group) for group in view.sudden_groups],
        "sudden_group_reasons": [group.reason for group in view.sudden_groups],
        "near_groups": near,
    }


def _named(names: Sequence[str], group: Group | NearGroup) -> list[list[str]]:
    """Give the names in the sets of a group."""
    return [[names[k] for k in chosen] for chosen in group.sets]


def print_view(console: Console, graph: BondGraph, view: CapabilityView, heading: str, note: str) -> None:
    """Print how many sets are testable, and which cannot be told apart, without what follows from smaller sets."""
    title(console, heading, note)
    verdicts, rank, n_parameters = view.judgement.verdicts, view.judgement.rank, len(graph.parameters)
    total = Counter(len(item.parameters) for item in verdicts)
    testable = Counter(len(item.parameters) for item in verdicts if item.testable)
    loose = Counter(len(item.parameters) for item in verdicts if not item.identifiable)
    counts = [(k, total[k], testable[k], total[k] - testable[k] - loose[k], loose[k]) for k in sorted(total)]
    header = ("suspects in a set", "sets", "testable", "explain anything", "values not fixed")
    table(console, header, [tuple(map(str, row)) for row in counts])
    all_of = f"the {n_parameters} parameters" if n_parameters > 1 else "the one parameter"
    trusted = [item.name for item in graph.parameters if not item.suspect]
    all_of += f", {join(trusted)} among them, which {'are' if len(trusted) > 1 else 'is'} trusted" if trusted else ""
    guess = "" if rank.clear else "; rounding decides, so this is a guess"
    shown = f"{with_noun(rank.value, 'combination')} of {all_of}{guess}"
    found = _groups_told(view.names, "cannot be told apart", view.sudden_groups, view.sudden_groups)
    at_once = [set(group.sets) for group in view.sudden_groups]
    later = [group for group in view.groups if not any(set(group.sets) <= alike for alike in at_once)]
    found += _groups_told(view.names, "alike but for how they begin", later, view.groups)
    found += under("hard to tell apart", listed([_group_text(view.names, group) for group in view.near_groups]))
    alike = "all testable sets can be told apart" if testable.total() else "no set is testable"
    lines(console, [("shows", shown), *(found or [("groups", alike)])])


def _groups_told(
    names: Sequence[str], label: str, groups: Sequence[Group], among: Sequence[Group]
) -> list[tuple[str, str]]:
    """Name the groups, and count those that follow from smaller ones among them and others."""
    known = {frozenset(group.sets) for group in among}
    first = [group for group in groups if not _follows(group, known)]
    found = under(label, listed([_group_text(names, group) for group in first]))
    if len(first) < len(groups):
        larger = with_noun(len(groups) - len(first), "larger group")
        found.append(("", f"{larger} of which this follows; --json writes them"))
    return found


def _follows(group: Group, known: Collection[frozenset[tuple[int, ...]]]) -> bool:
    """Whether the sets look alike because they do without what all of them hold."""
    shared = set(group.sets[0]).intersection(*group.sets)
    rest = frozenset(tuple(k for k in chosen if k not in shared) for chosen in group.sets)
    return bool(shared) and rest in known


def _group_text(names: Sequence[str], group: Group | NearGroup) -> str:
    """Say what a group holds, and why: `{K4} and {K6}: ...`."""
    return f"{some([braced(item) for item in _named(names, group)])}: {group.reason}"


def structure_record(
    suspects: Sequence[str],
    found: Mapping[str, Isolability],
    tests: StructuralTests | None,
    sensors: Sequence[Sequence[str]],
) -> Record:
    """Give what the structure says, in mixed causality, and the same for stores that work one way only."""
    return {
        **causality_record(suspects, found),
        "tests": None if tests is None else {"mso": tests.n_sets, "mtes": [list(names) for names in tests.faults]},
        "structural_sensors": [list(names) for names in sensors],
    }


def print_structure(
    console: Console,
    suspects: Sequence[str],
    found: Mapping[str, Isolability],
    tests: StructuralTests | None,
    sensors: Sequence[Sequence[str]],
) -> None:
    """Print what the equations alone say, whatever the values of the parameters."""
    title(console, "By structure alone", "which equation checks which; values and time, which `run` uses, tell more")
    mixed = found["mixed"]
    hidden = [name for name, seen in zip(suspects, mixed.detectable, strict=True) if not seen]
    seen = f"all but {', '.join(hidden)}" if len(hidden) < len(suspects) else "none"
    items = [("detectable", seen if hidden else "all faults")]
    if len(suspects) - len(hidden) > 1:
        together = [f"within {braced(names)}" for names in inseparable(suspects, mixed) if len(names) > 1]
        alone = f"none: each {'detectable fault' if hidden else 'fault'} can be told from every other"
        items.append(("not isolable", join(together) if together else alone))
    pairs = {name: int(item.isolable.sum()) for name, item in found.items()}
    if pairs["mixed"]:
        words = (("integral", "integrating only"), ("derivative", "differentiating only"))
        kept = [f"{pairs[name]} of {pairs['mixed']} isolable pairs by {text}" for name, text in words]
        items.append(("one way", "; ".join(kept)))
    if tests is not None:
        sets, smallest = with_noun(tests.n_sets, "minimal set"), some([braced(names) for names in tests.faults])
        text = f"{sets} of equations can be checked; the smallest sets of faults that a check sees: {smallest}"
        items.append(("tests", text))
    if sensors:
        named = [" with ".join(names) for names in sensors[:LISTED_SENSORS]]
        named += [with_noun(len(sensors) - LISTED_SENSORS, "other")] if len(sensors) > LISTED_SENSORS else []
        items.append(("to isolate more", f"a sensor of {', or of '.join(named)}"))
    lines(console, items)


def hypotheses_record(
    graph: BondGraph,
    view: CapabilityView,
    recorded: CapabilityView | None,
    solutions: Sequence[OtherSolutions],
    twins: Comparison,
) -> Record:
    """Give the verdict on every set, with the number of values that look the same, and the sets that imitate others."""
    known = {item.parameters: item for item in solutions}
    on_data = {item.parameters: item for item in recorded.judgement.verdicts} if recorded else {}
    hypotheses = []
    for item in view.judgement.verdicts:
        names = [graph.parameters[k].name for k in item.parameters]
        solution = known.get(tuple(names))
        roots = None if solution is None else solution.roots
        record: Record = {"parameters": names, **_verdict(item), "uncertain": item.uncertain, "roots": roots}
        if solution is not None and solution.others:
            record["other_values"] = [dict(zip(names, values, strict=True)) for values in solution.others]
        if item.parameters in on_data:
            record["on_data"] = _verdict(on_data[item.parameters])
        hypotheses.append(record)
    return {
        "hypotheses": hypotheses,
        "sets_left_out": view.judgement.left_out,
        "twins": [
            {"first": list(item.first), "second": list(item.second), "always": item.always, "words": item.words}
            for item in twins.found
        ],
        "twins_left_out": twins.left_out,
    }


def _verdict(item: SetVerdict) -> Record:
    return {"identifiable": item.identifiable, "falsifiable": item.falsifiable, "testable": item.testable}


def print_solutions(console: Console, graph: BondGraph, solutions: Sequence[OtherSolutions], twins: Comparison) -> None:
    """Print other values that would look the same, and sets of suspects that can imitate each other."""
    title(console, "Other values that look the same", "of long records without noise")
    looked = [item for item in solutions if not item.skipped]
    several = [item for item in looked if not item.unique]
    rows = [
        (braced(item.parameters), _values(graph, item.parameters, item.true), other)
        for item in several
        for other in ([_values(graph, item.parameters, values) for values in item.others] or ["infinitely many"])
    ]
    if rows:
        table(console, ("suspects", "these values", "look exactly like"), rows[:LISTED])
    items = []
    if looked:
        sets = with_noun(len(looked), "set")
        items.append(("unique", f"{len(looked) - len(several)} of {sets}: a record leaves one set of values"))
    elif not solutions:
        items.append(("", "there is no set whose values data fix"))
    if len(rows) > LISTED:
        items.append(("more", f"{with_noun(len(rows) - LISTED, 'line')} as above; --json writes all"))
    skipped = Counter(item.skipped for item in solutions if item.skipped)
    items += [("not looked at", f"{with_noun(count, 'set')}: {reason}") for reason, count in skipped.items()]
    plain = [item.words for item in twins.found if item.always or item.first_powers is not None]
    words, odd = listed(plain), len(twins.found) - len(plain)  # of pairs that meet in odd proportions only the number
    if odd:
        meet = f"of sets {'looks' if odd == 1 else 'look'} alike for faults in certain proportions; --json writes them"
        words.append(f"{with_noun(odd, 'other pair')} {meet}")
    if twins.left_out:
        were = "was" if twins.left_out == 1 else "were"
        words.append(
            f"{with_noun(twins.left_out, 'pair')} of sets {were} not compared; --budget raises the time for that"
        )
    lines(console, [*items, *under("twins", words)])


def _values(graph: BondGraph, names: Sequence[str], values: Sequence[float]) -> str:
    units = [graph.parameter(name).unit for name in names]
    found = zip(names, units, values, strict=True)
    return ", ".join(f"{name} = {with_unit(unit.from_si(value), unit.text, digits=4)}" for name, unit, value in found)


def smallest_record(found: Sequence[SmallestFault]) -> Record:
    """Give the smallest fault of each parameter, SI."""
    return {
        "smallest_fault": {
            item.parameter: {
                "value": item.value,
                "claimed": item.claimed if math.isfinite(item.claimed) else None,
                "within": item.within,
                "up": item.up,
                "down": item.down,
                "certainty": item.certainty,
                "onsets": list(item.onsets),
                "reason": item.reason or None,
                "alike": list(item.alike),
                "effects": {
                    effect.output: {"size": effect.size, "in_noise": effect.in_noise} for effect in item.effects
                },
            }
            for item in found
        }
    }


def print_smallest(
    console: Console, graph: BondGraph, found: Sequence[SmallestFault], guessed: Mapping[str, float]
) -> None:
    """Print the smallest fault of each parameter that is found in time.

    guessed : about where inputs are taken to be of which nobody says anything, SI, by name
    """
    if not found:
        return
    within = duration_text(found[0].within)
    cases = f"within {within}, in {100 * found[0].certainty:.0f} of 100 cases"
    title(console, "Smallest faults that are detected", cases)
    lines(console, guess_lines(graph, guessed))
    rows = []
    for item in found:
        unit, nominal = _unit_of(graph, item.parameter)
        change, part, effects = "not looked for" if item.reason == NO_TIME else "not found", "", item.reason
        if item.value is not None:
            change = figure(unit.difference_from_si(item.value), digits=3).number()
            part = share_text(item.value / abs(nominal), digits=3) if nominal else ""
            effects = ", ".join(f"{x.output} {x.in_noise:.2g}" for x in item.effects if x.in_noise >= NO_EFFECT)
        rows.append((item.parameter, change, unit_text(unit.text), part, effects, ", ".join(item.alike)))
    header = ("parameter", "change", "unit", "of nominal", "largest effect, in noise sd", "then alike")
    table(console, header, rows)
    told = _claimed_lines(graph, found) + begun_lines(found)
    told += heat_lines(graph, [item.parameter for item in found])
    if not graph.slow_errors and not any(item.healthy_change for item in graph.parameters):
        exact = "of a plant that is as the model says. What a first model leaves out hides more: `fit --until-quiet`"
        told.append(("these are", exact))
    lines(console, told)


def begun_lines(found: Sequence[SmallestFault], of: str = "") -> list[tuple[str, str]]:
    """Say when smallest faults begin, in the recording `of` which they are, and what that hides; of none nothing."""
    if not found:
        return []
    moments, within = join([clock_text(time) for time in found[0].onsets]), duration_text(found[0].within)
    idle = f"what does nothing in {within} after one of these, as while a pump is off, is not found"
    return [("begun", f"at {moments}{of}: {idle}")] if moments else []


def _claimed_lines(graph: BondGraph, found: Sequence[SmallestFault]) -> list[tuple[str, str]]:
    """Say from which size on those are claimed of which smaller ones are found."""
    sizes = dict[str, list[str]]()
    for item in found:
        if item.value is not None and item.claimed > item.value:
            sizes.setdefault(_claimed_text(item.claimed, *_unit_of(graph, item.parameter)), []).append(item.parameter)
    if not sizes:
        return []
    told = "; ".join(f"{join(names)} {size}" for size, names in sizes.items())
    return [("claimed", f"{told}. A smaller change may be that of a healthy part (`accuracy`, `healthy_change`)")]


def _claimed_text(size: float, unit: Unit, nominal: float) -> str:
    if math.isinf(size):
        return "never"
    part = share_text(size / abs(nominal), 3) if nominal else with_unit(unit.difference_from_si(size), unit.text)
    return f"from {part} on"


def guess_lines(graph: BondGraph, guessed: Mapping[str, float]) -> list[tuple[str, str]]:
    """Say about where inputs are taken to be of which nobody says anything."""
    if not guessed:
        return []
    units = {item.name: item.unit for item in graph.inputs}
    levels = [f"{name} about {with_unit(units[name].from_si(x), units[name].text)}" for name, x in guessed.items()]
    return [("inputs", f"{join(levels)}, since nobody says where: give `--data REC`, or their `range` in the model")]


def heat_lines(graph: BondGraph, names: Collection[str]) -> list[tuple[str, str]]:
    """Say of heat capacities among these what a smallest fault of them is; nothing where there is none.

    Heat counts from 0 K, unless the law counts it from elsewhere. One that stays where the capacity jumps is another
    temperature at once, by far more than a capacity that changes while the plant is cold, or slowly, ever shows.
    """
    units = {item.name: item.unit for item in graph.parameters} | {item.name: item.unit for item in graph.constants}
    kelvins = {name: dict(measure(unit.text).dimension.powers).get("kelvin", 0) for name, unit in units.items()}
    stores = {
        name
        for item in graph.components
        if item.type is ElementType.C and not any(kelvins.get(name) == 1 for name in _named_by(item))
        for name in item.parameters
    }
    told = [name for name in names if name in stores and kelvins[name] == -1]
    if not told:
        return []
    text = (
        "a jump, at which the heat stays; it counts from 0 K, so that 0.1 % are 0.3 K at once. "
        "A change that comes slowly has to be much larger. Count heat from a usual temperature: `q = C*(e - T0)`"
    )
    return [(join(told), text)]


def _named_by(part: Component) -> set[str]:
    """Give what the law of a component names."""
    return {name for law in part.laws for name in names(law.right)}


def _unit_of(graph: BondGraph, name: str) -> tuple[Unit, float]:
    """Give the unit of a parameter, or of what is wrong with an instrument, and its nominal value, SI."""
    if name.endswith(GAIN):
        return Unit(""), 1.0
    if name.endswith(BIAS):
        units = {item.name: item.unit for item in graph.inputs} | {item.name: item.unit for item in graph.sensors}
        return units[name.removesuffix(BIAS)], 0.0
    parameter = graph.parameter(name)
    return parameter.unit, parameter.nominal


def sensors_record(graph: BondGraph, advice: SensorAdvice) -> Record:
    """Give which further sensors would tell more, best first, beside the plant as it is."""
    return {
        "sensor_advice": [_choice_record(graph, item) for item in advice.further],
        "sensors_now": _choice_record(graph, advice.now),
        "sensors_not_tried": advice.left_out,
    }


def _choice_record(graph: BondGraph, item: SensorChoice) -> Record:
    return {
        "sensors": list(item.sensors),
        "rank": item.rank,
        "testable": item.testable,
        "classes": item.classes,
        "near": item.near,
        "groups": [_named([one.name for one in graph.parameters], group) for group in item.groups],
    }


def print_sensor_advice(console: Console, advice: SensorAdvice) -> None:
    """Print which further sensors would tell more."""
    title(console, "Further sensors", "each of the signals that the bonds allow, noise 1 % of its size")
    if not advice.further:
        lines(console, [("", "no further sensor would tell more")])
        return
    rows = [
        _choice_row(advice.now, "as it is"),
        *(_choice_row(item, " and ".join(item.sensors)) for item in advice.further),
    ]
    header = ("sensor", "testable sets", "of which differ", "hard to tell apart", "combinations shown")
    table(console, header, rows)
    if advice.left_out:
        lines(console, [("", f"{advice.left_out} combinations were not tried")])


def _choice_row(item: SensorChoice, name: str) -> tuple[str, ...]:
    return (name, str(item.testable), str(item.classes), str(item.near), str(item.rank))


def inputs_record(found: Sequence[Stimulus]) -> Record:
    """Give which input to move, for each group of sets that look alike; SI, percent stays percent."""
    advice = [
        {"sets": [list(names) for names in item.sets], "words": item.words, "choices": list(map(asdict, item.choices))}
        for item in found
    ]
    return {"input_advice": advice}


def print_input_advice(console: Console, found: Sequence[Stimulus], note: str, *, alike: bool) -> None:
    """Print which input to move so that sets can be told apart; the note says where they look alike, if any do."""
    title(console, "Test inputs", note)
    if not found:
        enough = "what looks alike differs enough in a record as long as a test, so no move of an input is needed"
        lines(console, [("", enough if alike else "no two suspects look alike, so no move of an input is needed")])
        return
    for item in found:
        named = join([braced(names) for names in item.sets])
        choices = [("", choice.words) for choice in item.choices[1:3]]
        lines(console, [(named, item.words), *choices])
