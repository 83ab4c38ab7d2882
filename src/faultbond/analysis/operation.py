"""The healthy filter over a run, linearised: what it knows at each sample, and how it answers a deviation.

The real monitor runs over the samples with its alarms off; transition, slope and gain of every sample follow from its
lanes and the step model. What asks how the detector reacts at an operating point starts from here.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from math import ceil

import casadi as ca
import numpy as np

from faultbond.analysis.batch import Batch
from faultbond.analysis.equilibrium import MOVE, Stand, moving_inputs, reference_levels, stands, times
from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec, unpack
from faultbond.equations.step import StepModel
from faultbond.errors import RecordingError, StructureError
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor

MOVES = ((0.5 * MOVE, 40.0), (0.5 * MOVE, 300.0))  # of the usual run: amplitude in references, period in samples
HELD = 4.0  # settling times between two moves
SMALLER = (1.0, 1 / 4, 1 / 16, 0.0)  # parts of these moves, tried in turn
_DIGITS = 1e-12  # part of a reading that must be less than its noise, or the plant has run away
_STILL = 1e-6  # part of a state by which it may move where it stands
_GROWN = 1e12  # times that a deviation has grown of a plant that runs away
_MOST_RUNS = 3  # tried with the filter


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Operation:
    """A run of the healthy filter; arrays have one row per sample, from the first at which the filter runs.

    time: (n,), s. packed: (n, n_sample), as the filter takes them. u: (n, n_inputs), SI. fresh: (n, n_noisy), SI, sd
    that the noise of inputs gains. noise: (n, n_outputs), SI, that of the sensors. mean, implicit: (n, n_joint),
    (n, n_loops), after the sample. transition: (n, n_joint, n_joint), from the sample before; zero in the first row.
    slope: (n, n_outputs, n_joint), of the readings. gain: (n, n_joint, n_outputs). spread: (n, n_outputs), sd of the
    innovations, SI. counted, blanked: (n, n_outputs), whether the sums take the value, and whether they forget those
    before. aged: (n, n_slow_errors), whether a slow error has been watched for as long as its memory, before which it
    raises no alarm. covariance: (n_joint, n_joint), after the first row. warm: rows before the alarms are on.
    """

    time: FloatArray
    packed: FloatArray
    u: FloatArray
    fresh: FloatArray
    noise: FloatArray
    mean: FloatArray
    implicit: FloatArray
    transition: FloatArray
    slope: FloatArray
    gain: FloatArray
    spread: FloatArray
    counted: BoolArray
    blanked: BoolArray
    aged: BoolArray
    covariance: FloatArray
    warm: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UsualRun:
    """A run of the nominal plant without noise; states (n, n_states) in the coordinates of the step model."""

    samples: tuple[Sample, ...]
    states: FloatArray


def operate(model: StepModel, spec: EngineSpec, engine: Core, run: UsualRun | Sequence[Sample]) -> Operation:
    """Run the healthy filter over samples and linearise it.

    Along a usual run the start is not solved for: it is known where it is, and the filter is told no more than its
    size.

    Raises
    ------
    RecordingError
        Where the filter never gets going, or loses the plant.
    """
    told, samples = spec, run.samples if isinstance(run, UsualRun) else run
    if isinstance(run, UsualRun):
        sizes = np.max(np.abs(run.states), axis=0, initial=0.0).tolist()
        states = [
            replace(state, start_mean=start, start_sd=size if size > 0.0 else 1.0) if state.start_sd is None else state
            for state, start, size in zip(spec.states, run.states[0].tolist(), sizes, strict=True)
        ]
        told = replace(spec, states=tuple(states))
    rows, begun = list[tuple[float, FloatArray, FloatArray, FloatArray]](), 0
    with suppress(np.linalg.LinAlgError):
        rows, begun = _filtered(told, engine, samples)
    if not rows:
        raise RecordingError(
            f"{spec.model}: the healthy filter does not get going on these {len(samples)} samples; "
            "give a longer recording of the healthy plant, with every input"
        )
    time, packed, lanes, spread = (np.array(item) for item in zip(*rows, strict=True))
    fields = {name: packed[:, place] for name, place in spec.sample_fields.items()}
    mean, implicit = lanes[:, : spec.n_joint], lanes[:, spec.n_joint + spec.n_packed : -1]
    transition, slope = _slopes(model, spec, mean, implicit, fields)
    spreads = np.array([unpack(spec, lane[spec.covariance_slice]) for lane in lanes])
    reading = fields["use"] * fields["y"]
    noise = spec.output_noise**2 * (1.0 + (np.array([item.growth for item in spec.outputs]) * reading) ** 2)
    information = fields["use"] / (noise * fields["scale"])
    found = Operation(
        time=time,
        packed=packed,
        u=fields["u"],
        fresh=np.sqrt(fields["fresh"]),
        noise=np.sqrt(noise),
        mean=mean,
        implicit=implicit,
        transition=transition,
        slope=slope,
        gain=spreads @ slope.transpose(0, 2, 1) * information[:, None, :],
        spread=spread,
        counted=(fields["use"] > 0) & (fields["scale"] == 1.0),
        blanked=(fields["use"] > 0) & (fields["scale"] != 1.0),
        aged=_aged(spec, fields["dt"][:, 0], begun),
        covariance=spreads[0],
        warm=max(begun + spec.thresholds.warm_up_samples, 0),
    )
    parts = (found.transition, found.slope, found.gain, found.spread, found.covariance)
    if not all(np.isfinite(part).all() for part in parts):
        raise RecordingError(
            f"{spec.model}: the healthy filter has no finite slope along these {len(samples)} samples; "
            "give a recording of the healthy plant in normal use"
        )
    return found


def _filtered(
    spec: EngineSpec, engine: Core, samples: Sequence[Sample]
) -> tuple[list[tuple[float, FloatArray, FloatArray, FloatArray]], int]:
    """Run the monitor with its alarms off; give rows since its filter runs, and in which of them monitoring began.

    A row: time, s; packed sample (n_sample,); healthy lane (n_numbers,); sd of the innovations (n_outputs,), SI.
    """
    monitor = Monitor(engine, quiet=True)
    if all(item.start_sd is not None for item in spec.states):  # the filter runs from the first sample on
        mean = np.array([item.start_mean for item in spec.states])
        monitor.go_on(engine.healthy_lane(mean, np.diag(spec.stated_variances)))
    rows = list[tuple[float, FloatArray, FloatArray, FloatArray]]()
    for number, sample in enumerate(samples):
        report = monitor.step(sample)
        if not monitor.number("clock.running"):
            rows = []
            continue
        packed, _ = monitor.row(number)
        spread = np.sqrt(np.maximum(report.variance, 0.0))
        rows.append((sample.time, packed, monitor.numbers("healthy.lane"), spread))
    first = len(samples) - len(rows)
    return rows, int(monitor.number("clock.begun")) - first


def _aged(spec: EngineSpec, dt: FloatArray, begun: int) -> BoolArray:
    """Give whether each slow error may alarm at each row (n, n_slow_errors), as `slow_error_alarms` of the core."""
    grid = spec.sample_time or float(np.median(dt[1:] if len(dt) > 1 else dt))
    watched = (np.arange(len(dt)) - begun) * grid
    return np.asarray(watched[:, None] >= spec.slow_watched)


def _slopes(
    model: StepModel, spec: EngineSpec, mean: FloatArray, implicit: FloatArray, fields: dict[str, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Give transition and slope of the readings of each sample."""
    n, n_x, count = spec.n_joint, len(spec.states), len(mean)
    transition = np.zeros((count, n, n))
    memories = np.array([error.memory for error in spec.slow_errors])
    dt = fields["dt"][1:]
    decay = np.exp(-dt / memories)
    moved = np.where(fields["still"][1:] > 0.0, 0.0, dt)
    x, by, z = Batch(model.follow)(mean[:-1], fields["u_before"][1:], fields["u"][1:], implicit[:-1], moved)
    transition[1:, :n_x] = by
    places = (spec.slow_slice, spec.parameter_slice, spec.noise_slice)
    slow, parameters, noise = (np.arange(n)[place] for place in places)
    transition[1:, slow, slow] = decay
    transition[1:, parameters, parameters] = 1.0
    transition[1:, noise, noise] = fields["fade"][1:]
    predicted = mean.copy()
    predicted[1:] = mean[:-1]
    predicted[1:, :n_x] = x[:, :, 0]
    predicted[1:, spec.slow_slice] *= decay
    predicted[1:, noise] *= fields["fade"][1:]
    solved = implicit.copy()
    solved[1:] = z[:, :, 0]
    slope = Batch(model.measure)(predicted, fields["u"], solved)[1]
    return transition, slope.copy()


