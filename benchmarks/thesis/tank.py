"""The water tank of thesis chapter 7: its runs, healthy and faulty, watched by both methods.

The rig's recordings are lost. Ours are simulated with valves that lag and are a little wrong and parameters off by up
to 3 %, with faults at the moments and of the sizes that the thesis tells.
"""

from collections.abc import Sequence
from functools import cache

import numpy as np

from benchmarks.shared.plants import graph_of, recipe_module, tank_case
from benchmarks.thesis.chart import Curve, Panel, panel
from benchmarks.thesis.watch import Banked, Curves, bank, watch
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection
from faultbond.model.graph import BondGraph
from faultbond.simulate import Fault, Inputs, Simulation, simulate
from faultbond.thesis.online.settings import Erratum, Settings

SEED = 7
MINUTE, LITRE, METRE = 60.0, 1e-3, 9810.0  # s, m3, Pa
PIPE = Fault(parameter="K1", value=4.45e11, start=41 * MINUTE)
LEAK = Fault(parameter="K6", value=8.7e-5, start=10 * MINUTE)
EARLY_PIPE = Fault(parameter="K1", value=4.45e11, start=10 * MINUTE)
FAULTS: dict[str, tuple[Fault, ...]] = {"healthy": (), "pipe": (PIPE,), "leak": (LEAK,), "both": (EARLY_PIPE, LEAK)}
LENGTHS = {"healthy": 82.0, "pipe": 82.0, "leak": 41.0, "both": 41.0}  # min
LITERAL = (Erratum.STEPS, Erratum.AVERAGE, Erratum.LIMIT)  # the detection of 5.4 as it is printed
SINGLES, PAIRS = 1, 2  # size of the sets that are tested
OPENINGS, START = (20.0, 60.0), 0.5  # % at the start, m
STEPS = ((5.0, 40.0, 65.0), (27.0, 10.0, 65.0), (44.0, 60.0, 75.0), (62.0, 20.0, 60.0), (77.0, 90.0, 75.0))  # min, %, %
HIGH = 0.2 * LITRE  # m3/s
EVERY = 4  # samples between the points of the curves


def graph() -> BondGraph:
    """Give the model."""
    return graph_of("tank")


@cache
def recording(name: str) -> Simulation:
    """Simulate one of the four runs.

    The two of 82 minutes step at the moments of figure 7.9; those with a leak follow the recipe of the example, which
    keeps the tank from running empty.
    """
    if name in ("leak", "both"):
        return tank_case(SEED, FAULTS[name], seconds=LENGTHS[name] * MINUTE).recording
    time = np.arange(0.0, LENGTHS[name] * MINUTE)
    moments = np.array([0.0, *(part for minute, *_ in STEPS for part in (minute - 1 / 60, minute))]) * MINUTE
    openings = np.array([OPENINGS, OPENINGS, *(item for *_, a, b in STEPS for item in ((a, b), (a, b)))])[:-1]
    openings[1] = STEPS[0][1:]  # a ramp to the first step
    values = np.array([np.interp(time, moments, column) for column in openings.T]).T
    start = {"tank.q": START * METRE / nominal("K3")}
    effects = recipe_module("tank").EFFECTS
    return simulate(graph(), Inputs(time=time, values=values), FAULTS[name], seed=SEED, effects=effects, start=start)


@cache
def run(name: str, largest: int, *printed: Erratum) -> Curves:
    """Watch a run with method `classic`, told 2 % of noise and a model that is 95 % accurate."""
    settings = Settings(noise=0.02, accuracy=0.95, largest=largest, printed=frozenset(printed))
    return watch(graph(), recording(name), settings, every=EVERY)


@cache
def banked(name: str) -> Banked:
    """Watch a run with method `bank`."""
    return bank(graph(), recording(name))


@cache
def explained(name: str, parameter: str, value: float) -> Curves:
    """Compare a run, from its fault on, with a model in which one parameter is another."""
    settings = Settings(noise=0.02, accuracy=0.95, largest=0)
    return watch(graph(), recording(name), settings, {parameter: value}, round(FAULTS[name][0].start), EVERY)


@cache
def effect_of_accuracy() -> float:
    """Give how much the expected flow of five minutes changes if n is 0.80, l/s."""
    made = tank_case(SEED, seconds=5 * MINUTE).recording
    rough, fine = (watch(graph(), made, Settings(noise=0.02, accuracy=n, largest=0)) for n in (0.80, 0.95))
    return float(np.max(np.abs(rough["expected"][:, 0] - fine["expected"][:, 0]))) / LITRE


def nominal(parameter: str) -> float:
    """Give the value of table 7.2."""
    return graph().parameter(parameter).nominal


def onset(name: str) -> float:
    """Give the moment of the fault, min."""
    return FAULTS[name][0].start / MINUTE


def when(detection: Detection | None) -> str:
    """Say when an alarm was raised."""
    return "never" if detection is None else clock(detection.time)


def clock(time: float) -> str:
    """Write a time in minutes and seconds."""
    return f"{int(time // 60)} min {round(time % 60):02d} s"


def window(found: Curves, first: float, last: float = np.inf) -> slice:
    """Give the rows between two moments, min."""
    return slice(
        int(np.searchsorted(found.time, first * MINUTE)), int(np.searchsorted(found.time, last * MINUTE, side="right"))
    )


def relative(found: Curves, output: int, first: float, last: float = np.inf) -> float:
    """Give the error of a prediction that it keeps 90 % of the time between two moments, over the rms of the output."""
    rows = window(found, first, last)
    measured, expected = found["measured"][rows, output], found["expected"][rows, output]
    return usual(measured, expected)


