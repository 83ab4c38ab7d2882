"""Is what it says of plants that others made right? Six plants, simulated with numpy alone, watched by `faultbond run`.

    python -m benchmarks.trust.strangers [--plants NAME,...] [--seeds 40] [--first-seed 0] [--processes 2]
        [--folder DIR] [--json FILE] [--from FILE ...] [--markdown FILE]

Of each plant `--seeds` recordings have a fault and half as many are healthy. Each model is a first one, made quiet by
`fit` and `check --data` (`ready`). Everything passes the command line. Three plants are there to tune on, the other
three only to be reported: who looks at their runs to change the method has none left to prove it by. `--folder` keeps
models and recordings; `--json` keeps what was found, a run a line, and `--from` makes the tables of such files anew.
"""

import argparse
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import asdict
from importlib import import_module
from json import JSONDecodeError
from multiprocessing import Pool
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from benchmarks.shared.page import as_markdown, as_text, note, selected, write_part
from benchmarks.trust.calibration import means, tenths
from benchmarks.trust.play import Claim
from benchmarks.trust.strangers.faults import STRUCK, TO_TUNE, Kind, fault_of
from benchmarks.trust.strangers.judge import LATE, Outcome, Verdict, judged
from benchmarks.trust.strangers.ready import prepare, records_of
from benchmarks.trust.strangers.rig import Rig, record

HEALTHY_FROM = 500  # seeds of healthy recordings lie so much above those of faulty ones
HEADER = (
    "", "healthy alarms", "faulty", "alarm before", "missed", "first", "in the group", "unexplained", "another",
    "sure, wrong name", "sure, wrong value", "delay, samples",
)  # fmt: skip
Job = tuple[str, int, bool, Path]  # plant, seed, whether it is faulty, folder
Rows = list[tuple[str, ...]]


def rig_of(plant: str) -> Rig:
    """Give a plant by its name."""
    rig: Rig = import_module(f"benchmarks.trust.strangers.{plant}").RIG
    return rig


def play(job: Job) -> Outcome:
    """Simulate, watch, judge."""
    plant, seed, faulty, folder = job
    rig = rig_of(plant)
    fault = fault_of(rig, seed) if faulty else None
    path = folder / f"{plant}.{'fault' if faulty else 'healthy'}.{seed}.csv"
    record(rig, fault.changes if fault is not None else (), seed).write(path)
    found = records_of(folder / f"{plant}.ready.yaml", path)
    path.with_suffix(".jsonl").write_text("".join(json.dumps(item) + "\n" for item in found), encoding="utf-8")
    return judged(plant, seed, fault, found, rig.step)


def play_all(jobs: Sequence[Job], processes: int) -> Iterator[Outcome]:
    """Give what became of the runs, as they end."""
    with nullcontext() if processes == 1 else Pool(processes) as pool:
        found = map(play, jobs) if pool is None else pool.imap_unordered(play, jobs)
        for number, outcome in enumerate(found, start=1):
            print(f"{number} of {len(jobs)}: {outcome.plant} {outcome.seed}", file=sys.stderr, flush=True)
            yield outcome


def rows(outcomes: Sequence[Outcome]) -> Rows:
    """Give a line for each plant, one for those to tune on, one for the others."""
    chosen = [(name, [item for item in outcomes if item.plant == name]) for name in STRUCK]
    lines = [_line(name + (" (to tune on)" if name in TO_TUNE else ""), found) for name, found in chosen if found]
    for words, tuned in (("all to tune on", True), ("all only to report", False)):
        lines.append(_line(words, [item for item in outcomes if (item.plant in TO_TUNE) == tuned]))
    return [line for line in lines if line]


def rows_of_kinds(outcomes: Sequence[Outcome]) -> Rows:
    """Give a line for each kind of fault, all plants together."""
    chosen = ((kind.value, [item for item in outcomes if item.kind == kind.value]) for kind in Kind)
    return [line for line in (_line(name, found) for name, found in chosen) if line]


def _line(name: str, found: Sequence[Outcome]) -> tuple[str, ...]:
    if not found:
        return ()
    healthy, faulty = ([item for item in found if bool(item.kind) == sick] for sick in (False, True))
    delays = [item.delay / rig_of(item.plant).step for item in faulty if item.delay is not None]

    def count(asked: Callable[[Outcome], bool]) -> str:
        return str(sum(asked(item) for item in faulty))

    order = (
        Verdict.EARLY, Verdict.MISSED, Verdict.FIRST, Verdict.GROUP, Verdict.UNEXPLAINED, Verdict.OTHER,
    )  # fmt: skip
    return (
        name,
        f"{sum(item.verdict is Verdict.EARLY for item in healthy)} of {len(healthy)}" if healthy else "",
        str(len(faulty)),
        *(count(lambda item, one=verdict: item.verdict is one) for verdict in order),  # type: ignore[misc]
        count(lambda item: item.wrong_name),
        count(lambda item: item.wrong_value),
        f"{median(delays):.0f}" if delays else "",
    )


