"""The figures of thesis 6.2.1, without noise: values of R and L that make three observations of a motor consistent.

The fault is not told; ours is R from 3 to 6 ohm. Two records are made: one by backward Euler, for which the formulas
of the constraint analysis are exact, and one as a motor in continuous time gives it.
"""

from functools import cache

import numpy as np

from benchmarks.shared.plants import EXAMPLES
from benchmarks.thesis.chart import Curve, panel
from benchmarks.thesis.page import Figure, Parts, figure, row
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import parameters
from faultbond.algebra.solving.backward_euler import plant_of
from faultbond.algebra.solving.solution import evaluate_root
from faultbond.algebra.solving.solve import solve
from faultbond.arrays import FloatArray
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import SAMPLE_TIME, build_components, frame_name
from faultbond.equations.constraint_network import build_network
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Fault, Inputs, random_steps, simulate

RATE, SECONDS, SEED = 50.0, 10.0, 3
FAULTY = 6.0  # ohm


def figures() -> tuple[Figure, ...]:
    """Give the figures of 6.2.1."""
    return figure_6_3(), figure_6_4(), figure_6_5()


@cache
def model() -> BondGraph:
    """Give the motor of table 6.3."""
    return load_model(EXAMPLES / "dc_motor" / "model.yaml")


@cache
def voltage() -> tuple[FloatArray, FloatArray]:
    """Give times and the applied voltage."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    generator = np.random.default_rng([SEED, 1])
    return time, random_steps(time, generator, low=2.0, high=12.0, shortest=1.0, longest=4.0)


@cache
def backward_euler() -> FloatArray:
    """Give the speed of the faulty motor by backward Euler, (n,)."""
    time, applied = voltage()
    value = {item.name: item.nominal for item in model().parameters} | {"R": FAULTY}
    dt = 1.0 / RATE
    matrix = np.array([[value["L"] / dt + value["R"], value["K"]], [-value["K"], value["J"] / dt + value["C"]]])
    state, speeds = np.zeros(2), np.zeros(time.size)
    for k in range(1, time.size):
        right = [applied[k] + value["L"] / dt * state[0], value["J"] / dt * state[1]]
        state = np.linalg.solve(matrix, right)
        speeds[k] = state[1]
    return speeds


@cache
def continuous() -> FloatArray:
    """Give the speed of the same motor in continuous time, (n,)."""
    time, applied = voltage()
    fault = Fault(parameter="R", value=FAULTY, start=0.0)
    return simulate(model(), Inputs(time=time, values=applied[:, None]), (fault,), seed=None).outputs[:, 0]


@cache
def needed(name: str, *, exact: bool = True) -> FloatArray:
    """Give the value of a parameter that makes each three observations consistent, (n,)."""
    graph = model()
    network = build_components(graph, build_network(graph, assign_causality(graph)))
    route = find_route(network, parameters(network, (name,)))
    root = solve(network, route, plant_of(graph)).roots[0]
    fixed = {item.name: item.nominal for item in graph.parameters} | {SAMPLE_TIME: 1.0 / RATE}
    _, applied = voltage()
    speed = backward_euler() if exact else continuous()
    found = np.full(applied.size, np.nan)
    for k in range(route.observations, applied.size):
        frames = range(route.observations + 1)
        samples = {frame_name(("V", back)): float(applied[k - back]) for back in frames}
        samples |= {frame_name(("omega", back)): float(speed[k - back]) for back in frames}
        found[k] = float(evaluate_root(root, fixed | samples)[name])
    return found


@figure("6.2.1")
def figure_6_3() -> Parts:
    """A simulation of a DC motor."""
    time, applied = voltage()
    yield "`examples/dc_motor/model.yaml`, table 6.3, R = 6 ohm in the plant; the voltage is not told."
    yield panel(
        "V, V, and omega, rad/s", Curve("V", time, applied, 1, dashed=True), Curve("omega", time, backward_euler())
    )
    yield row("samples a second", "50", f"{RATE:g}")


def _spread(values: FloatArray) -> tuple[float, float]:
    """Give the median of values and their spread from 10 % to 90 %, as a part of it."""
    there = values[np.isfinite(values)]
    low, middle, high = np.quantile(there, [0.1, 0.5, 0.9])
    return float(middle), float((high - low) / abs(middle))


def _small(value: float) -> str:
    return "below 1e-6" if value < 1e-6 else f"{value:.2g}"


@figure("6.2.1")
def figure_6_4() -> Parts:
    """The values of R that make the observations consistent."""
    (middle, spread), (other, scatter) = _spread(needed("R")), _spread(needed("R", exact=False))
    time, _ = voltage()
    yield panel(
        "R, ohm",
        Curve("record by backward Euler", time, needed("R")),
        Curve("in continuous time", time, needed("R", exact=False), 1, dots=True),
        low=0.0,
        high=12.0,
    )
    yield row(
        "R, and its spread from 10 % to 90 %",
        "essentially constant",
        f"{middle:.4g} ohm, {_small(spread)}",
        same=spread < 0.01,
        otherwise="rounding",
    )
    yield row(
        "{L, K, J, C}",
        "no conflict set",
        "no conflict set" if spread < 0.01 else "conflict set",
        same=spread < 0.01,
        otherwise="rounding",
    )
    yield row(
        "the same from a record in continuous time",
        "-",
        f"{other:.3g} ohm, {scatter:.2f}",
        remark="the formula is exact for backward Euler only, by which the thesis must have simulated",
    )


@figure("6.2.1")
def figure_6_5() -> Parts:
    """The values of L that make the observations consistent."""
    middle, spread = _spread(needed("L"))
    time, _ = voltage()
    yield panel("L, H", Curve("L", time, needed("L"), dots=True), low=-30.0, high=30.0)
    yield row(
        "L, and its spread from 10 % to 90 %",
        "clearly not constant",
        f"{middle:.3g} H, {spread:.1f}",
        same=spread > 0.5,
        otherwise="constant",
    )
    yield row(
        "{R, K, J, C}",
        "conflict set",
        "conflict set" if spread > 0.5 else "no conflict set",
        same=spread > 0.5,
        otherwise="constant",
    )
