"""Components, junctions and bonds: names, types, and whether everything is connected as its type needs."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from faultbond.model.elements import OWN_SIGNALS
from faultbond.model.graph import Bond, Junction
from faultbond.model.source import NAME, Entry, Node, Source, Text, choice, closest, shown
from faultbond.types import ElementType, JunctionType

MAX_PARTS = 2000
COMPONENT_KEYS = ("type", "law", "parameters", "start")


@dataclass(frozen=True, slots=True)
class Part:
    """A component or block before its laws are read."""

    name: str
    type: ElementType
    fields: Mapping[str, Entry]
    line: int

    @property
    def title(self) -> str:
        """Its name with the word for what it is, for messages."""
        return f"{'block' if self.type is ElementType.BLOCK else 'component'} {self.name}"


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


def wiring(source: Source, fields: Mapping[str, Entry]) -> Wiring:
    """Read `components`, `junctions` and `bonds`."""
    components = source.table(fields["components"].value, "components").entries if "components" in fields else ()
    junctions = source.table(fields["junctions"].value, "junctions").entries if "junctions" in fields else ()
    if len(components) + len(junctions) > MAX_PARTS:
        n_parts = f"{len(components)} components and {len(junctions)} junctions"
        place = fields["components"] if components else fields["junctions"]
        raise source.error(place, f"{n_parts}; at most {MAX_PARTS} together are read. Split the plant")
    if not components:
        raise source.error(
            fields.get("components") or 0,
            "no components; state them, such as `components: {pump: {type: Se, law: e = V}}`",
        )
    parts = {part.name: part for part in (_part(source, entry) for entry in components)}
    nodes = {junction.name: junction for junction in (_junction(source, entry) for entry in junctions)}
    for name in nodes.keys() & parts.keys():
        other = f" (also {source.at(parts[name].line).rstrip(': ')})" if source.has_lines else ""
        raise source.error(nodes[name].line, f"`{name}` is both a junction and a component{other}; rename one")
    result = Wiring(parts, nodes, _bonds(source, fields, parts, nodes))
    _check_connected(source, result)
    return result


def _part(source: Source, entry: Entry) -> Part:
    name = source.name(entry, "components")
    what = f"component {name}"
    fields = source.fields(entry.value, what, COMPONENT_KEYS)
    known = [item.value for item in OWN_SIGNALS]
    if "type" not in fields:
        raise source.error(entry, f"{what}: `type` is missing; it is one of {', '.join(known)}")
    word = source.text(fields["type"].value, f"{what}: type")
    if word not in known:
        raise source.error(fields["type"], f"{what}: unknown type `{shown(word)}`; {choice(word, known)}")
    return Part(name, ElementType(word), fields, entry.line)


def _junction(source: Source, entry: Entry) -> Junction:
    name = source.name(entry, "junctions")
    word = source.text(entry.value, f"junction {name}")
    if word not in ("0", "1"):
        raise source.error(
            entry, f"junction {name}: unknown type `{shown(word)}`; it is 0 (one effort) or 1 (one flow)"
        )
    return Junction(name=name, type=JunctionType(word), line=entry.line)


def _bonds(
    source: Source, fields: Mapping[str, Entry], parts: Mapping[str, Part], nodes: Mapping[str, Junction]
) -> tuple[Bond, ...]:
    if "bonds" not in fields:
        raise source.error(0, "no bonds; state them, such as `bonds: [pump -> line -> pipe]`")
    bonds: list[Bond] = []
    for node in _chains(source, fields["bonds"].value):
        names = [_end(source, node, word, (parts, nodes)) for word in re.split(r"\s*->\s*", node.value.strip())]
        if len(names) < 2:
            raise source.error(node, f"bond `{shown(node.value)}`: one part only; write `a -> b` or `a -> b -> c`")
        pairs = pairwise(names)
        bonds.extend(Bond(tail=tail, head=head, line=node.line) for tail, head in pairs)
    _check_bonds(source, bonds, parts)
    return tuple(bonds)


def _chains(source: Source, node: Node) -> tuple[Text, ...]:
    items = source.items(node, "bonds") if not isinstance(node, Text) or not node.value.strip() else (node,)
    return tuple(Text(source.text(item, "a bond"), item.line) for item in items)


def _end(source: Source, node: Text, word: str, known: tuple[Mapping[str, Part], Mapping[str, Junction]]) -> str:
    if word in known[0] or word in known[1]:
        return word
    what = f"bond `{shown(node.value)}`: "
    if not NAME.fullmatch(word):
        raise source.error(node, f"{what}`{shown(word)}` is not a name; write `a -> b -> c`, power flows along `->`")
    near = closest(word, [*known[0], *known[1]]) or "add it to `components` or `junctions`"
    raise source.error(node, f"{what}no component or junction `{shown(word)}`; {near}")


def _check_bonds(source: Source, bonds: list[Bond], parts: Mapping[str, Part]) -> None:
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
            if head and not head.type.is_source:
                turned = "put a junction between the two"
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
