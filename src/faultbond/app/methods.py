"""The methods of detection and diagnosis, all with the same face: a watcher takes samples and says what it sees."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Protocol

import numpy as np

from faultbond.app.engines import build_watcher
from faultbond.app.rows import resumed
from faultbond.errors import RecordingError, StructureError
from faultbond.model.graph import BondGraph
from faultbond.runtime.accepting import accept, reject
from faultbond.runtime.advice import Probe, advise
from faultbond.runtime.allowed import BEGIN_ANEW, fitting
from faultbond.runtime.classic import deciding
from faultbond.runtime.classic import state as classic
from faultbond.runtime.classic import watch as classic_watch
from faultbond.runtime.classic.plan import ClassicPlan
from faultbond.runtime.classic.ranking import current_limits
from faultbond.runtime.classic.state import ClassicState
from faultbond.runtime.history import Candidate, Diagnosis
from faultbond.runtime.monitor import START_PATIENCE, finish, step
from faultbond.runtime.state import Report, Sample, State, allowed_of, init
from faultbond.spec import Engine, EngineSpec
from faultbond.types import BoolArray, EngineChoice, FloatArray, Method

Numbers = Mapping[str, FloatArray]


class Watcher(Protocol):
    """A method at work on a plant; it holds what it remembers."""

    @property
    def spec(self) -> EngineSpec:
        """The model."""

    @property
    def title(self) -> str:
        """The engine, in words."""

    @property
    def asleep(self) -> int:
        """Samples after the start for which the alarms are off."""

    @property
    def lag(self) -> int:
        """Samples by which a report is about an earlier one."""

    @property
    def in_use(self) -> BoolArray:
        """Which sensors are used, (n_outputs,); one that was accepted as stuck is not."""

    def resume(self) -> None:
        """Expect a sample after a time of unknown length."""

    def step(self, sample: Sample) -> Report:
        """Take one sample."""

    def finish(self) -> Diagnosis | None:
        """Give the last diagnosis, if a fault was detected."""

    def accept(self, hypothesis: int) -> Candidate:
        """Take a hypothesis as the new healthy model, and give the candidate as it stood."""

    def reject(self, hypothesis: int) -> Candidate:
        """Rule a hypothesis out, and give the candidate as it stood."""

    def save(self) -> Numbers:
        """Give what is remembered, by name."""


class Bank:
    """The method `bank`.

    Parameters
    ----------
    spec, engine : the model
    saved : what another watcher saved; None begins anew
    probe : gives what candidates expect of signals that are measured by hand
    """

    def __init__(
        self, spec: EngineSpec, engine: Engine, saved: Numbers | None = None, probe: Probe | None = None
    ) -> None:
        self.spec = spec
        self.title = engine.title
        self.asleep, self.lag = spec.thresholds.warm_up_samples, 0
        self._engine = engine
        self._probe = probe
        self._state = init(spec) if saved is None else restored(spec, saved)

    @property
    def in_use(self) -> BoolArray:
        """Which sensors are used."""
        return np.isfinite(self._state.reading_noise)

    def resume(self) -> None:
        """Expect a sample after a time of unknown length."""
        self._state = resumed(self._state)

    def step(self, sample: Sample) -> Report:
        """Take one sample."""
        with np.errstate(all="ignore"):  # of filters that run away, numbers without end are a defined outcome
            self._state, report = step(self.spec, self._engine, self._state, sample)
            return replace(report, diagnosis=self._advised(report.diagnosis))

    def finish(self) -> Diagnosis | None:
        """Give the last diagnosis, if a fault was detected."""
        with np.errstate(all="ignore"):
            return self._advised(finish(self.spec, self._state))

    def _advised(self, diagnosis: Diagnosis | None) -> Diagnosis | None:
        """Add what to do next."""
        if diagnosis is None:
            return None
        return replace(diagnosis, advice=advise(self.spec, self._engine, self._state, diagnosis, self._probe))

    def accept(self, hypothesis: int) -> Candidate:
        """Take a hypothesis as the new healthy model, and give the candidate as it stood."""
        self._state, candidate = accept(self.spec, self._state, hypothesis)
        return candidate

    def reject(self, hypothesis: int) -> Candidate:
        """Rule a hypothesis out, and give the candidate as it stood."""
        self._state, candidate = reject(self.spec, self._state, hypothesis)
        return candidate

    def save(self) -> Numbers:
        """Give what is remembered, by name."""
        return self._state.save()


class Classic:
    """The method `classic`, that of the thesis.

    Parameters
    ----------
    spec, plan : the model
    saved : what another watcher saved; None begins anew
    """

    def __init__(self, spec: EngineSpec, plan: ClassicPlan, saved: Numbers | None = None) -> None:
        self.spec = spec
        self.title = f"the thesis' algorithms, {len(plan.formulas)} functions"
        self.asleep, self.lag = plan.delay + plan.depth + spec.thresholds.warm_up_samples, plan.delay
        self.in_use: BoolArray = np.ones(len(spec.outputs), dtype=bool)
        self._plan = plan
        fresh = classic.init(spec, plan)
        self._state = fresh if saved is None else ClassicState.restore(fitting(fresh.save(), saved, classic.ALLOWED))

    def resume(self) -> None:
        """Expect a sample after a time of unknown length."""
        self._state = deciding.resumed(self._state)

    def step(self, sample: Sample) -> Report:
        """Take one sample; the statistic is that part of its limit which it is of the bank's."""
        self._state, report = classic_watch.step(self.spec, self._plan, self._state, sample)
        limits = current_limits(self.spec, self._plan, self._state)
        return replace(report, cusum=report.cusum / limits * self.spec.thresholds.cusum_limit)

    def finish(self) -> Diagnosis | None:
        """Give the last diagnosis, if a fault was detected."""
        return classic_watch.finish(self.spec, self._plan, self._state)

    def accept(self, hypothesis: int) -> Candidate:
        """Take a hypothesis as the new healthy model, and give the candidate as it stood."""
        self._state, candidate = deciding.accept(self.spec, self._plan, self._state, hypothesis)
        return candidate

    def reject(self, hypothesis: int) -> Candidate:
        """Rule a hypothesis out, and give the candidate as it stood."""
        self._state, candidate = deciding.reject(self.spec, self._plan, self._state, hypothesis)
        return candidate

    def save(self) -> Numbers:
        """Give what is remembered, by name."""
        return self._state.save()


