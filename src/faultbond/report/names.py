"""Names in lists: in braces, or those that are listed and a count of the rest."""

from collections.abc import Sequence

from faultbond.report.numbers import join

LISTED = 12  # groups, near groups and the like that are listed


def braced(names: Sequence[str]) -> str:
    """Give the names of a set: `{K4, K6}`."""
    return "{" + ", ".join(names) + "}"


def listed(items: Sequence[str]) -> list[str]:
    """Give what is listed, and a line that counts the rest."""
    more = [f"... and {len(items) - LISTED} more; --json writes all"] if len(items) > LISTED else []
    return [*items[:LISTED], *more]


def some(named: Sequence[str], most: int = LISTED) -> str:
    """Name what is listed, and count the rest."""
    return join([*named[:most], f"{len(named) - most} more"] if len(named) > most else named)
