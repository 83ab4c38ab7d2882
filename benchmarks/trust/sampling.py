"""The same water tank recorded at 1, 10 and 100 Hz: how soon faults are found, which is named first, how large it is.

python -m benchmarks.trust.sampling [--seeds N] [--first-seed K] [--ways "1 Hz;10 Hz, averaged"]
"""

from argparse import ArgumentParser
from dataclasses import dataclass
from itertools import chain

import numpy as np

from benchmarks.shared.plants import EXAMPLES
from faultbond.app.rows import sample_of
from faultbond.io.grid import Grid, Row
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine

FAULTS = {"K1": 1.6, "K3": 0.8, "K4": 1.25, "K6": 12.0, "K7": 1.25, "K8": 0.92}
ONSET, WITHIN, LENGTH = 1500.0, 1200.0, 3000.0  # s; the onset is anywhere in the second after that
SETTINGS = {  # rows per second, sample_time, row_time
    "1 Hz": (1, "1 s", ""),
    "10 Hz, skipped": (10, "1 s", ""),
    "10 Hz, averaged": (10, "1 s", "0.1 s"),
    "10 Hz, each row": (10, "0.1 s", ""),
    "100 Hz, averaged": (100, "1 s", "0.01 s"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """What came of one run: s from the onset to the alarm, the first name, and the relative error of the true value.

    delay: None where there was no alarm; error: None where the truth is not among the candidates.
    """

    delay: float | None
    first: tuple[str, ...]
    probability: float
    error: float | None


def tank(sample_time: str, row_time: str = "") -> BondGraph:
    """The tank of the examples, at another rate."""
    text = (EXAMPLES / "tank" / "model.yaml").read_text(encoding="utf-8")
    lines = f"sample_time: {sample_time}" + (f"\nrow_time: {row_time}" if row_time else "")
    return parse_model(text.replace("sample_time: 1 s", lines))


def recorded(rate: int, parameter: str, seed: int) -> tuple[float, list[Row]]:
    """Rows of a run with a fault, and when it begins, s."""
    generator = np.random.default_rng([seed, 31])
    time = np.arange(0.0, LENGTH, 1.0 / rate)
    inputs = [random_steps(time, generator, low=low, high=90, shortest=100, longest=300) for low in (50, 30)]
    onset = ONSET + float(generator.uniform())
    fault = [Fault(parameter=parameter, factor=FAULTS[parameter], start=onset)] if parameter else []
    plant, values = tank(f"{1.0 / rate} s"), np.array(inputs).T
    made = simulate(plant, Inputs(time=time, values=values), fault, seed=seed, start={"tank.q": 0.2})
    rows = zip(time.tolist(), made.inputs, made.outputs, strict=True)
    return onset, [Row(time=t, u=u, y=y) for t, u, y in rows]


def judged(core: Core, onset: float, rows: list[Row], parameter: str) -> Trial:
    """Watch rows as `run` does."""
    grid, monitor, delay, last = Grid(core.spec.sample_time, row_time=core.spec.row_time), Monitor(core), None, None
    for point in chain((point for row in rows for point in grid.push(row)), grid.finish()):
        report = monitor.step(sample_of(point))
        if report.detection is not None:
            delay = report.detection.time - onset
        last = report.diagnosis or last
        if point.time > onset + WITHIN:
            break
    if last is None:
        return Trial(delay=delay, first=(), probability=0.0, error=None)
    true = next((item for item in last.candidates if item.parameters == (parameter,)), None)
    error = None
    if true is not None:
        error = true.suspects[0].estimate / ((true.suspects[0].nominal or 1.0) * FAULTS[parameter]) - 1.0
    best = last.candidates[0]
    return Trial(delay=delay, first=best.parameters, probability=best.probability, error=error)


def main() -> None:
    """Print each run, and a line of each way."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first-seed", type=int, default=200)
    parser.add_argument("--ways", default=";".join(SETTINGS), help="some of: " + "; ".join(SETTINGS))
    wishes = parser.parse_args()
    ways = [way for way in SETTINGS if way in wishes.ways.split(";")]
    found: dict[str, list[tuple[str, Trial]]] = {way: [] for way in ways}
    for way in ways:
        rate, sample_time, row_time = SETTINGS[way]
        core = build_engine(tank(sample_time, row_time))[1]
        for seed in range(wishes.first_seed, wishes.first_seed + wishes.seeds):
            for parameter in ("", *FAULTS):
                trial = judged(core, *recorded(rate, parameter, seed), parameter)
                print(f"{way}; seed {seed}; {parameter or 'healthy'}: {trial}", flush=True)
                found[way].append((parameter, trial))
    print("| recording | false alarms | found | delay, median | first | sure and wrong | error, median |")
    for way, trials in found.items():
        faulty = [(name, item) for name, item in trials if name]
        delays = [item.delay for _, item in faulty if item.delay is not None and item.delay >= 0.0]
        errors = [abs(item.error) for _, item in faulty if item.error is not None]
        right = sum(item.first == (name,) for name, item in faulty)
        wrong = sum(item.first != (name,) and item.probability > 0.95 for name, item in faulty)
        false = sum(item.delay is not None and (not name or item.delay < 0.0) for name, item in trials)
        middle = f"{np.median(delays):.0f} s" if delays else "-"
        off = f"{100 * np.median(errors):.1f} %" if errors else "-"
        of = f"{len(delays)} of {len(faulty)} | {middle} | {right} of {len(faulty)} | {wrong} | {off}"
        print(f"| {way} | {false} | {of} |")


if __name__ == "__main__":
    main()
