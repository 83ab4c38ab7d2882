"""Method `classic` beside a plant: detection, diagnosis, and what must hold of any on-line part."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from faultbond import sets
from faultbond.contract.samples import Report, Sample, Status
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.thesis.offline.build import build_classic
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.ranking import reason
from faultbond.thesis.online.settings import Settings
from faultbond.thesis.online.state import ClassicState, init
from faultbond.thesis.online.watch import finish, step
from made import samples_of

EXAMPLES = Path(__file__).parents[3] / "examples"
LEAK = Fault(parameter="K6", value=1.6e-4, start=300.0)
PIPE = Fault(parameter="K1", factor=3.0, start=300.0)


@cache
def plant(name: str, settings: Settings | None = None) -> tuple[BondGraph, EngineSpec, ClassicPlan]:
    """An example with its plan."""
    graph = load_model(EXAMPLES / name / "model.yaml")
    return (graph, *build_classic(graph, settings))


@cache
def recorded(name: str, rows: int, *faults: Fault, noisy: bool = True) -> tuple[Sample, ...]:
    """Samples of a plant whose inputs step at random."""
    graph = plant(name)[0]
    dt = graph.sample_time or 1.0
    time, generator = np.asarray(np.arange(rows) * dt, dtype=np.float64), np.random.default_rng(6)
    if name == "tank":
        u = np.array([random_steps(time, generator, low=low, high=90, shortest=60, longest=90) for low in (60, 50)]).T
    else:
        u = random_steps(time, generator, low=2, high=12, shortest=40 * dt, longest=90 * dt)[:, None]
    start = {"tank.q": 0.06} if name == "tank" else None
    seed = 2 if noisy else None
    made = simulate(graph, Inputs(time=time, values=u), faults, seed=seed, start=start)
    return samples_of(time, made.inputs, made.outputs)


def run(
    spec: EngineSpec, plan: ClassicPlan, samples: Sequence[Sample], state: ClassicState | None = None
) -> tuple[ClassicState, list[Report]]:
    """The last state and all reports."""
    state, reports = state or init(spec, plan), []
    for sample in samples:
        state, report = step(spec, plan, state, sample)
        reports.append(report)
    return state, reports


@cache
def watched(rows: int, *faults: Fault) -> tuple[ClassicState, tuple[Report, ...]]:
    """The tank watched, at usual settings."""
    _, spec, plan = plant("tank")
    state, reports = run(spec, plan, recorded("tank", rows, *faults))
    return state, tuple(reports)


def test_a_healthy_plant_is_left_alone() -> None:
    """No alarm, small indices, and a prediction of every output from the first samples on."""
    _, spec, plan = plant("tank")
    state, reports = watched(500)
    assert state.alarm < 0
    assert finish(spec, plan, state) is None
    late = np.array([report.cusum for report in reports[200:]])
    assert late.max() < 0.03
    assert {report.status for report in reports[200:]} == {Status.WATCHING}
    assert np.all(np.isfinite([report.expected for report in reports[30:]]))


@pytest.mark.parametrize(("fault", "signal", "wanted"), [(PIPE, "flow", 3.0 * 2.41e11), (LEAK, "pressure", 1.6e-4)])
def test_a_fault_is_found(fault: Fault, signal: str, wanted: float) -> None:
    """The output that shows it alarms, the suspect is one of two that come first, its value the mean over supersets."""
    _, spec, plan = plant("tank")
    state, reports = watched(800, fault)
    detections = [report.detection for report in reports if report.detection is not None]
    assert len(detections) == 1
    assert detections[0].signals == (signal,)
    assert 300.0 < detections[0].time < 700.0
    assert 290.0 < detections[0].change_time < detections[0].time
    diagnosis = finish(spec, plan, state)
    assert diagnosis is not None
    best = next(item for item in diagnosis.candidates[:2] if item.parameters == (fault.parameter,))
    assert best.group
    assert best.suspects[0].estimate == pytest.approx(wanted, rel=0.15)
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0)
    index = [item.name for item in spec.parameters].index(fault.parameter)
    lanes = [k for k, chosen in enumerate(plan.tested, start=1) if index in chosen]
    assert len(lanes) == 6
    own = [state.factors[plan.tested[k - 1].index(index), k] for k in lanes]
    assert best.suspects[0].estimate == pytest.approx(spec.parameters[index].scale * np.mean(own))


def test_two_faults_are_told_from_one() -> None:
    """With pipe and leak at fault no single explains both outputs, and the pair comes before every single."""
    _, spec, plan = plant("tank")
    state, _ = watched(800, PIPE, LEAK)
    diagnosis = finish(spec, plan, state)
    assert diagnosis is not None
    names = [item.parameters for item in diagnosis.candidates]
    place = next(k for k, item in enumerate(names) if set(item) == {"K1", "K6"})
    assert place < min(k for k, item in enumerate(names) if len(item) == 1)
    found = reason(spec, plan, state)  # conflicts and what hits them, by the algebra of sets: thesis 6.4.2
    suspects = frozenset(item.name for item in spec.parameters if item.suspect)
    tested = [frozenset(spec.parameters[k].name for k in item) for item in plan.tested]
    verdicts = dict(zip(tested, map(bool, found.explains), strict=True))
    conflicts = sets.conflict_sets(suspects, verdicts)
    assert conflicts
    cleared = [suspects - item for item, explains in verdicts.items() if explains]
    hitting = sets.minimal_hitting_sets(conflicts, max_size=2)
    assert all(len(item) > 1 for item in sets.without_cleared(hitting, cleared))
    assert (found.cleared[:7] < 1.0).all()


def test_a_motor_without_noise_gives_its_new_resistance() -> None:
    """Where every state is measured and nothing is noisy, least squares find the value that was put in."""
    _, spec, plan = plant("dc_motor_current", Settings(length=1, largest=1, accuracy=0.9, noise=0.02))
    samples = recorded("dc_motor_current", 900, Fault(parameter="R", factor=2.0, start=6.0), noisy=False)
    state, _ = run(spec, plan, samples)
    diagnosis = finish(spec, plan, state)
    assert diagnosis is not None
    assert diagnosis.candidates[0].parameters == ("R",)
    assert diagnosis.candidates[0].suspects[0].estimate == pytest.approx(6.0, rel=0.02)


@pytest.mark.parametrize("name", ["dc_motor", "dc_motor_current", "rlc", "rc", "cascaded_tanks"])
def test_every_example_runs(name: str) -> None:
    """States, predictions and indices stay finite on plants of other kinds."""
    _, spec, plan = plant(name)
    state, reports = run(spec, plan, recorded(name, 300))
    assert np.all(np.isfinite(state.states))
    assert np.all(np.isfinite([report.cusum for report in reports[40:]]))


def test_missing_values_are_held_and_counted_out() -> None:
    """Absent values of sensors and inputs leave no nan behind and raise no alarm."""
    _, spec, plan = plant("tank")
    samples = list(recorded("tank", 500))
    generator = np.random.default_rng(1)
    for k in range(len(samples)):
        gone = generator.random(4) < 0.1
        if 250 <= k < 262:
            gone[2:] = True
        u, y = np.where(gone[:2], np.nan, samples[k].u), np.where(gone[2:], np.nan, samples[k].y)
        samples[k] = Sample(time=samples[k].time, dt=samples[k].dt, u=u, y=y)
    state, reports = run(spec, plan, samples)
    assert state.alarm < 0
    assert np.all(np.isfinite(state.states))
    assert np.all(np.isfinite([report.cusum for report in reports[60:]]))
    nothing = Sample(time=0.0, dt=1.0, u=np.full(2, np.nan), y=np.full(2, np.nan))
    assert step(spec, plan, init(spec, plan), nothing)[1].status is Status.WAITING


def test_what_is_absent_does_not_count() -> None:
    """While the flow is not there its error index stands still, and that of the pressure goes on."""
    _, spec, plan = plant("tank")
    samples = recorded("tank", 500)
    state, _ = run(spec, plan, samples[:300])
    sums = []
    for sample in samples[300:340]:
        state, _ = step(spec, plan, state, Sample(time=sample.time, dt=sample.dt, u=sample.u, y=sample.y * [np.nan, 1]))
        sums.append(state.sums[:, :, 0])
    gone = [k for k in range(40) if k > 8]  # before that half of the window still has flows
    assert all(np.array_equal(sums[k][:, 0], sums[9][:, 0]) for k in gone)
    assert not np.array_equal(sums[20][:, 1], sums[19][:, 1])


def test_after_a_gap_the_states_are_sought_anew() -> None:
    """Twenty samples and more without any output make monitoring begin again; no alarm follows."""
    _, spec, plan = plant("rc")
    samples = list(recorded("rc", 300))
    gone = np.array([np.nan])
    for k in range(150, 200):
        samples[k] = Sample(time=samples[k].time, dt=samples[k].dt, u=samples[k].u, y=gone)
    state, reports = run(spec, plan, samples)
    assert {report.status for report in reports[180:205]} == {Status.STARTING}
    assert reports[230].status is Status.WATCHING
    assert 80 < state.running < 100
    assert state.alarm < 0


@pytest.mark.parametrize("name", ["skab", "three_tank", "dc_motor"])
def test_nonsense_leaves_numbers(name: str) -> None:
    """Values of any size and sign, some missing, leave every number finite, and weights that add up to 1."""
    _, spec, plan = plant(name)
    generator, state = np.random.default_rng(3), init(spec, plan)
    for k in range(150):
        u, y = generator.uniform(-1, 4, len(spec.inputs)), generator.uniform(-1, 2, len(spec.outputs))
        u[generator.random(u.size) < 0.1] = np.nan
        y = y * 1e9 if k % 50 == 3 else np.full_like(y, np.nan) if k % 5 == 0 else y
        state, _ = step(spec, plan, state, Sample(time=float(k), dt=1.0, u=u, y=y))
    assert state.alarm > 0
    assert np.all(np.isfinite(state.states))
    assert np.all(np.isfinite(state.sums))
    diagnosis = finish(spec, plan, state)
    assert diagnosis is not None
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0)


def test_the_prefilter_delays() -> None:
    """The sample worked on lies half of the longest parabola back; without prefilter it is the newest."""
    _, spec, plan = plant("rc", Settings(lengths=(("V_C", 5),)))
    samples = recorded("rc", 60)
    assert plan.delay == 8  # its input has noise and is filtered as well
    state, _ = run(spec, plan, samples)
    assert state.time - state.at == pytest.approx(8.0 * samples[1].dt)
    _, spec, plan = plant("rc", Settings(length=1))
    state, _ = run(spec, plan, samples)
    assert state.time == state.at
