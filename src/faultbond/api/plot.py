"""A figure of a run, drawn by matplotlib."""

from typing import TYPE_CHECKING, Any

import numpy as np

from faultbond.contract.findings import Candidate, History
from faultbond.errors import FaultbondError
from faultbond.model.graph import BondGraph

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, HIGH = 9.0, 2.2  # inches, of the figure and of each of its parts
BAND = 2.0  # standard deviations
MOST = 5  # candidates that are drawn
BESIDE: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.0, 1.0), "fontsize": "small"}  # a legend


def plotted(graph: BondGraph, history: History) -> "Figure":
    """Draw each sensor beside what was expected of it, and the probabilities of the candidates.

    Raises
    ------
    FaultbondError
        Where matplotlib is not installed.
    """
    try:
        from matplotlib import pyplot  # noqa: PLC0415 - optional
    except ImportError as error:
        raise FaultbondError("Drawing needs matplotlib. Install it with: pip install 'faultbond[plot]'") from error
    n = len(graph.sensors) + bool(history.diagnoses)
    figure, parts = pyplot.subplots(n, sharex=True, squeeze=False, figsize=(WIDTH, HIGH * n), layout="constrained")
    axes = list(parts[:, 0])
    for k, part in enumerate(axes[: len(graph.sensors)]):
        _draw_sensor(part, graph, history, k)
    if history.diagnoses:
        _draw_candidates(axes[-1], history)
    for part in axes:
        for found in history.detections:
            part.axvline(found.time, color="tab:red", linewidth=1)
            part.axvline(found.change_time, color="tab:red", linewidth=1, linestyle=":")
        for accepted in history.accepted:
            part.axvline(accepted.time, color="tab:green", linewidth=1)
    axes[-1].set_xlabel("time (s)")
    axes[0].set_title(graph.name)
    return figure


def _draw_sensor(part: "Axes", graph: BondGraph, history: History, k: int) -> None:
    """Draw a sensor: measured, and expected with a band of two standard deviations, in its unit."""
    sensor = graph.sensors[k]
    offset, factor = sensor.unit.offset, sensor.unit.factor
    time, expected = history.time, (history.expected[:, k] - offset) / factor
    band = BAND * history.expected_sd[:, k] / factor
    part.fill_between(time, expected - band, expected + band, color="tab:orange", alpha=0.3, linewidth=0)
    part.plot(time, (history.measured[:, k] - offset) / factor, color="tab:blue", linewidth=0.8, label="measured")
    part.plot(time, expected, color="tab:orange", linewidth=0.8, label="expected")
    part.set_ylabel(f"{sensor.name} ({sensor.unit.text})" if sensor.unit.text else sensor.name)
    part.legend(**BESIDE)


def _draw_candidates(part: "Axes", history: History) -> None:
    """Draw the probabilities of the candidates that were likeliest at some time."""
    times = np.array([item.time for item in history.diagnoses])
    told = [{_name(item): item.probability for item in diagnosis.candidates} for diagnosis in history.diagnoses]
    highest: dict[str, float] = {}
    for found in reversed(told):
        highest |= {name: max(value, highest.get(name, 0.0)) for name, value in found.items()}
    for name in sorted(highest, key=lambda name: -highest[name])[:MOST]:
        part.plot(times, [found.get(name, 0.0) for found in told], marker=".", markersize=3, label=name)
    part.set_ylim(-0.02, 1.02)
    part.set_ylabel("probability")
    part.legend(**BESIDE)


def _name(candidate: Candidate) -> str:
    return " + ".join(candidate.parameters or candidate.components)
