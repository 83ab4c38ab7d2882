"""Tables as text and Markdown, and on which machine they were measured."""

import os
import platform
import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from faultbond.synthesis.compile import find_compiler

Table = Sequence[Sequence[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One line of a table of figures; `met` is None where nothing is asked."""

    figure: str
    asked: str
    got: str
    met: bool | None

    @property
    def cells(self) -> tuple[str, str, str, str]:
        """What is printed."""
        return self.figure, self.asked, self.got, "" if self.met is None else "met" if self.met else "falls short"


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
            "no compiler" if compiler is None else f"compiler {Path(compiler[0]).name}",
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
