"""The table of figures: what is asked of faultbond, what it does, and whether that is enough.

    python -m benchmarks.trust.figures [--seeds 30] [--first-seed 700] [--only ROW,...] [--markdown FILE]

The plants are simulated and are not quite their models: see `benchmarks.shared.plants`. ROW is a scenario, `tank.K1`,
or the first words of several, `tank` or `time`.
"""

import math
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import takewhile
from multiprocessing import Pool
from pathlib import Path

import numpy as np

from benchmarks.shared.clock import CACHE, alarmed_at_once, fresh_cache, timed_program
from benchmarks.shared.page import (
    Row,
    arguments,
    note,
    percent,
    publish,
    quantile,
    seconds,
    seeds_of,
    selected,
    share,
)
from benchmarks.shared.plants import EXAMPLES, case, effort_or_flow_goes_on, graph_of, tank_case
from benchmarks.shared.play import EPSILON, engine_of, passed, samples, watched
from benchmarks.trust.scenarios import END, HEALTHY, SCENARIOS, Scenario
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Simulation
from faultbond.synthesis.compile import ZIG
from faultbond.synthesis.engine import build_engine

PROCESSES = 2
HEADER = ("figure", "asked", "got", "verdict")
BUILT = ("tank", "dc_motor", "dc_motor_current", "rlc", "rc")
TIMES = ("time.bank", "time.demo", "time.build")
OPEN = 60.0  # percent: a valve as open as this shows what is wrong with the pipe


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Of a ranking: the rank of the true set, 1 for the first, and the largest relative error of its parameters."""

    rank: int
    error: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One run: s from the fault, or from the opening after it, to an alarm that is not early; None without one.

    early : whether there was an alarm before the fault
    cusum, slow : largest CUSUM and slow error (in declared sd) before the fault
    readings : the last ranking at or before each look of the scenario, if the alarm counts
    """

    key: str
    delay: float | None
    early: bool
    cusum: float
    slow: float
    readings: tuple[Reading, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Watched:
    """What a monitor made of a recording; `cusum` and `slow` as in `Outcome`."""

    detection: Detection | None
    diagnoses: tuple[Diagnosis, ...]
    cusum: float
    slow: float


# specification, core, recording, onset (s; None: no fault), and for how many s after the alarm
Watch = Callable[[EngineSpec, Core, Simulation, float | None, float], Watched]


def watch(spec: EngineSpec, core: Core, recording: Simulation, onset: float | None, until: float) -> Watched:
    """Pass a recording through the monitor, up to `until` seconds after the alarm."""
    monitor = Monitor(core)
    detection: Detection | None = None
    diagnoses: list[Diagnosis] = []
    cusum = slow = 0.0

    def wanted(time: float) -> bool:
        return detection is None or time <= detection.time + until + EPSILON

    for sample, _, report in watched(monitor, takewhile(lambda item: wanted(item.time), samples(recording))):
        if onset is None or sample.time < onset:
            cusum = float(np.fmax(cusum, np.nan_to_num(report.cusum).max()))
            alarming = [abs(value) for value, error in zip(report.slow, spec.slow_errors, strict=True) if error.alarms]
            slow = float(np.fmax(slow, np.nan_to_num(max(alarming, default=0.0))))
        detection = report.detection or detection
        diagnoses += [report.diagnosis] if report.diagnosis is not None else []
    last = monitor.finish()
    return Watched(
        detection=detection, diagnoses=(*diagnoses, *([last] if last is not None else [])), cusum=cusum, slow=slow
    )


def play(scenario: Scenario, seed: int, watch: Watch = watch) -> Outcome:
    """Simulate one run and watch it, with our monitor or another."""
    onset = float(np.random.default_rng([seed, 7]).uniform(*scenario.onset)) if scenario.faults else None
    faults = [Fault(parameter=name, factor=factor, start=onset or 0.0) for name, factor in scenario.faults]
    plant = effort_or_flow_goes_on(scenario.folder) if scenario.goes_on else None
    recording = case(scenario.folder, seed, faults, seconds=scenario.seconds, plant=plant).recording
    spec, engine = engine_of(scenario.folder)
    found = watch(spec, engine, recording, onset, max(scenario.looks, default=0.0))
    alarm = found.detection.time if found.detection is not None else None
    begin = _opening(spec, recording, onset or 0.0) if scenario.from_opening else onset
    early = alarm is not None and (onset is None or alarm < onset)
    counts = alarm is not None and begin is not None and not early
    names = [item.name for item in spec.parameters]
    truth = {name: recording.parameters[-1, names.index(name)] for name, _ in scenario.faults}
    ends = [alarm + after + EPSILON for after in scenario.looks] if counts and alarm is not None else []
    readings = [_reading([item for item in found.diagnoses if item.time <= end][-1], truth) for end in ends]
    return Outcome(
        key=scenario.key,
        delay=max(alarm - begin, 0.0) if alarm is not None and begin is not None and not early else None,
        early=early,
        cusum=found.cusum,
        slow=found.slow,
        readings=tuple(readings),
    )


def _opening(spec: EngineSpec, recording: Simulation, onset: float) -> float | None:
    """Give the first moment from the onset on at which u_in is wide open; None where it never is."""
    column = [item.name for item in spec.inputs].index("u_in")
    open_wide = recording.inputs[:, column] >= OPEN
    already = open_wide[np.searchsorted(recording.time, onset, side="right") - 1]
    later = recording.time[open_wide & (recording.time >= onset)]
    return onset if already else float(later[0]) if later.size else None


def _reading(diagnosis: Diagnosis, truth: dict[str, float]) -> Reading:
    rank = [frozenset(item.parameters) for item in diagnosis.candidates].index(frozenset(truth))  # all sets are listed
    suspects = diagnosis.candidates[rank].suspects
    return Reading(rank=rank + 1, error=float(max(abs(s.estimate / truth[s.parameter] - 1.0) for s in suspects)))


def play_all(keys: Sequence[str], seeds: Sequence[int]) -> dict[str, list[Outcome]]:
    """Give the outcomes of some scenarios with some seeds, from several processes."""
    jobs = [(SCENARIOS[key], seed) for key in keys for seed in seeds]
    outcomes: dict[str, list[Outcome]] = {key: [] for key in keys}
    with Pool(PROCESSES) as pool:
        for number, outcome in enumerate(pool.imap(_play, jobs), start=1):
            outcomes[outcome.key].append(outcome)
            if number % len(seeds) == 0:
                print(f"{number} of {len(jobs)} runs: {outcome.key}", file=sys.stderr, flush=True)
    return outcomes


def _play(job: tuple[Scenario, int]) -> Outcome:
    return play(*job)


def rows_of(scenario: Scenario, outcomes: Sequence[Outcome]) -> list[Row]:
    """Give the lines of one scenario."""
    if not scenario.faults:
        return [false_alarms(f"{scenario.title}: runs with a false alarm", outcomes)]
    rows = []
    if scenario.delay is not None:
        delays = [math.inf if outcome.delay is None else outcome.delay for outcome in outcomes]
        worst, missed = quantile(delays, 0.95), sum(map(math.isinf, delays))
        since = ", from u_in at 60 % or more" if scenario.from_opening else ""
        got = f"{seconds(worst)} (median {seconds(quantile(delays, 0.5))}; {missed or 'none'} missed)"
        figure, asked = f"{scenario.title}: detected in 95 %{since}", f"{scenario.delay:g} s"
        rows.append(Row(figure=figure, asked=asked, got=got, met=worst <= scenario.delay, cost=worst))
    for what, part, best in (("first", scenario.first, 1), ("in the first three", scenario.three, 3)):
        if part is not None:
            count = sum(bool(outcome.readings) and outcome.readings[0].rank <= best for outcome in outcomes)
            figure, got = f"{scenario.title}: true set {what} {_when(scenario, 0)}", share(count, len(outcomes))
            met = count >= part * len(outcomes) - 1e-9
            rows.append(Row(figure=figure, asked=f"{100 * part:g} %", got=got, met=met, cost=-count))
    if scenario.error is not None:
        for look in dict.fromkeys((0, int(np.argmax(scenario.looks)))):
            errors = [outcome.readings[look].error if outcome.readings else math.inf for outcome in outcomes]
            worst = quantile(errors, 0.9)
            figure = f"{scenario.title}: error, 90 % quantile, {_when(scenario, look)}"
            got = f"{percent(worst)} (median {percent(quantile(errors, 0.5))})"
            met = worst <= scenario.error
            rows.append(Row(figure=figure, asked=f"{100 * scenario.error:g} %", got=got, met=met, cost=worst))
    return rows


def false_alarms(figure: str, outcomes: Sequence[Outcome]) -> Row:
    """Give the line of the alarms before a fault."""
    alarms, slow = sum(outcome.early for outcome in outcomes), max(outcome.slow for outcome in outcomes)
    got = f"{alarms} of {len(outcomes)}; largest CUSUM {max(outcome.cusum for outcome in outcomes):.1f}"
    got += f", slow error {slow:.2f} sd" if slow else ""
    return Row(figure=figure, asked="0", got=got, met=alarms == 0, cost=alarms)


def _when(scenario: Scenario, look: int) -> str:
    after = scenario.looks[look]
    return "at the end" if after == END else f"{after:g} s after the alarm"


def time_rows(keys: Sequence[str], seed: int) -> Iterator[Row]:
    """Give the lines about time; they are measured one after the other."""
    if "time.bank" in keys:
        taken, hypotheses = bank_throughout(seed)
        figure = f"tank, {hypotheses} hypotheses: processor time of 82 min at 1 Hz, bank throughout"
        yield Row(figure=figure, asked="1 s", got=f"{taken:.2f} s", met=taken < 1.0)
    if "time.demo" in keys:
        there = find_spec("ziglang") is not None  # by `pip install faultbond[compiler]`
        for figure, settings in (("demo", {}), ("demo, compiler ziglang", {"CC": " ".join(ZIG)}))[: 1 + there]:
            with tempfile.TemporaryDirectory() as folder:
                first, whole = timed_program("demo", folder=folder, settings=settings | {CACHE: folder})
                if not Path(folder, "report.html").exists():
                    raise RuntimeError("the demo left no report")
            yield Row(figure=f"{figure}, engine not built yet", asked="30 s", got=f"{whole:.1f} s", met=whole <= 30.0)
            yield Row(figure=f"{figure}: first line of output", asked="", got=f"{first:.2f} s", met=None)
    if "time.build" in keys:
        times = {example: build(example) for example in BUILT}
        slowest = max(times, key=lambda example: times[example])
        figure = f"engine built from the model file, slowest of {len(times)} examples"
        yield Row(figure=figure, asked="5 s", got=f"{times[slowest]:.2f} s ({slowest})", met=times[slowest] <= 5.0)


def bank_throughout(seed: int, rounds: int = 3) -> tuple[float, int]:
    """Give the processor time, s, of 82 minutes of the tank with the bank from the first possible sample on.

    Start, warm-up and the begin of the bank are part of it. Median of some rounds, and the number of hypotheses.
    """
    eager, given, taken = alarmed_at_once(graph_of("tank")), samples(tank_case(seed).recording), []
    for _ in range(rounds):
        begin = time.process_time()
        monitor = passed(eager, given)
        taken.append(time.process_time() - begin)
    alarm = monitor.number("clock.alarm")
    if alarm != eager.spec.thresholds.warm_up_samples:
        raise RuntimeError(f"the bank began at sample {alarm:.0f}, not at the end of the warm-up")
    return float(np.median(taken)), len(eager.spec.hypotheses)


def build(example: str) -> float:
    """Give the wall time, s, from the model file to a running engine, nothing built before."""
    with fresh_cache():
        begin = time.perf_counter()
        build_engine(load_model(EXAMPLES / example / "model.yaml"))
        return time.perf_counter() - begin


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    words = "What is asked of faultbond, and what it does."
    chosen = arguments(words, argv, seeds=30, first_seed=700, only="")
    seeds, wanted = seeds_of(chosen), selected((*SCENARIOS, *TIMES), chosen.only)
    if not wanted:
        sys.exit(f"--only {chosen.only}: no such row; there are {', '.join((*SCENARIOS, *TIMES))}")
    keys = [key for key in SCENARIOS if key in wanted]
    outcomes = play_all(keys, seeds) if keys else {}
    rows = [row for key in keys for row in rows_of(SCENARIOS[key], outcomes[key])]
    after = [outcome for key in keys if SCENARIOS[key].faults for outcome in outcomes[key]]
    if after:
        quiet = len([scenario for scenario in HEALTHY if scenario.key in keys])
        rows.insert(quiet, false_alarms("all runs with a fault: alarms before it", after))
    rows += time_rows(wanted, chosen.first_seed)
    told = note(f"Seeds {seeds[0]} to {seeds[-1]}")
    publish("trust.figures", chosen, told, (HEADER, [row.cells for row in rows]))


if __name__ == "__main__":
    main()
