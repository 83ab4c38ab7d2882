"""One case of a block as a sequence of things to compute: values that are at hand, and polynomial systems.

A root of an unknown becomes an unknown with its power as equation. Another function is applied where its argument is
found first, and inverted where its value is. Where neither comes first there is no closed form.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction

from faultbond.algebra.solving.branches import Applied, Branch, Condition
from faultbond.algebra.solving.tidy import replace_part
from faultbond.equations.matching import blocks, holdings, match
from faultbond.model.expression import Binary, Call, Expression, Name, Number, names

MAX_ROOT = 4


class NoClosedFormError(Exception):
    """There is no closed form; the argument says why."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Given:
    """`name = value`, everything in it being known by then."""

    name: str
    value: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class System:
    """Rational equations in as many unknowns."""

    residuals: tuple[Expression, ...]
    unknown: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ordered:
    """What a case is to be computed by, and the conditions that its roots add."""

    parts: tuple[Given | System, ...]
    conditions: tuple[Condition, ...]


def order_systems(case: Branch, unknown: tuple[str, ...], fresh: Callable[[str], str]) -> Ordered:
    """Give the parts of a case in order of computation.

    Parameters
    ----------
    case : with functions named
    unknown : those of its block; functions of unknowns come on top
    fresh : makes a name that is not in use from a word

    Raises
    ------
    NoClosedFormError
        Where a function has to be solved together with other equations.
    """
    given = tuple(Given(name=item.name, value=item.value) for item in case.known)
    residuals, functions, conditions = _with_roots(case)
    if not case.unknown:
        return Ordered(parts=(*given, System(residuals=residuals, unknown=unknown)), conditions=case.conditions)
    every = (*unknown, *(item.name for item in case.unknown))
    equations: list[Expression | Applied] = [*residuals, *functions]
    position = {name: k for k, name in enumerate(every)}
    rows = [[position[name] for name in _used(equation) if name in position] for equation in equations]
    matched = match(rows, len(every))
    if -1 in matched:
        raise NoClosedFormError("its equations do not fix it in this case")
    held = holdings(rows, matched)
    parts: list[Given | System] = [*given]
    for block in blocks(rows, matched):
        parts += _parts([equations[k] for k in block], tuple(every[held[k]] for k in block), fresh)
    return Ordered(parts=tuple(parts), conditions=(*case.conditions, *conditions))


def _with_roots(case: Branch) -> tuple[tuple[Expression, ...], list[Applied], list[Condition]]:
    """Turn roots into powers: with r = x**(p/q), the unknown is x**(1/q), at least 0, and r its p-th power."""
    residuals, functions, conditions = list(case.residuals), [], []
    for item in case.unknown:
        if isinstance(item.argument, Binary) and not item.function and item.argument.operator in ("+", "-"):
            residuals.append(Binary("-", Name(item.name), item.argument))
            continue
        exponent = Fraction(1, 2) if item.function == "sqrt" else Fraction(item.exponent).limit_denominator(MAX_ROOT)
        if item.function not in ("sqrt", "**") or (item.function == "**" and float(exponent) != item.exponent):
            functions.append(item)
            continue
        root = Name(item.name)
        if exponent.numerator != 1:
            raised = Binary("**", root, Number(float(exponent.numerator)))
            residuals = [replace_part(residual, root, raised) for residual in residuals]
            functions = [replace(other, argument=replace_part(other.argument, root, raised)) for other in functions]
        residuals.append(Binary("-", Binary("**", root, Number(float(exponent.denominator))), item.argument))
        conditions.append(Condition(expression=root))
    return tuple(residuals), functions, conditions


def _used(equation: Expression | Applied) -> tuple[str, ...]:
    return (equation.name, *names(equation.argument)) if isinstance(equation, Applied) else names(equation)


def _parts(
    equations: list[Expression | Applied], unknown: tuple[str, ...], fresh: Callable[[str], str]
) -> tuple[Given | System, ...]:
    applied = [equation for equation in equations if isinstance(equation, Applied)]
    if not applied:
        plain = tuple(equation for equation in equations if not isinstance(equation, Applied))
        return (System(residuals=plain, unknown=unknown),)
    (item, *more) = applied
    if more or len(equations) > 1:
        raise NoClosedFormError(f"{item.function or 'a function'} has to be solved together with other equations")
    if unknown == (item.name,):
        return (Given(name=item.name, value=item.value),)
    inner = Given(name=fresh("inverse"), value=_inverse(item))
    return inner, System(residuals=(Binary("-", item.argument, Name(inner.name)),), unknown=unknown)


def _inverse(item: Applied) -> Expression:
    """Give the argument of a function by its value."""
    value, one = Name(item.name), Number(1.0)
    match item.function:
        case "exp":
            return Call("log", (value,))
        case "log":
            return Call("exp", (value,))
        case "tanh":
            ratio = Binary("/", Binary("+", one, value), Binary("-", one, value))
            return Binary("/", Call("log", (ratio,)), Number(2.0))
        case "**":
            return Binary("**", value, Number(1.0 / item.exponent))
    raise NoClosedFormError(f"{item.function or 'a function'} has more than one inverse")
