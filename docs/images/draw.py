"""The figures of docs/sensors.md, from the examples: `python docs/images/draw.py [DIR]` writes them as SVG."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import parameters
from faultbond.algebra.solving.backward_euler import plant_of
from faultbond.algebra.solving.solution import evaluate_root
from faultbond.algebra.solving.solve import solve
from faultbond.analysis.groups import largest_angles
from faultbond.analysis.operation import operate
from faultbond.analysis.ranks import ReducedSensitivities, bases, reduce
from faultbond.analysis.replay import recorded_runs
from faultbond.analysis.sensitivity import build_recursion
from faultbond.analysis.testable import generic_run
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import SAMPLE_TIME, build_components, frame_name
from faultbond.equations.constraint_network import build_network
from faultbond.equations.step import StepModel
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.engine import build_engine, build_model

HERE = Path(__file__).resolve().parent
EXAMPLES = HERE.parents[1] / "examples"
INK, PALE, FIRST, SECOND = "#222222", "#bbbbbb", "#1f5fa8", "#c4541a"
STEEP = 30.0  # degrees from which a cell of the tables is white
SHOWN = 1000  # samples of the motor's recordings


def main() -> None:
    """Draw all figures."""
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else HERE
    for name, draw in FIGURES.items():
        (folder / name).write_text(draw(), encoding="utf-8")


# What the figures show


def angles() -> str:
    """Tables of the angle between what any two parameters of the tank do: in general, and in its healthy recording."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    model = build_model(graph)
    recursion = build_recursion(model.plant)
    points = points_of(graph, "tank/healthy.csv")
    times, inputs = np.array([item.time for item in points]), np.array([item.u for item in points])
    content = model.contents(model.reference_state, [item.nominal for item in graph.parameters]).full()[:, 0]
    runs = recorded_runs(model, recursion, times, inputs, content)
    noise = np.array([item.noise for item in graph.sensors])
    tables = [
        ("everything excited", reduce([generic_run(model, recursion)], noise)),
        ("in healthy.csv", reduce(runs, noise)),
    ]
    parts = [table(title, reduced, 60.0 + 350.0 * k) for k, (title, reduced) in enumerate(tables)]
    note = text(60, 345, "degrees between what the two parameters do to the sensors; below 10: hard to tell apart")
    return page(730, 365, [*parts, note])


def table(title: str, reduced: ReducedSensitivities, left: float) -> str:
    """One table of angles."""
    names, size, top = reduced.parameters, 38.0, 60.0
    base = bases(reduced, [(k,) for k in range(len(names))])
    parts = [text(left, 20, title, weight="bold")]
    for row, name in enumerate(names):
        y = top + size * row
        parts.append(text(left - 8, y + 24, name, anchor="end"))
        parts.append(text(left + size * (row + 0.5), top - 8, name, anchor="middle"))
        for column in range(row):
            angle = float(largest_angles(base[[row]], base[[column]])[0])
            parts.append(cell(left + size * column, y, size, angle))
    return "".join(parts)


def cell(x: float, y: float, size: float, angle: float) -> str:
    """One angle, the darker the smaller."""
    part = min(angle / STEEP, 1.0)
    shade = "#" + "".join(f"{round(dark + part * (255 - dark)):02x}" for dark in (31, 95, 168))
    box = f'<rect x="{x:g}" y="{y:g}" width="{size - 2:g}" height="{size - 2:g}" fill="{shade}" stroke="{PALE}"/>'
    color = "#ffffff" if part < 0.5 else INK
    return box + text(x + size / 2 - 1, y + 23, f"{angle:.0f}" if angle >= 1 else "<1", anchor="middle", color=color)


