"""All real roots of a problem on given samples: elimination in numbers, then polynomials in one unknown.

Where that is no way, Newton's method from several starts, which finds roots near the start only.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import exp, inf, isfinite
from random import Random
from time import thread_time

from faultbond.algebra.solving.backward_euler import misfit, newton
from faultbond.algebra.solving.branches import (
    Branch,
    Given,
    NoClosedFormError,
    System,
    cases,
    name_functions,
    order_systems,
    positive_at,
)
from faultbond.algebra.solving.elimination import ReducedSystem, SingularError, reduce_system
from faultbond.algebra.solving.polynomial import (
    NotRationalError,
    Space,
    TooLargeError,
    by_power,
    image,
    quotient,
    space_of,
    specialise,
)
from faultbond.algebra.solving.problem import TOLERANCE, Block, Problem
from faultbond.algebra.solving.symbols import real_roots
from faultbond.equations.numeric import Real, numeric_value

Reals = dict[str, Real]

N_STARTS = 20
START_SPREAD = 0.7  # of the logarithm of a start
MAX_PATHS = 32
MAX_DEGREE = 30
SAME = 1e-6  # relative difference below which two roots are one
_BITS = 400  # of a number; longer ones are rounded


@dataclass(frozen=True, slots=True, kw_only=True)
class Count:
    """Real roots that satisfy all equations, and the number of algebraic ones.

    degree: None where Newton's method was used. complete: whether every case was looked at.
    """

    roots: tuple[Reals, ...]
    degree: int | None
    complete: bool = True


@dataclass(slots=True)
class _Walk:
    problem: Problem
    guess: Mapping[str, Real]
    deadline: float
    number: int = 0
    by_newton: bool = False
    cut: bool = False

    def fresh(self, word: str) -> str:
        """Make a name that no signal and no parameter has."""
        self.number += 1
        return f"{word}:{self.number}"


def find_roots(problem: Problem, known: Mapping[str, Real], guess: Mapping[str, Real], seconds: float = inf) -> Count:
    """Give all real values of the unknowns that satisfy the equations on given samples.

    Parameters
    ----------
    problem : the equations
    known : samples, parameters, `dt`; values of unknowns among them are not used
    guess : where Newton's method starts from, for all unknowns, where it is needed
    seconds : after which no further root is looked for
    """
    walk = _Walk(problem=problem, guess=guess, deadline=thread_time() + seconds)
    paths: list[Reals] = [{name: _fraction(value) for name, value in known.items() if name not in problem.unknown}]
    total = 1
    for block in problem.blocks:
        further = [_through(walk, block, values) for values in paths]
        total *= max((degree for _, degree in further), default=0)
        paths = [values for found, _ in further for values in found]
        walk.cut |= len(paths) > MAX_PATHS
        paths = paths[:MAX_PATHS]
    roots: list[Reals] = []
    for values in paths:
        root = {name: values[name] for name in problem.unknown}
        if problem.is_met(_floats(values)) and not any(_same(root, other) for other in roots):
            roots.append(root)
    degree = None if walk.by_newton or walk.cut else total
    return Count(roots=tuple(roots), degree=degree, complete=not walk.cut)


def _fraction(value: Real) -> Fraction:
    """Give a number as a fraction, rounded where it is long."""
    value = Fraction(value)
    excess = value.denominator.bit_length() - _BITS
    if excess <= 0 or value.numerator.bit_length() <= _BITS:
        return value
    digits = 1 << max(_BITS - value.numerator.bit_length() + value.denominator.bit_length(), 0)
    return Fraction(round(value * digits), digits)


def _floats(values: Mapping[str, Real]) -> dict[str, Real]:
    return {name: float(value) for name, value in values.items()}


def _same(one: Reals, two: Reals) -> bool:
    return all(abs(float(value - two[name])) <= SAME * abs(float(value)) for name, value in one.items())


def _through(walk: _Walk, block: Block, values: Reals) -> tuple[list[Reals], int]:
    """Give all continuations of one path through a block, and the number of algebraic roots on their own branch."""
    unknown = frozenset(block.unknown)
    prefer = positive_at({**walk.guess, **values})
    found: list[Reals] = []
    highest = 0
    try:
        for number, case in enumerate(cases(block.residuals, unknown, {}, str, prefer)):
            if number == MAX_PATHS:
                walk.cut = True
                break
            if thread_time() > walk.deadline:
                raise TooLargeError
            roots, degree = _case_roots(walk, block, name_functions(case, unknown, walk.fresh), values)
            good = [root for root in roots if misfit(block.residuals, _floats(root)) < TOLERANCE]
            found += good
            if good:
                highest = max(highest, degree - len(roots) + len(good))
    except (NoClosedFormError, NotRationalError, TooLargeError):
        walk.by_newton = True
        return _newton_roots(walk, block, values), 1
    return found, highest


def _case_roots(walk: _Walk, block: Block, case: Branch, values: Reals) -> tuple[list[Reals], int]:
    """Give the roots in one case, and the number of algebraic ones; none where it is singular."""
    paths, total = [values], 1
    try:
        for part in order_systems(case, block.unknown, walk.fresh).parts:
            if isinstance(part, Given):
                done = [{**path, part.name: numeric_value(part.value, path)} for path in paths]
                paths = [{**path, part.name: _fraction(path[part.name])} for path in done if isfinite(path[part.name])]
            else:
                further = [_system_roots(walk, part, block.parameters, path) for path in paths]
                total *= max((degree for _, degree in further), default=0)
                paths = [path for found, _ in further for path in found]
    except SingularError:
        return [], 0
    return paths, total


def _system_roots(walk: _Walk, system: System, parameters: frozenset[str], values: Reals) -> tuple[list[Reals], int]:
    every = space_of(dict.fromkeys((*system.unknown, *values)))
    into = space_of(system.unknown)
    fractions = {name: Fraction(value) for name, value in values.items()}
    reduced = reduce_system(
        [specialise(quotient(residual, every)[0], every, fractions, into) for residual in system.residuals],
        [name for name in system.unknown if name not in parameters],
        [name for name in system.unknown if name in parameters],
        into,
        walk.deadline,
    )
    lasts: list[dict[str, Fraction]] = [{}]
    degree = 1
    if len(reduced.rest) > 1:
        raise NoClosedFormError("more than one unknown is left")
    if reduced.rest:
        (name,), (polynomial,) = reduced.unknown, reduced.rest
        parts = by_power(polynomial, name, into)
        degree = max(parts)
        if degree > MAX_DEGREE:
            raise TooLargeError
        coefficients = [int(parts[power].LC) if power in parts else 0 for power in range(degree, -1, -1)]
        lasts = [{name: root} for root in real_roots(coefficients)]
        degree -= max(min(parts) - 1, 0)  # repeated roots 0, of a division by the unknown as a rule
    return [{**values, **found} for last in lasts if (found := _back(reduced, into, last)) is not None], degree


def _back(reduced: ReducedSystem, space: Space, last: Mapping[str, Fraction]) -> dict[str, Fraction] | None:
    """Compute the eliminated unknowns; None where a denominator is zero."""
    found = dict(last)
    for pivot in reversed(reduced.pivots):
        above, below = (sum(image(item, space, found).values()) for item in (pivot.numerator, pivot.denominator))
        if not below:
            return None
        found[pivot.unknown] = _fraction(Fraction(above) / below)
    return found


def _newton_roots(walk: _Walk, block: Block, values: Reals) -> list[Reals]:
    """Start near the guess, and at multiples of it; every start that ends somewhere new gives a root."""
    rng = Random(0)  # noqa: S311 - starting points, no secret
    known = _floats(values)
    roots: list[Reals] = []
    for attempt in range(N_STARTS):
        if thread_time() > walk.deadline:
            break
        start = {
            name: float(walk.guess[name]) * (exp(rng.gauss(0.0, START_SPREAD)) if attempt else 1.0)
            for name in block.unknown
        }
        found = newton(block.residuals, known, start)
        if found is not None and not any(_same(found, other) for other in roots):
            roots.append(found)
    return [{**values, **{name: Fraction(value) for name, value in root.items()}} for root in roots]
