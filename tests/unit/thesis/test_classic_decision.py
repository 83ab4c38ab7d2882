"""Accepting and rejecting with method `classic`, and the curves that it leaves."""

from dataclasses import replace

import numpy as np
import pytest
from test_classic_watch import LEAK, PIPE, plant, recorded, run, watched

from faultbond.errors import FaultbondError
from faultbond.thesis.online.curves import point_of, stacked
from faultbond.thesis.online.decision import accept, after_pause, reject
from faultbond.thesis.online.ranking import rank
from faultbond.thesis.online.state import init
from faultbond.thesis.online.watch import finish, step


def test_an_accepted_diagnosis_is_the_new_model() -> None:
    """The parameters get their estimates, monitoring begins again, and the same fault raises no second alarm."""
    _, spec, plan = plant("tank")
    samples = recorded("tank", 800, PIPE)
    state, _ = run(spec, plan, samples[:640])
    best = rank(spec, plan, state).candidates[0]
    state, candidate = accept(spec, plan, state, best.hypothesis)
    assert candidate.parameters == best.parameters == ("K1",)
    names = [item.name for item in spec.parameters]
    assert state.healthy[names.index("K1")] == candidate.suspects[0].estimate
    assert state.healthy[names.index("K2")] == spec.parameters[names.index("K2")].nominal
    assert (state.alarm, state.running) == (-1, -1)
    state, _ = run(spec, plan, samples[640:], state)
    assert state.running > 120
    assert state.alarm < 0
    assert finish(spec, plan, state) is None


def test_what_was_mended_is_nominal_again() -> None:
    """The parameters of the candidate get their nominal values."""
    _, spec, plan = plant("tank")
    state, _ = run(spec, plan, recorded("tank", 800, PIPE)[:640])
    best = rank(spec, plan, state).candidates[0]
    state, candidate = accept(spec, plan, state, best.hypothesis, repaired=True)
    assert candidate.parameters == ("K1",)
    k = [item.name for item in spec.parameters].index("K1")
    assert state.healthy[k] == spec.parameters[k].nominal != candidate.suspects[0].estimate
    assert state.alarm == -1


def test_a_rejected_candidate_is_gone() -> None:
    """Those that do not contain it keep their order and share its weight; the last one cannot be rejected."""
    _, spec, plan = plant("tank")
    state, _ = watched(800, LEAK)
    before = rank(spec, plan, state).candidates
    state, candidate = reject(spec, plan, state, before[0].hypothesis)
    after = rank(spec, plan, state).candidates
    assert candidate.parameters == before[0].parameters
    (name,) = candidate.parameters
    assert [item.parameters for item in after] == [item.parameters for item in before if name not in item.parameters]
    assert sum(item.probability for item in after) == pytest.approx(1.0)
    with pytest.raises(FaultbondError, match="rejected, or is not among"):
        reject(spec, plan, state, before[0].hypothesis)
    nearly = replace(state, rejected=np.ones_like(state.rejected))
    nearly.rejected[3] = 0.0
    with pytest.raises(FaultbondError, match="last hypothesis"):
        reject(spec, plan, nearly, 3)


def test_without_an_alarm_there_is_nothing_to_decide() -> None:
    """Accepting needs a detection."""
    _, spec, plan = plant("tank")
    with pytest.raises(FaultbondError, match="no alarm"):
        accept(spec, plan, init(spec, plan), 0)


def test_after_a_pause_monitoring_begins_anew() -> None:
    """A healthy run forgets its states and errors, one that tests goes on; no alarm follows from a gap."""
    _, spec, plan = plant("tank")
    samples = recorded("tank", 800, PIPE)[:290]
    state, _ = run(spec, plan, samples[:200])
    state = after_pause(state)
    assert state.running == -1
    state, reports = run(spec, plan, samples[240:], state)
    assert state.alarm < 0
    assert reports[16].expected == pytest.approx(samples[248].y, rel=0.2)
    testing, _ = watched(800, PIPE)
    assert after_pause(testing) is testing


def test_curves_show_what_the_figures_show() -> None:
    """Each sample gives its weight, two estimates of the states, index and limit; from the alarm on also the tests."""
    _, spec, plan = plant("tank")
    state, points = init(spec, plan), []
    for sample in recorded("tank", 800, PIPE)[:420]:
        state, _ = step(spec, plan, state, sample)
        points.append(point_of(spec, plan, state))
    curves = stacked(points)
    assert state.alarm > 0
    late = np.arange(420) > state.alarm
    assert np.array_equal(np.isfinite(curves["hitting"]).all(axis=1), late | (np.arange(420) == state.alarm))
    assert curves["estimates"].shape == (420, 2, 21)
    assert np.all(np.diff(curves["trust"][20:]) <= 1e-12)
    trust = curves["trust"][20:, None]
    blend = trust * curves["samples"][20:] + (1 - trust) * curves["before"][20:]
    after = np.arange(20, 420) != state.alarm  # at the alarm the models of the tests begin; the healthy one goes on
    assert curves["states"][20:][after] == pytest.approx(blend[after])
    k1 = [item.name for item in spec.parameters].index("K1")
    assert curves["averages"][-1, k1] == pytest.approx(
        next(item for item in rank(spec, plan, state).candidates if item.parameters == ("K1",)).suspects[0].estimate
    )
    assert np.nanmax(curves["index"][state.alarm] / curves["limit"][state.alarm]) > 1.0
