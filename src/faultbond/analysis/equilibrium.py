"""Inputs that stand still: the levels about which usual runs move, and where the plant comes to rest with them."""

from dataclasses import dataclass

import numpy as np

from faultbond.analysis.sensitivity import Experiment, build_recursion
from faultbond.analysis.trajectories import Trajectory
from faultbond.analysis.valid_levels import Level, valid_levels
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel, is_guessed, reference_inputs
from faultbond.model.graph import Input

MOVE = 0.5  # part of their levels by which inputs move in a usual run
NOISE_PART = 1 / 30  # of an input of which nothing says where it is
_STEPS = 70  # ever longer ones
_LONGER = 1.25  # each than the one before
_STILL = 1e-6  # relative change in the last, of a plant at rest


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Stand:
    """Where a plant stands: contents (n_states,) and implicit signals (n_z,), SI."""

    contents: FloatArray
    implicit: FloatArray


def reference_levels(model: StepModel) -> FloatArray:
    """Give the inputs (n_inputs,) of the usual run, SI: those of the nominal run.

    Where nothing says where an input usually is, it is 30 noises above 0, if that is more. One at which the model does
    not hold is moved to where it does.
    """
    return np.array([item.value for item in _levels(model)], dtype=np.float64)


def moving_inputs(model: StepModel) -> FloatArray:
    """Give (n_inputs,) of zeros and ones: which inputs can move about their levels while the model holds."""
    return np.array([float(item.moves) for item in _levels(model)])


def _levels(model: StepModel) -> tuple[Level, ...]:
    graph = model.plant.graph
    levels = zip(graph.inputs, reference_inputs(model.plant), strict=True)
    usual = [level + (_above_noise(item) if is_guessed(item) else 0.0) for item, level in levels]
    return valid_levels(graph, usual, MOVE)


def _above_noise(item: Input) -> float:
    return max(item.noise / NOISE_PART - item.unit.factor, 0.0)


def times(model: StepModel, levels: FloatArray, factors: FloatArray) -> FloatArray:
    """Give inputs (n, n_inputs), SI, that are `levels` times `factors` (n, n_inputs) in the units of the model file."""
    units = [item.unit for item in model.plant.graph.inputs]
    offset = np.array([item.offset for item in units], dtype=np.float64)
    return np.asarray((levels - offset) * factors + offset)


def reference(model: StepModel) -> Stand:
    """Give where the nominal run of the model ended."""
    nominal = np.array([item.nominal for item in model.plant.graph.parameters])
    contents = model.contents(model.reference_state, nominal).full()[:, 0]
    return Stand(contents=contents, implicit=np.asarray(model.reference_implicit))


def stands(model: StepModel, levels: FloatArray) -> list[Stand]:
    """Give where runs with inputs (n_inputs,), SI, may begin: where the nominal run ended, and at rest if there is."""
    return [item for item in (reference(model), at_rest(model, levels)) if item is not None]


def at_rest(model: StepModel, levels: FloatArray) -> Stand | None:
    """Give where the nominal plant comes to rest with its inputs at levels (n_inputs,), SI; None where it does not."""
    graph, begin = model.plant.graph, reference(model)
    dt = (graph.sample_time or 1.0) * _LONGER ** np.arange(_STEPS, dtype=np.float64)
    dt[0] = 0.0
    run = Experiment(
        start=begin.contents,
        inputs=np.tile(levels, (_STEPS, 1)),
        dt=dt,
        theta=np.array([item.nominal for item in graph.parameters]),
        implicit=begin.implicit,
    )
    path = Trajectory(build_recursion(model.plant), run).alone(run.theta)
    if path is None:
        return None
    n_x, size = len(begin.contents), np.max(np.abs(path), axis=0, initial=0.0)
    still = np.abs(path[-1] - path[-2]) <= _STILL * size
    return Stand(contents=path[-1, :n_x].copy(), implicit=path[-1, n_x:].copy()) if still.all() else None