def advance_function(model: StepModel) -> ca.Function:
    """Give (v, z, u_before, u, dt) -> (v, z, y) of one sample, without slopes."""
    v, z, u = model.v, model.z, model.u
    n_x = len(model.states)
    before, dt = ca.SX.sym("u_before", u.numel()), ca.SX.sym("dt")
    x, _, solved = model.follow(v, before, u, z, dt)
    moved = ca.vertcat(x, v[n_x:])
    y, _, solved = model.measure(moved, u, solved)
    results = [ca.densify(item) for item in (moved, solved, y)]
    return ca.Function("advance", [v, z, before, u, dt], results, {"cse": True})


def usual_operation(model: StepModel, spec: EngineSpec, engine: Core, count: int) -> Operation:
    """Run the healthy filter over a usual run, and linearise it.

    Raises
    ------
    StructureError
        Where there is no usual run along which the filter keeps the plant.
    """
    for run in islice(usual_runs(model, spec, count), _MOST_RUNS):
        with suppress(RecordingError):
            found = operate(model, spec, engine, run)
            if len(found.time) == count and not _runs_away(run, found):
                return found
    graph = model.plant.graph
    near = ", ".join(item.name for item in graph.inputs)
    raise StructureError(
        f"{graph.file}: {graph.name} has no finite solution over {count} samples "
        f"{f'with {near} near the usual values' if near else 'by itself'}, or one that runs away; give a recording of "
        "the healthy plant with --data"
    )


