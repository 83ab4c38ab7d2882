"""From plants to structures: what is known of the examples by hand, and what is refused."""

from pathlib import Path

import pytest

from faultbond.diagnosability.classes import redundancy
from faultbond.diagnosability.isolability import Interpretation, isolability
from faultbond.diagnosability.structural import StructuralModel, structural_model
from faultbond.equations.causality import assign_causality
from faultbond.equations.constraint_network import build_network
from faultbond.errors import StructureError
from faultbond.model.text import load_model

EXAMPLES = Path(__file__).parents[3] / "examples"


def example(folder: str, *parameters: str) -> StructuralModel:
    """The structure of an example, with faults of all its suspects or of those given."""
    graph = load_model(EXAMPLES / folder / "model.yaml")
    suspects = parameters or tuple(item.name for item in graph.parameters if item.suspect)
    return structural_model(build_network(graph, assign_causality(graph)), suspects)


def groups(model: StructuralModel) -> set[str]:
    """Faults that cannot be told apart, by name."""
    found = isolability(model)
    assert found.detectable.all()
    return {
        " ".join(name for name, apart in zip(model.fault_names, row, strict=True) if not apart)
        for row in found.isolable
    }


def test_one_sensor_finds_every_fault_of_the_motor() -> None:
    """With the speed alone there is one test, so all faults show and none is told from another."""
    motor = example("dc_motor")
    assert redundancy(motor.equations, motor.n_variables) == 1
    assert groups(motor) == {"R L K J C"}


def test_the_current_splits_the_motor() -> None:
    """With the current measured as well, the electrical and the mechanical side are two tests; K stands in both."""
    motor = example("dc_motor_current")
    assert redundancy(motor.equations, motor.n_variables) == 2
    assert groups(motor) == {"R L", "K", "J C"}


def test_tank() -> None:
    """Flow and pressure of the thesis' tank: inlet, line and tank are three groups."""
    assert groups(example("tank")) == {"K8 K1 K7", "K2", "K3 K4 K6"}


@pytest.mark.parametrize("interpretation", Interpretation)
def test_bond_graph_plants_are_checked_either_way(interpretation: Interpretation) -> None:
    """The faults of motor and tank are detectable with integration only and with differentiation only."""
    for folder in ("dc_motor_current", "tank"):
        assert isolability(example(folder), interpretation).detectable.all()


def test_a_parameter_of_two_laws_has_its_own_equation() -> None:
    """The constant K of the motor stands in two laws and becomes an unknown; R stands in one and does not."""
    motor = example("dc_motor_current")
    fault = dict(zip(motor.fault_names, motor.faults, strict=True))
    assert motor.equation_names[fault["K"]] == "K"
    assert [motor.variable_name(variable) for variable in motor.equations[fault["K"]]] == ["K"]
    assert motor.equation_names[fault["R"]] == "R"
    assert "R" not in motor.variable_names
    assert sum(motor.variable_names.index("K") in variables for variables in motor.equations) == 3


def test_stores_are_differential() -> None:
    """Each store has an equation of its rate and its quantity, in order."""
    motor = example("dc_motor")
    named = [(motor.variable_name(rate), motor.variable_name(quantity)) for _, rate, quantity in motor.differentials]
    assert [quantity for _, quantity in named] == ["L.p", "J.p"]
    assert all(set(motor.equations[equation]) == {rate, quantity} for equation, rate, quantity in motor.differentials)


def test_a_plant_without_sensors_is_just_determined() -> None:
    """What is left of a plant without its sensors determines every variable and has nothing to spare."""
    tank = example("tank")
    kept = [
        variables
        for variables, name in zip(tank.equations, tank.equation_names, strict=True)
        if not name.startswith("sensor")
    ]
    assert len(kept) == tank.n_variables
    assert redundancy(kept, tank.n_variables) == 0


def test_unused_parameters_are_refused() -> None:
    """A fault of a parameter that no law contains is refused by its name."""
    with pytest.raises(StructureError, match="Q stands in no law and no reading"):
        example("dc_motor", "R", "Q")


def test_wrong_indices_are_refused() -> None:
    """Indices that point at nothing are refused."""
    with pytest.raises(StructureError, match="variable outside 0 to 0"):
        StructuralModel(equations=((0, 1),), n_variables=1)
    with pytest.raises(StructureError, match="enters an equation outside 0 to 0"):
        StructuralModel(equations=((0,),), n_variables=1, faults=(1,))
    with pytest.raises(StructureError, match="equation 0 is differential, but contains other variables"):
        StructuralModel(equations=((0, 1, 2),), n_variables=3, differentials=((0, 0, 1),))


def test_variables_without_names() -> None:
    """A variable without a name is called by its number, from 1."""
    assert StructuralModel(equations=((0,),), n_variables=1).variable_name(0) == "x1"
