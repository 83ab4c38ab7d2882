"""What was understood of a model, as one record: names, causality, states, loops, and every number in force."""

from dataclasses import asdict, dataclass

from faultbond.contract import lanes
from faultbond.contract.records import Record
from faultbond.contract.spec import EngineSpec
from faultbond.equations.evaluate import ROOT_WIDTH, SQRT_WIDTH
from faultbond.equations.sequence import Loop
from faultbond.equations.step import MAX_SUBSTEPS, NEWTON_STEPS, StepModel
from faultbond.model.expression import rename
from faultbond.model.graph import BondGraph, Check, Component, Input, Relation, Sensor
from faultbond.model.parser import to_text
from faultbond.runtime import monitor, onsets, packing, ranking, trail, unseen
from faultbond.synthesis.specify import PROCESS_NOISE

METHOD = "ROS2 (a Rosenbrock method): second order, L-stable; an input is held over its step"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Understanding:
    """A model, its equations, the contract with its engine, and the engine in words."""

    graph: BondGraph
    model: StepModel
    spec: EngineSpec
    engine: str


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopFound:
    """An algebraic loop: the signals in it, the components that own its laws, and how it is solved."""

    signals: tuple[str, ...]
    components: tuple[str, ...]
    solution: str


def lines_of(graph: BondGraph) -> dict[str, int]:
    """Give the line of the model file at which each component and junction stands; 0 for a model made in Python."""
    return {item.name: item.line for item in graph.components} | {item.name: item.line for item in graph.junctions}


def loops_of(model: StepModel) -> tuple[LoopFound, ...]:
    """Give the algebraic loops of a model."""
    implicit = set(model.plant.implicit)
    found = []
    for loop in (part for part in model.plant.steps if isinstance(part, Loop)):
        if loop.closed is not None:
            solution = "closed form"
        elif implicit & set(loop.tears):
            solution = f"{NEWTON_STEPS} Newton steps from the last solution"
        else:
            solution = "linear, solved by elimination"
        signals = (*loop.tears, *(part.signal for part in loop.inner))
        found.append(LoopFound(signals=signals, components=tuple(dict.fromkeys(loop.owners)), solution=solution))
    return tuple(found)


def law_text(component: Component, law: Relation) -> str:
    """Give a law as in the model file: own signals without the component's name."""

    def short(name: str) -> str:
        return name.removeprefix(f"{component.name}.")

    return f"{to_text(rename(law.left, short))} = {to_text(rename(law.right, short))}"


def set_sizes(spec: EngineSpec) -> dict[int, int]:
    """Give the number of hypotheses by the number of suspects in them."""
    sizes = [len(chosen) for chosen in spec.hypotheses]
    return {size: sizes.count(size) for size in sorted(set(sizes))}


def settings_of(spec: EngineSpec) -> dict[str, object]:
    """Give the numbers of the method that a model file does not state, by name."""
    return {
        **asdict(spec.thresholds),
        "start_samples": monitor.START_SAMPLES,
        "diagnosis_every": monitor.DIAGNOSIS_EVERY,
        "change_memory": packing.CHANGE_MEMORY,
        "start_patience": monitor.START_PATIENCE,
        "first_renewal": monitor.RENEWALS[0],
        "last_renewal": monitor.RENEWALS[-1],
        "onset_dense": onsets.DENSE,
        "onset_ratio": onsets.RATIO,
        "onset_many": onsets.MANY,
        "wild": trail.WILD,
        "process_noise": PROCESS_NOISE,
        "gap": packing.GAP,
        "unknown_gap": packing.UNKNOWN_GAP,
        "gap_far": unseen.FAR,
        "unseen_longest": unseen.LONGEST,
        "unseen_lost": unseen.LOST,
        "input_rarely": unseen.RARELY,
        "first_start": lanes.FIRST_START,
        "start_spread": lanes.START_SPREAD,
        "reach": lanes.REACH,
        "coarse_from": lanes.COARSE_FROM,
        "many_lanes": lanes.MANY_LANES,
        "max_candidates": ranking.MAX_CANDIDATES,
        "max_substeps": MAX_SUBSTEPS,
        "newton_steps": NEWTON_STEPS,
        "sqrt_width": SQRT_WIDTH,
        "root_width": ROOT_WIDTH,
    }


