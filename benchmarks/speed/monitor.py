"""How fast the monitor and the bank are: every example, and ladders of growing size.

    python -m benchmarks.speed [--markdown FILE]

Processor time per sample, so that other work on the machine counts as little as possible. The last columns compare
with the same filter graph in CasADi's virtual machine, measured in the same run.
"""

import time
from collections.abc import Sequence

import numpy as np

from benchmarks.shared.clock import alarmed_at_once, fresh_cache
from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.plants import case, graph_of
from benchmarks.shared.play import passed, samples
from faultbond.arrays import FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.model.builder import ModelBuilder
from faultbond.model.graph import BondGraph
from faultbond.runtime.bank import Bank, advance_bank, no_bank
from faultbond.runtime.monitor import step
from faultbond.runtime.packing import trusted
from faultbond.runtime.state import Sample, Status, init
from faultbond.simulate import Inputs, simulate, sines
from faultbond.synthesis.engine import build_engine

FOLDERS = ("tank", "dc_motor", "dc_motor_current", "rlc", "rc")
SECTIONS = range(2, 9)
SEED = 600
WATCHED, DIAGNOSED = 2000, 1000  # samples timed; fewer on the virtual machine
SLOWER = 10
MACHINE_SAMPLES = 8
LADDER_SAMPLES = 200
LATENCY_HEADER = "example | hypotheses | lanes | watching, median | 99 % | with bank, median | 99 % | bank alone"
LATENCY_HEADER += " | virtual machine, watching | bank"
LADDER_HEADER = "components | states | hypotheses | lanes | engine built in | bank per sample"
LADDER_HEADER += " | hypotheses per second | virtual machine"


def latency(folder: str) -> tuple[str, ...]:
    """Measure an example: median and 99 % of `step` before and after an alarm, median of the bank alone, and ratios."""
    graph = graph_of(folder)
    spec, compiled = build_engine(graph)
    _, virtual = build_engine(graph, compiled=False)
    rows = spec.thresholds.warm_up_samples + 1 + WATCHED
    given = samples(case(folder, SEED, seconds=rows * (graph.sample_time or 1.0)).recording)
    watching = _latencies(spec, compiled, given, Status.WATCHING)
    slow = _latencies(spec, virtual, given[: spec.thresholds.warm_up_samples + WATCHED // SLOWER], Status.WATCHING)
    diagnosing = _latencies(alarmed_at_once(spec), compiled, given[:-DIAGNOSED], Status.DIAGNOSING)
    bank, ratio = _bank(spec, (compiled, virtual), given)
    times = [value for taken in (watching, diagnosing) for value in (np.median(taken), np.quantile(taken, 0.99))]
    return (
        *(folder, str(spec.n_hypotheses), str(len(no_bank(spec).likelihoods))),
        *(_micro(float(value)) for value in (*times, bank)),
        *(f"x{np.median(slow) / np.median(watching):.1f}", f"x{ratio:.0f}"),
    )


def ladder(sections: int) -> tuple[str, ...]:
    """Measure an RC ladder: its size, and hypotheses per second (each taken one sample further)."""
    graph = _ladder_graph(sections)
    with fresh_cache():
        begin = time.perf_counter()
        spec, compiled = build_engine(graph)
        built = time.perf_counter() - begin
    _, virtual = build_engine(graph, compiled=False)
    moments: FloatArray = np.arange(LADDER_SAMPLES, dtype=np.float64) * (graph.sample_time or 1.0)
    voltage = sines(moments, [(5.0, 0.1, 0.0), (2.0, 0.5, 1.0)])
    given = samples(simulate(graph, Inputs(time=moments, values=voltage[:, None]), seed=SEED))
    bank, ratio = _bank(spec, (compiled, virtual), given)
    counts = (2 * sections, len(spec.states), spec.n_hypotheses, len(no_bank(spec).likelihoods))
    times = (f"{built:.1f} s", _micro(bank), f"{spec.n_hypotheses / bank:,.0f}", f"x{ratio:.0f}")
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


def _latencies(spec: EngineSpec, engine: Engine, given: Sequence[Sample], status: Status) -> FloatArray:
    """Give the processor time of each `step` that ends in a status, without the one in which the bank begins."""
    state, taken = init(spec), []
    for sample in given:
        begin = time.thread_time()
        state, report = step(spec, engine, state, sample)
        if report.status is status and report.detection is None:
            taken.append(time.thread_time() - begin)
    return np.array(taken)


def _bank(spec: EngineSpec, engines: tuple[Engine, Engine], given: Sequence[Sample]) -> tuple[float, float]:
    """Give the median time per sample of the bank on the first engine, and how many times as long the second takes."""
    begun = passed(alarmed_at_once(spec), engines[0], given[: spec.thresholds.warm_up_samples + 2])
    packed = begun.past.samples[-1]
    compiled = _rate(spec, engines[0], begun.bank, packed, DIAGNOSED // 2)
    return compiled, _rate(spec, engines[1], begun.bank, packed, MACHINE_SAMPLES) / compiled


def _rate(spec: EngineSpec, engine: Engine, bank: Bank, packed: FloatArray, count: int) -> float:
    taken = []
    for index in range(count):
        begin = time.thread_time()
        advance_bank(spec, engine, bank, packed, trusted(spec, packed), index)
        taken.append(time.thread_time() - begin)
    return float(np.median(taken))


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} us" if seconds < 0.01 else f"{1e3 * seconds:.0f} ms"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("How fast the monitor and the bank are.", argv)
    examples = [latency(folder) for folder in FOLDERS]
    ladders = [ladder(sections) for sections in SECTIONS]
    publish("speed", chosen, note(), (LATENCY_HEADER.split(" | "), examples), (LADDER_HEADER.split(" | "), ladders))
