"""Processor time of works that are compared: they take turns in one run, so that both meet the same machine."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """What is timed: `run` on what `prepare` gives, each time anew; `count`: of what one unit is told, samples say."""

    prepare: Callable[[], Any]
    run: Callable[[Any], object]
    count: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """What a program took: processor time, its compilers' included, and wall time, s."""

    processor: float
    wall: float


def turns(works: Sequence[Work], rounds: int) -> FloatArray:
    """Give the processor time of each work per unit, s, (rounds, n_works), after one turn that does not count."""
    found = np.empty((rounds + 1, len(works)))
    for row in found:
        for k, work in enumerate(works):
            given = work.prepare()
            begin = time.process_time()
            work.run(given)
            row[k] = (time.process_time() - begin) / work.count
    return found[1:]


def used(*command: str, settings: Mapping[str, str] | None = None, given: str | None = None) -> Usage:
    """Run Python with these arguments to its end, `given` its standard input; faults found are no failure.

    Raises
    ------
    RuntimeError
        Where it fails.
    """
    begin = time.perf_counter()
    with open(given or os.devnull, encoding="utf-8") as stream:
        process = subprocess.Popen(
            [sys.executable, *command],
            env=os.environ | (settings or {}),
            stdin=stream,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in (0, 1):
        raise RuntimeError(f"{' '.join(command)} ended with {process.returncode}")
    return Usage(processor=usage.ru_utime + usage.ru_stime, wall=time.perf_counter() - begin)


def spread(values: FloatArray, form: str, factor: float = 1.0) -> str:
    """Write a median, and in brackets the quartiles."""
    low, middle, high = factor * np.quantile(values, (0.25, 0.5, 0.75))
    return f"{middle:{form}} ({low:{form}} to {high:{form}})"
