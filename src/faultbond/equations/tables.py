"""Measured curves as pieces: straight lines, or cubics that rise and fall where the points do.

Each piece is a polynomial in x less its left end; which one holds is found by halves. So the slope is exactly that of
the piece, and at a point that of the piece on its right.
Source: Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300 (slopes inside); ends as in Moler, Numerical
Computing with Matlab, section 3.6.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

from faultbond.model.expression import TABLE, Binary, Call, Expression, Negative, Number
from faultbond.model.graph import Curve

_Piece = tuple[float, tuple[float, ...]]  # left end, and coefficients by rising power of the distance from there


def with_curves(expression: Expression, tables: Mapping[str, Curve]) -> Expression:
    """Give an expression in which every look into a table is a choice among polynomials."""
    if not tables:
        return expression
    match expression:
        case Negative(operand):
            return Negative(with_curves(operand, tables))
        case Binary(operator, left, right):
            return Binary(operator, with_curves(left, tables), with_curves(right, tables))
        case Call(function, arguments):
            inner = tuple(with_curves(item, tables) for item in arguments)
            if not function.startswith(TABLE):
                return Call(function, inner)
            table = tables[function.removeprefix(TABLE)]
            return _chosen(pieces_of(table), table.x, inner[0])
    return expression


def pieces_of(table: Curve) -> tuple[_Piece, ...]:
    """Give the pieces: one below the first point, one from each point to the next, and one above the last."""
    x, y = table.x, table.y
    slopes = _monotone_slopes(x, y) if table.monotone and len(x) > 2 else None
    inner: list[_Piece] = []
    for k in range(len(x) - 1):
        width, mean = x[k + 1] - x[k], (y[k + 1] - y[k]) / (x[k + 1] - x[k])
        if slopes is None:
            inner.append((x[k], (y[k], mean)))
            continue
        left, right = slopes[k], slopes[k + 1]
        bend, twist = (3.0 * mean - 2.0 * left - right) / width, (left + right - 2.0 * mean) / width**2
        inner.append((x[k], (y[k], left, bend, twist)))
    ends = (inner[0][1][1], slopes[-1] if slopes is not None else inner[-1][1][1])
    first, last = (0.0, 0.0) if not table.continues else ends
    return (x[0], (y[0], first)), *inner, (x[-1], (y[-1], last))


def _monotone_slopes(x: Sequence[float], y: Sequence[float]) -> list[float]:
    """Give the slopes at the points: a harmonic mean of those of the lines beside, 0 where these differ in sign."""
    widths = [after - before for before, after in pairwise(x)]
    lines = [(after - before) / width for (before, after), width in zip(pairwise(y), widths, strict=True)]
    found = [_end_slope(widths[0], widths[1], lines[0], lines[1])]
    for (h, g), (one, two) in zip(pairwise(widths), pairwise(lines), strict=True):
        weights = 2.0 * g + h, g + 2.0 * h
        found.append(sum(weights) / (weights[0] / one + weights[1] / two) if one * two > 0.0 else 0.0)
    return [*found, _end_slope(widths[-1], widths[-2], lines[-1], lines[-2])]


def _end_slope(width: float, next_width: float, line: float, next_line: float) -> float:
    """Give the slope at an end, of the parabola through three points, where that keeps the shape."""
    slope = ((2.0 * width + next_width) * line - width * next_line) / (width + next_width)
    if slope * line <= 0.0:
        return 0.0
    return 3.0 * line if line * next_line < 0.0 and abs(slope) > abs(3.0 * line) else slope


def _chosen(pieces: Sequence[_Piece], knots: Sequence[float], x: Expression) -> Expression:
    """Give the choice among n + 1 pieces by n knots."""
    if len(pieces) == 1:
        return _polynomial(*pieces[0], x)
    half = len(knots) // 2
    below = _chosen(pieces[: half + 1], knots[:half], x)
    above = _chosen(pieces[half + 1 :], knots[half + 1 :], x)
    return Call("where", (Binary("<", x, Number(knots[half])), below, above))


def _polynomial(origin: float, coefficients: Sequence[float], x: Expression) -> Expression:
    """Give a polynomial by Horner's rule."""
    away = Binary("-", x, Number(origin))
    value: Expression = Number(coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        value = Binary("+", Number(coefficient), Binary("*", away, value))
    return value
