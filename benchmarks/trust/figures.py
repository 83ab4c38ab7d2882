"""The table of figures: what is asked of faultbond, what it does, and whether that is enough.

    python -m benchmarks.trust.figures [--seeds 30] [--first-seed 700] [--only ROW,...] [--json FILE] [--markdown FILE]

The plants are simulated and are not quite their models: see `benchmarks.shared.plants`. ROW is a scenario, `tank.K1`,
or the first words of several, `tank` or `time`. `--markdown` puts the table into a page, between its marks.
"""

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from multiprocessing import Pool
from pathlib import Path

import numpy as np

from benchmarks.shared.clock import BUILT, bank_throughout, build, demo
from benchmarks.shared.page import Row, as_markdown, as_text, machine, today, write_part
from benchmarks.shared.play import Outcome, play
from benchmarks.trust.scenarios import END, HEALTHY, SCENARIOS, Scenario

PROCESSES = 2
HEADER = ("figure", "asked", "got", "verdict")


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure(Row):
    """One line of the table and the scenario that it is of."""

    key: str


def play_all(keys: Sequence[str], seeds: Sequence[int]) -> dict[str, list[Outcome]]:
    """Give the outcomes of some scenarios with some seeds, from several processes."""
    jobs = [(key, seed) for key in keys for seed in seeds]
    outcomes: dict[str, list[Outcome]] = {key: [] for key in keys}
    with Pool(PROCESSES) as pool:
        for number, outcome in enumerate(pool.imap(_play, jobs), start=1):
            outcomes[outcome.key].append(outcome)
            if number % len(seeds) == 0:
                print(f"{number} of {len(jobs)} runs: {outcome.key}", file=sys.stderr, flush=True)
    return outcomes


def _play(job: tuple[str, int]) -> Outcome:
    key, seed = job
    return play(SCENARIOS[key], seed)


def rows_of(scenario: Scenario, outcomes: Sequence[Outcome]) -> list[Figure]:
    """Give the lines of one scenario."""
    if not scenario.faults:
        return [_false_alarms(scenario.key, f"{scenario.title}: runs with a false alarm", outcomes)]
    rows = []
    if scenario.delay is not None:
        rows.append(_delay(scenario, outcomes))
    for what, part, best in (("first", scenario.first, 1), ("in the first three", scenario.three, 3)):
        if part is not None:
            rows.append(_rank(scenario, what, part, best, outcomes))
    if scenario.error is not None:
        rows += [_error(scenario, look, outcomes) for look in dict.fromkeys((0, _last_look(scenario)))]
    return rows


def _false_alarms(key: str, figure: str, outcomes: Sequence[Outcome]) -> Figure:
    alarms = sum(outcome.early for outcome in outcomes)
    largest = f"largest CUSUM {max(outcome.cusum for outcome in outcomes):.1f}"
    slow = max(outcome.slow for outcome in outcomes)
    more = f", slow error {slow:.2f} sd" if slow else ""
    return Figure(
        key=key, figure=figure, asked="0", got=f"{alarms} of {len(outcomes)}; {largest}{more}", met=alarms == 0
    )


def _delay(scenario: Scenario, outcomes: Sequence[Outcome]) -> Figure:
    limit = scenario.delay or 0.0
    delays = [math.inf if outcome.delay is None else outcome.delay for outcome in outcomes]
    worst = _quantile(delays, 0.95)
    since = ", from u_in at 60 % or more" if scenario.from_opening else ""
    return Figure(
        key=scenario.key,
        figure=f"{scenario.title}: detected in 95 %{since}",
        asked=f"{limit:g} s",
        got=f"{_seconds(worst)} (median {_seconds(_quantile(delays, 0.5))}; {_missed(delays)})",
        met=worst <= limit,
    )


def _missed(delays: Sequence[float]) -> str:
    missed = sum(math.isinf(delay) for delay in delays)
    return f"{missed} missed" if missed else "none missed"


def _seconds(value: float) -> str:
    return "never" if math.isinf(value) else f"{value:.3g} s" if value < 100 else f"{value:.0f} s"


def _rank(scenario: Scenario, what: str, part: float, best: int, outcomes: Sequence[Outcome]) -> Figure:
    count = sum(_rank_in(outcome) <= best for outcome in outcomes)
    return Figure(
        key=scenario.key,
        figure=f"{scenario.title}: true set {what} {_when(scenario, 0)}",
        asked=f"{100 * part:g} %",
        got=f"{count} of {len(outcomes)} ({100 * count / len(outcomes):.0f} %)",
        met=count >= part * len(outcomes) - 1e-9,
    )


def _rank_in(outcome: Outcome, look: int = 0) -> float:
    return outcome.readings[look].rank if outcome.readings else math.inf


def _error(scenario: Scenario, look: int, outcomes: Sequence[Outcome]) -> Figure:
    limit = scenario.error or 0.0
    errors = [outcome.readings[look].error if outcome.readings else math.inf for outcome in outcomes]
    worst = _quantile(errors, 0.9)
    return Figure(
        key=scenario.key,
        figure=f"{scenario.title}: error, 90 % quantile, {_when(scenario, look)}",
        asked=f"{100 * limit:g} %",
        got=f"{_percent(worst)} (median {_percent(_quantile(errors, 0.5))})",
        met=worst <= limit,
    )


def _percent(value: float) -> str:
    return "none" if math.isinf(value) else f"{100 * value:.2g} %"


def _when(scenario: Scenario, look: int) -> str:
    after = scenario.looks[look]
    return "at the end" if after == END else f"{after:g} s after the alarm"


