"""Networks of logic: the smallest sets of blocks or gates that explain every observation since the detection.

However large the smallest sets are, they are given: nothing is solved for, so that `max_faults` is no limit here.
Source: thesis 3.6; Reiter 1987.
"""

from collections.abc import Iterable, Iterator
from math import isnan

from faultbond.contract.findings import Candidate, Detection, Diagnosis
from faultbond.errors import RecordingError
from faultbond.io.grid import GridPoint
from faultbond.model.graph import BondGraph
from faultbond.model.logic import LogicNetwork, SignalValues, TimedObservation
from faultbond.networks.logic.diagnoses import minimum_diagnoses, predict


def watch_logic(network: LogicNetwork, observations: Iterable[TimedObservation]) -> Iterator[Detection | Diagnosis]:
    """Give the detection, if any, and one diagnosis for its observation and for each later one.

    A diagnosis holds all sets of the smallest size that explain every observation from the detection on; they are
    equally probable and one group.

    Raises
    ------
    StructureError
        if the network is not sound, or the diagnoses are too many or cannot be found in time.
    """
    rows: dict[tuple[tuple[str, bool], ...], SignalValues] = {}
    candidates: tuple[Candidate, ...] = ()
    order = {name: k for k, name in enumerate(network.suspects)}
    for sample, seen in enumerate(observations):
        if not rows:
            signals = _contradicting(network, seen.values)
            if not signals:
                continue
            yield Detection(time=seen.time, sample=sample, change_time=seen.time, signals=signals)
        key = tuple(sorted(seen.values.items()))
        if key not in rows:  # a row seen before says nothing new
            rows[key] = seen.values
            found = minimum_diagnoses(network, rows.values())
            candidates = tuple(
                Candidate(
                    suspects=(),
                    blocks=tuple(sorted(diagnosis, key=order.__getitem__)),
                    probability=1.0 / len(found),
                    group=True,
                )
                for diagnosis in found
            )
        yield Diagnosis(time=seen.time, candidates=candidates)


def _contradicting(network: LogicNetwork, seen: SignalValues) -> tuple[str, ...]:
    """Give the observed signals that are not as the healthy network makes them; none where it can make them.

    With unknown inputs an observation contradicts the network only if no inputs make it; all signals are given then.
    """
    observed = tuple(name for name in seen if name not in network.inputs)
    if all(name in seen for name in network.inputs):
        expected = predict(network, seen)
        return tuple(name for name in observed if expected[name] != seen[name])
    return () if minimum_diagnoses(network, [seen]) == (frozenset(),) else observed


def logic_observations(graph: BondGraph, points: Iterable[GridPoint]) -> Iterator[TimedObservation]:
    """Give the rows of a model of logic as truth values; a value that is missing is not known.

    Raises
    ------
    RecordingError
        if a value is neither 0 nor 1.
    """
    names = [*(item.name for item in graph.inputs), *(item.name for item in graph.sensors)]
    for point in points:
        pairs = zip(names, (*point.u.tolist(), *point.y.tolist()), strict=True)
        known = {name: value for name, value in pairs if not isnan(value)}
        for name, value in known.items():
            if value not in (0.0, 1.0):
                raise RecordingError(
                    f"{graph.file}: row {point.index}: {name} is {value:g}; expected 0 or 1, or nothing"
                )
        yield TimedObservation(time=point.time, values={name: value == 1.0 for name, value in known.items()})
