"""When a drifting value reaches a limit: quantiles against many straight lines."""

import ctypes

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bare_core import compiled
from diagnosed import text_of
from faultbond.arrays import FloatArray

LINES = 200_000
PARTS = (0.05, 0.5, 0.95)

Times = tuple[float | None, ...]


def forecast(
    time: float,
    limit: float,
    value: float,
    rate: float,
    covariance: tuple[float, float, float],
    healthy: float | None = None,
) -> Times:
    """Early, median and late time; None: never. healthy: where the value began; None: where it is."""
    known = np.array([time, limit, value, rate, *covariance, value if healthy is None else healthy])
    found = np.zeros(4)
    compiled(text_of()).t_forecast(*(ctypes.c_void_p(item.ctypes.data) for item in (known, found)))
    assert found[0] == limit
    return tuple(None if np.isnan(found[k]) else float(found[k]) for k in (2, 1, 3))


def lines(value: float, rate: float, covariance: tuple[float, float, float]) -> tuple[FloatArray, FloatArray]:
    """Values and rates drawn from their normal distribution."""
    matrix = np.array([[covariance[0], covariance[1]], [covariance[1], covariance[2]]])
    drawn = np.random.default_rng(4).multivariate_normal([value, rate], matrix, LINES)
    return drawn[:, 0], drawn[:, 1]


@pytest.mark.parametrize(
    ("limit", "value", "rate", "covariance"),
    [
        (10.0, 4.0, 0.02, (0.04, 0.0, 1e-6)),
        (10.0, 4.0, 0.02, (0.25, 8e-4, 9e-6)),
        (10.0, 4.0, 0.02, (0.25, -1.2e-3, 9e-6)),
        (-3.0, 1.0, -0.5, (0.09, 0.0, 0.01)),
    ],
)
def test_quantiles_are_those_of_many_lines(
    limit: float, value: float, rate: float, covariance: tuple[float, float, float]
) -> None:
    """At the early, median and late time 5 %, 50 % and 95 % of lines drawn at random lie beyond the limit."""
    values, rates = lines(value, rate, covariance)
    for time, part in zip(forecast(100.0, limit, value, rate, covariance), PARTS, strict=True):
        assert time is not None
        beyond = np.sign(limit - value) * (values + rates * (time - 100.0) - limit) >= 0.0
        assert np.mean(beyond) == pytest.approx(part, abs=4.0 * np.sqrt(part * (1.0 - part) / LINES))


def test_a_known_drift_arrives_when_it_does() -> None:
    """A value and rate without doubt reach the limit at one time, that of the straight line."""
    assert forecast(50.0, 7.0, 3.0, 0.25, (0.0, 0.0, 0.0)) == pytest.approx((66.0, 66.0, 66.0), rel=1e-12)


def test_a_drift_that_leads_away_never_arrives() -> None:
    """A value that moves away from the limit, or stands still, never reaches it; both sides are alike."""
    for value, rate, rate_sd in ((3.0, -0.25, 0.01), (3.0, 0.0, 0.0), (9.0, 0.25, 0.01)):
        assert forecast(0.0, 7.0, value, rate, (1e-6, 0.0, rate_sd**2)) == (None, None, None)


def test_a_doubtful_drift_may_never_arrive() -> None:
    """Where the rate has the other sign with more than 5 %, there is an early and a median time and no late one."""
    early, median, late = forecast(0.0, 7.0, 3.0, 1.0, (0.0, 0.0, 1.0))
    assert median == pytest.approx(4.0)
    assert early == pytest.approx(4.0 / (1.0 + 1.6448536269514722))
    assert late is None


def test_a_value_at_its_limit_is_there_now() -> None:
    """A value that may be beyond the limit already has its early time now."""
    early, median, _ = forecast(20.0, 7.0, 6.9, 0.1, (1.0, 0.0, 1e-6))
    assert (early, median) == pytest.approx((20.0, 21.0))


@given(
    st.floats(-5.0, 5.0),
    st.floats(-1.0, 1.0),
    st.floats(0.01, 2.0),
    st.floats(0.001, 0.5),
    st.floats(-0.9, 0.9),
)
@settings(max_examples=100, deadline=None)
def test_times_are_in_order_and_mirrored(value: float, rate: float, sd: float, rate_sd: float, coupling: float) -> None:
    """Early, median and late times follow each other, from now on; turning all signs changes none of them."""
    covariance = (sd**2, coupling * sd * rate_sd, rate_sd**2)
    found = forecast(30.0, 6.0, value, rate, covariance)
    order = [np.inf if time is None else time for time in found]
    assert order == sorted(order)
    assert order[0] >= 30.0
    assert forecast(30.0, -6.0, -value, -rate, covariance) == found


def test_a_limit_that_is_passed_is_reached_now() -> None:
    """A value beyond a limit, seen from the healthy one, has reached it, however it moves; before it nothing is new."""
    for rate in (0.25, -0.25):
        sure = forecast(50.0, 7.0, 9.0, rate, (1e-6, 0.0, 1e-6), 3.0)
        assert sure == pytest.approx((50.0, 50.0, 50.0), abs=1e-9)
    early, median, late = forecast(50.0, 7.0, 7.1, 0.25, (0.25, 0.0, 1e-6), 3.0)
    assert (early, median) == pytest.approx((50.0, 50.0), abs=1e-9)
    assert late is not None
    assert late > 51.0
    assert forecast(50.0, 7.0, 5.0, 0.25, (0.25, 0.0, 1e-6), 3.0) == forecast(50.0, 7.0, 5.0, 0.25, (0.25, 0.0, 1e-6))
