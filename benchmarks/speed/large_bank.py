"""Whether a large bank keeps up in real time: 20 parameters, sets of up to three, ten samples a second.

    python -m benchmarks.speed.large_bank [--markdown FILE]

Six tanks in a row with three sensors; a pipe is restricted. Each sample is a call of `step`, whose wall time is what
counts here. How long samples would wait if ten of them came each second is worked out from that.
"""

import time
from collections.abc import Sequence
from functools import cache
from itertools import accumulate

import numpy as np

from benchmarks.shared.ladders import six_tanks
from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.play import passed, samples
from benchmarks.speed.alone import n_filters
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.engine import build_engine

PERIOD = 0.1  # s between samples as they come
ROWS, SEED = 2000, 3
FAULT = Fault(parameter="R3", factor=2.0, start=700.0)
LATE = 0.5  # s


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("Whether a large bank keeps up with its plant.", argv)
    publish("speed.large_bank", chosen, note(), (("what", "got"), table(*play())))


def play() -> tuple[Monitor, FloatArray]:
    """Pass the samples of a run with a fault through a monitor; give it, and what each sample took, s."""
    core, given = _plant()
    monitor, taken = Monitor(core), []
    for sample in given:
        begin = time.perf_counter()
        monitor.step(sample)
        taken.append(time.perf_counter() - begin)
    _alarm(monitor)
    return monitor, np.array(taken)


def diagnosing(count: int) -> tuple[Monitor, list[Sample]]:
    """Give a monitor that diagnoses, the last `count` samples before the end of the run to come, and these samples."""
    core, given = _plant()
    monitor = passed(core, given[:-count])
    _alarm(monitor)
    return monitor, given[-count:]


@cache
def _plant() -> tuple[Core, list[Sample]]:
    """Give the core and a run with a fault."""
    graph = parse_model(f"{six_tanks()}max_faults: 3\n")
    moments: FloatArray = np.arange(ROWS, dtype=np.float64)
    opening = np.where(moments // 200.0 % 2 == 0, 40.0, 60.0)
    recording = simulate(graph, Inputs(time=moments, values=opening[:, None]), [FAULT], seed=SEED)
    return build_engine(graph)[1], samples(recording)


def _alarm(monitor: Monitor) -> int:
    """Give the sample of the alarm."""
    alarm = int(monitor.number("clock.alarm"))
    if alarm < 0:
        raise RuntimeError("no alarm was raised, so nothing was measured")
    return alarm


def waits(taken: FloatArray, period: float) -> FloatArray:
    """Give how long after each sample, s, the work on it ends, if one comes every `period` seconds."""
    arrived: FloatArray = period * np.arange(len(taken), dtype=np.float64)
    ends = accumulate(zip(arrived, taken, strict=True), lambda end, item: max(end, item[0]) + item[1], initial=0.0)
    return np.array(list(ends)[1:], dtype=np.float64) - arrived


def table(monitor: Monitor, taken: FloatArray) -> list[tuple[str, str]]:
    """Give the lines of the table; taken : (n_samples,), s."""
    spec, alarm = monitor.spec, _alarm(monitor)
    late, before, after = waits(taken, PERIOD), taken[spec.thresholds.warm_up_samples : alarm], taken[alarm + 1 :]
    counts = f"{len(spec.parameters)}; {len(spec.hypotheses)}; {len(spec.reserve)}"
    return [
        ("parameters; sets tested from the alarm on; in reserve", counts),
        ("filters", f"{n_filters(monitor)}"),
        ("a sample before the alarm, median", f"{1e3 * np.median(before):.2g} ms"),
        ("a sample after the alarm, median", f"{1e3 * np.median(after):.2g} ms"),
        ("the sample of the alarm", f"{taken[alarm]:.2g} s"),
        ("the slowest later sample, at which filters begin again", f"{after.max():.2g} s"),
        ("ten samples a second: the latest is worked on so long after it came", f"{late.max():.2g} s"),
        (f"time in which samples are more than {LATE} s late", f"{PERIOD * np.sum(late > LATE):.2g} s"),
        (f"of all {PERIOD * ROWS:.0f} s, the processor works", f"{taken.sum():.2g} s"),
    ]


if __name__ == "__main__":
    main()
