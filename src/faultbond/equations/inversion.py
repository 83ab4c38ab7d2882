"""Solving one relation for one signal in closed form.

A relation is written as a polynomial in the signal z and its size |z|, with coefficients free of z. Three forms have a
closed solution: linear; a z|z| + b z + c (turbulent flow; one real root, `signed_root`); a z^2 + b z + c (a one-way
square as in thesis 3.7.2; the root at and above the vertex, `upper_root`). Otherwise a signal that occurs once is
isolated by inverse functions; sign(a) sqrt(|a|), an orifice, is one function of a for that. What remains is left to
Newton's method.
"""

from dataclasses import dataclass
from functools import reduce

from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, names, walk

Monomial = tuple[int, int]  # powers of z and of |z|; |z| at most once, since |z|^2 = z^2
Polynomial = dict[Monomial, Expression]

ORIFICE = "signed square root"  # no function of laws; stands for sign(a) sqrt(|a|) while a relation is solved
ZERO, ONE = Number(0.0), Number(1.0)
LINEAR = {(0, 0), (1, 0)}
SIGNED = {(0, 0), (1, 0), (1, 1)}
SQUARE = {(0, 0), (1, 0), (2, 0)}
_MAX_POWER = 4
_MAX_NODES = 4000


@dataclass(frozen=True, slots=True)
class _NotPolynomialError(Exception):
    """The expression is no polynomial in z and |z|."""


def add(left: Expression, right: Expression) -> Expression:
    """Give left + right, folding zeros."""
    if left == ZERO:
        return right
    if right == ZERO:
        return left
    return Binary("-", left, right.operand) if isinstance(right, Negative) else Binary("+", left, right)


def multiply(left: Expression, right: Expression) -> Expression:
    """Give left * right, folding zeros and ones."""
    if ZERO in (left, right):
        return ZERO
    if left == ONE:
        return right
    return left if right == ONE else Binary("*", left, right)


def negate(operand: Expression) -> Expression:
    """Give -operand."""
    if isinstance(operand, Negative):
        return operand.operand
    return ZERO if operand == ZERO else Negative(operand)


def terms(expression: Expression) -> list[Expression]:
    """Give the terms of a sum, signs dropped."""
    match expression:
        case Binary("+" | "-", left, right):
            return [*terms(left), *terms(right)]
        case Negative(operand):
            return terms(operand)
    return [expression]


def substitute(expression: Expression, values: dict[str, Expression]) -> Expression:
    """Give the expression with names replaced by expressions."""
    match expression:
        case Name(text):
            return values.get(text, expression)
        case Negative(operand):
            return Negative(substitute(operand, values))
        case Binary(operator, left, right):
            return Binary(operator, substitute(left, values), substitute(right, values))
        case Call(function, arguments):
            return Call(function, tuple(substitute(argument, values) for argument in arguments))
    return expression


def collect(expression: Expression, signal: str) -> Polynomial | None:
    """Give the coefficients of a polynomial in `signal` and its size; None if it is none (or too large)."""
    if sum(1 for _ in walk(expression)) > _MAX_NODES:
        return None
    try:
        return {key: value for key, value in _collect(expression, signal).items() if value != ZERO}
    except _NotPolynomialError:
        return None


def _collect(expression: Expression, signal: str) -> Polynomial:
    if signal not in names(expression):
        return {(0, 0): expression}
    match expression:
        case Name():
            return {(1, 0): ONE}
        case Negative(operand):
            return {key: negate(value) for key, value in _collect(operand, signal).items()}
        case Binary("+" | "-" as operator, left, right):
            one = _collect(left, signal)
            two = _collect(right if operator == "+" else Negative(right), signal)
            return {key: add(one.get(key, ZERO), two.get(key, ZERO)) for key in sorted({*one, *two})}
        case Binary("*", left, right):
            return _product(_collect(left, signal), _collect(right, signal))
        case Binary("/", left, right) if signal not in names(right):
            return {key: Binary("/", value, right) for key, value in _collect(left, signal).items()}
        case Binary("**", left, Number(power)) if power in (1.0, 2.0, 3.0, 4.0):
            base = _collect(left, signal)
            result = base
            for _ in range(int(power) - 1):
                result = _product(result, base)
            return result
        case Call("abs", (argument,)) if len(inner := _collect(argument, signal)) == 1:  # |c z| = |c| |z|
            (((power_, size), coefficient),) = inner.items()
            pairs, single = divmod(power_ + size, 2)
            return {(2 * pairs, single): Call("abs", (coefficient,)) if coefficient != ONE else ONE}
    raise _NotPolynomialError


