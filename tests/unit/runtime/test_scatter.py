"""The sum of the scatter: it finds a sensor that scatters more, and nothing else moves it."""

from collections.abc import Sequence
from dataclasses import replace
from math import log

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.accepting import accept
from faultbond.runtime.alarm import accumulated, detect, statistic
from faultbond.runtime.cusum import LAGS, added, no_sums
from faultbond.runtime.state import Sample, State, init
from faultbond.types import FaultKind
from made import changed, differing, plant, recorded, run

NAME = "dc_motor_current"
SPEC = plant(NAME)[1]
LIMIT = SPEC.thresholds.scatter_limit
ONSET, ROWS = 200, 420


def fed(scores: FloatArray, state: State | None = None) -> State:
    """The state after innovations, in their sd, of the first sensor; nan: missing, inf: blanked, -inf: after a gap."""
    state, place = state or changed(init(SPEC), begun=0, index=100), SPEC.sample_fields
    for score in scores:
        packed = np.zeros(SPEC.n_sample)
        packed[place["use"]] = [not np.isnan(score), 1.0]
        packed[place["scale"]] = [SPEC.thresholds.blank_factor if score == np.inf else 1.0, 1.0]
        state = changed(state, astray=np.full_like(state.healthy.astray, float(score == -np.inf)))
        value = float(score) if np.isfinite(score) else 0.0
        state = replace(state, sensors=accumulated(SPEC, state, packed, np.array([value, 0.0, 1.0, 1.0])))
        state = changed(state, index=state.clock.index + 1)
    return state


def height(state: State) -> float:
    """The least of the sums of the first sensor, which is what counts."""
    return float(state.sensors.scatter[:, 0].min())


def largest(scores: FloatArray) -> float:
    """The largest height on the way."""
    state, peak = None, 0.0
    for score in scores:
        state = fed(np.array([score]), state)
        peak = max(peak, height(state))
    return peak


def by_hand(scores: Sequence[float]) -> list[float]:
    """The sums of the first sensor after all scores, written down plainly."""
    ratio, clip = SPEC.thresholds.scatter_ratio, SPEC.thresholds.cusum_clip
    sums = [0.0] * LAGS
    for k, score in enumerate(scores):
        for lag in range(1, min(LAGS, k) + 1):
            square = min((score - scores[k - lag]) ** 2 / 2.0, clip**2)
            sums[lag - 1] = max(0.0, sums[lag - 1] + 0.5 * (1.0 - 1.0 / ratio**2) * square - log(ratio))
    return sums


def test_sums_are_those_by_hand() -> None:
    """Each sum adds the log-likelihood ratio of one difference, of variance 1 as declared, clipped."""
    scores = 2.0 * np.random.default_rng(1).standard_normal(80)
    state = fed(scores)
    assert state.sensors.scatter[:, 0] == pytest.approx(by_hand(list(scores)), rel=1e-12)
    assert height(state) > 1.0
    assert np.all(state.sensors.scatter[:, 1] == 0.0)


@pytest.mark.parametrize(("factor", "within"), [(2.0, 250), (3.0, 110), (5.0, 70)])
def test_more_noise_crosses(factor: float, within: int) -> None:
    """White innovations twice as large as declared reach the limit within 250 samples, larger ones earlier."""
    for seed in range(3):
        assert largest(factor * np.random.default_rng([seed, 2]).standard_normal(within)) > LIMIT


def test_noise_as_declared_stays_low() -> None:
    """White innovations as declared, and half as large again, stay far from the limit."""
    noise = np.random.default_rng(3).standard_normal(3000)
    assert largest(noise) < 0.2 * LIMIT
    assert largest(1.4 * noise) < 0.5 * LIMIT


@pytest.mark.parametrize("period", [2, 3, 4])
def test_an_oscillation_is_no_noise(period: int) -> None:
    """Innovations that swing by several sd, and return after up to four samples, add nothing."""
    swing = 2.5 * np.cos(2.0 * np.pi * np.arange(600) / period)
    assert largest(swing + 0.5 * np.random.default_rng(4).standard_normal(600)) < 0.1 * LIMIT


def test_a_bias_and_a_slow_error_are_no_noise() -> None:
    """A step, a ramp and a slow wave of the innovations add less than what one wild value may."""
    time = np.arange(600)
    for course in (np.where(time < 300, 0.0, 40.0), 0.01 * time, 2.5 * np.sin(time / 20.0)):
        noise = np.random.default_rng(5).standard_normal(600)
        assert largest(course + noise) < 0.2 * LIMIT


def test_a_few_wild_values_are_no_noise() -> None:
    """Five wild values in a row, or one in twenty, do not reach half of the limit."""
    noise = np.random.default_rng(6).standard_normal(1000)
    row, now_and_then = noise.copy(), noise.copy()
    row[500:505] += np.array([50.0, -50.0, 50.0, 50.0, -50.0])
    now_and_then[::20] += 50.0
    assert largest(row) < 0.5 * LIMIT
    assert largest(now_and_then) < 0.5 * LIMIT


