"""The canonical text of a bond graph: fixed order and form, defaults in force left out."""

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from faultbond.errors import ModelError
from faultbond.model import keys
from faultbond.model.correlations import correlation_rows
from faultbond.model.defaults import default_range, in_force
from faultbond.model.elements import OWN_SIGNALS, default_laws
from faultbond.model.expression import rename
from faultbond.model.graph import (
    LOGIC_UNIT,
    BondGraph,
    Check,
    Component,
    Constant,
    Curve,
    Input,
    Parameter,
    Sensor,
    SlowError,
    TimeColumn,
    Unit,
    Validity,
)
from faultbond.model.parser import number_text, to_text
from faultbond.model.quantities import shared_factor
from faultbond.model.units import measure
from faultbond.types import ElementType, Hold, TimeGrid

_PLAIN = re.compile(r"-?[A-Za-z0-9_.](?:[A-Za-z0-9_ .+\-*/^()=<>%]*[A-Za-z0-9_.+*/^()=<>%])?")


def dump_model(graph: BondGraph) -> str:
    """Give the canonical text of a bond graph; it reads back as the same graph but for lines and file."""
    return "\n".join(_Writer(graph).lines()) + "\n"


def text_of(target: float, convert: Callable[[float], float]) -> str | None:
    """Give the shortest decimal number that `convert` (about linear) turns into exactly the target; None if none.

    Example
    -------
    >>> text_of(100.0, lambda number: number * 1e-3)
    '100000'
    """
    slope = convert(1.0) - convert(0.0)
    guess = (target - convert(0.0)) / slope if slope else 0.0
    if not math.isfinite(guess):
        return None
    near = [guess, *(math.nextafter(guess, end) for end in (-math.inf, math.inf))]
    near += [math.nextafter(item, end) for item, end in zip(near[1:], (-math.inf, math.inf), strict=True)]
    rounded = (float(f"{guess:.{digits}g}") for digits in range(1, 17))
    return next((number_text(item) for item in (*rounded, *near) if convert(item) == target), None)


def law_text(item: Component) -> str:
    """Give the laws of a component, or a block, as the value that stands in a model file."""
    texts = _laws(item)
    return f"[{', '.join(map(scalar_text, texts))}]" if len(texts) > 1 else scalar_text(texts[0])


def _laws(item: Component) -> list[str]:
    own = {f"{item.name}.{signal}": signal for signal in OWN_SIGNALS.get(item.type, ())}
    return [
        " = ".join(to_text(rename(side, lambda name: own.get(name, name))) for side in (law.left, law.right))
        for law in item.laws
    ]


