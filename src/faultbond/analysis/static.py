"""Static networks: detection at the first observation that contradicts the healthy network, then minimal diagnoses.

Diagnoses are sets of parameters whose changed, constant values explain every observation since the detection, or,
in a network without suspected parameters, sets of blocks whose suspension makes every observation consistent. Given
are all of minimum size. Source: thesis 3.4 to 3.8, 6.1 and 6.4.1.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import inf
from typing import Protocol

from faultbond.analysis import static_fit, static_noise
from faultbond.analysis.static_hypothesis import Hypothesis, advance, is_consistent
from faultbond.analysis.static_network import (
    Observation,
    StaticNetwork,
    holds,
    magnitude,
    observation,
    static_network,
    without_readings,
)
from faultbond.analysis.static_solve import value_of
from faultbond.io.grid import GridPoint
from faultbond.model.graph import BondGraph
from faultbond.runtime.history import Candidate, Detection, Diagnosis, Suspect

Solution = Mapping[str, tuple[float, float]]  # value and standard deviation by parameter; inf: not determined


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """Suspects that explain the observations, with every solution for their parameters; of blocks, no parameter."""

    suspects: tuple[str, ...]
    solutions: tuple[Solution, ...]


class Prover(Protocol):
    """Tells which observations contradict the healthy network, and what explains all since the detection."""

    def contradicting(self, seen: Observation) -> tuple[str, ...]:
        """Give the sensors that disagree; none where the observation agrees with the healthy network."""

    def explanations(self, rows: Sequence[Observation]) -> tuple[Explanation, ...]:
        """Give all explanations of least size; asked once for each row, the last of `rows`."""


def watch(graph: BondGraph, points: Iterable[GridPoint]) -> Iterator[Detection | Diagnosis]:
    """Give the detection, if any, and one diagnosis for its observation and for each later one.

    Observations without a reading are passed over.

    Parameters
    ----------
    graph : a static network of numbers
    points : its observations in order

    Raises
    ------
    StructureError
        if the model is no static network of numbers, or nothing in it is suspected.
    """
    network = static_network(graph)
    prover: Prover = NoisyProver(network) if network.is_noisy else ExactProver(network)
    rows: list[Observation] = []
    for point in points:
        seen = observation(network, point)
        if not seen.sensors:
            continue
        if not rows:
            signals = prover.contradicting(seen)
            if not signals:
                continue
            yield Detection(time=seen.time, sample=seen.index, change_time=seen.time, signals=signals)
        rows.append(seen)
        yield Diagnosis(time=seen.time, candidates=candidates(network, prover.explanations(rows)))


class ExactProver:
    """Of a network without noise: numbers agree or do not."""

    def __init__(self, network: StaticNetwork) -> None:
        self.network = network
        self.size = 0
        self.left: tuple[Hypothesis, ...] = ()

    def contradicting(self, seen: Observation) -> tuple[str, ...]:
        """Give the sensors that disagree; none where the observation agrees with the healthy network."""
        network = self.network
        if is_consistent(network, (), seen):
            return ()
        known = {**without_readings(network, seen), **seen.values}
        sizes = {name: magnitude(value) for name, value in known.items()}
        readings = [item for item in network.equations if item.sensor in seen.sensors and known.keys() >= {*item.names}]
        wrong = tuple(item.sensor for item in readings if not holds(item, known, sizes))
        return wrong or seen.sensors

    def explanations(self, rows: Sequence[Observation]) -> tuple[Explanation, ...]:
        """Give all explanations of least size; what was rejected stays so, and sizes only grow."""
        network = self.network
        self.left = _possible(advance(network, item, rows) for item in self.left)
        while not self.left and self.size < min(network.graph.max_faults, len(network.suspects)):
            self.size += 1
            tested = combinations(network.suspects, self.size)
            self.left = _possible(_from_the_first(network, suspects, rows) for suspects in tested)
        return tuple(_explanation(network, item) for item in self.left)


def _possible(hypotheses: Iterable[Hypothesis]) -> tuple[Hypothesis, ...]:
    return tuple(item for item in hypotheses if item.is_possible)


def _from_the_first(network: StaticNetwork, suspects: tuple[str, ...], rows: Sequence[Observation]) -> Hypothesis:
    held = Hypothesis(suspects=suspects)
    for count in range(1, len(rows) + 1):
        held = advance(network, held, rows[:count])
        if not held.is_possible:
            break
    return held


def _explanation(network: StaticNetwork, held: Hypothesis) -> Explanation:
    if network.of_blocks:
        return Explanation(suspects=held.suspects, solutions=({},))
    points = [(point, 0.0) for point in held.points] + ([(held.nearest, inf)] if held.nearest is not None else [])
    return Explanation(
        suspects=held.suspects,
        solutions=tuple({name: (float(value_of(point[name])), sd) for name in held.suspects} for point, sd in points),
    )


class NoisyProver:
    """Of a network with noise: the misfit is as noise makes it, or is larger."""

    def __init__(self, network: StaticNetwork) -> None:
        self.network = network
        self.healthy = static_fit.reader(network, ())
        self.trials: dict[tuple[str, ...], static_noise.Trial] = {}

    def contradicting(self, seen: Observation) -> tuple[str, ...]:
        """Give the sensors that disagree beyond their noise."""
        sensors = [item.name for item in self.network.graph.sensors]
        return static_fit.contradicting(self.healthy, sensors, static_fit.data_of(self.network, [seen]))

    def explanations(self, rows: Sequence[Observation]) -> tuple[Explanation, ...]:
        """Give all explanations of least size whose misfit passes."""
        self.trials = static_noise.trials(self.network, self.trials, rows)
        return tuple(self._explanation(item) for item in static_noise.left(self.trials))

    def _explanation(self, trial: static_noise.Trial) -> Explanation:
        names = () if self.network.of_blocks else trial.suspects
        solutions = ({n: (float(fit.values[k]), float(fit.sd[k])) for k, n in enumerate(names)} for fit in trial.fits)
        return Explanation(suspects=trial.suspects, solutions=tuple(solutions))


def candidates(network: StaticNetwork, found: Sequence[Explanation]) -> tuple[Candidate, ...]:
    """Give a candidate for each solution: sets of one size are equally likely, and so are the solutions of a set."""
    return tuple(
        Candidate(
            suspects=tuple(_suspect(network, name, *solution[name]) for name in solution),
            blocks=() if solution else item.suspects,
            probability=1.0 / len(found) / len(item.solutions),
            group=True,
        )
        for item in found
        for solution in sorted(item.solutions, key=lambda solution: _distance(network, solution))
    )


def _distance(network: StaticNetwork, solution: Solution) -> float:
    """How far a solution is from the nominal values."""
    parts = [(value, network.graph.parameter(name)) for name, (value, _) in solution.items()]
    return sum(((value - item.nominal) / item.scale) ** 2 for value, item in parts)


def _suspect(network: StaticNetwork, name: str, estimate: float, sd: float) -> Suspect:
    item = network.graph.parameter(name)
    return Suspect(parameter=name, component=item.owner, nominal=item.nominal, estimate=estimate, sd=sd)
