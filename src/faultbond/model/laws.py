"""Laws of components: defaults by type, names resolved to full signal names, values checked at the nominal."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from faultbond.errors import ModelError
from faultbond.model.elements import DEFAULT_LAWS, MUST_NAME, OWN_SIGNALS, default_laws
from faultbond.model.expression import TABLE, Binary, Call, Expression, Name, Negative, Number, names, rename
from faultbond.model.graph import Component, Relation, Start
from faultbond.model.head import Head
from faultbond.model.keys import COMPONENT_KEYS, VALUE, Key, Keys
from faultbond.model.parser import arithmetic, parse_expression, parse_relation, to_text
from faultbond.model.quantities import spread
from faultbond.model.source import Items, Table, closest, shown
from faultbond.model.spot import Spot
from faultbond.model.units import Measure
from faultbond.model.values import Values
from faultbond.model.wiring import Part, Wiring
from faultbond.types import ElementType


@dataclass(frozen=True, slots=True)
class StartEntry:
    """A stated start with what the check of dimensions needs."""

    signal: str
    measure: Measure | None
    line: int


class LawReader:
    """Reads laws and other expressions of one model."""

    def __init__(self, head: Head, plant: Wiring, values: Values) -> None:
        self.source, self.defaults, self.plant, self.values = head.source, head.defaults, plant, values
        self.nominals = values.nominals
        self.starts: list[StartEntry] = []

    def is_signal(self, name: str) -> bool:
        """Whether a resolved name is that of a signal."""
        return "." in name

    def components(self) -> tuple[Component, ...]:
        """Give all components with their laws."""
        owned = self.values.owned
        return tuple(
            Component(
                name=part.name,
                type=part.type,
                laws=self._laws(part, owned.get(part.name, ())),
                parameters=owned.get(part.name, ()),
                start=self._start(part),
                line=part.line,
            )
            for part in self.plant.parts.values()
        )

    def _laws(self, part: Part, parameters: tuple[str, ...]) -> tuple[Relation, ...]:
        texts = stated_laws(part)
        if "law" not in part.fields:
            if part.type not in DEFAULT_LAWS or len(parameters) != 1:
                example = "write `law: e = V`" if part.type is ElementType.SE else "write `law: f = Q`"
                if part.type in DEFAULT_LAWS:
                    example = "without one it needs exactly one parameter"
                raise part.place.error(f": `law` is missing; {example}")
            default = default_laws(part.type, parameters[0])
            self.defaults.add("law", " and ".join(default), part.name)
            texts = [(text, part.line) for text in default]
        n_laws = 2 if part.type.n_ports == 2 else 1
        element = f"{'an' if part.type.value in ('R', 'I', 'Se', 'Sf') else 'a'} {part.type.value} element"
        if len(texts) != n_laws:
            wanted = "two laws, `law: [.., ..]`" if n_laws == 2 else "one law"
            problem = f" has {len(texts)} law{'s'[: len(texts) != 1]}; {element} needs {wanted}"
            raise part.place.at(part.fields["law"]).error(problem)
        found, own = [], OWN_SIGNALS[part.type]
        for text, line in texts:
            where = f"{self.source.at(line)}law of {part.name}: "
            left, right = (self._resolved(side, where, part.name, own) for side in parse_relation(text, where))
            found.append(Relation(left=left, right=right, line=line))
        used = {name for law in found for side in (law.left, law.right) for name in names(side)}
        missing = [signal for signal in MUST_NAME[part.type] if f"{part.name}.{signal}" not in used]
        if missing:
            problem = f"names no `{missing[0]}`; the law of {element} relates {', '.join(MUST_NAME[part.type])}"
            if part.type is ElementType.R and len(missing) == 1:
                source = {"f": "Se", "e": "Sf"}[missing[0]]
                problem += f"; one that does not depend on it, as of a static head, is a source, `type: {source}`"
            ends = [name for name in used if name.endswith(".e") and not name.startswith(f"{part.name}.")]
            if part.type is ElementType.R and missing == ["e"] and len(ends) == 2:
                a, b = sorted(ends)
                problem += f"; between these `e` is `{a} - {b}` or its negative: `{a}**2 - {b}**2` is `e*({a} + {b})`"
            raise self.source.error(texts[0][1], f"law of {part.name} {problem}")
        return tuple(found)

    def expression(self, place: Spot) -> Expression:
        """Give a resolved expression outside a component, such as what a sensor reads."""
        text, where = place.text(), place.where(": ")
        return self._resolved(parse_expression(text, where), where, "", ())

    def _resolved(self, expression: Expression, where: str, owner: str, own: tuple[str, ...]) -> Expression:
        """Give the expression with full signal names, every name known and every constant part finite."""

        def full_name(name: str) -> str:
            if "." in name:
                return self.signal(name, where, owner if own else "")
            if name in own:
                return f"{owner}.{name}"
            if name in self.values.measures:
                return name
            raise ModelError(where + self._unknown(name, owner, own))

        result = rename(expression, full_name)
        check_finite(result, self.nominals, where)
        return result

    def _unknown(self, name: str, owner: str, own: tuple[str, ...]) -> str:
        if name in self.plant.parts or name in self.plant.junctions:
            signal = self.plant.signals(name)[0]
            return f"`{name}` is a part, not a number; name one of its signals, such as `{name}.{signal}`"
        if owner and own in (("e",), ("f",)) and name in ("e", "f"):
            quantity, other = ("an effort", "flow") if own == ("e",) else ("a flow", "effort")
            problem = f"`{name}` is set by the rest of the plant; a source sets {quantity} whatever its {other}"
            return f"{problem}. For a law between e and f use type R"
        near = closest(name, [*own, *self.values.measures]) or "state it under parameters, constants or inputs"
        return f"unknown name `{shown(name)}`; {near}"

    def signal(self, name: str, where: str, owner: str = "") -> str:
        """Give a dotted name if it is a signal of the plant.

        Raises
        ------
        ModelError
            where it is none, or one that the source `owner` may not name.
        """
        part, _, signal = name.partition(".")
        if part not in self.plant.parts and part not in self.plant.junctions:
            near = closest(part, [*self.plant.parts, *self.plant.junctions]) or "add it to components or junctions"
            raise ModelError(f"{where}`{name}`: no component or junction `{part}`; {near}")
        known = self.plant.signals(part)
        if signal not in known:
            listed = ", ".join(f"{part}.{item}" for item in known)
            kind = f"{self.plant.junctions[part].type.value}-junction" if part in self.plant.junctions else "component"
            raise ModelError(f"{where}{kind} {part} has no signal `{signal}`; it has {listed}")
        if part == owner and self.plant.parts[part].type.is_source:
            own = OWN_SIGNALS[self.plant.parts[part].type]
            if signal not in own:
                raise ModelError(where + self._unknown(signal, owner, own))
        return name

    def _start(self, part: Part) -> Start | None:
        """Give the known start of a store."""
        if "start" not in part.fields:
            if part.type.is_store:
                self.defaults.missing(COMPONENT_KEYS, "start", part.name)
            return None
        place = Spot(self.source, f"start of {part.name}", part.fields["start"].entry)
        if not part.type.is_store:
            raise place.error(": only C and I elements have a start; remove it")
        key = "q" if part.type is ElementType.C else "p"
        start, found = read_start(place, key)
        self.starts.append(StartEntry(f"{part.name}.{key}", found, place.line))
        return start


def stated_laws(part: Part) -> list[tuple[str, int]]:
    """Give the laws under the key `law` as texts with their lines; none if there is no such key."""
    if "law" not in part.fields:
        return []
    place = Spot(part.place.source, f"law of {part.name}", part.fields["law"].entry)
    node = place.entry.value
    nodes = node.items if isinstance(node, Items) else (node,)
    return [(place.inside(item).text(), item.line) for item in nodes]


def read_start(place: Spot, key: str) -> tuple[Start, Measure | None]:
    """Give the start of a store, `{key: .., sd: ..}`, and the measure in which it was stated.

    Raises
    ------
    ModelError
        where it is no such table.
    """
    if not isinstance(place.entry.value, Table):
        raise place.error(f" is a table; write `start: {{{key}: .., sd: ..}}`")
    example = f"write `start: {{{key}: .., sd: ..}}`"
    fields = place.fields(Keys({name: Key(VALUE, missing=example) for name in (key, "sd")}))
    mean = place.at(fields[key]).quantity(mark=": ")
    sd = fields["sd"]
    deviation = spread(sd.text(), sd.where(": "), mean.measure)
    found = mean.measure
    if deviation.quantity is not None and found is not None:
        sd.check_unit(deviation.quantity, found)
    elif deviation.quantity is not None:
        found = deviation.quantity.measure
    return Start(mean=mean.value, sd=deviation.difference(mean.value)), found


def check_used(plant: Wiring, values: Values, used: set[str]) -> None:
    """Refuse a parameter that no law and no sensor names: it could never be diagnosed.

    Raises
    ------
    ModelError
        at the first such parameter.
    """
    for item in values.parameters:
        if item.name not in used:
            problem = f": no law and no sensor names parameter `{item.name}`; use it or remove it"
            owner = plant.parts[item.owner].place
            raise owner.source.error(item.line, owner.words + problem)


def check_finite(expression: Expression, values: Mapping[str, float], where: str) -> float | None:
    """Give the value of an expression of constants and parameters; None if it names anything else.

    Raises
    ------
    ModelError
        if any part of constants and parameters alone is not finite at the nominal values, or is 0 and divides.
    """
    result: float | None
    reason = "is not a finite number"
    match expression:
        case Number(value):
            return value
        case Name(text):
            return values.get(text)
        case Negative(operand):
            inner = check_finite(operand, values, where)
            return None if inner is None else -inner
        case Binary(operator, left, right):
            a, b = check_finite(left, values, where), check_finite(right, values, where)
            if operator == "/" and b == 0:
                result, reason = math.nan, "divides by zero"
            else:
                result = None if a is None or b is None else arithmetic(operator, a, b)
        case Call(function, arguments):
            found = [check_finite(argument, values, where) for argument in arguments]
            if function.startswith(TABLE):
                return None
            known = [item for item in found if item is not None]
            result = _call(function, known) if len(known) == len(found) else None
    if result is not None and not math.isfinite(result):
        used = ", ".join(f"{name} = {values[name]:g}" for name in names(expression)[:5] if name in values)
        at = f" at the nominal {used}" if used else ""
        raise ModelError(f"{where}`{shown(to_text(expression))}` {reason}{at}; change the law or the value")
    return result


def _call(function: str, values: list[float]) -> float:
    match function:
        case "abs":
            return abs(values[0])
        case "sign":
            return math.copysign(1.0, values[0]) if values[0] else 0.0
        case "min":
            return min(values)
        case "max":
            return max(values)
        case "where":
            return values[1] if values[0] else values[2]
    try:
        return float(getattr(math, function)(values[0]))
    except (ValueError, OverflowError):
        return math.nan
