"""Make the recordings of the three tanks: `python make_three_tank.py`.

The plant of Frisk and others, IEEE Trans. SMC-A 42 (2012) 1216, as their toolbox simulates it: empty at the start, the
flow q0 into the first tank set by a feedback of all three pressures, without delay, so that p1 follows a sine. A fault
is added to a flow (V1, V2, V3) or to what flows into a tank (T1, T2, T3); its ramp takes 4 s. These equations are
written here once more, so that the plant does not share its code with the engine.
"""

from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solve_continuous_are

from faultbond.arrays import FloatArray
from faultbond.io import write_recording
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Fault, Simulation, columns

HERE = Path(__file__).parent
ROWS, STEP = 201, 0.1  # 20 s
NOISE = np.array([0.01, 0.01])  # p1, q2; q0 has none
NAMES = ("V1", "V2", "V3", "T1", "T2", "T3")
RAMP = {name: Fault(parameter=name, value=0.3, start=6.0, end=10.0) for name in NAMES}
# Rates of p1, p2, p3 by p1, p2, p3 (all resistances and areas are 1), by q0, and by the six faults.
A = np.array([[-1.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -2.0]])
B = np.array([1.0, 0.0, 0.0])
E = np.array([[-1.0, 0, 0, 1, 0, 0], [1, -1, 0, 0, 1, 0], [0, 1, -1, 0, 0, 1]])
_INPUT_COST = 0.5
_TOLERANCE = 1e-9


def feedback() -> tuple[FloatArray, float]:
    """Give the linear-quadratic gains of the pressures, and that of the reference, which p1 then keeps at rest."""
    riccati = solve_continuous_are(A, B[:, None], np.eye(3), np.array([[_INPUT_COST]]))
    gains = B @ riccati / _INPUT_COST
    return gains, float(-1.0 / np.linalg.solve(A - np.outer(B, gains), B)[0])


def reference(time: FloatArray | float) -> FloatArray | float:
    """Give the value that p1 is to have."""
    return 0.2 * np.sin(2.0 * np.pi * time / 10.0) + 1.0


def sizes(faults: Sequence[Fault], time: FloatArray) -> FloatArray:
    """Give the sizes of the six faults, shape (n, 6)."""
    given = np.zeros((time.size, len(NAMES)))
    for fault in faults:
        width = max((fault.end if fault.end is not None else fault.start) - fault.start, 1e-12)
        given[:, NAMES.index(fault.parameter)] = (fault.value or 0.0) * np.clip((time - fault.start) / width, 0.0, 1.0)
    return given


@lru_cache(maxsize=32)
def course(faults: tuple[Fault, ...], rows: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give time (n,), pressures (n, 3) and flow q0 (n,) without noise."""
    time: FloatArray = np.asarray(np.arange(rows) * STEP, dtype=np.float64)
    gains, lead = feedback()

    def control(moment: FloatArray | float, pressures: FloatArray) -> FloatArray:
        return np.asarray(np.maximum(lead * reference(moment) - gains @ pressures, 0.0))

    def rates(moment: float, pressures: FloatArray) -> FloatArray:
        fault = sizes(faults, np.array([moment]))[0]
        return np.asarray(A @ pressures + B * control(moment, pressures) + E @ fault)

    solved = solve_ivp(rates, (0.0, time[-1]), np.zeros(3), t_eval=time, rtol=_TOLERANCE, atol=_TOLERANCE, max_step=0.1)
    return time, np.asarray(solved.y.T), control(time, solved.y)


def record(graph: BondGraph, seed: int | None, faults: Sequence[Fault] = (), rows: int = ROWS) -> Simulation:
    """Record p1, q2 and q0; no noise where `seed` is None."""
    time, pressures, q0 = course(tuple(faults), rows)
    given = sizes(faults, time)
    outputs = np.column_stack([pressures[:, 0], pressures[:, 1] - pressures[:, 2] + given[:, 1]])
    if seed is not None:
        outputs = outputs + NOISE * np.random.default_rng(seed).standard_normal(outputs.shape)
    return Simulation(
        time=time,
        inputs=q0[:, None],
        outputs=outputs,
        true_inputs=q0[:, None],
        states=pressures,
        parameters=given[:, [NAMES.index(item.name) for item in graph.parameters]],
        state_names=("store1.q", "store2.q", "store3.q"),
        seed=seed,
        error=_TOLERANCE,
    )


def main() -> None:
    """Write healthy.csv and fault_valve1.csv: 0.3 more through the first valve, from 6 s on within 4 s."""
    graph = load_model(HERE / "model.yaml")
    write_recording(HERE / "healthy.csv", columns(graph, record(graph, seed=1), digits=6))
    write_recording(HERE / "fault_valve1.csv", columns(graph, record(graph, seed=2, faults=[RAMP["V1"]]), digits=6))


if __name__ == "__main__":
    main()
