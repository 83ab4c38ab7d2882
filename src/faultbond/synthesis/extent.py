"""How much a generated monitor tests: all hypotheses of a model, as many as fit in some filters, or none."""

from dataclasses import replace

from faultbond.contract.couples import PER_COUPLE, n_coupled
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.reserve import PER_SET, n_grown
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec
from faultbond.errors import FaultbondError, GenerationError


def narrowed(spec: EngineSpec, *, lanes_at_most: int | None, alarms_only: bool) -> EngineSpec:
    """Give a specification that tests what is wanted.

    Parameters
    ----------
    spec : it tests all hypotheses
    lanes_at_most : no more hypotheses are tested than fit in so many filters; None: all are
    alarms_only : whether alarms are raised, and no fault is named

    Raises
    ------
    FaultbondError
        Where both are wanted, or there is no room for the single faults.
    """
    if alarms_only and lanes_at_most is not None:
        raise FaultbondError("--watch-only has no filters for hypotheses: give it, or --lanes-at-most.")
    if alarms_only:
        return watch_only(spec)
    return spec if lanes_at_most is None else with_lanes(spec, lanes_at_most)


def watch_only(spec: EngineSpec) -> EngineSpec:
    """Give a specification that raises alarms and names no fault."""
    outputs = tuple(replace(item, suspect=False) for item in spec.outputs)
    inputs = tuple(replace(item, suspect=False) for item in spec.inputs)
    return replace(spec, hypotheses=(), reserve=(), coupled=False, outputs=outputs, inputs=inputs)


def count_lanes(spec: EngineSpec) -> int:
    """Give how many filters test the hypotheses after an alarm."""
    return (
        plan_lanes(spec).n_lanes
        + PER_SET * n_grown(spec)
        + plan_slots(spec).n_lanes
        + PER_COUPLE * sum(n_coupled(spec))
    )


def with_lanes(spec: EngineSpec, most: int) -> EngineSpec:
    """Give a specification that tests no more than fits in so many lanes, the sets of the lowest cost first.

    Single faults come first, then pairs and larger sets in order. What does not fit waits in reserve, with the few
    lanes that this takes, and what is said tells how likely it is that the fault is among it. Two faults of different
    kinds are tested only where all fit.

    Raises
    ------
    GenerationError
        Where there is no room for the single faults.
    """
    if count_lanes(spec) <= most:
        return spec
    sets = sorted(spec.hypotheses, key=len)  # keeps their order where they are as large
    least = len(sets[0]) if sets else 0
    low, high = sum(len(chosen) == least for chosen in sets), len(sets)

    def of(count: int) -> EngineSpec:
        waiting = (*sets[count:], *spec.reserve)
        return replace(spec, hypotheses=tuple(sets[:count]), reserve=waiting, coupled=False)

    needed = count_lanes(of(low))
    if needed > most:
        raise GenerationError(
            f"--lanes-at-most {most}: the single faults of {spec.model}, with the likeliest of the others, need "
            f"{needed} lanes; give {needed} or more, or --watch-only"
        )
    while low < high:
        middle = (low + high + 1) // 2
        if count_lanes(of(middle)) <= most:
            low = middle
        else:
            high = middle - 1
    return of(low)
