"""Rates and readings of a model as C, as `core/integrate.h` takes them, with the slopes of these that are not zero."""

from collections.abc import Iterable, Sequence

import casadi as ca
import numpy as np

from faultbond.arrays import BoolArray
from faultbond.equations.step import StepModel
from faultbond.synthesis.emit import statements
from faultbond.synthesis.plan_tables import ragged_table


def reached(entries: Sequence[tuple[int, int]], n_x: int, n_v: int) -> BoolArray:
    """Give which entries of v each state feels in the course of a step, (n_x, n_v).

    entries : rows and columns of the slopes of the rates that are not zero
    """
    reach = _pattern(entries, n_x, n_v) | np.eye(n_x, n_v, dtype=bool)
    for k in range(n_x):  # Warshall: through each state in turn
        reach |= reach[:, k : k + 1] & reach[k]
    return reach


def step_tables(
    entries: Sequence[tuple[int, int]], n_x: int, n_v: int, *, sloped: BoolArray | None = None
) -> Iterable[str]:
    """Give where the slopes of the rates stand, what each state feels in a step, and what elimination fills in.

    sloped : (n_v,), entries of v by which slopes are asked for; None: all
    """
    slopes, reach = _pattern(entries, n_x, n_v), reached(entries, n_x, n_v)
    if sloped is not None:
        reach &= sloped
    yield from ragged_table("RATE", [np.flatnonzero(row) for row in slopes], "COLUMN")
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


def _pattern(entries: Sequence[tuple[int, int]], n_rows: int, n_columns: int) -> BoolArray:
    found = np.zeros((n_rows, n_columns), dtype=bool)
    for row, column in entries:
        found[row, column] = True
    return found


def symmetric_table(n: int, kind: str = "") -> str:
    """Give where each entry of a symmetric matrix, (n, n), stands in its packed triangle."""
    rows, columns = np.triu_indices(n)
    places = np.zeros((n, n), dtype=np.intp)
    places[rows, columns] = places[columns, rows] = np.arange(len(rows))
    lines = ",\n    ".join("{" + ", ".join(map(str, row)) + "}" for row in places)
    return f"static const int SYMMETRIC{kind}[{n}][{n}] = {{\n    {lines}}};"


def with_sparse_slope(
    name: str, function: ca.Function, kept: Sequence[int] | None = None
) -> tuple[ca.Function, list[tuple[int, int]]]:
    """Give a function of a value and the entries of its slope that are not zero, and the places of these.

    kept : the columns of the slope that are wanted; None: all
    """
    arguments = [ca.SX.sym(f"a{k}", *function.size_in(k)) for k in range(function.n_in())]
    value, slope = function(*arguments)
    slope = ca.sparsify(slope)
    rows, columns = slope.sparsity().get_triplet()
    wanted = range(len(rows)) if kept is None else (k for k in range(len(rows)) if columns[k] in set(kept))
    order = sorted(wanted, key=lambda k: (rows[k], columns[k]))
    entries = ca.vertcat(*(slope.nz[k] for k in order)) if order else ca.SX(0, 1)
    sparse = ca.Function(name, arguments, [ca.densify(value), ca.densify(entries)], {"cse": True})
    return sparse, [(rows[k], columns[k]) for k in order]


def is_constant(model: StepModel, function: ca.Function) -> bool:
    """Tell whether slopes, (v, u, z) -> (value, slopes), are the same in all lanes and at all times."""
    slopes = function(model.v, model.u, model.z)[1]
    return not ca.depends_on(slopes, ca.vertcat(model.v, model.u, model.z))


def implicit_functions(model: StepModel) -> Iterable[tuple[ca.Function, dict[str, str]]]:
    """Give what solves the implicit signals, where there are such, with the names and kinds of results in C."""
    if not model.z.numel():
        return
    arguments = [ca.SX.sym(f"a{k}", *model.newton_step.size_in(k)) for k in range(3)]
    step, misfit = model.newton_step(*arguments)
    outputs = [ca.densify(step), ca.densify(misfit)]
    yield ca.Function("model_newton", arguments, outputs, {"cse": True}), {"step": "lanes", "misfit": "lanes"}
    yield ca.Function("model_misfit", arguments, outputs[1:], {"cse": True}), {"misfit": "lanes"}


def function_text(function: ca.Function, outputs: dict[str, str]) -> str:
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
