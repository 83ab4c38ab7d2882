"""Ranking of hypotheses from the numbers of their lanes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made import plant

from faultbond.runtime.lanes import plan_lanes
from faultbond.runtime.ranking import MAX_CANDIDATES, rank, scores
from faultbond.spec import EngineSpec, pack
from faultbond.types import FloatArray

SPEC = plant("dc_motor_current")[1]  # 25 hypotheses of up to three suspects


def lanes_with(spec: EngineSpec, likelihoods: FloatArray) -> FloatArray:
    """Lanes with these log-likelihoods, whose parameter factors and variances tell the lane."""
    n = plan_lanes(spec).n_lanes
    lanes = np.zeros((spec.n_numbers, n))
    for lane in range(n):
        factors = 1.0 + 0.01 * lane + 0.1 * np.arange(len(spec.parameters))
        lanes[spec.parameter_slice, lane] = factors
        variances = np.zeros(spec.n_joint)
        variances[spec.parameter_slice] = (0.001 * (1 + lane) + 0.0001 * np.arange(len(spec.parameters))) ** 2
        lanes[spec.covariance_slice, lane] = pack(np.diag(variances))
    lanes[-1] = likelihoods
    return lanes


def by_hand(spec: EngineSpec, likelihoods: FloatArray) -> list[float]:
    """Score of each hypothesis: logarithm of the mean likelihood over its starts, less the cost of its suspects."""
    plan, found = plan_lanes(spec), []
    for k, chosen in enumerate(spec.hypotheses):
        own = likelihoods[plan.hypothesis == k]
        mean = np.log(np.mean(np.exp(own - own.max()))) + own.max()
        found.append(float(mean - spec.thresholds.cost_per_suspect * len(chosen)))
    return found


@given(st.integers(0, 10**6), st.floats(0.1, 1000.0))
@settings(max_examples=40, deadline=None)
def test_probabilities_and_groups(seed: int, spread: float) -> None:
    """Probabilities are as the exponents of the scores and add up to 1; the group is within three nats."""
    likelihoods = np.random.default_rng(seed).normal(-5000.0, spread, plan_lanes(SPEC).n_lanes)
    diagnosis = rank(SPEC, 7.0, lanes_with(SPEC, likelihoods))
    expected = dict(zip(SPEC.hypotheses, by_hand(SPEC, likelihoods), strict=True))
    names = [item.name for item in SPEC.parameters]
    assert diagnosis.time == 7.0
    assert len(diagnosis.candidates) == len(SPEC.hypotheses)
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0, rel=1e-12)
    assert [item.probability for item in diagnosis.candidates] == sorted(
        (item.probability for item in diagnosis.candidates), reverse=True
    )
    best = max(expected.values())
    total = sum(np.exp(value - best) for value in expected.values())
    for item in diagnosis.candidates:
        score = expected[tuple(names.index(name) for name in item.parameters)]
        assert item.probability == pytest.approx(np.exp(score - best) / total, rel=1e-6, abs=1e-12)
        if abs(best - score - 3.0) > 1e-6:
            assert item.group == (best - score < 3.0)


def test_estimate_is_that_of_the_best_start() -> None:
    """The estimate and its sd are those of the start with the greatest likelihood, in SI."""
    plan = plan_lanes(SPEC)
    likelihoods = np.random.default_rng(3).normal(-100.0, 20.0, plan.n_lanes)
    names = [item.name for item in SPEC.parameters]
    for item in rank(SPEC, 0.0, lanes_with(SPEC, likelihoods)).candidates:
        chosen = tuple(names.index(name) for name in item.parameters)
        own = np.flatnonzero(plan.hypothesis == SPEC.hypotheses.index(chosen))
        lane = own[np.argmax(likelihoods[own])]
        for suspect, index in zip(item.suspects, chosen, strict=True):
            nominal = SPEC.parameters[index].nominal
            assert suspect.component == SPEC.parameters[index].component
            assert suspect.nominal == nominal
            assert suspect.estimate == pytest.approx(nominal * (1.0 + 0.01 * lane + 0.1 * index), rel=1e-12)
            assert suspect.sd == pytest.approx(nominal * (0.001 * (1 + lane) + 0.0001 * index), rel=1e-9)


def test_lost_lanes_do_not_count() -> None:
    """A start whose likelihood is no number adds nothing to its hypothesis and is not the one that is reported."""
    plan = plan_lanes(SPEC)
    likelihoods = np.full(plan.n_lanes, -100.0)
    own = np.flatnonzero(plan.hypothesis == 2)
    lost = likelihoods.copy()
    lost[own[0]] = np.nan
    lost[own[1]] = -np.inf
    found = scores(SPEC, plan, lost)
    assert np.all(np.isfinite(found))
    assert found[2] == pytest.approx(-100.0 + np.log((len(own) - 2) / len(own)) - 5.0)
    lanes = lanes_with(SPEC, lost)
    lanes[:-1, own[0]] = np.nan
    assert all(np.isfinite(s.estimate) for item in rank(SPEC, 0.0, lanes).candidates for s in item.suspects)


def test_a_hypothesis_without_any_number_is_last() -> None:
    """A hypothesis all of whose starts are lost has probability zero, and the others share the rest."""
    plan = plan_lanes(SPEC)
    likelihoods = np.full(plan.n_lanes, -100.0)
    likelihoods[plan.hypothesis == 0] = np.nan
    diagnosis = rank(SPEC, 0.0, lanes_with(SPEC, likelihoods))
    assert diagnosis.candidates[-1].probability == 0.0
    assert diagnosis.candidates[-1].parameters == (SPEC.parameters[SPEC.hypotheses[0][0]].name,)
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0)


def test_smaller_sets_win_a_tie() -> None:
    """Where two sets explain the data alike, the smaller one is more probable by the cost of one suspect."""
    found = scores(SPEC, plan_lanes(SPEC), np.zeros(plan_lanes(SPEC).n_lanes))
    by_size = {len(chosen): value for chosen, value in zip(SPEC.hypotheses, found, strict=True)}
    assert by_size[1] - by_size[2] == pytest.approx(SPEC.thresholds.cost_per_suspect)
    assert by_size[2] - by_size[3] == pytest.approx(SPEC.thresholds.cost_per_suspect)


def test_at_most_a_hundred_candidates() -> None:
    """Of more than a hundred sets the best hundred are given, with probabilities that count all sets."""
    sets = tuple(SPEC.hypotheses[k % 5] for k in range(MAX_CANDIDATES + 20))
    spec = replace(SPEC, hypotheses=sets)
    diagnosis = rank(spec, 0.0, lanes_with(spec, np.zeros(plan_lanes(spec).n_lanes)))
    assert len(diagnosis.candidates) == MAX_CANDIDATES
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(MAX_CANDIDATES / len(sets))
