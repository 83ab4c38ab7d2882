"""What was understood of a model, as text for people."""

import math
import textwrap
from collections.abc import Iterable

from rich.console import Console
from rich.text import Text

from faultbond.contract.lanes import plan_lanes
from faultbond.model.graph import BondGraph, Check, Component, Parameter, Sensor, SlowError, Unit
from faultbond.model.parser import to_text
from faultbond.report.console import lines, table, title
from faultbond.report.numbers import Notation, duration_text, figure, unit_text
from faultbond.report.terminal import PLAIN_WIDTH
from faultbond.report.understanding import METHOD, Understanding, law_text, lines_of, loops_of, set_sizes, settings_of
from faultbond.report.verdict import unfalsifiable_text
from faultbond.types import CheckKind, TimeGrid

MEANING = {
    "cusum_drift": "CUSUM: part of a standard deviation taken off each sample",
    "cusum_limit": "CUSUM: limit at which it alarms",
    "fast_drift": "fast CUSUM: part of a standard deviation taken off each sample",
    "fast_limit": "fast CUSUM: limit at which it alarms; so high that it does not, unless a time is promised",
    "scatter_ratio": "sum of the scatter: noise that it looks for, times as large as declared",
    "scatter_limit": "sum of the scatter: limit at which it alarms, nats",
    "cusum_clip": "CUSUM: largest contribution of one sample, standard deviations",
    "learning_bound": "largest innovation from which the healthy filter learns once warm, standard deviations",
    "bank_bound": "largest innovation that counts after the alarm, standard deviations",
    "slow_error_limit": "limit at which a slow error alarms, in its declared sizes",
    "cost_per_suspect": "cost of each suspect of a set, nats",
    "cost_per_sensor": "cost of a sensor as the suspect, nats",
    "group_nats": "sets closer to the best than this are not told apart, nats",
    "blank_factor": "noise variance of a sensor while an input settles, times",
    "warm_up_samples": "samples without alarms at the start, with those of the model's warm-up",
    "history_samples": "samples kept to look back for the onset",
    "start_samples": "samples gathered to solve an unknown start",
    "diagnosis_every": "samples from one diagnosis to the next",
    "change_memory": "changes of an input add up over, s",
    "start_patience": "samples for which a sensor without any value holds up the start, at most",
    "first_renewal": "samples from the alarm to the first new beginning of each hypothesis from what it has found",
    "last_renewal": "samples from the alarm to the last such beginning",
    "onset_dense": "samples before the alarm of which each is tried as onset",
    "onset_ratio": "ratio of the distances from the alarm of neighbouring onsets further back",
    "onset_many": "numbers in the covariances of all filters from which on fewer onsets are tried",
    "wild": "standard deviations of an innovation beyond which its sample is tried as onset, too",
    "process_noise": "sd added to a state each sample, noises of the sensor that shows it best",
    "gap": "samples without any value, and three times the usual number, after which the states are uncertain",
    "unknown_gap": "samples that a gap of unknown length counts as",
    "gap_far": "samples of a gap after which a state may be wherever it has been",
    "unseen_longest": "samples at most for which a missing input counts as having moved",
    "unseen_lost": "samples without an input that usually is told, from which on no sum grows",
    "input_rarely": "part of the samples in which an input is told that is not only logged at changes",
    "first_start": "first starting value of a suspect, nominals; each next one is twice as large",
    "start_spread": "standard deviation of a start, starts",
    "reach": "starting values lie within this many `change` of nominal",
    "coarse_from": "sets of this size and more use two starts for each suspect",
    "many_lanes": "filters beyond which pairs too use two starts for each suspect",
    "max_candidates": "candidates given in a record, at most",
    "max_substeps": "substeps of a sample, at most",
    "newton_steps": "Newton steps for a loop without closed form",
    "sqrt_width": "smoothing of sqrt(x) at 0, of the size of its terms",
    "root_width": "smoothing of a square law solved for its flow at 0, of the size of its terms",
}
NO_BREAK = "\N{NO-BREAK SPACE}"
LABELS = 18  # columns left of the texts of a section
SET_NAMES = {1: "single", 2: "pair", 3: "triple"}


def print_check(console: Console, seen: Understanding) -> None:
    """Print what was understood of a model.

    Parameters
    ----------
    console : where to print; one that is no terminal is set to `PLAIN_WIDTH` columns
    seen : the model and what was made of it
    """
    if not console.is_terminal:
        console.width = PLAIN_WIDTH
    graph = seen.graph
    console.print(Text.assemble((graph.name, "bold"), (f"  {graph.file}", "dim")))
    _print_plant(console, graph)
    _print_structure(console, seen)
    _print_signals(console, seen)
    _print_method(console, seen)
    _print_defaults(console, seen)


