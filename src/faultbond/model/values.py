"""Constants, inputs and parameters: the numbers of a model, in SI, with their spreads."""

import keyword
import math
from collections.abc import Mapping
from dataclasses import dataclass

from faultbond.model.defaults import ACCURACY, CHANGE, Defaults, default_range
from faultbond.model.expression import FUNCTIONS, RATE
from faultbond.model.graph import LOGIC_UNIT, Constant, Input, Parameter
from faultbond.model.kind import Kind
from faultbond.model.parser import number_text
from faultbond.model.quantities import NO_UNIT, Quantity, Spread, duration, quantity, spread
from faultbond.model.source import Entry, Items, Node, Source, Text, shown
from faultbond.model.units import DIMENSIONLESS, Measure, measure
from faultbond.model.wiring import Part, Wiring

SMALLEST, LARGEST = 1e-100, 1e100  # of standard deviations, SI
LONGEST = 1e12  # s
PARAMETER_KEYS = ("nominal", "accuracy", "change", "range", "limit", "suspect")
INPUT_KEYS = ("unit", "column", "noise", "settling", "range", "suspect")
RESERVED = frozenset({"e", "f", "q", "p", "e1", "f1", "e2", "f2", *FUNCTIONS, *keyword.kwlist})
RESERVED_IN_BLOCKS = frozenset({RATE, *FUNCTIONS, *keyword.kwlist})


@dataclass(frozen=True, slots=True)
class Values:
    """The numbers that a law may name, their measures (None: no unit was written), what they are and on which line."""

    constants: tuple[Constant, ...]
    inputs: tuple[Input, ...]
    parameters: tuple[Parameter, ...]
    measures: Mapping[str, Measure | None]
    places: Mapping[str, tuple[str, int]]

    @property
    def nominals(self) -> dict[str, float]:
        """SI values of constants and parameters by name."""
        return {item.name: item.value for item in self.constants} | {
            item.name: item.nominal for item in self.parameters
        }


