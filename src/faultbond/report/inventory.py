"""What was understood of a model: names, causality, states, loops, and every number in force; as record and text."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass

from rich.console import Console

from faultbond.contract import lanes
from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import MAX_CANDIDATES
from faultbond.contract.json_records import Record
from faultbond.contract.spec import EngineSpec
from faultbond.equations.evaluate import ROOT_WIDTH, SQRT_WIDTH
from faultbond.equations.passivity import active_elements
from faultbond.equations.sequence import Loop
from faultbond.equations.step import MAX_SUBSTEPS, NEWTON_STEPS, StepModel
from faultbond.model.expression import names, rename
from faultbond.model.graph import BondGraph, Check, Component, Curve, Parameter, Relation, Sensor, Unit, Validity
from faultbond.model.keys import BETWEEN, BEYOND, NOISES_OF
from faultbond.model.parser import to_text
from faultbond.report.console import headline, lines, table, title, under, wrapped
from faultbond.report.lateness import lag_lines, validity_lines
from faultbond.report.numbers import NO_BREAK, duration_text, figure, unit_text, with_noun, with_unit
from faultbond.report.oddities import oddities
from faultbond.report.reservations import known_alarms
from faultbond.report.shortcomings import active_texts, doubtful, hidden_instruments, hidden_suspects
from faultbond.report.suspects import owner_title
from faultbond.report.together import together_texts
from faultbond.report.verdict import step_text, unfalsifiable_text
from faultbond.synthesis.extent import count_lanes
from faultbond.synthesis.specify import PROCESS_NOISE
from faultbond.types import CheckKind, TimeGrid

METHOD = "ROS2 (a Rosenbrock method): second order, L-stable; an input is held over its step"
THRESHOLDS = {
    "cusum_drift": "CUSUM: part of a standard deviation taken off each sample",
    "cusum_limit": "CUSUM: limit at which it alarms",
    "fast_drift": "fast CUSUM: part of a standard deviation taken off each sample",
    "fast_limit": "fast CUSUM: limit at which it alarms; high enough that it does not where no time is promised",
    "scatter_ratio": "sum of the scatter: noise that it looks for, times as large as declared",
    "scatter_limit": "sum of the scatter: limit at which it alarms, nats",
    "cusum_clip": "CUSUM: largest contribution of one sample, standard deviations",
    "learning_bound": "largest innovation from which the healthy filter learns once warm, standard deviations",
    "bank_bound": "largest innovation that counts after the alarm, standard deviations",
    "cost_per_suspect": "cost of each suspect of a set, nats",
    "cost_per_sensor": "cost of a sensor as the suspect, nats",
    "group_nats": "sets closer to the best than this are not told apart, nats",
    "blank_factor": "noise variance of a sensor while an input settles, times",
    "warm_up_samples": "samples without alarms at the start, with those of the model's warm-up",
    "history_samples": "samples kept to look back for the onset",
}
_CORE = core_settings()
SETTINGS = {  # value and meaning of the numbers of the method beside its thresholds
    "start_samples": (_CORE["START_SAMPLES"], "samples gathered to solve an unknown start"),
    "diagnosis_every": (_CORE["DIAGNOSIS_EVERY"], "samples from one diagnosis to the next"),
    "start_patience": (
        _CORE["START_PATIENCE"],
        "samples for which a sensor without any value holds up the start, at most",
    ),
    "first_renewal": (
        _CORE["FIRST_RENEWAL"],
        "samples from the alarm to the first new beginning of each hypothesis from what it has found, at the least",
    ),
    "last_renewal": (_CORE["LAST_RENEWAL"], "samples from the alarm to the last such beginning, at the least"),
    "onset_dense": (_CORE["DENSE"], "samples before the alarm of which each may be tried as onset"),
    "onset_ratio": (_CORE["RATIO"], "ratio of the distances from the alarm of neighbouring onsets further back"),
    "wild": (_CORE["WILD"], "standard deviations of an innovation beyond which its sample is tried as onset, too"),
    "process_noise": (PROCESS_NOISE, "sd added to a state each sample, noises of the sensor that shows it best"),
    "gap": (
        _CORE["GAP_FROM"],
        "samples without any value, and three times the usual number, after which the states are uncertain",
    ),
    "unknown_gap": (_CORE["GAP_UNKNOWN"], "samples that a gap of unknown length counts as"),
    "gap_far": (_CORE["GAP_WHOLE"], "samples of a gap after which a state may be wherever it has been"),
    "unseen_longest": (_CORE["LONGEST_DOUBT"], "samples at most for which a missing input counts as having moved"),
    "unseen_lost": (_CORE["UNKNOWN_FROM"], "samples without an input that usually is told, after which no sum grows"),
    "input_rarely": (
        _CORE["RARELY"],
        "part of the samples in which an input is told that is not just logged at changes",
    ),
    "first_start": (lanes.FIRST_START, "first starting value of a suspect, nominals; each next one is twice as large"),
    "start_spread": (lanes.START_SPREAD, "standard deviation of a start, starts"),
    "reach": (lanes.REACH, "starting values lie within this many `change` of nominal"),
    "coarse_from": (lanes.COARSE_FROM, "sets of this size and more use two starts for each suspect"),
    "many_lanes": (lanes.MANY_LANES, "filters beyond which pairs too use two starts for each suspect"),
    "max_candidates": (MAX_CANDIDATES, "candidates given in a record, at most"),
    "max_substeps": (MAX_SUBSTEPS, "substeps of a sample, at most"),
    "newton_steps": (NEWTON_STEPS, "Newton steps for a loop without closed form"),
    "sqrt_width": (SQRT_WIDTH, "smoothing of sqrt(x) at 0, of the size of its terms"),
    "root_width": (ROOT_WIDTH, "smoothing of a square law solved for its flow at 0, of the size of its terms"),
}
LABELS = 18  # columns left of the texts of a section
SET_NAMES = {1: "single", 2: "pair", 3: "triple"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inventory:
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


def settings_of(spec: EngineSpec) -> dict[str, tuple[float, str]]:
    """Give the numbers of the method that a model file does not state, by name: value and meaning."""
    thresholds = {name: (value, THRESHOLDS[name]) for name, value in asdict(spec.thresholds).items()}
    return thresholds | SETTINGS


def check_record(seen: Inventory) -> Record:
    """Give all that `check` knows as one record; SI units, percent stays percent."""
    graph, spec = seen.graph, seen.spec
    return {
        "record": "check",
        "model": graph.name,
        "file": graph.file,
        "model_sha256": spec.model_sha256,
        "version": spec.version,
        "sample_time": graph.sample_time,
        "row_time": graph.row_time,
        "valid_when": _condition_record(graph.valid_when),
        "max_faults": graph.max_faults,
        "warm_up": graph.warm_up,
        "time_between_false_alarms": graph.time_between_false_alarms,
        "false_alarms": graph.false_alarms,
        **_structure_record(seen),
        "inputs": [
            {"name": item.name, "column": item.column, "unit": item.unit.text, "noise": item.noise}
            | {"settling": item.settling, "step": known.step, "step_part": known.step_part, "suspect": item.suspect}
            | {"lag": graph.parameter(item.lag).nominal if item.lag else 0.0, "order": item.order}
            | {"rate_limit": graph.parameter(item.rate_limit).nominal if item.rate_limit else None}
            | {"hold": item.hold.value}
            | {"noise_of": NOISES_OF[item.smooth]}
            for item, known in zip(graph.inputs, spec.inputs, strict=True)
        ],
        "unused": list(unused_inputs(graph)),
        "odd": list(oddities(graph)),
        "sensors": [
            {"name": item.name, "column": item.column, "unit": item.unit.text, "reads": to_text(item.reads)}
            | {"noise": item.noise, "noise_part": item.part, "range": [item.lower, item.upper], "suspect": item.suspect}
            | {"lag": graph.parameter(item.lag).nominal if item.lag else 0.0, "order": item.order}
            | {"valid_when": _condition_record(item.valid_when)}
            | {"direct_inputs": [spec.inputs[k].name for k in known.direct_inputs]}
            for item, known in zip(graph.sensors, spec.outputs, strict=True)
        ],
        "slow_errors": [
            {"signal": error.target, "sd": error.sd, "relative": error.relative, "memory": error.memory}
            | {"alarms": known.alarms, "limit": known.limit if known.alarms else None}
            | {"after": list(error.after), "each": list(error.each)}
            for error, known in zip(graph.slow_errors, spec.slow_errors, strict=True)
            if not error.wanders
        ],
        "wanders": [
            {"name": item.target, "sd": item.sd, "relative": item.relative, "memory": item.memory}
            | {"limit": known.limit if known.alarms else None}
            for item, known in zip(graph.slow_errors, spec.slow_errors, strict=True)
            if item.wanders
        ],
        "checks": [
            {
                "name": item.name,
                "kind": item.kind.value,
                "reads": None if item.reads is None else to_text(item.reads),
                "unit": item.unit.text,
                "noise": item.noise,
                "move": item.move,
                "cost": item.cost,
            }
            for item in graph.checks
        ],
        "discretisation": {"method": METHOD, "substeps": seen.model.substeps},
        "hypotheses": {str(size): number for size, number in _set_sizes(spec).items()},
        "explain_anything": [[spec.parameters[k].name for k in chosen] for chosen in spec.explain_anything],
        "filters": count_lanes(spec),
        "engine": seen.engine,
        "settings": {name: value for name, (value, _) in settings_of(spec).items()},
        "defaults": [{"what": what, "value": value} for what, value in graph.defaults],
    }


def _condition_record(item: Validity | None) -> Record | None:
    """Give when a model or a sensor holds, if that is stated."""
    return None if item is None else {"when": to_text(item.condition), "settling": item.settling}


def _structure_record(seen: Inventory) -> Record:
    """Give what the plant consists of, how it is joined, and what follows: strokes, causality, states, loops."""
    graph, model, spec = seen.graph, seen.model, seen.spec
    causality = model.plant.causality
    strokes = dict(causality.strokes)
    starts = [None if x.start_sd is None else {"mean": x.start_mean, "sd": x.start_sd} for x in spec.states]
    return {
        "components": [
            {"name": item.name, "type": item.type.value, "laws": [_law_text(item, law) for law in item.laws]}
            | {"parameters": list(item.parameters)}
            for item in graph.components
        ],
        "parameters": [
            {"name": item.name, "component": item.owner, "unit": item.unit.text, "nominal": item.nominal}
            | {"accuracy": item.accuracy, "change": item.change, "range": [item.lower, item.upper]}
            | {"limits": list(item.limits), "suspect": item.suspect, "healthy_change": item.healthy_change or None}
            for item in graph.parameters
        ],
        "doubtful": [name for name, _ in doubtful(graph)],
        "active": [
            {"component": item.component.name, "numbers": list(item.numbers)} for item in active_elements(graph)
        ],
        "correlations": [{"parameters": [item.one, item.other], "value": item.value} for item in graph.correlations],
        "constants": [{"name": item.name, "value": item.value, "unit": item.unit.text} for item in graph.fixed],
        "tables": [
            {"name": item.name, "x": list(item.x), "y": list(item.y), "file": item.file}
            | {"between": BETWEEN[item.monotone], "beyond": BEYOND[item.continues]}
            for item in graph.tables
        ],
        "junctions": [{"name": item.name, "type": item.type.value} for item in graph.junctions],
        "lines": _lines_of(graph),
        "bonds": [{"tail": bond.tail, "head": bond.head, "stroke": strokes[k]} for k, bond in enumerate(graph.bonds)],
        "causality": {
            "integral": list(causality.integral),
            "derivative": list(causality.derivative),
            "free": list(causality.free),
        },
        "states": [
            {"name": store.name, "filtered_as": coordinate, "start": start}
            for store, coordinate, start in zip(model.plant.network.states, model.states, starts, strict=True)
        ],
        "loops": [
            {"signals": list(loop.signals), "components": list(loop.components), "solution": loop.solution}
            for loop in loops_of(model)
        ],
    }


def _lines_of(graph: BondGraph) -> dict[str, int]:
    """Give the line of the model file at which each component and junction stands; 0 for a model made in Python."""
    return {item.name: item.line for item in graph.components} | {item.name: item.line for item in graph.junctions}


def _law_text(component: Component, law: Relation) -> str:
    """Give a law as in the model file: own signals without the component's name."""

    def short(name: str) -> str:
        return name.removeprefix(f"{component.name}.")

    return f"{to_text(rename(law.left, short))} = {to_text(rename(law.right, short))}"