class _Writer:
    """Writes one graph."""

    def __init__(self, graph: BondGraph) -> None:
        self.graph, self.defaults, self.static = graph, in_force(graph.defaults), graph.grid is TimeGrid.NONE
        self.parameters = {item.name: item for item in graph.parameters}
        texts = {item.name: _spread(item, item.accuracy) for item in graph.parameters}
        own = [item.name for item in graph.parameters if self.own("accuracy", item, item.accuracy, keys.ACCURACY)]
        self.wanders = {item.target: _over(item, item.unit) for item in graph.wanders}
        common = Counter(texts[name] for name in own if texts[name].endswith("%")).most_common(1)
        self.accuracy = common[0][0] if common and len(own) == len(graph.parameters) else ""
        self.accuracies = {name: texts[name] for name in own if texts[name] != self.accuracy}

    def stated(self, what: str, who: str = "", *, is_default: bool = True) -> bool:
        """Whether a thing must be written: it was stated, or has been changed since from its default."""
        return (what, who) not in self.defaults or not is_default

    def own(self, what: str, item: Parameter, value: float, percent: float) -> bool:
        """Whether a parameter has a spread of its own, not so many per cent of its nominal by default."""
        return self.stated(what, item.name, is_default=value == percent / 100 * abs(item.nominal))

    def lines(self) -> Iterator[str]:
        graph = self.graph
        yield from (f"{key}: {text}" for key, text in self.head().items() if text)
        yield from _section("constants", ((item.name, _value(item.value, item.unit)) for item in graph.fixed))
        together = correlation_rows(graph.correlations)
        yield from _section("correlations", ((name, _flow(row)) for name, row in together.items()))
        yield from _section("tables", ((item.name, self.table(item)) for item in graph.tables))
        unknown = ((item.name, self.unknown(item)) for item in graph.unknown_inputs)
        yield from _section("inputs", (*((item.name, self.input(item)) for item in graph.inputs), *unknown))
        parts = ((item.name, self.component(item)) for item in graph.components)
        slow = (item for item in graph.slow_errors if not item.wanders)
        yield from _section("blocks" if graph.is_block_network else "components", parts)
        yield from _section("junctions", ((item.name, item.type.value) for item in graph.junctions))
        if not graph.is_block_network:
            yield "bonds:"
            yield from (f"  - {bond.tail} -> {bond.head}" for bond in graph.bonds)
        yield from _section("sensors", ((item.name, self.sensor(item)) for item in graph.sensors))
        yield from _section("slow_error", ((item.target, self.slow_error(item)) for item in slow))
        yield from _section("checks", ((item.name, self.check(item)) for item in graph.checks))

    def head(self) -> dict[str, str]:
        graph, time, patience = self.graph, self.graph.time, self.graph.time_between_false_alarms
        has_faults = self.stated("max_faults", is_default=graph.max_faults == keys.MAX_FAULTS)
        has_time = self.stated("time", is_default=time == TimeColumn(optional=self.static))
        column = {
            "column": scalar_text(time.column) if time.column and self.stated("time column") else "",
            "unit": time.unit.text if self.stated("time unit") else "",
        }
        return {
            "name": scalar_text(graph.name) if self.stated("name") else "",
            "sample_time": graph.grid.value if graph.sample_time is None else _seconds(graph.sample_time),
            "row_time": _seconds(graph.row_time) if graph.row_time is not None else "",
            "max_faults": str(graph.max_faults) if has_faults else "",
            "accuracy": self.accuracy,
            "warm_up": _seconds(graph.warm_up) if not self.static and self.stated("warm_up") else "",
            "valid_when": _validity(graph.valid_when),
            "time_between_false_alarms": "" if patience is None else _seconds(patience),
            "false_alarms": str(graph.false_alarms) if graph.false_alarms else "",
            "time": "none" if time.column is None else _flow(column) if has_time else "",
        }

    def table(self, item: Curve) -> str:
        """Give a table with its points, wherever these came from."""
        pairs = (
            ", ".join(text_of(value, unit.to_si) or number_text(unit.from_si(value)) for value, unit in pair)
            for pair in (((x, item.x_unit), (y, item.y_unit)) for x, y in zip(item.x, item.y, strict=True))
        )
        has = {
            "between": self.stated("between", item.name, is_default=not item.monotone),
            "beyond": self.stated("beyond", item.name, is_default=not item.continues),
        }
        texts = {
            "points": f"[{', '.join(f'[{pair}]' for pair in pairs)}]",
            "x": item.x_unit.text,
            "y": item.y_unit.text,
            "between": keys.BETWEEN[item.monotone] if has["between"] else "",
            "beyond": keys.BEYOND[item.continues] if has["beyond"] else "",
        }
        return _flow(texts, keys.TABLE_KEYS)

    def input(self, item: Input) -> str:
        has_settling = not self.static and self.stated("settling", item.name, is_default=item.settling == 0)
        texts = {**self.instrument(item), "settling": _seconds(item.settling) if has_settling else ""}
        usual = (
            Hold.LAST if self.graph.row_time is None else Hold.LINEAR
        )  # a mean stands in the middle of what it is of
        texts["noise_of"] = keys.NOISES_OF[1] if item.smooth else ""
        texts["hold"] = "" if item.hold is usual else item.hold.value
        texts["rate_limit"] = self.rate_limit(self.parameters[item.rate_limit]) if item.rate_limit else ""
        return _flow(texts, keys.INPUT_KEYS)

    def unknown(self, item: Constant) -> str:
        """Give an input that nobody measures."""
        usual = _value(item.value, item.unit) if item.value else ""
        return _flow({"unit": item.unit.text, "unknown": self.wanders[item.name], "usual": usual}, keys.INPUT_KEYS)

    def sensor(self, item: Sensor) -> str:
        texts = {"reads": scalar_text(to_text(item.reads)), "valid_when": _validity(item.valid_when)}
        return _flow({**self.instrument(item), **texts}, keys.SENSOR_KEYS)

    def instrument(self, item: Input | Sensor) -> dict[str, str]:
        """Give what inputs and sensors share."""
        ends = [_value(end, item.unit) for end in item.fitted_range or ()]
        has_column, reach = self.stated("column", item.name, is_default=item.column == item.name), _range(item)
        return {
            "unit": item.unit.text,
            "column": scalar_text(item.column) if has_column else "",
            "noise": self.noise(item),
            "lag": self.lag(self.parameters[item.lag], item.order) if item.lag else "",
            "range": "" if reach == "any" else reach,
            "suspect": "" if item.suspect or self.static else "no",
            "healthy_bias": _difference(item.healthy_bias, item.unit) if item.healthy_bias else "",
            "fitted_range": f"[{', '.join(ends)}]" if ends else "",
        }

    def rate_limit(self, item: Parameter) -> str:
        """Give the highest rate of an input."""
        value, texts = _value(item.nominal, item.unit), {**self.spreads(item), "suspect": "" if item.suspect else "no"}
        return _flow({"value": value, **texts}, keys.RATE_LIMIT_KEYS) if any(texts.values()) else value

    def lag(self, item: Parameter, order: int) -> str:
        """Give the time constant of an input or a sensor; it is trusted unless it says otherwise."""
        value = _value(item.nominal, item.unit)
        texts = {
            "order": str(order) if order > 1 else "",
            **self.spreads(item),
            "suspect": "yes" if item.suspect else "",
        }
        return _flow({"value": value, **texts}, keys.LAG_KEYS) if any(texts.values()) else value

    def noise(self, item: Input | Sensor | Check) -> str:
        has_noise = item.unit != LOGIC_UNIT and self.stated("noise", item.name, is_default=item.noise == 0)
        rows = 1 if isinstance(item, Check) else self.graph.rows_per_sample
        part = item.part * math.sqrt(rows) if isinstance(item, Sensor) else 0.0
        beside = f" + {number_text(float(f'{100.0 * part:.12g}'))} %" if part else ""
        return _difference(item.noise * math.sqrt(rows), item.unit) + beside if has_noise else ""

    def component(self, item: Component) -> str:
        texts = _laws(item)
        is_default = len(item.parameters) == 1 and texts == default_laws(item.type, item.parameters[0])
        owned = {name: self.parameter(self.parameters[name]) for name in item.parameters}
        start: dict[str, str] = {}
        if item.start is not None:
            key = {"C": "q", "I": "p"}.get(item.type.value) or next(law.store for law in item.laws if law.store)
            start = {key: number_text(item.start.mean), "sd": number_text(item.start.sd)}
        return _flow(
            {
                "type": "" if item.type is ElementType.BLOCK else item.type.value,
                "law": law_text(item) if self.stated("law", item.name, is_default=is_default) else "",
                "parameters": _flow(owned) if owned else "",
                "signals": f"[{', '.join(item.signals)}]" if item.signals else "",
                "start": _flow(start) if start else "",
                "suspect": "" if item.suspect else "no",
            },
            keys.BLOCK_KEYS if item.type is ElementType.BLOCK else keys.COMPONENT_KEYS,
        )

    def parameter(self, item: Parameter) -> str:
        limits, nominal = [_value(end, item.unit) for end in item.limits], _value(item.nominal, item.unit)
        texts = {
            **self.spreads(item),
            "limit": f"[{', '.join(limits)}]" if len(limits) > 1 else "".join(limits),
            "wander": self.wanders.get(item.name, ""),
            "suspect": "" if item.suspect else "no",
        }
        return _flow({"nominal": nominal, **texts}, keys.PARAMETER_KEYS) if any(texts.values()) else nominal

    def spreads(self, item: Parameter) -> dict[str, str]:
        """Give how far a parameter may be from its nominal, where that is not the default."""
        has_change = self.own("change", item, item.change, keys.CHANGE)
        has_range = self.stated("range", item.name, is_default=(item.lower, item.upper) == default_range(item.nominal))
        return {
            "accuracy": self.accuracies.get(item.name, ""),
            "change": _spread(item, item.change) if has_change else "",
            "healthy_change": _spread(item, item.healthy_change) if item.healthy_change else "",
            "range": _range(item) if has_range else "",
        }

    def check(self, item: Check) -> str:
        has_cost = self.stated("cost", item.name, is_default=item.cost == keys.CHECK_COST)
        texts = {"cost": number_text(item.cost) if has_cost else "", "unit": item.unit.text}
        if item.move is not None:
            texts["move"] = _difference(item.move, self.graph.input(item.name).unit) if item.move else "no"
        if item.reads is not None:
            texts |= {"reads": scalar_text(to_text(item.reads)), "noise": self.noise(item)}
        return _flow(texts, keys.CHECK_KEYS)

    def slow_error(self, item: SlowError) -> str:
        unit = next((sensor.unit for sensor in self.graph.sensors if sensor.name == item.target), item.unit)
        size = _over(item, unit)
        if not item.after:
            return size
        return _flow(
            {"size": size, "after": f"[{', '.join(item.after)}]", "each": self.all_each(item, unit)},
            keys.SLOW_ERROR_KEYS,
        )

    def all_each(self, item: SlowError, size: Unit) -> str:
        """Give the growth for each unit of a change: one for all inputs, or a list."""
        units = [self.graph.input(name).unit.text for name in item.after]
        if len(set(zip(item.each, units, strict=True))) == 1:
            return self.each(item.each[0], item.after, size)
        return f"[{', '.join(self.each(x, (name,), size) for x, name in zip(item.each, item.after, strict=True))}]"

    def each(self, value: float, after: Sequence[str], size: Unit) -> str:
        """Give the growth for each unit of a change of some inputs."""
        per = shared_factor(self.graph.input(name).unit for name in after)
        own = self.graph.input(after[0]).unit
        try:
            if size.text and own.text:
                return _difference(value, measure(f"{size.text}/({own.text})").unit)
        except ModelError:
            pass  # the unit is too long; a bare number is in the sensor's unit per unit of the inputs
        return text_of(value, lambda number: number * size.factor / per) or number_text(value * per / size.factor)


