"""Laws of components: defaults by type, names resolved to full signal names, values checked at the nominal."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from faultbond.errors import ModelError
from faultbond.model.defaults import Defaults
from faultbond.model.elements import DEFAULT_LAWS, MUST_NAME, OWN_SIGNALS, default_laws
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, names, rename
from faultbond.model.graph import Component, Relation, Start
from faultbond.model.parser import arithmetic, parse_expression, parse_relation, to_text
from faultbond.model.quantities import quantity, spread
from faultbond.model.source import Entry, Items, Source, Table, closest, shown
from faultbond.model.units import Measure
from faultbond.model.values import Values, same_unit
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

    def __init__(self, source: Source, plant: Wiring, values: Values, defaults: Defaults) -> None:
        self.source, self.plant, self.values, self.defaults = source, plant, values, defaults
        self.nominals = values.nominals
        self.starts: list[StartEntry] = []

    def is_signal(self, name: str) -> bool:
        """Whether a resolved name is that of a signal."""
        return "." in name

    def components(self) -> tuple[Component, ...]:
        """Give all components with their laws."""
        owned: dict[str, list[str]] = {}
        for item in self.values.parameters:
            owned.setdefault(item.owner, []).append(item.name)
        return tuple(self._component(part, tuple(owned.get(part.name, ()))) for part in self.plant.parts.values())

    def _component(self, part: Part, parameters: tuple[str, ...]) -> Component:
        return Component(
            name=part.name,
            type=part.type,
            laws=self._laws(part, parameters),
            parameters=parameters,
            start=self._start(part),
            line=part.line,
        )

    def _laws(self, part: Part, parameters: tuple[str, ...]) -> tuple[Relation, ...]:
        texts, what = self._law_texts(part, parameters), f"law of {part.name}"
        n_laws = 2 if part.type.n_ports == 2 else 1
        if len(texts) != n_laws:
            wanted = "two laws, `law: [.., ..]`" if n_laws == 2 else "one law"
            problem = f"has {len(texts)} law{'s'[: len(texts) != 1]}; {_article(part.type)} element needs {wanted}"
            raise self.source.error(part.fields["law"], f"component {part.name} {problem}")
        found = tuple(self._relation(part, text, line, what) for text, line in texts)
        used = {name for law in found for side in (law.left, law.right) for name in names(side)}
        missing = [signal for signal in MUST_NAME[part.type] if f"{part.name}.{signal}" not in used]
        if missing:
            needed = ", ".join(MUST_NAME[part.type])
            problem = f"names no `{missing[0]}`; the law of {_article(part.type)} element relates {needed}"
            raise self.source.error(texts[0][1], f"{what} {problem}")
        return found

    def _law_texts(self, part: Part, parameters: tuple[str, ...]) -> list[tuple[str, int]]:
        """Give the laws as texts with their lines; the default ones where none is stated."""
        if "law" in part.fields:
            return stated_laws(self.source, part)
        if part.type in DEFAULT_LAWS and len(parameters) == 1:
            texts = default_laws(part.type, parameters[0])
            self.defaults.add("law", " and ".join(texts), part.name)
            return [(text, part.line) for text in texts]
        example = "write `law: e = V`" if part.type is ElementType.SE else "write `law: f = Q`"
        if part.type in DEFAULT_LAWS:
            example = "without one it needs exactly one parameter"
        problem = f"component {part.name}: `law` is missing"
        raise self.source.error(part.line, f"{problem}; {example}")

    def _relation(self, part: Part, text: str, line: int, what: str) -> Relation:
        where = f"{self.source.at(line)}{what}: "
        left, right = parse_relation(text, where)
        own = OWN_SIGNALS[part.type]
        return Relation(
            left=self._resolved(left, where, part.name, own),
            right=self._resolved(right, where, part.name, own),
            line=line,
        )

    def expression(self, text: str, line: int, what: str) -> Expression:
        """Give a resolved expression outside a component, such as what a sensor reads."""
        where = f"{self.source.at(line)}{what}: "
        return self._resolved(parse_expression(text, where), where, "", ())

    def _resolved(self, expression: Expression, where: str, owner: str, own: tuple[str, ...]) -> Expression:
        """Give the expression with full signal names, every name known and every constant part finite."""
        result = rename(expression, lambda name: self._full_name(name, where, owner, own))
        check_finite(result, self.nominals, where)
        return result

    def _full_name(self, name: str, where: str, owner: str, own: tuple[str, ...]) -> str:
        if "." in name:
            return self.signal(name, where, owner if own else "")
        if name in own:
            return f"{owner}.{name}"
        if name in self.values.measures:
            return name
        raise ModelError(where + self._unknown(name, owner, own))

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
        """Give a dotted name if it is a signal of the plant."""
        part, _, signal = name.partition(".")
        if part not in self.plant.parts and part not in self.plant.junctions:
            near = closest(part, [*self.plant.parts, *self.plant.junctions]) or "add it to components or junctions"
            raise ModelError(f"{where}`{name}`: no component or junction `{part}`; {near}")
        known = self.plant.signals(part)
        if signal not in known:
            listed = ", ".join(f"{part}.{item}" for item in known)
            kind = f"{self.plant.junctions[part].type.value}-junction" if part in self.plant.junctions else "component"
            raise ModelError(f"{where}{kind} {part} has no signal `{signal}`; it has {listed}")
        source = part == owner and self.plant.parts[part].type.is_source
        if source and signal not in OWN_SIGNALS[self.plant.parts[part].type]:
            raise ModelError(where + self._unknown(signal, owner, OWN_SIGNALS[self.plant.parts[part].type]))
        return name

    def _start(self, part: Part) -> Start | None:
        """Give the known start of a store."""
        if "start" not in part.fields:
            if part.type.is_store:
                self.defaults.add("start", "solved from the first samples", part.name)
            return None
        entry, what = part.fields["start"], f"start of {part.name}"
        if not part.type.is_store:
            raise self.source.error(entry, f"{what}: only C and I elements have a start; remove it")
        key = "q" if part.type is ElementType.C else "p"
        start, found = read_start(self.source, entry, what, key)
        self.starts.append(StartEntry(f"{part.name}.{key}", found, entry.line))
        return start


def stated_laws(source: Source, part: Part) -> list[tuple[str, int]]:
    """Give the laws under the key `law` as texts with their lines; none if there is no such key."""
    if "law" not in part.fields:
        return []
    node = part.fields["law"].value
    nodes = node.items if isinstance(node, Items) else (node,)
    return [(source.text(item, f"law of {part.name}"), item.line) for item in nodes]


def read_start(source: Source, entry: Entry, what: str, key: str) -> tuple[Start, Measure | None]:
    """Give the start of a store, `{key: .., sd: ..}`, and the measure in which it was stated."""
    if not isinstance(entry.value, Table):
        raise source.error(entry, f"{what} is a table; write `start: {{{key}: .., sd: ..}}`")
    fields = source.fields(entry.value, what, (key, "sd"))
    for needed in (key, "sd"):
        if needed not in fields:
            problem = f"`{needed}` is missing; write `start: {{{key}: .., sd: ..}}`"
            raise source.error(entry, f"{what}: {problem}")
    mean = quantity(source.text(fields[key].value, what), f"{source.at(fields[key])}{what}: ")
    where = f"{source.at(fields['sd'])}{what}: sd: "
    deviation = spread(source.text(fields["sd"].value, f"{what}: sd"), where, mean.measure)
    found = mean.measure
    if deviation.quantity is not None and found is not None:
        same_unit(source, fields["sd"], f"{what}: sd", deviation.quantity, found)
    elif deviation.quantity is not None:
        found = deviation.quantity.measure
    return Start(mean=mean.value, sd=deviation.difference(mean.value)), found


def check_used(source: Source, plant: Wiring, values: Values, used: set[str]) -> None:
    """Refuse a parameter that no law and no sensor names: it could never be diagnosed."""
    for item in values.parameters:
        if item.name not in used:
            problem = f"no law and no sensor names parameter `{item.name}`; use it or remove it"
            raise source.error(item.line, f"{plant.parts[item.owner].title}: {problem}")


def _article(element: ElementType) -> str:
    return (
        f"{'an' if element in (ElementType.R, ElementType.I, ElementType.SE, ElementType.SF) else 'a'} {element.value}"
    )


def check_finite(expression: Expression, values: Mapping[str, float], where: str) -> float | None:
    """Give the value of an expression of constants and parameters; None if it names anything else.

    Raises
    ------
    ModelError
        if any part of constants and parameters alone is not finite at the nominal values, or is 0 and divides.
    """
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
                raise ModelError(where + _not_finite(expression, values, "divides by zero"))
            result = None if a is None or b is None else _binary(operator, a, b)
        case Call(function, arguments):
            found = [check_finite(argument, values, where) for argument in arguments]
            known = [item for item in found if item is not None]
            result = _call(function, known) if len(known) == len(found) else None
    if result is not None and not math.isfinite(result):
        raise ModelError(where + _not_finite(expression, values, "is not a finite number"))
    return result


def _not_finite(expression: Expression, values: Mapping[str, float], reason: str) -> str:
    used = ", ".join(f"{name} = {values[name]:g}" for name in names(expression)[:5] if name in values)
    at = f" at the nominal {used}" if used else ""
    return f"`{shown(to_text(expression))}` {reason}{at}; change the law or the value"


def _binary(operator: str, a: float, b: float) -> float:
    comparisons = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}
    return float(comparisons[operator]) if operator in comparisons else arithmetic(operator, a, b)


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
