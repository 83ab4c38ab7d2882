"""The route that passes through the fewest components, by integer programming.

Unknowns: which equations are used, which unknowns are needed, and by which used equation each needed one is found. All
unknowns of a used equation are needed, a needed one is found by one used equation, a used equation finds one. Targets
are needed; the number of parts of the plant passed through is least. Ours; the thesis reaches the same by following
every route (A.2.1), which explodes; this one is checked against it.
"""

from collections.abc import Sequence

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, OptimizeResult, milp
from scipy.sparse import csr_array, eye_array

from faultbond.errors import StructureError
from faultbond.structure.components import ComponentNetwork
from faultbond.structure.matching import closure, match, undetermined
from faultbond.structure.route import Question, Route
from faultbond.structure.routes import Frames, fewest_frames, route_of, shorten
from faultbond.structure.unroll import check_question, in_words

TIME_LIMIT = 10.0  # seconds
_SMALL = 1e-3  # weight of a sensor, so that none is used without need


def fewest_components(network: ComponentNetwork, question: Question, time_limit: float = TIME_LIMIT) -> Route:
    """Give, of the routes with the fewest frames, one that passes through the fewest components.

    Raises
    ------
    StructureError
        Where there is no route, or where none is shown to be the shortest within `time_limit` seconds.
    """
    check_question(network, question)
    found = fewest_frames(network, question)
    if not found.n_targets:
        return route_of(network, question, found, found.matched)
    chosen = _choose(found, time_limit)
    if chosen is None:
        sought = ", ".join(in_words(target) for target in question.targets)
        n = len(closure(found.targets, found.unrolled.equations, shorten(found))[0])
        raise StructureError(
            f"{network.file}: {sought}: no route is shown to be the shortest within {time_limit:g} s; "
            f"use the default route, of {n} equations, or allow more time"
        )
    rows = [row if e in chosen else () for e, row in enumerate(found.unrolled.equations)]
    return route_of(network, question, found, match(rows, len(found.unrolled.unknowns)))


def _choose(found: Frames, time_limit: float) -> frozenset[int] | None:
    """Give the equations to use; None where time is too short."""
    unrolled = found.unrolled
    free = undetermined(unrolled.equations, len(unrolled.unknowns), found.matched)
    usable = [e for e, row in enumerate(unrolled.equations) if row and free.isdisjoint(row)]
    rows = [unrolled.equations[e] for e in usable]
    weights = np.array([max(float(unrolled.weights[e]), _SMALL) for e in usable])
    result = _solve(rows, len(unrolled.unknowns), found.targets, weights, time_limit)
    if result.x is None or result.status != 0:
        return None
    return frozenset(e for k, e in enumerate(usable) if result.x[k] > 0.5)


def _solve(
    rows: Sequence[Sequence[int]],
    n_unknowns: int,
    targets: Sequence[int],
    weights: np.ndarray,
    time_limit: float,
) -> OptimizeResult:
    """Columns: equation used; unknown needed; equation finds unknown, for each that it contains."""
    n = len(rows)
    edges = [(e, v) for e, row in enumerate(rows) for v in row]
    ends = np.array(edges)
    k = np.arange(len(edges))
    used, needed, finds = ends[:, 0], n + ends[:, 1], n + n_unknowns + k
    size = n + n_unknowns + len(edges)
    ones = np.ones(len(edges))
    each_finds = csr_array((ones, (used, finds)), shape=(n, size)) - eye_array(n, size)
    each_found = csr_array((ones, (ends[:, 1], finds)), shape=(n_unknowns, size)) - eye_array(n_unknowns, size, k=n)
    pairs = (np.concatenate([k, k]), np.concatenate([needed, used]))
    all_needed = csr_array((np.concatenate([ones, -ones]), pairs), shape=(len(edges), size))
    lower = np.zeros(size)
    lower[n + np.array(targets)] = 1.0
    cost = np.concatenate([weights, np.zeros(size - n)])
    return milp(
        cost,
        constraints=(
            LinearConstraint(each_finds, 0, 0),
            LinearConstraint(each_found, 0, 0),
            LinearConstraint(all_needed, 0, 1),
        ),
        bounds=Bounds(lower, np.ones(size)),
        integrality=np.concatenate([np.ones(n + n_unknowns), np.zeros(len(edges))]),
        options={"time_limit": time_limit},
    )
