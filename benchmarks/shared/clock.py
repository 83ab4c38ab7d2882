"""How long the whole program takes: the bank at work, the demo, the build of an engine."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.shared.plants import EXAMPLES, tank_case
from benchmarks.shared.play import engine_of
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.model.text import load_model
from faultbond.runtime.monitor import step
from faultbond.runtime.state import Sample, State, init
from faultbond.simulate import Simulation
from faultbond.synthesis.engine import build_engine

BUILT = ("tank", "dc_motor", "dc_motor_current", "rlc", "rc")
_CACHE = "FAULTBOND_CACHE"


@dataclass(frozen=True, slots=True, kw_only=True)
class Demo:
    """Wall time of `faultbond demo`, s: until its first line, and until its end; and which engine it says it took."""

    first_line: float
    whole: float
    engine: str


def samples(recording: Simulation) -> list[Sample]:
    """Give the samples of a recording."""
    steps = np.diff(recording.time, prepend=recording.time[0])
    return [
        Sample(time=float(time), dt=float(dt), u=u, y=y)
        for time, dt, u, y in zip(recording.time, steps, recording.inputs, recording.outputs, strict=True)
    ]


def alarmed_at_once(spec: EngineSpec) -> EngineSpec:
    """Give a specification whose limit is passed by the first sample after warm-up, so that the bank begins there."""
    return replace(spec, thresholds=replace(spec.thresholds, cusum_limit=-1.0))


def play_through(spec: EngineSpec, engine: Engine, given: list[Sample]) -> State:
    """Pass samples through the monitor."""
    state = init(spec)
    for sample in given:
        state, _ = step(spec, engine, state, sample)
    return state


def bank_throughout(seed: int, rounds: int = 3) -> tuple[float, int]:
    """Give the processor time, s, of 82 minutes of the tank with the bank from the first possible sample on.

    Start, warm-up and the begin of the bank are part of it. Median of some rounds, and the number of hypotheses.
    """
    spec, engine = engine_of("tank")
    eager = alarmed_at_once(spec)
    given = samples(tank_case(seed).recording)
    taken = []
    for _ in range(rounds):
        begin = time.process_time()
        state = play_through(eager, engine, given)
        taken.append(time.process_time() - begin)
    if state.alarm != spec.thresholds.warm_up_samples:
        raise RuntimeError(f"the bank began at sample {state.alarm}, not at the end of the warm-up")
    return float(np.median(taken)), len(spec.hypotheses)


def demo(*, compiled: bool) -> Demo:
    """Time the demo in a fresh folder; with the compiler it has to build its engine."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {_CACHE: folder, "FAULTBOND_ENGINE": "auto" if compiled else "vm"}
        begin = time.perf_counter()
        with subprocess.Popen(
            [sys.executable, "-m", "faultbond", "demo"], cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
        ) as process:
            if process.stdout is None:
                raise RuntimeError("no output of the demo")
            process.stdout.readline()
            first = time.perf_counter() - begin
            rest = process.stdout.read()
        whole = time.perf_counter() - begin
        if process.returncode != 0 or not (Path(folder) / "report.html").exists():
            raise RuntimeError(f"the demo ended with {process.returncode}")
    engine = next((line.partition(": ")[2] for line in rest.splitlines() if line.startswith("Engine")), "?")
    return Demo(first_line=first, whole=whole, engine=engine)


def build(example: str) -> float:
    """Give the wall time, s, from the model file to a running engine, nothing built before."""
    with fresh_cache():
        begin = time.perf_counter()
        build_engine(load_model(EXAMPLES / example / "model.yaml"))
        return time.perf_counter() - begin


@contextmanager
def fresh_cache() -> Iterator[None]:
    """Let engines be built in an empty folder."""
    before = os.environ.get(_CACHE)
    with tempfile.TemporaryDirectory() as folder:
        os.environ[_CACHE] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ[_CACHE]
            else:
                os.environ[_CACHE] = before
