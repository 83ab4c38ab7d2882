"""A recording of a simulated plant."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.plant import Plant, build_plant
from faultbond.errors import ModelError
from faultbond.model.graph import BondGraph
from faultbond.simulate.instruments import Instruments, instruments
from faultbond.simulate.integrate import Caller, IntegrationMethod, Integrator, Segments
from faultbond.simulate.truth import (
    Effects,
    Fault,
    check_faults,
    driven_by_parameters,
    healthy_parameters,
    name_hint,
    true_parameters,
    wander_paths,
    wandering_parameters,
)
from faultbond.types import FaultKind, Hold

Decide = Callable[[float, FloatArray], Sequence[float] | FloatArray]

_FIRST_TRY = IntegrationMethod(implicit=False, substeps=4)
_COLD = 1.0  # K; nothing that is watched begins as near to absolute zero
_ROUNDS = 3


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inputs:
    """Inputs known beforehand; the value in row k acts from the time of row k until that of row k + 1.

    Where the model says `hold: linear` it is the value at the time of row k, and between rows what acts goes linearly;
    with `hold: next` it has acted since the time of row k - 1.

    time: (n,), s, increasing. values: (n, n_inputs), SI, the true inputs in the order of the model.
    """

    time: FloatArray
    values: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Policy:
    """Inputs decided on the way, by an operator or a controller.

    time: (n,), s, increasing. begin() gives a fresh `decide(time, outputs)`, which is then called row by row and gives
    the inputs (SI) from this row on; `outputs` are those recorded in the row before (SI, nan at the first row). A run
    may begin more than once, until the integration is accurate.
    """

    time: FloatArray
    begin: Callable[[], Decide]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """A recording, and the truth behind it. All SI, one row per moment.

    time: (n,), s. inputs, outputs: (n, n_inputs), (n, n_outputs), as recorded, with noise. true_inputs: what acts,
    before lag and curve. states: (n, n_states), named by `state_names`. parameters: (n, n_parameters). error: relative
    error of the integration, estimated.
    """

    time: FloatArray
    inputs: FloatArray
    outputs: FloatArray
    true_inputs: FloatArray
    states: FloatArray
    parameters: FloatArray
    state_names: tuple[str, ...]
    seed: int | None
    error: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Course:
    """Moments at which something changes (rows, and steps of faults between them), and the parameters there."""

    moments: FloatArray
    rows: tuple[int, ...]  # numbers of the moments that are rows
    held: tuple[int, ...]  # for each stretch the row before it
    parts: FloatArray  # (2, n): where in the time from that row to the next it begins and ends, 0 to 1
    linear: FloatArray  # (n_inputs,): 1 for those that go linearly from row to row, else 0
    early: FloatArray  # the same for those that are as in the next row
    left: FloatArray
    right: FloatArray
    at_rows: FloatArray

    def acting(self, stretch: int | slice, before: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give inputs at the begin of stretches and what they gain in these, by their values in the rows around."""
        begin, end = self.parts[:, stretch, None]
        gain = self.linear * (after - before)
        return before + self.early * (after - before) + begin * gain, (end - begin) * gain

    def segments(self, inputs: FloatArray) -> Segments:
        """Give the stretches with the inputs of the rows, shape (n_rows, n_inputs)."""
        rows = np.array(self.held, dtype=np.intp)
        begin, climb = self.acting(slice(None), inputs[rows], inputs[rows + 1])
        return Segments(length=np.diff(self.moments), inputs=begin, climb=climb, left=self.left, right=self.right)


