"""How long a sample takes: the tank's filter and bank beside FilterPy and numba, a large bank, a call from Python."""

import time
from collections.abc import Callable
from functools import cache, partial

import numpy as np

from benchmarks.shared.clock import alarmed_at_once
from benchmarks.shared.plants import graph_of, tank_case
from benchmarks.shared.play import block_of, engine_of, passed, samples
from benchmarks.shared.told import relinearised
from benchmarks.shared.turns import Work, spread, turns
from benchmarks.speed import large_bank, peers, tank_loops
from benchmarks.speed.alone import filters_alone, n_filters
from benchmarks.speed.peak import counting, fma_peak
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample, Samples, Status
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault

SEED = 600
ROUNDS = 21
BLOCK, WATCHED_FROM = 2000, 1000  # samples of a healthy tank
DIAGNOSED = 200  # samples, long after the alarm: no filter begins again
ALONE = 100  # samples that the filters alone take
RESTING = Fault(parameter="K3", factor=1.3, start=1500.0)
RESTING_FROM = 3000  # samples, after the last time that filters begin again
FAULT, REPEATS = Fault(parameter="K6", factor=20.0, start=1500.0), 5
NO_PEER = "not installed"
SAME_WORK = "rates, slopes, both stages, second update"

Rows = list[tuple[str, str, str]]  # figure, asked, got


def watching() -> Rows:
    """Compare a watching step in blocks with one filter of FilterPy."""
    monitor, block = _watching()
    n, n_y = monitor.spec.n_joint, len(monitor.spec.outputs)
    ours = Work(prepare=monitor.copy, run=partial(_take, block), count=BLOCK)
    times, got = _compared(ours, peers.by_filterpy([(1, n)], n_y, 50))
    each = f"a sample {spread(times[:, 0], '.2f', 1e6)} us"
    return [
        (f"tank, watching, in blocks: times as fast as one FilterPy filter of {n} numbers", "150", f"{got}; {each}")
    ]


def diagnosing() -> Rows:
    """Compare a diagnosing step with FilterPy's filters, as many as there are lanes; also where lanes rest."""
    peer = partial(peers.by_filterpy, samples=1)
    monitor, block = _resting()
    resting = int(monitor.numbers("bank.rests").sum())
    what = f"after K3 x{RESTING.factor}, {resting} of {len(monitor.numbers('bank.rests'))} groups at rest"
    return [
        _bank_row("FilterPy's filters", "600", peer, *_diagnosing()),
        _bank_row("FilterPy's filters", "1,000", peer, monitor, block, f", {what}"),
    ]


def loops() -> Rows:
    """Compare a diagnosing step with loops of numba, whose model costs nothing, and that do the same work."""
    monitor, block = _diagnosing()
    free = "filters in loops compiled by numba, constant slopes, one update"
    ours = Work(prepare=monitor.copy, run=partial(_take, block), count=len(block))
    lanes, given = [monitor.lane(k) for k in range(n_filters(monitor))], _last(monitor, 10)
    times, got = _compared(ours, tank_loops.by_loops(monitor.spec, lanes, given))
    each = f"a sample {spread(times[:, 0], '.1f', 1e6)} us"
    figure = f"the same, of so many that do the same work in loops written for this plant: {SAME_WORK}"
    return [_bank_row(free, "15", partial(peers.by_numba, samples=5), monitor, block), (figure, "", f"{got}; {each}")]


def peak() -> Rows:
    """Compare the operations of a diagnosing step's filters with what FMA units can do in its time."""
    monitor, block = _diagnosing()
    whole = Work(prepare=monitor.copy, run=partial(_take, block), count=len(block))
    lanes, sample = [monitor.lane(k) for k in range(n_filters(monitor))], _last(monitor, 1)[0]
    with counting(graph_of("tank"), monitor.spec) as count:
        counts = [count(lane, sample)[0] for lane in lanes]
    times = turns([whole, filters_alone(monitor, ALONE), fma_peak()], ROUNDS)
    step, alone = (sum(counts) * times[:, 2] / times[:, k] for k in range(2))
    told = f"{spread(step, '.1f', 100.0)} %; of {spread(1e-9 / times[:, 2], '.1f')} GFlop/s"
    figure = (
        f"tank, diagnosing, {len(lanes)} lanes of {min(counts):,} to {max(counts):,} operations: share of the FMA peak"
    )
    return [(figure, "30 %", told), ("the same, of the filters alone", "", f"{spread(alone, '.1f', 100.0)} %")]