class ValueReader:
    """Reads constants, inputs and parameters, which share one name space.

    instruments: whether inputs that do not say so are suspects.
    """

    def __init__(
        self, source: Source, defaults: Defaults, accuracy: Spread | None, kind: Kind, instruments: bool
    ) -> None:
        self.source, self.defaults, self.accuracy = source, defaults, accuracy
        self.kind, self.instruments = kind, instruments
        self.measures: dict[str, Measure | None] = {}
        self.places: dict[str, tuple[str, int]] = {}

    def read(self, fields: Mapping[str, Entry], plant: Wiring) -> Values:
        """Read all of them, in the order of the file."""
        constants = tuple(self._constant(entry) for entry in self._entries(fields, "constants"))
        inputs = tuple(self._input(entry) for entry in self._entries(fields, "inputs"))
        owned = ((part, part.fields["parameters"]) for part in plant.parts.values() if "parameters" in part.fields)
        parameters = tuple(
            self._parameter(entry, part)
            for part, field in owned
            for entry in self.source.table(field.value, f"{part.title}: parameters").entries
        )
        return Values(constants, inputs, parameters, self.measures, self.places)

    def _entries(self, fields: Mapping[str, Entry], key: str) -> tuple[Entry, ...]:
        return self.source.table(fields[key].value, key).entries if key in fields else ()

    def _claim(self, entry: Entry, what: str, found: Measure | None) -> str:
        """Take a name for a thing; an error if it is reserved or another thing has it."""
        name = self.source.name(entry, f"{what}s")
        if name in (RESERVED_IN_BLOCKS if self.kind.blocks else RESERVED):
            of = "functions" if self.kind.blocks else "signals and functions"
            of = "Python's own words" if keyword.iskeyword(name) else of
            raise self.source.error(entry, f"{what} `{name}`: the name is reserved for {of}; choose another")
        if name in self.places:
            other, line = self.places[name]
            first = f" on line {line}" if self.source.has_lines else ""
            advice = "rename one" if other != what else "state it once; every law may name it"
            raise self.source.error(
                entry, f"{what} `{name}` is already a{'n'[: other == 'input']} {other}{first}; {advice}"
            )
        self.places[name] = (what, entry.line)
        self.measures[name] = found
        return name

    def _constant(self, entry: Entry) -> Constant:
        what = f"constant {shown(entry.key)}: "
        found = quantity(self.source.text(entry.value, what.rstrip(": ")), self.source.at(entry) + what)
        name = self._claim(entry, "constant", found.measure)
        return Constant(name=name, value=found.value, unit=found.unit, line=entry.line)

    def _input(self, entry: Entry) -> Input:
        what = f"input {shown(entry.key)}"
        fields = self.source.fields(entry.value, what, INPUT_KEYS)
        found = read_unit(self.source, fields, what, self.kind, entry)
        name = self._claim(entry, "input", found)
        if self.kind.static and "settling" in fields:
            problem = "with `sample_time: none` each row stands by itself, and nothing settles; remove it"
            raise self.source.error(fields["settling"], f"{what}: settling: {problem}")
        if "noise" in fields:
            noise = read_spread(self.source, fields["noise"], f"{what}: noise", found)
            needs_size(self.source, fields["noise"], f"{what}: noise", noise)
            check_scale(self.source, fields["noise"], f"{what}: noise", noise.difference())
        else:
            noise = Spread(absolute=Quantity(0.0, found))
            if not self.kind.logic:
                self.defaults.add("noise", "0", name)
        if "settling" not in fields and not self.kind.static:
            self.defaults.add("settling", "0 s", name)
        lower, upper = self._input_range(fields, f"{what}: range", found)
        return Input(
            name=name,
            column=read_column(self.source, fields, what, name, self.defaults),
            unit=found.unit if found else NO_UNIT,
            noise=noise.difference(),
            settling=read_duration(self.source, fields["settling"], f"{what}: settling")
            if "settling" in fields
            else 0.0,
            lower=lower,
            upper=upper,
            suspect=read_instrument(self.source, fields, what, self.kind, self.instruments),
            line=entry.line,
        )

    def _input_range(self, fields: Mapping[str, Entry], what: str, unit: Measure | None) -> tuple[float, float]:
        """Give the least and greatest SI value of an input; infinite ones by default."""
        if "range" not in fields:
            return -math.inf, math.inf
        entry = fields["range"]
        if self.kind.logic:
            raise self.source.error(entry, f"{what}: a logic signal has no range; remove it")
        lower, upper = (self._end(item, what, Quantity(0.0, unit)) for item in range_ends(self.source, entry, what))
        if lower >= upper:
            raise self.source.error(entry, f"{what}: the lowest value must be below the highest; mend one")
        return lower, upper

    def _parameter(self, entry: Entry, owner: Part) -> Parameter:
        what = f"parameter {shown(entry.key)}"
        if isinstance(entry.value, Text):
            fields = {"nominal": Entry("nominal", entry.value, entry.line)}
        else:
            fields = self.source.fields(entry.value, what, PARAMETER_KEYS)
        if "nominal" not in fields:
            raise self.source.error(entry, f"{what}: `nominal` is missing; state its healthy value")
        text = self.source.text(fields["nominal"].value, f"{what}: nominal")
        nominal = quantity(text, self.source.at(fields["nominal"]) + f"{what}: ")
        spreads = {key: self._spread(fields, key, what, nominal) for key in ("accuracy", "change")}
        if nominal.measure is None and nominal.number == 0:
            units = [item.quantity.measure for item in spreads.values() if item and item.quantity]
            nominal = Quantity(0.0, next((unit for unit in units if unit and not unit.unit.offset), None))
        name = self._claim(entry, "parameter", nominal.measure)
        lower, upper = self._range(fields, what, name, nominal)
        return Parameter(
            name=name,
            owner=owner.name,
            nominal=nominal.value,
            unit=nominal.unit,
            accuracy=self._size("accuracy", spreads["accuracy"], name, nominal, entry),
            change=self._size("change", spreads["change"], name, nominal, entry),
            lower=lower,
            upper=upper,
            limits=self._limits(fields, what, nominal, (lower, upper)),
            suspect=self._suspect(fields, what, owner),
            line=entry.line,
        )

    def _spread(self, fields: Mapping[str, Entry], key: str, what: str, nominal: Quantity) -> Spread | None:
        if key not in fields:
            return None
        unit_free_zero = nominal.measure is None and nominal.number == 0
        if unit_free_zero:
            return spread(*self._of(fields[key], f"{what}: {key}"))
        return read_spread(self.source, fields[key], f"{what}: {key}", nominal.measure)

    def _of(self, entry: Entry, what: str) -> tuple[str, str]:
        return self.source.text(entry.value, what), f"{self.source.at(entry)}{what} "

    def _size(self, key: str, stated: Spread | None, name: str, nominal: Quantity, entry: Entry) -> float:
        """Give the SI standard deviation of a parameter, `accuracy` or `change`, by default a part of its nominal."""
        default = self.accuracy if key == "accuracy" else None
        chosen = stated or default or Spread(ratio=(ACCURACY if key == "accuracy" else CHANGE) / 100)
        if chosen.is_relative and nominal.value == 0:
            example = f"{key}: 2 {nominal.unit.text}".rstrip()
            problem = f"the nominal is 0, so `{key}` must be a size of its own; write `{example}` with your number"
            raise self.source.error(entry, f"parameter {name}: {problem}")
        if stated is None and default is None:
            self.defaults.add(key, f"{ACCURACY if key == 'accuracy' else CHANGE:g} %", name)
        result = chosen.difference(nominal.value)
        if not math.isfinite(result) or (key == "change" and result == 0):
            raise self.source.error(entry, f"parameter {name}: `{key}` must be a finite size above 0")
        check_scale(self.source, entry, f"parameter {name}: `{key}`", result / abs(nominal.value or 1.0))
        return result

    def _suspect(self, fields: Mapping[str, Entry], what: str, owner: Part) -> bool:
        """Whether a parameter is a suspect; those of a block that is trusted are not."""
        trusted = not read_suspect(self.source, owner.fields, owner.title)
        own = read_suspect(self.source, fields, what)
        if trusted and own and "suspect" in fields:
            problem = f"is a suspect, but {owner.title} is trusted; remove one `suspect`"
            raise self.source.error(fields["suspect"], f"{what} {problem}")
        return own and not trusted

    def _range(self, fields: Mapping[str, Entry], what: str, name: str, nominal: Quantity) -> tuple[float, float]:
        if "range" not in fields:
            words = "0 or more" if nominal.value > 0 else "0 or less" if nominal.value < 0 else "any"
            self.defaults.add("range", words, name)
            return default_range(nominal.value)
        entry = fields["range"]
        ends = range_ends(self.source, entry, f"{what}: range")
        lower, upper = (self._end(item, f"{what}: range", nominal) for item in ends)
        if not lower <= nominal.value <= upper or lower == upper:
            problem = "the nominal must lie between the two ends of `range`, and they must differ"
            raise self.source.error(entry, f"{what}: {problem}")
        return lower, upper

    def _limits(
        self, fields: Mapping[str, Entry], what: str, nominal: Quantity, reach: tuple[float, float]
    ) -> tuple[float, ...]:
        """Give the values at which a drift matters: one, or one on each side of the nominal."""
        if "limit" not in fields:
            return ()
        entry, what = fields["limit"], f"{what}: limit"
        if self.kind.static:
            raise self.source.error(entry, f"{what}: with `sample_time: none` nothing drifts; remove it")
        nodes = (entry.value,) if isinstance(entry.value, Text) else self.source.items(entry.value, what)
        found = sorted(self._end(node, what, nominal) for node in nodes)
        if not all(reach[0] <= value <= reach[1] and math.isfinite(value) for value in found):
            raise self.source.error(entry, f"{what} must lie within the range of the parameter; mend one of them")
        sides = [value > nominal.value for value in found]
        if nominal.value in found or sides not in ([False], [True], [False, True]):
            problem = "is one value other than the nominal, or `[lowest, highest]` about it"
            raise self.source.error(entry, f"{what} {problem}")
        return tuple(found)

    def _end(self, node: Node, what: str, nominal: Quantity) -> float:
        found = read_end(self.source, node, what, nominal.measure)
        same_unit(self.source, node, what, found, nominal.measure)
        return found.value


