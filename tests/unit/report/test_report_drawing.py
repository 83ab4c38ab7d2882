"""The drawing of a bond graph."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from fake import MOTOR_STROKES, TANK_STROKES, make_graph, motor_graph, tank_graph
from faultbond.equations.causality import assign_causality
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.report.drawing import boxes, draw, links
from faultbond.report.layout import place

SVG = "{http://www.w3.org/2000/svg}"


def long_plant(pairs: int) -> BondGraph:
    """Give a chain of pipes and tanks, a thin graph of 4 nodes per pair."""
    parts: dict[str, tuple[str, str, float, str]] = {"source": ("Se", "V", 1.0, "Pa")}
    junctions: dict[str, str] = {}
    chains = []
    before = "source"
    for k in range(pairs):
        junctions |= {f"line{k}": "1", f"node{k}": "0"}
        parts |= {f"pipe{k}": ("R", f"R{k}", 1.0, ""), f"tank{k}": ("C", f"C{k}", 1.0, "")}
        chains += [f"{before} line{k} node{k} tank{k}", f"line{k} pipe{k}"]
        before = f"node{k}"
    return make_graph("chain", parts, tuple(chains), junctions, ())


def net() -> BondGraph:
    """Give three tanks joined in a ring."""
    parts = {name: ("C" if name[0] == "T" else "R", f"k{name}", 1.0, "") for name in ("T1", "T2", "T3", "A", "B", "D")}
    chains = ("n1 T1", "n2 T2", "n3 T3", "a A", "b B", "d D", "n1 a n2 b n3 d n1")
    return make_graph("ring", parts, chains, {"n1": "0", "n2": "0", "n3": "0", "a": "1", "b": "1", "d": "1"}, ())


EXAMPLES = Path(__file__).parents[3] / "examples"
PLANTS = [tank_graph(), motor_graph(), net(), long_plant(4), long_plant(15)]


def classes(svg: str, name: str) -> list[ET.Element]:
    """Give the elements of that class."""
    return [item for item in ET.fromstring(svg).iter() if name in item.get("class", "").split()]  # noqa: S314


@pytest.fixture(scope="module", autouse=True)
def placed_once() -> Iterator[None]:
    """Lay each graph out once, for all that is drawn of it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("faultbond.report.drawing.place", cache(place))
        yield


@pytest.mark.parametrize("graph", PLANTS, ids=lambda graph: f"{graph.name}-{len(graph.bonds)}")
def test_labels_do_not_overlap_and_are_inside(graph: BondGraph) -> None:
    """No two labels share an area, and all lie inside the picture."""
    labels = boxes(graph)
    assert len(labels) == len(graph.components) + len(graph.junctions)
    assert not [(a.name, b.name) for a, b in combinations(labels.values(), 2) if a.overlaps(b)]
    root = ET.fromstring(draw(graph))  # noqa: S314
    _, _, width, height = map(float, root.get("viewBox", "").split())
    for box in labels.values():
        assert 0 <= box.x - box.width / 2 < box.x + box.width / 2 <= width
        assert 0 <= box.y - box.height / 2 < box.y + box.height / 2 <= height


@pytest.mark.parametrize(
    ("graph", "strokes"), [(tank_graph(), TANK_STROKES), (motor_graph(), MOTOR_STROKES)], ids=["tank", "motor"]
)
def test_every_bond_has_one_half_arrow_and_one_stroke(graph: BondGraph, strokes: dict[int, str]) -> None:
    """There are as many bonds, half arrows and causal strokes as the model has bonds; none without causality."""
    svg = draw(graph, strokes)
    for name in ("bond", "half-arrow", "causal-stroke"):
        assert len(classes(svg, name)) == len(graph.bonds), name
    assert not classes(draw(graph), "causal-stroke")


@pytest.mark.parametrize("file", sorted(EXAMPLES.glob("*/model.yaml")), ids=lambda file: file.parent.name)
def test_built_in_plants_are_drawn_with_their_causality(file: Path) -> None:
    """Each built-in plant gets one stroke per bond and labels that keep clear of each other."""
    graph = load_model(file)
    svg = draw(graph, dict(assign_causality(graph).strokes))
    assert len(classes(svg, "causal-stroke")) == len(graph.bonds)
    assert not [(a.name, b.name) for a, b in combinations(boxes(graph).values(), 2) if a.overlaps(b)]


