"""Faults that come and go: pairs of lanes that mix, as interacting models do, against plain sums over modes."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.synthesis.compile import find_compiler
from lamp_core import interacted, lamp

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SWITCHING = 1.0 / 300.0  # per sample
STAY = np.array([[1.0 - SWITCHING, SWITCHING], [SWITCHING, 1.0 - SWITCHING]])


@cache
def wide() -> EngineSpec:
    """What lanes with a slot hold."""
    return lamp().spec.slotted


def pairs(seed: int, likelihoods: list[float]) -> FloatArray:
    """Lanes in pairs with random means, covariances and roles, and these log-likelihoods."""
    generator = np.random.default_rng(seed)
    lanes = generator.normal(size=(wide().n_numbers, len(likelihoods)))
    for lane in lanes.T:
        root = generator.normal(size=(wide().n_joint, wide().n_joint))
        lane[wide().covariance_slice] = pack(root @ root.T)
    lanes[-1] = likelihoods
    return lanes


def moments(lane: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of a lane."""
    return lane[: wide().n_joint], unpack(wide(), lane[wide().covariance_slice])


def two_normals(lanes: FloatArray, weights: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance of a mixture of two normal densities, from its first and second moments."""
    both = [moments(lane) for lane in lanes.T]
    mean = sum(weight * item[0] for weight, item in zip(weights, both, strict=True))
    second = sum(weight * (item[1] + np.outer(item[0], item[0])) for weight, item in zip(weights, both, strict=True))
    return np.asarray(mean), np.asarray(second - np.outer(mean, mean))


LIKELIHOODS = st.lists(st.floats(-800.0, 800.0), min_size=2, max_size=8).filter(lambda found: len(found) % 2 == 0)


@given(st.integers(0, 10**6), LIKELIHOODS)
@settings(max_examples=60, deadline=None)
def test_mixing_keeps_the_whole_probability(seed: int, likelihoods: list[float]) -> None:
    """The likelihoods of the two lanes of a pair add up to the same after mixing, and the pairs stay apart."""
    lanes = pairs(seed, likelihoods)
    found = interacted(lanes)
    for k in range(0, len(likelihoods), 2):
        before, after = (np.logaddexp(item[-1, k], item[-1, k + 1]) for item in (lanes, found))
        assert after == pytest.approx(before, rel=1e-12, abs=1e-9)
        alone = interacted(lanes[:, k : k + 2])
        assert np.array_equal(alone, found[:, k : k + 2])


@given(st.integers(0, 10**6), st.floats(-12.0, 12.0), st.floats(-3000.0, 3000.0))
@settings(max_examples=60, deadline=None)
def test_moments_are_those_of_two_normal_densities(seed: int, apart: float, level: float) -> None:
    """A lane becomes what is known of a plant now in its mode: as both lanes say, weighed by where it came from."""
    lanes = pairs(seed, [level + apart, level])
    found = interacted(lanes)
    before = np.exp([apart - np.logaddexp(apart, 0.0), -np.logaddexp(apart, 0.0)])
    for now in (0, 1):
        joint = before * STAY[:, now]
        mean, covariance = two_normals(lanes, joint / joint.sum())
        assert found[: wide().n_joint, now] == pytest.approx(mean, rel=1e-9, abs=1e-9)
        assert moments(found[:, now])[1] == pytest.approx(covariance, rel=1e-6, abs=1e-7)
        loops = lanes[wide().loop_slice] @ (joint / joint.sum())
        assert found[wide().loop_slice, now] == pytest.approx(loops, rel=1e-9, abs=1e-9)
        assert found[-1, now] == pytest.approx(
            level + np.logaddexp(apart, 0.0) + np.log(joint.sum()), rel=1e-9, abs=1e-9
        )
        has_gone = wide().role_fields["returns"].start
        roles = slice(wide().loop_slice.stop, has_gone)
        assert np.array_equal(found[roles, now], lanes[roles, now])
        was = lanes[has_gone] if now == 0 else np.array([1.0, lanes[has_gone, 1]])  # what goes has been there
        assert found[has_gone, now] == pytest.approx(was @ (joint / joint.sum()), rel=1e-9, abs=1e-9)


@given(st.integers(0, 10**6), st.floats(-50.0, 50.0))
@settings(max_examples=30, deadline=None)
def test_the_modes_are_alike(seed: int, apart: float) -> None:
    """Exchanging the two lanes of a pair exchanges the results, but for what is known of its having gone."""
    lanes = pairs(seed, [apart, 0.0])
    found, turned = (np.delete(interacted(part), -2, axis=0) for part in (lanes, lanes[:, ::-1]))
    assert turned[:, ::-1] == pytest.approx(found, rel=1e-12, abs=1e-12)


@given(st.integers(0, 10**6), st.sampled_from([np.nan, np.inf, -np.inf, -1e300]), st.booleans())
@settings(max_examples=30, deadline=None)
def test_a_lost_lane_begins_again_from_the_other(seed: int, lost: float, first: bool) -> None:
    """A lane whose numbers are lost does not harm the other, and goes on from it, as likely as a switch."""
    lanes = pairs(seed, [-20.0, -20.0])
    gone, kept = (0, 1) if first else (1, 0)
    lanes[: wide().loop_slice.stop, gone] = np.nan
    lanes[-1, gone] = lost
    found = interacted(lanes)
    for k in (gone, kept):
        assert np.array_equal(found[: wide().loop_slice.stop, k], lanes[: wide().loop_slice.stop, kept])
    assert found[-1, kept] == pytest.approx(-20.0 + np.log(1.0 - SWITCHING))
    assert found[-1, gone] == pytest.approx(-20.0 + np.log(SWITCHING))


@given(st.lists(st.tuples(st.floats(-9.0, 3.0), st.floats(-9.0, 3.0)), min_size=1, max_size=7))
@settings(max_examples=40, deadline=None)
def test_two_modes_obey_bayes(gains: list[tuple[float, float]]) -> None:
    """Over a row of samples, the likelihoods are sums over every row of modes, each as likely as its switches."""
    lanes = pairs(1, [-1e300, 0.0])  # healthy at first
    for gain in gains:
        lanes = interacted(lanes)
        lanes[-1] += gain
    total = np.zeros(2)
    for number in range(2 ** len(gains)):
        modes = [1, *(number >> k & 1 for k in range(len(gains)))]
        weight = 1.0
        for k, gain in enumerate(gains):
            weight *= STAY[modes[k], modes[k + 1]] * np.exp(gain[modes[k + 1]])
        total[modes[-1]] += weight
    assert lanes[-1] == pytest.approx(np.log(total), rel=1e-9, abs=1e-9)
