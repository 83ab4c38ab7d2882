"""Component networks of a few equations, written in one line."""

from faultbond.algebra.route import Question, Target
from faultbond.equations.component_network import ComponentNetwork, Equation, FrameState
from faultbond.model.expression import Number


def network(text: str, outputs: str = "y", states: str = "") -> ComponentNetwork:
    """A network of `name: signals` separated by semicolons.

    `x@` is x one frame earlier, a capital is a parameter, `name?` is a sensor's equation, which weighs nothing.
    """
    equations = tuple(_equation(part) for part in text.split(";"))
    signals = tuple(dict.fromkeys(signal for item in equations for signal, _ in item.signals))
    names = tuple(dict.fromkeys(name for item in equations for name in item.parameters))
    return ComponentNetwork(
        name="net",
        equations=equations,
        signals=signals,
        inputs=(),
        outputs=tuple(outputs.split()),
        states=tuple(FrameState(signal=x, rate=f"d{x}", sum=f"s{x}", component=None) for x in states.split()),
        parameters=names,
        suspects=names,
    )


def _equation(text: str) -> Equation:
    name, _, rest = text.partition(":")
    words = rest.split()
    return Equation(
        name=name.strip(" ?"),
        owner=name.strip(" ?"),
        residual=Number(0.0),
        signals=tuple((word.rstrip("@"), word.count("@")) for word in words if word[0].islower()),
        parameters=tuple(word for word in words if word[0].isupper()),
        weight=0 if "?" in name else 1,
    )


def ask(net: ComponentNetwork, *targets: Target) -> Question:
    """The question for these targets; parameters among them are unknown."""
    unknown = tuple(target for target in targets if isinstance(target, str))
    return Question(targets=targets, unknown=unknown, observed=net.observed)
