"""The thesis' search for the shortest route: lists U, K and C, breadth first over all choices.

U holds what is still to be found, K what is known, C the components that may be passed through. One step finds the
first of U by a component of C: what else that component relates takes its place in U, what is known drops out,
duplicates go, signals are sorted by frame and parameters stand last. Every choice is followed; states with the same
components passed and the same U are one. The first state with an empty U is a shortest route.

The rules about time. The components of an older frame are added only when nothing in the open frames finds the first
of U. A parameter is found by its component in the newest frame where that is unused. Once a route has gone back in time
through a store, it may not go forward through another, that is, find a signal of a frame by a store of the frame after
it. States at the start of a frame can still be found from that frame, since this goes forward first. Where all routes
end without success and a parameter stands in two equations, as that of a gyrator, they are followed once more with
either equation in its newest frame where it is unused, though the other be left in an open one.

The number of states grows by ten with each section of a ladder; `routes.find_route` is the method for daily use.
Source: thesis 4.4.1, A.1, A.2.1, A.3 with errata E5 (a missing step) and E6 (the end is an empty U).
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise

from faultbond.algebra.route import Question, Route, RouteStep, Target
from faultbond.algebra.routes.unroll import (
    Place,
    assemble,
    causes,
    check_question,
    contained,
    frame_limit,
    in_words,
    open_targets,
    unknown_parameters,
    usable,
)
from faultbond.equations.component_network import ComponentNetwork, Equation

STATE_LIMIT = 100_000


class Ending(StrEnum):
    """How a search ended."""

    FOUND = "found"
    EXHAUSTED = "exhausted"
    LIMIT = "limit"


@dataclass(frozen=True, slots=True, kw_only=True)
class Passage:
    """One step of a search.

    finds : the first of U
    place : the component passed through, with its frame
    choices : all components that could have been passed through
    frames : number of open frames
    unknown : U afterwards
    """

    finds: Target
    place: Place
    choices: tuple[Place, ...]
    frames: int
    unknown: tuple[Target, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RouteSearch:
    """What a search found, and what it took.

    passages : of the route; where there is none, of the last state looked at
    expanded, distinct : states looked at, and states met
    widest : the largest number of routes followed at the same time
    """

    network: ComponentNetwork
    question: Question
    route: Route | None
    ending: Ending
    passages: tuple[Passage, ...]
    expanded: int
    distinct: int
    widest: int

    @property
    def message(self) -> str:
        """How the search ended, in words, and what to do."""
        sought = ", ".join(in_words(target) for target in self.question.targets)
        size = f"{self.expanded} states expanded, {self.distinct} distinct"
        if self.route is not None:
            frames = f"{self.route.frames} frame{'s' if self.route.frames > 1 else ''}"
            return f"{sought}: {len(self.route.steps)} equations in {frames}; {size}"
        if self.ending is Ending.EXHAUSTED:
            return f"{sought}: no route from what is measured, all were followed to their end; {size}; add a sensor"
        return f"{sought}: stopped at the limit; {size}; use the default method, whose effort does not explode"


@dataclass(frozen=True, slots=True, eq=False)
class _State:
    """A route as far as it has come.

    unknown: U, as codes. used: components passed, a bit each. found: what U has held, a bit for each code. back:
    whether the route has gone back in time.
    """

    unknown: tuple[int, ...]
    used: int
    found: int
    frames: int
    back: bool
    parent: "_State | None"
    place: tuple[int, int]
    choices: tuple[tuple[int, int], ...]


class _Codes:
    """Signals and equations as integers: a signal's code is its frame times the number of signals plus its index.

    Parameters have the highest codes, so that frames order codes and parameters stand last.
    """

    def __init__(self, network: ComponentNetwork, question: Question, *, forward: bool) -> None:
        self.question = question
        self.forward = forward
        self.equations: tuple[Equation, ...] = usable(network, question)
        self.signals = tuple(dict.fromkeys((*network.signals, *network.inputs, *network.outputs)))
        self.newest = question.newest
        self.limit = frame_limit(network, question)
        deepest = max((target[1] for target in question.targets if not isinstance(target, str)), default=0)
        self.n_frames = max(self.newest + self.limit, deepest) + 2
        self.free = unknown_parameters(question)
        self.first_parameter = len(self.signals) * self.n_frames
        self.parameters = tuple(sorted(self.free))
        self.index = {name: k for k, name in enumerate(self.signals)}
        caused = causes(network) if question.causal else None
        finders: dict[int, list[tuple[int, int]]] = {}  # equations that find a signal, and the frames each reaches
        for e, item in enumerate(self.equations):
            for name, back in item.signals:
                if caused is None or (not back and name in caused[item.name]):
                    finders.setdefault(self.index[name], []).append((e, back))
            for name in item.parameters:
                if name in self.free:
                    finders.setdefault(self.code(name), []).append((e, 0))  # of a parameter, by its code
        self.finders = finders
        self.contents: dict[tuple[int, int], tuple[int, ...]] = {}
        self.apart = False  # whether the equations of a parameter are looked at each for itself
        self.has_twice = any(len(finders.get(self.code(name), ())) > 1 for name in self.parameters)
        self.carries = [any(back for _, back in item.signals) for item in self.equations]

    def code(self, target: Target) -> int:
        """Give the code of a signal in a frame or of an unknown parameter."""
        if isinstance(target, str):
            return self.first_parameter + self.parameters.index(target)
        return target[1] * len(self.signals) + self.index[target[0]]

    def target(self, code: int) -> Target:
        """Give what a code stands for."""
        if code >= self.first_parameter:
            return self.parameters[code - self.first_parameter]
        frame, signal = divmod(code, len(self.signals))
        return self.signals[signal], frame

    def name(self, place: tuple[int, int]) -> Place:
        """Give an equation by its name, with its frame."""
        return self.equations[place[0]].name, place[1]

    def unknowns(self, place: tuple[int, int]) -> tuple[int, ...]:
        """Give the codes of what an equation relates in a frame and is not known."""
        if place not in self.contents:
            self.contents[place] = tuple(
                self.code(item)
                for item in contained(self.equations[place[0]], place[1])
                if (item in self.free if isinstance(item, str) else not self.question.is_known(item))
            )
        return self.contents[place]

    def bit(self, place: tuple[int, int]) -> int:
        """Give the bit that stands for an equation in a frame."""
        return 1 << (place[1] * len(self.equations) + place[0])


def search_route(
    network: ComponentNetwork, question: Question, *, limit: int = STATE_LIMIT, forward: bool = False
) -> RouteSearch:
    """Follow every route until one is complete, none is left, or `limit` states have been looked at.

    forward: whether routes may go forward in time again, which the thesis forbids.

    Raises
    ------
    StructureError
        Where the question names what the network does not have.
    """
    check_question(network, question)
    codes = _Codes(network, question, forward=forward)
    start = _State(
        unknown=_sorted(tuple(codes.code(target) for target in open_targets(question)), codes),
        used=0,
        found=0,
        frames=1,
        back=False,
        parent=None,
        place=(-1, -1),
        choices=(),
    )
    tree = _grow(start, codes, limit)
    if tree.ending is Ending.EXHAUSTED and codes.has_twice:
        codes.apart = True
        again = _grow(start, codes, limit - tree.expanded)
        tree = replace(
            again,
            expanded=tree.expanded + again.expanded,
            distinct=tree.distinct + again.distinct,
            widest=max(tree.widest, again.widest),
        )
    states = [tree.last]
    while states[-1].parent is not None:
        states.append(states[-1].parent)
    passages = tuple(
        Passage(
            finds=codes.target(before.unknown[0]),
            place=codes.name(state.place),
            choices=tuple(map(codes.name, state.choices)),
            frames=state.frames,
            unknown=tuple(map(codes.target, state.unknown)),
        )
        for before, state in pairwise(reversed(states))
    )
    steps = [RouteStep(equation=item.place[0], frame=item.place[1], finds=item.finds) for item in passages]
    return RouteSearch(
        network=network,
        question=question,
        route=assemble(network, question, steps) if tree.ending is Ending.FOUND else None,
        ending=tree.ending,
        passages=passages,
        expanded=tree.expanded,
        distinct=tree.distinct,
        widest=tree.widest,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Tree:
    """How the tree of routes has grown: see `RouteSearch`; last: the complete state, or the one looked at last."""

    last: _State
    ending: Ending
    expanded: int
    distinct: int
    widest: int


def _grow(start: _State, codes: _Codes, limit: int) -> _Tree:
    """Follow all routes, one component at a time."""
    seen: set[tuple[int, frozenset[int]]] = set()
    front, last, expanded, widest = [start], start, 0, 0

    def ended(last: _State, ending: Ending) -> _Tree:
        return _Tree(last=last, ending=ending, expanded=expanded, distinct=len(seen), widest=widest)

    if not start.unknown:
        return ended(start, Ending.FOUND)
    while front:
        widest = max(widest, len(front))
        following: list[_State] = []
        for last in front:
            if expanded >= limit:
                return ended(last, Ending.LIMIT)
            expanded += 1
            for state in _successors(last, codes):
                key = (state.used, frozenset(state.unknown))
                if key in seen:
                    continue
                seen.add(key)
                if not state.unknown:
                    return ended(state, Ending.FOUND)
                following.append(state)
        front = following
    return ended(last, Ending.EXHAUSTED)


def _successors(state: _State, codes: _Codes) -> Iterator[_State]:
    """Pass through each component that finds the first of U."""
    sought = state.unknown[0]
    frames, choices = _choices(state, codes)
    found = state.found | 1 << sought
    for place in choices:
        new = [code for code in codes.unknowns(place) if not found >> code & 1]
        unknown = _sorted((*new, *state.unknown[1:]), codes)
        back = codes.carries[place[0]] and (sought >= codes.first_parameter or place[1] == sought // len(codes.signals))
        yield _State(
            unknown=unknown,
            used=state.used | codes.bit(place),
            found=found,
            frames=frames,
            back=state.back or (back and not codes.forward),
            parent=state,
            place=place,
            choices=choices,
        )


def _sorted(unknown: Iterable[int], codes: _Codes) -> tuple[int, ...]:
    """Remove duplicates; signals by frame, else in the order in which they came, then parameters."""
    n = len(codes.signals)
    return tuple(
        sorted(dict.fromkeys(unknown), key=lambda code: codes.n_frames if code >= codes.first_parameter else code // n)
    )


def _choices(state: _State, codes: _Codes) -> tuple[int, tuple[tuple[int, int], ...]]:
    """Give the number of frames that are then open, and the unused components that find the first of U."""
    sought, frames = state.unknown[0], state.frames
    of_parameter = sought >= codes.first_parameter
    frame, key = (0, sought) if of_parameter else divmod(sought, len(codes.signals))

    def is_unused(place: tuple[int, int]) -> bool:
        return not state.used & codes.bit(place)

    while True:
        last = codes.newest + frames - 1
        places: list[tuple[int, int]] = []
        for e, back in codes.finders.get(key, ()):
            if of_parameter:  # for each of its equations the newest frame where that is unused
                end = codes.newest + codes.limit if codes.apart else last + 1
                unused = next(filter(is_unused, ((e, k) for k in range(codes.newest, end))), None)
                places += [unused] if unused else []
            elif codes.newest <= frame - back <= last and not (back and state.back) and is_unused((e, frame - back)):
                places.append((e, frame - back))  # in the signal's own frame and, through a store, in the next
        if of_parameter:
            frames = max((frames, *(k - codes.newest + 1 for _, k in places)))
        if places or frames >= codes.limit:
            return frames, tuple(places)
        frames += 1