def _print_plant(console: Console, graph: BondGraph) -> None:
    title(console, "Components")
    table(console, ("name", "type", "law"), [_component(item) for item in graph.components])
    if graph.parameters or not graph.is_block_network:
        title(console, "Parameters")
        header = ("name", "component", "nominal", "± when healthy", "± when faulty", "range", "unit")
        table(console, header, [_parameter(item) for item in graph.parameters])
    if graph.constants:
        constants = (f"{item.name} = {_value(item.unit, item.value)}" for item in graph.constants)
        lines(console, [("constants", ", ".join(constants))])
    if limits := _limits(graph):
        lines(console, [("drifts matter at", limits)])


def _component(item: Component) -> tuple[str, ...]:
    laws = "\n".join(law_text(item, law) for law in item.laws)
    return (item.name, item.type.value if item.suspect else f"{item.type.value}, trusted", laws)


def _parameter(item: Parameter) -> tuple[str, ...]:
    unit = item.unit
    healthy, faulty = (
        figure(unit.difference_from_si(sd), digits=3).number(Notation.FILE) for sd in (item.accuracy, item.change)
    )
    return (
        item.name,
        item.owner,
        figure(unit.from_si(item.nominal)).number(Notation.FILE),
        healthy,
        faulty if item.suspect else "trusted",
        _reach(item),
        unit_text(unit.text, Notation.FILE),
    )


def _reach(item: Parameter | Sensor) -> str:
    lower, upper = (figure(item.unit.from_si(end)).number(Notation.FILE) for end in (item.lower, item.upper))
    match (math.isfinite(item.lower), math.isfinite(item.upper)):
        case (True, True):
            return f"{lower} to {upper}"
        case (True, False):
            return f"{lower} or more"
        case (False, True):
            return f"{upper} or less"
    return "any"


def _limits(graph: BondGraph) -> str:
    stated = [(item, [_value(item.unit, end) for end in item.limits]) for item in graph.parameters if item.limits]
    return "; ".join(f"{item.name} {' or '.join(ends)}" for item, ends in stated)


def _value(unit: Unit, si: float) -> str:
    return f"{figure(unit.from_si(si)).number(Notation.FILE)} {unit_text(unit.text, Notation.FILE)}".rstrip()


def _spread(unit: Unit, si: float) -> str:
    if si == 0.0:
        return "none"
    return f"{figure(unit.difference_from_si(si)).number(Notation.FILE)} {unit_text(unit.text, Notation.FILE)}".rstrip()


def _print_structure(console: Console, seen: Understanding) -> None:
    memory = [
        ("states", "\n".join(_states(seen)) or "none: the plant has no memory"),
        ("loops", "\n".join(_loops(seen)) or "none"),
    ]
    if seen.graph.is_block_network:
        title(console, "Signals")
        suspects = ", ".join(seen.graph.suspect_blocks) or "the parameters"
        signals = _wrapped(seen.graph.block_signals, console.width - LABELS)
        lines(console, [("signals", signals), ("suspects", suspects), *memory])
        return
    graph, causality = seen.graph, seen.model.plant.causality
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
            ("integral", _located(causality.integral, seen)),
            ("derivative", _located(causality.derivative, seen)),
            ("chosen freely", _located(causality.free, seen)),
            *memory,
        ],
    )


def _located(parts: Iterable[str], seen: Understanding) -> str:
    """Name parts, each with its line in the model file."""
    lines = lines_of(seen.graph)
    return ", ".join(f"{name} (line {lines[name]})" if lines.get(name) else name for name in parts) or "none"


def _wrapped(items: Iterable[str], width: int) -> str:
    """Put items in lines, none of them broken."""
    whole = ", ".join(item.replace(" ", NO_BREAK) for item in items)
    return textwrap.fill(whole, max(width, 1), break_long_words=False, break_on_hyphens=False).replace(NO_BREAK, " ")


def _states(seen: Understanding) -> Iterable[str]:
    stores = seen.model.plant.network.states
    starts = {item.name: item.start for item in seen.graph.components if item.start is not None}
    for store, coordinate in zip(stores, seen.model.states, strict=True):
        start = starts.get(store.component or "")
        known = "solved from the first samples" if start is None else f"{start.mean:g} ± {start.sd:g} (SI)"
        estimated = "" if coordinate == store.name else f", estimated as {coordinate}"
        yield f"{store.name}{estimated}; start: {known}"


def _loops(seen: Understanding) -> Iterable[str]:
    for loop in loops_of(seen.model):
        yield f"{', '.join(loop.signals)} by {_located(loop.components, seen)}: {loop.solution}"


