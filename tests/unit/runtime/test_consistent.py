"""What keeps filters as sure as they may be: usual squares, and starts that know of parameters."""

import numpy as np
import pytest

from bare_core import bare
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from made import plant, recorded, run, samples_of

SETTINGS = core_settings()
CALLS = """
int64_t t_learn(State *state, const double *scores, const double *count)
{
    for (int64_t k = 0; k < (int64_t)*count; k++) {
        double packed[N_SAMPLE] = {0}, innovations[2 * N_OUTPUTS];
        for (int j = 0; j < N_OUTPUTS; j++) {
            packed[SAMPLE_USE + j] = packed[SAMPLE_SCALE + j] = innovations[N_OUTPUTS + j] = 1.0;
            innovations[j] = scores[k * N_OUTPUTS + j];
        }
        state->clock.index = k;
        accumulate(&state->clock, &state->inputs, &state->healthy, &state->sensors, packed, innovations);
    }
    return 0;
}
"""


def learned(scores: FloatArray) -> FloatArray:
    """Usual squares (2,) after normalised innovations (n, 2) from the first sample on."""
    core = bare(CALLS)
    core["clock.begun"] = 0
    core.call("t_learn", np.ascontiguousarray(scores), np.array([float(len(scores))]))
    return np.array(core["sensors.nis"])


@pytest.mark.parametrize("size", [0.7, 1.0, 1.6])
def test_usual_squares_are_found(size: float) -> None:
    """After many samples they are the mean square of innovations that count up to a bound; none leave them alone."""
    count = 3 * int(SETTINGS["NIS_MEMORY"])
    scores = size * np.random.default_rng(1).standard_normal((count, 2))
    scores[:, 1] = np.nan
    found = learned(scores)
    bound = bare(CALLS).spec.thresholds.cusum_clip
    assert found[0] == pytest.approx(np.mean(np.clip(scores[:, 0], -bound, bound) ** 2), rel=0.05)
    assert found[1] == 1.0


@pytest.mark.parametrize(("score", "end"), [(0.0, "NIS_LEAST"), (3.0, "NIS_MOST")])
def test_usual_squares_begin_as_declared_and_end_somewhere(score: float, end: str) -> None:
    """A hundred samples hardly count against the declaration, and no number of them leads out of the range."""
    count = 20 * int(SETTINGS["NIS_TRUST"])
    assert np.all(np.abs(learned(np.full((101, 2), score)) - 1.0) < 1.0)
    assert learned(np.full((count, 2), score)) == pytest.approx(np.full(2, SETTINGS[end]), rel=1e-3)


def test_usual_squares_are_those_of_before_the_alarm() -> None:
    """While a fault is open nothing is learned of what is usual."""
    core, alarmed = plant("dc_motor_current")[2], None
    monitor = Monitor(core)
    for sample in recorded("dc_motor_current", 400, Fault(parameter="K", factor=0.6, start=2.4)):
        found = monitor.step(sample).detection
        alarmed = monitor.numbers("sensors.nis") if found is not None else alarmed
    assert alarmed is not None
    assert np.array_equal(monitor.numbers("sensors.nis"), alarmed)
    assert np.any(alarmed != 1.0)


def started(seed: int, off: float) -> tuple[EngineSpec, FloatArray, FloatArray, FloatArray]:
    """The start that is found of a running motor with other parameters, its covariance, and the truth beside it."""
    graph, spec, core = plant("dc_motor_current")
    generator = np.random.default_rng(seed)
    factors = 1.0 + off * generator.standard_normal(len(spec.parameters))
    faults = [
        Fault(parameter=item.name, factor=float(factor), start=0.0)
        for item, factor in zip(spec.parameters, factors, strict=True)
    ]
    time = np.asarray(np.arange(int(SETTINGS["START_SAMPLES"])) * 0.02, dtype=np.float64)
    inputs = Inputs(time=time, values=np.full((len(time), 1), 8.0))
    made = simulate(graph, inputs, faults, seed=seed, start={"L.p": 2.5 * 3.0, "J.p": 1.5 * 1.0})
    samples = samples_of(time, made.inputs, made.outputs)
    rows, place = np.zeros((len(samples), spec.n_sample)), spec.sample_fields
    rows[1:, place["dt"]], rows[:, place["scale"]], rows[:, place["use"]] = 0.02, 1.0, 1.0
    rows[:, place["fresh"]] = spec.input_variance
    rows[:, place["u"]] = made.inputs
    rows[:, place["u_before"]] = made.inputs[[0, *range(len(rows) - 1)]]
    rows[:, place["y"]] = made.outputs
    mean, covariance = core.solve_start(rows)
    parameters = {item.name: item.nominal * factor for item, factor in zip(spec.parameters, factors, strict=True)}
    true = np.array([7.5 / parameters["L"], 1.5 / parameters["J"], *factors])
    return spec, mean, covariance, true


def test_start_is_off_with_the_parameters() -> None:
    """Where parameters are off, so is the start that was found; the covariance of both together says by how much.

    The parameters were drawn from what is declared, and the states' own part is taken three times as wide as the fit
    says. A covariance of the states alone would be broken by most plants.
    """
    together, alone = [], []
    for seed in range(30):
        spec, mean, covariance, true = started(seed, 0.15)
        n, wide = len(mean), covariance.copy()
        scale = np.ones(len(covariance))
        scale[n:] = 0.15 / 0.03  # as if that had been declared
        found = np.concatenate([mean, np.ones(len(spec.parameters))])
        wide *= np.outer(scale, scale)
        wide[:n, :n] += (scale[-1] ** 2 - 1.0) * _from_parameters(covariance, n)
        error = found - true
        together.append(error @ np.linalg.solve(wide, error) / len(error))
        own = covariance[:n, :n] - _from_parameters(covariance, n)
        alone.append(error[:n] @ np.linalg.solve(own, error[:n]) / n)
    assert np.mean(together) < 1.5
    assert np.mean(alone) > 3.0


def _from_parameters(covariance: FloatArray, n: int) -> FloatArray:
    """The part of the states' covariance, the first n, that goes with the parameters."""
    cross = covariance[:n, n:]
    return np.asarray(cross @ np.linalg.solve(covariance[n:, n:], cross.T))


def test_runs_from_a_start_with_parameters_off_are_quiet() -> None:
    """A motor whose parameters are off by twice what is declared raises no alarm as it begins."""
    graph, spec, core = plant("dc_motor_current")
    time = np.asarray(np.arange(300) * 0.02, dtype=np.float64)
    for seed in range(5):
        generator = np.random.default_rng(seed)
        faults = [
            Fault(parameter=item.name, factor=float(1.0 + 0.06 * generator.uniform(-1.0, 1.0)), start=0.0)
            for item in spec.parameters
        ]
        inputs = Inputs(time=time, values=np.full((len(time), 1), 8.0))
        made = simulate(graph, inputs, faults, seed=seed, start={"L.p": 2.5 * 3.0, "J.p": 1.5 * 1.0})
        monitor, _ = run(core, samples_of(time, made.inputs, made.outputs))
        assert monitor.number("clock.running") == 1
        assert monitor.number("clock.detections") == 0
