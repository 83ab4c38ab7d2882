"""Sets of suspects that are too many to be tested at once: which get lanes later, and what they follow from."""

from functools import lru_cache
from itertools import combinations

import numpy as np

from faultbond.arrays import IntArray
from faultbond.contract.spec import EngineSpec

GROWN = 32  # sets of the reserve that are tested
PER_SET = (
    3  # lanes of each: two from the closed form (effort or flow goes on, or content does), one from healthy values
)

Extensions = tuple[tuple[IntArray, IntArray, IntArray], ...]


def n_grown(spec: EngineSpec) -> int:
    """Give the number of sets of the reserve that can be tested."""
    return min(GROWN, len(spec.reserve))


@lru_cache(maxsize=8)
def extensions(spec: EngineSpec) -> Extensions:
    """Give how sets of the reserve follow from the largest tested sets within them, by the number of suspects added.

    Of each such number: the rows in the reserve (n,), the tested sets (n,), and what these lack (n, number).
    """
    place = {chosen: k for k, chosen in enumerate(spec.hypotheses)}
    found: dict[int, list[tuple[int, int, list[int]]]] = {}
    for row, chosen in enumerate(spec.reserve):
        for more in range(1, len(chosen)):
            parts = [part for part in combinations(chosen, len(chosen) - more) if part in place]
            if parts:
                found.setdefault(more, []).extend((row, place[part], sorted(set(chosen) - {*part})) for part in parts)
                break
    return tuple(
        (np.array(rows, dtype=np.intp), np.array(bases, dtype=np.intp), np.array(added, dtype=np.intp))
        for rows, bases, added in (zip(*items, strict=True) for items in found.values())
    )