def _spread(item: Parameter, value: float) -> str:
    """Give a parameter's spread, relative where that is exact."""
    if item.nominal != 0:
        percent = text_of(value, lambda number: number / 100 * abs(item.nominal))
        if percent is not None and len(percent) <= 8:
            return f"{percent} %"
    return _difference(value, item.unit)


def _over(item: SlowError, unit: Unit) -> str:
    """Give the standard deviation and the memory of a slow error; `unit`: that of an absolute one."""
    if item.relative:
        sd = f"{text_of(item.sd, lambda number: number / 100) or number_text(item.sd * 100)} %"
    else:
        sd = _difference(item.sd, unit)
    return f"{sd} over {_seconds(item.memory)}"


def _range(item: Parameter | Sensor | Input) -> str:
    """Give a range, `any` where both ends are infinite."""
    if math.isinf(item.lower) and math.isinf(item.upper):
        return "any"
    ends = (number_text(end) if math.isinf(end) else _value(end, item.unit) for end in (item.lower, item.upper))
    return f"[{', '.join(ends)}]"


def _validity(item: Validity | None) -> str:
    """Give when something holds; empty where it always does."""
    if item is None:
        return ""
    when = scalar_text(to_text(item.condition))
    return _flow({"when": when, "settling": _seconds(item.settling)}) if item.settling else when


