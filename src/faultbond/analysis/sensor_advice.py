"""Which further sensors would tell more: one or two, of the efforts, flows and stored quantities that no sensor reads.

A sensor is judged by what the bank could do with it: how many classes of testable sets can be told apart, how many
sets are testable, how many independent combinations of parameters show, and how many pairs stay hard to tell apart. The
noise of a sensor that is not there is taken as `NOISE_PART` of the signal's usual size.
"""

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice
from math import comb

import numpy as np

from faultbond.analysis.groups import Group, alike_classes, groups, near_pairs
from faultbond.analysis.ranks import reduce
from faultbond.analysis.reading_noise import usual_noise
from faultbond.analysis.sensitivity import Experiment, Recursion, Sensitivity, build_recursion, sensitivity
from faultbond.analysis.testable import generic_run, judge, sets_to_test
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel
from faultbond.model.expression import Name
from faultbond.model.graph import BondGraph, Sensor, Unit

NOISE_PART = 0.01  # of the root mean square of the signal along the run
MOST_TRIED = 300  # combinations of sensors judged
MOST_WORK = 5 * 10**9  # products in all trials together
MOST_SETS = 2500  # sets judged in a trial, sizes whole
MOST_COMPARED = 100  # sets compared for nearness, sizes whole
MOST_NUMBERS = 10**7  # of sensitivities held at a time
MOST_ADVISED = 5  # of one sensor, and of two
_WORK_OF_A_SET = 100  # products, for each column
_BOND = "->"  # in the name of a signal that only a bond has; no law can read it


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorChoice:
    """What the plant would tell with further sensors.

    sensors: signals to read; none for the plant as it is. classes: testable sets that can be told apart, sets that look
    alike counted once. near: pairs hard to tell apart, of small sets where there are many. clearness: size of the
    combination of parameters that shows least, relative to that which shows most, to one digit; 0 if rounding hides it.
    """

    sensors: tuple[str, ...]
    rank: int
    testable: int
    classes: int
    near: int
    clearness: float
    groups: tuple[Group, ...]

    @property
    def merit(self) -> tuple[int, int, int, int]:
        """What is compared, the most important first."""
        return self.classes, self.testable, self.rank, -self.near

    @property
    def order(self) -> tuple[float, ...]:
        """By what choices are sorted, the best first."""
        return (*(-part for part in self.merit), -self.clearness)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorAdvice:
    """The plant as it is, and the sensors that would help, the best first.

    left_out: combinations of sensors that were not tried. largest: size of the largest sets of suspects counted.
    """

    now: SensorChoice
    further: tuple[SensorChoice, ...]
    left_out: int
    largest: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Trial:
    """What all trials share: a run with all that could be read, of whose outputs the first `present` are read.

    suspects: positions of parameters. largest: size of the largest sets. most: number of trials.
    """

    graph: BondGraph
    run: Sensitivity
    present: int
    suspects: tuple[int, ...]
    largest: int
    most: int


def advise_sensors(model: StepModel, recursion: Recursion | None = None) -> SensorAdvice:
    """Give the one or two further sensors that would help most; those that would not help are not among them.

    Raises
    ------
    StructureError
        Where the equations have no finite solution along any random run.
    """
    run, room = _extended_run(model, readable_signals(model), recursion)
    trial = _trial(model.plant.graph, run)
    shown = [k for k in range(trial.present, len(run.outputs)) if np.any(run.by_theta[:, k] != 0.0)]
    now = _advice(trial, ())
    rank = len(run.parameters)
    sets = sum(comb(len(trial.suspects), size) for size in range(1, min(trial.largest, rank - 1) + 1))
    most = (sets, sets, rank, 0)  # the merit of a plant of which everything shows
    alone = {k: _advice(trial, (k,)) for k in shown[: trial.most] if now.merit < most}
    ranked = sorted(alone, key=lambda k: alone[k].order)
    best = max((now.merit, *(item.merit for item in alone.values())))
    wanted = combinations(ranked, 2) if best < most else iter(())
    pairs = [_advice(trial, pair) for pair in islice(wanted, max(0, trial.most - len(alone)))]
    useful = [alone[k] for k in ranked if alone[k].merit > now.merit]
    better = sorted((item for item in pairs if item.merit > best), key=lambda item: item.order)
    tried = len(alone) + len(pairs)
    return SensorAdvice(
        now=_with_groups(trial, now),
        further=tuple(_with_groups(trial, item) for item in useful[:MOST_ADVISED] + better[:MOST_ADVISED]),
        left_out=0 if best >= most else comb(len(shown) + room, 2) + len(shown) + room - tried,
        largest=trial.largest,
    )


