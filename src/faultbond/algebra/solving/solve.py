"""Solving a route for its targets: the work of REDUCE in the thesis.

Block by block along the route. A law with branches is solved on each side of its kinks. A block of one linear equation
is solved as it stands; others by elimination, a polynomial of degree 1 or 2 in closed form, one of higher degree if it
factors. Every root is put back into the original equations on backward-Euler records; closed forms are given only if
on each record one of them gives back what the plant was simulated with.
Source: thesis 4.3, 4.4 step 4 and 3.7.2; appendix A.3 (the closed form of R and L).
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import thread_time

from faultbond.algebra.route import Route
from faultbond.algebra.solving.backward_euler import NumericPlant
from faultbond.algebra.solving.branches import Condition, NoClosedFormError, positive_at
from faultbond.algebra.solving.closed import FormCandidate, FormSearch, find_candidates
from faultbond.algebra.solving.elimination import SingularError
from faultbond.algebra.solving.polynomial import Ratio, TooLargeError, quotient_expression
from faultbond.algebra.solving.problem import TOLERANCE, Fixed, Problem, ProofData, prepare, trials_of
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
from faultbond.algebra.solving.tidy import fold
from faultbond.equations.component_network import ComponentNetwork
from faultbond.equations.inversion import substitute
from faultbond.equations.numeric import Real, is_nan
from faultbond.model.expression import Binary, Call, Expression, Number, names, walk
from faultbond.model.parser import to_text

_TINY = 1e-300
_ROUNDING = 1e-12  # of a target that is 0, against what it is a sum of
BEYOND = "no closed form within the limit"
MAX_CONDITION = 12  # parts of an expression up to which a condition shows it in place of a name


@dataclass(frozen=True, slots=True, kw_only=True)
class SolvingLimits:
    """When solving gives up: seconds of a processor (a third more for counting roots), and terms of a polynomial.

    What others make the machine do so takes no closed form away.
    """

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
    deadline = thread_time() + limits.seconds
    records, fixed = trials_of(network, problem, plant, deadline)
    if not records:
        kind, remark = SolutionKind.NUMERIC, BEYOND
        targets = ", ".join(problem.targets)
        if fixed is Fixed.NOT:
            kind = SolutionKind.UNDETERMINED
            remark = f"the equations of this route do not fix {targets} on any test record"
        elif fixed is not None:
            remark = f"the equations of this route amplify rounding so much that {targets} would be lost"
        return Solution(targets=problem.targets, kind=kind, degree=None, real_roots=None, remarks=(remark,))
    roots, remarks = _closed_forms(problem, records, deadline, limits.terms)
    count: Count | None = None
    with suppress(TooLargeError):  # it takes too long
        seconds = max(deadline - thread_time(), limits.seconds / 3.0)
        count = find_roots(problem, records[0].known, records[0].true, seconds)
    if count is None or count.degree is None:
        kind = SolutionKind.NUMERIC
    elif count.degree > 2:
        kind = SolutionKind.POLYNOMIAL
    else:
        several = len({root.conditions for root in roots}) < len(roots)  # on one side of every kink
        kind = SolutionKind.QUADRATIC if count.degree == 2 or several else SolutionKind.LINEAR
    return Solution(
        targets=problem.targets,
        kind=kind,
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
        prefer=positive_at(records[0].true),
        deadline=deadline,
        max_terms=max_terms,
        zeros=frozenset(name for name, value in records[0].known.items() if not value and name not in problem.signals),
    )
    try:
        candidates = find_candidates(search)
    except (NoClosedFormError, SingularError) as error:
        return (), (f"no closed form: {error}",)
    except TooLargeError:
        return (), (BEYOND,)
    remarks = []
    if search.left_out:
        remarks.append(f"{search.left_out} or more further combinations of signs and cases were left out")
    drafts = [
        Root(
            lines=tuple(Line(name=name, value=_written(value)) for name, value in candidate.lines),
            conditions=candidate.conditions,
        )
        for candidate in candidates
    ]
    valid = [k for k, root in enumerate(drafts) if any(_is_met(root, problem, record) for record in records)]
    roots = tuple(dict.fromkeys(_finished(candidates[k], problem) for k in valid))
    # Where cases are left out, some records do not lie where any root is said to hold.
    reached = [
        record
        for record in records
        if any(conditions_hold(root, {**evaluate_root(root, record.known), **record.true}) for root in drafts)
    ]
    if reached[:1] != [records[0]] or not all(
        any(_is_true(root, problem, record) for root in roots) for record in reached
    ):
        return (), (*remarks, "no closed form: none gives back the values that the test records were made with")
    kept = {root.conditions for root in roots}
    dropped = [_spelled_out(candidate, problem) for k, candidate in enumerate(candidates) if k not in valid]
    missed = dict.fromkeys(" and ".join(item.text for item in words) for words in dropped if words not in kept)
    remarks += [f"no solution on any test record where {words}" for words in missed if words]
    return tuple(sorted(roots, key=lambda root: not _is_true(root, problem, records[0]))), tuple(remarks)


def _written(value: Expression | Ratio) -> Expression:
    return quotient_expression(value) if isinstance(value, Ratio) else value


def _is_met(root: Root, problem: Problem, record: ProofData) -> bool:
    """Whether a root satisfies the original equations on a record, and its own conditions."""
    values = {**record.known, **evaluate_root(root, record.known)}
    found = all(not is_nan(values[name]) for name in problem.unknown)
    return found and conditions_hold(root, values) and problem.is_met(values)


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
    used = (value.space.place if isinstance(value, Ratio) else names(value) for _, value in candidate.lines)
    outer = [name for name in dict.fromkeys(name for item in used for name in item) if name not in problem.signals]
    lines: list[Line] = []
    open_ = set(problem.targets) | {name for item in candidate.conditions for name in names(item.expression)}
    for name, value in reversed(candidate.lines):
        if name in open_:
            if isinstance(value, Ratio):
                above, below = lowest_terms(value.numerator, value.denominator, value.space)
                written = quotient_expression(Ratio(numerator=above, denominator=below, space=value.space), outer)
            else:
                written = value
            lines.append(Line(name=name, value=written))
            open_.update(names(written))
    return Root(lines=tuple(reversed(lines)), conditions=_spelled_out(candidate, problem))


def _spelled_out(candidate: FormCandidate, problem: Problem) -> tuple[Condition, ...]:
    """Give the conditions of a candidate in plain names: names of ours replaced where their value is short."""
    values = dict(candidate.lines)
    spelled = []
    for item in candidate.conditions:
        expression = item.expression
        for name in names(expression):
            if name in values and name not in problem.signals:
                value = _written(values[name])
                if sum(1 for _ in walk(value)) <= MAX_CONDITION:
                    expression = fold(substitute(expression, {name: value}))
        spelled.append(Condition(expression=expression, strict=item.strict))
    return tuple(dict.fromkeys(spelled))


def _not_closed(problem: Problem, record: ProofData, roots: Sequence[Root], count: Count | None) -> tuple[str, ...]:
    """Say how many of the real roots at the nominal plant no closed form gives."""
    if count is None or not roots:
        return ()
    given = [evaluate_root(root, record.known) for root in roots]
    missing = sum(not any(_agree(found, root, problem.targets, record) for found in given) for root in count.roots)
    if not missing:
        return ()
    return (f"{missing} of {len(count.roots)} real roots at the nominal plant have no closed form here",)


def _singular(roots: Sequence[Root], problem: Problem) -> tuple[Singular, ...]:
    """Name where a closed form has no value: a denominator that samples make zero, a root of a negative number."""
    found: dict[Expression, Singular] = {}
    theirs = {*problem.signals, *problem.targets, *problem.unknown}
    for root in roots:
        own: dict[str, Expression] = {}  # made here, parts of a formula, each with what it is made of
        for line in root.lines:
            if line.name not in theirs:
                own[line.name] = substitute(line.value, {key: own[key] for key in names(line.value) if key in own})
        varying = set(own) | set(problem.signals)
        name = ""
        for line in reversed(root.lines):
            name = name if line.name in own else line.name
            for part in walk(line.value):
                match part:
                    case Binary("/", _, below) if varying.intersection(names(below)):
                        inside = below.right if isinstance(below, Binary) and isinstance(below.left, Number) else below
                        words = "no value where this is 0: the samples do not excite"
                    case Call("sqrt", (inside,)) if varying.intersection(names(inside)):
                        words = "no real value where this is negative"
                    case _:
                        continue
                spelled = fold(substitute(inside, {key: own[key] for key in names(inside) if key in own}))
                if isinstance(part, Binary) or not (isinstance(spelled, Call) and spelled.function == "abs"):
                    found.setdefault(spelled, Singular(name=name, expression=spelled, words=words))
    return tuple(reversed(found.values()))
