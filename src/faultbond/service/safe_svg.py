"""SVG from a drawing program as it may stand in a page: what is known of it, and nothing that runs or fetches.

What is not known to be harmless goes: a list of what is dangerous would be old the day after.
"""

import re
import xml.etree.ElementTree as ET  # document types with anything inside are refused before anything is parsed
from collections.abc import Iterator
from dataclasses import dataclass, field

from faultbond.errors import ModelError

SVG, XLINK = "http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"
MOST_NESTED = 100  # elements within each other
MOST_DRAWN = 50_000  # elements, where each that is used counts as often as that
SHAPES = ("path", "rect", "circle", "ellipse", "line", "polyline", "polygon")
GROUPS = ("svg", "g", "a", "switch", "use")
TEXTS = ("text", "tspan", "textPath", "title", "desc")
UNSEEN = ("defs", "symbol", "clipPath", "marker", "linearGradient", "radialGradient")
ELEMENTS = {*SHAPES, *GROUPS, *TEXTS, *UNSEEN, "stop", "style"}
REFERRING = ("use", "textPath", "linearGradient", "radialGradient")
PLACING = """
    id class viewBox preserveAspectRatio version x y x1 y1 x2 y2 cx cy r rx ry fx fy fr dx dy d points width height
    gradientUnits spreadMethod offset clipPathUnits markerUnits markerWidth markerHeight refX refY orient
    pathLength rotate textLength lengthAdjust startOffset
"""
LOOKS = """
    transform gradientTransform clip-path clip-rule color display visibility opacity
    fill fill-opacity fill-rule stroke stroke-width stroke-opacity stroke-dasharray stroke-dashoffset
    stroke-linecap stroke-linejoin stroke-miterlimit stop-color stop-opacity marker marker-start marker-mid marker-end
    font font-family font-size font-style font-variant font-weight font-stretch letter-spacing word-spacing line-height
    text-anchor text-align text-decoration dominant-baseline alignment-baseline baseline-shift
    paint-order vector-effect shape-rendering text-rendering white-space
"""
CALLS = """
    rgb rgba hsl hsla var calc light-dark
    matrix translate translatex translatey scale scalex scaley rotate skewx skewy
"""
ATTRIBUTES = frozenset(PLACING.split())
PROPERTIES = frozenset(LOOKS.split())  # of styles, and attributes, whose values are looked at, too
FUNCTIONS = frozenset(CALLS.split())  # that such values may call
EMPTY_TYPE = re.compile(r"""<!DOCTYPE\s+[^\s<>\[\]"']+(?:\s+(?:PUBLIC|SYSTEM)(?:\s+(?:"[^"]*"|'[^']*'))+)?\s*>""")
COMMENT = re.compile(r"/\*.*?(?:\*/|\Z)", re.DOTALL)
LOCAL_URL = re.compile(r"""url\(\s*["']?#[\w.:-]+["']?\s*\)""", re.IGNORECASE)
CALLED = re.compile(r"([\w-]*)\(")
SELECTOR = re.compile(r"[\w\s.#,>*-]+")
LENGTH = re.compile(r"\s*([0-9.]+)\s*(?:px)?\s*")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SafeSvg:
    """A drawing that may be shown. root: names without name spaces. dropped: what was left out, each once, in words."""

    root: ET.Element
    dropped: tuple[str, ...]


def safe_svg(text: str, label: str) -> SafeSvg:
    """Read a drawing, and leave out what is not known to be harmless.

    Parameters
    ----------
    text : of the file
    label : its name in messages

    Raises
    ------
    ModelError
        Where it is no SVG, has a document type with entities or more, or would draw too much.
    """
    root = _parsed(text, label)
    if root.tag != f"{{{SVG}}}svg":
        raise ModelError(f'{label}: no SVG; expected <svg xmlns="{SVG}">, as drawing programs save it')
    cleaning = _Cleaning()
    kept = cleaning.element(root, label)
    _scale(kept, label)
    _refuse_masses(kept, cleaning.dropped, label)
    kept.set("xmlns", SVG)
    return SafeSvg(root=kept, dropped=tuple(sorted(cleaning.dropped)))


def _parsed(text: str, label: str) -> ET.Element:
    """Parse XML; a document type that only names where it is told of is passed over, and any other refused."""
    named = EMPTY_TYPE.search(text)
    if named:
        text = text[: named.start()] + "\n" * named[0].count("\n") + text[named.end() :]
    for word in ("<!DOCTYPE", "<!ENTITY"):
        if word in text:
            line = text.count("\n", 0, text.find(word)) + 1
            raise ModelError(f"{label}:{line}: a document type with entities is not read; save it as plain SVG")
    try:
        return ET.fromstring(text)  # noqa: S314 - no entities left, see above
    except (ET.ParseError, ValueError) as problem:  # the latter where its encoding is none
        place = f":{problem.position[0]}" if isinstance(problem, ET.ParseError) else ""
        raise ModelError(f"{label}{place}: not XML: {problem}") from None


