"""The figures of thesis 7.1: the output valve of the tank."""

from functools import cache

import numpy as np

from benchmarks.shared.plants import EXAMPLES
from benchmarks.thesis import tank
from benchmarks.thesis.chart import Curve, panel
from benchmarks.thesis.page import Figure, Parts, figure, row, short
from benchmarks.thesis.tank import MINUTE
from faultbond.arrays import FloatArray
from faultbond.model.text import parse_model
from faultbond.simulate import Inputs, simulate

OPENINGS = (10.0, 20.0, 30.0, 40.0, 50.0, 65.0)  # %
FULL, NEARLY_EMPTY = 1.2, 0.1  # m


def figures() -> tuple[Figure, ...]:
    """Give the figures of 7.1."""
    return figure_7_4(), figure_7_5()


@cache
def emptying() -> tuple[FloatArray, tuple[FloatArray, ...]]:
    """Give the depths over time as the tank empties through the output valve, the input valve shut."""
    text = (EXAMPLES / "tank" / "model.yaml").read_text(encoding="utf-8").replace("K7: 255 ", "K7: 2.55e6 ")
    graph = parse_model(text, file="input valve shut")
    time = np.arange(0.0, 40 * MINUTE, 10.0)
    start = {"tank.q": FULL * tank.METRE / graph.parameter("K3").nominal}
    depths = []
    for opening in OPENINGS:
        made = simulate(
            graph, Inputs(time=time, values=np.tile([0.0, opening], (time.size, 1))), seed=None, start=start
        )
        depth = made.outputs[:, 1] / tank.METRE
        depths.append(np.where(depth >= NEARLY_EMPTY, depth, np.nan))
    return time, tuple(depths)


def outflows() -> FloatArray:
    """Give the flow out at each opening, from how the depth falls, l/s."""
    time, depths = emptying()
    slopes = [np.polyfit(time[np.isfinite(item)], item[np.isfinite(item)], 1)[0] for item in depths]
    return -np.array(slopes) * tank.METRE / tank.nominal("K3") / tank.LITRE


@figure("7.1")
def figure_7_4() -> Parts:
    """The level as the tank empties, for several openings of the output valve."""
    time, depths = emptying()
    bends = max(float(np.nanmax(np.abs(_straight(time, item)))) for item in depths)
    yield (
        "The measurements are lost. This is the model of table 7.2, its input valve shut, which the law of K7 "
        "alone does not do: with Q_in = 0 % open 0.09 l/s still flow."
    )
    yield panel(
        "depth, m",
        *(
            Curve(f"{opening:g} %", time / MINUTE, depth, k)
            for k, (opening, depth) in enumerate(zip(OPENINGS, depths, strict=True))
        ),
        below="min",
        low=0.0,
    )
    yield row(
        "largest deviation from a straight line",
        "rate essentially constant",
        f"{bends * 1000:.1f} mm",
        remark="by the law of the outlet",
    )


def _straight(time: FloatArray, depth: FloatArray) -> FloatArray:
    there = np.isfinite(depth)
    return np.asarray(depth[there] - np.polyval(np.polyfit(time[there], depth[there], 1), time[there]))


@figure("7.1")
def figure_7_5() -> Parts:
    """The characteristic of the output valve."""
    flows = outflows()
    slope, offset = np.polyfit(OPENINGS, flows * tank.LITRE, 1)
    yield "Found from the slopes of figure 7.4."
    yield panel(
        "flow out, l/s",
        Curve("from the level", np.array(OPENINGS), flows),
        Curve(
            "K4 u + K6",
            np.array(OPENINGS),
            (tank.nominal("K4") * np.array(OPENINGS) + tank.nominal("K6")) / tank.LITRE,
            1,
            dashed=True,
        ),
        below="% open",
        low=0.0,
    )
    yield row("slope K4", "2.35e-6", short(slope), remark="of the model, by the level")
    yield row("flow at 0 %, K6", "1.04e-5", short(offset), remark="of the model, by the level")
    yield row("range in which it is linear", "10 % to 65 %", "assumed everywhere")
    yield row(
        "pump pressure constant below a flow of",
        "16 l/sec",
        f"largest flow {tank.recording('healthy').outputs[:, 0].max() / tank.LITRE:.2f} l/s",
        same=False,
        otherwise="this model reaches 0.29 l/s, 17.6 l/min, at most, so the recordings do not show which unit is meant",
    )
