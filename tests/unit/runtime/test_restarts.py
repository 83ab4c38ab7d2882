"""What holds when the filter has to begin anew in the middle of a run."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from faultbond.contract.samples import Status
from faultbond.contract.spec import covariance_place
from faultbond.equations.plant import build_plant
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from faultbond.synthesis.engine import build_core
from made import changed, graph_of, plant, recorded, run, spec_of

FAULT = Fault(parameter="C", factor=1.6, start=4.0)
SPEC = spec_of("rc")
SAMPLES = recorded("rc", 1000, FAULT)  # at 50 Hz


@pytest.fixture(scope="module")
def accepted() -> Monitor:
    """Give the monitor after the fault was accepted at 10 s."""
    monitor, _ = run(plant("rc")[2], SAMPLES[:500])
    (wanted,) = (
        item for item in monitor.conclude().candidates if item.parameters == ("C",) and item.kind.value == "step"
    )
    monitor.accept(wanted.hypothesis)
    return monitor


def resumed(monitor: Monitor) -> Monitor:
    """Give a copy after a gap of unknown length."""
    after = monitor.copy()
    after.resume()
    return after


def lost(monitor: Monitor) -> Monitor:
    """Give a copy after a sample after which the filter holds no numbers."""
    broken = changed(monitor, **{"healthy.lane": np.full(SPEC.n_numbers, np.nan)})
    after, reports = run(plant("rc")[2], SAMPLES[500:503], broken)
    assert any(report.status is Status.LOST for report in reports)
    return after


@pytest.mark.parametrize(("begin", "first"), [(resumed, Status.WATCHING), (lost, Status.STARTING)])
def test_what_was_accepted_stays_when_the_filter_begins_anew(
    begin: Callable[[Monitor], Monitor], first: Status, accepted: Monitor
) -> None:
    """After a gap, or a sample that broke the filter, the accepted parameter is still the normal one: no alarm."""
    monitor, reports = run(plant("rc")[2], SAMPLES[520:], begin(accepted))
    assert reports[0].status is first
    assert reports[-1].status is Status.WATCHING
    place = SPEC.parameter_slice.start + [item.name for item in SPEC.parameters].index("C")
    lane = monitor.numbers("healthy.lane")
    assert lane[place] == pytest.approx(1.6, rel=0.05)
    assert 1e-3**2 < lane[covariance_place(SPEC, place, place)] < 0.1**2


def test_without_an_accepted_fault_the_nominal_plant_begins_anew() -> None:
    """A fault that nobody accepted is found again after a gap."""
    before, _ = run(plant("rc")[2], SAMPLES[:190])
    monitor, reports = run(plant("rc")[2], SAMPLES[300:600], resumed(before))
    assert any(report.detection is not None for report in reports)
    assert monitor.number("clock.alarm") >= 0


def test_the_start_of_the_model_is_that_of_the_first_sample_only() -> None:
    """Where the model says how the plant starts, that does not hold when the filter begins anew much later."""
    states = tuple(replace(item, start_mean=0.0, start_sd=1e-3) for item in SPEC.states)
    core, healthy = build_core(build_plant(graph_of("rc")), replace(SPEC, states=states)), recorded("rc", 600)
    monitor, first = run(core, healthy[:300])
    assert abs(first[19].expected[0] - healthy[19].y[0]) < 6.0 * np.sqrt(first[19].variance[0])
    later = next(k for k in range(300, 500) if abs(healthy[k].y[0]) > 5.0)
    _, reports = run(core, healthy[later:], changed(monitor, begun=-1, running=0))
    assert [report.status for report in reports[:20]].count(Status.STARTING) == 19
    assert all(report.detection is None for report in reports)
    assert abs(reports[20].expected[0] - healthy[later + 20].y[0]) < 6.0 * np.sqrt(reports[20].variance[0])


def test_where_a_filter_strayed_is_no_place_where_the_plant_has_been(accepted: Monitor) -> None:
    """Lost, it forgets how far the states moved; while it seeks them after a gap, it learns nothing of that."""
    assert np.all(np.isfinite(accepted.numbers("healthy.travel")))
    assert np.all(np.isinf(lost(accepted).numbers("healthy.travel")))
    here = np.repeat(accepted.numbers("healthy.lane")[:1], 2)
    new = changed(accepted, travel=here)
    seeking, _ = run(plant("rc")[2], SAMPLES[500:501], changed(new, astray=1e3))
    assert np.array_equal(seeking.numbers("healthy.travel"), here)
    found, _ = run(plant("rc")[2], SAMPLES[500:501], new)
    assert np.ptp(found.numbers("healthy.travel")) > 0.0


def test_a_filter_that_was_lost_says_so_and_begins_with_what_follows() -> None:
    """A sample after which the healthy filter holds no numbers is told; the next ones are gathered for a new start."""
    core, samples = plant("dc_motor_current")[2], recorded("dc_motor_current", 200)
    before, _ = run(core, samples[:120])
    broken = changed(before, **{"healthy.lane": np.full(core.spec.n_numbers, np.nan)})
    monitor, reports = run(core, samples[120:], broken)
    assert [report.status for report in reports[:21]] == [Status.LOST, *[Status.STARTING] * 19, Status.WARMING]
    assert np.all(np.isnan(reports[0].expected))
    assert np.all(np.isfinite(monitor.numbers("healthy.lane")))
    assert reports[-1].status is Status.WATCHING
    assert (monitor.number("clock.alarm"), monitor.number("clock.begun")) == (-1, 121)