def _set_sizes(spec: EngineSpec) -> dict[int, int]:
    """Give the number of hypotheses by the number of suspects in them."""
    sizes = [len(chosen) for chosen in spec.hypotheses]
    return {size: sizes.count(size) for size in sorted(set(sizes))}


def print_check(console: Console, seen: Inventory, *, settings: bool = False) -> None:
    """Print what was understood of a model; a console that is no terminal gets `console.PLAIN_WIDTH` columns.

    settings: whether the numbers of the method are shown too
    """
    headline(console, seen.graph.name, seen.graph.file)
    _print_plant(console, seen.graph)
    _print_structure(console, seen)
    _print_signals(console, seen)
    _print_method(console, seen)
    if odd := list(oddities(seen.graph)):
        title(console, "Is it meant so?")
        lines(console, under("odd", odd))
    title(console, "Defaults in force: what the model file does not state")
    lines(console, seen.graph.defaults)
    if seen.graph.grid is TimeGrid.NONE:
        return
    told = settings_of(seen.spec).values()
    if settings:
        title(console, "Settings of the method")
        lines(console, [(f"{value:g}", meaning) for value, meaning in told])
    else:
        lines(console, [("the method", f"{len(told)} numbers that no model states: `check --settings` shows them")])


def _print_plant(console: Console, graph: BondGraph) -> None:
    title(console, "Components")
    rows = []
    for item in graph.components:
        laws = "\n".join(_law_text(item, law) for law in item.laws)
        rows.append((item.name, item.type.value if item.suspect else f"{item.type.value}, trusted", laws))
    table(console, ("name", "type", "law"), rows)
    if graph.parameters or not graph.is_block_network:
        title(console, "Parameters")
        header = ("name", "component", "nominal", "± when healthy", "± when faulty", "range", "unit")
        table(console, header, [_parameter_row(item, graph) for item in graph.parameters])
    if graph.fixed:
        constants = [f"{item.name} = {_value(item.unit, item.value)}" for item in graph.fixed]
        lines(console, [("constants", ", ".join(constants))])
    if graph.tables:
        lines(console, [(("tables" if k == 0 else ""), _table_text(item)) for k, item in enumerate(graph.tables)])
    limited = [item for item in graph.parameters if item.limits]
    if limited:
        limits = [f"{item.name} {' or '.join(_value(item.unit, end) for end in item.limits)}" for item in limited]
        lines(console, [("drifts matter at", "; ".join(limits))])
    if graph.correlations:
        known = {item.name: item for item in graph.parameters}
        lines(console, under("go together", together_texts(known, graph.correlations)))
    if doubts := [*active_texts(graph), *(text for _, text in doubtful(graph))]:
        lines(console, under("doubtful", doubts))


