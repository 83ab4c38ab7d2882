"""The generated part of a model's core: sizes, tables, and the text of its rates and readings.

All else, one sample of a filter, is written once in `faultbond/core`; this text grows with the number of laws only.
"""

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np

from faultbond.arrays import BoolArray
from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel
from faultbond.synthesis.emit import core_files, literal, statements

CORE = ("port.h", "lanes.h", "maths.h", "integrate.h", "filter.h", "core.c")  # in the order in which each needs others


def core_text(spec: EngineSpec, model: StepModel) -> str:
    """Give the whole source of the engine of a model, one compilation unit.

    Parameters
    ----------
    spec : what a lane holds
    model : the plant in discrete time, with an error of every input
    """
    return core_files(*CORE[:3]) + model_text(spec, model) + core_files(*CORE[3:])


def model_text(spec: EngineSpec, model: StepModel) -> str:
    """Give sizes, tables and functions of a model as C text; see `core_text`. No name of the user's stands in it."""
    rates, rate_entries = _with_sparse_slope("model_rates", model.rates)
    linear = _are_constant(model, model.rates)
    readings, reading_entries = _with_sparse_slope("model_readings", model.readings)
    n_v = model.v.numel()
    parts = [
        "/* The model: sizes, tables, rates and readings. */",
        _sizes(spec, model, rate_entries, reading_entries, linear=linear),
        *_places(spec),
        *_tables(spec),
        *_state_tables(spec, rate_entries, n_v),
        *_reading_tables(spec, reading_entries),
        *(_function(item, outputs) for item, outputs in _functions(model, rates, readings, linear=linear)),
    ]
    return "\n".join(parts) + "\n"


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
        "N_PARAMETERS": len(spec.parameters),
        "N_INPUTS": len(spec.inputs),
        "N_OUTPUTS": len(spec.outputs),
        "N_IMPLICIT": len(spec.loops),
        "N_NOISY": len(spec.noisy_inputs),
        "N_SLOT": spec.slot_slice.stop - spec.slot_slice.start,
        "N_V": model.v.numel(),
        "N_SAMPLE": spec.n_sample,
        "N_NUMBERS": spec.n_numbers,
        "N_RATE_SLOPES": len(rates),
        "N_READING_SLOPES": len(readings),
        "SUBSTEPS": model.substeps,
        "RATES_ARE_LINEAR": int(linear),
        "READINGS_ARE_LINEAR": int(model.measure_is_linear and not spec.slot),
        "WILDEST": repr(spec.thresholds.bank_bound**2),
        "BLANK_FACTOR": repr(spec.thresholds.blank_factor),
    }
    return "\n".join(f"#define {name} {size}" for name, size in sizes.items())


def _are_constant(model: StepModel, function: ca.Function) -> bool:
    """Whether the slopes of a function are the same in all lanes and at all times."""
    slope = function(model.v, model.u, model.z)[1]
    return not ca.depends_on(slope, ca.vertcat(model.v, model.u, model.z))


def _places(spec: EngineSpec) -> Iterable[str]:
    """Where the fields of a sample, and the roles of a slot, stand."""
    yield from (f"#define SAMPLE_{name.upper()} {place.start}" for name, place in spec.sample_fields.items())
    yield from (f"#define ROLE_{name.upper()} {place.start}" for name, place in spec.role_fields.items())


def _tables(spec: EngineSpec) -> Iterable[str]:
    yield _numbers("STATE_VARIANCE", (item.noise**2 for item in spec.states))
    yield _numbers("SLOW_VARIANCE", (item.sd**2 for item in spec.slow_errors))
    yield _numbers("SLOW_MEMORY", (item.memory for item in spec.slow_errors))
    yield _numbers("LOWER", (item.lower for item in spec.parameters))
    yield _numbers("UPPER", (item.upper for item in spec.parameters))
    yield _numbers("OUTPUT_VARIANCE", (item.noise**2 for item in spec.outputs))
    yield _numbers("INPUT_VARIANCE", (spec.inputs[k].noise ** 2 for k in spec.noisy_inputs))
    yield _integers("NOISY", spec.noisy_inputs)
    noisy = {index: k for k, index in enumerate(spec.noisy_inputs)}
    yield _integers("NOISE_OF_INPUT", (noisy.get(k, -1) for k in range(len(spec.inputs))))
    n = spec.n_joint
    rows, columns = np.triu_indices(n)
    places = np.zeros((n, n), dtype=np.intp)
    places[rows, columns] = places[columns, rows] = np.arange(len(rows))
    lines = ",\n    ".join("{" + ", ".join(map(str, row)) + "}" for row in places)
    yield f"static const int SYMMETRIC[{n}][{n}] = {{\n    {lines}}};"


