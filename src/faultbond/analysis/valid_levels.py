"""Levels of inputs at which `valid_when` holds, so that a usual run is one in which something is judged.

Each input is looked at by itself: conditions that join two of them are not met on purpose.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from faultbond.equations.numeric import Real, condition_holds
from faultbond.model.expression import Binary, Expression, Number, names, walk
from faultbond.model.graph import BondGraph, Input

_PARTS = (1.0, 1.25, 0.75, 2.5, 0.4, -1.0, 0.0)  # of what stands in a condition, tried in turn
_CORNERS = 9  # levels within the move of an input at which its conditions are to hold


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """A level of an input, SI. moves: whether its conditions hold all along its usual move about it."""

    value: float
    moves: bool


def valid_levels(graph: BondGraph, levels: Sequence[float], move: float) -> tuple[Level, ...]:
    """Give a level of each input, as near to those stated as the conditions allow.

    Parameters
    ----------
    graph : whose `valid_when`, and those of its sensors, are to hold
    levels : (n_inputs,), SI, tried first
    move : part of a level by which an input moves up and down
    """
    of_model = [graph.valid_when.condition] if graph.valid_when is not None else []
    conditions = [*of_model, *(item.condition for item in graph.conditions)]
    constants: dict[str, Real] = {item.name: item.value for item in graph.constants}
    found = []
    for item, level in zip(graph.inputs, levels, strict=True):
        own = _of_input(conditions, item.name, constants)
        first = _of_input(of_model, item.name, constants)
        found.append(_level(item, level, own, constants, move) or _level(item, level, first, constants, move))
    return tuple(one or Level(value=level, moves=True) for one, level in zip(found, levels, strict=True))


def _of_input(conditions: Sequence[Expression], name: str, constants: dict[str, Real]) -> list[Expression]:
    """Give what of some conditions has to hold for this input alone."""
    found = [part for condition in conditions for part in _joined(condition)]
    return [part for part in found if set(names(part)) - set(constants) == {name}]


def _joined(condition: Expression) -> Iterator[Expression]:
    """Give what `and` joins."""
    if isinstance(condition, Binary) and condition.operator == "and":
        yield from _joined(condition.left)
        yield from _joined(condition.right)
    else:
        yield condition


def _level(
    item: Input, level: float, conditions: Sequence[Expression], constants: dict[str, Real], move: float
) -> Level | None:
    """Give the first level at which all conditions hold, best all along its move; None where there is none."""
    if not conditions:
        return Level(value=level, moves=True)
    stated = [part.value for condition in conditions for part in walk(condition) if isinstance(part, Number)]
    tried = [level, *(part * value for value in stated for part in _PARTS)]
    tried += [value + item.unit.factor * way for value in stated for way in (1.0, -1.0)]
    tried += [part * value for value in (*map(float, constants.values()), level) for part in _PARTS]
    tried = [value for value in tried if item.lower <= value <= item.upper]
    for moves in (True, False):
        for value in tried:
            ways = [2.0 * k / (_CORNERS - 1) - 1.0 for k in range(_CORNERS)] if moves else [0.0]
            ends = [value + move * way * (value - item.unit.offset) for way in ways]
            if all(condition_holds(one, {**constants, item.name: end}) for end in ends for one in conditions):
                return Level(value=value, moves=moves)
    return None