def calibration(outcomes: Sequence[Outcome]) -> Rows:
    """Give, by tenths of the claimed probability, the mean claim and the part that was right."""
    claims = [claim for item in outcomes for claim in item.claims]
    found = ((tenth, inside, means(inside)) for tenth, inside in tenths(claims))
    return [
        (f"{10 * tenth} to {10 * tenth + 10} %", f"{100 * claimed:.1f} %", f"{100 * right:.1f} %", str(len(inside)))
        for tenth, inside, (claimed, right) in found
    ]


def prepared(plants: Sequence[str], folder: Path, processes: int) -> Rows:
    """Give, for each plant, on how many healthy recordings its first model alarmed, and what made it quiet."""
    rigs = [rig_of(plant) for plant in plants]
    with Pool(processes) as pool:
        found = pool.starmap(prepare, [(rig, folder) for rig in rigs], chunksize=1)
    pairs = zip(plants, found, strict=True)
    return [(plant, f"{sum(ready.first)} of {len(ready.first)}", ready.told) for plant, ready in pairs]


def jobs(plants: Sequence[str], seeds: int, first: int, folder: Path) -> list[Job]:
    """Give what is to be played: half as many healthy recordings as faulty ones, plants taking turns."""
    healthy = range(first + HEALTHY_FROM, first + HEALTHY_FROM + (seeds + 1) // 2)
    faulty = range(first, first + seeds)
    chosen = [(seed, False) for seed in healthy] + [(seed, True) for seed in faulty]
    return [(plant, seed, sick, folder) for seed, sick in chosen for plant in plants]


def keep(found: Iterator[Outcome], path: Path | None) -> Iterator[Outcome]:
    """Pass outcomes on; write each to a file, a line a run."""
    with nullcontext() if path is None else path.open("w", encoding="utf-8") as stream:
        for item in found:
            if stream is not None:
                stream.write(json.dumps({**asdict(item), "verdict": item.verdict.value}) + "\n")
                stream.flush()
            yield item


def read(paths: Sequence[Path]) -> Iterator[Outcome]:
    """Read what `keep` wrote; a line that is cut off is left out."""
    for line in (line for path in paths for line in path.read_text(encoding="utf-8").splitlines()):
        try:
            item = json.loads(line)
        except JSONDecodeError:
            continue
        claims = tuple(Claim(**claim) for claim in item.pop("claims"))
        truth, named, verdict = tuple(item.pop("truth")), tuple(item.pop("named")), Verdict(item.pop("verdict"))
        yield Outcome(truth=truth, named=named, verdict=verdict, claims=claims, **item)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="Is what faultbond says of plants that others made right?")
    parser.add_argument("--plants", metavar="NAME,...", default="", help="only these (default: all six)")
    parser.add_argument("--seeds", type=int, default=40, help="faulty recordings of a plant (default %(default)s)")
    parser.add_argument("--first-seed", type=int, default=0, help="the first of them (default %(default)s)")
    parser.add_argument("--processes", type=int, default=2, choices=(1, 2), help="how many (default %(default)s)")
    parser.add_argument("--folder", metavar="DIR", type=Path, help="keep models and recordings here; take its models")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write what became of every run to FILE")
    parser.add_argument("--from", metavar="FILE", dest="source", type=Path, nargs="+", help="take the runs of FILEs")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the tables into the page FILE")
    chosen = parser.parse_args(argv)
    plants = selected(STRUCK, chosen.plants)
    with TemporaryDirectory() if chosen.folder is None else nullcontext(chosen.folder) as name:
        folder = Path(name)
        folder.mkdir(parents=True, exist_ok=True)
        models = prepared(plants, folder, chosen.processes) if chosen.folder or not chosen.source else []
        todo = jobs(plants, chosen.seeds, chosen.first_seed, folder)
        found = list(read(chosen.source) if chosen.source else keep(play_all(todo, chosen.processes), chosen.json))
    show(plants, models, found, chosen.markdown)


def show(plants: Sequence[str], models: Rows, outcomes: Sequence[Outcome], page: Path | None) -> None:
    """Print the tables; put them into the page, if one is named, below the command that makes them."""
    seeds = [item.seed for item in outcomes if item.kind]
    tables = (
        (("model", "first model: healthy recordings with an alarm", "what was done"), models),
        (HEADER, rows(outcomes)),
        (HEADER, rows_of_kinds(outcomes)),
        ((f"claimed, {LATE} samples after the alarm and later", "claimed", "right", "claims"), calibration(outcomes)),
    )
    told = note(f"Seeds {min(seeds)} to {max(seeds)}, {len(outcomes)} runs")
    print(*(as_text(*table) for table in tables), told, sep="\n\n")
    if page is not None:
        only = "" if set(plants) == set(STRUCK) else f" --plants {','.join(plants)}"
        command = f"`python -m benchmarks.trust.strangers{only} --seeds {len(set(seeds))} --first-seed {min(seeds)}`"
        write_part(page, "strangers", "\n\n".join((command, told, *(as_markdown(*table) for table in tables))))
