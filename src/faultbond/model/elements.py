"""Elements of a bond graph: their own signals and their laws by default. Source: thesis 3.2.2."""

from faultbond.types import ElementType

DEFAULT_LAWS = {  # where no law is stated and there is one parameter X
    ElementType.R: ("e = X*f",),
    ElementType.C: ("q = X*e",),
    ElementType.I: ("p = X*f",),
    ElementType.TF: ("e1 = X*e2", "f2 = X*f1"),
    ElementType.GY: ("e1 = X*f2", "e2 = X*f1"),
}
OWN_SIGNALS = {  # what a law of the element may name without a dot
    ElementType.R: ("e", "f"),
    ElementType.C: ("e", "q", "f"),
    ElementType.I: ("f", "p", "e"),
    ElementType.TF: ("e1", "f1", "e2", "f2"),
    ElementType.GY: ("e1", "f1", "e2", "f2"),
    ElementType.SE: ("e",),
    ElementType.SF: ("f",),
}
MUST_NAME = {  # what the laws of the element must relate
    **OWN_SIGNALS,
    ElementType.C: ("e", "q"),
    ElementType.I: ("f", "p"),
}


def default_laws(element: ElementType, parameter: str) -> list[str]:
    """Give the laws of an element with one parameter that states none; empty for sources."""
    return [law.replace("X", parameter) for law in DEFAULT_LAWS.get(element, ())]
