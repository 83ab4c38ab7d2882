"""Expressions and closed forms as LaTeX mathematics: fractions, indices, Greek letters."""

import re
from collections.abc import Sequence

from faultbond.algebra.solving.branches import Condition
from faultbond.algebra.solving.formula import readable_lines, shown_conditions
from faultbond.algebra.solving.solution import Root
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number
from faultbond.model.parser import number_text

_LETTERS = (
    "alpha beta gamma delta epsilon zeta eta theta iota kappa lambda mu nu xi pi rho sigma tau upsilon phi chi psi",
    "omega Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega",
)
GREEK = frozenset(" ".join(_LETTERS).split())
_COMMANDS = frozenset({"exp", "log", "sin", "cos", "tan", "tanh", "min", "max"})
_SUM, _MINUS, _PRODUCT, _POWER, _ATOM = 2, 3, 4, 5, 6
_COMPARISONS = {"<": "<", "<=": r"\le", ">": ">", ">=": r"\ge"}


def to_latex(root: Root, targets: Sequence[str]) -> str:
    """Give a closed form as an `aligned` block, one line for each name, conditions last."""
    lines = readable_lines(root, targets)
    rows = [f"{name_latex(line.name)} &= {expression_latex(line.value)}" for line in lines]
    conditions = shown_conditions(root, lines)
    if conditions:
        rows.append(r"&\text{where } " + r",\; ".join(map(condition_latex, conditions)))
    return "\\begin{aligned}\n" + " \\\\\n".join(rows) + "\n\\end{aligned}\n"


def condition_latex(condition: Condition) -> str:
    """Give a condition, such as `f_{line,0} >= 0`."""
    sign = ">" if condition.strict else r"\ge"
    match condition.expression:
        case Negative(operand):
            return f"{expression_latex(operand)} {'<' if condition.strict else _COMPARISONS['<=']} 0"
        case Binary("-", left, right):
            return f"{expression_latex(left)} {sign} {expression_latex(right)}"
    return f"{expression_latex(condition.expression)} {sign} 0"


def name_latex(name: str) -> str:
    r"""Give a name: `omega_0` as `\omega_{0}`, `line.f_0` as `f_{\mathrm{line},0}`, `K1` as `K_{1}`.

    Example
    -------
    >>> print(name_latex("omega_0"))
    \omega_{0}
    """
    part, dot, signal = name.rpartition(".")
    words = [word for word in (signal if dot else name).split("_") if word]
    head, *indices = words or [name]
    match = re.fullmatch(r"([A-Za-z]+)(\d+)", head)
    if match:
        head, indices = match[1], [match[2], *indices]
    if part:
        indices = [part.replace("_", " "), *indices]
    written = [index if index.isdigit() else _letter(index) for index in indices]
    return _letter(head) + (f"_{{{','.join(written)}}}" if written else "")


def _letter(word: str) -> str:
    if word in GREEK:
        return f"\\{word}"
    return word if len(word) == 1 else rf"\mathrm{{{word}}}"


def expression_latex(expression: Expression, needed: int = 0) -> str:
    """Give an expression, in brackets if it binds weaker than needed."""
    text, strength = _written(expression)
    return rf"\left({text}\right)" if strength < needed else text


def _written(expression: Expression) -> tuple[str, int]:
    match expression:
        case Number(value):
            return _number(value), _ATOM
        case Name(name):
            return name_latex(name), _ATOM
        case Negative(operand):
            return f"-{expression_latex(operand, _PRODUCT)}", _MINUS
        case Binary("/", left, right):
            return rf"\frac{{{expression_latex(left)}}}{{{expression_latex(right)}}}", _ATOM
        case Binary("**", base, exponent):
            return f"{_base(base)}^{{{expression_latex(exponent)}}}", _POWER
        case Binary("*", left, right):
            return f"{expression_latex(left, _PRODUCT)} {_dot(right)}{expression_latex(right, _PRODUCT)}", _PRODUCT
        case Binary(("+" | "-") as operator, left, right):
            return f"{expression_latex(left, _SUM)} {operator} {expression_latex(right, _PRODUCT)}", _SUM
        case Binary(operator, left, right):
            return f"{expression_latex(left)} {_COMPARISONS[operator]} {expression_latex(right)}", 1
        case Call(function, arguments):
            return _call(function, arguments), _ATOM
    raise ValueError(expression)


def _base(base: Expression) -> str:
    """A fraction needs brackets under a power, though it needs none in a product."""
    if isinstance(base, Binary) and base.operator == "/":
        return rf"\left({expression_latex(base)}\right)"
    return expression_latex(base, _ATOM)


def _dot(right: Expression) -> str:
    """Two numbers side by side would read as one."""
    first = right
    while isinstance(first, Binary) and first.operator in ("*", "**"):
        first = first.left
    return r"\cdot " if isinstance(first, Number) else ""


def _number(value: float) -> str:
    mantissa, _, exponent = number_text(value).partition("e")
    return rf"{mantissa} \cdot 10^{{{exponent}}}" if exponent else mantissa


def _call(function: str, arguments: Sequence[Expression]) -> str:
    parts = [expression_latex(argument) for argument in arguments]
    match function:
        case "sqrt":
            return rf"\sqrt{{{parts[0]}}}"
        case "abs":
            return rf"\left|{parts[0]}\right|"
        case "where":
            cases = rf"{parts[1]} & \text{{if }} {parts[0]} \\ {parts[2]} & \text{{else}}"
            return rf"\begin{{cases}}{cases}\end{{cases}}"
    head = f"\\{function}" if function in _COMMANDS else rf"\operatorname{{{function}}}"
    return rf"{head}\left({', '.join(parts)}\right)"
