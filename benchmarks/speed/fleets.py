"""How the work grows: assets of a fleet, threads, and hypotheses of one plant.

    python -m benchmarks.speed.fleets [--markdown FILE]

Processor time, medians, and in brackets quartiles; the speed-up by threads is of wall time. A fleet of any size is one
of few tanks that watch, repeated: each asset is worked on as if it were another one.
"""

import os
import time
from collections.abc import Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np

from benchmarks.shared.clock import alarmed_at_once
from benchmarks.shared.ladders import ladder_text
from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.plants import graph_of, tank_case
from benchmarks.shared.play import block_of, passed, samples
from benchmarks.shared.turns import Work, spread, turns
from benchmarks.speed.alone import n_filters
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Samples
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.fleet import Fleet
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.engine import build_engine

DIFFERENT, SEED = 32, 600  # tanks that are simulated
WARM, BLOCK, ROUNDS = 300, 60, 9
SIZES = (1_000, 10_000, 100_000, 1_000_000)
LADDERS = ((4, 1), (4, 2), (4, 3), (8, 3), (12, 3), (16, 3))  # sections, largest set
FEW, DIAGNOSED = 240, 40  # samples of a ladder until it diagnoses, and then
SPARE = 1.1  # of what a fleet needs, beside samples of its own


@cache
def _core() -> Core:
    """Give the core of the tank, with what fleets need."""
    return build_engine(graph_of("tank"), fleets=True)[1]


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("How the work grows with assets, threads and hypotheses.", argv)
    publish(
        "speed.fleets",
        chosen,
        note(),
        (
            ("tanks", "memory of each", "a sample each, blocks of 60", "one sample a call", "of a core at 1 Hz"),
            assets(),
        ),
        (("tanks", "threads", "times as fast as one thread", "processor time, of that of one thread"), threads()),
        (("ladder", "hypotheses", "filters", "numbers in each", "a sample", "each filter", "for each number"), banks()),
    )


def assets() -> list[tuple[str, ...]]:
    """Give the rows of fleets of growing size, as far as memory lets."""
    rows: list[tuple[str, ...]] = []
    for size in SIZES:
        if needed(size) > available():
            told = f"{needed(size) / 2**30:.0f} GiB needed, {available() / 2**30:.0f} free"
            rows.append((f"{size:,}", f"{needed(size) / SPARE / size / 1e3:.1f} kB", told, "", ""))
            continue
        fleet, rounds = large(size), 3 if size > 10_000 else ROUNDS
        block, single = (measured(fleet, count, rounds) for count in (BLOCK, 1))
        share = f"{100.0 * size * float(np.median(single)):.1f} %"
        each = f"{fleet.size / size / 1e3:.1f} kB"
        rows.append((f"{size:,}", each, *(f"{spread(item, '.3f', 1e6)} us" for item in (block, single)), share))
    return rows


def per_step() -> list[tuple[str, str, str]]:
    """Give the row of a healthy tank in a fleet for the table of figures."""
    fleet = large(10_000)
    block, single = (spread(measured(fleet, count, ROUNDS), ".3f", 1e6) for count in (BLOCK, 1))
    told = f"{block} us in blocks of {BLOCK}; one sample a call {single} us"
    return [("fleet of 10,000 tanks, watching, a sample of each, one core", "0.3 us", told)]


def threads() -> list[tuple[str, ...]]:
    """Give the row of two threads beside one."""
    size, count = 10_000, 20
    time_, u, y = repeated(size, count)
    found = np.empty((ROUNDS, 2, 2))
    for row in found:
        for k in range(2):
            fleet = large(size, k + 1)
            begin = time.perf_counter(), time.process_time()
            fleet.block(time_, u, y)
            row[k] = time.perf_counter() - begin[0], time.process_time() - begin[1]
    faster, more = found[:, 0, 0] / found[:, 1, 0], found[:, 1, 1] / found[:, 0, 1]
    return [(f"{size:,}", "2", spread(faster, ".2f"), spread(more, ".2f"))]


