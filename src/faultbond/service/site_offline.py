"""What a site file says of the off-line desk: how much an analysis of what people bring may take."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from faultbond.model.document import MAX_BYTES
from faultbond.model.keys import TEXT, Key, Keys
from faultbond.model.source import Text
from faultbond.model.spot import Spot
from faultbond.report.byte_size import MB, size_text
from faultbond.service.offline.limits import OfflineLimits
from faultbond.service.site_numbers import read_number, read_size, read_time, read_whole

LONGEST = 7 * 86400.0  # s of a job
OFFLINE_KEYS = Keys(
    {
        "folder": Key(TEXT, "where files and analyses are kept, taken from where the site file lies"),
        "upload": Key({}, "size of a file that is brought"),
        "time": Key({}, "of an analysis, by the clock"),
        "processor": Key({}, "time of a processor, of each process of it"),
        "memory": Key({}, "address space of each of them"),
        "results": Key({}, "size of a file that it writes"),
        "at_once": Key({}, "analyses that are at work"),
        "queue": Key({}, "analyses that wait"),
        "jobs": Key({}, "analyses that are kept once they have ended"),
        "days": Key({}, "for which they are"),
        "room": Key({}, "size of all files together"),
    }
)


def read_limits(place: Spot, folder: Path, usual: OfflineLimits) -> OfflineLimits | None:
    """Give the limits that a site file says, None for `no`.

    Parameters
    ----------
    place : the key `offline`
    folder : where the site file lies
    usual : what counts where nothing is said

    Raises
    ------
    ModelError
        Where it says what is no limit.
    """
    if isinstance(place.entry.value, Text) and not place.is_empty:
        return usual if place.is_yes() else None
    told = place.fields(OFFLINE_KEYS)
    found: dict[str, Any] = {
        "folder": str(folder / told["folder"].text()) if "folder" in told else None,
        "upload": read_size(told, "upload", 1000),
        "seconds": read_time(told, "time", 1.0, LONGEST),
        "processor": read_time(told, "processor", 1.0, LONGEST),
        "memory": read_size(told, "memory", 100 * MB),
        "results": read_size(told, "results", MB),
        "at_once": read_whole(told, "at_once", 1, 64),
        "queue": read_whole(told, "queue", 1, 1000),
        "jobs": read_whole(told, "jobs", 1, 10_000),
        "days": read_number(told, "days", 1e-3, 1e6),
        "room": read_size(told, "room", MB),
    }
    limits = replace(usual, **{name: value for name, value in found.items() if value is not None})
    if limits.room < limits.upload + 2 * MAX_BYTES:
        needed = f"`upload` ({size_text(limits.upload)}) and {size_text(2 * MAX_BYTES)}"
        problem = f": there is no room for a recording and its model; `room` is {needed} at least"
        raise (told.get("room") or told["upload"]).error(problem)
    return limits
