"""Routes by matching: polynomial, with the fewest frames.

Frames are added until the equations fix every target (Dulmage and Mendelsohn 1958: it has left the under-determined
part). Of the equations that could be spared the deepest are left out first. What the targets then need along the
matching is the route: no part of it gives them, since as many equations as unknowns are needed whichever way they are
matched. Sources: thesis 4.4.1 (what a route is); Pothen and Fan 1990.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from faultbond.algebra.route import Question, Route, RouteStep
from faultbond.algebra.routes.unroll import (
    Place,
    Unrolled,
    assemble,
    causes,
    check_question,
    frame_limit,
    in_words,
    open_targets,
    unroll,
)
from faultbond.equations.component_network import ComponentNetwork
from faultbond.equations.matching import closure, holdings, incidence, match, redundant, undetermined
from faultbond.errors import StructureError

_FEW = 24  # equations that are left out in turn to shorten a route
_EXPLORED = 3  # routes looked at for each alternative wanted
_TRIED_SENSORS = 12  # signals that are tried as a further sensor when a question is refused,
_TRIED_EQUATIONS = 20_000  # and the number of equations looked at for that


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """Frames, and a matching of their equations with as many unknowns as possible; targets are the first unknowns."""

    unrolled: Unrolled
    matched: tuple[int, ...]
    n_targets: int

    @property
    def targets(self) -> range:
        """Indices of the targets among the unknowns."""
        return range(self.n_targets)

    @property
    def is_solved(self) -> bool:
        """Whether no alternating path leads from an unknown without equation to a target."""
        return all(self.matched[k] >= 0 for k in closure(self.targets, self.unrolled.equations, self.matched)[1])


def find_route(network: ComponentNetwork, question: Question) -> Route:
    """Give a route with the fewest frames.

    A causal question is answered along causality where that is possible, otherwise in any direction.

    Raises
    ------
    StructureError
        Where no number of frames fixes the targets; names what stays undetermined.
    """
    check_question(network, question)
    if question.causal:
        caused = causes(network)
        for frames in range(1, frame_limit(network, question) + 1):
            unrolled = unroll(network, question, frames)
            rows = []
            for (name, frame), row in zip(unrolled.places, unrolled.equations, strict=True):
                unknowns = ((k, unrolled.unknowns[k]) for k in row)
                rows.append([k for k, u in unknowns if isinstance(u, str) or (u[0] in caused[name] and u[1] == frame)])
            matched = match(rows, len(unrolled.unknowns))
            found = Frames(unrolled=unrolled, matched=matched, n_targets=len(open_targets(question)))
            if found.is_solved:
                return route_of(network, question, found, matched)
    found = fewest_frames(network, question)
    return route_of(network, question, found, shorten(found))


def alternatives(network: ComponentNetwork, question: Question, limit: int = 20) -> Iterator[Route]:
    """Give up to `limit` different routes, the one of `find_route` first.

    Each further one does without one equation more of a route found before, which may take more frames. The same route
    some frames earlier is not another one. For a caller that prefers, say, the route that amplifies noise least.

    Raises
    ------
    StructureError
        Where there is no route at all.
    """
    first = find_route(network, question)
    yield first
    seen, given = {_places(first)}, {_newest(first)}
    tried = {frozenset[Place]()}
    queue = [(frozenset[Place](), first)]
    for without, route in queue:
        for step in route.steps:
            fewer = without | {(step.equation, step.frame)}
            if len(given) >= limit or len(seen) >= _EXPLORED * limit:
                return
            if fewer in tried:
                continue
            tried.add(fewer)
            found = _add_frames(network, question, fewer)
            if not found.is_solved:
                continue
            other = route_of(network, question, found, shorten(found))
            if _places(other) in seen:
                continue
            seen.add(_places(other))
            queue.append((fewer, other))
            if _newest(other) not in given:
                given.add(_newest(other))
                yield other


def _newest(route: Route) -> frozenset[Place]:
    """The places of a route, moved to the newest frame where nothing ties it to another."""
    question = route.question
    tied = question.known or question.hidden or any(not isinstance(target, str) for target in question.targets)
    moved = 0 if tied else min((step.frame for step in route.steps), default=0)
    return frozenset((name, frame - moved) for name, frame in _places(route))


def _places(route: Route) -> frozenset[Place]:
    return frozenset((step.equation, step.frame) for step in route.steps)


def fewest_frames(network: ComponentNetwork, question: Question) -> Frames:
    """Add frames until every target is fixed.

    Raises
    ------
    StructureError
        Names a target and the unknown that nothing fixes.
    """
    found = _add_frames(network, question)
    if found.is_solved:
        return found
    unrolled = found.unrolled
    free = undetermined(unrolled.equations, len(unrolled.unknowns), found.matched)
    lost = [in_words(unrolled.unknowns[k]) for k in found.targets if k in free]
    known = [name for name in (*network.inputs, *network.outputs) if name in question.observed]
    known += [in_words(signal) for signal in sorted(question.known)]
    span = "however many samples are used"
    if unrolled.frames == question.frames:
        span = f"within {unrolled.frames} time frame{'s' if unrolled.frames > 1 else ''}, the limit"
    # Signals that would help if measured: those near the targets first; few are tried where a trial takes long.
    signals = (unknown[0] for k, unknown in enumerate(unrolled.unknowns) if k in free and not isinstance(unknown, str))
    n_tried = max(1, min(_TRIED_SENSORS, _TRIED_EQUATIONS // max(1, len(unrolled.equations))))
    closed = question.observed | {signal for signal, _ in question.hidden}
    sensors = [
        name
        for name in list(dict.fromkeys(signals))[:n_tried]
        if name not in closed and _add_frames(network, replace(question, observed=question.observed | {name})).is_solved
    ][:3]
    advice = f"add a sensor, for example of {' or '.join(sensors)}" if sensors else "add sensors"
    raise StructureError(
        f"{network.file}: {', '.join(lost)} cannot be found from {', '.join(known) or 'nothing'}: "
        f"{'they stay' if len(lost) > 1 else 'it stays'} undetermined {span}; {advice}"
    )


def _add_frames(network: ComponentNetwork, question: Question, without: frozenset[Place] = frozenset()) -> Frames:
    """Add frames until every target is fixed, or nothing more can become known."""
    n_targets = len(open_targets(question))
    unrolled = unroll(network, question, 1, without=without)
    matched = match(unrolled.equations, len(unrolled.unknowns))
    found = Frames(unrolled=unrolled, matched=matched, n_targets=n_targets)
    for frames in range(2, frame_limit(network, question) + 1):
        if found.is_solved:
            break
        unrolled = unroll(network, question, frames, unrolled, without)
        matched = match(unrolled.equations, len(unrolled.unknowns), matched)
        found = Frames(unrolled=unrolled, matched=matched, n_targets=n_targets)
    return found


def shorten(found: Frames) -> tuple[int, ...]:
    """Give a matching along which the targets need few equations.

    Among the equations that the targets need and that could be spared, one is replaced in turn, along a shortest
    alternating path, by one that nothing needs yet: the one after which the fewest are needed. Where no single exchange
    helps, each is left out for good and the rest shortened in the same way, if they are not too many. Ours; it ends at
    the shortest route nearly always, `fewest.fewest_components` always.
    """
    rows = found.unrolled.equations
    matched = _descend(found, rows, found.matched)
    trying = True
    while trying:
        trying = False
        needed = closure(found.targets, rows, matched)[0]
        candidates = sorted(redundant(rows, matched) & set(needed))
        for equation in candidates if len(candidates) <= _FEW else ():
            fewer = [row if e != equation else () for e, row in enumerate(rows)]
            start = [-1 if e == equation else e for e in matched]
            other = _descend(found, fewer, match(fewer, len(start), start))
            if _size(closure(found.targets, rows, other)[0], found) < _size(needed, found):
                matched, trying = other, True
                break
    return matched


def _descend(found: Frames, rows: Sequence[Sequence[int]], matched: tuple[int, ...]) -> tuple[int, ...]:
    """Exchange one equation at a time while that helps."""
    containing = incidence(rows, len(matched))
    needed = closure(found.targets, rows, matched)[0]
    while True:
        options = []
        for equation in sorted(redundant(rows, matched) & set(needed)):
            for exchanged in _exchanges(equation, matched, rows, containing):
                needs = closure(found.targets, rows, exchanged)[0]
                options.append((_size(needs, found), -equation, exchanged, needs))
        best = min(options, default=None, key=lambda option: option[:2])
        if best is None or best[0] >= _size(needed, found):
            return matched
        *_, matched, needed = best


def _size(needed: Sequence[int], found: Frames) -> tuple[int, ...]:
    """Give what is to be small: parts of the plant that are passed through, equations, frames gone back.

    Of equals it is the one in which targets sought later are met again, as in the thesis' search, where those sought
    first are found from the newest frame; then the first in the order of the network.
    """
    unrolled = found.unrolled
    weight = sum(unrolled.weights[e] for e in needed)
    depth = sum(unrolled.places[e][1] for e in needed)
    again = sum(k for e in needed for k in unrolled.equations[e] if k < found.n_targets)
    return weight, len(needed), depth, -again, sum(needed)


def _exchanges(
    equation: int, matched: tuple[int, ...], equations: Sequence[Sequence[int]], containing: Sequence[Sequence[int]]
) -> Iterator[tuple[int, ...]]:
    """Give matchings without an equation: along a shortest path to each equation that determines nothing."""
    held = holdings(equations, matched)
    start = held[equation]
    came: dict[int, int] = {start: -1}  # unknown -> the one whose search led to the equation that determines it
    spare: set[int] = set()
    queue = [start]
    for unknown in queue:
        for other in containing[unknown]:
            if other == equation or other in spare:
                continue
            if held[other] < 0:
                spare.add(other)
                result, taken, back = list(matched), other, unknown
                while back >= 0:  # back to the start, each unknown takes the equation of the one after it
                    result[back], taken, back = taken, matched[back], came[back]
                yield tuple(result)
            elif held[other] not in came:
                came[held[other]] = unknown
                queue.append(held[other])


def route_of(network: ComponentNetwork, question: Question, found: Frames, matched: Sequence[int]) -> Route:
    """Give the route along a matching: from the targets to what is known, breadth first."""
    unrolled = found.unrolled
    steps = []
    queue = dict.fromkeys(found.targets)
    order = list(queue)
    for unknown in order:
        name, frame = unrolled.places[matched[unknown]]
        steps.append(RouteStep(equation=name, frame=frame, finds=unrolled.unknowns[unknown]))
        for other in unrolled.equations[matched[unknown]]:
            if other not in queue:
                queue[other] = None
                order.append(other)
    return assemble(network, question, steps)