def _table_text(item: Curve) -> str:
    """Say what a table holds, and what it does where it holds nothing."""
    x, y = (
        [unit.from_si(value) for value in values] for values, unit in ((item.x, item.x_unit), (item.y, item.y_unit))
    )
    ends = f"x {x[0]:g} to {x[-1]:g} {unit_text(item.x_unit.text)}".rstrip()
    span = f"y {min(y):g} to {max(y):g} {unit_text(item.y_unit.text)}".rstrip()
    beyond = "beyond its ends on in a straight line" if item.continues else "beyond its ends the value there"
    return f"{item.name}: {len(x)} points, {ends}, {span}; {BETWEEN[item.monotone]} between them, {beyond}"


def _parameter_row(item: Parameter, graph: BondGraph) -> tuple[str, ...]:
    unit = item.unit
    nominal = figure(unit.from_si(item.nominal)).number()
    healthy, faulty = (figure(unit.difference_from_si(sd), digits=3).number() for sd in (item.accuracy, item.change))
    shown = faulty if item.suspect else "trusted"
    return item.name, owner_title(graph, item), nominal, healthy, shown, _reach(item), unit_text(unit.text)


def _reach(item: Parameter | Sensor) -> str:
    lower, upper = (figure(item.unit.from_si(end)).number() for end in (item.lower, item.upper))
    match (math.isfinite(item.lower), math.isfinite(item.upper)):
        case (True, True):
            return f"{lower} to {upper}"
        case (True, False):
            return f"{lower} or more"
        case (False, True):
            return f"{upper} or less"
    return "any"


