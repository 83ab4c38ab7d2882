"""The quick way through networks in which every signal follows from inputs and parameters by arithmetic."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from math import isfinite

import sympy as sp
from sympy.polys.rings import PolyElement, PolyRing, ring

from faultbond.analysis.static_equations import defines, holds
from faultbond.analysis.static_network import Observation, StaticNetwork, followed
from faultbond.analysis.static_solve import NotPolynomialError
from faultbond.model.expression import Binary, Expression, Name, Negative, Number, names
from faultbond.structure.numeric import Value, evaluate, exact

Quotient = tuple[PolyElement, PolyElement]  # numerator, denominator


def is_explicit(network: StaticNetwork, seen: Observation) -> bool:
    """Whether all readings of an observation follow, step by step, from its inputs."""
    known = seen.healthy.values if seen.healthy is not None else {}
    read = (item for item in network.readings if item.sensor in seen.sensors)
    return network.is_explicit and all(name in known for item in read for name in item.names)


def agrees(network: StaticNetwork, seen: Observation, values: Mapping[str, Value]) -> bool:
    """Whether parameters of these values give the readings of an explicit observation."""
    if seen.healthy is None:
        return False
    known = followed(network, seen.healthy, values)
    read = (item for item in network.readings if item.sensor in seen.sensors)
    return all(holds(item, known.values, known.sizes) for item in read)


def reading_equations(network: StaticNetwork, suspects: Sequence[str], seen: Observation) -> tuple[sp.Expr, ...] | None:
    """Give what the readings of an explicit observation say of suspended parameters, as polynomials that vanish.

    None where a reading that they do not influence is wrong.

    Raises
    ------
    NotPolynomialError
        where a law is no arithmetic of them.
    """
    if seen.healthy is None:
        raise NotPolynomialError
    ring_of_it, *elements = _ring(tuple(suspects))
    one = ring_of_it.one
    images = {name: (element, one) for name, element in zip(suspects, elements, strict=True)}
    known = seen.healthy
    for law in network.laws:
        signal = defines(law)
        told = all(name in images or name in known.values for name in law.names if name != signal)
        if signal is not None and told and not images.keys().isdisjoint(law.names):
            images[signal] = _image(law.right, known.values, images, one)
    equations = []
    for item in network.readings:
        if item.sensor not in seen.sensors:
            continue
        if not images.keys().isdisjoint(item.names):
            left, right = (_image(side, known.values, images, one) for side in (item.left, item.right))
            equations.append(_arithmetic("-", left, right)[0].as_expr())
        elif not holds(item, known.values, known.sizes):
            return None
    return tuple(item for item in equations if item != 0)


@lru_cache(maxsize=256)
def _ring(suspects: tuple[str, ...]) -> tuple[PolyRing, ...]:
    return tuple(ring([sp.Symbol(name) for name in suspects], sp.QQ))


def _image(
    expression: Expression, values: Mapping[str, Value], images: Mapping[str, Quotient], one: PolyElement
) -> Quotient:
    """Give an expression as a quotient of polynomials in the suspended parameters."""
    if images.keys().isdisjoint(names(expression)):
        value = evaluate(expression, values)
        if not isfinite(value):
            raise NotPolynomialError
        fraction = exact(value) if isinstance(value, float) else value
        return one * sp.QQ(fraction.numerator, fraction.denominator), one
    match expression:
        case Name(text):
            return images[text]
        case Negative(operand):
            above, below = _image(operand, values, images, one)
            return -above, below
        case Binary("**", base, Number(power)) if power == int(power):
            above, below = _image(base, values, images, one)
            above, below = (above, below) if power >= 0 else (below, above)
            return above ** abs(int(power)), below ** abs(int(power))
        case Binary("+" | "-" | "*" | "/" as operator, left, right):
            return _arithmetic(operator, _image(left, values, images, one), _image(right, values, images, one))
    raise NotPolynomialError


def _arithmetic(operator: str, left: Quotient, right: Quotient) -> Quotient:
    (a, b), (c, d) = left, right
    match operator:
        case "*":
            return a * c, b * d
        case "/" if c:
            return a * d, b * c
        case "+" | "-":
            c = c if operator == "+" else -c
            return (a + c, b) if b == d else (a * d + c * b, b * d)
    raise NotPolynomialError
