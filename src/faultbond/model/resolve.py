"""From the plain tree to a checked bond graph: the one way for the text file and for the Python builder."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from faultbond.model import defaults as default_values
from faultbond.model.blocks import BlockReader, block_wiring
from faultbond.model.checks import read_checks
from faultbond.model.defaults import Defaults
from faultbond.model.dimensions import Checker, Demand, check_demands
from faultbond.model.dump import dump_model
from faultbond.model.expression import Expression, Name, names
from faultbond.model.graph import BondGraph, Check, Component, Relation, SlowError, TimeColumn
from faultbond.model.kind import Kind, kind_of
from faultbond.model.laws import LawReader, check_used
from faultbond.model.measured import Measured, MeasuredReader
from faultbond.model.quantities import Spread, spread
from faultbond.model.source import Entry, Source, Table, Text, shown
from faultbond.model.units import SECOND, Measure, measure
from faultbond.model.values import ValueReader, Values, column_text, read_duration, yes_or_no
from faultbond.model.wiring import Wiring, wiring
from faultbond.types import TimeGrid

MODEL_KEYS = (
    *("name", "sample_time", "max_faults", "accuracy", "warm_up", "time", "constants", "inputs", "components"),
    *("junctions", "bonds", "sensors", "slow_error", "blocks", "instrument_faults", "time_between_false_alarms"),
    "checks",
)
MAX_FAULTS = 10


@dataclass(frozen=True, slots=True)
class _Settings:
    name: str
    kind: Kind
    grid: TimeGrid
    sample_time: float | None
    max_faults: int
    time: TimeColumn
    accuracy: Spread | None
    instruments: bool  # inputs and sensors are suspects


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
    fields = source.fields(table, "model", MODEL_KEYS)
    defaults = Defaults()
    settings = _settings(source, fields, defaults, name)
    kind = settings.kind
    plant = block_wiring(source, fields) if kind.blocks else wiring(source, fields)
    values = ValueReader(source, defaults, settings.accuracy, kind, settings.instruments).read(fields, plant)
    laws: LawReader | BlockReader = LawReader(source, plant, values, defaults)
    if kind.blocks:
        laws = BlockReader(source, plant, values, defaults, kind)
    components = laws.components()
    reader = MeasuredReader(source, laws, defaults, kind, settings.instruments)
    measured = reader.read(fields)
    checks = read_checks(fields, reader, plant, measured.sensors)
    check_used(source, plant, values, _used(components, measured))
    if not kind.logic:
        _check_dimensions(source, plant, values, components, laws, measured, checks)
    graph = BondGraph(
        name=settings.name,
        grid=settings.grid,
        sample_time=settings.sample_time,
        max_faults=settings.max_faults,
        warm_up=_warm_up(source, fields, settings, measured.slow_errors, defaults),
        time=settings.time,
        parameters=values.parameters,
        constants=values.constants,
        inputs=values.inputs,
        components=components,
        junctions=tuple(plant.junctions.values()),
        bonds=plant.bonds,
        sensors=measured.sensors,
        slow_errors=measured.slow_errors,
        time_between_false_alarms=_patience(source, fields),
        checks=checks,
        defaults=defaults.pairs(),
        file=source.label,
    )
    return replace(graph, text=dump_model(graph))


def _settings(source: Source, fields: Mapping[str, Entry], defaults: Defaults, name: str) -> _Settings:
    grid, sample_time = _grid(source, fields)
    kind = kind_of(source, fields, grid)
    time = _time(source, fields, defaults, kind)
    if time.column is None and grid is TimeGrid.VARIABLE:
        problem = "`time: none` needs a fixed sample_time; state the time column, or a sample_time such as `1 s`"
        raise source.error(fields["time"], problem)
    return _Settings(
        name=_name(source, fields, defaults, name),
        kind=kind,
        grid=grid,
        sample_time=sample_time,
        max_faults=_max_faults(source, fields, defaults),
        time=time,
        accuracy=_accuracy(source, fields),
        instruments=_instruments(source, fields, kind),
    )


def _name(source: Source, fields: Mapping[str, Entry], defaults: Defaults, name: str) -> str:
    if "name" not in fields:
        defaults.add("name", "the file's name")
        return name
    text = source.text(fields["name"].value, "name")
    if len(text) > 100 or not text.isprintable():
        raise source.error(fields["name"], "name must be one line of printable text, 100 characters at most")
    return text


def _grid(source: Source, fields: Mapping[str, Entry]) -> tuple[TimeGrid, float | None]:
    if "sample_time" not in fields:
        raise source.error(0, "`sample_time` is missing; state it, such as `sample_time: 1 s`, or `variable`")
    entry = fields["sample_time"]
    text = source.text(entry.value, "sample_time")
    if text == "variable":
        return TimeGrid.VARIABLE, None
    if text == "none":
        return TimeGrid.NONE, None
    value = read_duration(source, entry, "sample_time")
    if value <= 0:
        raise source.error(entry, "sample_time must be above 0, such as `1 s`")
    return TimeGrid.FIXED, value


def _max_faults(source: Source, fields: Mapping[str, Entry], defaults: Defaults) -> int:
    if "max_faults" not in fields:
        defaults.add("max_faults", str(default_values.MAX_FAULTS))
        return default_values.MAX_FAULTS
    text = source.text(fields["max_faults"].value, "max_faults")
    if not (text.isascii() and text.isdigit() and len(text) <= 2 and 1 <= int(text) <= MAX_FAULTS):
        problem = f"is a whole number from 1 to {MAX_FAULTS}, not `{shown(text)}`"
        raise source.error(fields["max_faults"], f"max_faults {problem}")
    return int(text)


def _accuracy(source: Source, fields: Mapping[str, Entry]) -> Spread | None:
    if "accuracy" not in fields:
        return None
    entry = fields["accuracy"]
    found = spread(source.text(entry.value, "accuracy"), source.at(entry) + "accuracy ")
    if not found.is_relative:
        problem = "of the model is relative, such as `3 %`; state an absolute one at its parameter"
        raise source.error(entry, f"accuracy {problem}")
    return found


def _instruments(source: Source, fields: Mapping[str, Entry], kind: Kind) -> bool:
    """Whether inputs and sensors that do not say so are suspects."""
    if "instrument_faults" in fields:
        return yes_or_no(source, fields["instrument_faults"], "instrument_faults")
    return not kind.static


def _patience(source: Source, fields: Mapping[str, Entry]) -> float | None:
    """Give the stated mean time between false alarms in seconds."""
    if "time_between_false_alarms" not in fields:
        return None
    entry = fields["time_between_false_alarms"]
    value = read_duration(source, entry, entry.key)
    if value <= 0:
        raise source.error(entry, f"{entry.key} must be above 0, such as `30 days`")
    return value


def _time(source: Source, fields: Mapping[str, Entry], defaults: Defaults, kind: Kind) -> TimeColumn:
    if "time" not in fields:
        defaults.add("time", "column `time` in s" + (", else the number of the row" if kind.static else ""))
        return TimeColumn(optional=kind.static)
    entry = fields["time"]
    if isinstance(entry.value, Text) and entry.value.value.strip() == "none":
        return TimeColumn(column=None)
    if isinstance(entry.value, Text):
        raise source.error(entry, "time is `{column: .., unit: ..}` or `none`")
    known = source.fields(entry.value, "time", ("column", "unit"))
    column, unit = "time", measure("s")
    if "column" in known:
        column = column_text(source, known["column"], "time")
    else:
        defaults.add("time column", "time")
    if "unit" in known:
        unit = measure(source.text(known["unit"].value, "time: unit"), source.at(known["unit"]) + "time: ")
        if unit.dimension != SECOND:
            raise source.error(known["unit"], f"time: unit is {unit.dimension}, not a time; write s, ms, min or h")
    else:
        defaults.add("time unit", "s")
    return TimeColumn(column=column, unit=unit.unit)


def _warm_up(
    source: Source,
    fields: Mapping[str, Entry],
    settings: _Settings,
    slow_errors: tuple[SlowError, ...],
    defaults: Defaults,
) -> float:
    """Give the time without alarms: stated, or long enough for the filter to learn the slow errors of the plant."""
    if settings.kind.static:
        return 0.0
    if "warm_up" in fields:
        return read_duration(source, fields["warm_up"], "warm_up")
    least = default_values.WARM_UP_SECONDS
    if settings.sample_time is not None:
        least = default_values.WARM_UP_SAMPLES * settings.sample_time
    memories = [item.memory for item in slow_errors if not item.is_sensor]
    value = max(least, default_values.WARM_UP_MEMORY * max(memories, default=0.0))
    defaults.add("warm_up", f"{value:.6g} s")
    return value


def _used(components: tuple[Component, ...], measured: Measured) -> set[str]:
    laws = [side for item in components for law in item.laws for side in (law.left, law.right)]
    return {name for expression in (*laws, *(item.reads for item in measured.sensors)) for name in names(expression)}


def _check_dimensions(
    source: Source,
    plant: Wiring,
    values: Values,
    components: tuple[Component, ...],
    laws: LawReader | BlockReader,
    measured: Measured,
    checks: tuple[Check, ...],
) -> None:
    """Check laws, in the order of the file, then what refers to their signals."""

    def law(side: Relation, owner: str) -> Demand:
        where = f"{source.at(side.line)}law of {owner}: "
        return lambda checker: checker.law(side.left, side.right, where)

    def expect(reads: Expression, found: Measure | None, words: tuple[str, str], line: int) -> Iterator[Demand]:
        if found is not None:
            where = f"{source.at(line)}{words[0]}: "
            yield lambda checker: checker.expect(reads, found.dimension, words[1], where)

    demands = [law(side, component.name) for component in components for side in component.laws]
    for word, items in (("sensor", measured.sensors), ("check", checks)):
        for item in items:
            if item.reads is not None:
                unit, said = measured.stated(item.name)
                demands += expect(item.reads, unit, (f"{word} {item.name}", said), item.line)
    reads = {sensor.name: sensor.reads for sensor in measured.sensors}
    for error in measured.slow_errors:
        words = f"slow_error {error.target}", "its size"
        target = reads[error.target] if error.is_sensor else Name(error.target)
        demands += expect(target, measured.size_measures.get(error.target), words, error.line)
    for start in laws.starts:
        words = f"start of {start.signal.partition('.')[0]}", "the start"
        demands += expect(Name(start.signal), start.measure, words, start.line)
    check_demands(demands, lambda: Checker(plant, values))
