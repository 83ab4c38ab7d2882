"""Healthy recordings of real rigs: how near each comes to an alarm, and how long it takes.

`python benchmarks/recordings.py [--json FILE]`; the recordings are looked for in the folder FAULTBOND_DATA.
"""

import argparse
import json
import os
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.monitor import Sample, init, step
from faultbond.runtime.trace import Trace
from faultbond.spec import Engine, EngineSpec
from faultbond.synthesis.engine import build_engine

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
RECORDINGS = {  # example folder: recordings in FAULTBOND_DATA
    "emps": ("emps/emps.csv",),
    "cascaded_tanks": ("cascaded_tanks/estimation.csv",),
    "pipe": ("pipe/ULg150801.csv", "pipe/ULg151202.csv", "pipe/ULg151204_1.csv"),
}

Result = dict[str, object]


def measure(graph: BondGraph, spec: EngineSpec, engine: Engine, recording: Path) -> Result:
    """Run a recording and give what it came to, up to the alarm where there is one."""
    begin = time.perf_counter()
    state, trace = init(spec), Trace(spec)
    grid = Grid(spec.sample_time)
    largest = np.zeros(len(spec.slow_errors))
    for point in on_grid(read_rows(str(recording), columns_of(graph)), grid):
        sample = Sample(time=point.time, dt=point.dt, u=point.u, y=point.y)
        state, report = step(spec, engine, state, sample)
        trace.add(sample, report)
        largest = np.fmax(largest, np.abs(report.slow))
        if report.detection is not None:
            break
    history = trace.history()
    cusum = np.fmax.reduce(history.cusum, axis=0)
    return {
        "recording": recording.name,
        "samples": grid.counts.samples,
        "seconds": time.perf_counter() - begin,
        "alarm": history.detections[0].time if history.detections else None,
        "cusum": {output.name: float(value) for output, value in zip(spec.outputs, cusum, strict=True)},
        "cusum_limit": spec.thresholds.cusum_limit,
        "slow": {error.name: float(value) for error, value in zip(spec.slow_errors, largest, strict=True)},
    }


def measure_all(folder: Path) -> list[Result]:
    """Give one result for each recording under a folder."""
    results = []
    for example, names in RECORDINGS.items():
        graph = load_model(EXAMPLES / example / "model.yaml")
        spec, engine = build_engine(graph)
        results += [{"model": graph.name} | measure(graph, spec, engine, folder / name) for name in names]
    return results


def main() -> None:
    """Print one table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(description="Healthy recordings of real rigs.")
    parser.add_argument("--json", type=Path, help="file for the results")
    arguments = parser.parse_args()
    folder = os.environ.get("FAULTBOND_DATA")
    if not folder:
        print("FAULTBOND_DATA is not set: no recordings")
        return
    results = measure_all(Path(folder))
    print(f"{'recording':<18}{'samples':>8}{'time':>8}{'alarm':>8}  CUSUM; slow errors in declared sd")
    for row in results:
        alarm = "none" if row["alarm"] is None else f"{row['alarm']:.0f} s"
        values = f"{_text(row['cusum'])}; {_text(row['slow'])}"
        print(f"{row['recording']:<18}{row['samples']:>8}{row['seconds']:>6.1f} s{alarm:>8}  {values}")
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


def _text(values: object) -> str:
    assert isinstance(values, Mapping)  # noqa: S101 - made above
    return ", ".join(f"{name} {value:.1f}" for name, value in values.items())


if __name__ == "__main__":
    main()
