"""Elimination of unknowns from a set of polynomials, one linear unknown after the other.

An equation gives an unknown in which it is linear. The best ones are linear in a signal with a coefficient that no
unknown enters ("clean"): these raise no degree and add no roots. Among them the one whose substitution fills the least
comes first (Markowitz 1957). Where none is left, a coefficient may hold unknowns; roots at which it vanishes are no
solutions, and it is divided out where it divides. Where no equation is linear in anything, two equations are reduced
by one another (Euclid). What remains is a polynomial in one unknown, or several that have to be solved numerically.
Source: thesis 4.4 step 4 (this is the work of REDUCE).
"""

from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from time import thread_time

from sympy.polys.rings import PolyElement

from faultbond.algebra.solving.polynomial import (
    Space,
    TooLargeError,
    by_power,
    degree,
    divide,
    limited_power,
    limited_product,
    primitive,
)
from faultbond.errors import StructureError


class SingularError(StructureError):
    """The equations do not fix their unknowns, or contradict each other."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pivot:
    """unknown = numerator / denominator, in what was not yet eliminated. clean: no unknown enters the denominator."""

    unknown: str
    numerator: PolyElement
    denominator: PolyElement
    clean: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class ReducedSystem:
    """What elimination leaves.

    pivots: in order of elimination, so each is computed from those after it. rest: equations in the `unknown` that are
    left, as many as these.
    """

    pivots: tuple[Pivot, ...]
    rest: tuple[PolyElement, ...]
    unknown: tuple[str, ...]


@dataclass(slots=True)
class _Row:
    """An equation and what a search for pivots asks of it."""

    polynomial: PolyElement
    unknown: frozenset[str]
    linear: dict[
        str, int
    ]  # unknown of power 1 -> number of different products of unknowns in its coefficient; 0: clean


@dataclass(slots=True)
class _Work:
    """The state of an elimination."""

    space: Space
    signals: frozenset[str]
    deadline: float
    zeros: tuple[int, ...]
    rows: list[_Row] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)
    pivots: list[Pivot] = field(default_factory=list)
    divisors: list[PolyElement] = field(default_factory=list)


def reduce_system(
    polynomials: Sequence[PolyElement],
    signals: Sequence[str],
    parameters: Sequence[str],
    space: Space,
    deadline: float = float("inf"),
    zeros: Collection[str] = (),
) -> ReducedSystem:
    """Eliminate as many unknowns as can be, signals before parameters.

    Parameters
    ----------
    polynomials : as many as signals and parameters
    signals, parameters : what is unknown
    space : of the polynomials; its limit on terms counts
    deadline : on the clock of `time.thread_time`
    zeros : known names that may be 0, so that what holds in spite of it is not divided by them if it can be helped

    Raises
    ------
    SingularError
        Where an equation vanishes or is contradicted.
    TooLargeError
        Where a polynomial outgrows the limit of the space, or time is up.
    """
    work = _Work(
        space=space, signals=frozenset(signals), deadline=deadline, zeros=tuple(space.place[name] for name in zeros)
    )
    work.unknown = [*signals, *parameters]
    work.rows = [_row(work, polynomial) for polynomial in polynomials]
    while len(work.unknown) > 1 or (work.rows and work.rows[0].linear):
        if thread_time() > deadline:
            raise TooLargeError
        choice = _choose(work)
        if choice is not None:
            _substitute(work, *choice)
        elif not _reduce(work):
            break
    return ReducedSystem(
        pivots=tuple(work.pivots), rest=tuple(row.polynomial for row in work.rows), unknown=tuple(work.unknown)
    )


def _row(work: _Work, polynomial: PolyElement) -> _Row:
    """Free a polynomial of known factors, and find what it is linear in."""
    places = {name: work.space.place[name] for name in work.unknown}
    polynomial = primitive(polynomial, work.space, work.space.place.keys() - places.keys())
    columns = tuple(zip(*polynomial, strict=True))
    parts = set(zip(*(columns[k] for k in places.values() if columns), strict=True))  # products of unknowns
    found = {name: powers for name, *powers in zip(places, *parts, strict=True) if any(powers)}
    if not found:
        raise SingularError("the equations of a block contradict each other, or one follows from the others")
    linear = {}
    for name, powers in found.items():
        if max(powers) == 1:
            holding = [part for part, power in zip(parts, powers, strict=True) if power]
            linear[name] = 0 if len(holding) == sum(holding[0]) == 1 else len(holding)
    return _Row(polynomial, frozenset(found), linear)


def _choose(work: _Work) -> tuple[int, str] | None:
    """Give the row and the unknown of the best pivot; None where no row is linear in anything."""
    count = Counter(name for row in work.rows for name in row.unknown)
    options = []
    for position, row in enumerate(work.rows):
        for name, dirt in row.linear.items():
            k = work.space.place[name]
            vanishes = bool(work.zeros) and all(  # whether its coefficient is 0 where the names that may be 0 are
                any(powers[zero] for zero in work.zeros) for powers in row.polynomial if powers[k]
            )
            tier = 4 * vanishes + 2 * (name not in work.signals) + bool(dirt)
            others = len(row.unknown - work.signals - {name})
            fill = (len(row.unknown) - 1) * (count[name] - 1)
            options.append(((tier, dirt, others, fill, len(row.polynomial), position), name))
    if not options:
        return None
    cost, name = min(options)
    return cost[-1], name


def _substitute(work: _Work, position: int, name: str) -> None:
    """Take a row as the equation of an unknown and put it into all others."""
    row = work.rows.pop(position)
    parts = by_power(row.polynomial, name, work.space)
    above, below = -parts.get(0, work.space.ring.zero), parts[1]
    work.pivots.append(Pivot(unknown=name, numerator=above, denominator=below, clean=not row.linear[name]))
    work.unknown.remove(name)
    _divide_out_later(work, below)
    for k, other in enumerate(work.rows):
        if name in other.unknown:
            work.rows[k] = _row(work, _stripped(work, _put(work, other.polynomial, name, above, below)))


def _put(work: _Work, polynomial: PolyElement, name: str, above: PolyElement, below: PolyElement) -> PolyElement:
    """Give the polynomial with above / below for a name, times a power of below."""
    space = work.space
    if thread_time() > work.deadline:
        raise TooLargeError
    parts = by_power(polynomial, name, space)
    top = max(parts)
    result = parts[top]
    for exponent in range(top - 1, -1, -1):  # Horner's rule
        result = limited_product(result, above, space)
        if exponent in parts:
            result += limited_product(parts[exponent], limited_power(below, top - exponent, space), space)
    return result


def _divide_out_later(work: _Work, divisor: PolyElement) -> None:
    """Note a polynomial that is not zero at a solution; of a product only the unknowns count, the rest goes anyway."""
    if len(divisor) == 1:
        (powers,) = divisor
        unknown = {work.space.place[name] for name in work.unknown}
        divisor = divisor.new({tuple(power if k in unknown else 0 for k, power in enumerate(powers)): 1})
    if divisor != 1:
        work.divisors.append(divisor)


def _stripped(work: _Work, polynomial: PolyElement) -> PolyElement:
    """Divide out the denominators of pivots: where one is zero its unknown has no value, so no solution is lost."""
    for divisor in work.divisors:
        while len(polynomial) >= len(divisor) and (smaller := divide(polynomial, divisor, work.space)):
            polynomial = smaller
    return polynomial


def _reduce(work: _Work) -> bool:
    """Lower the power of an unknown in one of two rows by the other; false where no two rows share an unknown."""
    options = []
    for name in work.unknown:
        sharing = [
            (degree(row.polynomial, name, work.space), len(row.polynomial), k)
            for k, row in enumerate(work.rows)
            if name in row.unknown
        ]
        if len(sharing) > 1:
            low, high = sorted(sharing)[:2]
            options.append((low[0] + high[0], low[1] + high[1], name, low[2], high[2]))
    if not options:
        return False
    _, _, name, low_row, high_row = min(options)
    space = work.space
    low_parts = by_power(work.rows[low_row].polynomial, name, space)
    high_parts = by_power(work.rows[high_row].polynomial, name, space)
    top_low, top_high = max(low_parts), max(high_parts)
    lead, lead_high = low_parts[top_low], high_parts[top_high]
    lifted = work.rows[low_row].polynomial * space.ring.gens[space.place[name]] ** (top_high - top_low)
    left = limited_product(work.rows[high_row].polynomial, lead, space)
    _divide_out_later(work, lead)
    work.rows[high_row] = _row(work, _stripped(work, left - limited_product(lifted, lead_high, space)))
    return True
