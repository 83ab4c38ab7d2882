"""The healthy filter over a run, linearised: what it knows at each sample, and how it answers a deviation.

The real monitor runs over the samples with its alarms off; transition, slope and gain of every sample follow from its
lanes and the step model. What asks how the detector reacts at an operating point starts from here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import inf

import casadi as ca
import numpy as np

from faultbond.dynamics.step import StepModel, reference_inputs
from faultbond.errors import RecordingError
from faultbond.runtime.monitor import START_PATIENCE, Sample, init, step
from faultbond.spec import Engine, EngineSpec, unpack
from faultbond.types import BoolArray, FloatArray

NOISE_PART = 1 / 30  # of an input whose range is not known
MOVES = ((0.25, 40.0), (0.25, 300.0))  # of the generic run: amplitude in references, period in samples


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Operation:
    """A run of the healthy filter; arrays have one row per sample, from the first at which the filter runs.

    time, dt: (n,), s; `dt` since the sample before. u, u_before: (n, n_inputs), SI; `u_before` was held until then.
    mean, implicit: (n, n_joint), (n, n_loops), after the sample. transition: (n, n_joint, n_joint), from the sample
    before; zero in the first row. slope: (n, n_outputs, n_joint), of the readings. gain: (n, n_joint, n_outputs).
    spread: (n, n_outputs), sd of the innovations, SI. counted: (n, n_outputs), whether the CUSUM takes the value.
    covariance: (n_joint, n_joint), after the first row. warm: rows before the alarms are on.
    """

    time: FloatArray
    dt: FloatArray
    u: FloatArray
    u_before: FloatArray
    mean: FloatArray
    implicit: FloatArray
    transition: FloatArray
    slope: FloatArray
    gain: FloatArray
    spread: FloatArray
    counted: BoolArray
    covariance: FloatArray
    warm: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Trace:
    """What the monitor left behind: time (n,), samples (n, n_sample), lanes (n, n_numbers), spread (n, n_outputs)."""

    time: FloatArray
    samples: FloatArray
    lanes: FloatArray
    spread: FloatArray
    warm: int


def operate(model: StepModel, spec: EngineSpec, engine: Engine, samples: Sequence[Sample]) -> Operation:
    """Run the healthy filter over samples and linearise it.

    Raises
    ------
    RecordingError
        Where the filter never gets going, or loses the plant.
    """
    trace = _trace(spec, engine, samples)
    fields = {name: trace.samples[:, place] for name, place in spec.sample_fields.items()}
    mean, implicit = trace.lanes[:, : spec.n_joint], trace.lanes[:, spec.n_joint + spec.n_packed : -1]
    transition, slope = _slopes(model, spec, mean, implicit, fields)
    spreads = np.array([unpack(spec, lane[spec.covariance_slice]) for lane in trace.lanes])
    information = fields["use"] / (spec.output_noise**2 * fields["scale"])
    return Operation(
        time=trace.time,
        dt=fields["dt"][:, 0],
        u=fields["u"],
        u_before=fields["u_before"],
        mean=mean,
        implicit=implicit,
        transition=transition,
        slope=slope,
        gain=spreads @ slope.transpose(0, 2, 1) * information[:, None, :],
        spread=trace.spread,
        counted=(fields["use"] > 0) & (fields["scale"] == 1.0),
        covariance=spreads[0],
        warm=trace.warm,
    )


def _trace(spec: EngineSpec, engine: Engine, samples: Sequence[Sample]) -> _Trace:
    quiet = replace(
        spec.thresholds, cusum_limit=inf, slow_error_limit=inf, history_samples=START_PATIENCE + 2
    )  # only as much history as the start may need
    watched = replace(spec, thresholds=quiet)
    state = init(watched)
    rows: list[tuple[float, FloatArray, FloatArray, FloatArray]] = []
    for sample in samples:
        state, report = step(watched, engine, state, sample)
        if not state.running:
            rows = []
            continue
        packed = state.trail_samples[(state.index - 1) % len(state.trail_times)]
        rows.append((sample.time, packed, state.lane[:, 0], np.sqrt(report.variance)))
    if not rows:
        raise RecordingError(
            f"{spec.model}: the healthy filter does not get going on these {len(samples)} samples; "
            "give a longer recording of the healthy plant, with every input"
        )
    first = state.index - len(rows)
    time, samples_seen, lanes, spread = (np.array(item) for item in zip(*rows, strict=True))
    return _Trace(
        time=time,
        samples=samples_seen,
        lanes=lanes,
        spread=spread,
        warm=max(state.begun + spec.thresholds.warm_up_samples - first, 0),
    )


def _slopes(
    model: StepModel, spec: EngineSpec, mean: FloatArray, implicit: FloatArray, fields: dict[str, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Give transition and slope of the readings of each sample."""
    n, n_x = spec.n_joint, len(spec.states)
    count = len(mean)
    transition, slope = np.zeros((count, n, n)), np.zeros((count, len(spec.outputs), n))
    memories = np.array([error.memory for error in spec.slow_errors])
    for k in range(count):
        predicted, z = mean[k].copy(), implicit[k]
        if k:
            dt = float(fields["dt"][k, 0])
            x, by, z = model.predict(mean[k - 1], fields["u_before"][k], implicit[k - 1], dt)
            decay = np.exp(-dt / memories)
            transition[k, :n_x] = by.full()
            transition[k, spec.slow_slice, spec.slow_slice] = np.diag(decay)
            transition[k, spec.parameter_slice, spec.parameter_slice] = np.eye(len(spec.parameters))
            predicted = mean[k - 1].copy()
            predicted[:n_x] = x.full()[:, 0]
            predicted[spec.slow_slice] *= decay
            predicted[spec.noise_slice] = 0.0
        slope[k] = model.measure(predicted, fields["u"][k], z)[1].full()
    return transition, slope