def test_rounded_and_stuck_readings_are_no_noise() -> None:
    """Innovations of readings rounded to 3 sd, that go to and fro between two values or stand still, add nothing."""
    slow = np.cumsum(0.05 * np.random.default_rng(7).standard_normal(800))
    toggled = np.where(np.arange(800) % 2, 3.0, 0.0)
    for readings in (3.0 * np.round(slow / 3.0) - slow, toggled):
        assert largest(np.asarray(readings, dtype=np.float64)) < 0.1 * LIMIT
    assert largest(np.full(800, 2.0)) == 0.0


def test_missing_values_are_passed_over() -> None:
    """Values that are missing change nothing, so that a sensor that reads rarely is watched all the same."""
    scores = 2.0 * np.random.default_rng(8).standard_normal(60)
    rare = np.column_stack([scores, np.full((60, 2), np.nan)]).ravel()
    assert np.array_equal(fed(rare).sensors.scatter, fed(scores).sensors.scatter)
    assert np.array_equal(fed(rare).sensors.before, fed(scores).sensors.before)


@pytest.mark.parametrize("what", [np.inf, -np.inf])
def test_nothing_is_compared_across_a_step_or_a_gap(what: float) -> None:
    """After a blanked value, and after a gap, the sums keep their heights and the comparison begins anew."""
    before = fed(2.0 * np.random.default_rng(9).standard_normal(60))
    after = fed(np.array([what]), before)
    assert height(before) > 5.0
    assert np.array_equal(after.sensors.scatter[:, 0], before.sensors.scatter[:, 0])
    assert np.all(np.isnan(after.sensors.before[:, 0]))
    assert np.array_equal(fed(np.array([9.0]), after).sensors.scatter[:, 0], before.sensors.scatter[:, 0])


def test_the_onset_is_where_the_sum_began() -> None:
    """An alarm of the scatter names the sensor and begins where the first of its sums left 0."""
    quiet = fed(0.1 * np.random.default_rng(10).standard_normal(50))
    loud = fed(4.0 * np.random.default_rng(11).standard_normal(90), quiet)
    loud = changed(loud, cusum=np.zeros_like(loud.sensors.cusum))
    peak = statistic(SPEC, loud.sensors)
    assert peak[0] == pytest.approx(SPEC.thresholds.cusum_limit * height(loud) / LIMIT)
    detection, change = detect(SPEC, loud, peak)
    assert detection is not None
    assert detection.signals == (SPEC.outputs[0].name,)
    assert 145 <= change <= 152


def scattering(spec: EngineSpec, factor: float, rows: int = ROWS) -> tuple[Sample, ...]:
    """Samples of the motor whose current scatters so many times as much from `ONSET` on."""
    generator, index = np.random.default_rng(12), [item.name for item in spec.outputs].index("i")
    noise = np.zeros((rows, len(spec.outputs)))
    noise[ONSET:, index] = (factor**2 - 1.0) ** 0.5 * spec.outputs[index].noise
    more = noise * generator.standard_normal(noise.shape)
    return tuple(replace(item, y=item.y + extra) for item, extra in zip(recorded(NAME, rows), more, strict=True))


def test_a_sensor_that_scatters_is_found_and_named() -> None:
    """Three times the noise is found, dated and named; accepted, it is the new normal."""
    _, spec, engine = plant(NAME)
    samples = scattering(spec, 3.0, 700)
    state, reports = run(spec, engine, samples[:ROWS])
    (detection,) = [item.detection for item in reports if item.detection is not None]
    assert detection.signals == ("i",)
    assert ONSET < detection.sample < ONSET + 110
    assert detection.change_time == pytest.approx(samples[ONSET].time, abs=0.2)
    best = [item.diagnosis for item in reports if item.diagnosis is not None][-1].candidates[0]
    assert (best.components, best.kind) == (("i",), FaultKind.NOISE)
    index = len(spec.hypotheses) + [item.name for item in spec.instruments].index("i")
    state, _ = accept(spec, state, index)
    assert np.all(state.sensors.scatter == 0.0)
    assert np.all(np.isnan(state.sensors.before))
    assert np.all(state.sensors.scatter_start == state.clock.accepted)
    state, reports = run(spec, engine, samples[ROWS:], state)
    assert state.clock.alarm < 0
    assert not any(item.detection for item in reports)
    restored = State.restore(state.save())
    assert not differing(state, restored)


@pytest.mark.parametrize("wild", [np.nan, np.inf, -np.inf])
def test_a_score_that_is_no_number_leaves_all_sums_as_they_are(wild: float) -> None:
    """One innovation without a variance neither blinds the detector nor raises an alarm."""
    settings, sums = SPEC.thresholds, no_sums(2)
    for score in np.random.default_rng(9).standard_normal((20, 2)) + 1.0:
        sums = added(settings, sums, score, np.array([True, True]))
    after = added(settings, sums, np.array([wild, 1.0]), np.array([True, True]))
    for name in ("slow", "fast", "scatter", "before"):
        assert np.array_equal(getattr(after, name)[:, 0], getattr(sums, name)[:, 0])
        assert np.isfinite(getattr(after, name)).all()
    assert after.slow[0, 1] > sums.slow[0, 1]
    assert after.before[0, 1] == 1.0
