"""What the analysis of a plant found, as text for people."""

from collections import Counter
from collections.abc import Collection, Iterable, Sequence

from rich.console import Console

from faultbond.analysis.capability import CapabilityView
from faultbond.analysis.groups import Group
from faultbond.analysis.input_advice import Stimulus
from faultbond.analysis.sensor_advice import SensorAdvice, SensorChoice
from faultbond.analysis.smallest import SmallestFault
from faultbond.analysis.solutions import OtherSolutions
from faultbond.analysis.twins import Comparison
from faultbond.diagnosability.isolability import Isolability
from faultbond.model.graph import BondGraph
from faultbond.report.analysed import Tests
from faultbond.report.console import lines, table, title
from faultbond.report.numbers import Notation, duration_text, figure, unit_text
from faultbond.report.verdict import join

LISTED = 12  # groups, near groups and the like that are listed
LISTED_SENSORS = 4
NOWHERE = "not found"
NO_EFFECT = 1e-3  # noise standard deviations below which an effect is none


def print_view(console: Console, graph: BondGraph, view: CapabilityView, heading: str, note: str) -> None:
    """Print how many sets are testable, and which cannot be told apart."""
    title(console, heading, note)
    rows = _verdict_rows(view)
    table(console, ("suspects in a set", "sets", "testable", "explain anything", "values not fixed"), rows)
    lines(console, _shown(view, len(graph.parameters)) + _alike(graph, view))


def _shown(view: CapabilityView, n_parameters: int) -> list[tuple[str, str]]:
    rank = view.judgement.rank
    all_of = f"the {n_parameters} parameters" if n_parameters > 1 else "the one parameter"
    shown = f"{counted(rank.value, 'combination')} of {all_of}"
    return [("shows", shown if rank.clear else f"{shown}; rounding decides, so this is a guess")]


def _alike(graph: BondGraph, view: CapabilityView) -> list[tuple[str, str]]:
    """Say what cannot be told apart, without what follows from smaller sets, and what nearly so."""
    known = {frozenset(group.sets) for group in view.groups}
    first = [group for group in view.groups if not _follows(group, known)]
    told = [(_sets(graph, group.sets), group.reason) for group in first]
    near = [(_sets(graph, group.sets), group.reason) for group in view.near_groups]
    same = f"{counted(len(view.groups) - len(first), 'larger group')} of which this follows; --json writes them"
    found = _group_lines("cannot be told apart", told)
    found += [("", same)] if len(first) < len(view.groups) else []
    found += _group_lines("hard to tell apart", near)
    if found:
        return found
    testable = sum(item.testable for item in view.judgement.verdicts)
    return [("groups", "all testable sets can be told apart" if testable else "no set is testable")]


def _follows(group: Group, known: Collection[frozenset[tuple[int, ...]]]) -> bool:
    """Whether the sets look alike because they do without what all of them hold."""
    shared = set(group.sets[0]).intersection(*group.sets)
    rest = frozenset(tuple(k for k in chosen if k not in shared) for chosen in group.sets)
    return bool(shared) and rest in known


