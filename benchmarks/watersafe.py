"""What is found on a real rig: tank 4 of WaterSafe alone, all four tanks healthy, and with switchings hidden.

Nobody made faults on this rig, but its demand valves switch at known times. Where the model is not told of a switching,
the switching is a leak (or the end of one) of known time, place and size.

    FAULTBOND_DATA=FOLDER python benchmarks/watersafe.py [--json FILE]

FOLDER/watersafe/ holds `watersafe.csv` and `events.csv`; see examples/watersafe/README.md.
"""

import argparse
import csv
import json
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from faultbond.io import Grid, GridPoint, columns_of, on_grid, read_rows
from faultbond.model.text import load_model
from faultbond.runtime.history import Candidate, Detection, Diagnosis
from faultbond.runtime.monitor import Sample, State, finish, init, step
from faultbond.spec import Engine, EngineSpec
from faultbond.synthesis.engine import build_engine
from faultbond.types import FloatArray

MODELS = Path(__file__).resolve().parents[1] / "examples" / "watersafe"
OUTLETS = ("VA_C1", "VA_C2", "VA_C3", "VA_C4")
CM3 = 1e-6  # m3
SETTLED = 10.0  # s from a closing of C4 to the start of a window
HIDDEN = 300.0  # s for which a switching is hidden, unless the valve switches again
LARGE = 9.8  # cm3/s; smaller switchings are within the rig's own balance error of 1 to 3 cm3/s over hours
BEFORE = 10  # rows whose median is the flow before a switching
STARTS_EVERY = 500  # rows between the starts of healthy runs


