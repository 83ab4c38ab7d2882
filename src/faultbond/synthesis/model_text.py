"""The generated part of a model's core: sizes, tables, and the text of its rates and readings.

All else is written once in `faultbond/core`; this text grows with the number of laws only, and the tables with that of
hypotheses.
"""

from collections.abc import Iterable, Sequence
from hashlib import sha256
from textwrap import wrap

import casadi as ca
import numpy as np

from faultbond.arrays import BoolArray
from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel
from faultbond.synthesis.ahead import ahead_lengths
from faultbond.synthesis.conditions import states_text
from faultbond.synthesis.functions_text import (
    function_text,
    implicit_functions,
    is_constant,
    reached,
    step_tables,
    symmetric_table,
    with_sparse_slope,
)
from faultbond.synthesis.plan_tables import (
    integers,
    numbers,
    plan_sizes,
    plan_tables,
    ragged_table,
    small_integers,
)
from faultbond.types import CheckKind, Hold

_HASH = "/* the hash of this text: a saved state is of one model */"
# What a compiler is given: the model, then the core, which finds its own files.
_CORE = '#include "core.c"\n'


def core_text(spec: EngineSpec, model: StepModel) -> str:
    """Give the source of the on-line part of a model, one compilation unit, which includes the files of the core.

    Parameters
    ----------
    spec : what a lane holds
    model : the plant in discrete time, with an error of every input
    """
    return model_text(spec, model) + _CORE


def model_text(spec: EngineSpec, model: StepModel) -> str:
    """Give `model.h`: sizes, tables and functions of a model as C. No name of the user's stands in it."""
    rates, rate_entries = with_sparse_slope("model_rates", model.rates)
    linear, ahead = is_constant(model, rates), ahead_lengths(model)
    readings, reading_entries = with_sparse_slope("model_readings", model.readings)
    parts = [
        "/* The model: sizes, tables, rates and readings. */",
        "#ifndef FB_MODEL_H",
        "#define FB_MODEL_H",
        _sizes(spec, model, rate_entries, reading_entries, ahead, linear=linear),
        '#include "layout.h"',
        _HASH,
        *_tables(spec),
        *_state_tables(spec, rate_entries, model.v.numel()),
        *_reading_tables(spec, reading_entries),
        *plan_tables(spec),
        small_integers("AHEAD_LENGTH", ahead),
        states_text(spec, model.plant.graph),
        "#ifdef FB_HOLDS_FILTERS",
        *(function_text(item, outputs) for item, outputs in _functions(spec, model, rates, readings, linear=linear)),
        "#endif",
        "#endif",
    ]
    text = "\n".join(parts) + "\n"
    words = ", ".join(f"0x{word}ULL" for word in wrap(sha256(f"{spec.version}\0{text}".encode()).hexdigest(), 16))
    return text.replace(_HASH, f"static const uint64_t MODEL_HASH[] = {{{words}}};")


def _sizes(
    spec: EngineSpec,
    model: StepModel,
    rates: Sequence[tuple[int, int]],
    readings: Sequence[tuple[int, int]],
    ahead: Sequence[int],
    *,
    linear: bool,
) -> str:
    sizes = {
        "N_STATES": len(spec.states),
        "N_SLOW": len(spec.slow_errors),
        "N_AFTER": sum(len(item.after) for item in spec.slow_errors),
        "N_PARAMETERS": len(spec.parameters),
        "N_INPUTS": len(spec.inputs),
        "N_OUTPUTS": len(spec.outputs),
        "N_IMPLICIT": len(spec.loops),
        "N_NOISY": len(spec.noisy_inputs),
        "NOISE_GROWS": int(any(item.growth for item in spec.outputs)),
        "N_SMOOTH": len(spec.smooth_inputs),
        "N_CONDITIONS": len(spec.settlings),
        "MODEL_CONDITION": f"({spec.condition})" if spec.condition < 0 else spec.condition,
        "N_LINEAR": sum(item.linear for item in spec.inputs),
        "N_V": model.v.numel(),
        "N_RATE_SLOPES": len(rates),
        "N_READING_SLOPES": len(readings),
        "SUBSTEPS": model.substeps,
        "AHEAD": sum(ahead),
        "N_AHEAD": len(ahead),
        "RATES_ARE_LINEAR": int(linear),
        "READINGS_ARE_LINEAR": int(model.measure_is_linear),
        **plan_sizes(spec),
        **({"N_HELD": len(spec.held), "N_HELD_STATES": len(spec.held_states)} if spec.held else {}),
    }
    return "\n".join(f"#define {name} {size}" for name, size in sizes.items())


