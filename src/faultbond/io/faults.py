"""Faults as they are written on the command line: `K1=4.45e11@2460`, `K1=x1.85@2460..3660`."""

import math
import re
from contextlib import suppress
from dataclasses import dataclass

from faultbond.errors import FaultbondError
from faultbond.io.recording import parse_time

FORM = re.compile(
    r"(?P<name>[A-Za-z][A-Za-z0-9_]*)\s*=\s*(?P<factor>x?)(?P<amount>[^@]+)@(?P<start>.+?)(?:\.\.(?P<end>.+))?"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultRequest:
    """A change of a parameter: to `value` in the model file's unit, or by `factor`; one of the two is None.

    The change is at `start` if `end` is the same, else a straight line from one to the other; seconds on the
    recording's clock.
    """

    parameter: str
    value: float | None
    factor: float | None
    start: float
    end: float


def parse_fault(text: str) -> FaultRequest:
    """Read a fault: PARAMETER=VALUE@TIME, PARAMETER=xFACTOR@TIME, or either with TIME..TIME for a ramp.

    Parameters
    ----------
    text : as the user wrote it; a time is in seconds or ISO 8601

    Raises
    ------
    FaultbondError
        When the text is no fault.
    """
    match = FORM.fullmatch(text.strip())
    if match is None:
        raise FaultbondError(
            f"--fault {text!r}: expected PARAMETER=VALUE@TIME, such as K1=4.45e11@2460 or K1=x1.85@2460."
        )
    amount = _finite(match["amount"])
    if amount is None:
        raise FaultbondError(
            f"--fault {text!r}: {match['amount']!r} is not a number. Give the value in the model's unit."
        )
    start, end = _moment(match["start"], text), _moment(match["end"] or match["start"], text)
    if end < start:
        raise FaultbondError(f"--fault {text!r}: it ends before it starts. Write the earlier time first.")
    relative = bool(match["factor"])
    return FaultRequest(
        parameter=match["name"],
        value=None if relative else amount,
        factor=amount if relative else None,
        start=start,
        end=end,
    )


def _moment(text: str, fault: str) -> float:
    """Read a time in seconds or ISO 8601."""
    seconds = _finite(text)
    if seconds is not None:
        return seconds
    with suppress(ValueError, OverflowError):
        return parse_time(text)
    raise FaultbondError(f"--fault {fault!r}: {text!r} is not a time. Give seconds, or 2024-05-01T12:00:00Z.")


def _finite(text: str) -> float | None:
    """Read a finite number; None if the text is none."""
    with suppress(ValueError):
        number = float(text)
        return number if math.isfinite(number) and "_" not in text else None
    return None
