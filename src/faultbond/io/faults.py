"""Faults as they are written on the command line: `K1=x1.85@2460..3660`, `flow.bias=1.4e-5@1500`, `flow.stuck@1500`."""

import math
import re
from contextlib import suppress
from dataclasses import dataclass

from faultbond.errors import FaultbondError
from faultbond.io.times import finite_number, parse_time
from faultbond.types import FaultKind

FORM = re.compile(
    r"(?P<name>[A-Za-z][A-Za-z0-9_]*)(?:\.(?P<kind>\w*))?\s*(?:=\s*(?P<factor>x?)(?P<amount>[^@]+))?"
    r"@(?P<start>[^,]+?)(?:\.\.(?P<end>[^,]+))?(?:,(?P<on>[^/]+)(?:/(?P<off>.+))?)?"
)
OF_INSTRUMENTS = tuple(kind.value for kind in (FaultKind.BIAS, FaultKind.GAIN, FaultKind.STUCK, FaultKind.NOISE))


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultRequest:
    """A change of a parameter, or of the `bias`, `gain`, `stuck` value or `noise` of a sensor or input: `flow.bias`.

    To `value` in the model file's unit, or by `factor`; one of the two is None, of a `stuck` sensor both may be. The
    change is at `start` if `end` is the same, else a straight line from one to the other; seconds on the recording's
    clock. on, off: s for which it is there and gone in turn; off None: it is gone for good after `on`.
    """

    parameter: str
    value: float | None
    factor: float | None
    start: float
    end: float
    on: float | None = None
    off: float | None = None


def parse_fault(text: str) -> FaultRequest:
    """Read a fault: NAME=VALUE@TIME, NAME=xFACTOR@TIME, with TIME..TIME for a ramp, or TIME,ON/OFF where it comes back.

    Parameters
    ----------
    text : as the user wrote it; a time is in seconds or ISO 8601, ON and OFF are in seconds

    Raises
    ------
    FaultbondError
        When the text is no fault.
    """
    match = FORM.fullmatch(text.strip())
    kind = match["kind"] if match else None
    if match is None or (match["amount"] is None and kind != FaultKind.STUCK.value):
        raise FaultbondError(
            f"fault {text!r}: expected NAME=VALUE@TIME, such as K1=4.45e11@2460, K1=x1.85@2460 or flow.stuck@2460."
        )
    if kind is not None and kind not in OF_INSTRUMENTS:
        grows = "; a drift is a bias that grows, .bias=VALUE@FROM..TO" if kind == FaultKind.DRIFT.value else ""
        known = ", ".join(OF_INSTRUMENTS)
        raise FaultbondError(f"fault {text!r}: {kind!r} is no fault of a sensor or input. Those are {known}{grows}.")
    amount = None if match["amount"] is None else finite_number(match["amount"])
    if amount is not None and math.isnan(amount):
        advice = "Give the value in the model's unit, or x2 for a factor."
        raise FaultbondError(f"fault {text!r}: {match['amount']!r} is not a number. {advice}")
    start, end = _moment(match["start"], text), _moment(match["end"] or match["start"], text)
    if end < start:
        raise FaultbondError(f"fault {text!r}: it ends before it starts. Write the earlier time first.")
    on, off = (_length(match[name], text) for name in ("on", "off"))
    if on is not None and end > start:
        raise FaultbondError(f"fault {text!r}: a fault that comes and goes has one TIME, at which it comes first.")
    relative = bool(match["factor"])
    return FaultRequest(
        parameter=match["name"] + (f".{kind}" if kind else ""),
        value=None if relative else amount,
        factor=amount if relative else None,
        start=start,
        end=end,
        on=on,
        off=off,
    )


def _length(text: str | None, fault: str) -> float | None:
    """Read a length of time in seconds."""
    if text is None:
        return None
    seconds = finite_number(text)
    if not seconds > 0.0:
        raise FaultbondError(f"fault {fault!r}: {text!r} is not a length of time. Give seconds, as in @1500,300/600.")
    return seconds


def _moment(text: str, fault: str) -> float:
    """Read a time in seconds or ISO 8601."""
    seconds = finite_number(text)
    if not math.isnan(seconds):
        return seconds
    with suppress(ValueError, OverflowError):
        return parse_time(text)
    raise FaultbondError(f"fault {fault!r}: {text!r} is not a time. Give seconds, or 2024-05-01T12:00:00Z.")
