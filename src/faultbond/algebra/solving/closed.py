"""Candidates for closed forms: each block solved in names, every sign of every root a candidate of its own."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from time import thread_time

from sympy.polys.rings import PolyElement

from faultbond.algebra.solving.branches import (
    Branch,
    Condition,
    Given,
    NoClosedFormError,
    System,
    cases,
    name_functions,
    order_systems,
)
from faultbond.algebra.solving.elimination import ReducedSystem, SingularError, reduce_system
from faultbond.algebra.solving.polynomial import (
    NotRationalError,
    Ratio,
    Space,
    TooLargeError,
    by_power,
    degree,
    divide,
    quotient,
    space_of,
)
from faultbond.algebra.solving.problem import Block, Problem
from faultbond.algebra.solving.symbols import factors_with
from faultbond.algebra.solving.tidy import ONE, ZERO, fold, negative
from faultbond.equations.component_network import SAMPLE_TIME
from faultbond.equations.inversion import collect
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, names

MAX_CANDIDATES = 16

Draft = tuple[str, Expression | Ratio]  # a line, its value not yet in lowest terms


@dataclass(frozen=True, slots=True, kw_only=True)
class FormCandidate:
    """Lines for all unknowns of the blocks done so far, where they hold, and the sides of kinks that were taken."""

    lines: tuple[Draft, ...] = ()
    conditions: tuple[Condition, ...] = ()
    sides: Mapping[Expression, int] = field(default_factory=dict)


@dataclass(slots=True)
class FormSearch:
    """What solving one problem in names goes by.

    prefer: whether an expression is positive at the nominal plant. deadline: on the clock of `time.thread_time`.
    zeros: parameters that are 0 there. left_out: number of candidates and cases beyond the limit, at least.
    """

    problem: Problem
    prefer: Callable[[Expression], bool]
    deadline: float
    max_terms: int
    zeros: frozenset[str] = frozenset()
    taken: set[str] = field(default_factory=set)
    left_out: int = 0

    def fresh(self, word: str) -> str:
        """Make a name that is not in use."""
        number = 1
        while f"{word}{number}" in self.taken:
            number += 1
        self.taken.add(f"{word}{number}")
        return f"{word}{number}"


def find_candidates(search: FormSearch) -> tuple[FormCandidate, ...]:
    """Give candidates for all blocks, those on the sides of the nominal plant first.

    Raises
    ------
    NoClosedFormError
        Where a block has none; the argument says why.
    TooLargeError
        Where an expression outgrows the limit, or time is up.
    SingularError
        Where a block does not fix its unknowns.
    """
    search.taken |= {name for residual in search.problem.residuals for name in names(residual)}
    found = [FormCandidate()]
    for block in search.problem.blocks:
        found = [further for candidate in found for further in _solve_block(search, block, candidate)]
        search.left_out += max(0, len(found) - MAX_CANDIDATES)
        found = found[:MAX_CANDIDATES]
    return tuple(found)


def _solve_block(search: FormSearch, block: Block, candidate: FormCandidate) -> list[FormCandidate]:
    """Give the candidates of every case that has any; a case may be singular, or go without closed form."""
    unknown = frozenset(block.unknown)
    found = []
    problem: NoClosedFormError | SingularError | None = None
    every = cases(block.residuals, unknown, candidate.sides, search.problem.plain, search.prefer)
    for number, case in enumerate(every):
        if number == MAX_CANDIDATES:
            search.left_out += 1
            break
        if thread_time() > search.deadline:
            raise TooLargeError
        try:
            found += _solve_case(search, block, candidate, name_functions(case, unknown, search.fresh))
        except (NoClosedFormError, SingularError) as error:
            problem = problem or error
    if not found and problem is not None:
        raise problem
    return found


def _solve_case(search: FormSearch, block: Block, candidate: FormCandidate, case: Branch) -> list[FormCandidate]:
    ordered = order_systems(case, block.unknown, search.fresh)
    conditions = dict.fromkeys((*candidate.conditions, *ordered.conditions))
    found = [FormCandidate(lines=candidate.lines, conditions=tuple(conditions), sides=case.sides)]
    for part in ordered.parts:
        value: Expression | None
        if isinstance(part, Given):
            name, value = part.name, part.value
        else:
            name, value = part.unknown[0], None
            if len(part.unknown) == 1:
                value = linear_value(part.residuals[0], name)
            if value is None:
                found = [further for item in found for further in _solve_system(search, part, block.parameters, item)]
                continue
        found = [replace(item, lines=(*item.lines, (name, value))) for item in found]
    return found


def linear_value(residual: Expression, name: str) -> Expression | None:
    """Give a name in which a residual is linear, the law's own shape kept; None where it is not linear."""
    form = collect(residual, name)
    if form is None or not set(form) <= {(0, 0), (1, 0)} or (1, 0) not in form:
        return None
    constant, slope = form.get((0, 0), ZERO), form[1, 0]
    value, slope = (constant, slope.operand) if isinstance(slope, Negative) else (negative(constant), slope)
    if isinstance(slope, Binary) and slope.operator == "-" and isinstance(value, Negative):
        value, slope = value.operand, negative(slope)
    if slope == ONE or constant == ZERO:
        return fold(value)
    match slope:
        case Binary("/", above, below):  # a slope of 1/x multiplies
            value = Binary("*", value, below)
            return fold(value if above == ONE else Binary("/", value, above))
    return fold(Binary("/", value, slope))


