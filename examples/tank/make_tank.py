"""Make the recordings of the water tank: `python make_tank.py`.

The operator's recipe: raise the level to 1.2 m, then seven phases of other valve openings, each until a level is
reached or its time is over, the last six again and again. The plant is not the model: its parameters are off by up to
3 %, its valves follow with a lag of 3 s, and their curves are a little wrong.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.io import write_recording
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Decide, Effects, Fault, Policy, Simulation, columns, simulate

HERE = Path(__file__).parent
ROWS = 4920  # 82 minutes at 1 Hz
PASCAL_PER_METRE = 9810.0
EFFECTS = Effects(spread=0.03, lag=3.0, curve={"u_in": 0.03, "u_out": 0.02})
# u_in and u_out in percent; whether the level shall rise; to which level in m; for how many minutes at most
PHASES = (
    (90, 20, True, 1.20, 10),
    (20, 65, False, 0.50, 18),
    (60, 40, True, 1.10, 12),
    (10, 50, False, 0.50, 17),
    (80, 50, True, 1.20, 12),
    (25, 60, False, 0.40, 18),
    (45, 20, True, 1.00, 12),
    (15, 65, False, 0.45, 15),
)
FIRST_OPENINGS, FIRST_RAMP = (20.0, 60.0), 300.0  # percent; seconds of the ramp to the first phase
REPEAT_FROM = 2
NEARLY_EMPTY = 0.12  # m


def recipe() -> Decide:
    """Begin the recipe; the result gives the valve openings for a time and the last readings."""
    phase, since = 0, 0.0

    def decide(time: float, outputs: FloatArray) -> Sequence[float]:
        nonlocal phase, since
        level = outputs[1] / PASCAL_PER_METRE  # nan at the first row: no phase ends
        u_in, u_out, rising, target, minutes = PHASES[phase]
        reached = level >= target if rising else level <= max(target, NEARLY_EMPTY)
        if reached or time - since > 60 * minutes:
            phase, since = phase + 1 if phase + 1 < len(PHASES) else REPEAT_FROM, time
            u_in, u_out, *_ = PHASES[phase]
        if phase > 0:
            return u_in, u_out
        part = min(1.0, time / FIRST_RAMP)
        return tuple(a + part * (b - a) for a, b in zip(FIRST_OPENINGS, (u_in, u_out), strict=True))

    return decide


def record(graph: BondGraph, seed: int, faults: Sequence[Fault] = (), rows: int = ROWS) -> Simulation:
    """Run the recipe from a random level between 0.4 m and 0.7 m."""
    level = np.random.default_rng([seed, 1]).uniform(0.4, 0.7)
    start = {"tank.q": level * PASCAL_PER_METRE / graph.parameter("K3").nominal}
    policy = Policy(time=np.arange(rows, dtype=np.float64), begin=recipe)
    return simulate(graph, policy, faults, seed=seed, effects=EFFECTS, start=start)


def main() -> None:
    """Write healthy.csv and fault_pipe.csv: the pipe's resistance K1 x 1.85 (2.41e11 to 4.45e11) at 1500 s."""
    graph = load_model(HERE / "model.yaml")
    pipe = Fault(parameter="K1", factor=1.85, start=1500.0)
    write_recording(HERE / "healthy.csv", columns(graph, record(graph, seed=1), digits=6))
    write_recording(HERE / "fault_pipe.csv", columns(graph, record(graph, seed=2, faults=[pipe]), digits=6))


if __name__ == "__main__":
    main()
