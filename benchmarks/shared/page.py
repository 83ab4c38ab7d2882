"""Arguments of a benchmark, its numbers in words, its tables as text and on a page, and on which machine it ran."""

import argparse
import math
import os
import platform
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from faultbond.synthesis.compile import compiler_title, find_compiler

HELP = {
    "seeds": "number of seeds (default %(default)s)",
    "first_seed": "the first of them (default %(default)s)",
    "hours": "hours of each tank (default %(default)g)",
    "samples": "samples of each run (default %(default)s)",
    "only": "names, parted by commas, or the first words of several (default: all)",
}
TOLD = ("seeds", "hours", "first_seed", "only")  # arguments that a page tells, in this order

Table = Sequence[Sequence[str]]
Listing = tuple[Sequence[str], Table]  # header and rows


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of a table of figures; `met` is None where nothing is asked.

    cost : the number behind `got`; less is better
    """

    figure: str
    asked: str
    got: str
    met: bool | None
    cost: float = 0.0

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """What is printed."""
        return self.figure, self.asked, self.got, "" if self.met is None else "met" if self.met else "falls short"


def arguments(words: str, argv: Sequence[str] | None, **defaults: float | str) -> argparse.Namespace:
    """Read the arguments of a benchmark: those named with their defaults, and the page for its tables."""
    parser = argparse.ArgumentParser(description=words)
    for name, default in defaults.items():
        parser.add_argument(f"--{name.replace('_', '-')}", type=type(default), default=default, help=HELP[name])
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the tables into the page FILE")
    return parser.parse_args(argv)


def seeds_of(chosen: argparse.Namespace) -> range:
    """Give the seeds that were asked for."""
    return range(chosen.first_seed, chosen.first_seed + chosen.seeds)


def selected(keys: Iterable[str], only: str) -> list[str]:
    """Give the keys that `only` names, or whose first words it names; all where it names none."""
    names = [f"{name}." for name in only.split(",") if name]
    return [key for key in keys if not names or f"{key}.".startswith(tuple(names))]


def publish(module: str, chosen: argparse.Namespace, *parts: str | Listing) -> None:
    """Print texts and tables; put them into the page, if one was asked for, below the command that makes them."""
    print(*(part if isinstance(part, str) else as_text(*part) for part in parts), sep="\n\n")
    if chosen.markdown is not None:
        given = {name: getattr(chosen, name, "") for name in TOLD}
        texts = {name: f"{value:g}" if isinstance(value, float) else str(value) for name, value in given.items()}
        words = (f" --{name.replace('_', '-')} {text}" for name, text in texts.items() if text)
        shown = (part if isinstance(part, str) else as_markdown(*part) for part in parts)
        command = f"`python -m benchmarks.{module}{''.join(words)}`"
        write_part(chosen.markdown, module.rpartition(".")[2], "\n\n".join((command, *shown)))


def note(*told: str) -> str:
    """Say what was measured, when and on what."""
    return f"{'; '.join((*told, today(), machine()))}."


def quantile(values: Iterable[float], part: float) -> float:
    """Give the smallest value that a part of all values does not exceed."""
    ordered = sorted(values)
    return ordered[max(math.ceil(part * len(ordered) - 1e-9) - 1, 0)]


def seconds(value: float) -> str:
    """Write a delay, infinite where there was none."""
    return "never" if math.isinf(value) else f"{value:.3g} s" if value < 100 else f"{value:.0f} s"


def percent(value: float) -> str:
    """Write an error, infinite where nothing was estimated."""
    return "none" if math.isinf(value) else f"{100 * value:.2g} %"


def share(count: int, total: int) -> str:
    """Write how many of all."""
    return f"{count} of {total} ({100 * count / total:.0f} %)"


def as_text(header: Sequence[str], rows: Table) -> str:
    """Give a table in columns, the last one as it is."""
    widths = [max(len(row[k]) for row in (header, *rows)) for k in range(len(header))]
    lines = ("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in (header, *rows))
    return "\n".join(line.rstrip() for line in lines)


def as_markdown(header: Sequence[str], rows: Table) -> str:
    """Give a table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def machine() -> str:
    """Say on what this runs."""
    compiler = find_compiler()
    return ", ".join(
        (
            f"{_processor()}, {os.cpu_count()} cores",
            f"{platform.system()} {platform.machine()}",
            f"Python {platform.python_version()}",
            "no compiler" if compiler is None else f"compiler {Path(compiler_title(compiler)).name}",
        )
    )


def today() -> str:
    """Give the date."""
    return datetime.now().astimezone().date().isoformat()


def write_part(page: Path, name: str, text: str) -> None:
    """Put a text into a page, between the comments that mark this part; at the end where there are none."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    part = f"{begin}\n{text}\n{end}"
    old = page.read_text(encoding="utf-8") if page.exists() else ""
    pattern = re.compile(f"{re.escape(begin)}.*?{re.escape(end)}", flags=re.DOTALL)
    new = pattern.sub(lambda _: part, old) if pattern.search(old) else f"{old}{part}\n"
    page.write_text(new, encoding="utf-8")


def _processor() -> str:
    """Give the name of the processor as the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    return next((line.partition(":")[2].strip() for line in lines if line.startswith("model name")), platform.machine())