def _tables(spec: EngineSpec) -> Iterable[str]:
    yield numbers("STATE_VARIANCE", (item.noise**2 for item in spec.states))
    yield numbers("SLOW_VARIANCE", (item.sd**2 for item in spec.slow_errors))
    yield numbers("SLOW_MEMORY", (item.memory for item in spec.slow_errors))
    yield numbers("LOWER", (item.lower for item in spec.parameters))
    yield numbers("UPPER", (item.upper for item in spec.parameters))
    yield numbers("OUTPUT_VARIANCE", (item.noise**2 for item in spec.outputs))
    yield numbers("OUTPUT_GROWTH", (item.growth**2 for item in spec.outputs))
    yield numbers("INPUT_VARIANCE", spec.input_variance)
    yield integers("NOISY", spec.noisy_inputs)
    noisy = {index: k for k, index in enumerate(spec.noisy_inputs)}
    yield integers("NOISE_OF_INPUT", (noisy.get(k, -1) for k in range(len(spec.inputs))))
    yield integers("SMOOTH_NOISE", spec.smooth_inputs)
    yield numbers("CONDITION_SETTLING", spec.settlings)
    yield integers("OUTPUT_CONDITION", (item.condition for item in spec.outputs))
    if spec.held:
        yield integers("HELD_OUTPUT", spec.held)
        yield integers("HELD_STATE", (state for state, _ in spec.held_states))
        yield integers("HELD_BY", (h for _, h in spec.held_states))
    yield integers("INPUT_LINEAR", (item.linear for item in spec.inputs))
    yield integers("INPUT_NEXT", (item.hold is Hold.NEXT for item in spec.inputs))
    for layout, kind in _kinds(spec):
        yield symmetric_table(layout.n_joint, kind)


def _kinds(spec: EngineSpec) -> Iterable[tuple[EngineSpec, str]]:
    """Give the layouts of plain lanes and of wide ones, which have a slot, and how tables of each end their names."""
    return ((spec, "_plain"), (spec.slotted, "_wide"))


def _state_tables(spec: EngineSpec, entries: Sequence[tuple[int, int]], n_v: int) -> Iterable[str]:
    """Where the slopes of the rates stand, what each state feels in a step, and what elimination fills in."""
    reach = reached(entries, len(spec.states), n_v)
    yield from step_tables(entries, len(spec.states), n_v)
    for layout, kind in _kinds(spec):
        yield from ragged_table("STATE", [_joint_places(layout, row) for row in reach], "PLACE", kind)


def _reading_tables(spec: EngineSpec, entries: Sequence[tuple[int, int]]) -> Iterable[str]:
    columns = [np.array([c for row, c in entries if row == j], dtype=np.intp) for j in range(len(spec.outputs))]
    yield from ragged_table("READING", columns, "COLUMN")
    patterns = [np.isin(np.arange(spec.parameter_slice.stop + len(spec.inputs)), item) for item in columns]
    for layout, kind in _kinds(spec):
        yield from ragged_table("OUT", [_joint_places(layout, row, slot=True) for row in patterns], "PLACE", kind)


def _joint_places(spec: EngineSpec, pattern: BoolArray, *, slot: bool = False) -> list[int]:
    """Give the places in z that slopes by the marked columns of v go to; `slot`: those of the slot in any case."""
    first, last = spec.parameter_slice.start, spec.parameter_slice.stop
    places = [int(c) for c in np.flatnonzero(pattern[:last])]
    if spec.slot and (slot or pattern[first:].any()):
        places.append(spec.slot_slice.start)
    if spec.slot and (slot or pattern[last:].any()):
        places.append(spec.slot_slice.start + 1)
    return places + [spec.noise_slice.start + k for k, index in enumerate(spec.noisy_inputs) if pattern[last + index]]


def _named(name: str, function: ca.Function) -> ca.Function:
    """Give a function under another name."""
    arguments = [ca.SX.sym(f"a{k}", *function.size_in(k)) for k in range(function.n_in())]
    return ca.Function(name, arguments, function.call(arguments), {"cse": True})


def _functions(
    spec: EngineSpec, model: StepModel, rates: ca.Function, readings: ca.Function, *, linear: bool
) -> Iterable[tuple[ca.Function, dict[str, str]]]:
    yield from implicit_functions(model)
    yield rates, {"value": "lanes", "slopes": "double" if linear else "lanes"}
    yield readings, {"value": "lanes", "slopes": "lanes"}
    if spec.checked(CheckKind.SIGNAL):
        yield _named("model_signals", model.by_hand), {"value": "lanes"}
