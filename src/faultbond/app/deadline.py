"""How much of its time a long piece of work has taken, and what ends there."""

from collections.abc import Callable
from time import monotonic
from typing import TypeVar

Whatever = TypeVar("Whatever")


class _OutOfTimeError(Exception):
    """There is no more time for what is under way."""


class Deadline:
    """Tells what is being done; a step that it bounds ends where that is told after its time.

    Parameters
    ----------
    tell : is told
    within : s from now that all of it may take
    """

    def __init__(self, tell: Callable[[str], None], within: float) -> None:
        self._tell, self._within, self._began = tell, within, monotonic()
        self._bound: float | None = None

    def __call__(self, text: str) -> None:
        """Tell what is being done, unless that is bounded and its time is up."""
        if self._bound is not None and not self.has(self._bound):
            raise _OutOfTimeError
        self._tell(text)

    def has(self, part: float) -> bool:
        """Whether less than this part of the time is gone."""
        return monotonic() - self._began < part * self._within

    def in_time(self, part: float, step: Callable[[], Whatever]) -> Whatever | None:
        """Give what a step finds; None where more than a part of the time is gone before its end."""
        self._bound = part
        try:
            return step()
        except _OutOfTimeError:
            self._tell("what was under way is left: the time is up")
            return None
        finally:
            self._bound = None
