"""The structure of a model on plain integers: which equation contains which unknown, and where a fault enters.

The algorithms of `matching`, `overdetermined`, `isolability` and `placement` work on this and on nothing else.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from faultbond.equations.constraint_network import ConstraintNetwork
from faultbond.errors import StructureError
from faultbond.model.expression import names
from faultbond.model.structure import Structure


@dataclass(frozen=True, slots=True, kw_only=True)
class StructuralModel:
    """Equations as the unknowns they contain. All entries are indices; known signals do not appear.

    equations : for each equation its variables, ascending
    n_variables : variables are 0 .. n_variables - 1
    faults : for each fault the equation that it makes untrue; a fault of several equations is an unknown with an
        equation of its own (`p = p0`), which carries the fault
    differentials : (equation, rate, quantity) of each equation `rate = d quantity / dt`; the equation contains both
    variable_names, equation_names, fault_names : for messages; empty, or one for each
    """

    equations: tuple[tuple[int, ...], ...]
    n_variables: int
    faults: tuple[int, ...] = ()
    differentials: tuple[tuple[int, int, int], ...] = ()
    variable_names: tuple[str, ...] = ()
    equation_names: tuple[str, ...] = ()
    fault_names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Refuse indices that point at nothing; nothing after this looks again."""
        if any(not 0 <= variable < self.n_variables for variables in self.equations for variable in variables):
            raise StructureError(f"an equation contains a variable outside 0 to {self.n_variables - 1}")
        if any(not 0 <= equation < len(self.equations) for equation in self.faults):
            raise StructureError(f"a fault enters an equation outside 0 to {len(self.equations) - 1}")
        for equation, rate, quantity in self.differentials:
            if sorted(self.equations[equation]) != sorted((rate, quantity)):
                raise StructureError(f"equation {equation} is differential, but contains other variables than its two")

    def variable_name(self, variable: int) -> str:
        """Give the name of a variable, for messages."""
        return self.variable_names[variable] if self.variable_names else f"x{variable + 1}"

    def equation_name(self, equation: int) -> str:
        """Give the name of an equation, for messages."""
        return self.equation_names[equation] if self.equation_names else f"e{equation + 1}"


def structural_model(network: ConstraintNetwork, parameters: Sequence[str]) -> StructuralModel:
    """Give the structure of a constraint network, with a fault for each suspect parameter.

    Unknowns are the signals, unknown inputs and the stored quantities. Equations are the constraints, a differential
    equation for each store, and one for each sensor. A parameter of one constraint is a fault of it; a parameter of
    several (of a GY or a TF, say) becomes an unknown with an equation of its own. That could be done for all alike,
    with the same result (an unknown that two equations share is over-determined where both are); this way the structure
    is smaller.

    Raises
    ------
    StructureError
        Where a parameter stands in no constraint and no reading.
    """
    contents = [*(item.residual for item in network.constraints), *network.readings]
    used = [frozenset(names(expression)) for expression in contents]
    places = Counter(name for content in used for name in content)
    shared = tuple(name for name in parameters if places[name] > 1)
    stores = (*network.states, *network.dependent)
    variables = tuple(dict.fromkeys([*network.signals, *(store.name for store in stores), *network.free, *shared]))
    index = {name: k for k, name in enumerate(variables)}
    first_store = len(used)
    own = {name: first_store + len(stores) + k for k, name in enumerate(shared)}
    contained = [*used, *((store.rate, store.name) for store in stores), *((name,) for name in shared)]
    own |= {name: k for k, content in enumerate(used) for name in content if name not in own}
    lost = [name for name in parameters if name not in own]
    if lost:
        raise StructureError(
            f"{lost[0]} stands in no law and no reading, so no fault of it can show; remove it or use it"
        )
    return StructuralModel(
        equations=tuple(tuple(sorted({index[name] for name in content if name in index})) for content in contained),
        n_variables=len(variables),
        faults=tuple(own[name] for name in parameters),
        differentials=tuple((first_store + k, index[item.rate], index[item.name]) for k, item in enumerate(stores)),
        variable_names=variables,
        equation_names=(
            *(item.owner for item in network.constraints),
            *(f"sensor {k + 1}" for k in range(len(network.readings))),
            *(f"d {store.name}/dt" for store in stores),
            *shared,
        ),
        fault_names=tuple(parameters),
    )


def stated_structure(structure: Structure) -> StructuralModel:
    """Give the structure that a model file states, on plain integers.

    A fault of one equation is a fault of it; one of several becomes an unknown with an equation `fault = 0`. Without
    that equation the fault is eliminated, which leaves more to check than without all equations that it enters.
    """
    places = Counter(fault for item in structure.equations for fault in item.faults)
    shared = tuple(fault for fault in structure.faults if places[fault] > 1)
    variables = (*structure.unknowns, *shared)
    index = {name: k for k, name in enumerate(variables)}
    contained: list[tuple[str, ...]] = [
        (*item.unknowns, *(fault for fault in item.faults if fault in shared)) for item in structure.equations
    ]
    own = {fault: k for k, item in enumerate(structure.equations) for fault in item.faults}
    first_rate = len(contained)
    contained += [(item.rate, item.quantity) for item in structure.derivatives]
    own |= {fault: len(contained) + k for k, fault in enumerate(shared)}
    contained += [(fault,) for fault in shared]
    return StructuralModel(
        equations=tuple(tuple(sorted(index[name] for name in content)) for content in contained),
        n_variables=len(variables),
        faults=tuple(own[fault] for fault in structure.faults),
        differentials=tuple(
            (first_rate + k, index[item.rate], index[item.quantity]) for k, item in enumerate(structure.derivatives)
        ),
        variable_names=variables,
        equation_names=(
            *(item.name for item in structure.equations),
            *(item.name for item in structure.derivatives),
            *(f"{fault} = 0" for fault in shared),
        ),
        fault_names=structure.faults,
    )
