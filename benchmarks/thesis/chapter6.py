"""The figures of thesis 6.2: values of R and L that make three observations of a motor consistent.

With noise, too: which of {L, K, J, C} and {R, K, J, C} is a conflict set. The fault is not told; ours is R from 3 to 6
ohm. Without noise two records are made: one by backward Euler, for which the formulas of the constraint analysis are
exact, and one as a motor in continuous time gives it.
"""

from functools import cache

import numpy as np

from benchmarks.shared.ladders import components_of
from benchmarks.shared.plants import graph_of, recipe_module
from benchmarks.thesis.chart import Curve, panel
from benchmarks.thesis.page import Figure, Parts, drawn, figure, percent, row
from benchmarks.thesis.watch import Banked, Curves, bank, watch
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import parameters
from faultbond.algebra.solving.backward_euler import plant_of
from faultbond.algebra.solving.solution import evaluate_root
from faultbond.algebra.solving.solve import solve
from faultbond.arrays import FloatArray
from faultbond.equations.component_network import SAMPLE_TIME, frame_name
from faultbond.model.graph import BondGraph
from faultbond.simulate import Fault, Inputs, Simulation, random_steps, simulate
from faultbond.thesis.online.settings import Erratum, Settings

RATE, SECONDS, SEED = 50.0, 10.0, 3
FAULTY = 6.0  # ohm
ONSET, ROWS = 10.0, 2000  # s and samples of the noisy run


def noisy() -> tuple[Figure, ...]:
    """Give the figures of 6.2.2."""
    found = [figure_6_6()]
    for k, (caption, parts) in enumerate(
        (
            ("the estimate for the parameter of {name}", estimated),
            ("estimated and actual output for {set}", predicted),
            ("the error index for {set}", error_index),
        )
    ):
        for j, (name, healthy) in enumerate({"R": "{L, K, J, C}", "L": "{R, K, J, C}"}.items()):
            title = caption.format(name=name, set=healthy)
            found.append(drawn(f"6.{7 + 2 * k + j}", title, "6.2.2", parts(name)))
    return tuple(found)


# 6.2.1: without noise


def model() -> BondGraph:
    """Give the motor of table 6.3."""
    return graph_of("dc_motor")


