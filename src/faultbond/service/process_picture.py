"""A picture of the plant as its people know it: an SVG, of which the elements with names of the model are coloured."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path

from faultbond.errors import ModelError
from faultbond.model.document import read_document
from faultbond.model.graph import BondGraph
from faultbond.service.safe_svg import GROUPS, SHAPES, UNSEEN, safe_svg

NAMED = {*SHAPES, *GROUPS, "text"}  # elements that a name colours
MOST_LISTED = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessPicture:
    """A picture of a plant.

    file: where it is from. svg: what is shown, where `data-component` tells what is what. shows: names of the model
    that are in it. lacks: those that may be at fault and are not. strangers: ids that are no names of the model.
    dropped: what was left out, in words.
    """

    file: str
    svg: str
    shows: tuple[str, ...]
    lacks: tuple[str, ...]
    strangers: tuple[str, ...]
    dropped: tuple[str, ...]

    @property
    def tag(self) -> str:
        """What tells it from another one."""
        return sha256(self.svg.encode()).hexdigest()[:16]

    def content(self) -> dict[str, object]:
        """Give what is in it and what is not, for a record."""
        return {key: value for key, value in asdict(self).items() if key != "svg"}

    def told(self) -> str:
        """Say what is in it, and what is not."""
        parts = [f"picture {self.file} shows {len(self.shows)} names of the model: {_listed(self.shows)}"]
        told = (
            ("it lacks", self.lacks),
            ("ids that are no names of the model", self.strangers),
            ("left out for safety", self.dropped),
        )
        return "; ".join(parts + [f"{words}: {_listed(names)}" for words, names in told if names])


def read_process_picture(path: Path, graph: BondGraph) -> ProcessPicture:
    """Read the picture of a plant.

    Parameters
    ----------
    path : SVG, 1 MiB at most, of which ids are names of components, sensors and inputs
    graph : the plant

    Raises
    ------
    ModelError
        Where it cannot be read, is no SVG, or has no such id.
    """
    document = read_document(path, "picture", "simplify the drawing")
    found = safe_svg(document.text.removeprefix("\ufeff"), document.label)
    known = tuple(item.name for item in (*graph.components, *graph.instruments))
    ids = dict.fromkeys(_marked(found.root, set(known)))
    shows = tuple(name for name in known if name in ids)
    suspects = _suspects(graph)
    if not shows:
        raise ModelError(
            f"{document.label}: no id in it is a name of the model; give the elements of the drawing ids such as "
            f"{_listed(tuple(suspects) or known)}"
        )
    return ProcessPicture(
        file=document.label,
        svg=ET.tostring(found.root, encoding="unicode"),
        shows=shows,
        lacks=tuple(name for name in suspects if name not in ids),
        strangers=tuple(name for name in ids if name not in known),
        dropped=found.dropped,
    )


def _suspects(graph: BondGraph) -> dict[str, None]:
    """Give the names of what may be at fault: owners of suspect parameters, blocks, sensors and inputs."""
    owners = (item.owner for item in graph.parameters if item.suspect)
    return dict.fromkeys((*owners, *graph.suspect_blocks, *(item.name for item in graph.instruments if item.suspect)))


def _marked(parent: ET.Element, names: set[str]) -> Iterator[str]:
    """Put what has a name into a group that tells it, in which the page has room for the colour; give all ids."""
    for place, child in enumerate(parent):
        if child.tag in UNSEEN:
            continue
        if child.tag != "text":  # a name within a text has no shape
            yield from _marked(child, names)
        name = child.get("id")
        if name is None or child.tag not in NAMED:
            continue
        yield name
        if name in names:
            group = ET.Element("g", {"data-component": name})
            group.tail, child.tail = child.tail, None
            group.append(child)
            parent[place] = group


def _listed(names: tuple[str, ...]) -> str:
    """Give names in a line, the first of them where there are many."""
    more = len(names) - MOST_LISTED
    return ", ".join(names[:MOST_LISTED]) + (f" and {more} more" if more > 0 else "")
