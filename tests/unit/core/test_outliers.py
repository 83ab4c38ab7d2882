"""The start that the core solves from the first samples, and what it takes for wild among them."""

import ctypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from bare_core import aligned, compiled, text_of
from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.model.text import parse_model
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.compile import find_compiler
from plants import TWO_STORES

ROOT = Path(__file__).parents[3]
WRAPPERS = """
typedef struct {
    StartMemory start; SolveMemory solve; Filters filters; State state; Told told; double samples[MOST_FIRST][N_SAMPLE];
} Test;
int64_t t_size(void) { return (int64_t)sizeof(Test); }
int64_t t_begin(int64_t count, const double *u, double *y, int64_t again, Test *test, double *mean, double *covariance,
                double *inputs)
{
    State *state = &test->state;
    memset(test, 0xa5, sizeof *test);
    memset(state, 0, sizeof *state);
    forget_inputs(state, &test->told);
    state->inputs = test->told.inputs;
    state->clock.begun = -1;
    prepare_filters(&test->filters);
    for (int j = 0; j < N_OUTPUTS; j++) state->normal.noise[j] = state->sensors.nis[j] = 1.0;
    for (int64_t t = 0; t < count; t++) {
        Sample sample;
        sample.dt = SAMPLE_TIME;
        memcpy(sample.u, u + t * N_INPUTS, N_INPUTS * sizeof *u);
        memcpy(sample.y, y + t * N_OUTPUTS, N_OUTPUTS * sizeof *y);
        state->clock.index = t;
        pack_sample(state, &sample, &state->clock, &state->inputs, state->healthy.astray, test->samples[t]);
    }
    const int64_t wild = begin(state, count, NULL, (int)again, test->samples, mean, covariance, &test->start,
                               &test->solve, &test->filters.plain);
    for (int64_t k = 0; k < count * N_OUTPUTS; k++) y[k] = test->samples[k / N_OUTPUTS][SAMPLE_USE + k % N_OUTPUTS];
    memcpy(inputs, state->inputs.lowest, N_INPUTS * sizeof *inputs);
    memcpy(inputs + N_INPUTS, state->inputs.highest, N_INPUTS * sizeof *inputs);
    memcpy(inputs + 2 * N_INPUTS, state->inputs.odd, N_INPUTS * sizeof *inputs);
    return wild;
}
void t_lane(const double *mean, const double *covariance, int64_t n, const double *known, double *lane)
{
    healthy_lane(mean, covariance, (int)n, known, lane);
}
void t_least_squares(int64_t rows, const double *a, const double *right, double *x, double *spread, Test *test)
{
    SolveMemory *solve = &test->solve;
    solve->n_free = N_STATES;
    for (int c = 0; c < N_STATES; c++) memcpy(solve->rows[c], a + c * rows, (size_t)rows * sizeof *a);
    memcpy(solve->right, right, (size_t)rows * sizeof *right);
    triangularise(N_STATES, rows, solve);
    find_spread(solve);
    least_squares(N_STATES, rows, solve, x);
    memcpy(spread, solve->spread, sizeof solve->spread);
}
"""
RC, TANK, MOTOR = ((ROOT / f"examples/{name}/model.yaml").read_text() for name in ("rc", "tank", "dc_motor_current"))
STATED = RC.replace("parameters: {C: 100 uF}", "parameters: {C: 100 uF}, start: {q: 700 uC, sd: 10 uC}")
MODELS = {"rc": RC, "tank": TANK, "motor": MOTOR, "two stores": TWO_STORES, "stated": STATED}
STARTS = {"tank": {"tank.q": 0.2}, "motor": {"L.p": 3.75, "J.p": -3.0}}  # 26 kPa; 1.5 A, -2 rad/s
pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


class Begun(NamedTuple):
    """What the core found; `used`: readings that are, `inputs`: least, greatest and refused value of each."""

    wild: int
    mean: FloatArray
    covariance: FloatArray
    used: FloatArray
    inputs: FloatArray