def _runs_away(run: UsualRun, found: Operation) -> bool:
    """Whether the plant stands where it would leave however little it is off, as nothing real does."""
    n_states = run.states.shape[1]
    if np.any(np.ptp(run.states, axis=0) > _STILL * (np.max(np.abs(run.states), axis=0) + _STILL)):
        return False
    grown = np.eye(n_states)
    for step in found.transition[1:, :n_states, :n_states]:
        grown = step @ grown
        if not np.all(np.abs(grown) < _GROWN):
            return True
    return False


def usual_runs(model: StepModel, spec: EngineSpec, count: int) -> Iterator[UsualRun]:
    """Give runs of the nominal plant without noise, its inputs moving about their references, the most lively first.

    An input is its reference times 1 + 1/4 sin(2 pi k/40) + 1/4 sin(2 pi k/300) at sample k; a second input moves a
    part of a period later, so that no two move together. One that settles stands still for four settling times after
    each move, or the sensors that feel it would be blind all the time, and one whose move would end the validity of the
    model stands still all the time. A run begins where the plant is at rest with its inputs at their references, or
    where the reference run ended if it does not come to rest; declared starts hold. Then come runs whose inputs move
    less, or not at all.
    """
    batch, levels, n_u = Batch(advance_function(model)), reference_levels(model), len(spec.inputs)
    held = np.array([max(1, ceil(HELD * item.settling / (spec.sample_time or 1.0))) for item in spec.inputs], dtype=int)
    k, shift = np.arange(count)[:, None] // held * held, np.arange(n_u) / (n_u + 0.5)
    moves = sum((size * np.sin(2 * np.pi * (k / period + shift)) for size, period in MOVES), np.zeros((count, n_u)))
    moves *= moving_inputs(model)
    begins = stands(model, levels)[::-1]
    for part in SMALLER:
        for stand in begins:
            run = _run(model, spec, batch, stand, times(model, levels, 1.0 + part * moves))
            if run is not None:
                yield run


def _run(model: StepModel, spec: EngineSpec, batch: Batch, stand: Stand, u: FloatArray) -> UsualRun | None:
    """Give the run from one start, or None."""
    dt, n_x = np.full((1, 1), spec.sample_time or 1.0), len(spec.states)
    factors = np.array([item.healthy for item in spec.parameters])
    v = np.zeros((1, spec.n_joint))
    v[0, spec.parameter_slice] = factors
    known = [state.start_sd is not None for state in spec.states]  # declared starts hold
    x = model.coordinates(stand.contents, factors * model.scales).full()[:, 0]
    v[0, :n_x] = np.where(known, [state.start_mean for state in spec.states], x)
    y, _, z = (item.full().T.copy() for item in model.measure(v[0], u[0], stand.implicit)) if len(u) else (v, v, v)
    samples, states = [], np.zeros((len(u), n_x))
    for row, held in enumerate(u):
        if row:
            v, z, y = (item[:, :, 0] for item in batch(v, z, u[row - 1 : row], u[row : row + 1], dt))
        if not np.isfinite(v).all() or not np.all(np.abs(y) * _DIGITS < spec.output_noise):
            return None
        time = row * float(dt[0, 0])
        samples.append(Sample(time=time, dt=float(dt[0, 0]) if row else 0.0, u=held, y=y[0].copy()))
        states[row] = v[0, :n_x]
    return UsualRun(samples=tuple(samples), states=states)
