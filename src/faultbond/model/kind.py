"""What a model file states: a bond graph or a block network, in time or static, of numbers or of logic."""

from collections.abc import Mapping
from dataclasses import dataclass

from faultbond.model.graph import LOGIC_UNIT
from faultbond.model.source import Entry, Source, Table, Text
from faultbond.types import TimeGrid

_OF_BOND_GRAPHS = ("components", "junctions", "bonds")
_OF_TIME = {
    "warm_up": "no alarms to wait for",
    "time_between_false_alarms": "no alarms to wait for",
    "slow_error": "no slow errors",
    "instrument_faults": "no faults of sensors and inputs",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """The kind of a model.

    blocks: a block network, not a bond graph. static: each row is an observation. logic: signals are 0 or 1; `logic_by`
    names the input or sensor that says so.
    """

    blocks: bool = False
    static: bool = False
    logic_by: str = ""

    @property
    def logic(self) -> bool:
        """Whether the network is of logic."""
        return bool(self.logic_by)


def kind_of(source: Source, fields: Mapping[str, Entry], grid: TimeGrid) -> Kind:
    """Give the kind of a model from the keys that it states.

    Raises
    ------
    ModelError
        where keys of different kinds stand side by side.
    """
    if "blocks" not in fields:
        if grid is TimeGrid.NONE:
            problem = "is for block networks; a bond graph needs a time such as `1 s`, or `variable`"
            raise source.error(fields["sample_time"], f"sample_time `none` {problem}")
        return Kind()
    for key in _OF_BOND_GRAPHS:
        if key in fields:
            problem = "stands beside `blocks`; a model is a block network, or components, junctions and bonds"
            raise source.error(fields[key], f"`{key}` {problem}. Remove one")
    static, logic_by = grid is TimeGrid.NONE, _logic_by(fields)
    if logic_by and not static:
        problem = f"{logic_by} is logic, and logic networks are static; write `sample_time: none`"
        raise source.error(fields["sample_time"], f"sample_time: {problem}")
    for key, nothing in _OF_TIME.items():
        if static and key in fields:
            problem = f"with `sample_time: none` each row stands by itself, and there are {nothing}; remove it"
            raise source.error(fields[key], f"{key}: {problem}")
    return Kind(blocks=True, static=static, logic_by=logic_by)


def _logic_by(fields: Mapping[str, Entry]) -> str:
    """Give the first input or sensor with `unit: logic`, in words; empty if there is none."""
    for section, word in (("inputs", "input"), ("sensors", "sensor")):
        table = fields[section].value if section in fields else None
        for entry in table.entries if isinstance(table, Table) else ():
            inner = entry.value.entries if isinstance(entry.value, Table) else ()
            units = [item.value for item in inner if item.key == "unit"]
            if any(isinstance(unit, Text) and unit.value.strip() == LOGIC_UNIT.text for unit in units):
                return f"{word} {entry.key[:64]}"
    return ""
