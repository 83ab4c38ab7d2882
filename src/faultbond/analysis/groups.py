"""Sets of suspects that cannot be told apart, exactly or nearly, and why.

Two identifiable sets of one size look alike where their sensitivities span the same space: what one explains, the
other explains. They are nearly alike where the largest principal angle between the spaces is small: of an effect of
one set, the other leaves at most the sine of that angle unexplained. Angles weigh the outputs by their noise.

Source: thesis 6.1.2 (faults that explain one another); Bjorck and Golub, Math. Comp. 27 (1973) 579 (angles).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import accumulate, compress, groupby, product
from math import radians, sin

import numpy as np

from faultbond.analysis.alike import why_alike, why_near
from faultbond.analysis.ranks import ReducedSensitivities, bases
from faultbond.arrays import BoolArray, FloatArray, IntArray

Set = tuple[int, ...]
Pair = tuple[Set, Set]
Following = Callable[[IntArray, IntArray], BoolArray]

NEAR_ANGLE = 10.0  # degrees: about a sixth of an effect is left to tell two sets apart
MOST_COMPARED = 4000  # sets of one size that are compared with each other; larger sizes are left out of near groups
MOST_CLOSE = 20_000  # pairs of one size whose angle is worked out
MOST_NEAR = 100  # near groups given, the nearest
_SAME_SHADOW = 1e-6
_BLOCK = 2**21  # numbers in one batch
_VECTORS = 3  # random ones, of which shadows are compared
_ROUNDS = 8  # of comparisons of a lot of sets with one of them, at least


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


def groups(reduced: ReducedSensitivities, sets: Sequence[Set]) -> tuple[Group, ...]:
    """Give the classes, of two members at least, of sets that look exactly alike.

    Parameters
    ----------
    reduced : what the plant shows, by exact rank
    sets : identifiable, sorted by size
    """
    reasons: dict[frozenset[Set], str] = {}
    for members in classes(reduced, sets):
        reasons[frozenset(members)] = why_alike(reduced, members, reasons)
    return tuple(Group(sets=tuple(sorted(members)), reason=reason) for members, reason in reasons.items())


def classes(reduced: ReducedSensitivities, sets: Sequence[Set]) -> list[tuple[Set, ...]]:
    """Give the members of each of `groups`, without reasons."""
    by_size = groupby(sets, key=len)
    return [members for _, same_size in by_size for members in _classes(reduced, tuple(same_size))]


def _classes(reduced: ReducedSensitivities, sets: tuple[Set, ...]) -> list[tuple[Set, ...]]:
    """Give the classes of sets of one size that span the same space.

    Equal spaces give equal shadows of a vector; those of random ones are compared first, since that needs no
    comparison of all with all. Where shadows are alike of more than `MOST_COMPARED`, as where rounding hides most of a
    plant, the largest lots of them are taken as different.
    """
    if len(sets) < 2:
        return []
    if reduced.rank.clear and len(sets[0]) >= reduced.rank.value:
        return [tuple(sorted(sets))]
    base = bases(reduced, sets)
    vectors = np.random.default_rng(0).standard_normal((base.shape[1], _VECTORS))
    lengths = np.maximum(np.sum(vectors**2, axis=0), 1e-300)
    shadows = np.sum(np.einsum("nik,iv->nkv", base, vectors) ** 2, axis=1) / lengths
    parts = sorted(_like(shadows), key=len)
    few = [part for part, total in zip(parts, accumulate(map(len, parts)), strict=True) if total <= MOST_COMPARED]
    found = [members for part in few for members in _same_space(reduced, sorted(sets[k] for k in part))]
    return sorted(members for members in found if len(members) > 1)


def _like(shadows: FloatArray) -> list[list[int]]:
    """Give the rows, two at least, that no gap in any column parts."""
    labels = np.zeros(len(shadows), dtype=np.intp)
    for column in shadows.T:
        order = np.lexsort((column, labels))
        apart = (np.diff(labels[order]) != 0) | (np.diff(column[order]) > _SAME_SHADOW)
        labels[order] = np.concatenate([[0], np.cumsum(apart)])
    order = np.argsort(labels, kind="stable")
    bounds = np.concatenate([[0], np.cumsum(np.bincount(labels))])
    return [order[bounds[k] : bounds[k + 1]].tolist() for k in np.flatnonzero(np.diff(bounds) > 1)]


def _same_space(reduced: ReducedSensitivities, sets: list[Set]) -> list[tuple[Set, ...]]:
    """Give the classes of some sets: all are compared with the first, what is left with the first of that.

    A large lot in which hardly any two are alike, as rounding makes them, is left after some rounds.
    """
    found: list[tuple[Set, ...]] = []
    for _ in range(max(_ROUNDS, MOST_COMPARED // len(sets))):
        if not sets:
            break
        alike = [True, *_alike(reduced, sets[0], sets[1:])]
        found.append(tuple(compress(sets, alike)))
        sets = [item for item, same in zip(sets, alike, strict=True) if not same]
    return found


def _alike(reduced: ReducedSensitivities, one: Set, others: list[Set]) -> list[bool]:
    """Whether the union of one identifiable set and each other spans no more than each of them."""
    if not others:
        return []
    places = np.array(others)
    columns = reduced.matrix[:, places] * ~np.isin(places, one)  # what both hold counts once
    head = np.broadcast_to(reduced.matrix[:, None, list(one)], columns.shape)
    unions = np.concatenate([head, columns], axis=2).transpose(1, 0, 2)
    values = np.linalg.svd(unions, compute_uv=False)
    return [int(rank) <= len(one) for rank in np.sum(values > reduced.rank.low, axis=1)]


def near_groups(
    reduced: ReducedSensitivities, sets: Sequence[Set], alike: Sequence[Group] = (), threshold: float = NEAR_ANGLE
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
    pairs = near_pairs(reduced, sets, [group.sets for group in alike], threshold)
    nearest = sorted(pairs, key=lambda item: (item[1], item[0]))[:MOST_NEAR]
    return tuple(NearGroup(sets=pair, angle=angle, reason=why_near(reduced, pair, angle)) for pair, angle in nearest)


def near_pairs(
    reduced: ReducedSensitivities, sets: Sequence[Set], alike: Sequence[tuple[Set, ...]], threshold: float = NEAR_ANGLE
) -> list[tuple[Pair, float]]:
    """Give the pairs of `near_groups` and their angles, at most `MOST_CLOSE` a size, in no order, without reasons."""
    home = {chosen: k for k, members in enumerate(alike) for chosen in members}
    double = {chosen for members in alike for chosen in members[1:]}
    near: set[frozenset[Set]] = set()
    singles = _alike_singles(len(reduced.parameters), alike)
    found: list[tuple[Pair, float]] = []
    for size, same_size in groupby((chosen for chosen in sets if chosen not in double), key=len):
        pairs = _close_pairs(reduced, tuple(same_size), threshold, singles)
        for pair, angle in pairs:
            near.add(frozenset(pair))
            left, right = _rests(pair)
            known = frozenset((left, right)) in near or (left in home and home[left] == home.get(right))
            if len(left) == size or not known:
                found.append((pair, angle))
        for (left, right), _ in pairs if size == 1 else ():
            singles[left + right] = singles[right + left] = True
    return found


def _alike_singles(n_parameters: int, alike: Sequence[tuple[Set, ...]]) -> BoolArray:
    """Tell of each two parameters whether they look exactly alike."""
    found = np.zeros((n_parameters, n_parameters), dtype=bool)
    for members in alike:
        if len(members[0]) == 1:
            places = [chosen[0] for chosen in members]
            found[np.ix_(places, places)] = True
    return found


def not_compared(sets: Sequence[Set]) -> int:
    """Give the number of sets that `near_groups` leaves out, since there are too many of their size."""
    counts = [len(tuple(same_size)) for _, same_size in groupby(sets, key=len)]
    return sum(count for count in counts if count > MOST_COMPARED)


def _rests(pair: Pair) -> Pair:
    """Give two sets without what both hold."""
    one, two = pair
    return tuple(k for k in one if k not in two), tuple(k for k in two if k not in one)


def _close_pairs(
    reduced: ReducedSensitivities, sets: tuple[Set, ...], threshold: float, singles: BoolArray
) -> list[tuple[Pair, float]]:
    """Give the pairs of sets with their largest principal angle where that is below the threshold.

    Pairs of two are left out that follow from a near pair of single suspects, told by `singles`.
    """
    if len(sets) < 2 or len(sets) > MOST_COMPARED:
        return []
    base = bases(reduced, sets)
    one, two = _candidates(base, sin(radians(threshold)), _following(sets, singles))
    step = max(1, _BLOCK // max(1, base[0].size))
    parts = [slice(first, first + step) for first in range(0, len(one), step)]
    angles = [angle for part in parts for angle in largest_angles(base[one[part]], base[two[part]]).tolist()]
    pairs = zip(one.tolist(), two.tolist(), angles, strict=True)
    return [((sets[k], sets[m]), angle) for k, m, angle in pairs if angle <= threshold]


def _candidates(base: FloatArray, sine: float, following: Following) -> tuple[IntArray, IntArray]:
    """Give the pairs whose squared sines have a sum that allows the largest; of too many those of the smallest sums."""
    n, height, size = base.shape
    flat = base.transpose(1, 0, 2).reshape(height, n * size)
    step = max(1, _BLOCK // max(1, n * size * size))
    one, two, sums = np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0)
    for first in range(0, n - 1, step):
        cosines = flat[:, first * size : (first + step) * size].T @ flat[:, first * size :]
        left_over = size - np.sum(cosines.reshape(-1, size, n - first, size) ** 2, axis=(1, 3))
        rows, columns = np.nonzero(np.triu(left_over < size * sine**2, 1))
        new = ~following(rows + first, columns + first)
        one, two = np.append(one, rows[new] + first), np.append(two, columns[new] + first)
        sums = np.append(sums, left_over[rows[new], columns[new]])
        if len(sums) > MOST_CLOSE:
            kept = np.sort(np.argpartition(sums, MOST_CLOSE)[:MOST_CLOSE])
            one, two, sums = one[kept], two[kept], sums[kept]
    return one, two


def _following(sets: tuple[Set, ...], singles: BoolArray) -> Following:
    """Give a function that tells of pairs of two suspects each whether they follow from a near pair of single ones."""
    if len(sets[0]) != 2:
        return lambda one, _two: np.zeros(len(one), dtype=bool)
    members = np.array(sets)

    def following(one: IntArray, two: IntArray) -> BoolArray:
        found = np.zeros(len(one), dtype=bool)
        for k, m in product((0, 1), repeat=2):
            shared = members[one, k] == members[two, m]
            found |= shared & singles[members[one, 1 - k], members[two, 1 - m]]
        return found

    return following


def largest_angles(one: FloatArray, two: FloatArray) -> FloatArray:
    """Give the largest principal angle, in degrees, of each pair of orthonormal bases, shape (n, height, size)."""
    apart = two - np.einsum("nik,nkm->nim", one, np.einsum("nik,nim->nkm", one, two))
    squares = np.linalg.eigvalsh(np.einsum("nik,nim->nkm", apart, apart))[:, -1] if len(one) else np.zeros(0)
    return np.asarray(np.degrees(np.arcsin(np.sqrt(np.clip(squares, 0.0, 1.0)))))
