"""C text of a filter graph: one statement per operation, eight lanes at a time.

Values that depend on the sample only stay scalars, the rest are vectors of eight doubles (GCC and Clang vector
extension), so the same text runs eight hypotheses, or eight assets, per call.
"""

from collections.abc import Iterator
from string import Template

import casadi as ca

from faultbond.errors import GenerationError

LANES = 8

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
_NAMES = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}


def emit_filter(function: ca.Function, template: str) -> str:
    """Give the C source of a filter function (lane, sample) -> (lane, innovations).

    Raises
    ------
    GenerationError
        Where the graph holds an operation that has no C form here.
    """
    return Template(template).substitute(
        lanes=LANES,
        n_numbers=function.numel_in(0),
        n_sample=function.numel_in(1),
        n_innovations=function.numel_out(1),
        body="\n".join(_statements(function)),
    )


def _statements(function: ca.Function) -> Iterator[str]:
    value: dict[int, str] = {}  # work slot -> C name
    vector: dict[str, bool] = {}
    outputs = ("next", "innovation")
    for k in range(function.n_instructions()):
        operation = _NAMES[function.instruction_id(k)]
        inputs, results = function.instruction_input(k), function.instruction_output(k)
        if operation == "OP_INPUT":
            name = f"{'lane' if inputs[0] == 0 else 'sample'}[{inputs[1]}]"
            value[results[0]], vector[name] = name, inputs[0] == 0
        elif operation == "OP_CONST":
            name = _literal(float(function.instruction_constant(k)))
            value[results[0]], vector[name] = name, False
        elif operation == "OP_OUTPUT":
            name = value[inputs[0]]
            text = name if vector[name] else f"broadcast({name})"
            yield f"    {outputs[results[0]]}[{results[1]}] = {text};"
        elif operation == "OP_ASSIGN":
            value[results[0]] = value[inputs[0]]
        else:
            arguments = [value[slot] for slot in inputs]
            wide = any(vector[name] for name in arguments)
            name = f"v{k}"
            yield f"    const {'lanes' if wide else 'double'} {name} = {_term(operation, arguments, vector, wide)};"
            value[results[0]], vector[name] = name, wide


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
        raise GenerationError(f"no C form for {operation}; run without a compiler (--engine vm)")
    call = _FUNCTIONS[operation]
    if not wide:
        return f"{call}({', '.join(arguments)})"
    wrapped = (name if vector[name] else f"broadcast({name})" for name in arguments)
    return f"v_{call}({', '.join(wrapped)})"


def _literal(number: float) -> str:
    text = repr(number)
    return f"({text})" if number < 0 else text