def _trial(graph: BondGraph, run: Sensitivity) -> _Trial:
    """Bound the work of a trial by the size of the sets compared, that of all by their number."""
    suspects = tuple(k for k, item in enumerate(graph.parameters) if item.suspect)
    sizes = range(1, min(graph.max_faults, max(1, len(suspects))) + 1)
    counts = {size: sum(comb(len(suspects), k) for k in range(1, size + 1)) for size in sizes}
    largest = max((size for size in sizes if counts[size] <= MOST_SETS), default=1)
    present, columns = len(graph.sensors), len(run.parameters) + len(run.states)
    work = len(run.times) * (present + 2) * columns**2 + _WORK_OF_A_SET * counts[largest] * columns
    return _Trial(
        graph=graph,
        run=run,
        present=present,
        suspects=suspects,
        largest=largest,
        most=max(1, min(MOST_TRIED, MOST_WORK // max(1, work))),
    )


def readable_signals(model: StepModel) -> tuple[str, ...]:
    """Give the signals and stored quantities that a sensor could read and none does; signals of junctions first.

    What lags has no name in the model file, so it is not among them.
    """
    plant = model.plant
    lagging = {name for store in plant.network.states if store.lag for name in (store.name, store.rate)}
    read = {expression.text for expression in plant.network.readings if isinstance(expression, Name)}
    names = dict.fromkeys((*plant.network.signals, *(store.name for store in plant.network.states)))
    junctions = {item.name for item in plant.graph.junctions}
    free = [name for name in names if name not in read and name not in lagging and _BOND not in name]
    return tuple(sorted(free, key=lambda name: name.partition(".")[0] not in junctions))


def _extended_run(model: StepModel, names: Sequence[str], recursion: Recursion | None) -> tuple[Sensitivity, int]:
    """Give the run that shows most, with sensors on the signals, and how many of these there was no room for."""
    graph = model.plant.graph
    run = generic_run(model, recursion)
    size = len(run.times) * (len(run.parameters) + len(run.states))
    taken = names[: max(1, MOST_NUMBERS // max(1, size))]
    more = tuple(Sensor(name=name, column=name, unit=Unit("1"), reads=Name(name), noise=0.0) for name in taken)
    extended = build_recursion(build_plant(replace(graph, sensors=(*graph.sensors, *more))))
    experiment = Experiment(
        start=run.x[0],
        inputs=run.inputs,
        dt=np.diff(run.times, prepend=0.0),
        theta=run.theta,
        implicit=model.reference_implicit,
    )
    return sensitivity(extended, experiment), len(names) - len(taken)


def restricted(run: Sensitivity, outputs: Sequence[int]) -> Sensitivity:
    """Give a run as some of its outputs show it."""
    chosen = list(outputs)
    return replace(
        run,
        outputs=tuple(run.outputs[k] for k in chosen),
        y=run.y[:, chosen],
        by_theta=run.by_theta[:, chosen],
        by_start=run.by_start[:, chosen],
        by_unknown=run.by_unknown[:, chosen],
    )


def _advice(trial: _Trial, further: tuple[int, ...]) -> SensorChoice:
    """Judge the plant with its sensors and some further outputs of the run; groups are left for later."""
    part = restricted(trial.run, (*range(trial.present), *further))
    noise = np.append(usual_noise(trial.graph.sensors, (part,)), np.zeros(len(further)))
    usual = np.sqrt(np.mean(part.y**2, axis=0))
    noise = np.where(noise > 0, noise, NOISE_PART * usual)
    seen, weighed = reduce([part]), reduce([part], noise)
    sets = sets_to_test(judge(seen, trial.suspects, trial.largest)).sets
    alike = alike_classes(seen, sets)
    judged = [item for item in sets if len(item) < seen.rank.value]
    sizes = [len(chosen) for chosen in sets]  # of which those are compared at which there are not too many
    few = max((size for size in sizes if bisect_right(sizes, size) <= MOST_COMPARED), default=min(sizes, default=0))
    told = weighed.rank.clear and weighed.rank.value >= seen.rank.value
    return SensorChoice(
        sensors=tuple(trial.run.outputs[k] for k in further),
        rank=seen.rank.value,
        testable=len(judged),
        classes=len(sets) - sum(len(members) - 1 for members in alike) if judged else 0,
        near=len(near_pairs(weighed, [chosen for chosen in sets if len(chosen) <= few], alike)),
        clearness=float(f"{weighed.rank.kept:.0e}") if told else 0.0,
        groups=(),
    )


def _with_groups(trial: _Trial, item: SensorChoice) -> SensorChoice:
    """Add the sets that still look alike, with the reasons."""
    further = (trial.run.outputs.index(name, trial.present) for name in item.sensors)
    seen = reduce([restricted(trial.run, (*range(trial.present), *further))])
    sets = sets_to_test(judge(seen, trial.suspects, trial.largest)).sets
    return replace(item, groups=groups(seen, sets))
