"""Values of unknowns that meet equations of any form, by least squares from several starts: not all, but some.

For equations that are no polynomials or too large, and where exact arithmetic finds none because data are rounded.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from faultbond.arrays import FloatArray
from faultbond.equations.numeric import Real, slopes
from faultbond.networks.least_squares import directions
from faultbond.networks.propagation import Propagated
from faultbond.networks.relations import holds, magnitude

FACTORS = {  # of the nominal values, by number of unknowns
    1: (1.0, 0.3, 3.0, 0.03, 30.0, -0.3, -3.0),
    2: (1.0, 0.3, 3.0, -1.0),
    3: (1.0, 0.3, 3.0),
}
MAX_STARTS = 30
_OUTSIDE = 1e6  # residual of a side without a real value
_SAME = 1e-6  # solutions closer than this, relative, are one

# An observation, the place of each of its unknowns, and the size of what is known in each equation.
_Part = tuple[Propagated, Mapping[str, int], Sequence[float]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A solution: values of the wanted unknowns; `free` where others lie in every neighbourhood of it."""

    values: Mapping[str, float]
    free: bool


def search_solutions(
    rows: Sequence[Propagated], nominal: Mapping[str, float], signals: Sequence[Mapping[str, Real]]
) -> list[Found]:
    """Give solutions that all rows share, nearest to the first start first.

    Parameters
    ----------
    rows : what propagation left of each observation
    nominal : the wanted unknowns with the values to start from
    signals : values of signals to start from, for each row
    """
    wanted = tuple(nominal)
    if not any(row.open for row in rows):
        return [Found(values=dict(nominal), free=bool(wanted))]
    rest: list[float] = []  # starts of the signals of all rows, which follow the wanted unknowns
    parts: list[_Part] = []
    for row, start in zip(rows, signals, strict=True):
        place = {name: k for k, name in enumerate(wanted)}
        for name in dict.fromkeys(name for equation in row.open for name in equation.names):
            if name not in row.known and name not in place:
                place[name] = len(wanted) + len(rest)
                value = magnitude(start[name]) if name in start else np.nan
                rest.append(float(start[name]) if np.isfinite(value) else 1.0)
        known = {name: size for name in row.known if np.isfinite(size := magnitude(row.known[name])) and size > 0.0}
        scales = [max((known[name] for name in item.names if name in known), default=1.0) for item in row.open]
        parts.append((row, place, scales))
    found: list[Found] = []
    for factors in starts(len(wanted)):
        first = [factor * (nominal[name] or 1.0) for factor, name in zip(factors, wanted, strict=True)]
        x = _descended(parts, np.array([*first, *rest]))
        if x is None:
            continue
        jacobian = _residuals(parts, x)[1] * np.maximum(np.abs(x), 1e-3)
        free = bool(directions(jacobian)[2][: len(wanted)].any())
        solution = Found(values={name: float(x[k]) for k, name in enumerate(wanted)}, free=free)
        if not any(same(solution, other) for other in found):
            found.append(solution)
            if solution.free or not wanted:
                return [solution]
    return found


def starts(count: int) -> list[tuple[float, ...]]:
    """Give factors of the nominal values to start from, those near them first."""
    factors = FACTORS.get(count, (1.0, 0.5) if count else ())
    nearest = sorted(product(factors, repeat=count), key=lambda item: sum(factor != 1.0 for factor in item))
    return nearest[:MAX_STARTS]


def same(one: Found, other: Found) -> bool:
    """Whether two solutions differ by rounding only."""
    pairs = ((value, other.values[name]) for name, value in one.values.items())
    return all(abs(a - b) <= _SAME * max(abs(a), abs(b)) for a, b in pairs)


def _descended(parts: Sequence[_Part], start: FloatArray) -> FloatArray | None:
    """Give the unknowns where least squares end, None where they do not meet all equations there."""
    fit = least_squares(
        lambda x: _residuals(parts, x)[0],
        start,
        jac=lambda x: _residuals(parts, x)[1],
        x_scale=np.maximum(np.abs(start), 1e-3),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=200,
    )
    x = np.asarray(fit.x, dtype=np.float64)
    for row, place, _ in parts:
        known = {**row.known, **{name: float(x[k]) for name, k in place.items()}}
        sizes = {name: magnitude(value) for name, value in known.items()}
        if not all(holds(equation, known, sizes) for equation in row.open):
            return None
    return x


def _residuals(parts: Sequence[_Part], x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give the misfit of each equation over its scale, and its slopes by the unknowns."""
    values, jacobian = [], []
    for row, place, _ in parts:
        known = {**row.known, **{name: float(x[k]) for name, k in place.items()}}
        for equation in row.open:
            left, by_left = slopes(equation.left, known, place)
            right, by_right = slopes(equation.right, known, place)
            gap = float(left - right)
            line = np.zeros(len(x))
            for name, slope in by_left.items():
                line[place[name]] += float(slope)
            for name, slope in by_right.items():
                line[place[name]] -= float(slope)
            values.append(gap if np.isfinite(gap) else _OUTSIDE)
            jacobian.append(np.where(np.isfinite(line), line, 0.0))
    scales = np.array([scale for *_, own in parts for scale in own])
    return np.array(values) / scales, np.array(jacobian) / scales[:, None]