def _value(unit: Unit, si: float) -> str:
    return with_unit(unit.from_si(si), unit.text)


def _spread(unit: Unit, si: float) -> str:
    return with_unit(unit.difference_from_si(si), unit.text, digits=4) if si else "none"


def _print_structure(console: Console, seen: Inventory) -> None:
    graph, causality = seen.graph, seen.model.plant.causality
    loops = [
        f"{', '.join(item.signals)} by {_located(item.components, graph)}: {item.solution}"
        for item in loops_of(seen.model)
    ]
    memory = [
        ("states", "\n".join(_states(seen)) or "none: the plant has no memory"),
        ("loops", "\n".join(loops) or "none"),
    ]
    if graph.is_block_network:
        title(console, "Signals")
        suspects = ", ".join(graph.suspect_blocks) or "the parameters"
        signals = _wrapped(graph.block_signals, console.width - LABELS)
        lines(console, [("signals", signals), ("suspects", suspects), *memory])
        return
    strokes = dict(causality.strokes)
    bonds = [
        f"{bond.tail} {'->|' if strokes[k] == bond.head else '|->'} {bond.head}" for k, bond in enumerate(graph.bonds)
    ]
    title(console, "Bonds and causality")
    lines(
        console,
        [
            ("junctions", ", ".join(f"{item.name} ({item.type.value})" for item in graph.junctions) or "none"),
            ("bonds", _wrapped(bonds, console.width - LABELS)),
            ("", "-> counts power positive; | stands where the effort arrives, the flow at the other end"),
            ("integral", _located(causality.integral, graph)),
            ("derivative", _located(causality.derivative, graph)),
            ("chosen freely", _located(causality.free, graph)),
            *memory,
        ],
    )