def simulate(
    graph: BondGraph,
    inputs: Inputs | Policy,
    faults: Sequence[Fault] = (),
    *,
    seed: int | None = 0,
    noise: bool = True,
    effects: Effects | None = None,
    start: Mapping[str, float] | None = None,
) -> Simulation:
    """Simulate a plant and record it as its instruments would.

    Sensors and inputs have the noise that the model declares; slow errors are zero, and nothing wanders unless
    `effects` says so. The same seed gives the same noise and the same plant whatever the faults.

    Parameters
    ----------
    graph : the plant
    inputs : what is fed in, or who decides it
    faults : of parameters and instruments; a fault of an instrument acts from the first row after its time on
    seed : of the noise and of `Effects.spread`; None: no noise, no spread
    noise : whether sensors and inputs have the noise that the model declares
    effects : imperfections that the model leaves out; default none
    start : SI value by state (`tank.q`); a state that is not named begins at the model's `start`, else at 0, and what
        lags where it settles

    Raises
    ------
    ModelError
        Where a fault, a start or the inputs do not fit the model.
    CausalityError, StructureError
        Where the model has no solution.
    """
    effects = effects or Effects()
    time = np.asarray(inputs.time, dtype=np.float64)
    if time.ndim != 1 or not time.size or not np.all(np.isfinite(time)) or not np.all(np.diff(time) > 0):
        raise ModelError(f"{graph.file}: the times of the inputs must be finite and increase from row to row")
    check_faults(graph, faults, float(time[-1]))
    scatter = next((fault.parameter for fault in faults if fault.kind == FaultKind.NOISE.value), "")
    if scatter and not noise:
        raise ModelError(f"{graph.file}: {scatter} without noise shows nothing; leave out one of the two")
    n_parameters, graph = len(graph.parameters), driven_by_parameters(graph)
    plant = build_plant(graph)
    generator = None if seed is None else np.random.default_rng(seed)
    healthy = healthy_parameters(graph, effects.spread, generator)
    healthy[n_parameters:] = [item.nominal for item in graph.parameters[n_parameters:]]
    sensors, actuators = (instruments(items, faults, time) for items in (graph.sensors, graph.inputs))
    shapes = (time.size, len(graph.sensors)), (time.size, len(graph.inputs))
    scattering = generator if noise else None
    draws_y, draws_u = (
        np.zeros(shape) if scattering is None else scattering.standard_normal(shape) for shape in shapes
    )
    paths = wander_paths(graph, time, generator if effects.wander else None)
    if not effects.lag >= 0.0:
        raise ModelError(f"{graph.file}: a lag of {effects.lag:g} s; it must be 0 or more")
    curves = effects.curve_of(graph)
    lagged = tuple(k for k, item in enumerate(graph.inputs) if item.settling > 0 and effects.lag > 0)
    run = _Run(
        integrator=Integrator(plant, lagged, effects.lag, tuple(curves.get(item.name, 0.0) for item in graph.inputs)),
        course=(course := _course(graph, healthy, faults, time, paths)),
        x=_start(plant, start or {}),
        time=time,
        sensors=sensors,
        actuators=actuators,
        draws=draws_y,
    )
    values = _checked_values(graph, inputs) if isinstance(inputs, Inputs) else run.decide(inputs)
    acting = run.acting(values)
    states, _, error = run.integrate(acting)
    readings = run.integrator.outputs(states[list(course.rows)], acting, course.at_rows)
    _check_warm(plant, readings[0], start or {})
    return Simulation(
        time=_frozen(time),
        inputs=_frozen(values + actuators.noise * draws_u),
        outputs=_frozen(sensors.show(readings, draws_y)),
        true_inputs=_frozen(acting),
        states=_frozen(states[list(course.rows), : plant.x.numel()]),
        parameters=_frozen(course.at_rows[:, :n_parameters]),
        state_names=tuple(state.name for state in plant.network.states),
        seed=seed,
        error=error,
    )


def columns(graph: BondGraph, simulation: Simulation, *, digits: int | None = None) -> dict[str, FloatArray]:
    """Give the columns of a recording file, in the model file's units, time first.

    Parameters
    ----------
    graph : the plant, which names columns and units
    simulation : what to write
    digits : significant digits kept of inputs and outputs; None keeps all

    Returns
    -------
    values by header, each of shape (n,)
    """
    table: dict[str, FloatArray] = {}
    if graph.time.column is not None:
        table[graph.time.column] = (simulation.time - graph.time.unit.offset) / graph.time.unit.factor
    for item, values in zip(graph.instruments, np.hstack([simulation.inputs, simulation.outputs]).T, strict=True):
        shown = (values - item.unit.offset) / item.unit.factor
        table[item.column] = shown if digits is None else np.array([float(f"{v:.{digits}g}") for v in shown])
    return table


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Run:
    """One plant on one course from one start; `draws` is the noise of the sensors, standard normal."""

    integrator: Integrator
    course: _Course
    x: FloatArray
    time: FloatArray
    sensors: Instruments
    actuators: Instruments
    draws: FloatArray

    def acting(self, values: FloatArray) -> FloatArray:
        """Give what acts of the inputs, shape (n, n_inputs)."""
        return self.actuators.show(values, np.zeros_like(values))

    def integrate(self, values: FloatArray) -> tuple[FloatArray, IntegrationMethod, float]:
        """Integrate with inputs that act as known."""
        first = self.integrator.start(self.x, values[0], self.course.at_rows[0])
        return self.integrator.integrate(first, self.course.segments(values))

    def decide(self, policy: Policy) -> FloatArray:
        """Find the inputs of a policy, with a method that is accurate enough on them."""
        method = _FIRST_TRY
        for _ in range(_ROUNDS):
            values = self._close(policy, method)
            _, needed, _ = self.integrate(self.acting(values))
            if needed.implicit == method.implicit and needed.substeps <= method.substeps:
                break
            method = needed
        return values

    def _close(self, policy: Policy, method: IntegrationMethod) -> FloatArray:
        """Step through the rows, asking the policy at each."""
        graph = self.integrator.plant.graph
        advance, read, course = Caller(self.integrator.step(method)), Caller(self.integrator.read), self.course
        values, acting = (np.zeros((self.time.size, len(graph.inputs))) for _ in range(2))
        shown = np.full((self.time.size, len(graph.sensors)), np.nan)
        lengths, still = np.diff(course.moments), np.zeros(len(graph.inputs))
        decide = policy.begin()
        state: FloatArray | None = None
        segment = 0
        for row, moment in enumerate(self.time):
            seen = shown[row - 1] if row else np.full(len(graph.sensors), np.nan)
            values[row] = _checked_decision(graph, decide(float(moment), seen), float(moment))
            acting[row] = self.actuators.show_row(row, values[row], still, acting)
            if state is None:
                state = self.integrator.start(self.x, acting[0], course.at_rows[0])
            while segment < len(course.held) and course.held[segment] < row:
                inputs = course.acting(segment, acting[row - 1], acting[row])
                state = advance(state, lengths[segment], *inputs, course.left[segment], course.right[segment])
                segment += 1
            readings = read(state, acting[row], course.at_rows[row])
            shown[row] = self.sensors.show_row(row, readings, self.draws[row], shown)
        return values


