"""Closed forms as text in the syntax of laws, as Python, as C and as LaTeX. The same solution gives the same bytes.

Code computes each common part once and needs nothing but the mathematics of its language. C is C99; whole powers are
products.
"""

import keyword
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from faultbond.algebra.solving.branches import Condition
from faultbond.algebra.solving.readable import Formula, common_parts, readable_lines, shown_conditions
from faultbond.algebra.solving.solution import Line, Root, Solution
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number
from faultbond.model.parser import number_text, to_text

PYTHON_HEADER = "import math\n"
C_HEADER = "#include <math.h>\n"
MAX_PRODUCT = 16  # powers up to here are products in C

_PRECEDENCE = {"<": 1, "<=": 1, ">": 1, ">=": 1, "+": 2, "-": 2, "*": 3, "/": 3, "**": 5}
_MINUS, _ATOM = 4, 6
_PYTHON_WORDS = frozenset({*keyword.kwlist, "math", "abs", "min", "max"})
_C_RESERVED = (
    "auto break case char const continue default do double else enum extern float for goto if inline int long register",
    "restrict return short signed sizeof static struct switch typedef union unsigned void volatile while",
    "abs sqrt exp log sin cos tan tanh fabs fmin fmax pow math y0 y1 yn j0 j1 jn gamma",
    # Macros of math.h and of compilers in their own dialects.
    "NAN INFINITY HUGE HUGE_VAL HUGE_VALF HUGE_VALL MAXFLOAT FP_NAN FP_INFINITE FP_ZERO FP_SUBNORMAL FP_NORMAL",
    "FP_ILOGB0 FP_ILOGBNAN FP_FAST_FMA FP_FAST_FMAF FP_FAST_FMAL MATH_ERRNO MATH_ERREXCEPT math_errhandling signgam",
    "M_E M_LOG2E M_LOG10E M_LN2 M_LN10 M_PI M_PI_2 M_PI_4 M_1_PI M_2_PI M_2_SQRTPI M_SQRT2 M_SQRT1_2",
    "DOMAIN SING OVERFLOW UNDERFLOW PLOSS TLOSS linux unix i386",
)
_C_WORDS = frozenset(" ".join(_C_RESERVED).split())


def to_lines(root: Root, targets: Sequence[str]) -> tuple[str, ...]:
    """Give a closed form as lines `name = value` in the syntax of laws, the targets among them."""
    return tuple(f"{line.name} = {to_text(line.value)}" for line in readable_lines(root, targets))


def to_one_line(solution: Solution) -> str | None:
    """Give all closed forms in one line, the first root first; None where there is none.

    Lines are separated by `; `, closed forms by ` or `, conditions follow ` where `.
    """
    if not solution.roots:
        return None
    return " or ".join(_one_root(root, solution.targets) for root in solution.roots)


def _one_root(root: Root, targets: Sequence[str]) -> str:
    conditions = conditions_text(shown_conditions(root, readable_lines(root, targets)))
    return "; ".join(to_lines(root, targets)) + (f" where {conditions}" if conditions else "")


def conditions_text(conditions: Sequence[Condition]) -> str:
    """Give conditions in the syntax of laws, joined by `and`; empty where there are none."""
    return " and ".join(condition.text for condition in conditions)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Style:
    """What differs between languages: numbers, names, powers, functions."""

    number: Callable[[float], str]
    name: Callable[[str], str]
    power: Callable[[Expression, Expression, Callable[[Expression, int], str]], tuple[str, int]]
    call: Callable[[str, Sequence[str]], str]


def _written(expression: Expression, style: _Style, needed: int = 0) -> str:
    """Give the text of an expression, in parentheses if it binds weaker than needed."""

    def inner(part: Expression, strength: int) -> str:
        return _written(part, style, strength)

    match expression:
        case Number(value):
            text, strength = style.number(value), _ATOM if value >= 0 else _MINUS
        case Name(name):
            text, strength = style.name(name), _ATOM
        case Negative(operand):
            text, strength = f"-{inner(operand, _MINUS)}", _MINUS
        case Binary("**", base, exponent):
            text, strength = style.power(base, exponent, inner)
        case Binary(operator, left, right):
            strength = _PRECEDENCE[operator]
            space = " " if strength <= 2 else ""
            text = f"{inner(left, strength)}{space}{operator}{space}{inner(right, strength + 1)}"
        case Call(function, arguments):
            text, strength = style.call(function, [inner(argument, 0) for argument in arguments]), _ATOM
    return f"({text})" if strength < needed else text


def identifiers(names: Sequence[str], reserved: frozenset[str]) -> dict[str, str]:
    """Give each name as an identifier, `armature.f_0` as `armature_f_0`; no two alike, none reserved."""
    found: dict[str, str] = {}
    for name in names:
        word = re.sub(r"\W", "_", name)
        while word in reserved or word in found.values():
            word += "_"
        found[name] = word
    return found


def _prepared(
    lines_: Sequence[Line], formula: Formula, reserved: frozenset[str]
) -> tuple[tuple[Line, ...], dict[str, str]]:
    """Give the lines of code, and identifiers for all their names."""
    number = 0
    taken = {*formula.arguments, *(line.name for line in formula.lines)}

    def fresh() -> str:
        nonlocal number
        number += 1
        while f"t{number}" in taken:
            number += 1
        return f"t{number}"

    lines = common_parts(lines_, fresh)
    return lines, identifiers((*formula.arguments, *(line.name for line in lines)), reserved)


