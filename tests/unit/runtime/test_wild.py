"""Wild values: one reading, or one input, that is far from everything says nothing of the plant."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.reserve import PER_SET, n_grown
from faultbond.contract.samples import Sample
from faultbond.contract.slots import plan_slots
from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from made import EXAMPLES, graph_of, plant, recorded, run, samples_of

START_SAMPLES = int(core_settings()["START_SAMPLES"])
HEALTHY = sorted(path.parent.name for path in EXAMPLES.glob("*/healthy.csv"))
SPARSE = {"every row": 1, "every second row": 2, "every fifth row": 5, "when it changes": 0}
STEPS: dict[
    str, list[tuple[tuple[float, ...], tuple[float, ...], dict[str, float] | None]]
] = {  # of a plant: each input before and after a step, and its start
    "dc_motor": [((1.0,), (12.0,), None)],
    "dc_motor_current": [((1.0,), (12.0,), None), ((0.0,), (9.0,), None)],
    "tank": [((60.0, 5.0), (60.0, 60.0), {"tank.q": 0.2}), ((60.0, 0.0), (60.0, 70.0), {"tank.q": 0.2})],
}
JUMPS = [("dc_motor_current", "R", 0.2), ("dc_motor_current", "R", 5.0), ("dc_motor_current", "L", 0.5)]
JUMPS += [("rc", "R", 0.2), ("rc", "R", 5.0)]
FAULTY = [("dc_motor", "fault_winding.csv", 1000), ("rc", "fault_capacitor.csv", 1000)]
BURSTS = [  # of a plant: the sensor, the first row and the number of wild readings
    ("dc_motor", 0, 60, 13),
    ("dc_motor", 0, 2, 5),
    ("dc_motor", 0, 20, 8),
    ("tank", 0, 30, 30),
    ("tank", 0, 200, 30),
    ("tank", 1, 2, 8),
    ("rlc", 0, 60, 13),
    ("rlc", 0, 200, 30),
    ("rlc", 0, 8, 5),
    ("dc_motor_current", 1, 2, 5),
]
Place = tuple[str, int]  # `u` or `y`, and the column


@cache
def recorded_rows(name: str, file: str = "healthy.csv") -> tuple[Sample, ...]:
    """Samples of a recording of an example."""
    graph = graph_of(name)
    rows = read_rows(str(Path(EXAMPLES, name, file)), columns_of(graph))
    return tuple(Sample(time=p.time, dt=p.dt, u=p.u, y=p.y) for p in on_grid(rows, Grid(graph.sample_time)))


def places(name: str) -> list[Place]:
    """Every column of an example."""
    first = recorded_rows(name)[0]
    return [*(("u", k) for k in range(len(first.u))), *(("y", k) for k in range(len(first.y)))]


def wild_values(name: str, place: Place, row: int) -> dict[str, float]:
    """Values that no sensor and no input of an example shows."""
    field, column = place
    values = np.array([getattr(item, field)[column] for item in recorded_rows(name)])
    span = float(np.ptp(values))
    return {
        "10 spans above": float(values.max()) + 10.0 * span,
        "10 spans below": float(values.min()) - 10.0 * span,
        "negative": -float(values[row]),
        "1e6": 1e6,
        "1e300": -1e300,
    }


def spoiled(samples: Iterable[Sample], place: Place, rows: Iterable[int], value: float) -> list[Sample]:
    """Samples with another value in some rows of a column."""
    field, column, changed = *place, list(samples)
    for row in rows:
        values = getattr(changed[row], field).copy()
        values[column] = value
        changed[row] = replace(changed[row], **{field: values})
    return changed


@pytest.mark.parametrize(
    ("row", "labels"),
    [
        (0, ("1e6", "10 spans below")),
        (7, ("1e300", "negative")),
        (START_SAMPLES - 1, ("1e6", "10 spans above")),
        (START_SAMPLES, ("1e300", "10 spans above")),
    ],
)
@pytest.mark.parametrize("name", HEALTHY)
def test_one_wild_value_at_the_start_raises_no_alarm(name: str, row: int, labels: tuple[str, str]) -> None:
    """One wild value of any sensor or input among the first rows of a healthy plant raises no alarm."""
    core = plant(name)[2]
    for place in places(name):
        for label in labels:
            value = wild_values(name, place, row)[label]
            final, reports = run(core, spoiled(recorded_rows(name)[:70], place, [row], value))
            assert final.number("clock.detections") == 0, (place, label)
            assert final.number("clock.running"), (place, label)
            assert sum(report.wild for report in reports) <= 1, (place, label)


@pytest.mark.parametrize("name", HEALTHY)
def test_one_wild_value_later_raises_no_alarm_and_is_counted(name: str) -> None:
    """A wild value later on raises no alarm and is counted once."""
    core = plant(name)[2]
    known, _ = run(core, recorded_rows(name)[:60])
    for place in places(name):
        for label, value in wild_values(name, place, 60).items():
            final, reports = run(core, spoiled(recorded_rows(name)[:120], place, [60], value)[60:], known)
            assert final.number("clock.detections") == 0, (place, label)
            assert label == "negative" or sum(report.wild for report in reports) == 1, (place, label)


@pytest.mark.parametrize("name", HEALTHY)
def test_nothing_is_wild_in_a_recording_that_is_as_it_should_be(name: str) -> None:
    """No value of a healthy recording is refused."""
    core = plant(name)[2]
    _, reports = run(core, recorded_rows(name)[:500])
    assert sum(report.wild for report in reports) == 0


@pytest.mark.parametrize("value", [1e300, -1e6])
def test_a_burst_of_a_sensor_is_a_fault_of_that_sensor(value: float) -> None:
    """A sensor that is wild for a dozen samples, or from then on, is found at fault; no component is."""
    core = plant("dc_motor")[2]
    known, _ = run(core, recorded_rows("dc_motor")[:100])
    for length in (3, 12, 150):
        samples = spoiled(recorded_rows("dc_motor")[:250], ("y", 0), range(100, 100 + length), value)
        final, _ = run(core, samples[100:], known)
        found = final.finish()
        assert (found is not None) == (length > 3)
        assert found is None or found.candidates[0].components == ("omega",)


@pytest.mark.parametrize("value", [1e6, 100.0])
@pytest.mark.parametrize(("name", "column", "row", "length"), BURSTS)
def test_a_sensor_that_recovers_from_nonsense_blames_no_component(
    name: str, column: int, row: int, length: int, value: float
) -> None:
    """After a burst of wild readings, early or late, the sensor is at fault or nothing is; never a component."""
    core = plant(name)[2]
    rows = recorded_rows(name)[: row + length + 260]
    final, _ = run(core, spoiled(rows, ("y", column), range(row, row + length), value * rows[row].y[column]))
    found = final.finish()
    best = found.candidates[0] if found is not None else None
    assert best is None or core.spec.outputs[column].name in best.components, best


@pytest.mark.parametrize("value", [1e300, 1e6, -100.0])
def test_a_burst_of_an_input_raises_no_alarm(value: float) -> None:
    """An input that is wild for a dozen samples is held, and each value is counted."""
    core = plant("dc_motor")[2]
    known, _ = run(core, recorded_rows("dc_motor")[:100])
    samples = spoiled(recorded_rows("dc_motor")[:200], ("u", 0), range(100, 112), value)
    final, reports = run(core, samples[100:], known)
    assert final.number("clock.detections") == 0
    assert sum(report.wild for report in reports) == 12


@pytest.mark.parametrize("absent", [1, 2, 40])
def test_an_input_that_is_wild_once_and_then_missing_is_not_believed(absent: int) -> None:
    """A wild value of an input after which some values are missing is held, counted, and no part of its range."""
    core = plant("tank")[2]
    samples = spoiled(recorded_rows("tank")[:800], ("u", 0), [700], 5000.0)
    samples = spoiled(samples, ("u", 0), range(701, 701 + absent), np.nan)
    final, reports = run(core, samples)
    assert final.number("clock.detections") == 0
    assert sum(report.wild for report in reports) >= 1
    assert final.number("inputs.highest") < 200.0


@pytest.mark.parametrize("told", SPARSE)
@pytest.mark.parametrize(("name", "case"), [(name, case) for name in STEPS for case in range(len(STEPS[name]))])
def test_an_input_that_really_goes_far_is_followed(name: str, case: int, told: str) -> None:
    """An input that goes far beyond what it was raises no alarm and is not called wild, however seldom it is told."""
    graph, _, core = plant(name)
    before, after, start = STEPS[name][case]
    row = np.arange(500)
    time = np.asarray(row * (graph.sample_time or 1.0), dtype=np.float64)
    made = simulate(graph, Inputs(time=time, values=np.where(row[:, None] < 200, before, after)), seed=4, start=start)
    inputs = made.inputs.copy()
    inputs[~(row % SPARSE[told] == 0 if SPARSE[told] else np.isin(row, (0, 200)))] = np.nan
    final, reports = run(core, samples_of(time, inputs, made.outputs))
    assert final.number("clock.detections") == 0
    np.testing.assert_allclose(final.numbers("inputs.held"), after, rtol=0.2)
    assert sum(report.wild for report in reports) == 0


@pytest.mark.parametrize(("name", "parameter", "factor"), JUMPS)
def test_a_component_that_jumps_far_is_named(name: str, parameter: str, factor: float) -> None:
    """A sensor that shows at once what it never showed is no wild sensor if a component explains it."""
    core = plant(name)[2]
    samples = recorded(name, 700, Fault(parameter=parameter, factor=factor, start=400 * 0.02))
    found = run(core, samples)[0].finish()
    assert found is not None
    first = found.candidates[0]
    assert [suspect.parameter for suspect in first.suspects] == [parameter]
    assert abs(first.suspects[0].estimate / (first.suspects[0].nominal or 1.0) - factor) < 0.15 * factor


@pytest.mark.parametrize(("name", "file", "onset"), FAULTY)
def test_a_wild_value_changes_no_verdict(name: str, file: str, onset: int) -> None:
    """A fault is found as soon, and named as without it, with a wild value before or after its onset."""
    core = plant(name)[2]
    samples = recorded_rows(name, file)[: onset + 140]
    begun, _ = run(core, samples[: onset - 20])
    plain = _verdict(core, samples[onset - 20 :], begun)
    for place in places(name):
        for row in (onset - 10, onset + 100):
            value = wild_values(name, place, row)["10 spans above"]
            alarm, named = _verdict(core, spoiled(samples, place, [row], value)[onset - 20 :], begun)
            assert named == plain[1], (place, row)
            assert alarm <= plain[0] + 10, (place, row)


def _verdict(core: Core, samples: Sequence[Sample], begun: Monitor) -> tuple[float, tuple[str, ...]]:
    """The sample of the alarm, and the components of the first candidate."""
    final, _ = run(core, samples, begun)
    found = final.finish()
    assert found is not None
    return final.number("clock.alarm"), found.candidates[0].components


def sums_of(monitor: Monitor) -> FloatArray:
    """The sums of the lanes, but of what has come to stay: those are as well what the drifts have that may end now."""
    spec, plan = monitor.spec, plan_slots(monitor.spec)
    sums = monitor.numbers("bank.sums").reshape(2, len(spec.outputs), -1)
    first = plan_lanes(spec).n_lanes + PER_SET * n_grown(spec)
    return np.delete(sums, first + np.arange(plan.ramped + 1, plan.switched, 2), axis=2)


def test_where_an_input_is_unknown_nothing_is_held_against_a_hypothesis() -> None:
    """The sums of the lanes stand still while those of the alarm would: an input may be elsewhere than it is held."""
    core = plant("tank")[2]
    rows = recorded_rows("tank", "fault_pipe.csv")[:1682]
    known, _ = run(core, rows[:1668])  # no lane begins again in these samples
    assert known.number("clock.alarm") >= 0
    blind = spoiled(rows, ("u", 0), range(1668, 1682), np.nan)[1668:]
    some, _ = run(core, blind[:10], known)
    more, _ = run(core, blind, known)
    assert not some.knows_inputs
    assert np.array_equal(sums_of(more), sums_of(some))
    seen, _ = run(core, rows[1668:], known)
    assert not np.array_equal(sums_of(seen), sums_of(some))