def range_ends(source: Source, entry: Entry, what: str) -> tuple[Node, Node]:
    """Give the two ends of the key `range`, infinite ones for `any`."""
    if isinstance(entry.value, Text) and entry.value.value.strip() == "any":
        return Text("-inf", entry.line), Text("inf", entry.line)
    if not isinstance(entry.value, Items) or len(entry.value.items) != 2:
        raise source.error(entry, f"{what} is `[lowest, highest]` or `any`, such as `[1 Pa, 5 Pa]`")
    return entry.value.items[0], entry.value.items[1]


def read_end(source: Source, node: Node, what: str, default: Measure | None) -> Quantity:
    """Give an end of a range, which may be infinite."""
    text = source.text(node, what)
    if text in ("inf", "-inf"):
        return Quantity(float(text), None)
    return quantity(text, f"{source.at(node)}{what} ", default)


def read_suspect(source: Source, fields: Mapping[str, Entry], what: str, default: bool = True) -> bool:
    """Give the key `suspect`."""
    if "suspect" not in fields:
        return default
    return yes_or_no(source, fields["suspect"], f"{what}: suspect")


def read_instrument(source: Source, fields: Mapping[str, Entry], what: str, kind: Kind, default: bool) -> bool:
    """Whether an input or sensor is a suspect; none is in a static network."""
    if kind.static and "suspect" in fields:
        problem = "with `sample_time: none` there are no faults of sensors and inputs; remove it"
        raise source.error(fields["suspect"], f"{what}: suspect: {problem}")
    return read_suspect(source, fields, what, default)