@cache
def voltage() -> tuple[FloatArray, FloatArray]:
    """Give times and the applied voltage."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    generator = np.random.default_rng([SEED, 1])
    return time, random_steps(time, generator, low=2.0, high=12.0, shortest=1.0, longest=4.0)


@cache
def backward_euler() -> FloatArray:
    """Give the speed of the faulty motor by backward Euler, (n,)."""
    time, applied = voltage()
    value = {item.name: item.nominal for item in model().parameters} | {"R": FAULTY}
    dt = 1.0 / RATE
    matrix = np.array([[value["L"] / dt + value["R"], value["K"]], [-value["K"], value["J"] / dt + value["C"]]])
    state, speeds = np.zeros(2), np.zeros(time.size)
    for k in range(1, time.size):
        right = [applied[k] + value["L"] / dt * state[0], value["J"] / dt * state[1]]
        state = np.linalg.solve(matrix, right)
        speeds[k] = state[1]
    return speeds


@cache
def continuous() -> FloatArray:
    """Give the speed of the same motor in continuous time, (n,)."""
    time, applied = voltage()
    fault = Fault(parameter="R", value=FAULTY, start=0.0)
    return simulate(model(), Inputs(time=time, values=applied[:, None]), (fault,), seed=None).outputs[:, 0]


@cache
def needed(name: str, *, exact: bool = True) -> FloatArray:
    """Give the value of a parameter that makes each three observations consistent, (n,)."""
    graph = model()
    network = components_of(graph)
    route = find_route(network, parameters(network, (name,)))
    root = solve(network, route, plant_of(graph)).roots[0]
    fixed = {item.name: item.nominal for item in graph.parameters} | {SAMPLE_TIME: 1.0 / RATE}
    _, applied = voltage()
    speed = backward_euler() if exact else continuous()
    found = np.full(applied.size, np.nan)
    for k in range(route.observations, applied.size):
        frames = range(route.observations + 1)
        samples = {frame_name(("V", back)): float(applied[k - back]) for back in frames}
        samples |= {frame_name(("omega", back)): float(speed[k - back]) for back in frames}
        found[k] = float(evaluate_root(root, fixed | samples)[name])
    return found


@figure("6.2.1")
def figure_6_3() -> Parts:
    """A simulation of a DC motor."""
    time, applied = voltage()
    yield "`examples/dc_motor/model.yaml`, table 6.3, R = 6 ohm in the plant; the voltage is not told."
    yield panel(
        "V, V, and omega, rad/s", Curve("V", time, applied, 1, dashed=True), Curve("omega", time, backward_euler())
    )
    yield row("samples a second | 50", f"{RATE:g}")


def _spread(values: FloatArray) -> tuple[float, float]:
    """Give the median of values and their spread from 10 % to 90 %, as a part of it."""
    there = values[np.isfinite(values)]
    low, middle, high = np.quantile(there, [0.1, 0.5, 0.9])
    return float(middle), float((high - low) / abs(middle))


def _small(value: float) -> str:
    return "below 1e-6" if value < 1e-6 else f"{value:.2g}"


@figure("6.2.1")
def figure_6_4() -> Parts:
    """The values of R that make the observations consistent."""
    (middle, spread), (other, scatter) = _spread(needed("R")), _spread(needed("R", exact=False))
    time, _ = voltage()
    yield panel(
        "R, ohm",
        Curve("record by backward Euler", time, needed("R")),
        Curve("in continuous time", time, needed("R", exact=False), 1, dots=True),
        low=0.0,
        high=12.0,
    )
    yield row(
        "R, and its spread from 10 % to 90 % | essentially constant",
        f"{middle:.4g} ohm, {_small(spread)}",
        same=spread < 0.01,
        otherwise="rounding",
    )
    yield row(
        "{L, K, J, C} | no conflict set",
        "no conflict set" if spread < 0.01 else "conflict set",
        same=spread < 0.01,
        otherwise="rounding",
    )
    yield row(
        "the same from a record in continuous time",
        f"{other:.3g} ohm, {scatter:.2f}",
        remark="the formula is exact for backward Euler only, by which the thesis must have simulated",
    )


@figure("6.2.1")
def figure_6_5() -> Parts:
    """The values of L that make the observations consistent."""
    middle, spread = _spread(needed("L"))
    time, _ = voltage()
    yield panel("L, H", Curve("L", time, needed("L"), dots=True), low=-30.0, high=30.0)
    yield row(
        "L, and its spread from 10 % to 90 % | clearly not constant",
        f"{middle:.3g} H, {spread:.1f}",
        same=spread > 0.5,
        otherwise="constant",
    )
    yield row(
        "{R, K, J, C} | conflict set",
        "conflict set" if spread > 0.5 else "no conflict set",
        same=spread > 0.5,
        otherwise="constant",
    )


# 6.2.2: with noise


@cache
def recording() -> Simulation:
    """Simulate the motor with noise, R becoming faulty at 10 s."""
    fault = Fault(parameter="R", value=FAULTY, start=ONSET)
    made: Simulation = recipe_module("dc_motor").record(model(), SEED, (fault,), ROWS)
    return made


@cache
def run(*printed: Erratum) -> Curves:
    """Watch it with method `classic`, singles tested."""
    return watch(model(), recording(), Settings(noise=0.02, largest=1, printed=frozenset(printed)))


@cache
def banked() -> Banked:
    """Watch it with method `bank`."""
    return bank(model(), recording())


def _since(found: Curves) -> tuple[slice, FloatArray]:
    """Give the rows from the alarm on, and the times since then."""
    begin = found.alarm or 0
    return slice(begin, None), found.time[begin:] - found.time[begin]


@figure("6.2.2")
def figure_6_6() -> Parts:
    """Simulated measurements with 2 % of noise."""
    made = recording()
    chosen = (made.time >= ONSET) & (made.time < ONSET + 20.0)
    noise = float(np.std(made.inputs[:, 0] - made.true_inputs[:, 0]) / np.sqrt(np.mean(made.inputs[:, 0] ** 2)))
    yield (
        "R changes from 3 to 6 ohm at 10 s, and `classic` has to detect that first; the next figures count from "
        "its alarm."
    )
    yield panel(
        "V, V, and omega, rad/s",
        Curve("V", made.time[chosen], made.inputs[chosen, 0], 1, dashed=True),
        Curve("omega", made.time[chosen], made.outputs[chosen, 0]),
    )
    yield row(
        "noise/signal ratio of V | about 2 %", percent(noise, 1), same=0.01 < noise < 0.03, otherwise="another voltage"
    )
    yield row("alarm after the fault", _delay(run()), _delay(banked()))


def _delay(found: Curves | Banked) -> str:
    return "never" if found.detection is None else f"{found.detection.time - ONSET:.1f} s"


def _of(name: str, found: Curves) -> int:
    return found.tested.index(name)


def estimated(name: str) -> Parts:
    """Give the least squares estimate of a parameter."""
    found, literal, other = run(), run(Erratum.SIGNALS), banked()
    unit, truth = {"R": ("ohm", FAULTY), "L": ("H", model().parameter("L").nominal)}[name]
    curves = []
    for k, (label, item) in enumerate((("classic", found), ("as printed", literal))):
        rows, time = _since(item)
        curves.append(Curve(label, time, item["estimates"][rows, 0, _of(name, item)], k, dashed=k > 0))
    times = other.times - (found.detection.time if found.detection else 0.0)
    curves.append(Curve("bank", times[times >= 0], other.estimate(name)[times >= 0], 2, dashed=True))
    values = found["estimates"][_since(found)[0], 0, _of(name, found)]
    early, late = (float(np.nanstd(item)) for item in (values[:100], values[-100:]))
    ends = [float(item["estimates"][-1, 0, _of(name, item)]) for item in (found, literal)]
    yield panel(f"{name}, {unit}", *curves, below="s after the alarm", low=0.0, high=2.0 * truth)
    what, otherwise = "standard deviation in the first and the last 2 s", "it does not settle"
    told = f"{early:.2f}, {late:.3f} {unit}"
    yield row(f"{what} | fluctuates, then settles", told, same=late < early, otherwise=otherwise)
    remark, theirs = "R is what is faulty, so none is right", f"{other.estimate(name)[-1]:.3g} {unit}"
    remark = f"true {truth:g} {unit}" if name == "R" else remark
    yield row("value at the end | one value, not told", f"{ends[0]:.3g} {unit}", theirs, remark=remark)
    if name == "R":
        what, told = "value at the end, least squares as printed | the same figure", f"{ends[1]:.3g} {unit}"
        remark = "erratum: propagated signals carry noise into both sides; blended states do better"
        yield row(what, told, same=False, remark=remark)


def predicted(name: str) -> Parts:
    """Give the output that a hypothesis expects."""
    found = run()
    rows, time = _since(found)
    measured, expected = found["measured"][rows, 0], found["predicted"][rows, 0, _of(name, found)]
    late = time > 2.0
    off = float(np.sqrt(np.nanmean((measured - expected)[late] ** 2) / np.nanmean(measured[late] ** 2)))
    both = Curve("actual", time, measured, 1, dashed=True), Curve("estimated", time, expected)
    yield panel("omega, rad/s", *both, below="s after the alarm")
    printed, same = ("close", off < 0.1) if name == "R" else ("does not follow closely", off >= 0.1)
    otherwise = "the states are corrected at every sample"
    yield row(f"error over signal from 2 s on, rms | {printed}", f"{off:.3f}", same=same, otherwise=otherwise)


def error_index(name: str) -> Parts:
    """Give the error index of a hypothesis."""
    found, other = run(), banked()
    rows, time = _since(found)
    values = found["errors"][rows, _of(name, found)]
    low, high = float(values[time > 4.0].min()), float(values[time > 4.0].max())
    printed, same = {"R": ("0.02 to 0.08", high < 0.08), "L": ("0.2 to 0.75", low > 0.15)}[name]
    top = max(0.1, 1.1 * float(values.max()))
    yield panel("error index", Curve("index", time, values), below="s after the alarm", low=0.0, high=top)
    otherwise = "the least squares of the thesis are not told; its states may run free of the output"
    yield row(f"from 4 s on | {printed}", f"{low:.3f} to {high:.3f}", same=same, otherwise=otherwise)
    best = found.diagnosis.candidates if found.diagnosis is not None else ()
    ours = next((percent(item.probability) for item in best if item.parameters == (name,)), "-")
    theirs, remark = percent(other.probability(name)[-1]), "a weight, not a frequency, for `classic`"
    yield row(f"probability of {{{name}}} at the end", ours, theirs, remark=remark)
