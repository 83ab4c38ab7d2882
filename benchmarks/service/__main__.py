"""What the service takes, and what it withstands, on this machine.

    python -m benchmarks.service [--only NAME,...] [--markdown FILE]

Names are `stream` (20 signals at 100 Hz, of a Mosquitto), `viewers`, `assets` (a hundred tanks, ten minutes), `kills`,
`disk` (that others fill; it takes root) and `soak` (an hour). The service is a program of its own; what it takes is
told by the system, so this is for Linux.
"""

import sys
from collections.abc import Callable, Sequence

from benchmarks.service import assets, disk, kills, soak, stream, viewers
from benchmarks.shared.page import Row, arguments, note, publish, selected

PARTS: dict[str, Callable[[], list[Row]]] = {
    "stream": stream.rows,
    "viewers": viewers.rows,
    "assets": assets.rows,
    "kills": kills.rows,
    "disk": disk.rows,
    "soak": soak.rows,
}


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("What the service takes, and what it withstands.", argv, only="")
    wanted = selected(PARTS, chosen.only)
    if not wanted:
        sys.exit(f"--only {chosen.only}: no such part; there are {', '.join(PARTS)}")
    table = list[Sequence[str]]()
    for name in wanted:
        for row in PARTS[name]():
            table.append(row.cells)
            print("  ".join(row.cells), file=sys.stderr, flush=True)
    publish("service", chosen, note("The service"), (("figure", "asked", "got", ""), table))


if __name__ == "__main__":
    main()
