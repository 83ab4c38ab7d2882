"""Which change of which input, held how long, best separates sets of suspects that cannot be told apart.

From an operating point one input goes to another level and stays there. How far apart two sets then are is the part of
the outputs' change by one that the other cannot imitate with other values and another start, in noise standard
deviations over the record; the record holds as much time before the change as the longest hold. A set's fault is a
quarter of the declared change of each of its parameters. All is linear about the nominal plant, and noise of the inputs
and slow errors are left out: it tells which input to move, and only roughly how sure one will be.

Source: none in the thesis; expected separation as in Box and Hill, Technometrics 9 (1967) 57, for linear models.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, product

import numpy as np

from faultbond.analysis.comparison import places_of
from faultbond.analysis.equilibrium import reference_levels, stands
from faultbond.analysis.ranks import reduce, set_ranks, told_rank
from faultbond.analysis.reading_noise import usual_noise
from faultbond.analysis.sensitivity import Experiment, Sensitivity, build_recursion, sensitivities
from faultbond.analysis.testable import generic_run
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from faultbond.errors import ModelError, StructureError
from faultbond.model.graph import Input

LEVELS = (0.1, 0.3, 0.5, 0.7, 0.9)  # parts of what an input can be
FACTORS = (0.0, 0.5, 1.5, 2.0)  # of the level, in the model file's unit, of an input without a range
HOLD_SAMPLES = 600  # longest hold, where none is given
PARTS = (1 / 8, 1 / 4, 1 / 2, 1.0)  # of the longest hold
SHORTER = (1.0, 1 / 4, 1 / 16)  # parts of the longest hold, tried in turn
FAULT = 0.25  # of the declared change: the fault that is to be told apart
ENOUGH = 3.0  # standard deviations
_STEPS = 48  # of the longest hold; each stands for many samples
_NEAR = 0.05  # of what an input can be; a smaller change is none
_AS_GOOD = 0.8  # of what the longest hold gives
_BETTER = 1.2  # times the separation at rest; less is no help
_SEEN = 0.1  # standard deviations; less is rounding, or nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class InputAdvice:
    """One input moved from one level to another (SI, percent in percent) and held for `hold` seconds.

    before, after : separation of the two sets that stay closest, in standard deviations, for a record as long
    """

    input: str
    level: float
    change: float
    hold: float
    before: float
    after: float
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Stimulus:
    """What to do with the inputs to tell sets apart: best first, one entry for each input and level that helps."""

    sets: tuple[tuple[str, ...], ...]
    choices: tuple[InputAdvice, ...]
    words: str


def input_advice(
    model: StepModel,
    sets: Sequence[Sequence[str]],
    *,
    inputs: Sequence[float] | FloatArray | None = None,
    longest: float | None = None,
) -> Stimulus:
    """Give the changes of inputs that best separate sets of suspects.

    Parameters
    ----------
    model : the plant
    sets : two or more sets of parameter names
    inputs : (n_inputs,), levels of the operating point, SI; default those of `equilibrium.reference_levels`
    longest : s, the longest hold; default 600 samples, fewer where the plant has no finite solution for so long

    Raises
    ------
    ModelError
        Where a name is unknown, or there are fewer than two sets.
    StructureError
        Where the plant has no finite solution even for a while with its inputs at these levels.
    """
    graph = model.plant.graph
    places = [tuple(places_of(graph, names)) for names in sets]
    if len(places) < 2:
        raise ModelError(f"{graph.file}: {len(places)} set given; two or more are needed to be told apart")
    named = tuple(tuple(names) for names in sets)
    if not graph.inputs:
        words = f"the plant has no input that could separate {_list(named)}"
        return Stimulus(sets=named, choices=(), words=words)
    reduced = reduce([generic_run(model)])
    for (one, first), (other, second) in combinations(zip(places, named, strict=True), 2):
        ranks = [int(set_ranks(reduced, [chosen])[0][0]) for chosen in (one, other, tuple(sorted({*one, *other})))]
        if ranks[2] == max(ranks[:2]):  # what one does, the other does too
            words = f"no input can separate {_list((first, second))}: for every input they have the same effects"
            return Stimulus(sets=named, choices=(), words=words)
    levels = reference_levels(model) if inputs is None else np.asarray(inputs, dtype=np.float64)
    trials = _trials(model, levels)
    hold, still, runs = _runs(model, levels, longest, trials)
    found = []
    for (number, change), run in zip(trials, runs, strict=True):
        if run is None:
            continue
        after = [_separation(model, places, run, hold, part) for part in PARTS]
        part, value = next((p, v) for p, v in zip(PARTS, after, strict=True) if v >= _AS_GOOD * after[-1])
        before = _separation(model, places, still, hold, part)
        if value > max(_BETTER * before, _SEEN):
            found.append(_advice(graph.inputs[number], levels[number], change, part * hold, before, value))
    choices = tuple(sorted(found, key=lambda item: -item.after))
    if not choices:
        words = f"no change of one input brings {_list(named)} further apart"
    elif choices[0].after < ENOUGH:
        words = f"no change of one input tells {_list(named)} apart surely; best: {choices[0].words}"
    else:
        words = f"to tell {_list(named)} apart, {choices[0].words}"
    return Stimulus(sets=named, choices=choices, words=words)


def _runs(
    model: StepModel, levels: FloatArray, asked: float | None, trials: Sequence[tuple[int, float]]
) -> tuple[float, Sensitivity, tuple[Sensitivity | None, ...]]:
    """Give the longest hold, s, the run at rest, and those of the trials; None where the plant cannot do a trial.

    They are at the operating point first, and half way comes the change. Where they begin: where the reference run
    ended, else at rest, else with a shorter hold.
    """
    graph, count = model.plant.graph, 2 * _STEPS + 1
    recursion = build_recursion(model.plant)
    inputs = np.tile(levels, (1 + len(trials), count, 1))
    for k, (number, change) in enumerate(trials, 1):
        inputs[k, _STEPS + 1 :, number] += change
    longest = HOLD_SAMPLES * (graph.sample_time or 1.0) if asked is None else asked
    for part, stand in product(SHORTER, stands(model, levels)):
        dt = np.full(count, part * longest / _STEPS)
        dt[0] = 0.0
        theta = np.array([item.nominal for item in graph.parameters])
        begin = Experiment(start=stand.contents, inputs=inputs[0], dt=dt, theta=theta, implicit=stand.implicit)
        still, *runs = sensitivities(recursion, [replace(begin, inputs=item) for item in inputs])
        if still is not None:
            return part * longest, still, tuple(runs)
    held = ", ".join(
        f"{item.name} = {item.unit.from_si(level):.3g} {item.unit.text}"
        for item, level in zip(graph.inputs, levels, strict=True)
    )
    raise StructureError(
        f"{graph.file}: {graph.name} has no finite solution while its inputs stand still at {held}; check that its "
        "stores neither empty nor overflow there, or declare a start"
    )


def _trials(model: StepModel, levels: FloatArray) -> list[tuple[int, float]]:
    """Give the changes to be tried: (input, change in SI); none of an input that nobody can move."""
    trials, graph = [], model.plant.graph
    still = {item.name for item in graph.checks if item.move == 0.0}
    for number, (item, level) in enumerate(zip(graph.inputs, levels, strict=True)):
        if item.name in still:
            continue
        changes = [wanted - level for wanted in _wanted(item, level)]
        trials += [(number, float(change)) for change in changes]
    return trials


def _wanted(item: Input, level: float) -> list[float]:
    """Give the levels to which an input may go from one, SI, none beyond an end of its range.

    They are parts of what it can be, as it is known of percent too, else of the level.
    """
    lower, upper = item.lower, item.upper
    if item.unit.text == "percent":
        lower, upper = max(lower, 0.0), min(upper, 100.0)
    if np.isfinite([lower, upper]).all():
        span = upper - lower
        return [to for part in LEVELS if abs((to := lower + part * span) - level) >= _NEAR * span]
    there = item.unit.from_si(level) or 1.0
    return [to for factor in FACTORS if lower <= (to := item.unit.to_si(factor * there)) <= upper]


def _separation(
    model: StepModel, places: Sequence[tuple[int, ...]], run: Sensitivity, longest: float, part: float
) -> float:
    """Give the separation of the two closest sets when the record ends `part` of the longest hold after the change."""
    graph = model.plant.graph
    rows = _STEPS + 1 + round(part * _STEPS)
    samples = max(longest / _STEPS / (graph.sample_time or 1.0), 1.0)  # that one step stands for
    noise = usual_noise(graph.sensors, (run,))
    noise = np.maximum(noise, 1e-9 * np.max(np.abs(run.y), axis=0, initial=0.0) + 1e-300)
    weight = np.sqrt(samples) / noise[:, None]
    faults = np.array([FAULT * abs(item.change / item.scale) for item in graph.parameters])
    by_theta = (run.by_theta[:rows] * weight).reshape(-1, len(faults)) * faults
    by_free = (run.by_free[:rows] * weight).reshape(len(by_theta), -1)
    return min(
        _apart(by_theta[:, list(one)], np.hstack([by_theta[:, list(other)], by_free]))
        for pair in combinations(places, 2)
        for one, other in (pair, pair[::-1])
    )


def _apart(columns: FloatArray, others: FloatArray) -> float:
    """Give the length of what others cannot imitate, root of the mean square over faults of one size."""
    lengths = np.linalg.norm(others, axis=0)
    base, values, _ = np.linalg.svd(others[:, lengths > 0] / lengths[lengths > 0], full_matrices=False)
    base = base[:, : told_rank(values).value] if len(values) else base
    for _ in range(2):  # twice, for rounding
        columns = columns - base @ (base.T @ columns)
    return float(np.sqrt(np.sum(columns**2)))


def _advice(item: Input, level: float, change: float, hold: float, before: float, after: float) -> InputAdvice:
    one, two = (f"{item.unit.from_si(value):.3g}" for value in (level, level + change))
    there = f"{two} {'%' if item.unit.text == 'percent' else item.unit.text}".rstrip()
    far, near = ("0" if size < 0.05 else f"{size:.1f}" if size < 9.95 else f"{size:.0f}" for size in (after, before))
    return InputAdvice(
        input=item.name,
        level=float(level),
        change=change,
        hold=hold,
        before=before,
        after=after,
        words=f"move {item.name} from {one} to {there} and hold it for {float(f'{hold:.3g}'):.15g} s: "
        f"{far} standard deviations apart instead of {near}",
    )


def _list(named: Sequence[tuple[str, ...]]) -> str:
    sets = ["{" + ", ".join(names) + "}" for names in named]
    return ", ".join(sets[:-1]) + " and " + sets[-1]
