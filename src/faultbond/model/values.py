"""Constants, inputs and parameters: the numbers of a model, in SI, with their spreads."""

import keyword
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from faultbond.model.defaults import default_range
from faultbond.model.expression import FUNCTIONS, RATE
from faultbond.model.graph import LOGIC_UNIT, Constant, Input, Parameter, SlowError
from faultbond.model.head import Head, whole
from faultbond.model.keys import (
    ACCURACY,
    CHANGE,
    HOLDS,
    INPUT_KEYS,
    LAG_KEYS,
    MOST_STAGES,
    NOISES_OF,
    PARAMETER_KEYS,
    RATE_LIMIT_KEYS,
    Keys,
)
from faultbond.model.quantities import NO_UNIT, Quantity, Spread, quantity, spread_over
from faultbond.model.source import Entry, shown
from faultbond.model.spot import Spot, check_name
from faultbond.model.units import DIMENSIONLESS, Measure, measure
from faultbond.model.wiring import Part, Wiring
from faultbond.types import Hold

RESERVED = frozenset({"e", "f", "q", "p", "e1", "f1", "e2", "f2", *FUNCTIONS, *keyword.kwlist})
RESERVED_IN_BLOCKS = frozenset({RATE, *FUNCTIONS, *keyword.kwlist})
_SPREADS = ("accuracy", "change", "healthy_change")


@dataclass(frozen=True, slots=True)
class Values:
    """The numbers that a law may name, their measures (None: no unit was written), what they are and on which line.

    tables : of the tables that it may look into the measures of x and y
    """

    constants: tuple[Constant, ...]
    inputs: tuple[Input, ...]
    parameters: tuple[Parameter, ...]
    measures: Mapping[str, Measure | None]
    places: Mapping[str, tuple[str, int]]
    tables: Mapping[str, tuple[Measure | None, Measure | None]]

    @property
    def nominals(self) -> dict[str, float]:
        """SI values of constants and parameters by name."""
        constants = {item.name: item.value for item in self.constants}
        return constants | {item.name: item.nominal for item in self.parameters}

    @property
    def owned(self) -> dict[str, tuple[str, ...]]:
        """Names of the parameters of each component or block that has any."""
        found: dict[str, tuple[str, ...]] = {}
        for item in self.parameters:
            found[item.owner] = (*found.get(item.owner, ()), item.name)
        return found


