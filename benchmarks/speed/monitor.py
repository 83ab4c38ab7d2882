"""How fast the monitor and the bank are: every example, and ladders of growing size.

    python -m benchmarks.speed [--json FILE] [--markdown FILE]

Processor time per sample, so that other work on the machine counts as little as possible. The last columns compare
with the same filter graph in CasADi's virtual machine, measured in the same run.
"""

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from benchmarks.shared.clock import alarmed_at_once, fresh_cache, play_through, samples
from benchmarks.shared.page import as_markdown, as_text, machine, today, write_part
from benchmarks.shared.plants import EXAMPLES, case
from faultbond.arrays import FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.model.builder import ModelBuilder
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Latency:
    """Processor time per sample, s, and how many times as long the virtual machine takes.

    watching, diagnosing : median and 99 % of `step`, before and after an alarm
    bank : median of the bank alone
    """

    model: str
    hypotheses: int
    lanes: int
    watching: tuple[float, float]
    diagnosing: tuple[float, float]
    bank: float
    watching_ratio: float
    bank_ratio: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Ladder:
    """An RC ladder: its size, and hypotheses per second (each taken one sample further)."""

    components: int
    states: int
    hypotheses: int
    lanes: int
    build: float  # s of wall time
    bank: float  # s per sample
    per_second: float
    bank_ratio: float


def latency(folder: str) -> Latency:
    """Measure an example."""
    graph = load_model(EXAMPLES / folder / "model.yaml")
    spec, compiled = build_engine(graph)
    _, virtual = build_engine(graph, compiled=False)
    rows = spec.thresholds.warm_up_samples + 1 + WATCHED
    given = samples(case(folder, SEED, seconds=rows * (graph.sample_time or 1.0)).recording)
    watching = _latencies(spec, compiled, given, Status.WATCHING)
    slow = _latencies(spec, virtual, given[: spec.thresholds.warm_up_samples + WATCHED // SLOWER], Status.WATCHING)
    diagnosing = _latencies(alarmed_at_once(spec), compiled, given[:-DIAGNOSED], Status.DIAGNOSING)
    bank, ratio = _bank(spec, (compiled, virtual), given)
    return Latency(
        model=folder,
        hypotheses=spec.n_hypotheses,
        lanes=len(no_bank(spec).likelihoods),
        watching=_middle_and_tail(watching),
        diagnosing=_middle_and_tail(diagnosing),
        bank=bank,
        watching_ratio=float(np.median(slow) / np.median(watching)),
        bank_ratio=ratio,
    )


def ladder(sections: int) -> Ladder:
    """Measure an RC ladder."""
    graph = _ladder_graph(sections)
    with fresh_cache():
        begin = time.perf_counter()
        spec, compiled = build_engine(graph)
        built = time.perf_counter() - begin
    _, virtual = build_engine(graph, compiled=False)
    bank, ratio = _bank(spec, (compiled, virtual), _ladder_samples(graph))
    return Ladder(
        components=2 * sections,
        states=len(spec.states),
        hypotheses=spec.n_hypotheses,
        lanes=len(no_bank(spec).likelihoods),
        build=built,
        bank=bank,
        per_second=spec.n_hypotheses / bank,
        bank_ratio=ratio,
    )


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


def _ladder_samples(graph: BondGraph) -> list[Sample]:
    moments: FloatArray = np.arange(LADDER_SAMPLES, dtype=np.float64) * (graph.sample_time or 1.0)
    voltage = sines(moments, [(5.0, 0.1, 0.0), (2.0, 0.5, 1.0)])
    return samples(simulate(graph, Inputs(time=moments, values=voltage[:, None]), seed=SEED))


def _latencies(spec: EngineSpec, engine: Engine, given: Sequence[Sample], status: Status) -> FloatArray:
    """Give the processor time of each `step` that ends in a status, without the one in which the bank begins."""
    state, taken = init(spec), []
    for sample in given:
        begin = time.thread_time()
        state, report = step(spec, engine, state, sample)
        if report.status is status and report.detection is None:
            taken.append(time.thread_time() - begin)
    return np.array(taken)


def _bank(spec: EngineSpec, engines: tuple[Engine, Engine], given: list[Sample]) -> tuple[float, float]:
    """Give the median time per sample of the bank on the first engine, and how many times as long the second takes."""
    state = play_through(alarmed_at_once(spec), engines[0], given[: spec.thresholds.warm_up_samples + 2])
    packed = state.trail_samples[(state.index - 1) % len(state.trail_times)]
    compiled, virtual = (
        _rate(spec, engine, state.bank, packed, count)
        for engine, count in zip(engines, (DIAGNOSED // 2, MACHINE_SAMPLES), strict=True)
    )
    return compiled, virtual / compiled


def _rate(spec: EngineSpec, engine: Engine, bank: Bank, packed: FloatArray, count: int) -> float:
    taken = []
    for index in range(count):
        begin = time.thread_time()
        advance_bank(spec, engine, bank, packed, trusted(spec, packed), index)
        taken.append(time.thread_time() - begin)
    return float(np.median(taken))


def _middle_and_tail(taken: FloatArray) -> tuple[float, float]:
    return float(np.median(taken)), float(np.quantile(taken, 0.99))


LATENCY_HEADER = (
    "example",
    "hypotheses",
    "lanes",
    "watching, median",
    "99 %",
    "with bank, median",
    "99 %",
    "bank alone",
    "virtual machine, watching",
    "bank",
)
LADDER_HEADER = (
    "components",
    "states",
    "hypotheses",
    "lanes",
    "engine built in",
    "bank per sample",
    "hypotheses per second",
    "virtual machine",
)


def _micro(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} us" if seconds < 0.01 else f"{1e3 * seconds:.0f} ms"


def _latency_cells(row: Latency) -> tuple[str, ...]:
    times = (*row.watching, *row.diagnosing, row.bank)
    ratios = (f"x{row.watching_ratio:.1f}", f"x{row.bank_ratio:.0f}")
    return row.model, str(row.hypotheses), str(row.lanes), *(_micro(value) for value in times), *ratios


def _ladder_cells(row: Ladder) -> tuple[str, ...]:
    counts = (row.components, row.states, row.hypotheses, row.lanes)
    times = (f"{row.build:.1f} s", _micro(row.bank), f"{row.per_second:,.0f}", f"x{row.bank_ratio:.0f}")
    return *(str(value) for value in counts), *times


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="How fast the monitor and the bank are.")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write all numbers to FILE, in seconds")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the tables into the page FILE")
    chosen = parser.parse_args(argv)
    latencies = [latency(folder) for folder in FOLDERS]
    examples = [_latency_cells(row) for row in latencies]
    print(as_text(LATENCY_HEADER, examples), flush=True)
    ladders = [ladder(sections) for sections in SECTIONS]
    sizes = [_ladder_cells(row) for row in ladders]
    print(f"\n{as_text(LADDER_HEADER, sizes)}")
    note = f"{today()}; {machine()}"
    print(f"\n{note}")
    if chosen.json is not None:
        report = {"note": note, "examples": [asdict(row) for row in latencies], "ladders": [asdict(r) for r in ladders]}
        chosen.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if chosen.markdown is not None:
        tables = f"{as_markdown(LATENCY_HEADER, examples)}\n\n{as_markdown(LADDER_HEADER, sizes)}"
        write_part(chosen.markdown, "speed", f"`python -m benchmarks.speed`\n\n{note}.\n\n{tables}")


if __name__ == "__main__":
    main()
