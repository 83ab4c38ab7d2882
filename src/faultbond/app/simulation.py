"""`simulate`: a recording of the simulated plant."""

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from faultbond.app.disorder import refuse_disorder
from faultbond.app.rows import naming, no_time, sample_of
from faultbond.app.wishes import Imperfections
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.errors import ModelError, RecordingError
from faultbond.io.faults import FaultRequest
from faultbond.io.files import STANDARD_INPUT
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.memory_table import Recording
from faultbond.io.out import Out
from faultbond.io.recording import columns_of, read_rows, write_recording
from faultbond.model.document import ModelFile
from faultbond.model.graph import BondGraph
from faultbond.model.row_means import of_rows
from faultbond.model.text import load_model
from faultbond.runtime.monitor import Monitor

START_POINTS = int(core_settings()["START_SAMPLES"]) - 1  # that tell a start


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulated:
    """A recording of a simulated plant. held: samples that lacked an input. start: of states, SI."""

    graph: BondGraph
    simulation: Any
    seed: int
    held: int
    start: Mapping[str, float]

    def columns(self) -> dict[str, FloatArray]:
        """Give its columns by header, (n_rows,) each, in the units of the model file."""
        from faultbond.simulate import columns  # noqa: PLC0415 - loads casadi and scipy

        return dict(columns(self.graph, self.simulation, digits=9))


def simulate(
    model: ModelFile,
    *,
    inputs: Recording,
    faults: tuple[FaultRequest, ...],
    seed: int | None,
    noise: bool,
    imperfections: Imperfections,
    start: Mapping[str, float],
    output: Path,
    out: Out,
) -> None:
    """Write a recording of the simulated plant; see `simulated`."""
    found = simulated(
        model, inputs=inputs, faults=faults, seed=seed, noise=noise, imperfections=imperfections, start=start
    )
    write_recording(output, found.columns())
    times, begin, held = found.simulation.time, found.start, found.held
    rows = len(times)
    out.record(
        {"record": "simulate", "model": found.graph.name, "output": str(output), "samples": rows, "seed": found.seed}
        | {"noise": noise, "held": held, "start": begin}
    )
    drawn = f"; seed {found.seed}" if noise or imperfections.spread or imperfections.wander else ""
    quiet = "" if noise else "; no noise"
    out.say(f"{output}: {rows} rows, {times[0]:.9g} s to {times[-1]:.9g} s{drawn}{quiet}")
    for how, names in (("as given", begin.keys() & start), (f"from the first rows of {inputs}", begin.keys() - start)):
        states = [f"{name} {_in_unit(found.graph, name, value)}" for name, value in begin.items() if name in names]
        if states:
            out.say(f"start, {how}: {', '.join(states)}")
    if held:
        out.say(f"{held} samples lacked an input: its last value was held")


def _in_unit(graph: BondGraph, state: str, value: float) -> str:
    return f"{value:.6g} {graph.signal_unit(state).text}".rstrip()


def simulated(
    model: ModelFile,
    *,
    inputs: Recording,
    faults: tuple[FaultRequest, ...] = (),
    seed: int | None = None,
    noise: bool = True,
    imperfections: Imperfections | None = None,
    start: Mapping[str, float] | None = None,
) -> Simulated:
    """Simulate a plant.

    Parameters
    ----------
    model : the model file
    inputs : recording with the time and the inputs; its sensors, if it has some, tell the start
    faults : what is wrong, and when
    seed : of the noise; None draws one
    noise : whether sensors and inputs scatter as the model declares
    imperfections : what the plant has and the model leaves out
    start : SI values by state

    Raises
    ------
    ModelError
        Where something is to wander, and nothing does.
    """
    imperfections, start = imperfections or Imperfections(), start or {}
    means = load_model(model)
    if imperfections.wander and not means.wanders:
        problem = "nothing wanders in it; state how far and how long, such as `wander: 3 % over 6 h` of a parameter"
        raise ModelError(f"{means.file}: {problem}, or leave out --wander")
    graph = of_rows(means)
    points, held = driving_inputs(graph, inputs)
    begin = {**solved_start(means, inputs), **start}
    from faultbond.simulate import Effects, Inputs, fault_in_si  # noqa: PLC0415 - loads casadi and scipy
    from faultbond.simulate import simulate as simulate_plant  # noqa: PLC0415

    seed = secrets.randbelow(2**31) if seed is None else seed
    simulation = simulate_plant(
        graph,
        Inputs(time=np.array([point.time for point in points]), values=np.array([point.u for point in points])),
        [fault_in_si(fault, graph) for fault in faults],
        seed=seed,
        noise=noise,
        effects=Effects(
            spread=imperfections.spread,
            lag=imperfections.lag,
            curve=imperfections.curve,
            wander=imperfections.wander,
        ),
        start=begin,
    )
    return Simulated(graph=graph, simulation=simulation, seed=seed, held=held, start=begin)


def driving_inputs(graph: BondGraph, recording: Recording) -> tuple[list[GridPoint], int]:
    """Give the inputs of a recording on the grid, with absent values held, and at how many points one was absent.

    Raises
    ------
    RecordingError
        Where no row has a time, or the recording is no usual one.
    """
    points: list[GridPoint] = []
    held = 0
    last = np.full(len(graph.inputs), np.nan)
    rows = read_rows(recording, columns_of(graph, sensors=False))
    grid = Grid(graph.sample_time, steady=True)
    with naming(recording):
        for point in on_grid(rows, grid):
            absent = ~np.isfinite(point.u)
            held += bool(absent.any())
            last = np.where(absent, last, point.u)
            points.append(replace(point, u=last))
    if not points:
        raise RecordingError(no_time(recording))
    refuse_disorder(grid, recording)
    return points, held


def solved_start(graph: BondGraph, recording: Recording) -> dict[str, float]:
    """Give the start of the states that the model leaves open, if the recording shows what the sensors saw."""
    try:
        rows = read_rows(recording, columns_of(graph)) if str(recording) != STANDARD_INPUT else iter(())
        points = list(
            islice(
                on_grid(rows, Grid(graph.sample_time, steady=True, row_time=graph.row_time, held=graph.held_inputs)),
                START_POINTS,
            )
        )
    except RecordingError:  # no sensors in it
        return {}
    return start_of(graph, points)


def start_of(graph: BondGraph, points: Sequence[GridPoint]) -> dict[str, float]:
    """Give the start of the states that the model leaves open, by first points; none where it does not hold."""
    known = {item.name for item in graph.components if item.start is not None}
    from faultbond.synthesis.engine import build_engine, build_model  # noqa: PLC0415 - loads casadi

    model = build_model(graph)
    stores = model.plant.network.states
    is_seen = any(np.isfinite(point.y).any() for point in points)
    if not is_seen or all(store.component in known for store in stores):
        return {}
    _, core = build_engine(graph)
    monitor = Monitor(core)
    for point in points:
        monitor.step(sample_of(point))
    if monitor.is_outside:
        return {}
    first = max(int(monitor.number("clock.begun")), 0)
    mean, _ = core.solve_start(np.array([monitor.row(k)[0] for k in range(first, len(points))]))
    contents = model.contents(mean, [item.nominal for item in graph.parameters]).full()[:, 0]
    return {
        store.name: float(content)
        for store, content in zip(stores, contents, strict=True)
        if store.component not in known
    }
