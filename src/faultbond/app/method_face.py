"""The face that all methods of detection and diagnosis have: a watcher takes samples and says what it sees."""

from collections.abc import Mapping
from typing import Protocol

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.contract.samples import Reports, Samples
from faultbond.contract.spec import EngineSpec

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

    def take(self, samples: Samples) -> Reports:
        """Take samples in order, one at least, up to one at which something is found; tells of those it took."""

    def finish(self) -> Diagnosis | None:
        """Give the last diagnosis, if a fault was detected."""

    def sure(self, level: float) -> int | None:
        """Tell the rule of the diagnosis that `take` gave, and give the hypothesis that it accepts now; None: none yet.

        level: probability of a candidate from which it is sure
        """

    def accept(self, hypothesis: int, *, repaired: bool = False) -> Candidate:
        """Take a hypothesis as the new healthy model, or as repaired, and give the candidate as it stood."""

    def reject(self, hypothesis: int) -> Candidate:
        """Rule a hypothesis out, and give the candidate as it stood."""

    def save(self) -> Numbers:
        """Give what is remembered, by name."""
