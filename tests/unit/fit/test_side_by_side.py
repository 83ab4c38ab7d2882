"""Calls that do not need each other run at once, and are told in order."""

from collections.abc import Iterator
from threading import Barrier, Event, get_ident
from time import sleep

import pytest

from faultbond.fit import side_by_side as module
from faultbond.fit.side_by_side import in_background, parts_side_by_side, side_by_side


@pytest.fixture(params=[1, 2])
def processors(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """So many processors, with a pool of their own."""
    monkeypatch.setattr(module, "_processors", lambda: request.param)
    module._threads.cache_clear()
    yield request.param
    module._threads.cache_clear()


def test_what_is_given_comes_in_order(processors: int) -> None:
    """Whichever call ends first."""
    assert list(side_by_side(lambda number: number**2, range(20))) == [number**2 for number in range(20)]
    assert list(side_by_side(lambda number: number, [])) == []


def test_on_several_processors_calls_run_at_once(processors: int) -> None:
    """Two that wait for each other end; on one processor, or of one call, all is done where it is asked for."""
    if processors == 1:
        assert set(side_by_side(lambda _: get_ident(), range(4))) == {get_ident()}
        return
    met = Barrier(2)
    assert sorted(side_by_side(lambda _: met.wait(timeout=30.0), range(2))) == [0, 1]
    assert list(side_by_side(lambda _: get_ident(), [0])) == [get_ident()]


def test_an_error_is_told_and_the_rest_is_left(processors: int) -> None:
    """Of what stands in line behind a call that fails next to nothing is begun."""
    started = []

    def call(number: int) -> int:
        started.append(number)
        sleep(0.002)
        return 1 // (number - 1)

    with pytest.raises(ZeroDivisionError):
        list(side_by_side(call, range(1000)))
    assert len(started) < 1000


def test_parts_of_calls_run_while_these_wait_for_them(processors: int) -> None:
    """Though as many calls wait as there are threads for them; parts that wait for each other end, too."""
    met = Barrier(2)

    def call(number: int) -> list[int]:
        return list(parts_side_by_side(lambda part: 10 * number + part, range(3)))

    assert list(side_by_side(call, range(4))) == [[10 * number + part for part in range(3)] for number in range(4)]
    if processors > 1:
        assert sorted(parts_side_by_side(lambda _: met.wait(timeout=30.0), range(2))) == [0, 1]


def test_what_was_begun_runs_beside_what_goes_on(processors: int) -> None:
    """It has ended before it is asked for; on one processor it begins then. What fails does so when it is asked for."""
    done = Event()
    waiting = in_background(done.set)
    assert done.wait(timeout=30.0 if processors > 1 else 0.05) == (processors > 1)
    waiting()
    assert done.is_set()
    failing = in_background(lambda: 1 // 0)
    with pytest.raises(ZeroDivisionError):
        failing()
