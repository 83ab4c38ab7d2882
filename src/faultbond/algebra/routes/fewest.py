"""The route that passes through the fewest components, by integer programming.

Unknowns: which equations are used, which unknowns are needed, and by which used equation each needed one is found. All
unknowns of a used equation are needed, a needed one is found by one used equation, a used equation finds one. Targets
are needed. The question put is whether fewer parts of the plant are enough than in the route by matching. Ours; the
thesis reaches the same by following every route (A.2.1), which explodes; this one is checked against it.
"""

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import csr_array, eye_array

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes.matched import fewest_frames, route_of, shorten
from faultbond.algebra.routes.unroll import check_question, in_words
from faultbond.equations.component_network import ComponentNetwork
from faultbond.equations.matching import closure, match, undetermined
from faultbond.errors import StructureError

TIME_LIMIT = 10.0  # seconds
_OPTIMAL, _INFEASIBLE = 0, 2  # status of a solution


def fewest_components(network: ComponentNetwork, question: Question, time_limit: float = TIME_LIMIT) -> Route:
    """Give, of the routes with the fewest frames, one that passes through the fewest components.

    This is the route of `routes.find_route` in any direction, unless there is one with fewer components.

    Raises
    ------
    StructureError
        Where there is no route, or where none is shown to be the shortest within `time_limit` seconds.
    """
    check_question(network, question)
    found = fewest_frames(network, question)
    matched = shorten(found)
    if not found.n_targets:
        return route_of(network, question, found, matched)
    unrolled = found.unrolled
    free = undetermined(unrolled.equations, len(unrolled.unknowns), matched)
    usable = [e for e, row in enumerate(unrolled.equations) if row and free.isdisjoint(row)]
    weights = np.array([float(unrolled.weights[e]) for e in usable])
    needed = closure(found.targets, unrolled.equations, matched)[0]
    known = sum(unrolled.weights[e] for e in needed)
    rows = [unrolled.equations[e] for e in usable]
    # Columns: equation used; unknown wanted; equation finds unknown, for each that it contains.
    n, n_unknowns = len(rows), len(unrolled.unknowns)
    edges = [(e, v) for e, row in enumerate(rows) for v in row]
    ends = np.array(edges)
    k = np.arange(len(edges))
    used, wanted, finds = ends[:, 0], n + ends[:, 1], n + n_unknowns + k
    size = n + n_unknowns + len(edges)
    ones = np.ones(len(edges))
    each_finds = csr_array((ones, (used, finds)), shape=(n, size)) - eye_array(n, size)
    each_found = csr_array((ones, (ends[:, 1], finds)), shape=(n_unknowns, size)) - eye_array(n_unknowns, size, k=n)
    pairs = (np.concatenate([k, k]), np.concatenate([wanted, used]))
    all_wanted = csr_array((np.concatenate([ones, -ones]), pairs), shape=(len(edges), size))
    lower = np.zeros(size)
    lower[n + np.array(found.targets)] = 1.0
    weight = np.concatenate([weights, np.zeros(size - n)])
    result = milp(
        weight,
        constraints=(
            LinearConstraint(each_finds, 0, 0),
            LinearConstraint(each_found, 0, 0),
            LinearConstraint(all_wanted, 0, 1),
            LinearConstraint(weight[None, :], -np.inf, known - 0.5),
        ),
        bounds=Bounds(lower, np.ones(size)),
        integrality=np.arange(size) < n,  # with whole equations used, the other columns can be taken whole
        options={"time_limit": time_limit},
    )
    if result.status not in (_OPTIMAL, _INFEASIBLE):
        sought = ", ".join(in_words(target) for target in question.targets)
        raise StructureError(
            f"{network.file}: {sought}: no route is shown to be the shortest within {time_limit:g} s; "
            f"use the default route, of {len(needed)} equations, or allow more time"
        )
    if result.status == _OPTIMAL:
        chosen = {e for k, e in enumerate(usable) if result.x[k] > 0.5}
        matched = match([row if e in chosen else () for e, row in enumerate(unrolled.equations)], len(matched))
    return route_of(network, question, found, matched)
