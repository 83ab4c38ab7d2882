"""The canonical text of a bond graph: fixed order and form, defaults in force left out."""

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator

from faultbond.errors import ModelError
from faultbond.model.defaults import ACCURACY, CHANGE, CHECK_COST, MAX_FAULTS, default_range, in_force
from faultbond.model.elements import OWN_SIGNALS, default_laws
from faultbond.model.expression import rename
from faultbond.model.graph import (
    LOGIC_UNIT,
    BondGraph,
    Check,
    Component,
    Input,
    Parameter,
    Sensor,
    SlowError,
    TimeColumn,
    Unit,
)
from faultbond.model.parser import number_text, to_text
from faultbond.model.units import measure
from faultbond.types import CheckKind, ElementType, TimeGrid

_PLAIN = re.compile(r"-?[A-Za-z0-9_.](?:[A-Za-z0-9_ .+\-*/^()=<>%]*[A-Za-z0-9_.+*/^()=<>%])?")


def dump_model(graph: BondGraph) -> str:
    """Give the canonical text of a bond graph; it reads back as the same graph but for lines and file.

    Example
    -------
    >>> text_of(100.0, lambda number: number * 1e-3)
    '100000'
    """
    return "\n".join(_Writer(graph).lines()) + "\n"


def text_of(target: float, convert: Callable[[float], float]) -> str | None:
    """Give the shortest decimal number that `convert` (about linear) turns into exactly the target; None if none."""
    slope = convert(1.0) - convert(0.0)
    guess = (target - convert(0.0)) / slope if slope else 0.0
    if not math.isfinite(guess):
        return None
    near = [guess, *(math.nextafter(guess, end) for end in (-math.inf, math.inf))]
    near += [math.nextafter(item, end) for item, end in zip(near[1:], (-math.inf, math.inf), strict=True)]
    rounded = (float(f"{guess:.{digits}g}") for digits in range(1, 17))
    return next((number_text(item) for item in (*rounded, *near) if convert(item) == target), None)


