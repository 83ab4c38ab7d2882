"""Block networks: names, laws between signals, and which law defines which signal. Source: thesis 3.4 to 3.9, 6.1."""

from collections.abc import Mapping, Sequence

from faultbond.errors import ModelError
from faultbond.model.expression import LOGIC, NOT, RATE, Binary, Call, Expression, Name, Negative, Number, names, walk
from faultbond.model.graph import Component, Relation, Start
from faultbond.model.head import Head
from faultbond.model.keys import BLOCK_KEYS
from faultbond.model.laws import StartEntry, check_finite, read_start, stated_laws
from faultbond.model.parser import parse_expression, parse_relation, to_text
from faultbond.model.source import NAME, Source, closest, shown
from faultbond.model.spot import Spot
from faultbond.model.values import RESERVED_IN_BLOCKS, Values, read_suspect
from faultbond.model.wiring import MAX_PARTS, Part, Wiring
from faultbond.types import ElementType


def block_wiring(source: Source, fields: Mapping[str, Spot]) -> Wiring:
    """Read the names and keys of `blocks`.

    Raises
    ------
    ModelError
        where there are none, too many, or one that is no table of its keys.
    """
    place = fields["blocks"]
    count = len(place.entries())
    if count > MAX_PARTS:
        raise source.error(place.line, f"{count} blocks; at most {MAX_PARTS} are read. Split the network")
    if not count:
        raise source.error(place.line, "no blocks; state them, such as `blocks: {gain: {law: y = 2*x}}`")
    parts = (Part(item, ElementType.BLOCK, item.fields(BLOCK_KEYS)) for item in place.things("block"))
    return Wiring({part.name: part for part in parts}, {}, ())


