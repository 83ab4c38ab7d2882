"""The slopes of a set of equations at a point, as a matrix; what fixes what, to first order."""

from collections.abc import Mapping, Sequence
from enum import Enum
from fractions import Fraction

import numpy as np
from scipy.linalg.lapack import dgecon, dgetrf

from faultbond.arrays import FloatArray
from faultbond.equations.numeric import Real, is_nan, slopes, solve_linear
from faultbond.model.expression import Expression

WELL, SINGULAR = 1e-10, 1e-15  # reciprocal conditions of equations with rows and columns scaled
MAX_EXACT = 60  # equations that are looked at in exact arithmetic


def slope_matrix(residuals: Sequence[Expression], columns: Sequence[str], values: Mapping[str, Real]) -> FloatArray:
    """Give the derivatives of residuals by some names; shape (n_residuals, n_columns), nan where there is none."""
    position = {name: k for k, name in enumerate(columns)}
    matrix = np.zeros((len(residuals), len(columns)))
    for row, residual in enumerate(residuals):
        value, by = slopes(residual, values, position)
        if is_nan(value):
            matrix[row] = np.nan
        for name, slope in by.items():
            matrix[row, position[name]] = float(slope)
    return matrix


def scaled(matrix: FloatArray, sizes: FloatArray) -> FloatArray:
    """Give a matrix with columns in units of their sizes and rows of largest entry 1."""
    in_units = matrix * np.where(sizes == 0.0, 1.0, np.abs(sizes))
    largest = np.abs(in_units).max(axis=1, keepdims=True, initial=0.0)
    result: FloatArray = in_units / np.where(largest == 0.0, 1.0, largest)
    return result


class Fixed(Enum):
    """How well equations fix their unknowns near a solution."""

    WELL = "well"
    BARELY = "barely"
    NOT = "not"


def fixes(residuals: Sequence[Expression], unknown: Sequence[str], values: Mapping[str, Real]) -> Fixed:
    """Tell whether equations fix as many unknowns near a solution: exactly where the values are fractions.

    In floating point they fix them barely where rounding is amplified beyond use.
    """
    if len(residuals) <= MAX_EXACT and all(isinstance(value, Fraction | int) for value in values.values()):
        position = {name: k for k, name in enumerate(unknown)}
        rows = [slopes(residual, values, position)[1] for residual in residuals]
        placed = [{position[name]: slope for name, slope in row.items()} for row in rows]
        return Fixed.WELL if solve_linear(placed, [Fraction(0)] * len(rows)) is not None else Fixed.NOT
    matrix = slope_matrix(residuals, unknown, values)
    if not np.all(np.isfinite(matrix)):
        return Fixed.NOT
    closeness = reciprocal_condition(scaled(matrix, np.array([float(values[name]) for name in unknown])))
    if closeness > WELL:
        return Fixed.WELL
    return Fixed.BARELY if closeness > SINGULAR else Fixed.NOT


def reciprocal_condition(matrix: FloatArray) -> float:
    """Give an estimate of how far a square matrix is from singular ones, 1 being far and 0 singular.

    Source: Higham 1988 (LAPACK's gecon), on the factors of an LU decomposition.
    """
    norm = float(np.abs(matrix).sum(axis=0).max(initial=0.0))
    factors, _, info = dgetrf(matrix)
    if info != 0:
        return 0.0
    found, _ = dgecon(factors, norm, norm="1")
    return float(found)
