"""Least squares of method `classic`: what a sample may do to an estimate, and what the limits are made of."""

import numpy as np
import pytest
from test_classic_watch import PIPE, plant, recorded, watched

from faultbond.thesis.online.estimate import LARGEST, start_factors, within_ranges
from faultbond.thesis.online.indices import indices_of
from faultbond.thesis.online.ranking import current_limits, noise_of
from faultbond.thesis.online.state import init
from faultbond.thesis.online.watch import step


def test_suspects_follow_one_that_is_brought_back() -> None:
    """At the end of a range the others move along their covariance; a lane within its ranges stays as it is."""
    factors = np.array([[-0.1, 0.5], [0.5, 0.5]])
    covariance = np.repeat(np.array([[1.0, 0.5], [0.5, 2.0]])[:, :, None], 2, axis=2)
    found = within_ranges(factors, covariance, np.full((2, 2), 0.02), np.full((2, 2), 50.0))
    assert found[:, 0] == pytest.approx([0.02, 0.5 + 0.5 * 0.12])
    assert found[:, 1].tolist() == [0.5, 0.5]


def test_suspects_begin_healthy_and_wide() -> None:
    """Each slot of a tested set begins at its healthy factor with the variance of `change`, unrelated to the others."""
    _, spec, plan = plant("tank")
    healthy = np.array([item.nominal for item in spec.parameters])
    healthy[0] *= 1.25
    factors, covariance = start_factors(spec, plan, healthy)
    lane = 1 + plan.tested.index((0, 6))  # K8 and K6
    assert factors[:, lane].tolist() == [1.25, 1.0]
    assert covariance[:, :, lane] == pytest.approx(np.diag([4.0, 100.0]))
    assert not covariance[:, :, 0].any()


def test_a_sample_moves_an_estimate_by_little() -> None:
    """Each law moves a factor by 0.3 of it, or 0.3, at most."""
    _, spec, plan = plant("tank")
    state, moved = init(spec, plan), []
    for sample in recorded("tank", 800, PIPE)[:420]:
        before = state.factors
        state, report = step(spec, plan, state, sample)
        if state.alarm >= 0 and report.detection is None:
            moved.append(np.abs(state.factors - before) / np.maximum(np.abs(before), 1.0))
    assert 0.2 < np.max(moved) <= 2.2 * LARGEST  # two laws a sample


def test_model_errors_widen_the_limit() -> None:
    """A flow that follows from other readings may be off by what its parameters may be off, a depth hardly."""
    _, spec, plan = plant("tank")
    state, _ = watched(500)
    flow, depth = indices_of(state.spread_sums)
    assert 0.02 < flow < 0.04  # a third of 3 % each of K8, K2 and K7, and more
    assert depth < 0.003
    wanted = 1.5 * (noise_of(spec, plan, state) + np.array([flow, depth]))
    decay = np.exp(-state.running / 95.0)
    assert current_limits(spec, plan, state) == pytest.approx(wanted + (1.0 - wanted) * decay)


def test_noise_is_a_share_of_what_was_read() -> None:
    """N is the declared noise over the root mean square of the filtered readings so far."""
    _, spec, plan = plant("tank")
    state, _ = watched(500)
    y = np.array([sample.y for sample in recorded("tank", 500)])
    rough = spec.output_noise / np.sqrt(np.mean(y[9:-8] ** 2, axis=0))
    assert noise_of(spec, plan, state) == pytest.approx(rough, rel=0.01)