class BlockReader:
    """Reads laws and other expressions of one block network; signals keep their bare names."""

    def __init__(self, head: Head, plant: Wiring, values: Values) -> None:
        self.head, self.source, self.plant, self.values = head, head.source, plant, values
        self.starts: list[StartEntry] = []
        self.owners: dict[str, tuple[str, int]] = {}  # signal -> block, line
        self.stores: set[str] = set()

    def components(self) -> tuple[Component, ...]:
        """Give all blocks with their laws."""
        owned = self.values.owned
        drafts = [(part, *self._draft(part)) for part in self.plant.parts.values()]
        return tuple(
            Component(
                name=part.name,
                type=part.type,
                laws=tuple(self._resolved(law, part) for law in laws),
                parameters=owned.get(part.name, ()),
                start=self._start(part, [law.store for law in laws if law.store is not None]),
                signals=signals,
                suspect=read_suspect(part.fields),
                line=part.line,
            )
            for part, laws, signals in drafts
        )

    def is_signal(self, name: str) -> bool:
        """Whether a name is that of a signal."""
        return name in self.owners

    def expression(self, place: Spot) -> Expression:
        """Give a resolved expression outside a block, such as what a sensor reads."""
        text, where = place.text(), place.where(": ")
        return self._checked(parse_expression(text, where, blocks=True), where)

    def signal(self, name: str, where: str) -> str:
        """Give a name if it is a signal of the network.

        Raises
        ------
        ModelError
            where it is none.
        """
        if name not in self.owners:
            raise ModelError(where + self._unknown(name))
        return name

    def _draft(self, part: Part) -> tuple[tuple[Relation, ...], tuple[str, ...]]:
        """Give the laws of a block, their names not yet resolved, and the signals that it states beside theirs."""
        texts = stated_laws(part)
        if not texts:
            raise part.place.error(": `law` is missing; write one, such as `law: y = 2*x`")
        laws = tuple(self._relation(part, text, line) for text, line in texts)
        for law in laws:
            if law.signal is not None:
                self._claim(law.signal, part, f"{self.source.at(law.line)}law of {part.name}: ", law.line)
        signals = []
        for place in part.fields["signals"].one_or_more() if "signals" in part.fields else ():
            name = place.text()
            if not NAME.fullmatch(name):
                raise place.error(f": `{shown(name)}` is not a name; write a list of names, such as `signals: [T]`")
            line = place.line or part.fields["signals"].line
            self._claim(name, part, f"{self.source.at(line)}{place.words}: ", line)
            signals.append(name)
        self.stores.update(law.store for law in laws if law.store is not None)
        return laws, tuple(signals)

    def _relation(self, part: Part, text: str, line: int) -> Relation:
        where = f"{self.source.at(line)}law of {part.name}: "
        left, right = parse_relation(text, where, blocks=True)
        law = Relation(left=left, right=right, line=line)
        inner = right if law.store is not None else Binary("-", left, right)
        if _has_rate(inner):
            problem = "a rate stands alone on the left of a law, as in `der(y) = x/P`"
            raise ModelError(f"{where}`{shown(text)}`: {problem}")
        if law.store is not None and self.head.static:
            problem = f"`der({law.store})` makes a store, and with `sample_time: none` there is no time"
            raise ModelError(f"{where}{problem}; state a sample_time such as `1 s`")
        return law

    def _claim(self, name: str, part: Part, where: str, line: int) -> None:
        """Take a name for a signal; an error if anything else has it."""
        if "." in name:
            raise ModelError(f"{where}`{name}`: signals of blocks have no dot; write `{name.partition('.')[2]}`")
        if name in RESERVED_IN_BLOCKS:
            raise ModelError(f"{where}`{name}`: the name is reserved for functions; choose another")
        if name in self.values.places:
            other, _ = self.values.places[name]
            article = "an" if other == "input" else "a"
            problem = f"`{name}` is already {article} {other}; a law defines a signal of its own"
            raise ModelError(f"{where}{problem}. Write the equation as `0 = ...`, or rename one")
        if name in self.owners:
            block, first = self.owners[name]
            place = f" on line {first}" if self.source.has_lines else ""
            problem = f"signal `{name}` is already that of block {block}{place}; a signal has one law"
            raise ModelError(f"{where}{problem}. Rename it, or write a further equation as `0 = ...`")
        self.owners[name] = (part.name, line)

    def _resolved(self, law: Relation, part: Part) -> Relation:
        where = f"{self.source.at(law.line)}law of {part.name}: "
        left = law.left if law.store is not None else self._checked(law.left, where)
        return Relation(left=left, right=self._checked(law.right, where), line=law.line)

    def _checked(self, expression: Expression, where: str) -> Expression:
        """Give the expression if every name is known, logic and numbers are apart, and constant parts are finite."""
        for name in names(expression):
            if name not in self.owners and name not in self.values.measures:
                raise ModelError(where + self._unknown(name))
        if _has_rate(expression):
            raise ModelError(f"{where}`{shown(to_text(expression))}`: a rate is no signal; `der(y)` is for laws")
        if self.head.logic:
            self._check_logic(expression, where)
        elif found := _first_logic(expression):
            advice = "write `**` for a power, or give inputs and sensors" if found == "^" else "give inputs and sensors"
            problem = f"`{found}` is logic, but no input and no sensor is; {advice} `unit: logic`"
            raise ModelError(f"{where}`{shown(to_text(expression))}`: {problem}")
        else:
            check_finite(expression, self.values.nominals, where)
        return expression

    def _unknown(self, name: str) -> str:
        if "." in name:
            return f"`{name}`: signals of blocks have no dot; write `{name.partition('.')[2]}`"
        if name in self.plant.parts and name not in self.values.measures:
            own = [signal for signal, (block, _) in self.owners.items() if block == name]
            example = f", such as `{own[0]}`" if own else ""
            return f"`{name}` is a block, not a signal; name one of its signals{example}"
        near = closest(name, [*self.owners, *self.values.measures])
        return f"unknown name `{shown(name)}`; {near or 'a signal stands left in a law, or under `signals` of a block'}"

    def _check_logic(self, expression: Expression, where: str) -> None:
        """Refuse numbers in a network of logic."""
        whole = f"{where}`{shown(to_text(expression))}`: "
        advice = f"{self.head.logic_by} is logic; write `&`, `|`, `^`, `~`, signals, 0 and 1"
        for item in walk(expression):
            match item:
                case Binary(operator) if operator not in LOGIC:
                    raise ModelError(f"{whole}`{operator}` is for numbers, but {advice}")
                case Negative():
                    raise ModelError(f"{whole}`-` is for numbers, but {advice}")
                case Call(function) if function != NOT:
                    raise ModelError(f"{whole}`{function}` is for numbers, but {advice}")
                case Number(value) if value not in (0.0, 1.0):
                    raise ModelError(f"{whole}`{value:g}` is a number, but {advice}")
                case Name(text) if text in self.values.nominals:
                    raise ModelError(f"{whole}`{text}` is a number, but {advice}")

    def _start(self, part: Part, stores: Sequence[str]) -> Start | None:
        """Give the known start of a block's store."""
        if "start" not in part.fields:
            if stores:
                self.head.defaults.missing(BLOCK_KEYS, "start", part.name)
            return None
        place = Spot(self.source, f"start of {part.name}", part.fields["start"].entry)
        if len(stores) != 1:
            problem = f": a block with a start has one law `der(..) = ..`, and this one has {len(stores)}"
            raise place.error(f"{problem}; split or mend the block")
        if stores[0] == "sd":
            raise place.error(": `sd` is the standard deviation here; rename the signal")
        start, found = read_start(place, stores[0])
        self.starts.append(StartEntry(stores[0], found, place.line))
        return start


def _has_rate(expression: Expression) -> bool:
    return any(isinstance(item, Call) and item.function == RATE for item in walk(expression))


def _first_logic(expression: Expression) -> str:
    """Give the first logic operator of an expression; empty if there is none."""
    for item in walk(expression):
        match item:
            case Binary(operator) if operator in LOGIC:
                return operator
            case Call(function) if function == NOT:
                return "~"
    return ""
