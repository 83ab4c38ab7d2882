"""Both methods on a recording, with the curves that the thesis' figures show."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from benchmarks.shared.play import samples, watched
from benchmarks.thesis.page import percent, set_text
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Detection, Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Simulation
from faultbond.synthesis.engine import build_engine
from faultbond.thesis.offline.build import build_classic
from faultbond.thesis.online import state as classic_state
from faultbond.thesis.online import watch as classic_watch
from faultbond.thesis.online.curves import point_of, stacked
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.settings import Settings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curves:
    """A run of `classic`.

    curves : by name of a field of `curves.Point`, a row a sample. alarm : index of the row of the alarm, None without
    """

    spec: EngineSpec
    plan: ClassicPlan
    curves: Mapping[str, FloatArray]
    detection: Detection | None
    diagnosis: Diagnosis | None
    alarm: int | None

    def __getitem__(self, name: str) -> FloatArray:
        """Give a curve."""
        return self.curves[name]

    @property
    def time(self) -> FloatArray:
        """Times of the rows, s."""
        return self.curves["time"]

    @property
    def tested(self) -> tuple[str, ...]:
        """The tested sets by name, `K1` or `K1, K6`."""
        return tuple(self.named(item) for item in self.plan.tested)

    @property
    def hypotheses(self) -> tuple[str, ...]:
        """All hypotheses by name."""
        return tuple(self.named(item) for item in self.spec.hypotheses)

    def named(self, indices: tuple[int, ...]) -> str:
        """Write a set of parameters."""
        return ", ".join(sorted(self.spec.parameters[k].name for k in indices))


def watch(
    graph: BondGraph,
    recording: Simulation,
    settings: Settings,
    healthy: Mapping[str, float] | None = None,
    start: int = 0,
    every: int = 1,
) -> Curves:
    """Pass a recording through method `classic`; if no sets are tested no alarm is raised.

    Parameters
    ----------
    graph : the model
    recording : what is watched
    settings : of the method
    healthy : parameters while healthy that are not those of the model, SI
    start : the first row that is watched
    every : a point of the curves for so many samples, and one at the alarm
    """
    spec, plan = _built(graph, settings)
    if not plan.tested:
        spec = replace(spec, thresholds=replace(spec.thresholds, warm_up_samples=recording.time.size))
    state = classic_state.init(spec, plan)
    values = healthy or {}
    state.healthy[:] = [values.get(item.name, item.nominal) for item in spec.parameters]
    points, detection, alarm = [], None, None
    for k, sample in enumerate(samples(recording)[start:], start=start):
        state, report = classic_watch.step(spec, plan, state, sample)
        if state.running > 0 and (k % every == 0 or report.detection is not None):
            points.append(point_of(spec, plan, state))
        if report.detection is not None:
            detection, alarm = report.detection, len(points) - 1
    return Curves(
        spec=spec,
        plan=plan,
        curves=stacked(points),
        detection=detection,
        diagnosis=classic_watch.finish(spec, plan, state),
        alarm=alarm,
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Banked:
    """A run of `bank`. time, expected : of each sample, (n,) and (n, n_outputs), SI."""

    time: FloatArray
    expected: FloatArray
    detection: Detection | None
    diagnoses: tuple[Diagnosis, ...]

    @property
    def times(self) -> FloatArray:
        """Times of the diagnoses, s."""
        return np.array([item.time for item in self.diagnoses])

    def probability(self, *parameters: str) -> FloatArray:
        """Give the probability of a set in each diagnosis."""
        found = (_candidate(item, parameters) for item in self.diagnoses)
        return np.array([0.0 if item is None else item.probability for item in found])

    def estimate(self, parameter: str, *others: str) -> FloatArray:
        """Give the estimate of a parameter by the set of it and others, in each diagnosis; nan where not listed."""
        found = (_candidate(item, (parameter, *others)) for item in self.diagnoses)
        return np.array(
            [np.nan if item is None else item.suspects[item.parameters.index(parameter)].estimate for item in found]
        )

    def ranking(self, count: int) -> str:
        """Give the best sets of the last diagnosis with their probabilities."""
        best = self.diagnoses[-1].candidates[:count] if self.diagnoses else ()
        return " ".join(f"{set_text(sorted(item.parameters))} {percent(item.probability)}" for item in best)


def bank(graph: BondGraph, recording: Simulation) -> Banked:
    """Pass a recording through method `bank`."""
    _, core = build_engine(graph)
    monitor, detection = Monitor(core), None
    diagnoses: list[Diagnosis | None] = []
    expected = []
    for _, _, report in watched(monitor, samples(recording)):
        expected.append(report.expected)
        detection = report.detection or detection
        diagnoses.append(report.diagnosis)
    found = tuple(item for item in (*diagnoses, monitor.finish()) if item is not None)
    return Banked(time=recording.time, expected=np.array(expected), detection=detection, diagnoses=found)


@cache
def _built(graph: BondGraph, settings: Settings) -> tuple[EngineSpec, ClassicPlan]:
    """Build the method once for all recordings."""
    return build_classic(graph, settings)


def _candidate(diagnosis: Diagnosis, parameters: Iterable[str]) -> Candidate | None:
    wanted = frozenset(parameters)
    return next((item for item in diagnosis.candidates if frozenset(item.parameters) == wanted), None)
