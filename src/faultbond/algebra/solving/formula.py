"""Closed forms as text in the syntax of laws, as Python and as C. The same solution gives the same bytes.

Short lines stand where they are used. Code computes each common part once and needs nothing but the mathematics of its
language. C is C99; whole powers are products.
"""

import keyword
import re
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from faultbond.algebra.solving.branches import Condition
from faultbond.algebra.solving.solution import Line, Root, Solution
from faultbond.algebra.solving.tidy import fold
from faultbond.equations.component_network import SAMPLE_TIME
from faultbond.equations.inversion import substitute
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, names, parts, walk
from faultbond.model.parser import number_text, to_text

MAX_INLINE = 60  # parts of a line that is put where it is used
SHORT = 3  # parts of a line that is put wherever it is used


@dataclass(frozen=True, slots=True, kw_only=True)
class Formula:
    """What gives one target by one closed form.

    arguments: samples, then `dt`, then parameters. number: of the closed form, the first being the one that holds at
    the nominal plant. count: of closed forms. origin: a word on what it follows from, where several functions give the
    same target.
    """

    target: str
    arguments: tuple[str, ...]
    lines: tuple[Line, ...]
    conditions: tuple[Condition, ...]
    number: int
    count: int
    origin: str = ""


def formulas(solution: Solution, parameters: Sequence[str]) -> tuple[Formula, ...]:
    """Give a formula for each target and each closed form.

    Parameters
    ----------
    solution : with closed forms
    parameters : names that are parameters of the plant; all others but `dt` are samples
    """
    found = []
    for target in solution.targets:
        for number, root in enumerate(solution.roots, start=1):
            lines = readable_lines(root, (target,))
            used = {name for line in lines for name in names(line.value)} - {line.name for line in lines}
            found.append(
                Formula(
                    target=target,
                    arguments=tuple(sorted(used, key=lambda name: (name in parameters, name == SAMPLE_TIME, name))),
                    lines=lines,
                    conditions=shown_conditions(root, lines),
                    number=number,
                    count=len(solution.roots),
                )
            )
    return tuple(found)


def readable_lines(root: Root, targets: Sequence[str]) -> tuple[Line, ...]:
    """Give the lines that targets follow from; one that is used once or short stands where it is used."""
    lines = _needed(root.lines, targets)
    uses = Counter(part.text for line in lines for part in walk(line.value) if isinstance(part, Name))
    inlined: dict[str, Expression] = {}
    kept: list[Line] = []
    for line in lines:
        value = fold(substitute(line.value, inlined))
        size = sum(1 for _ in walk(value))
        if line.name not in targets and (size <= SHORT or (uses[line.name] == 1 and size <= MAX_INLINE)):
            inlined[line.name] = value
        else:
            kept.append(Line(name=line.name, value=value))
    return _needed(kept, targets)


def _needed(lines: Iterable[Line], targets: Sequence[str]) -> tuple[Line, ...]:
    kept: list[Line] = []
    open_ = set(targets)
    for line in reversed(tuple(lines)):
        if line.name in open_:
            kept.append(line)
            open_.update(names(line.value))
    return tuple(reversed(kept))


def shown_conditions(root: Root, lines: Sequence[Line]) -> tuple[Condition, ...]:
    """Give the conditions of a root in samples, parameters and the names of lines that are shown."""
    shown = {line.name for line in lines}
    values: dict[str, Expression] = {}
    for line in root.lines:
        if line.name not in shown:
            values[line.name] = fold(substitute(line.value, values))
    return tuple(
        dict.fromkeys(
            Condition(expression=fold(substitute(item.expression, values)), strict=item.strict)
            for item in root.conditions
        )
    )


def common_parts(lines: Sequence[Line], fresh: Callable[[], str]) -> tuple[Line, ...]:
    """Give lines in which no sum, product or function is computed twice; what is shared has a line of its own.

    Parameters
    ----------
    lines : of one formula
    fresh : makes a name that is not in use
    """
    seen: Counter[Expression] = Counter()
    for line in lines:
        _count(line.value, seen)
    named: dict[Expression, Expression] = {}
    result: list[Line] = []
    for line in lines:
        value = _shared(line.value, seen, named, result, fresh)
        result.append(Line(name=line.name, value=value))
        if isinstance(line.value, Binary | Call):
            named.setdefault(line.value, Name(line.name))
    return tuple(result)


def _count(expression: Expression, seen: Counter[Expression]) -> None:
    """Count each part once for every place where it would be computed."""
    if not _is_worth_it(expression):
        for part in parts(expression):
            _count(part, seen)
        return
    seen[expression] += 1
    if seen[expression] == 1:
        for part in parts(expression):
            _count(part, seen)


def _is_worth_it(expression: Expression) -> bool:
    """Whether a part may get a line of its own: comparisons stay where they are."""
    match expression:
        case Binary(operator, _, _):
            return operator in ("+", "-", "*", "/", "**")
        case Call():
            return True
    return False


def _shared(
    expression: Expression,
    seen: Mapping[Expression, int],
    named: dict[Expression, Expression],
    lines: list[Line],
    fresh: Callable[[], str],
) -> Expression:
    """Give an expression in the names of shared parts, adding a line for each that is met first."""
    if expression in named:
        return named[expression]
    result = expression
    match expression:
        case Negative(operand):
            result = Negative(_shared(operand, seen, named, lines, fresh))
        case Binary(operator, left, right):
            result = Binary(
                operator, _shared(left, seen, named, lines, fresh), _shared(right, seen, named, lines, fresh)
            )
        case Call(function, arguments):
            result = Call(function, tuple(_shared(part, seen, named, lines, fresh) for part in arguments))
    if _is_worth_it(expression) and seen.get(expression, 0) > 1:
        name = Name(fresh())
        lines.append(Line(name=name.text, value=result))
        named[expression] = name
        return name
    return result


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
    found = []
    for root in solution.roots:
        conditions = conditions_text(shown_conditions(root, readable_lines(root, solution.targets)))
        found.append("; ".join(to_lines(root, solution.targets)) + (f" where {conditions}" if conditions else ""))
    return " or ".join(found)


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
