"""Fit the speed of the pipe's outlet thermometer: `python fit_pipe.py RECORDING...`.

Least squares between the measured outlet temperature and a simulation of each recording from its first row on. K_film
is the only number that no data sheet gives. The fit of K_film together with the heat capacity is printed beside it: the
capacity should come out near that of water and steel, which stands in model.yaml.
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


class Recording:
    """One recording and the function (factors of the parameters, start) -> outlet temperature."""

    def __init__(self, graph: BondGraph, model: StepModel, path: str) -> None:
        rows = list(read_rows(path, columns_of(graph)))
        self.outlet = np.array([row.y[0] for row in rows])
        self._steps = np.append(np.diff([row.time for row in rows]), 1.0)
        self._inputs = np.array([row.u for row in rows]).T
        self._start = [item.name for item in graph.parameters].index("T_0")
        self._nominal = graph.parameter("T_0").nominal
        x, factors = ca.MX.sym("x", len(model.states)), ca.MX.sym("factors", model.scales.size)
        u, step = ca.MX.sym("u", model.u.numel()), ca.MX.sym("step")
        joint, none = ca.vertcat(x, ca.DM.zeros(model.plant.b.numel(), 1), factors), ca.DM.zeros(0, 1)
        following, reading = model.predict(joint, u, none, step)[0], model.measure(joint, u, none)[0]
        self._run = ca.Function("row", [x, factors, u, step], [following, reading]).mapaccum(len(rows))
        self._x = np.zeros(len(model.states))  # no temperature above that of the start

    def residuals(self, factors: FloatArray) -> FloatArray:
        """Give simulated minus measured outlet temperature, K."""
        own = factors.copy()
        own[self._start] = self.outlet[0] / self._nominal
        repeated = np.repeat(own[:, None], len(self.outlet), axis=1)
        found = self._run(self._x, repeated, self._inputs, self._steps[None, :])[1].full()[0]
        return np.asarray(found - self.outlet)


def fit(graph: BondGraph, recordings: list[Recording], names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Give the factors of the named parameters and the residuals of all recordings, K."""
    places = [[item.name for item in graph.parameters].index(name) for name in names]

    def residuals(unknown: FloatArray) -> FloatArray:
        factors = np.ones(len(graph.parameters))
        factors[places] = unknown
        return np.concatenate([item.residuals(factors) for item in recordings])

    found = least_squares(residuals, np.ones(len(names)), bounds=(0.05, 20.0), diff_step=1e-4)
    return np.asarray(found.x), np.asarray(found.fun)


def main() -> None:
    """Fit to the recordings named on the command line and print the values."""
    graph = load_model(HERE / "model.yaml")
    model = build_step_model(build_plant(graph))
    recordings = [Recording(graph, model, path) for path in sys.argv[1:]]
    for names in (("K_film",), ("K_film", "C_pipe")):
        factors, residuals = fit(graph, recordings, names)
        for name, factor in zip(names, factors, strict=True):
            item = graph.parameter(name)
            print(f"{name}: {item.unit.from_si(item.nominal * factor):.4g} {item.unit.text}")
        print(f"residual: {np.sqrt(np.mean(residuals**2)):.2f} K, at most {np.abs(residuals).max():.1f} K")


if __name__ == "__main__":
    main()