def _state_tables(spec: EngineSpec, entries: Sequence[tuple[int, int]], n_v: int) -> Iterable[str]:
    """Where the slopes of the rates stand, what each state feels in a step, and what elimination fills in."""
    n_x = len(spec.states)
    slopes = np.zeros((n_x, n_v), dtype=bool)
    for row, column in entries:
        slopes[row, column] = True
    yield from _rows("RATE", [np.flatnonzero(row) for row in slopes], "COLUMN")
    reach = slopes | np.eye(n_x, n_v, dtype=bool)
    for k in range(n_x):  # Warshall: through each state in turn
        reach |= reach[:, k : k + 1] & reach[k]
    reaches_all = n_x > 0 and bool(reach.all())
    yield f"#define REACHES_ALL {int(reaches_all)}"
    if not reaches_all:
        yield from _rows("REACH", [np.flatnonzero(row) for row in reach], "COLUMN")
    filled = slopes[:, :n_x] | np.eye(n_x, dtype=bool)
    for k in range(n_x):
        below = filled[:, k] & (np.arange(n_x) > k)
        filled[np.ix_(below, np.arange(n_x) > k)] |= filled[k, k + 1 :]
    yield from _rows("LOWER", [k + 1 + np.flatnonzero(filled[k + 1 :, k]) for k in range(n_x)], "PLACE")
    yield from _rows("UPPER", [k + 1 + np.flatnonzero(filled[k, k + 1 :]) for k in range(n_x)], "PLACE")
    yield from _rows("STATE", [_joint_places(spec, row) for row in reach], "PLACE")


def _reading_tables(spec: EngineSpec, entries: Sequence[tuple[int, int]]) -> Iterable[str]:
    columns = [np.array([c for row, c in entries if row == j], dtype=np.intp) for j in range(len(spec.outputs))]
    yield from _rows("READING", columns, "COLUMN")
    patterns = [np.isin(np.arange(spec.parameter_slice.stop + len(spec.inputs)), item) for item in columns]
    yield from _rows("OUT", [_joint_places(spec, row, slot=True) for row in patterns], "PLACE")


def _joint_places(spec: EngineSpec, pattern: BoolArray, *, slot: bool = False) -> list[int]:
    """Give the places in z that slopes by the marked columns of v go to; `slot`: that of the size in any case."""
    first, last = spec.parameter_slice.start, spec.parameter_slice.stop
    places = [int(c) for c in np.flatnonzero(pattern[:last])]
    if spec.slot and (slot or pattern[first:].any()):
        places.append(spec.slot_slice.start)
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


def _functions(
    model: StepModel, rates: ca.Function, readings: ca.Function, *, linear: bool
) -> Iterable[tuple[ca.Function, dict[str, str]]]:
    if model.z.numel():
        arguments = [ca.SX.sym(f"a{k}", *model.newton_step.size_in(k)) for k in range(3)]
        step, misfit = model.newton_step(*arguments)
        outputs = [ca.densify(step), ca.densify(misfit)]
        yield ca.Function("model_newton", arguments, outputs, {"cse": True}), {"step": "lanes", "misfit": "lanes"}
        yield ca.Function("model_misfit", arguments, outputs[1:], {"cse": True}), {"misfit": "lanes"}
    yield rates, {"value": "lanes", "slopes": "double" if linear else "lanes"}
    yield readings, {"value": "lanes", "slopes": "lanes"}


def _function(function: ca.Function, outputs: dict[str, str]) -> str:
    """Give a function of the model as C: of lanes v and z, and inputs u that all lanes share."""
    inputs = {"v": True, "u": False, "z": True}
    wide = {name: kind == "lanes" for name, kind in outputs.items()}
    body = "\n".join(f"    {item.line}" for item in statements(function, inputs, wide))
    results = ", ".join(f"{kind} *FB_RESTRICT {name}" for name, kind in outputs.items())
    return (
        f"\nstatic void {function.name()}(const lanes *FB_RESTRICT v, const double *FB_RESTRICT u,\n"
        f"    const lanes *FB_RESTRICT z, {results})\n{{\n    (void)v, (void)u, (void)z;\n{body}\n}}"
    )


def _rows(name: str, rows: Sequence[Sequence[int] | np.ndarray], what: str) -> Iterable[str]:
    """Give rows of different length as one table, and where each begins."""
    yield _integers(f"{name}_ROW", np.cumsum([0, *map(len, rows)]))
    yield _integers(f"{name}_{what}", (int(place) for row in rows for place in row))


def _integers(name: str, values: Iterable[int]) -> str:
    return f"static const int {name}[] = {{{', '.join(str(int(value)) for value in values) or '0'}}};"


def _numbers(name: str, values: Iterable[float]) -> str:
    return f"static const double {name}[] = {{{', '.join(map(literal, values)) or '0.0'}}};"