def _last_look(scenario: Scenario) -> int:
    """Give the latest moment at which the ranking was read."""
    return int(np.argmax(scenario.looks))


def _quantile(values: Sequence[float], part: float) -> float:
    """Give the smallest value that a part of all values does not exceed."""
    ordered = sorted(values)
    return ordered[max(math.ceil(part * len(ordered) - 1e-9) - 1, 0)]


def time_rows(wanted: Callable[[str], bool], seed: int) -> list[Figure]:
    """Give the lines about time; they are measured one after the other."""
    rows = []
    if wanted("time.bank"):
        taken, hypotheses = bank_throughout(seed)
        figure = f"tank, {hypotheses} hypotheses: processor time of 82 min at 1 Hz, bank throughout"
        rows.append(Figure(key="time.bank", figure=figure, asked="1 s", got=f"{taken:.2f} s", met=taken < 1.0))
    if wanted("time.demo"):
        for compiled, limit in ((True, 30.0), (False, 120.0)):
            seen = demo(compiled=compiled)
            engine = "compiler, engine not built yet" if compiled else "no compiler"
            got, first = f"{seen.whole:.1f} s", f"{seen.first_line:.2f} s"
            figure = f"demo, {engine}"
            rows.append(Figure(key="time.demo", figure=figure, asked=f"{limit:g} s", got=got, met=seen.whole <= limit))
            rows.append(
                Figure(key="time.demo", figure=f"{figure}: first line of output", asked="", got=first, met=None)
            )
    if wanted("time.build"):
        times = {example: build(example) for example in BUILT}
        slowest = max(times, key=lambda example: times[example])
        got = f"{times[slowest]:.2f} s ({slowest})"
        figure = f"engine built from the model file, slowest of {len(times)} examples"
        rows.append(Figure(key="time.build", figure=figure, asked="5 s", got=got, met=times[slowest] <= 5.0))
    return rows


def shortfalls(scenario: Scenario, outcomes: Sequence[Outcome]) -> list[str]:
    """Give a line for each run that is not as asked."""
    lines = []
    for outcome in outcomes:
        wrong = []
        if outcome.early:
            wrong.append(f"false alarm at {outcome.alarm:g} s")
        elif scenario.faults and outcome.delay is None:
            wrong.append("not detected")
        elif outcome.delay is not None and scenario.delay is not None and outcome.delay > scenario.delay:
            wrong.append(f"detected after {_seconds(outcome.delay)}")
        if outcome.readings:
            first, last = outcome.readings[0], outcome.readings[_last_look(scenario)]
            if first.rank > 1:
                group = "in the group" if first.group else "not in the group"
                wrong.append(
                    f"rank {first.rank} with {first.probability:.2g}, {group}; first {first.winner} "
                    f"with {first.winner_probability:.2g}"
                )
            limit = scenario.error or math.inf
            if max(first.error, last.error) > limit:
                wrong.append(f"error {_percent(first.error)}, {_percent(last.error)} at the latest reading")
        if wrong:
            since = "" if outcome.delay is None else f", alarm {_seconds(outcome.delay)} after it counts"
            lines.append(f"{outcome.key} seed {outcome.seed}{since}: {'; '.join(wrong)}")
    return lines


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="What is asked of faultbond, and what it does.")
    parser.add_argument("--seeds", type=int, default=30, help="number of seeds (default %(default)s)")
    parser.add_argument("--first-seed", type=int, default=700, help="the first of them (default %(default)s)")
    parser.add_argument("--only", metavar="ROW,...", default="", help="scenarios, or the first words of their names")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the rows and every run to FILE")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the table into the page FILE")
    chosen = parser.parse_args(argv)
    names = [name for name in chosen.only.split(",") if name]

    def wanted(key: str) -> bool:
        return not names or any(key == name or key.startswith(f"{name}.") for name in names)

    seeds = range(chosen.first_seed, chosen.first_seed + chosen.seeds)
    keys = [key for key in SCENARIOS if wanted(key)]
    outcomes = play_all(keys, seeds) if keys else {}
    rows = [row for key in keys for row in rows_of(SCENARIOS[key], outcomes[key])]
    after = [outcome for key in keys if SCENARIOS[key].faults for outcome in outcomes[key]]
    if after:
        rows.insert(
            len([scenario for scenario in HEALTHY if scenario.key in keys]),
            _false_alarms("all", "all runs with a fault: alarms before it", after),
        )
    rows += time_rows(wanted, chosen.first_seed)
    if not rows:
        parser.error(f"--only {chosen.only}: no such row; there are {', '.join(SCENARIOS)}, time.bank, time.demo, ...")
    print(as_text(HEADER, [row.cells for row in rows]))
    falls = [line for key in keys for line in shortfalls(SCENARIOS[key], outcomes[key])]
    print("\nRuns that are not as asked:", *(falls or ["none"]), sep="\n")
    note = f"seeds {seeds[0]} to {seeds[-1]}; {today()}; {machine()}"
    print(f"\n{note}")
    if chosen.json is not None:
        report = {
            "note": note,
            "rows": [asdict(row) for row in rows],
            "runs": [asdict(outcome) for key in keys for outcome in outcomes[key]],
        }
        chosen.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if chosen.markdown is not None:
        command = f"python -m benchmarks.trust.figures --seeds {chosen.seeds} --first-seed {chosen.first_seed}"
        command += f" --only {chosen.only}" if names else ""
        text = f"`{command}`\n\n{note[0].upper()}{note[1:]}.\n\n{as_markdown(HEADER, [row.cells for row in rows])}"
        write_part(chosen.markdown, "figures", text)


if __name__ == "__main__":
    main()
