"""From which size on a change is claimed."""

from dataclasses import replace
from math import inf, sqrt

import pytest
from scipy.stats import norm

from diagnosed import SPEC
from faultbond.contract.claims import CERTAINTY, claimed_bias, claimed_parameter, claimed_size
from faultbond.contract.core_settings import core_settings
from faultbond.contract.slots import BIASES, INPUT_BIASES


@pytest.mark.parametrize(("healthy", "faulty"), [(0.01, 2.0), (0.3, 2.0), (1.9, 2.0), (1e-6, 1.0), (20.0, 5e3)])
def test_a_change_of_that_size_is_a_fault_with_the_certainty_that_is_asked(healthy: float, faulty: float) -> None:
    """By Bayes' rule, with the densities of another library; a smaller one is less surely a fault."""

    def sure(size: float) -> float:
        one, other = norm.pdf(size, scale=faulty), norm.pdf(size, scale=healthy)
        return float(one / (one + other))

    size = claimed_size(healthy, faulty)
    assert sure(size) == pytest.approx(CERTAINTY)
    assert sure(0.9 * size) < CERTAINTY < sure(1.1 * size)


def test_what_no_healthy_part_does_is_claimed_however_small() -> None:
    """And what a healthy part does more of than a faulty one is never claimed."""
    assert claimed_size(0.0, 2.0) == 0.0
    assert claimed_size(2.0, 2.0) == claimed_size(3.0, 2.0) == inf


def test_of_a_parameter_its_accuracy_or_what_it_was_seen_to_do_counts() -> None:
    """In SI: the scale of the parameter, which may be negative, is part of it."""
    item, part = SPEC.parameters[1], core_settings()["MOVES_BY"]
    parameters = list(SPEC.parameters)
    assert claimed_parameter(SPEC, 1) == pytest.approx(item.scale * claimed_size(part * item.accuracy, item.change))
    for changed, healthy in (
        (replace(item, healthy_change=3.0 * item.accuracy), 3.0 * item.accuracy),
        (replace(item, healthy_change=0.1 * item.accuracy, scale=-item.scale), part * item.accuracy),
        (replace(item, accuracy=0.0), 0.0),
    ):
        parameters[1] = changed
        spec = replace(SPEC, parameters=tuple(parameters))
        assert claimed_parameter(spec, 1) == pytest.approx(item.scale * claimed_size(healthy, item.change))


def test_beside_one_that_goes_with_it_a_parameter_is_known_better() -> None:
    """Of two that are known by their sum alone each is known as the correlation says, once the other is."""
    item, rho = SPEC.parameters[1], 0.95
    spec = replace(SPEC, correlations=((0, 1, rho),))
    known = core_settings()["MOVES_BY"] * item.accuracy * sqrt(1.0 - rho**2)
    assert claimed_parameter(spec, 1) == pytest.approx(item.scale * claimed_size(known, item.change))


def test_of_an_instrument_what_it_was_found_off_by_counts() -> None:
    """Nothing where nobody looked; of an input its largest value tells what a fault may be."""
    sensor, source = SPEC.outputs[0], SPEC.inputs[0]
    assert claimed_bias(SPEC, 0, is_output=True) == claimed_bias(SPEC, 0, is_output=False, largest=50.0) == 0.0
    spec = replace(
        SPEC,
        outputs=(replace(sensor, healthy_bias=2.0 * sensor.noise), *SPEC.outputs[1:]),
        inputs=(replace(source, healthy_bias=0.3), *SPEC.inputs[1:]),
    )
    assert claimed_bias(spec, 0, is_output=True) == claimed_size(2.0 * sensor.noise, BIASES[-1] * sensor.noise)
    assert claimed_bias(spec, 0, is_output=False, largest=50.0) == claimed_size(0.3, 50.0 * INPUT_BIASES[-1])
