"""Where sensors are to be placed, for models whose answer is known by hand or published."""

import pytest
from benchmarks.shared import published

from faultbond.diagnosability.placement import sensors_to_detect, sensors_to_isolate
from faultbond.diagnosability.structural import StructuralModel
from faultbond.errors import StructureError

# x follows from a, y from x, z from x
TREE = "x | f1\nx y | f2\nx z | f3"


def named(model: StructuralModel, sets: tuple[tuple[int, ...], ...]) -> list[str]:
    """Sets of variables by name."""
    return [" ".join(sorted(model.variable_names[variable] for variable in sensors)) for sensors in sets]


def places(model: StructuralModel, names: str) -> list[int]:
    """Variables by name."""
    return [model.variable_names.index(name) for name in names.split()]


def test_detection_needs_a_sensor_behind_each_fault() -> None:
    """Sensors at the two ends of a tree check all of it; one at the root does not."""
    model = published.structure(TREE)
    assert named(model, sensors_to_detect(model)) == ["y z"]


def test_isolation_needs_more() -> None:
    """Two sensors at the ends of a tree tell its three faults apart; in a chain each variable needs one."""
    model = published.structure(TREE)
    assert named(model, sensors_to_isolate(model)) == ["y z"]
    chain = published.structure("x | f1\nx y | f2\ny z | f3")
    assert named(chain, sensors_to_detect(chain)) == ["z"]
    assert named(chain, sensors_to_isolate(chain)) == ["x y z"]


def test_only_pairs_that_matter() -> None:
    """Where only the first two faults are to be told apart, a sensor between them and one at the end are enough."""
    chain = published.structure("x | f1\nx y | f2\ny z | f3")
    assert named(chain, sensors_to_isolate(chain, pairs=[(1, 0)])) == ["x z"]


def test_places_limit_what_can_be_had() -> None:
    """What no allowed sensor checks is left out, and the rest is served."""
    model = published.structure(TREE)
    assert named(model, sensors_to_detect(model, places(model, "x y"))) == ["y"]
    assert named(model, sensors_to_isolate(model, places(model, "x y"))) == ["x y"]
    assert sensors_to_detect(model, []) == ((),)


def test_nothing_to_gain() -> None:
    """Where all faults are isolable already, no sensor is the smallest set."""
    model = published.structure("x | f1\nx | f2\nx")
    assert sensors_to_isolate(model) == ((),)


def test_largest_number_of_sensors() -> None:
    """Sets larger than wanted are not given."""
    chain = published.structure("x | f1\nx y | f2\ny z | f3")
    assert sensors_to_isolate(chain, max_sensors=2) == ()
    assert named(chain, sensors_to_isolate(chain, max_sensors=3)) == ["x y z"]


def test_faulty_sensors_are_doubled() -> None:
    """A sensor that can fail is told from the fault that it shows only by a second one."""
    model = published.structure("x | f1")
    assert named(model, sensors_to_isolate(model)) == ["x"]
    assert named(model, sensors_to_isolate(model, faulty=[0])) == ["x x"]


def test_undetermined_variables_are_named() -> None:
    """A model that leaves variables open is refused by their names."""
    model = published.structure("x | f1\ny z")
    with pytest.raises(StructureError, match="these are open: y, z; add the equations"):
        sensors_to_detect(model)


def test_commault() -> None:
    """The two smallest sets for Commault's example are those published."""
    model = published.structure(published.COMMAULT)
    assert named(model, sensors_to_isolate(model)) == ["x5 x6", "x6 x7"]


def test_five_states() -> None:
    """The linear model of five states has the sets of Krysander and Frisk, also where the new sensors can fail."""
    model = published.structure(published.FIVE_STATES)
    states = places(model, "x1 x2 x3 x4 x5")
    assert named(model, sensors_to_detect(model, states)) == ["x1", "x2", "x3 x4"]
    assert set(named(model, sensors_to_isolate(model, states))) == {"x1 x3", "x1 x4", "x2 x3", "x2 x4", "x3 x4"}
    assert len(sensors_to_isolate(model, states, faulty=states)) == 9
