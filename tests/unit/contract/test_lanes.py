"""Lanes of a bank: starts reach every likely value of a suspect, and each hypothesis has all their combinations."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.contract.lanes import COARSE_FROM, plan_lanes, starts_of
from faultbond.contract.spec import ParameterSpec
from made import spec_of


def parameter(change: float, nominal: float = 1.0, lower: float = 0.02, upper: float = 50.0) -> ParameterSpec:
    """A parameter of size 1."""
    return ParameterSpec(
        name="X",
        component="x",
        nominal=nominal,
        scale=1.0,
        accuracy=0.03,
        change=change,
        lower=lower,
        upper=upper,
        suspect=True,
        unit="",
        unit_factor=1.0,
    )


@given(st.floats(0.02, 20.0), st.floats(0.0, 1.0), st.integers(1, 2))
@settings(deadline=None)
def test_starts_cover_the_declared_change(change: float, part: float, size: int) -> None:
    """Every value within one `change` of nominal is within three standard deviations of a start."""
    low, high = max(0.02, 1.0 - change), 1.0 + change
    value = low + part * (high - low)
    nearest = min(abs(value - start.value) / start.sd for start in starts_of(parameter(change), size))
    assert nearest <= 3.0 + 1e-9


@given(st.floats(0.02, 20.0))
@settings(deadline=None)
def test_starts_are_few_and_double(change: float) -> None:
    """Starts double from one to the next, lie on both sides of nominal, and a thousandfold range takes ten at most."""
    values = [start.value for start in starts_of(parameter(change), 1)]
    assert 2 <= len(values) <= 10
    assert np.diff(np.log2(values)) == pytest.approx(1.0)
    assert values[0] < 1.0


def test_usual_change_has_four_starts() -> None:
    """A parameter with the default change of 200 % starts from 0.45, 0.9, 1.8 and 3.6 nominals."""
    assert [start.value for start in starts_of(parameter(2.0), 1)] == [0.45, 0.9, 1.8, 3.6]


def test_rounding_of_the_change_does_not_matter() -> None:
    """A change that differs from 200 % by rounding has the same starts."""
    assert len(starts_of(parameter(float(np.nextafter(2.0, 0.0))), 1)) == 4


def test_large_sets_use_the_inner_starts() -> None:
    """In a set of three or more, each suspect has only its two inner starts."""
    item = parameter(2.0)
    assert starts_of(item, COARSE_FROM) == starts_of(item, 1)[1:3]


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [(-np.inf, np.inf, {0.0, 2.0, -2.0}), (0.0, np.inf, {0.0, 2.0}), (-np.inf, 0.0, {0.0, -2.0})],
)
def test_suspect_with_nominal_zero(lower: float, upper: float, expected: set[float]) -> None:
    """A suspect whose nominal is zero starts from zero and from a third of its change on the sides that are allowed."""
    starts = starts_of(parameter(6.0, nominal=0.0, lower=lower, upper=upper), 1)
    assert {start.value for start in starts} == expected
    assert {start.sd for start in starts} == {6.0}


@pytest.mark.parametrize("name", ["tank", "dc_motor_current"])
def test_plan_holds_every_combination(name: str) -> None:
    """Each hypothesis has one lane per combination of starts of its suspects and of stores that keep their content."""
    spec = spec_of(name)
    plan = plan_lanes(spec)
    assert plan.n_lanes == plan.values.shape[1] == plan.jumps.shape[0]
    for k, chosen in enumerate(spec.hypotheses):
        lanes = np.flatnonzero(plan.hypothesis == k)
        assert lanes[0] == plan.first[k]
        assert np.array_equal(lanes, np.arange(lanes[0], lanes[-1] + 1))
        assert plan.sizes[k] == len(chosen)
        for lane in lanes:
            assert tuple(np.flatnonzero(plan.suspected[:, lane])) == chosen
        stores = [k for k, state in enumerate(spec.states) if any(index in chosen for index, _ in state.jumps)]
        starts = [[s.value for s in starts_of(spec.parameters[index], len(chosen))] for index in chosen]
        expected = {(*values, *jumps) for values in product(*starts) for jumps in product([0, 1], repeat=len(stores))}
        found = [(*plan.values[list(chosen), lane].tolist(), *plan.jumps[lane, stores].tolist()) for lane in lanes]
        assert len(found) == len(expected)
        assert set(found) == expected
        others = [k for k in range(len(spec.states)) if k not in stores]
        assert not plan.jumps[lanes][:, others].any()


def test_a_hypothesis_keeps_its_lanes() -> None:
    """The lanes of a hypothesis are the same whichever others are tested beside it."""
    spec = spec_of("tank")
    full = plan_lanes(spec)
    kept = (3, 9, 17)
    less = plan_lanes(replace(spec, hypotheses=tuple(spec.hypotheses[k] for k in kept)))
    for new, old in enumerate(kept):
        for field in ("values", "sds", "suspected"):
            there = getattr(full, field)[:, full.hypothesis == old]
            assert np.array_equal(getattr(less, field)[:, less.hypothesis == new], there)
        assert np.array_equal(full.jumps[full.hypothesis == old], less.jumps[less.hypothesis == new])


def test_stores_of_one_parameter_go_together() -> None:
    """Stores of one parameter all keep their content or none does: twice its starts, not 2 to the power n lanes."""
    spec = spec_of("dc_motor")
    index = spec.states[0].jumps[0][0]
    many = replace(spec, states=tuple(replace(spec.states[0], name=f"x{k}") for k in range(30)))
    plan = plan_lanes(many)
    lanes = np.flatnonzero(plan.hypothesis == many.hypotheses.index((index,)))
    assert len(lanes) == 2 * len(starts_of(spec.parameters[index], 1))
    assert plan.jumps[lanes].sum(axis=1).tolist() == [0, 30] * (len(lanes) // 2)
