"""A valve closes on a real water loop: when the alarm comes, and whether it is told what cannot be told.

    FAULTBOND_DATA=FOLDER python -m benchmarks.peers.skab [--markdown FILE]

FOLDER/skab/ holds the recordings and `labels.csv`; see examples/skab/README.md.

Drops of known size and speed, put into the healthy minutes before, are a second table. A third one counts rows, as the
makers of the recordings do, and has the same plant with its laws turned over: resistances in place of coefficients.

The labels say when the valve was first turned. For most of a minute its turning hardly matters to the flow, so delays
are also counted from when the flow gave way: where the straight ramp that fits its fall best begins.
"""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from textwrap import fill

import numpy as np

from benchmarks.peers.recordings import Outcome, Rig, data_folder, rig_of
from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.plants import EXAMPLES
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Diagnosis
from faultbond.io.grid import GridPoint
from faultbond.model.text import parse_model

MODEL = EXAMPLES / "skab" / "model.yaml"
SUSPECTS = frozenset({"pump", "pipe", "valve"})  # one flow cannot tell them apart
LARGE = 5.0  # %; smaller drops are within what the flow wanders by itself
VISIBLE = 2.0  # %; of smaller drops it cannot be said when they began
BEFORE = 120.0  # s before the closing that tell the flow before
MADE = 0.05  # of the flow: drop put into healthy minutes
MADE_AT = 300.0  # s after the first row
MADE_TAKES = (1.0, 20.0, 60.0)  # s
WIDTH = 120  # of a page
MARGIN = 20.0  # s by which a label may be off
HEADER = ("run", "drop", "closing begins", "flow gives way", "alarm", "delay", "from the flow", "CUSUM before", "group")
FORMS_HEADER = (
    "law of pipe and valve",
    "F1 over all rows",
    "alarms before",
    "valve in the group while closed",
    "at the end",
)
MADE_HEADER = ("drop of 5 % that takes", "detected", "alarms before", "after, median", "slowest")


