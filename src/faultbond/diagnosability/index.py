"""The differential index by structure: how often equations have to be differentiated before they can be solved.

Source: Pantelides, The consistent initialization of differential-algebraic systems, SIAM J. Sci. Stat. Comput. 9
(1988).
"""

from collections.abc import Collection

from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import match, redundant
from faultbond.errors import StructureError


def structural_index(model: StructuralModel) -> tuple[int, tuple[int, ...]]:
    """Give the structural index of a model with as many equations as variables, and how often each is differentiated.

    Raises
    ------
    StructureError
        Where the equations do not determine each variable, or some are left over.

    Source
    ------
    Pantelides 1988; here all unmatched equations of a round are differentiated at once. The index is the largest number
    of differentiations, and one more where a variable then still occurs without a derivative (an algebraic variable).
    """
    matched = match(model.equations, model.n_variables)
    if -1 in matched or len(model.equations) != model.n_variables:
        raise StructureError(
            f"an index needs as many equations as variables, each determined; these are {len(model.equations)} "
            f"equations in {model.n_variables} variables, of which {sum(k >= 0 for k in matched)} are determined"
        )
    # orders: for each equation, its variables and their derivatives; `rate = d quantity / dt` contains a first one
    quantity_of = {equation: quantity for equation, _, quantity in model.differentials}
    orders = [{v: int(quantity_of.get(e) == v) for v in variables} for e, variables in enumerate(model.equations)]
    times = [0] * len(orders)  # how often each equation is differentiated
    while True:
        highest = [0] * model.n_variables
        for equation, row in enumerate(orders):
            for variable, order in row.items():
                highest[variable] = max(highest[variable], order + times[equation])
        leading = [[v for v, order in row.items() if order + times[e] == highest[v]] for e, row in enumerate(orders)]
        matched = match(leading, model.n_variables)
        if -1 not in matched:
            return max(times, default=0) + (0 in highest), tuple(times)
        for equation in redundant(leading, matched):
            times[equation] += 1


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
