"""Sets of suspects that cannot be told apart, exactly or nearly, and why.

Two identifiable sets of one size look alike where their sensitivities span the same space: what one explains, the
other explains. They are nearly alike where the largest principal angle between the spaces is small: of an effect of
one set, the other leaves at most the sine of that angle unexplained. Angles weigh the outputs by their noise.

Source: thesis 6.1.2 (faults that explain one another); Bjorck and Golub, Math. Comp. 27 (1973) 579 (angles).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, groupby
from math import radians, sin

import numpy as np

from faultbond.analysis.alike import why_alike, why_near
from faultbond.analysis.ranks import Reduced, bases
from faultbond.types import FloatArray

Set = tuple[int, ...]

NEAR_ANGLE = 10.0  # degrees: about a sixth of an effect is left to tell two sets apart
MOST_NUMBERS = 3 * 10**7  # in the comparison of all sets of one size with all others; larger sizes are left out
MOST_NEAR = 100  # near groups given, the nearest
_SAME_SHADOW = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Sets that no data can tell apart, and the reason in words."""

    sets: tuple[Set, ...]
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NearGroup:
    """Two sets that are hard to tell apart: the angle between them in degrees, and the reason in words."""

    sets: tuple[Set, Set]
    angle: float
    reason: str


def groups(reduced: Reduced, sets: Sequence[Set]) -> tuple[Group, ...]:
    """Give the classes, of two members at least, of sets that look exactly alike.

    Parameters
    ----------
    reduced : what the plant shows, by exact rank
    sets : identifiable, sorted by size
    """
    found: list[Group] = []
    for _, same_size in groupby(sets, key=len):
        for members in _classes(reduced, tuple(same_size)):
            smaller = {frozenset(group.sets): group.reason for group in found}
            found.append(Group(sets=members, reason=why_alike(reduced, members, smaller)))
    return tuple(found)


def _classes(reduced: Reduced, sets: tuple[Set, ...]) -> list[tuple[Set, ...]]:
    """Give the classes of sets of one size that span the same space.

    Equal spaces give equal shadows of a vector; those of a random one are compared first, since that needs no
    comparison of all with all.
    """
    if len(sets) < 2:
        return []
    base = bases(reduced, sets)
    vector = np.random.default_rng(0).standard_normal(base.shape[1])
    shadows = np.sum(np.einsum("nik,i->nk", base, vector) ** 2, axis=1) / max(float(np.sum(vector**2)), 1e-300)
    order = np.argsort(shadows, kind="stable")
    breaks = np.flatnonzero(np.diff(shadows[order]) > _SAME_SHADOW) + 1
    found: list[tuple[Set, ...]] = []
    for part in np.split(order, breaks):
        classes: list[list[Set]] = []
        for chosen in sorted(sets[k] for k in part):
            home = next((item for item in classes if _alike(reduced, item[0], chosen)), None)
            if home is None:
                classes.append([chosen])
            else:
                home.append(chosen)
        found += [tuple(item) for item in classes if len(item) > 1]
    return sorted(found)


def _alike(reduced: Reduced, one: Set, two: Set) -> bool:
    """Whether the union of two identifiable sets spans no more than each of them."""
    union = reduced.matrix[:, sorted({*one, *two})]
    return int(np.sum(np.linalg.svd(union, compute_uv=False) > reduced.rank.low)) <= len(one)


def near_groups(
    reduced: Reduced, sets: Sequence[Set], alike: Sequence[Group] = (), threshold: float = NEAR_ANGLE
) -> tuple[NearGroup, ...]:
    """Give the pairs of sets of one size that are hard to tell apart, the nearest first, `MOST_NEAR` at most.

    Of sets that look exactly alike only the first is compared. A pair that follows from a smaller one by adding the
    same suspects to both is left out.

    Parameters
    ----------
    reduced : what the plant shows, with the noise of the outputs as their units
    sets : identifiable, sorted by size
    alike : the exact groups of these sets
    threshold : largest angle, degrees
    """
    double = {chosen for group in alike for chosen in group.sets[1:]}
    known = {frozenset(pair) for group in alike for pair in combinations(group.sets, 2)}
    found: list[NearGroup] = []
    for _, same_size in groupby((chosen for chosen in sets if chosen not in double), key=len):
        for pair, angle in _close_pairs(reduced, tuple(same_size), threshold):
            known.add(frozenset(pair))
            if not _follows(pair, known):
                found.append(NearGroup(sets=pair, angle=angle, reason=why_near(reduced, pair, angle)))
    return tuple(sorted(found, key=lambda item: (item.angle, item.sets))[:MOST_NEAR])


def _follows(pair: tuple[Set, Set], known: set[frozenset[Set]]) -> bool:
    """Whether the pair without what both hold is known."""
    shared = set(pair[0]) & set(pair[1])
    left, right = (tuple(k for k in chosen if k not in shared) for chosen in pair)
    return bool(shared) and frozenset((left, right)) in known


def _close_pairs(reduced: Reduced, sets: tuple[Set, ...], threshold: float) -> list[tuple[tuple[Set, Set], float]]:
    """Give the pairs of sets with their largest principal angle where that is below the threshold."""
    n, height = len(sets), reduced.matrix.shape[0]
    if n < 2 or n * max(n, height * height) > MOST_NUMBERS:
        return []
    base = bases(reduced, sets)
    size = base.shape[2]
    flat = np.einsum("nik,njk->nij", base, base).reshape(n, -1)
    left_over = size - flat @ flat.T  # sum of squared sines of the principal angles
    one, two = np.nonzero(np.triu(left_over < size * sin(radians(threshold)) ** 2, 1))
    angles = largest_angles(base[one], base[two])
    close = np.flatnonzero(angles <= threshold)
    return [((sets[one[k]], sets[two[k]]), float(angles[k])) for k in close]


def largest_angles(one: FloatArray, two: FloatArray) -> FloatArray:
    """Give the largest principal angle, in degrees, of each pair of orthonormal bases, shape (n, height, size)."""
    apart = two - one @ (one.transpose(0, 2, 1) @ two)
    sines = np.linalg.svd(apart, compute_uv=False)[:, 0] if len(one) else np.zeros(0)
    return np.degrees(np.arcsin(np.minimum(sines, 1.0)))
