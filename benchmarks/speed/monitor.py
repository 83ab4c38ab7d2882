"""How fast the monitor and the bank are: every example, and ladders of growing size.

    python -m benchmarks.speed.monitor [--markdown FILE]

Processor time per sample, so that other work on the machine counts as little as possible.
"""

import time
from collections.abc import Sequence

import numpy as np

from benchmarks.shared.clock import alarmed_at_once, fresh_cache
from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.plants import case, graph_of
from benchmarks.shared.play import engine_of, passed, samples
from benchmarks.shared.turns import turns
from benchmarks.speed.alone import filters_alone, n_filters
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample, Status
from faultbond.model.builder import ModelBuilder
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, simulate, sines
from faultbond.synthesis.engine import build_engine

FOLDERS = ("tank", "dc_motor", "dc_motor_current", "rlc", "rc")
SECTIONS = range(2, 9)
SEED = 600
WATCHED, DIAGNOSED = 2000, 1000  # samples timed
ALONE, ROUNDS = 50, 9  # samples that the filters of a bank alone take, and how often
LADDER_SAMPLES = 200
LATENCY_HEADER = "example | hypotheses | lanes | watching, median | 99 % | with bank, median | 99 % | filters alone"
LADDER_HEADER = "components | states | hypotheses | lanes | engine built in | filters per sample"
LADDER_HEADER += " | hypotheses per second"


def latency(folder: str) -> tuple[str, ...]:
    """Measure an example: median and 99 % of `step` before and after an alarm, median of its filters alone."""
    graph = graph_of(folder)
    spec, core = engine_of(folder)
    rows = spec.thresholds.warm_up_samples + 1 + WATCHED
    given = samples(case(folder, SEED, seconds=rows * (graph.sample_time or 1.0)).recording)
    alarmed = alarmed_at_once(graph)
    watching = _latencies(core, given, Status.WATCHING)
    diagnosing = _latencies(alarmed, given[:-DIAGNOSED], Status.DIAGNOSING)
    bank = passed(alarmed, given[:-DIAGNOSED])
    times = [value for taken in (watching, diagnosing) for value in (np.median(taken), np.quantile(taken, 0.99))]
    return (
        *(folder, str(spec.n_hypotheses), str(n_filters(bank))),
        *(_micro(float(value)) for value in (*times, _filters(bank))),
    )


def ladder(sections: int) -> tuple[str, ...]:
    """Measure an RC ladder: its size, and hypotheses per second (each taken one sample further)."""
    graph = _ladder_graph(sections)
    with fresh_cache():
        begin = time.perf_counter()
        spec, _ = build_engine(graph)
        built = time.perf_counter() - begin
    moments: FloatArray = np.arange(LADDER_SAMPLES, dtype=np.float64) * (graph.sample_time or 1.0)
    voltage = sines(moments, [(5.0, 0.1, 0.0), (2.0, 0.5, 1.0)])
    given = samples(simulate(graph, Inputs(time=moments, values=voltage[:, None]), seed=SEED))
    bank = passed(alarmed_at_once(graph), given)
    each = _filters(bank)
    counts = (2 * sections, len(spec.states), spec.n_hypotheses, n_filters(bank))
    times = (f"{built:.1f} s", _micro(each), f"{spec.n_hypotheses / each:,.0f}")
    return *(str(value) for value in counts), *times


def _ladder_graph(sections: int) -> BondGraph:
    """Give resistors in a row with a capacitor behind each; the first and the last voltage are measured."""
    builder = ModelBuilder(f"RC ladder of {sections} sections", sample_time="0.1 s", max_faults=2)
    builder.input("V", unit="V").component("source", "Se", law="e = V")
    before = "source"
    for k in range(1, sections + 1):
        builder.component(f"R{k}", "R", parameters={f"R{k}": "1 ohm"})
        builder.component(f"C{k}", "C", parameters={f"C{k}": "1 F"}, start={"q": "0 C", "sd": "0.1 C"})
        builder.junction(f"line{k}", "1").junction(f"node{k}", "0")
        builder.bond(f"{before} -> line{k} -> node{k} -> C{k}").bond(f"line{k} -> R{k}")
        before = f"node{k}"
    for k in (1, sections):
        builder.sensor(f"V{k}", f"node{k}.e", unit="V", noise="50 mV")
    return builder.build()


def _latencies(core: Core, given: Sequence[Sample], status: Status) -> FloatArray:
    """Give the processor time of each `step` that ends in a status, without the one in which the bank begins."""
    monitor, taken = Monitor(core), []
    for sample in given:
        begin = time.thread_time()
        report = monitor.step(sample)
        if report.status is status and report.detection is None:
            taken.append(time.thread_time() - begin)
    return np.array(taken)


def _filters(bank: Monitor) -> float:
    """Give the median time per sample of the filters of a bank."""
    if bank.number("clock.alarm") < 0:
        raise RuntimeError("no alarm was raised, so there is no bank")
    return float(np.median(turns([filters_alone(bank, ALONE)], ROUNDS)))


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} us" if seconds < 0.01 else f"{1e3 * seconds:.0f} ms"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("How fast the monitor and the bank are.", argv)
    examples = [latency(folder) for folder in FOLDERS]
    ladders = [ladder(sections) for sections in SECTIONS]
    publish(
        "speed.monitor", chosen, note(), (LATENCY_HEADER.split(" | "), examples), (LADDER_HEADER.split(" | "), ladders)
    )


if __name__ == "__main__":
    main()
