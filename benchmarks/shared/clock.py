"""Times of whole programs, and a bank that is at work from the first possible sample on."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace

from benchmarks.shared.play import core_with
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core

CACHE = "FAULTBOND_CACHE"


def timed_program(*words: str, folder: str, settings: Mapping[str, str] | None = None) -> tuple[float, float]:
    """Run faultbond in a folder; give the wall time until its first line, and until its end, s."""
    begin = time.perf_counter()
    command, environment = [sys.executable, "-m", "faultbond", *words], os.environ | (settings or {})
    with subprocess.Popen(command, cwd=folder, env=environment, stdout=subprocess.PIPE, text=True) as process:
        if process.stdout is None:
            raise RuntimeError("no output of the program")
        process.stdout.readline()
        first = time.perf_counter() - begin
        process.stdout.read()
    if process.returncode != 0:
        raise RuntimeError(f"faultbond {words[0]} ended with {process.returncode}")
    return first, time.perf_counter() - begin


def alarmed_at_once(graph: BondGraph) -> Core:
    """Give a core whose limit is passed by the first sample after warm-up, so that the bank begins there."""
    return core_with(graph, _without_limit)


def _without_limit(spec: EngineSpec) -> EngineSpec:
    return replace(spec, thresholds=replace(spec.thresholds, cusum_limit=-1.0))


@contextmanager
def fresh_cache() -> Iterator[None]:
    """Let engines be built in an empty folder."""
    before = os.environ.get(CACHE)
    with tempfile.TemporaryDirectory() as folder:
        os.environ[CACHE] = folder
        try:
            yield
        finally:
            if before is None:
                del os.environ[CACHE]
            else:
                os.environ[CACHE] = before
