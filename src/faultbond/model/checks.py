"""Checks by hand: which component can be looked at, which input moved, which signal measured, and what it costs."""

from collections.abc import Mapping

from faultbond.model.defaults import CHECK_COST
from faultbond.model.graph import Check, Input, Sensor
from faultbond.model.measured import MeasuredReader
from faultbond.model.quantities import quantity
from faultbond.model.source import Entry, Text, closest, shown
from faultbond.model.values import same_unit
from faultbond.model.wiring import Wiring
from faultbond.types import CheckKind

CHECK_KEYS = ("cost", "move", "reads", "unit", "noise")
OF_SIGNALS = ("unit", "noise")


def read_checks(
    fields: Mapping[str, Entry], reader: MeasuredReader, plant: Wiring, sensors: tuple[Sensor, ...]
) -> tuple[Check, ...]:
    """Read `checks`, in the order of the file.

    Parameters
    ----------
    fields : the keys of the model
    reader : reads what a check measures as it reads what a sensor measures
    plant : components or blocks, and junctions
    sensors : what is measured already
    """
    if "checks" not in fields:
        return ()
    checks = _Reader(reader, plant, {item.name for item in sensors})
    return tuple(checks.check(entry) for entry in reader.source.table(fields["checks"].value, "checks").entries)


class _Reader:
    """Reads the checks of one model."""

    def __init__(self, reader: MeasuredReader, plant: Wiring, sensors: set[str]) -> None:
        self.reader, self.plant, self.sensors = reader, plant, sensors
        self.source = reader.source

    def check(self, entry: Entry) -> Check:
        """Give one check."""
        name, what = self.source.name(entry, "checks"), f"check {entry.key}"
        short = isinstance(entry.value, Text) and entry.value.value.strip()
        fields = {"cost": Entry("cost", entry.value, entry.line)} if short else {}
        fields = fields or self.source.fields(entry.value, what, CHECK_KEYS)
        cost = self._cost(fields, name, what)
        self._refuse_known(entry, what, "reads" in fields)
        if "reads" in fields:
            return self._signal(entry, fields, what, cost)
        for key in OF_SIGNALS:
            if key in fields:
                problem = f"`{key}` goes with `reads`, the law of what is measured; state that, or remove `{key}`"
                raise self.source.error(fields[key], f"{what}: {problem}")
        if name in self.reader.inputs:
            move = self._move(fields["move"], what, self.reader.inputs[name]) if "move" in fields else None
            return Check(name=name, kind=CheckKind.INPUT, move=move, cost=cost, line=entry.line)
        if "move" in fields:
            raise self.source.error(fields["move"], f"{what}: only an input is moved; remove `move`")
        return Check(name=name, kind=CheckKind.COMPONENT, cost=cost, line=entry.line)

    def _signal(self, entry: Entry, fields: Mapping[str, Entry], what: str, cost: float) -> Check:
        if "move" in fields:
            raise self.source.error(
                fields["move"], f"{what}: a signal is measured, not moved; remove `move` or `reads`"
            )
        reading = self.reader.reading(entry, fields, what, "check")
        return Check(
            name=entry.key,
            kind=CheckKind.SIGNAL,
            reads=reading.reads,
            unit=reading.unit,
            noise=reading.noise,
            cost=cost,
            line=entry.line,
        )

    def _refuse_known(self, entry: Entry, what: str, reads: bool) -> None:
        """Refuse a name that is not that of one thing to check: a signal has a new name, all else a known one."""
        name = entry.key
        found = [
            word for word, known in (("component", self.plant.parts), ("input", self.reader.inputs)) if name in known
        ]
        if name in self.sensors:
            problem = "a sensor has this name; name a component or an input, or give `reads` under a new name"
            raise self.source.error(entry, f"{what}: {problem}")
        if reads and found:
            problem = f"{_article(found[0])} has this name; remove `reads`, or choose a new name for what is measured"
            raise self.source.error(entry, f"{what}: {problem}")
        if len(found) > 1:
            raise self.source.error(entry, f"{what}: a component and an input have this name; rename one")
        if not reads and not found:
            owner = {item.name: item.owner for item in self.reader.laws.values.parameters}.get(name, "")
            near = f"name its component `{owner}`" if owner else closest(name, [*self.plant.parts, *self.reader.inputs])
            problem = f"no component or input `{shown(name)}`; {near or 'give `reads` to measure a signal by hand'}"
            raise self.source.error(entry, f"{what}: {problem}")

    def _cost(self, fields: Mapping[str, Entry], name: str, what: str) -> float:
        if "cost" not in fields:
            self.reader.defaults.add("cost", f"{CHECK_COST:g}", name)
            return CHECK_COST
        entry, what = fields["cost"], f"{what}: cost"
        found = quantity(self.source.text(entry.value, what), f"{self.source.at(entry)}{what} ")
        if found.measure is not None or found.number <= 0:
            raise self.source.error(entry, f"{what} is a number above 0 without a unit, in any measure that you like")
        return found.number

    def _move(self, entry: Entry, what: str, item: Input) -> float:
        """Give the SI size of the change of an input."""
        what, own = f"{what}: move", self.reader.laws.values.measures[item.name]
        if self.reader.kind.logic:
            raise self.source.error(entry, f"{what}: a logic input has two values; remove it")
        found = quantity(self.source.text(entry.value, what), f"{self.source.at(entry)}{what} ", own)
        same_unit(self.source, entry, what, found, own)
        if found.difference <= 0:
            raise self.source.error(entry, f"{what} is a size above 0, such as `10 percent`")
        return found.difference


def _article(word: str) -> str:
    return f"an {word}" if word == "input" else f"a {word}"
