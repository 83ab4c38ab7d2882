"""Backward-Euler records of a component network: data on which a route must give back what was put in.

Each frame is solved in blocks, each block by Newton's method. Where all numbers are fractions and the laws linear, the
record is exact. Source: golden values 1.1 of the thesis' motor (backward Euler is the rule of its constraint analysis).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from random import Random

import numpy as np

from faultbond.equations.component_network import PREVIOUS, SAMPLE_TIME, ComponentNetwork
from faultbond.equations.matching import blocks, holdings, match
from faultbond.equations.numeric import NAN, Real, Slopes, exact, is_nan, numeric_value, slopes, solve_linear
from faultbond.errors import StructureError
from faultbond.model.expression import Expression, names
from faultbond.model.graph import BondGraph

FrameRecord = dict[str, tuple[Real, ...]]  # each signal over time, the oldest value first

PERCENT_RANGE = (20.0, 80.0)
USUAL_RANGE = (1.0, 10.0)  # of an input, in its own unit
_MAX_STEPS = 60
_MAX_HALVINGS = 30
_MAX_STARTS = 12
_TOLERANCE = 1e-11
_MAX_EXACT = 1500  # equations times samples; fractions grow from sample to sample
_LEVELS = 90  # an exact input takes one of so many values of its range


@dataclass(frozen=True, slots=True, kw_only=True)
class NumericPlant:
    """The numbers that go with a component network, in SI.

    values: of parameters and constants. changes: standard deviation of a faulty value. inputs: the range in which a
    test input moves. one_sided: those that cannot change their sign (percent, temperatures). start: signals before the
    first sample, 0 where absent. sds: standard deviation of the noise of inputs and sensors.
    """

    values: Mapping[str, Fraction]
    changes: Mapping[str, Fraction] = field(default_factory=dict)
    sample_time: Fraction = Fraction(1)
    inputs: Mapping[str, tuple[Fraction, Fraction]]
    one_sided: frozenset[str] = frozenset()
    start: Mapping[str, Fraction] = field(default_factory=dict)
    sds: Mapping[str, float] = field(default_factory=dict)


def plant_of(graph: BondGraph, sample_time: float | None = None) -> NumericPlant:
    """Give the numbers of a bond graph or block network, as the decimals that they are in SI.

    Parameters
    ----------
    graph : a bond graph, or the blocks of a network
    sample_time : s; default that of the model, 1 s where it has none
    """
    numbers = [(item.name, item.nominal) for item in graph.parameters]
    numbers += [(item.name, item.value) for item in graph.constants]
    time = sample_time or graph.sample_time or 1.0
    inputs = {}
    for item in graph.inputs:
        lower, upper = PERCENT_RANGE if item.unit.text == "percent" else USUAL_RANGE
        inputs[item.name] = exact(item.unit.to_si(lower)), exact(item.unit.to_si(upper))
    return NumericPlant(
        values={name: exact(value) for name, value in numbers},
        changes={parameter.name: exact(parameter.change) for parameter in graph.parameters},
        sample_time=exact(time),
        inputs=inputs,
        one_sided=frozenset(item.name for item in graph.inputs if item.unit.text == "percent" or item.unit.offset),
        sds={item.name: item.noise for item in graph.inputs} | {item.name: item.noise for item in graph.sensors},
    )


def random_inputs(plant: NumericPlant, n: int, seed: int, *, signed: bool = False) -> dict[str, tuple[Fraction, ...]]:
    """Give inputs that jump at every sample, few digits each; the same seed gives the same inputs.

    Parameters
    ----------
    plant : which inputs there are, and their ranges
    n : number of samples
    seed : of the random numbers
    signed : whether an input that rests at 0 takes values of both signs
    """
    rng = Random(seed)  # noqa: S311 - test data, no secret
    found = {}
    for name, (lower, upper) in plant.inputs.items():
        step = (upper - lower) / _LEVELS
        signs = (1, -1) if signed and name not in plant.one_sided else (1,)
        found[name] = tuple((lower + step * rng.randint(0, _LEVELS)) * rng.choice(signs) for _ in range(n))
    return found


class _NotLinearError(Exception):
    """A block cannot be solved exactly."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Block:
    """Signals that the equations of one frame give at once."""

    residuals: tuple[Expression, ...]
    signals: tuple[str, ...]


