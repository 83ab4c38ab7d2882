"""Numbers and moments as they stand in a recording or on the command line."""

import math
import re
from contextlib import suppress
from datetime import UTC, datetime

from faultbond.model.graph import Unit

WITH_COMMA = re.compile(r"\s*[+-]?\d*,\d+(e[+-]?\d+)?\s*", re.IGNORECASE)  # a number as half of the world writes it
DAY_FIRST = re.compile(r"([0-9]{1,2})\.([0-9]{1,2})\.([0-9]{4})(?![0-9])")  # a date as that half writes it


def finite_number(value: object) -> float:
    """Give a number, also of a text; nan where there is none, or none that is finite."""
    try:
        found = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return math.nan
    return found if math.isfinite(found) and not (isinstance(value, str) and "_" in value) else math.nan


def is_not_finite(text: str) -> bool:
    """Whether a text is written as a number that is none, such as `nan` or `inf`."""
    try:
        return not math.isfinite(float(text))
    except ValueError:
        return False


def unix_seconds(moment: datetime) -> float:
    """Give Unix seconds of a moment, UTC where no zone is given."""
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()


def parse_time(text: str) -> float:
    """Give Unix seconds of an ISO 8601 time, its date perhaps as 31.5.2026; UTC without a zone; ValueError if none."""
    text = text.strip()
    if found := DAY_FIRST.match(text):
        day, month, year = found.groups()
        text = f"{year}-{month:0>2}-{day:0>2}{text[found.end() :]}"
    return unix_seconds(datetime.fromisoformat(text))


def moment_of(value: object, unit: Unit) -> float:
    """Give the time of a row in seconds: of a number in a unit, a date and time, or a text of one; nan of all else."""
    if isinstance(value, datetime):
        return unix_seconds(value)
    found = finite_number(value)
    if math.isnan(found) and isinstance(value, str):
        with suppress(ValueError, OverflowError):
            return parse_time(value)
    return unit.to_si(found)
