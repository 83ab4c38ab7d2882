"""Noise through the linearised detector, against the monitor."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.analysis import false_alarm_trials
from faultbond.analysis.false_alarm_trials import Bisection, Detector, alarms, windows_of
from faultbond.analysis.operation import usual_operation
from faultbond.app.realisations import compiled_detector
from faultbond.contract.samples import Sample
from faultbond.fit.cusum import added, height_of, no_sums
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.engine import build_core, build_engine
from faultbond.synthesis.specify import build_spec
from plants import example


@pytest.mark.parametrize("name", ["dc_motor_current", "rlc"])
def test_innovations_without_a_fault_are_white_and_of_unit_size(name: str) -> None:
    """Noise that passes the filter's recursion leaves as the filter expects: sd 1, no memory, and hardly an alarm."""
    model = example(name)
    spec = build_spec(model)
    operation = usual_operation(model, spec, build_engine(model.plant.graph)[1], 260)
    windows = windows_of(spec, operation, [60, 100], 100)
    noise = windows.noise
    assert np.std(noise, axis=(0, 1, 2)) == pytest.approx(1.0, abs=0.05)
    assert np.abs(np.mean(noise[:, 1:] * noise[:, :-1], axis=(0, 1, 2))).max() < 0.05
    assert windows.quiet.mean() > 0.9


def test_what_is_blanked_is_compared_with_nothing() -> None:
    """After a step that blanks a sensor the sum of its scatter begins anew, as in the monitor."""
    model = example("rlc")
    spec = build_spec(model)
    operation = usual_operation(model, spec, build_engine(model.plant.graph)[1], 200)
    always = replace(operation, blanked=np.ones_like(operation.counted))
    assert windows_of(spec, operation, [120], 20).sums.scatter.any()
    assert not windows_of(spec, always, [120], 20).sums.scatter.any()


def test_the_sums_are_those_of_the_monitor() -> None:
    """From the monitor's own innovations many realisations at once have the same sums, sample for sample.

    Of all sums: the sensor scatters for a while, and a promise makes the fast sums count.
    """
    model = example("dc_motor")
    built = build_spec(model)
    spec = replace(built, thresholds=replace(built.thresholds, fast_limit=12.0, cusum_limit=60.0))
    monitor = Monitor(build_core(model.plant, spec))
    time = 0.02 * np.arange(160, dtype=np.float64)
    made = simulate(model.plant.graph, Inputs(time=time, values=np.where(time < 1.5, 4.0, 9.0)[:, None]), seed=3)
    outputs = made.outputs.copy()
    outputs[110:125] += np.random.default_rng(5).standard_normal((15, 1)) * 4.0 * spec.output_noise
    sums, leading = no_sums(3, 1), set()
    for k in range(160):
        sample = Sample(time=float(time[k]), dt=0.02 * (k > 0), u=made.inputs[k], y=outputs[k])
        report = monitor.step(sample)
        if (
            monitor.number("clock.index") > spec.thresholds.warm_up_samples
            and monitor.number("clock.running")
            and k >= spec.thresholds.warm_up_samples
        ):
            score = (outputs[k] - report.expected) / np.sqrt(report.variance)
            sums = added(spec.thresholds, sums, np.array([score, -score, 0.0 * score]), np.array([True]))
            seen = height_of(spec.thresholds, sums)
            assert seen[0] == pytest.approx(report.cusum, abs=1e-9)
            assert seen[1] == pytest.approx(report.cusum, abs=1e-9)
            assert not seen[2].any()
            leading |= {"slow"} if seen[0] == sums.slow[:, 0].max() else {"other"}
    assert leading == {"slow", "other"}