def build_method(graph: BondGraph, method: Method, choice: EngineChoice, saved: Numbers | None = None) -> Watcher:
    """Give a watcher of a plant, at its beginning, or as it was saved."""
    if method is Method.CLASSIC:
        from faultbond.synthesis.classic.build import build_classic  # noqa: PLC0415 - loads casadi and sympy

        spec, plan = build_classic(graph)
        if not plan.tested:
            raise StructureError(f"{graph.file}: method `classic` tests sets of parameters, and none is a suspect")
        return Classic(spec, plan, saved)
    spec, engine = build_watcher(graph, choice)
    from faultbond.synthesis.probe import build_probe  # noqa: PLC0415 - loads casadi

    return Bank(spec, engine, saved, build_probe(spec, graph))


def restored(spec: EngineSpec, saved: Numbers) -> State:
    """Give the state of the method `bank` that was saved.

    Raises
    ------
    RecordingError
        Where it does not fit the model, or has numbers that no run has.
    """
    state = State.restore(fitting(init(spec).save(), saved, allowed_of(spec)))
    gathering = 0 if state.running or state.begun < 0 else state.index - state.begun
    if max(state.begun, state.alarm, state.accepted) > state.index or gathering > START_PATIENCE:
        raise RecordingError(f"the saved state is damaged: its samples are out of order. {BEGIN_ANEW}")
    return state
