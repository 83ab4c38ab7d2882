"""What is measured: sensors, their slow errors, and what can be checked by hand."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

from faultbond.errors import ModelError
from faultbond.model.blocks import BlockReader
from faultbond.model.expression import Expression, Name, names
from faultbond.model.graph import Check, Input, Sensor, SlowError, Unit
from faultbond.model.head import Head
from faultbond.model.keys import CHECK_COST, CHECK_KEYS, SENSOR_KEYS, SLOW_ERROR_KEYS
from faultbond.model.laws import LawReader
from faultbond.model.quantities import NO_UNIT, Spread, shared_factor, spread, spread_over
from faultbond.model.source import closest, shown
from faultbond.model.spot import Spot
from faultbond.model.units import Measure
from faultbond.model.values import (
    ValueReader,
    read_column,
    read_fitted_range,
    read_healthy_bias,
    read_instrument,
    read_reach,
    read_unit,
)
from faultbond.types import CheckKind


@dataclass(frozen=True, slots=True)
class Measured:
    """Sensors, slow errors and checks.

    stated : of sensors and checks with a unit anywhere the measure that comes first, and where it stands
    sizes : of slow errors of signals the measure of their size, where it has one
    valid : of sensors that do not always read as stated, where it stands when they do
    """

    sensors: tuple[Sensor, ...]
    slow_errors: tuple[SlowError, ...]
    checks: tuple[Check, ...]
    stated: Mapping[str, tuple[Measure, str]]
    sizes: Mapping[str, Measure]
    valid: Mapping[str, Spot]


class MeasuredReader:
    """Reads `sensors`, `slow_error` and `checks`; the lags of sensors become numbers of the model."""

    def __init__(self, head: Head, laws: LawReader | BlockReader, numbers: ValueReader) -> None:
        self.head, self.source, self.laws, self.numbers = head, head.source, laws, numbers
        self.inputs: dict[str, Input] = {item.name: item for item in laws.values.inputs}
        self.units: dict[str, Measure | None] = {}  # of sensors and checks
        self.stated: dict[str, tuple[Measure, str]] = {}
        self.sizes: dict[str, Measure] = {}
        self.valid: dict[str, Spot] = {}
        self.columns: dict[str, str] = {}  # of sensors, by column

    def read(self, fields: Mapping[str, Spot]) -> Measured:
        """Read all of them, in the order of the file.

        Raises
        ------
        ModelError
            where there is no sensor, or at the first thing that cannot be read.
        """
        if "sensors" not in fields or not fields["sensors"].entries():
            line = fields["sensors"].line if "sensors" in fields else 0
            problem = "no sensors, so nothing can be compared with the model; state at least one under `sensors`"
            raise self.source.error(line, problem)
        sensors = tuple(map(self._sensor, fields["sensors"].things("sensor")))
        slow = fields["slow_error"].things("slow_error", checked=False) if "slow_error" in fields else ()
        errors = tuple(map(self._slow_error, slow))
        taken = {item.name for item in sensors}
        places = fields["checks"].things("check") if "checks" in fields else ()
        checks = tuple(self._check(place, taken) for place in places)
        return Measured(sensors, errors, checks, self.stated, self.sizes, self.valid)

    def _sensor(self, place: Spot) -> Sensor:
        name = place.name
        if name in self.inputs:
            raise place.error(": an input has this name too; rename one and state its `column`")
        fields = place.fields(SENSOR_KEYS)
        reads, unit, noise = self._reading(place, fields, "sensor")

        def end(place: Spot) -> float:
            found = place.end(self.units[name])
            if name in self.stated:
                place.check_unit(found, self.stated[name][0])
            elif found.measure is not None:
                self.stated[name] = found.measure, "its range"
            return found.value

        lower, upper = read_reach(self.head, fields, end)
        if "valid_when" in fields:
            if self.head.static:
                problem = ": with `sample_time: none` there are no states of operation; remove it"
                raise fields["valid_when"].error(problem)
            self.valid[name] = place.at(fields["valid_when"])
        lag, order = self.numbers.lag(place, fields["lag"]) if "lag" in fields else ("", 1)
        column = read_column(self.head, fields, SENSOR_KEYS, name)
        other = self.columns.setdefault(column, name)
        if other != name and not {name, other} <= self.valid.keys():
            problem = f": its column {shown(column)!r} is that of the sensor {other} too; state the `column` of each"
            raise place.at(fields.get("column", place)).error(f"{problem}, or when each reads it with `valid_when`")
        return Sensor(
            name=name,
            column=column,
            unit=unit,
            reads=reads,
            noise=noise,
            growth=self._part(place, fields, self.units[name]) / noise if noise else 0.0,
            lag=lag,
            order=order,
            lower=lower,
            upper=upper,
            suspect=read_instrument(self.head, fields),
            healthy_bias=read_healthy_bias(fields, self.units[name]),
            fitted_range=read_fitted_range(fields, end),
            line=place.line,
        )

    def _reading(self, place: Spot, fields: Mapping[str, Spot], word: str) -> tuple[Expression, Unit, float]:
        """Give what a sensor, or a check by hand, reads, its unit, and its SI noise; `word` says which it is."""
        name = place.name
        signal = "y" if self.head.blocks else "vessel.e"
        if "reads" not in fields:
            raise place.error(f": `reads` is missing; state a law of signals, such as `reads: {signal}`")
        if "noise" not in fields and not self.head.static:
            raise place.error(": `noise` is missing; state its standard deviation, such as `noise: 180 Pa`")
        measure = self.units[name] = read_unit(self.head, place, fields)
        if measure is None:
            self.head.defaults.missing(SENSOR_KEYS, "unit", name)
        else:
            self.stated[name] = measure, "its unit"
        reads, text = self.laws.expression(fields["reads"]), shown(fields["reads"].text())
        if set(names(reads)) <= {item.name for item in self.laws.values.constants}:
            problem = f": `{text}` is always the same; name a signal such as `{signal}`, an input or a parameter"
            raise place.at(fields["reads"]).error(problem)
        if self.laws.is_signal(name) and reads != Name(name):
            advice = "rename one and state `column`" if word == "sensor" else "rename the check"
            raise place.error(f": a signal has this name too, and the {word} reads `{text}`; {advice}")
        unit = measure.unit if measure else NO_UNIT
        if "noise" not in fields:
            if not self.head.logic:
                self.head.defaults.missing(SENSOR_KEYS, "noise", name)
            return reads, unit, 0.0
        spread = self._size(fields["noise"], measure)
        if measure is None and spread.quantity and spread.quantity.measure:
            self.stated[name] = spread.quantity.measure, "its noise"
        noise = spread.difference()
        if noise <= 0 and not self.head.static:
            raise fields["noise"].error(" must be above 0; state its standard deviation")
        fields["noise"].check_size(noise)
        return reads, unit, noise

    def _size(self, place: Spot, measure: Measure | None) -> Spread:
        """Give the noise of a reading of 0."""
        size, plus, _ = place.text().partition(" + ")
        if not plus:
            return place.spread(measure, sized=True, free=True)
        found = spread(size, place.where(), measure)
        if found.is_relative:
            raise place.error(" is a size and a part of the reading, in this order, such as `0.1 bar + 1 %`")
        if found.quantity is not None and measure is not None:
            place.check_unit(found.quantity, measure)
        return found

    def _part(self, place: Spot, fields: Mapping[str, Spot], measure: Measure | None) -> float:
        """Give the part of the reading that the noise of a sensor is beside its size, 0 where none is stated."""
        _, plus, part = fields["noise"].text().partition(" + ")
        if not plus:
            return 0.0
        noise = fields["noise"]
        if self.head.static:
            raise noise.error(": with `sample_time: none` noise is a size; leave out what is behind `+`")
        found = spread(part, noise.where(), measure)
        if not found.is_relative:
            raise noise.error(" is a size and a part of the reading, such as `0.1 bar + 1 %`")
        if measure is not None and measure.unit.offset:
            text = measure.unit.text
            raise noise.error(f": a part of a reading in {text} depends on where {text} begins; state a size alone")
        return found.ratio or 0.0

    def _slow_error(self, place: Spot) -> SlowError:
        target, default = place.name, self._target_measure(place)
        fields = place.fields(SLOW_ERROR_KEYS)
        size = fields["size"]
        sd, memory = spread_over(place.at(size).text(), place.at(size).where(": "), default)
        stated = sd.quantity.measure if sd.quantity else None
        if stated is not None and default is None:
            self.sizes[target] = stated
        elif sd.quantity is not None and stated is not None:
            size.check_unit(sd.quantity, default)
        value = sd.ratio if sd.is_relative else sd.difference()
        size.check_size(value)
        place.at(size).check_time(memory, ": its memory")
        if ("after" in fields) != ("each" in fields):
            problem = "`after` and `each` belong together; write `after: [inflow], each: 0.005 cm/(cm^3/s)`"
            raise place.error(f": {problem}")
        after = self._after(place.at(fields["after"])) if "after" in fields else ()
        unit = stated or default
        return SlowError(
            target=target,
            sd=value,
            relative=sd.is_relative,
            memory=memory,
            after=after,
            each=self._each(place, fields["each"], after, sd, default) if "each" in fields else (),
            is_sensor=target in self.units,
            unit=NO_UNIT if unit is None or sd.is_relative else unit.unit,
            line=place.line,
        )

    def _target_measure(self, place: Spot) -> Measure | None:
        """Check the target, a signal or a sensor; give the measure of a sensor.

        A signal cannot be in error where a sensor of a block network has its name, or where it is a store.
        """
        target = place.name
        if self.laws.is_signal(target):
            target = self.laws.signal(target, place.where(": "))
            if target in self.units:
                raise place.error(": a sensor and a signal have this name; rename the sensor and state its `column`")
            if isinstance(self.laws, BlockReader) and target in self.laws.stores:
                problem = f"`{target}` is a store; add a block with `law: y = {target}` and put the error on `y`"
                raise place.error(f": {problem}, or on a sensor")
            return None
        if target not in self.units:
            signal, known = ("y", self.laws.owners) if isinstance(self.laws, BlockReader) else ("line.f", {})
            near = closest(target, [*self.units, *known])
            near = near or f"write a sensor's name or a signal such as `{signal}`"
            raise place.error(f": no sensor `{shown(target)}`; {near}")
        return self.units[target]

    def _after(self, place: Spot) -> tuple[str, ...]:
        """Give the inputs that `after` names."""
        inner = replace(place, words=f"{place.words}: after")
        found = tuple(item.text() for item in inner.one_or_more())
        for name in found:
            if name not in self.inputs:
                near = closest(name, self.inputs) or "name inputs of the model"
                raise inner.error(f": no input `{shown(name)}`; {near}")
        if not found or len(set(found)) < len(found):
            raise place.error(": after names one or more inputs, each once")
        return found

    def _each(
        self, place: Spot, each: Spot, after: tuple[str, ...], sd: Spread, target: Measure | None
    ) -> tuple[float, ...]:
        """Give the SI growth of the standard deviation per SI change of each input."""
        if sd.is_relative:
            problem = ": `each` needs an absolute size, such as `size: 0.2 cm over 40 s`"
            raise place.at(each).error(problem)
        size = target or (sd.quantity.measure if sd.quantity else None)
        stated = each.one_or_more()
        if len(stated) == 1:
            return (self._growth(stated[0], after, size),) * len(after)
        if len(stated) != len(after):
            raise place.at(each).error(f": `each` is one size, or one of each input in `after`: {', '.join(after)}")
        return tuple(self._growth(item, (name,), size) for item, name in zip(stated, after, strict=True))

    def _growth(self, each: Spot, after: tuple[str, ...], size: Measure | None) -> float:
        where = each.where()
        found = each.quantity()
        if found.number < 0:
            raise ModelError(f"{where}is negative; a standard deviation is 0 or more")
        if found.measure is None:
            per_unit = shared_factor(self.inputs[name].unit for name in after)
            return found.number * (size.unit.factor if size else 1.0) / per_unit
        for name in after:
            measure = self.laws.values.measures[name]
            if size and measure and size.dimension / measure.dimension != found.measure.dimension:
                wanted = size.dimension / measure.dimension
                raise ModelError(f"{where}is in {found.measure.dimension}, but {wanted} is expected for input {name}")
        return found.difference

    def _check(self, place: Spot, sensors: set[str]) -> Check:
        """Give what can be checked by hand: a component is looked at, an input moved, a signal measured."""
        name, fields = place.name, place.fields(CHECK_KEYS)
        cost = CHECK_COST
        if "cost" in fields:
            found = fields["cost"].quantity()
            if found.measure is not None or found.number <= 0:
                problem = " is a number above 0 without a unit, in any measure that you like"
                raise fields["cost"].error(problem)
            cost = found.number
        else:
            self.head.defaults.missing(CHECK_KEYS, "cost", name)
        self._refuse_known(place, sensors, "reads" in fields)
        if "reads" in fields:
            if "move" in fields:
                problem = ": a signal is measured, not moved; remove `move` or `reads`"
                raise place.at(fields["move"]).error(problem)
            reads, unit, noise = self._reading(place, fields, "check")
            kind = CheckKind.SIGNAL
            return Check(name=name, kind=kind, reads=reads, unit=unit, noise=noise, cost=cost, line=place.line)
        for key in ("unit", "noise"):
            if key in fields:
                problem = f"`{key}` goes with `reads`, the law of what is measured; state that, or remove `{key}`"
                raise place.at(fields[key]).error(f": {problem}")
        if name in self.inputs:
            move = self._move(fields["move"], self.inputs[name]) if "move" in fields else None
            return Check(name=name, kind=CheckKind.INPUT, move=move, cost=cost, line=place.line)
        if "move" in fields:
            raise place.at(fields["move"]).error(": only an input is moved; remove `move`")
        return Check(name=name, kind=CheckKind.COMPONENT, cost=cost, line=place.line)

    def _refuse_known(self, place: Spot, sensors: set[str], reads: bool) -> None:
        """Refuse a name that is not that of one thing to check: a signal has a new name, all else a known one."""
        name, parts = place.name, self.laws.plant.parts
        found = [word for word, known in (("a component", parts), ("an input", self.inputs)) if name in known]
        if name in sensors:
            problem = "a sensor has this name; name a component or an input, or give `reads` under a new name"
            raise place.error(f": {problem}")
        if reads and found:
            problem = f"{found[0]} has this name; remove `reads`, or choose a new name for what is measured"
            raise place.error(f": {problem}")
        if len(found) > 1:
            raise place.error(": a component and an input have this name; rename one")
        if not reads and not found:
            owner = {item.name: item.owner for item in self.laws.values.parameters}.get(name, "")
            near = f"name its component `{owner}`" if owner else closest(name, [*parts, *self.inputs])
            problem = f"no component or input `{shown(name)}`; {near or 'give `reads` to measure a signal by hand'}"
            raise place.error(f": {problem}")

    def _move(self, place: Spot, item: Input) -> float:
        """Give the SI size of the change of an input; `no`: 0, since nobody can move it."""
        own = self.laws.values.measures[item.name]
        if self.head.logic:
            raise place.error(": a logic input has two values; remove it")
        if place.text().lower() in ("no", "false"):
            return 0.0
        found = place.quantity(own)
        place.check_unit(found, own)
        if found.difference <= 0:
            raise place.error(" is a size above 0, such as `10 percent`, or `no` where nobody can move it")
        return found.difference
