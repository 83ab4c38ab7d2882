"""Make the recordings of the RLC circuit: `python make_rlc.py`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from faultbond.io import write_recording
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Effects, Fault, Inputs, Simulation, columns, simulate, sines

HERE = Path(__file__).parent
ROWS, RATE = 2400, 40.0  # one minute at 40 Hz
EFFECTS = Effects(spread=0.015)  # the plant's parameters are off by up to 1.5 %
FAULTS = (Fault(parameter="C", factor=1.34, start=20.0),)


def record(graph: BondGraph, seed: int, faults: Sequence[Fault] = (), rows: int = ROWS) -> Simulation:
    """Feed two sines, 10 V at 0.25 Hz and 4 V at 0.6 Hz, of random phase, to the circuit at rest."""
    time = np.arange(rows) / RATE
    generator = np.random.default_rng([seed, 1])
    first, second = generator.uniform(0.0, 2 * np.pi, 2)
    voltage = sines(time, [(10.0, 0.25, first), (4.0, 0.6, second)])
    inputs = Inputs(time=time, values=voltage[:, None])
    return simulate(graph, inputs, faults, seed=seed, effects=EFFECTS)


def main() -> None:
    """Write healthy.csv and fault_capacitor.csv."""
    graph = load_model(HERE / "model.yaml")
    write_recording(HERE / "healthy.csv", columns(graph, record(graph, seed=1), digits=6))
    write_recording(HERE / "fault_capacitor.csv", columns(graph, record(graph, seed=2, faults=FAULTS), digits=6))


if __name__ == "__main__":
    main()
