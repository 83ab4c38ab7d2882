"""What the healthy filter and the bank learn from a sample, and when the bank begins again."""

from functools import cache

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from faultbond.types import FaultKind
from made import packed, plant, recorded, run, spec_of

FAULT, ROWS = Fault(parameter="R", factor=2.0, start=2.4), 450
SPREAD = int(core_settings()["SPREAD"])
RENEWALS = tuple(int(core_settings()[f"{name}_RENEWAL"]) for name in ("FIRST", "SECOND", "LAST"))
SPEC = spec_of("dc_motor")


@cache
def passed() -> Monitor:
    """A monitor that is just past the alarm."""
    monitor = Monitor(plant("dc_motor")[2])
    for sample in recorded("dc_motor", ROWS, FAULT):
        if monitor.step(sample).detection:
            break
    return monitor


def steps_of(monitor: Monitor) -> FloatArray:
    """Lanes of steps of parameters, (n_numbers, n_lanes)."""
    return np.array([monitor.lane(k) for k in range(plan_lanes(SPEC).n_lanes)]).T


def slots_of(monitor: Monitor) -> FloatArray:
    """Lanes with a slot, (n_numbers, n_lanes); of faults that come and go two are one."""
    first, chosen = plan_lanes(SPEC).n_lanes, enumerate(plan_slots(SPEC).lanes)
    mixing = (FaultKind.DRIFT, FaultKind.RAMP, FaultKind.INTERMITTENT)
    return np.array([monitor.lane(first + k) for k, lane in chosen if lane.kind not in mixing]).T


def test_the_bank_linearises_twice_with_a_wide_bound_and_begins_again_when_it_is_time() -> None:
    """Each sample takes all lanes on by two updates, bounding only what nothing explains; but where lanes begin."""
    monitor, place, bound = passed().copy(), SPEC.sample_fields, SPEC.thresholds.bank_bound
    assert bound > 3.0 * SPEC.thresholds.learning_bound
    alarm, renewed = int(monitor.number("clock.alarm")), {"steps": list[int](), "slots": list[int]()}
    lanes = {"steps": (plant("dc_motor")[2], steps_of), "slots": (plant("dc_motor")[2].slot, slots_of)}
    for k, sample in enumerate(recorded("dc_motor", ROWS, FAULT)[alarm + 1 :], start=1):
        before = {name: of(monitor) for name, (_, of) in lanes.items()}
        monitor.step(sample)
        row = packed(monitor)
        assert row[0, place["again"]] == 0.0
        row[:, place["again"]], row[:, place["bound"]] = 1.0, bound
        for name, (core, of) in lanes.items():
            if not np.array_equal(of(monitor), core.advance(before[name], row)[0], equal_nan=True):
                renewed[name].append(k)
    assert len(recorded("dc_motor", ROWS, FAULT)) - alarm > RENEWALS[-1] + 20
    every = {k for found in renewed.values() for k in found}
    assert all(any(0 <= k - since <= SPREAD for k in every) for since in (0, *RENEWALS))
    for found in renewed.values():
        assert found
        assert all(any(0 <= k - since <= SPREAD for since in (0, *RENEWALS)) for k in found)
        assert len(found) < 0.5 * len(recorded("dc_motor", ROWS, FAULT)[alarm + 1 :])


def test_the_healthy_lane_linearises_once_and_is_bounded_when_warm() -> None:
    """The monitor's own lane never updates twice; its innovations are bounded once the warm-up is over."""
    monitor, _ = run(plant("dc_motor")[2], recorded("dc_motor", 300, FAULT))
    place, begun = SPEC.sample_fields, int(monitor.number("clock.begun"))
    for index in range(begun, 300):
        row = monitor.row(index)[0]
        assert row[place["again"]] == 0.0
        warm = index >= begun + SPEC.thresholds.warm_up_samples
        assert row[place["bound"]] == (SPEC.thresholds.learning_bound if warm else 0.0)
