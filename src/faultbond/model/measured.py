"""Sensors and slow errors: what is measured, and known imperfections."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from faultbond.errors import ModelError
from faultbond.model.blocks import BlockReader
from faultbond.model.defaults import Defaults
from faultbond.model.dump import shared_factor
from faultbond.model.expression import Expression, Name, names
from faultbond.model.graph import Input, Sensor, SlowError, Unit
from faultbond.model.kind import Kind
from faultbond.model.laws import LawReader
from faultbond.model.quantities import NO_UNIT, Spread, quantity, spread, spread_over
from faultbond.model.source import Entry, Node, Source, Text, closest, shown
from faultbond.model.units import Measure
from faultbond.model.values import (
    check_length,
    check_scale,
    needs_size,
    range_ends,
    read_column,
    read_end,
    read_instrument,
    read_unit,
    same_unit,
)

SENSOR_KEYS = ("reads", "unit", "noise", "column", "range", "suspect")
SLOW_ERROR_KEYS = ("size", "after", "each")


@dataclass(frozen=True, slots=True)
class Measured:
    """Sensors and slow errors, with the measures in which they were stated."""

    sensors: tuple[Sensor, ...]
    slow_errors: tuple[SlowError, ...]
    sensor_measures: Mapping[str, Measure | None]
    noise_measures: Mapping[str, Measure | None]
    range_measures: Mapping[str, Measure]
    size_measures: Mapping[str, Measure]

    def stated(self, name: str) -> tuple[Measure | None, str]:
        """Give the measure that a sensor or check states first, and where."""
        if self.sensor_measures[name] is not None:
            return self.sensor_measures[name], "its unit"
        if self.noise_measures[name] is not None:
            return self.noise_measures[name], "its noise"
        return self.range_measures.get(name), "its range"


@dataclass(frozen=True, slots=True)
class Reading:
    """What is measured, in which unit, with which noise (SI standard deviation)."""

    reads: Expression
    unit: Unit
    noise: float


class MeasuredReader:
    """Reads `sensors` and `slow_error`.

    instruments: whether sensors that do not say so are suspects.
    """

    def __init__(
        self, source: Source, laws: LawReader | BlockReader, defaults: Defaults, kind: Kind, instruments: bool
    ) -> None:
        self.source, self.laws, self.defaults, self.kind = source, laws, defaults, kind
        self.instruments = instruments
        self.inputs: dict[str, Input] = {item.name: item for item in laws.values.inputs}
        self.sensor_measures: dict[str, Measure | None] = {}
        self.noise_measures: dict[str, Measure | None] = {}
        self.range_measures: dict[str, Measure] = {}
        self.size_measures: dict[str, Measure] = {}

    def read(self, fields: Mapping[str, Entry]) -> Measured:
        """Read both, in the order of the file."""
        entries = self.source.table(fields["sensors"].value, "sensors").entries if "sensors" in fields else ()
        if not entries:
            problem = "no sensors, so nothing can be compared with the model; state at least one under `sensors`"
            raise self.source.error(fields.get("sensors", 0), problem)
        sensors = tuple(self._sensor(entry) for entry in entries)
        slow = self.source.table(fields["slow_error"].value, "slow_error").entries if "slow_error" in fields else ()
        errors = tuple(self._slow_error(entry) for entry in slow)
        known = (self.sensor_measures, self.noise_measures, self.range_measures, self.size_measures)
        return Measured(sensors, errors, *known)

    def _sensor(self, entry: Entry) -> Sensor:
        name = self.source.name(entry, "sensors")
        what = f"sensor {name}"
        if name in self.inputs:
            raise self.source.error(entry, f"{what}: an input has this name too; rename one and state its `column`")
        fields = self.source.fields(entry.value, what, SENSOR_KEYS)
        reading = self.reading(entry, fields, what, "sensor")
        lower, upper = self._range(fields, name, what)
        return Sensor(
            name=name,
            column=read_column(self.source, fields, what, name, self.defaults),
            unit=reading.unit,
            reads=reading.reads,
            noise=reading.noise,
            lower=lower,
            upper=upper,
            suspect=read_instrument(self.source, fields, what, self.kind, self.instruments),
            line=entry.line,
        )

    def reading(self, entry: Entry, fields: Mapping[str, Entry], what: str, word: str) -> Reading:
        """Give what a sensor, or a check by hand, reads; `word` says which, `what` also names it."""
        name = entry.key
        signal = "y" if self.kind.blocks else "vessel.e"
        for key, example in (("reads", f"reads: {signal}"), ("noise", "noise: 180 Pa")):
            if key not in fields and not (key == "noise" and self.kind.static):
                meaning = "its standard deviation" if key == "noise" else "a law of signals"
                raise self.source.error(entry, f"{what}: `{key}` is missing; state {meaning}, such as `{example}`")
        measure = read_unit(self.source, fields, what, self.kind, entry)
        self.sensor_measures[name] = measure
        if measure is None:
            self.defaults.add("unit", "SI", name)
        text = self.source.text(fields["reads"].value, f"{what}: reads")
        reads = self.laws.expression(text, fields["reads"].line, f"{what}: reads")
        if not any(self.laws.is_signal(item) for item in names(reads)):
            raise self.source.error(fields["reads"], f"{what}: `{shown(text)}` reads no signal, such as `{signal}`")
        if self.laws.is_signal(name) and reads != Name(name):
            advice = "rename one and state `column`" if word == "sensor" else "rename the check"
            problem = f"a signal has this name too, and the {word} reads `{shown(text)}`; {advice}"
            raise self.source.error(entry, f"{what}: {problem}")
        unit = measure.unit if measure else NO_UNIT
        return Reading(reads, unit, self._noise(fields, name, what, measure))

    def _noise(self, fields: Mapping[str, Entry], name: str, what: str, measure: Measure | None) -> float:
        """Give the SI standard deviation of a sensor; only in a static network may it be 0, which is the default."""
        if "noise" not in fields:
            if not self.kind.logic:
                self.defaults.add("noise", "0", name)
            self.noise_measures[name] = None
            return 0.0
        entry, what = fields["noise"], f"{what}: noise"
        noise = self._sensor_spread(entry, what, measure)
        needs_size(self.source, entry, what, noise)
        self.noise_measures[name] = noise.quantity.measure if noise.quantity else None
        if noise.difference() <= 0 and not self.kind.static:
            raise self.source.error(entry, f"{what} must be above 0; state its standard deviation")
        check_scale(self.source, entry, what, noise.difference())
        return noise.difference()

    def _range(self, fields: Mapping[str, Entry], name: str, what: str) -> tuple[float, float]:
        """Give the ends of a sensor's measuring range in SI; without a unit of the sensor, their own is checked."""
        if "range" not in fields:
            return -math.inf, math.inf
        entry, what = fields["range"], f"{what}: range"
        if self.kind.logic:
            raise self.source.error(entry, f"{what}: a logic signal has no range; remove it")
        lower, upper = (self._end(node, what, name) for node in range_ends(self.source, entry, what))
        if lower >= upper:
            raise self.source.error(entry, f"{what}: the lowest value must be below the highest; mend one")
        return lower, upper

    def _end(self, node: Node, what: str, name: str) -> float:
        found = read_end(self.source, node, what, self.sensor_measures[name])
        known = self.sensor_measures[name] or self.noise_measures[name] or self.range_measures.get(name)
        if known is not None:
            same_unit(self.source, node, what, found, known)
        elif found.measure is not None:
            self.range_measures[name] = found.measure
        return found.value

    def _sensor_spread(self, entry: Entry, what: str, measure: Measure | None) -> Spread:
        """Give a standard deviation of a sensor; one that states no unit is in SI, and what it reads decides."""
        found = spread(self.source.text(entry.value, what), f"{self.source.at(entry)}{what} ", measure)
        if measure is not None and found.quantity is not None:
            same_unit(self.source, entry, what, found.quantity, measure)
        return found

    def _slow_error(self, entry: Entry) -> SlowError:
        target, what = entry.key, f"slow_error {shown(entry.key)}"
        default = self._target_measure(entry, what)
        if isinstance(entry.value, Text):
            fields = {"size": Entry("size", entry.value, entry.line)}
        else:
            fields = self.source.fields(entry.value, what, SLOW_ERROR_KEYS)
        if "size" not in fields:
            raise self.source.error(entry, f"{what}: `size` is missing; write it as `size: 0.2 cm over 40 s`")
        where = f"{self.source.at(fields['size'])}{what}: "
        sd, memory = spread_over(self.source.text(fields["size"].value, what), where, default)
        if sd.quantity is not None and sd.quantity.measure is not None:
            if default is None:
                self.size_measures[target] = sd.quantity.measure
            else:
                same_unit(self.source, fields["size"], f"{what}: size", sd.quantity, default)
        check_scale(self.source, fields["size"], f"{what}: size", sd.ratio if sd.is_relative else sd.difference())
        check_length(self.source, fields["size"], f"{what}: its memory", memory)
        if ("after" in fields) != ("each" in fields):
            problem = "`after` and `each` belong together; write `after: [inflow], each: 0.005 cm/(cm^3/s)`"
            raise self.source.error(entry, f"{what}: {problem}")
        after = self._after(fields["after"], what) if "after" in fields else ()
        stated = default if sd.quantity is None else sd.quantity.measure or default
        return SlowError(
            target=target,
            sd=sd.ratio if sd.is_relative else sd.difference(),
            relative=sd.is_relative,
            memory=memory,
            after=after,
            each=self._each(fields["each"], what, after, sd, default) if "each" in fields else 0.0,
            is_sensor=target in self.sensor_measures,
            unit=Unit("") if stated is None or sd.is_relative else stated.unit,
            line=entry.line,
        )

    def _target_measure(self, entry: Entry, what: str) -> Measure | None:
        """Check the target, a signal or a sensor; give the measure of a sensor."""
        target = entry.key
        if self.laws.is_signal(target):
            self._check_signal(entry, what)
            return None
        if target not in self.sensor_measures:
            signal, known = ("y", self.laws.owners) if isinstance(self.laws, BlockReader) else ("line.f", {})
            near = closest(target, [*self.sensor_measures, *known])
            near = near or f"write a sensor's name or a signal such as `{signal}`"
            raise self.source.error(entry, f"{what}: no sensor `{shown(target)}`; {near}")
        return self.sensor_measures[target]

    def _check_signal(self, entry: Entry, what: str) -> None:
        """Refuse a signal that cannot be in error; in a block network a sensor may have its name, or it is a store."""
        target = self.laws.signal(entry.key, f"{self.source.at(entry)}{what}: ")
        if target in self.sensor_measures:
            problem = "a sensor and a signal have this name; rename the sensor and state its `column`"
            raise self.source.error(entry, f"{what}: {problem}")
        if isinstance(self.laws, BlockReader) and target in self.laws.stores:
            problem = f"`{target}` is a store; add a block with `law: y = {target}` and put the error on `y`"
            raise self.source.error(entry, f"{what}: {problem}, or on a sensor")

    def _after(self, entry: Entry, what: str) -> tuple[str, ...]:
        node = entry.value
        items = (node,) if isinstance(node, Text) else self.source.items(node, f"{what}: after")
        found = tuple(self.source.text(item, f"{what}: after") for item in items)
        for name in found:
            if name not in self.inputs:
                near = closest(name, self.inputs) or "name inputs of the model"
                raise self.source.error(entry, f"{what}: after: no input `{shown(name)}`; {near}")
        if not found or len(set(found)) < len(found):
            raise self.source.error(entry, f"{what}: after names one or more inputs, each once")
        return found

    def _each(self, entry: Entry, what: str, after: tuple[str, ...], sd: Spread, target: Measure | None) -> float:
        """Give the SI growth of the standard deviation per SI change of an input."""
        if sd.is_relative:
            raise self.source.error(entry, f"{what}: `each` needs an absolute size, such as `size: 0.2 cm over 40 s`")
        where = f"{self.source.at(entry)}{what}: each "
        found = quantity(self.source.text(entry.value, f"{what}: each"), where)
        size = target or (sd.quantity.measure if sd.quantity else None)
        per = [self.laws.values.measures[name] for name in after]
        if found.number < 0:
            raise ModelError(f"{where}is negative; a standard deviation is 0 or more")
        if found.measure is None:
            per_unit = shared_factor(self.inputs[name].unit for name in after)
            return found.number * (size.unit.factor if size else 1.0) / per_unit
        for name, measure in zip(after, per, strict=True):
            if size and measure and size.dimension / measure.dimension != found.measure.dimension:
                wanted = size.dimension / measure.dimension
                raise ModelError(f"{where}is in {found.measure.dimension}, but {wanted} is expected for input {name}")
        return found.difference