class ValueReader:
    """Reads constants, inputs and parameters, which share one name space."""

    def __init__(self, head: Head) -> None:
        self.head, self.source, self.defaults = head, head.source, head.defaults
        self.measures: dict[str, Measure | None] = {}
        self.places: dict[str, tuple[str, int]] = {}
        self.lags: list[Parameter] = []  # time constants and highest rates of instruments, which no law has to name
        self.wanders: list[SlowError] = []  # how far numbers go from their usual values by themselves

    def read(
        self,
        fields: Mapping[str, Spot],
        plant: Wiring,
        tables: Mapping[str, tuple[Measure | None, Measure | None]],
    ) -> Values:
        """Read all of them, in the order of the file; `tables`: the measures of both axes of each."""
        constants = fields["constants"].things("constant", checked=False) if "constants" in fields else ()
        inputs = fields["inputs"].things("input", checked=False) if "inputs" in fields else ()
        parameters = (
            (place, part)
            for part in plant.parts.values()
            if "parameters" in part.fields
            for place in part.fields["parameters"].things("parameter", checked=False)
        )
        fixed = tuple(map(self._constant, constants))
        driven = [self._unknown(place) if self._is_unknown(place) else self._input(place) for place in inputs]
        return Values(
            (*fixed, *(item for item in driven if isinstance(item, Constant))),
            tuple(item for item in driven if isinstance(item, Input)),
            tuple(self._parameter(place, part) for place, part in parameters),
            self.measures,
            self.places,
            tables,
        )

    def _claim(self, place: Spot, what: str, found: Measure | None) -> str:
        """Take a name for a thing; an error if it is reserved or another thing has it."""
        name = check_name(self.source, place.entry, f"{what}s")
        if name in (RESERVED_IN_BLOCKS if self.head.blocks else RESERVED):
            of = "functions" if self.head.blocks else "signals and functions"
            of = "Python's own words" if keyword.iskeyword(name) else of
            problem = f"{what} `{name}`: the name is reserved for {of}; choose another"
            raise self.source.error(place.entry, problem)
        if name in self.places:
            other, line = self.places[name]
            first = f" on line {line}" if self.source.has_lines else ""
            advice = "rename one" if other != what else "state it once; every law may name it"
            problem = f"{what} `{name}` is already a{'n'[: other == 'input']} {other}{first}; {advice}"
            raise self.source.error(place.entry, problem)
        self.places[name] = (what, place.line)
        self.measures[name] = found
        return name

    def _constant(self, place: Spot) -> Constant:
        found = place.quantity(mark=": ")
        name = self._claim(place, "constant", found.measure)
        return Constant(name=name, value=found.value, unit=found.unit, line=place.line)

    def _is_unknown(self, place: Spot) -> bool:
        """Whether nobody measures an input."""
        fields = place.fields(INPUT_KEYS)
        if "usual" in fields and "unknown" not in fields:
            raise fields["usual"].error(
                ": it goes with `unknown`, how far an input goes that nobody measures; state that, or remove it"
            )
        return "unknown" in fields

    def _unknown(self, place: Spot) -> Constant:
        """Give an input that nobody measures: a number that wanders, and is no suspect."""
        fields = place.fields(INPUT_KEYS)
        for key, field in fields.items():
            if key == "suspect" and field.is_yes():
                problem = "what nobody measures has no record that may be wrong; make it a parameter with a `wander`"
                raise field.error(f": {problem}, of a source, if a fault may change it")
            if key not in ("unit", "unknown", "usual", "suspect"):
                raise field.error(": nobody measures it, as `unknown` says; remove one of the two")
        found = read_unit(self.head, place, fields)
        name = self._claim(place, "input", found)
        usual = Quantity(0.0, found)
        if "usual" in fields:
            usual = fields["usual"].quantity(found)
            fields["usual"].check_unit(usual, found)
        self.wanders.append(self._wander(fields["unknown"], name, usual))
        return Constant(name=name, value=usual.value, unit=found.unit if found else NO_UNIT, line=place.line)

    def _input(self, place: Spot) -> Input:
        fields = place.fields(INPUT_KEYS)
        found = read_unit(self.head, place, fields)
        name = self._claim(place, "input", found)
        settling = fields.get("settling")
        if settling and self.head.static:
            problem = ": with `sample_time: none` each row stands by itself, and nothing settles; remove it"
            raise settling.error(problem)
        noise = 0.0
        if "noise" in fields:
            noise = fields["noise"].spread(found, sized=True).difference()
            fields["noise"].check_size(noise)
        elif not self.head.logic:
            self.defaults.missing(INPUT_KEYS, "noise", name)
        if not settling and not self.head.static:
            self.defaults.missing(INPUT_KEYS, "settling", name)
        lower, upper = read_reach(self.head, fields, lambda end: self._end(end, found))
        lag, order = self.lag(place, fields["lag"]) if "lag" in fields else ("", 1)
        return Input(
            name=name,
            column=read_column(self.head, fields, INPUT_KEYS, name),
            unit=found.unit if found else NO_UNIT,
            noise=noise,
            settling=settling.seconds() if settling else 0.0,
            smooth=self._is_smooth(fields["noise_of"], noise) if "noise_of" in fields else False,
            hold=self._hold(fields),
            lag=lag,
            order=order,
            rate_limit=self._rate_limit(place, fields, found) if "rate_limit" in fields else "",
            lower=lower,
            upper=upper,
            suspect=read_instrument(self.head, fields),
            healthy_bias=read_healthy_bias(fields, found),
            fitted_range=read_fitted_range(fields, lambda end: self._end(end, found)),
            line=place.line,
        )

    def _is_smooth(self, place: Spot, noise: float) -> bool:
        """Whether the noise of an input is that of its record."""
        word = place.text()
        if self.head.static:
            raise place.error(": with `sample_time: none` each row stands by itself, and nothing is smooth; remove it")
        if word not in NOISES_OF:
            problem = f"`input`, what acts scatters, or `record`, the meter does, not `{shown(word)}`"
            raise place.error(f" is {problem}")
        if not noise:
            raise place.error(": there is no `noise` beside it; state how much the record scatters, or remove it")
        return word == NOISES_OF[1]

    def _hold(self, fields: Mapping[str, Spot]) -> Hold:
        """Give what an input is between two rows.

        Of rows that are averaged the mean about a sample is what sensors feel at once; of an input that lags nothing is
        felt at once, so what acts until the next sample may be its mean.
        """
        usual = Hold.LAST if self.head.row_time is None else Hold.LINEAR
        if "hold" not in fields:
            return usual
        place = fields["hold"]
        word = place.text()
        if self.head.static:
            raise place.error(": with `sample_time: none` each row stands by itself, and nothing is held; remove it")
        if word not in HOLDS:
            ways = "`last`, it stays until the next row, `next`, it was so since the row before, or `linear`"
            raise place.error(f" is {ways}, not `{shown(word)}`")
        hold = Hold(word)
        if hold is Hold.NEXT and usual is Hold.LINEAR:
            raise place.error(": with `row_time` a sample is the mean of the rows about it; remove it")
        return hold if "lag" in fields or usual is Hold.LAST else usual

    def lag(self, owner: Spot, stated: Spot) -> tuple[str, int]:
        """Take the lag of an input or a sensor; give the parameter that is its time constant, and its order.

        Raises
        ------
        ModelError
            where it is no time above 0, or something else has the name of the parameter.
        """
        place = self._own(owner, stated, "lag")
        fields = place.fields(LAG_KEYS)
        value, seconds = place.at(fields["value"]), measure("s")
        nominal = value.quantity(seconds)
        value.check_unit(nominal, seconds)
        if not nominal.value > 0.0:
            raise value.error(" is a time above 0, such as `3 s`; an input or a sensor without `lag` follows at once")
        value.check_time(nominal.value)
        suspect = read_suspect(fields, default=False)
        name = self._timing(place, fields, nominal, owner.name, "lag", suspect)
        return name, whole(fields["order"], 1, MOST_STAGES) if "order" in fields else 1

    def _rate_limit(self, owner: Spot, stated: Mapping[str, Spot], unit: Measure | None) -> str:
        """Take the highest rate of what an input moves; give the parameter that is it."""
        place = self._own(owner, stated["rate_limit"], "rate_limit")
        if "lag" not in stated:
            usual = f"{self.head.sample_time:g} s" if self.head.sample_time else "1 s"
            raise place.error(
                f": it needs a `lag` beside it; state `lag: {{value: {usual}, accuracy: 50 %}}`, about a sample, "
                "if nothing is known of it"
            )
        fields = place.fields(RATE_LIMIT_KEYS)
        value = place.at(fields["value"])
        rate = measure((unit.unit if unit else NO_UNIT).rate.text)
        nominal = value.quantity(rate)
        value.check_unit(nominal, rate)
        if not nominal.value > 0.0:
            raise value.error(
                f" is a rate above 0, such as `5 {rate.unit.text}`; without it what lags moves at any rate"
            )
        return self._timing(place, fields, nominal, owner.name, "rate limit", read_suspect(fields))

    def _own(self, owner: Spot, stated: Spot, word: str) -> Spot:
        """Give the place of a number that belongs to an input or a sensor, called by the name of that."""
        if self.head.static:
            raise stated.error(": with `sample_time: none` each row stands by itself, and nothing lags; remove it")
        name = f"{owner.name}_{word}"
        if name in self.places:
            other, line = self.places[name]
            first = f" on line {line}" if self.source.has_lines else ""
            article = "an" if other == "input" else "a"
            raise stated.error(
                f": its parameter is called `{name}`, and so is {article} {other}{first}; rename that one"
            )
        return Spot(self.source, stated.words, Entry(name, stated.entry.value, stated.line))

    def _timing(
        self, place: Spot, fields: Mapping[str, Spot], nominal: Quantity, owner: str, what: str, suspect: bool
    ) -> str:
        """Keep a number above 0 that says how an input or a sensor comes behind; give its name."""
        found = self._number(place, fields, nominal, owner, what, suspect)
        if found.lower < 0.0:
            why = {"lag": "nothing acts before its cause", "rate limit": "its size is meant, in both directions"}
            raise fields["range"].error(f" must not go below 0; {why[what]}")
        self.lags.append(found)
        return found.name

    def _parameter(self, place: Spot, owner: Part) -> Parameter:
        fields = place.fields(PARAMETER_KEYS)
        nominal = quantity(fields["nominal"].text(), place.at(fields["nominal"]).where(": "))
        return self._number(place, fields, nominal, owner.name, "parameter", self._suspect(place, fields, owner))

    def _number(
        self, place: Spot, fields: Mapping[str, Spot], nominal: Quantity, owner: str, what: str, suspect: bool
    ) -> Parameter:
        """Give a parameter whose nominal value is known, with its spreads and range."""
        bare_zero = nominal.measure is None and nominal.number == 0  # takes the unit of its spreads
        spreads = {key: fields[key].spread(nominal.measure, free=bare_zero) for key in _SPREADS if key in fields}
        if bare_zero:
            units = [item.quantity.measure for item in spreads.values() if item.quantity]
            nominal = Quantity(0.0, next((unit for unit in units if unit and not unit.unit.offset), None))
        name = self._claim(place, what, nominal.measure)
        accuracy = spreads.get("accuracy") or self.head.accuracy
        lower, upper = self._range(place, fields, nominal)
        moves = spreads.get("healthy_change")
        if "wander" in fields:
            self.wanders.append(self._wander(fields["wander"], name, nominal))
        return Parameter(
            name=name,
            owner=owner,
            nominal=nominal.value,
            unit=nominal.unit,
            accuracy=self._size("accuracy", ACCURACY, accuracy, place, nominal),
            change=self._size("change", CHANGE, spreads.get("change"), place, nominal),
            lower=lower,
            upper=upper,
            limits=self._limits(fields["limit"], nominal, (lower, upper)) if "limit" in fields else (),
            suspect=suspect,
            healthy_change=self._size("healthy_change", 0.0, moves, place, nominal) if moves else 0.0,
            line=place.line,
        )

    def _wander(self, place: Spot, name: str, usual: Quantity) -> SlowError:
        """Give how far a number goes from its usual value by itself, and for how long."""
        if self.head.static:
            raise place.error(": with `sample_time: none` each row stands by itself, and nothing wanders; remove it")
        sd, memory = spread_over(place.text(), place.where(": "), usual.measure, "wander")
        if sd.quantity is not None:
            place.check_unit(sd.quantity, usual.measure)
        size = sd.ratio if sd.is_relative else sd.difference()
        if sd.is_relative and usual.value == 0.0:
            size_text = f"2 {usual.unit.text}".rstrip()
            problem = f": a part of 0 is nothing; write a size, such as `{size_text} over 6 h` with your numbers"
            raise place.error(problem)
        if size == 0.0:
            raise place.error(": its size must be above 0; what does not wander states none")
        place.check_size(size)
        place.check_time(memory, ": its memory")
        return SlowError(
            target=name,
            sd=size,
            relative=sd.is_relative,
            memory=memory,
            wanders=True,
            unit=NO_UNIT if sd.is_relative else usual.unit,
            line=place.line,
        )

    def _size(self, key: str, percent: float, stated: Spread | None, place: Spot, nominal: Quantity) -> float:
        """Give an SI standard deviation of a parameter, such as its `accuracy`, by default a part of its nominal."""
        chosen = stated or Spread(ratio=percent / 100)
        where = f"parameter {place.name}: "
        if chosen.is_relative and nominal.value == 0:
            example = f"{key}: 2 {nominal.unit.text}".rstrip()
            problem = f"the nominal is 0, so `{key}` must be a size of its own; write `{example}` with your number"
            raise self.source.error(place.entry, where + problem)
        if stated is None:
            self.defaults.missing(PARAMETER_KEYS, key, place.name)
        result = chosen.difference(nominal.value)
        if not math.isfinite(result) or (key == "change" and result == 0):
            raise self.source.error(place.entry, f"{where}`{key}` must be a finite size above 0")
        Spot(self.source, f"{where}`{key}`", place.entry).check_size(result / abs(nominal.value or 1.0))
        return result

    def _suspect(self, place: Spot, fields: Mapping[str, Spot], owner: Part) -> bool:
        """Whether a parameter is a suspect; those of a block that is trusted are not."""
        trusted = not read_suspect(owner.fields)
        own = read_suspect(fields)
        if trusted and own and "suspect" in fields:
            problem = f" is a suspect, but {owner.title} is trusted; remove one `suspect`"
            raise place.at(fields["suspect"]).error(problem)
        return own and not trusted

    def _range(self, place: Spot, fields: Mapping[str, Spot], nominal: Quantity) -> tuple[float, float]:
        if "range" not in fields:
            words = "0 or more" if nominal.value > 0 else "0 or less" if nominal.value < 0 else "any"
            self.defaults.add("range", words, place.name)
            return default_range(nominal.value)
        lower, upper = (self._end(end, nominal.measure) for end in fields["range"].ends())
        if not lower <= nominal.value <= upper or lower == upper:
            raise place.at(fields["range"]).error(
                ": the nominal must lie between the two ends of `range`, and they must differ"
            )
        return lower, upper

    def _limits(self, place: Spot, nominal: Quantity, reach: tuple[float, float]) -> tuple[float, ...]:
        """Give the values at which a drift matters: one, or one on each side of the nominal."""
        if self.head.static:
            raise place.error(": with `sample_time: none` nothing drifts; remove it")
        found = sorted(self._end(end, nominal.measure) for end in place.one_or_more())
        if not all(reach[0] <= value <= reach[1] and math.isfinite(value) for value in found):
            raise place.error(" must lie within the range of the parameter; mend one of them")
        sides = [value > nominal.value for value in found]
        if nominal.value in found or sides not in ([False], [True], [False, True]):
            raise place.error(" is one value other than the nominal, or `[lowest, highest]` about it")
        return tuple(found)

    def _end(self, place: Spot, unit: Measure | None) -> float:
        found = place.end(unit)
        place.check_unit(found, unit)
        return found.value


