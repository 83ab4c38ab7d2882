"""All real values of a few unknowns that meet the equations of some observations.

Equations become polynomials over the fractions, branch by branch; signals are eliminated where they stand with a plain
number, the rest by a Groebner basis, and roots are given exactly where they have a form. Whoever asks has to check
each solution in the original equations: that discards roots outside their branch. Equations that are no polynomials,
or too large, are left to `search`.
Source: thesis 3.7.2 (roots and branches), 4.3; Cox, Little and O'Shea, Ideals, Varieties, and Algorithms, chapter 3.
"""

import operator
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from math import isfinite, prod

import sympy as sp
from mpmath.libmp import NoConvergence
from sympy.polys.matrices import DomainMatrix

from faultbond.equations.numeric import Real, exact, numeric_value
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, names, walk
from faultbond.networks.propagation import Propagated

ExactPoint = dict[str, sp.Expr]  # an exact value, or one of 30 digits, by name
PolynomialSystem = tuple[sp.Expr, ...]  # polynomials that vanish

MAX_CASES = 64  # combinations of branches
MAX_DEGREE = 30  # in one unknown
MAX_SOLUTIONS = 60  # product of the degrees of a system
MAX_UNKNOWNS = 6
MAX_POWER = 16
MAX_TERMS = 500  # of a polynomial
DIGITS = 30
_ARITHMETIC: dict[str, Callable[[sp.Expr, sp.Expr], sp.Expr]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_BRANCHES = {"abs": 2, "sign": 3, "where": 2}
_NEARLY_REAL = 1e-6  # a double root of inexact data has an imaginary part of this size, relative


@dataclass(frozen=True, slots=True)
class NotPolynomialError(Exception):
    """The equations are no polynomials in the unknowns, or too large."""


def number(value: Real) -> sp.Rational:
    """Give a value as a fraction of sympy."""
    fraction = value if isinstance(value, Fraction) else exact(value)
    return sp.Rational(fraction.numerator, fraction.denominator)


def value_of(expression: sp.Expr) -> Fraction:
    """Give a number of sympy as a fraction, exact if it is one, else of 30 digits."""
    if expression.is_Rational:
        return Fraction(int(expression.p), int(expression.q))
    return Fraction(str(sp.N(expression, DIGITS)))


def polynomial_cases(found: Propagated, wanted: Collection[str], tag: str) -> list[PolynomialSystem]:
    """Give the equations that propagation left as polynomials, one system for each combination of branches.

    Parameters
    ----------
    found : what followed from one observation
    wanted : unknowns that all observations share; signals become symbols of this observation
    tag : mark of this observation

    Raises
    ------
    NotPolynomialError
        if an equation is none, or there are too many branches.
    """
    sides = [side for equation in found.open for side in (equation.left, equation.right)]
    calls = (part for side in sides for part in walk(side) if isinstance(part, Call))
    branching = (call for call in calls if call.function in {*_BRANCHES, "min", "max"})
    points = dict.fromkeys(call for call in branching if not found.known.keys() >= set(names(call)))
    options = [range(_BRANCHES.get(call.function, len(call.arguments))) for call in points]
    if prod(len(option) for option in options) > MAX_CASES:
        raise NotPolynomialError
    cases = []
    for chosen in product(*options):
        reader = _Reader(found.known, frozenset(wanted), tag, dict(zip(points, chosen, strict=True)))
        for equation in found.open:
            reader.equations.append(reader.read(equation.left) - reader.read(equation.right))
        numerators = [sp.expand(sp.fraction(sp.together(item))[0]) for item in reader.equations]
        cases.append(_eliminated(numerators, wanted))
    return cases


class _Reader:
    """Turns expressions into sympy for one choice of branches; `equations` collects what defines roots and kinks."""

    def __init__(self, known: Mapping[str, Real], wanted: frozenset[str], tag: str, chosen: Mapping[Call, int]) -> None:
        self.known, self.wanted, self.tag, self.chosen = known, wanted, tag, chosen
        self.equations: list[sp.Expr] = []
        self.roots: dict[tuple[sp.Expr, int], sp.Symbol] = {}

    def read(self, expression: Expression) -> sp.Expr:
        if self.known.keys() >= set(names(expression)):
            value = numeric_value(expression, self.known)
            if not isfinite(value):
                raise NotPolynomialError
            return number(value)
        match expression:
            case Name(text):
                return sp.Symbol(text if text in self.wanted else f"{text}@{self.tag}")
            case Negative(operand):
                return -self.read(operand)
            case Binary("**", left, right):
                base, exponent = self.read(left), self.read(right)
                if not exponent.is_Rational or exponent.q > 6 or abs(exponent.p) > MAX_POWER:
                    raise NotPolynomialError
                return self.root(base, int(exponent.q)) ** int(exponent.p)
            case Binary(operation, left, right) if operation in _ARITHMETIC:
                one, other = self.read(left), self.read(right)
                if operation == "/" and other == 0:
                    raise NotPolynomialError
                return _ARITHMETIC[operation](one, other)
            case Call("sqrt", (argument,)):
                return self.root(self.read(argument), 2)
            case Call() if expression in self.chosen:
                return self.branch(expression, self.chosen[expression])
        raise NotPolynomialError

    def branch(self, call: Call, chosen: int) -> sp.Expr:
        match call:
            case Call("abs", (argument,)):
                return self.read(argument) * (1, -1)[chosen]
            case Call("sign", (argument,)):
                if chosen == 2:
                    self.equations.append(self.read(argument))
                return sp.Integer((1, -1, 0)[chosen])
            case Call("where", (_, yes, no)):
                return self.read((yes, no)[chosen])
        return self.read(call.arguments[chosen])  # min, max

    def root(self, base: sp.Expr, degree: int) -> sp.Expr:
        """Give the symbol of a root that `equations` defines; its sign is left to the check."""
        if degree == 1:
            return base
        if (base, degree) not in self.roots:
            symbol = sp.Symbol(f"root {len(self.roots)}@{self.tag}")
            self.roots[base, degree] = symbol
            self.equations.append(symbol**degree - base)
        return self.roots[base, degree]


def _eliminated(equations: Sequence[sp.Expr], wanted: Collection[str]) -> PolynomialSystem:
    """Substitute signals that stand in an equation with a plain number as their factor, shortest equation first."""
    left = [item for item in equations if item != 0]
    while True:
        pivots = (
            (item, symbol)
            for item in sorted(left, key=lambda item: (len(item.free_symbols), int(item.count_ops()), str(item)))
            for symbol in sorted(item.free_symbols, key=str)
            if symbol.name not in wanted and item.coeff(symbol).is_Rational and sp.degree(item, symbol) == 1
        )
        item, symbol = next(pivots, (None, None))
        if item is None or symbol is None:
            return tuple(left)
        solution = symbol - item / item.coeff(symbol)
        others = [other for other in left if other is not item]
        left = [sp.expand(other.subs(symbol, sp.expand(solution))) if other.has(symbol) else other for other in others]
        left = [other for other in left if other != 0]
        if any(len(other.args) > MAX_TERMS for other in left):
            raise NotPolynomialError


def real_points(system: PolynomialSystem, wanted: Sequence[str]) -> list[ExactPoint] | None:
    """Give the real solutions of a system for the wanted unknowns; None where they are infinitely many.

    Without wanted unknowns: the solutions for all symbols.

    Raises
    ------
    NotPolynomialError
        if the system is too large.
    """
    system = tuple(item for item in system if item != 0)
    if any(item.is_number for item in system):
        return []
    every = sorted({symbol for item in system for symbol in item.free_symbols}, key=str)
    target = [sp.Symbol(name) for name in wanted] or every
    others = [symbol for symbol in every if symbol not in target]
    if not system:
        return None if target else [{}]
    polynomials = [sp.Poly(item, *every) for item in system]
    degrees = [int(item.total_degree()) for item in polynomials]
    if not others and max(degrees) == 1:
        return _linear_point(polynomials, target)
    if not others and len(every) < len(target):
        return [] if real_points(system, [symbol.name for symbol in every]) == [] else None
    if len(every) > MAX_UNKNOWNS or prod(degrees) > (MAX_DEGREE if len(every) == 1 else MAX_SOLUTIONS):
        raise NotPolynomialError
    if len(every) == len(system) == 1:
        roots = _real_roots(polynomials[0])
        if others:  # says nothing of the wanted unknown, unless it cannot be met
            return None if roots else []
        return [{every[0].name: root} for root in roots]
    basis = sp.groebner(system, *others, *target, order="lex").exprs
    if basis == [1]:
        return []
    own = [item for item in basis if not item.free_symbols & set(others)]
    if not own or not sp.groebner(own, *target, order="lex").is_zero_dimensional:
        return None
    return [{symbol.name: point[symbol.name] for symbol in target} for point in _extended(own, target, {})]


def _linear_point(system: list[sp.Poly], target: list[sp.Symbol]) -> list[ExactPoint] | None:
    """Give the solution of linear equations, in fractions."""
    width = len(target)
    place = [target.index(symbol) for symbol in system[0].gens]
    rows = []
    for polynomial in system:
        row = [sp.QQ(0)] * (width + 1)
        for powers, coefficient in polynomial.as_dict().items():
            row[place[powers.index(1)] if any(powers) else width] = sp.QQ(coefficient.p, coefficient.q)
        rows.append(row)
    reduced, pivots = DomainMatrix(rows, (len(rows), width + 1), sp.QQ).rref(method="GJ")
    if width in pivots or len(pivots) < width:
        return [] if width in pivots else None
    values = [-row[width] for row in reduced.to_list()[:width]]
    pairs = zip(target, values, strict=True)
    return [{symbol.name: sp.Rational(value.numerator, value.denominator) for symbol, value in pairs}]


def _extended(basis: list[sp.Expr], unknown: list[sp.Symbol], found: dict[sp.Symbol, sp.Expr]) -> Iterator[ExactPoint]:
    """Solve a lexicographic basis from its last unknown up."""
    if not unknown:
        yield {symbol.name: value for symbol, value in found.items()}
        return
    *higher, symbol = unknown
    of_it = [item for item in basis if symbol in item.free_symbols and item.free_symbols <= {symbol, *found}]
    linear = next(
        (item for item in of_it if sp.Poly(item, symbol).LC().is_Rational and sp.degree(item, symbol) == 1), None
    )
    if linear is not None:
        values = [sp.radsimp(sp.expand((symbol - linear / linear.coeff(symbol)).subs(found)))]
    else:
        left = [polynomial for item in of_it if (polynomial := _specialised(item, symbol, found)).degree() > 0]
        least = min(left, key=lambda polynomial: int(polynomial.degree()), default=None)
        values = [] if least is None else _real_roots(least)
    for value in values:
        yield from _extended(basis, higher, {**found, symbol: value})


def _specialised(item: sp.Expr, symbol: sp.Symbol, found: Mapping[sp.Symbol, sp.Expr]) -> sp.Poly:
    """Give a polynomial in one symbol, in 50 digits where the others are no fractions; what should vanish then does."""
    if all(value.is_Rational for value in found.values()):
        return sp.Poly(item.subs(found), symbol)
    numbers = {other: sp.Rational(str(sp.N(value, 50))) for other, value in found.items()}
    polynomial = sp.Poly(item.subs(numbers), symbol)
    least = max(abs(coefficient) for coefficient in polynomial.coeffs()) / 10**25
    return sp.Poly.from_dict({power: c for power, c in polynomial.as_dict().items() if abs(c) > least}, symbol)


def _real_roots(polynomial: sp.Poly) -> list[sp.Expr]:
    """Give the real roots in rising order, each once, exact where they have a form, and those that are nearly real."""
    simple = polynomial.sqf_part()
    roots = list(sp.real_roots(simple))
    if len(roots) < simple.degree():
        complex_roots = []
        with suppress(NoConvergence):  # of coefficients hundreds of powers of ten apart; the real roots are all there
            complex_roots = [root.as_real_imag() for root in simple.nroots(n=DIGITS, maxsteps=500)]
        nearly = (real for real, imaginary in complex_roots if 0 < imaginary <= _NEARLY_REAL * abs(real))
        roots += [sp.Rational(str(real)) for real in nearly]
    return sorted(roots, key=lambda root: sp.N(root, DIGITS))
