"""Fit the parameters of the cascaded tanks: `python fit_cascaded_tanks.py RECORDING`.

Least squares between the measured lower level and that of a simulation that begins once, 68 minutes long, with both
levels at the start among the unknowns. Prints the values that stand in model.yaml.
"""

import sys
from pathlib import Path

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from faultbond.dynamics.plant import build_plant
from faultbond.dynamics.step import StepModel, build_step_model
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.types import FloatArray

HERE = Path(__file__).parent
LEVELS = (5.0, 5.2)  # V, first guess of both levels at the start


def simulation(model: StepModel, step: float, rows: int) -> ca.Function:
    """Give the function (levels, factors of the parameters, inputs) -> outputs of a whole run."""
    n_x, n_b = len(model.states), model.plant.b.numel()
    x, factors, u = ca.MX.sym("x", n_x), ca.MX.sym("factors", model.scales.size), ca.MX.sym("u", model.u.numel())
    joint = ca.vertcat(x, ca.DM.zeros(n_b, 1), factors)
    none = ca.DM.zeros(0, 1)  # no relation of this plant is implicit
    following, reading = model.predict(joint, u, none, step)[0], model.measure(joint, u, none)[0]
    return ca.Function("row", [x, factors, u], [following, reading]).mapaccum(rows)


def fit(graph: BondGraph, u: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give levels at the start and factors of the parameters as one array, and the residuals in V."""
    run = simulation(build_step_model(build_plant(graph)), graph.sample_time or 1.0, len(y))

    def residuals(unknown: FloatArray) -> FloatArray:
        factors = np.repeat(unknown[2:, None], len(y), axis=1)
        return np.asarray(run(unknown[:2], factors, u[None, :])[1].full()[0] - y)

    first = np.concatenate([LEVELS, np.ones(len(graph.parameters))])
    found = least_squares(residuals, first, bounds=(0.02, np.inf), diff_step=1e-4)
    return np.asarray(found.x), np.asarray(found.fun)


def main() -> None:
    """Fit to the recording named on the command line and print the values."""
    graph = load_model(HERE / "model.yaml")
    rows = list(read_rows(sys.argv[1], columns_of(graph)))
    unknown, residuals = fit(graph, np.array([row.u[0] for row in rows]), np.array([row.y[0] for row in rows]))
    print(f"levels at the start: {unknown[0]:.3g} V, {unknown[1]:.3g} V")
    for item, factor in zip(graph.parameters, unknown[2:], strict=True):
        print(f"{item.name}: {item.unit.from_si(item.nominal * factor):.3g} {item.unit.text}")
    print(f"residual: {np.sqrt(np.mean(residuals**2)):.3f} V, at most {np.abs(residuals).max():.2f} V")


if __name__ == "__main__":
    main()