def by_flow(found: Curves, first: float) -> tuple[float, float]:
    """Give the median relative error of the flow while it is below and above 0.2 l/s, from a moment on (min)."""
    rows = window(found, first)
    measured, expected = found["measured"][rows, 0], found["expected"][rows, 0]
    off, high = np.abs(measured - expected) / measured, measured > HIGH
    return float(np.nanmedian(off[~high])), float(np.nanmedian(off[high]))


def bank_relative(name: str, output: int, first: float, last: float = np.inf) -> float:
    """Give the same of `bank`, against the raw samples."""
    made, other = recording(name), banked(name)
    rows = (made.time >= first * MINUTE) & (made.time <= last * MINUTE)
    return usual(made.outputs[rows, output], other.expected[rows, output])


def usual(measured: FloatArray, expected: FloatArray) -> float:
    """Give the error of nine in ten samples over the rms of all, without the moments at which valves settle."""
    return float(np.nanquantile(np.abs(measured - expected), 0.9) / np.sqrt(np.nanmean(measured**2)))


def usually(found: Curves, name: str, labels: Sequence[str]) -> dict[str, float]:
    """Give the mean of a curve of each test or hypothesis from 5 min after the alarm on, lowest first."""
    begin = float(found.time[found.alarm or 0]) / MINUTE + 5.0
    values = found[name][window(found, begin)].mean(axis=0)
    return {labels[k]: float(values[k]) for k in np.argsort(values, kind="stable")}


# Panels


def inputs(name: str) -> tuple[Panel, ...]:
    """Draw the openings of both valves."""
    made = recording(name)
    return tuple(
        panel(
            f"{letter}: {words} valve, %",
            Curve("opening", made.time / MINUTE, made.inputs[:, k]),
            below="min",
            low=0.0,
            high=100.0,
        )
        for k, (letter, words) in enumerate((("A", "input"), ("B", "output")))
    )


def outputs(name: str, letters: str = "AB") -> tuple[Panel, ...]:
    """Draw flow and depth as measured."""
    made = recording(name)
    return tuple(
        panel(
            f"{letter}: {words}",
            Curve("measured", made.time / MINUTE, made.outputs[:, k] / unit),
            below="min",
            mark=onset(name) if FAULTS[name] else None,
        )
        for k, (letter, words, unit) in enumerate(zip(letters, ("flow, l/s", "depth, m"), (LITRE, METRE), strict=True))
    )


def predicted(name: str, output: int, found: Curves, *, error: bool = False, also: bool = True) -> Panel:
    """Draw an output beside what the model of `classic` and, if wanted, that of `bank` expect."""
    unit, title = ((LITRE, "flow, l/s"), (METRE, "depth, m"))[output]
    time = found.time / MINUTE
    curves = [
        Curve("measured", time, found["measured"][:, output] / unit),
        Curve("expected", time, found["expected"][:, output] / unit, 1, dashed=True),
    ]
    if also:
        other = banked(name)
        curves.append(Curve("bank", other.time / MINUTE, other.expected[:, output] / unit, 2, dashed=True))
    if error:
        off = (found["measured"][:, output] - found["expected"][:, output]) / unit
        curves.append(Curve("error", time, off, 3))
    high = 1.15 * float(np.nanmax(found["measured"][:, output])) / unit
    low = min(0.0, float(np.nanmin(curves[-1].y))) if error else 0.0
    return panel(
        title, *(curves), below="min", low=max(low, -0.25 * high), high=high, mark=onset(name) if FAULTS[name] else None
    )


def index_panels(name: str, found: Curves, high: float = 0.25) -> tuple[Panel, ...]:
    """Draw the error index as the thesis prints it, averaged, and that of each output, with their limits."""
    time = found.time / MINUTE
    literal = found["index"].mean(axis=1)
    limit = 0.03 + 0.97 * np.exp(-(found.time - found.time[0]) / found.plan.settings.decay)
    mark = onset(name) if FAULTS[name] else None
    averaged = panel(
        "average of both outputs, as printed",
        Curve("index", time, literal),
        Curve("1 1/2 N", time, limit, 1, dashed=True),
        below="min",
        low=0.0,
        high=high,
        mark=mark,
    )
    each = panel(
        "each output, limit with model errors",
        Curve("flow", time, found["index"][:, 0]),
        Curve("limit", time, found["limit"][:, 0], dashed=True),
        Curve("depth", time, found["index"][:, 1], 1),
        Curve("limit", time, found["limit"][:, 1], 1, dashed=True),
        below="min",
        low=0.0,
        high=high,
        mark=mark,
    )
    return averaged, each


def many(
    found: Curves,
    values: FloatArray,
    labels: Sequence[str],
    title: str,
    leading: Sequence[str],
    low: float | None = 0.0,
    high: float | None = None,
) -> Panel:
    """Draw a curve for each test or hypothesis from the alarm on, the leading ones in colour."""
    begin = found.alarm or 0
    time = found.time[begin:] / MINUTE
    curves = [
        Curve(
            label.replace(", ", " ") if label in leading else "",
            time,
            values[begin:, k],
            list(leading).index(label) if label in leading else 0,
        )
        for k, label in enumerate(labels)
    ]
    ordered = sorted(curves, key=lambda item: item.color if item.label else len(leading))
    return panel(title, *(ordered), below="min", low=low, high=high)


def bank_panel(name: str, sets: Sequence[str]) -> Panel:
    """Draw the probabilities that `bank` gives to sets, from its alarm on."""
    other = banked(name)
    return panel(
        "bank: probability, %",
        *(
            Curve(label.replace(", ", " "), other.times / MINUTE, 100 * other.probability(*label.split(", ")), k)
            for k, label in enumerate(sets)
        ),
        below="min",
        low=0.0,
        high=100.0,
    )