def _located(parts: Iterable[str], graph: BondGraph) -> str:
    """Name parts, each with its line in the model file."""
    lines = _lines_of(graph)
    return ", ".join(f"{name} (line {lines[name]})" if lines.get(name) else name for name in parts) or "none"


def _wrapped(items: Iterable[str], width: int) -> str:
    """Put items in lines, none of them broken."""
    return wrapped(", ".join(item.replace(" ", NO_BREAK) for item in items), width)


def _states(seen: Inventory) -> Iterator[str]:
    starts = {item.name: item.start for item in seen.graph.components if item.start is not None}
    for store, coordinate in zip(seen.model.plant.network.states, seen.model.states, strict=True):
        start = starts.get(store.component or "")
        known = f"about where {store.source} is" if store.source else "solved from the first samples"
        known = (
            known
            if start is None
            else f"{start.mean:g} ± {start.sd:g} {unit_text(seen.graph.signal_unit(store.name).text)}".rstrip()
        )
        estimated = "" if coordinate == store.name else f", estimated as {coordinate}"
        yield f"{store.name}{estimated}; start: {known}"


def _print_signals(console: Console, seen: Inventory) -> None:
    graph, spec = seen.graph, seen.spec
    title(console, "Inputs")
    inputs = []
    for item, known in zip(graph.inputs, spec.inputs, strict=True):
        steps = [_spread(item.unit, known.step)] if known.step else []
        steps += [f"{100 * known.step_part:g} % of the largest value"] if known.step_part else []
        unit, noise = unit_text(item.unit.text), _spread(item.unit, item.noise)
        noise += ", of the record" if item.smooth else ""
        inputs.append((item.name, item.column, unit, noise, duration_text(item.settling), " and ".join(steps)))
    if inputs:
        header = ("name", "column", "unit", _noise_title(graph), "settling", "a step is more than")
        shown = 4 if graph.grid is TimeGrid.NONE else len(header)  # without time nothing settles
        table(console, header[:shown], [row[:shown] for row in inputs])
        if idle := unused_inputs(graph):
            told = "no law, sensor or condition names it, but a recording must have its column; use it or remove it"
            lines(console, under("unused", [f"{name}: {told}" for name in idle]))
    else:
        lines(console, [("", "none")])
    title(console, "Sensors")
    sensors = []
    for sensor, output in zip(graph.sensors, spec.outputs, strict=True):
        unit, noise = unit_text(sensor.unit.text), _spread(sensor.unit, sensor.noise)
        noise += f" + {100.0 * sensor.part:.3g} %" if sensor.part else ""
        direct = ", ".join(graph.inputs[n].name for n in output.direct_inputs)
        sensors.append((sensor.name, sensor.column, to_text(sensor.reads), unit, noise, direct))
    table(console, ("name", "column", "reads", "unit", _noise_title(graph), "follows at once"), sensors)
    lines(console, [*lag_lines(graph, spec), *validity_lines(graph), *_instruments(graph)])
    for kind, heading, what in (("slow_error", "Slow errors", "signal"), ("wander", "What wanders", "name")):
        rows = []
        for error, slow in zip(graph.slow_errors, spec.slow_errors, strict=True):
            if error.kind != kind:
                continue
            known_unit = error.unit if error.unit.text else graph.signal_unit(error.target)
            size = f"{100 * error.sd:g} %" if error.relative else _spread(known_unit, error.sd)
            size += f", more after a change of {', '.join(error.after)}" if error.after else ""
            limit = f"beyond {slow.limit:.2g} sizes" if slow.alarms else "never"
            rows.append((error.target, size, duration_text(error.memory), limit))
        if rows:
            title(console, heading)
            table(console, (what, "size (sd)", "memory", "alarms"), rows)
    if graph.checks:
        title(console, "Checks by hand")
        table(console, ("name", "what is done", "cost"), [_check_row(item, graph) for item in graph.checks])


