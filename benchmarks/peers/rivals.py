"""The table of figures with a bank of FilterPy's filters beside faultbond, on the same recordings.

    python -m benchmarks.peers.rivals [--seeds 10] [--first-seed 700] [--only ROW,...] [--markdown FILE]

How the bank is built, and with which settings, is said in `benchmarks.peers.filterpy_bank`. Its alarm is calibrated
first: the limit is `MARGIN` times the largest CUSUM in healthy runs with seeds of their own. FilterPy comes with the
dependency group `bench`.
"""

import sys
import time
from collections.abc import Sequence
from functools import cache, partial
from multiprocessing import Pool
from multiprocessing.pool import Pool as Processes

from benchmarks.peers import filterpy_bank
from benchmarks.shared.page import arguments, note, publish, seeds_of, selected
from benchmarks.shared.plants import case, graph_of
from benchmarks.shared.play import engine_of
from benchmarks.trust.figures import Outcome, play, rows_of, watch
from benchmarks.trust.scenarios import SCENARIOS
from faultbond.equations.step import StepModel
from faultbond.simulate import Fault
from faultbond.synthesis.engine import build_model

PROCESSES = 2
HEALTHY = {"tank": "tank.healthy", "dc_motor": "motor.healthy", "rlc": "rlc.healthy"}
FAULTY = ("tank.K1", "tank.K6", "tank.K1+K6", "tank.K8", "motor.R", "motor.L", "motor.R+J", "rlc.C")
KEYS = (*HEALTHY.values(), *FAULTY)
CALIBRATION_SEEDS = range(200_000, 200_100)  # fewer allow limits that some of the 300 healthy runs asked of us pass
MARGIN = 1.15
HEADER = ("figure", "asked", "faultbond", "FilterPy bank", "faultbond is")
Pair = tuple[Outcome, Outcome]


@cache
def model_of(folder: str) -> StepModel:
    """Give the step model of an example, built once per process."""
    return build_model(graph_of(folder))


def largest_sum(job: tuple[str, int]) -> float:
    """Give the largest CUSUM of the bank's healthy filter in one healthy run."""
    folder, seed = job
    spec, engine = engine_of(folder)
    recording = case(folder, seed, seconds=SCENARIOS[HEALTHY[folder]].seconds).recording
    watched = filterpy_bank.watch(model_of(folder), float("inf"), spec, engine, recording, None, 0.0)
    return watched.cusum


def calibrated(pool: Processes, folders: Sequence[str]) -> dict[str, float]:
    """Give the limit of the bank's alarm for each example."""
    limits = {}
    for folder in folders:
        largest = max(pool.imap(largest_sum, [(folder, seed) for seed in CALIBRATION_SEEDS]))
        limits[folder] = MARGIN * largest
        print(f"limit for {folder}: {limits[folder]:.1f}", file=sys.stderr, flush=True)
    return limits


def play_both(job: tuple[str, int, float]) -> Pair:
    """Give what faultbond and the bank make of one run."""
    key, seed, limit = job
    scenario = SCENARIOS[key]
    other = partial(filterpy_bank.watch, model_of(scenario.folder), limit)
    return play(scenario, seed), play(scenario, seed, other)


def rows_of_both(key: str, pairs: Sequence[Pair]) -> list[tuple[str, ...]]:
    """Give the lines of one scenario."""
    scenario = SCENARIOS[key]
    ours, theirs = ([pair[k] for pair in pairs] for k in (0, 1))
    both = zip(rows_of(scenario, ours), rows_of(scenario, theirs), strict=True)
    lines = [(a.figure, a.asked, a.got, b.got, _compared(a.cost, b.cost)) for a, b in both]
    if not scenario.faults:
        return list(lines)
    early = [sum(outcome.early for outcome in outcomes) for outcomes in (ours, theirs)]
    return [*lines, (f"{scenario.title}: alarms before the fault", "0", *map(str, early), _compared(*early))]


def _compared(ours: float, theirs: float) -> str:
    return "equal" if ours == theirs else "better" if ours < theirs else "worse"


def times(key: str, seed: int, limit: float) -> tuple[str, ...]:
    """Give the line about processor time: a run of one scenario up to its end, everything but the simulation."""
    scenario = SCENARIOS[key]
    onset = scenario.onset[0]
    faults = [Fault(parameter=name, factor=factor, start=onset) for name, factor in scenario.faults]
    recording = case(scenario.folder, seed, faults, seconds=scenario.seconds).recording
    spec, engine = engine_of(scenario.folder)
    taken = []
    for each in (watch, partial(filterpy_bank.watch, model_of(scenario.folder), limit)):
        begin = time.process_time()
        each(spec, engine, recording, onset, float("inf"))
        taken.append(time.process_time() - begin)
    sets = f"{len(spec.hypotheses)} sets of parameters, {recording.time.size} samples"
    got = (f"{value:.2f} s" for value in taken)
    return f"{scenario.title}: processor time of one run, {sets}", "", *got, _compared(taken[0], taken[1])


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    words = "The table of figures, with a bank of FilterPy's filters beside us."
    chosen = arguments(words, argv, seeds=10, first_seed=700, only="")
    keys, seeds = selected(KEYS, chosen.only), seeds_of(chosen)
    if not keys:
        sys.exit(f"--only {chosen.only}: no such row; there are {', '.join(KEYS)}")
    with Pool(PROCESSES) as pool:
        limits = calibrated(pool, list(dict.fromkeys(SCENARIOS[key].folder for key in keys)))
        jobs = [(key, seed, limits[SCENARIOS[key].folder]) for key in keys for seed in seeds]
        pairs: dict[str, list[Pair]] = {key: [] for key in keys}
        for number, pair in enumerate(pool.imap(play_both, jobs), start=1):
            pairs[pair[0].key].append(pair)
            if number % len(seeds) == 0:
                print(f"{number} of {len(jobs)} runs: {pair[0].key}", file=sys.stderr, flush=True)
    rows = [row for key in keys for row in rows_of_both(key, pairs[key])]
    firsts = {SCENARIOS[key].folder: key for key in reversed(keys) if key in FAULTY}
    rows += [times(key, seeds[0], limits[folder]) for folder, key in reversed(firsts.items())]
    told = ", ".join(f"{folder} {limit:.1f}" for folder, limit in limits.items())
    told = note(f"Seeds {seeds[0]} to {seeds[-1]}", f"limits of the bank's CUSUM: {told}")
    publish("peers.rivals", chosen, told, (HEADER, rows))


if __name__ == "__main__":
    main()