def _seconds(value: float) -> str:
    return f"{number_text(value)} s"


def _value(value: float, unit: Unit) -> str:
    """Give a quantity in its unit, rounded if no decimal number gives exactly this value."""
    return f"{text_of(value, unit.to_si) or number_text(unit.from_si(value))} {unit.text}".rstrip()


def _difference(value: float, unit: Unit) -> str:
    """Give a difference in its unit; in SI base units if no decimal number gives exactly this value."""
    number = text_of(value, lambda item: unit.factor * item)
    if number is None:
        return f"{number_text(value)} {measure(unit.text).dimension.base_text() or 'rad'}"
    return f"{number} {unit.text}".rstrip()


def _section(title: str, entries: Iterable[tuple[str, str]]) -> Iterator[str]:
    rows = [f"  {key}: {text}" for key, text in entries]
    return iter([f"{title}:", *rows] if rows else [])


def _flow(texts: Mapping[str, str], known: keys.Keys | None = None) -> str:
    """Give a table on one line, without its empty entries, in the order of its keys."""
    order = texts if known is None else known.known
    return "{" + ", ".join(f"{key}: {texts[key]}" for key in order if texts.get(key)) + "}"


def scalar_text(text: str) -> str:
    """Give a text as YAML, in quotes where it needs them."""
    return text if _PLAIN.fullmatch(text) else json.dumps(text, ensure_ascii=False)
