"""Limits of the detector from a promised mean time between false alarms.

While the plant is healthy and its model as accurate as declared, the innovations are white with known variance, so the
mean time until a CUSUM passes its limit h is known (Siegmund, Sequential Analysis, 1985, eq. 2.57):

    ARL(h) = (exp(2 k b) - 2 k b - 1) / (2 k^2)      b = h + 1.166, k the drift, in samples

and so is that until a slow error, an Ornstein-Uhlenbeck process x of standard deviation 1 and memory tau, leaves -l..l:

    T(l) = tau sqrt(pi/2) exp(l^2/2) / l             for large l (Kramers)

All statistics share the promise: the rates of their false alarms add up to one in the promised time. The sum of the
scatter has a limit of its own, which real sensors ask for; white innovations pass it once in 1e19 samples.
"""

from collections.abc import Callable
from math import exp, log, pi, sqrt

OVERSHOOT = 1.166  # by which a sum passes its limit on average, in standard deviations of an innovation
LEAST = 3.0  # a lower limit would alarm on noise whatever was promised
MOST = 200.0
_HALVINGS = 100


def cusum_limit(promise: float, step: float, n_outputs: int, drift: float, shares: int = 1) -> float:
    """Give the limit of the CUSUM.

    Parameters
    ----------
    promise : mean time between false alarms, s
    step : time between samples, s
    n_outputs : number of sensors, each with two sums
    drift : of the sums, in standard deviations
    shares : among how many kinds of statistic the promise is shared
    """
    samples = shares * 2 * n_outputs * promise / step

    def length(limit: float) -> float:
        reach = 2.0 * drift * (limit + OVERSHOOT)
        return (exp(reach) - reach - 1.0) / (2.0 * drift**2)

    return _first(length, samples)


def slow_error_limit(promise: float, memory: float, shares: int = 1) -> float:
    """Give the limit of a slow error in its declared standard deviations.

    Parameters
    ----------
    promise : mean time between false alarms, s
    memory : of the slow error, s
    shares : among how many slow errors, each of as many kinds of statistic, the promise is shared
    """

    def length(limit: float) -> float:
        return memory * sqrt(pi / 2.0) * exp(min(0.5 * limit**2, 500.0)) / limit

    return _first(length, shares * promise, low=1.0)


def _first(length: Callable[[float], float], wanted: float, low: float = LEAST) -> float:
    """Give the limit whose mean time is as wanted; `length` grows with it."""
    high = MOST
    if log(max(length(low), 1e-300)) >= log(max(wanted, 1e-300)):
        return low
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if length(middle) >= wanted else (middle, high)
    return high
