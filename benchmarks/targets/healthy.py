"""Rows of a healthy tank, as many as wanted, simulated."""

from functools import cache

import numpy as np

from benchmarks.shared.plants import graph_of
from benchmarks.trust.promise import tank

SEED = 40


@cache
def healthy_rows(count: int) -> bytes:
    """Give a recording as CSV, a row each second; six digits, as in the example."""
    made, graph = tank(SEED, float(count), False), graph_of("tank")
    names = [*(item.name for item in graph.inputs), *(item.name for item in graph.sensors)]
    cells = (",".join(f"{value:.6g}" for value in row) for row in np.hstack([made.inputs, made.outputs]))
    return "\n".join(
        (",".join(("time", *names)), *(f"{time:.0f},{row}" for time, row in zip(made.time, cells, strict=True)), "")
    ).encode()
