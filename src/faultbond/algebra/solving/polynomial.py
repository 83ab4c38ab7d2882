"""Sparse polynomials with whole coefficients in many names, small and quick.

A monomial is one integer that holds the powers of all names side by side, so that a product of monomials is a sum of
integers. A polynomial maps monomials to coefficients; there are no zero coefficients.
Source: the packed exponents of Monagan and Pearce 2007 (sparse polynomial division using a heap).
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from functools import reduce
from heapq import heapify, heappop, heappush
from math import gcd

Polynomial = dict[int, int]

BITS = 12  # of a power, the highest of which stays free as a guard
_FIELD = (1 << BITS) - 1
MAX_POWER = 1 << (BITS - 2)


class TooLargeError(Exception):
    """An expression outgrew its limit."""


@dataclass(frozen=True, slots=True)
class Space:
    """The names of a set of polynomials; a later name weighs more in the order of monomials."""

    names: tuple[str, ...]
    shifts: dict[str, int]
    max_terms: int = 20_000

    @property
    def guard(self) -> int:
        """The guard bits of all powers."""
        return sum(1 << (shift + BITS - 1) for shift in self.shifts.values())

    def mask(self, names: Iterable[str]) -> int:
        """Give the bits that hold the powers of some names."""
        return sum(_FIELD << self.shifts[name] for name in names)

    def name(self, name: str) -> Polynomial:
        """Give the polynomial that is a name."""
        return {1 << self.shifts[name]: 1}

    def powers(self, monomial: int) -> dict[str, int]:
        """Give the names of a monomial with their powers."""
        return {name: power for name, shift in self.shifts.items() if (power := monomial >> shift & _FIELD)}


def space_of(names: Collection[str], max_terms: int = 20_000) -> Space:
    """Give the space of polynomials in some names."""
    ordered = tuple(names)
    return Space(ordered, {name: BITS * k for k, name in enumerate(ordered)}, max_terms)


def constant(value: int) -> Polynomial:
    """Give the polynomial that is a number."""
    return {0: value} if value else {}


def add(left: Polynomial, right: Polynomial, factor: int = 1) -> Polynomial:
    """Give left + factor * right."""
    result = dict(left)
    for monomial, coefficient in right.items():
        total = result.get(monomial, 0) + factor * coefficient
        if total:
            result[monomial] = total
        else:
            del result[monomial]
    return result


def multiply(left: Polynomial, right: Polynomial, space: Space) -> Polynomial:
    """Give left * right.

    Raises
    ------
    TooLargeError
        Before the work, where the product has too many terms to be worth it.
    """
    small, large = (left, right) if len(left) < len(right) else (right, left)
    if len(small) * len(large) > 20 * space.max_terms:
        raise TooLargeError
    result: Polynomial = {}
    terms = list(large.items())
    for one, factor in small.items():
        for two, coefficient in terms:
            key = one + two
            result[key] = result.get(key, 0) + factor * coefficient
    result = {monomial: coefficient for monomial, coefficient in result.items() if coefficient}
    if len(result) > space.max_terms or uses(result, space.guard):
        raise TooLargeError
    return result


def power(base: Polynomial, exponent: int, space: Space) -> Polynomial:
    """Give base ** exponent, exponent 0 or above."""
    result = constant(1)
    for _ in range(exponent):
        result = multiply(result, base, space)
    return result


def scale(polynomial: Polynomial, factor: int) -> Polynomial:
    """Give factor * polynomial."""
    return {monomial: factor * coefficient for monomial, coefficient in polynomial.items()} if factor else {}


def by_power(polynomial: Polynomial, name: str, space: Space) -> dict[int, Polynomial]:
    """Give the coefficients of a polynomial in one name: power -> polynomial in the others."""
    shift = space.shifts[name]
    field = _FIELD << shift
    found: dict[int, Polynomial] = {}
    for monomial, coefficient in polynomial.items():
        found.setdefault((monomial & field) >> shift, {})[monomial & ~field] = coefficient
    return found


def degree(polynomial: Polynomial, name: str, space: Space) -> int:
    """Give the highest power of a name."""
    shift = space.shifts[name]
    return max((monomial >> shift & _FIELD for monomial in polynomial), default=0)


def uses(polynomial: Polynomial, mask: int) -> int:
    """Give the bits of those powers under a mask that are not zero everywhere; 0 where the polynomial is free of it."""
    return reduce(lambda bits, monomial: bits | monomial, polynomial, 0) & mask


def common_monomial(polynomial: Polynomial, space: Space) -> int:
    """Give the largest monomial that divides every term."""
    monomials = iter(polynomial)
    common = next(monomials, 0)
    for monomial in monomials:
        if not common:
            break
        common = sum(
            min(common >> shift & _FIELD, monomial >> shift & _FIELD) << shift
            for shift in space.shifts.values()
            if common >> shift & _FIELD
        )
    return common


def primitive(polynomial: Polynomial, space: Space, mask: int) -> Polynomial:
    """Give the polynomial without its whole content and its common monomial in the names of a mask."""
    if not polynomial:
        return polynomial
    content = reduce(gcd, polynomial.values())
    common = common_monomial(polynomial, space) & mask
    if content == 1 and not common:
        return polynomial
    return {monomial - common: coefficient // content for monomial, coefficient in polynomial.items()}


def divide(polynomial: Polynomial, divisor: Polynomial, space: Space) -> Polynomial | None:
    """Give polynomial / divisor where that leaves nothing over; None else."""
    lead = max(divisor)
    leading = divisor[lead]
    rest = [(monomial, coefficient) for monomial, coefficient in divisor.items() if monomial != lead]
    work = dict(polynomial)
    queue = [-monomial for monomial in work]
    heapify(queue)
    guard = space.guard
    result: Polynomial = {}
    while queue:
        monomial = -heappop(queue)
        coefficient = work.pop(monomial, 0)
        if not coefficient:
            continue
        quotient, over = divmod(coefficient, leading)
        if over or ((monomial | guard) - lead) & guard != guard or len(result) > space.max_terms:
            return None
        key = monomial - lead
        result[key] = quotient
        for other, factor in rest:
            target = key + other
            if target not in work:
                heappush(queue, -target)
            work[target] = work.get(target, 0) - quotient * factor
    return result
