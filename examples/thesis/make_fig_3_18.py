"""Make the recording of the summing store, thesis figure 3.19: `python make_fig_3_18.py`."""

from pathlib import Path

import numpy as np

from faultbond.io import write_recording
from faultbond.model.text import load_model
from faultbond.simulate import Inputs, columns, simulate

HERE = OUT = Path(__file__).parent
ROWS, RATE = 300, 10.0  # half a minute at 10 Hz


def main() -> None:
    """Write fig_3_18.csv: the input is 1, and the output rises from zero."""
    graph = load_model(HERE / "fig_3_18.yaml")
    inputs = Inputs(time=np.arange(ROWS) / RATE, values=np.ones((ROWS, 1)))
    write_recording(OUT / "fig_3_18.csv", columns(graph, simulate(graph, inputs, seed=1), digits=6))


if __name__ == "__main__":
    main()