def moved_input() -> str:
    """What a leak and a wider outlet of the tank do to its pressure, with the outlet valve at rest and moved."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    time = np.arange(1601.0)
    noise = graph.sensors[1].noise
    frames = []
    for k, level in enumerate((50.0, 10.0)):
        u_out = np.where(time < 900, 50.0, level)
        inputs = Inputs(time=time, values=np.column_stack([np.full(len(time), 50.0), u_out]))
        healthy = simulate(graph, inputs, seed=None).outputs[:, 1]
        leak = graph.parameter("K6").nominal + 25e-6  # m^3/s more than usual
        outlet = graph.parameter("K4").nominal + 25e-6 / 50.0  # the same at u_out = 50 %
        faults = [Fault(parameter="K6", value=leak, start=300.0), Fault(parameter="K4", value=outlet, start=300.0)]
        lines = [(simulate(graph, inputs, [fault], seed=None).outputs[:, 1] - healthy) / noise for fault in faults]
        title = "u_out stays at 50 %" if level == 50.0 else "u_out goes to 10 % at 900 s"
        axes = Axes(left=70.0 + 350.0 * k, x=(0.0, 1600.0), y=(-20.0, 0.0))
        frames += [axes.frame(title, "s", "pressure, from healthy, in noise sd" if k == 0 else "")]
        frames += [axes.line(time, lines[1], SECOND, 3.5), axes.line(time, lines[0], FIRST, 1.4)]
    return page(730, 330, [*frames, key(70, 318, FIRST, "leak K6 + 2.5e-5 m^3/s"), key(260, 318, SECOND, OUTLET)])


OUTLET = "outlet K4 + 5e-7 m^3/s/percent"


def formula() -> str:
    """The motor's R by its closed form, sample by sample, and by the filter, without and with the current measured."""
    parts = []
    plants = (("dc_motor", "V and omega", 1200.0), ("dc_motor_current", "V, omega and i", 12.0))
    for k, (folder, title, reach) in enumerate(plants):
        time, by_formula, by_filter = resistance(folder)
        axes = Axes(left=70.0 + 350.0 * k, x=(0.0, 20.0), y=(-reach, reach))
        seen = np.where(np.abs(by_formula) < reach, by_formula, np.nan)
        share = 100.0 * float(np.mean(np.isfinite(seen)))
        parts += [axes.frame(f"{title}: {share:.0f} % of the dots are in view", "s", "R in ohm" if k == 0 else "")]
        parts += [axes.dots(time, seen, PALE), axes.line(time, by_filter, SECOND, 2.5)]
    return page(730, 330, [*parts, key(70, 318, PALE, "closed form"), key(260, 318, SECOND, "healthy filter")])