class _Writer:
    """Writes one graph."""

    def __init__(self, graph: BondGraph) -> None:
        self.graph, self.defaults, self.static = graph, in_force(graph.defaults), graph.grid is TimeGrid.NONE
        self.parameters = {item.name: item for item in graph.parameters}
        self.accuracies = {item.name: self.spread_text(item, item.accuracy) for item in graph.parameters}
        own = [item.name for item in graph.parameters if self.stated_spread("accuracy", item, item.accuracy, ACCURACY)]
        common = Counter(self.accuracies[name] for name in own if self.accuracies[name].endswith("%")).most_common(1)
        self.accuracy = common[0][0] if common and len(own) == len(graph.parameters) else ""
        self.own_accuracy = frozenset(name for name in own if self.accuracies[name] != self.accuracy)

    def stated(self, what: str, who: str = "", *, is_default: bool = True) -> bool:
        """Whether a thing must be written: it was stated, or has been changed since from its default."""
        return (what, who) not in self.defaults or not is_default

    def stated_spread(self, what: str, item: Parameter, value: float, percent: float) -> bool:
        return self.stated(what, item.name, is_default=value == percent / 100 * abs(item.nominal))

    def lines(self) -> Iterator[str]:
        graph = self.graph
        yield from self.head()
        yield from _section("constants", ((item.name, _value(item.value, item.unit)) for item in graph.constants))
        yield from _section("inputs", ((item.name, self.input(item)) for item in graph.inputs))
        parts = ((item.name, self.component(item)) for item in graph.components)
        yield from _section("blocks" if graph.is_block_network else "components", parts)
        yield from _section("junctions", ((item.name, item.type.value) for item in graph.junctions))
        if not graph.is_block_network:
            yield "bonds:"
            yield from (f"  - {bond.tail} -> {bond.head}" for bond in graph.bonds)
        yield from _section("sensors", ((item.name, self.sensor(item)) for item in graph.sensors))
        yield from _section("slow_error", ((item.target, self.slow_error(item)) for item in graph.slow_errors))
        yield from _section("checks", ((item.name, self.check(item)) for item in graph.checks))

    def head(self) -> Iterator[str]:
        graph = self.graph
        if self.stated("name"):
            yield f"name: {_scalar(graph.name)}"
        yield f"sample_time: {graph.grid.value if graph.sample_time is None else _seconds(graph.sample_time)}"
        if self.stated("max_faults", is_default=graph.max_faults == MAX_FAULTS):
            yield f"max_faults: {graph.max_faults}"
        if self.accuracy:
            yield f"accuracy: {self.accuracy}"
        if not self.static and self.stated("warm_up"):
            yield f"warm_up: {_seconds(graph.warm_up)}"
        if graph.time_between_false_alarms is not None:
            yield f"time_between_false_alarms: {_seconds(graph.time_between_false_alarms)}"
        if graph.time.column is None:
            yield "time: none"
        elif self.stated("time", is_default=graph.time == TimeColumn(optional=self.static)):
            column = _scalar(graph.time.column) if self.stated("time column") else ""
            unit = graph.time.unit.text if self.stated("time unit") else ""
            yield f"time: {_flow((('column', column), ('unit', unit)))}"

    def input(self, item: Input) -> str:
        has_settling = self.stated("settling", item.name, is_default=item.settling == 0)
        return _flow(
            (
                ("unit", item.unit.text),
                ("column", self.column(item)),
                ("noise", self.noise(item)),
                ("settling", _seconds(item.settling) if has_settling and not self.static else ""),
                ("range", _range(item) if math.isfinite(item.lower) or math.isfinite(item.upper) else ""),
                ("suspect", "" if item.suspect or self.static else "no"),
            )
        )

    def noise(self, item: Input | Sensor | Check) -> str:
        has_noise = item.unit != LOGIC_UNIT and self.stated("noise", item.name, is_default=item.noise == 0)
        return _difference(item.noise, item.unit) if has_noise else ""

    def column(self, item: Input | Sensor) -> str:
        stated = self.stated("column", item.name, is_default=item.column == item.name)
        return _scalar(item.column) if stated else ""

    def component(self, item: Component) -> str:
        own = {f"{item.name}.{signal}": signal for signal in OWN_SIGNALS.get(item.type, ())}
        sides = [
            [rename(side, lambda name: own.get(name, name)) for side in (law.left, law.right)] for law in item.laws
        ]
        texts = [f"{to_text(left)} = {to_text(right)}" for left, right in sides]
        law = f"[{', '.join(map(_scalar, texts))}]" if len(texts) > 1 else _scalar(texts[0])
        is_default = len(item.parameters) == 1 and texts == default_laws(item.type, item.parameters[0])
        owned = ((name, self.parameter(self.parameters[name])) for name in item.parameters)
        start = ""
        if item.start is not None:
            key = {"C": "q", "I": "p"}.get(item.type.value) or next(law.store for law in item.laws if law.store)
            start = f"{{{key}: {number_text(item.start.mean)}, sd: {number_text(item.start.sd)}}}"
        return _flow(
            (
                ("type", "" if item.type is ElementType.BLOCK else item.type.value),
                ("law", law if self.stated("law", item.name, is_default=is_default) else ""),
                ("parameters", _flow(owned) if item.parameters else ""),
                ("signals", f"[{', '.join(item.signals)}]" if item.signals else ""),
                ("start", start),
                ("suspect", "" if item.suspect else "no"),
            )
        )

    def parameter(self, item: Parameter) -> str:
        has_change = self.stated_spread("change", item, item.change, CHANGE)
        has_range = self.stated("range", item.name, is_default=(item.lower, item.upper) == default_range(item.nominal))
        entries = (
            ("accuracy", self.accuracies[item.name] if item.name in self.own_accuracy else ""),
            ("change", self.spread_text(item, item.change) if has_change else ""),
            ("range", _range(item) if has_range else ""),
            ("limit", self.limit(item)),
            ("suspect", "" if item.suspect else "no"),
        )
        nominal = _value(item.nominal, item.unit)
        return _flow((("nominal", nominal), *entries)) if any(text for _, text in entries) else nominal

    def spread_text(self, item: Parameter, value: float) -> str:
        """Give a parameter's spread, relative where that is exact."""
        if item.nominal != 0:
            percent = text_of(value, lambda number: number / 100 * abs(item.nominal))
            if percent is not None and len(percent) <= 8:
                return f"{percent} %"
        return _difference(value, item.unit)

    def limit(self, item: Parameter) -> str:
        ends = [_value(end, item.unit) for end in item.limits]
        return f"[{', '.join(ends)}]" if len(ends) > 1 else "".join(ends)

    def sensor(self, item: Sensor) -> str:
        return _flow(
            (
                ("reads", _scalar(to_text(item.reads))),
                ("unit", item.unit.text),
                ("noise", self.noise(item)),
                ("column", self.column(item)),
                ("range", _range(item) if math.isfinite(item.lower) or math.isfinite(item.upper) else ""),
                ("suspect", "" if item.suspect or self.static else "no"),
            )
        )

    def check(self, item: Check) -> str:
        has_cost = self.stated("cost", item.name, is_default=item.cost == CHECK_COST)
        unit = self.graph.input(item.name).unit if item.kind is CheckKind.INPUT else item.unit
        return _flow(
            (
                ("cost", number_text(item.cost) if has_cost else ""),
                ("move", "" if item.move is None else _difference(item.move, unit)),
                ("reads", "" if item.reads is None else _scalar(to_text(item.reads))),
                ("unit", item.unit.text),
                ("noise", "" if item.reads is None else self.noise(item)),
            )
        )

    def slow_error(self, item: SlowError) -> str:
        unit = next((sensor.unit for sensor in self.graph.sensors if sensor.name == item.target), item.unit)
        if item.relative:
            sd = f"{text_of(item.sd, lambda number: number / 100) or number_text(item.sd * 100)} %"
        else:
            sd = _difference(item.sd, unit)
        size = f"{sd} over {_seconds(item.memory)}"
        if not item.after:
            return size
        return _flow((("size", size), ("after", f"[{', '.join(item.after)}]"), ("each", self.each(item, unit))))

    def each(self, item: SlowError, size: Unit) -> str:
        per = shared_factor(self.graph.input(name).unit for name in item.after)
        own = self.graph.input(item.after[0]).unit
        try:
            if size.text and own.text:
                return _difference(item.each, measure(f"{size.text}/({own.text})").unit)
        except ModelError:
            pass  # the unit is too long; a bare number is in the sensor's unit per unit of the inputs
        return text_of(item.each, lambda value: value * size.factor / per) or number_text(item.each * per / size.factor)


