"""Laws as text: a whitelist over Python's `ast`, and the text of an expression.

`ast` gives precedence only; before it sees the text, every token has been checked, and nothing is ever executed.
"""

import ast
import keyword
import math
import re
from decimal import Decimal

from faultbond.errors import ModelError
from faultbond.model.expression import (
    ELSEWHERE,
    FUNCTIONS,
    JOINS,
    NOT,
    RATE,
    TABLE,
    Binary,
    Call,
    Expression,
    Name,
    Negative,
    Number,
)
from faultbond.model.source import choice, shown

MAX_LAW_LENGTH = 2000
MAX_NODES = 500
MAX_LAW_DEPTH = 50
MAX_EXPONENT = 16  # of a law and of a unit

_TOKEN = re.compile(
    r"""(?P<space>[ \t\r\n]+)
    |(?P<number>(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?(?![A-Za-z0-9_.]))
    |(?P<name>[A-Za-z][A-Za-z0-9_]{0,63}(?:\.[A-Za-z][A-Za-z0-9_]{0,63})?(?![A-Za-z0-9_.]))
    |(?P<operator>\*\*|<=|>=|[-+*/<>(),])
    |(?P<equality>==|!=)
    |(?P<logic>[&|^~])""",
    re.VERBOSE,
)
_EQUALS = re.compile(r"(?<![<>=!])=(?!=)")
_ARITHMETIC: dict[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Pow: "**"}
_COMPARISON: dict[type[ast.cmpop], str] = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">="}
_EQUALITY: dict[type[ast.cmpop], str] = {ast.Eq: "==", ast.NotEq: "!="}
_JOINED: dict[type[ast.boolop], str] = {ast.And: "and", ast.Or: "or"}
_COMPARED = _COMPARISON | _EQUALITY
_LOGIC: dict[type[ast.operator], str] = {ast.BitAnd: "&", ast.BitXor: "^", ast.BitOr: "|"}
_OPERATORS = _ARITHMETIC | _LOGIC
_ADVICE = {
    "^": "write `**` for a power",
    "=": "one `=` stands between the two sides of a law, and nowhere else",
    "&": "logic belongs to block networks",
    "|": "logic belongs to block networks; write `abs(x)` for a magnitude",
    "~": "logic belongs to block networks",
}
_READ = "only numbers, names, part.signal, + - * / ** ( ) and functions are read"
_OF_CONDITIONS = {
    "=": "write `==` to compare",
    "&": "write `and`",
    "|": "write `or`",
    "~": "turn the comparison, `mode != 1`, `speed <= idle`",
    "!": "write `!=`, or turn the comparison",
}


def parse_expression(text: str, where: str = "", *, blocks: bool = False) -> Expression:
    """Give the tree of an expression such as `K1*f*abs(f)`.

    Parameters
    ----------
    text : what the user wrote
    where : start of every error message, `model.yaml:12: `
    blocks : whether it belongs to a block network, where `& | ^ ~` and `der(x)` are read too

    Raises
    ------
    ModelError
        if the text is longer than 2000 characters, has more than 500 parts or 50 levels, or uses anything outside the
        grammar: `+ - * / **`, the functions of `FUNCTIONS`, `table(x, NAME)`, numbers, names, `part.signal`, and a
        comparison as the first argument of `where`.

    Example
    -------
    >>> to_text(parse_expression("K1 * (f*abs(f))"))
    'K1*(f*abs(f))'
    """
    _check_length(text, where, "expression")
    _check_tokens(text, where, blocks=blocks)
    return _Reader(where, text, blocks=blocks).expression(_tree(text, where), 1)


def parse_condition(text: str, where: str = "") -> Expression:
    """Give the tree of a condition such as `mode == 1 and speed > idle`: comparisons, joined by `and` and `or`.

    Parameters
    ----------
    text : what the user wrote
    where : start of every error message, `model.yaml:12: `

    Raises
    ------
    ModelError
        if it is none, or as `parse_expression` says.

    Example
    -------
    >>> to_text(parse_condition("mode == 1 and (speed > idle or by_hand < 1)"))
    'mode == 1 and (speed > idle or by_hand < 1)'
    """
    _check_length(text, where, "condition")
    _check_tokens(text, where, blocks=False, condition=True)
    return _Reader(where, text, blocks=False).joined(_tree(text, where), 1)


def _tree(text: str, where: str) -> ast.expr:
    """Give what Python reads in a text whose tokens are checked."""
    try:
        return ast.parse(" ".join(text.split()), mode="eval").body
    except (SyntaxError, ValueError, MemoryError, RecursionError):
        problem = f"`{shown(text)}` is not an expression; look for a missing operator, operand or parenthesis"
        raise ModelError(where + problem) from None


