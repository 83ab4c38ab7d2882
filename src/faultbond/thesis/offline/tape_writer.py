"""Closed forms turned into programs of plain data for the on-line part.

What is computed twice is computed once: equal instructions on equal registers share a register (value numbering).
"""

from collections.abc import Callable, Mapping, Sequence

from faultbond.algebra.solving.solution import Line, Root
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, names, rename
from faultbond.thesis.offline.torn import Torn
from faultbond.thesis.online.plan import Programs
from faultbond.thesis.online.tape import Instruction, NewtonTape, Outcome, Program

MAX_POWER = 16  # whole powers up to here are products


class _Writer:
    """Registers, and the instructions that fill them."""

    def __init__(self, n_arguments: int, constants: Sequence[float]) -> None:
        self.constants = {value: n_arguments + k for k, value in enumerate(constants)}
        self.first = n_arguments + len(constants)
        self.code: dict[Instruction, int] = {}

    def emit(self, name: str, *operands: int) -> int:
        """Give the register of an instruction, that of an equal one if there is one."""
        return self.code.setdefault((name, operands), self.first + len(self.code))

    def write(self, expression: Expression, known: Mapping[str, int]) -> int:
        """Give the register of an expression."""
        match expression:
            case Number(value):
                return self.constants[value]
            case Name(text):
                return known[text]
            case Negative(operand):
                return self.emit("negative", self.write(operand, known))
            case Binary("**", base, Number(value)) if value.is_integer() and 1 <= value <= MAX_POWER:
                return self._product(self.write(base, known), int(value))
            case Binary(operator, left, right):
                return self.emit(operator, self.write(left, known), self.write(right, known))
            case Call(("min" | "max") as function, (first, *others)):
                found = self.write(first, known)
                for other in others:
                    found = self.emit(function, found, self.write(other, known))
                return found
            case Call(function, arguments):
                return self.emit(function, *[self.write(argument, known) for argument in arguments])
        raise ValueError(expression)

    def _product(self, base: int, exponent: int) -> int:
        if exponent == 1:
            return base
        half = self._product(base, exponent // 2)
        whole = self.emit("*", half, half)
        return self.emit("*", whole, base) if exponent % 2 else whole


def compile_roots(roots: Sequence[Root], targets: Sequence[str], places: Mapping[str, int]) -> Program:
    """Give the program of closed forms.

    Parameters
    ----------
    roots : of one solution, that which holds at the nominal plant first
    targets : names of the results, of lines or of places
    places : place of each name in the environment; a name with a line of its own has none

    Raises
    ------
    KeyError
        Where a closed form uses a name that has no place.
    """
    outer: dict[str, None] = {}  # names that closed forms are given, in order of use
    for root in roots:
        own = {line.name for line in root.lines}
        used = (*(name for item in _expressions(root) for name in names(item)), *targets)
        outer |= dict.fromkeys(name for name in used if name not in own)
    constants = tuple(dict.fromkeys(n for root in roots for item in _expressions(root) for n in _numbers(item)))
    writer = _Writer(len(outer), constants)
    arguments = {name: k for k, name in enumerate(outer)}
    outcomes = []
    for root in roots:
        known = dict(arguments)
        for line in root.lines:
            known[line.name] = writer.write(line.value, known)
        conditions = (
            ()
            if len(roots) == 1
            else tuple((writer.write(item.expression, known), item.strict) for item in root.conditions)
        )
        outcomes.append(Outcome(results=tuple(known[target] for target in targets), conditions=conditions))
    return Program(
        arguments=tuple(places[name] for name in outer),
        constants=constants,
        code=tuple(writer.code),
        outcomes=tuple(outcomes),
    )


def compile_torn(torn: Torn, target: str, places: Mapping[str, int]) -> NewtonTape:
    """Give the search for a target that has no closed form."""
    starts = []
    for name in torn.guessed:  # the same signal one frame earlier
        signal, _, frame = name.rpartition("_")
        starts.append(places.get(f"{signal}_{int(frame) + 1}", -1) if frame.isdigit() else -1)
    return NewtonTape(
        program=compile_roots([Root(lines=torn.lines)], (*torn.misfits, target), places),
        guessed=tuple(places[name] for name in torn.guessed),
        starts=tuple(starts),
        about=torn.about,
    )


def compile_batch(items: Sequence[tuple[Sequence[Root], str] | None], places: Mapping[str, int]) -> Programs:
    """Give programs for many closed forms of one target each; those with one root only are one program.

    Parameters
    ----------
    items : roots and target; None is left out
    places : place of each name in the environment
    """
    alone = [(row, item) for row, item in enumerate(items) if item is not None and len(item[0]) > 1]
    together = [(row, item[0][0], item[1]) for row, item in enumerate(items) if item is not None and len(item[0]) == 1]
    batch: list[tuple[Program, tuple[int, ...]]] = [
        (compile_roots(roots, (target,), places), (row,)) for row, (roots, target) in alone
    ]
    if together:
        lines = tuple(
            Line(name=f"{row} {line.name}", value=rename(line.value, _within(root, row)))
            for row, root, _ in together
            for line in root.lines
        )
        targets = tuple(_within(root, row)(target) for row, root, target in together)
        rows = tuple(row for row, _, _ in together)
        batch.append((compile_roots([Root(lines=lines)], targets, places), rows))
    return tuple(batch)


def _within(root: Root, row: int) -> Callable[[str], str]:
    """Give names of lines a form of their own, since two closed forms may call different lines alike."""
    own = {line.name for line in root.lines}
    return lambda name: f"{row} {name}" if name in own else name


def _expressions(root: Root) -> tuple[Expression, ...]:
    return (*(line.value for line in root.lines), *(item.expression for item in root.conditions))


def _numbers(expression: Expression) -> tuple[float, ...]:
    match expression:
        case Number(value):
            return (value,)
        case Negative(operand):
            return _numbers(operand)
        case Binary("**", base, Number(value)) if value.is_integer() and 1 <= value <= MAX_POWER:
            return _numbers(base)
        case Binary(_, left, right):
            return (*_numbers(left), *_numbers(right))
        case Call(_, arguments):
            return tuple(value for argument in arguments for value in _numbers(argument))
    return ()
