"""How good is it: the table of trust, measured on simulated plants with faults of every kind.

    python -m benchmarks.trust [--seeds 100] [--first-seed 5000] [--only CASE,...] [--json FILE] [--markdown FILE]

CASE is a key of `benchmarks.trust_cases` or the first words of several, `tank` or `bias`. `--json` keeps every run, and
`--from FILE` makes the table of such a file anew.
"""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from multiprocessing import Pool
from pathlib import Path

from benchmarks.page import as_markdown, as_text, machine, today, write_part
from benchmarks.trust_calibration import calibration_rows, coverage_rows
from benchmarks.trust_cases import CASES, MOTOR, SMALL
from benchmarks.trust_play import Claim, Run, play
from benchmarks.trust_plot import write_plot

PROCESSES = 2
HEADER = ("figure", "asked", "got", "verdict")
HEALTHY_SEEDS, ROUGH_SEEDS = 3.0, 0.5  # in seeds of the other cases
Runs = dict[str, list[Run]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of the table."""

    figure: str
    asked: str
    got: str
    met: bool | None

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """What is printed."""
        return self.figure, self.asked, self.got, "" if self.met is None else "met" if self.met else "falls short"


def play_all(keys: Sequence[str], seeds: int, first: int) -> Runs:
    """Give the runs of some cases."""
    jobs = [(key, first + k) for key in keys for k in range(_count(key, seeds))]
    runs: Runs = {key: [] for key in keys}
    with Pool(PROCESSES) as pool:
        for number, run in enumerate(pool.imap(_play, jobs, chunksize=2), start=1):
            runs[run.key].append(run)
            if number % 50 == 0:
                print(f"{number} of {len(jobs)} runs: {run.key}", file=sys.stderr, flush=True)
    return runs


def _count(key: str, seeds: int) -> int:
    part = {"tank.healthy": HEALTHY_SEEDS, "tank.rough": ROUGH_SEEDS}.get(key, 1.0)
    return max(1, round(part * seeds))


def _play(job: tuple[str, int]) -> Run:
    key, seed = job
    return play(CASES[key], seed)


def rows(runs: Runs) -> list[Row]:
    """Give the lines of the table for the cases that were played."""
    found: list[Row] = []
    found += _alarms(runs, "tank.healthy", "tank healthy, 82 min")
    found += _alarms(runs, "tank.rough", "tank healthy, parameters and curves off by up to 5 %, 82 min")
    found += _alarms(runs, "motor.healthy", "motor healthy, 300 s")
    found += _alarms(runs, "current.healthy", "motor with current healthy, 300 s")
    found += _delays(runs, "tank.K6", "tank, leak K6", 50.0)
    found += _delays(runs, "small.K6", "tank, smallest leak, 0.010 l/s", 600.0)
    tank = [key for key in runs if key.startswith("tank.K")]
    found += _ranks(runs, tank, "tank, nine sets of faults, 10 min after the alarm", 2, 0.97, 1)
    found += _ranks(runs, tank, "tank, nine sets of faults, 10 min after the alarm: in the first three", 2, 1.0, 3)
    found += [row for key in tank for row in _ranks(runs, [key], f"  of these {key[5:]}", 2, None, 1)]
    found += _errors(runs, "tank.K1", "tank, K1: error", 2, 0.07)
    found += _errors(runs, "tank.K6", "tank, K6: error", 2, 0.03)
    for name in SMALL:
        found += _small(runs, name)
    singles = [f"motor.{name}.{word}" for name in MOTOR for word in ("up", "down")]
    found += _ranks(runs, singles, "motor, every single x1.5 and /1.5, 5 s after the alarm", 1, 0.97, 1)
    found += _ranks(runs, ["motor.pairs.alike"], "motor, pairs in the same direction, 20 s after the alarm", 3, 0.85, 1)
    found += _groups(runs, ["motor.pairs.any"], "motor, pairs in any direction, 20 s: truth in the group", 3, 0.97)
    found += _ranks(runs, ["current.triples"], "motor with current, triples, 10 s after the alarm", 2, 0.95, 1)
    found += _errors(runs, "current.triples", "motor with current, triples: error", 2, 0.03)
    for key, what, look in (
        ("bias.flow", "tank, flow reads 5 sd wrong, 5 min", 1),
        ("bias.pressure", "tank, pressure reads 5 sd wrong, 5 min", 1),
        ("bias.omega", "motor, speed reads 5 sd wrong, 10 s", 2),
        ("bias.current.omega", "motor with current, speed reads 5 sd wrong, 10 s", 2),
        ("bias.current.i", "motor with current, current reads 5 sd wrong, 10 s", 2),
    ):
        found += _ranks(runs, [key], f"{what} after the alarm", look, 0.97, 1)
    found += _drift(runs)
    found += _ranks(runs, ["missing.K6"], "tank, leak K6, 5 % of all values missing, 10 min", 2, 0.95, 1)
    found += _delays(runs, "missing.K6", "tank, leak K6, 5 % of all values missing", 50.0)
    found += _ranks(runs, ["missing.R"], "motor, R x2, 5 % of all values missing, 5 s", 1, 0.95, 1)
    return found


def _chosen(runs: Runs, keys: Sequence[str]) -> list[Run]:
    return [run for key in keys for run in runs.get(key, [])]


def _alarms(runs: Runs, key: str, figure: str) -> list[Row]:
    chosen = runs.get(key, [])
    if not chosen:
        return []
    alarms = sum(run.early for run in chosen)
    got = f"{alarms} of {len(chosen)}; largest CUSUM {max(run.cusum for run in chosen):.1f}"
    return [Row(figure=f"{figure}: runs with a false alarm", asked="0", got=got, met=alarms == 0)]


def _delays(runs: Runs, key: str, figure: str, limit: float) -> list[Row]:
    chosen = runs.get(key, [])
    if not chosen:
        return []
    delays = sorted(math.inf if run.delay is None else run.delay for run in chosen)
    worst, middle = quantile(delays, 0.95), quantile(delays, 0.5)
    got = f"{_seconds(worst)} (median {_seconds(middle)})"
    return [Row(figure=f"{figure}: detected in 95 % within", asked=f"{limit:g} s", got=got, met=worst <= limit)]


def _small(runs: Runs, name: str) -> list[Row]:
    chosen = _chosen(runs, [f"small.{name}.up", f"small.{name}.down"])
    if not chosen:
        return []
    within = sum(run.delay is not None and run.delay <= 600.0 for run in chosen)
    got = f"{within} of {len(chosen)} ({100 * within / len(chosen):.0f} %)"
    figure = f"tank, {name} up or down by 10 %: detected within 10 min"
    return [Row(figure=figure, asked="95 %", got=got, met=within >= 0.95 * len(chosen))]


def _ranks(runs: Runs, keys: Sequence[str], figure: str, look: int, part: float | None, best: int) -> list[Row]:
    chosen = _chosen(runs, keys)
    if not chosen:
        return []
    count = sum(bool(run.looks) and run.looks[look].rank <= best for run in chosen)
    return [_share(figure if best > 1 else f"{figure}: true set first", count, len(chosen), part)]


def _groups(runs: Runs, keys: Sequence[str], figure: str, look: int, part: float) -> list[Row]:
    chosen = _chosen(runs, keys)
    count = sum(bool(run.looks) and run.looks[look].group for run in chosen)
    return [_share(figure, count, len(chosen), part)] if chosen else []


def _share(figure: str, count: int, total: int, part: float | None) -> Row:
    asked = "" if part is None else f"{100 * part:g} %"
    got = f"{count} of {total} ({100 * count / total:.0f} %)"
    return Row(figure=figure, asked=asked, got=got, met=None if part is None else count >= part * total - 1e-9)


def _errors(runs: Runs, key: str, figure: str, look: int, limit: float) -> list[Row]:
    claims = [run.looks[look] for run in runs.get(key, []) if run.looks]
    return _quantile_row(figure, [claim.error for claim in claims], limit) if claims else []


def _drift(runs: Runs) -> list[Row]:
    last = [run.claims[-1] for run in runs.get("drift.K1", []) if run.claims]
    if not last:
        return []
    total = len(runs["drift.K1"])
    figure = "tank, K1 doubles over an hour"
    found = [_share(f"{figure}: K1 first at the end", sum(claim.right for claim in last), total, 0.95)]
    found += _quantile_row(f"{figure}: value", [claim.error for claim in last], 0.08)
    found += _quantile_row(f"{figure}: rate", [math.inf if c.rate is None else c.rate for c in last], 0.20)
    found.append(_share(f"{figure}: forecast covers the truth", sum(c.covered is True for c in last), total, 0.90))
    return found


def _quantile_row(figure: str, values: Sequence[float], limit: float) -> list[Row]:
    worst, middle = quantile(sorted(values), 0.9), quantile(sorted(values), 0.5)
    got = "none" if math.isinf(worst) else f"{100 * worst:.2g} % (median {100 * middle:.2g} %)"
    return [Row(figure=f"{figure}, 90 % quantile", asked=f"{100 * limit:g} %", got=got, met=worst <= limit)]


def quantile(ordered: Sequence[float], part: float) -> float:
    """Give the smallest of some ordered values that a part of them does not exceed."""
    return ordered[max(math.ceil(part * len(ordered) - 1e-9) - 1, 0)]


def _seconds(value: float) -> str:
    return "never" if math.isinf(value) else f"{value:.3g} s" if value < 100 else f"{value:.0f} s"


def _read(path: Path) -> Runs:
    """Read runs that `--json` wrote."""
    kept = json.loads(path.read_text(encoding="utf-8"))
    runs: Runs = {}
    for item in kept["runs"]:
        looks, claims = ([Claim(**claim) for claim in item.pop(name)] for name in ("looks", "claims"))
        run = Run(**item, looks=tuple(looks), claims=tuple(claims))
        runs.setdefault(run.key, []).append(run)
    return runs


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="How good faultbond is on simulated plants.")
    parser.add_argument("--seeds", type=int, default=100, help="runs of each case (default %(default)s)")
    parser.add_argument("--first-seed", type=int, default=5000, help="the first seed (default %(default)s)")
    parser.add_argument("--only", metavar="CASE,...", default="", help="cases, or the first words of their names")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write every run to FILE")
    parser.add_argument("--from", metavar="FILE", dest="source", type=Path, help="take the runs of FILE, play none")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the tables into the page FILE")
    chosen = parser.parse_args(argv)
    names = [name for name in chosen.only.split(",") if name]

    def wanted(key: str) -> bool:
        return not names or any(key == name or key.startswith(f"{name}.") for name in names)

    keys = [key for key in CASES if wanted(key)]
    runs = _read(chosen.source) if chosen.source else play_all(keys, chosen.seeds, chosen.first_seed)
    if chosen.json is not None:
        kept = {"runs": [asdict(run) for found in runs.values() for run in found]}
        chosen.json.write_text(json.dumps(kept) + "\n", encoding="utf-8")
    table, calibrated = rows(runs), [*calibration_rows(runs), *coverage_rows(runs)]
    print(as_text(HEADER, [row.cells for row in table]))
    print("\n" + as_text(("calibration", "claimed", "right", "runs"), calibrated))
    seeds = [run.seed for found in runs.values() for run in found]
    note = f"Seeds {min(seeds)} to {max(seeds)}, {len(seeds)} runs; {today()}; {machine()}."
    print(f"\n{note}")
    if chosen.markdown is not None:
        command = f"`python -m benchmarks.trust --seeds {chosen.seeds} --first-seed {chosen.first_seed}`"
        parts = (command, note, as_markdown(HEADER, [row.cells for row in table]))
        write_part(chosen.markdown, "trust", "\n\n".join(parts))
        write_part(chosen.markdown, "calibration", as_markdown(("", "claimed", "right", "claims"), calibrated))
        write_plot(runs, chosen.markdown.parent / "images" / "trust" / "calibration.svg")


if __name__ == "__main__":
    main()
