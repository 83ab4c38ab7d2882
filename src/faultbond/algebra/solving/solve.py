"""Solving a route for its targets: the work of REDUCE in the thesis.

Block by block along the route. A law with branches is solved on each side of its kinks. A block of one linear equation
is solved as it stands; others by elimination, a polynomial of degree 1 or 2 in closed form, one of higher degree if it
factors. Every root is put back into the original equations on backward-Euler records; closed forms are given only if
on each record one of them gives back what the plant was simulated with.
Source: thesis 4.3, 4.4 step 4 and 3.7.2; appendix A.3 (the closed form of R and L).
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import monotonic

from faultbond.algebra.route import Route
from faultbond.algebra.solving.backward_euler import NumericPlant
from faultbond.algebra.solving.branches import Condition
from faultbond.algebra.solving.closed import FormCandidate, FormSearch, find_candidates
from faultbond.algebra.solving.elimination import SingularError
from faultbond.algebra.solving.linearise import Fixed
from faultbond.algebra.solving.polynomial import Ratio, TooLargeError, quotient_expression
from faultbond.algebra.solving.problem import TOLERANCE, Problem, ProofData, prepare, trials_of
from faultbond.algebra.solving.roots import Count, find_roots
from faultbond.algebra.solving.solution import (
    VERSION,
    Line,
    Root,
    Singular,
    Solution,
    SolutionKind,
    conditions_hold,
    evaluate_root,
    read_cached,
    write_cached,
)
from faultbond.algebra.solving.symbols import lowest_terms
from faultbond.algebra.solving.systems import NoClosedFormError
from faultbond.algebra.solving.tidy import fold
from faultbond.equations.component_network import ComponentNetwork
from faultbond.equations.inversion import substitute
from faultbond.equations.numeric import Real, is_nan, numeric_value
from faultbond.model.expression import Binary, Call, Expression, Number, names, walk
from faultbond.model.parser import to_text

_TINY = 1e-300
_ROUNDING = 1e-12  # of a target that is 0, against what it is a sum of
BEYOND = "no closed form within the limit"
MAX_CONDITION = 12  # parts of an expression up to which a condition shows it in place of a name


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvingLimits:
    """When solving gives up: seconds (a third more for counting roots), and terms of a polynomial."""

    seconds: float = 3.0
    terms: int = 5_000


def solve(
    network: ComponentNetwork, route: Route, plant: NumericPlant, limits: SolvingLimits | None = None
) -> Solution:
    """Solve a route for its targets.

    Parameters
    ----------
    network, route : what is computed from what
    plant : the numbers of the nominal plant; constants among them enter the closed form as numbers
    limits : default 3 s

    Raises
    ------
    StructureError
        Where a signal in a frame and a parameter have one name.
    """
    limits = limits or SolvingLimits()
    problem = prepare(network, route, plant)
    deadline = monotonic() + limits.seconds
    records, fixed = trials_of(network, problem, plant, deadline)
    if not records:
        return _unchecked(problem, fixed)
    roots, remarks = _closed_forms(problem, records, deadline, limits.terms)
    count = _count(problem, records[0], max(deadline - monotonic(), limits.seconds / 3.0))
    return Solution(
        targets=problem.targets,
        kind=_kind(roots, count),
        degree=count.degree if count else None,
        real_roots=(len(count.roots) or None) if count and count.complete else None,  # there is one: the nominal value
        roots=roots,
        singular=_singular(roots, problem),
        remarks=(*remarks, *_not_closed(problem, records[0], roots, count)),
    )


def solve_cached(
    network: ComponentNetwork, route: Route, plant: NumericPlant, folder: Path, limits: SolvingLimits | None = None
) -> Solution:
    """Solve a route, or read what was found for the same equations and numbers before from a folder."""
    key = cache_key(network, route, plant, limits or SolvingLimits())
    known = read_cached(folder, key)
    if known is not None:
        return known
    solution = solve(network, route, plant, limits)
    if BEYOND not in solution.remarks:  # a faster or idler machine may get further
        write_cached(folder, key, solution)
    return solution


def cache_key(network: ComponentNetwork, route: Route, plant: NumericPlant, limits: SolvingLimits) -> str:
    """Give a name for a solution that changes with all that it depends on."""
    equations = [(item.name, to_text(item.residual), item.signals) for item in network.equations]
    question = route.question
    asked = (question.targets, question.unknown, sorted(question.known), sorted(question.hidden))
    groups = (plant.values, plant.changes, plant.start)
    numbers = [sorted((name, str(value)) for name, value in group.items()) for group in groups]
    ranges = sorted(
        (name, str(lower), str(upper), name in plant.one_sided) for name, (lower, upper) in plant.inputs.items()
    )
    names_ = (network.parameters, network.inputs)  # any other number is a constant, which enters a closed form as such
    parts = (
        VERSION,
        names_,
        equations,
        asked,
        route.steps,
        route.blocks,
        numbers,
        ranges,
        str(plant.sample_time),
        limits,
    )
    return sha256(repr(parts).encode()).hexdigest()


def _closed_forms(
    problem: Problem, records: Sequence[ProofData], deadline: float, max_terms: int
) -> tuple[tuple[Root, ...], tuple[str, ...]]:
    """Give the closed forms that hold, and remarks."""
    search = FormSearch(
        problem=problem,
        prefer=_positive_at(records[0].true),
        deadline=deadline,
        max_terms=max_terms,
        zeros=frozenset(name for name, value in records[0].known.items() if not value and name not in problem.signals),
    )
    try:
        candidates = find_candidates(search)
    except NoClosedFormError as error:
        return (), (f"no closed form: {error}",)
    except SingularError as error:
        return (), (f"no closed form: {error}",)
    except TooLargeError:
        return (), (BEYOND,)
    remarks = []
    if search.left_out:
        remarks.append(f"{search.left_out} or more further combinations of signs and cases were left out")
    drafts = [_draft(candidate) for candidate in candidates]
    valid = [k for k, root in enumerate(drafts) if any(_is_met(root, problem, record) for record in records)]
    roots = tuple(dict.fromkeys(_finished(candidates[k], problem) for k in valid))
    reached = [record for record in records if any(_is_reached(root, record) for root in drafts)]
    if reached[:1] != [records[0]] or not all(
        any(_is_true(root, problem, record) for root in roots) for record in reached
    ):
        return (), (*remarks, "no closed form: none gives back the values that the test records were made with")
    dropped = [_spelled_out(candidate, problem) for k, candidate in enumerate(candidates) if k not in valid]
    remarks += _not_met(dropped, roots)
    return tuple(sorted(roots, key=lambda root: not _is_true(root, problem, records[0]))), tuple(remarks)


def _unchecked(problem: Problem, fixed: Fixed | None) -> Solution:
    """Say why no record could be made to check a closed form on."""
    targets = ", ".join(problem.targets)
    if fixed is None:
        kind, words = SolutionKind.NUMERIC, BEYOND
    elif fixed is Fixed.NOT:
        kind, words = SolutionKind.UNDETERMINED, f"the equations of this route do not fix {targets} on any test record"
    else:
        kind, words = (
            SolutionKind.NUMERIC,
            f"the equations of this route amplify rounding so much that {targets} would be lost",
        )
    return Solution(targets=problem.targets, kind=kind, degree=None, real_roots=None, remarks=(words,))


def _positive_at(values: Mapping[str, Real]) -> Callable[[Expression], bool]:
    """Whether an expression is positive at the nominal plant; what has no value there counts as positive."""

    def positive(expression: Expression) -> bool:
        if not set(names(expression)) <= values.keys():
            return True
        return not numeric_value(expression, values) < 0

    return positive


def _draft(candidate: FormCandidate) -> Root:
    """Give all lines of a candidate as they are."""
    lines = (
        Line(name=name, value=quotient_expression(value) if isinstance(value, Ratio) else value)
        for name, value in candidate.lines
    )
    return Root(lines=tuple(lines), conditions=candidate.conditions)


def _is_met(root: Root, problem: Problem, record: ProofData) -> bool:
    """Whether a root satisfies the original equations on a record, and its own conditions."""
    values = {**record.known, **evaluate_root(root, record.known)}
    found = all(not is_nan(values[name]) for name in problem.unknown)
    return found and conditions_hold(root, values) and problem.is_met(values)


def _is_reached(root: Root, record: ProofData) -> bool:
    """Whether a record lies where a root is said to hold; where cases are left out some do not."""
    return conditions_hold(root, {**evaluate_root(root, record.known), **record.true})


def _is_true(root: Root, problem: Problem, record: ProofData) -> bool:
    """Whether a root gives the values that a record was made with."""
    return _agree(evaluate_root(root, record.known), record.true, problem.targets, record)


def _agree(found: Mapping[str, Real], other: Mapping[str, Real], names_: Sequence[str], record: ProofData) -> bool:
    return all(
        abs(float(found[name]) - float(other[name]))
        <= TOLERANCE * abs(float(other[name])) + _ROUNDING * record.scales.get(name, 0.0) + _TINY
        for name in names_
    )


def _finished(candidate: FormCandidate, problem: Problem) -> Root:
    """Give the lines that the targets need, in lowest terms, grouped by parameters; conditions in plain names."""
    outer = [name for name in _all_names(candidate) if name not in problem.signals]
    lines: list[Line] = []
    open_ = set(problem.targets) | {name for item in candidate.conditions for name in names(item.expression)}
    for name, value in reversed(candidate.lines):
        if name in open_:
            lines.append(Line(name=name, value=_lowest(value, outer)))
            open_.update(names(lines[-1].value))
    return Root(lines=tuple(reversed(lines)), conditions=_spelled_out(candidate, problem))


def _spelled_out(candidate: FormCandidate, problem: Problem) -> tuple[Condition, ...]:
    """Give the conditions of a candidate in plain names."""
    values = dict(candidate.lines)
    spelled = (
        Condition(expression=_spelled(item.expression, values, problem), strict=item.strict)
        for item in candidate.conditions
    )
    return tuple(dict.fromkeys(spelled))


def _all_names(candidate: FormCandidate) -> tuple[str, ...]:
    return tuple(
        dict.fromkeys(
            name
            for _, value in candidate.lines
            for name in (value.space.place if isinstance(value, Ratio) else names(value))
        )
    )


def _lowest(value: Expression | Ratio, outer: Sequence[str]) -> Expression:
    if not isinstance(value, Ratio):
        return value
    above, below = lowest_terms(value.numerator, value.denominator, value.space)
    return quotient_expression(Ratio(numerator=above, denominator=below, space=value.space), outer)


def _spelled(condition: Expression, values: Mapping[str, Expression | Ratio], problem: Problem) -> Expression:
    """Give a condition with names of ours replaced where their value is short."""
    for name in names(condition):
        value = values.get(name)
        if name in problem.signals or value is None:
            continue
        value = quotient_expression(value) if isinstance(value, Ratio) else value
        if sum(1 for _ in walk(value)) <= MAX_CONDITION:
            condition = fold(substitute(condition, {name: value}))
    return condition


def _not_met(dropped: Sequence[tuple[Condition, ...]], roots: Sequence[Root]) -> list[str]:
    """Say which cases no test record reached."""
    kept = {root.conditions for root in roots}
    missed = dict.fromkeys(_in_words(conditions) for conditions in dropped if conditions not in kept)
    return [f"no solution on any test record where {words}" for words in missed if words]


def _in_words(conditions: Sequence[Condition]) -> str:
    return " and ".join(condition.text for condition in conditions)


def _count(problem: Problem, record: ProofData, seconds: float) -> Count | None:
    """Count the roots on a record of the nominal plant; None where that takes too long."""
    try:
        return find_roots(problem, record.known, record.true, seconds)
    except TooLargeError:
        return None


def _not_closed(problem: Problem, record: ProofData, roots: Sequence[Root], count: Count | None) -> tuple[str, ...]:
    """Say how many of the real roots at the nominal plant no closed form gives."""
    if count is None or not roots:
        return ()
    given = [evaluate_root(root, record.known) for root in roots]
    missing = sum(not any(_agree(found, root, problem.targets, record) for found in given) for root in count.roots)
    if not missing:
        return ()
    return (f"{missing} of {len(count.roots)} real roots at the nominal plant have no closed form here",)


def _kind(roots: Sequence[Root], count: Count | None) -> SolutionKind:
    if count is None or count.degree is None:
        return SolutionKind.NUMERIC
    if count.degree > 2:
        return SolutionKind.POLYNOMIAL
    several = len({root.conditions for root in roots}) < len(roots)  # on one side of every kink
    return SolutionKind.QUADRATIC if count.degree == 2 or several else SolutionKind.LINEAR


def _singular(roots: Sequence[Root], problem: Problem) -> tuple[Singular, ...]:
    """Name where a closed form has no value: a denominator that samples make zero, a root of a negative number."""
    found: dict[Expression, Singular] = {}
    for root in roots:
        own = {line.name: line.value for line in root.lines if _is_ours(line.name, problem)}
        varying = set(own) | set(problem.signals)
        name = ""
        for line in reversed(root.lines):
            name = name if line.name in own else line.name
            for part in walk(line.value):
                for inside, words in _no_value(part, varying):
                    spelled = fold(substitute(inside, {key: own[key] for key in names(inside) if key in own}))
                    found.setdefault(spelled, Singular(name=name, expression=spelled, words=words))
    return tuple(reversed(found.values()))


def _is_ours(name: str, problem: Problem) -> bool:
    """Whether a name was made here, for a part of a formula."""
    return name not in problem.signals and name not in problem.targets and name not in problem.unknown


def _no_value(part: Expression, varying: set[str]) -> Iterator[tuple[Expression, str]]:
    match part:
        case Binary("/", _, below) if varying.intersection(names(below)):
            inner = below.right if isinstance(below, Binary) and isinstance(below.left, Number) else below
            yield inner, "no value where this is 0: the samples do not excite"
        case Call("sqrt", (inside,)) if varying.intersection(names(inside)):
            yield inside, "no real value where this is negative"
