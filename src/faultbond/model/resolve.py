"""From the plain tree to a checked bond graph: the one way for the text file and for the Python builder."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial

from faultbond.model.blocks import BlockReader, block_wiring
from faultbond.model.correlations import read_correlations
from faultbond.model.defaults import Defaults
from faultbond.model.dimensions import Checker, Demand, check_demands
from faultbond.model.dump import dump_model
from faultbond.model.expression import Expression, Name, names
from faultbond.model.graph import BondGraph, Component, Sensor, SlowError
from faultbond.model.head import Head, read_head
from faultbond.model.keys import MODEL_KEYS
from faultbond.model.laws import LawReader, check_used
from faultbond.model.measured import Measured, MeasuredReader
from faultbond.model.row_means import averaged
from faultbond.model.source import Entry, Source, Table, Text
from faultbond.model.spot import Spot
from faultbond.model.tables import check_tables, read_tables
from faultbond.model.units import Measure
from faultbond.model.validity import ValidityReader, trust_states
from faultbond.model.values import ValueReader, Values
from faultbond.model.wiring import Wiring, wiring

WARM_UP_SAMPLES = 20
WARM_UP_SECONDS = 20.0  # for a variable grid
WARM_UP_MEMORY = 0.3  # of the longest memory of a plant signal's slow error


def resolve(table: Table, source: Source, name: str) -> BondGraph:
    """Give the bond graph of a plain tree.

    Parameters
    ----------
    table : keys and values as texts
    source : names the file, for messages
    name : the model's name where it states none

    Raises
    ------
    ModelError
        at the first thing that is not a complete, consistent model.
    """
    fields = Spot(source, "model", Entry("", table)).fields(MODEL_KEYS, prefix="")
    defaults = Defaults()
    head = read_head(source, fields, defaults, name)
    plant = block_wiring(source, fields) if head.blocks else wiring(source, fields)
    reader = ValueReader(head)
    tables, axes = read_tables(head, fields)
    values = reader.read(fields, plant, axes)
    laws: LawReader | BlockReader = (BlockReader if head.blocks else LawReader)(head, plant, values)
    components = laws.components()
    measured = MeasuredReader(head, laws, reader).read(fields)
    sides = [side for item in components for law in item.laws for side in (law.left, law.right)]
    sides += [item.reads for item in measured.sensors]
    check_used(plant, values, {name for side in sides for name in names(side)})
    top = Spot(source, "model", Entry("", table))
    check_tables(tables, _expressions(source, components, measured), top)
    validity = ValidityReader(laws, frozenset(item.name for item in measured.sensors))
    valid_when = validity.read(fields["valid_when"]) if "valid_when" in fields else None
    sensors = tuple(_valid(item, measured.valid.get(item.name), validity) for item in measured.sensors)
    checker = None
    if not head.logic:
        checker = _check_dimensions(source, plant, values, components, laws, measured, validity)
    warm_up = _warm_up(fields, head, measured.slow_errors)
    patience = None
    if "time_between_false_alarms" in fields:
        place = fields["time_between_false_alarms"]
        patience = place.seconds()
        if patience <= 0:
            raise place.error(" must be above 0, such as `30 days`")
    parameters = (*values.parameters, *reader.lags)
    correlations = read_correlations(fields["correlations"], parameters) if "correlations" in fields else ()
    graph = BondGraph(
        name=head.name,
        grid=head.grid,
        sample_time=head.sample_time,
        max_faults=head.max_faults,
        warm_up=warm_up,
        time=head.time,
        parameters=parameters,
        constants=values.constants,
        inputs=values.inputs,
        components=components,
        junctions=tuple(plant.junctions.values()),
        bonds=plant.bonds,
        sensors=sensors,
        slow_errors=(*measured.slow_errors, *reader.wanders),
        tables=tables,
        time_between_false_alarms=patience,
        false_alarms=head.false_alarms,
        valid_when=valid_when,
        row_time=head.row_time,
        checks=measured.checks,
        correlations=correlations,
        defaults=defaults.pairs(),
        file=source.label,
    )
    if checker is not None:
        graph = replace(graph, signal_units=tuple(_units(graph, plant, checker)))
    graph = averaged(trust_states(graph))
    return replace(graph, text=dump_model(graph))


def _units(graph: BondGraph, plant: Wiring, checker: Checker) -> Iterator[tuple[str, str]]:
    """Give the SI unit of each signal of which laws and units fix it."""
    bonded = (f"{part}.{signal}" for part in (*plant.parts, *plant.junctions) for signal in plant.signals(part))
    for name in graph.block_signals if graph.is_block_network else bonded:
        unit = checker.unit_of(name)
        if unit is not None:
            yield name, unit


def _valid(sensor: Sensor, stated: Spot | None, reader: ValidityReader) -> Sensor:
    """Give a sensor with the condition under which it reads as stated, where there is one."""
    return sensor if stated is None else replace(sensor, valid_when=reader.read(stated))


def _expressions(
    source: Source, components: tuple[Component, ...], measured: Measured
) -> Iterator[tuple[Expression, Spot]]:
    """Give all expressions, each with a place for messages about it."""
    for component in components:
        for law in component.laws:
            place = Spot(source, f"law of {component.name}: ", Entry("", Text(""), law.line))
            yield from ((law.left, place), (law.right, place))
    for word, items in (("sensor", measured.sensors), ("check", measured.checks)):
        for item in items:
            if item.reads is not None:
                yield item.reads, Spot(source, f"{word} {item.name}: reads: ", Entry("", Text(""), item.line))


def _warm_up(fields: Mapping[str, Spot], head: Head, slow_errors: tuple[SlowError, ...]) -> float:
    """Give the time without alarms: stated, or long enough for the filter to learn the slow errors of the plant."""
    if head.static:
        return 0.0
    if "warm_up" in fields:
        return fields["warm_up"].seconds()
    least = WARM_UP_SECONDS if head.sample_time is None else WARM_UP_SAMPLES * head.sample_time
    memories = [item.memory for item in slow_errors if not item.is_sensor]
    value = max(least, WARM_UP_MEMORY * max(memories, default=0.0))
    head.defaults.add("warm_up", f"{value:.6g} s")
    return value


def _check_dimensions(
    source: Source,
    plant: Wiring,
    values: Values,
    components: tuple[Component, ...],
    laws: LawReader | BlockReader,
    measured: Measured,
    validity: ValidityReader,
) -> Checker:
    """Check laws, in the order of the file, then what refers to their signals."""
    demands: list[Demand] = []

    def expect(reads: Expression, found: Measure, words: tuple[str, str], line: int) -> None:
        where = f"{source.at(line)}{words[0]}: "
        demands.append(lambda checker: checker.expect(reads, found.dimension, words[1], where))

    for component in components:
        for law in component.laws:
            where = f"{source.at(law.line)}law of {component.name}: "
            demands.append(partial(Checker.law, left=law.left, right=law.right, where=where))
    for word, items in (("sensor", measured.sensors), ("check", measured.checks)):
        for item in items:
            if item.reads is not None and item.name in measured.stated:
                unit, said = measured.stated[item.name]
                expect(item.reads, unit, (f"{word} {item.name}", said), item.line)
    reads = {sensor.name: sensor.reads for sensor in measured.sensors}
    for error in measured.slow_errors:
        if error.target in measured.sizes:
            target = reads[error.target] if error.is_sensor else Name(error.target)
            expect(target, measured.sizes[error.target], (f"slow_error {error.target}", "its size"), error.line)
    for start in laws.starts:
        if start.measure is not None:
            words = f"start of {start.signal.partition('.')[0]}", "the start"
            expect(Name(start.signal), start.measure, words, start.line)
    return check_demands([*demands, *validity.demands], lambda: Checker(plant, values))