@dataclass(frozen=True, eq=False)
class Core:
    """A core with wrappers of its static functions."""

    spec: EngineSpec
    library: ctypes.CDLL
    memory: FloatArray

    def call(self, name: str, *arguments: int | FloatArray | None) -> int:
        """Call a wrapper with whole numbers and arrays."""
        places = [item.ctypes.data if isinstance(item, np.ndarray) else item for item in arguments]
        function = getattr(self.library, name)
        function.restype = ctypes.c_int64
        return int(function(*(None if item is None else ctypes.c_int64(item) for item in places)))

    def begin(self, u: FloatArray, y: FloatArray, *, again: bool = False) -> Begun:
        """The start from raw values, (n_samples, n_inputs) and (n_samples, n_outputs)."""
        n = self.spec.parameter_slice.stop
        mean, covariance, inputs = np.zeros(len(self.spec.states)), np.zeros((n, n)), np.zeros((3, u.shape[1]))
        used = y.copy()
        wild = self.call("t_begin", len(u), u.copy(), used, int(again), self.memory, mean, covariance, inputs)
        return Begun(wild, mean, covariance, used, inputs.T)


@cache
def core(name: str, *options: str) -> Core:
    """The core of a plant."""
    spec, text = text_of(parse_model(MODELS[name], file=name), WRAPPERS)
    library = compiled(text, *options)
    return Core(spec, library, aligned(Core(spec, library, np.zeros(0)).call("t_size")))


@cache
def recorded(name: str, seed: int, u: tuple[float, ...] = (6.0,) * 20) -> tuple[FloatArray, FloatArray]:
    """Inputs and outputs of a nominal plant in motion."""
    graph = parse_model(MODELS[name], file=name)
    time = np.asarray(np.arange(20) * (graph.sample_time or 1.0))
    inputs = np.tile([60.0, 40.0], (20, 1)) if name == "tank" else np.array(u)[:, None]
    made = simulate(graph, Inputs(time=time, values=inputs), seed=seed, start=STARTS.get(name, {"C.q": 8e-4}))
    return made.inputs, made.outputs


def voltage(x0: float, product: float, u: FloatArray) -> FloatArray:
    """The voltage of a capacitor that began at x0 and is charged through a resistor, at each sample."""
    found = [x0]
    for before in u[:-1, 0]:
        found.append(before + (found[-1] - before) * np.exp(-0.02 / product))
    return np.array(found)


def test_a_linear_start_is_that_of_least_squares() -> None:
    """A voltage is that of a line fitted by numpy; its sd three times as wide, with what R and C may be off."""
    u, y = recorded("rc", 1)
    found, zero = core("rc").begin(u, y), voltage(0.0, 1.0, u)
    slope = voltage(1.0, 1.0, u) - zero
    best = float(slope @ (y[:, 0] - zero) / (slope @ slope))
    assert found.mean[0] == pytest.approx(best, abs=1e-4)
    by_factor = (voltage(best, 1.001, u) - voltage(best, 0.999, u)) / 0.002
    led = float(slope @ by_factor / (slope @ slope))
    assert found.covariance[0, 1:] == pytest.approx(-led * 0.03**2, rel=1e-2)
    assert found.covariance[0, 0] == pytest.approx(9.0 * 0.1**2 / (slope @ slope) + 2.0 * (0.03 * led) ** 2, rel=1e-2)
    assert found.covariance[1:, 1:] == pytest.approx(np.diag([0.03**2] * 2))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("name", "true", "good"), [("tank", [2.6e4], [180.0]), ("motor", [1.5, -2.0], [0.2, 0.1])])
def test_start_is_found(name: str, true: list[float], good: list[float], seed: int) -> None:
    """The start is within three of its own sds, these are no larger than the data allow, and nothing is wild."""
    found = core(name).begin(*recorded(name, seed))
    sd = np.sqrt(np.diag(found.covariance))[: len(true)]
    assert np.all(np.abs(found.mean - true) < 3.0 * sd)
    assert np.all(sd < 3.0 * np.array(good))
    assert np.linalg.eigvalsh(found.covariance[: len(true), : len(true)]).min() > 0.0
    assert found.wild == 0
    assert found.used.all()


