"""The record of every default in force: what was not stated, and what holds instead."""

import math

from faultbond.model.keys import Keys


def default_range(nominal: float) -> tuple[float, float]:
    """Give the range of a parameter that states none: the sign of its nominal, anything for 0."""
    return (0.0 if nominal > 0 else -math.inf), (0.0 if nominal < 0 else math.inf)


class Defaults:
    """Collects defaults; those with the same value become one line, `change of K1, K2`."""

    def __init__(self) -> None:
        self._who: dict[tuple[str, str], list[str]] = {}

    def add(self, what: str, value: str, who: str = "") -> None:
        """Record that `what` (of `who`) was not stated, so that `value` holds."""
        self._who.setdefault((what, value), []).extend([who] if who else [])

    def missing(self, keys: Keys, key: str, who: str = "", more: str = "") -> None:
        """Record that a key (of `who`) is missing, so that its default, and what more there is of it, holds."""
        self.add(key, keys.known[key].default + more, who)

    def pairs(self) -> tuple[tuple[str, str], ...]:
        """Give the lines (thing, value) in the order in which they came up."""
        return tuple(
            (f"{what} of {', '.join(who)}" if who else what, value) for (what, value), who in self._who.items()
        )


def in_force(pairs: tuple[tuple[str, str], ...]) -> frozenset[tuple[str, str]]:
    """Give (what, who) of every default in the lines; `who` is empty for one of the whole model.

    Example
    -------
    >>> sorted(in_force((("change of K1, K2", "200 %"), ("max_faults", "2"))))
    [('change', 'K1'), ('change', 'K2'), ('max_faults', '')]
    """
    split = ((what, who) for what, _, who in (thing.partition(" of ") for thing, _ in pairs))
    return frozenset((what, name) for what, who in split for name in who.split(", "))
