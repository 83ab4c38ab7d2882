"""The alarm of an asset, and what a person may do with it, by ISA-18.2 (IEC 62682).

There is one alarm for each diagnosis event: it becomes active with a detection, and returns to normal when a diagnosis
was accepted, the fault repaired, or nothing was at fault for long. That it was seen (acknowledged) is one thing, what
is made of the diagnosis another.
"""

from dataclasses import dataclass, replace
from enum import Enum

from faultbond.errors import FaultbondError
from faultbond.service.contract.messages import LONGEST_SHELF, Action, Deed


class AlarmState(Enum):
    """How an alarm stands; the value is the word for people."""

    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED = "returned to normal, unacknowledged"
    SHELVED = "shelved"
    SUPPRESSED = "suppressed by design"
    OUT_OF_SERVICE = "out of service"


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """An alarm as it stands.

    active: whether there is a detection for which nothing was accepted, and that is not over by itself. since: of the
    last change of that, on the recording's clock. acknowledged_by: who has seen it; empty where nobody has. unseen:
    whether it was active and nobody has acknowledged it since (a latch). shelved_until: by the clock of the service.
    """

    active: bool = False
    since: float | None = None
    unseen: bool = False
    acknowledged_by: str = ""
    shelved_until: float | None = None
    suppressed: bool = False
    out_of_service: bool = False

    def raised(self, time: float) -> "Alarm":
        """Give it after a detection."""
        return replace(self, active=True, since=time, unseen=True, acknowledged_by="")

    def returned(self, time: float) -> "Alarm":
        """Give it after what was detected has been accepted or repaired, or was nothing."""
        return replace(self, active=False, since=time)

    def state(self, now: float) -> AlarmState:
        """Give its state at a time by the clock of the service; what hides an alarm goes before what it would be."""
        if self.out_of_service:
            return AlarmState.OUT_OF_SERVICE
        if self.suppressed:
            return AlarmState.SUPPRESSED
        if self.is_shelved(now):
            return AlarmState.SHELVED
        if self.active:
            return AlarmState.UNACKNOWLEDGED if self.unseen else AlarmState.ACKNOWLEDGED
        return AlarmState.RETURNED if self.unseen else AlarmState.NORMAL

    def is_shelved(self, now: float) -> bool:
        """Whether it is on the shelf at a time."""
        return self.shelved_until is not None and now < self.shelved_until

    def allows(self, now: float) -> tuple[Action, ...]:
        """Give what makes sense to do with it at a time."""
        put_away = (Action.SUPPRESS if not self.suppressed else Action.UNSUPPRESS,)
        serve = (Action.OUT_OF_SERVICE if not self.out_of_service else Action.IN_SERVICE,)
        shelf = (Action.UNSHELVE if self.is_shelved(now) else Action.SHELVE,)
        return (*((Action.ACKNOWLEDGE,) if self.unseen else ()), *shelf, *put_away, *serve)

    def after(self, deed: Deed) -> "Alarm":
        """Give it after what a person did with it.

        Raises
        ------
        FaultbondError
            Where that makes no sense as it stands.
        """
        if deed.action not in self.allows(deed.at):
            raise FaultbondError(f"{deed.asset}: {_REFUSED[deed.action]}")
        match deed.action:
            case Action.ACKNOWLEDGE:
                return replace(self, unseen=False, acknowledged_by=deed.who)
            case Action.SHELVE:
                return replace(self, shelved_until=_end_of_shelf(deed))
            case Action.UNSHELVE:
                return replace(self, shelved_until=None)
            case Action.SUPPRESS | Action.UNSUPPRESS:
                return replace(self, suppressed=deed.action is Action.SUPPRESS)
            case _:
                return replace(self, out_of_service=deed.action is Action.OUT_OF_SERVICE)


def _end_of_shelf(deed: Deed) -> float:
    """Give until when an alarm is shelved; always for a limited time."""
    if deed.until is None or not 0.0 < deed.until - deed.at <= LONGEST_SHELF:
        hours = LONGEST_SHELF / 3600.0
        raise FaultbondError(f"{deed.asset}: an alarm is shelved for up to {hours:g} hours. Say for how long.")
    return deed.until


_REFUSED = {
    Action.ACKNOWLEDGE: "there is no alarm that has not been acknowledged.",
    Action.SHELVE: "its alarm is shelved already.",
    Action.UNSHELVE: "its alarm is not shelved.",
    Action.SUPPRESS: "its alarm is suppressed already.",
    Action.UNSUPPRESS: "its alarm is not suppressed.",
    Action.OUT_OF_SERVICE: "it is out of service already.",
    Action.IN_SERVICE: "it is in service already.",
}
