"""The cheapest sets of further sensors, by structure, with as much of the search as there is time for.

Where the model determines every variable, sets come from `placement`. Where it leaves some open, as an unknown load, a
sensor may first have to fix what another is then checked against; such sets are tried one after the other.
"""

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from itertools import combinations, count

from faultbond.diagnosability.isolability import Isolability, isolability
from faultbond.diagnosability.placement import Sensors, sensors_to_detect, sensors_to_isolate
from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import match, undetermined

GROWTH = 10.0  # times as long as for the sets before is what sets of one sensor more may take


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSets:
    """Sets of sensors that give all that the possible sensors can give.

    sets : the cheapest first; the empty set alone: there is nothing to gain
    searched : all smallest sets of up to so many sensors are among them
    cheapest : whether no set is cheaper than the first
    """

    sets: tuple[Sensors, ...]
    searched: int
    cheapest: bool


def measured(model: StructuralModel, sensors: Sensors, faulty: Collection[int] = ()) -> StructuralModel:
    """Give a model with an equation for each further sensor, and a fault for each that is of a `faulty` variable."""
    first = len(model.equations)
    faults = tuple(k for k, variable in enumerate(sensors, first) if variable in faulty)
    names = tuple(f"sensor of {model.variable_name(variable)}" for variable in sensors)
    return replace(
        model,
        equations=model.equations + tuple((variable,) for variable in sensors),
        faults=model.faults + faults,
        equation_names=(*model.equation_names, *names) if model.equation_names else (),
        fault_names=(*model.fault_names, *(names[k - first] for k in faults)) if model.fault_names else (),
    )


def sensor_sets(
    model: StructuralModel,
    costs: Mapping[int, float],
    *,
    faulty: Collection[int] = (),
    isolate: bool,
    seconds: float,
) -> SensorSets:
    """Give the smallest sets of sensors that make faults detectable, or isolable too, as far as sensors allow it.

    Parameters
    ----------
    model : structure of the model with the sensors that it has
    costs : of a sensor of each variable that can be measured
    faulty : variables whose new sensors can fail themselves; where the model leaves variables open, these are not
        counted as faults
    isolate : whether faults are to be told apart, too
    seconds : time for the search
    """
    until = time.monotonic() + seconds
    best = isolability(measured(model, tuple(costs)))

    def is_enough(sensors: Sensors) -> bool:
        return _reaches(isolability(measured(model, sensors)), best, isolate=isolate)

    if is_enough(()):
        return SensorSets(sets=((),), searched=0, cheapest=True)
    if undetermined(model.equations, model.n_variables, match(model.equations, model.n_variables)):
        found = _tried(costs, is_enough, until)
    else:
        found = _placed(model, costs, faulty if isolate else (), isolate, until)
    if not found.sets and not (isolate and faulty):  # one set can always be told
        thinned = _thinned(costs, is_enough)
        least = sum(sorted(costs.values())[: found.searched + 1])  # of all that has not been looked at
        found = SensorSets(sets=(thinned,), searched=found.searched, cheapest=cost_of(thinned, costs) <= least)
    return replace(found, sets=tuple(sorted(found.sets, key=lambda item: (cost_of(item, costs), len(item), item))))


def cost_of(sensors: Sensors, costs: Mapping[int, float]) -> float:
    """Give what a set of sensors costs."""
    return sum(costs[variable] for variable in sensors)


def _reaches(found: Isolability, best: Isolability, *, isolate: bool) -> bool:
    """Whether faults are as detectable, and as isolable, as with all sensors."""
    n_faults = len(best.detectable)
    if not isolate:
        return bool((found.detectable[:n_faults] >= best.detectable).all())
    return bool((found.isolable[:n_faults, :n_faults] >= best.isolable).all()) and _reaches(found, best, isolate=False)


def _placed(
    model: StructuralModel, costs: Mapping[int, float], faulty: Collection[int], isolate: bool, until: float
) -> SensorSets:
    """Search sets of a model that determines every variable, of ever more sensors."""
    places = tuple(costs)
    prices = sorted(cost for place, cost in costs.items() for _ in range(1 + (place in faulty)))
    sets: tuple[Sensors, ...] = ()
    for size in count(1):
        begun = time.monotonic()
        if isolate:
            sets = sensors_to_isolate(model, places, faulty=faulty, max_sensors=size)
        else:
            sets = sensors_to_detect(model, places, max_sensors=size)
        least = min((cost_of(item, costs) for item in sets), default=float("inf"))
        if sum(prices[: size + 1]) >= least or size >= len(prices):
            return SensorSets(sets=sets, searched=size, cheapest=True)
        now = time.monotonic()
        if now + GROWTH * (now - begun) > until:
            break
    return SensorSets(sets=sets, searched=size, cheapest=False)


def _tried(costs: Mapping[int, float], is_enough: Callable[[Sensors], bool], until: float) -> SensorSets:
    """Try sets of any model, of ever more sensors; a sensor without which all others are not enough is in each."""
    needed = tuple(place for place in costs if not is_enough(tuple(other for other in costs if other != place)))
    others = [place for place in costs if place not in needed]
    prices = sorted(costs[place] for place in others)
    found: list[Sensors] = []
    for extra in range(len(others) + 1):
        for chosen in combinations(others, extra):
            if time.monotonic() > until:
                return SensorSets(sets=tuple(found), searched=len(needed) + extra - 1, cheapest=False)
            sensors = tuple(sorted((*needed, *chosen)))
            if not any(set(other) <= set(sensors) for other in found) and is_enough(sensors):
                found.append(sensors)
        least = min((cost_of(item, costs) for item in found), default=float("inf"))
        if cost_of(needed, costs) + sum(prices[: extra + 1]) >= least:
            break
    return SensorSets(sets=tuple(found), searched=len(needed) + extra, cheapest=True)


def _thinned(costs: Mapping[int, float], is_enough: Callable[[Sensors], bool]) -> Sensors:
    """Give one set from which no sensor can be left out: all, less one after the other, the dearest first."""
    kept = sorted(costs)
    for place in sorted(costs, key=lambda item: -costs[item]):
        rest = tuple(other for other in kept if other != place)
        if is_enough(rest):
            kept = list(rest)
    return tuple(kept)
