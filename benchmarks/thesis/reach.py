"""Section 6.5 of the thesis: how much three components of the motor can explain, by fits and by algebra."""

from collections.abc import Sequence
from functools import cache
from itertools import combinations

import numpy as np

from benchmarks.thesis.hypotheses import model
from benchmarks.thesis.motor import NOMINAL
from benchmarks.thesis.page import Parts, equal, set_text, table
from faultbond.analysis.solutions import reachable

BEHAVIOURS, LOW, HIGH, SEED = 25, 0.5, 2.0, 0
INDEPENDENT = {  # of 25 other motors, by another program; a solver that failed counted as none
    "RLJ": 12,
    "RLC": 13,
    "RLK": 24,
    "RJC": 15,
    "RJK": 25,
    "RCK": 7,
    "LJC": 11,
    "LJK": 16,
    "LCK": 23,
}
REMARK = "erratum: not always with positive values"


@table("6.1.2 and 6.5, pages 124 and 148")
def three_components() -> Parts:
    """Section 6.5: what three components can explain."""
    triples = list(combinations("RLJCK", 3))
    found = reachable(model("motor"), triples, behaviours=BEHAVIOURS, low=LOW, high=HIGH, seed=SEED)
    lines = []
    for item in found:
        exact = exact_count(item.parameters)
        other = INDEPENDENT.get("".join(item.parameters))
        ours = f"{item.reached} of {item.tried}; {exact} by algebra; {'-' if other is None else other} of others"
        always = exact == item.tried
        line = equal(set_text(item.parameters), "always", ours, "" if always else REMARK, same=always)
        lines.append(line)
    yield (
        "The thesis: with three components a positive answer is always obtained. Near the nominal motor that "
        f"holds. Here are {BEHAVIOURS} random motors, all five parameters between half and twice nominal: how many of "
        "their behaviours positive values of three parameters give, the other two nominal. First what the search for "
        "solutions finds, which is a lower bound, then the exact number, then what another program found for 25 other "
        "motors, a lower bound, too."
    )
    yield from lines


def exact_count(triple: Sequence[str]) -> int:
    """Give how many of the random motors positive values of three parameters can imitate."""
    return sum(is_possible(triple, *lumps) for lumps in _motors())


@cache
def _motors() -> list[tuple[float, float, float]]:
    """Give the lumps L J/K, (J R + L C)/K, (R C + K^2)/K of the motors that `reachable` draws."""
    names = [item.name for item in model("motor").plant.graph.parameters]
    nominal = np.array([float(NOMINAL[name]) for name in names])
    shape = (BEHAVIOURS, len(names))
    factors = np.exp(np.random.default_rng(SEED).uniform(np.log(LOW), np.log(HIGH), shape))
    motors = []
    for row in factors * nominal:
        value = dict(zip(names, row.tolist(), strict=True))
        r, ell, k, j, c = (value[name] for name in "RLKJC")
        motors.append((ell * j / k, (j * r + ell * c) / k, (r * c + k**2) / k))
    return motors


def is_possible(triple: Sequence[str], a: float, b: float, c: float) -> bool:
    """Whether positive values of three parameters, the others nominal, give the lumps a, b, c.

    For a given K, the products J R and L C are the roots of t^2 - b K t + L J R C with L J = a K, R C = c K - K^2.
    """
    nominal = {name: float(value) for name, value in NOMINAL.items()}
    fixed = {name: value for name, value in nominal.items() if name not in triple}
    match fixed:
        case {"K": k}:
            return _are_real(a, b, c, k)
        case {"L": ell, "J": j}:
            return _are_real(a, b, c, ell * j / a)
        case {"R": r, "C": f}:
            return any(_are_real(a, b, c, k) for k in _positive(1.0, -c, r * f))
        case {"J": one, "C": other} | {"L": one, "R": other}:  # one/other * (c - K) + a other/one = b
            return 0.0 < c - (b - a * other / one) * other / one < c
        case {"L": one, "C": other} | {"J": one, "R": other}:
            product = one * other  # K^2 (c - K) a/product + product = b K
            return any(k < c for k in _positive(-a / product, a * c / product, -b, product))
    raise ValueError(f"{triple}: three parameters of the motor")


def _are_real(a: float, b: float, c: float, k: float) -> bool:
    """Whether J R and L C are real; they are positive then."""
    inner = c * k - k**2
    return inner > 0.0 and (b * k) ** 2 >= 4.0 * a * k * inner


def _positive(*coefficients: float) -> list[float]:
    """Give the real positive roots of a polynomial."""
    return [
        float(root.real) for root in np.roots(coefficients) if abs(root.imag) < 1e-9 * abs(root) and root.real > 0.0
    ]
