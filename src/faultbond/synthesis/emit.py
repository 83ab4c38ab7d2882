"""C text of a graph: one statement per operation, several lanes at a time.

Values that no lane moves stay scalars, the rest are vectors of doubles (GCC and Clang vector extension), so the
same text runs several hypotheses, or assets, per call.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import casadi as ca

from faultbond.errors import GenerationError

_BINARY = {"OP_ADD": "+", "OP_SUB": "-", "OP_MUL": "*", "OP_DIV": "/"}
_FUNCTIONS = {  # operations that are a call in C, for scalars and (with v_) for vectors
    "OP_EXP": "exp",
    "OP_LOG": "log",
    "OP_POW": "pow",
    "OP_CONSTPOW": "pow",
    "OP_SQRT": "sqrt",
    "OP_SIN": "sin",
    "OP_COS": "cos",
    "OP_TAN": "tan",
    "OP_TANH": "tanh",
    "OP_FABS": "fabs",
    "OP_FMIN": "fmin",
    "OP_FMAX": "fmax",
    "OP_SIGN": "sign_of",
    "OP_LT": "less",
    "OP_LE": "less_equal",
    "OP_EQ": "equal",
    "OP_NE": "not_equal",
    "OP_NOT": "not_true",
    "OP_AND": "both",
    "OP_OR": "either",
    "OP_IF_ELSE_ZERO": "where_true",
}
_OWN = frozenset({"exp", "log", "pow"})  # that maths.h has for scalars too, by the name with _one
_IN_NAMES = {ord("["): "_", ord("]"): ""}  # of an argument, such as v[3], which is not v3
_NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}


@dataclass(frozen=True, slots=True)
class Statement:
    """One operation: what it defines (None: an output), whether that is a vector, its text, and lanes it divides by."""

    defines: str | None
    wide: bool
    uses: tuple[str, ...]
    text: str
    divisor: str = ""

    @property
    def line(self) -> str:
        """The statement as a line of C."""
        return self.text if self.defines is None else _definition(self.defines, self.wide, self.text)


def statements(function: ca.Function, inputs: Mapping[str, bool], outputs: Mapping[str, bool]) -> Iterator[Statement]:
    """Give the operations of a function as C, in order.

    What several lanes are divided by is inverted once: a division takes ten times as long as a product.

    Parameters
    ----------
    function : of columns of numbers
    inputs : the names of its arguments in C, and which of them are lanes
    outputs : the names of its results, and which of them are lanes; others must not depend on any

    Raises
    ------
    GenerationError
        Where the graph holds an operation that has no C form here.
    """
    found = list(_operations(function, inputs, outputs))
    often = {name for name, count in Counter(item.divisor for item in found).items() if name and count > 1}
    inverse: dict[str, str] = {}
    for item in found:
        if item.divisor not in often:
            yield item
            continue
        if item.divisor not in inverse:
            inverse[item.divisor] = f"by_{item.divisor.translate(_IN_NAMES)}"
            yield Statement(inverse[item.divisor], item.wide, (item.divisor,), f"1.0 / {item.divisor}")
        by = inverse[item.divisor]
        yield replace(item, text=f"{item.uses[0]} * {by}" if len(item.uses) > 1 else by)


def _operations(function: ca.Function, inputs: Mapping[str, bool], outputs: Mapping[str, bool]) -> Iterator[Statement]:
    """Give the operations of a function as they stand."""
    names, results_of = list(inputs.items()), list(outputs.items())
    value: dict[int, str] = {}  # work slot -> C name
    vector: dict[str, bool] = {}
    for k in range(function.n_instructions()):
        operation = _NAMES[function.instruction_id(k)]
        operands, results = function.instruction_input(k), function.instruction_output(k)
        if operation == "OP_INPUT":
            argument, wide = names[operands[0]]
            name = f"{argument}[{operands[1]}]"
            value[results[0]], vector[name] = name, wide
        elif operation == "OP_CONST":
            name = literal(float(function.instruction_constant(k)))
            value[results[0]], vector[name] = name, False
        elif operation == "OP_OUTPUT":
            name = value[operands[0]]
            result, wide = results_of[results[0]]
            text = name if vector[name] or not wide else f"broadcast({name})"
            yield Statement(None, wide, (name,), f"{result}[{results[1]}] = {text};")
        elif operation == "OP_ASSIGN":
            value[results[0]] = value[operands[0]]
        else:
            arguments = [value[slot] for slot in operands]
            wide = any(vector[name] for name in arguments)
            name = f"v{k}"
            divisor = arguments[-1] if operation in {"OP_DIV", "OP_INV"} and vector[arguments[-1]] else ""
            yield Statement(name, wide, tuple(arguments), _term(operation, arguments, vector, wide), divisor)
            value[results[0]], vector[name] = name, wide


def _definition(name: str, wide: bool, text: str) -> str:
    return f"const {'lanes' if wide else 'double'} {name} = {text};"


def _term(operation: str, arguments: list[str], vector: dict[str, bool], wide: bool) -> str:
    first = arguments[0]
    if operation in _BINARY:
        return f"{first} {_BINARY[operation]} {arguments[1]}"
    match operation:
        case "OP_NEG":
            return f"-{first}"
        case "OP_SQ":
            return f"{first} * {first}"
        case "OP_TWICE":
            return f"{first} + {first}"
        case "OP_INV":
            return f"1.0 / {first}"
    if operation not in _FUNCTIONS:
        raise GenerationError(f"no C form for {operation}; please report it with the model")
    call = _FUNCTIONS[operation]
    if not wide:
        return f"{call}{'_one' if call in _OWN else ''}({', '.join(arguments)})"
    wrapped = (name if vector[name] else f"broadcast({name})" for name in arguments)
    return f"v_{call}({', '.join(wrapped)})"


def literal(number: float) -> str:
    """Give a number as C; the same number when it is read back."""
    text = repr(float(number)).replace("inf", "INFINITY").replace("nan", "NAN")
    return f"({text})" if number < 0 else text