def parse_relation(text: str, where: str = "", *, blocks: bool = False) -> tuple[Expression, Expression]:
    """Give the two sides of a law `left = right`.

    Raises
    ------
    ModelError
        if there is not one `=`, or a side is no expression.

    Example
    -------
    >>> parse_relation("e = K8")
    (Name(text='e'), Name(text='K8'))
    """
    _check_length(text, where, "law")
    sides = _EQUALS.split(text)
    if len(sides) != 2:
        raise ModelError(f"{where}`{shown(text)}` is not a law; write `left = right` with one `=`, such as `e = R*f`")
    return parse_expression(sides[0], where, blocks=blocks), parse_expression(sides[1], where, blocks=blocks)


def _check_length(text: str, where: str, word: str) -> None:
    if len(text) > MAX_LAW_LENGTH:
        raise ModelError(f"{where}the {word} has {len(text)} characters; at most {MAX_LAW_LENGTH} are read. Split it")


def _check_tokens(text: str, where: str, *, blocks: bool, condition: bool = False) -> None:
    """Refuse everything that is not a number, a name or an operator of ours; those of a condition only there."""
    if not text.strip():
        raise ModelError(f"{where}an expression is missing; write one, such as `R*f`")
    at = 0
    while at < len(text):
        match = _TOKEN.match(text, at)
        if match is None or (match["logic"] and not blocks) or (match["equality"] and not condition):
            advice = (_OF_CONDITIONS if condition else _ADVICE).get(text[at], _READ)
            raise ModelError(f"{where}cannot read `{shown(text[at : at + 20])}` in `{shown(text)}`; {advice}")
        if match["number"] and not math.isfinite(float(match["number"])):
            raise ModelError(f"{where}the number `{shown(match['number'])}` is too large; rescale it")
        for word in (match["name"] or "").split("."):
            if condition and word == "not":
                raise ModelError(f"{where}`not` is not read; turn the comparison, `mode != 1`, `speed <= idle`")
            if keyword.iskeyword(word) and not (condition and word in JOINS):
                raise ModelError(f"{where}`{word}` is a reserved word; choose another name")
        at = match.end()


class _Reader:
    """Turns the `ast` tree of one text into ours, counting as it goes."""

    def __init__(self, where: str, text: str, *, blocks: bool) -> None:
        self.where, self.text, self.blocks, self.nodes = where, text, blocks, 0

    def error(self, problem: str) -> ModelError:
        return ModelError(f"{self.where}`{shown(self.text)}`: {problem}")

    def expression(self, node: ast.expr, depth: int) -> Expression:
        self.nodes += 1
        if self.nodes > MAX_NODES:
            raise self.error(f"more than {MAX_NODES} numbers, names and operators; split the expression")
        if depth > MAX_LAW_DEPTH:
            raise self.error(f"more than {MAX_LAW_DEPTH} levels of nesting; split the expression")
        match node:
            case ast.Constant(value=int() | float() as value):
                return Number(float(value))
            case ast.Name(id=name):
                return Name(name)
            case ast.Attribute(value=ast.Name(id=part), attr=signal):
                return Name(f"{part}.{signal}")
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return Negative(self.expression(operand, depth + 1))
            case ast.UnaryOp(op=ast.Invert(), operand=operand):
                return Call(NOT, (self.expression(operand, depth + 1),))
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
                sides = self.expression(left, depth + 1), self.expression(right, depth + 1)
                exponent = constant_value(sides[1]) if isinstance(operator, ast.Pow) else None
                if exponent is not None and not abs(exponent) <= MAX_EXPONENT:
                    raise self.error(f"an exponent above {MAX_EXPONENT}; rewrite the power")
                return Binary(_OPERATORS[type(operator)], *sides)
            case ast.Call():
                return self.call(node, depth)
            case ast.Compare():
                raise self.error("a comparison may stand only in where(condition, a, b)")
        raise self.error("only + - * / **, a minus sign, functions, numbers and names are read")

    def call(self, node: ast.Call, depth: int) -> Expression:
        if not isinstance(node.func, ast.Name) or node.keywords:
            raise self.error(f"only functions may be called: {', '.join(FUNCTIONS)}")
        name, n_arguments = node.func.id, len(node.args)
        if name == RATE and self.blocks:
            if n_arguments == 1 and isinstance(node.args[0], ast.Name):
                return Call(RATE, (self.expression(node.args[0], depth + 1),))
            raise self.error("`der` takes the name of one signal, as in `der(y) = x/P`")
        if name == TABLE.strip():
            if n_arguments == 2 and isinstance(node.args[1], ast.Name):
                return Call(TABLE + node.args[1].id, (self.expression(node.args[0], depth + 1),))
            raise self.error("`table` takes an expression and the name of a table, as in `table(u, curve)`")
        if name not in FUNCTIONS:
            meant = ELSEWHERE.get(name.lower())
            near = f"did you mean `{meant}`?" if meant else choice(name, [*FUNCTIONS, TABLE.strip()])
            raise self.error(f"unknown function `{name}`; {near}")
        wanted = FUNCTIONS[name]
        if n_arguments < 2 if wanted < 0 else n_arguments != wanted:
            number = "two or more arguments" if wanted < 0 else f"{wanted} argument{'s'[: wanted - 1]}"
            raise self.error(f"`{name}` takes {number}, not {n_arguments}")
        if name == "where":
            condition = self.condition(node.args[0], depth + 1)
            return Call(name, (condition, *(self.expression(item, depth + 1) for item in node.args[1:])))
        return Call(name, tuple(self.expression(item, depth + 1) for item in node.args))

    def joined(self, node: ast.expr, depth: int) -> Expression:
        """Give a condition that is no part of a law."""
        self.nodes += 1
        if depth > MAX_LAW_DEPTH:
            raise self.error(f"more than {MAX_LAW_DEPTH} levels of nesting; split the expression")
        match node:
            case ast.BoolOp(op=join, values=values):
                first, *others = (self.joined(item, depth + 1) for item in values)
                for other in others:
                    first = Binary(_JOINED[type(join)], first, other)
                return first
            case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _COMPARED:
                sides = self.expression(left, depth + 1), self.expression(right, depth + 1)
                return Binary(_COMPARED[type(operator)], *sides)
            case ast.Compare():
                raise self.error("compare two things at a time, and join comparisons by `and`")
        raise self.error("it is a comparison, such as `mode == 1`, or some joined by `and` and `or`")

    def condition(self, node: ast.expr, depth: int) -> Expression:
        match node:
            case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _COMPARISON:
                self.nodes += 1
                sides = self.expression(left, depth + 1), self.expression(right, depth + 1)
                return Binary(_COMPARISON[type(operator)], *sides)
        raise self.error("where() needs one comparison (< <= > >=) as its first argument")


