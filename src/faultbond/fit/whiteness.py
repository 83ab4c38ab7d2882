"""Whether what is left of a sensor's readings is white noise.

Source: Ljung and Box, Biometrika 65 (1978) 297; with missing values as Stoffer and Toloi 1992 (pairs that are there).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from faultbond.arrays import FloatArray

MOST_LAGS = 20
SHOWN_LAGS = 60
LEVEL = 0.01  # p below which it is not white
SLIGHT = 0.1  # a correlation below this is said to be slight


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Whiteness:
    """The test of one sensor over all recordings.

    correlation: (n_shown,), autocorrelation at lags 1, 2, ...; p: probability of a statistic as large from white noise,
    nan where there is too little; bound: 95 % of the correlations of white noise lie within it. spread: sd of the
    residuals, in those that the filter expects. mean: of the residuals, likewise.
    """

    sensor: str
    lags: int
    statistic: float
    p: float
    correlation: FloatArray
    bound: float
    spread: float
    mean: float

    @property
    def white(self) -> bool:
        """Whether white noise is not refuted."""
        return not self.p < LEVEL

    @property
    def words(self) -> str:
        """What it means."""
        if np.isnan(self.p):
            return "too few readings to judge"
        if self.white:
            return "white noise: nothing that could be foretold"
        first = float(self.correlation[0])
        if abs(first) < SLIGHT:
            return "nearly white: the model misses a little"
        if first > 0:
            return f"{100 * first:.0f} % of each error comes back in the next: the model misses something slow"
        return (
            f"errors alternate ({100 * first:.0f} %): something fast is missing, or the declared slow errors are large"
        )


def test_whiteness(sensor: str, residuals: Sequence[FloatArray]) -> Whiteness:
    """Test the standardised residuals of one sensor, an array (N,) for each recording; nan where there is none."""
    present = [item - np.nanmean(item) for item in residuals if np.isfinite(item).sum() > 1]
    values = np.concatenate([item[np.isfinite(item)] for item in residuals]) if residuals else np.zeros(0)
    n = len(values)
    lags = int(min(MOST_LAGS, n // 5))
    power = sum(float(np.nansum(item**2)) for item in present)
    if lags < 1 or power <= 0.0:
        empty = np.zeros(0)
        return Whiteness(
            sensor=sensor, lags=0, statistic=0.0, p=np.nan, correlation=empty, bound=1.0, spread=np.nan, mean=np.nan
        )
    shown = max(lags, min(SHOWN_LAGS, n // 4))
    counts = np.array([sum(_pairs(item, lag)[1] for item in present) for lag in range(1, shown + 1)], dtype=float)
    sums = np.array([sum(_pairs(item, lag)[0] for item in present) for lag in range(1, shown + 1)])
    correlation = np.where(counts > 0, sums / np.maximum(counts, 1.0), 0.0) / (power / n)
    squares = correlation[:lags] ** 2 * np.maximum(counts[:lags], 1.0) / n
    statistic = float((n + 2) * np.sum(squares))
    return Whiteness(
        sensor=sensor,
        lags=lags,
        statistic=statistic,
        p=float(chdtrc(lags, statistic)),
        correlation=correlation,
        bound=float(1.96 / np.sqrt(n)),
        spread=float(np.sqrt(np.mean(values**2))),
        mean=float(np.mean(values)),
    )


def _pairs(values: FloatArray, lag: int) -> tuple[float, int]:
    """Give the sum of the products of values so far apart, and their number."""
    if lag >= len(values):
        return 0.0, 0
    products = values[lag:] * values[:-lag]
    here = np.isfinite(products)
    return float(products[here].sum()), int(here.sum())
