"""What whole programs take: `run` on recordings and streams, from a model file to its first sample, and memory."""

import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from benchmarks.shared.clock import CACHE
from benchmarks.shared.plants import EXAMPLES, graph_of
from benchmarks.shared.turns import Usage, spread, used
from benchmarks.trust.promise import tank
from faultbond.arrays import FloatArray
from faultbond.io.recording import write_recording

ROUNDS, LONG_ROUNDS = 9, 5
MODEL, HEALTHY, FAULTY = (str(EXAMPLES / "tank" / name) for name in ("model.yaml", "healthy.csv", "fault_pipe.csv"))
RUN = ("-m", "faultbond", "run", MODEL)
MANY, FEW = 100_000, 10_000  # rows of a healthy tank
SEED = 40
FIRST_SAMPLE = """
import sys
import numpy as np
from faultbond import Sample, load_model
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.engine import build_engine

spec, core = build_engine(load_model(sys.argv[1]))
Monitor(core).step(Sample(time=0.0, dt=0.0, u=np.array([20.0, 60.0]), y=np.array([1.3e-4, 4900.0])))
"""
READ = """
import csv, sys

with open(sys.argv[1], newline="") as stream:
    rows = list(csv.reader(stream))
"""
READ_NUMBERS = READ + "numbers = [[float(cell) for cell in row] for row in rows[1:]]\n"
PEAK = """
import sys
from pathlib import Path
from faultbond.cli import main

try:
    main(sys.argv[1:])
finally:
    print(Path("/proc/self/status").read_text(), file=sys.stderr)
"""

Rows = list[tuple[str, str, str]]


def run() -> Rows:
    """Compare `run` on the healthy recording with loading numpy."""
    used(*RUN, HEALTHY)  # the library is kept
    pairs = [(used(*RUN, HEALTHY), used("-c", "import numpy")) for _ in range(ROUNDS)]
    told = f"{_ratio(pairs)}; {_seconds([ours for ours, _ in pairs])}"
    return [("tank, `run` on its healthy recording, in times of `import numpy`", "6", told)]


def first_sample() -> Rows:
    """Give the time from a model file to its first sample, nothing compiled before."""
    found = []
    for _ in range(LONG_ROUNDS):
        with tempfile.TemporaryDirectory() as folder:
            found.append(used("-c", FIRST_SAMPLE, MODEL, settings={CACHE: folder}))
    wall = spread(np.array([item.wall for item in found]), ".2f")
    told = f"{_seconds(found)}, its compilers included; wall {wall} s"
    return [("tank, from the model file to the first sample, cold cache", "2.5 s", told)]


def rows() -> Rows:
    """Compare `run` on many healthy rows with reading them."""
    with _recordings() as (many, _):
        used(*RUN, many)
        found = [(used(*RUN, many), used("-c", READ, many), used("-c", READ_NUMBERS, many)) for _ in range(LONG_ROUNDS)]
    numbers = _ratio([(ours, theirs) for ours, _, theirs in found])
    told = f"{_ratio([(ours, theirs) for ours, theirs, _ in found])}; {_seconds([ours for ours, _, _ in found])}"
    figure = f"tank, `run` on {MANY:,} healthy rows, in times of reading them by the module csv"
    return [(figure, "8", told), ("the same, in times of reading them into numbers", "", numbers)]


def live() -> Rows:
    """Give the rows a second that come by standard input, also of a run that is kept: what more rows take more."""
    with _recordings() as (many, few), tempfile.TemporaryDirectory() as folder:
        used(*RUN, "-", given=few)
        plain, kept = [], []
        for k in range(LONG_ROUNDS):
            plain.append([used(*RUN, "-", given=name).processor for name in (few, many)])
            keeping = [(*RUN, "-", "--state", str(Path(folder, f"{k} {name}"))) for name in ("few", "many")]
            kept.append([used(*words, given=name).processor for words, name in zip(keeping, (few, many), strict=True)])
    figure = "tank, `run` on standard input, watching, rows a second of processor time"
    told = [spread((MANY - FEW) / np.diff(np.array(item))[:, 0], ",.0f") for item in (plain, kept)]
    return [(figure, "30,000", told[0]), ("the same of a run that is kept (`--state`)", "", told[1])]


def memory() -> Rows:
    """Give the largest resident memory of `run` on the recording that the demo has."""
    used(*RUN, FAULTY)
    found = [_peak() for _ in range(LONG_ROUNDS)]
    told = f"{spread(np.array(found), '.1f')} MB"
    return [("tank, `run` on the recording of the demo: resident memory", "60 MB", told)]


def _peak() -> float:
    """Give the largest resident memory, MB, as the program itself sees it at its end."""
    command = [sys.executable, "-c", PEAK, "run", MODEL, FAULTY]
    told = subprocess.run(command, capture_output=True, text=True, check=False).stderr
    found = re.search(r"^VmHWM:\s+(\d+) kB$", told, re.MULTILINE)
    if found is None:
        raise RuntimeError(f"the system does not tell its memory: {told[-300:]}")
    return int(found[1]) * 1024 / 1e6


@contextmanager
def _recordings() -> Iterator[tuple[str, str]]:
    """Give files with many and with few rows of a healthy tank."""
    with tempfile.TemporaryDirectory() as folder:
        names = (str(Path(folder, "many.csv")), str(Path(folder, "few.csv")))
        for name, count in zip(names, (MANY, FEW), strict=True):
            time, values = _healthy()
            columns = dict(zip(_names(), values[:count].T, strict=True))
            write_recording(name, {"time": time[:count], **columns})
        yield names


def _names() -> list[str]:
    graph = graph_of("tank")
    return [*(item.name for item in graph.inputs), *(item.name for item in graph.sensors)]


@cache
def _healthy() -> tuple[FloatArray, FloatArray]:
    """Record a healthy tank; seven digits, as in the example."""
    made = tank(SEED, float(MANY), False)
    values = np.hstack([made.inputs, made.outputs])
    return made.time, np.array([float(f"{value:.6g}") for value in values.ravel()]).reshape(values.shape)


def _ratio(pairs: list[tuple[Usage, Usage]]) -> str:
    return spread(np.array([ours.processor / theirs.processor for ours, theirs in pairs]), ".2f")


def _seconds(found: list[Usage]) -> str:
    return f"{spread(np.array([item.processor for item in found]), '.2f')} s"