def _function_name(formula: Formula, words: dict[str, str]) -> str:
    origin = re.sub(r"\W+", "_", f" {formula.origin}") if formula.origin else ""
    suffix = f"_{formula.number}" if formula.number > 1 else ""
    return f"{words[formula.target]}_of{origin}{suffix}"


def _remark(formula: Formula) -> str:
    """Say in one sentence what a function gives."""
    which = f", closed form {formula.number} of {formula.count}" if formula.count > 1 else ""
    where = conditions_text(formula.conditions)
    return f"{formula.target}{which}{f', valid where {where}' if where else ''}."


def to_python(formula: Formula) -> str:
    """Give a function of Python, `L_of(omega_0, ..., dt, C, ...)`; it wants `PYTHON_HEADER` before it."""
    lines, words = _prepared(formula.lines, formula, _PYTHON_WORDS)
    style = _Style(number=number_text, name=words.__getitem__, power=_python_power, call=_python_call)
    body = [f"    {words[line.name]} = {_written(line.value, style)}" for line in lines]
    arguments = ", ".join(words[name] for name in formula.arguments)
    head = f'def {_function_name(formula, words)}({arguments}):\n    """Give {_remark(formula)}"""'
    return "\n".join([head, *body, f"    return {words[formula.target]}"]) + "\n"


def _python_power(base: Expression, exponent: Expression, inner: Callable[[Expression, int], str]) -> tuple[str, int]:
    """Broken powers by the library: `**` gives a complex number for a negative base, `math.pow` an error as `sqrt`."""
    match exponent:
        case Number(value) | Negative(Number(value)) if value.is_integer():
            return f"{inner(base, _ATOM)}**{inner(exponent, _MINUS)}", _PRECEDENCE["**"]
    return f"math.pow({inner(base, 0)}, {inner(exponent, 0)})", _ATOM


def _python_call(function: str, arguments: Sequence[str]) -> str:
    match function:
        case "abs" | "min" | "max":
            return f"{function}({', '.join(arguments)})"
        case "sign":
            return f"(({arguments[0]} > 0) - ({arguments[0]} < 0))"
        case "where":
            return f"({arguments[1]} if {arguments[0]} else {arguments[2]})"
    return f"math.{function}({', '.join(arguments)})"


def to_c(formula: Formula) -> str:
    """Give a function of C99, `static double L_of(double omega_0, ...)`; it wants `C_HEADER` before it."""
    multiplied = [Line(name=line.name, value=_multiplied(line.value)) for line in formula.lines]
    lines, words = _prepared(multiplied, formula, _C_WORDS)
    style = _Style(number=_c_number, name=words.__getitem__, power=_c_power, call=_c_call)
    body = [f"    const double {words[line.name]} = {_written(line.value, style)};" for line in lines]
    arguments = ", ".join(f"double {words[name]}" for name in formula.arguments) or "void"
    head = f"/* {_remark(formula)} */\nstatic double {_function_name(formula, words)}({arguments})\n{{"
    return "\n".join([head, *body, f"    return {words[formula.target]};", "}"]) + "\n"


def _c_number(value: float) -> str:
    text = number_text(value)
    return text if any(letter in text for letter in ".en") else f"{text}.0"


def _c_power(base: Expression, exponent: Expression, inner: Callable[[Expression, int], str]) -> tuple[str, int]:
    return f"pow({inner(base, 0)}, {inner(exponent, 0)})", _ATOM


def _multiplied(expression: Expression) -> Expression:
    """Give an expression with small whole powers as products of squares, whose common parts are computed once."""
    match expression:
        case Binary("**", base, Number(value)) if value.is_integer() and 1 <= value <= MAX_PRODUCT:
            return _product(_multiplied(base), int(value))
        case Binary("**", base, Negative(Number(value))) if value.is_integer() and 1 <= value <= MAX_PRODUCT:
            return Binary("/", Number(1.0), _product(_multiplied(base), int(value)))
        case Negative(operand):
            return Negative(_multiplied(operand))
        case Binary(operator, left, right):
            return Binary(operator, _multiplied(left), _multiplied(right))
        case Call(function, arguments):
            return Call(function, tuple(map(_multiplied, arguments)))
    return expression


def _product(base: Expression, exponent: int) -> Expression:
    if exponent == 1:
        return base
    half = _product(base, exponent // 2)
    whole = Binary("*", half, half)
    return Binary("*", whole, base) if exponent % 2 else whole


def _c_call(function: str, arguments: Sequence[str]) -> str:
    match function:
        case "abs":
            return f"fabs({arguments[0]})"
        case "sign":
            return f"((({arguments[0]}) > 0.0) - (({arguments[0]}) < 0.0))"
        case "where":
            return f"(({arguments[0]}) ? ({arguments[1]}) : ({arguments[2]}))"
        case "min" | "max":
            result = arguments[0]
            for argument in arguments[1:]:
                result = f"f{function}({result}, {argument})"
            return result
    return f"{function}({', '.join(arguments)})"
