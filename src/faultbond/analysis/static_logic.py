"""Static networks of logic: the smallest sets of blocks that explain every observation since the detection.

However large the smallest sets are, they are given: nothing is solved for, so that `max_faults` is no limit here.
Source: thesis 3.6.
"""

from collections.abc import Iterable, Iterator
from math import isnan

from faultbond.errors import RecordingError
from faultbond.io.grid import GridPoint
from faultbond.model.graph import BondGraph
from faultbond.model.logic import LogicNetwork
from faultbond.runtime.history import Candidate, Detection, Diagnosis
from faultbond.structure.logic import logic_network, minimum_diagnoses, predict


def watch_logic(graph: BondGraph, points: Iterable[GridPoint]) -> Iterator[Detection | Diagnosis]:
    """Give the detection, if any, and one diagnosis for its observation and for each later one.

    Parameters
    ----------
    graph : a static network of logic
    points : its observations in order; those without a reading are passed over

    Raises
    ------
    StructureError
        if the network is not sound, or there are too many diagnoses.
    RecordingError
        if a value is neither 0 nor 1.
    """
    network = logic_network(graph)
    rows: list[dict[str, bool]] = []
    for point in points:
        inputs = _logic(graph, point, [item.name for item in graph.inputs], point.u.tolist())
        readings = _logic(graph, point, [item.name for item in graph.sensors], point.y.tolist())
        if not readings:
            continue
        seen = {**inputs, **readings}
        if not rows:
            if minimum_diagnoses(network, [seen]) == (frozenset(),):
                continue
            signals = _wrong(network, inputs, readings)
            yield Detection(time=point.time, sample=point.index, change_time=point.time, signals=signals)
        rows.append(seen)
        found = minimum_diagnoses(network, rows)
        yield Diagnosis(time=point.time, candidates=_candidates(network, found))


def _logic(graph: BondGraph, point: GridPoint, names: list[str], values: list[float]) -> dict[str, bool]:
    """Give the values that are there."""
    known = {name: value for name, value in zip(names, values, strict=True) if not isnan(value)}
    for name, value in known.items():
        if value not in (0.0, 1.0):
            raise RecordingError(f"{graph.file}: observation {point.index + 1}: {name} is {value:g}, not 0 or 1")
    return {name: value == 1.0 for name, value in known.items()}


def _wrong(network: LogicNetwork, inputs: dict[str, bool], readings: dict[str, bool]) -> tuple[str, ...]:
    """Give the readings that differ from what the healthy network gives; all where that depends on missing inputs."""
    if len(inputs) < len(network.inputs):
        return tuple(readings)
    expected = predict(network, inputs)
    return tuple(name for name, value in readings.items() if value != expected[name])


def _candidates(network: LogicNetwork, found: tuple[frozenset[str], ...]) -> tuple[Candidate, ...]:
    ordered = [tuple(name for name in network.suspects if name in names) for names in found]
    share = 1.0 / max(len(found), 1)
    return tuple(Candidate(suspects=(), blocks=blocks, probability=share, group=True) for blocks in ordered)
