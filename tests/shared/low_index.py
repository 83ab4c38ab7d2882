"""Whether a set of equations can be solved without differentiating any: an oracle for minimal sets."""

from collections.abc import Collection

from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import match


def low_index(model: StructuralModel, equations: Collection[int]) -> bool:
    """Say whether a set of equations has index 0 or 1: no equation has to be differentiated to solve it.

    That is so if its algebraic equations determine all rates and all variables that are not stored quantities.
    """
    differential = {equation for equation, _, _ in model.differentials if equation in equations}
    quantities = {quantity for equation, _, quantity in model.differentials if equation in differential}
    rows = [
        [variable for variable in model.equations[equation] if variable not in quantities]
        for equation in sorted(set(equations) - differential)
    ]
    contained = {variable for row in rows for variable in row}
    matched = match(rows, model.n_variables)
    return all(matched[variable] >= 0 for variable in contained)
