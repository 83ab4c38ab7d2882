"""Moments as text."""

from datetime import UTC, datetime


def parse_time(text: str) -> float:
    """Give Unix seconds of an ISO 8601 time, UTC where no zone is given; ValueError if it is none."""
    moment = datetime.fromisoformat(text.strip())
    return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
