"""Make the recordings of the DC motor with its current measured: `python make_dc_motor_current.py`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from faultbond.io import write_recording
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Effects, Fault, Inputs, Simulation, columns, random_steps, simulate

HERE = Path(__file__).parent
ROWS, RATE = 3000, 50.0  # one minute at 50 Hz
EFFECTS = Effects(spread=0.015)  # the plant's parameters are off by up to 1.5 %
FAULTS = (
    Fault(parameter="R", factor=2.0, start=20.0),
    Fault(parameter="L", factor=2.0, start=20.0),
    Fault(parameter="J", factor=1.5, start=20.0),
)


def record(graph: BondGraph, seed: int, faults: Sequence[Fault] = (), rows: int = ROWS) -> Simulation:
    """Feed random steps of voltage, each held for 1 s to 4 s, to the motor at rest."""
    time = np.arange(rows) / RATE
    generator = np.random.default_rng([seed, 1])
    voltage = random_steps(time, generator, low=2.0, high=12.0, shortest=1.0, longest=4.0)
    inputs = Inputs(time=time, values=voltage[:, None])
    return simulate(graph, inputs, faults, seed=seed, effects=EFFECTS)


def main() -> None:
    """Write healthy.csv and fault_triple.csv."""
    graph = load_model(HERE / "model.yaml")
    write_recording(HERE / "healthy.csv", columns(graph, record(graph, seed=1), digits=6))
    write_recording(HERE / "fault_triple.csv", columns(graph, record(graph, seed=2, faults=FAULTS), digits=6))


if __name__ == "__main__":
    main()
