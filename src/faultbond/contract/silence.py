"""Sensors and inputs that gave no value: what they would show was not watched, and that is said."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

SENSOR, INPUT = "sensor", "input"


@dataclass(frozen=True, slots=True, kw_only=True)
class Silent:
    """A sensor or an input (`role`) that gave no value, hardly any, or none for long.

    values: of so many samples. since, until: times of the values before and after its longest silence, s; None: it was
    silent from the first sample on, or to the last.
    """

    name: str
    role: str
    values: int
    samples: int
    since: float | None
    until: float | None

    def sentence(self, clock: Callable[[float], str]) -> str:
        """Say how silent it was, and what follows; `clock` writes a time."""
        then = " then" if self.values else ""
        lost = f"what only it would show was not watched{then}"
        return f"{self.fact(clock)}: {lost if self.role == SENSOR else 'it is taken to have stayed as it was'}"

    def fact(self, clock: Callable[[float], str]) -> str:
        """Say how silent it was."""
        if not self.values:
            return f"the {self.role} {self.name} gave no value"
        when = [f"before {clock(self.until)}" if self.until is not None else ""]
        if self.since is not None:
            when = [f"from {clock(self.since)}", f"to {clock(self.until)}" if self.until is not None else "on"]
        told = f"the {self.role} {self.name} gave a value in {self.values} of {self.samples} samples"
        return f"{told}, none {' '.join(when)}"


def unwatched(silent: Iterable[Silent]) -> tuple[str, ...]:
    """Give the sensors among these: what they would show was not watched, so that no plant is healthy by the others."""
    return tuple(item.name for item in silent if item.role == SENSOR)


def seconds(time: float) -> str:
    """Write a time in seconds, all digits that it has."""
    return f"{time:.15g} s"
