"""The rule that accepts a diagnosis without a person, the same as that of `core/rule.h`: this method has no core.

It needs no compiler, so the rule stands here once more; a test holds both together.
"""

from dataclasses import replace

from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import Diagnosis
from faultbond.runtime.names import is_sure
from faultbond.thesis.online.state import ClassicState, with_nothing_sure


def take_diagnosis(state: ClassicState, diagnosis: Diagnosis, level: float) -> tuple[ClassicState, int | None]:
    """Take a diagnosis; give the state, and the hypothesis that has been sure for so long that it is accepted now.

    Parameters
    ----------
    state : after the sample of the diagnosis
    diagnosis : of that sample
    level : probability of a candidate from which it is sure
    """
    if not _set_is_sure(diagnosis, level):
        return with_nothing_sure(state), None
    settings, sample, best = core_settings(), state.index - 1, diagnosis.candidates[0].hypothesis
    before = state if state.sure == best else replace(state, sure=best, sure_since=sample, clear_since=-1)
    clear_since = -1
    if is_sure(diagnosis, level):
        clear_since = before.clear_since if before.clear_since >= 0 else sample
    clear = clear_since >= 0 and sample - clear_since >= settings["SURE_SAMPLES"]
    ripe = clear or sample - before.sure_since >= settings["LONG_SAMPLES"]
    return replace(before, clear_since=clear_since), best if ripe else None


def _set_is_sure(diagnosis: Diagnosis, level: float) -> bool:
    """Whether the best candidate is likely enough, whatever its kind, alone in its group, and explains the data."""
    alone = sum(item.group for item in diagnosis.candidates) == 1
    return alone and diagnosis.candidates[0].probability >= level and diagnosis.unexplained is None
