"""Static networks made at random: a fault that was made is found, and what is reported explains the observations."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.contract.findings import Detection, Diagnosis
from faultbond.equations.numeric import exact, numeric_value
from faultbond.io.grid import GridPoint
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.networks.detection import watch

FORMS = ("P{k}*{a}", "{a} + P{k}*{b}", "{a}*{b} + P{k}", "P{k}*{a}**2 - {b}", "{b} - P{k}*{a}", "P{k}*abs({a})")


@st.composite
def networks(draw: st.DrawFn) -> tuple[BondGraph, tuple[str, ...]]:
    """Give a network of two to four blocks, each with a parameter, one or two sensors, and its laws in causal order."""
    count = draw(st.integers(2, 4))
    signals = ["x1", "x2"]
    laws = []
    for k in range(count):
        form = draw(st.sampled_from(FORMS))
        a, b = draw(st.sampled_from(signals)), draw(st.sampled_from(signals))
        parameter = f"P{k}: {{nominal: {k + 1}, range: any}}"
        laws.append(f"b{k}: {{law: s{k} = {form.format(k=k, a=a, b=b)}, parameters: {{{parameter}}}}}")
        signals.append(f"s{k}")
    order = draw(st.permutations(laws))
    read = [signals[-1], *draw(st.lists(st.sampled_from(signals[2:-1]), max_size=1))]
    sensors = ", ".join(f"y{k}: {{reads: {name}}}" for k, name in enumerate(read))
    text = "\n  ".join(["sample_time: none\ninputs: {x1: {}, x2: {}}\nblocks:", *order]) + f"\nsensors: {{{sensors}}}\n"
    return parse_model(text), tuple(f"s{k}" for k in range(count))


def outputs(graph: BondGraph, order: Sequence[str], inputs: Sequence[int], changed: dict[str, int]) -> list[float]:
    """Give the readings of a network with changed parameters, law by law."""
    values = {item.name: Fraction(changed.get(item.name, int(item.nominal))) for item in graph.parameters}
    known = {**values, "x1": Fraction(inputs[0]), "x2": Fraction(inputs[1])}
    laws = {law.signal: law.right for block in graph.components for law in block.laws}
    for signal in order:
        known[signal] = exact(float(numeric_value(laws[signal], known)))
    return [float(numeric_value(item.reads, known)) for item in graph.sensors]


def observe(
    graph: BondGraph, order: Sequence[str], rows: Sequence[Sequence[int]], changed: dict[str, int]
) -> list[GridPoint]:
    """Give observations of a network with changed parameters."""
    return [
        GridPoint(
            index=k, time=float(k), dt=0.0, u=np.array(row, float), y=np.array(outputs(graph, order, row, changed))
        )
        for k, row in enumerate(rows)
    ]


rows_of_inputs = st.lists(st.tuples(st.integers(-4, 4), st.integers(1, 5)), min_size=1, max_size=4)


@given(networks(), rows_of_inputs, st.integers(0, 3), st.integers(-6, 6))
@settings(max_examples=60, deadline=None)
def test_a_single_fault_is_among_the_diagnoses(
    made: tuple[BondGraph, tuple[str, ...]], rows: list[tuple[int, int]], which: int, value: int
) -> None:
    """The parameter that was changed is reported with its value, after every row from the detection on."""
    graph, order = made
    name = graph.parameters[which % len(graph.parameters)].name
    records = list(watch(graph, observe(graph, order, rows, {name: value})))
    for item in records:
        if isinstance(item, Diagnosis):
            found = [
                suspect.estimate for one in item.candidates for suspect in one.suspects if one.parameters == (name,)
            ]
            assert any(abs(estimate - value) <= 1e-9 * abs(value) for estimate in found)


@given(networks(), rows_of_inputs, st.integers(-6, 6), st.integers(-6, 6))
@settings(max_examples=40, deadline=None)
def test_every_candidate_explains_every_row(
    made: tuple[BondGraph, tuple[str, ...]], rows: list[tuple[int, int]], first: int, second: int
) -> None:
    """The estimates of each candidate, put into the laws, give all readings since the detection."""
    graph, order = made
    points = observe(graph, order, rows, {"P0": first, "P1": second})
    records = list(watch(graph, points))
    if not records:
        return
    detection, last = records[0], records[-1]
    assert isinstance(detection, Detection)
    assert isinstance(last, Diagnosis)
    assert last.candidates  # the two that were changed, or fewer
    assert abs(sum(item.probability for item in last.candidates) - 1.0) < 1e-12
    for candidate in last.candidates:
        values = {suspect.parameter: suspect.estimate for suspect in candidate.suspects}
        changed = replace(
            graph,
            parameters=tuple(replace(item, nominal=values.get(item.name, item.nominal)) for item in graph.parameters),
        )
        for point in points[detection.sample :]:
            record = next(iter(watch(_loosened(changed), [point])), None)
            assert record is None


def _loosened(graph: BondGraph) -> BondGraph:
    """Give the network with the noise that the rounding of an estimate may make."""
    return replace(graph, sensors=tuple(replace(item, noise=1e-6) for item in graph.sensors))