def simulate_frames(
    network: ComponentNetwork,
    values: Mapping[str, Real],
    inputs: Mapping[str, Sequence[Real]],
    dt: Real,
    start: Mapping[str, Real] | None = None,
    n: int | None = None,
) -> FrameRecord:
    """Give every signal over time, by backward Euler; exactly where all numbers are fractions and laws linear.

    Parameters
    ----------
    network : equations of a frame
    values : parameters and constants, SI
    inputs : all of one length, oldest first
    dt : sample time, s
    start : signals before the first sample; 0 where absent
    n : number of samples, for a plant without inputs

    Raises
    ------
    StructureError
        Where the equations of a frame do not fix its signals, or no solution is found.
    """
    missing = [name for name in network.inputs if name not in inputs]
    if missing:
        raise StructureError(f"{network.name}: values of the inputs {', '.join(missing)} are missing")
    order = frame_blocks(network)
    length = min((len(series) for series in inputs.values()), default=n or 0)
    if isinstance(dt, Fraction) and length * len(network.equations) <= _MAX_EXACT:
        try:
            return _advance(network, order, length, values, inputs, dt, start or {})
        except _NotLinearError:
            pass  # floating point will do
    plain = {name: tuple(map(float, series)) for name, series in inputs.items()}
    return _advance(network, order, length, _floats(values), plain, float(dt), _floats(start or {}))


def _floats(values: Mapping[str, Real]) -> dict[str, Real]:
    return {name: float(value) for name, value in values.items()}


def _advance(
    network: ComponentNetwork,
    order: Sequence[_Block],
    length: int,
    values: Mapping[str, Real],
    inputs: Mapping[str, Sequence[Real]],
    dt: Real,
    start: Mapping[str, Real],
) -> FrameRecord:
    nothing: Real = Fraction(0) if isinstance(dt, Fraction) else 0.0
    before = {signal: start.get(signal, nothing) for signal in network.signals}
    record: dict[str, list[Real]] = {signal: [] for signal in network.signals}
    for position in range(length):
        now = dict(values) | {SAMPLE_TIME: dt} | {signal: series[position] for signal, series in inputs.items()}
        now |= {signal + PREVIOUS: value for signal, value in before.items()}
        for block in order:
            guess = {signal: before[signal] for signal in block.signals}
            now |= _solve(block, now, guess, network.name)
        before = {signal: now[signal] for signal in network.signals}
        for signal, value in before.items():
            record[signal].append(value)
    return {signal: tuple(series) for signal, series in record.items()}


def frame_blocks(network: ComponentNetwork) -> tuple[_Block, ...]:
    """Give the equations of a frame in the order in which they give its signals, inputs and the past known.

    Raises
    ------
    StructureError
        Where equations are too many or too few; names the superfluous and the undetermined.
    """
    known = {name + PREVIOUS for name in network.signals} | set(network.inputs)
    unknown = [signal for signal in network.signals if signal not in known]
    position = {signal: k for k, signal in enumerate(unknown)}
    rows = [[position[name] for name in names(item.residual) if name in position] for item in network.equations]
    matched = match(rows, len(unknown))
    held = holdings(rows, matched)
    spare = [item.name for item, variable in zip(network.equations, held, strict=True) if variable < 0]
    free = [signal for signal, equation in zip(unknown, matched, strict=True) if equation < 0]
    if spare or free:
        raise StructureError(
            f"{network.name}: a frame of the network cannot be computed: equations too many: "
            f"{', '.join(spare) or 'none'}; signals left open: {', '.join(free) or 'none'}; check the laws of these"
        )
    return tuple(
        _Block(
            residuals=tuple(network.equations[k].residual for k in block),
            signals=tuple(unknown[held[k]] for k in block),
        )
        for block in blocks(rows, matched)
    )


