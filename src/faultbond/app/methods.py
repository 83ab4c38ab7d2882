"""The methods of detection and diagnosis: the bank, and where the other one is made."""

from dataclasses import replace

import numpy as np

from faultbond.app.engine_choice import build_watcher
from faultbond.app.method_face import Numbers, Watcher
from faultbond.arrays import BoolArray
from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.errors import RecordingError
from faultbond.model.graph import BondGraph
from faultbond.runtime.accepting import accept, reject
from faultbond.runtime.advice import Probe, advise
from faultbond.runtime.allowed import BEGIN_ANEW, fitting
from faultbond.runtime.monitor import START_PATIENCE, finish, step
from faultbond.runtime.packing import resumed
from faultbond.runtime.state import Report, Sample, State, allowed_of, init
from faultbond.types import EngineChoice, Method


class BankWatcher:
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
        return np.isfinite(self._state.normal.noise)

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


def build_method(graph: BondGraph, method: Method, choice: EngineChoice, saved: Numbers | None = None) -> Watcher:
    """Give a watcher of a plant, at its beginning, or as it was saved."""
    if method is Method.CLASSIC:
        from faultbond.app.classic import build_classic_watcher  # noqa: PLC0415 - loads casadi and sympy

        return build_classic_watcher(graph, saved)
    spec, engine = build_watcher(graph, choice)
    from faultbond.synthesis.probe import build_probe  # noqa: PLC0415 - loads casadi

    return BankWatcher(spec, engine, saved, build_probe(spec, graph))


def restored(spec: EngineSpec, saved: Numbers) -> State:
    """Give the state of the method `bank` that was saved.

    Raises
    ------
    RecordingError
        Where it does not fit the model, or has numbers that no run has.
    """
    state = State.restore(fitting(init(spec).save(), saved, allowed_of(spec)))
    clock = state.clock
    gathering = 0 if clock.running or clock.begun < 0 else clock.index - clock.begun
    if max(clock.begun, clock.alarm, clock.accepted) > clock.index or gathering > START_PATIENCE:
        raise RecordingError(f"the saved state is damaged: its samples are out of order. {BEGIN_ANEW}")
    return state
