"""The equations of several frames as plain integers, and a route from the steps that an algorithm has chosen.

Frame after frame the equations of a network and the unknowns that they contain are numbered in the order in which they
are met, so that further frames only add numbers. Source: thesis 4.1, 4.4; A.1 for what is known.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from faultbond.algebra.route import Question, Route, RouteStep, Target
from faultbond.equations.component_network import ComponentNetwork, Equation, frame_name
from faultbond.equations.matching import blocks, match
from faultbond.errors import StructureError

Place = tuple[str, int]  # an equation and its frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Unrolled:
    """Equations of `frames` frames with the unknowns that they contain, by index.

    places : for each equation its name and frame
    unknowns : targets first, then as met
    equations : for each equation the unknowns that it contains
    weights : for each equation 1 for a part of the plant, 0 for a sensor
    """

    frames: int
    places: tuple[Place, ...]
    unknowns: tuple[Target, ...]
    equations: tuple[tuple[int, ...], ...]
    weights: tuple[int, ...]


def check_question(network: ComponentNetwork, question: Question) -> None:
    """Refuse a question about what the network does not have.

    Raises
    ------
    StructureError
        Names the target.
    """
    signals = {*network.signals, *network.observed}
    for target in question.targets:
        if target not in network.parameters and (isinstance(target, str) or target[0] not in signals):
            kind = "parameter" if isinstance(target, str) else "signal"
            name = target if isinstance(target, str) else target[0]
            raise StructureError(f"{network.file}: there is no {kind} {name}; look at the names in the model")


def open_targets(question: Question) -> tuple[Target, ...]:
    """Give the targets that are not known anyway."""
    return tuple(
        target for target in dict.fromkeys(question.targets) if isinstance(target, str) or not question.is_known(target)
    )


def unknown_parameters(question: Question) -> frozenset[str]:
    """Give the parameters whose value is not known."""
    return frozenset((*question.unknown, *(target for target in question.targets if isinstance(target, str))))


def usable(network: ComponentNetwork, question: Question) -> tuple[Equation, ...]:
    """Give the equations that are not suspended."""
    return tuple(item for item in network.equations if item.name not in question.suspended)


def contained(equation: Equation, frame: int) -> tuple[Target, ...]:
    """Give what an equation relates in a frame, known or not: parameters, then signals."""
    return (*equation.parameters, *((name, frame + back) for name, back in equation.signals))


def unroll(
    network: ComponentNetwork,
    question: Question,
    frames: int,
    before: Unrolled | None = None,
    without: frozenset[Place] = frozenset(),
) -> Unrolled:
    """Give the equations of the newest frames.

    before: what fewer frames gave, to be added to. without: equations to leave out.
    """
    unknowns = list(before.unknowns if before else open_targets(question))
    index = {unknown: k for k, unknown in enumerate(unknowns)}
    free = unknown_parameters(question)
    places: list[Place] = []
    found: list[tuple[int, ...]] = []
    weights: list[int] = []
    equations = usable(network, question)
    for frame in range(question.newest + (before.frames if before else 0), question.newest + frames):
        for equation in equations:
            if (equation.name, frame) in without:
                continue
            targets = _unknown(equation, frame, question, free)
            for target in targets:
                if target not in index:
                    index[target] = len(unknowns)
                    unknowns.append(target)
            places.append((equation.name, frame))
            found.append(tuple(index[target] for target in targets))
            weights.append(equation.weight)
    return Unrolled(
        frames=frames,
        places=(*(before.places if before else ()), *places),
        unknowns=tuple(unknowns),
        equations=(*(before.equations if before else ()), *found),
        weights=(*(before.weights if before else ()), *weights),
    )


def _unknown(equation: Equation, frame: int, question: Question, free: frozenset[str]) -> list[Target]:
    found: list[Target] = [name for name in equation.parameters if name in free]
    for name, back in equation.signals:
        signal = (name, frame + back)
        if not question.is_known(signal):
            found.append(signal)
    return found


def frame_limit(network: ComponentNetwork, question: Question) -> int:
    """Give the number of frames beyond which nothing more becomes known.

    Each further frame must fix one more of the states and unknown parameters; there are no more of them.
    """
    deepest = max((target[1] for target in question.targets if not isinstance(target, str)), default=0)
    needed = len(network.states) + len(unknown_parameters(question)) + 2 + max(0, deepest - question.newest)
    return max(1, min(question.frames, needed))


def assemble(network: ComponentNetwork, question: Question, steps: Sequence[RouteStep]) -> Route:
    """Give the route of the steps: each finds its unknown by its equation; together they contain no other unknown."""
    equations = {item.name: item for item in network.equations}
    free = unknown_parameters(question)
    index = {step.finds: k for k, step in enumerate(steps)}
    needs = [
        tuple(index[target] for target in _unknown(equations[step.equation], step.frame, question, free))
        for step in steps
    ]
    used = {
        target
        for step in steps
        for target in contained(equations[step.equation], step.frame)
        if not isinstance(target, str) and question.is_known(target)
    }
    used |= {target for target in question.targets if not isinstance(target, str) and question.is_known(target)}
    order = {name: k for k, name in enumerate((*network.inputs, *network.outputs, *network.signals))}
    known = sorted(used, key=lambda signal: (signal[1], order.get(signal[0], len(order))))
    return Route(
        question=question,
        steps=tuple(steps),
        blocks=blocks(needs, range(len(steps))),
        samples=tuple(signal for signal in known if signal[0] in question.observed),
        known=tuple(signal for signal in known if signal[0] not in question.observed),
    )


def in_words(target: Target) -> str:
    """Give a target by name, a signal with its frame."""
    return target if isinstance(target, str) else frame_name(target)


def causes(network: ComponentNetwork) -> dict[str, frozenset[str]]:
    """Give for each equation the signals that it causes, where the model is computed from states and inputs.

    A state is caused by its sum, any other signal by the equation that computes it from states and inputs. Within an
    algebraic loop each equation of the loop may cause any signal of the loop. Where a store has derivative causality,
    its state is caused by the rest of the plant and its sum causes the rate. Source: thesis 3.3.2, 4.2.4.
    """
    states = {state.signal for state in network.states}
    sums = {state.sum for state in network.states}
    signals = [name for name in network.signals if name not in network.inputs]
    signals.sort(key=lambda name: name in states)
    index = {name: k for k, name in enumerate(signals)}
    ordered = sorted(network.equations, key=lambda item: item.name in sums)
    full = [tuple(dict.fromkeys(index[n] for n, back in item.signals if not back and n in index)) for item in ordered]
    n_algebraic = len(signals) - len(states & set(signals))
    # First without the states, so that as few as possible are caused by anything but their sum.
    first = [
        tuple(k for k in row if k < n_algebraic) if item.name not in sums else ()
        for item, row in zip(ordered, full, strict=True)
    ]
    matched = match(full, len(signals), match(first, len(signals)))
    given = {k for k, e in enumerate(matched) if e >= 0 and ordered[e].name in sums and signals[k] in states}
    rows = [tuple(k for k in row if k not in given or matched[k] == e) for e, row in enumerate(full)]
    held = {e: k for k, e in enumerate(matched) if e >= 0}
    found: dict[str, frozenset[str]] = {item.name: frozenset() for item in network.equations}
    for block in blocks(rows, matched):
        inside = {held[e] for e in block}
        for e in block:
            found[ordered[e].name] = frozenset(signals[k] for k in rows[e] if k in inside)
    return found
