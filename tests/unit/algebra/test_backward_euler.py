"""Records by backward Euler satisfy every equation, exactly where that is possible."""

from fractions import Fraction
from pathlib import Path

import pytest
from solved import EXAMPLES, example, static

from faultbond.algebra.solving.backward_euler import (
    FrameRecord,
    NumericPlant,
    frame_blocks,
    misfit,
    newton,
    plant_of,
    random_inputs,
    simulate_frames,
)
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.equations.numeric import Real
from faultbond.errors import StructureError
from faultbond.model.expression import names
from faultbond.model.parser import parse_expression
from faultbond.model.text import parse_model

# A long chain; a plant without inputs, of which a record is made; empty tanks, where roots have no slope.
WITHOUT = ("pipe", "skab", "dts200")
FOLDERS = sorted(path.parent.name for path in EXAMPLES.glob("*/model.yaml") if path.parent.name not in WITHOUT)


def at(network: ComponentNetwork, plant: NumericPlant, record: FrameRecord, position: int) -> dict[str, Real]:
    """All values of one frame, those of the frame before as `x@1`."""
    values: dict[str, Real] = {**plant.values, "dt": plant.sample_time}
    for signal in network.signals:
        values[signal] = record[signal][position]
        values[f"{signal}@1"] = record[signal][position - 1]
    return values


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_equation_holds(folder: str) -> None:
    """Every equation of every frame is satisfied by the record of an example."""
    network, plant = example(folder)
    inputs = random_inputs(plant, 5, seed=2)
    record = simulate_frames(network, plant.values, inputs, plant.sample_time)
    residuals = [item.residual for item in network.equations]
    assert all(misfit(residuals, at(network, plant, record, k)) < 1e-9 for k in range(1, 5))
    assert all(record[name] == tuple(values) for name, values in inputs.items()) or not _is_exact(record)


def _is_exact(record: FrameRecord) -> bool:
    return all(isinstance(value, Fraction | int) for series in record.values() for value in series)


def test_linear_plants_are_exact() -> None:
    """The motor's record is of fractions, the tank's, with its squares, of floating point."""
    for folder, exact in (("dc_motor", True), ("rlc", True), ("tank", False)):
        network, plant = example(folder)
        assert (
            _is_exact(simulate_frames(network, plant.values, random_inputs(plant, 3, seed=0), plant.sample_time))
            is exact
        )


def test_start_is_taken() -> None:
    """A capacitor without current keeps its voltage."""
    network, plant = example("rc")
    record = simulate_frames(network, plant.values, {"V": [Fraction(7)]}, plant.sample_time, {"V_C": Fraction(7)})
    assert record["V_C"] == (7,)
    assert record["loop.f"] == (0,)


def test_derivative_causality(tmp_path: Path) -> None:
    """Two inductors in series share their current; the record satisfies both laws."""
    text = """
name: two coils
sample_time: 0.5 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  L1: {type: I, parameters: {L1: 2 H}}
  L2: {type: I, parameters: {L2: 3 H}}
  R: {type: R, parameters: {R: 1 ohm}}
junctions: {loop: 1}
bonds: [source -> loop -> L1, loop -> L2, loop -> R]
sensors: {i: {reads: loop.f, unit: A, noise: 1 A}}
"""
    graph = parse_model(text)
    network = build_components(graph, build_network(graph, assign_causality(graph)))
    record = simulate_frames(network, plant_of(graph).values, {"V": [Fraction(11)]}, Fraction(1, 2))
    assert record["i"] == (Fraction(1),)  # 11 = i + 5 i / 0.5


def test_superfluous_equations_are_named() -> None:
    """A network with an equation too many says which, and which signal stays open."""
    network, plant = static({"a": "x - u", "b": "x - 2*u", "c": "y - w"}, ["u"], ["y"], {})
    with pytest.raises(StructureError, match="equations too many: b; signals left open: w"):
        simulate_frames(network, plant.values, {"u": [1.0]}, 1.0)


def test_no_solution_is_named() -> None:
    """A law that no number satisfies names the signal."""
    network, plant = static({"law": "x**2 + u"}, ["u"], ["x"], {})
    with pytest.raises(StructureError, match="no value found for x"):
        simulate_frames(network, plant.values, {"u": [1.0]}, 1.0)


def test_blocks_come_in_order() -> None:
    """A block uses only signals of blocks before it."""
    network, _ = example("tank")
    known: set[str] = set(network.inputs)
    for block in frame_blocks(network):
        known |= set(block.signals)
        used = {name for residual in block.residuals for name in names(residual)} & set(network.signals)
        assert used <= known


def test_inputs_stay_in_their_range() -> None:
    """Percent stays within 20 and 80, other inputs within 1 and 10 of their unit; with signs where that makes sense."""
    _, tank = example("tank")
    inputs = random_inputs(tank, 50, seed=1, signed=True)
    assert all(20 <= value <= 80 for series in inputs.values() for value in series)
    _, motor = example("dc_motor")
    volts = random_inputs(motor, 50, seed=1, signed=True)["V"]
    assert min(volts) < 0 < max(volts)
    assert all(1 <= abs(value) <= 10 for value in volts)
    assert random_inputs(motor, 50, seed=1) == random_inputs(motor, 50, seed=1)


def test_newton_from_afar() -> None:
    """Steps are halved where whole ones would overshoot: atan-like laws converge from far away."""
    found = newton((parse_expression("tanh(x) - 0.5"),), {}, {"x": 2.5})
    assert found is not None
    assert float(found["x"]) == pytest.approx(0.5493061443340549)
    assert newton((parse_expression("x**2 + 1"),), {}, {"x": 1.0}) is None
