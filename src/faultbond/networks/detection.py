"""Static networks: detection at the first observation that contradicts the healthy network, then minimal diagnoses.

Diagnoses are sets of parameters whose changed, constant values explain every observation since the detection, or,
in a network without suspected parameters, sets of blocks whose suspension makes every observation consistent. Given
are all of minimum size. Source: thesis 3.4 to 3.8, 6.1 and 6.4.1.
"""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from math import inf

import numpy as np

from faultbond.contract.findings import Candidate, Detection, Diagnosis, Suspect
from faultbond.io.grid import GridPoint
from faultbond.model.graph import BondGraph
from faultbond.networks.hypothesis import Hypothesis, advance, is_consistent, some_solutions
from faultbond.networks.least_squares import DETECTED, Data, data_of, limit, readable, whitened
from faultbond.networks.logic.diagnoses import logic_network
from faultbond.networks.logic.hypotheses import logic_observations, watch_logic
from faultbond.networks.noise_hypotheses import FittedHypothesis, left, trials
from faultbond.networks.polynomial_roots import value_of
from faultbond.networks.static_network import (
    Observation,
    StaticNetwork,
    conflicts,
    healthy_of,
    observation,
    static_network,
    with_healthy,
    wrong_readings,
)

_SURELY = 1e-10  # relative: closer than the tolerance by what floating point may add

Estimates = Mapping[str, tuple[float, float]]  # value and standard deviation by parameter; inf: not determined


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Explanation:
    """Suspects that explain the observations, with every solution for their parameters; of blocks, no parameter."""

    suspects: tuple[str, ...]
    solutions: tuple[Estimates, ...]


def watch(graph: BondGraph, points: Iterable[GridPoint]) -> Iterator[Detection | Diagnosis]:
    """Give the detection, if any, and one diagnosis for its observation and for each later one.

    Observations without a reading are passed over.

    Parameters
    ----------
    graph : a static network, of numbers or of logic
    points : its observations in order

    Raises
    ------
    StructureError
        if the model is no static network, or nothing in it is suspected; with noise, if a signal does not follow.
    """
    if graph.is_logic:
        yield from watch_logic(logic_network(graph), logic_observations(graph, points))
        return
    network = static_network(graph)
    prover = NoisyProver(network) if network.is_noisy else ExactProver(network)
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
        rows.append(with_healthy(network, seen))
        yield Diagnosis(time=seen.time, candidates=candidates(network, prover.explanations(rows)))


class ExactProver:
    """Of a network without noise: numbers agree or do not."""

    def __init__(self, network: StaticNetwork) -> None:
        self.network = network
        self.size = 0
        self.left: tuple[Hypothesis, ...] = ()
        self.conflicts: set[frozenset[str]] = set()

    def contradicting(self, seen: Observation) -> tuple[str, ...]:
        """Give the sensors that disagree; none where the observation agrees with the healthy network."""
        network = self.network
        if self._agrees_quickly(seen) or is_consistent(network, (), seen):
            return ()
        wrong = wrong_readings(network, seen, healthy_of(network, seen))
        return tuple(item.sensor for item in wrong) or seen.sensors

    def _agrees_quickly(self, seen: Observation) -> bool:
        """Whether floating point is enough to see that an observation agrees."""
        if self.network.reader is None:
            return False
        data = data_of(self.network, [seen])
        y, _, _ = self.network.reader(self.network.reader.nominal, data.u)
        there = np.isfinite(data.y)
        if not np.isfinite(y[there]).all():
            return False
        near = np.abs(y - data.y) <= _SURELY * np.maximum(np.abs(y), np.abs(data.y))
        return bool(near[there].all())

    def explanations(self, rows: Sequence[Observation]) -> tuple[Explanation, ...]:
        """Give all explanations of least size; asked once for each row, the last of `rows`.

        What was rejected stays so, and sizes only grow.
        """
        self.conflicts |= set(conflicts(self.network, rows[-1]))
        self.left, found = self._kept((advance(self.network, item, rows) for item in self.left), rows)
        while not found and self.size < min(self.network.graph.max_faults, len(self.network.suspects)):
            self.size += 1
            fresh = (
                _from_the_first(self.network, suspects, rows)
                for suspects in combinations(self.network.suspects, self.size)
                if not any(conflict.isdisjoint(suspects) for conflict in self.conflicts)
            )
            self.left, found = self._kept(fresh, rows)
        return found

    def _kept(
        self, tested: Iterable[Hypothesis], rows: Sequence[Observation]
    ) -> tuple[tuple[Hypothesis, ...], tuple[Explanation, ...]]:
        """Give the hypotheses that have a solution, with what they explain."""
        explained = ((item, _explanation(self.network, item, rows)) for item in tested if item.is_possible)
        kept = [(item, explanation) for item, explanation in explained if explanation.solutions]
        return tuple(item for item, _ in kept), tuple(explanation for _, explanation in kept)


