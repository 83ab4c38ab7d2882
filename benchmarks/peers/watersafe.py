"""What is found on a real rig: tank 4 of WaterSafe alone, all four tanks healthy, and with switchings hidden.

Nobody made faults on this rig, but its demand valves switch at known times. Where the model is not told of a switching,
the switching is a leak (or the end of one) of known time, place and size.

    FAULTBOND_DATA=FOLDER python -m benchmarks.peers.watersafe [--markdown FILE]

FOLDER/watersafe/ holds `watersafe.csv` and `events.csv`; see examples/watersafe/README.md.
"""

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill

import numpy as np

from benchmarks.peers.recordings import Outcome, Rig, build_rig, data_folder
from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.plants import EXAMPLES
from benchmarks.shared.play import watched
from faultbond.app.rows import sample_of
from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.io.grid import GridPoint
from faultbond.runtime.monitor import Monitor

MODELS = EXAMPLES / "watersafe"
OUTLETS = ("VA_C1", "VA_C2", "VA_C3", "VA_C4")
CM3 = 1e-6  # m3
SETTLED = 10.0  # s from a closing of C4 to the start of a window
HIDDEN = 300.0  # s for which a switching is hidden, unless the valve switches again
LARGE = 9.8  # cm3/s; smaller switchings are within the rig's own balance error of 1 to 3 cm3/s over hours
BEFORE = 10  # rows whose median is the flow before a switching
STARTS_EVERY = 500  # rows between the starts of healthy runs
WIDTH = 120  # of a page
Cells = tuple[str, ...]
WINDOW_HEADER = ("opened at", "alarm after", "onset", "first", "probability", "outflow", "or the area until")
HEALTHY_HEADER = ("from", "LS_A1", "LS_A2", "LS_A3", "LS_A4", "limit", "alarm")
HIDDEN_HEADER = ("switchings", "detected", "median", "90 %", "right tank", "right leak first", "leak in the group")


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

    @property
    def large(self) -> bool:
        """Whether the switching can show; one of unknown size counts."""
        return self.change is None or abs(self.change) >= LARGE


@dataclass(frozen=True, slots=True, kw_only=True)
class Results:
    """All that was measured; of windows and healthy runs the lines of their tables."""

    windows: tuple[Cells, ...]
    healthy: tuple[Cells, ...]
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


def rows_of(points: Sequence[GridPoint], begin: float, end: float = np.inf) -> slice:
    """Give the rows from `begin` to before `end`, s."""
    times = [point.time for point in points]
    return slice(int(np.searchsorted(times, begin)), int(np.searchsorted(times, end)))


def candidate(diagnosis: Diagnosis, *parameters: str) -> Candidate | None:
    """Give the candidate with these parameters, if it is in the list."""
    return next((item for item in diagnosis.candidates if item.parameters == parameters), None)


def windows(rig: Rig, points: Sequence[GridPoint], switchings: Sequence[Switching]) -> Iterator[Cells]:
    """Watch tank 4 alone, from each closing of C4 through its next opening to the closing after that."""
    own = [item for item in switchings if item.valve == "VA_C4"]
    for closing, opening, following in zip(own, own[1:], [*own[2:], None], strict=False):
        if opening.opening[1] >= opening.opening[0]:
            end = following.time if following is not None else np.inf
            yield _window(opening.time, rig.watch(points[rows_of(points, closing.end + SETTLED, end)]))


def _window(opened: float, found: Outcome) -> Cells:
    """Give times after the opening (before: a false alarm), and until when outflow and area could not be told apart."""
    if found.detection is None:
        return f"{opened:.0f} s", *["-"] * (len(WINDOW_HEADER) - 1)
    last = found.diagnoses[-1]
    outlet = candidate(last, "Q4")
    undecided = [item.time - opened for item in found.diagnoses if _listed(item, "Q4") and _listed(item, "A4")]
    moments = (opened, found.detection.time - opened, found.detection.change_time - opened)
    return (
        *(f"{value:.0f} s" for value in moments),
        *(", ".join(last.candidates[0].parameters), f"{last.candidates[0].probability:.3f}"),
        _number(None if outlet is None else outlet.suspects[0].estimate / CM3, 1, " cm3/s"),
        _number(max(undecided, default=None), 0, " s"),
    )


def _listed(diagnosis: Diagnosis, *parameters: str) -> bool:
    """Whether a set is among those that cannot be told from the best."""
    found = candidate(diagnosis, *parameters)
    return found is not None and found.group


def healthy(rig: Rig, points: Sequence[GridPoint]) -> Iterator[Cells]:
    """Watch all tanks with nothing hidden, from the first row on and from later ones: largest CUSUM of each sensor."""
    for first in range(0, len(points), STARTS_EVERY):
        found = rig.watch(points[first:])
        alarm = "none" if found.alarm is None else f"at {found.alarm:.0f} s"
        limit, cusums = f"{rig.spec.thresholds.cusum_limit:.3g}", (f"{value:.1f}" for value in found.cusum)
        yield f"{points[first].time:.0f} s", *cusums, limit, alarm


