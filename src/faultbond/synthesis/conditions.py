"""The conditions under which a model and its sensors hold, as C of the inputs."""

from collections.abc import Mapping

from faultbond.contract.spec import EngineSpec
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number
from faultbond.model.graph import BondGraph
from faultbond.synthesis.emit import literal

_FUNCTIONS = {"abs": "fabs", "min": "fmin", "max": "fmax"}
_OPERATORS = {"and": "&&", "or": "||"}


def states_text(spec: EngineSpec, graph: BondGraph) -> str:
    """Give the function of a core that tells whether a condition is true."""
    constants = {item.name: literal(item.value) for item in graph.constants}
    names = constants | {item.name: f"u[{k}]" for k, item in enumerate(spec.inputs)}
    cases = "".join(
        f"    if (condition == {k}) return {_text(item.condition, names)};\n" for k, item in enumerate(graph.conditions)
    )
    head = "static inline int model_holds(int condition, const double *FB_RESTRICT u)"
    return f"\n{head}\n{{\n    (void)condition, (void)u;\n{cases}    return 1;\n}}"


def _text(expression: Expression, names: Mapping[str, str]) -> str:
    match expression:
        case Number(value):
            return literal(value)
        case Name(text):
            return names[text]
        case Negative(operand):
            return f"(-{_text(operand, names)})"
        case Binary("**", base, exponent):
            return f"pow({_text(base, names)}, {_text(exponent, names)})"
        case Binary(operator, left, right):
            return f"({_text(left, names)} {_OPERATORS.get(operator, operator)} {_text(right, names)})"
        case Call("sign", (argument,)):
            text = _text(argument, names)
            return f"(({text} > 0.0) - ({text} < 0.0))"
        case Call("where", (condition, yes, no)):
            return f"({_text(condition, names)} ? {_text(yes, names)} : {_text(no, names)})"
        case Call(function, (first, *others)):
            text, name = _text(first, names), _FUNCTIONS.get(function, function)
            for other in others:
                text = f"{name}({text}, {_text(other, names)})"
            return text if others else f"{name}({text})"
    raise AssertionError(expression)