@dataclass(frozen=True, slots=True)
class _Cleaning:
    """Takes over what is harmless, and notes the rest."""

    dropped: set[str] = field(default_factory=set)

    def element(self, told: ET.Element, label: str, depth: int = 0) -> ET.Element:
        """Give an element that is known, with what is known of it."""
        if depth > MOST_NESTED:
            raise ModelError(f"{label}: more than {MOST_NESTED} elements within each other; ungroup some")
        name = _bare(told.tag)
        made = ET.Element(name, dict(self._attributes(told, name)))
        made.text, made.tail = told.text, told.tail
        if name == "style":
            made.text = "\n".join(self._rules(told.text or ""))
            return made
        for child in told:
            if child.tag in _KNOWN:
                made.append(self.element(child, label, depth + 1))
            else:
                self.dropped.add(_told(child.tag, "the element {}"))
        return made

    def _attributes(self, told: ET.Element, name: str) -> Iterator[tuple[str, str]]:
        for key, value in told.attrib.items():
            if key in ("href", f"{{{XLINK}}}href"):
                if name in REFERRING and value.startswith("#"):
                    yield "href", value
                else:
                    self.dropped.add("links")
            elif key == "style":
                yield key, self._declarations(value)
            elif key in ATTRIBUTES or (key in PROPERTIES and _is_harmless(value)):
                yield key, value
            else:
                self.dropped.add(_told(key, "the attribute {}"))

    def _rules(self, sheet: str) -> Iterator[str]:
        """Give the rules of a style sheet; those within others, as of media, go."""
        selector, body, depth, is_plain = "", "", 0, True
        for part in re.split(r"([{}])", COMMENT.sub(" ", sheet)):
            if part == "{":
                depth += 1
                is_plain = depth == 1
            elif part == "}":
                depth -= 1
                statement, _, selector = selector.rpartition(";")  # as `@import` before it
                if statement:
                    self.dropped.add("rules of styles")
                if depth == 0 and is_plain and SELECTOR.fullmatch(selector):
                    yield f"{selector.strip()}{{{self._declarations(body)}}}"
                elif depth <= 0:
                    self.dropped.add("rules of styles")
                    depth = 0
            elif depth == 0:
                selector = part
            else:
                body = part

    def _declarations(self, text: str) -> str:
        kept = []
        for declaration in filter(str.strip, COMMENT.sub(" ", text).split(";")):
            key, _, value = (part.strip() for part in declaration.replace("!important", "").partition(":"))
            if key.lower() in PROPERTIES and _is_harmless(value):
                kept.append(f"{key}:{value}")
            else:
                self.dropped.add(_told(key, "the style {}"))
        return ";".join(kept)


_KNOWN = {f"{{{SVG}}}{name}" for name in ELEMENTS}


def _is_harmless(value: str) -> bool:
    """Whether a value of a style is one that fetches nothing: it calls functions that are known, and points inside."""
    rest = LOCAL_URL.sub(" ", value)
    called = {name.lower() for name in CALLED.findall(rest)}
    return called <= FUNCTIONS | {""} and "\\" not in rest  # by which names are written in other ways


def _bare(name: str) -> str:
    return name.rpartition("}")[2]


def _told(name: str, words: str) -> str:
    """Say what goes; of what drawing programs note for themselves, in name spaces of theirs, that it is such."""
    foreign = name.startswith("{") and not name.startswith((f"{{{SVG}}}", f"{{{XLINK}}}"))
    return "notes of drawing programs" if foreign else words.format(_bare(name)[:40] or "without a name")


def _scale(root: ET.Element, label: str) -> None:
    """Let a drawing be as large as the room that it has, which takes a view box."""
    sizes = [LENGTH.fullmatch(root.attrib.pop(key, "")) for key in ("width", "height")]
    if "viewBox" not in root.attrib:
        if not all(sizes):
            raise ModelError(f"{label}: <svg> has no viewBox, and no width and height in px; save it with one")
        root.set("viewBox", " ".join(["0", "0", *(size[1] for size in sizes if size)]))


def _refuse_masses(root: ET.Element, dropped: set[str], label: str) -> None:
    """Let what is used not use anything itself, since that multiplies without end; and count what is drawn."""
    known = {item.get("id"): [part.tag for part in item.iter()] for item in root.iter() if item.get("id")}
    drawn = sum(1 for _ in root.iter())
    for use in root.iter("use"):
        inside = known.get(use.get("href", "").removeprefix("#"), [])
        if "use" in inside:
            del use.attrib["href"]
            dropped.add("uses of what uses others")
        else:
            drawn += len(inside)
    if drawn > MOST_DRAWN:
        raise ModelError(f"{label}: it draws {drawn} elements, and {MOST_DRAWN} are the most; leave some out")