def advance_function(model: StepModel) -> ca.Function:
    """Give (v, z, u_before, u, dt) -> (v, z, y) of one sample, without slopes."""
    v, z, u = model.v, model.z, model.u
    n_x = len(model.states)
    before, dt = ca.SX.sym("u_before", u.numel()), ca.SX.sym("dt")
    x, _, solved = model.predict(v, before, z, dt)
    moved = ca.vertcat(x, v[n_x:])
    y, _, solved = model.measure(moved, u, solved)
    return ca.Function("advance", [v, z, before, u, dt], [moved, solved, y], {"cse": True})


def healthy_vector(model: StepModel, spec: EngineSpec) -> FloatArray:
    """Give the joint vector of the nominal plant at its start, or where the reference run ended."""
    v = np.zeros(spec.n_joint)
    for k, state in enumerate(spec.states):
        v[k] = model.reference_state[k] if state.start_sd is None else state.start_mean
    v[spec.parameter_slice] = [item.healthy for item in spec.parameters]
    return v


def reference_levels(model: StepModel) -> FloatArray:
    """Give the inputs of the generic run, SI: half range for percent, else one unit or 30 noises, whichever is more."""
    levels = zip(model.plant.graph.inputs, reference_inputs(model.plant), strict=True)
    return np.array([level + max(item.noise / NOISE_PART - item.unit.factor, 0.0) for item, level in levels])


def times(model: StepModel, levels: FloatArray, factors: FloatArray) -> FloatArray:
    """Give inputs (n, n_inputs), SI, that are `levels` times `factors` (n, n_inputs) in the units of the model file."""
    units = [item.unit for item in model.plant.graph.inputs]
    offset = np.array([item.offset for item in units], dtype=np.float64)
    return np.asarray((levels - offset) * factors + offset)


def generic_samples(model: StepModel, spec: EngineSpec, count: int) -> list[Sample]:
    """Give a run of the nominal plant without noise, its inputs moving about their references.

    An input is its reference times 1 + 1/4 sin(2 pi k/40) + 1/4 sin(2 pi k/300) at sample k; a second input moves a
    part of a period later, so that no two move together.
    """
    dt, n_u = spec.sample_time or 1.0, len(spec.inputs)
    k, shift = np.arange(count)[:, None], np.arange(n_u) / (n_u + 0.5)
    moves = sum((size * np.sin(2 * np.pi * (k / period + shift)) for size, period in MOVES), np.zeros((count, n_u)))
    u = times(model, reference_levels(model), 1.0 + moves)
    advance = advance_function(model)
    v, z = healthy_vector(model, spec), np.asarray(model.reference_implicit)
    y = model.measure(v, u[0], z)[0].full()[:, 0] if count else np.zeros(0)
    samples = []
    for row in range(count):
        if row:
            v, z, y = (item.full().reshape(-1) for item in advance(v, z, u[row - 1], u[row], dt))
        samples.append(Sample(time=row * dt, dt=dt if row else 0.0, u=u[row], y=y))
    return samples
