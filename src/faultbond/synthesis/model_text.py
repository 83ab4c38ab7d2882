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
from faultbond.synthesis.conditions import states_text
from faultbond.synthesis.emit import statements
from faultbond.synthesis.plan_tables import integers, numbers, plan_sizes, plan_tables, ragged_table
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
    rates, rate_entries = _with_sparse_slope("model_rates", model.rates)
    linear = _are_constant(model, model.rates)
    readings, reading_entries = _with_sparse_slope("model_readings", model.readings)
    parts = [
        "/* The model: sizes, tables, rates and readings. */",
        "#ifndef FB_MODEL_H",
        "#define FB_MODEL_H",
        _sizes(spec, model, rate_entries, reading_entries, linear=linear),
        '#include "layout.h"',
        _HASH,
        *_tables(spec),
        *_state_tables(spec, rate_entries, model.v.numel()),
        *_reading_tables(spec, reading_entries),
        *plan_tables(spec),
        states_text(spec, model.plant.graph),
        "#ifdef FB_HOLDS_FILTERS",
        *(_function(item, outputs) for item, outputs in _functions(spec, model, rates, readings, linear=linear)),
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
        "RATES_ARE_LINEAR": int(linear),
        "READINGS_ARE_LINEAR": int(model.measure_is_linear),
        **plan_sizes(spec),
        **({"N_HELD": len(spec.held), "N_HELD_STATES": len(spec.held_states)} if spec.held else {}),
    }
    return "\n".join(f"#define {name} {size}" for name, size in sizes.items())


def _are_constant(model: StepModel, function: ca.Function) -> bool:
    """Whether the slopes of a function are the same in all lanes and at all times."""
    slope = function(model.v, model.u, model.z)[1]
    return not ca.depends_on(slope, ca.vertcat(model.v, model.u, model.z))


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
        n = layout.n_joint
        rows, columns = np.triu_indices(n)
        places = np.zeros((n, n), dtype=np.intp)
        places[rows, columns] = places[columns, rows] = np.arange(len(rows))
        lines = ",\n    ".join("{" + ", ".join(map(str, row)) + "}" for row in places)
        yield f"static const int SYMMETRIC{kind}[{n}][{n}] = {{\n    {lines}}};"


def _kinds(spec: EngineSpec) -> Iterable[tuple[EngineSpec, str]]:
    """Give the layouts of plain lanes and of wide ones, which have a slot, and how tables of each end their names."""
    return ((spec, "_plain"), (spec.slotted, "_wide"))


def _state_tables(spec: EngineSpec, entries: Sequence[tuple[int, int]], n_v: int) -> Iterable[str]:
    """Where the slopes of the rates stand, what each state feels in a step, and what elimination fills in."""
    n_x = len(spec.states)
    slopes = np.zeros((n_x, n_v), dtype=bool)
    for row, column in entries:
        slopes[row, column] = True
    yield from ragged_table("RATE", [np.flatnonzero(row) for row in slopes], "COLUMN")
    reach = slopes | np.eye(n_x, n_v, dtype=bool)
    for k in range(n_x):  # Warshall: through each state in turn
        reach |= reach[:, k : k + 1] & reach[k]
    reaches_all = n_x > 0 and bool(reach.all())
    yield f"#define REACHES_ALL {int(reaches_all)}"
    if not reaches_all:
        yield from ragged_table("REACH", [np.flatnonzero(row) for row in reach], "COLUMN")
    filled = slopes[:, :n_x] | np.eye(n_x, dtype=bool)
    for k in range(n_x):
        below = filled[:, k] & (np.arange(n_x) > k)
        filled[np.ix_(below, np.arange(n_x) > k)] |= filled[k, k + 1 :]
    yield from ragged_table("LOWER", [k + 1 + np.flatnonzero(filled[k + 1 :, k]) for k in range(n_x)], "PLACE")
    yield from ragged_table("UPPER", [k + 1 + np.flatnonzero(filled[k, k + 1 :]) for k in range(n_x)], "PLACE")
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


def _with_sparse_slope(name: str, function: ca.Function) -> tuple[ca.Function, list[tuple[int, int]]]:
    """Give a function of a value and the entries of its slope that are not zero, and the places of these."""
    arguments = [ca.SX.sym(f"a{k}", *function.size_in(k)) for k in range(function.n_in())]
    value, slope = function(*arguments)
    slope = ca.sparsify(slope)
    rows, columns = slope.sparsity().get_triplet()
    order = sorted(range(len(rows)), key=lambda k: (rows[k], columns[k]))
    entries = ca.vertcat(*(slope.nz[k] for k in order)) if order else ca.SX(0, 1)
    sparse = ca.Function(name, arguments, [ca.densify(value), ca.densify(entries)], {"cse": True})
    return sparse, [(rows[k], columns[k]) for k in order]


def _named(name: str, function: ca.Function) -> ca.Function:
    """Give a function under another name."""
    arguments = [ca.SX.sym(f"a{k}", *function.size_in(k)) for k in range(function.n_in())]
    return ca.Function(name, arguments, function.call(arguments), {"cse": True})


def _functions(
    spec: EngineSpec, model: StepModel, rates: ca.Function, readings: ca.Function, *, linear: bool
) -> Iterable[tuple[ca.Function, dict[str, str]]]:
    if model.z.numel():
        arguments = [ca.SX.sym(f"a{k}", *model.newton_step.size_in(k)) for k in range(3)]
        step, misfit = model.newton_step(*arguments)
        outputs = [ca.densify(step), ca.densify(misfit)]
        yield ca.Function("model_newton", arguments, outputs, {"cse": True}), {"step": "lanes", "misfit": "lanes"}
        yield ca.Function("model_misfit", arguments, outputs[1:], {"cse": True}), {"misfit": "lanes"}
    yield rates, {"value": "lanes", "slopes": "double" if linear else "lanes"}
    yield readings, {"value": "lanes", "slopes": "lanes"}
    if spec.checked(CheckKind.SIGNAL):
        yield _named("model_signals", model.by_hand), {"value": "lanes"}


def _function(function: ca.Function, outputs: dict[str, str]) -> str:
    """Give a function of the model as C: of lanes v and z, and inputs u that all lanes share."""
    inputs = {"v": True, "u": False, "z": True}
    wide = {name: kind == "lanes" for name, kind in outputs.items()}
    body = "\n".join(f"    {item.line}" for item in statements(function, inputs, wide))
    results = ", ".join(f"{kind} *FB_RESTRICT {name}" for name, kind in outputs.items())
    unused = ", ".join(f"(void){name}" for name in (*inputs, *outputs))  # which of them are depends on the model
    return (
        f"\nstatic void {function.name()}(const lanes *FB_RESTRICT v, const double *FB_RESTRICT u,\n"
        f"    const lanes *FB_RESTRICT z, {results})\n{{\n    {unused};\n{body}\n}}"
    )
