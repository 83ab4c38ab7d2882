"""The cheapest sensors of structures whose answer is known by hand."""

from collections.abc import Mapping

from benchmarks.shared import published

from faultbond.diagnosability.sensor_sets import SensorSets, sensor_sets
from faultbond.diagnosability.structural import StructuralModel

BOTH = published.structure("x | f1\ny | f2\nz x y")  # z shows both faults, x and y one each
APART = published.structure("x | f1\ny | f2\nw")


def found(model: StructuralModel, costs: Mapping[str, float], seconds: float = 1e6) -> SensorSets:
    """The sets of sensors that make all faults detectable."""
    by_place = {model.variable_names.index(name): cost for name, cost in costs.items()}
    return sensor_sets(model, by_place, isolate=False, seconds=seconds)


def named(model: StructuralModel, sets: SensorSets) -> list[str]:
    """The sets by name."""
    return [" ".join(model.variable_name(variable) for variable in item) for item in sets.sets]


def test_two_may_be_cheaper_than_one() -> None:
    """The search goes on beyond the fewest sensors while more of them could cost less."""
    dear = found(BOTH, {"x": 1, "y": 1, "z": 10})
    assert named(BOTH, dear) == ["x y", "z"]
    assert dear.cheapest
    assert named(BOTH, found(BOTH, {"x": 1, "y": 1, "z": 1})) == ["z"]


def test_a_search_that_is_cut_off() -> None:
    """Where there is no time for all sets, the first is called the cheapest only if nothing left out can be cheaper."""
    cut = found(BOTH, {"x": 1, "y": 1, "z": 10}, seconds=0.0)
    assert (named(BOTH, cut), cut.searched, cut.cheapest) == (["z"], 1, False)
    needed = found(APART, {"x": 1, "y": 1, "w": 1}, seconds=0.0)
    assert (named(APART, needed), needed.searched, needed.cheapest) == (["x y"], 1, True)
    dear = found(APART, {"x": 1, "y": 5, "w": 1}, seconds=0.0)
    assert (named(APART, dear), dear.cheapest) == (["x y"], False)


def test_open_variables() -> None:
    """A sensor that shows nothing by itself may fix what others are checked against."""
    model = published.structure("x y z | f")
    assert named(model, found(model, {"x": 1, "y": 1, "z": 1})) == ["x y z"]
    assert found(model, {"x": 1, "y": 1}).sets == ((),)  # it takes all three
