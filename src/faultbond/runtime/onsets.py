"""The samples that are tried as onset of a fault."""

from itertools import pairwise

from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.trail import Trail

DENSE, RATIO = 40, 1.05  # samples before the alarm of which each is tried; ratio of their distances further back
MANY, MANY_DENSE, MANY_RATIO = 200_000, 8, 1.25  # the same with so many numbers in the covariances of all lanes
LARGE_BANK = 1_000_000  # numbers beyond which only those near the estimated onset are tried
SPARSE_BACK = (1, 2, 4, 8, 16, 32)  # samples about the estimated onset at which a large bank tries


def onsets(spec: EngineSpec, trail: Trail, change: int) -> list[tuple[int, float]]:
    """Give places for the onset, and the samples for which each stands; dense before the alarm, sparse far from it.

    Where the innovations became wild is tried too: what happens within a few samples, as a jump does whose trace the
    plant soon loses, only fits a lane that begins there. A bank with many lanes would take too long to begin at all
    places; it tries fewer, and one with very many only some about `change`.

    Parameters
    ----------
    spec : the model
    trail : what is kept of the time before
    change : place of the onset that the detector estimates
    """
    alarm, end = trail.alarmed, len(trail.samples) - 1
    places = {change, *(burst - late for burst in trail.bursts for late in (0, 1))}
    numbers = plan_lanes(spec).n_lanes * spec.n_packed
    if numbers > LARGE_BANK:
        places |= {change + side * back for back in SPARSE_BACK for side in (-1, 1) if change + side * back <= end}
    else:
        dense, ratio = (MANY_DENSE, MANY_RATIO) if numbers > MANY else (DENSE, RATIO)
        places |= {alarm, *_before(alarm, dense, ratio), *_after(alarm, end)}
    chosen = sorted(place for place in places if place >= 1) or [end]
    edges = [chosen[0] - 0.5, *(0.5 * (a + b) for a, b in pairwise(chosen)), chosen[-1] + 0.5]
    return [(place, right - left) for place, (left, right) in zip(chosen, pairwise(edges), strict=True)]


def _before(alarm: int, dense: int, ratio: float) -> set[int]:
    """Give places before the alarm: all of the last `dense`, further back ones with this ratio of their distances."""
    places, back = set(), 1
    while back < alarm:
        places.add(alarm - back)
        back = back + 1 if back < dense else round(back * ratio)
    return places


def _after(alarm: int, end: int) -> set[int]:
    """Give places after the alarm, which may have been for something else."""
    places, ahead = set(), 1
    while alarm + ahead <= end:
        places.add(alarm + ahead)
        ahead *= 2
    return places
