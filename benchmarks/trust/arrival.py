"""How the rows of a run reach the monitor: some of their values missing, some late, or watching interrupted.

All rows go the way that `faultbond run` has for them: through the grid, and at an interruption through the file that
keeps a run.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.shared.play import engine_of
from benchmarks.trust.plants import Make, Played
from faultbond.app.rows import sample_of
from faultbond.contract.samples import Report, Sample
from faultbond.contract.spec import EngineSpec
from faultbond.io.grid import Grid, GridClock, Row, on_grid
from faultbond.io.saved import FoundSoFar, Saved, read_saved, write_saved
from faultbond.runtime.monitor import Monitor
from faultbond.types import Method

AFTER = {"tank": 60.0, "dc_motor": 1.0}  # s after the onset at which watching is interrupted once more
MOST_LATE = 5  # samples
STATE = "state"  # name of what the core saves, in the file


def with_missing(make: Make, part: float, seed: int) -> Played:
    """Give a run in which a part of all values is missing."""
    found = make(seed)
    generator = np.random.default_rng([seed, 17])
    inputs, outputs = found.inputs.copy(), found.outputs.copy()
    inputs[generator.random(inputs.shape) < part] = np.nan
    outputs[generator.random(outputs.shape) < part] = np.nan
    inputs[0] = found.inputs[0]
    return replace(found, inputs=inputs, outputs=outputs)


def with_late(make: Make, part: float, seed: int) -> Played:
    """Give a live run in which a part of the rows arrives after 1 to 5 later ones."""
    found = make(seed)
    generator = np.random.default_rng([seed, 23])
    arrival = np.arange(found.time.size, dtype=float)
    late = generator.random(arrival.size) < part
    late[0] = False
    arrival[late] += generator.integers(1, MOST_LATE + 1, int(late.sum())) + 0.5
    return replace(found, order=tuple(int(k) for k in np.argsort(arrival, kind="stable")))


def interrupted(make: Make, seed: int) -> Played:
    """Give a run whose watching is interrupted at any moment between warm-up and onset, and again after the onset."""
    found = make(seed)
    spec, _ = engine_of(found.folder)
    warm = float(found.time[spec.thresholds.warm_up_samples])
    before = float(np.random.default_rng([seed, 29]).uniform(warm, found.onset))
    return replace(found, stops=(before, found.onset + AFTER[found.folder]))


def watched(monitor: Monitor, made: Played) -> Iterator[tuple[Sample, Monitor, Report]]:
    """Pass a run through a monitor; give each sample with the monitor as it then is, and what was said to it."""
    spec, clock = monitor.spec, None
    sessions = _sessions(made)
    for number, rows in enumerate(sessions, start=1):
        grid = _grid(spec, made, clock)
        for point in on_grid(rows, grid):
            sample = sample_of(point)
            if point.resumes:
                monitor.resume()
            report = monitor.step(sample)
            yield sample, monitor, report
        if number < len(sessions):
            monitor, clock = _kept(monitor, grid)


def _sessions(made: Played) -> list[Iterator[Row]]:
    """Give the rows between interruptions, in the order of their arrival."""
    order = np.arange(made.time.size) if made.order is None else np.array(made.order)
    return [
        (Row(time=float(made.time[k]), u=made.inputs[k], y=made.outputs[k]) for k in part)
        for part in np.split(order, np.searchsorted(made.time, made.stops))
    ]


def _grid(spec: EngineSpec, made: Played, clock: GridClock | None) -> Grid:
    noise = [item.noise for item in spec.outputs]
    return Grid(spec.sample_time, live=made.order is not None, noise=noise, clock=clock)


def _kept(monitor: Monitor, grid: Grid) -> tuple[Monitor, GridClock | None]:
    """Write a run to a file and read it again."""
    spec = monitor.spec
    if grid.clock is None:
        return monitor, None
    saved = Saved(
        model=spec.model,
        model_sha256=spec.model_sha256,
        version=spec.version,
        method=Method.BANK,
        numbers={STATE: monitor.save().view(np.float64)},
        clock=grid.clock,
        found=FoundSoFar(),
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "state"
        write_saved(path, saved)
        again = read_saved(path)
    return Monitor(monitor.core, again.numbers[STATE].view(np.uint8)), again.clock
