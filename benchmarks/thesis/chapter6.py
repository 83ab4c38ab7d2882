"""The figures of thesis 6.2.2, with noise: which of {L, K, J, C} and {R, K, J, C} of the motor is a conflict set."""

from functools import cache

import numpy as np

from benchmarks.shared.plants import recipe_module
from benchmarks.thesis.chapter6_exact import FAULTY, SEED, model
from benchmarks.thesis.chart import Curve, panel
from benchmarks.thesis.page import Figure, Parts, figure, percent, row
from benchmarks.thesis.watch import Banked, Curves, bank, watch
from faultbond.arrays import FloatArray
from faultbond.simulate import Fault, Simulation
from faultbond.thesis.online.settings import Erratum, Settings

ONSET, ROWS = 10.0, 2000  # s and samples of the noisy run
NAMES = {"R": "{L, K, J, C}", "L": "{R, K, J, C}"}


def figures() -> tuple[Figure, ...]:
    """Give the figures of 6.2.2."""
    return (
        figure_6_6(),
        estimated("R", "6.7"),
        estimated("L", "6.8"),
        predicted("R", "6.9"),
        predicted("L", "6.10"),
        error_index("R", "6.11"),
        error_index("L", "6.12"),
    )


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
        "noise/signal ratio of V", "about 2 %", percent(noise, 1), same=0.01 < noise < 0.03, otherwise="another voltage"
    )
    yield row("alarm after the fault", "-", _delay(run()), bank=_delay(banked()))


def _delay(found: Curves | Banked) -> str:
    return "never" if found.detection is None else f"{found.detection.time - ONSET:.1f} s"


def _of(name: str, found: Curves) -> int:
    return found.tested.index(name)


def estimated(name: str, number: str) -> Figure:
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
    rows_ = [
        row(
            "standard deviation in the first and the last 2 s",
            "fluctuates, then settles",
            f"{early:.2f}, {late:.3f} {unit}",
            same=late < early,
            otherwise="it does not settle",
        ),
        row(
            "value at the end",
            "one value, not told",
            f"{ends[0]:.3g} {unit}",
            bank=f"{other.estimate(name)[-1]:.3g} {unit}",
            remark=f"true {truth:g} {unit}" if name == "R" else "R is what is faulty, so none is right",
        ),
    ]
    if name == "R":
        rows_.append(
            row(
                "value at the end, least squares as printed",
                "the same figure",
                f"{ends[1]:.3g} {unit}",
                same=False,
                remark="erratum: propagated signals carry noise into both sides; blended states do better",
            )
        )
    return Figure(
        number,
        f"the estimate for the parameter of {name}",
        "6.2.2",
        panels=(panel(f"{name}, {unit}", *(curves), below="s after the alarm", low=0.0, high=2.0 * truth),),
        rows=tuple(rows_),
    )


def predicted(name: str, number: str) -> Figure:
    """Give the output that a hypothesis expects."""
    found = run()
    rows, time = _since(found)
    measured, expected = found["measured"][rows, 0], found["predicted"][rows, 0, _of(name, found)]
    late = time > 2.0
    off = float(np.sqrt(np.nanmean((measured - expected)[late] ** 2) / np.nanmean(measured[late] ** 2)))
    close = name == "R"
    return Figure(
        number,
        f"estimated and actual output for {NAMES[name]}",
        "6.2.2",
        panels=(
            panel(
                "omega, rad/s",
                Curve("actual", time, measured, 1, dashed=True),
                Curve("estimated", time, expected),
                below="s after the alarm",
            ),
        ),
        rows=(
            row(
                "error over signal from 2 s on, rms",
                "close" if close else "does not follow closely",
                f"{off:.3f}",
                same=(off < 0.1) == close,
                otherwise="the states are corrected at every sample",
            ),
        ),
    )


def error_index(name: str, number: str) -> Figure:
    """Give the error index of a hypothesis."""
    found, other = run(), banked()
    rows, time = _since(found)
    values = found["errors"][rows, _of(name, found)]
    late = values[time > 4.0]
    low, high = float(late.min()), float(late.max())
    printed = {"R": "0.02 to 0.08", "L": "0.2 to 0.75"}[name]
    same = {"R": high < 0.08, "L": low > 0.15}[name]
    return Figure(
        number,
        f"the error index for {NAMES[name]}",
        "6.2.2",
        panels=(
            panel(
                "error index",
                Curve("index", time, values),
                below="s after the alarm",
                low=0.0,
                high=max(0.1, 1.1 * float(values.max())),
            ),
        ),
        rows=(
            row(
                "from 4 s on",
                printed,
                f"{low:.3f} to {high:.3f}",
                same=same,
                otherwise="the least squares of the thesis are not told; its states may run free of the output",
            ),
            row(
                f"probability of {{{name}}} at the end",
                "-",
                _weight(found, name),
                bank=percent(other.probability(name)[-1]),
                remark="a weight, not a frequency, for `classic`",
            ),
        ),
    )


def _weight(found: Curves, name: str) -> str:
    best = found.diagnosis.candidates if found.diagnosis is not None else ()
    return next((percent(item.probability) for item in best if item.parameters == (name,)), "-")
