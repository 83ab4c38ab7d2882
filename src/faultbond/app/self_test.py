"""The self-test of a generated program: samples of a healthy plant that gets a fault, and the records that `run` gives.

The inputs move as in usual operation; the noise is of a fixed seed, so that the same model gives the same samples.
"""

import io
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from faultbond.analysis.operation import usual_runs
from faultbond.app.course import Course, Following
from faultbond.app.methods import BankWatcher
from faultbond.arrays import FloatArray
from faultbond.contract.json_records import run_record
from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel
from faultbond.errors import ModelError, StructureError
from faultbond.io.grid import Grid, blocks_of_points
from faultbond.io.out import Out
from faultbond.io.recording import columns_of, read_blocks, write_recording
from faultbond.model.graph import BondGraph, Parameter
from faultbond.model.row_means import of_rows
from faultbond.runtime.core import Core
from faultbond.simulate import Fault, Inputs, columns, simulate
from faultbond.types import Method

HEALTHY, FAULTY = 120, 160  # samples before the fault, beside those for which alarms are off, and after it
_SEED = 1
_MOST_TRIED = 6  # faults
_DIGITS = 9
_START = 20  # samples from which a start is solved


@dataclass(frozen=True, slots=True, kw_only=True)
class SelfTest:
    """Recorded samples as CSV, their records as JSON lines, and the parameter that is at fault; empty: none is.

    samples : (n_samples, 2 + n_inputs + n_sensors), those of the recording as the core takes them: time and step (s),
        inputs and readings, SI, nan where missing
    """

    recording: str
    records: str
    samples: FloatArray
    fault: str


def self_test(graph: BondGraph, model: StepModel, core: Core) -> SelfTest:
    """Give the self-test of a model: the first fault that is found in time, else a healthy recording.

    Parameters
    ----------
    graph : the plant
    model : the same in discrete time
    core : compiled; its specification says what is tested

    Raises
    ------
    StructureError
        Where the plant has no usual run.
    """
    begin = core.spec.thresholds.warm_up_samples + _START + HEALTHY
    inputs, start = usual_inputs(model, core.spec, begin + FAULTY)
    tried = [item for item in graph.parameters if item.suspect][:_MOST_TRIED]
    for item in tried:
        found = _tried(graph, core, inputs, start, _fault(item, graph, begin))
        if found is not None and '"record": "detection"' in found.records:
            return found
    healthy = _tried(graph, core, inputs, start, None)
    if healthy is None:
        raise StructureError(f"{graph.file}: {graph.name} cannot be simulated near its usual inputs")
    return healthy


def usual_inputs(model: StepModel, spec: EngineSpec, count: int) -> tuple[FloatArray, dict[str, float]]:
    """Give inputs of usual operation, (n, n_inputs), SI, and what the stores hold at its beginning.

    Raises
    ------
    StructureError
        Where there is no finite solution near the usual inputs.
    """
    run = next(usual_runs(model, spec, count), None)
    if run is None:
        graph = model.plant.graph
        raise StructureError(f"{graph.file}: {graph.name} has no finite solution near its usual inputs")
    nominal = [item.nominal for item in model.plant.graph.parameters]
    contents = model.contents(run.states[0], nominal).full()[:, 0]
    stores = [store.name for store in model.plant.network.states]
    return np.array([sample.u for sample in run.samples]), dict(zip(stores, map(float, contents), strict=True))


def _fault(item: Parameter, graph: BondGraph, begin: int) -> Fault:
    """Give a usual fault of a parameter within its range, from sample `begin` on."""
    return Fault(parameter=item.name, value=faulty_value(item), start=(graph.sample_time or 1.0) * begin)


def faulty_value(item: Parameter, part: float = 1.0) -> float:
    """Give a usual faulty value of a parameter within its range: off by a part of the change that is declared of it."""
    change = part * item.change
    ends = [end for end in (item.nominal + change, item.nominal - change) if item.lower < end < item.upper]
    middle = 0.5 * (item.lower + item.upper)
    return ends[0] if ends else middle if isfinite(middle) else item.nominal + change


def _tried(
    graph: BondGraph, core: Core, inputs: FloatArray, start: dict[str, float], fault: Fault | None
) -> SelfTest | None:
    """Simulate one fault and run the monitor over it; None where the plant has no solution with it."""
    rows = of_rows(graph)
    step, each = rows.sample_time or 1.0, graph.rows_per_sample
    values = np.repeat(inputs, each, axis=0)
    moments = Inputs(time=step * np.arange(len(values), dtype=np.float64), values=values)
    try:
        simulation = simulate(rows, moments, [fault] if fault else [], seed=_SEED, start=start)
    except (ModelError, StructureError):
        return None
    with TemporaryDirectory() as work:
        path = Path(work) / "recording.csv"
        write_recording(path, columns(rows, simulation, digits=_DIGITS))
        records, samples = records_of(graph, core, path)
        return SelfTest(
            recording=path.read_text(encoding="utf-8"),
            records=records,
            samples=samples,
            fault=fault.parameter if fault else "",
        )


def records_of(graph: BondGraph, core: Core, recording: Path) -> tuple[str, FloatArray]:
    """Give the records of a recording as `run` writes them of one that comes on standard input, and its samples.

    These have the shape (n_samples, 2 + n_inputs + n_sensors); see `SelfTest`.
    """
    spec, lines = core.spec, io.StringIO()
    out, watcher = Out(text=None, json=lines), BankWatcher(core)
    grid = Grid(
        spec.sample_time,
        live=True,
        noise=[item.noise for item in spec.outputs],
        row_time=spec.row_time,
        held=[not item.linear for item in spec.inputs],
    )
    out.record(
        run_record(
            model=spec.model,
            model_sha256=spec.model_sha256,
            method=Method.BANK,
            version=spec.version,
            sample_time=spec.sample_time,
            explain_anything=[[spec.parameters[k].name for k in chosen] for chosen in spec.explain_anything],
        )
    )
    course = Course(watcher, grid, Following(out=out))
    taken = []
    for rows in read_blocks(str(recording), columns_of(graph)):
        for points in grid.push_block(rows):
            course.take(points)
            taken.append(points)
    for points in blocks_of_points(grid.finish()):
        course.take(points)
        taken.append(points)
    course.finish()
    samples = [np.column_stack([points.time, points.dt, points.u, points.y]) for points in taken]
    return lines.getvalue(), np.concatenate(samples)