def read_suspect(fields: Mapping[str, Spot], default: bool = True) -> bool:
    """Give the key `suspect`."""
    return fields["suspect"].is_yes() if "suspect" in fields else default


def read_instrument(head: Head, fields: Mapping[str, Spot]) -> bool:
    """Whether an input or sensor is a suspect; none is in a static network.

    Raises
    ------
    ModelError
        where a static network states it.
    """
    for key in ("suspect", "healthy_bias"):
        if head.static and key in fields:
            raise fields[key].error(": with `sample_time: none` there are no faults of sensors and inputs; remove it")
    return read_suspect(fields, head.instruments)


def read_healthy_bias(fields: Mapping[str, Spot], unit: Measure | None) -> float:
    """Give the bias, SI, that an input or sensor seems to have on healthy data; 0 where none is stated.

    Raises
    ------
    ModelError
        where it is no size in a unit of the input or sensor.
    """
    if "healthy_bias" not in fields:
        return 0.0
    size = fields["healthy_bias"].spread(unit, sized=True).difference()
    fields["healthy_bias"].check_size(size)
    return size


def read_fitted_range(fields: Mapping[str, Spot], read: Callable[[Spot], float]) -> tuple[float, float] | None:
    """Give where an input or sensor was in the recordings of a fit, SI; None where none is stated; `read` gives an end.

    Raises
    ------
    ModelError
        where they are not two values in order.
    """
    if "fitted_range" not in fields:
        return None
    place = fields["fitted_range"]
    lower, upper = (read(end) for end in place.ends())
    if not -math.inf < lower <= upper < math.inf:
        raise place.error(": two values in order are expected, as in `[20 percent, 85 percent]`; mend one")
    return lower, upper


