"""Expressions without needless zeros, ones and minus signs."""

from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number

ZERO: Expression = Number(0.0)
ONE: Expression = Number(1.0)


def difference(left: Expression, right: Expression) -> Expression:
    """Give left - right, folding zeros."""
    if right == ZERO:
        return left
    return negative(right) if left == ZERO else Binary("-", left, right)


def negative(expression: Expression) -> Expression:
    """Give minus an expression, a difference turned round."""
    match expression:
        case Negative(operand):
            return operand
        case Binary("-", left, right):
            return Binary("-", right, left)
        case Binary(("*" | "/") as operator, Negative(left), right):
            return Binary(operator, left, right)
    return Negative(expression)


def replace_part(expression: Expression, old: Expression, new: Expression) -> Expression:
    """Give an expression with every part that equals `old` replace_part."""
    if expression == old:
        return new
    match expression:
        case Negative(operand):
            return Negative(replace_part(operand, old, new))
        case Binary(operator, left, right):
            return Binary(operator, replace_part(left, old, new), replace_part(right, old, new))
        case Call(function, arguments):
            return Call(function, tuple(replace_part(argument, old, new) for argument in arguments))
    return expression


def fold(expression: Expression) -> Expression:
    """Give an expression without zeros, ones and minus signs that a sum or a product can take up.

    Fractions in a product become one fraction, and a name times itself a square.
    """
    match expression:
        case Negative(operand):
            inner = fold(operand)
            return inner if inner == ZERO else negative(inner)
        case Binary("+" | "-" as operator, left, right):
            return _fold_sum(operator, fold(left), fold(right))
        case Binary("*" | "/" as operator, left, right):
            return _fold_product(operator, fold(left), fold(right))
        case Binary(operator, left, right):
            return Binary(operator, fold(left), fold(right))
        case Call(function, arguments):
            return Call(function, tuple(map(fold, arguments)))
    return expression


def _fold_sum(operator: str, left: Expression, right: Expression) -> Expression:
    if right == ZERO:
        return left
    if left == ZERO:
        return right if operator == "+" else negative(right)
    match left, right:
        case Negative(one), Negative(two):
            return Negative(Binary("+", one, two)) if operator == "+" else Binary("-", two, one)
        case _, Negative(two):
            return Binary("-" if operator == "+" else "+", left, two)
        case Negative(one), _:
            return Binary("-", right, one) if operator == "+" else Negative(Binary("+", one, right))
    return Binary(operator, left, right)


def _fold_product(operator: str, left: Expression, right: Expression) -> Expression:
    if left == ZERO or (right == ZERO and operator == "*"):
        return ZERO
    if right == ONE:
        return left
    if left == ONE and operator == "*":
        return right
    match left, right:
        case Negative(one), Negative(two):
            return _fold_product(operator, one, two)
        case Negative(one), _:
            return Negative(_fold_product(operator, one, right))
        case _, Negative(two):
            return Negative(_fold_product(operator, left, two))
        case _, Binary("/", above, below):
            up, down = (above, below) if operator == "*" else (below, above)
            return Binary("/", _fold_product("*", left, up), down)
        case Binary("/", above, below), _ if operator == "*":
            return Binary("/", _fold_product("*", above, right), below)
        case Binary("*", rest, Name(name)), Name(other) if operator == "*" and name == other:
            return Binary("*", rest, Binary("**", right, Number(2.0)))
        case Name(), _ if left == right and operator == "*":
            return Binary("**", left, Number(2.0))
    return Binary(operator, left, right)
