"""Logic networks over a row of observations: when they contradict the healthy network, and what explains them all.

Source: thesis 3.6; Reiter 1987.
"""

from collections.abc import Iterable, Iterator

from faultbond.model.logic import LogicNetwork, Observation, TimedObservation
from faultbond.runtime.history import Candidate, Detection, Diagnosis
from faultbond.structure.logic import minimum_diagnoses, predict


def watch_logic(network: LogicNetwork, observations: Iterable[TimedObservation]) -> Iterator[Detection | Diagnosis]:
    """Give the detection, if any, and one diagnosis for its observation and for each later one.

    A diagnosis holds all sets of the smallest size that explain every observation from the detection on; they are
    equally probable and one group.

    Raises
    ------
    StructureError
        When the network is not sound, or the diagnoses cannot be found in time.
    """
    rows: dict[tuple[tuple[str, bool], ...], Observation] = {}
    candidates: tuple[Candidate, ...] = ()
    for sample, seen in enumerate(observations):
        if not rows:
            signals = contradicting(network, seen.values)
            if not signals:
                continue
            yield Detection(time=seen.time, sample=sample, change_time=seen.time, signals=signals)
        key = tuple(sorted(seen.values.items()))
        if key not in rows:  # a row seen before says nothing new
            rows[key] = seen.values
            candidates = _candidates(network, tuple(rows.values()))
        yield Diagnosis(time=seen.time, candidates=candidates)


def contradicting(network: LogicNetwork, seen: Observation) -> tuple[str, ...]:
    """Give the observed signals that are not as the healthy network makes them; all of them where inputs are unknown.

    With unknown inputs an observation contradicts the network only if no inputs make it.
    """
    observed = tuple(name for name in seen if name not in network.inputs)
    if all(name in seen for name in network.inputs):
        expected = predict(network, seen)
        return tuple(name for name in observed if expected[name] != seen[name])
    return () if minimum_diagnoses(network, [seen]) == (frozenset(),) else observed


def _candidates(network: LogicNetwork, rows: tuple[Observation, ...]) -> tuple[Candidate, ...]:
    found = minimum_diagnoses(network, rows)
    order = {name: k for k, name in enumerate(network.suspects)}
    return tuple(
        Candidate(
            suspects=(),
            blocks=tuple(sorted(diagnosis, key=order.__getitem__)),
            probability=1.0 / len(found),
            group=True,
        )
        for diagnosis in found
    )
