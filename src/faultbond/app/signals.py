"""Signals that stop the program: they wait until a row has been taken, so what is kept is whole."""

import signal
import threading
from collections.abc import Iterable, Iterator
from math import inf
from time import monotonic
from types import FrameType, TracebackType
from typing import Any, TypeVar

Item = TypeVar("Item")
SIGNALLED = 128  # exit code, as shells report: this and the number of the signal
ONE = 0.5  # s; a signal that comes so soon again is the same: `timeout` sends it to a program and to its group
STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Stopped(KeyboardInterrupt):
    """The program was asked to stop by a signal, SIGINT being Ctrl-C."""

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.number = number


def stop_of(error: BaseException) -> Stopped | None:
    """Give the signal that is behind an error: itself, or what it was raised from; None where there is none."""
    told = error if isinstance(error, Stopped) else error.__cause__
    return told if isinstance(told, Stopped) else None


def last_of(stages: Iterator[Item]) -> tuple[Item, Stopped | Exception | None]:
    """Give the last of what stages find one after the other, and what ended them early; the first may raise."""
    found = next(stages)
    try:
        for further in stages:
            found = further
    except KeyboardInterrupt as error:
        if (stopped := stop_of(error)) is None:
            raise
        return found, stopped
    except Exception as error:
        return found, error
    return found, None


class Stopping:
    """Takes the signals that stop the program while it is entered; one that is ignored, as by `nohup`, stays so.

    noted: the signal that came. Only in the main thread, as Python has it; in others nothing changes.
    """

    def __init__(self) -> None:
        self._before: dict[int, Any] = {}
        self.noted: int | None = None
        self._waits, self._patient = False, False
        self._came: dict[int, float] = {}  # when, s, by number; one that another takes is told to both

    def __enter__(self) -> "Stopping":
        if threading.current_thread() is threading.main_thread():
            for number in STOPPING:
                if signal.getsignal(number) not in (signal.SIG_IGN, None):
                    self._before[number] = signal.signal(number, self._note)
                    outer = getattr(self._before[number], "__self__", None)
                    if isinstance(outer, Stopping):  # what it raised, a library may have swallowed
                        self.noted, self._came = self.noted or outer.noted, outer._came
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def between(self, items: Iterable[Item]) -> Iterator[Item]:
        """Give items.

        Raises
        ------
        Stopped
            Where a signal came; raised while an item is waited for, never while one is worked on.
        """
        self._patient, upstream = True, iter(items)
        while True:
            self._waits = True
            try:
                if self.noted is not None:
                    raise Stopped(self.noted)
                item = next(upstream)
            except StopIteration:
                return
            finally:
                self._waits = False
            yield item

    def _note(self, number: int, _: FrameType | None) -> None:
        now = monotonic()
        if now - self._came.get(number, -inf) < ONE:
            return
        self._came[number] = now
        again = number == self.noted == signal.SIGINT  # somebody insists
        self.noted = self.noted or number
        if self._waits or again or not self._patient:
            raise Stopped(number)
