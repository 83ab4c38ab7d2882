"""Things of the model's text by their place: what stands there as a number, a time, a name, or why it cannot."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NoReturn, TypeVar

from faultbond.errors import ModelError
from faultbond.model.keys import Keys
from faultbond.model.parser import number_text
from faultbond.model.quantities import Quantity, Spread, duration, quantity, spread
from faultbond.model.source import NAME, Entry, Items, Node, Source, Table, Text, choice, kind, shown
from faultbond.model.units import Measure, coulomb_hint

SMALLEST, LARGEST = 1e-100, 1e100  # of standard deviations, SI
LONGEST = 1e12  # s
LONGEST_TITLE = 100  # characters

_Form = TypeVar("_Form", Text, Items, Table)


@dataclass(frozen=True, slots=True)
class Spot:
    """An entry of the model's text, and the words for it in messages: `sensor flow: noise`."""

    source: Source
    words: str
    entry: Entry

    @property
    def name(self) -> str:
        """Its key."""
        return self.entry.key

    @property
    def line(self) -> int:
        """Line of its key."""
        return self.entry.line

    def where(self, mark: str = " ") -> str:
        """Give the start of a message about it: `model.yaml:12: sensor flow: noise `."""
        return f"{self.source.at(self.entry)}{self.words}{mark}"

    def error(self, problem: str) -> ModelError:
        """Give the exception for a problem, whose text goes on right after the words for the place."""
        return ModelError(self.where("") + problem)

    def inside(self, node: Node) -> "Spot":
        """Give the place of an item in it, under the same words."""
        return Spot(self.source, self.words, Entry(self.name, node, node.line))

    def at(self, inner: "Spot") -> "Spot":
        """Give the place of something in it under its own words, where a message needs no more."""
        return Spot(self.source, self.words, inner.entry)

    def _form(self, form: type[_Form], wanted: str) -> _Form:
        node = self.entry.value
        if not isinstance(node, form):
            raise self.inside(node).error(f" must be {wanted}, not a {kind(node)}")
        return node

    def text(self) -> str:
        """Give its text; an error unless it is a text that is not empty.

        Raises
        ------
        ModelError
            where it is empty, or no text.
        """
        node = self._form(Text, "a text")
        if not node.value.strip():
            raise self.inside(node).error(" is empty; state it or leave the key out")
        return node.value.strip()

    def title(self) -> str:
        """Read a name for people, of a model.

        Raises
        ------
        ModelError
            Where it is not one line, or is long.
        """
        text = self.text()
        if len(text) > LONGEST_TITLE or not text.isprintable():
            raise self.error(f" must be one line of printable text, {LONGEST_TITLE} characters at most")
        return text

    @property
    def is_empty(self) -> bool:
        """Whether nothing stands behind the key."""
        return isinstance(self.entry.value, Text) and not self.entry.value.value.strip()

    def items(self) -> tuple["Spot", ...]:
        """Give the places of a list; nothing counts as an empty one."""
        return () if self.is_empty else tuple(map(self.inside, self._form(Items, "a list `[...]`").items))

    def one_or_more(self) -> tuple["Spot", ...]:
        """Give the places of a list, or the one of a text that stands for a list of it."""
        return (self.inside(self.entry.value),) if isinstance(self.entry.value, Text) else self.items()

    def entries(self) -> tuple[Entry, ...]:
        """Give the entries of a table; nothing counts as an empty one."""
        return () if self.is_empty else self._form(Table, "a table `{key: value, ...}`").entries

    def things(self, word: str, *, checked: bool = True) -> Iterator["Spot"]:
        """Give the named things of a section, `sensor flow`, with their names checked, or to be checked later."""
        for entry in self.entries():
            is_number = entry.key[:1].isdigit()  # in `{R: 1,2 ohm}` there are two things
            name = check_name(self.source, entry, self.words) if checked or is_number else shown(entry.key)
            yield Spot(self.source, f"{word} {name}", entry)

    def fields(
        self, keys: Keys, prefix: str | None = None, *, note: Callable[[ModelError], None] | None = None
    ) -> dict[str, "Spot"]:
        """Give the places of a table by key.

        Parameters
        ----------
        keys : what may stand there
        prefix : start of the words for what is inside; by default the words for the table
        note : takes each mistake, and the others are given; None: the first is raised

        Raises
        ------
        ModelError
            at the first key that is not known, or where one is missing.
        """
        prefix = f"{self.words}: " if prefix is None else prefix
        if isinstance(self.entry.value, Text) and keys.short and not (self.is_empty and keys.may_be_empty):
            short = Entry(keys.short, self.entry.value, self.line)
            return {keys.short: Spot(self.source, prefix + keys.short, short)}
        note = note or _raised
        found = {entry.key: Spot(self.source, prefix + entry.key, entry) for entry in self.entries()}
        for key, place in found.items():
            if key not in keys.known:
                advice, value = choice(key, keys.known), place.entry.value
                if not NAME.fullmatch(key) and isinstance(value, Text) and not value.value:
                    advice = "put quotes round a text with a comma"
                note(self.source.error(place.entry, f"{self.words}: unknown key `{shown(key)}`; {advice}"))
        for key, about in keys.known.items():
            if about.missing and key not in found:
                note(self.source.error(self.entry, f"{prefix}`{key}` is missing; {about.missing}"))
        return {key: place for key, place in found.items() if key in keys.known}

    def quantity(self, default: Measure | None = None, mark: str = " ") -> Quantity:
        """Give its quantity; a number without unit has the default one."""
        return quantity(self.text(), self.where(mark), default)

    def spread(self, default: Measure | None = None, *, sized: bool = False, free: bool = False) -> Spread:
        """Give its standard deviation, in a unit that agrees with the thing's.

        Parameters
        ----------
        default : the unit of the thing
        sized : whether a percentage alone does not do
        free : whether a thing without unit takes one that is stated here

        Raises
        ------
        ModelError
            where it is no such thing, or in another unit.
        """
        found = spread(self.text(), self.where(), default)
        if found.quantity is not None and not (free and default is None):
            self.check_unit(found.quantity, default)
        if sized and found.is_relative:
            text = number_text(100 * found.ratio)
            raise self.error(f" is relative; say of what, such as `{text} % of 8.9 kPa`, or write a size")
        return found

    def seconds(self) -> float:
        """Give its time in seconds."""
        found = duration(self.text(), self.where())
        self.check_time(found)
        return found

    def is_yes(self) -> bool:
        """Give the truth value of `yes` or `no`.

        Raises
        ------
        ModelError
            where it is neither.
        """
        word = self.text().lower()
        if word not in ("yes", "no", "true", "false"):
            raise self.error(f" is `yes` or `no`, not `{shown(word)}`")
        return word in ("yes", "true")

    def column(self) -> str:
        """Give a column name: printable text of at most 200 characters.

        Raises
        ------
        ModelError
            where it is not.
        """
        text = self.text()
        if len(text) > 200 or not text.isprintable():
            raise self.error(" must be printable text of at most 200 characters")
        return text

    def end(self, default: Measure | None) -> Quantity:
        """Give an end of a range, which may be infinite."""
        text = self.text()
        return Quantity(float(text), None) if text in ("inf", "-inf") else self.quantity(default)

    def ends(self) -> tuple["Spot", "Spot"]:
        """Give the two ends of a range, infinite ones for `any`.

        Raises
        ------
        ModelError
            where they are not two.
        """
        node = self.entry.value
        if isinstance(node, Text) and node.value.strip() == "any":
            return self.inside(Text("-inf", self.line)), self.inside(Text("inf", self.line))
        if not isinstance(node, Items) or len(node.items) != 2:
            raise self.error(" is `[lowest, highest]` or `any`, such as `[1 Pa, 5 Pa]`")
        return self.inside(node.items[0]), self.inside(node.items[1])

    def check_unit(self, found: Quantity, wanted: Measure | None) -> None:
        """Refuse a quantity of another dimension than the thing it belongs to.

        Raises
        ------
        ModelError
            where it is one.
        """
        if found.measure is None:
            return
        if wanted is None:
            problem = f" is in {found.measure.unit.text or '1'}, but the thing itself has no unit; state both or none"
            raise self.error(problem)
        if found.measure.dimension != wanted.dimension:
            problem = f" is in {found.measure.dimension}, but {wanted.dimension} is expected"
            hint = coulomb_hint(found.measure.dimension, wanted.dimension)
            raise self.error(f"{problem}; {hint or f'use a unit such as `{wanted.unit.text or 1}`'}")

    def check_size(self, size: float) -> None:
        """Refuse a size whose square no computer holds.

        Raises
        ------
        ModelError
            where it is too small or too large.
        """
        if size and not SMALLEST < abs(size) < LARGEST:
            raise self.error(f" is {size:.3g} in SI, as nothing real is; check the number and its unit")

    def check_time(self, seconds: float, what: str = "") -> None:
        """Refuse a time longer than anything lasts.

        Raises
        ------
        ModelError
            where it is.
        """
        if seconds > LONGEST:
            raise self.error(f"{what} is longer than any plant runs; check the number and its unit")


def _raised(error: ModelError) -> NoReturn:
    raise error


def check_name(source: Source, entry: Entry, section: str) -> str:
    """Give a key as a name; an error unless it is a letter and then letters, digits and `_`, 64 at most.

    Raises
    ------
    ModelError
        where it is none.
    """
    if not NAME.fullmatch(entry.key):
        rule = "a name is a letter, then letters, digits and `_`, 64 characters at most"
        is_rest = entry.key[:1].isdigit() and entry.value == Text("", entry.value.line)  # of a number, behind its comma
        comma = ". A decimal comma? Write a point" if is_rest else ""
        raise source.error(entry, f"{section}: `{shown(entry.key)}` is not a name; {rule}{comma}")
    return entry.key
