"""One run of the table of trust: the recording passes the monitor, and what it says is kept in few numbers."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from benchmarks.shared.plants import graph_of
from benchmarks.shared.play import EPSILON, core_with, engine_of
from benchmarks.trust.arrival import watched
from benchmarks.trust.cases import Case
from benchmarks.trust.plants import Played
from faultbond.app.classic import Classic
from faultbond.contract.findings import Diagnosis, Suspect
from faultbond.contract.samples import Report, Sample, Samples
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.runtime.names import candidate_names
from faultbond.thesis.offline.build import build_classic
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.types import Method

OPEN = 60.0  # percent
LIMIT = 2.5  # in nominals: when a drifting parameter reaches it is forecast

Seen = tuple[Sample, Report, Callable[[], Diagnosis | None]]  # what is said to a sample, and what would be said last


@dataclass(frozen=True, slots=True, kw_only=True)
class Claim:
    """What a diagnosis says `after` seconds since the alarm.

    best : probability of the best candidate; right : whether that is the true set. rank : of the true set, from 1.
    group : whether the true set is in the group, which has `size` members. error : largest relative error of the
    parameters of the true set. kind : of the true set. rate : relative error of the rate of a drift, if it has one.
    covered : whether the forecast of the moment at which the value of the end is reached covers it, if there is one.
    """

    after: float
    best: float
    right: bool
    rank: int
    group: bool
    size: int
    error: float
    kind: str
    rate: float | None = None
    covered: bool | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """One run: `delay` from the fault to the alarm, s; None without one. early: an alarm before the fault.

    looks : at the moments asked for; claims : of all diagnoses
    """

    key: str
    folder: str
    seed: int
    delay: float | None
    early: bool
    cusum: float
    unexplained: int
    looks: tuple[Claim, ...]
    claims: tuple[Claim, ...]
    method: str = Method.BANK.value


def play(case: Case, seed: int, method: Method = Method.BANK) -> Run:
    """Simulate and watch."""
    made = case.make(seed)
    patience, detection, last = _Patience(case), None, None
    diagnoses: list[Diagnosis] = []
    cusum = 0.0
    for sample, report, finished in (_by_classic if method is Method.CLASSIC else _by_bank)(made):
        if sample.time < made.onset:
            cusum = float(np.fmax(cusum, np.nan_to_num(report.cusum).max()))
        detection = report.detection or detection
        diagnoses += [report.diagnosis] if report.diagnosis is not None else []
        if detection is not None:
            last = finished
            if patience.ends(sample, detection.time):
                break
    final = last() if last is not None else None
    diagnoses += [final] if final is not None else []
    early, looks = detection is not None and detection.time < made.onset, []
    claims: tuple[Claim, ...] = ()
    if detection is not None and not early:
        claims = tuple(_claim(made, item, detection.time) for item in diagnoses)
    for after in case.looks if claims else ():
        waited = case.waits and after == max(case.looks)
        seen = [item for item in claims if item.after <= after + EPSILON]
        looks.append(claims[-1] if waited or not seen else seen[-1])
    return Run(
        key=case.key,
        folder=made.folder,
        seed=seed,
        delay=detection.time - made.onset if detection is not None and not early else None,
        early=early,
        cusum=cusum,
        unexplained=sum(item.unexplained is not None for item in diagnoses),
        looks=tuple(looks),
        claims=claims,
        method=method.value,
    )


def _by_bank(made: Played) -> Iterator[Seen]:
    core = _limited(made.folder, made.suspects) if made.rate else engine_of(made.folder)[1]
    for sample, monitor, report in watched(Monitor(core), made):
        yield sample, report, monitor.finish


@cache
def _limited(folder: str, names: frozenset[str]) -> Core:
    """Give the core of an example with a limit for parameters that drift."""

    def limited(spec: EngineSpec) -> EngineSpec:
        items = spec.parameters
        new = (replace(item, limits=(LIMIT * item.nominal,)) if item.name in names else item for item in items)
        return replace(spec, parameters=tuple(new))

    return core_with(graph_of(folder), limited)


def _by_classic(made: Played) -> Iterator[Seen]:
    """Watch by the thesis' method; rows come as they were measured."""
    watcher, steps = Classic(*_classic_of(made.folder)), np.diff(made.time, prepend=made.time[0])
    rows = Samples(time=made.time, dt=steps, u=made.inputs, y=made.outputs)
    for k in range(len(rows)):
        one = rows[k : k + 1]
        yield one.first, watcher.take(one).last, watcher.finish


@cache
def _classic_of(folder: str) -> tuple[EngineSpec, ClassicPlan]:
    return build_classic(graph_of(folder))


class _Patience:
    """How long a run is watched after its alarm.

    Parameters
    ----------
    case : whose last look is waited for
    """

    def __init__(self, case: Case) -> None:
        self._case = case
        self._until = max(case.looks, default=0.0)
        self._opened, self._moved, self._outlet = 0.0, np.inf, np.nan

    def ends(self, sample: Sample, alarm: float) -> bool:
        """Take a sample after the alarm, and tell whether it is the last one."""
        case = self._case
        if not case.waits:
            return sample.time >= alarm + self._until - EPSILON
        inlet, outlet = sample.u
        self._opened += sample.dt * float(inlet >= OPEN)
        if abs(outlet - self._outlet) > 0.0:  # not of the first one
            self._moved = min(self._moved, sample.time)
        self._outlet = outlet if np.isfinite(outlet) else self._outlet
        settled = case.settled is None or sample.time >= self._moved + case.settled
        return settled and self._opened >= case.opened and sample.time >= alarm + self._until - EPSILON


def _claim(made: Played, diagnosis: Diagnosis, alarm: float) -> Claim:
    sets = [candidate_names(item) for item in diagnosis.candidates]
    place = sets.index(made.suspects) if made.suspects in sets else len(sets)
    best = diagnosis.candidates[0]
    true = diagnosis.candidates[place] if place < len(sets) else None
    error, rate, covered = float("inf"), None, None
    if true is not None and made.values:
        ahead = float(made.time[-1]) - diagnosis.time  # of a drift, the true value is that of the moment
        error = max(
            abs(item.estimate / (made.values[item.parameter] - made.rate * ahead) - 1.0) for item in true.suspects
        )
        moving = true.suspects[0]
        if made.rate and moving.rate is not None:
            rate = abs(moving.rate / made.rate - 1.0)
            covered = _covered(made, moving)
    return Claim(
        after=diagnosis.time - alarm,
        best=best.probability,
        right=place == 0,
        rank=place + 1,
        group=true is not None and true.group,
        size=sum(item.group for item in diagnosis.candidates),
        error=error,
        kind=true.kind.value if true is not None else "",
        rate=rate,
        covered=covered,
    )


def _covered(made: Played, moving: Suspect) -> bool:
    """Whether the forecast of when the limit is reached covers the moment at which it will be."""
    (found,) = moving.forecasts
    end = float(made.time[-1]) + (found.limit - made.values[moving.parameter]) / made.rate
    early = found.earliest is None or found.earliest > end
    late = found.latest is not None and found.latest < end
    return not early and not late
