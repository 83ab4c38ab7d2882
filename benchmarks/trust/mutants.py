"""Damaged and forged inputs: models, recordings and saved states, changed at random and given to the program.

    python -m benchmarks.trust.mutants --count 5000 --seed 1

Asked: no internal error (exit code 3), none above 1 GB or 10 s, and one line on standard error at most. Each mutant
runs in a process of its own, forked from one that has loaded everything, with limits of memory and time.
"""

import argparse
import contextlib
import io
import os
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.shared.plants import EXAMPLES
from faultbond.cli import main
from faultbond.io.archive import read_archive, write_archive

PLANTS = ("rc", "rlc", "dc_motor", "tank")
ROWS = 150  # of a recording; the alarms are on after them
SECONDS, MEGABYTES = 10, 1000  # of the processor; of memory above that of the process which was forked
WAIT = 120  # s on the clock after which a mutant that sleeps is stopped
HARD = 4  # times the allowed memory at which the system refuses more
REMARKS = ("its row is not used", "it counts as missing", "than sample_time, ")  # that may stand beside a line
ODD = ["", "nan", "inf", "-inf", "1e300", "-1e300", "1e-300", "1e18", "0", "-1", "0,5", "x", "=1+1"]
ODD += ["9" * 400, "\x1b[31m"]
WORDS = ["none", "variable", "any", "logic", "1e308 s", "0 s", "-1 V", "[]", "{}", "percent", "e = f", "1/0"]
WORDS += ["inf", "K1"]
NUMBERS = (np.nan, np.inf, -np.inf, -1.0, 0.5, 1e15, 2.0**62, 1e300, -1e300, 0.0)
TIMED_OUT = (signal.SIGALRM, signal.SIGXCPU)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One mutant: the arguments of the program, and what was changed."""

    arguments: tuple[str, ...]
    what: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """How it ended. code: 124: stopped for its time. seconds: of the processor. megabytes: more than before."""

    code: int
    seconds: float
    megabytes: float
    errors: str
    output: str

    def faults(self) -> Iterator[str]:
        """Give what is wrong with it."""
        if self.code not in (0, 1, 2, 4):
            yield f"exit {self.code}"
        if self.seconds > SECONDS:
            yield f"over {SECONDS} s"
        if self.megabytes > MEGABYTES:
            yield f"over {MEGABYTES} MB"
        if re.search(r"Warning|Traceback", self.errors):
            yield "warning or traceback"
        if len([line for line in self.errors.splitlines() if not any(words in line for words in REMARKS)]) > 1:
            yield "more than one line"
        if re.search(r"\d{60}", self.output + self.errors):
            yield "endless number"
        if re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]", self.output + self.errors):
            yield "control character"


def mutated_text(text: str, choose: random.Random, words: Sequence[str]) -> str:
    """Change a text in one to three places."""
    for _ in range(choose.randint(1, 3)):
        lines = text.split("\n")
        k = choose.randrange(len(lines))
        match choose.randrange(7):
            case 0:
                lines.pop(k)
            case 1:
                lines.insert(k, choose.choice(lines))
            case 2 | 3:
                places = list(re.finditer(r"[\w.+-]+", lines[k]))
                if places:
                    place = choose.choice(places)
                    lines[k] = lines[k][: place.start()] + choose.choice(words) + lines[k][place.end() :]
            case 4:
                at = choose.randrange(len(lines[k]) + 1)
                lines[k] = lines[k][:at] + chr(choose.choice((0, 7, 27, 34, 44, 123, 160, 0x202E))) + lines[k][at:]
            case 5:
                a = choose.randrange(len(lines))
                lines[k], lines[a] = lines[a], lines[k]
            case _:
                lines = lines[: k + 1] if choose.random() < 0.2 else lines
        text = "\n".join(lines)
    return text


def mutated_state(content: bytes, choose: random.Random, scratch: Path) -> bytes:
    """Change a saved state: bytes of the file, or, with a new checksum, an array or what it tells."""
    match choose.randrange(4):
        case 0:
            place = choose.randrange(len(content))
            return content[:place] + bytes([choose.randrange(256)]) + content[place + 1 :]
        case 1:
            return content[: choose.randrange(len(content))]
    scratch.write_bytes(content)
    about, arrays = read_archive(scratch)
    if choose.random() < 0.7:
        name = choose.choice(sorted(arrays))
        values = arrays[name].copy()
        number, generator = choose.choice(NUMBERS), np.random.default_rng(choose.randrange(2**32))
        values[generator.random(values.shape) < choose.choice((0.05, 0.5, 1.0))] = number
        arrays[name] = values if choose.random() < 0.8 else np.resize(values, (*values.shape, 2))
    else:
        _change_told(about, choose)
    stream = io.BytesIO()
    write_archive(stream, about, arrays)
    return stream.getvalue()


def _change_told(told: object, choose: random.Random) -> None:
    """Change one value in a JSON tree."""
    place = told
    while isinstance(place, dict | list) and place:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = choose.choice(keys)
        inner = place[key]
        if not isinstance(inner, dict | list) or not inner or choose.random() < 0.1:
            place[key] = choose.choice((None, -1, 10**400, 1e300, "x", [], {}, True, 3, 1e15))
            return
        place = inner


@dataclass(frozen=True, slots=True, kw_only=True)
class Seeds:
    """What is mutated. plants: model, recording and state; networks: model and recording. All as (path, content)."""

    plants: tuple[tuple[Path, Path, Path], ...]
    networks: tuple[tuple[Path, Path], ...]


def prepare(folder: Path, plants: tuple[str, ...] = PLANTS) -> Seeds:
    """Make short recordings of the examples, and states of them, for which their engines are compiled."""
    made = []
    for name in plants:
        model = EXAMPLES / name / "model.yaml"
        source = sorted((EXAMPLES / name).glob("fault_*.csv"))[0]
        recording, state = folder / f"{name}.csv", folder / f"{name}.state"
        lines = source.read_text().splitlines(keepends=True)
        recording.write_text("".join(lines[: ROWS + 1]))
        with contextlib.redirect_stdout(io.StringIO()):
            main(["run", str(model), str(recording), "--state", str(state)])
        recording.write_text("".join([lines[0], *lines[ROWS + 1 : 2 * ROWS]]))
        made.append((model, recording, state))
    figures = sorted((EXAMPLES / "thesis").glob("fig_*.yaml"))
    return Seeds(plants=tuple(made), networks=tuple((path, path.with_suffix(".csv")) for path in figures))


def mutant(seeds: Seeds, choose: random.Random, folder: Path) -> Case:
    """Make the next mutant, its files in `folder`."""
    model, recording, state = (folder / name for name in ("model.yaml", "rec.csv", "x.state"))
    kind = choose.choice(("model", "model", "recording", "recording", "state", "network", "network rows"))
    if kind.startswith("network"):
        source, rows = choose.choice(seeds.networks)
    else:
        source, rows, kept = choose.choice(seeds.plants)
        state.write_bytes(kept.read_bytes())
    texts = {model: source.read_text(), recording: rows.read_text()}
    if kind in ("model", "network"):
        texts[model] = mutated_text(texts[model], choose, ODD + WORDS)
    elif kind != "state":
        texts[recording] = mutated_text(texts[recording], choose, ODD)
    for path, text in texts.items():
        path.write_text(text, encoding="utf-8", errors="surrogateescape")
    if kind == "state":
        state.write_bytes(mutated_state(state.read_bytes(), choose, folder / "scratch"))
        verb = choose.choice((("run",), ("run", "--json"), ("accept",), ("reject",)))
    else:
        verbs = (("check",), ("run",), ("run", "--json"), ("run", "--report"), ("simulate",), ("analyse",))
        verb = choose.choice(verbs)
    return Case(arguments=_arguments(verb, kind, folder), what=kind)


def _arguments(verb: tuple[str, ...], kind: str, folder: Path) -> tuple[str, ...]:
    """Give the arguments of a verb."""
    model, recording, state = (str(folder / name) for name in ("model.yaml", "rec.csv", "x.state"))
    match verb:
        case ("check",):
            return ("check", model)
        case ("accept",):
            return ("accept", model, state)
        case ("reject",):
            return ("reject", model, state, "C")
        case ("simulate",):
            return ("simulate", model, "--inputs", recording, "-o", str(folder / "out.csv"))
        case ("analyse",):
            return ("analyse", model, "--patience", "2 s")
    kept = ("--state", state) if kind == "state" else ()
    more = ("--json", "-") if "--json" in verb else ()
    page = ("--report", str(folder / "r.html")) if "--report" in verb and not kind.startswith("network") else ()
    return ("run", model, recording, *kept, *more, *page)


def try_out(case: Case, folder: Path) -> Outcome:
    """Run a mutant in a forked process, with limits."""
    out, errors = folder / "stdout", folder / "stderr"
    child = os.fork()
    if child == 0:
        _be_the_program(case, out, errors)
    _, status, used = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return Outcome(
        code=124 if -code in TIMED_OUT else code,
        seconds=used.ru_utime + used.ru_stime,
        megabytes=max(used.ru_maxrss - before, 0) / 1024.0,
        errors=errors.read_text(errors="replace"),
        output=out.read_text(errors="replace"),
    )


def _be_the_program(case: Case, out: Path, errors: Path) -> None:
    """Run the program as a user does, and leave."""
    code = 3
    try:
        for path, number in ((out, 1), (errors, 2)):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
        sys.stdout, sys.stderr = (open(number, "w", encoding="utf-8", closefd=False) for number in (1, 2))  # noqa: SIM115
        with Path("/proc/self/statm").open() as about:
            size = int(about.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (size + HARD * MEGABYTES * 2**20,) * 2)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        resource.setrlimit(resource.RLIMIT_CPU, (2 * SECONDS,) * 2)
        signal.alarm(WAIT)
        if case.what == "model":  # nobody will ask for its engine again
            os.environ["FAULTBOND_CACHE"] = str(out.parent / "cache")
        sys.argv = ["faultbond", *case.arguments]
        code = main()
        sys.stdout.flush()
    except SystemExit as leaving:
        code = leaving.code if isinstance(leaving.code, int) else 2
    finally:
        sys.stderr.flush()
        os._exit(code)


def campaign(
    count: int, seed: int, folder: Path, tell: Callable[[str], None], plants: tuple[str, ...] = PLANTS
) -> Counter[str]:
    """Try mutants and count how they end; each that is wrong is told with its number, by which it can be made again."""
    seeds, counts = prepare(folder, plants), Counter[str]()
    for number in range(count):
        place = folder / str(number)
        place.mkdir()
        case = mutant(seeds, random.Random(f"{seed} {number}"), place)  # noqa: S311 - no secret
        outcome = try_out(case, place)
        counts[f"{case.what}: exit {outcome.code}"] += 1
        wrong = list(outcome.faults())
        for fault in wrong:
            counts[f"WRONG {fault}"] += 1
        if wrong:
            last = (outcome.errors.strip().splitlines() or [""])[-1][:300]
            tell(f"{seed} {number} {case.what} {' '.join(case.arguments[:1])}: {', '.join(wrong)}: {last}")
        else:
            shutil.rmtree(place)
    return counts


def run() -> int:
    """Read the arguments and try."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, help="where files of mutants that went wrong stay (default: nowhere)")
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as made:
        folder = arguments.folder or Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        counts = campaign(arguments.count, arguments.seed, folder, lambda line: print(line, flush=True))
    for name, number in sorted(counts.items()):
        print(f"{number:6d}  {name}")
    return int(any(name.startswith("WRONG") for name in counts))


if __name__ == "__main__":
    sys.exit(run())
