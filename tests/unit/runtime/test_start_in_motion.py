"""A monitor that begins on a plant that is already in motion."""

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.simulate import Inputs, simulate, sines
from made import graph_of, plant, run, samples_of


def moving(rows: int) -> tuple[tuple[Sample, ...], FloatArray]:
    """The RLC circuit under two sines, with its voltage of C and current of L."""
    graph = graph_of("rlc")
    time = np.asarray(np.arange(rows) * 0.025, dtype=np.float64)
    values = sines(time, [(10.0, 0.25, 1.0), (4.0, 0.6, 2.0)])[:, None]
    made = simulate(graph, Inputs(time=time, values=values), seed=3)
    return samples_of(time, made.inputs, made.outputs), made.states / np.array([0.05, 5.0])


@pytest.mark.parametrize("first", [213, 480, 731, 1102])
def test_a_settled_zero_says_nothing_of_the_size(first: int) -> None:
    """With constant voltage the coil's current would settle at 0, but for rounding; in motion it is found all the same.

    So a monitor that begins in the middle raises no alarm.
    """
    samples, true = moving(1300)
    core = plant("rlc")[2]
    monitor, _ = run(core, samples[first : first + 25])
    assert np.all(np.abs(monitor.numbers("healthy.lane")[:2] - true[first + 24]) < [2.0, 0.4])  # of 20 V and 2 A
    _, reports = run(core, samples[first + 25 : first + 200], monitor)
    assert all(report.detection is None for report in reports)
