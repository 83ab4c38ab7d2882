"""Parameters that seem to wander: their estimates differ, between recordings or within one, by more than they may.

Each of these is let wander, one after the other, the one first that the recordings gain most by; sizes and memories are
those of the highest likelihood. Where the memory is long beside a recording, that hardly has a place: what lasts longer
may be larger. There the smallest is told of those that are about as likely.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.fit.ascent import ascend, spread_noise
from faultbond.fit.certainty import inverse_of
from faultbond.fit.evidence import likelihoods
from faultbond.fit.identification import Fit
from faultbond.fit.imperfections import UNTRIED, Imperfection, Kind, memory_place, size_place, with_imperfections
from faultbond.fit.likelihood import Layout, Likelihood, build_begin, layout_of
from faultbond.fit.objective import Scored
from faultbond.fit.unknowns import unknowns_of
from faultbond.model.graph import BondGraph

MOST_PART = 0.5  # a parameter wanders by no more
SIZES = (0.003, 0.01, 0.03, 0.1, 0.3)  # parts of a value
MEMORIES = (0.01, 0.04, 0.15, 0.6, 2.4, 20.0)  # of the longest recording
LEAST_MEMORY = 10.0  # samples
MOST_MEMORY = 300.0  # longest recordings
NOISES = (1.0, 0.5, 0.2)  # of that found without: a part of it may be wander
SMALLER = (1.0, 0.8, 0.65, 0.5, 0.4, 0.3)  # of the likeliest size and memory
WORTH = 6.0  # nats that a wander must gain
LONG = 0.3  # of a recording, a memory that is long beside it
AS_GOOD = 0.5  # nats; so much less is about as likely
APART = 4.0  # standard deviations between recordings that no parameter keeps by chance
INFLATED = 3.0  # times the sd of a right model: the data ask for other values at other times
MOST_TRIED = 6  # parameters
TURNS = 12  # steps of a climb


@dataclass(frozen=True, slots=True, kw_only=True)
class Wander:
    """A parameter that seems to wander: by which part, over which time (s), and how many nats that explains."""

    parameter: str
    size: float
    memory: float
    gain: float


def wanders_of(
    graph: BondGraph, found: Fit, build: Callable[[StepModel], Likelihood], tell: Callable[[str], None]
) -> tuple[Wander, ...]:
    """Give the parameters that seem to wander, those first that explain most.

    Parameters
    ----------
    graph : the plant that was fitted
    found : what came of it
    build : gives what evaluates the likelihood of a model
    tell : takes what is being done
    """
    declared = {item.target for item in graph.slow_errors}
    unsteady = [name for name in unsteady_of(found) if name not in declared and graph.parameter(name).nominal != 0.0]
    if not unsteady:
        return ()
    tell(f"asking whether {', '.join(unsteady[:MOST_TRIED])} wander")
    left = [Imperfection(kind=Kind.WANDER, place=name) for name in unsteady[:MOST_TRIED]]
    ground = _Ground(with_imperfections(graph, tuple(left)), found, build)
    gains: list[float] = []
    while left:
        likeliest = ground.likeliest(left)
        gain = ground.climb(likeliest)
        if not gain >= WORTH:  # nor where it is no number
            break
        gains.append(gain)
        left = [item for item in left if item.place != likeliest.place]
    settled = map(ground.smallest, ground.chosen)
    return tuple(
        Wander(parameter=item.place, size=item.size, memory=item.memory, gain=gain)
        for item, gain in zip(settled, gains, strict=True)
    )


def unsteady_of(found: Fit) -> list[str]:
    """Give the parameters that do not stay the same in a recording, or from one to the next, the surest first."""
    statistics: dict[str, float] = {}
    for change in found.changes:
        statistics[change.parameter] = max(statistics.get(change.parameter, 0.0), change.statistic)
    unknowns, n = found.plant.unknowns, len(found.plant.unknowns.places)
    for k, item in enumerate(unknowns.parameters):
        inflation = float(found.certainty.inflation[k])
        apart = max((_apart(course, k, n) for course in found.courses), default=0.0) / inflation
        for statistic, limit in ((apart if len(found.courses) > 1 else 0.0, APART), (inflation, INFLATED)):
            if statistic > limit:
                statistics[item.name] = max(statistics.get(item.name, 0.0), statistic)
    return sorted(statistics, key=lambda name: statistics[name], reverse=True)


def _apart(course: Scored, k: int, n: int) -> float:
    """Give how far a recording by itself would move unknown k of n from where all together put it, in its sd.

    What it has for itself, its start, moves with it.
    """
    places = [k, *range(n, len(course.information))]
    inverse = inverse_of(course.information[np.ix_(places, places)])
    spread, moved = float(inverse[0, 0]), float(inverse[0] @ course.scores.sum(axis=0)[places])
    return abs(moved) / np.sqrt(spread) if spread > 0.0 else 0.0


class _Ground:
    """The plant in which some parameters may wander, from what was found without on.

    chosen: those that do, as found; q: (n_q,), see `Layout`; value: logarithm of the likelihood there.
    """

    def __init__(self, graph: BondGraph, found: Fit, build: Callable[[StepModel], Likelihood]) -> None:
        model, old = build_step_model(build_plant(graph)), found.plant
        self.graph, self.layout, self.found = graph, layout_of(model), found
        times = [item.time for item in found.records]
        step = float(np.median(np.diff(np.concatenate(times))))
        longest = self.longest = max(float(np.ptp(item)) for item in times)
        self.memories = LEAST_MEMORY * step, max(MOST_MEMORY * longest, LEAST_MEMORY * step)
        self.tried = sorted({float(np.clip(part * longest, *self.memories)) for part in MEMORIES})
        self.records = found.records
        self.plant = replace(
            old,
            layout=self.layout,
            engine=build(model),
            begin=build_begin(model),
            base=_with_room(old.base, old.layout, self.layout),
        )
        at = found.summit.point
        self.q = _with_room(old.unknowns.fill(old.base, at.values)[0], old.layout, self.layout)
        self.starts, self.value = at.starts, found.summit.evaluation.value
        self.chosen: list[Imperfection] = []

    def likeliest(self, left: Sequence[Imperfection]) -> Imperfection:
        """Give about the likeliest further wander, with size and memory."""
        tried = [replace(item, size=size, memory=memory) for item in left for size in SIZES for memory in self.tried]
        declared = np.array([self.with_one(self.q, item, noise) for item in tried for noise in NOISES])
        best = int(np.argmax(likelihoods(self.plant, self.records, self.starts, declared)))
        return tried[best // len(NOISES)]

    def with_one(self, q: FloatArray, item: Imperfection, noise: float = 1.0) -> FloatArray:
        """Give q with a wander of a size, and the noise of the sensors so many times as large."""
        changed, layout = q.copy(), self.layout
        changed[layout.first_noise : layout.first_noise + layout.n_y] += np.log(noise)
        changed[size_place(self.graph, layout, item)] = np.log(item.size)
        changed[memory_place(self.graph, layout, item)] = np.log(item.memory)
        return changed

    def climb(self, more: Imperfection) -> float:
        """Climb on with one more that wanders, and stay there if that is worth it; gives what is gained, nats."""
        layout, opened = self.layout, [*self.chosen, more]
        begun = self.with_one(self.q, more)
        sizes = [size_place(self.graph, layout, item) for item in opened]
        memories = [memory_place(self.graph, layout, item) for item in opened]
        base = self.plant.base.copy()
        base[layout.n_p :] = begun[layout.n_p :]
        first = layout.first_noise
        old = self.found.plant.unknowns
        parameters = tuple(zip(old.places.tolist(), old.parameters, strict=False))
        unknowns = unknowns_of(
            layout, base, parameters, (*range(first, first + layout.n_y), *sizes, *memories), grow=True
        )
        lower, upper = unknowns.lower.copy(), unknowns.upper.copy()
        n = len(lower) - len(memories)
        lower[n:], upper[n:] = np.log(self.memories)
        upper[n - len(sizes) : n] = np.log(MOST_PART)
        plant = replace(self.plant, base=base, unknowns=replace(unknowns, lower=lower, upper=upper))
        entries = begun[unknowns.places]
        logs = unknowns.logarithmic & (np.arange(len(entries)) < unknowns.n_theta)
        values = np.where(logs, np.log(np.maximum(entries, 1e-300)), entries)
        begin = replace(self.found.summit.point, values=np.clip(values, lower, upper), starts=self.starts)
        prior = unknowns.widened(self.found.widths)
        summit = ascend(
            plant, self.records, spread_noise(plant, self.records, begin), prior, anchor=begin.starts, turns=TURNS
        )
        gain = summit.evaluation.value - self.value
        if gain >= WORTH:
            self.q, self.starts = plant.unknowns.fill(base, summit.point.values)[0], summit.point.starts
            self.value = summit.evaluation.value
            self.chosen = [
                replace(item, size=float(np.exp(self.q[size])), memory=float(np.exp(self.q[memory])))
                for item, size, memory in zip(opened, sizes, memories, strict=True)
            ]
        return gain

    def smallest(self, item: Imperfection) -> Imperfection:
        """Give a wander as it was found; if its memory is long, the smallest that is about as likely."""
        if item.memory < LONG * self.longest:
            return item
        tried = [
            replace(item, size=size * item.size, memory=max(memory * item.memory, self.memories[0]))
            for size in SMALLER
            for memory in SMALLER
        ]
        declared = np.array([self.with_one(self.q, one) for one in tried])
        values = likelihoods(self.plant, self.records, self.starts, declared)
        good = [one for one, value in zip(tried, values.tolist(), strict=True) if value >= values[0] - AS_GOOD]
        return min(good, key=lambda one: (one.size, one.memory))


def _with_room(q: FloatArray, old: Layout, new: Layout) -> FloatArray:
    """Give q of a plant with more slow errors behind those of another; they are next to nothing."""
    more = new.n_b - old.n_b
    first, last = old.n_p + old.n_y + old.n_b, old.first_each
    untried, memories = np.full(more, np.log(UNTRIED)), np.zeros(more)
    return np.concatenate([q[:first], untried, q[first:last], memories, q[last:]])
