"""Parts that fail: when they are begun anew, when they are given up, and what is told of it."""

import asyncio
import logging
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultbond.service.contract.part import ServicePart
from faultbond.service.supervisor import RestartPolicy, supervise

QUICK = RestartPolicy(most=2, within=10.0, delay=0.001, longest=0.002)
ascending = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=12).map(sorted)


@given(ascending, st.integers(0, 6), st.floats(0.1, 1e5))
def test_no_more_restarts_in_any_window(failures: Sequence[float], most: int, within: float) -> None:
    """A failure is the last one exactly where more than `most` others came before it within the time."""
    delay = RestartPolicy(most=most, within=within).delay_after(failures)
    others = sum(failures[-1] - at <= within for at in failures[:-1])
    assert (delay is None) == (others >= most)


@given(ascending, st.integers(1, 6))
def test_delays_grow_to_a_longest_one(failures: Sequence[float], n: int) -> None:
    """Each failure in a row waits for twice as long; one that was alone for long waits for the shortest time."""
    policy = RestartPolicy(most=20, within=1e9, delay=1.0, longest=8.0)
    assert policy.delay_after(failures) == min(2.0 ** (len(failures) - 1), 8.0)
    alone = RestartPolicy(most=n, within=1.0, delay=0.5, longest=8.0)
    assert alone.delay_after([*failures, failures[-1] + 2.0]) == 0.5


class Work:
    """Fails so many times, then ends. fails_at: at which of its calls, by different lines."""

    def __init__(self, failures: int, now: list[float], every: float = 1.0) -> None:
        self.failures, self.now, self.every, self.begun = failures, now, every, 0

    async def __call__(self) -> None:
        self.begun += 1
        self.now[0] += self.every
        if self.begun <= self.failures:
            raise KeyError(f"number {self.begun}")


def supervised(work: Work, policy: RestartPolicy = QUICK) -> ServicePart:
    """Let a work be done, by its own clock."""
    part = ServicePart(name="sink", since=0.0)
    asyncio.run(supervise(work, part, policy=policy, clock=lambda: 100.0 + work.now[0], steady=lambda: work.now[0]))
    return part


def test_a_work_that_fails_is_begun_anew_until_it_ends(caplog: pytest.LogCaptureFixture) -> None:
    """What failed is in the log, with its traceback the first time only."""
    work = Work(2, [0.0])
    part = supervised(work)
    assert (work.begun, part.restarts, part.is_given_up) == (3, 2, False)
    assert [record.exc_info is not None for record in caplog.records] == [True, False]
    assert caplog.messages[0] == "sink failed unforeseen (KeyError: 'number 1') and is begun anew."


def test_a_work_that_fails_too_often_is_given_up(caplog: pytest.LogCaptureFixture) -> None:
    """It is said why, since when, and what to do."""
    work = Work(99, [0.0])
    part = supervised(work)
    assert (work.begun, part.restarts, part.is_given_up) == (3, 2, True)
    assert part.shown() == {
        "ok": False,
        "trouble": "sink failed unforeseen (KeyError: 'number 3') and is given up; restart the service once it is "
        "mended.",
        "since": 101.0,
        "restarts": 2,
        "given_up": True,
    }
    assert {record.levelno for record in caplog.records} == {logging.ERROR}


def test_a_work_that_fails_now_and_then_is_never_given_up() -> None:
    """Only failures within the time count."""
    work = Work(50, [0.0], every=6.0)
    assert not supervised(work).is_given_up
    assert work.begun == 51


def test_a_part_tells_the_log_once_that_it_is_lost_and_once_that_it_is_back(caplog: pytest.LogCaptureFixture) -> None:
    """However often it is tried meanwhile."""
    caplog.set_level(logging.INFO)
    part = ServicePart(name="mqtt://broker/a", since=0.0)
    for now in (10.0, 11.0, 13.0):
        part.fails(f"mqtt://broker/a: refused {now:g}", now)
    assert (part.trouble, part.since) == ("mqtt://broker/a: refused 13", 10.0)
    for now in (70.0, 71.0):
        part.works(now)
    assert (part.trouble, part.since) == ("", 70.0)
    assert caplog.messages == ["mqtt://broker/a: refused 10", "mqtt://broker/a: works again after 60 s."]


def test_cancelling_is_no_failure() -> None:
    """Who stops the service stops the part."""

    async def forever() -> None:
        await asyncio.sleep(3600.0)

    async def stopped() -> ServicePart:
        part = ServicePart(name="sink", since=0.0)
        task = asyncio.create_task(supervise(forever, part))
        await asyncio.sleep(0.01)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        return part

    assert asyncio.run(stopped()).trouble == ""
