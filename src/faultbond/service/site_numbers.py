"""Numbers and sizes in the site file, each of a range."""

import re
from collections.abc import Mapping

from faultbond.model.source import shown
from faultbond.model.spot import Spot
from faultbond.report.byte_size import UNITS, size_text

_SIZE = re.compile(rf"([0-9]+(?:\.[0-9]+)?) ?(|{'|'.join(UNITS)})")


def read_number(fields: Mapping[str, Spot], key: str, least: float, most: float) -> float | None:
    """Give a number of a range, None where it is not said.

    Raises
    ------
    ModelError
        Where it is none, or out of the range.
    """
    if key not in fields:
        return None
    place = fields[key]
    text = place.text()
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not least <= value <= most:
        raise place.error(f" is a number from {least:g} to {most:g}, not `{shown(text)}`")
    return value


def read_whole(fields: Mapping[str, Spot], key: str, least: int, most: int) -> int | None:
    """Give a whole number of a range, None where it is not said.

    Raises
    ------
    ModelError
        Where it is none, or out of the range.
    """
    value = read_number(fields, key, least, most)
    if value is not None and value != int(value):
        raise fields[key].error(f" is a whole number, not `{shown(fields[key].text())}`")
    return None if value is None else int(value)


def read_size(fields: Mapping[str, Spot], key: str, least: int) -> int | None:
    """Give a number of bytes, such as of `20 GB`, None where it is not said.

    Raises
    ------
    ModelError
        Where it is none, or less than it may be, or more than a disk has.
    """
    if key not in fields:
        return None
    place = fields[key]
    found = _SIZE.fullmatch(place.text())
    value = round(float(found[1]) * UNITS.get(found[2], 1)) if found else 0
    if not least <= value <= 1000 * UNITS["TB"]:
        raise place.error(f" is a size such as `20 GB`, from {size_text(least)} on, not `{shown(place.text())}`")
    return value


def read_time(fields: Mapping[str, Spot], key: str, least: float, most: float) -> float | None:
    """Give a time of a range, s, None where it is not said.

    Raises
    ------
    ModelError
        Where it is none, or out of the range.
    """
    if key not in fields:
        return None
    value = fields[key].seconds()
    if not least <= value <= most:
        raise fields[key].error(f" is a time from {least:g} s to {most:g} s, not `{shown(fields[key].text())}`")
    return value
