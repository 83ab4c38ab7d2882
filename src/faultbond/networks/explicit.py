"""The quick way through networks in which every signal follows from inputs and parameters by arithmetic."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from math import isfinite

import sympy as sp
from sympy.polys.rings import PolyElement, PolyRing, ring

from faultbond.equations.numeric import Real, exact, numeric_value
from faultbond.model.expression import Binary, Expression, Name, Negative, names
from faultbond.networks.polynomial_roots import MAX_POWER, MAX_TERMS, NotPolynomialError
from faultbond.networks.relations import holds, magnitude
from faultbond.networks.static_network import READING, Observation, StaticNetwork, followed, wrong_readings

PolynomialQuotient = tuple[PolyElement, PolyElement]  # numerator, denominator


def is_explicit(network: StaticNetwork, seen: Observation) -> bool:
    """Whether all readings of an observation follow, step by step, from its inputs."""
    known = seen.healthy.values if seen.healthy is not None else {}
    read = (item for item in network.readings if item.sensor in seen.sensors)
    return network.is_explicit and all(name in known for item in read for name in item.names)


def agrees(network: StaticNetwork, seen: Observation, values: Mapping[str, Real]) -> bool:
    """Whether parameters of these values give the readings of an explicit observation."""
    if seen.healthy is None:
        return False
    return next(wrong_readings(network, seen, followed(network, seen.healthy, values)), None) is None


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
        if images.keys().isdisjoint(law.uses) or law.signal is None:
            continue
        if all(name in images or name in known.values for name in law.uses):
            images[law.signal] = _quotient(_image(law.right, known.values, images, one), one)
    equations = []
    for item in network.readings:
        if item.sensor not in seen.sensors:
            continue
        if not images.keys().isdisjoint(item.names):
            read = _image(item.right, known.values, images, one)
            gap = _arithmetic("-", _quotient(read, one), _quotient(known.values[READING + item.sensor], one))
            equations.append(gap[0].as_expr())
        elif not holds(item, known.values, known.sizes):
            return None
    return tuple(item for item in equations if item != 0)


@lru_cache(maxsize=256)
def _ring(suspects: tuple[str, ...]) -> tuple[PolyRing, ...]:
    return tuple(ring([sp.Symbol(name) for name in suspects], sp.QQ))


def _image(
    expression: Expression, values: Mapping[str, Real], images: Mapping[str, PolynomialQuotient], one: PolyElement
) -> PolynomialQuotient | Real:
    """Give an expression as a quotient of polynomials in the suspended parameters, or its value without them."""
    match expression:
        case Name(text):
            return images[text] if text in images else values[text]
        case Negative(operand):
            image = _image(operand, values, images, one)
            return (-image[0], image[1]) if isinstance(image, tuple) else -image
        case Binary(operator, left, right):
            first, second = _image(left, values, images, one), _image(right, values, images, one)
            if not (isinstance(first, tuple) or isinstance(second, tuple)):
                return numeric_value(expression, values)
            if operator != "**":
                return _arithmetic(operator, _quotient(first, one), _quotient(second, one))
            if (
                isinstance(first, tuple)
                and not isinstance(second, tuple)
                and magnitude(second) <= MAX_POWER
                and second == int(second)
            ):
                above, below = first if second >= 0 else first[::-1]
                return _limited(above ** abs(int(second)), below ** abs(int(second)))
            raise NotPolynomialError
    if images.keys().isdisjoint(names(expression)):
        return numeric_value(expression, values)
    raise NotPolynomialError


def _quotient(image: PolynomialQuotient | Real, one: PolyElement) -> PolynomialQuotient:
    if isinstance(image, tuple):
        return image
    if not isfinite(image):
        raise NotPolynomialError
    fraction = exact(image) if isinstance(image, float) else image
    return one * sp.QQ(fraction.numerator, fraction.denominator), one


def _arithmetic(operator: str, left: PolynomialQuotient, right: PolynomialQuotient) -> PolynomialQuotient:
    (a, b), (c, d) = left, right
    match operator:
        case "*":
            return _limited(a * c, b * d)
        case "/" if c:
            return _limited(a * d, b * c)
        case "+" | "-":
            c = c if operator == "+" else -c
            return (a + c, b) if b == d else _limited(a * d + c * b, b * d)
    raise NotPolynomialError


def _limited(above: PolyElement, below: PolyElement) -> PolynomialQuotient:
    if max(len(above), len(below)) > MAX_TERMS:
        raise NotPolynomialError
    return above, below