def check_record(seen: Understanding) -> Record:
    """Give all that `check` knows as one record; SI units, percent stays percent."""
    graph, spec = seen.graph, seen.spec
    return {
        "record": "check",
        "model": graph.name,
        "file": graph.file,
        "model_sha256": spec.model_sha256,
        "version": spec.version,
        "sample_time": graph.sample_time,
        "max_faults": graph.max_faults,
        "warm_up": graph.warm_up,
        "time_between_false_alarms": graph.time_between_false_alarms,
        **_parts(graph),
        **_structure(seen),
        "inputs": [_input(item, seen) for item in graph.inputs],
        "sensors": [_sensor(item, seen) for item in graph.sensors],
        "slow_errors": [
            {"signal": error.target, "sd": error.sd, "relative": error.relative, "memory": error.memory}
            | {"alarms": known.alarms, "after": list(error.after), "each": error.each}
            for error, known in zip(graph.slow_errors, spec.slow_errors, strict=True)
        ],
        "checks": [_check(item) for item in graph.checks],
        "discretisation": {"method": METHOD, "substeps": seen.model.substeps},
        "hypotheses": {str(size): number for size, number in set_sizes(spec).items()},
        "explain_anything": [[spec.parameters[k].name for k in chosen] for chosen in spec.explain_anything],
        "filters": lanes.plan_lanes(spec).n_lanes,
        "engine": seen.engine,
        "settings": settings_of(spec),
        "defaults": [{"what": what, "value": value} for what, value in graph.defaults],
    }


def _parts(graph: BondGraph) -> Record:
    """Components, parameters, constants and junctions."""
    return {
        "components": [
            {
                "name": item.name,
                "type": item.type.value,
                "laws": [law_text(item, law) for law in item.laws],
                "parameters": list(item.parameters),
            }
            for item in graph.components
        ],
        "parameters": [
            {"name": item.name, "component": item.owner, "unit": item.unit.text, "nominal": item.nominal}
            | {"accuracy": item.accuracy, "change": item.change, "range": [item.lower, item.upper]}
            | {"limits": list(item.limits), "suspect": item.suspect}
            for item in graph.parameters
        ],
        "constants": [{"name": item.name, "value": item.value, "unit": item.unit.text} for item in graph.constants],
        "junctions": [{"name": item.name, "type": item.type.value} for item in graph.junctions],
    }


def _structure(seen: Understanding) -> Record:
    """Bonds with strokes, causality, states, loops."""
    causality = seen.model.plant.causality
    strokes = dict(causality.strokes)
    return {
        "lines": lines_of(seen.graph),
        "bonds": [
            {"tail": bond.tail, "head": bond.head, "stroke": strokes[k]} for k, bond in enumerate(seen.graph.bonds)
        ],
        "causality": {
            "integral": list(causality.integral),
            "derivative": list(causality.derivative),
            "free": list(causality.free),
        },
        "states": [
            {
                "name": store.name,
                "filtered_as": coordinate,
                "start": None if state.start_sd is None else {"mean": state.start_mean, "sd": state.start_sd},
            }
            for store, coordinate, state in zip(
                seen.model.plant.network.states, seen.model.states, seen.spec.states, strict=True
            )
        ],
        "loops": [
            {"signals": list(loop.signals), "components": list(loop.components), "solution": loop.solution}
            for loop in loops_of(seen.model)
        ],
    }


def _input(item: Input, seen: Understanding) -> Record:
    known = seen.spec.inputs[[entry.name for entry in seen.spec.inputs].index(item.name)]
    return {
        "name": item.name,
        "column": item.column,
        "unit": item.unit.text,
        "noise": item.noise,
        "settling": item.settling,
        "step": known.step,
        "step_part": known.step_part,
        "suspect": item.suspect,
    }


def _sensor(item: Sensor, seen: Understanding) -> Record:
    known = seen.spec.outputs[[entry.name for entry in seen.spec.outputs].index(item.name)]
    return {
        "name": item.name,
        "column": item.column,
        "unit": item.unit.text,
        "reads": to_text(item.reads),
        "noise": item.noise,
        "range": [item.lower, item.upper],
        "suspect": item.suspect,
        "direct_inputs": [seen.spec.inputs[k].name for k in known.direct_inputs],
    }


def _check(item: Check) -> Record:
    return {
        "name": item.name,
        "kind": item.kind.value,
        "reads": None if item.reads is None else to_text(item.reads),
        "unit": item.unit.text,
        "noise": item.noise,
        "move": item.move,
        "cost": item.cost,
    }
