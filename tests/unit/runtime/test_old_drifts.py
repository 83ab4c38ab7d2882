"""Drifts long under way: what the healthy filter learned from them is in doubt, and they begin again."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import covariance_place
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.types import FaultKind
from made import TANK_START, changed, differing, plant, samples_of


@cache
def drifting(waited: int = 99) -> Monitor:
    """A tank whose pipe narrows slowly, some time after the alarm; its valve moves."""
    graph, _, core = plant("tank")
    time = np.arange(1500.0)
    u = np.stack([np.where(time % 400.0 < 200.0, 80.0, 45.0), np.where(time % 600.0 < 300.0, 65.0, 45.0)], axis=1)
    fault = Fault(parameter="K1", factor=2.5, start=350.0, end=1500.0)
    made = simulate(graph, Inputs(time=time, values=u), [fault], seed=2, start={"tank.q": TANK_START})
    monitor = Monitor(core)
    for used, sample in enumerate(samples_of(time, made.inputs, made.outputs)):
        monitor.step(sample)
        if monitor.number("clock.alarm") >= 0 and used == monitor.number("clock.alarm") + waited:
            break
    assert monitor.number("clock.alarm") == monitor.number("clock.index") - 1 - waited
    return monitor


def test_the_oldest_healthy_lane_is_from_before_the_drift() -> None:
    """Healthy lanes are kept at multiples of windows, two of each; that which counts has learned little."""
    monitor = drifting()
    spec, settings, place = monitor.spec, core_settings(), monitor.spec.parameter_slice
    snapshots = monitor.numbers("healthy.snapshots").reshape(-1, spec.n_numbers + len(spec.parameters) + 2)
    alarm, walks, ratio = monitor.number("clock.alarm"), round(settings["WALKS"]), settings["WALK_RATIO"]
    assert monitor.number("alarm.old") < 0
    for window in range(walks):
        length = settings["WALK_EVERY"] * ratio**window
        for number in (alarm // length - 1, alarm // length):
            kept = snapshots[2 * window + int(number) % 2]
            assert np.any(kept) == (number * length >= settings["WALK_SETTLES"])
            assert kept[-1] == (number * length if np.any(kept) else 0.0)
            if number * length > monitor.number("clock.index") - spec.thresholds.history_samples:
                assert np.array_equal(kept[: spec.n_numbers], monitor.row(int(number * length))[1])
    old = snapshots[int(monitor.number("job.old"))]
    assert old[-1] == max(settings["WALK_EVERY"] * ratio, (alarm // 300 - 1) * 300)
    drifted = monitor.numbers("healthy.lane")[place]
    assert np.abs(old[place] - 1.0).max() < 0.01 < np.abs(drifted - 1.0).max()


def test_a_drift_that_is_there_is_found() -> None:
    """Begun again from what was found, the lane of a drift has its size and rate within three sds, and small ones."""
    monitor = drifting(260)
    spec, plan, n = monitor.spec, plan_slots(monitor.spec), plan_lanes(monitor.spec).n_lanes
    index = [item.name for item in spec.parameters].index("K1")
    lanes = [
        monitor.lane(n + k)
        for k, item in enumerate(plan.lanes)
        if item.parameter == index and item.kind is FaultKind.DRIFT
    ]
    best, wide = max(lanes, key=lambda lane: float(lane[-1])), spec.slotted
    place = wide.slot_slice.start
    sds = [np.sqrt(best[covariance_place(wide, k, k)]) for k in (place, place + 1)]
    now = 1.0 + 1.5 * (monitor.number("clock.index") - 1 - 350.0) / 1150.0
    assert best[spec.parameter_slice][index] + best[place] == pytest.approx(now, abs=3.0 * sds[0])
    assert best[place + 1] == pytest.approx(1.5 / 1150.0, abs=3.0 * sds[1])
    assert sds[0] < 0.3
    assert sds[1] < 0.003


def test_a_run_goes_on_bit_for_bit_with_its_old_lanes() -> None:
    """Old lanes are saved and restored with the state."""
    monitor = drifting()
    assert np.any(monitor.numbers("healthy.snapshots"))
    assert not differing(Monitor(monitor.core, monitor.save()), monitor)


def test_a_drift_is_told_on_top_of_one_that_was_accepted() -> None:
    """A diagnosis gives the rate of the parameter, with what it had been moving at before."""
    monitor = drifting(260)
    spec = monitor.spec
    accepted = changed(monitor, rates=np.linspace(1e-4, 2e-4, len(spec.parameters)))
    names = [item.name for item in spec.parameters]
    told = 0
    for one, two in zip(monitor.conclude().candidates, accepted.conclude().candidates, strict=True):
        before, after = one.suspects[0], two.suspects[0]
        if one.kind is FaultKind.DRIFT and before.parameter in names:
            index = names.index(before.parameter)
            assert before.rate is not None
            assert after.rate is not None
            more = spec.parameters[index].scale * accepted.numbers("normal.rates")[index]
            assert after.rate - before.rate == pytest.approx(more)
            told += 1
    assert told
