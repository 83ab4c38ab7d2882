"""The methods of detection and diagnosis: the bank, and where the other one is made."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from faultbond.app.engine import build_watcher
from faultbond.app.method_face import Numbers, Watcher
from faultbond.app.plant import load_prepared
from faultbond.arrays import BoolArray
from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.contract.samples import Reports, Samples
from faultbond.errors import RecordingError
from faultbond.io.prepared import Identity, Prepared
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import BEGIN_ANEW, Monitor
from faultbond.types import Method

_STATE = "state"  # name of what the core saves


class BankWatcher:
    """The method `bank`.

    Parameters
    ----------
    core : of the model
    saved : what another watcher saved; None begins anew
    only_alarms : whether the first alarm is the end, and nothing is named
    """

    def __init__(self, core: Core, saved: Numbers | None = None, *, only_alarms: bool = False) -> None:
        self.spec = core.spec
        self.title = core.title
        self.asleep, self.lag = core.spec.thresholds.warm_up_samples, 0
        self._monitor = Monitor(core, None if saved is None else _state_of(saved), only_alarms=only_alarms)

    @property
    def core(self) -> Core:
        """The core of the model."""
        return self._monitor.core

    def unnamed(self) -> "BankWatcher":
        """Give another watcher of the same plant, at its beginning, which names nothing, for which it takes no time."""
        return BankWatcher(self._monitor.core, only_alarms=True)

    @property
    def in_use(self) -> BoolArray:
        """Which sensors are used, (n_outputs,)."""
        return self._monitor.in_use

    def resume(self) -> None:
        """Expect a sample after a time of unknown length."""
        self._monitor.resume()

    def take(self, samples: Samples) -> Reports:
        """Take samples in order, one at least, up to one at which something is found; tells of those it took."""
        reports = self._monitor.take(samples)
        found = reports.diagnosis
        return reports if found is None else replace(reports, diagnosis=self._advised(self._monitor, found))

    def finish(self) -> Diagnosis | None:
        """Give the last diagnosis, if a fault was detected."""
        ended = self._monitor.copy()  # the run may go on, as if it had not been asked
        return None if ended.number("clock.alarm") < 0 else self._advised(ended, ended.conclude())

    def _advised(self, monitor: Monitor, diagnosis: Diagnosis) -> Diagnosis:
        """Add what to do next."""
        return replace(diagnosis, advice=monitor.advise())

    def sure(self, level: float) -> int | None:
        """Tell the rule of the diagnosis that was due, and give the hypothesis that it accepts now; None: none yet."""
        return self._monitor.sure(level)

    def accept(self, hypothesis: int, *, repaired: bool = False) -> Candidate:
        """Take a hypothesis as the new healthy model, or as repaired, and give the candidate as it stood."""
        return self._monitor.accept(hypothesis, repaired=repaired)

    def reject(self, hypothesis: int) -> Candidate:
        """Rule a hypothesis out, and give the candidate as it stood."""
        return self._monitor.reject(hypothesis)

    def save(self) -> Numbers:
        """Give what is remembered, by name."""
        return {_STATE: self._monitor.save().view(np.float64)}  # whole words


def _state_of(saved: Numbers) -> NDArray[np.uint8]:
    """Give the state of the method `bank` among what was saved.

    Raises
    ------
    RecordingError
        Where another version saved it.
    """
    if set(saved) != {_STATE} or saved[_STATE].ndim != 1:
        raise RecordingError(f"the saved state was made by another version of faultbond. {BEGIN_ANEW}")
    return np.ascontiguousarray(saved[_STATE]).view(np.uint8)


def build_method(
    graph: BondGraph, method: Method, saved: Numbers | None = None, identity: Identity | None = None
) -> Watcher:
    """Give a watcher of a plant, at its beginning, or as it was saved; see `build_watcher` of its identity."""
    if method is Method.CLASSIC:
        from faultbond.app.classic import build_classic_watcher  # noqa: PLC0415 - loads casadi and sympy

        return build_classic_watcher(graph, saved)
    return BankWatcher(build_watcher(graph, identity), saved)


def prepared_bank(prepared: Prepared, saved: Numbers | None = None) -> BankWatcher:
    """Give the method `bank` of a plant that the cache knows, at its beginning, or as it was saved.

    Raises
    ------
    GenerationError
        Where its core cannot be loaded.
    """
    return BankWatcher(load_prepared(prepared), saved)
