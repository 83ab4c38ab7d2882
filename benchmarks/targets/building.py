"""How long it takes to write the project of the tank and to build its program, once the cache knows the tank."""

import resource
import shutil
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

from benchmarks.shared.page import Listing
from benchmarks.shared.plants import EXAMPLES

ROUNDS = 5
HEADER = ("the tank, the cache knows it", "processor time", "wall time")


def builds(folder: Path) -> Listing:
    """Give the table of `generate`, of `make`, and of both."""
    place = folder / "built"
    generate = [sys.executable, "-m", "faultbond", "generate", str(EXAMPLES / "tank" / "model.yaml"), "-o", str(place)]
    taken(generate)
    told = []
    for _ in range(ROUNDS):
        shutil.rmtree(place)
        told.append((taken(generate), taken(["make", "-C", str(place)])))
    parts = [[round_[k] for round_ in told] for k in range(2)]
    both = [(one[0] + other[0], one[1] + other[1]) for one, other in told]
    return HEADER, [
        (name, f"{median(item[0] for item in rounds):.2f} s", f"{median(item[1] for item in rounds):.2f} s")
        for name, rounds in (("`faultbond generate`", parts[0]), ("`make`", parts[1]), ("both", both))
    ]


def taken(command: list[str]) -> tuple[float, float]:
    """Run a program; gives what processor time it took with its children, and wall time, s."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, stdout=subprocess.DEVNULL, check=True)
    after, wall = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter() - begin
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime, wall