def constant_value(expression: Expression) -> float | None:
    """Give the value of an expression of numbers and `+ - * / **` only; None if it has names, nan if it has no value.

    Example
    -------
    >>> constant_value(parse_expression("1/4"))
    0.25
    """
    match expression:
        case Number(value):
            return value
        case Negative(operand):
            inner = constant_value(operand)
            return None if inner is None else -inner
        case Binary(operator, left, right) if operator in _ARITHMETIC.values():
            a, b = constant_value(left), constant_value(right)
            return None if a is None or b is None else arithmetic(operator, a, b)
    return None


def arithmetic(operator: str, a: float, b: float) -> float:
    """Give `a operator b` in floating point, 1 or 0 of a comparison; nan where there is no finite real value."""
    try:
        match operator:
            case "<":
                return float(a < b)
            case "<=":
                return float(a <= b)
            case ">":
                return float(a > b)
            case ">=":
                return float(a >= b)
            case "+":
                return a + b
            case "-":
                return a - b
            case "*":
                return a * b
            case "/":
                return a / b
        return math.pow(a, b)
    except (ValueError, OverflowError, ZeroDivisionError):
        return math.nan


_PRECEDENCE = {"or": -1, "and": 0, **dict.fromkeys(_COMPARED.values(), 1), "|": 2, "^": 3, "&": 4}
_PRECEDENCE |= {"+": 5, "-": 5, "*": 6, "/": 6, "**": 8}
_SPACED = 5  # operators up to this strength stand between spaces
_MINUS = 7  # also of `~`
_ATOM = 9
_WEAKEST = -1


def to_text(expression: Expression) -> str:
    """Give the text that parses to exactly this tree, with as few parentheses as that allows.

    Example
    -------
    >>> to_text(parse_expression("(a - (b - c)) * ((d))**2"))
    '(a - (b - c))*d**2'
    """
    return _text(expression, _WEAKEST)


def _text(expression: Expression, needed: int) -> str:
    """Give the text, in parentheses if it binds weaker than needed."""
    match expression:
        case Number(value):
            return number_text(value)
        case Name(text):
            return text
        case Negative(operand):
            own, text = _MINUS, f"-{_text(operand, _MINUS)}"
        case Call("not", (operand,)):
            own, text = _MINUS, f"~{_text(operand, _MINUS)}"
        case Call(function, (argument,)) if function.startswith(TABLE):
            return f"{TABLE.strip()}({_text(argument, 0)}, {function.removeprefix(TABLE)})"
        case Call(function, arguments):
            return f"{function}({', '.join([_text(argument, 0) for argument in arguments])})"
        case Binary(operator, left, right):
            own, power = _PRECEDENCE[operator], operator == "**"
            sides = _text(left, _ATOM if power else own), _text(right, _MINUS if power else own + 1)
            text = (operator if own > _SPACED else f" {operator} ").join(sides)
    return text if own >= needed else f"({text})"


def number_text(value: float) -> str:
    """Give the shortest text of a number that reads back exactly: `100`, `0.5`, `2.41e11`."""
    if value.is_integer() and abs(value) < 1e7:
        return str(int(value))
    if 1e-4 <= abs(value) < 1e7 or not math.isfinite(value):
        return repr(value)
    mantissa, _, exponent = f"{Decimal(repr(value)).normalize():e}".partition("e")
    return f"{mantissa}e{int(exponent)}"