def test_a_stated_start_is_taken_and_solved_again_after_a_loss() -> None:
    """What the model states is not asked of the samples, but it no longer holds once the plant has run."""
    u, y = recorded("rc", 1)
    one, two = (core("stated").begin(u, y, again=again) for again in (False, True))
    assert one.mean == pytest.approx([7.0], rel=1e-15)
    assert one.covariance[0, 0] == pytest.approx(0.1**2 + (7.0 * 0.03) ** 2)
    assert two.mean == pytest.approx(core("rc").begin(u, y).mean, rel=1e-6)


def test_a_precise_sensor_of_a_sum() -> None:
    """Two states that are shown only together: their sum is known, each by itself is as uncertain as it is large."""
    found = core("two stores").begin(np.full((20, 1), 3e6), np.full((20, 1), 3e6))
    states = found.covariance[:2, :2]
    assert found.mean.sum() == pytest.approx(3e6, rel=1e-9)
    assert np.all(np.sqrt(np.diag(states)) > 1e5)
    assert states.sum() < 1e-6 * np.trace(states)


@pytest.mark.parametrize("value", [1e6, -1e300])
@pytest.mark.parametrize("row", [0, 7, 19])
@pytest.mark.parametrize(("name", "column"), [("tank", 0), ("tank", 1), ("motor", 0)])
def test_a_wild_reading_counts_as_missing(name: str, column: int, row: int, value: float) -> None:
    """One wild reading leaves the very start that the others give without it."""
    u, y = recorded(name, 2)
    wild, missing = y.copy(), y.copy()
    wild[row, column], missing[row, column] = value, np.nan
    one, two = (core(name).begin(u, values) for values in (wild, missing))
    assert (one.wild, two.wild) == (1, 0)
    for found, expected in zip(one[1:4], two[1:4], strict=True):
        assert np.array_equal(found, expected)


@pytest.mark.parametrize(("first", "end"), [(0, 1), (4, 7), (10, 11), (17, 19)])
@pytest.mark.parametrize("value", [1e6, 40.0])
def test_an_input_that_strays_counts_as_missing(first: int, end: int, value: float) -> None:
    """Of an input that leaves its other values and comes back nothing is believed, and the start is as without it."""
    u, y = recorded("motor", 3)
    stray = u.copy()
    stray[first:end] = value
    found, plain = core("motor").begin(stray, y), core("motor").begin(u, y)
    rest = np.delete(u, slice(first, end))
    assert found.wild == end - first
    assert found.inputs[0] == pytest.approx([rest.min(), rest.max(), np.nan], nan_ok=True)
    assert np.all(np.abs(found.mean - plain.mean) < np.sqrt(np.diag(plain.covariance))[:2])


def test_the_last_input_is_judged_by_the_next_sample() -> None:
    """An input that strays at the last sample is refused, and counted only once that is sure."""
    u, y = recorded("motor", 3)
    found = core("motor").begin(np.r_[u[:-1], [[1e6]]], y)
    assert found.wild == 0
    assert found.inputs[0].tolist() == [u[:-1].min(), u[:-1].max(), 1e6]


@pytest.mark.parametrize(("first", "end"), [(14, 20), (5, 9)])
def test_a_step_that_the_readings_follow_is_believed(first: int, end: int) -> None:
    """A step of the input that goes on, and one that comes back, are no stray values where the readings follow."""
    u, y = recorded("motor", 1, tuple(9.0 if first <= k < end else 2.0 for k in range(20)))
    found = core("motor").begin(u, y)
    assert found.wild == 0
    assert found.inputs[0, 1] == u.max()


