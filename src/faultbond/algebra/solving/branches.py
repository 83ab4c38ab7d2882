"""Laws with branches, one case at a time, and each case as a sequence of things to compute.

abs, sign, min, max and where are on one side of a kink or the other: each side is a case, a law without the branch and
the condition under which it holds. A signal keeps its side during the few samples of a route, so a choice made in one
frame holds in all. What has no kink stays: a root becomes an unknown of its own with its power as equation; other
functions of unknowns become unknowns with a function as equation, which is applied where its argument is found first,
and inverted where its value is. Where neither comes first there is no closed form.
Source: thesis 3.7.2 (a square passed backwards has two answers).
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction

from faultbond.algebra.solving.tidy import ONE, ZERO, difference, negative, replace_part
from faultbond.equations.matching import blocks, holdings, match
from faultbond.equations.numeric import Real, numeric_value
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, names, parts, rename
from faultbond.model.parser import to_text

KINKED = frozenset({"abs", "sign", "min", "max", "where"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """`expression >= 0`, or `> 0` where strict."""

    expression: Expression
    strict: bool = False

    @property
    def text(self) -> str:
        """The condition in the syntax of laws: `line.f_0 >= 0`, `a_0 >= b_0`."""
        left, right, greater, less = self.expression, ZERO, ">", "<"
        match self.expression:
            case Negative(operand):
                left, greater = operand, less
            case Binary("-", one, two):
                left, right = one, two
        return f"{to_text(left)} {greater}{'' if self.strict else '='} {to_text(right)}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Applied:
    """`name = function(argument)`; `argument ** exponent` where the function is `**`, the argument where it is ``."""

    name: str
    function: str
    argument: Expression
    exponent: float = 1.0

    @property
    def value(self) -> Expression:
        """The right-hand side."""
        if not self.function:
            return self.argument
        if self.function == "**":
            return Binary("**", self.argument, Number(self.exponent))
        return Call(self.function, (self.argument,))


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch:
    """Residuals on one side of every kink.

    conditions: where they hold. known: functions of what is known, in order of computation. unknown: functions of
    unknowns; their names are unknowns too. sides: which side was taken, by expression without frames.
    """

    residuals: tuple[Expression, ...]
    conditions: tuple[Condition, ...] = ()
    known: tuple[Applied, ...] = ()
    unknown: tuple[Applied, ...] = ()
    sides: Mapping[Expression, int] = field(default_factory=dict)


def positive_at(values: Mapping[str, Real]) -> Callable[[Expression], bool]:
    """Give whether an expression is positive at some values; one that has none there counts as positive."""

    def positive(expression: Expression) -> bool:
        return not set(names(expression)) <= values.keys() or not numeric_value(expression, values) < 0

    return positive


def cases(
    residuals: tuple[Expression, ...],
    unknown: frozenset[str],
    sides: Mapping[Expression, int],
    plain: Callable[[str], str],
    prefer: Callable[[Expression], bool] = lambda expression: True,
) -> Iterator[Branch]:
    """Give every case of some residuals, the preferred side of each kink first.

    Parameters
    ----------
    residuals : equations of one block
    unknown : names that are solved for; a kink in known values is no case but a value
    sides : sides taken before
    plain : a name without its frame
    prefer : whether an expression is rather positive (at the nominal plant, say)
    """
    yield from _split(Branch(residuals=residuals, sides=dict(sides)), unknown, plain, prefer)


def _split(
    case: Branch, unknown: frozenset[str], plain: Callable[[str], str], prefer: Callable[[Expression], bool]
) -> Iterator[Branch]:
    decided = frozenset(case.sides)
    kink = next((found for item in case.residuals if (found := _kink(item, unknown, decided, plain)) is not None), None)
    if kink is None:
        yield case
        return
    argument = _argument(kink)
    key, sign = _key(argument, plain)
    order: tuple[int, ...] = (1, -1) if prefer(argument) else (-1, 1)
    if key in case.sides:
        order = (sign * case.sides[key],)
    for side in order:
        condition = Condition(expression=argument if side > 0 else negative(argument), strict=kink.function == "sign")
        value = _on_side(kink, side)
        conditions = case.conditions if condition in case.conditions else (*case.conditions, condition)
        further = Branch(
            residuals=tuple(replace_part(item, kink, value) for item in case.residuals),
            conditions=conditions,
            sides={**case.sides, key: sign * side},
        )
        yield from _split(further, unknown, plain, prefer)


def _kink(
    expression: Expression, unknown: frozenset[str], decided: frozenset[Expression], plain: Callable[[str], str]
) -> Call | None:
    """Give the innermost kink of an unknown, or of what has taken a side before, the leftmost first."""
    for part in parts(expression):
        found = _kink(part, unknown, decided, plain)
        if found is not None:
            return found
    if isinstance(expression, Call) and expression.function in KINKED:
        is_open = bool(unknown.intersection(names(expression)))
        if is_open or _key(_argument(expression), plain)[0] in decided:
            return expression
    return None


def _argument(kink: Call) -> Expression:
    """Give what is positive on the first side of a kink."""
    match kink:
        case Call("where", (Binary(">" | ">=", left, right), *_)):
            return difference(left, right)
        case Call("where", (Binary(_, left, right), *_)):
            return difference(right, left)
        case Call("min", (one, two, *_)):
            return difference(two, one)
        case Call("max", (one, two, *_)):
            return difference(one, two)
    return kink.arguments[0]


def _on_side(kink: Call, side: int) -> Expression:
    """Give the value of a kink on the first side (1) or the second (-1)."""
    match kink:
        case Call("abs", (argument,)):
            return argument if side > 0 else negative(argument)
        case Call("sign", _):
            return ONE if side > 0 else Negative(ONE)
        case Call("where", (_, yes, no)):
            return yes if side > 0 else no
        case Call(function, (one, two, *more)):
            kept = one if side > 0 else two
            return Call(function, (kept, *more)) if more else kept
    raise ValueError(kink)


def _key(argument: Expression, plain: Callable[[str], str]) -> tuple[Expression, int]:
    """Give an expression without frames, and its sign: x and -x share a key."""
    stripped = rename(argument, plain)
    if isinstance(stripped, Negative):
        return stripped.operand, -1
    if isinstance(stripped, Binary) and stripped.operator == "-" and repr(stripped.left) > repr(stripped.right):
        return Binary("-", stripped.right, stripped.left), -1
    return stripped, 1


def name_functions(case: Branch, unknown: frozenset[str], fresh: Callable[[str], str]) -> Branch:
    """Give a case whose residuals are rational: functions, and powers that are no whole numbers, carry names.

    Parameters
    ----------
    case : on one side of every kink
    unknown : names that are solved for
    fresh : makes a name that is not in use from a word
    """
    residuals, known, applied = case.residuals, list(case.known), list(case.unknown)
    open_ = set(unknown)
    while True:
        part = next((found for item in residuals if (found := _function(item, frozenset(open_))) is not None), None)
        if part is None:
            break
        is_open = bool(open_.intersection(names(part)))
        item = _applied(part, fresh)
        if is_open:
            applied.append(item)
            open_.add(item.name)
        else:
            known.append(item)
        residuals = tuple(replace_part(residual, part, Name(item.name)) for residual in residuals)
    return Branch(
        residuals=residuals,
        conditions=case.conditions,
        known=tuple(known),
        unknown=tuple(applied),
        sides=case.sides,
    )


def _function(expression: Expression, unknown: frozenset[str]) -> Expression | None:
    """Give the innermost function, broken power, power of known values or sum under a power, the leftmost first.

    A sum that is squared is an unknown of its own, so that each sign of its root is linear in what it sums.
    """
    for part in parts(expression):
        found = _function(part, unknown)
        if found is not None:
            return found
    match expression:
        case Call():
            return expression
        case Binary("**", base, exponent) if not _is_whole(exponent) or _is_known(base, unknown):
            return expression
        case Binary("**", Binary("+" | "-") as base, _):
            return base
    return None


def _is_known(base: Expression, unknown: frozenset[str]) -> bool:
    """Whether a power had better stay as it is than be multiplied out."""
    return not isinstance(base, Name | Number) and not unknown.intersection(names(base))


def _is_whole(exponent: Expression) -> bool:
    match exponent:
        case Number(value) | Negative(Number(value)):
            return value.is_integer()
    return False


def _applied(part: Expression, fresh: Callable[[str], str]) -> Applied:
    match part:
        case Call(function, (argument,)):
            return Applied(name=fresh(function), function=function, argument=argument)
        case Binary("**", base, Number(value)):
            return Applied(name=fresh("power"), function="**", argument=base, exponent=value)
        case Binary("**", base, Negative(Number(value))):
            return Applied(name=fresh("power"), function="**", argument=base, exponent=-value)
    # Sums under a power; kinks of known values and powers with a name as exponent: values as they stand.
    return Applied(name=fresh("value"), function="", argument=part)


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
    used = [*map(names, residuals), *((item.name, *names(item.argument)) for item in functions)]
    position = {name: k for k, name in enumerate(every)}
    rows = [[position[name] for name in row if name in position] for row in used]
    matched = match(rows, len(every))
    if -1 in matched:
        raise NoClosedFormError("its equations do not fix it in this case")
    held = holdings(rows, matched)
    parts: list[Given | System] = [*given]
    for block in blocks(rows, matched):
        found = tuple(every[held[k]] for k in block)
        plain = tuple(part for k in block if not isinstance(part := equations[k], Applied))
        item = next((part for k in block if isinstance(part := equations[k], Applied)), None)
        if item is None:
            parts.append(System(residuals=plain, unknown=found))
        elif len(block) > 1:
            raise NoClosedFormError(f"{item.function or 'a function'} has to be solved together with other equations")
        elif found == (item.name,):
            parts.append(Given(name=item.name, value=item.value))
        else:
            inner = Given(name=fresh("inverse"), value=_inverse(item))
            parts += [inner, System(residuals=(Binary("-", item.argument, Name(inner.name)),), unknown=found)]
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
