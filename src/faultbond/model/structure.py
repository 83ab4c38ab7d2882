"""A structure: equations of which only the names in them are known, with unknowns, known signals and faults.

It is what tools for structural diagnosis take, such as the fault diagnosis toolbox of Linköping University (relations
as lists of names, or symbolic ones, of which the structure is taken). Nothing of a text is ever executed.
"""

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from faultbond.model.expression import RATE
from faultbond.model.keys import BESIDE_STRUCTURE, FURTHER_SENSOR_KEYS, MODEL_KEYS, SENSOR_COST, STRUCTURE_KEYS
from faultbond.model.source import NAME, Entry, Items, Source, Table, Text, choice, closest, shown
from faultbond.model.spot import Spot, check_name

STRUCTURE = "structure"  # the key of a model file that has one
DIFFERENTIAL = "diff"  # `[dx, x, diff]`, as the toolbox writes `dx = der(x)`
LARGEST_COST = 1e12
NUMBERS = frozenset({"pi", "True", "False"})  # names in texts, of sympy too, that need not be listed

_KINDS = {"unknowns": "an unknown", "known": "known", "faults": "a fault", "parameters": "a parameter"}
_TOKEN = re.compile(
    r"""[ \t\r\n]+
    |(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?(?![A-Za-z_])
    |(?P<name>[A-Za-z][A-Za-z0-9_]*(?:\.[A-Za-z][A-Za-z0-9_]*)*)(?P<call>[ \t]*\()?
    |(?P<equals>==?)
    |[-+*/^()<>,&|~]""",
    re.VERBOSE,
)
_RATE_LAW = re.compile(rf"\s*(?:(\w+)\s*==?\s*{RATE}\(\s*(\w+)\s*\)|{RATE}\(\s*(\w+)\s*\)\s*==?\s*(\w+))\s*")


@dataclass(frozen=True, slots=True, kw_only=True)
class StructureEquation:
    """An equation: its name, and the names in it by what they are, each once, in order of appearance."""

    name: str
    unknowns: tuple[str, ...]
    known: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Derivative:
    """An equation `rate = d quantity / dt`; both are unknowns."""

    name: str
    rate: str
    quantity: str


@dataclass(frozen=True, slots=True, kw_only=True)
class FurtherSensor:
    """A sensor that there could be; suspect: it can fail itself."""

    signal: str
    cost: float = SENSOR_COST
    suspect: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure:
    """A model that is known by its structure only.

    unknowns : those that stand in an equation; the rate of x is called `der(x)` where it has no name
    known, faults : as listed
    equations : without those of `derivatives`, which come after them
    further_sensors : unknowns that could be measured
    unused : listed unknowns and known signals that stand in no equation
    states_sensors, states_costs : whether further sensors, and costs of them, were stated
    line : of the key `structure`
    """

    name: str
    unknowns: tuple[str, ...]
    known: tuple[str, ...]
    faults: tuple[str, ...]
    equations: tuple[StructureEquation, ...]
    derivatives: tuple[Derivative, ...]
    further_sensors: tuple[FurtherSensor, ...]
    unused: tuple[str, ...] = ()
    states_sensors: bool = False
    states_costs: bool = False
    file: str = "model"
    line: int = 0

    @property
    def sha256(self) -> str:
        """Hash that names the structure: that of what it states."""
        content = (self.name, self.unknowns, self.known, self.faults, self.equations, self.derivatives)
        return hashlib.sha256(repr((*content, self.further_sensors)).encode()).hexdigest()


def read_structure(table: Table, source: Source, name: str) -> Structure:
    """Give the structure of a plain tree with the key `structure`.

    Parameters
    ----------
    table : keys and values as texts
    source : names the file, for messages
    name : the model's name where it states none

    Raises
    ------
    ModelError
        at the first thing that is not a complete, consistent structure.
    """
    top = {entry.key: Spot(source, entry.key, entry) for entry in table.entries}
    for key, place in top.items():
        if key not in MODEL_KEYS.known:
            raise source.error(place.entry, f"model: unknown key `{shown(key)}`; {choice(key, MODEL_KEYS.known)}")
        if key not in (STRUCTURE, *BESIDE_STRUCTURE):
            problem = f"stands beside `{STRUCTURE}`, which has no laws, numbers or units; remove one"
            raise source.error(place.entry, f"`{key}` {problem}")
    name = top["name"].title() if "name" in top else name
    place = top[STRUCTURE]
    return _Reader(source, place.fields(STRUCTURE_KEYS)).structure(name, place.line)


