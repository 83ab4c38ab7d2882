"""When a drifting value reaches a limit: from the value and rate of now, with their covariance.

A straight line v + r t with v, r normal has passed the limit by t with the probability that v + r t lies beyond it,
which is normal too; early, median and late times are where that probability is 5 %, 50 % and 95 %.
"""

from collections.abc import Callable
from math import inf, sqrt
from statistics import NormalDist

from faultbond.contract.findings import Forecast

PARTS = (0.05, 0.5, 0.95)
_LONGEST = 1e12  # s: a limit that is not reached by then is not reached
_HALVINGS = 200


def forecast(
    time: float,
    limit: float,
    value: float,
    rate: float,
    covariance: tuple[float, float, float],
    healthy: float | None = None,
) -> Forecast:
    """Give when a drifting value reaches a limit; now, where it has passed it.

    Parameters
    ----------
    time : now, s
    limit : the value that matters
    value, rate : of now, and per second
    covariance : variance of the value, covariance of both, variance of the rate
    healthy : the value from which a limit beyond it is passed; None: that of now, which has not passed any
    """
    side = 1.0 if limit >= (value if healthy is None else healthy) else -1.0
    ahead, speed = side * (limit - value), side * rate

    def passed(after: float) -> float:
        spread = covariance[0] + 2.0 * covariance[1] * after + covariance[2] * after**2
        return NormalDist().cdf((speed * after - ahead) / sqrt(max(spread, 1e-300)))

    early, median, late = (_first(passed, part) for part in PARTS)
    return Forecast(limit=limit, time=_at(time, median), earliest=_at(time, early), latest=_at(time, late))


def _first(passed: Callable[[float], float], part: float) -> float:
    """Give the first time at which a probability has been reached; inf if it never is."""
    high = 1.0
    while passed(high) < part:
        high *= 2.0
        if high > _LONGEST:
            return inf
    low = 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (low, middle) if passed(middle) >= part else (middle, high)
    return high


def _at(time: float, after: float) -> float | None:
    return None if after == inf else time + after
