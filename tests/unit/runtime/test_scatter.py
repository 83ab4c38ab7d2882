"""A sensor that scatters more than declared, from the alarm to the new normal."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.runtime.monitor import Monitor
from faultbond.types import FaultKind
from made import differing, plant, recorded, run

NAME, ONSET, ROWS = "dc_motor_current", 200, 420


def test_a_sensor_that_scatters_is_found_and_named() -> None:
    """Three times the noise is found, dated and named; accepted, it is the new normal."""
    core = plant(NAME)[2]
    spec, generator = core.spec, np.random.default_rng(12)
    index = [item.name for item in spec.outputs].index("i")
    noise = np.zeros((700, len(spec.outputs)))
    noise[ONSET:, index] = (3.0**2 - 1.0) ** 0.5 * spec.outputs[index].noise
    more = noise * generator.standard_normal(noise.shape)
    samples = [replace(item, y=item.y + extra) for item, extra in zip(recorded(NAME, 700), more, strict=True)]
    monitor, reports = run(core, samples[:ROWS])
    (detection,) = [item.detection for item in reports if item.detection is not None]
    assert detection.signals == ("i",)
    assert ONSET < detection.sample < ONSET + 110
    assert detection.change_time == pytest.approx(samples[ONSET].time, abs=0.2)
    best = [item.diagnosis for item in reports if item.diagnosis is not None][-1].candidates[0]
    assert (best.components, best.kind) == (("i",), FaultKind.NOISE)
    monitor.accept(best.hypothesis)
    assert best.hypothesis == len(spec.hypotheses) + [item.name for item in spec.instruments].index("i")
    assert not monitor.numbers("sensors.scatter").any()
    assert np.isnan(monitor.numbers("sensors.before")).all()
    assert set(monitor.numbers("sensors.scatter_start")) == {monitor.number("clock.accepted")}
    monitor, reports = run(core, samples[ROWS:], monitor)
    assert monitor.number("clock.alarm") < 0
    assert not any(item.detection for item in reports)
    assert not differing(monitor, Monitor(core, monitor.save()))
