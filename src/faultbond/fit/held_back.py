"""Recordings that are held back, by which a model is judged that was fitted to the others."""

from collections.abc import Sequence
from dataclasses import replace

from faultbond.contract.samples import Sample
from faultbond.errors import NoVerdictError

HELD = 3  # one recording of so many is held back, and the last part of so many where there is one

Recordings = Sequence[tuple[str, Sequence[Sample]]]  # names and grid points


def parted(read: Recordings, least: int) -> tuple[Recordings, Recordings]:
    """Give recordings to fit and to hold back: the last of them, or the last part of one.

    Raises
    ------
    NoVerdictError
        Where a part has fewer than `least` samples.
    """
    if len(read) > 1:
        count = max(len(read) // HELD, 1)
        fitted, held = tuple(read[:-count]), tuple(read[-count:])
    else:
        ((name, points),) = read
        last = len(points) - len(points) // HELD
        after = [replace(points[last], dt=0.0), *points[last + 1 :]] if last < len(points) else []
        fitted, held = ((name, points[:last]),), ((f"the last third of {name}", after),)
    for name, points in (*fitted, *held):
        if len(points) < least:
            raise NoVerdictError(
                f"{name}: {len(points)} samples; at least {least} are needed where a part is held back to judge by; "
                "give a longer recording, or several"
            )
    return fitted, held
