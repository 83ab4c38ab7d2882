"""What the generated program of the tank takes on each machine it can be built for, and whether it says the same there.

    python -m benchmarks.targets [--only NAME,...] [--markdown FILE]

Names are those of the targets, `rows`, which compares the program with `run` on a million healthy rows, and `build`,
which says how long it takes to write the project and to build its program. Programs for other processors are run by
an emulator; their times are those of the emulator, and are not compared.
"""

import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from benchmarks.shared.page import Listing, arguments, note, publish, selected
from benchmarks.targets.building import builds
from benchmarks.targets.million import million_rows
from benchmarks.targets.project import Project
from faultbond.types import TARGETS

HEADER = (
    "target",
    "program, bytes",
    "a plant, bytes",
    "a call, bytes",
    "stack, at the most, bytes",
    "a healthy sample",
    "says what `run` says",
    "run by",
)
ROWS, BUILD = "rows", "build"


def main(argv: Sequence[str] | None = None) -> None:
    """Build, run, measure, print, write."""
    chosen = arguments("What generated programs take, on all machines they can be built for.", argv, only="")
    wanted = selected((*TARGETS, ROWS, BUILD), chosen.only)
    if not wanted:
        sys.exit(f"--only {chosen.only}: no such target; there are {', '.join((*TARGETS, ROWS, BUILD))}")
    parts: list[str | Listing] = [note("The tank")]
    with tempfile.TemporaryDirectory() as folder:
        project = Project.generate(Path(folder))
        table = []
        for name in wanted:
            if name in TARGETS:
                table.append((f"`{name}`", *project.figures(name)))
                print("  ".join(table[-1]), file=sys.stderr, flush=True)
        if table:
            parts.append((HEADER, table))
        if ROWS in wanted:
            parts.append(million_rows(project))
        if BUILD in wanted:
            parts.append(builds(Path(folder)))
    publish("targets", chosen, *parts)


if __name__ == "__main__":
    main()
