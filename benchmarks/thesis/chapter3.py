"""The figure of thesis 3.9 that shows results: noise through a component with memory."""

import numpy as np

from benchmarks.thesis.chart import Curve, panel
from benchmarks.thesis.page import Figure, row
from benchmarks.thesis.routes import through_a_store

RATE = 10.0  # samples a second


def figures() -> tuple[Figure, ...]:
    """Give figure 3.19."""
    _, _, (x, y, ahead, back) = through_a_store()
    time = np.arange(x.size) / RATE
    signals = (
        ("A: measured input", time, x),
        ("B: measured output", time, y),
        ("C: output from the input and the last output", time[1:], ahead),
        ("D: input from the output and the last output", time[1:], back),
    )
    off = float(np.std(ahead - y[1:]))
    ratio = float(np.std(back) / np.std(x))
    figure = Figure(
        "3.19",
        "propagating noise through dynamic components",
        "3.9",
        words="The numbers are in the table of figures 3.18 and 3.19 above.",
        panels=tuple(panel(title, Curve("value", moments, values)) for title, moments, values in signals),
        rows=(
            row("(C) against (B), rms", "very close", f"{off:.3f}", same=off < 0.05, otherwise="more noise"),
            row("noise of (D) over that of (A)", "very bad", f"{ratio:.0f}", same=ratio > 5.0, otherwise="less noise"),
        ),
    )
    return (figure,)