def _solve_system(
    search: FormSearch, system: System, parameters: frozenset[str], candidate: FormCandidate
) -> list[FormCandidate]:
    signals = search.problem.signals
    # Parameters by name, then the sample time, then the rest by name and frame: the order of factors in a term.
    used = {name for residual in system.residuals for name in names(residual)} | set(system.unknown)
    order = sorted(used, key=lambda name: (name in signals, name == SAMPLE_TIME, signals.get(name, (name, 0))))
    space = space_of(order, search.max_terms)
    try:
        polynomials = [quotient(residual, space)[0] for residual in system.residuals]
    except NotRationalError:
        raise NoClosedFormError("an exponent is not known") from None
    reduced = reduce_system(
        polynomials,
        [name for name in system.unknown if name not in parameters],
        [name for name in system.unknown if name in parameters],
        space,
        search.deadline,
        search.zeros & used,
    )
    lines = tuple(
        (pivot.unknown, Ratio(numerator=pivot.numerator, denominator=pivot.denominator, space=space))
        for pivot in reversed(reduced.pivots)
    )
    found = _last_unknown(search, reduced, space, parameters, candidate)
    return [replace(further, lines=(*further.lines, *lines)) for further in found]


def _last_unknown(
    search: FormSearch, reduced: ReducedSystem, space: Space, parameters: frozenset[str], candidate: FormCandidate
) -> list[FormCandidate]:
    """Give the candidates for what elimination leaves: nothing, or a polynomial in one unknown."""
    if not reduced.rest:
        return [candidate]
    if len(reduced.rest) > 1:
        raise NoClosedFormError(f"{len(reduced.rest)} equations in {', '.join(reduced.unknown)} remain")
    (name,), (polynomial,) = reduced.unknown, reduced.rest
    found = []
    lowest = min(by_power(polynomial, name, space))
    if lowest:  # 0 is a root, of a division by the unknown as a rule
        polynomial = divide(polynomial, space.ring.gens[space.place[name]] ** lowest, space)
        found.append(replace(candidate, lines=(*candidate.lines, (name, ZERO))))
    pieces = (polynomial,) if degree(polynomial, name, space) <= 2 else factors_with(polynomial, name, space)
    for piece in pieces:
        if 1 <= degree(piece, name, space) <= 2:
            found += _roots(search, piece, name, space, name not in parameters, candidate)
    if not found:
        raise NoClosedFormError(f"a polynomial of degree {degree(polynomial, name, space)} in {name} remains")
    return found


def _roots(
    search: FormSearch, polynomial: PolyElement, name: str, space: Space, signal: bool, candidate: FormCandidate
) -> list[FormCandidate]:
    parts = by_power(polynomial, name, space)
    one, nothing = space.ring.one, space.ring.zero
    if 2 not in parts:
        value = Ratio(numerator=-parts.get(0, nothing), denominator=parts[1], space=space)
        return [replace(candidate, lines=(*candidate.lines, (name, value)))]
    if 1 not in parts:
        return _square_roots(search, parts, name, space, signal, candidate)
    sign = -1 if all(coefficient < 0 for coefficient in parts[2].values()) else 1
    a, b, c = (search.fresh(letter) for letter in "abc")
    lines: list[Draft] = [
        (letter, Ratio(numerator=sign * parts.get(power, nothing), denominator=one, space=space))
        for letter, power in ((a, 2), (b, 1), (c, 0))
    ]
    inner = Binary("-", Binary("**", Name(b), Number(2.0)), Binary("*", Binary("*", Number(4.0), Name(a)), Name(c)))
    root = search.fresh("root")
    lines.append((root, Call("sqrt", (inner,))))
    below = Binary("*", Number(2.0), Name(a))
    above = Binary("-", Name(root), Name(b)), Binary("-", Negative(Name(b)), Name(root))
    return [
        replace(candidate, lines=(*candidate.lines, *lines, (name, Binary("/", numerator, below))))
        for numerator in above
    ]


def _square_roots(
    search: FormSearch,
    parts: Mapping[int, PolyElement],
    name: str,
    space: Space,
    signal: bool,
    candidate: FormCandidate,
) -> list[FormCandidate]:
    """Give plus and minus the root of -c/a; a signal keeps its sign from frame to frame."""
    square = search.fresh("square")
    value = Ratio(numerator=-parts.get(0, space.ring.zero), denominator=parts[2], space=space)
    root = Call("sqrt", (Name(square),))
    key = Name(search.problem.plain(name))
    sides: tuple[int, ...] = (1, -1) if search.prefer(Name(name)) else (-1, 1)
    if signal and key in candidate.sides:
        sides = (candidate.sides[key],)
    found = []
    for side in sides:
        condition = Condition(expression=Name(name) if side > 0 else Negative(Name(name)))
        is_new = signal and condition not in candidate.conditions
        found.append(
            FormCandidate(
                lines=(*candidate.lines, (square, value), (name, root if side > 0 else Negative(root))),
                conditions=(*candidate.conditions, condition) if is_new else candidate.conditions,
                sides={**candidate.sides, key: side} if signal else candidate.sides,
            )
        )
    return found