def counted(number: int, noun: str) -> str:
    """Give a number with its noun: `1 set`, `2 sets`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _verdict_rows(view: CapabilityView) -> list[tuple[str, ...]]:
    verdicts = view.judgement.verdicts
    total = Counter(len(item.parameters) for item in verdicts)
    testable = Counter(len(item.parameters) for item in verdicts if item.testable)
    loose = Counter(len(item.parameters) for item in verdicts if not item.identifiable)
    rest = {size: total[size] - testable[size] - loose[size] for size in total}
    counts = [(size, total[size], testable[size], rest[size], loose[size]) for size in sorted(total)]
    return [tuple(str(number) for number in row) for row in counts]


def _group_lines(label: str, found: Sequence[tuple[str, str]]) -> list[tuple[str, str]]:
    items = _listed([f"{sets}: {reason}" for sets, reason in found])
    return [(label if k == 0 else "", text) for k, text in enumerate(items)]


def _listed(items: Sequence[str]) -> list[str]:
    """Give what is listed, and a line that counts the rest."""
    more = [f"... and {len(items) - LISTED} more; --json writes all"] if len(items) > LISTED else []
    return [*items[:LISTED], *more]


def _sets(graph: BondGraph, sets: Iterable[Sequence[int]]) -> str:
    """Name sets: `{K4} and {K6}`."""
    return _some(["{" + ", ".join(graph.parameters[k].name for k in chosen) + "}" for chosen in sets])


def _some(named: Sequence[str]) -> str:
    """Name what is listed, and count the rest."""
    return join([*named[:LISTED], f"{len(named) - LISTED} more"] if len(named) > LISTED else named)


def print_structure(
    console: Console,
    suspects: Sequence[str],
    found: dict[str, Isolability],
    tests: Tests | None,
    sensors: Sequence[Sequence[str]],
) -> None:
    """Print what the equations alone say, whatever the values of the parameters."""
    title(console, "By structure alone", "which equation checks which, whatever the values")
    mixed = found["mixed"]
    hidden = [name for name, seen in zip(suspects, mixed.detectable, strict=True) if not seen]
    together = ["{" + ", ".join(names) + "}" for names in structural_groups(suspects, mixed) if len(names) > 1]
    seen = f"all but {', '.join(hidden)}" if len(hidden) < len(suspects) else "none"
    faults = "detectable fault" if hidden else "fault"
    items = [("detectable", seen if hidden else "all faults")]
    if len(suspects) - len(hidden) > 1:
        alone = f"none: each {faults} can be told from every other"
        items.append(("not isolable", join(together) if together else alone))
    pairs = {name: int(item.isolable.sum()) for name, item in found.items()}
    if pairs["mixed"]:
        words = (("integral", "integrating only"), ("derivative", "differentiating only"))
        kept = [f"{pairs[name]} of {pairs['mixed']} isolable pairs by {text}" for name, text in words]
        items.append(("one way", "; ".join(kept)))
    if tests is not None:
        smallest = _some(["{" + ", ".join(names) + "}" for names in tests.faults])
        sets = counted(tests.n_sets, "minimal set")
        text = f"{sets} of equations can be checked; the smallest sets of faults that a check sees: {smallest}"
        items.append(("tests", text))
    if sensors:
        named = [" with ".join(names) for names in sensors[:LISTED_SENSORS]]
        named += [counted(len(sensors) - LISTED_SENSORS, "other")] if len(sensors) > LISTED_SENSORS else []
        items.append(("to isolate more", f"a sensor of {', or of '.join(named)}"))
    lines(console, items)


def structural_groups(suspects: Sequence[str], found: Isolability) -> tuple[tuple[str, ...], ...]:
    """Give the classes of detectable faults of which none can be told from another, by structure."""
    groups: list[list[int]] = []
    for k in range(len(suspects)):
        if not found.detectable[k]:
            continue
        for group in groups:
            if not found.isolable[k, group[0]] and not found.isolable[group[0], k]:
                group.append(k)
                break
        else:
            groups.append([k])
    return tuple(tuple(suspects[k] for k in group) for group in groups)


def print_solutions(console: Console, graph: BondGraph, solutions: Sequence[OtherSolutions], twins: Comparison) -> None:
    """Print other values that would look the same, and sets of suspects that can imitate each other."""
    title(console, "Other values that look the same", "of long records without noise")
    looked = [item for item in solutions if not item.skipped]
    several = [item for item in looked if not item.unique]
    rows = [
        ("{" + ", ".join(item.parameters) + "}", _values(graph, item.parameters, item.true), other)
        for item in several
        for other in ([_values(graph, item.parameters, values) for values in item.others] or ["infinitely many"])
    ]
    if rows:
        table(console, ("suspects", "these values", "look exactly like"), rows[:LISTED])
    alone = len(looked) - len(several)
    what = f"{alone} of {counted(len(looked), 'set')}: a record leaves one set of values"
    nothing = [] if solutions else [("", "there is no set whose values data fix")]
    unique = [("unique", what)] if looked else nothing
    skipped = Counter(item.skipped for item in solutions if item.skipped)
    rest = [("not looked at", f"{counted(count, 'set')}: {reason}") for reason, count in skipped.items()]
    if len(rows) > LISTED:
        rest = [("more", f"{counted(len(rows) - LISTED, 'line')} as above; --json writes all"), *rest]
    words = _twins(twins)
    lines(console, [*unique, *rest, *(("twins" if k == 0 else "", text) for k, text in enumerate(words))])


def _twins(twins: Comparison) -> list[str]:
    """Say what imitates what; of pairs that meet in odd proportions only how many there are."""
    plain = [item.words for item in twins.found if item.always or item.first_powers is not None]
    odd = len(twins.found) - len(plain)
    look, were = "looks" if odd == 1 else "look", "was" if twins.left_out == 1 else "were"
    meet = f"{counted(odd, 'other pair')} of sets {look} alike for faults in certain proportions; --json writes them"
    left = f"{counted(twins.left_out, 'pair')} of sets {were} not compared"
    return [*_listed(plain), *([meet] if odd else []), *([left] if twins.left_out else [])]


def _values(graph: BondGraph, names: Sequence[str], values: Sequence[float]) -> str:
    parts = []
    for name, value in zip(names, values, strict=True):
        unit = graph.parameter(name).unit
        text = figure(unit.from_si(value), digits=4).number(Notation.FILE)
        parts.append(f"{name} = {text} {unit_text(unit.text, Notation.FILE)}".rstrip())
    return ", ".join(parts)


def print_smallest(console: Console, graph: BondGraph, found: Sequence[SmallestFault]) -> None:
    """Print the smallest fault of each parameter that is found in time."""
    if not found:
        return
    within = f"within {duration_text(found[0].within)}, in {100 * found[0].certainty:.0f} of 100 cases"
    title(console, "Smallest faults that are detected", within)
    header = ("parameter", "change", "unit", "of nominal", "largest effect on the outputs, in noise sd")
    table(console, header, [_smallest(graph, item) for item in found])


def _smallest(graph: BondGraph, item: SmallestFault) -> tuple[str, ...]:
    parameter = graph.parameter(item.parameter)
    unit = parameter.unit
    effects = ", ".join(f"{effect.output} {_size(effect.in_noise)}" for effect in item.effects)
    if item.value is None:
        return (item.parameter, NOWHERE, unit_text(unit.text, Notation.FILE), "", item.reason)
    change = figure(unit.difference_from_si(item.value), digits=3).number(Notation.FILE)
    part = f"{100 * item.value / abs(parameter.nominal):.3g} %" if parameter.nominal else ""
    return (item.parameter, change, unit_text(unit.text, Notation.FILE), part, effects)


def _size(in_noise: float) -> str:
    return f"{in_noise:.2g}" if in_noise >= NO_EFFECT else "0"


def print_sensor_advice(console: Console, advice: SensorAdvice) -> None:
    """Print which further sensors would tell more."""
    title(console, "Further sensors", "each of the signals that the bonds allow, noise 1 % of its size")
    if not advice.further:
        lines(console, [("", "no further sensor would tell more")])
        return
    rows = [_sensors(advice.now, "as it is"), *(_sensors(item, " and ".join(item.sensors)) for item in advice.further)]
    header = ("sensor", "testable sets", "of which differ", "hard to tell apart", "combinations shown")
    table(console, header, rows)
    if advice.left_out:
        lines(console, [("", f"{advice.left_out} combinations were not tried")])


def _sensors(item: SensorChoice, name: str) -> tuple[str, ...]:
    return (name, str(item.testable), str(item.classes), str(item.near), str(item.rank))


def print_input_advice(console: Console, found: Sequence[Stimulus], note: str) -> None:
    """Print which input to move so that sets can be told apart; the note says where they look alike."""
    title(console, "Test inputs", note)
    if not found:
        lines(console, [("", "nothing looks alike")])
        return
    for item in found:
        named = join(["{" + ", ".join(names) + "}" for names in item.sets])
        choices = [("", choice.words) for choice in item.choices[1:3]]
        lines(console, [(named, item.words), *choices])


def print_refusal(console: Console, heading: str, message: str) -> None:
    """Print that a section cannot be told."""
    title(console, heading[0].upper() + heading[1:])
    lines(console, [("cannot be told", message)])
