"""What a plant can show on a recording."""

import numpy as np
import pytest
from plants import example

from faultbond.analysis.ranks import reduce
from faultbond.analysis.recorded import MOST_SAMPLES, recorded_runs
from faultbond.analysis.sensitivity import Sensitivity, build_recursion
from faultbond.dynamics.step import StepModel
from faultbond.errors import RecordingError
from faultbond.types import FloatArray


def runs(model: StepModel, times: FloatArray, inputs: FloatArray, start: FloatArray) -> tuple[Sensitivity, ...]:
    """The runs of a recording."""
    return recorded_runs(model, build_recursion(model.plant), times, inputs, start)


def test_a_short_recording_is_taken_whole() -> None:
    """Times, uneven ones too, and inputs are those of the recording; parameters are nominal."""
    model = example("dc_motor")
    times = 100.0 + np.cumsum(np.random.default_rng(0).uniform(0.01, 0.5, 30))
    inputs = np.sin(times)[:, None]
    (found,) = runs(model, times, inputs, np.array([0.1, 0.2]))
    assert found.times == pytest.approx(times - times[0])
    assert np.array_equal(found.inputs, inputs)
    assert found.x[0] == pytest.approx([0.1, 0.2])
    assert list(found.theta) == [item.nominal for item in model.plant.graph.parameters]


def test_a_long_recording_is_seen_as_a_whole_and_where_it_moves_most() -> None:
    """Blocks of equal rows keep the mean of the inputs; the window lies where they move, from the state there."""
    model = example("tank")
    n = 3000
    times = np.arange(n, dtype=np.float64)
    inputs = np.tile([60.0, 40.0], (n, 1))
    inputs[1800:1900, 0] += 10.0 * np.sin(np.arange(100))
    whole, window = runs(model, times, inputs, np.array([0.04]))
    assert len(whole.times) == len(window.times) == MOST_SAMPLES // 2
    assert np.diff(whole.times) == pytest.approx(10.0)
    assert whole.inputs.mean(axis=0) == pytest.approx(inputs.mean(axis=0))
    assert np.diff(window.times) == pytest.approx(1.0)
    moves = inputs[:, 0] != 60.0
    assert np.sum(window.inputs[:, 0] != 60.0) == moves.sum()
    assert window.x[0] in whole.x[150:190]


def test_missing_inputs_are_held() -> None:
    """An absent input keeps its last value; before the first value, that one is taken."""
    model = example("dc_motor")
    inputs = np.array([[np.nan], [2.0], [np.nan], [3.0], [np.nan]])
    (found,) = runs(model, np.arange(5.0), inputs, np.zeros(2))
    assert found.inputs[:, 0].tolist() == [2.0, 2.0, 2.0, 3.0, 3.0]


def test_recordings_without_values_are_refused() -> None:
    """An input without any value, or no row at all, is one clear line."""
    model = example("dc_motor")
    with pytest.raises(RecordingError, match="no row has a value of the input V; check its column `V`"):
        runs(model, np.arange(3.0), np.full((3, 1), np.nan), np.zeros(2))
    with pytest.raises(RecordingError, match="DC motor: the recording has no rows"):
        runs(model, np.zeros(0), np.zeros((0, 1)), np.zeros(2))


def test_what_a_recording_shows_depends_on_its_inputs() -> None:
    """Valves that stand still show four combinations of the tank's parameters, valves that move show six."""
    model = example("tank")
    times = np.arange(2400.0)
    still = np.tile([60.0, 40.0], (2400, 1))
    moving = np.where((times[:, None] // np.array([300.0, 200.0])) % 2 == 0, 30.0, 70.0)
    ranks = [reduce(runs(model, times, inputs, np.array([0.04]))).rank for inputs in (still, moving)]
    assert [(item.value, item.clear) for item in ranks] == [(4, True), (6, True)]
