"""What the page is shown of an asset, beside what its own tests see."""

from collections.abc import Mapping
from typing import Any

from faultbond.report.numbers import NO_BREAK
from faultbond.service.contract.messages import Action, Deed, NamedRecord
from faultbond.service.shown import EVENTS, events_of


def told(kind: str, time: float, content: Mapping[str, Any]) -> NamedRecord:
    """Give a record."""
    content = {"record": kind, "time": time, **content}
    return NamedRecord(id=f"tank/{time}", asset="tank", sample=int(time), time=time, kind=kind, content=content)


def test_events_are_alarms_and_how_they_ended() -> None:
    """Each tells behind which deed it came; what a person accepted is a deed, and no event."""
    walk = {"parameter": "K1", "sd": 4.0, "from_start": False, "together": False}
    pipe = {"components": ["pipe"], "probability": 0.993, "repaired": False}
    deed = Deed(asset="tank", action=Action.ACKNOWLEDGE, at=5e8, who="anna", rows=1404, number=7)
    journal: list[NamedRecord | Deed] = [
        told("detection", 1404.0, {"signals": ["flow", "pressure"]}),
        deed,
        told("accepted", 1504.0, {**pipe, "by": "rule"}),
        told("detection", 1604.0, {"signals": [], "walk": walk}),
        told("accepted", 1704.0, {**pipe, "by": "person"}),
        told("detection", 1804.0, {"signals": ["flow"]}),
        told("accepted", 1904.0, {"components": [], "probability": 0.97, "repaired": False, "by": "rule"}),
    ]
    assert {item.kind for item in journal if isinstance(item, NamedRecord)} == set(EVENTS)
    ended = f"Alarm ended: a rule accepted pipe (99.3{NO_BREAK}%)."
    by_itself = "Alarm ended by itself: for long nothing was further off than healthy parts may be."
    assert events_of(journal) == [
        {"time": 1904.0, "text": by_itself, "alarm": False, "behind": 7},
        {"time": 1804.0, "text": "Alarm raised, seen in flow.", "alarm": True, "behind": 7},
        {"time": 1604.0, "text": "Alarm raised, as K1 had to move too far.", "alarm": True, "behind": 7},
        {"time": 1504.0, "text": ended, "alarm": False, "behind": 7},
        {"time": 1404.0, "text": "Alarm raised, seen in flow and pressure.", "alarm": True, "behind": 0},
    ]
