"""What a plant can show on a recording."""

import numpy as np
import pytest

from faultbond.analysis.capability import on_record
from faultbond.analysis.ranks import reduce
from faultbond.analysis.replay import MOST_SAMPLES, recorded_runs
from faultbond.analysis.sensitivity import Sensitivity, build_recursion
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from faultbond.errors import RecordingError
from plants import example


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


def steady(n: int) -> tuple[StepModel, FloatArray, FloatArray, FloatArray]:
    """The motor at rest under 10 V: the model, times, inputs and readings with noise."""
    model = example("dc_motor")
    speed = 10.0 * 2.0 / (3.0 * 0.4 + 2.0**2)
    readings = speed + 0.06 * np.random.default_rng(0).standard_normal((n, 1))
    return model, np.linspace(0.0, 0.02 * (n - 1), n), np.full((n, 1), 10.0), readings


@pytest.mark.parametrize("n", [400, 3000])
def test_the_start_is_fitted_to_the_readings(n: int) -> None:
    """Of a motor at rest, guessed half as fast, the start comes out as the rest that it is, and pairs do not show."""
    model, times, inputs, readings = steady(n)
    recursion = build_recursion(model.plant)
    rest = np.array([2.5 * 10.0 * 0.4 / 5.2, 1.5 * 20.0 / 5.2])
    guessed = recorded_runs(model, recursion, times, inputs, 0.5 * rest)
    fitted = recorded_runs(model, recursion, times, inputs, 0.5 * rest, readings)
    assert fitted[0].x[0] == pytest.approx(rest, rel=0.1)
    assert fitted[0].y[:, 0] == pytest.approx(20.0 / 5.2, abs=0.06)
    pairs = [
        sum(
            item.testable for item in on_record(model, recursion, found).judgement.verdicts if len(item.parameters) == 2
        )
        for found in (guessed, fitted)
    ]
    assert pairs == [10, 0]


def test_a_start_that_fits_is_left_though_parameters_are_off() -> None:
    """What healthy parameters within their accuracy explain does not move the start."""
    model = example("dc_motor")
    recursion = build_recursion(model.plant)
    times = np.linspace(0.0, 9.98, 500)
    inputs = np.asarray(np.where(np.sin(2.5 * times) > 0, 10.0, -10.0), dtype=np.float64)[:, None]
    start = np.array([1.0, 4.0])
    (nominal,) = recorded_runs(model, recursion, times, inputs, start)
    readings = nominal.y + 0.01 * nominal.by_theta[:, :, 0] - 0.02 * nominal.by_theta[:, :, 2]
    (found,) = recorded_runs(model, recursion, times, inputs, start, readings)
    assert found.x[0] == pytest.approx(start, abs=0.03)


def test_absent_readings_show_nothing() -> None:
    """A sensor without values in the recording tells nothing; with values in some rows these rows count."""
    model, times, inputs, readings = steady(400)
    recursion = build_recursion(model.plant)
    blind = np.full_like(readings, np.nan)
    assert reduce(recorded_runs(model, recursion, times, inputs, np.zeros(2), blind)).rank.value == 0
    readings[::2] = np.nan
    (found,) = recorded_runs(model, recursion, times, inputs, np.zeros(2), readings)
    assert not found.by_theta[::2].any()
    assert not found.by_start[::2].any()
    assert found.by_theta[1::2].any()


def test_readings_of_a_block_are_those_that_are_there() -> None:
    """In a long recording with one reading in ten, each block of ten still has one."""
    model, times, inputs, readings = steady(3000)
    readings[np.arange(3000) % 10 != 7] = np.nan
    whole, _ = recorded_runs(model, build_recursion(model.plant), times, inputs, np.zeros(2), readings)
    assert whole.by_theta[1:].any(axis=(1, 2)).all()


def test_each_input_counts_by_its_range() -> None:
    """The busy window is where the inlet valve dances by a per cent, not where the outlet goes once by fifty."""
    model = example("tank")
    inputs = np.tile([60.0, 40.0], (3000, 1))
    inputs[2000:2100, 0] += np.where(np.arange(100) % 2, 1.0, 0.0)
    inputs[500:, 1] = 90.0
    inputs[510:520, 1] = 40.0
    _, window = runs(model, np.arange(3000.0), inputs, np.array([0.04]))
    assert np.ptp(window.inputs[:, 0]) == 1.0
