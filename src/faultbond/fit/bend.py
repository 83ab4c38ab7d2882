"""By what a law is multiplied that goes with a signal otherwise than it says: a power of it, an exponential, or a bow.

A film that is told to carry heat with the flow to the power 0.8 and does with 0.55 is off by the flow to the power
-0.25; a winding grows by a power of its temperature, a duct's law has an exponent of its own. An efficiency is largest
somewhere between, which no power is: its logarithm is a parabola of that of the flow.
"""

from dataclasses import dataclass
from math import inf

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.model.expression import Binary, Call, Expression, Name, Number

LOW = 0.02  # part of the moments in which a signal is smaller than what counts as little of it
BELOW = 0.5  # times that, and
LEAST = 0.05  # times its usual size: below, a power stays as it is, and is not 0 or infinite
DIGITS = 2  # of the numbers that are written into a law
NOTHING = 1e-9  # of its last digit, by which a number may be larger than what it is rounded to


@dataclass(frozen=True, slots=True)
class Bend:
    """What a parameter goes with, its usual size, and the least and largest size for which that goes on, SI.

    by: a signal, an input, or what a law raises to a power; name: the signals and inputs in it; signed: whether it
    changes its sign, and its size counts. Without a least size the factor is an exponential, of what goes through zero
    without being a size. bowed: whether the square of its logarithm counts.
    """

    by: Expression
    name: str
    usual: float
    least: float = 0.0
    most: float = inf
    signed: bool = False
    bowed: bool = False

    def logarithm(self, values: FloatArray) -> FloatArray:
        """Give the logarithm of the factor for a power of 1, (n,), at values (n,)."""
        if not self.least:
            return values / self.usual
        logarithm = np.log(np.clip(np.abs(values), self.least, self.most) / self.usual)
        return np.square(logarithm) if self.bowed else logarithm

    def steepness(self, power: float) -> float:
        """Give by how much a power moves the logarithm of the factor from the usual size to twice of it."""
        doubled = np.log(2.0) ** (2.0 if self.bowed else 1.0) if self.least else 1.0
        return float(abs(power) * doubled)

    def factor(self, power: str) -> Expression:
        """Give the factor with the parameter that is its power."""
        if not self.least:
            return Call("exp", (Binary("/", Binary("*", Name(power), self.by), Number(self.usual)),))
        size = Call("abs", (self.by,)) if self.signed else self.by
        kept: Expression = Call("max", (size, Number(self.least)))
        kept = Call("min", (kept, Number(self.most))) if self.most < inf else kept
        ratio = Binary("/", kept, Number(self.usual))
        if not self.bowed:
            return Binary("**", ratio, Name(power))
        return Call("exp", (Binary("*", Name(power), Binary("**", Call("log", (ratio,)), Number(2.0))),))


def bend_by(by: Expression, name: str, values: FloatArray, *, own: bool, bowed: bool = False) -> Bend | None:
    """Give how a law may go with a signal; None where that is nothing, or always the same.

    Parameters
    ----------
    by, name : what it goes with, and the signals and inputs in that
    values : what it is at many moments, (n,), SI
    own : whether the law speaks of it already: then its size counts where it changes its sign
    bowed : whether by the square of its logarithm; its size counts
    """
    sizes = np.abs(values)
    if not len(values) or not np.all(np.isfinite(values)) or not sizes.max() > 0.0:
        return None
    if values.min() < 0.0 < values.max() and not own and not bowed:
        found = Bend(by, name, _rounded(float(sizes.max())))
    else:
        usual = float(np.exp(np.mean(np.log(np.maximum(sizes, LEAST * sizes.max())))))
        least = max(BELOW * float(np.quantile(sizes, LOW)), LEAST * usual)
        most = _rounded_up(float(sizes.max())) if bowed else inf  # a parabola goes anywhere beyond where it was seen
        signed = bool(values.min() < 0.0)
        found = Bend(by, name, _rounded(usual), _rounded(least), most, signed=signed, bowed=bowed)
    return found if np.ptp(found.logarithm(values)) > 0.0 else None


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")


def _rounded_up(value: float) -> float:
    step = 10.0 ** (np.floor(np.log10(value)) + 1 - DIGITS)
    return _rounded(float(np.ceil(value / step - NOTHING) * step))
