"""What a plant's sensors can tell of its faults: in general, and along a recording.

In general everything that the plant has is excited, and only exact ranks count. Along a recording, what its noise hides
counts as not seen. Source: thesis 4.6, 6.1.2, 6.5.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import comb

import numpy as np

from faultbond.analysis.groups import MOST_NEAR, Group, NearGroup, groups, near_groups
from faultbond.analysis.ranks import ReducedSensitivities, above_noise, reduce
from faultbond.analysis.reading_noise import usual_noise
from faultbond.analysis.replay import sudden_runs
from faultbond.analysis.sensitivity import Recursion, Sensitivity
from faultbond.analysis.testable import Judgement, generic_run, judge
from faultbond.equations.step import StepModel

MOST_JUDGED = 4096  # sets up to the largest size are judged as long as there are no more


@dataclass(frozen=True, slots=True, kw_only=True)
class CapabilityView:
    """Verdicts on sets of suspects, small sets first, and which of those up to `max_faults` look alike.

    groups: alike once the change has lasted. sudden_groups: alike even where it comes at once and stores keep their
    contents, as the bank takes it; a bias of an instrument, or a gain of an input, counts as a suspect of its own.
    near_groups: nearly alike in either way. names: of what the positions in the two stand for.
    """

    judgement: Judgement
    groups: tuple[Group, ...]
    sudden_groups: tuple[Group, ...]
    near_groups: tuple[NearGroup, ...]
    names: tuple[str, ...]

    def is_instrument(self, chosen: Sequence[int]) -> bool:
        """Whether a set is an instrument."""
        return "." in self.names[chosen[0]]  # no name of a parameter has a dot


def in_general(model: StepModel, recursion: Recursion) -> CapabilityView:
    """Give what data can tell when everything is excited.

    Raises
    ------
    StructureError
        Where the equations have no finite solution along any run.
    """
    run = generic_run(model, recursion)
    exact, sudden = reduce([run]), generic_run(model, recursion, sudden=True)
    return _view(model, exact, exact, reduce([run], usual_noise(model.plant.graph.sensors, [run])), [sudden])


def on_record(model: StepModel, recursion: Recursion, runs: Sequence[Sensitivity]) -> CapabilityView:
    """Give what a recording can tell: effects of a faulty parameter that its noise does not hide.

    Groups are sets that look exactly alike along the record, near groups those that its noise makes hard to tell apart.

    Parameters
    ----------
    model, recursion : the plant
    runs : those of `replay.recorded_runs`
    """
    reduced = reduce(runs, usual_noise(model.plant.graph.sensors, runs))
    changes = np.array([item.change for item in model.plant.graph.parameters])
    seen = above_noise(reduced, changes / np.where(reduced.steps != 0.0, np.abs(reduced.steps), 1.0))
    return _view(model, seen, reduced, reduced, sudden_runs(model, recursion, runs))


def _view(
    model: StepModel,
    judged: ReducedSensitivities,
    exact: ReducedSensitivities,
    in_noises: ReducedSensitivities,
    sudden: Sequence[Sensitivity],
) -> CapabilityView:
    graph = model.plant.graph
    suspects = [k for k, item in enumerate(graph.parameters) if item.suspect]
    judgement = judge(judged, suspects, largest_size(len(suspects), graph.max_faults))
    sets = [
        item.parameters
        for item in judgement.verdicts
        if item.identifiable and len(item.parameters) <= graph.max_faults and item.falsifiable
    ] or [item.parameters for item in judgement.verdicts if item.identifiable and len(item.parameters) == 1]
    at_once = reduce(sudden)
    shown = np.linalg.norm(at_once.matrix, axis=0) > at_once.rank.low
    instruments = [(k,) for k in range(len(graph.parameters), len(at_once.parameters)) if shown[k]]
    both = sorted([*sets, *instruments], key=len)
    lasting, alike = groups(exact, sets), groups(at_once, both)
    near = near_groups(in_noises, sets, lasting)
    known = {frozenset(item.sets) for item in near}
    at_first = near_groups(reduce(sudden, usual_noise(model.plant.graph.sensors, sudden)), both, alike)
    near += tuple(item for item in at_first if frozenset(item.sets) not in known)
    return CapabilityView(
        judgement=judgement,
        groups=lasting,
        sudden_groups=alike,
        near_groups=tuple(sorted(near, key=lambda item: (item.angle, item.sets)))[:MOST_NEAR],
        names=at_once.parameters,
    )


def largest_size(n_suspects: int, max_faults: int) -> int:
    """Give the size up to which all sets of so many suspects are judged: all where they are few."""
    size, total = 0, 0
    while size < n_suspects and total + comb(n_suspects, size + 1) <= MOST_JUDGED:
        size += 1
        total += comb(n_suspects, size)
    return max(size, min(max_faults, n_suspects))