def shared_factor(units: Iterable[Unit]) -> float:
    """Give the SI factor of the unit that all inputs share; 1 (SI) if they differ."""
    factors = {item.factor for item in units}
    return factors.pop() if len(factors) == 1 else 1.0


def _range(item: Parameter | Sensor | Input) -> str:
    """Give a range, `any` where both ends are infinite."""
    if math.isinf(item.lower) and math.isinf(item.upper):
        return "any"
    ends = (number_text(end) if math.isinf(end) else _value(end, item.unit) for end in (item.lower, item.upper))
    return f"[{', '.join(ends)}]"


def _seconds(value: float) -> str:
    return f"{number_text(value)} s"


def _value(value: float, unit: Unit) -> str:
    """Give a quantity in its unit; in SI base units if no decimal number gives exactly this value."""
    number = text_of(value, unit.to_si)
    return _joined(number, unit) if number else _joined(number_text(unit.from_si(value)), unit)


def _difference(value: float, unit: Unit) -> str:
    """Give a difference in its unit; in SI base units if no decimal number gives exactly this value."""
    number = text_of(value, lambda item: unit.factor * item)
    return (
        _joined(number, unit) if number else f"{number_text(value)} {measure(unit.text).dimension.base_text() or 'rad'}"
    )


def _joined(number: str, unit: Unit) -> str:
    return f"{number} {unit.text}".rstrip()


def _section(title: str, entries: Iterable[tuple[str, str]]) -> Iterator[str]:
    rows = [f"  {key}: {text}" for key, text in entries]
    return iter([f"{title}:", *rows] if rows else [])


def _flow(entries: Iterable[tuple[str, str]]) -> str:
    """Give a table on one line, without its empty entries."""
    return "{" + ", ".join(f"{key}: {text}" for key, text in entries if text) + "}"


def _scalar(text: str) -> str:
    """Give a text as YAML, in quotes where it needs them."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)
