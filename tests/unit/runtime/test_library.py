"""One compiled core for many: lanes of any number, and monitors in threads of their own."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from faultbond.contract.samples import Samples
from faultbond.runtime.core import LANES
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from made import plant, recorded, run, spec_of

SPEC = spec_of("dc_motor")
FAULTS = (None, Fault(parameter="R", factor=2.0, start=2.4), Fault(parameter="K", factor=0.7, start=2.0))


@pytest.mark.parametrize("n_lanes", [1, LANES, 2 * LANES + 1, 5 * LANES - 1])
def test_any_number_of_lanes_at_once(n_lanes: int) -> None:
    """Every bit of a lane is as if it were alone, a lane of no numbers among them spoils no other."""
    monitor, _ = run(plant("dc_motor")[2], recorded("dc_motor", 60))
    lanes = np.repeat(monitor.numbers("healthy.lane")[:, None], n_lanes, axis=1)
    lanes[SPEC.parameter_slice] *= np.linspace(0.5, 2.0, n_lanes)
    lanes[0, n_lanes // 2] = np.nan
    rows = np.array([monitor.row(number)[0] for number in range(20, 40)])
    following, innovations = plant("dc_motor")[2].advance(lanes, rows)
    for k in range(n_lanes):
        alone, off = plant("dc_motor")[2].advance(lanes[:, k : k + 1], rows)
        assert np.array_equal(following[:, k : k + 1], alone, equal_nan=True)
        assert np.array_equal(innovations[:, :, k : k + 1], off, equal_nan=True)
        assert np.isfinite(alone).all() == (k != n_lanes // 2)


def watched(fault: Fault | None) -> tuple[bytes, bytes]:
    """What a monitor remembers after a recording, and what it expected, in blocks."""
    samples = recorded("dc_motor", 300, fault)
    block = Samples(
        time=np.array([item.time for item in samples]),
        dt=np.array([item.dt for item in samples]),
        u=np.array([item.u for item in samples]),
        y=np.array([item.y for item in samples]),
    )
    monitor, expected, place = Monitor(plant("dc_motor")[2]), b"", 0
    while place < len(block):
        reports = monitor.take(block[place:])
        expected, place = expected + reports.expected.tobytes(), place + len(reports)
    return monitor.save().tobytes(), expected


def test_monitors_in_threads_of_their_own_know_nothing_of_each_other() -> None:
    """Several at a time, of one core, end up as each does alone."""
    alone = [watched(fault) for fault in FAULTS]
    assert len({saved for saved, _ in alone}) == len(FAULTS)
    with ThreadPoolExecutor(2 * len(FAULTS)) as threads:
        assert list(threads.map(watched, FAULTS * 4)) == alone * 4
