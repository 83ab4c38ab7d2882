"""How inputs and sensors come behind, what an input is between rows, and when the model and its sensors hold."""

from collections.abc import Iterator

from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph, Input, Sensor
from faultbond.model.parser import to_text
from faultbond.report.numbers import duration_text, figure, unit_text
from faultbond.types import Hold, TimeGrid


def validity_lines(graph: BondGraph) -> Iterator[tuple[str, str]]:
    """Say when the model and its sensors hold, where that is stated."""
    stated = [("the model", graph.valid_when), *((item.name, item.valid_when) for item in graph.sensors)]
    for name, item in stated:
        if item is not None:
            settled = f", and has been for {duration_text(item.settling)}" if item.settling else ""
            yield "valid when", f"{name}: {to_text(item.condition)}{settled}"


def lag_lines(graph: BondGraph, spec: EngineSpec) -> Iterator[tuple[str, str]]:
    """Give the lags of inputs and sensors, and what to do where the model has none that the plant has."""
    linear = [item.name for item in graph.inputs if item.linear]
    if linear:
        yield "linear", f"{', '.join(linear)}: from row to row"
    early = [item.name for item in graph.inputs if item.hold is Hold.NEXT]
    if early:
        yield "hold", f"{', '.join(early)}: as in the next row"
    lagging = [item for item in graph.instruments if item.lag]
    if lagging:
        yield "lag", ", ".join(_lag(graph, item) for item in lagging)
    direct = {k for item in spec.outputs for k in item.direct_inputs if not spec.inputs[k].settling}
    felt = {k for item in spec.outputs for k in item.direct_inputs}
    idle = [item for k, item in enumerate(graph.inputs) if item.settling and k not in felt]
    for lags, why in ((False, "so that it does nothing; state a `lag`"), (True, "or but for a lag: it does nothing")):
        if still := ", ".join(item.name for item in idle if bool(item.lag) is lags):
            yield "settling", f"{still}: no sensor feels it at once, {why}"
    if direct and graph.grid is not TimeGrid.NONE:
        names = ", ".join(item.name for k, item in enumerate(graph.inputs) if k in direct)
        yield "felt at once", f"{names}: if it takes time to act, or a sensor to follow, state its `lag`"


def _lag(graph: BondGraph, item: Input | Sensor) -> str:
    """Give how an input or a sensor comes behind: `u 8 s in 3 stages, at 2 percent/s at most`."""
    stages = f" in {item.order} stages" if item.order > 1 else ""
    words = f"{item.name} {duration_text(graph.parameter(item.lag).nominal)}{stages}"
    if not isinstance(item, Input) or not item.rate_limit:
        return words
    limit = graph.parameter(item.rate_limit)
    size = figure(limit.unit.from_si(limit.nominal)).number()
    return f"{words}, at {size} {unit_text(limit.unit.text)} at most"