def _course(
    graph: BondGraph, healthy: FloatArray, faults: Sequence[Fault], time: FloatArray, paths: FloatArray
) -> _Course:
    def values(times: FloatArray, *, after: bool) -> FloatArray:
        usual = true_parameters(graph, healthy, faults, times, after=after)
        return wandering_parameters(graph, time, usual, times, paths)

    own = [fault for fault in faults if not fault.instrument]
    events = [moment for fault in own for moment in (*fault.switches(float(time[-1])), fault.end) if moment is not None]
    inside = [moment for moment in events if time[0] < moment < time[-1]]
    moments = np.union1d(time, inside)
    held = np.searchsorted(time, moments[:-1], side="right") - 1
    length = time[held + 1] - time[held]
    return _Course(
        moments=moments,
        rows=tuple(np.searchsorted(moments, time).tolist()),
        held=tuple(held.tolist()),
        parts=np.array([moments[:-1] - time[held], moments[1:] - time[held]]) / length,
        linear=np.array([float(item.linear) for item in graph.inputs]),
        early=np.array([float(item.hold is Hold.NEXT) for item in graph.inputs]),
        left=values(moments[:-1], after=True),
        right=values(moments[1:], after=False),
        at_rows=values(time, after=True),
    )


def _start(plant: Plant, start: Mapping[str, float]) -> FloatArray:
    """Give the states at first, nan for what lags and is not named."""
    known = {item.name: item.start.mean for item in plant.graph.components if item.start is not None}
    x = {state.name: np.nan if state.lag else known.get(state.component or "", 0.0) for state in plant.network.states}
    for name, value in start.items():
        if name not in x:
            raise ModelError(f"{plant.graph.file}: start of {name}: no such state; {name_hint(name, tuple(x))}")
        x[name] = float(value)
    return np.array(list(x.values()), dtype=np.float64)


def _check_warm(plant: Plant, readings: FloatArray, start: Mapping[str, float]) -> None:
    """Refuse a start at which a thermometer reads about absolute zero, since a store was taken to be empty.

    readings : float array, shape (n_outputs,), SI, at first
    """
    known = {item.name for item in plant.graph.components if item.start is not None}
    empty = [item.name for item in plant.network.states if not item.lag and item.component not in known]
    empty = [name for name in empty if name not in start]
    for sensor, value in zip(plant.graph.sensors, readings.tolist(), strict=True):
        if sensor.unit.offset and abs(value) < _COLD and empty:
            raise ModelError(
                f"{plant.graph.file}: sensor {sensor.name} begins at {sensor.unit.from_si(value):.5g} "
                f"{sensor.unit.text}, since the start of {', '.join(empty)} is not known and counts as 0, which is 0 K "
                f"in a store of heat; give `--start '{empty[0]}=...'`, in SI as its capacity times 293 K, or inputs "
                "from a recording with the sensors"
            )


def _checked_values(graph: BondGraph, inputs: Inputs) -> FloatArray:
    values = np.asarray(inputs.values, dtype=np.float64)
    expected = (len(inputs.time), len(graph.inputs))
    if values.shape != expected:
        raise ModelError(f"{graph.file}: the inputs have shape {values.shape}, expected (rows, inputs) = {expected}")
    bad = np.argwhere(~np.isfinite(values))
    if bad.size:
        row, k = bad[0]
        raise ModelError(
            f"{graph.file}: input {graph.inputs[k].name} has no value at {inputs.time[row]:g} s (row {row + 1}); "
            "a simulation needs every input in every row"
        )
    return values


def _checked_decision(graph: BondGraph, decision: Sequence[float] | FloatArray, moment: float) -> FloatArray:
    values = np.asarray(decision, dtype=np.float64)
    if values.shape != (len(graph.inputs),) or not np.all(np.isfinite(values)):
        raise ModelError(
            f"{graph.file}: the policy gave {decision} at {moment:g} s, expected {len(graph.inputs)} finite inputs"
        )
    return values


def _frozen(array: FloatArray) -> FloatArray:
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy
