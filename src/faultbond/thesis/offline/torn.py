"""Functions without a closed form: the same equations, torn, for Newton's method beside the plant.

Of the unknowns of a block that must be solved together a few are guessed, the others follow from them one by one, and
as many equations are left over, whose misfits are zero at the right guess. Source: Elmqvist and Otter 1994 (tearing).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, combinations, islice

from faultbond.algebra.route import Route
from faultbond.algebra.solving.backward_euler import NumericPlant
from faultbond.algebra.solving.problem import Block, prepare, trials_of
from faultbond.algebra.solving.solution import Line
from faultbond.equations.component_network import ComponentNetwork
from faultbond.equations.inversion import isolate
from faultbond.errors import StructureError
from faultbond.model.expression import Call, Expression, names, walk
from faultbond.thesis.online.tape import OPERATIONS

MOST_GUESSED = 3  # unknowns of a block that are guessed
_MOST_TRIED = 401  # choices of them


@dataclass(frozen=True, slots=True, kw_only=True)
class Torn:
    """How targets follow: `guessed` unknowns and where they are about, lines one by one, and what must be zero.

    misfits: names of the lines that must be zero, as many as there are guesses.
    """

    guessed: tuple[str, ...]
    about: tuple[float, ...]
    lines: tuple[Line, ...]
    misfits: tuple[str, ...]


def tear(network: ComponentNetwork, route: Route, plant: NumericPlant, prefer: Sequence[str]) -> Torn:
    """Tear the equations of a route.

    Parameters
    ----------
    network, route, plant : what follows from what, and the nominal numbers
    prefer : names that are guessed rather than others, since it is known where they are about

    Raises
    ------
    StructureError
        Where more than a few unknowns would have to be guessed, or the nominal plant has no values to begin with.
    """
    problem = prepare(network, route, plant)
    records, _ = trials_of(network, problem, plant)
    if not records:
        raise StructureError(
            f"{network.file}: the nominal plant cannot be computed where {route.question.title} is sought"
        )
    guessed: list[str] = []
    lines: list[Line] = []
    misfits: list[str] = []
    for block in problem.blocks:
        order = sorted(block.unknown, key=lambda name: name not in prefer)
        sizes = range(min(MOST_GUESSED, len(order)) + 1)
        choices = islice(chain.from_iterable(combinations(order, size) for size in sizes), _MOST_TRIED)
        tried = ((chosen, _follow(block, chosen)) for chosen in choices)
        found = next(((chosen, *followed) for chosen, followed in tried if followed is not None), None)
        if found is None:
            raise StructureError(
                f"{network.file}: {route.question.title} takes {len(block.unknown)} equations at once that neither a "
                "closed form nor a few guesses solve; take method `bank`"
            )
        chosen, steps, left = found
        guessed += chosen
        lines += steps
        for residual in left:
            misfits.append(f"misfit {len(misfits)}")
            lines.append(Line(name=misfits[-1], value=residual))
    about = tuple(float(records[0].true[name]) for name in guessed)
    return Torn(guessed=tuple(guessed), about=about, lines=tuple(lines), misfits=tuple(misfits))


def _follow(block: Block, chosen: Sequence[str]) -> tuple[list[Line], list[Expression]] | None:
    """Solve equation after equation for the one unknown that is left in it; None where that comes to a stop."""
    open_ = [name for name in block.unknown if name not in chosen]
    left = list(block.residuals)
    lines: list[Line] = []
    while open_:
        for residual in left:
            unknown = [name for name in names(residual) if name in open_]
            value = isolate(residual, unknown[0]) if len(unknown) == 1 else None
            calls = (part for part in walk(value) if isinstance(part, Call)) if value is not None else ()
            if value is not None and all(part.function in OPERATIONS for part in calls):
                left.remove(residual)
                open_.remove(unknown[0])
                lines.append(Line(name=unknown[0], value=value))
                break
        else:
            return None
    return lines, left
