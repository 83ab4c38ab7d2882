"""The rule that accepts a diagnosis without a person: the same candidate has been sure for long enough.

Sure is a candidate whose set and kind of fault are, together. Where the kind stays open, as between a bias and a drift
that hardly moves, waiting longer does not help, and the next fault would be laid to the first; so a candidate whose set
alone has been sure for much longer is accepted too, with its likeliest kind.
"""

from dataclasses import dataclass

from faultbond.contract.findings import Diagnosis
from faultbond.runtime.names import is_sure

SURE_SAMPLES = 200  # for which a candidate has been the sure one before the rule accepts it
LONG_SAMPLES = 600  # for which a set has been sure before it is accepted although its kind is not


@dataclass(frozen=True, slots=True, kw_only=True)
class Sure:
    """Which hypothesis has been sure, since which sample, and since when its kind has been, too; -1: none."""

    hypothesis: int = -1
    since: int = -1
    clear_since: int = -1

    def ripe(self, sample: int) -> bool:
        """Whether it has been sure for so long that it is accepted at `sample`."""
        clear = self.clear_since >= 0 and sample - self.clear_since >= SURE_SAMPLES
        return clear or (self.since >= 0 and sample - self.since >= LONG_SAMPLES)


def sure_after(sure: Sure, diagnosis: Diagnosis, sample: int, level: float) -> Sure:
    """Give what is sure after one more diagnosis.

    Parameters
    ----------
    sure : what was sure before
    diagnosis : made at `sample`
    sample : number of the sample
    level : probability of a candidate from which it is sure
    """
    if not _set_is_sure(diagnosis, level):
        return Sure()
    best = diagnosis.candidates[0].hypothesis
    before = sure if sure.hypothesis == best else Sure(hypothesis=best, since=sample)
    if not is_sure(diagnosis, level):
        return Sure(hypothesis=best, since=before.since)
    clear = before.clear_since if before.clear_since >= 0 else sample
    return Sure(hypothesis=best, since=before.since, clear_since=clear)


def _set_is_sure(diagnosis: Diagnosis, level: float) -> bool:
    """Whether the best candidate is likely enough, whatever its kind, alone in its group, and explains the data."""
    alone = sum(item.group for item in diagnosis.candidates) == 1
    return alone and diagnosis.candidates[0].probability >= level and diagnosis.unexplained is None
