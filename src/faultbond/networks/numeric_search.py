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
from faultbond.networks.propagation import Propagated
from faultbond.networks.relations import holds, magnitude

FACTORS = {  # of the nominal values, by number of unknowns
    1: (1.0, 0.3, 3.0, 0.03, 30.0, -0.3, -3.0),
    2: (1.0, 0.3, 3.0, -1.0),
    3: (1.0, 0.3, 3.0),
}
MAX_STARTS = 30
_OUTSIDE = 1e6  # residual of a side without a real value
_SINGULAR = 1e-9
_SAME = 1e-6  # solutions closer than this, relative, are one


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A solution: values of the wanted unknowns; `free` where others lie in every neighbourhood of it."""

    values: Mapping[str, float]
    free: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Problem:
    """Equations of several observations; x holds the wanted unknowns, then the signals of each observation."""

    rows: tuple[Propagated, ...]
    wanted: tuple[str, ...]
    places: tuple[Mapping[str, int], ...]  # for each row: place in x by name
    scales: FloatArray  # of the equations
    count: int


def search(
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
    problem, rest = _problem(rows, wanted, signals)
    found: list[Found] = []
    for factors in starts(len(wanted)):
        first = [factor * (nominal[name] or 1.0) for factor, name in zip(factors, wanted, strict=True)]
        solution = _descend(problem, np.array([*first, *rest]))
        if solution is not None and not any(same(solution, other) for other in found):
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


def _problem(
    rows: Sequence[Propagated], wanted: tuple[str, ...], signals: Sequence[Mapping[str, Real]]
) -> tuple[_Problem, list[float]]:
    """Number the unknowns; give the problem and the start of all signals."""
    rest: list[float] = []
    places, scales = [], []
    for row, start in zip(rows, signals, strict=True):
        place = {name: k for k, name in enumerate(wanted)}
        for name in dict.fromkeys(name for equation in row.open for name in equation.names):
            if name not in row.known and name not in place:
                place[name] = len(wanted) + len(rest)
                value = magnitude(start[name]) if name in start else np.nan
                rest.append(float(start[name]) if np.isfinite(value) else 1.0)
        places.append(place)
        scales += [_scale(row, equation.names) for equation in row.open]
    problem = _Problem(
        rows=tuple(rows), wanted=wanted, places=tuple(places), scales=np.array(scales), count=len(wanted) + len(rest)
    )
    return problem, rest


def _scale(row: Propagated, names: Sequence[str]) -> float:
    sizes = [magnitude(row.known[name]) for name in names if name in row.known]
    return max([item for item in sizes if np.isfinite(item) and item > 0.0], default=1.0)


def _descend(problem: _Problem, start: FloatArray) -> Found | None:
    fit = least_squares(
        lambda x: _residuals(problem, x)[0],
        start,
        jac=lambda x: _residuals(problem, x)[1],
        x_scale=np.maximum(np.abs(start), 1e-3),
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=200,
    )
    x = np.asarray(fit.x, dtype=np.float64)
    if not all(_met(problem, x, k) for k in range(len(problem.rows))):
        return None
    values = {name: float(x[k]) for k, name in enumerate(problem.wanted)}
    return Found(values=values, free=_is_free(_residuals(problem, x)[1] * np.maximum(np.abs(x), 1e-3), problem))


def _residuals(problem: _Problem, x: FloatArray) -> tuple[FloatArray, FloatArray]:
    values, jacobian = [], []
    for row, place in zip(problem.rows, problem.places, strict=True):
        known = {**row.known, **{name: float(x[k]) for name, k in place.items()}}
        for equation in row.open:
            left, by_left = slopes(equation.left, known, place)
            right, by_right = slopes(equation.right, known, place)
            gap = float(left - right)
            line = np.zeros(problem.count)
            for name, slope in by_left.items():
                line[place[name]] += float(slope)
            for name, slope in by_right.items():
                line[place[name]] -= float(slope)
            values.append(gap if np.isfinite(gap) else _OUTSIDE)
            jacobian.append(np.where(np.isfinite(line), line, 0.0))
    return np.array(values) / problem.scales, np.array(jacobian) / problem.scales[:, None]


def _met(problem: _Problem, x: FloatArray, k: int) -> bool:
    row, place = problem.rows[k], problem.places[k]
    known = {**row.known, **{name: float(x[position]) for name, position in place.items()}}
    sizes = {name: magnitude(value) for name, value in known.items()}
    return all(holds(equation, known, sizes) for equation in row.open)


def _is_free(jacobian: FloatArray, problem: _Problem) -> bool:
    """Whether a wanted unknown can move without leaving the solutions, to first order."""
    _, singular, rows = np.linalg.svd(np.linalg.qr(jacobian, mode="r"), full_matrices=True)
    rank = int(np.sum(singular > _SINGULAR * max(singular.max(initial=0.0), 1e-300)))
    return bool(np.any(np.abs(rows[rank:, : len(problem.wanted)]) > _SAME))