@dataclass(frozen=True, slots=True, kw_only=True)
class Switching:
    """A switching of an outlet valve: opening before and after, and the change of the flow, cm3/s, where known."""

    time: float
    end: float
    valve: str
    opening: tuple[float, float]
    change: float | None

    @property
    def tank(self) -> str:
        """Number of the tank."""
        return self.valve[-1]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """A model with its engine, and the recording on its grid."""

    spec: EngineSpec
    engine: Engine
    points: tuple[GridPoint, ...]

    def rows(self, begin: float, end: float = np.inf) -> slice:
        """Give the rows from `begin` to before `end`, s."""
        times = [point.time for point in self.points]
        return slice(int(np.searchsorted(times, begin)), int(np.searchsorted(times, end)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Outcome:
    """What a run brought; `highest`: largest CUSUM of each sensor before the alarm."""

    detection: Detection | None
    diagnoses: tuple[Diagnosis, ...]
    highest: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """Tank 4 alone, through one opening of C4. Times in s after the opening (before: a false alarm), flows in cm3/s."""

    opening: float
    delay: float | None
    onset: float | None
    best: tuple[str, ...] = ()
    probability: float | None = None
    outflow: float | None = None
    undecided_until: float | None = None  # last diagnosis at which outflow and area could not be told apart


@dataclass(frozen=True, slots=True, kw_only=True)
class Healthy:
    """All tanks, nothing hidden, from a row on: largest CUSUM of each sensor."""

    start: float
    alarm: float | None
    highest: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hidden:
    """All tanks, one switching hidden. Delay in s, flows in cm3/s; `leak_listed`: the right leak is in the group."""

    time: float
    valve: str
    change: float | None
    delay: float | None
    best: tuple[str, ...] = ()
    right_tank: bool = False
    right_leak: bool = False
    leak_listed: bool = False
    leak: float | None = None

    @property
    def large(self) -> bool:
        """Whether the switching can show; one of unknown size counts."""
        return self.change is None or abs(self.change) >= LARGE


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """All that was measured."""

    limit: float
    windows: tuple[Window, ...]
    healthy: tuple[Healthy, ...]
    hidden: tuple[Hidden, ...]


def read_switchings(path: Path) -> tuple[Switching, ...]:
    """Read the switchings of the outlet valves, in the order of time."""
    with path.open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if row["valve"] in OUTLETS]
    return tuple(
        Switching(
            time=float(row["t_start"]),
            end=float(row["t_end"]),
            valve=row["valve"],
            opening=(float(row["from"]), float(row["to"])),
            change=float(row["q_after"]) - float(row["q_before"]) if row["q_after"] and row["q_before"] else None,
        )
        for row in rows
    )


def read_plant(model: Path, recording: Path) -> Plant:
    """Build the engine of a model and read a recording for it."""
    graph = load_model(model)
    spec, engine = build_engine(graph)
    points = on_grid(read_rows(recording, columns_of(graph)), Grid(spec.sample_time))
    return Plant(spec=spec, engine=engine, points=tuple(points))


def states(plant: Plant) -> Iterator[State]:
    """Pass the whole recording through the monitor; gives the state before each point."""
    state = init(plant.spec)
    for point in plant.points:
        yield state
        state, _ = step(plant.spec, plant.engine, state, sample_of(point))


def sample_of(point: GridPoint) -> Sample:
    """Give what the monitor takes of a grid point."""
    return Sample(time=point.time, dt=point.dt, u=point.u, y=point.y)


def watch(plant: Plant, points: Sequence[GridPoint], state: State) -> Outcome:
    """Pass points through the monitor."""
    detection, diagnoses = None, []
    highest = np.zeros(len(plant.spec.outputs))
    for point in points:
        state, report = step(plant.spec, plant.engine, state, sample_of(point))
        if detection is None:
            highest = np.fmax(highest, report.cusum)
        detection = report.detection or detection
        if report.diagnosis is not None:
            diagnoses.append(report.diagnosis)
    last = finish(plant.spec, state)
    if last is not None and (not diagnoses or diagnoses[-1].time < last.time):
        diagnoses.append(last)
    return Outcome(detection=detection, diagnoses=tuple(diagnoses), highest=highest)


def candidate(diagnosis: Diagnosis, *parameters: str) -> Candidate:
    """Give the candidate with these parameters."""
    return next(item for item in diagnosis.candidates if item.parameters == parameters)


def windows(plant: Plant, switchings: Sequence[Switching]) -> Iterator[Window]:
    """Watch tank 4 alone, from each closing of C4 through its next opening to the closing after that."""
    own = [item for item in switchings if item.valve == "VA_C4"]
    for closing, opening, following in zip(own, own[1:], [*own[2:], None], strict=False):
        if opening.opening[1] < opening.opening[0]:
            continue
        end = following.time if following is not None else np.inf
        found = watch(plant, plant.points[plant.rows(closing.end + SETTLED, end)], init(plant.spec))
        yield _window(opening, found)


def _window(opening: Switching, found: Outcome) -> Window:
    if found.detection is None:
        return Window(opening=opening.time, delay=None, onset=None)
    last = found.diagnoses[-1]
    undecided = [
        item.time - opening.time
        for item in found.diagnoses
        if candidate(item, "Q4").group and candidate(item, "A4").group
    ]
    return Window(
        opening=opening.time,
        delay=found.detection.time - opening.time,
        onset=found.detection.change_time - opening.time,
        best=last.candidates[0].parameters,
        probability=last.candidates[0].probability,
        outflow=candidate(last, "Q4").suspects[0].estimate / CM3,
        undecided_until=max(undecided, default=None),
    )


def healthy(plant: Plant) -> Iterator[Healthy]:
    """Watch all tanks with nothing hidden, from the first row on and from later ones."""
    for first in range(0, len(plant.points), STARTS_EVERY):
        found = watch(plant, plant.points[first:], init(plant.spec))
        yield Healthy(
            start=plant.points[first].time,
            alarm=found.detection.time if found.detection is not None else None,
            highest=tuple(float(value) for value in found.highest),
        )


def hidden(plant: Plant, switchings: Sequence[Switching]) -> Iterator[Hidden]:
    """Hide each switching of an outlet valve from the model, one at a time."""
    firsts = {plant.rows(item.time).start for item in switchings}
    before = {row: state for row, state in enumerate(states(plant)) if row in firsts}
    for item in switchings:
        again = (other.time for other in switchings if other.valve == item.valve and other.time > item.time)
        rows = plant.rows(item.time, min(item.time + HIDDEN, next(again, np.inf)))
        points = hide(plant, f"demand{item.tank}", rows)
        yield _hidden(item, watch(plant, points, before[rows.start]))


def hide(plant: Plant, name: str, rows: slice) -> tuple[GridPoint, ...]:
    """Give rows in which an input stays at its value before them."""
    k = [item.name for item in plant.spec.inputs].index(name)
    held = np.nanmedian([point.u[k] for point in plant.points[max(rows.start - BEFORE, 0) : rows.start]])
    return tuple(
        replace(point, u=np.where(np.arange(len(point.u)) == k, held, point.u)) for point in plant.points[rows]
    )


def _hidden(item: Switching, found: Outcome) -> Hidden:
    if found.detection is None:
        return Hidden(time=item.time, valve=item.valve, change=item.change, delay=None)
    last = found.diagnoses[-1]
    best, leak = last.candidates[0].parameters, candidate(last, f"L{item.tank}")
    return Hidden(
        time=item.time,
        valve=item.valve,
        change=item.change,
        delay=found.detection.time - item.time,
        best=best,
        right_tank=all(name[-1] == item.tank for name in best),
        right_leak=best == leak.parameters,
        leak_listed=leak.group,
        leak=leak.suspects[0].estimate / CM3,
    )


def measure(folder: Path) -> Results:
    """Measure everything on the recording in a folder."""
    switchings = read_switchings(folder / "events.csv")
    recording = folder / "watersafe.csv"
    tanks = read_plant(MODELS / "tanks.yaml", recording)
    return Results(
        limit=tanks.spec.thresholds.cusum_limit,
        windows=tuple(windows(read_plant(MODELS / "tank4.yaml", recording), switchings)),
        healthy=tuple(healthy(tanks)),
        hidden=tuple(hidden(tanks, switchings)),
    )


def show(results: Results) -> None:
    """Print the results for people."""
    print("Tank 4 alone, each opening of its outlet from 7 to about 18 cm3/s (times after the opening)")
    print(f"{'opening':>8} {'alarm':>7} {'onset':>7} {'best':>6} {'prob.':>7} {'outflow':>8} {'or area until':>14}")
    for row in results.windows:
        print(
            f"{row.opening:6.0f} s {_seconds(row.delay)} {_seconds(row.onset)} {'+'.join(row.best) or '-':>6} "
            f"{_number(row.probability, 3)} {_number(row.outflow, 1):>8} {_seconds(row.undecided_until):>14}"
        )
    print(f"\nAll tanks, nothing hidden: largest CUSUM of each sensor (limit {results.limit:g})")
    for start in results.healthy:
        alarm = "no alarm" if start.alarm is None else f"FALSE ALARM at {start.alarm:.0f} s"
        print(f"from {start.start:5.0f} s {' '.join(f'{value:6.1f}' for value in start.highest)}  {alarm}")
    print("\nAll tanks, one switching hidden")
    large = [row for row in results.hidden if row.large]
    for missed in large:
        if missed.delay is None:
            print(f"missed: {missed.valve} at {missed.time:.0f} s, {_number(missed.change, 1).strip()} cm3/s")
    for title, rows in (
        (f"from {LARGE} cm3/s", large),
        ("  opened", [row for row in large if (row.change or 0.0) > 0]),
        ("  closed", [row for row in large if (row.change or 0.0) < 0]),
        ("smaller", [row for row in results.hidden if not row.large]),
    ):
        print(f"{title:18} {summary(rows)}")


def summary(rows: Sequence[Hidden]) -> str:
    """Say how many of the hidden switchings were found."""
    found = [row for row in rows if row.delay is not None]
    counts = f"{len(found)} of {len(rows)} detected"
    if not found:
        return counts
    delays = [row.delay for row in found if row.delay is not None]
    return (
        f"{counts}, after {np.median(delays):.0f} s (median; 90 %: {np.quantile(delays, 0.9):.0f} s), "
        f"right tank {sum(row.right_tank for row in found)}, right leak first {sum(row.right_leak for row in found)}, "
        f"in the group {sum(row.leak_listed for row in found)}"
    )


def _seconds(value: float | None) -> str:
    return f"{'-':>7}" if value is None else f"{value:5.0f} s"


def _number(value: float | None, places: int) -> str:
    return f"{'-':>7}" if value is None else f"{value:7.{places}f}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Faults found on the WaterSafe rig.")
    parser.add_argument("--json", metavar="FILE", help="write all results to FILE; `-` is standard output")
    wanted = parser.parse_args()
    if "FAULTBOND_DATA" not in os.environ:
        print("FAULTBOND_DATA is not set: nothing to measure", file=sys.stderr)
        return
    results = measure(Path(os.environ["FAULTBOND_DATA"]) / "watersafe")
    text = json.dumps(asdict(results), indent=1)
    if wanted.json == "-":
        print(text)
        return
    if wanted.json:
        Path(wanted.json).write_text(text + "\n", encoding="utf-8")
    show(results)


if __name__ == "__main__":
    main()