def resistance(folder: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give time, R by the closed form and R by the healthy filter on the first samples of a healthy recording."""
    graph = load_model(EXAMPLES / folder / "model.yaml")
    model = build_model(graph)
    points = points_of(graph, f"{folder}/healthy.csv")[:SHOWN]
    spec, engine = build_engine(graph)
    run = operate(model, spec, engine, [Sample(time=p.time, dt=p.dt, u=p.u, y=p.y) for p in points])
    by_filter = run.mean[:, spec.parameter_slice][:, 0] * graph.parameters[0].nominal
    time = np.array([point.time for point in points])
    return time, closed_form(graph, model, points), np.interp(time, run.time, by_filter)


def closed_form(graph: BondGraph, model: StepModel, points: Sequence[GridPoint]) -> FloatArray:
    """Give R of each sample by its closed form, nan where there are too few samples."""
    network = build_components(graph, build_network(graph, assign_causality(graph)))
    question = parameters(network, ("R",))
    root = solve(network, find_route(network, question), plant_of(graph)).roots[0]
    names = [*network.inputs, *network.outputs]
    series = np.array([[*point.u, *point.y] for point in points])
    fixed = {item.name: item.nominal for item in graph.parameters} | {SAMPLE_TIME: graph.sample_time or 1.0}
    found = np.full(len(points), np.nan)
    for k in range(3, len(points)):
        samples = {frame_name((n, back)): float(series[k - back, c]) for c, n in enumerate(names) for back in range(4)}
        found[k] = float(evaluate_root(root, fixed | samples)["R"])
    return found


def points_of(graph: BondGraph, recording: str) -> list[GridPoint]:
    """Give an example's recording on the grid."""
    return list(on_grid(read_rows(str(EXAMPLES / recording), columns_of(graph)), Grid(graph.sample_time)))


# Lines and letters


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """A frame with its left edge on the page and the ranges of its scales."""

    left: float
    x: tuple[float, float]
    y: tuple[float, float]
    top: float = 35.0
    width: float = 290.0
    height: float = 230.0

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Give where a point of the curve stands on the page."""
        across = (x - self.x[0]) / (self.x[1] - self.x[0])
        up = (y - self.y[0]) / (self.y[1] - self.y[0])
        return self.left + self.width * across, self.top + self.height * (1.0 - up)

    def frame(self, title: str, below: str, beside: str) -> str:
        """The frame with ticks, a title and the names of the axes."""
        bottom = self.top + self.height
        parts = [f'<rect x="{self.left:g}" y="{self.top:g}" width="290" height="230" fill="none" stroke="{INK}"/>']
        parts.append(text(self.left, self.top - 12, title, weight="bold"))
        ticks = [(self.place(float(value), 0)[0], f"{value:g}") for value in np.linspace(*self.x, 5)[:-1]]
        parts += [text(x, bottom + 16, words, anchor="middle") for x, words in ticks]
        parts.append(text(self.left + self.width, bottom + 16, below, anchor="end"))
        steps = [(self.place(0, float(value))[1], f"{value:g}") for value in np.linspace(*self.y, 5)]
        parts += [text(self.left - 6, y + 4, words, anchor="end") for y, words in steps]
        turn = f'transform="rotate(-90 {self.left - 45:g} {bottom - 115:g})"'
        parts.append(text(self.left - 45, bottom - 115, beside, anchor="middle", more=turn))
        return "".join(parts)

    def line(self, x: FloatArray, y: FloatArray, color: str, width: float) -> str:
        """A curve, broken where it has no value, without the points on a straight line."""
        kept = sorted({0, len(x) - 1, *bends(x, y)})
        spots = " ".join("{:.1f},{:.1f}".format(*self.place(float(x[k]), float(y[k]))) for k in kept)
        return f'<polyline points="{spots}" fill="none" stroke="{color}" stroke-width="{width:g}"/>'

    def dots(self, x: FloatArray, y: FloatArray, color: str) -> str:
        """A dot for each value."""
        spots = (self.place(float(a), float(b)) for a, b in zip(x, y, strict=True) if np.isfinite(b))
        marks = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in spots)
        return f'<path d="{marks}" stroke="{color}" stroke-width="2.4" stroke-linecap="round"/>'


def bends(x: FloatArray, y: FloatArray) -> Iterable[int]:
    """Give about every tenth point, and those about a jump."""
    jumps = np.flatnonzero(np.abs(np.diff(y)) > 0.02 * float(np.ptp(y)))
    yield from range(0, len(x), max(1, len(x) // 150))
    yield from (int(k) + shift for k in jumps for shift in (0, 1))


def text(
    x: float, y: float, words: str, *, anchor: str = "start", weight: str = "normal", color: str = INK, more: str = ""
) -> str:
    """Words on the page."""
    shown = words.replace("&", "&amp;").replace("<", "&lt;")
    place = f'x="{x:g}" y="{y:g}" text-anchor="{anchor}"'
    return f'<text {place} font-weight="{weight}" fill="{color}" {more}>{shown}</text>'


def key(x: float, y: float, color: str, words: str) -> str:
    """An entry of the legend."""
    return f'<rect x="{x:g}" y="{y - 8:g}" width="18" height="6" fill="{color}"/>' + text(x + 26, y, words)


def page(width: float, height: float, parts: Iterable[str]) -> str:
    """The figure."""
    size = f'viewBox="0 0 {width:g} {height:g}" width="{width:g}" height="{height:g}"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} font-family="sans-serif" font-size="13">'
    return f'{head}\n<rect width="100%" height="100%" fill="#ffffff"/>\n' + "\n".join(parts) + "\n</svg>\n"


FIGURES = {
    "angles.svg": angles,
    "moved_input.svg": moved_input,
    "formula.svg": formula,
}

if __name__ == "__main__":
    main()