def _print_signals(console: Console, seen: Understanding) -> None:
    graph = seen.graph
    title(console, "Inputs")
    inputs = [
        (
            *(item.name, item.column, unit_text(item.unit.text, Notation.FILE)),
            *(_spread(item.unit, item.noise), duration_text(item.settling), _step(seen, k)),
        )
        for k, item in enumerate(graph.inputs)
    ]
    if inputs:
        header = ("name", "column", "unit", "noise (sd)", "settling", "a step is more than")
        shown = 4 if graph.grid is TimeGrid.NONE else len(header)  # without time nothing settles
        table(console, header[:shown], [row[:shown] for row in inputs])
    else:
        lines(console, [("", "none")])
    title(console, "Sensors")
    sensors = [
        (
            *(item.name, item.column, to_text(item.reads), unit_text(item.unit.text, Notation.FILE)),
            *(_spread(item.unit, item.noise), ", ".join(graph.inputs[n].name for n in known.direct_inputs)),
        )
        for item, known in zip(graph.sensors, seen.spec.outputs, strict=True)
    ]
    table(console, ("name", "column", "reads", "unit", "noise (sd)", "follows at once"), sensors)
    lines(console, list(_instruments(graph)))
    if graph.slow_errors:
        title(console, "Slow errors")
        rows = [
            (error.target, _slow_size(error), duration_text(error.memory), "yes" if known.alarms else "no")
            for error, known in zip(graph.slow_errors, seen.spec.slow_errors, strict=True)
        ]
        table(console, ("signal", "size (sd)", "memory", "may alarm"), rows)
    if graph.checks:
        title(console, "Checks by hand")
        table(console, ("name", "what is done", "cost"), [_check(item, graph) for item in graph.checks])


def _instruments(graph: BondGraph) -> Iterable[tuple[str, str]]:
    """What is known of sensors and inputs as instruments."""
    ranges = [f"{item.name} {_reach(item)} {unit}" for item, unit in _ranged(graph)]
    if ranges:
        yield "range", "; ".join(ranges)
    if graph.grid is not TimeGrid.NONE:
        trusted = [item.name for item in graph.inputs if not item.suspect]
        trusted += [item.name for item in graph.sensors if not item.suspect]
        everything = len(trusted) == len(graph.inputs) + len(graph.sensors)
        yield "trusted", "all inputs and sensors" if everything else ", ".join(trusted) or "none: each may fail"


def _ranged(graph: BondGraph) -> Iterable[tuple[Sensor, str]]:
    for item in graph.sensors:
        if math.isfinite(item.lower) or math.isfinite(item.upper):
            yield item, unit_text(item.unit.text, Notation.FILE)


def _check(item: Check, graph: BondGraph) -> tuple[str, str, str]:
    match item.kind:
        case CheckKind.COMPONENT:
            what = "look at it"
        case CheckKind.INPUT:
            unit = graph.input(item.name).unit
            what = "move it" if item.move is None else f"move it by {_spread(unit, item.move)}"
        case CheckKind.SIGNAL:
            reads = "" if item.reads is None else to_text(item.reads)
            what = f"measure {reads}, noise (sd) {_spread(item.unit, item.noise)}"
    return item.name, what, f"{item.cost:g}"


def _step(seen: Understanding, k: int) -> str:
    known, unit = seen.spec.inputs[k], seen.graph.inputs[k].unit
    parts = [_spread(unit, known.step)] if known.step else []
    parts += [f"{100 * known.step_part:g} % of the largest value"] if known.step_part else []
    return " and ".join(parts)


def _slow_size(error: SlowError) -> str:
    unit = error.unit if error.unit.text else Unit("SI")
    size = f"{100 * error.sd:g} %" if error.relative else _spread(unit, error.sd)
    return f"{size}, more after a change of {', '.join(error.after)}" if error.after else size


def _print_method(console: Console, seen: Understanding) -> None:
    graph, spec = seen.graph, seen.spec
    if graph.grid is TimeGrid.NONE:
        title(console, "Observations")
        sets = f"of at most {graph.max_faults} suspect{'s'[: graph.max_faults != 1]}"
        lines(console, [("rows", "each is an observation by itself"), ("hypotheses", f"the smallest sets, {sets}")])
        return
    promised = graph.time_between_false_alarms
    step = f"every {duration_text(graph.sample_time)}" if graph.sample_time else "as the rows come"
    substeps = f"{seen.model.substeps} steps a sample" if seen.model.substeps > 1 else "one step a sample"
    sizes = set_sizes(spec)
    sets = " and ".join(
        f"{number} {SET_NAMES.get(size, f'set of {size}')}{'s' if number > 1 else ''}" for size, number in sizes.items()
    )
    title(console, "Engine")
    lines(
        console,
        [
            ("sampled", step),
            ("warm-up", f"no alarms in the first {spec.thresholds.warm_up_samples} samples"),
            *([("false alarms", f"one in {duration_text(promised)} at most, on average")] if promised else []),
            ("in time", f"{METHOD}; {substeps}"),
            ("hypotheses", f"{sets or 'none'}; {plan_lanes(spec).n_lanes} filters after an alarm"),
            *([("not tested", f"{text}: would explain anything")] if (text := unfalsifiable_text(spec)) else []),
            ("runs as", seen.engine),
        ],
    )


def _print_defaults(console: Console, seen: Understanding) -> None:
    title(console, "Defaults in force: what the model file does not state")
    lines(console, seen.graph.defaults)
    if seen.graph.grid is TimeGrid.NONE:
        return
    title(console, "Settings of the method")
    lines(console, [(f"{value:g}", MEANING.get(name, name)) for name, value in settings_of(seen.spec).items()])
