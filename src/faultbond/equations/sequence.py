"""The order in which signals follow from states, inputs and parameters.

Each signal is matched to a constraint (maximum matching), signals that need each other are gathered in blocks
(strongly connected components, Tarjan 1972), and a block of several is an algebraic loop: a few of its signals are torn
(guessed), the others follow, and the unused constraints are residuals (Elmqvist and Otter 1994). Thesis 4.2 solves the
same sets by REDUCE.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from math import comb

from faultbond.equations.constraint_network import Constraint, ConstraintNetwork, Store
from faultbond.equations.inversion import isolate, linear_solution, substitute
from faultbond.equations.matching import blocks, holdings, match_any
from faultbond.errors import StructureError
from faultbond.model.expression import Binary, Expression, Name, names


@dataclass(frozen=True, slots=True, kw_only=True)
class Assignment:
    """`signal = expression` of signals known before."""

    signal: str
    expression: Expression
    owner: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Loop:
    """An algebraic loop: find `tears` such that `residuals` vanish, where `inner` follow from the tears.

    closed: the tear in closed form, where there is one (a single tear).
    """

    tears: tuple[str, ...]
    inner: tuple[Assignment, ...]
    residuals: tuple[Expression, ...]
    owners: tuple[str, ...]
    closed: Expression | None


Step = Assignment | Loop

_MAX_TRIALS = 500  # sets of tears tried one by one; beyond that a greedy choice
_MAX_INSERTED = 40  # signals of a loop that are inserted to isolate its tear


@dataclass(frozen=True, slots=True, kw_only=True)
class _Equation:
    """A constraint with the signals it can be solved for, and those it only needs."""

    constraint: Constraint
    unknowns: frozenset[str]
    needs: frozenset[str]


def slope_name(dependent: str, state: str) -> str:
    """Give the name that stands for the derivative of a dependent store by a state."""
    return f"d {dependent}/d {state}"


def sequence(network: ConstraintNetwork, file: str = "model") -> tuple[Step, ...]:
    """Give the steps that compute every signal of the network, in order.

    Raises
    ------
    StructureError
        Where constraints and signals do not balance; names the undetermined signals and the superfluous constraints.
    """
    signals = frozenset(network.signals)
    plain = [
        _Equation(constraint=item, unknowns=frozenset(names(item.residual)) & signals, needs=frozenset())
        for item in network.constraints
    ]
    if not network.dependent:
        return tuple(_steps(plain, network, file))
    # First as if the rates of dependent stores were given: this shows on which states their quantities depend.
    free = [_rate_equation(store, (), signals) for store in network.dependent]
    sources = _sources(tuple(_steps([*plain, *free], network, file)), network)
    rates = [_rate_equation(store, sources[store.name], signals) for store in network.dependent]
    return tuple(_steps([*plain, *rates], network, file))


def _rate_equation(store: Store, states: tuple[Store, ...], signals: frozenset[str]) -> _Equation:
    """The rate of a dependent store: its quantity differentiated through the states (inputs are held)."""
    residual: Expression = Name(store.rate)
    for state in states:
        residual = Binary("-", residual, Binary("*", Name(slope_name(store.name, state.name)), Name(state.rate)))
    constraint = Constraint(owner=store.component or store.name, residual=residual, line=0)
    return _Equation(
        constraint=constraint, unknowns=frozenset(names(residual)) & signals, needs=frozenset({store.name})
    )


def _sources(steps: tuple[Step, ...], network: ConstraintNetwork) -> dict[str, tuple[Store, ...]]:
    """For each dependent store the states on which its quantity depends."""
    states = {state.name: state for state in network.states}
    reach: dict[str, frozenset[str]] = {name: frozenset({name}) for name in states}
    for step in steps:
        parts = [step] if isinstance(step, Assignment) else list(step.inner)
        used = [name for part in parts for name in names(part.expression)]
        found = [step.signal] if isinstance(step, Assignment) else [*step.tears, *(part.signal for part in parts)]
        if isinstance(step, Loop):
            used += [name for residual in step.residuals for name in names(residual)]
        total = frozenset[str]().union(*(reach.get(name, frozenset()) for name in used))
        reach |= dict.fromkeys(found, total)
    return {store.name: tuple(states[name] for name in sorted(reach[store.name])) for store in network.dependent}


def _steps(equations: list[_Equation], network: ConstraintNetwork, file: str) -> Iterator[Step]:
    """Match equations and signals, and solve block by block."""
    place = {name: k for k, name in enumerate(network.signals)}
    rows = [sorted(place[name] for name in equation.unknowns) for equation in equations]
    matched = match_any(rows, len(place))
    held = holdings(rows, matched)
    if -1 in held or -1 in matched:
        lost = sorted({item.constraint.owner for item, signal in zip(equations, held, strict=True) if signal < 0})
        open_ = [name for name, equation in zip(network.signals, matched, strict=True) if equation < 0]
        raise StructureError(
            f"{file}: the equations do not fix every signal: undetermined {', '.join(open_) or 'none'}; "
            f"superfluous: the law of {', '.join(lost) or 'none'}; look at the laws of these parts and at what they "
            "connect"
        )
    preferred = {error.target for error in network.slow_errors}
    varying = {*network.signals, *network.inputs, *network.free, *(state.name for state in network.states)}
    reads = [row + [place[name] for name in item.needs] for row, item in zip(rows, equations, strict=True)]
    for block in blocks(reads, matched):
        signals = [network.signals[held[k]] for k in block]
        if len(block) > 1:
            yield _tear([equations[k] for k in block], signals, preferred, varying)
            continue
        residual, owner = equations[block[0]].constraint.residual, equations[block[0]].constraint.owner
        solution = isolate(residual, signals[0])
        if solution is not None:
            yield Assignment(signal=signals[0], expression=solution, owner=owner)
        else:
            yield Loop(tears=(signals[0],), inner=(), residuals=(residual,), owners=(owner,), closed=None)


def _tear(equations: list[_Equation], signals: list[str], preferred: set[str], varying: set[str]) -> Loop:
    """Choose the tears of a loop: as few as possible, signals with a slow error and closed forms first.

    Then those from which the others follow without a quotient by what may be zero at times, as the speed of a pump is.
    """

    def rank(loop: Loop) -> tuple[bool, bool, bool, int]:
        occurrences = sum(names(residual).count(tear) for residual in loop.residuals for tear in loop.tears)
        fails = any(_divides_by(part.expression, varying) for part in loop.inner)
        return (not set(loop.tears) & preferred if preferred else False, loop.closed is None, fails, occurrences)

    for size in range(1, len(signals) + 1):
        few = comb(len(signals), size) <= _MAX_TRIALS
        options = combinations(signals, size) if few else [_greedy(equations, signals, size)]
        loops = [loop for tears in options if (loop := _loop(equations, signals, tears)) is not None]
        if loops:
            return min(loops, key=rank)
    raise AssertionError("all signals torn is always a loop")


def _divides_by(solution: Expression, varying: set[str]) -> bool:
    """Tell whether a linear solution, see `linear_solution`, is a quotient by something that varies."""
    match solution:
        case Binary("/", _, slope):
            return not varying.isdisjoint(names(slope))
    return False


def _greedy(equations: list[_Equation], signals: list[str], size: int) -> tuple[str, ...]:
    """Give tears for a wide loop: each next one is the signal in most of the equations still unsolved."""
    tears: list[str] = []
    for _ in range(size):
        inner, rest = _follow(equations, signals, tuple(tears))
        known = set(tears) | {part.signal for part in inner}
        counts = {s: sum(s in equations[k].unknowns for k in rest) for s in signals if s not in known}
        if not counts:
            break
        tears.append(max(counts, key=lambda s: (counts[s], -signals.index(s))))
    return tuple(tears)


def _follow(
    equations: list[_Equation], signals: list[str], tears: tuple[str, ...]
) -> tuple[list[Assignment], list[int]]:
    """Compute what follows from the tears by linear steps; give it and the equations left over."""
    unknown = set(signals) - set(tears)
    rest = list(range(len(equations)))
    inner: list[Assignment] = []
    progress = True
    while progress:
        progress = False
        for k in rest:
            open_ = equations[k].unknowns & unknown
            if len(open_) == 1:
                (signal,) = open_
                solution = linear_solution(equations[k].constraint.residual, signal)
                if solution is not None:
                    inner.append(Assignment(signal=signal, expression=solution, owner=equations[k].constraint.owner))
                    unknown.discard(signal)
                    rest.remove(k)
                    progress = True
                    break
    return inner, rest


def _loop(equations: list[_Equation], signals: list[str], tears: tuple[str, ...]) -> Loop | None:
    """Give the loop with these tears, in closed form where one tear can be isolated; None where too few follow."""
    inner, rest = _follow(equations, signals, tears)
    if len(rest) != len(tears):
        return None
    residuals = tuple(equations[k].constraint.residual for k in rest)
    closed = None
    if len(tears) == 1 and len(inner) <= _MAX_INSERTED:
        values: dict[str, Expression] = {}
        for part in inner:
            values[part.signal] = substitute(part.expression, values)
        closed = isolate(substitute(residuals[0], values), tears[0])
    owners = tuple(sorted({equation.constraint.owner for equation in equations}))
    return Loop(tears=tears, inner=tuple(inner), residuals=residuals, owners=owners, closed=closed)
