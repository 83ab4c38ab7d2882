"""The head of a model file: its kind, its time, and what holds where a thing says nothing itself."""

from collections.abc import Mapping
from dataclasses import dataclass

from faultbond.model.defaults import Defaults
from faultbond.model.graph import LOGIC_UNIT, TimeColumn
from faultbond.model.keys import BOND_GRAPH_KEYS, MAX_FAULTS, MODEL_KEYS, MOST_FAULTS, TIME_KEYS
from faultbond.model.quantities import Spread
from faultbond.model.source import Source, Table, Text, shown
from faultbond.model.spot import Spot
from faultbond.model.units import SECOND, measure
from faultbond.types import TimeGrid

MOST_ALARMS = 10**6  # false ones that are known
_OF_TIME = {
    "warm_up": "no alarms to wait for",
    "row_time": "no samples that rows are averaged for",
    "valid_when": "no states of operation; leave out the rows that are not to be judged",
    "time_between_false_alarms": "no alarms to wait for",
    "false_alarms": "no alarms",
    "slow_error": "no slow errors",
    "correlations": "no parameters that are learned",
    "instrument_faults": "no faults of sensors and inputs",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Head:
    """What is known of a whole model before its things are read.

    source : where it comes from
    defaults : the record of defaults in force, which grows while the model is read
    blocks : whether it is a block network, not a bond graph
    logic_by : the input or sensor that says that signals are 0 or 1; empty where they are numbers
    instruments : whether inputs and sensors that do not say so are suspects
    """

    source: Source
    defaults: Defaults
    name: str
    blocks: bool
    logic_by: str
    grid: TimeGrid
    sample_time: float | None
    row_time: float | None
    max_faults: int
    false_alarms: int
    time: TimeColumn
    accuracy: Spread | None
    instruments: bool

    @property
    def static(self) -> bool:
        """Whether each row is an observation by itself."""
        return self.grid is TimeGrid.NONE

    @property
    def logic(self) -> bool:
        """Whether the network is of logic."""
        return bool(self.logic_by)


def whole(place: Spot, least: int, most: int) -> int:
    """Read a whole number within bounds.

    Raises
    ------
    ModelError
        where it is none, or out of them.
    """
    text = place.text()
    if not (text.isascii() and text.isdigit() and len(text) <= len(str(most)) and least <= int(text) <= most):
        raise place.error(f" is a whole number from {least} to {most}, not `{shown(text)}`")
    return int(text)


def read_head(source: Source, fields: Mapping[str, Spot], defaults: Defaults, name: str) -> Head:
    """Read the head of a model.

    Parameters
    ----------
    source : where the model comes from
    fields : the keys of the model
    defaults : is told what is not stated
    name : the model's name where it states none

    Raises
    ------
    ModelError
        where a setting cannot be read, or keys of different kinds stand side by side.
    """
    grid, sample_time = _grid(fields["sample_time"])
    static, blocks = grid is TimeGrid.NONE, "blocks" in fields
    logic_by = _check_kind(fields, static)
    time = _time(fields, defaults, static)
    if time.column is None and grid is TimeGrid.VARIABLE:
        problem = "`time: none` needs a fixed sample_time; state the time column, or a sample_time such as `1 s`"
        raise source.error(fields["time"].entry, problem)
    if "name" in fields:
        name = fields["name"].title()
    max_faults = whole(fields["max_faults"], 1, MOST_FAULTS) if "max_faults" in fields else MAX_FAULTS
    false_alarms = whole(fields["false_alarms"], 0, MOST_ALARMS) if "false_alarms" in fields else 0
    for key in ("name", "max_faults"):
        if key not in fields:
            defaults.missing(MODEL_KEYS, key)
    accuracy = fields["accuracy"].spread(free=True) if "accuracy" in fields else None
    if accuracy and not accuracy.is_relative:
        problem = " of the model is relative, such as `3 %`; state an absolute one at its parameter"
        raise fields["accuracy"].error(problem)
    return Head(
        source=source,
        defaults=defaults,
        name=name,
        blocks=blocks,
        logic_by=logic_by,
        grid=grid,
        sample_time=sample_time,
        row_time=_row_time(fields["row_time"], sample_time) if "row_time" in fields else None,
        max_faults=max_faults,
        false_alarms=false_alarms,
        time=time,
        accuracy=accuracy,
        instruments=fields["instrument_faults"].is_yes() if "instrument_faults" in fields else not static,
    )


def _grid(place: Spot) -> tuple[TimeGrid, float | None]:
    text = place.text()
    if text in (TimeGrid.VARIABLE.value, TimeGrid.NONE.value):
        return TimeGrid(text), None
    value = place.seconds()
    if value <= 0:
        raise place.error(" must be above 0, such as `1 s`")
    return TimeGrid.FIXED, value


def _row_time(place: Spot, sample_time: float | None) -> float:
    """Give the time between the rows that are averaged for a sample."""
    if sample_time is None:
        raise place.error(": rows are averaged for samples of a fixed sample_time; state one, or remove it")
    value = place.seconds()
    if not 0.0 < value <= sample_time / 2:
        raise place.error(f" must be above 0, and half of sample_time or less: {sample_time / 2:g} s; else remove it")
    return value


def _check_kind(fields: Mapping[str, Spot], static: bool) -> str:
    """Refuse keys of different kinds side by side; give the first input or sensor with `unit: logic`, in words."""
    if "blocks" not in fields:
        if static:
            problem = " `none` is for block networks; a bond graph needs a time such as `1 s`, or `variable`"
            raise fields["sample_time"].error(problem)
        return ""
    for key in BOND_GRAPH_KEYS:
        if key in fields:
            problem = "stands beside `blocks`; a model is a block network, or components, junctions and bonds"
            raise fields[key].source.error(fields[key].entry, f"`{key}` {problem}. Remove one")
    things = (
        (word, entry)
        for section, word in (("inputs", "input"), ("sensors", "sensor"))
        if section in fields and isinstance(table := fields[section].entry.value, Table)
        for entry in table.entries
    )
    logic_by = ""
    for word, entry in things:
        inner = entry.value.entries if isinstance(entry.value, Table) else ()
        units = [item.value for item in inner if item.key == "unit"]
        if any(isinstance(unit, Text) and unit.value.strip() == LOGIC_UNIT.text for unit in units):
            logic_by = f"{word} {entry.key[:64]}"
            break
    if logic_by and not static:
        problem = f": {logic_by} is logic, and logic networks are static; write `sample_time: none`"
        raise fields["sample_time"].error(problem)
    for key, nothing in _OF_TIME.items():
        if static and key in fields:
            problem = f": with `sample_time: none` each row stands by itself, and there are {nothing}; remove it"
            raise fields[key].error(problem)
    return logic_by


def _time(fields: Mapping[str, Spot], defaults: Defaults, static: bool) -> TimeColumn:
    if "time" not in fields:
        defaults.missing(MODEL_KEYS, "time", more=", else the number of the row" if static else "")
        return TimeColumn(optional=static)
    place = fields["time"]
    if isinstance(place.entry.value, Text):
        if place.entry.value.value.strip() == "none":
            return TimeColumn(column=None)
        raise place.error(" is `{column: .., unit: ..}` or `none`")
    found = place.fields(TIME_KEYS)
    column, unit = "time", measure("s")
    if "column" in found:
        column = found["column"].column()
    else:
        defaults.add("time column", column)
    if "unit" in found:
        unit = measure(found["unit"].text(), place.at(found["unit"]).where(": "))
        if unit.dimension != SECOND:
            raise found["unit"].error(f" is {unit.dimension}, not a time; write s, ms, min or h")
    else:
        defaults.add("time unit", unit.unit.text)
    return TimeColumn(column=column, unit=unit.unit)
