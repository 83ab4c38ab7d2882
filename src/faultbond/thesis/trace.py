"""The thesis' search step by step, as the thesis prints its example: number, U, K and C after each change.

Source: thesis A.3.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from string import ascii_lowercase

from faultbond.algebra.route import Target
from faultbond.algebra.routes.unroll import Place, contained, in_words, open_targets, unknown_parameters, usable
from faultbond.equations.component_network import frame_name
from faultbond.thesis.search import Passage, RouteSearch


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lists:
    """U, K and C; K with what was found last in front."""

    unknown: tuple[Target, ...]
    found: tuple[Target, ...] = ()
    used: frozenset[Place] = frozenset()
    frames: int = 1


def trace_lines(search: RouteSearch) -> Iterator[str]:
    """Print a search: the way to the route, or to the last state looked at where there is none.

    Where there is a choice all of it is shown, and the one that is followed to the end is named.
    """
    lists = _Lists(unknown=open_targets(search.question))
    number = 0
    yield f"To find {_joined(lists.unknown)}:"
    yield from _lines("", lists, search)
    for passage in search.passages:
        if passage.frames > lists.frames:
            number += 1
            lists = replace(lists, frames=passage.frames)
            yield f"No component is left to find {in_words(passage.finds)}; those of the next frame are added."
            yield from _lines(f"{number}.", lists, search)
        number += 1
        yield from _choice(f"{number}.", lists, passage, search)
        lists = _after(lists, passage.place, search)
        for sentence, unknown in _tidied(lists, search):
            number += 1
            lists = replace(lists, unknown=unknown)
            yield sentence
            yield from _lines(f"{number}.", lists, search)
    yield f"{search.message[0].upper()}{search.message[1:]}."


def _choice(number: str, lists: _Lists, passage: Passage, search: RouteSearch) -> Iterator[str]:
    """The lists after each of the components that could be passed through."""
    if len(passage.choices) == 1:
        yield f"Propagating through {frame_name(passage.place)}."
        yield from _lines(number, _after(lists, passage.place, search), search)
        return
    for k, place in enumerate(passage.choices):
        yield f"{'or ' if k else ''}{'through' if k else 'Propagating through'} {frame_name(place)}"
        yield from _lines(f"{' ' * len(number) if k else number} {_letter(k)}", _after(lists, place, search), search)
    yield f"Of these {_letter(passage.choices.index(passage.place))} is followed here."


def _letter(k: int) -> str:
    return f"({ascii_lowercase[k]})" if k < len(ascii_lowercase) else f"({k + 1})"


def _after(lists: _Lists, place: Place, search: RouteSearch) -> _Lists:
    """The lists when a component has been passed through, before anything drops out of U."""
    equation = search.network.equation(place[0])
    sought, *rest = lists.unknown
    needs = [target for target in contained(equation, place[1]) if target != sought]
    return replace(lists, unknown=(*needs, *rest), found=(sought, *lists.found), used=lists.used | {place})


def _tidied(lists: _Lists, search: RouteSearch) -> Iterator[tuple[str, tuple[Target, ...]]]:
    """What changes U after a step, and U after it: known parameters, then signals drop out, duplicates go, sorting."""
    question, unknown = search.question, lists.unknown

    def is_given(target: Target) -> bool:
        return target not in unknown_parameters(question) if isinstance(target, str) else question.is_known(target)

    for kind in (str, tuple):
        known = [item for item in unknown if isinstance(item, kind) and (item in lists.found or is_given(item))]
        if known:
            unknown = tuple(item for item in unknown if item not in known)
            yield f"Known and removed: {_joined(tuple(dict.fromkeys(known)))}.", unknown
    twice = tuple(dict.fromkeys(item for k, item in enumerate(unknown) if item in unknown[:k]))
    if twice:
        unknown = tuple(dict.fromkeys(unknown))
        yield f"Duplicates removed: {_joined(twice)}.", unknown
    ordered = tuple(sorted(unknown, key=lambda item: (isinstance(item, str), 0 if isinstance(item, str) else item[1])))
    if ordered != unknown:
        yield "Sorted by frame, parameters last.", ordered


def _lines(number: str, lists: _Lists, search: RouteSearch) -> Iterator[str]:
    """The three lists: U, K with what is known from the beginning (x stands for any frame), and C with what is left."""
    network, question = search.network, search.question
    known = [in_words(target) for target in lists.found]
    for name in (*network.inputs, *network.outputs):
        hidden = [frame_name(signal) for signal in sorted(question.hidden) if signal[0] == name]
        if name in question.observed:
            known.append(f"{name}_x" + (f" except {' '.join(hidden)}" if hidden else ""))
    known += [frame_name(signal) for signal in sorted(question.known)]
    known += [name for name in network.parameters if name not in unknown_parameters(question)]
    frames = range(question.newest, question.newest + lists.frames)
    places = ((equation.name, frame) for frame in frames for equation in usable(network, question))
    margin = " " * 9
    yield f"{number:<8} U = {{{_joined(lists.unknown)}}}"
    yield f"{margin}K = {{{', '.join(known)}}}"
    yield f"{margin}C = {{{', '.join(frame_name(place) for place in places if place not in lists.used)}}}"


def _joined(targets: Sequence[Target]) -> str:
    return ", ".join(in_words(target) for target in targets)
