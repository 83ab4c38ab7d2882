"""The Python builder: the same plant and the same checks as the file."""

from pathlib import Path

import pytest

from faultbond.errors import ModelError
from faultbond.model.builder import ModelBuilder
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"


def rc() -> ModelBuilder:
    """The RC circuit of the examples."""
    return (
        ModelBuilder("RC circuit", sample_time="0.02 s", max_faults=1, accuracy="3 %")
        .input("V", unit="V", noise="0.1 V")
        .component("source", "Se", law="e = V")
        .component("R", "R", parameters={"R": "10 kohm"})
        .component("C", "C", parameters={"C": "100 uF"})
        .junction("loop", 1)
        .bond("source -> loop -> R")
        .bond("loop -> C")
        .sensor("V_C", "C.e", unit="V", noise="0.1 V")
    )


def test_builder_gives_the_model_of_the_file() -> None:
    """Builder and file give the same canonical text."""
    assert rc().build().text == load_model(EXAMPLES / "rc" / "model.yaml").text


def test_equal_tanks_are_a_loop() -> None:
    """Four equal tanks in a row need one loop."""
    plant = ModelBuilder("four tanks", sample_time="1 s").input("Q", unit="l/min")
    plant.component("pump", "Sf", law="f = Q").bond("pump -> node1")
    for i in range(1, 5):
        plant.junction(f"node{i}", 0).component(f"tank{i}", "C", law=f"e = q/A{i}", parameters={f"A{i}": "0.1 m^2"})
        plant.component(f"leak{i}", "R", law=f"f = L{i}*e", parameters={f"L{i}": {"nominal": 1e-5, "suspect": i != 2}})
        plant.bond(f"node{i} -> tank{i}").bond(f"node{i} -> leak{i}").sensor(f"level{i}", f"node{i}.e", noise=0.001)
        if i > 1:
            plant.junction(f"pipe{i}", 1).bond(f"node{i - 1} -> pipe{i} -> node{i}")
            plant.component(f"drag{i}", "R", parameters={f"D{i}": "10 s/m^2"}).bond(f"pipe{i} -> drag{i}")
    graph = plant.slow_error("level1", "1 cm over 60 s", after=["Q"], each="0.1 cm/(l/min)").build()
    assert len(graph.bonds) == 1 + 4 * 2 + 3 * 3
    assert [item.suspect for item in graph.parameters if item.name.startswith("L")] == [True, False, True, True]
    again = parse_model(graph.text)
    assert [item.nominal for item in again.parameters] == [item.nominal for item in graph.parameters]
    assert again.text == graph.text


def test_errors_name_the_model() -> None:
    """Messages start with the model's name in place of file and line."""
    with pytest.raises(ModelError, match=r"^model RC circuit: sensor x: reads: unknown name `R2`"):
        rc().sensor("x", "C.e*R2", noise=1).build()


def test_adding_twice_is_an_error() -> None:
    """A name is added once."""
    with pytest.raises(ModelError, match=r"^model RC circuit: components: `R` is added twice"):
        rc().component("R", "R", parameters={"R2": 1})


def test_odd_values_are_refused() -> None:
    """A Python value that is no text, number, list or table is refused by type."""
    with pytest.raises(ModelError, match=r"inputs: x: a complex cannot stand here"):
        rc().input("x", noise=1j)  # type: ignore[arg-type]


def test_builder_settings() -> None:
    """Settings reach the graph."""
    plant = ModelBuilder("x", sample_time="variable", warm_up="5 s", time={"column": "t", "unit": "ms"})
    plant.constant("g", "9.81 m/s^2").component("body", "I", parameters={"m": "2 kg"}, start={"p": 0, "sd": 1})
    plant.component("weight", "Se", law="e = m*g").bond("weight -> body").sensor(
        "v", "body.f", noise="1 mm/s", unit="m/s"
    )
    graph = plant.build()
    assert (graph.warm_up, graph.time.unit.factor, graph.constants[0].value) == (5.0, 0.001, 9.81)
    assert graph.file == "model x"
