"""Limits from a promise: what white innovations and slow errors really do keeps it."""

import numpy as np
import pytest

from faultbond.contract.spec import EngineSpec, Thresholds
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.promise import LEAST, cusum_limit, slow_error_limit
from faultbond.synthesis.specify import build_spec

MODEL = """
name: tank
sample_time: 1 s
{key}
inputs: {{u: {{unit: m^3/s}}}}
components:
  pump: {{type: Sf, law: f = u}}
  tank: {{type: C, law: q = A*e, parameters: {{A: 2 m^2}}}}
  pipe: {{type: R, law: e = R*f, parameters: {{R: 3 s/m^2}}}}
junctions: {{node: 0}}
bonds: [pump -> node -> tank, node -> pipe]
sensors: {{level: {{reads: node.e, unit: m, noise: 1 cm}}}}
slow_error: {{pipe.f: 2 % over 600 s}}
"""


def spec_of(key: str, errors: str = "pipe.f: 2 % over 600 s") -> EngineSpec:
    """Of the small tank with one more line in its model file, and slow errors."""
    text = MODEL.format(key=key).replace("pipe.f: 2 % over 600 s", errors)
    return build_spec(build_model(parse_model(text)))


def thresholds(key: str) -> Thresholds:
    """Settings of the small tank with one more line in its model file."""
    return spec_of(key).thresholds


@pytest.mark.parametrize("promise", [200.0, 500.0])
def test_white_innovations_keep_the_promise(promise: float) -> None:
    """Two sums of each of two sensors, fed with white innovations, alarm once in the promised time on average."""
    generator, runs = np.random.default_rng(1), 800
    limit = cusum_limit(promise, 1.0, 2, 0.3)
    sums, alarm = np.zeros((2, 2, runs)), np.full(runs, np.nan)
    for sample in range(1, 12 * int(promise)):
        score = np.clip(generator.standard_normal((2, runs)), -3.0, 3.0)
        sums = np.maximum(sums + np.stack([score, -score]) - 0.3, 0.0)
        alarm = np.where(np.isnan(alarm) & (sums.max(axis=(0, 1)) > limit), sample, alarm)
    assert not np.isnan(alarm).any()
    assert np.mean(alarm) == pytest.approx(promise, rel=0.12)


def test_slow_errors_keep_the_promise() -> None:
    """Two slow errors as declared leave the limit not more often than promised, and not much more rarely."""
    generator, runs, memory = np.random.default_rng(2), 100, 50.0
    limit = slow_error_limit(2000.0, memory, 2)
    keep = float(np.exp(-1.0 / memory))
    x, alarm = generator.standard_normal((2, runs)), np.full(runs, np.nan)
    for sample in range(1, 25_000):
        x = keep * x + np.sqrt(1.0 - keep**2) * generator.standard_normal(x.shape)
        alarm = np.where(np.isnan(alarm) & (np.abs(x).max(axis=0) > limit), sample, alarm)
        if not np.isnan(alarm).any():
            break
    assert 2000.0 * 0.95 < np.nanmean(alarm) < 2000.0 * 1.8


def test_limits_grow_with_the_promise() -> None:
    """A longer promise, more sensors and a shorter sample time need higher limits; there is a least one."""
    hour, month = 3600.0, 30 * 86400.0
    assert cusum_limit(hour, 1.0, 1, 0.3) < cusum_limit(month, 1.0, 1, 0.3)
    assert cusum_limit(month, 1.0, 1, 0.3) < cusum_limit(month, 1.0, 4, 0.3) < cusum_limit(month, 0.02, 4, 0.3)
    assert slow_error_limit(hour, 600.0) < slow_error_limit(month, 600.0) < slow_error_limit(month, 600.0, 3)
    assert slow_error_limit(month, 600.0) < slow_error_limit(month, 60.0)
    assert cusum_limit(1.0, 1.0, 1, 0.3) == LEAST


def test_absolute_errors_alarm_where_they_are_no_more_than_unusual() -> None:
    """The size of a part of a law is a bound, 1.6; that of an absolute error usual, 5; what sloshes does not alarm."""
    sloshing = "{size: 1 mm over 40 s, after: [u], each: 1 mm/(m^3/s)}"
    for errors, limits in (
        ("pipe.f: 2 % over 600 s, level: 2 mm over 600 s", [1.6, 5.0]),
        ("pump.f: 0.1 l/s over 60 s", [5.0]),
        (f"pipe.f: 2 % over 600 s, level: {sloshing}", [1.6, np.inf]),
    ):
        spec = spec_of("", errors)
        assert spec.slow_limits.tolist() == limits
        assert [item.alarms for item in spec.slow_errors] == [limit < np.inf for limit in limits]


def test_slow_errors_share_a_promise_evenly() -> None:
    """Each has its limit by its own memory: one that is soon another one does not deafen the others."""
    key, month = "time_between_false_alarms: 30 days", 30 * 86400.0
    slow, fast = spec_of(key, "pipe.f: 2 % over 600 s, level: 2 mm over 10 s").slow_limits
    assert (slow, fast) == pytest.approx([slow_error_limit(month, memory, 4) for memory in (600.0, 10.0)])
    assert slow < fast
    assert slow == spec_of(key, "pipe.f: 2 % over 600 s, level: 2 mm over 600 s").slow_limits[0]


def test_model_file_sets_the_limits() -> None:
    """Without the key the usual limits hold; with it they follow from the promise, shared by sums and slow errors."""
    usual, month = thresholds(""), 30 * 86400.0
    assert usual.cusum_limit == 26.0
    promised = thresholds("time_between_false_alarms: 30 days")
    assert promised.cusum_limit == pytest.approx(cusum_limit(month, 1.0, 1, usual.cusum_drift, 4))
    assert promised.fast_limit == pytest.approx(cusum_limit(month, 1.0, 1, usual.fast_drift, 4))
    assert promised.fast_limit < 20.0
    assert usual.fast_limit == 1000.0
    (slow,) = spec_of("time_between_false_alarms: 30 days").slow_limits
    assert slow == pytest.approx(slow_error_limit(month, 600.0, 2))