def unused_inputs(graph: BondGraph) -> tuple[str, ...]:
    """Give the inputs that no law, sensor or condition names."""
    stated = {name for item in graph.conditions for name in names(item.condition)}
    return tuple(item.name for item in graph.inputs if item.name not in graph.acting_inputs | stated)


def _noise_title(graph: BondGraph) -> str:
    """Say what the noise is of that is shown: where rows are averaged, of their mean."""
    return "noise (sd)" if graph.row_time is None else "noise of means (sd)"


def _instruments(graph: BondGraph) -> Iterator[tuple[str, str]]:
    """Give what is known of sensors and inputs as instruments."""
    ranges = [
        f"{item.name} {_reach(item)} {unit_text(item.unit.text)}"
        for item in graph.sensors
        if math.isfinite(item.lower) or math.isfinite(item.upper)
    ]
    if ranges:
        yield "range", "; ".join(ranges)
    if graph.grid is not TimeGrid.NONE:
        trusted = [item.name for item in graph.instruments if not item.suspect]
        some = ", ".join(trusted) or "none of the inputs and sensors: each may fail"
        yield "trusted", "all inputs and sensors" if len(trusted) == len(graph.instruments) else some


def _check_row(item: Check, graph: BondGraph) -> tuple[str, str, str]:
    match item.kind:
        case CheckKind.COMPONENT:
            what = "look at it"
        case CheckKind.INPUT:
            unit = graph.input(item.name).unit
            size = "" if item.move is None else f" by {_spread(unit, item.move)}"
            what = "cannot be moved" if item.move == 0.0 else f"move it{size}"
        case CheckKind.SIGNAL:
            reads = "" if item.reads is None else to_text(item.reads)
            what = f"measure {reads}, noise (sd) {_spread(item.unit, item.noise)}"
    return item.name, what, f"{item.cost:g}"


def _left_out(spec: EngineSpec) -> Iterator[tuple[str, str]]:
    """Name what no hypothesis is about alone, with the reason."""
    trusted = ", ".join(item.name for item in spec.parameters if not item.suspect)
    if trusted:
        yield "not tested", f"{trusted}: trusted, unless the model file says `suspect: yes`"
    if hidden := ", ".join((*hidden_suspects(spec), *hidden_instruments(spec))):
        told = f"{hidden}: no data fix such a change by itself; `analyse` tells why"
        guessed = bool(spec.inputs) and all(item.fitted_range == (-math.inf, math.inf) for item in spec.inputs)
        yield "not tested", told + (" (inputs as guessed: a `fit` writes where they were)" if guessed else "")


def _rows_text(graph: BondGraph) -> str:
    """Say how samples are made of rows."""
    made = f"each sample is the mean of {graph.rows_per_sample}, and noise is told of that mean"
    return f"every {duration_text(graph.row_time or 0.0)}; {made}"


def _print_method(console: Console, seen: Inventory) -> None:
    graph, spec = seen.graph, seen.spec
    if graph.grid is TimeGrid.NONE:
        title(console, "Observations")
        sets = f"the smallest sets, of at most {with_noun(graph.max_faults, 'suspect')}"
        lines(console, [("rows", "each is an observation by itself"), ("hypotheses", sets)])
        return
    promised = graph.time_between_false_alarms
    substeps = f"{seen.model.substeps} steps a sample" if seen.model.substeps > 1 else "one step a sample"
    sets = " and ".join(
        with_noun(number, SET_NAMES.get(size, f"set of {size}")) for size, number in _set_sizes(spec).items()
    )
    title(console, "Engine")
    lines(
        console,
        [
            ("sampled", step_text(graph)),
            *([("rows", _rows_text(graph))] if graph.row_time is not None else []),
            ("warm-up", f"no alarms in the first {spec.thresholds.warm_up_samples} samples"),
            *([("false alarms", f"one in {duration_text(promised)} at most, on average")] if promised else []),
            *([("known", known_alarms(graph))] if graph.false_alarms else []),
            ("in time", f"{METHOD}; {substeps}"),
            ("hypotheses", f"{sets or 'none'}; {count_lanes(spec)} filters after an alarm"),
            *([("not tested", f"{text}: would explain anything")] if (text := unfalsifiable_text(spec)) else []),
            *_left_out(spec),
            ("runs as", seen.engine),
        ],
    )
