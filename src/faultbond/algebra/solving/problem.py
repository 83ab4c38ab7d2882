"""A route as equations to be solved, and the records on which its solution is checked.

The slopes of the equations at a record tell, to first order, what fixes what.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from math import inf
from time import thread_time

import numpy as np
from scipy.linalg.lapack import dgecon, dgetrf

from faultbond.algebra.route import Route, Target
from faultbond.algebra.solving.backward_euler import NumericPlant, misfit, random_inputs, simulate_frames
from faultbond.arrays import FloatArray
from faultbond.equations.component_network import (
    SAMPLE_TIME,
    ComponentNetwork,
    SignalAt,
    frame_name,
    in_frame,
)
from faultbond.equations.inversion import substitute
from faultbond.equations.numeric import Real, is_nan, slopes, solve_linear
from faultbond.errors import StructureError
from faultbond.model.expression import FUNCTIONS, LOGIC, Binary, Call, Expression, Number, names, walk

TOLERANCE = 1e-6  # of a residual against what it sums, in floating point
WARM_UP = 3  # samples that a record has before those that a route uses
_ATTEMPTS = 6
_SMALL = 4  # number of a record from which on its inputs are small
WELL, SINGULAR = 1e-10, 1e-15  # reciprocal conditions of equations with rows and columns scaled
MAX_EXACT = 60  # equations that are looked at in exact arithmetic
CHANGES = (Fraction(6, 5), Fraction(4, 5))  # of the unknown parameters in the further records


def slope_matrix(residuals: Sequence[Expression], columns: Sequence[str], values: Mapping[str, Real]) -> FloatArray:
    """Give the derivatives of residuals by some names; shape (n_residuals, n_columns), nan where there is none."""
    position = {name: k for k, name in enumerate(columns)}
    matrix = np.zeros((len(residuals), len(columns)))
    for row, residual in enumerate(residuals):
        value, by = slopes(residual, values, position)
        if is_nan(value):
            matrix[row] = np.nan
        for name, slope in by.items():
            matrix[row, position[name]] = float(slope)
    return matrix


class Fixed(Enum):
    """How well equations fix their unknowns near a solution."""

    WELL = "well"
    BARELY = "barely"
    NOT = "not"


def fixes(residuals: Sequence[Expression], unknown: Sequence[str], values: Mapping[str, Real]) -> Fixed:
    """Tell whether equations fix as many unknowns near a solution: exactly where the values are fractions.

    In floating point they fix them barely where rounding is amplified beyond use.
    """
    if len(residuals) <= MAX_EXACT and all(isinstance(value, Fraction | int) for value in values.values()):
        position = {name: k for k, name in enumerate(unknown)}
        rows = [slopes(residual, values, position)[1] for residual in residuals]
        placed = [{position[name]: slope for name, slope in row.items()} for row in rows]
        return Fixed.WELL if solve_linear(placed, [Fraction(0)] * len(rows)) is not None else Fixed.NOT
    matrix = slope_matrix(residuals, unknown, values)
    if not np.all(np.isfinite(matrix)):
        return Fixed.NOT
    sizes = np.array([abs(float(values[name])) or 1.0 for name in unknown])
    in_units = matrix * sizes  # columns in units of the unknowns, rows of largest entry 1
    largest = np.abs(in_units).max(axis=1, keepdims=True, initial=0.0)
    closeness = reciprocal_condition(in_units / np.where(largest == 0.0, 1.0, largest))
    if closeness > WELL:
        return Fixed.WELL
    return Fixed.BARELY if closeness > SINGULAR else Fixed.NOT


def reciprocal_condition(matrix: FloatArray) -> float:
    """Give an estimate of how far a matrix (n, n) is from singular ones, 1 being far and 0 singular.

    Source: Higham 1988 (LAPACK's gecon), on the factors of an LU decomposition.
    """
    norm = float(np.abs(matrix).sum(axis=0).max(initial=0.0))
    factors, _, info = dgetrf(matrix)
    if info != 0:
        return 0.0
    found, _ = dgecon(factors, norm, norm="1")
    return float(found)


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """Equations that give their unknowns together. parameters: those unknowns that are no signals."""

    residuals: tuple[Expression, ...]
    unknown: tuple[str, ...]
    parameters: frozenset[str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Problem:
    """A route in names: `omega_0` is the newest sample, a parameter has its own name.

    samples: the known signals. signals: what each name of a signal stands for. shared: whether a signal keeps its side
    of a kink from frame to frame (frames that are separate observations share nothing).
    """

    name: str
    blocks: tuple[Block, ...]
    targets: tuple[str, ...]
    samples: tuple[str, ...]
    signals: Mapping[str, SignalAt]
    frames: int
    shared: bool

    @property
    def residuals(self) -> tuple[Expression, ...]:
        """All equations."""
        return tuple(residual for block in self.blocks for residual in block.residuals)

    @property
    def unknown(self) -> tuple[str, ...]:
        """All that is found."""
        return tuple(name for block in self.blocks for name in block.unknown)

    def plain(self, name: str) -> str:
        """Give a name without its frame."""
        return self.signals[name][0] if self.shared and name in self.signals else name

    def is_met(self, values: Mapping[str, Real]) -> bool:
        """Whether values satisfy all equations."""
        return misfit(self.residuals, values) < TOLERANCE


@dataclass(frozen=True, slots=True, kw_only=True)
class ProofData:
    """Backward-Euler data for a route: `known` goes in, `true` is what must come out (all signals, all unknowns).

    scales: of each target the size of what it is a sum of; a target that is 0 comes out as rounding of that size.
    """

    known: Mapping[str, Real]
    true: Mapping[str, Real]
    scales: Mapping[str, float]


def name_of(target: Target) -> str:
    """Give the name of a parameter, or of a signal in a frame."""
    return target if isinstance(target, str) else frame_name(target)


def prepare(network: ComponentNetwork, route: Route, plant: NumericPlant) -> Problem:
    """Give the equations of a route, constants as numbers.

    Raises
    ------
    StructureError
        Where a signal in a frame and a parameter have one name, an equation is logic, or a target is known anyway.
    """
    sought = {step.finds for step in route.steps}
    given = [name_of(target) for target in route.question.targets if target not in sought]
    if given:
        raise StructureError(
            f"{', '.join(given)} {'are' if len(given) > 1 else 'is'} known without a route; "
            "ask for what is not measured"
        )
    constants = {name: Number(float(value)) for name, value in plant.values.items() if name not in network.parameters}
    equations = {item.name: item for item in network.equations}
    for equation in (equations[step.equation] for step in route.steps):
        for part in walk(equation.residual):
            logical = isinstance(part, Binary) and part.operator in LOGIC
            if logical or (isinstance(part, Call) and part.function not in FUNCTIONS):
                raise StructureError(
                    f"the equation of {equation.owner} is logic, which is not solved for numbers; "
                    "diagnoses of logic networks follow from consistency alone"
                )
    residuals = [substitute(in_frame(equations[step.equation], step.frame), dict(constants)) for step in route.steps]
    signals = {
        frame_name((signal, step.frame + back)): (signal, step.frame + back)
        for step in route.steps
        for signal, back in equations[step.equation].signals
    }
    for name in (*network.parameters, SAMPLE_TIME):
        if name in signals:
            signal, frame = signals[name]
            raise StructureError(f"{name} is a parameter, and also {signal} in frame {frame}; rename the parameter")
    finds = [name_of(step.finds) for step in route.steps]
    found = set(finds)
    used = {name for residual in residuals for name in names(residual)}
    return Problem(
        name=network.name,
        blocks=tuple(
            Block(
                residuals=tuple(residuals[k] for k in block),
                unknown=tuple(finds[k] for k in block),
                parameters=frozenset(finds[k] for k in block if isinstance(route.steps[k].finds, str)),
            )
            for block in route.blocks
        ),
        targets=tuple(map(name_of, route.question.targets)),
        samples=tuple(name for name in signals if name not in found and name in used),
        signals=signals,
        frames=1 + max((frame for _, frame in signals.values()), default=0),
        shared=bool(network.states),
    )


def trials_of(
    network: ComponentNetwork, problem: Problem, plant: NumericPlant, deadline: float = inf
) -> tuple[tuple[ProofData, ...], Fixed | None]:
    """Give records of the nominal plant, first, and of plants with other values of the unknown parameters.

    They differ in their inputs and their start, so that they lie on several sides of a kink. A record that cannot be
    computed (a root of a negative number, say), or on which the equations do not fix the unknowns, is made anew, a few
    times, in the end with small inputs, which reach inside a limit or a dead zone. With the records comes how well the
    best one fixes the unknowns; None where time was up before one was found. Without one of the nominal plant there is
    none.

    Parameters
    ----------
    network, problem, plant : what is simulated, and for which route
    deadline : on the clock of `time.thread_time`; records not made by then are left out
    """
    unknown = [name for name in problem.unknown if name not in problem.signals]
    found: list[ProofData] = []
    best = Fixed.NOT
    for number, factor in enumerate((Fraction(1), *CHANGES)):
        values = dict(plant.values)
        for name in unknown:
            nominal = plant.values[name]
            values[name] = nominal * factor if nominal else plant.changes.get(name, Fraction(1)) * (factor - 1)
        for attempt in range(_ATTEMPTS):
            if thread_time() > deadline and (found or attempt):
                return tuple(found), best if found else None
            record = _record(network, problem, plant, values, number + attempt)
            fixed = Fixed.NOT if record is None else fixes(problem.residuals, problem.unknown, record.true)
            best = best if fixed is Fixed.NOT or best is Fixed.WELL else fixed
            if record is not None and fixed is Fixed.WELL:
                found.append(record)
                break
        else:
            if not found:
                return (), best
    return tuple(found), best


def _record(
    network: ComponentNetwork, problem: Problem, plant: NumericPlant, values: Mapping[str, Fraction], seed: int
) -> ProofData | None:
    n = problem.frames + WARM_UP
    inputs = random_inputs(plant, n, seed, signed=seed % 2 == 1)
    if seed >= _SMALL:
        inputs = {
            name: given if name in plant.one_sided else tuple(value / 10 for value in given)
            for name, given in inputs.items()
        }
    start = dict(plant.start)
    if seed % 4 >= 2:  # a plant without inputs moves only if it does not begin at rest
        start |= {state.signal: Fraction(3 + k, 2 + k) for k, state in enumerate(network.states)}
    try:
        record = simulate_frames(network, values, inputs, plant.sample_time, start, n)
    except StructureError:
        return None
    true = {name: record[signal][n - 1 - frame] for name, (signal, frame) in problem.signals.items()}
    true |= {name: values[name] for name in network.parameters} | {SAMPLE_TIME: plant.sample_time}
    known = {name: value for name, value in true.items() if name not in problem.unknown}
    return ProofData(known=known, true=true, scales=_scales(problem, known, true))


def _scales(problem: Problem, known: Mapping[str, Real], true: Mapping[str, Real]) -> dict[str, float]:
    """Give for each target that is 0 the sum of the sizes of what each known value brings to it, to first order."""
    zero = [name for name in problem.targets if not true[name]]
    if not zero:
        return {}
    used = [name for name in known if any(name in names(residual) for residual in problem.residuals)]
    by_unknown = slope_matrix(problem.residuals, problem.unknown, true)
    by_known = slope_matrix(problem.residuals, used, true) * np.array([abs(float(known[name])) for name in used])
    try:
        parts = np.abs(np.linalg.solve(by_unknown, by_known)).sum(axis=1)
    except np.linalg.LinAlgError:
        return {}
    return {name: float(parts[problem.unknown.index(name)]) for name in zero}
