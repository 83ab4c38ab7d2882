"""The rule that accepts a diagnosis without a person: the same candidate has been sure for long enough."""

from dataclasses import dataclass

from faultbond.runtime.accepting import SURE_SAMPLES, is_sure
from faultbond.runtime.history import Diagnosis


@dataclass(frozen=True, slots=True, kw_only=True)
class Sure:
    """Which hypothesis has been sure, and since which sample; -1: none."""

    hypothesis: int = -1
    since: int = -1

    def ripe(self, sample: int) -> bool:
        """Whether it has been sure for so long that it is accepted at `sample`."""
        return self.hypothesis >= 0 and sample - self.since >= SURE_SAMPLES


def watch(sure: Sure, diagnosis: Diagnosis, sample: int, level: float) -> Sure:
    """Give what is sure after one more diagnosis.

    Parameters
    ----------
    sure : what was sure before
    diagnosis : made at `sample`
    sample : number of the sample
    level : probability of a candidate and its kind from which it is sure
    """
    if not is_sure(diagnosis, level):
        return Sure()
    best = diagnosis.candidates[0].hypothesis
    return sure if sure.hypothesis == best else Sure(hypothesis=best, since=sample)
