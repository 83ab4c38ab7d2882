"""Recordings of real rigs: models run over them, and how near healthy ones come to an alarm.

    FAULTBOND_DATA=FOLDER python -m benchmarks.peers.recordings

FOLDER holds the recordings, by example.
"""

import os
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.shared.page import as_text
from benchmarks.shared.plants import EXAMPLES
from benchmarks.shared.play import watched
from faultbond.app.rows import sample_of
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.engine import build_engine

RECORDINGS = {  # example folder: recordings in FAULTBOND_DATA
    "emps": ("emps/emps.csv",),
    "cascaded_tanks": ("cascaded_tanks/estimation.csv",),
    "pipe": ("pipe/ULg150801.csv", "pipe/ULg151202.csv", "pipe/ULg151204_1.csv"),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rig:
    """A model with its core."""

    graph: BondGraph
    spec: EngineSpec
    core: Core

    def read(self, recording: Path) -> tuple[GridPoint, ...]:
        """Read a recording on the grid of samples."""
        return tuple(on_grid(read_rows(recording, columns_of(self.graph)), Grid(self.spec.sample_time)))

    def watch(
        self, points: Sequence[GridPoint], monitor: Monitor | None = None, *, to_alarm: bool = False
    ) -> "Outcome":
        """Pass points through a monitor, a new one if none is given, up to the alarm only if so asked."""
        monitor = Monitor(self.core) if monitor is None else monitor
        detection, diagnoses = None, []
        cusum, slow = np.zeros(len(self.spec.outputs)), np.zeros(len(self.spec.slow_errors))
        for _, _, report in watched(monitor, map(sample_of, points)):
            if detection is None:
                cusum, slow = np.fmax(cusum, report.cusum), np.fmax(slow, np.abs(report.slow))
            detection = detection or report.detection
            diagnoses += [report.diagnosis] if report.diagnosis is not None else []
            if to_alarm and detection is not None:
                break
        last = monitor.finish()
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
    """Build the core of a model."""
    return rig_of(load_model(model))


def rig_of(graph: BondGraph) -> Rig:
    """Build the core of a model that has been read."""
    spec, core = build_engine(graph)
    return Rig(graph=graph, spec=spec, core=core)


def data_folder() -> Path | None:
    """Give the folder of the recordings; without one, say so."""
    folder = os.environ.get("FAULTBOND_DATA")
    if not folder:
        print("FAULTBOND_DATA is not set: no recordings", file=sys.stderr)
        return None
    return Path(folder)


def cells(rig: Rig, recording: Path) -> tuple[str, ...]:
    """Run a recording and give what it came to, up to the alarm where there is one."""
    begin = time.perf_counter()
    points = rig.read(recording)
    found = rig.watch(points, to_alarm=True)
    taken = time.perf_counter() - begin
    cusum = ", ".join(f"{item.name} {value:.1f}" for item, value in zip(rig.spec.outputs, found.cusum, strict=True))
    slow = ", ".join(f"{item.name} {value:.1f}" for item, value in zip(rig.spec.slow_errors, found.slow, strict=True))
    alarm = "none" if found.alarm is None else f"{found.alarm:.0f} s"
    return recording.name, str(len(points)), f"{taken:.1f} s", alarm, f"{cusum}; {slow}"


def main() -> None:
    """Print one table."""
    folder = data_folder()
    if folder is not None:
        rigs = {example: build_rig(EXAMPLES / example / "model.yaml") for example in RECORDINGS}
        rows = [cells(rigs[example], folder / name) for example, names in RECORDINGS.items() for name in names]
        print(as_text(("recording", "samples", "time", "alarm", "CUSUM; slow errors in declared sd"), rows))


if __name__ == "__main__":
    main()