def _product(left: Polynomial, right: Polynomial) -> Polynomial:
    result: Polynomial = {}
    for (z_left, size_left), one in left.items():
        for (z_right, size_right), two in right.items():
            pairs, size = divmod(size_left + size_right, 2)
            key = (z_left + z_right + 2 * pairs, size)
            if key[0] > _MAX_POWER:
                raise _NotPolynomialError
            result[key] = add(result.get(key, ZERO), multiply(one, two))
    return result


def linear_solution(residual: Expression, signal: str) -> Expression | None:
    """Give the solution where the residual is linear in the signal."""
    form = collect(residual, signal)
    if form is None or not set(form) <= LINEAR or (1, 0) not in form:
        return None
    constant, slope = form.get((0, 0), ZERO), form[1, 0]
    if slope == ONE:
        return negate(constant)
    if slope == Negative(ONE):
        return constant
    return Binary("/", negate(constant), slope)


def isolate(residual: Expression, signal: str) -> Expression | None:
    """Give `signal` such that residual = 0, in closed form; None where there is none."""
    solution = linear_solution(residual, signal)
    if solution is not None:
        return solution
    form = collect(residual, signal)
    if form is not None:
        keys = set(form)
        for allowed, function in ((SIGNED, "signed_root"), (SQUARE, "upper_root")):
            lead = max(allowed, key=sum)
            if keys <= allowed and lead in keys:
                return Call(function, (form[lead], form.get((1, 0), ZERO), form.get((0, 0), ZERO)))
    return _invert(_orifices(residual, signal), ZERO, signal)


def _orifices(expression: Expression, signal: str) -> Expression:
    """Write products with sign(a) and sqrt(|a|), a with the signal in it, with `ORIFICE` of a."""
    match expression:
        case Negative(operand):
            return Negative(_orifices(operand, signal))
        case Binary("+" | "-" as operator, left, right):
            return Binary(operator, _orifices(left, signal), _orifices(right, signal))
        case Binary("*" | "/"):
            above, below = _factors(expression)
            for factor in above:
                match factor:
                    case Call("sign", (argument,)) if signal in names(argument):
                        root = Call("sqrt", (Call("abs", (argument,)),))
                        if root in above:
                            above.remove(factor)
                            above.remove(root)
                            product = reduce(multiply, [*above, Call(ORIFICE, (argument,))])
                            return Binary("/", product, reduce(multiply, below)) if below else product
    return expression


def _factors(product: Expression) -> tuple[list[Expression], list[Expression]]:
    """Give the factors above and below the bar of a product of quotients."""
    match product:
        case Binary("*", left, right):
            (one, under), (two, beneath) = _factors(left), _factors(right)
            return [*one, *two], [*under, *beneath]
        case Binary("/", left, right):
            (one, under), (two, beneath) = _factors(left), _factors(right)
            return [*one, *beneath], [*under, *two]
    return [product], []


def _invert(expression: Expression, value: Expression, signal: str) -> Expression | None:
    """Solve expression = value where the signal occurs once and each function on the way has an inverse."""
    if sum(1 for part in walk(expression) if part == Name(signal)) != 1:
        return None
    match expression:
        case Name():
            return value
        case Negative(operand):
            return _invert(operand, negate(value), signal)
        case Binary(operator, left, right):
            return _invert_binary(operator, left, right, value, signal)
        case Call("exp", (argument,)):
            return _invert(argument, Call("log", (value,)), signal)
        case Call("log", (argument,)):
            return _invert(argument, Call("exp", (value,)), signal)
        case Call("sqrt", (argument,)):
            return _invert(argument, Binary("**", value, Number(2.0)), signal)
        case Call(function, (argument,)) if function == ORIFICE:
            return _invert(argument, Binary("*", value, Call("abs", (value,))), signal)
    return None


def _invert_binary(
    operator: str, left: Expression, right: Expression, value: Expression, signal: str
) -> Expression | None:
    inside_left = signal in names(left)
    inner, rest = (left, right) if inside_left else (right, left)
    match operator:
        case "+":
            return _invert(inner, add(value, negate(rest)), signal)
        case "-":
            target = add(value, rest) if inside_left else add(rest, negate(value))
            return _invert(inner, target, signal)
        case "*":
            return _invert(inner, Binary("/", value, rest), signal)
        case "/":
            target = Binary("*", value, rest) if inside_left else Binary("/", rest, value)
            return _invert(inner, target, signal)
    return None
