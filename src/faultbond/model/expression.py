"""Expressions of laws and sensors: a small immutable tree, parsed by our own whitelist.

The parser uses Python's `ast` for tokens and precedence only; nothing of the user's text is ever executed.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Number:
    """A literal number as written, without unit."""

    value: float


@dataclass(frozen=True, slots=True)
class Name:
    """A name: parameter, constant or input (`K1`), or a signal: `pipe.f` of a bond graph, `x` of a block network."""

    text: str


@dataclass(frozen=True, slots=True)
class Negative:
    """Minus an operand."""

    operand: "Expression"


@dataclass(frozen=True, slots=True)
class Binary:
    """`left operator right`; operator one of `+ - * / **`, a comparison `< <= > >=`, or logic `& ^ |`.

    In conditions, which are no laws, also `== !=`, `and` and `or`.
    """

    operator: str
    left: "Expression"
    right: "Expression"


@dataclass(frozen=True, slots=True)
class Call:
    """A function of the table `FUNCTIONS` applied to its arguments; in block networks also `not` and `der`."""

    function: str
    arguments: tuple["Expression", ...]


Expression = Number | Name | Negative | Binary | Call

LOGIC = ("&", "^", "|")  # operators between logic signals, the strongest first
JOINS = ("and", "or")  # of comparisons in a condition, the stronger first
NOT = "not"  # Call(NOT, (x,)) is `~x`
TABLE = "table "  # Call(TABLE + "curve", (x,)) is `table(x, curve)`
RATE = "der"  # Call(RATE, (Name("y"),)) is `der(y)`, the left side of a law that makes y a store

FUNCTIONS: dict[str, int] = {  # name -> number of arguments; -1: two or more
    "abs": 1,
    "sign": 1,
    "sqrt": 1,
    "exp": 1,
    "log": 1,
    "sin": 1,
    "cos": 1,
    "tan": 1,
    "tanh": 1,
    "min": -1,
    "max": -1,
    "where": 3,
}
ELSEWHERE = {  # what other languages call a function, by its name there
    "ln": "log(x)",
    "log10": "log(x)/log(10)",
    "pow": "x**y",
    "square": "x**2",
    "sqr": "x**2",
    "fabs": "abs(x)",
    "sgn": "sign(x)",
    "iff": "where(condition, x, y)",
    "interp": "table(x, NAME)",
    "interp1": "table(x, NAME)",
    "lookup": "table(x, NAME)",
}


def parts(expression: Expression) -> tuple[Expression, ...]:
    """Give what an expression is made of, from left to right; nothing for a name or a number."""
    match expression:
        case Negative(operand):
            return (operand,)
        case Binary(_, left, right):
            return left, right
        case Call(_, arguments):
            return arguments
    return ()


def walk(expression: Expression) -> Iterator[Expression]:
    """Give the expression and all its parts, outermost first."""
    yield expression
    for part in parts(expression):
        yield from walk(part)


def names(expression: Expression) -> tuple[str, ...]:
    """Give the names used, each once, in order of appearance."""
    return tuple(dict.fromkeys(part.text for part in walk(expression) if isinstance(part, Name)))


def powers(expression: Expression) -> Iterator[tuple[Expression, Expression]]:
    """Give what is raised to a power in an expression, and the power; of a root that is a half."""
    for part in walk(expression):
        match part:
            case Binary("**", base, power):
                yield base, power
            case Call("sqrt", (base,)):
                yield base, Number(0.5)


def exponents(expression: Expression) -> frozenset[str]:
    """Give the names that stand in a power, or in what an exponential is of."""
    raised = (power for _, power in powers(expression))
    argued = (item for part in walk(expression) for item in _argument(part))
    return frozenset(name for one in (*raised, *argued) for name in names(one))


def _argument(part: Expression) -> tuple[Expression, ...]:
    return part.arguments if isinstance(part, Call) and part.function == "exp" else ()


def factors(expression: Expression) -> frozenset[str]:
    """Give the names by which a product is multiplied; a constant that is added to it counts as nothing."""
    match expression:
        case Name(name):
            return frozenset({name})
        case Binary("+", one, Name(_)):
            return factors(one)
        case Binary("*", one, other):
            return factors(one) | factors(other)
        case Binary("/", one, _):
            return factors(one)
    return frozenset()


def without_factor(expression: Expression, name: str) -> Expression | None:
    """Give a product without one of its factors; None where that is none of them."""
    match expression:
        case Binary("*", Name(one), other) if one == name:
            return other
        case Binary("*", one, Name(other)) if other == name:
            return one
        case Binary(("*" | "/") as operator, one, other):
            left = without_factor(one, name)
            return None if left is None else Binary(operator, left, other)
    return None


def rebuilt(expression: Expression, change: Callable[[Expression], Expression]) -> Expression:
    """Give the expression with every part replaced by what `change` gives for it, innermost first."""
    match expression:
        case Negative(operand):
            expression = Negative(rebuilt(operand, change))
        case Binary(operator, left, right):
            expression = Binary(operator, rebuilt(left, change), rebuilt(right, change))
        case Call(function, arguments):
            expression = Call(function, tuple(rebuilt(argument, change) for argument in arguments))
    return change(expression)


def rename(expression: Expression, change: Callable[[str], str]) -> Expression:
    """Give the expression with every name `n` replaced by `change(n)`."""
    return rebuilt(expression, lambda part: Name(change(part.text)) if isinstance(part, Name) else part)
