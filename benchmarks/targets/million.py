"""The generated program beside `run`, on very many healthy rows: time, and memory while they pass."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path

from benchmarks.shared.page import Listing
from benchmarks.shared.plants import EXAMPLES
from benchmarks.targets.healthy import healthy_rows
from benchmarks.targets.project import Project

COUNT = 1_000_000
STEP = 1 << 20  # bytes that are passed at a time
HEADER = (f"{COUNT:,} healthy rows of the tank by standard input", "processor time", "wall time", "resident memory")


def million_rows(project: Project) -> Listing:
    """Give the table of the program and of `run`."""
    run = [sys.executable, "-m", "faultbond", "run", str(EXAMPLES / "tank" / "model.yaml"), "-", "--json", "-"]
    rows = healthy_rows(COUNT)
    passed(run, rows[: rows.index(b"\n", 10_000) + 1])  # what is compiled is kept
    ours, theirs = passed([str(project.program())], rows), passed(run, rows)
    static = passed([str(project.program("x86_64-linux-static"))], rows)
    told = (("`watch`", ours), ("`watch`, `x86_64-linux-static`", static), ("`faultbond run`", theirs))
    table = [(name, f"{processor:.1f} s", f"{wall:.1f} s", f"{peak:.1f} MB") for name, (processor, wall, peak) in told]
    return HEADER, [
        *table,
        ("`run` in times of `watch`", f"{theirs[0] / ours[0]:.1f}", f"{theirs[1] / ours[1]:.1f}", ""),
    ]


def passed(command: list[str], rows: bytes) -> tuple[float, float, float]:
    """Pass rows through a program; gives its processor time and wall time, s, and its largest resident memory, MB.

    Raises
    ------
    RuntimeError
        Where it fails or finds a fault.
    """
    begin = time.perf_counter()
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        if process.stdin is None:
            raise RuntimeError("no input of the program")
        for first in range(0, len(rows), STEP):
            process.stdin.write(rows[first : first + STEP])
        process.stdin.flush()
        status = Path(f"/proc/{process.pid}/status").read_text(
            encoding="utf-8"
        )  # its own memory, not that of who began it
        process.stdin.close()
        _, ended, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(ended)
    wall = time.perf_counter() - begin
    found = re.search(r"^VmHWM:\s+(\d+) kB$", status, re.MULTILINE)
    if process.returncode != 0 or found is None:
        raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}")
    return usage.ru_utime + usage.ru_stime, wall, int(found[1]) * 1024 / 1e6