def test_a_step_that_goes_on_is_believed_where_no_reading_tells() -> None:
    """Of the last values of an input, unlike the others but like each other, nobody knows that they are wild."""
    u, y = recorded("motor", 1, tuple(9.0 if k >= 17 else 2.0 for k in range(20)))
    y = np.where(np.arange(20)[:, None] < 16, y, np.nan)
    assert core("motor").begin(u, y).inputs[0, 1] == u.max()
    back = np.where(np.arange(20)[:, None] < 19, u, 2.0)
    assert core("motor").begin(back, y).inputs[0, 1] < 4.0


@pytest.mark.parametrize("place", [4, 7, 14])
@pytest.mark.parametrize("bias", [-0.3, 0.3])
def test_a_step_is_believed_though_a_sensor_is_off(place: int, bias: float) -> None:
    """Before a step that makes up for what a sensor reads too much no value of the input is taken back."""
    for sign in (-1.0, 1.0):
        u, y = recorded("motor", 2, tuple(5.0 + sign * (k >= place) for k in range(20)))
        off = np.zeros(y.shape[1])
        off[0] = bias * np.abs(y[:, 0]).mean()
        found = core("motor").begin(u, y + off)
        assert np.ptp(found.inputs[0, :2]) > 0.7  # of 1 V, of which single values may scatter


def test_a_plant_that_runs_away_blames_no_reading() -> None:
    """Where no start fits since the inputs are absurd, no reading is taken out, and the start is a number."""
    u, y = recorded("tank", 1)
    found = core("tank").begin(np.full_like(u, -1e300), y)
    assert found.used.all()
    assert np.isfinite(found.mean).all()


def test_healthy_lane() -> None:
    """A lane holds the states, no slow error, healthy or known factors with their covariance, and input noise."""
    plant, place = core("motor"), np.triu_indices(8)
    lane, known, mean, states = np.zeros(45), np.zeros(45), np.array([1.0, 2.0]), np.array([[0.5, 0.1], [0.1, 0.7]])
    expected = np.diag([0.0, 0.0, *[0.03**2] * 5, 0.16**2])
    expected[:2, :2] = states
    plant.call("t_lane", mean, states, 2, None, lane)
    assert lane.tolist() == pytest.approx([1.0, 2.0, *[1.0] * 5, 0.0, *expected[place], 0.0], rel=1e-12)
    root = np.random.default_rng(1).normal(size=(8, 8))
    known[:8], known[8:-1] = np.arange(8.0), (root @ root.T)[place]
    expected[2:7, 2:7] = (root @ root.T)[2:7, 2:7]
    plant.call("t_lane", mean, states, 2, known, lane)
    assert lane.tolist() == pytest.approx([1.0, 2.0, *range(2, 7), 0.0, *expected[place], 0.0], rel=1e-12)


@pytest.mark.parametrize("size", [1.0, 1e12, 1e100])
def test_least_squares_of_any_size(size: float) -> None:
    """Solutions, and what is left unknown, agree with numpy, also where squares of the numbers have no room."""
    plant, generator = core("motor"), np.random.default_rng(4)
    x, spread, right = np.zeros(2), np.zeros((2, 2)), 1e250 * generator.normal(size=22)
    scaled = generator.normal(size=(22, 2))
    plant.call("t_least_squares", 22, np.ascontiguousarray((scaled * [size, 1.0]).T), right, x, spread, plant.memory)
    assert x * [size, 1.0] == pytest.approx(np.linalg.lstsq(scaled, right, rcond=None)[0], rel=1e-9)
    assert spread * np.outer([size, 1.0], [size, 1.0]) == pytest.approx(np.linalg.inv(scaled.T @ scaled), rel=1e-9)


def test_every_width_has_the_same_digits() -> None:
    """Where sums and products are not fused, 1, 2, 4 and 8 lanes at a time find the same start to the last bit."""
    u, y = (values.copy() for values in recorded("motor", 2))
    u[8], y[3, 0] = 50.0, 1e4
    one, *others = (core("motor", f"-DFB_LANES={n}").begin(u, y) for n in (1, 2, 4, 8))
    assert one.wild == 2
    for found in others:
        assert np.array_equal(found.mean, one.mean)
        assert np.array_equal(found.covariance, one.covariance)
