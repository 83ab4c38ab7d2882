"""`simulate`: a recording of the simulated plant."""

import secrets
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np

from faultbond.app.rows import no_time, sample_of
from faultbond.app.wishes import Imperfections
from faultbond.contract.core_settings import core_settings
from faultbond.errors import ModelError, RecordingError
from faultbond.io.faults import FaultRequest
from faultbond.io.files import STANDARD_INPUT
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.out import Out
from faultbond.io.recording import columns_of, read_rows, write_recording
from faultbond.model.graph import BondGraph
from faultbond.model.row_means import of_rows
from faultbond.model.text import load_model
from faultbond.runtime.monitor import Monitor

START_POINTS = int(core_settings()["START_SAMPLES"]) - 1  # that tell a start


def simulate(
    model: Path,
    *,
    inputs: str,
    faults: tuple[FaultRequest, ...],
    seed: int | None,
    noise: bool,
    imperfections: Imperfections,
    start: Mapping[str, float],
    output: Path,
    out: Out,
) -> None:
    """Write a recording of the simulated plant; `inputs` is a path or `-`, `start` gives SI values by state.

    noise: whether sensors and inputs scatter as the model declares

    Raises
    ------
    ModelError
        Where something is to wander, and nothing does.
    """
    means = load_model(model)
    if imperfections.wander and not means.wanders:
        problem = "nothing wanders in it; state how far and how long, such as `wander: 3 % over 6 h` of a parameter"
        raise ModelError(f"{means.file}: {problem}, or leave out --wander")
    graph = of_rows(means)
    points, held = _inputs(graph, inputs)
    begin = {**solved_start(means, inputs), **start}
    from faultbond import simulate as plant  # noqa: PLC0415 - loads casadi and scipy

    seed = secrets.randbelow(2**31) if seed is None else seed
    simulation = plant.simulate(
        graph,
        plant.Inputs(time=np.array([point.time for point in points]), values=np.array([point.u for point in points])),
        [plant.fault_in_si(fault, graph) for fault in faults],
        seed=seed,
        noise=noise,
        effects=plant.Effects(
            spread=imperfections.spread,
            lag=imperfections.lag,
            curve=imperfections.curve,
            wander=imperfections.wander,
        ),
        start=begin,
    )
    write_recording(output, plant.columns(graph, simulation, digits=9))
    rows = len(simulation.time)
    out.record(
        {"record": "simulate", "model": graph.name, "output": str(output), "samples": rows, "seed": seed}
        | {"noise": noise, "held": held, "start": begin}
    )
    drawn = f"; seed {seed}" if noise or imperfections.spread or imperfections.wander else ""
    quiet = "" if noise else "; no noise"
    out.say(f"{output}: {rows} rows, {simulation.time[0]:.9g} s to {simulation.time[-1]:.9g} s{drawn}{quiet}")
    for name, value in begin.items():
        source = "as given" if name in start else f"solved from the first rows of {inputs}"
        out.say(f"start of {name}: {value:.6g} (SI), {source}")
    if held:
        out.say(f"{held} samples lacked an input: its last value was held")


def _inputs(graph: BondGraph, recording: str) -> tuple[list[GridPoint], int]:
    """Give the inputs of a recording on the grid, with absent values held, and at how many points one was absent."""
    points: list[GridPoint] = []
    held = 0
    last = np.full(len(graph.inputs), np.nan)
    rows = read_rows(recording, columns_of(graph, sensors=False))
    for point in on_grid(rows, Grid(graph.sample_time, steady=True)):
        absent = ~np.isfinite(point.u)
        held += bool(absent.any())
        last = np.where(absent, last, point.u)
        points.append(replace(point, u=last))
    if not points:
        raise RecordingError(no_time(recording))
    return points, held


def solved_start(graph: BondGraph, recording: str) -> dict[str, float]:
    """Give the start of the states that the model leaves open, if the recording shows what the sensors saw."""
    try:
        rows = read_rows(recording, columns_of(graph)) if recording != STANDARD_INPUT else iter(())
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
    if not points or all(store.component in known for store in stores):
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
