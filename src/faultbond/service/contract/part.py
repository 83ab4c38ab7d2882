"""How a part of the service stands: its health tells of it, and the log of each change."""

import logging
from dataclasses import dataclass
from typing import Any

from faultbond.report.numbers import duration_text

_LOG = logging.getLogger(__name__)


@dataclass(slots=True, kw_only=True)
class ServicePart:
    """A part of the service as its health tells of it.

    name: for people. since: when it began to be as it is, Unix s. trouble: why it does not work; empty: it does.
    restarts: how often it was begun anew after what was not foreseen. is_given_up: whether it will not be again.
    """

    name: str
    since: float
    trouble: str = ""
    restarts: int = 0
    is_given_up: bool = False

    def works(self, now: float) -> None:
        """Note that it works."""
        if self.trouble:
            _LOG.info("%s: works again after %s.", self.name, duration_text(max(now - self.since, 0.0), digits=2))
            self.trouble, self.since = "", now

    def fails(self, trouble: str, now: float) -> None:
        """Note why it does not work; who reads the log is told once."""
        if not self.trouble:
            self.since = now
            _LOG.warning("%s", trouble if trouble.startswith(self.name) else f"{self.name}: {trouble}")
        self.trouble = trouble

    def ends(self, now: float) -> None:
        """Note that it has nothing more to do."""
        self.fails(f"{'standard input' if self.name == '-' else self.name} has ended", now)

    def breaks(self, error: Exception, now: float, *, is_over: bool, is_known: bool = False) -> None:
        """Note what was not foreseen, with its traceback in the log unless it is known.

        is_over: whether it is given up; else it is begun anew.
        """
        what = f"{type(error).__name__}: {error}".rstrip(": ")
        coming = "given up; restart the service once it is mended" if is_over else "begun anew"
        told = f"{self.name} failed unforeseen ({what}) and is {coming}."
        _LOG.error("%s", told, exc_info=None if is_known else error)
        self.since = self.since if self.trouble else now
        self.trouble, self.is_given_up = told, is_over

    def shown(self) -> dict[str, Any]:
        """Give it as JSON."""
        return {
            "ok": not self.trouble,
            "trouble": self.trouble,
            "since": self.since,
            "restarts": self.restarts,
            "given_up": self.is_given_up,
        }
