"""Closed forms made readable: short lines inlined, and for code every common part computed once."""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from faultbond.algebra.solving.branches import Condition
from faultbond.algebra.solving.solution import Line, Root, Solution
from faultbond.algebra.solving.tidy import fold
from faultbond.equations.component_network import SAMPLE_TIME
from faultbond.equations.inversion import substitute
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, names, parts, walk

MAX_INLINE = 60  # parts of a line that is put where it is used
SHORT = 3  # parts of a line that is put wherever it is used


@dataclass(frozen=True, slots=True, kw_only=True)
class Formula:
    """What gives one target by one closed form.

    arguments: samples, then `dt`, then parameters. number: of the closed form, the first being the one that holds at
    the nominal plant. count: of closed forms. origin: a word on what it follows from, where several functions give the
    same target.
    """

    target: str
    arguments: tuple[str, ...]
    lines: tuple[Line, ...]
    conditions: tuple[Condition, ...]
    number: int
    count: int
    origin: str = ""


def formulas(solution: Solution, parameters: Sequence[str]) -> tuple[Formula, ...]:
    """Give a formula for each target and each closed form.

    Parameters
    ----------
    solution : with closed forms
    parameters : names that are parameters of the plant; all others but `dt` are samples
    """
    found = []
    for target in solution.targets:
        for number, root in enumerate(solution.roots, start=1):
            lines = readable_lines(root, (target,))
            found.append(
                Formula(
                    target=target,
                    arguments=_arguments(lines, set(parameters)),
                    lines=lines,
                    conditions=shown_conditions(root, lines),
                    number=number,
                    count=len(solution.roots),
                )
            )
    return tuple(found)


def _arguments(lines: Sequence[Line], parameters: set[str]) -> tuple[str, ...]:
    own = {line.name for line in lines}
    used = {name for line in lines for name in names(line.value)} - own
    return tuple(sorted(used, key=lambda name: (name in parameters, name == SAMPLE_TIME, name)))


def readable_lines(root: Root, targets: Sequence[str]) -> tuple[Line, ...]:
    """Give the lines that targets follow from; one that is used once or short stands where it is used."""
    lines = _needed(root.lines, targets)
    uses = Counter(part.text for line in lines for part in walk(line.value) if isinstance(part, Name))
    inlined: dict[str, Expression] = {}
    kept: list[Line] = []
    for line in lines:
        value = fold(substitute(line.value, inlined))
        size = sum(1 for _ in walk(value))
        if line.name not in targets and (size <= SHORT or (uses[line.name] == 1 and size <= MAX_INLINE)):
            inlined[line.name] = value
        else:
            kept.append(Line(name=line.name, value=value))
    return _needed(kept, targets)


def _needed(lines: Iterable[Line], targets: Sequence[str]) -> tuple[Line, ...]:
    kept: list[Line] = []
    open_ = set(targets)
    for line in reversed(tuple(lines)):
        if line.name in open_:
            kept.append(line)
            open_.update(names(line.value))
    return tuple(reversed(kept))


def shown_conditions(root: Root, lines: Sequence[Line]) -> tuple[Condition, ...]:
    """Give the conditions of a root in samples, parameters and the names of lines that are shown."""
    shown = {line.name for line in lines}
    values: dict[str, Expression] = {}
    for line in root.lines:
        if line.name not in shown:
            values[line.name] = fold(substitute(line.value, values))
    return tuple(
        dict.fromkeys(
            Condition(expression=fold(substitute(item.expression, values)), strict=item.strict)
            for item in root.conditions
        )
    )


def common_parts(lines: Sequence[Line], fresh: Callable[[], str]) -> tuple[Line, ...]:
    """Give lines in which no sum, product or function is computed twice; what is shared has a line of its own.

    Parameters
    ----------
    lines : of one formula
    fresh : makes a name that is not in use
    """
    seen: Counter[Expression] = Counter()
    for line in lines:
        _count(line.value, seen)
    named: dict[Expression, Expression] = {}
    result: list[Line] = []
    for line in lines:
        value = _shared(line.value, seen, named, result, fresh)
        result.append(Line(name=line.name, value=value))
        if isinstance(line.value, Binary | Call):
            named.setdefault(line.value, Name(line.name))
    return tuple(result)


def _count(expression: Expression, seen: Counter[Expression]) -> None:
    """Count each part once for every place where it would be computed."""
    if not _is_worth_it(expression):
        for part in parts(expression):
            _count(part, seen)
        return
    seen[expression] += 1
    if seen[expression] == 1:
        for part in parts(expression):
            _count(part, seen)


def _is_worth_it(expression: Expression) -> bool:
    """Whether a part may get a line of its own: comparisons stay where they are."""
    match expression:
        case Binary(operator, _, _):
            return operator in ("+", "-", "*", "/", "**")
        case Call():
            return True
    return False


def _shared(
    expression: Expression,
    seen: Mapping[Expression, int],
    named: dict[Expression, Expression],
    lines: list[Line],
    fresh: Callable[[], str],
) -> Expression:
    """Give an expression in the names of shared parts, adding a line for each that is met first."""
    if expression in named:
        return named[expression]
    result = expression
    match expression:
        case Negative(operand):
            result = Negative(_shared(operand, seen, named, lines, fresh))
        case Binary(operator, left, right):
            result = Binary(
                operator, _shared(left, seen, named, lines, fresh), _shared(right, seen, named, lines, fresh)
            )
        case Call(function, arguments):
            result = Call(function, tuple(_shared(part, seen, named, lines, fresh) for part in arguments))
    if _is_worth_it(expression) and seen.get(expression, 0) > 1:
        name = Name(fresh())
        lines.append(Line(name=name.text, value=result))
        named[expression] = name
        return name
    return result
