"""Sets of suspects that cannot be told apart, exactly or nearly, and why.

Two identifiable sets of one size look alike where their sensitivities span the same space: what one explains, the
other explains. They are nearly alike where the largest principal angle between the spaces is small: of an effect of
one set, the other leaves at most the sine of that angle unexplained. Angles weigh the outputs by their noise.

Source: thesis 6.1.2 (faults that explain one another); Bjorck and Golub, Math. Comp. 27 (1973) 579 (angles).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, compress, groupby, product
from math import isclose, radians, sin

import numpy as np

from faultbond.analysis.ranks import BLOCK, ReducedSensitivities, bases
from faultbond.arrays import BoolArray, FloatArray, IntArray

SuspectSet = tuple[int, ...]  # positions of parameters
SetPair = tuple[SuspectSet, SuspectSet]
PairTest = Callable[[IntArray, IntArray], BoolArray]  # of pairs by their positions

NEAR_ANGLE = 10.0  # degrees: about a sixth of an effect is left to tell two sets apart
MOST_COMPARED = 4000  # sets of one size that are compared with each other; larger sizes are left out of near groups
MOST_CLOSE = 20_000  # pairs of one size whose angle is worked out
MOST_NEAR = 100  # near groups given, the nearest
_SAME_SHADOW = 1e-6
_VECTORS = 3  # random ones, of which shadows are compared
_ROUNDS = 8  # of comparisons of a lot of sets with one of them, at least
_EXACT = 1e-6  # relative; a ratio of effects so near a simple number is that number
_LARGEST_POWER = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Group:
    """Sets that no data can tell apart, and the reason in words."""

    sets: tuple[SuspectSet, ...]
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class NearGroup:
    """Two sets that are hard to tell apart: the angle between them in degrees, and the reason in words."""

    sets: SetPair
    angle: float
    reason: str


def groups(reduced: ReducedSensitivities, sets: Sequence[SuspectSet]) -> tuple[Group, ...]:
    """Give the classes, of two members at least, of sets that look exactly alike.

    Parameters
    ----------
    reduced : what the plant shows, by exact rank
    sets : identifiable, sorted by size
    """
    reasons: dict[frozenset[SuspectSet], str] = {}
    for members in alike_classes(reduced, sets):
        reasons[frozenset(members)] = _why_alike(reduced, members, reasons)
    return tuple(Group(sets=tuple(sorted(members)), reason=reason) for members, reason in reasons.items())


def alike_classes(reduced: ReducedSensitivities, sets: Sequence[SuspectSet]) -> list[tuple[SuspectSet, ...]]:
    """Give the members of each of `groups`, without reasons."""
    by_size = groupby(sets, key=len)
    return [members for _, same_size in by_size for members in _classes(reduced, tuple(same_size))]


def _classes(reduced: ReducedSensitivities, sets: tuple[SuspectSet, ...]) -> list[tuple[SuspectSet, ...]]:
    """Give the classes of sets of one size that span the same space.

    Equal spaces give equal shadows of a vector; those of random ones are compared first, since that needs no
    comparison of all with all. Where shadows are alike of more than `MOST_COMPARED`, as where rounding hides most of a
    plant, the largest lots of them are taken as different. Of each other lot all are compared with the first, what is
    left with the first of that; one in which hardly any two are alike, as rounding makes them, is left after some
    rounds.
    """
    if len(sets) < 2:
        return []
    if reduced.rank.clear and len(sets[0]) >= reduced.rank.value:
        return [tuple(sorted(sets))]
    base = bases(reduced, sets)
    vectors = np.random.default_rng(0).standard_normal((base.shape[1], _VECTORS))
    lengths = np.maximum(np.sum(vectors**2, axis=0), 1e-300)
    shadows = np.sum(np.einsum("nik,iv->nkv", base, vectors) ** 2, axis=1) / lengths
    lots = sorted(_like(shadows), key=len)
    found: list[tuple[SuspectSet, ...]] = []
    for lot, total in zip(lots, accumulate(map(len, lots)), strict=True):
        if total > MOST_COMPARED:
            break
        left = sorted(sets[k] for k in lot)
        for _ in range(max(_ROUNDS, MOST_COMPARED // len(lot))):
            if len(left) < 2:
                break
            alike = [True, *_alike(reduced, left[0], left[1:])]
            found.append(tuple(compress(left, alike)))
            left = [item for item, same in zip(left, alike, strict=True) if not same]
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


def _alike(reduced: ReducedSensitivities, one: SuspectSet, others: list[SuspectSet]) -> list[bool]:
    """Whether the union of one identifiable set and each other spans no more than each of them."""
    places = np.array(others)
    columns = reduced.matrix[:, places] * ~np.isin(places, one)  # what both hold counts once
    head = np.broadcast_to(reduced.matrix[:, None, list(one)], columns.shape)
    unions = np.concatenate([head, columns], axis=2).transpose(1, 0, 2)
    values = np.linalg.svd(unions, compute_uv=False)
    return [int(rank) <= len(one) for rank in np.sum(values > reduced.rank.low, axis=1)]


def near_groups(
    reduced: ReducedSensitivities,
    sets: Sequence[SuspectSet],
    alike: Sequence[Group] = (),
    threshold: float = NEAR_ANGLE,
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
    return tuple(NearGroup(sets=pair, angle=angle, reason=_why_near(reduced, pair, angle)) for pair, angle in nearest)


def near_pairs(
    reduced: ReducedSensitivities,
    sets: Sequence[SuspectSet],
    alike: Sequence[tuple[SuspectSet, ...]],
    threshold: float = NEAR_ANGLE,
) -> list[tuple[SetPair, float]]:
    """Give the pairs of `near_groups` and their angles, at most `MOST_CLOSE` a size, in no order, without reasons."""
    home = {chosen: k for k, members in enumerate(alike) for chosen in members}
    double = {chosen for members in alike for chosen in members[1:]}
    near: set[frozenset[SuspectSet]] = set()
    singles = np.zeros((len(reduced.parameters),) * 2, dtype=bool)  # whether two parameters look alike, or nearly
    for members in alike:
        if len(members[0]) == 1:
            singles[np.ix_(*[[chosen[0] for chosen in members]] * 2)] = True
    found: list[tuple[SetPair, float]] = []
    for size, same_size in groupby((chosen for chosen in sets if chosen not in double), key=len):
        pairs = _close_pairs(reduced, tuple(same_size), threshold, singles)
        for (one, two), angle in pairs:
            near.add(frozenset((one, two)))
            left, right = tuple(k for k in one if k not in two), tuple(k for k in two if k not in one)
            known = frozenset((left, right)) in near or (left in home and home[left] == home.get(right))
            if len(left) == size or not known:
                found.append(((one, two), angle))
        for (left, right), _ in pairs if size == 1 else ():
            singles[left + right] = singles[right + left] = True
    return found


def _close_pairs(
    reduced: ReducedSensitivities, sets: tuple[SuspectSet, ...], threshold: float, singles: BoolArray
) -> list[tuple[SetPair, float]]:
    """Give the pairs of sets with their largest principal angle where that is below the threshold.

    Pairs of two are left out that follow from a near pair of single suspects, told by `singles`.
    """
    if len(sets) < 2 or len(sets) > MOST_COMPARED:
        return []
    members = np.array(sets)

    def follows(one: IntArray, two: IntArray) -> BoolArray:
        found = np.zeros(len(one), dtype=bool)
        for k, m in product((0, 1), repeat=2) if members.shape[1] == 2 else ():
            found |= (members[one, k] == members[two, m]) & singles[members[one, 1 - k], members[two, 1 - m]]
        return found

    base = bases(reduced, sets)
    one, two = _possible(base, sin(radians(threshold)), follows)
    step = max(1, BLOCK // max(1, base[0].size))
    parts = [slice(first, first + step) for first in range(0, len(one), step)]
    angles = [angle for part in parts for angle in largest_angles(base[one[part]], base[two[part]]).tolist()]
    pairs = zip(one.tolist(), two.tolist(), angles, strict=True)
    return [((sets[k], sets[m]), angle) for k, m, angle in pairs if angle <= threshold]


def _possible(base: FloatArray, sine: float, follows: PairTest) -> tuple[IntArray, IntArray]:
    """Give the pairs whose squared sines have a sum that allows the largest; of too many those of the smallest sums."""
    n, height, size = base.shape
    flat = base.transpose(1, 0, 2).reshape(height, n * size)
    step = max(1, BLOCK // max(1, n * size * size))
    one, two, sums = np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0)
    for first in range(0, n - 1, step):
        cosines = flat[:, first * size : (first + step) * size].T @ flat[:, first * size :]
        left_over = size - np.sum(cosines.reshape(-1, size, n - first, size) ** 2, axis=(1, 3))
        rows, columns = np.nonzero(np.triu(left_over < size * sine**2, 1))
        new = ~follows(rows + first, columns + first)
        one, two = np.append(one, rows[new] + first), np.append(two, columns[new] + first)
        sums = np.append(sums, left_over[rows[new], columns[new]])
        if len(sums) > MOST_CLOSE:
            kept = np.sort(np.argpartition(sums, MOST_CLOSE)[:MOST_CLOSE])
            one, two, sums = one[kept], two[kept], sums[kept]
    return one, two


def largest_angles(one: FloatArray, two: FloatArray) -> FloatArray:
    """Give the largest principal angle, in degrees, of each pair of orthonormal bases, shape (n, height, size)."""
    apart = two - np.einsum("nik,nkm->nim", one, np.einsum("nik,nim->nkm", one, two))
    squares = np.linalg.eigvalsh(np.einsum("nik,nim->nkm", apart, apart))[:, -1] if len(one) else np.zeros(0)
    return np.asarray(np.degrees(np.arcsin(np.sqrt(np.clip(squares, 0.0, 1.0)))))


def _why_alike(
    reduced: ReducedSensitivities, sets: tuple[SuspectSet, ...], smaller: Mapping[frozenset[SuspectSet], str]
) -> str:
    """Give the reason for which sets look exactly alike.

    Parameters
    ----------
    reduced : what the plant shows
    sets : the group
    smaller : reasons of the groups found before, by their sets
    """
    if not reduced.matrix[:, [k for chosen in sets for k in chosen]].any():
        return "none of them shows"
    if len(sets[0]) == 1:
        return _why_singles(reduced, [chosen[0] for chosen in sets])
    shared = set(sets[0]).intersection(*sets)
    rest = frozenset(tuple(k for k in chosen if k not in shared) for chosen in sets)
    if shared and rest in smaller:
        return smaller[rest]
    if len(sets[0]) >= reduced.rank.value:
        return "each of them explains anything"
    return f"they act through the same {len(sets[0])} combinations"


def _why_near(reduced: ReducedSensitivities, pair: SetPair, angle: float) -> str:
    """Give what is left to tell two sets apart that look nearly alike, and where it shows."""
    one, two = (reduced.columns[:, list(chosen)] for chosen in pair)
    base, other = np.linalg.qr(one)[0], np.linalg.qr(two)[0]
    left, _, _ = np.linalg.svd(other - base @ (base.T @ other), full_matrices=False)
    parts = np.bincount(reduced.row_outputs, weights=left[:, 0] ** 2, minlength=len(reduced.outputs))
    first, second = ("{" + ", ".join(reduced.parameters[k] for k in chosen) + "}" for chosen in pair)
    where = f", most of it in {reduced.outputs[int(np.argmax(parts))]}" if len(reduced.outputs) > 1 else ""
    return f"what {second} does, {first} does too but for {100.0 * sin(radians(angle)):.2g} %{where}"


def _why_singles(reduced: ReducedSensitivities, members: list[int]) -> str:
    """Say through which combination single parameters act: a sum, a product of powers, or else how they compare."""
    first, *others = members
    names = [reduced.parameters[k] for k in members]
    effects = reduced.columns * reduced.lengths
    ratios, slopes = [], []
    for other in others:  # the effect of `other` in those of `first`, per step and per SI
        ratio = float(effects[:, first] @ effects[:, other] / (effects[:, first] @ effects[:, first]))
        ratios.append(ratio)
        slopes.append(ratio * float(reduced.steps[first] / reduced.steps[other]))
    sums = all(isclose(abs(slope), 1.0, rel_tol=_EXACT) for slope in slopes)
    powers = [_power(ratio) for ratio in ratios] if reduced.relative[members].all() else [None]
    if sums and None in powers:
        terms = "".join(f" {'+' if slope > 0 else '-'} {name}" for slope, name in zip(slopes, names[1:], strict=True))
        return f"only {names[0]}{terms} acts"
    if not sums and None not in powers:
        return f"only {_product(names, [Fraction(1), *(power for power in powers if power is not None)])} acts"
    return "; ".join(  # how large a change of one parameter acts as a change of another
        f"1 % of {name} acts as about {ratio:.2g} % of {names[0]}"
        if reduced.relative[[first, other]].all()
        else f"{name} acts as {names[0]} does, in a fixed proportion"
        for other, name, ratio in zip(others, names[1:], ratios, strict=True)
    )


def _power(ratio: float) -> Fraction | None:
    """Give a ratio as a fraction of small numbers where it is one."""
    found = Fraction(ratio).limit_denominator(_LARGEST_POWER)
    small = 0 < abs(found.numerator) <= _LARGEST_POWER
    return found if small and isclose(float(found), ratio, rel_tol=_EXACT) else None


def _product(names: list[str], powers: list[Fraction]) -> str:
    """Write a product of powers, with whole exponents."""
    whole = int(np.lcm.reduce([power.denominator for power in powers]))
    factors: dict[bool, list[str]] = {True: [], False: []}
    for name, power in zip(names, powers, strict=True):
        exponent = abs(int(power * whole))
        factors[power > 0].append(name if exponent == 1 else f"{name}**{exponent}")
    return "/".join(["*".join(factors[True]), *factors[False]])
