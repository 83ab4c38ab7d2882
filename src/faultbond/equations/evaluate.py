"""Expressions as CasADi SX graphs, with derivatives that stay finite.

Smoothing, and its width: `sqrt(x)` is p / sqrt(p + w), p = max(x, 0), w = 1e-12 of the sizes of the terms of x. The
root of a z|z| + b z + c = 0 uses sqrt(c^2 + w^2) for |c|, w = 1e-6 of the sizes of the terms of c, so a turbulent flow
is laminar below about a thousandth of its usual size. `sign`, `abs`, `min`, `max`, `where` are exact; their derivative
at the kink is that of one side, or 0 for `sign`. Logic is arithmetic of 0 and 1: `a & b` is a b, `~a` is 1 - a.
"""

import operator as op
from collections.abc import Callable, Mapping

import casadi as ca

from faultbond.equations.inversion import terms
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number

SQRT_WIDTH = 1e-12
ROOT_WIDTH = 1e-6
_TINY = 1e-30  # keeps a width above zero where every term is zero

_UNARY: dict[str, Callable[[ca.SX], ca.SX]] = {
    "abs": ca.fabs,
    "sign": ca.sign,
    "exp": ca.exp,
    "log": ca.log,
    "sin": ca.sin,
    "cos": ca.cos,
    "tan": ca.tan,
    "tanh": ca.tanh,
}

_BINARY: dict[str, Callable[[ca.SX, ca.SX], ca.SX]] = {
    "+": op.add,
    "-": op.sub,
    "*": op.mul,
    "/": op.truediv,
    "<": op.lt,
    "<=": op.le,
    ">": lambda one, two: two < one,
    ">=": lambda one, two: two <= one,
    "&": op.mul,
    "|": lambda one, two: one + two - one * two,
    "^": lambda one, two: one + two - 2 * one * two,
}


def evaluate(expression: Expression, values: Mapping[str, ca.SX]) -> ca.SX:
    """Give the SX graph of an expression, (1, 1), SI; `values` maps every name to its graph, (1, 1) too."""
    match expression:
        case Number(value):
            return ca.SX(value)
        case Name(text):
            return values[text]
        case Negative(operand):
            return -evaluate(operand, values)
        case Binary("**", base, exponent):
            return _power(evaluate(base, values), exponent, values)
        case Binary(operator, left, right):
            return _BINARY[operator](evaluate(left, values), evaluate(right, values))
        case Call(function, arguments):
            return _call(function, arguments, values)
    raise AssertionError(expression)


def _power(base: ca.SX, exponent: Expression, values: Mapping[str, ca.SX]) -> ca.SX:
    """Whole powers by products, exact for negative bases."""
    literal = exponent.operand if isinstance(exponent, Negative) else exponent
    if isinstance(literal, Number) and literal.value == int(literal.value):
        result, square, rest = ca.SX(1), base, int(literal.value)
        while rest:
            if rest % 2:
                result = result * square
            square, rest = square * square, rest // 2
        return 1 / result if isinstance(exponent, Negative) else result
    return base ** evaluate(exponent, values)


def _call(function: str, arguments: tuple[Expression, ...], values: Mapping[str, ca.SX]) -> ca.SX:
    parts = [evaluate(argument, values) for argument in arguments]
    if function in _UNARY:
        return _UNARY[function](parts[0])
    match function:
        case "sqrt":
            return _sqrt(parts[0], _size(arguments[0], values))
        case "min" | "max":
            result = parts[0]
            for part in parts[1:]:
                result = ca.fmin(result, part) if function == "min" else ca.fmax(result, part)
            return result
        case "not":
            return 1 - parts[0]
        case "where":
            return ca.if_else(parts[0], parts[1], parts[2])
        case "signed_root":
            return _signed_root(parts[0], parts[1], parts[2], _size(arguments[2], values))
        case "upper_root":
            half, constant = 0.5 * parts[1] / parts[0], parts[2] / parts[0]
            return _sqrt(half * half - constant, half * half + ca.fabs(constant)) - half
    raise AssertionError(function)


def _size(expression: Expression, values: Mapping[str, ca.SX]) -> ca.SX:
    """Sum of the sizes of the terms: the scale against which a small sum is small."""
    total = ca.SX(_TINY)
    for term in terms(expression):
        total = total + ca.fabs(evaluate(term, values))
    return total


def _sqrt(argument: ca.SX, size: ca.SX) -> ca.SX:
    positive = ca.fmax(argument, 0)
    return positive / ca.sqrt(positive + SQRT_WIDTH * size)


def _signed_root(lead: ca.SX, slope: ca.SX, constant: ca.SX, size: ca.SX) -> ca.SX:
    """The one real root of lead z|z| + slope z + constant = 0, lead and slope of one sign.

    Written without cancellation: z = -2 c / (b + sqrt(b^2 + 4 a |c|)).
    """
    sign = ca.if_else(lead < 0, -1, 1)
    a, b, c = sign * lead, sign * slope, sign * constant
    width = ROOT_WIDTH * size
    return -2 * c / (b + ca.sqrt(b * b + 4 * a * ca.sqrt(c * c + width * width)))
