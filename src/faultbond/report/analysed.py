"""What the analysis of a plant found, as one record: plain mappings ready for JSON; SI units, percent stays percent."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from faultbond.algebra.routes.functions import Function, components_passed, equations_passed
from faultbond.algebra.solving.formula import to_one_line
from faultbond.analysis.capability import CapabilityView
from faultbond.analysis.groups import Group, NearGroup
from faultbond.analysis.input_advice import Stimulus
from faultbond.analysis.sensor_advice import SensorAdvice, SensorChoice
from faultbond.analysis.smallest import SmallestFault
from faultbond.analysis.solutions import OtherSolutions
from faultbond.analysis.testable import SetVerdict
from faultbond.analysis.twins import Comparison
from faultbond.contract.records import Record
from faultbond.diagnosability.isolability import Isolability
from faultbond.equations.component_network import ComponentNetwork, frame_name
from faultbond.model.graph import BondGraph


def groups_record(graph: BondGraph, view: CapabilityView) -> Record:
    """Give what cannot be told apart, and why."""
    return {
        "rank": view.judgement.rank.value,
        "groups": [_sets(graph, group) for group in view.groups],
        "group_reasons": [group.reason for group in view.groups],
        "near_groups": [
            {"sets": _sets(graph, group), "angle": group.angle, "reason": group.reason} for group in view.near_groups
        ],
    }


def _sets(graph: BondGraph, group: Group | NearGroup) -> list[list[str]]:
    return [_names(graph, chosen) for chosen in group.sets]


def _names(graph: BondGraph, chosen: Sequence[int]) -> list[str]:
    return [graph.parameters[k].name for k in chosen]


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
    return {
        "hypotheses": [_hypothesis(graph, item, on_data, known) for item in view.judgement.verdicts],
        "sets_left_out": view.judgement.left_out,
        "twins": [
            {"first": list(item.first), "second": list(item.second), "always": item.always, "words": item.words}
            for item in twins.found
        ],
        "twins_left_out": twins.left_out,
    }


def _hypothesis(
    graph: BondGraph,
    item: SetVerdict,
    on_data: Mapping[tuple[int, ...], SetVerdict],
    known: Mapping[tuple[str, ...], OtherSolutions],
) -> Record:
    names = _names(graph, item.parameters)
    solution = known.get(tuple(names))
    roots = None if solution is None else solution.roots
    record: Record = {"parameters": names, **_verdict(item), "uncertain": item.uncertain, "roots": roots}
    if solution is not None and solution.others:
        record["other_values"] = [dict(zip(names, values, strict=True)) for values in solution.others]
    if item.parameters in on_data:
        record["on_data"] = _verdict(on_data[item.parameters])
    return record


def _verdict(item: SetVerdict) -> Record:
    return {"identifiable": item.identifiable, "falsifiable": item.falsifiable, "testable": item.testable}


@dataclass(frozen=True, slots=True, kw_only=True)
class Tests:
    """How many minimal sets of equations can be checked (MSO), and the faults that each of the MTES responds to."""

    n_sets: int
    faults: tuple[tuple[str, ...], ...]


def structure_record(
    suspects: Sequence[str],
    found: Mapping[str, Isolability],
    tests: Tests | None,
    sensors: Sequence[Sequence[str]],
) -> Record:
    """Give what the structure says, in mixed causality, and the same for stores that work one way only."""
    parts = {name: _isolability(suspects, item) for name, item in found.items()}
    return {
        **parts.pop("mixed"),
        "by_causality": parts,
        "tests": None if tests is None else {"mso": tests.n_sets, "mtes": [list(names) for names in tests.faults]},
        "structural_sensors": [list(names) for names in sensors],
    }


def _isolability(suspects: Sequence[str], found: Isolability) -> Record:
    return {
        "detectable": {name: bool(found.detectable[k]) for k, name in enumerate(suspects)},
        "isolable": {
            name: {other: bool(found.isolable[k, n]) for n, other in enumerate(suspects) if n != k}
            for k, name in enumerate(suspects)
        },
    }


def smallest_record(found: Sequence[SmallestFault]) -> Record:
    """Give the smallest fault of each parameter, SI."""
    return {
        "smallest_fault": {
            item.parameter: {
                "value": item.value,
                "within": item.within,
                "up": item.up,
                "down": item.down,
                "certainty": item.certainty,
                "reason": item.reason or None,
                "effects": {
                    effect.output: {"size": effect.size, "in_noise": effect.in_noise} for effect in item.effects
                },
            }
            for item in found
        }
    }


def sensors_record(graph: BondGraph, advice: SensorAdvice) -> Record:
    """Give which further sensors would tell more, best first, beside the plant as it is."""
    return {
        "sensor_advice": [_sensors(graph, item) for item in advice.further],
        "sensors_now": _sensors(graph, advice.now),
        "sensors_not_tried": advice.left_out,
    }


def _sensors(graph: BondGraph, item: SensorChoice) -> Record:
    return {
        "sensors": list(item.sensors),
        "rank": item.rank,
        "testable": item.testable,
        "classes": item.classes,
        "near": item.near,
        "groups": [_sets(graph, group) for group in item.groups],
    }


def inputs_record(found: Sequence[Stimulus]) -> Record:
    """Give which input to move, for each group of sets that look alike; SI, percent stays percent."""
    return {
        "input_advice": [
            {
                "sets": [list(names) for names in item.sets],
                "words": item.words,
                "choices": [
                    {
                        "input": choice.input,
                        "level": choice.level,
                        "change": choice.change,
                        "hold": choice.hold,
                        "before": choice.before,
                        "after": choice.after,
                        "words": choice.words,
                    }
                    for choice in item.choices
                ],
            }
            for item in found
        ]
    }


def routes_record(network: ComponentNetwork, found: Sequence[Function], late: int) -> Record:
    """Give the route of each function, and its closed form where it was asked for, in time, and there is one."""
    return {"routes": [_route(network, item) for item in found], "closed_forms_left_out": late}


def _route(network: ComponentNetwork, item: Function) -> Record:
    targets = [target if isinstance(target, str) else frame_name(target) for target in item.question.targets]
    record: Record = {"target": ", ".join(targets), "question": item.question.title}
    if item.route is None:
        nothing: Record = {"components": [], "observations": None, "equations": None, "closed_form": None}
        return {**record, **nothing, "refusal": item.refusal}
    record |= {
        "components": list(components_passed(network, item.route)),
        "observations": item.route.observations,
        "equations": len(equations_passed(network, item.route)),
        "closed_form": None if item.solution is None else to_one_line(item.solution),
        "steps": list(equations_passed(network, item.route)),
        "samples": [frame_name(sample) for sample in item.route.samples],
        "frames": item.route.frames,
        "largest_block": item.route.largest_block,
        "noise": None if item.gain is None else dict(item.gain.deviations),
    }
    if item.solution is not None:
        record |= {
            "kind": item.solution.kind.value,
            "degree": item.solution.degree,
            "real_roots": item.solution.real_roots,
            "singular": [singular.words for singular in item.solution.singular],
            "remarks": list(item.solution.remarks),
        }
    return record
