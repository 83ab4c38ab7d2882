"""What slow errors hide: lags, highest rates and curves, asked for once more where none of those errors is there.

A slow error goes with almost anything, so it is often the first that is found, and beside it what is really missing
gains little. Without it that has to explain everything by itself; with it again, data tell which of the two ways is
better.
"""

from dataclasses import replace

import numpy as np

from faultbond.fit.foothold import Added, Footing, keys_of
from faultbond.fit.further import added_together, better
from faultbond.fit.imperfections import without_slow_error
from faultbond.fit.quiet_search import WORTH, Search

ROUNDS = 4  # in which lags and their like are added


def unhidden(search: Search, stand: Footing) -> Footing | None:
    """Give where lags and their like lead that are found without the slow errors; None: nowhere better."""
    slow = [item for item in stand.added if item.what.is_slow and item.what.key not in keys_of(search.graph)]
    keys = frozenset(item.what.key for item in stand.added)
    if not slow or keys in search.unhidden:
        return None
    search.unhidden.add(keys)
    search.tell(f"asking what {', '.join(item.what.words for item in slow)} may hide")
    graph = stand.graph
    for item in slow:
        graph = without_slow_error(graph, item.what)
    definite = tuple(item for item in stand.added if item not in slow)
    bare = search.ground(graph).climbed(replace(stand, graph=graph, added=definite))
    (refused, search.refused), (possible, search.possible) = (search.refused, {}), (search.possible, ())
    found = bare
    for _ in range(ROUNDS):
        further = better(search, found) if np.isfinite(found.trained) else None
        if further is None:
            break
        found = further
    search.refused, search.possible = refused, possible
    if found is bare:
        return None
    return _with_slow(search, stand, found, slow)


def _with_slow(search: Search, stand: Footing, found: Footing, slow: list[Added]) -> Footing | None:
    """Give a footing with the slow errors again, those that are of use, if that foretells better than before."""
    search.tell(f"fitting {', '.join(item.what.words for item in slow)} beside that")
    again = search.lasting(added_together(search, found, slow))
    if not again.held - stand.held >= WORTH:
        return None
    return again
