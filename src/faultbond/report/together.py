"""Correlations between parameters in words: which go together, and what that says of their ratio or product."""

import math
from collections.abc import Mapping, Sequence

from faultbond.model.graph import Correlation, Parameter
from faultbond.report.numbers import MINUS, figure

CLEAR = 0.5  # correlations that are told of a fit
MOST_TOLD = 6  # the closest of them


def together_texts(parameters: Mapping[str, Parameter], correlations: Sequence[Correlation]) -> list[str]:
    """Say which parameters go together, and how well their ratio, or their product, is known.

    Parameters
    ----------
    parameters : by name, with the nominal values and accuracies that hold
    correlations : of them
    """
    return [_text(parameters[item.one], parameters[item.other], item.value) for item in correlations]


def closest_texts(parameters: Mapping[str, Parameter], correlations: Sequence[Correlation]) -> list[str]:
    """Say the same of the few that go together most closely."""
    clear = sorted((item for item in correlations if abs(item.value) >= CLEAR), key=lambda item: -abs(item.value))
    more = len(clear) - MOST_TOLD
    return [*together_texts(parameters, clear[:MOST_TOLD]), *([f"and {more} more"] if more > 0 else [])]


def _text(one: Parameter, other: Parameter, value: float) -> str:
    """Say how well two parameters are known beside each other; of values about 0, or not known, there is no ratio."""
    words = f"{one.name} and {other.name} {value:g}"
    if one.nominal != 0.0 and other.nominal != 0.0:
        a, b = one.accuracy / one.nominal, other.accuracy / other.nominal
        what = "ratio" if value * a * b > 0.0 else "product"
        known = math.sqrt(a * a + b * b - 2.0 * abs(value * a * b))
        if known < 1.0:
            words = f"{words}: their {what} is known to {figure(100.0 * known, digits=2).number()} %"
    return words.replace("-", MINUS)