def read_reach(head: Head, fields: Mapping[str, Spot], read: Callable[[Spot], float]) -> tuple[float, float]:
    """Give the least and greatest SI value of an input or sensor, infinite by default; `read` gives one of them.

    Raises
    ------
    ModelError
        where they are not two values in order, or of a logic signal.
    """
    if "range" not in fields:
        return -math.inf, math.inf
    place = fields["range"]
    if head.logic:
        raise place.error(": a logic signal has no range; remove it")
    lower, upper = (read(end) for end in place.ends())
    if lower >= upper:
        raise place.error(": the lowest value must be below the highest; mend one")
    return lower, upper


def read_unit(head: Head, place: Spot, fields: Mapping[str, Spot]) -> Measure | None:
    """Give the measure of the key `unit` of an input, sensor or check, None if it is not stated.

    Raises
    ------
    ModelError
        where it is no unit, or logic among numbers, or a number among logic.
    """
    text = fields["unit"].text() if "unit" in fields else ""
    here = place.at(fields.get("unit", place))
    if head.logic:
        if text != LOGIC_UNIT.text:
            problem = f"{head.logic_by} is logic, and a network is all logic or all numbers; state `unit: logic`"
            raise here.error(f": {problem}")
        if "noise" in fields:
            raise place.at(fields["noise"]).error(": a logic signal has no noise; remove it")
        return Measure(LOGIC_UNIT, DIMENSIONLESS)
    if text == LOGIC_UNIT.text:
        raise here.error(": logic signals belong to block networks; a bond graph has physical units")
    return measure(text, here.where(": ")) if text else None


def read_column(head: Head, fields: Mapping[str, Spot], keys: Keys, name: str) -> str:
    """Give the column of a recording, by default the name of the thing."""
    if "column" not in fields:
        head.defaults.missing(keys, "column", name)
        return name
    return fields["column"].column()
