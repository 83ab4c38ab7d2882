"""What is asked of the speed of faultbond, and what it does.

    python -m benchmarks.speed [--only NAME,...] [--markdown FILE]

Processor time, of pieces that are compared in turns in the same run; medians, and in brackets the quartiles. Ratios
count, since machines differ. FilterPy and numba are compared with where they are installed.
"""

import sys
from collections.abc import Sequence

from benchmarks.shared.page import arguments, note, publish, selected
from benchmarks.speed import fleets, programs, sizes, steps

FIGURES = {
    "watching": steps.watching,
    "diagnosing": steps.diagnosing,
    "loops": steps.loops,
    "peak": steps.peak,
    "six_tanks": steps.six_tanks,
    "call": steps.call,
    "longest": steps.longest,
    "fleet": fleets.per_step,
    "run": programs.run,
    "first_sample": programs.first_sample,
    "rows": programs.rows,
    "live": programs.live,
    "memory": programs.memory,
    "ladders": sizes.ladders,
    "lines": sizes.lines,
}
HEADER = ("figure", "asked", "got", "command")


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("What is asked of the speed of faultbond, and what it does.", argv, only="")
    wanted = selected(FIGURES, chosen.only)
    if not wanted:
        sys.exit(f"--only {chosen.only}: no such figure; there are {', '.join(FIGURES)}")
    table = []
    for name in wanted:
        for row in FIGURES[name]():
            table.append((*row, f"`python -m benchmarks.speed --only {name}`"))
            print("  ".join(row), file=sys.stderr, flush=True)
    publish("speed", chosen, note(), (HEADER, table))


if __name__ == "__main__":
    main()
