"""How good is it: the table of trust, measured on simulated plants with faults of every kind.

    python -m benchmarks.trust [--seeds 100] [--first-seed 5000] [--only CASE,...] [--method METHOD] [--json FILE]
        [--markdown FILE]

CASE is a key of `benchmarks.trust.cases` or the first words of several, `tank` or `bias`. `--json` keeps each run as it
ends, seed by seed, so that a part of them is there if the program is stopped; `--from FILE ...` makes the table of such
files anew.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from itertools import groupby
from json import JSONDecodeError
from multiprocessing import Pool
from pathlib import Path

from benchmarks.shared.page import as_markdown, as_text, note, selected, write_part
from benchmarks.trust.calibration import calibration_rows, write_plot
from benchmarks.trust.cases import CASES, CLASSIC
from benchmarks.trust.play import Claim, Run, play
from benchmarks.trust.rows import HEADER, cells
from faultbond.types import Method

PROCESSES = 2
PARTS = {"tank.healthy": 3.0, "tank.rough": 0.5}  # runs of a case, in runs of the other cases
Runs = dict[str, list[Run]]
Job = tuple[str, int, Method]  # case and seed, and by which method


def jobs(keys: Sequence[str], seeds: int, first: int, methods: Sequence[Method]) -> list[tuple[Job, ...]]:
    """Give what is to be played, all of one seed together; those of the first seed first."""
    found = [
        (key, seed, method)
        for method in methods
        for key in keys
        if method is Method.BANK or key in CLASSIC
        for seed in range(first, first + _count(key, seeds))
    ]
    by_seed = groupby(sorted(found, key=lambda job: job[1]), lambda job: job[1])
    return sorted((tuple(chosen) for _, chosen in by_seed), key=len, reverse=True)


def _count(key: str, seeds: int) -> int:
    return max(1, round(PARTS.get(key, 1.0) * seeds))


def play_all(todo: Sequence[tuple[Job, ...]]) -> Iterator[Run]:
    """Give the runs as they end."""
    with Pool(PROCESSES) as pool:
        for number, runs in enumerate(pool.imap_unordered(_play, todo), start=1):
            yield from runs
            print(f"{number} of {len(todo)} seeds", file=sys.stderr, flush=True)


def _play(todo: tuple[Job, ...]) -> list[Run]:
    return [play(CASES[key], seed, method) for key, seed, method in todo]


def keep(found: Iterator[Run], path: Path | None) -> Iterator[Run]:
    """Pass runs on; write each to a file, a line a run."""
    with nullcontext() if path is None else path.open("w", encoding="utf-8") as stream:
        for run in found:
            if stream is not None:
                stream.write(json.dumps(asdict(run)) + "\n")
                stream.flush()
            yield run


def read(paths: Sequence[Path]) -> Iterator[Run]:
    """Read runs that `keep` wrote; a line that is cut off is left out."""
    for path in paths:
        for line in path.read_text(encoding="utf-8").splitlines():
            try:
                item = json.loads(line)
            except JSONDecodeError:
                continue
            looks, claims = (tuple(Claim(**claim) for claim in item.pop(name)) for name in ("looks", "claims"))
            yield Run(**item, looks=looks, claims=claims)


def by_case(found: Iterable[Run]) -> Runs:
    """Give runs of one method by case, in the order of cases and seeds."""
    unique = {(run.key, run.seed): run for run in found}
    runs: Runs = {key: [] for key in CASES}
    for key, seed in sorted(unique):
        runs[key].append(unique[key, seed])
    return {key: chosen for key, chosen in runs.items() if chosen}


def seeds_of(runs: Runs) -> int:
    """Give how many seeds were asked for."""
    usual = [len(found) for key, found in runs.items() if key not in PARTS]
    return max(usual or [round(len(found) / PARTS[key]) for key, found in runs.items()])


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="How good faultbond is on simulated plants.")
    parser.add_argument("--seeds", type=int, default=100, help="runs of each case (default %(default)s)")
    parser.add_argument("--first-seed", type=int, default=5000, help="the first seed (default %(default)s)")
    parser.add_argument("--only", metavar="CASE,...", default="", help="cases, or the first words of their names")
    parser.add_argument("--method", choices=[item.value for item in Method], help="only this method (default both)")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write every run to FILE as it ends")
    parser.add_argument("--from", metavar="FILE", dest="source", type=Path, nargs="+", help="take the runs of FILEs")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the tables into the page FILE")
    chosen = parser.parse_args(argv)
    methods = [Method(chosen.method)] if chosen.method else list(Method)
    if chosen.source:
        found = list(read(chosen.source))
    else:
        todo = jobs(selected(CASES, chosen.only), chosen.seeds, chosen.first_seed, methods)
        found = list(keep(play_all(todo), chosen.json))
    runs, classic = (by_case(run for run in found if run.method == method.value) for method in Method)
    table, calibrated = cells(runs, classic), calibration_rows(runs)
    seeds = [run.seed for case in (*runs.values(), *classic.values()) for run in case]
    told = note(f"Seeds {min(seeds)} to {max(seeds)}, {len(seeds)} runs")
    print(as_text(HEADER, table), as_text(("calibration", "claimed", "right", "runs"), calibrated), told, sep="\n\n")
    page = chosen.markdown
    if page is not None:
        command = f"`python -m benchmarks.trust --seeds {seeds_of(runs)} --first-seed {min(seeds)}`"
        write_part(page, "trust", "\n\n".join((command, told, as_markdown(HEADER, table))))
        write_part(page, "calibration", as_markdown(("", "claimed", "right", "claims"), calibrated))
        write_plot(runs, page.parent / "images" / "trust" / "calibration.svg")