def banks() -> list[tuple[str, ...]]:
    """Give the rows of ladders with more and more hypotheses."""
    rows: list[tuple[str, ...]] = []
    for sections, largest in LADDERS:
        monitor, block = diagnosing(sections, largest)
        run = Work(prepare=monitor.copy, run=partial(take, block), count=len(block))
        each, spec = turns([run], ROUNDS)[:, 0], monitor.spec
        n, numbers = n_filters(monitor), spec.n_numbers
        rows.append(
            (
                f"{sections} stores, sets of {largest}",
                f"{spec.n_hypotheses:,}",
                f"{n:,}",
                f"{numbers}",
                f"{spread(each, '.1f', 1e6)} us",
                f"{spread(each / n, '.0f', 1e9)} ns",
                f"{spread(each / n / numbers, '.2f', 1e9)} ns",
            )
        )
    return rows


def diagnosing(sections: int, largest: int) -> tuple[Monitor, Samples]:
    """Give a monitor of a ladder that diagnoses, and the samples that come."""
    text = ladder_text(sections)
    rows = "\n".join(line for line in text.splitlines() if not line.startswith("max_faults"))
    graph = parse_model(f"{rows}\nmax_faults: {largest}\n")
    moments: FloatArray = (graph.sample_time or 1.0) * np.arange(FEW + DIAGNOSED, dtype=np.float64)
    voltage = np.where(np.arange(len(moments)) // 25 % 2 == 0, 5.0, 10.0)[:, None]
    recording = simulate(graph, Inputs(time=moments, values=voltage), seed=SEED)
    monitor = passed(alarmed_at_once(graph), samples(recording)[:FEW])
    return monitor, block_of(recording)[FEW:]


def take(block: Samples, monitor: Monitor) -> None:
    """Take a block, which ends where a diagnosis is due."""
    taken = 0
    while taken < len(block):
        taken += len(monitor.take(block[taken:]))


def measured(fleet: Fleet, count: int, rounds: int) -> FloatArray:
    """Give the processor time of a sample of one asset, s, in blocks of `count`, (rounds,), without the first."""
    found = np.empty(rounds + 1)
    for k in range(rounds + 1):
        time_, u, y = repeated(fleet.n_assets, count, fleet.index)
        begin = time.process_time()
        fleet.block(time_, u, y)
        found[k] = (time.process_time() - begin) / (fleet.n_assets * count)
    if len(fleet.monitors) > fleet.n_assets // 100:
        raise RuntimeError("tanks are in alarm, so it was not watching that was measured")
    return found[1:]


def large(size: int, n_threads: int = 1) -> Fleet:
    """Give a fleet of so many tanks that watch: the few that were simulated, again and again."""
    few, fleet = _few(), Fleet(_core(), size, threads=n_threads)
    fleet.repeat(few)
    return fleet


@cache
def _few() -> Fleet:
    time_, u, y = _simulated()
    fleet = Fleet(_core(), DIFFERENT)
    fleet.block(time_[:WARM], u[:, :WARM], y[:, :WARM])
    return fleet


@cache
def _simulated() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give times, inputs and readings of different tanks."""
    seconds = float(WARM + (ROUNDS + 1) * (BLOCK + 1))
    blocks = [block_of(tank_case(SEED + k, seconds=seconds).recording) for k in range(DIFFERENT)]
    return blocks[0].time, np.array([item.u for item in blocks]), np.array([item.y for item in blocks])


def repeated(size: int, count: int, first: int = WARM) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give the next samples of a fleet of so many tanks."""
    time_, u, y = _simulated()
    part, again = slice(first, first + count), -(-size // DIFFERENT)
    inputs, readings = (np.tile(item[:, part], (again, 1, 1))[:size] for item in (u, y))
    return time_[part], inputs, readings


def needed(size: int) -> float:
    """Give the bytes of a fleet of so many tanks."""
    return SPARE * size * _few().size / DIFFERENT


def available() -> float:
    """Give the bytes of memory that are free."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    return 1024.0 * float(next(line.split()[1] for line in lines if line.startswith("MemAvailable")))


if __name__ == "__main__":
    main()
