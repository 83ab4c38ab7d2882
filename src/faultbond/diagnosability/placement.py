"""Which further sensors make faults detectable, and which make them isolable, by structure alone.

A sensor measures one variable, and so checks the equations from which the variable follows. A fault that is to become
detectable is thus a set of variables of which one has to be measured, and the smallest sets of sensors are the minimal
hitting sets of these. To tell f from g is to detect f without the equation of g.

Source: Krysander and Frisk, Sensor placement for fault diagnosis, IEEE Trans. SMC-A 38 (2008).
"""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import replace
from itertools import combinations, groupby

from faultbond.diagnosability.classes import classes
from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import Equations, holdings, incidence, match, redundant, undetermined
from faultbond.errors import StructureError
from faultbond.sets import minimal_hitting_sets

Sensors = tuple[int, ...]  # the variables measured, ascending; one that is measured twice stands twice
Pair = tuple[int, int]


def sensors_to_detect(
    model: StructuralModel, places: Collection[int] | None = None, *, max_sensors: int | None = None
) -> tuple[Sensors, ...]:
    """Give the smallest sets of sensors that make every fault detectable that sensors at `places` can make so.

    Arguments, order of the sets, errors and source as of `sensors_to_isolate`.

    Raises
    ------
    StructureError
        Where a variable is undetermined.
    """
    free = undetermined(model.equations, model.n_variables, match(model.equations, model.n_variables))
    if free:
        named = ", ".join(model.variable_name(variable) for variable in sorted(free))
        raise StructureError(
            f"sensors are placed in models that determine every variable, but these are open: {named}; "
            "add the equations that fix them"
        )
    allowed = frozenset(range(model.n_variables) if places is None else places)
    checked = redundant(model.equations, match(model.equations, model.n_variables))
    wanted = _measured(model.equations, model.n_variables, set(model.faults) - checked, allowed)
    return _smallest(tuple(sorted(sensors)) for sensors in minimal_hitting_sets(wanted, max_sensors))


def sensors_to_isolate(
    model: StructuralModel,
    places: Collection[int] | None = None,
    *,
    faulty: Collection[int] = (),
    pairs: Iterable[Pair] | None = None,
    max_sensors: int | None = None,
) -> tuple[Sensors, ...]:
    """Give the smallest sets of sensors that make faults detectable and isolable, as far as `places` allow it.

    Parameters
    ----------
    model : structure of the model with the sensors that it has
    places : variables that can be measured; None: all
    faulty : variables whose new sensors can have faults themselves, to be told from all others
    pairs : faults of the model that are to be told apart; None: all
    max_sensors : size of the largest set wanted; None: all sets

    Returns
    -------
    tuple of tuple of int
        Smallest first; no set contains another. The empty set alone: there is nothing to gain.

    Raises
    ------
    StructureError
        Where a variable is undetermined.

    Source
    ------
    Krysander and Frisk 2008: first all sets that make the faults detectable; then for each what is
    to be added. The fault of a sensor added in the second step needs no thought: without the equation of any other
    fault its variable is still determined, so the sensor is checked.
    """
    allowed = frozenset(range(model.n_variables) if places is None else places)
    apart = set(combinations(range(len(model.faults)), 2)) if pairs is None else {(min(p), max(p)) for p in pairs}
    found: list[Sensors] = []
    for first in sensors_to_detect(model, places, max_sensors=max_sensors):
        left = None if max_sensors is None else max_sensors - len(first)
        sensed = replace(  # with an equation for each sensor, and a fault for each sensor that can have one
            model,
            equations=model.equations + tuple((variable,) for variable in first),
            faults=model.faults + tuple(k for k, place in enumerate(first, len(model.equations)) if place in faulty),
            equation_names=(),
            fault_names=(),
        )
        wanted = set(_to_separate(sensed, len(model.faults), apart, allowed))
        found += [tuple(sorted([*first, *more])) for more in minimal_hitting_sets(wanted, left)]
    return _smallest(found)


def _to_separate(
    model: StructuralModel, n_first: int, apart: set[Pair], allowed: frozenset[int]
) -> Iterator[frozenset[int]]:
    """Give for each pair of faults that is still to be separated the variables of which one has to be measured.

    The first `n_first` faults are to be separated as `apart` says, all later ones from each other and from these.
    """
    label = classes(model.equations, match(model.equations, model.n_variables))
    for g, removed in enumerate(model.faults):
        # Only faults of one class are not isolable, and as the relation is symmetric, each pair is taken once.
        equations = {
            equation
            for f, equation in enumerate(model.faults[:g])
            if label[equation] == label[removed] >= 0 and equation != removed and (g >= n_first or (f, g) in apart)
        }
        if equations:
            rows = [*model.equations[:removed], (), *model.equations[removed + 1 :]]
            yield from _measured(rows, model.n_variables, equations, allowed)


def _measured(
    equations: Equations, n_variables: int, wanted: Iterable[int], allowed: frozenset[int]
) -> Iterator[frozenset[int]]:
    """Give for each wanted equation the allowed variables that follow from it; not where there is none.

    The equations are in the just-determined part. A variable follows from an equation if it is determined by it, or by
    one with a variable that follows from it.
    """
    matched = match(equations, n_variables)
    held = holdings(equations, matched)
    containing = incidence(equations, n_variables)
    for start in wanted:
        following = {held[start]}
        queue = [held[start]]
        for variable in queue:
            for equation in containing[variable]:
                if held[equation] not in following:
                    following.add(held[equation])
                    queue.append(held[equation])
        if following & allowed:
            yield frozenset(following & allowed)


def _smallest(sets: Iterable[Sensors]) -> tuple[Sensors, ...]:
    """Give the sets that contain no other, counting sensors of one variable; smallest first."""
    kept: dict[Sensors, frozenset[tuple[int, int]]] = {}  # with each variable numbered as often as it is measured
    shorter: list[frozenset[tuple[int, int]]] = []
    for _, same_size in groupby(sorted(set(sets), key=lambda item: (len(item), item)), key=len):
        for sensors in same_size:
            counted = frozenset((variable, sensors[:k].count(variable)) for k, variable in enumerate(sensors))
            if not any(other <= counted for other in shorter):
                kept[sensors] = counted
        shorter = [*kept.values()]
    return tuple(kept)
