"""A change of less than what is not known of a parameter is told as that, and not as a fault."""

from dataclasses import replace
from functools import cache

import pytest

from faultbond.contract.findings import Diagnosis
from faultbond.equations.plant import build_plant
from faultbond.simulate import Fault
from faultbond.synthesis.engine import build_core
from made import graph_of, recorded, run, spec_of

ROWS, NAME = 900, "dc_motor_current"


@cache
def ended(accuracy: float, change: float) -> Diagnosis:
    """The diagnosis at the end, of a motor whose R changes by this part and of which it is known to that."""
    spec = spec_of(NAME)
    known = tuple(replace(item, accuracy=accuracy) if item.name == "R" else item for item in spec.parameters)
    core = build_core(build_plant(graph_of(NAME)), replace(spec, parameters=known))
    monitor = run(core, recorded(NAME, ROWS, Fault(parameter="R", factor=1.0 + change, start=6.0)))[0]
    assert monitor.number("clock.alarm") > 0
    return monitor.conclude()


def test_a_change_within_the_accuracy_is_not_claimed() -> None:
    """The same recording, by how well the parameter is known: 12 % of 3 % are a fault, 12 % of 20 % are not."""
    sure, open_ = ended(0.03, 0.12), ended(0.2, 0.12)
    assert sure.candidates[0].parameters == open_.candidates[0].parameters == ("R",)
    assert sure.candidates[0].probability > 0.95
    assert sure.within_accuracy < 0.01
    assert open_.within_accuracy > 0.9
    assert open_.candidates[0].probability < 0.1 + 1.0 / len(open_.candidates)
    for found in (sure, open_):
        assert sum(item.probability for item in found.candidates) == pytest.approx(1.0)


def test_a_change_well_beyond_the_accuracy_loses_nothing() -> None:
    """Three times what is not known is a fault."""
    found = ended(0.2, 0.6)
    assert found.candidates[0].parameters == ("R",)
    assert found.candidates[0].probability > 0.95
    assert found.within_accuracy < 1e-3