@dataclass(frozen=True, slots=True, kw_only=True)
class Label:
    """A recording and what is known of it; s after its first row, drop of the flow in %."""

    name: str
    begin: float  # the valve is first turned
    end: float  # it is open again
    dwell: tuple[float, float]  # closed as far as it goes
    drop: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What a run brought, s after its first row. `cusum`: largest one before the closing, the limit being `limit`.

    group, last: components that cannot be told apart, when the valve was about to open again, and at the end.
    rows: those in which a fault was told and there was one; told; there was one.
    """

    label: Label
    gives_way: float | None
    alarm: float | None
    cusum: float
    limit: float
    group: tuple[str, ...]
    last: tuple[str, ...]
    rows: tuple[int, int, int]
    shared: float | None  # part of the diagnoses up to then in which all suspects are in the group

    @property
    def early(self) -> bool:
        """Whether the alarm was there before the fault."""
        return self.alarm is not None and self.alarm < self.label.begin

    @property
    def delay(self) -> float | None:
        """Seconds from the first turning of the valve to an alarm while it was closed."""
        late = self.alarm is not None and self.alarm >= self.label.dwell[1]
        return None if self.alarm is None or self.early or late else self.alarm - self.label.begin

    @property
    def delay_from_flow(self) -> float | None:
        """Seconds from when the flow gave way."""
        if self.delay is None or self.gives_way is None:
            return None
        return self.delay + self.label.begin - self.gives_way


def read_labels(path: Path) -> tuple[Label, ...]:
    """Read what is known of the recordings."""
    labels = []
    with path.open(encoding="utf-8", newline="") as stream:
        for row in csv.DictReader(stream):
            moments: list[str] = [row["t_on_s"], *row["changepoints_s"].strip("[]").split(",")]
            closed, opening, end = map(float, moments[-3:])
            name, begin, drop = f"{row['group']}_{row['file']}", float(row["t_on_s"]), float(row["flow_drop_pct"])
            labels.append(Label(name=name, begin=begin, end=end, dwell=(closed, opening), drop=drop))
    return tuple(labels)


def gives_way(times: FloatArray, flow: FloatArray, label: Label) -> float | None:
    """Give when the flow gave way, seconds: where the straight ramp between two levels that fits best begins.

    None where the drop is too small to say.

    Parameters
    ----------
    times, flow : float arrays, shape (n_rows,), s and m3/s; nan where missing
    label : Label
        When the valve was turned.
    """
    if label.drop < VISIBLE:
        return None
    closed, opening = label.dwell
    near = np.isfinite(flow) & (times >= label.begin - BEFORE) & (times < opening)
    seconds, values = times[near], flow[near]
    before = values[seconds < label.begin - MARGIN].mean()
    after = values[seconds > closed + MARGIN].mean()
    grid = np.arange(label.begin - MARGIN, closed + MARGIN)
    ramps = [(first, last) for first in grid for last in grid if first < last]
    errors = [np.sum((np.interp(seconds, ramp, (before, after)) - values) ** 2) for ramp in ramps]
    return float(ramps[int(np.argmin(errors))][0])


def measure(rig: Rig, recording: Path, label: Label) -> Run:
    """Run one recording."""
    points = rig.read(recording)
    start = points[0].time
    found = rig.watch(points)
    closed = [item for item in found.diagnoses if item.time < start + label.dwell[1]]
    groups = [_group(told) for told in closed]
    return Run(
        label=label,
        gives_way=gives_way(np.array([point.time - start for point in points]), _flow(points), label),
        alarm=None if found.alarm is None else found.alarm - start,
        cusum=float(rig.watch([point for point in points if point.time - start < label.begin]).cusum.max()),
        limit=rig.spec.thresholds.cusum_limit,
        group=tuple(sorted(groups[-1])) if groups else (),
        last=tuple(sorted(_group(found.diagnoses[-1]))) if found.diagnoses else (),
        rows=_rows(points, found, label),
        shared=float(np.mean([group >= SUSPECTS for group in groups])) if groups else None,
    )


def _group(told: Diagnosis) -> frozenset[str]:
    return frozenset(name for item in told.candidates if item.group for name in item.components)


def _rows(points: Sequence[GridPoint], found: Outcome, label: Label) -> tuple[int, int, int]:
    """Count rows in which a fault is told: from the alarm on, but while the first candidate is said to be gone."""
    times = np.array([point.time for point in points])
    there = np.isfinite(_flow(points))
    true = there & (times >= points[0].time + label.begin) & (times < points[0].time + label.end)
    told = np.zeros(times.size, dtype=bool)
    if found.alarm is not None:
        told = there & (times >= found.alarm)
        for diagnosis in found.diagnoses:
            told[times >= diagnosis.time] = diagnosis.candidates[0].present
    told &= there
    return int((told & true).sum()), int(told.sum()), int(true.sum())


def turned_over() -> str:
    """Give the model with resistances in place of flow coefficients, known to the same flow."""
    text = MODEL.read_text(encoding="utf-8")
    for name in ("pipe", "valve"):
        old = f"law: e = f*abs(f)/K_{name}**2, parameters: {{K_{name}: 2.39e-6 m^3/s/Pa^0.5}}"
        new = f"law: e = R_{name}*f*abs(f), parameters: {{R_{name}: {{nominal: 1.75e11 Pa*s^2/m^6, accuracy: 4 %}}}}"
        if old not in text:
            raise ValueError(f"{MODEL}: the law of {name} is another one; expected {old}")
        text = text.replace(old, new)
    return text


def form(law: str, runs: Sequence[Run]) -> tuple[str, ...]:
    """Give a row of the third table."""
    hits, told, true = np.sum([run.rows for run in runs], axis=0)
    closed, last = sum("valve" in run.group for run in runs), sum("valve" in run.last for run in runs)
    early, total = sum(run.early for run in runs), len(runs)
    words = f"{2.0 * hits / (told + true):.3f}", f"{early} of {total}", f"{closed} of {total}", f"{last} of {total}"
    return law, *words


def _flow(points: Sequence[GridPoint]) -> FloatArray:
    return np.array([point.y[0] for point in points])


def made_drop(rig: Rig, healthy: Sequence[Sequence[GridPoint]], takes: float) -> tuple[str, ...]:
    """Put a drop that takes so many seconds into the healthy part of every run; give a row of the second table."""
    delays = [_made(rig, points, takes) for points in healthy]
    found = [delay for delay in delays if delay is not None and delay >= 0.0]
    early = sum(delay is not None and delay < 0.0 for delay in delays)
    slowest = _seconds(max(found, default=None))
    return _seconds(takes), f"{len(found)} of {len(delays)}", str(early), _median(found), slowest


def _made(rig: Rig, points: Sequence[GridPoint], takes: float) -> float | None:
    """Give the delay of one drop; the flow meter goes on to tell whole units."""
    begin, unit = points[0].time + MADE_AT, rig.spec.outputs[0].unit_factor
    size = MADE * np.nanmean(_flow(points))
    parts = np.clip([(point.time - begin) / takes for point in points], 0.0, 1.0)
    lower = [np.round((point.y - size * part) / unit) * unit for point, part in zip(points, parts, strict=True)]
    changed = [
        replace(point, y=y if part > 0.0 else point.y) for point, part, y in zip(points, parts, lower, strict=True)
    ]
    alarm = rig.watch(changed, to_alarm=True).alarm
    return None if alarm is None else alarm - begin


def cells(run: Run) -> tuple[str, ...]:
    """Give a row of the table."""
    alarm = _seconds(run.alarm) + (" (too early)" if run.early else "")
    return (
        run.label.name,
        f"{run.label.drop:.1f} %",
        _seconds(run.label.begin),
        _seconds(run.gives_way),
        alarm,
        _seconds(run.delay),
        _seconds(run.delay_from_flow),
        f"{run.cusum:.1f} of {run.limit:.3g}",
        ", ".join(run.group) or "-",
    )


def summary(runs: Sequence[Run]) -> str:
    """Say in a few sentences what was asked and what came of it."""
    large = [run for run in runs if run.label.drop >= LARGE]
    found = [run for run in large if run.delay is not None]
    told = [run.shared for run in runs if run.shared is not None]
    lines = [
        f"Drops of {LARGE:g} % and more: {len(found)} of {len(large)} detected, "
        f"{_median([run.delay for run in found])} after the valve was first turned (median), "
        f"{_median([run.delay_from_flow for run in found])} after the flow gave way.",
        f"Alarms before the closing: {sum(run.early for run in runs)} of {len(runs)}.",
        f"Pump, pipe and valve are in the group in {100.0 * np.mean(told):.0f} % of the diagnoses while it is closed."
        if told
        else "",
    ]
    return "\n".join(line for line in lines if line)


def _median(delays: Sequence[float | None]) -> str:
    known = [delay for delay in delays if delay is not None]
    return f"{np.median(known):.0f} s" if known else "-"


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.0f} s"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen, data = arguments("A closing valve found in a real water loop.", argv), data_folder()
    if data is None:
        return
    rig, folder = rig_of(parse_model(MODEL.read_text(encoding="utf-8"))), data / "skab"
    labels = read_labels(folder / "labels.csv")
    runs = [measure(rig, folder / f"{label.name}.csv", label) for label in labels]
    other = rig_of(parse_model(turned_over()))
    turned = [measure(other, folder / f"{label.name}.csv", label) for label in labels]
    whole = [(label, rig.read(folder / f"{label.name}.csv")) for label in labels]
    healthy = [[row for row in rows if row.time - rows[0].time < label.begin - MARGIN] for label, rows in whole]
    made = [made_drop(rig, healthy, takes) for takes in MADE_TAKES]
    told = (HEADER, [cells(run) for run in runs])
    forms = (FORMS_HEADER, [form("f*abs(f)/K**2", runs), form("R*f*abs(f)", turned)])
    publish("peers.skab", chosen, note(), told, fill(summary(runs), WIDTH), (MADE_HEADER, made), forms)


if __name__ == "__main__":
    main()
