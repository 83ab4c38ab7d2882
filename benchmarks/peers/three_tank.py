"""Three tanks in a row, the example of the Fault Diagnosis Toolbox: how soon each of its six faults is found.

    python -m benchmarks.peers.three_tank [--seeds 100] [--first-seed 700] [--markdown FILE]

The plant, its controller, its noise and its faults are those of the toolbox (see examples/three_tank), and so are the
three residuals beside which we stand: an equation that the others leave over, in derivative, integral and mixed
causality. Their thresholds are the 99 % quantiles of healthy runs with other seeds, and three samples in a row beyond
one of them are an alarm; the residuals know their true start and do not count before the faults can begin. V3 and T3
enter the same equation and cannot be told apart by anybody, but a ramp in V2 is seen at once and so differs from both.
"""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from multiprocessing import Pool

import numpy as np

from benchmarks.shared.page import arguments, note, publish, quantile, seeds_of
from benchmarks.shared.plants import case
from benchmarks.shared.play import EPSILON, engine_of, samples, watched
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Diagnosis
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Simulation

# Median delays, s, after the start of the ramp: the residuals of the toolbox, measured with 20 seeds of another stream.
ASKED = {"V1": 1.6, "V2": 3.6, "V3": 4.35, "T1": 2.5, "T2": 2.8, "T3": 1.9}
BEGIN, END, SIZE = 6.0, 10.0, 0.3
STEP = 0.1  # s
ROWS, LONG_ROWS = 201, 6001  # 20 s as in the toolbox; 10 minutes of healthy running
LONG_RUNS = 10
CALIBRATION_SEEDS = range(100_000, 100_100)
QUANTILE, IN_A_ROW = 0.99, 3
HEADER = "fault | asked | faultbond: median, 95 % | missed | verdict | residuals: median, 95 % | missed"
HEADER += " | truth in the group at 10 s | at 20 s | groups at 20 s"
PROCESSES = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One run with one fault (`fault` "": none): alarms in s, None where there was none.

    alarm : of faultbond
    early, late : what its diagnosis cannot tell apart when the ramp ends, and at the end of the recording
    residuals : alarm of the residuals
    """

    fault: str
    seed: int
    alarm: float | None
    early: tuple[str, ...]
    late: tuple[str, ...]
    residuals: float | None

    def delay(self, alarm: float | None) -> float:
        """Give the delay from the start of the ramp; infinite without an alarm, or with one before it."""
        return math.inf if alarm is None or alarm < BEGIN else alarm - BEGIN


def record(fault: str, seed: int, rows: int = ROWS) -> Simulation:
    """Record one run; `fault` "" is none."""
    faults = [Fault(parameter=fault, value=SIZE, start=BEGIN, end=END)] if fault else []
    return case("three_tank", seed, faults, seconds=rows * STEP).recording


def watch(recording: Simulation) -> tuple[float | None, tuple[str, ...], tuple[str, ...]]:
    """Give the alarm of faultbond, and its groups when the ramp ends and at the end."""
    monitor, alarm, early = Monitor(engine_of("three_tank")[1]), None, None
    for sample, _, report in watched(monitor, samples(recording)):
        if report.detection is not None and alarm is None:
            alarm = report.detection.time
        if abs(sample.time - END) < 0.5 * STEP:
            early = monitor.finish()
    return alarm, _group(early), _group(monitor.finish())


def _group(diagnosis: Diagnosis | None) -> tuple[str, ...]:
    candidates = diagnosis.candidates if diagnosis is not None else ()
    return tuple(sorted("+".join(item.parameters) for item in candidates if item.group))


def residuals(recording: Simulation) -> FloatArray:
    """Give the three residuals of the toolbox, shape (n, 3), as its generated code computes them.

    Source: Frisk and others, IEEE Trans. SMC-A 42 (2012) 1216, figures 2, 3 and 12; Euler's rule as in the toolbox.
    """
    p1, q2, q0 = recording.outputs[:, 0], recording.outputs[:, 1], recording.inputs[:, 0]
    flow = q0 - np.diff(p1, prepend=0.0) / STEP  # q1, from the level of the first tank
    derivative = flow - q2 - np.diff(p1 - flow, prepend=0.0) / STEP
    derivative[:2] = 0.0  # as in the toolbox, which has no differences there yet
    integral, mixed = np.zeros(p1.size), np.zeros(p1.size)
    first = second = lower = third = 0.0  # p1, p2 of the one; p2, p3 of the other
    for k in range(p1.size):
        integral[k], mixed[k] = first - p1[k], lower - third - q2[k]
        between = first - second
        first, second = first + STEP * (q0[k] - between), second + STEP * (between - q2[k])
        lower, third = lower + STEP * (flow[k] - q2[k]), third + STEP * (q2[k] - third)
    mixed[0] = 0.0
    return np.column_stack([derivative, integral, mixed])


@cache
def limits() -> tuple[float, ...]:
    """Give the threshold of each residual, from healthy runs that are not otherwise used."""
    seen = [np.abs(residuals(run)[run.time >= BEGIN - EPSILON]) for run in map(_healthy, CALIBRATION_SEEDS)]
    return tuple(float(value) for value in np.quantile(np.concatenate(seen), QUANTILE, axis=0))


def _healthy(seed: int) -> Simulation:
    return record("", seed)


def judge(recording: Simulation) -> float | None:
    """Give the moment at which one residual was beyond its limit three times in a row."""
    counts = recording.time[:, None] >= BEGIN - EPSILON
    beyond = (np.abs(residuals(recording)) > limits()) & counts
    held = np.logical_and.reduce([beyond[k : beyond.shape[0] - IN_A_ROW + 1 + k] for k in range(IN_A_ROW)]).any(axis=1)
    return float(recording.time[np.argmax(held) + IN_A_ROW - 1]) if held.any() else None


def play(job: tuple[str, int, int]) -> Outcome:
    """Record one run (fault, seed, rows), and see what both make of it."""
    fault, seed, rows = job
    recording = record(fault, seed, rows)
    alarm, early, late = watch(recording)
    return Outcome(fault=fault, seed=seed, alarm=alarm, early=early, late=late, residuals=judge(recording))


def row(fault: str, outcomes: Sequence[Outcome]) -> tuple[str, ...]:
    """Give the line of one fault."""
    ours = [outcome.delay(outcome.alarm) for outcome in outcomes]
    theirs = [outcome.delay(outcome.residuals) for outcome in outcomes]
    missed = sum(map(math.isinf, ours))
    groups = Counter(", ".join(outcome.late) for outcome in outcomes)
    return (
        fault,
        f"{ASKED[fault]:g} s, none missed",
        _delays(ours),
        str(missed),
        "met" if quantile(ours, 0.5) <= ASKED[fault] + EPSILON and not missed else "falls short",
        _delays(theirs),
        str(sum(map(math.isinf, theirs))),
        _percent([fault in outcome.early for outcome in outcomes]),
        _percent([fault in outcome.late for outcome in outcomes]),
        "; ".join(f"{name or 'none'} ({count})" for name, count in groups.most_common(3)),
    )


def _delays(values: Sequence[float]) -> str:
    both = (quantile(values, part) for part in (0.5, 0.95))
    return ", ".join("never" if math.isinf(value) else f"{value:.2f} s" for value in both)


def _percent(right: Sequence[bool]) -> str:
    return f"{100 * sum(right) / len(right):.0f} %"


def false_alarms(title: str, outcomes: Sequence[Outcome]) -> str:
    """Say in how many healthy runs each alarmed."""
    ours = sum(outcome.alarm is not None for outcome in outcomes)
    theirs = sum(outcome.residuals is not None for outcome in outcomes)
    return f"{title}: false alarms in {ours} of {len(outcomes)} runs, of the residuals in {theirs}."


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    words = "Three tanks in a row: how soon each fault is found."
    chosen = arguments(words, argv, seeds=100, first_seed=700)
    seeds = seeds_of(chosen)
    limits()  # before there are other processes
    with Pool(PROCESSES) as pool:
        outcomes = {fault: pool.map(play, [(fault, seed, ROWS) for seed in seeds]) for fault in ("", *ASKED)}
        long = pool.map(play, [("", seed, LONG_ROWS) for seed in seeds[:LONG_RUNS]])
    early = sum(o.alarm is not None and o.alarm < BEGIN for fault in ASKED for o in outcomes[fault])
    notes = (
        false_alarms("Healthy, 20 s", outcomes[""]),
        false_alarms("Healthy, 10 min", long),
        f"With a fault, {early} of {len(ASKED) * len(seeds)} alarms came before it.",
        note(f"Seeds {seeds[0]} to {seeds[-1]}"),
    )
    rows = [row(fault, outcomes[fault]) for fault in ASKED]
    publish("peers.three_tank", chosen, (HEADER.split(" | "), rows), " ".join(notes))


if __name__ == "__main__":
    main()