class _Reader:
    """Reads the lists of names, then the equations with these names."""

    def __init__(self, source: Source, fields: Mapping[str, Spot]) -> None:
        self.source, self.fields = source, fields
        self.kinds: dict[str, tuple[str, int]] = {}  # name -> the list it stands in, and the line
        self.rates: dict[str, Derivative] = {}  # by quantity
        for key in _KINDS:
            self._declare(key)

    def structure(self, name: str, line: int) -> Structure:
        found = dict(self._equations())
        for place in self.fields["derivatives"].things("derivative") if "derivatives" in self.fields else ():
            self._differentiate(place, place.name, place.text(), f"d {place.text()}/dt")
        rest = [place for place in found.values() if not self._is_rate(place)]  # all rates have names by then
        texts = [self._contents(place) for place in rest]
        used = {word for _, words in texts for word in words}
        used |= {word for item in self.rates.values() for word in (item.rate, item.quantity)}
        self._check_faults(used)
        implied = [item.rate for item in self.rates.values() if item.rate not in self.kinds]
        unknowns = (*(word for word in self._of("unknowns") if word in used), *implied)
        sensors = tuple(self._further_sensors(unknowns))
        return Structure(
            name=name,
            unknowns=unknowns,
            known=self._of("known"),
            faults=self._of("faults"),
            equations=tuple(self._equation(*item) for item in texts),
            derivatives=tuple(self.rates.values()),
            further_sensors=sensors,
            unused=tuple(word for key in ("unknowns", "known") for word in self._of(key) if word not in used),
            states_sensors="further_sensors" in self.fields,
            states_costs=any(item.cost != SENSOR_COST for item in sensors),
            file=self.source.label,
            line=line,
        )

    def _of(self, key: str) -> tuple[str, ...]:
        return tuple(word for word, (kind, _) in self.kinds.items() if kind == key)

    def _declare(self, key: str) -> None:
        """Take the names of a list; an error where one has been taken."""
        for place in self.fields[key].one_or_more() if key in self.fields else ():
            word = self._name(place)
            if word in self.kinds:
                kind, line = self.kinds[word]
                first = f" on line {line}" if self.source.has_lines and line != place.line else ""
                raise place.error(f": `{word}` is already {_KINDS[kind]}{first}; list it once")
            self.kinds[word] = key, place.line

    def _name(self, place: Spot) -> str:
        return check_name(self.source, Entry(place.text(), place.entry.value, place.line), place.words)

    def _known_name(self, place: Spot, word: str) -> str:
        """Give a name that is listed; an error where it is not."""
        if word not in self.kinds:
            near = closest(word, self.kinds)
            advice = f"{near} Else list it" if near else "list it"
            raise place.error(f": unknown name `{shown(word)}`; {advice} under {', '.join(_KINDS)}")
        return word

    def _equations(self) -> Iterator[tuple[str, Spot]]:
        """Give the equations by name; those of a list are e1, e2 and so on."""
        place = self.fields["equations"]
        if isinstance(place.entry.value, Items):
            for k, item in enumerate(place.items(), 1):
                node = item.entry.value
                yield f"e{k}", Spot(self.source, f"equation e{k}", Entry(f"e{k}", node, node.line))
        else:
            yield from ((item.name, item) for item in place.things("equation"))

    def _is_rate(self, place: Spot) -> bool:
        """Whether an equation only says that one unknown is the rate of another; then that is noted."""
        node = place.entry.value
        if isinstance(node, Text):
            match = _RATE_LAW.fullmatch(node.value)
            if match is None:
                return False
            rate, quantity = (match[1], match[2]) if match[1] else (match[4], match[3])
        else:
            items = node.items if isinstance(node, Items) else ()
            words = [item.value.strip() for item in items if isinstance(item, Text)]
            if len(words) != 3 or words[2] != DIFFERENTIAL or DIFFERENTIAL in self.kinds:
                return False
            rate, quantity = words[:2]
        self._differentiate(place, rate, quantity, place.name)
        return True

    def _differentiate(self, place: Spot, rate: str, quantity: str, name: str) -> None:
        """Note that one unknown is the rate of another."""
        for word in (rate, quantity):
            kind, _ = self.kinds[self._known_name(place, word)]
            if kind != "unknowns":
                advice = "give what is measured a name of its own: an unknown x, and an equation `[y, x]`"
                raise place.error(f": `{word}` is {_KINDS[kind]}, and only unknowns have rates; {advice}")
        if rate == quantity:
            raise place.error(f": `{rate}` cannot be its own rate; give the rate a name of its own")
        taken = next((item for item in self.rates.values() if quantity == item.quantity or rate == item.rate), None)
        if taken is not None:
            raise place.error(f": `{taken.rate}` is already the rate of `{taken.quantity}`; remove one")
        self.rates[quantity] = Derivative(name=name, rate=rate, quantity=quantity)

    def _contents(self, place: Spot) -> tuple[Spot, tuple[str, ...]]:
        """Give the names in an equation, each once."""
        if isinstance(place.entry.value, Text):
            return place, tuple(dict.fromkeys(self._words(place)))
        words = [self._known_name(place, item.text()) for item in place.items()]
        twice = next((word for k, word in enumerate(words) if word in words[:k]), None)
        if twice is not None:
            raise place.error(f" names `{twice}` twice; name it once, or what was meant in its place")
        if not words:
            raise place.error(" is empty; list what stands in it, such as `[x1, x2]`")
        return place, tuple(words)

    def _words(self, place: Spot) -> Iterator[str]:
        """Give the names in the text of an equation, without functions; `der(x)` is the rate of x."""
        text, at, sides = place.text(), 0, 1
        found = False
        while at < len(text):
            token = _TOKEN.match(text, at)
            sides += bool(token and token["equals"])
            if token is None or sides > 2:
                problem = f"cannot read `{shown(text[at : at + 20])}` in `{shown(text)}`"
                raise place.error(f": {problem}; write `q = K*(p1 - p2) + f`, or list the names: `[q, p1, p2, f]`")
            at = token.end()
            if token["name"] == RATE and token["call"]:
                word, at = self._rate(place, text, at)
            elif token["name"] and (token["name"] in self.kinds or not (token["call"] or token["name"] in NUMBERS)):
                word = self._known_name(place, token["name"])
            else:
                continue
            found = True
            yield word
        if not found:
            raise place.error(f": `{shown(text)}` names nothing that is listed; list what stands in it")

    def _rate(self, place: Spot, text: str, at: int) -> tuple[str, int]:
        """Give the name of the rate that `der(` begins, and where the text goes on."""
        inner = re.compile(rf"\s*({NAME.pattern})\s*\)").match(text, at)
        if inner is None:
            raise place.error(f": `{RATE}` takes the name of one unknown, as in `{RATE}(x)`")
        quantity = self._known_name(place, inner[1])
        if quantity not in self.rates:
            kind, _ = self.kinds[quantity]
            if kind != "unknowns":
                raise place.error(f": `{quantity}` is {_KINDS[kind]}, and only unknowns have rates")
            name = f"{RATE}({quantity})"
            self.rates[quantity] = Derivative(name=f"d {quantity}/dt", rate=name, quantity=quantity)
        return self.rates[quantity].rate, inner.end()

    def _equation(self, place: Spot, words: tuple[str, ...]) -> StructureEquation:
        kinds = {word: self.kinds[word][0] if word in self.kinds else "unknowns" for word in words}

        def of(key: str) -> tuple[str, ...]:
            return tuple(word for word in words if kinds[word] == key)

        return StructureEquation(name=place.name, unknowns=of("unknowns"), known=of("known"), faults=of("faults"))

    def _check_faults(self, used: set[str]) -> None:
        for word in self._of("faults"):
            if word not in used:
                problem = (
                    f"fault `{word}` stands in no equation; put it into the one that it makes untrue, or remove it"
                )
                raise self.source.error(self.kinds[word][1], problem)

    def _further_sensors(self, unknowns: tuple[str, ...]) -> Iterator[FurtherSensor]:
        """Give the sensors that there could be, in the order of the file; by default of all unknowns but rates."""
        rates = {item.rate for item in self.rates.values()}
        if "further_sensors" not in self.fields:
            yield from (FurtherSensor(signal=word) for word in unknowns if word not in rates)
            return
        section = self.fields["further_sensors"]
        if isinstance(section.entry.value, Table):
            places = list(section.things("further sensor"))
        else:
            names = {self._name(item): item.line for item in section.one_or_more()}
            entries = [Entry(name, Text("", line), line) for name, line in names.items()]
            places = [Spot(self.source, f"further sensor {entry.key}", entry) for entry in entries]
        for place in places:
            if self._known_name(place, place.name) not in unknowns:
                kind = self.kinds[place.name][0]
                what = _KINDS[kind] if kind != "unknowns" else "in no equation"
                raise place.error(f": it is {what}; only an unknown of some equation can be measured in addition")
            fields = place.fields(FURTHER_SENSOR_KEYS)
            suspect = fields["suspect"].is_yes() if "suspect" in fields else False
            yield FurtherSensor(signal=place.name, cost=self._cost(fields), suspect=suspect)

    def _cost(self, fields: Mapping[str, Spot]) -> float:
        if "cost" not in fields:
            return SENSOR_COST
        found = fields["cost"].quantity()
        if found.measure is not None or not 0 < found.number <= LARGEST_COST:
            raise fields["cost"].error(" is a number above 0, without a unit")
        return found.number
