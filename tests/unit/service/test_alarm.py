"""The alarm of an asset by ISA-18.2: which states follow which, and that nothing stays hidden for ever by mistake."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultbond.errors import FaultbondError
from faultbond.service.alarm import Alarm, AlarmState
from faultbond.service.contract.messages import LONGEST_SHELF, Action, Deed

ALARM_ACTIONS = (*Alarm(unseen=True).allows(0.0), Action.UNSHELVE, Action.UNSUPPRESS, Action.IN_SERVICE)


def deed(action: Action, at: float = 0.0, minutes: float | None = None) -> Deed:
    """Give a deed of somebody."""
    until = None if minutes is None else at + 60.0 * minutes
    return Deed(asset="pump", action=action, at=at, who="anna", rows=0, until=until)


def test_an_alarm_is_raised_seen_and_returns() -> None:
    """The usual way of an alarm."""
    states = [alarm := Alarm(), alarm := alarm.raised(5.0), alarm := alarm.after(deed(Action.ACKNOWLEDGE))]
    states.append(alarm.returned(9.0))
    assert [item.state(0.0) for item in states] == [
        AlarmState.NORMAL,
        AlarmState.UNACKNOWLEDGED,
        AlarmState.ACKNOWLEDGED,
        AlarmState.NORMAL,
    ]
    assert (states[-1].since, states[-1].acknowledged_by) == (9.0, "anna")


def test_what_nobody_saw_stays_until_somebody_does() -> None:
    """An alarm that returned by itself is still to be acknowledged, and a new one is unseen whoever saw the last."""
    alarm = Alarm().raised(5.0).returned(6.0)
    assert alarm.state(0.0) is AlarmState.RETURNED
    seen = alarm.after(deed(Action.ACKNOWLEDGE))
    assert seen.state(0.0) is AlarmState.NORMAL
    assert seen.raised(7.0).state(0.0) is AlarmState.UNACKNOWLEDGED
    assert seen.raised(7.0).acknowledged_by == ""


def test_a_shelf_has_an_end() -> None:
    """Shelved for ten minutes, it is back after ten minutes, and no shelf is without end or longer than a day."""
    alarm = Alarm().raised(5.0).after(deed(Action.SHELVE, at=100.0, minutes=10.0))
    assert [alarm.state(now) for now in (100.0, 699.0, 700.0)] == [AlarmState.SHELVED] * 2 + [AlarmState.UNACKNOWLEDGED]
    for minutes in (None, 0.0, -1.0, LONGEST_SHELF / 60.0 + 1.0, float("nan")):
        with pytest.raises(FaultbondError, match="pump: an alarm is shelved for up to 24 hours"):
            Alarm().after(deed(Action.SHELVE, minutes=minutes))


@pytest.mark.parametrize(
    ("action", "words"),
    [
        (Action.ACKNOWLEDGE, "there is no alarm that has not been acknowledged"),
        (Action.UNSHELVE, "is not shelved"),
        (Action.UNSUPPRESS, "is not suppressed"),
        (Action.IN_SERVICE, "is in service already"),
    ],
)
def test_what_makes_no_sense_is_refused(action: Action, words: str) -> None:
    """Of an alarm at rest."""
    with pytest.raises(FaultbondError, match=f"pump: .*{words}"):
        Alarm().after(deed(action))


@given(st.lists(st.one_of(st.sampled_from(ALARM_ACTIONS), st.sampled_from(["raise", "return"])), max_size=30))
def test_whatever_is_done_it_can_be_seen_again(steps: list[object]) -> None:
    """After anything at all, undoing what hides it shows an active alarm; refused deeds change nothing."""
    alarm, active = Alarm(), False
    for k, step in enumerate(steps):
        now = 60.0 * k
        if isinstance(step, Action):
            allowed = step in alarm.allows(now)
            try:
                after = alarm.after(deed(step, at=now, minutes=5.0))
            except FaultbondError:
                assert not allowed
            else:
                assert allowed
                assert after.active == active
                alarm = after
        else:
            active = step == "raise"
            alarm = alarm.raised(now) if active else alarm.returned(now)
    now = 1e6
    for hidden, action in (("suppressed", Action.UNSUPPRESS), ("out_of_service", Action.IN_SERVICE)):
        if getattr(alarm, hidden):
            alarm = alarm.after(deed(action, at=now))
    shown = alarm.state(now)
    assert (shown in {AlarmState.UNACKNOWLEDGED, AlarmState.ACKNOWLEDGED}) == active