def six_tanks() -> Rows:
    """Compare a whole step on a large bank, called from Python for each sample, with its filters alone."""
    monitor, rest = large_bank.diagnosing(ALONE)
    whole = Work(prepare=monitor.copy, run=partial(_push, rest), count=len(rest))
    times = turns([whole, filters_alone(monitor, ALONE)], ROUNDS // 3)
    figure = f"six tanks, {n_filters(monitor)} filters: a whole step, in times of its filters alone"
    told = f"{spread(times[:, 0] / times[:, 1], '.2f')}; a sample {spread(times[:, 0], '.2f', 1e3)} ms"
    return [(figure, "1.3", told)]


def call() -> Rows:
    """Give what one sample at a time costs more than a block of them."""
    monitor, block = _watching()
    runs = (partial(_push, _split(block)), partial(_step, _split(block)), partial(_take, block))
    times = turns([Work(prepare=monitor.copy, run=run, count=BLOCK) for run in runs], ROUNDS)
    pushed, stepped = (f"{spread(times[:, k] - times[:, 2], '.2f', 1e6)} us" for k in range(2))
    figure = "tank: a sample of its own, called from Python (`push`), beyond its time in a block"
    return [(figure, "2 us", pushed), ("the same with its report (`step`)", "", stepped)]


def longest() -> Rows:
    """Compare the longest step of a run with a fault, alarm and renewals among them, with the median one after it.

    Each run is made several times, and each step's time is the median of its repetitions: what else the machine does
    at a step, it does not do each time.
    """
    _, core = engine_of("tank")
    given = samples(tank_case(SEED, [FAULT], seconds=FAULT.start + 1000.0).recording)
    taken, status = np.empty((REPEATS, len(given))), [Status.WAITING] * len(given)
    for row in taken:
        monitor, first = Monitor(core), -1
        for k, sample in enumerate(given):
            begin = time.thread_time()
            monitor.push(sample)
            row[k], status[k] = time.thread_time() - begin, monitor.report.status
            first = k if first < 0 and monitor.report.diagnosis is not None else first
    alarm, each = int(monitor.number("clock.alarm")), np.median(taken, axis=0)
    if alarm < 0:
        raise RuntimeError("no alarm was raised, so nothing was measured")
    usual = float(np.median(each[[item is Status.DIAGNOSING for item in status]]))
    slowest = alarm + int(np.argmax(each[alarm:]))
    ratios = taken[:, slowest] / usual
    what = "the alarm" if slowest == alarm else f"{slowest - alarm} samples after the alarm"
    told = f"{spread(ratios, '.1f')}: {1e3 * each[slowest]:.2f} ms at {what}, median {1e3 * usual:.3f} ms"
    return [
        ("tank: the longest step, in times of the median diagnosing one", "10", told),
        ("the same: samples from the alarm to the first diagnosis", "", str(first - alarm)),
    ]


def _bank_row(
    theirs: str,
    asked: str,
    peer: Callable[[peers.Sizes, int], Work | None],
    monitor: Monitor,
    block: Samples,
    what: str = "",
) -> tuple[str, str, str]:
    spec = monitor.spec
    plain = sum(len(monitor.lane(k)) == spec.n_numbers for k in range(n_filters(monitor)))
    sizes = [(plain, spec.n_joint), (n_filters(monitor) - plain, spec.slotted.n_joint)]
    ours = Work(prepare=monitor.copy, run=partial(_take, block), count=len(block))
    times, got = _compared(ours, peer(sizes, len(spec.outputs)))
    each = f"a sample {spread(times[:, 0], '.1f', 1e6)} us"
    figure = f"tank, diagnosing, {n_filters(monitor)} lanes{what}: times as fast as so many {theirs}"
    return figure, asked, f"{got}; {each}"


def _last(monitor: Monitor, count: int) -> FloatArray:
    """Give the last samples as lanes of the bank take them, (count, n_sample)."""
    last = int(monitor.number("clock.index"))
    return relinearised(monitor.spec, np.array([monitor.row(k)[0] for k in range(last - count, last)]))


def _compared(ours: Work, theirs: Work | None) -> tuple[FloatArray, str]:
    """Give the times of both, and how many times as fast ours is."""
    times = turns([ours] if theirs is None else [ours, theirs], ROUNDS)
    return times, NO_PEER if theirs is None else spread(times[:, 1] / times[:, 0], ".1f")


@cache
def _watching() -> tuple[Monitor, Samples]:
    """Give a monitor of a healthy tank that watches, and the samples that come."""
    given = tank_case(SEED, seconds=float(WATCHED_FROM + BLOCK)).recording
    block = block_of(given)
    monitor = Monitor(engine_of("tank")[1])
    _take(block[:WATCHED_FROM], monitor)
    return monitor, block[WATCHED_FROM:]


@cache
def _diagnosing() -> tuple[Monitor, Samples]:
    """Give a monitor of the tank long after its alarm, and the samples that come."""
    recording = tank_case(SEED, seconds=float(WATCHED_FROM + DIAGNOSED)).recording
    monitor = passed(alarmed_at_once(graph_of("tank")), samples(recording)[:WATCHED_FROM])
    return monitor, block_of(recording)[WATCHED_FROM:]


@cache
def _resting() -> tuple[Monitor, Samples]:
    """Give a monitor of a tank with a fault, long after its alarm, and the samples that come."""
    recording = tank_case(SEED, [RESTING], seconds=float(RESTING_FROM + DIAGNOSED)).recording
    monitor = Monitor(engine_of("tank")[1])
    _take(block_of(recording)[:RESTING_FROM], monitor)
    if monitor.number("clock.alarm") < 0:
        raise RuntimeError("no alarm was raised, so nothing was measured")
    return monitor, block_of(recording)[RESTING_FROM:]


def _take(block: Samples, monitor: Monitor) -> None:
    """Take a block, which ends where a diagnosis is due."""
    taken = 0
    while taken < len(block):
        taken += len(monitor.take(block[taken:]))


def _split(block: Samples) -> list[Sample]:
    rows = zip(block.time, block.dt, block.u, block.y, strict=True)
    return [Sample(time=float(time), dt=float(dt), u=u, y=y) for time, dt, u, y in rows]


def _push(given: list[Sample], monitor: Monitor) -> None:
    for sample in given:
        monitor.push(sample)


def _step(given: list[Sample], monitor: Monitor) -> None:
    for sample in given:
        monitor.step(sample)
