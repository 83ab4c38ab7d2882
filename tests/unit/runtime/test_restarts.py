"""What holds when the filter has to begin anew in the middle of a run."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from faultbond.contract.spec import covariance_place
from faultbond.runtime.accepting import accept, find_hypothesis
from faultbond.runtime.packing import resumed
from faultbond.runtime.state import State, Status
from faultbond.simulate import Fault
from made import changed, plant, recorded, run

FAULT = Fault(parameter="C", factor=1.6, start=4.0)
_, SPEC, ENGINE = plant("rc")
SAMPLES = recorded("rc", 1000, FAULT)  # at 50 Hz


@pytest.fixture(scope="module")
def accepted() -> State:
    """Give the state after the fault was accepted at 10 s."""
    state, _ = run(SPEC, ENGINE, SAMPLES[:500])
    return accept(SPEC, state, find_hypothesis(SPEC, ["C"]))[0]


def lost(state: State) -> State:
    """Give the state after a sample after which the filter holds no numbers."""
    state, reports = run(SPEC, ENGINE, SAMPLES[500:503], changed(state, lane=np.full_like(state.healthy.lane, np.nan)))
    assert any(report.status is Status.LOST for report in reports)
    return state


@pytest.mark.parametrize(("begin", "first"), [(resumed, Status.WATCHING), (lost, Status.STARTING)])
def test_what_was_accepted_stays_when_the_filter_begins_anew(
    begin: Callable[[State], State], first: Status, accepted: State
) -> None:
    """After a gap, or a sample that broke the filter, the accepted parameter is still the normal one: no alarm."""
    state, reports = run(SPEC, ENGINE, SAMPLES[520:], begin(accepted))
    assert reports[0].status is first
    assert reports[-1].status is Status.WATCHING
    place = SPEC.parameter_slice.start + [item.name for item in SPEC.parameters].index("C")
    assert state.healthy.lane[place, 0] == pytest.approx(1.6, rel=0.05)
    assert 1e-3**2 < state.healthy.lane[covariance_place(SPEC, place, place), 0] < 0.1**2


def test_without_an_accepted_fault_the_nominal_plant_begins_anew() -> None:
    """A fault that nobody accepted is found again after a gap."""
    state, _ = run(SPEC, ENGINE, SAMPLES[:190])
    state, reports = run(SPEC, ENGINE, SAMPLES[300:600], resumed(state))
    assert any(report.detection is not None for report in reports)
    assert state.clock.alarm >= 0


def test_the_start_of_the_model_is_that_of_the_first_sample_only() -> None:
    """Where the model says how the plant starts, that does not hold when the filter begins anew much later."""
    spec = replace(SPEC, states=tuple(replace(item, start_mean=0.0, start_sd=1e-3) for item in SPEC.states))
    healthy = recorded("rc", 600)
    state, first = run(spec, ENGINE, healthy[:300])
    assert abs(first[19].expected[0] - healthy[19].y[0]) < 6.0 * np.sqrt(first[19].variance[0])
    later = next(k for k in range(300, 500) if abs(healthy[k].y[0]) > 5.0)
    state, reports = run(spec, ENGINE, healthy[later:], changed(state, begun=-1, running=0))
    assert [report.status for report in reports[:20]].count(Status.STARTING) == 19
    assert all(report.detection is None for report in reports)
    assert abs(reports[20].expected[0] - healthy[later + 20].y[0]) < 6.0 * np.sqrt(reports[20].variance[0])


def test_where_a_filter_strayed_is_no_place_where_the_plant_has_been(accepted: State) -> None:
    """Lost, it forgets how far the states moved; while it seeks them after a gap, it learns nothing of that."""
    assert np.all(np.isfinite(accepted.healthy.travel))
    assert np.all(np.isinf(lost(accepted).healthy.travel))
    here = np.repeat(accepted.healthy.lane[:1].T, 2, axis=0)
    new = changed(accepted, travel=here)
    seeking, _ = run(SPEC, ENGINE, SAMPLES[500:501], changed(new, astray=np.full_like(new.healthy.astray, 1e3)))
    assert np.array_equal(seeking.healthy.travel, here)
    found, _ = run(SPEC, ENGINE, SAMPLES[500:501], new)
    assert np.ptp(found.healthy.travel) > 0.0
