"""The likelihood of a model as C: sizes, tables, rates and readings, and the loops of `likelihood.c`."""

from collections.abc import Iterable
from importlib.resources import files
from math import ceil

import numpy as np

from faultbond.equations.step import StepModel
from faultbond.synthesis.functions_text import (
    function_text,
    implicit_functions,
    is_constant,
    reached,
    step_tables,
    symmetric_table,
    with_sparse_slope,
)
from faultbond.synthesis.plan_tables import integers, numbers, ragged_table
from faultbond.types import Hold

_ANYWHERE = 1e3  # times the noise of a sensor: an sd that says nothing of what it reads


def likelihood_text(model: StepModel, *, fewer: int = 1) -> str:
    """Give the source of what filters a plant of which all parameters are given.

    Parameters
    ----------
    model : the plant in discrete time, with an error of every input
    fewer : in how many times fewer parts a step is taken
    """
    joint = _joint_of(model)
    kept = [column for column, place in enumerate(joint) if place >= 0 or _climbs(model, column)]
    rates, rate_entries = with_sparse_slope("model_rates", model.rates, kept)
    readings, reading_entries = with_sparse_slope("model_readings", model.readings, [k for k in kept if joint[k] >= 0])
    linear = is_constant(model, rates)
    functions = (
        *implicit_functions(model),
        (rates, {"value": "lanes", "slopes": "double" if linear else "lanes"}),
        (readings, {"value": "lanes", "slopes": "lanes"}),
    )
    sizes = _sizes(model) | {
        "SUBSTEPS": ceil(model.substeps / fewer),
        "N_RATE_SLOPES": len(rate_entries),
        "N_READING_SLOPES": len(reading_entries),
        "RATES_ARE_LINEAR": int(linear),
    }
    n_x, n_v, n_y = len(model.states), model.v.numel(), len(model.plant.graph.sensors)
    reach = reached(rate_entries, n_x, n_v)
    columns = [[column for row, column in reading_entries if row == j] for j in range(n_y)]
    parts = [
        *(f"#define {name} {size}" for name, size in sizes.items()),
        '#include "layout.h"',
        *_tables(model),
        integers("JOINT_OF", joint),
        "#define IS_SLOPED(c) (JOINT_OF[c] >= 0)",
        *step_tables(rate_entries, n_x, n_v, sloped=np.array(joint) >= 0),
        ragged_table("STATE", [[joint[c] for c in np.flatnonzero(row) if joint[c] >= 0] for row in reach], "PLACE"),
        ragged_table("READING", columns, "COLUMN"),
        ragged_table("OUT", [[joint[c] for c in row] for row in columns], "PLACE"),
        symmetric_table(n_x + len(model.plant.graph.slow_errors) + len(_noisy(model))),
        *(function_text(*item) for item in functions),
        files("faultbond.synthesis").joinpath("likelihood.c").read_text(encoding="utf-8"),
    ]
    return "\n".join(part if isinstance(part, str) else "\n".join(part) for part in parts)


def _noisy(model: StepModel) -> list[int]:
    return [k for k, item in enumerate(model.plant.graph.inputs) if item.noise > 0.0]


def _first_parameter(model: StepModel) -> int:
    return len(model.states) + len(model.plant.graph.slow_errors)


def _first_input(model: StepModel) -> int:
    return _first_parameter(model) + len(model.plant.graph.parameters)


def _climbs(model: StepModel, column: int) -> bool:
    """Tell whether a column of v is of an input that goes linearly from row to row."""
    number = column - _first_input(model)
    return number >= 0 and model.plant.graph.inputs[number].linear


def _joint_of(model: StepModel) -> list[int]:
    """Give the place in z of each entry of v; -1: what is given, and inputs without noise, have none."""
    first, noisy = _first_parameter(model), _noisy(model)
    places = [*range(first), *([-1] * (model.v.numel() - first))]
    for k, number in enumerate(noisy):
        places[_first_input(model) + number] = first + k
    return places


def _sizes(model: StepModel) -> dict[str, int]:
    graph = model.plant.graph
    return {
        "N_STATES": len(model.states),
        "N_SLOW": len(graph.slow_errors),
        "N_PARAMETERS": len(graph.parameters),
        "N_INPUTS": len(graph.inputs),
        "N_OUTPUTS": len(graph.sensors),
        "N_IMPLICIT": model.z.numel(),
        "N_NOISY": len(_noisy(model)),
        "N_LINEAR": sum(item.linear for item in graph.inputs),
        "N_FELT": sum(len(item.after) for item in graph.slow_errors),
        "N_HELD_SENSORS": sum(item.valid_when is not None for item in graph.sensors),
        "N_HELD_STATES": len(_held_states(model)),
        "N_HELD": 0,  # of the samples of the core, see layout.h
        "N_V": model.v.numel(),
    }


def _tables(model: StepModel) -> Iterable[str]:
    graph = model.plant.graph
    order = {item.name: k for k, item in enumerate(graph.inputs)}
    felt = [(k, order[name]) for k, item in enumerate(graph.slow_errors) for name in item.after]
    held = _held_states(model)
    yield integers("NOISY", _noisy(model))
    yield integers("INPUT_LINEAR", (item.linear for item in graph.inputs))
    yield integers("INPUT_NEXT", (item.hold is Hold.NEXT for item in graph.inputs))
    yield integers("FELT_ERROR", (k for k, _ in felt))
    yield integers("FELT_INPUT", (number for _, number in felt))
    yield integers("CONDITIONAL", (item.valid_when is not None for item in graph.sensors))
    yield numbers("OUTPUT_GROWTH", (item.growth**2 for item in graph.sensors))
    yield integers("HELD_BY", (sensor for sensor, _, _ in held))
    yield integers("HELD_STATE", (state for _, state, _ in held))
    yield numbers("HELD_VARIANCE", (sd**2 for _, _, sd in held))


def _held_states(model: StepModel) -> list[tuple[int, int, float]]:
    """Give what lags before sensors that do not always read as stated.

    The number of the sensor among these, the state, and an sd that is as good as none for that state, SI.
    """
    conditional = [item for item in model.plant.graph.sensors if item.valid_when is not None]
    return [
        (number, state, _ANYWHERE * item.noise)
        for number, item in enumerate(conditional)
        for state, store in enumerate(model.plant.network.states)
        if store.owner == item.name and item.lag
    ]
