"""The slopes of a set of equations at a point, as a matrix; what fixes what, to first order."""

from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np

from faultbond.model.expression import Expression
from faultbond.structure.numeric import Value, is_nan, slopes, solve_linear
from faultbond.types import FloatArray

RANK_TOLERANCE = 1e-10  # of the largest singular value, rows and columns scaled
MAX_EXACT = 60  # equations that are looked at in exact arithmetic


def slope_matrix(residuals: Sequence[Expression], columns: Sequence[str], values: Mapping[str, Value]) -> FloatArray:
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


def fixes(residuals: Sequence[Expression], unknown: Sequence[str], values: Mapping[str, Value]) -> bool:
    """Whether equations fix as many unknowns near a solution: exactly where the values are fractions."""
    if len(residuals) <= MAX_EXACT and all(isinstance(value, Fraction | int) for value in values.values()):
        position = {name: k for k, name in enumerate(unknown)}
        rows = [slopes(residual, values, position)[1] for residual in residuals]
        placed = [{position[name]: slope for name, slope in row.items()} for row in rows]
        return solve_linear(placed, [Fraction(0)] * len(rows)) is not None
    matrix = slope_matrix(residuals, unknown, values)
    if not np.all(np.isfinite(matrix)):
        return False
    singular = np.linalg.svd(scaled(matrix, np.array([float(values[name]) for name in unknown])), compute_uv=False)
    return bool(singular[-1] > RANK_TOLERANCE * singular[0])
