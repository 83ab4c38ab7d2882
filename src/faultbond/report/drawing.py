"""The bond graph as SVG: half arrows for power, strokes for causality, suspects coloured by probability.

A block network is drawn with an arrow from each block to those that read its signals.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from html import escape

from faultbond.model.expression import names
from faultbond.model.graph import BondGraph, Component
from faultbond.report.layout import place
from faultbond.types import ElementType

CHARACTER = 8.9  # px, width of an average character of a title at 14 px; generous
SMALL_CHARACTER = 7.2
LONGEST = 18  # characters of a label line; longer ones are cut
BOX_HEIGHT = 40.0
SPACE_ACROSS = 64.0  # between boxes, room for arrow and stroke
SPACE_DOWN = 52.0
MARGIN = 16.0
GAP = 3.0  # between a box and the end of its bond
BARB = 12.0
STROKE = 9.0  # half the length of a causal stroke
LEGEND_HEIGHT = 52.0
STRONGEST = 0.85  # opacity of the colour at probability 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """The label of a node in px: centre, size, and its two lines of text."""

    name: str
    x: float
    y: float
    width: float
    height: float
    title: str
    subtitle: str
    junction: bool

    def overlaps(self, other: "Box") -> bool:
        """Tell whether two labels share an area."""
        across = abs(self.x - other.x) < (self.width + other.width) / 2.0
        return across and abs(self.y - other.y) < (self.height + other.height) / 2.0

    def border(self, x: float, y: float, gap: float) -> tuple[float, float]:
        """Give where the line from the centre towards (x, y) leaves the box widened by `gap`."""
        dx, dy = x - self.x, y - self.y
        reach = min(
            (self.width / 2.0 + gap) / abs(dx) if dx else math.inf,
            (self.height / 2.0 + gap) / abs(dy) if dy else math.inf,
        )
        return self.x + dx * reach, self.y + dy * reach


def boxes(graph: BondGraph) -> dict[str, Box]:
    """Give the labels of all nodes at their places, by name."""
    titles = {item.name: (_title(item), ", ".join(item.parameters)) for item in graph.components}
    junctions = {item.name: (item.type.value, item.name) for item in graph.junctions}
    texts = {name: (_cut(title), _cut(subtitle)) for name, (title, subtitle) in {**titles, **junctions}.items()}
    cells = place(tuple(texts), links(graph))
    widths = {
        name: max(44.0, CHARACTER * len(title) + 18.0, SMALL_CHARACTER * len(subtitle) + 18.0)
        for name, (title, subtitle) in texts.items()
    }
    centres = _column_centres(cells, widths)
    return {
        name: Box(
            name=name,
            x=centres[column],
            y=MARGIN + BOX_HEIGHT / 2.0 + row * (BOX_HEIGHT + SPACE_DOWN),
            width=widths[name],
            height=BOX_HEIGHT,
            title=texts[name][0],
            subtitle=texts[name][1],
            junction=name in junctions,
        )
        for name, (column, row) in cells.items()
    }


def links(graph: BondGraph) -> tuple[tuple[str, str], ...]:
    """Give what joins the nodes, (tail, head): bonds; in a block network from each block to those that read of it."""
    if not graph.is_block_network:
        return tuple((bond.tail, bond.head) for bond in graph.bonds)
    owned = {item.name: {*(law.signal for law in item.laws), *item.signals} for item in graph.components}
    owners = {signal: block for block, signals in owned.items() for signal in signals if signal is not None}
    pairs = dict.fromkeys(
        (owners[name], item.name)
        for item in graph.components
        for law in item.laws
        for name in (*names(law.left), *names(law.right))
        if owners.get(name, item.name) != item.name
    )
    return tuple(pairs)


def draw(
    graph: BondGraph, strokes: Mapping[int, str] | None = None, probabilities: Mapping[str, float] | None = None
) -> str:
    """Give the bond graph as SVG text, fit for a page or a file of its own.

    Parameters
    ----------
    graph : the plant
    strokes : for each bond, by its index, the node at which its causal stroke stands: the one that receives the
        effort; None: none are drawn
    probabilities : for each component the probability that it changed; None: no colours and no legend
    """
    nodes = boxes(graph)
    width = max((box.x + box.width / 2.0 for box in nodes.values()), default=0.0) + MARGIN
    height = max((box.y + box.height / 2.0 for box in nodes.values()), default=0.0) + MARGIN
    sides = (1.0, -1.0) if graph.is_block_network else (1.0,)
    parts = [_bond(nodes, tail, head, (strokes or {}).get(k), sides) for k, (tail, head) in enumerate(links(graph))]
    parts += [_node(box, (probabilities or {}).get(box.name, 0.0)) for box in nodes.values()]
    if probabilities is not None:
        parts.append(_legend(height))
        width, height = max(width, 292.0), height + LEGEND_HEIGHT
    title = f"<title>{graph_title(graph)} of {escape(graph.name)}</title>"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="bond-graph" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" role="img">{title}<style>{STYLE}</style>{"".join(parts)}</svg>'
    )


def graph_title(graph: BondGraph) -> str:
    """Give the heading of a drawing."""
    return "Block network" if graph.is_block_network else "Bond graph"


def _title(item: Component) -> str:
    return item.name if item.type is ElementType.BLOCK else f"{item.type.value}:{item.name}"


STYLE = """
.bond-graph{font-family:system-ui,"Segoe UI","Helvetica Neue",Arial,"DejaVu Sans",sans-serif;font-size:14px}
.bond-graph text{fill:var(--ink,#16202b);text-anchor:middle}
.bond-graph .name{font-weight:600}.bond-graph .more{font-size:12px;fill:var(--soft,#51606f)}
.bond-graph .paper{fill:var(--panel,#ffffff)}.bond-graph .heat{fill:var(--suspect,#f07b2f)}
.bond-graph .frame{fill:none;stroke:var(--rule,#b9c4ce)}.bond-graph .junction .frame{stroke:var(--ink,#16202b)}
.bond-graph .suspect .more{fill:var(--ink,#16202b)}.bond-graph .suspect .frame{stroke:var(--suspect-edge,#b4490b)}
.bond-graph .bond,.bond-graph .half-arrow{stroke:var(--ink,#16202b);stroke-width:1.5;fill:none;stroke-linecap:round}
.bond-graph .causal-stroke{stroke:var(--ink,#16202b);stroke-width:2.6}
""".replace("\n", "")


def _column_centres(cells: Mapping[str, tuple[int, int]], widths: Mapping[str, float]) -> dict[int, float]:
    """Give the x of each grid column, as wide as its widest label."""
    widest: dict[int, float] = {}
    for name, (column, _) in cells.items():
        widest[column] = max(widest.get(column, 0.0), widths[name])
    centres, left = {}, MARGIN
    for column in sorted(widest):
        centres[column] = left + widest[column] / 2.0
        left += widest[column] + SPACE_ACROSS
    return centres


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def _bond(nodes: Mapping[str, Box], tail: str, head: str, stroke: str | None, sides: tuple[float, ...]) -> str:
    """Draw one bond with its half arrow, of a signal with a whole one, and its causal stroke if known."""
    a, b = nodes[tail], nodes[head]
    x1, y1 = a.border(b.x, b.y, GAP)
    x2, y2 = b.border(a.x, a.y, GAP)
    length = max(math.hypot(x2 - x1, y2 - y1), 1e-9)
    ux, uy = (x2 - x1) / length, (y2 - y1) / length
    text = _line("bond", (x1, y1), (x2, y2))
    for side in sides:
        off = (
            -0.6 * side if ux < -0.5 else 0.6 * side
        )  # the barb of a bond to the left stands above it, like all others
        barb = (x2 + BARB * (-0.9 * ux + off * uy), y2 + BARB * (-0.9 * uy - off * ux))
        text += _line("half-arrow", (x2, y2), barb)
    if stroke in (tail, head):
        x, y = (x1, y1) if stroke == tail else (x2, y2)
        text += _line("causal-stroke", (x - STROKE * uy, y + STROKE * ux), (x + STROKE * uy, y - STROKE * ux))
    return f"<g>{text}</g>"


def _line(kind: str, start: tuple[float, float], end: tuple[float, float]) -> str:
    (x1, y1), (x2, y2) = start, end
    return f'<line class="{kind}" x1="{x1:.1f}" y1="{y1:.1f}" x2="{x2:.1f}" y2="{y2:.1f}"/>'


def _node(box: Box, probability: float) -> str:
    """Draw one label, filled by the probability that the component changed."""
    round_off = BOX_HEIGHT / 2.0 if box.junction else 6.0
    area = (
        f'x="{box.x - box.width / 2.0:.1f}" y="{box.y - box.height / 2.0:.1f}" width="{box.width:.1f}" '
        f'height="{box.height:.1f}" rx="{round_off:.0f}"'
    )
    kinds = ["node", *(["junction"] if box.junction else []), *(["suspect"] if probability >= 0.05 else [])]
    shift = 4.5 if not box.subtitle else -2.0
    hint = f"<title>{escape(box.name)}: {100.0 * probability:.1f} %</title>" if probability > 0.0 else ""
    heat = f'<rect class="heat" {area} fill-opacity="{STRONGEST * probability:.3f}"/>' if probability >= 0.005 else ""
    return (
        f'<g class="{" ".join(kinds)}" data-name="{escape(box.name)}">{hint}<rect class="paper" {area}/>{heat}'
        f'<rect class="frame" {area}/>{_text("name", box.x, box.y + shift, box.title)}'
        + (_text("more", box.x, box.y + 14.0, box.subtitle) if box.subtitle else "")
        + "</g>"
    )


def _text(kind: str, x: float, y: float, text: str) -> str:
    return f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}">{escape(text)}</text>'


def _legend(top: float) -> str:
    """Draw the colour scale."""
    steps: Iterable[int] = range(10)
    bars = "".join(
        f'<rect class="heat" x="{MARGIN + 26.0 * k:.0f}" y="{top + 8.0:.0f}" width="26" height="10" '
        f'fill-opacity="{STRONGEST * (k + 0.5) / 10.0:.3f}"/>'
        for k in steps
    )
    frame = f'<rect class="frame" x="{MARGIN}" y="{top + 8.0:.0f}" width="260" height="10"/>'
    texts = "".join(
        f'<text class="more" x="{x:.0f}" y="{top + 34.0:.0f}" style="text-anchor:{anchor}">{text}</text>'
        for x, anchor, text in (
            (MARGIN, "start", "0 %"),
            (MARGIN + 130.0, "middle", "probability of a change"),
            (MARGIN + 260.0, "end", "100 %"),
        )
    )
    return f'<g class="legend">{bars}{frame}{texts}</g>'
