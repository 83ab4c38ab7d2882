"""What keeps filters as sure as they may be: usual squares, new beginnings, starts that know of parameters."""

from functools import cache

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import extremes, plan_lanes
from faultbond.contract.spec import EngineSpec, covariance_place
from faultbond.runtime import monitor
from faultbond.runtime.alarm import NIS_MEMORY, NIS_RANGE, NIS_TRUST, usual_squares
from faultbond.runtime.start import solve_start
from faultbond.runtime.state import Sample, init
from faultbond.runtime.stepped import ASTRAY, IN_REACH, renew_all_steps
from faultbond.runtime.trail import Trail
from faultbond.simulate import Fault, Inputs, simulate
from made import changed, plant, recorded, run, samples_of

LAST = monitor.RENEWALS[-1]


@pytest.mark.parametrize("size", [0.7, 1.0, 1.6])
def test_usual_squares_are_found(size: float) -> None:
    """After many samples they are the mean square of the normalised innovations; missing ones leave them alone."""
    spec = plant("dc_motor_current")[1]
    state, generator = changed(init(spec), begun=0), np.random.default_rng(1)
    for index in range(3 * NIS_MEMORY):
        score = np.array([size * generator.standard_normal(), np.nan])
        state = changed(state, index=index, nis=usual_squares(state, score))
    assert state.sensors.nis[0] == pytest.approx(size**2, rel=0.05)
    assert state.sensors.nis[1] == 1.0


def test_usual_squares_begin_as_declared_and_end_somewhere() -> None:
    """A hundred samples hardly count against the declaration, and no number of them leads out of the range."""
    spec = plant("dc_motor_current")[1]
    for score, end in ((0.0, NIS_RANGE[0]), (3.0, NIS_RANGE[1])):
        state = changed(init(spec), begun=0)
        for index in range(20 * NIS_TRUST):
            state = changed(state, index=index, nis=usual_squares(state, np.full(2, score)))
            if index == 100:
                assert np.all(np.abs(state.sensors.nis - 1.0) < 1.0)
        assert np.all(state.sensors.nis == pytest.approx(end, rel=1e-3))


def test_usual_squares_are_those_of_before_the_alarm() -> None:
    """While a fault is open nothing is learned of what is usual."""
    _, spec, engine = plant("dc_motor_current")
    samples = recorded("dc_motor_current", 400, Fault(parameter="K", factor=0.6, start=2.4))
    state, alarmed = init(spec), None
    for sample in samples:
        state, report = monitor.step(spec, engine, state, sample)
        alarmed = state.sensors.nis if report.detection is not None else alarmed
    assert alarmed is not None
    assert np.array_equal(state.sensors.nis, alarmed)
    assert np.any(state.sensors.nis != 1.0)


@cache
def diagnosing() -> tuple[EngineSpec, Trail, FloatArray]:
    """A motor with a fault, just before its last renewal: its trail, and the filters of its bank."""
    _, spec, engine = plant("dc_motor_current")
    samples = recorded("dc_motor_current", 600, Fault(parameter="R", factor=1.6, start=4.0))
    state = init(spec)
    for sample in samples:
        if state.clock.alarm >= 0 and state.clock.index == state.clock.alarm + LAST:
            break
        state, _ = monitor.step(spec, engine, state, sample)
    assert state.clock.index == state.clock.alarm + LAST
    trail, _ = monitor._cut_trail(changed(state, index=state.clock.index - 1), state.clock.alarm)
    return spec, trail, state.bank.steps


def test_all_that_may_lead_begins_again() -> None:
    """Filters within reach begin again and are not much less likely then; others follow the best, unlikely as ever."""
    spec, trail, before = diagnosing()
    plan = plan_lanes(spec)
    after = renew_all_steps(spec, plant("dc_motor_current")[2], trail, before)
    leading = extremes(plan, before[-1])[0]
    best = before[-1, leading]
    reach = np.where(best > best.max() - IN_REACH, IN_REACH, 0.0)
    assert len(set(reach)) == 2, "hypotheses beyond reach, and within"
    near = before[-1] >= (best - reach)[plan.hypothesis]
    assert np.array_equal(after[-1, ~near], before[-1, ~near])
    assert np.array_equal(after[:-1, ~near], after[:-1, leading[plan.hypothesis[~near]]])
    assert np.all(after[-1, near] > before[-1, near] - ASTRAY)
    changed = np.any(after != before, axis=0)
    assert changed.sum() > 0.5 * near.sum()
    name = [item.name for item in spec.parameters].index("R")
    single = plan.hypothesis == spec.hypotheses.index((name,))
    values = after[spec.parameter_slice.start + name, single & near & changed]
    assert len(values) > 1
    assert np.ptp(values) < 0.01


def test_a_filter_that_linearised_far_off_is_no_better_sure_than_others() -> None:
    """What began far off has, after the last renewal, the standard deviation of what began near."""
    spec, trail, before = diagnosing()
    spoilt, plan = before.copy(), plan_lanes(spec)
    name = [item.name for item in spec.parameters].index("R")
    place = spec.parameter_slice.start + name
    lane = int(extremes(plan, spoilt[-1])[0][spec.hypotheses.index((name,))])
    variance = covariance_place(spec, place, place)
    true = spoilt[variance, lane]
    spoilt[variance, lane] *= 0.01
    renewed = renew_all_steps(spec, plant("dc_motor_current")[2], trail, spoilt)
    assert renewed[variance, lane] == pytest.approx(true, rel=0.3)


def started(seed: int, off: float) -> tuple[EngineSpec, FloatArray, FloatArray, FloatArray]:
    """The start that is found of a running motor with other parameters, its covariance, and the truth beside it."""
    graph, spec, engine = plant("dc_motor_current")
    generator = np.random.default_rng(seed)
    factors = 1.0 + off * generator.standard_normal(len(spec.parameters))
    faults = [
        Fault(parameter=item.name, factor=float(factor), start=0.0)
        for item, factor in zip(spec.parameters, factors, strict=True)
    ]
    time = np.asarray(np.arange(monitor.START_SAMPLES) * 0.02, dtype=np.float64)
    inputs = Inputs(time=time, values=np.full((len(time), 1), 8.0))
    made = simulate(graph, inputs, faults, seed=seed, start={"L.p": 2.5 * 3.0, "J.p": 1.5 * 1.0})
    samples = samples_of(time, made.inputs, made.outputs)
    rows, place = np.zeros((len(samples), spec.n_sample)), spec.sample_fields
    rows[1:, place["dt"]], rows[:, place["scale"]], rows[:, place["use"]] = 0.02, 1.0, 1.0
    rows[:, place["u"]] = made.inputs
    rows[:, place["u_before"]] = made.inputs[[0, *range(len(rows) - 1)]]
    rows[:, place["y"]] = made.outputs
    mean, covariance = solve_start(spec, engine, rows)
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
    graph, spec, engine = plant("dc_motor_current")
    time = np.asarray(np.arange(300) * 0.02, dtype=np.float64)
    for seed in range(5):
        generator = np.random.default_rng(seed)
        faults = [
            Fault(parameter=item.name, factor=float(1.0 + 0.06 * generator.uniform(-1.0, 1.0)), start=0.0)
            for item in spec.parameters
        ]
        inputs = Inputs(time=time, values=np.full((len(time), 1), 8.0))
        made = simulate(graph, inputs, faults, seed=seed, start={"L.p": 2.5 * 3.0, "J.p": 1.5 * 1.0})
        state, _ = run(spec, engine, list[Sample](samples_of(time, made.inputs, made.outputs)))
        assert state.clock.alarm < 0
