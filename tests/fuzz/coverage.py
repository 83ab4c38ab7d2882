"""Which lines and branches of the core are reached by whole runs, wild samples and cases at random, of all plants here.

`make coverage` runs it; an argument: seconds of cases at random, for each plant. A line counts as reached where one of
the plants reaches it: none has all kinds of inputs, sensors and faults. What is listed is reached by none of them.
"""

import json
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from test_driven import FAULTS, GCC, WILD

from driven import made, program, ran, write_recording

COUNTED = ("-O0", "--coverage")
MORE = ("loop", "linear", "tied")  # plants of which no test here needs a fault
SHOWN = 12  # lines of a file that are listed


def reached(name: str, seconds: int, folder: Path) -> Iterator[tuple[str, int, bool, list[bool]]]:
    """Give for lines of the core its file, number, whether it is reached, and that of its branches, by one plant."""
    faults = FAULTS | {plant: fault for plant, (fault, _) in WILD.items()}
    executable = program(name, folder, GCC, *COUNTED, f"-DIN_{folder.name}")  # it counts into the folder it is made in
    recording = write_recording(folder / "recording", made(name, 900, faults.get(name)))
    ran(executable, "whole", recording, folder / "out")
    ran(executable, "wild", recording, 8_000, 1)
    ran(executable, "fuzz", recording, seconds, 1)
    command = ["gcov", "--branch-probabilities", "--json-format", "--stdout", "drive-drive_text.gcda"]
    told = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stdout
    for file in json.loads(told)["files"]:
        if Path(file["file"]).parent.name == "core":
            for line in file["lines"]:
                branches = [branch["count"] > 0 for branch in line["branches"]]
                yield Path(file["file"]).name, line["line_number"], line["count"] > 0, branches


def main(seconds: int) -> None:
    """Print a row for each file of the core, then the lines that nothing reaches."""
    lines: dict[str, dict[int, bool]] = defaultdict(lambda: defaultdict(bool))
    branches: dict[str, dict[tuple[int, int], bool]] = defaultdict(lambda: defaultdict(bool))
    for name in dict.fromkeys((*FAULTS, *WILD, *MORE)):
        with TemporaryDirectory() as folder:
            for file, number, is_reached, ways in reached(name, seconds, Path(folder)):
                lines[file][number] |= is_reached
                for k, taken in enumerate(ways):
                    branches[file][number, k] |= taken
    told = [f"{'file':16} {'lines':>7} {'reached':>8} {'branches':>9} {'reached':>8}"]
    told += [_row(file, [*lines[file].values()], [*branches[file].values()]) for file in sorted(lines)]
    every = [[x for of in kind.values() for x in of.values()] for kind in (lines, branches)]
    told.append(_row("all", *every))
    for file in sorted(lines):
        left = [number for number, is_reached in sorted(lines[file].items()) if not is_reached]
        if left:
            more = f" and {len(left) - SHOWN} more" if len(left) > SHOWN else ""
            told.append(f"{file}: nothing reaches {', '.join(map(str, left[:SHOWN]))}{more}")
    sys.stdout.write("\n".join([*told, ""]))


def _row(name: str, lines: list[bool], branches: list[bool]) -> str:
    share = [f"{100 * sum(of) / len(of):.1f} %" if of else "" for of in (lines, branches)]
    return f"{name:16} {len(lines):7} {share[0]:>8} {len(branches):9} {share[1]:>8}"


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10)
