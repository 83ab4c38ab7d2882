"""Why two sets of suspects look alike, in words."""

from collections.abc import Mapping
from fractions import Fraction
from math import isclose, radians, sin

import numpy as np

from faultbond.analysis.ranks import ReducedSensitivities

Set = tuple[int, ...]

_EXACT = 1e-6
_LARGEST_POWER = 4


def why_alike(reduced: ReducedSensitivities, sets: tuple[Set, ...], smaller: Mapping[frozenset[Set], str]) -> str:
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


def why_near(reduced: ReducedSensitivities, pair: tuple[Set, Set], angle: float) -> str:
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
    return "; ".join(_compared(reduced, first, other, ratio) for other, ratio in zip(others, ratios, strict=True))


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


def _compared(reduced: ReducedSensitivities, first: int, other: int, ratio: float) -> str:
    """Say how large a change of one parameter acts as a change of another."""
    one, two = reduced.parameters[first], reduced.parameters[other]
    if reduced.relative[[first, other]].all():
        return f"1 % of {two} acts as about {ratio:.2g} % of {one}"
    return f"{two} acts as {one} does, in a fixed proportion"
