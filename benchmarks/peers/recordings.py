"""Recordings of real rigs: models run over them, and how near healthy ones come to an alarm.

    FAULTBOND_DATA=FOLDER python -m benchmarks.peers.recordings [--json FILE]

FOLDER holds the recordings, by example.
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.monitor import finish, step
from faultbond.runtime.state import Sample, State, init
from faultbond.synthesis.engine import build_engine

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
RECORDINGS = {  # example folder: recordings in FAULTBOND_DATA
    "emps": ("emps/emps.csv",),
    "cascaded_tanks": ("cascaded_tanks/estimation.csv",),
    "pipe": ("pipe/ULg150801.csv", "pipe/ULg151202.csv", "pipe/ULg151204_1.csv"),
}

Result = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rig:
    """A model with its engine."""

    graph: BondGraph
    spec: EngineSpec
    engine: Engine

    def read(self, recording: Path) -> tuple[GridPoint, ...]:
        """Read a recording on the grid of samples."""
        return tuple(on_grid(read_rows(recording, columns_of(self.graph)), Grid(self.spec.sample_time)))

    def states(self, points: Sequence[GridPoint]) -> Iterator[State]:
        """Pass points through the monitor; gives the state before each."""
        state = init(self.spec)
        for point in points:
            yield state
            state, _ = step(self.spec, self.engine, state, sample_of(point))

    def watch(self, points: Sequence[GridPoint], state: State | None = None, *, to_alarm: bool = False) -> "Outcome":
        """Pass points through the monitor, up to the alarm only if so asked."""
        state = init(self.spec) if state is None else state
        detection, diagnoses = None, []
        cusum, slow = np.zeros(len(self.spec.outputs)), np.zeros(len(self.spec.slow_errors))
        for point in points:
            state, report = step(self.spec, self.engine, state, sample_of(point))
            if detection is None:
                cusum, slow = np.fmax(cusum, report.cusum), np.fmax(slow, np.abs(report.slow))
            detection = detection or report.detection
            if report.diagnosis is not None:
                diagnoses.append(report.diagnosis)
            if to_alarm and detection is not None:
                break
        last = finish(self.spec, state)
        if last is not None and (not diagnoses or diagnoses[-1].time < last.time):
            diagnoses.append(last)
        return Outcome(detection=detection, diagnoses=tuple(diagnoses), cusum=cusum, slow=slow)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What a run brought. Up to the alarm: largest CUSUM of each sensor, largest slow errors in their declared sd."""

    detection: Detection | None
    diagnoses: tuple[Diagnosis, ...]
    cusum: FloatArray
    slow: FloatArray

    @property
    def alarm(self) -> float | None:
        """Time of the alarm."""
        return None if self.detection is None else self.detection.time


def build_rig(model: Path) -> Rig:
    """Build the engine of a model."""
    graph = load_model(model)
    spec, engine = build_engine(graph)
    return Rig(graph=graph, spec=spec, engine=engine)


def sample_of(point: GridPoint) -> Sample:
    """Give what the monitor takes of a grid point."""
    return Sample(time=point.time, dt=point.dt, u=point.u, y=point.y)


def data_folder() -> Path | None:
    """Give the folder of the recordings; without one, say so."""
    folder = os.environ.get("FAULTBOND_DATA")
    if not folder:
        print("FAULTBOND_DATA is not set: no recordings", file=sys.stderr)
        return None
    return Path(folder)


def measure(rig: Rig, recording: Path) -> Result:
    """Run a recording and give what it came to, up to the alarm where there is one."""
    begin = time.perf_counter()
    points = rig.read(recording)
    found = rig.watch(points, to_alarm=True)
    return {
        "recording": recording.name,
        "samples": len(points),
        "seconds": time.perf_counter() - begin,
        "alarm": found.alarm,
        "cusum": {output.name: float(value) for output, value in zip(rig.spec.outputs, found.cusum, strict=True)},
        "cusum_limit": rig.spec.thresholds.cusum_limit,
        "slow": {error.name: float(value) for error, value in zip(rig.spec.slow_errors, found.slow, strict=True)},
    }


def measure_all(folder: Path) -> list[Result]:
    """Give one result for each recording under a folder."""
    results = []
    for example, names in RECORDINGS.items():
        rig = build_rig(EXAMPLES / example / "model.yaml")
        results += [{"model": rig.graph.name} | measure(rig, folder / name) for name in names]
    return results


def main() -> None:
    """Print one table, and write it as JSON where asked."""
    parser = argparse.ArgumentParser(description="Healthy recordings of real rigs.")
    parser.add_argument("--json", type=Path, help="file for the results")
    arguments = parser.parse_args()
    folder = data_folder()
    if folder is None:
        return
    results = measure_all(folder)
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