def hidden(rig: Rig, points: Sequence[GridPoint], switchings: Sequence[Switching]) -> Iterator[Hidden]:
    """Hide each switching of an outlet valve from the model, one at a time."""
    firsts = {rows_of(points, item.time).start for item in switchings}
    passing = enumerate(watched(Monitor(rig.core), map(sample_of, points)), start=1)
    before = {0: Monitor(rig.core)} | {row: monitor.copy() for row, (_, monitor, _) in passing if row in firsts}
    for item in switchings:
        again = (other.time for other in switchings if other.valve == item.valve and other.time > item.time)
        rows = rows_of(points, item.time, min(item.time + HIDDEN, next(again, np.inf)))
        changed = hide(rig, points, f"demand{item.tank}", rows)
        yield _hidden(item, rig.watch(changed, before[rows.start].copy()))


def hide(rig: Rig, points: Sequence[GridPoint], name: str, rows: slice) -> tuple[GridPoint, ...]:
    """Give rows in which an input stays at its value before them."""
    k = [item.name for item in rig.spec.inputs].index(name)
    held = np.nanmedian([point.u[k] for point in points[max(rows.start - BEFORE, 0) : rows.start]])
    return tuple(replace(point, u=np.where(np.arange(len(point.u)) == k, held, point.u)) for point in points[rows])


def _hidden(item: Switching, found: Outcome) -> Hidden:
    if found.alarm is None:
        return Hidden(time=item.time, valve=item.valve, change=item.change, delay=None)
    last = found.diagnoses[-1]
    best, leak = last.candidates[0], candidate(last, f"L{item.tank}")
    return Hidden(
        time=item.time,
        valve=item.valve,
        change=item.change,
        delay=found.alarm - item.time,
        best=best.parameters,
        right_tank=all(name[-1] == item.tank for name in best.components),
        right_leak=leak is not None and best.parameters == leak.parameters,
        leak_listed=leak is not None and leak.group,
    )


def measure(folder: Path) -> Results:
    """Measure everything on the recording in a folder."""
    switchings = read_switchings(folder / "events.csv")
    tank4, tanks = build_rig(MODELS / "tank4.yaml"), build_rig(MODELS / "tanks.yaml")
    points = tanks.read(folder / "watersafe.csv")
    return Results(
        windows=tuple(windows(tank4, tank4.read(folder / "watersafe.csv"), switchings)),
        healthy=tuple(healthy(tanks, points)),
        hidden=tuple(hidden(tanks, points, switchings)),
    )


def tables(results: Results) -> tuple[tuple[str, Sequence[str], Sequence[Cells]], ...]:
    """Give the tables, each with its title and header."""
    return (
        ("Tank 4 alone, each opening of its outlet from 7 to about 18 cm3/s", WINDOW_HEADER, results.windows),
        ("All tanks, nothing hidden: largest CUSUM of each level", HEALTHY_HEADER, results.healthy),
        ("All tanks, one switching hidden", HIDDEN_HEADER, _hidden_rows(results)),
    )


def _hidden_rows(results: Results) -> list[tuple[str, ...]]:
    large = [row for row in results.hidden if row.large]
    return [
        _summary(title, rows)
        for title, rows in (
            (f"{LARGE} cm3/s and more", large),
            ("of these opened", [row for row in large if (row.change or 0.0) > 0]),
            ("of these closed", [row for row in large if (row.change or 0.0) < 0]),
            ("smaller", [row for row in results.hidden if not row.large]),
        )
    ]


def _summary(title: str, rows: Sequence[Hidden]) -> tuple[str, ...]:
    """Say how many of the hidden switchings were found."""
    found = [row for row in rows if row.delay is not None]
    delays = [row.delay for row in found if row.delay is not None]
    return (
        title,
        f"{len(found)} of {len(rows)}",
        _number(float(np.median(delays)) if delays else None, 0, " s"),
        _number(float(np.quantile(delays, 0.9)) if delays else None, 0, " s"),
        str(sum(row.right_tank for row in found)),
        str(sum(row.right_leak for row in found)),
        str(sum(row.leak_listed for row in found)),
    )


def exceptions(results: Results) -> list[str]:
    """Name each large switching that was missed, or taken for something else than a leak of its tank."""
    lines = []
    for row in results.hidden:
        if not row.large or row.right_leak:
            continue
        what = f"{row.valve} at {row.time:.0f} s by {_number(row.change, 1, ' cm3/s')}"
        lines.append(f"{what}: missed" if row.delay is None else f"{what}: {', '.join(row.best)} first")
    return lines


def _number(value: float | None, places: int, unit: str = "") -> str:
    return "-" if value is None else f"{value:.{places}f}{unit}"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen, folder = arguments("Faults found on the WaterSafe rig.", argv), data_folder()
    if folder is None:
        return
    results = measure(folder / "watersafe")
    parts = [part for title, header, rows in tables(results) for part in (title, (header, rows))]
    words = fill(f"Not first: {'; '.join(exceptions(results) or ['none'])}.", WIDTH)
    publish("peers.watersafe", chosen, note(), *parts, words)


if __name__ == "__main__":
    main()
