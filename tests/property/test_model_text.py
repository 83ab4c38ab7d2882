"""Random plants and networks survive the way text -> model -> text, and the order of their parts does not matter."""

import dataclasses
from typing import Any

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from strategies import ELEMENTS, LAWS, UNITS, Mapping, as_text, gates, networks, plants, shuffled

from faultbond.model.defaults import in_force
from faultbond.model.graph import BondGraph
from faultbond.model.text import dump_model, parse_model
from faultbond.types import ElementType

fast = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def plain(thing: Any, leave: tuple[str, ...] = ("line", "file", "text")) -> Any:
    """Give a graph as nested tuples without lines and file."""
    if dataclasses.is_dataclass(thing) and not isinstance(thing, type):
        kept = (field.name for field in dataclasses.fields(thing) if field.name not in leave)
        return (type(thing).__name__, *((name, plain(getattr(thing, name), leave)) for name in kept))
    return tuple(plain(item, leave) for item in thing) if isinstance(thing, tuple) else thing


def unordered(graph: BondGraph) -> Any:
    """Give a graph with all its lists sorted."""
    sorted_lists = {
        field.name: sorted(plain(getattr(graph, field.name)), key=repr)
        for field in dataclasses.fields(graph)
        if isinstance(getattr(graph, field.name), tuple) and field.name not in ("defaults", "correlations")
    }
    sorted_lists["correlations"] = sorted((sorted((item.one, item.other)), item.value) for item in graph.correlations)
    return sorted_lists, in_force(graph.defaults), graph.sample_time, graph.warm_up, plain(graph.time)


def test_every_element_has_a_strategy() -> None:
    """No element is left out of the random plants."""
    assert set(LAWS) == set(UNITS) == set(ELEMENTS) == set(ElementType) - {ElementType.BLOCK}


@given(plants() | networks() | gates())
@fast
def test_canonical_text_reads_back_as_the_same_graph(plant: Mapping) -> None:
    """The canonical text gives the same numbers to the last bit, the same laws and the same defaults."""
    graph = parse_model(as_text(plant))
    again = parse_model(dump_model(graph))
    assert plain(again) == plain(graph)
    assert again.text == graph.text == dump_model(graph)


@given((plants() | networks() | gates()).flatmap(lambda plant: st.tuples(st.just(plant), shuffled(plant))))
@fast
def test_order_of_entries_does_not_matter(pair: tuple[Mapping, Mapping]) -> None:
    """Sections and entries in another order give the same plant."""
    first, second = (parse_model(as_text(plant)) for plant in pair)
    assert unordered(first) == unordered(second)
