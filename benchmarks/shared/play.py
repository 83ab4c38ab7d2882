"""One simulated run, and what the monitor makes of it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np

from benchmarks.shared.plants import EXAMPLES, case
from benchmarks.shared.variants import effort_or_flow_goes_on
from benchmarks.trust.scenarios import END, Scenario
from faultbond.contract.findings import Candidate, Detection, Diagnosis
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.model.text import load_model
from faultbond.runtime.monitor import finish, step
from faultbond.runtime.state import Sample, init
from faultbond.simulate import Fault, Simulation
from faultbond.synthesis.engine import build_engine

OPEN = 60.0  # percent: a valve as open as this shows what is wrong with the pipe
_EPSILON = 1e-9  # s


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """The last ranking at or before `after` seconds past the alarm (None: at the end of the recording).

    rank of the true set, 1 for the first; its probability, whether it is in the group of those that cannot be told
    apart yet, the largest relative error of its parameters; the set that is first, and its probability.
    """

    after: float | None
    rank: int
    probability: float
    group: bool
    error: float
    winner: str
    winner_probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One run. Times in s; `alarm` and `delay` are None without an alarm, `onset` without a fault.

    counted_from : moment from which the delay is counted
    early : whether the alarm came before the fault
    cusum, slow : largest CUSUM and slow error (in declared sd) before the fault
    """

    key: str
    seed: int
    onset: float | None
    counted_from: float | None
    alarm: float | None
    delay: float | None
    early: bool
    cusum: float
    slow: float
    readings: tuple[Reading, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Watched:
    """What a monitor made of a recording; `cusum` and `slow` as in `Outcome`."""

    detection: Detection | None
    diagnoses: tuple[Diagnosis, ...]
    cusum: float
    slow: float


# specification, engine, recording, onset (s; None: no fault), and for how many s after the alarm
Watch = Callable[[EngineSpec, Engine, Simulation, float | None, float], Watched]


@cache
def engine_of(folder: str) -> tuple[EngineSpec, Engine]:
    """Give specification and engine of an example, built once per process."""
    return build_engine(load_model(EXAMPLES / folder / "model.yaml"))


def watch(spec: EngineSpec, engine: Engine, recording: Simulation, onset: float | None, until: float) -> Watched:
    """Pass a recording through the monitor, up to `until` seconds after the alarm."""
    state, detection = init(spec), None
    diagnoses: list[Diagnosis] = []
    cusum = slow = 0.0
    steps = np.diff(recording.time, prepend=recording.time[0])
    for time, dt, u, y in zip(recording.time, steps, recording.inputs, recording.outputs, strict=True):
        if detection is not None and time > detection.time + until + _EPSILON:
            break
        state, report = step(spec, engine, state, Sample(time=float(time), dt=float(dt), u=u, y=y))
        if onset is None or time < onset:
            cusum = float(np.fmax(cusum, np.nan_to_num(report.cusum).max()))
            alarming = [abs(value) for value, error in zip(report.slow, spec.slow_errors, strict=True) if error.alarms]
            slow = float(np.fmax(slow, np.nan_to_num(max(alarming, default=0.0))))
        detection = report.detection or detection
        if report.diagnosis is not None:
            diagnoses.append(report.diagnosis)
    last = finish(spec, state)
    if last is not None:
        diagnoses.append(last)
    return Watched(detection=detection, diagnoses=tuple(diagnoses), cusum=cusum, slow=slow)


def play(scenario: Scenario, seed: int, watch: Watch = watch) -> Outcome:
    """Simulate one run and watch it, with our monitor or another."""
    onset = float(np.random.default_rng([seed, 7]).uniform(*scenario.onset)) if scenario.faults else None
    faults = [Fault(parameter=name, factor=factor, start=onset or 0.0) for name, factor in scenario.faults]
    plant = effort_or_flow_goes_on(scenario.folder) if scenario.goes_on else None
    recording = case(scenario.folder, seed, faults, seconds=scenario.seconds, plant=plant).recording
    spec, engine = engine_of(scenario.folder)
    watched = watch(spec, engine, recording, onset, max(scenario.looks, default=0.0))
    alarm = watched.detection.time if watched.detection is not None else None
    begin = _opening(spec, recording, onset or 0.0) if scenario.from_opening else onset
    early = alarm is not None and (onset is None or alarm < onset)
    counts = alarm is not None and begin is not None and not early
    return Outcome(
        key=scenario.key,
        seed=seed,
        onset=onset,
        counted_from=begin,
        alarm=alarm,
        delay=max(alarm - begin, 0.0) if counts and alarm is not None and begin is not None else None,
        early=early,
        cusum=watched.cusum,
        slow=watched.slow,
        readings=_readings(scenario, spec, recording, alarm, watched.diagnoses) if counts and alarm is not None else (),
    )


def _opening(spec: EngineSpec, recording: Simulation, onset: float) -> float | None:
    """Give the first moment from the onset on at which u_in is wide open; None where it never is."""
    column = [item.name for item in spec.inputs].index("u_in")
    open_wide = recording.inputs[:, column] >= OPEN
    already = open_wide[np.searchsorted(recording.time, onset, side="right") - 1]
    later = recording.time[open_wide & (recording.time >= onset)]
    return onset if already else float(later[0]) if later.size else None


def _readings(
    scenario: Scenario, spec: EngineSpec, recording: Simulation, alarm: float, diagnoses: tuple[Diagnosis, ...]
) -> tuple[Reading, ...]:
    truth = {name: recording.parameters[-1, _place(spec, name)] for name, _ in scenario.faults}
    readings = []
    for after in scenario.looks:
        seen = [item for item in diagnoses if item.time <= alarm + after + _EPSILON]
        readings.append(_reading(seen[-1], truth, None if after == END else after))
    return tuple(readings)


def _place(spec: EngineSpec, name: str) -> int:
    return [item.name for item in spec.parameters].index(name)


def _reading(diagnosis: Diagnosis, truth: dict[str, float], after: float | None) -> Reading:
    wanted = frozenset(truth)
    sets = [frozenset(candidate.parameters) for candidate in diagnosis.candidates]
    rank = sets.index(wanted)  # no example has more sets than a diagnosis lists
    found, best = diagnosis.candidates[rank], diagnosis.candidates[0]
    return Reading(
        after=after,
        rank=rank + 1,
        probability=found.probability,
        group=found.group,
        error=float(max(abs(item.estimate / truth[item.parameter] - 1.0) for item in found.suspects)),
        winner=_named(best),
        winner_probability=best.probability,
    )


def _named(candidate: Candidate) -> str:
    return "+".join(candidate.parameters)
