"""Constraint propagation in a static network: what follows from one observation with suspects suspended.

Source: thesis 3.4.1 (propagation, forward and backward) and 3.5.1 (suspension).
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import isnan

from faultbond.equations.inversion import linear_solution
from faultbond.equations.numeric import Real, numeric_value
from faultbond.model.expression import Binary, Name, names
from faultbond.networks.relations import BlockLaw, equation, holds, magnitude, shortened, size
from faultbond.networks.static_network import READING, Observation, StaticNetwork

FOLLOWS = "value of "  # start of a name that no user can write


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagated:
    """What follows from what is known: all known values, equations with unknowns left, and a contradiction if any."""

    known: Mapping[str, Real]
    open: tuple[BlockLaw, ...]
    conflict: BlockLaw | None


def suspend(
    network: StaticNetwork, seen: Observation, suspended: Iterable[str], values: Mapping[str, Real]
) -> Propagated:
    """Give what follows from one observation with suspects suspended.

    A suspended parameter that follows stays unknown, with an equation more that gives its value.

    Parameters
    ----------
    network : the network
    seen : the observation
    suspended : parameters whose values, or blocks whose laws, are not used
    values : values of suspended parameters, where they are to be tried
    """
    blocks = set(suspended) if network.of_blocks else set()
    parameters = set() if network.of_blocks else set(suspended)  # a block may have the name of a parameter
    known = {name: value for name, value in network.values.items() if name not in parameters}
    known.update(seen.values)
    known.update(values)
    laws = [law for law in network.laws if law.block not in blocks]
    found = propagate([*laws, *(item for item in network.readings if item.sensor in seen.sensors)], known)
    own = [] if found.conflict else sorted(parameters & found.known.keys() - values.keys())
    left = {name: value for name, value in found.known.items() if name not in own}
    left.update({FOLLOWS + name: found.known[name] for name in own})
    return replace(found, known=left, open=(*found.open, *(equation(Name(n), Name(FOLLOWS + n)) for n in own)))


def propagate(equations: Iterable[BlockLaw], known: Mapping[str, Real]) -> Propagated:
    """Follow equations with one unknown until none is left, checking those without unknowns."""
    found = dict(known)
    sizes = {name: magnitude(value) for name, value in found.items()}
    waiting = list(equations)
    while True:
        left = []
        for item in waiting:
            unknown = [name for name in item.names if name not in found]
            if not unknown:
                if not holds(item, found, sizes):
                    return Propagated(known=found, open=(), conflict=item)
            elif len(unknown) > 1 or not _follow(item, unknown[0], found, sizes):
                left.append(item)
            elif isnan(found[unknown[0]]):
                return Propagated(known=found, open=(), conflict=item)
        if len(left) == len(waiting):
            return Propagated(known=found, open=tuple(left), conflict=None)
        waiting = left


def _follow(item: BlockLaw, name: str, found: dict[str, Real], sizes: dict[str, float]) -> bool:
    """Add the value of the only unknown of an equation, if the equation gives it directly."""
    sides = ((item.left, item.right), (item.right, item.left))
    direct = next((other for one, other in sides if one == Name(name) and name not in names(other)), None)
    definition = direct or linear_solution(Binary("-", item.left, item.right), name)
    if definition is None:
        return False
    value = shortened(numeric_value(definition, found))
    if isnan(value) and direct is None:
        return False  # the unknown has no influence here, such as a factor of 0
    found[name], sizes[name] = value, size(definition, found, sizes)
    return True


def without_readings(network: StaticNetwork, seen: Observation) -> dict[str, Real]:
    """Give the signals of the healthy network as far as they follow from the inputs alone."""
    inputs = {name: value for name, value in seen.values.items() if not name.startswith(READING)}
    return dict(suspend(network, replace(seen, values=inputs, sensors=()), (), {}).known)