@pytest.mark.parametrize(("shape", "promised"), [("step", False), ("step", True), ("burst", False)])
def test_the_factor_parts_what_alarms_from_what_does_not(shape: str, promised: bool) -> None:
    """With effects a little larger than the factor says most realisations alarm, with a little smaller ones too few.

    Counted sample by sample with the statistics of the monitor: for a step, with and without a promise, and for what
    moves the sum of the scatter alone.
    """
    model = example("rlc")
    built = build_spec(model)
    spec = replace(built, thresholds=replace(built.thresholds, fast_limit=6.0)) if promised else built
    operation = usual_operation(model, spec, build_engine(model.plant.graph)[1], 200)
    windows = windows_of(spec, operation, [50, 70, 90], 100)
    effects = np.full((101, 1, 3, 1), 0.2) * np.array([1.0, 0.8, 1.2])[:, None]
    if shape == "burst":
        effects *= np.random.default_rng(7).choice([-4.0, 4.0], (101, 1, 1, 1))
    detector = Detector(
        spec,
        windows,
        operation.counted[windows.rows],
        operation.blanked[windows.rows],
        compiled_detector(spec.thresholds),
    )
    (factor,) = detector.enough(effects, np.zeros((101, 1, 3, 0)), Bisection(np.log(20.0), 12, 1, 0.0), 0.6)
    share = []
    for larger in (1.02 * factor, factor / 1.02):
        sums, found = windows.sums, np.zeros(windows.quiet.shape, dtype=bool)
        for w in range(101):
            counted = operation.counted[windows.rows[:, w]][:, None, :]
            sums = added(spec.thresholds, sums, windows.noise[:, w] + larger * effects[w, 0][:, None, :], counted)
            found |= alarms(spec, sums, np.zeros((*found.shape, 0)))
        share.append(float(found[windows.quiet].mean()))
    assert share[0] > 0.6 > share[1] > 0.3


def test_a_filter_that_has_learned_begins_with_slow_errors_that_are_not_zero(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a least-squares estimate of a slow error and a parameter errs by where the slow error is truly zero."""
    spec = build_spec(example("tank"))
    n, place = spec.n_joint, spec.slow_slice.start
    k, other = spec.parameter_slice.start, spec.parameter_slice.start + 1
    prior = np.diag(np.full(n, 1e-12))
    prior[place, place], prior[place + 1, place + 1] = spec.slow_sizes**2
    prior[k, k] = prior[other, other] = 0.03**2
    seen = np.zeros(n)
    seen[[place, k]] = 1.0, 0.7  # one measurement of their sum, with noise 0.01
    gain = prior @ seen / (seen @ prior @ seen + 0.01**2)
    covariance = prior - np.outer(gain, seen @ prior)
    true = prior.copy()
    true[place, place] = true[place + 1, place + 1] = 0.0
    error = (np.eye(n) - np.outer(gain, seen)) @ true @ (np.eye(n) - np.outer(gain, seen)).T
    error += 0.01**2 * np.outer(gain, gain)
    monkeypatch.setattr(false_alarm_trials, "REALISATIONS", 40000)
    drawn = np.cov(false_alarm_trials._first_errors(spec, covariance, np.random.default_rng(1)).T)
    sizes = np.sqrt(np.maximum(np.diag(error), 1e-8))
    assert np.abs((drawn - error) / np.outer(sizes, sizes)).max() < 0.03
    assert error[place, place] > 0.2 * covariance[place, place]


def test_a_slow_error_that_inputs_kick_is_drawn_as_uncertain_as_it_is() -> None:
    """After a move it is larger than declared, so of it the difference to that has no covariance to be drawn from."""
    spec = build_spec(example("tank"))
    place = spec.slow_slice.start
    kicked = replace(spec.slow_errors[0], after=((0, 0.1),))
    after = replace(spec, slow_errors=(kicked, *spec.slow_errors[1:]))
    covariance = np.diag(np.full(spec.n_joint, 1e-12))
    covariance[place, place] = (1e4 * spec.slow_sizes[0]) ** 2
    drawn = false_alarm_trials._first_errors(after, covariance, np.random.default_rng(1))
    assert np.std(drawn[:, place]) == pytest.approx(1e4 * spec.slow_sizes[0], rel=0.2)
    assert np.all(np.isfinite(drawn))