def yes_or_no(source: Source, entry: Entry, what: str) -> bool:
    """Give the truth value of `yes` or `no`."""
    word = source.text(entry.value, what).lower()
    if word not in ("yes", "no", "true", "false"):
        raise source.error(entry, f"{what} is `yes` or `no`, not `{shown(word)}`")
    return word in ("yes", "true")


def read_unit(source: Source, fields: Mapping[str, Entry], what: str, kind: Kind, place: Entry) -> Measure | None:
    """Give the measure of the key `unit` of an input or sensor, None if it is not stated."""
    text = source.text(fields["unit"].value, f"{what}: unit") if "unit" in fields else ""
    if kind.logic:
        if text != LOGIC_UNIT.text:
            problem = f"{kind.logic_by} is logic, and a network is all logic or all numbers; state `unit: logic`"
            raise source.error(fields.get("unit", place), f"{what}: {problem}")
        if "noise" in fields:
            raise source.error(fields["noise"], f"{what}: a logic signal has no noise; remove it")
        return Measure(LOGIC_UNIT, DIMENSIONLESS)
    if text == LOGIC_UNIT.text:
        problem = "logic signals belong to block networks; a bond graph has physical units"
        raise source.error(fields["unit"], f"{what}: {problem}")
    return measure(text, source.at(fields["unit"]) + f"{what}: ") if text else None


def read_column(source: Source, fields: Mapping[str, Entry], what: str, name: str, defaults: Defaults) -> str:
    """Give the column of a recording, by default the name of the thing."""
    if "column" not in fields:
        defaults.add("column", "its name", name)
        return name
    return column_text(source, fields["column"], what)


def column_text(source: Source, entry: Entry, what: str) -> str:
    """Give a column name: printable text of at most 200 characters."""
    text = source.text(entry.value, f"{what}: column")
    if len(text) > 200 or not text.isprintable():
        raise source.error(entry, f"{what}: column must be printable text of at most 200 characters")
    return text


def read_spread(source: Source, entry: Entry, what: str, default: Measure | None) -> Spread:
    """Give a standard deviation whose unit agrees with the thing's."""
    found = spread(source.text(entry.value, what), f"{source.at(entry)}{what} ", default)
    if found.quantity is not None:
        same_unit(source, entry, what, found.quantity, default)
    return found


def needs_size(source: Source, entry: Entry, what: str, found: Spread) -> None:
    """Refuse a percentage of nothing."""
    if found.is_relative:
        text = number_text(100 * found.ratio)
        raise source.error(entry, f"{what} is relative; say of what, such as `{text} % of 8.9 kPa`, or write a size")


def check_scale(source: Source, place: Node | Entry, what: str, size: float) -> None:
    """Refuse a size whose square no computer holds."""
    if size and not SMALLEST < abs(size) < LARGEST:
        raise source.error(place, f"{what} is {size:.3g} in SI, as nothing real is; check the number and its unit")


def same_unit(source: Source, place: Node | Entry, what: str, found: Quantity, wanted: Measure | None) -> None:
    """Refuse a quantity of another dimension than the thing it belongs to."""
    if found.measure is None:
        return
    if wanted is None:
        problem = f"is in {found.measure.unit.text or '1'}, but the thing itself has no unit; state both or none"
        raise source.error(place, f"{what} {problem}")
    if found.measure.dimension != wanted.dimension:
        problem = f"is in {found.measure.dimension}, but {wanted.dimension} is expected; use a unit such as"
        raise source.error(place, f"{what} {problem} `{wanted.unit.text or '1'}`")


def read_duration(source: Source, entry: Entry, what: str) -> float:
    """Give a time in seconds."""
    found = duration(source.text(entry.value, what), f"{source.at(entry)}{what} ")
    check_length(source, entry, what, found)
    return found


def check_length(source: Source, place: Node | Entry, what: str, seconds: float) -> None:
    """Refuse a time longer than anything lasts."""
    if seconds > LONGEST:
        raise source.error(place, f"{what} is longer than any plant runs; check the number and its unit")