def _solve(block: _Block, known: Mapping[str, Real], guess: Mapping[str, Real], name: str) -> dict[str, Real]:
    """Give the signals of a block: exactly where all is exact, else by Newton's method, from the frame before first."""
    if isinstance(known[SAMPLE_TIME], Fraction):
        return _solve_exactly(block, known, guess)
    rng = Random(0)  # noqa: S311 - starting points, no secret
    for attempt in range(_MAX_STARTS):
        found = newton(block.residuals, known, guess)
        if found is not None:
            return found
        size = 10.0 ** (attempt // 2)
        guess = {signal: size * rng.uniform(0.1 if attempt % 2 else -1.0, 1.0) for signal in block.signals}
    raise StructureError(f"{name}: no value found for {', '.join(block.signals)}; look at the laws that relate them")


def _solve_exactly(block: _Block, known: Mapping[str, Real], guess: Mapping[str, Real]) -> dict[str, Real]:
    """One step of Newton's method, which solves linear equations."""
    rows, right, size = _linearise(block.residuals, known, guess, block.signals)
    step = solve_linear(rows, right) if size < float("inf") else None
    if step is None:
        raise _NotLinearError
    found = {name: guess[name] + change for name, change in zip(block.signals, step, strict=True)}
    if any(numeric_value(residual, {**known, **found}) != 0 for residual in block.residuals):
        raise _NotLinearError
    return found


def newton(
    residuals: Sequence[Expression], known: Mapping[str, Real], guess: Mapping[str, Real]
) -> dict[str, Real] | None:
    """Give values near the guess at which the residuals are zero; None where Newton's method finds none.

    Steps are halved until the residuals shrink, each measured against the size of what it sums.
    """
    unknown = tuple(guess)
    point = dict(guess)
    size = NAN
    for _ in range(_MAX_STEPS):
        rows, right, size = _linearise(residuals, known, point, unknown)
        if size == 0:
            return point
        step = _step(rows, right) if size < float("inf") else None
        if step is None:
            return None
        for halvings in range(_MAX_HALVINGS):  # whole, half, quarter, ... steps
            moved: dict[str, Real] = {
                name: point[name] + 0.5**halvings * change for name, change in zip(unknown, step, strict=True)
            }
            if misfit(residuals, {**known, **moved}) < size:
                break
        else:
            return point if size < _TOLERANCE else None
        done = all(abs(float(moved[key] - point[key])) <= _TOLERANCE * abs(float(moved[key])) for key in unknown)
        if done and size < _TOLERANCE:
            return moved
        point = moved
    return None


def _linearise(
    residuals: Sequence[Expression], known: Mapping[str, Real], point: Mapping[str, Real], unknown: tuple[str, ...]
) -> tuple[list[dict[int, Real]], list[Real], float]:
    """Give slopes, minus the values, and the largest value relative to the terms of its residual."""
    everything = {**known, **point}
    columns = {name: k for k, name in enumerate(unknown)}
    rows, right, worst = [], [], 0.0
    for residual in residuals:
        value, by = slopes(residual, everything, columns)
        rows.append({columns[name]: slope for name, slope in by.items()})
        right.append(-value)
        if is_nan(value):
            return [], [], float("inf")
        if value != 0:
            worst = max(worst, _relative(value, by, everything, residual))
    return rows, right, worst


def _relative(value: Real, by: Slopes, everything: Mapping[str, Real], residual: Expression) -> float:
    """Give the size of a residual against that of what moves it; all names count, so that small unknowns do not."""
    _, all_by = slopes(residual, everything, frozenset(names(residual)))
    terms = sum(abs(float(slope * everything[name])) for name, slope in all_by.items())
    return abs(float(value)) / (terms or 1.0)


def _step(rows: Sequence[Mapping[int, Real]], right: Sequence[Real]) -> list[float] | None:
    """Give x with rows x = right in floating point; None where that is singular."""
    matrix = np.zeros((len(rows), len(rows)))
    for position, row in enumerate(rows):
        for column, entry in row.items():
            matrix[position, column] = entry
    weights = np.abs(matrix).max(axis=1)
    if not np.all(weights > 0.0):
        return None
    try:
        found = np.linalg.solve(matrix / weights[:, None], np.array(right, dtype=float) / weights)
    except np.linalg.LinAlgError:
        return None
    return [float(value) for value in found] if np.all(np.isfinite(found)) else None


def misfit(residuals: Sequence[Expression], values: Mapping[str, Real]) -> float:
    """Give the largest residual, each relative to the size of what it sums; inf where one has no value."""
    worst = 0.0
    for residual in residuals:
        value = numeric_value(residual, values)
        if is_nan(value):
            return float("inf")
        if value != 0:
            worst = max(worst, _relative(value, {}, values, residual))
    return worst
