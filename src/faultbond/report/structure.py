"""What a structure says of its faults: keys of the record, and text for people."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from rich.console import Console

from faultbond.contract.json_records import Record
from faultbond.diagnosability.isolability import Interpretation, Isolability
from faultbond.diagnosability.likeness import Alike, Hidden
from faultbond.diagnosability.sensor_sets import SensorSets, cost_of
from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import Decomposition
from faultbond.model.structure import Structure
from faultbond.report.console import headline, lines, table, title, under
from faultbond.report.names import LISTED, braced, listed, some
from faultbond.report.numbers import figure, join, with_noun

LISTED_SENSORS = 4
LISTED_NAMES = 8  # equations or unknowns in a row or a reason
ONE_WAY = {Interpretation.INTEGRAL: "integrating", Interpretation.DERIVATIVE: "differentiating"}


@dataclass(frozen=True, slots=True)
class MinimalTest:
    """A minimal set of equations that can be checked (MSO).

    equations, faults : indices, ascending
    ways : the causalities in one direction that do for it; None: not looked at
    """

    equations: tuple[int, ...]
    faults: tuple[int, ...]
    ways: tuple[Interpretation, ...] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundTests:
    """The minimal tests, and the smallest sets of faults that a test sees (of the MTES); None: too many to list."""

    minimal: tuple[MinimalTest, ...] | None
    smallest: tuple[tuple[int, ...], ...] | None
    limit: int


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultView:
    """Which faults are detectable and isolable, by causality, and why not, in mixed causality."""

    by_causality: Mapping[Interpretation, Isolability]
    alike: tuple[Alike, ...]
    hidden: tuple[Hidden, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorView:
    """Sets of further sensors that make faults detectable, and isolable, and what no further sensor helps."""

    detect: SensorSets
    isolate: SensorSets
    costs: Mapping[int, float]
    hidden: tuple[Hidden, ...]
    alike: tuple[Alike, ...]


def causality_record(faults: Sequence[str], found: Mapping[str, Isolability]) -> Record:
    """Give what is detectable and isolable by name, in mixed causality and `by_causality` in one direction only."""
    parts: dict[str, Record] = {
        kind: {
            "detectable": {name: bool(item.detectable[k]) for k, name in enumerate(faults)},
            "isolable": {
                name: {other: bool(item.isolable[k, n]) for n, other in enumerate(faults) if n != k}
                for k, name in enumerate(faults)
            },
        }
        for kind, item in found.items()
    }
    return {**parts.pop("mixed"), "by_causality": parts}


def inseparable(faults: Sequence[str], found: Isolability) -> tuple[tuple[str, ...], ...]:
    """Give the classes of detectable faults of which none can be told from another, by structure."""
    groups: list[list[int]] = []
    for k in range(len(faults)):
        if not found.detectable[k]:
            continue
        for group in groups:
            if not found.isolable[k, group[0]] and not found.isolable[group[0], k]:
                group.append(k)
                break
        else:
            groups.append([k])
    return tuple(tuple(faults[k] for k in group) for group in groups)


def head_record(structure: Structure) -> Record:
    """Give what names the structure; lists are empty until the sections that fill them."""
    return {
        "record": "structure",
        "model": structure.name,
        "model_sha256": structure.sha256,
        "unknowns": list(structure.unknowns),
        "known": list(structure.known),
        "faults": list(structure.faults),
        "unused": list(structure.unused),
        "equations": [],
        "open": [],
        "redundancy": None,
        "detectable": {},
        "isolable": {},
        "by_causality": {},
        "not_detectable": [],
        "groups": [],
        "group_reasons": [],
        "tests": None,
        "sets": [],
        "sensors": {},
    }


def print_head(console: Console, structure: Structure) -> None:
    """Print what a structure has."""
    headline(console, structure.name, structure.file)
    items = [
        ("unknowns", some(structure.unknowns)),
        ("known", some(structure.known) or "none"),
        ("faults", some(structure.faults) or "none"),
    ]
    rates = [f"{item.rate} of {item.quantity}" for item in structure.derivatives]
    items += [("rates", some(rates))] if rates else []
    items += [("in no equation", some(structure.unused))] if structure.unused else []
    lines(console, items)


def structure_check_record(structure: Structure) -> Record:
    """Give all that `check` knows of a structure."""
    return {
        "record": "check",
        "model": structure.name,
        "model_sha256": structure.sha256,
        "structure": {
            "unknowns": list(structure.unknowns),
            "known": list(structure.known),
            "faults": list(structure.faults),
            "equations": {item.name: [*item.unknowns, *item.known, *item.faults] for item in structure.equations},
            "derivatives": {item.rate: item.quantity for item in structure.derivatives},
            "further_sensors": {
                item.signal: {"cost": item.cost, "suspect": item.suspect} for item in structure.further_sensors
            },
            "unused": list(structure.unused),
        },
    }


def print_equations(console: Console, structure: Structure) -> None:
    """Print a structure as it was understood, with every default."""
    print_head(console, structure)
    title(console, "Equations", "what stands in each, in any order")
    header = ("equation", "unknowns", "known", "faults")
    parts = [(item.name, item.unknowns, item.known, item.faults) for item in structure.equations]
    rows = [(name, *(", ".join(words) for words in contents)) for name, *contents in parts]
    rows += [(item.name, f"{item.rate}, {item.quantity}", "", "") for item in structure.derivatives]
    table(console, header, rows)
    title(console, "Further sensors", "that there could be")
    costs = [
        (item.signal, figure(item.cost).number(), "yes" if item.suspect else "no") for item in structure.further_sensors
    ]
    table(console, ("unknown", "cost", "suspect"), costs)
    if not structure.states_sensors:
        lines(console, [("default", "further_sensors: every unknown but rates, each at a cost of 1, trusted")])
    lines(
        console,
        [("laws", "none: `analyse` tells what the equations say of the faults; `run`, `fit` and `simulate` need laws")],
    )


def parts_record(model: StructuralModel, parts: Decomposition) -> Record:
    """Give the equations with what stands in them and the part that they are in."""
    where = dict.fromkeys(parts.over.equations, "over")
    where |= dict.fromkeys(parts.just.equations, "just")
    where |= dict.fromkeys(parts.under.equations, "under")
    return {
        "equations": [
            {
                "name": model.equation_name(k),
                "part": where[k],
                "unknowns": _variables(model, row),
                "faults": [model.fault_names[n] for n, equation in enumerate(model.faults) if equation == k],
            }
            for k, row in enumerate(model.equations)
        ],
        "open": _variables(model, parts.under.variables),
        "redundancy": len(parts.over.equations) - len(parts.over.variables),
    }


def print_parts(console: Console, model: StructuralModel, parts: Decomposition) -> None:
    """Print what can be checked, what can just be found, and what stays open."""
    title(console, "What the equations determine", "the parts of Dulmage and Mendelsohn")
    rows = [("checked", parts.over), ("found, not checked", parts.just), ("open", parts.under)]
    header = ("part", "equations", "unknowns", "which")
    cells = [
        (name, str(len(part.equations)), str(len(part.variables)), some(_variables(model, part.variables)))
        for name, part in rows
    ]
    table(console, header, cells)
    spare = len(parts.over.equations) - len(parts.over.variables)
    text = f"{with_noun(spare, 'equation')} more than it takes to find what is checked"
    lines(console, [("to spare", text if spare else "none: nothing can be checked, so no fault shows")])


def faults_record(model: StructuralModel, view: FaultView) -> Record:
    """Give which faults show and which can be told apart, and why not."""
    return {
        **causality_record(model.fault_names, {kind.value: item for kind, item in view.by_causality.items()}),
        "not_detectable": _hidden_record(model, view.hidden),
        **_alike_record(model, view.alike),
    }


def _hidden_record(model: StructuralModel, hidden: Iterable[Hidden]) -> list[Record]:
    return [{"fault": model.fault_names[item.fault], "reason": _why_hidden(model, item)} for item in hidden]


def _alike_record(model: StructuralModel, alike: Iterable[Alike]) -> Record:
    return {
        "groups": [[model.fault_names[k] for k in item.faults] for item in alike],
        "group_reasons": [_why_alike(model, item) for item in alike],
    }


def print_fault_view(console: Console, model: StructuralModel, view: FaultView) -> None:
    """Print which faults show and which can be told apart, and why not."""
    title(console, "Which faults show", "whatever the values")
    names, hidden = model.fault_names, [model.fault_names[item.fault] for item in view.hidden]
    seen = "all faults" if not hidden else "none" if len(hidden) == len(names) else f"all but {some(hidden)}"
    items = [("detectable", seen)]
    items += under("not detectable", listed(_hidden_texts(model, view.hidden)))
    items += under("cannot be told apart", listed(_alike_texts(model, view.alike)))
    if not view.alike and len(names) - len(hidden) > 1:
        items.append(("told apart", f"each {'detectable fault' if hidden else 'fault'} from every other"))
    for kind, words in ONE_WAY.items():
        if kind in view.by_causality:
            items += under(f"by {words} only", listed(_losses(names, view.by_causality, kind)))
    lines(console, items)


def _hidden_texts(model: StructuralModel, hidden: Iterable[Hidden]) -> list[str]:
    faults: dict[str, list[str]] = {}  # by why they do not show
    for item in hidden:
        faults.setdefault(_why_hidden(model, item), []).append(model.fault_names[item.fault])
    return [f"{some(names)}: {reason}" for reason, names in faults.items()]


def _alike_texts(model: StructuralModel, alike: Iterable[Alike]) -> list[str]:
    return [f"{braced([model.fault_names[k] for k in item.faults])}: {_why_alike(model, item)}" for item in alike]


def _why_hidden(model: StructuralModel, item: Hidden) -> str:
    """Say why a fault does not show."""
    if item.open:
        entered = model.equation_name(model.faults[item.fault])
        return f"{entered} contains {_some_variables(model, item.open)}, which nothing fixes"
    equations = _some_equations(model, item.equations)
    needed = f"{equations} {'is' if len(item.equations) == 1 else 'are'} needed to find"
    found = _some_variables(model, item.variables)
    return f"{needed} {found}, and nothing checks {'it' if len(item.variables) == 1 else 'them'}"


def _why_alike(model: StructuralModel, item: Alike) -> str:
    """Say why faults cannot be told apart."""
    entered = sorted({model.faults[k] for k in item.faults})
    if len(entered) == 1:
        return f"{'both' if len(item.faults) == 2 else 'all'} enter {model.equation_name(entered[0])}"
    equations = _some_equations(model, item.equations)
    found = _some_variables(model, item.variables)
    rest = "the other only finds" if len(item.equations) == 2 else "the others only find"
    return f"{equations} are checked only together; without one of them {rest} {found}"


def _losses(faults: Sequence[str], found: Mapping[Interpretation, Isolability], kind: Interpretation) -> list[str]:
    """Say what is lost where stores work in one direction only."""
    both, one = found[Interpretation.MIXED], found[kind]
    if (both.isolable == one.isolable).all() and (both.detectable == one.detectable).all():
        return ["the same"]
    lost = [faults[k] for k in range(len(faults)) if both.detectable[k] and not one.detectable[k]]
    texts = [f"{some(lost)} {'is' if len(lost) == 1 else 'are'} not detectable"] if lost else []
    groups = [group for group in inseparable(faults, one) if len(group) > 1]
    texts += [f"{braced(group)} cannot be told apart" for group in groups if group not in inseparable(faults, both)]
    together = {name: group for group in groups for name in group}
    worse: dict[tuple[str, ...], list[str]] = {}  # what cannot be told from these any more, though these can from it
    for k, name in enumerate(faults):
        lost_from = np.flatnonzero(both.isolable[k] & ~one.isolable[k]).tolist() if one.detectable[k] else []
        others = tuple(faults[n] for n in lost_from if faults[n] not in together.get(name, ()))
        worse.setdefault(others, []).append(name)
    return texts + [f"{some(names)} cannot be told from {some(others)}" for others, names in worse.items() if others]


def tests_record(model: StructuralModel, tests: FoundTests) -> Record:
    """Give the minimal tests and which faults each sees."""

    def names(faults: Sequence[int]) -> list[str]:
        return [model.fault_names[k] for k in faults]

    minimal, smallest = tests.minimal, tests.smallest
    return {
        "tests": {
            "mso": None if minimal is None else len(minimal),
            "mtes": None if smallest is None else [names(item) for item in smallest],
        },
        "sets": [
            {
                "equations": _equations(model, item.equations),
                "faults": names(item.faults),
                "ways": None if item.ways is None else [kind.value for kind in item.ways],
            }
            for item in minimal or ()
        ],
    }


def print_tests(console: Console, model: StructuralModel, tests: FoundTests) -> None:
    """Print the minimal tests by the faults that they see, the most telling first."""
    title(console, "Tests", "minimal sets of equations that can be checked (MSO)")
    limit = f"more than {tests.limit}, or too many to search through; --budget raises the limit"
    items = []
    if tests.minimal is None:
        items.append(("sets", limit))
    else:
        of: dict[tuple[int, ...], list[MinimalTest]] = {}
        for item in tests.minimal:
            of.setdefault(item.faults, []).append(item)
        kinds = sorted(of, key=lambda faults: (not faults, len(faults), faults))
        header = ("faults that it sees", "sets", "the smallest of them", "its rates are used")
        rows = [_test_row(model, faults, of[faults]) for faults in kinds[:LISTED]]
        width = len(header) if model.differentials else len(header) - 1
        if rows:
            table(console, header[:width], [row[:width] for row in rows])
        sets = with_noun(len(tests.minimal), "minimal set")
        items.append(("sets", f"{sets}, which see {with_noun(len(of), 'set')} of faults" if of else "none"))
        if len(kinds) > LISTED:
            items.append(("more", f"{with_noun(len(kinds) - LISTED, 'line')} as above; --json writes all"))
    if tests.smallest is None:
        items.append(("least seen", limit))
    elif tests.smallest:
        seen = some([braced([model.fault_names[k] for k in faults]) for faults in tests.smallest])
        items.append(("least seen", f"smallest sets of faults that a test can see: {seen}"))
    lines(console, items)


def _test_row(model: StructuralModel, faults: Sequence[int], sets: Sequence[MinimalTest]) -> tuple[str, ...]:
    """Give the row of the tests that see the same faults."""
    first = min(sets, key=lambda item: (len(item.equations), item.equations))
    seen = some([model.fault_names[k] for k in faults]) or "none"
    return seen, str(len(sets)), _some_equations(model, first.equations), _ways_text(model, first)


def _ways_text(model: StructuralModel, test: MinimalTest) -> str:
    """Say in which direction of time a test uses its differential equations."""
    if not {equation for equation, _, _ in model.differentials} & {*test.equations}:
        return "not at all"
    if test.ways is None:
        return "not looked at"
    either = len(test.ways) == len(ONE_WAY)
    return "either way" if either else " ".join(f"by {ONE_WAY[kind]}" for kind in test.ways) or "in both ways"


def further_record(model: StructuralModel, view: SensorView) -> Record:
    """Give the sets of further sensors, the cheapest first."""
    goals = {"detect": view.detect, "isolate": view.isolate}
    return {
        "sensors": {
            **{
                goal: {
                    "choices": [
                        {"sensors": _variables(model, item), "cost": cost_of(item, view.costs)} for item in found.sets
                    ],
                    "searched": found.searched,
                    "cheapest": found.cheapest,
                }
                for goal, found in goals.items()
            },
            "never_detectable": _hidden_record(model, view.hidden),
            **{f"never_{key}": value for key, value in _alike_record(model, view.alike).items()},
        }
    }


def print_further(console: Console, structure: Structure, model: StructuralModel, view: SensorView) -> None:
    """Print which further sensors would make all faults detectable and isolable; `model` has all of them."""
    places = some(_variables(model, tuple(view.costs)))
    title(console, "Further sensors", f"of {places}" if structure.states_sensors else "of any unknown but rates")
    items = [
        *_choices("to detect all", structure, model, view, view.detect, bool(view.hidden)),
        *_choices("to tell all apart", structure, model, view, view.isolate, bool(view.hidden or view.alike)),
        *under("never detectable", listed(_hidden_texts(model, view.hidden))),
        *under("never told apart", listed(_alike_texts(model, view.alike))),
    ]
    lines(console, items)


def _choices(
    label: str, structure: Structure, model: StructuralModel, view: SensorView, found: SensorSets, partly: bool
) -> list[tuple[str, str]]:
    """Say which sets of sensors serve a goal; partly: some faults are out of reach of all sensors."""
    far = ", as far as these sensors can" if partly else ""
    if found.sets == ((),):
        return [(label, "no further sensor would help" if partly else "nothing is missing")]
    if not found.sets:
        return [(label, f"none found of up to {with_noun(found.searched, 'sensor')}; --budget searches on")]
    texts: list[str] = []
    for item in found.sets[:LISTED_SENSORS]:
        counted = {name: item.count(place) for name, place in zip(_variables(model, item), item, strict=True)}
        named = join([name if number == 1 else f"{name} ({number} sensors)" for name, number in counted.items()])
        cost = f", at a cost of {figure(cost_of(item, view.costs)).number()}" if structure.states_costs else ""
        one = "a sensor" if len(item) == 1 else "sensors"
        texts.append(f"{'or ' if texts else ''}{one} of {named}{cost}")
    texts[0] += far
    if len(found.sets) > LISTED_SENSORS:
        more = with_noun(len(found.sets) - LISTED_SENSORS, "other set")
        up_to = f" of up to {found.searched} sensors" if found.searched > 1 else ""
        texts.append(f"or {more}{up_to}; --json writes all")
    if not found.cheapest:
        texts.append("there may be cheaper sets; --budget searches on")
    return under(label, texts)


def _variables(model: StructuralModel, variables: Sequence[int]) -> list[str]:
    return [model.variable_name(variable) for variable in variables]


def _some_variables(model: StructuralModel, variables: Sequence[int]) -> str:
    return some(_variables(model, variables), LISTED_NAMES)


def _some_equations(model: StructuralModel, equations: Sequence[int]) -> str:
    return some(_equations(model, equations), LISTED_NAMES)


def _equations(model: StructuralModel, equations: Sequence[int]) -> list[str]:
    return [model.equation_name(equation) for equation in equations]