def test_stroke_stands_at_the_node_that_receives_the_effort() -> None:
    """The stroke of each bond of the tank lies nearer to the named node than to the other."""
    graph, nodes = tank_graph(), boxes(tank_graph())
    for bond, stroke, k in zip(
        graph.bonds, classes(draw(graph, TANK_STROKES), "causal-stroke"), range(99), strict=False
    ):
        middle = [(float(stroke.get(f"{axis}1", "")) + float(stroke.get(f"{axis}2", ""))) / 2 for axis in "xy"]
        other = bond.tail if TANK_STROKES[k] == bond.head else bond.head
        near, far = (
            np.hypot(nodes[name].x - middle[0], nodes[name].y - middle[1]) for name in (TANK_STROKES[k], other)
        )
        assert near < far, bond


def test_suspects_are_coloured_by_probability() -> None:
    """The fill grows with the probability, and a legend explains it; without probabilities there is neither."""
    graph = tank_graph()
    svg = draw(graph, None, {"pipe": 0.9, "leak": 0.2})
    fills = {
        node.get("data-name"): float(heat.get("fill-opacity", "0"))
        for node in classes(svg, "node")
        for heat in node.iter(f"{SVG}rect")
        if heat.get("class") == "heat"
    }
    assert set(fills) == {"pipe", "leak"}
    assert fills["pipe"] > fills["leak"] > 0.0
    assert classes(svg, "legend")
    assert not classes(draw(graph), "legend")


@pytest.mark.parametrize("graph", PLANTS, ids=lambda graph: f"{graph.name}-{len(graph.bonds)}")
def test_bonds_do_not_cross_nor_run_over_labels(graph: BondGraph) -> None:
    """In plain plants no bond crosses another, and none runs over a label that is not its own."""
    nodes = boxes(graph)
    share = np.linspace(0.02, 0.98, 200)
    paths = {}
    for bond in graph.bonds:
        a, b = nodes[bond.tail], nodes[bond.head]
        paths[bond] = np.array([a.x, a.y]) + share[:, None] * np.array([b.x - a.x, b.y - a.y])
    for bond, path in paths.items():
        for box in nodes.values():
            inside = (abs(path[:, 0] - box.x) < box.width / 2) & (abs(path[:, 1] - box.y) < box.height / 2)
            assert box.name in (bond.tail, bond.head) or not inside.any(), (bond, box.name)
    for first, second in combinations(graph.bonds, 2):
        if not {first.tail, first.head} & {second.tail, second.head}:
            apart = np.linalg.norm(paths[first][:, None] - paths[second][None, :], axis=2)
            assert apart.min() > 5.0, (first, second)


def test_drawing_is_deterministic() -> None:
    """The same model gives the same picture."""
    assert draw(tank_graph(), TANK_STROKES) == draw(tank_graph(), TANK_STROKES)


def test_hostile_names_are_escaped() -> None:
    """Markup in a model name stays text."""
    root = ET.fromstring(draw(tank_graph("<script>&")))  # noqa: S314
    assert root.findtext(f"{SVG}title") == "Bond graph of <script>&"


def test_a_block_network_is_drawn_with_signals() -> None:
    """An arrow with two barbs leads from each block to each that reads a signal of it."""
    graph = load_model(EXAMPLES / "thesis" / "fig_6_13.yaml")
    assert links(graph) == (("A", "C"), ("B", "C"), ("A", "D"), ("B", "D"), ("A", "E"), ("C", "E"))
    picture = draw(graph, {}, {"E": 0.9})
    assert (len(classes(picture, "bond")), len(classes(picture, "half-arrow"))) == (6, 12)
    assert "<title>Block network of adders and multipliers</title>" in picture
    labels = boxes(graph)
    assert [box.title for box in labels.values()] == list("ABCDE")
    assert not [(a.name, b.name) for a, b in combinations(labels.values(), 2) if a.overlaps(b)]