def _from_the_first(network: StaticNetwork, suspects: tuple[str, ...], rows: Sequence[Observation]) -> Hypothesis:
    held = Hypothesis(suspects=suspects)
    for count in range(1, len(rows) + 1):
        held = advance(network, held, rows[:count])
        if not held.is_possible:
            break
    return held


def _explanation(network: StaticNetwork, held: Hypothesis, rows: Sequence[Observation]) -> Explanation:
    """Give all points, and of infinitely many solutions one near the nominal values; none where that is not real."""
    if network.of_blocks:
        return Explanation(suspects=held.suspects, solutions=({},))
    solutions = [{name: (float(value_of(point[name])), 0.0) for name in held.suspects} for point in held.points]
    near = next(some_solutions(network, held.suspects, rows), None) if held.systems else None
    if near is not None:
        solutions.append({name: (near.values[name], inf) for name in held.suspects})
    return Explanation(suspects=held.suspects, solutions=tuple(solutions))


class NoisyProver:
    """Of a network with noise: the misfit is as noise makes it, or is larger."""

    def __init__(self, network: StaticNetwork) -> None:
        self.network = network
        self.trials: dict[tuple[str, ...], FittedHypothesis] = {}

    def contradicting(self, seen: Observation) -> tuple[str, ...]:
        """Give the sensors that disagree beyond their noise; none where it explains all together."""
        if self.network.reader is None:
            return ()
        read, data, nothing = self.network.reader.of(()), data_of(self.network, [seen]), np.zeros(0)
        gaps, _ = whitened(read, nothing, data)
        if float(np.sum(gaps**2)) <= limit(DETECTED, int(readable(read, data).sum())):
            return ()
        sensors = [item.name for item in self.network.graph.sensors]
        own = np.eye(len(sensors), dtype=bool)[:, :, None]
        alone = [Data(u=data.u, y=np.where(item, data.y, np.nan)) for item in own]
        far = np.array([np.abs(whitened(read, nothing, item)[0]).max() for item in alone])
        wrong = (far > np.sqrt(limit(DETECTED, 1))) | (far == far.max())
        return tuple(name for name, off in zip(sensors, wrong, strict=True) if off)

    def explanations(self, rows: Sequence[Observation]) -> tuple[Explanation, ...]:
        """Give all explanations of least size whose misfit passes; asked once for each row, the last of `rows`."""
        self.trials = trials(self.network, self.trials, rows)
        found = []
        for trial in left(self.trials):
            names = () if self.network.of_blocks else trial.suspects
            solutions = (
                {n: (float(fit.values[k]), float(fit.sd[k])) for k, n in enumerate(names)} for fit in trial.fits
            )
            found.append(Explanation(suspects=trial.suspects, solutions=tuple(solutions)))
        return tuple(found)


def candidates(network: StaticNetwork, found: Sequence[Explanation]) -> tuple[Candidate, ...]:
    """Give a candidate for each solution: sets of one size are equally likely, and so are the solutions of a set."""
    parameters = {item.name: item for item in network.graph.parameters}

    def distance(solution: Estimates) -> float:
        """How far a solution is from the nominal values; without end where the square is."""
        parts = ((value, parameters[name]) for name, (value, _) in solution.items())
        return math.hypot(*((value - item.nominal) / item.scale for value, item in parts))

    return tuple(
        Candidate(
            suspects=tuple(
                Suspect(parameter=item.name, component=item.owner, nominal=item.nominal, estimate=value, sd=sd)
                for item, (value, sd) in ((parameters[name], solution[name]) for name in solution)
            ),
            blocks=() if solution else explanation.suspects,
            probability=1.0 / len(found) / len(explanation.solutions),
            group=True,
        )
        for explanation in found
        for solution in sorted(explanation.solutions, key=distance)
    )
