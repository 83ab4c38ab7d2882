"""Which sets of suspects are worth testing.

A set is identifiable where its sensitivities are independent: data then fix the values of all its parameters. It is
falsifiable where the plant as a whole can show more than the set can explain: data then can contradict it. Testable is
what is both. Source: thesis 4.6, 6.1.2 (sets that explain anything); rank by automatic differentiation instead of
solving.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, islice
from math import comb

import numpy as np

from faultbond.analysis.experiment import random_experiments
from faultbond.analysis.ranks import Rank, ReducedSensitivities, reduce, set_ranks
from faultbond.analysis.sensitivity import Recursion, Sensitivity, build_recursion, sensitivities
from faultbond.equations.step import StepModel
from faultbond.errors import StructureError
from faultbond.model.graph import BondGraph

MOST_SETS = 20_000  # sets judged, small ones first
EXPLAINS_ANYTHING = "explains anything"
NOT_IDENTIFIABLE = "not identifiable"


@dataclass(frozen=True, slots=True, kw_only=True)
class SetVerdict:
    """What data can tell of a set of suspects, given by their positions in `BondGraph.parameters`.

    uncertain: the sensitivities are so nearly dependent that rounding decides; the set then counts as identifiable.
    """

    parameters: tuple[int, ...]
    identifiable: bool
    falsifiable: bool
    uncertain: bool

    @property
    def testable(self) -> bool:
        """Whether data can both fix the parameters and contradict the set."""
        return self.identifiable and self.falsifiable


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """The verdict on every set up to a size; `left_out` sets, the largest, were not judged."""

    rank: Rank
    verdicts: tuple[SetVerdict, ...]
    left_out: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """Sets for the bank to test, and those dropped with the reason; `left_out` sets, the largest, were not judged."""

    sets: tuple[tuple[int, ...], ...]
    dropped: tuple[tuple[tuple[int, ...], str], ...]
    left_out: int = 0


def generic_run(model: StepModel, recursion: Recursion | None = None, *, sudden: bool = False) -> Sensitivity:
    """Give a run that shows what a plant can show when everything is excited: of several, that of the largest rank.

    Where it is `sudden`, a change comes after a healthy while, stores keep their contents, and instruments are among
    what changes; else values are what they are from the first sample on.

    Raises
    ------
    StructureError
        Where the equations have no finite solution along any of the runs.
    """
    recursion = recursion if recursion is not None else build_recursion(model.plant)
    runs = sensitivities(recursion, random_experiments(model, recursion, sudden=sudden), instruments=sudden)
    ranks = [(reduce([run]).rank, run) for run in runs if run is not None]
    if not ranks:
        raise no_run(model.plant.graph)
    percent = [item.unit.text == "percent" for item in model.plant.graph.inputs]

    def merit(item: tuple[Rank, Sensitivity]) -> tuple[int, bool, bool, float]:
        rank, run = item  # of equals one whose valves do not turn about
        return rank.least, rank.clear, not (run.inputs[:, percent] < 0.0).any(), rank.kept

    return max(ranks, key=merit)[1]


def no_run(graph: BondGraph) -> StructureError:
    """Give the error of a plant that no random run can be made with."""
    return StructureError(
        f"{graph.file}: the equations of {graph.name} have no finite solution along random inputs; "
        "check the laws, their units and the nominal values"
    )


def judge(reduced: ReducedSensitivities, suspects: Sequence[int], largest: int) -> Judgement:
    """Give the verdict on every set of suspects of at most `largest` members.

    Parameters
    ----------
    reduced : what the plant shows, generic or on a recording
    suspects : positions of parameters
    largest : size of a set
    """
    verdicts: list[SetVerdict] = []
    total = sum(comb(len(suspects), size) for size in range(1, largest + 1))
    for size in range(1, min(largest, len(suspects)) + 1):
        sets = tuple(islice(combinations(suspects, size), MOST_SETS - len(verdicts)))
        if not sets:
            break
        ranks, doubts = (found.tolist() for found in set_ranks(reduced, sets))
        for chosen, rank, doubt in zip(sets, ranks, doubts, strict=True):
            verdicts.append(
                SetVerdict(
                    parameters=chosen,
                    identifiable=rank == size,
                    falsifiable=rank < reduced.rank.value,
                    uncertain=doubt or not reduced.rank.clear,
                )
            )
    return Judgement(rank=reduced.rank, verdicts=tuple(verdicts), left_out=total - len(verdicts))


def choose_sets(model: StepModel, recursion: Recursion | None = None) -> Choice:
    """Choose the sets of suspects that the bank of a model tests; all, where no run tells anything."""
    graph = model.plant.graph
    suspects = [k for k, item in enumerate(graph.parameters) if item.suspect]
    if not suspects:
        return Choice(sets=(), dropped=())
    try:
        seen = reduce([generic_run(model, recursion)])
    except StructureError:
        sizes = range(1, graph.max_faults + 1)
        return Choice(sets=tuple(item for size in sizes for item in combinations(suspects, size)), dropped=())
    return sets_to_test(judge(seen, suspects, graph.max_faults))


def unseen_instruments(model: StepModel, recursion: Recursion | None = None) -> frozenset[str]:
    """Name the sensors and inputs of whose faults no run shows more than what unknown inputs may do, or the start.

    No data contradict such a fault, as none do that of a parameter which is not identifiable: it would explain whatever
    the unknown input has done. Without unknown inputs, or where no run tells anything, there is none.
    """
    graph = model.plant.graph
    if not graph.unknown_inputs:
        return frozenset()
    try:
        seen = reduce([generic_run(model, recursion, sudden=True)])
    except StructureError:
        return frozenset()
    shown = np.linalg.norm(seen.matrix, axis=0) > seen.rank.low
    faults = list(zip(seen.parameters, shown.tolist(), strict=True))[len(graph.parameters) :]
    told = {name.rpartition(".")[0] for name, is_shown in faults if is_shown}
    return frozenset(name.rpartition(".")[0] for name, _ in faults) - told


def sets_to_test(judgement: Judgement) -> Choice:
    """Choose the sets for the bank: the testable ones.

    Where none is testable, as in a circuit of which only one time constant shows, the smallest identifiable sets are
    chosen, else the single suspects: the bank then has at least something to estimate.
    """
    verdicts = judgement.verdicts
    sets = tuple(item.parameters for item in verdicts if item.testable)
    for fallback in ([item for item in verdicts if item.identifiable], verdicts):
        if not sets and fallback:
            smallest = min(len(item.parameters) for item in fallback)
            sets = tuple(item.parameters for item in fallback if len(item.parameters) == smallest)
    kept = set(sets)
    return Choice(
        sets=sets,
        dropped=tuple(
            (item.parameters, EXPLAINS_ANYTHING if item.identifiable else NOT_IDENTIFIABLE)
            for item in verdicts
            if item.parameters not in kept
        ),
        left_out=judgement.left_out,
    )
