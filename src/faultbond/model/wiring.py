"""Components, junctions and bonds: names, types, and whether everything is connected as its type needs."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

from faultbond.model.elements import OWN_SIGNALS
from faultbond.model.graph import Bond, Junction
from faultbond.model.keys import COMPONENT_KEYS
from faultbond.model.source import NAME, Source, choice, closest, shown
from faultbond.model.spot import Spot
from faultbond.types import ElementType, JunctionType

MAX_PARTS = 2000


@dataclass(frozen=True, slots=True)
class Part:
    """A component or block before its laws are read."""

    place: Spot
    type: ElementType
    fields: Mapping[str, Spot]

    @property
    def name(self) -> str:
        """Its name."""
        return self.place.name

    @property
    def line(self) -> int:
        """Its line."""
        return self.place.line

    @property
    def title(self) -> str:
        """Its name with the word for what it is, for messages."""
        return self.place.words


@dataclass(frozen=True, slots=True)
class Wiring:
    """The structure of the plant, checked."""

    parts: Mapping[str, Part]
    junctions: Mapping[str, Junction]
    bonds: tuple[Bond, ...]

    def signals(self, name: str) -> tuple[str, ...]:
        """Give the signals of a part: of its ports, or common to a junction; `q` and `p` integrate flow and effort."""
        if name in self.junctions:
            return ("e", "p") if self.junctions[name].type is JunctionType.ZERO else ("f", "q")
        return ("e1", "f1", "e2", "f2") if self.parts[name].type.n_ports == 2 else ("e", "f", "q", "p")


def wiring(source: Source, fields: Mapping[str, Spot]) -> Wiring:
    """Read `components`, `junctions` and `bonds`.

    Raises
    ------
    ModelError
        where one of them cannot be read, or a part is not connected as its type needs.
    """
    components, junctions = (fields[key].entries() if key in fields else () for key in ("components", "junctions"))
    if len(components) + len(junctions) > MAX_PARTS:
        n_parts = f"{len(components)} components and {len(junctions)} junctions"
        place = fields["components"] if components else fields["junctions"]
        raise source.error(place.entry, f"{n_parts}; at most {MAX_PARTS} together are read. Split the plant")
    if not components:
        line = fields["components"].line if "components" in fields else 0
        raise source.error(line, "no components; state them, such as `components: {pump: {type: Se, law: e = V}}`")
    parts = {part.name: part for part in map(_part, fields["components"].things("component"))}
    nodes = {}
    for place in fields["junctions"].things("junction") if junctions else ():
        word = place.text()
        if word not in ("0", "1"):
            raise place.error(f": unknown type `{shown(word)}`; it is 0 (one effort) or 1 (one flow)")
        nodes[place.name] = Junction(name=place.name, type=JunctionType(word), line=place.line)
    for name in nodes.keys() & parts.keys():
        other = f" (also {source.at(parts[name].line).rstrip(': ')})" if source.has_lines else ""
        raise source.error(nodes[name].line, f"`{name}` is both a junction and a component{other}; rename one")
    if "bonds" not in fields:
        raise source.error(0, "no bonds; state them, such as `bonds: [pump -> line -> pipe]`")
    bonds = _bonds(fields["bonds"], {**parts, **nodes})
    _check_bonds(source, bonds, parts)
    result = Wiring(parts, nodes, bonds)
    _check_connected(source, result)
    return result


def _part(place: Spot) -> Part:
    fields, known = place.fields(COMPONENT_KEYS), [item.value for item in OWN_SIGNALS]
    word = fields["type"].text()
    if word not in known:
        raise place.at(fields["type"]).error(f": unknown type `{shown(word)}`; {choice(word, known)}")
    return Part(place, ElementType(word), fields)


def _bonds(place: Spot, known: Mapping[str, object]) -> tuple[Bond, ...]:
    """Give the bonds of all chains `a -> b -> c`."""
    bonds: list[Bond] = []
    chains = place.items() if place.is_empty else place.one_or_more()
    for text, line in [(replace(item, words="a bond").text(), item.line) for item in chains]:
        ends = re.split(r"\s*->\s*", text)
        what = f"bond `{shown(text)}`: "
        for word in ends:
            if word in known:
                continue
            if not NAME.fullmatch(word):
                problem = f"`{shown(word)}` is not a name; write `a -> b -> c`, power flows along `->`"
                raise place.source.error(line, what + problem)
            near = closest(word, known) or "add it to `components` or `junctions`"
            raise place.source.error(line, f"{what}no component or junction `{shown(word)}`; {near}")
        if len(ends) < 2:
            raise place.source.error(line, f"{what}one part only; write `a -> b` or `a -> b -> c`")
        bonds.extend(Bond(tail=tail, head=head, line=line) for tail, head in pairwise(ends))
    return tuple(bonds)


def _check_bonds(source: Source, bonds: Sequence[Bond], parts: Mapping[str, Part]) -> None:
    """Check each bond by itself: its ends differ, it is stated once, and R, C and I receive power."""
    seen: dict[tuple[str, str], int] = {}
    for bond in bonds:
        arrow = f"bond `{bond.tail} -> {bond.head}`"
        tail, head = parts.get(bond.tail), parts.get(bond.head)
        if bond.tail == bond.head:
            raise source.error(bond.line, f"{arrow} joins a part to itself; a bond joins two parts")
        if (bond.tail, bond.head) in seen:
            first = f", first on line {seen[bond.tail, bond.head]}" if source.has_lines else ""
            raise source.error(bond.line, f"{arrow} stands twice{first}; remove one")
        seen[bond.tail, bond.head] = bond.line
        if tail and head and tail.type.is_source and head.type.is_source:
            raise source.error(bond.line, f"{arrow} joins two sources; put a junction or an element between them")
        if tail and not tail.type.is_source and tail.type.n_ports == 1:
            turned = f"write `{bond.head} -> {bond.tail}`"
            before = next((other.tail for other in bonds if other.head == bond.tail), None)
            if head and not head.type.is_source:
                turned = "put a junction between the two"
            elif before is not None:  # power does not flow through it
                chain = f"`{before} -> between -> {bond.head}, between -> {bond.tail}`"
                turned = f"it stands between {before} and {bond.head}: write {chain}, with a 1-junction `between`"
            raise source.error(bond.line, f"{arrow}: {tail.type.value} element {bond.tail} receives power; {turned}")


def _check_connected(source: Source, plant: Wiring) -> None:
    """Check that every part has the number of bonds that its type needs."""
    tails, heads = Counter(bond.tail for bond in plant.bonds), Counter(bond.head for bond in plant.bonds)
    for junction in plant.junctions.values():
        if not tails[junction.name] + heads[junction.name]:
            raise source.error(junction.line, f"junction {junction.name} has no bond; connect it under `bonds`")
    for part in plant.parts.values():
        n_in, n_out = heads[part.name], tails[part.name]
        if part.type.n_ports == 1 and n_in + n_out != 1:
            advice = "connect it under `bonds`" if n_in + n_out == 0 else "put a junction where several parts meet"
            found = "no bond" if n_in + n_out == 0 else f"{n_in + n_out} bonds"
            what = f"{part.type.value} element {part.name} has {found} and needs one"
            raise source.error(part.line, f"{what}; {advice}")
        if part.type.n_ports == 2 and (n_in, n_out) != (1, 1):
            what = f"{part.type.value} element {part.name} has {n_in} bonds in and {n_out} out and needs one of each"
            raise source.error(part.line, f"{what}; write `a -> {part.name} -> b`")
