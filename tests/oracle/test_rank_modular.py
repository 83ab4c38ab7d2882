"""Ranks of sensitivities against exact arithmetic modulo a large prime.

The slow version writes the plant down as equations, steps it by backward Euler with numbers modulo a prime that carry
their derivatives, and eliminates. Nothing is rounded, so a zero is a zero; that a number which is not zero is zero
modulo the prime has a chance of about one in the prime.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

from faultbond.analysis.ranks import reduce, set_ranks
from faultbond.analysis.testable import generic_run
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[2] / "examples"
PRIME = 2**61 - 1
SAMPLES = 24


@dataclass(frozen=True)
class Number:
    """A number modulo the prime, with its derivatives."""

    value: int
    slope: tuple[int, ...]

    def __add__(self, other: "Number") -> "Number":
        return Number((self.value + other.value) % PRIME, self.mix(other, 1, 1))

    def __sub__(self, other: "Number") -> "Number":
        return Number((self.value - other.value) % PRIME, self.mix(other, 1, -1))

    def __mul__(self, other: "Number") -> "Number":
        return Number(self.value * other.value % PRIME, self.mix(other, other.value, self.value))

    def __truediv__(self, other: "Number") -> "Number":
        one_over = pow(other.value, -1, PRIME)
        value = self.value * one_over % PRIME
        return Number(value, self.mix(other, one_over, -value * one_over))

    def mix(self, other: "Number", mine: int, its: int) -> tuple[int, ...]:
        """Add multiples of both derivatives."""
        return tuple((mine * a + its * b) % PRIME for a, b in zip(self.slope, other.slope, strict=True))


Matrix = list[list[Number]]
Rates = Callable[[Sequence[Number], Sequence[Number], Number, Number], list[Number]]  # x, theta, u, zero
Readings = Callable[[Sequence[Number], Sequence[Number], Number], list[Number]]  # x, theta, u


def solve(matrix: Matrix, right: list[Number]) -> list[Number]:
    """Solve linear equations by elimination."""
    rows = [[*row, value] for row, value in zip(matrix, right, strict=True)]
    n = len(rows)
    for k in range(n):
        pivot = next(i for i in range(k, n) if rows[i][k].value)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        rows[k] = [entry / rows[k][k] for entry in rows[k]]
        for i in range(n):
            if i != k:
                rows[i] = [a - rows[i][k] * b for a, b in zip(rows[i], rows[k], strict=True)]
    return [row[-1] for row in rows]


def rank_of(rows: Sequence[Sequence[int]]) -> int:
    """Rank modulo the prime."""
    left, found = [list(row) for row in rows], 0
    for column in range(len(left[0]) if left else 0):
        pivot = next((i for i in range(found, len(left)) if left[i][column]), None)
        if pivot is None:
            continue
        left[found], left[pivot] = left[pivot], left[found]
        inverse = pow(left[found][column], -1, PRIME)
        for i in range(found + 1, len(left)):
            factor = left[i][column] * inverse % PRIME
            left[i] = [(a - factor * b) % PRIME for a, b in zip(left[i], left[found], strict=True)]
        found += 1
    return found


def exact_slopes(rates: Rates, readings: Readings, n_x: int, n_theta: int, seed: int) -> list[tuple[int, ...]]:
    """Give the derivatives of all readings by [theta, x0], for random parameters, start, inputs and step."""
    rng = np.random.default_rng(seed)
    n = n_theta + n_x

    def fresh(place: int | None = None) -> Number:
        return Number(int(rng.integers(1, PRIME)), tuple(int(k == place) for k in range(n)))

    def plain(value: int) -> Number:
        return Number(value, (0,) * n)

    theta, x = [fresh(k) for k in range(n_theta)], [fresh(n_theta + k) for k in range(n_x)]
    zero, one, dt = plain(0), plain(1), fresh()
    found: list[tuple[int, ...]] = []
    for _ in range(SAMPLES):
        u = fresh()
        # The rates are affine in x: their columns are differences from x = 0.
        constant = rates([zero] * n_x, theta, u, zero)
        units = [[one if j == k else zero for j in range(n_x)] for k in range(n_x)]
        columns = [[a - b for a, b in zip(rates(unit, theta, u, zero), constant, strict=True)] for unit in units]
        matrix = [[units[i][j] - dt * columns[j][i] for j in range(n_x)] for i in range(n_x)]
        x = solve(matrix, [x[i] + dt * constant[i] for i in range(n_x)])
        found += [reading.slope for reading in readings(x, theta, u)]
    return found


def exact_rank(slopes: list[tuple[int, ...]], n_theta: int, members: Sequence[int]) -> int:
    """Rank of the columns of some parameters beyond what the start explains."""
    start = [row[n_theta:] for row in slopes]
    both = [(*(row[k] for k in members), *row[n_theta:]) for row in slopes]
    return rank_of(both) - rank_of(start)


def motor_rates(x: Sequence[Number], theta: Sequence[Number], u: Number, _zero: Number) -> list[Number]:
    """Rates of current and speed."""
    R, L, K, J, C = theta
    return [(u - R * x[0] - K * x[1]) / L, (K * x[0] - C * x[1]) / J]


def ladder_rates(x: Sequence[Number], theta: Sequence[Number], u: Number, zero: Number) -> list[Number]:
    """Rates of the voltages along a ladder; theta: R1, C1, R2, C2, ..."""
    n = len(x)
    flows = [((u if k == 0 else x[k - 1]) - x[k]) / theta[2 * k] for k in range(n)] + [zero]
    return [(flows[k] - flows[k + 1]) / theta[2 * k + 1] for k in range(n)]


def ladder(n: int, sensors: Sequence[str], seed: int) -> StepModel:
    """The same ladder as a model, with random values."""
    rng = np.random.default_rng(seed)
    parts, bonds, before = ["  source: {type: Se, law: e = V}"], [], "source"
    for k in range(1, n + 1):
        values = f"{rng.uniform(0.5, 2.0)} ohm", f"{rng.uniform(0.5, 2.0)} F"
        parts.append(f"  R{k}: {{type: R, parameters: {{R{k}: {values[0]}}}}}")
        parts.append(f"  C{k}: {{type: C, parameters: {{C{k}: {values[1]}}}}}")
        bonds += [f"{before} -> l{k} -> R{k}", f"l{k} -> n{k} -> C{k}"]
        before = f"n{k}"
    junctions = ", ".join(f"l{k}: 1, n{k}: 0" for k in range(1, n + 1))
    read = ", ".join(f"s{k}: {{reads: {signal}, noise: 1e-3}}" for k, signal in enumerate(sensors))
    text = (
        "name: ladder\nsample_time: 0.5 s\ninputs: {V: {unit: V}}\ncomponents:\n" + "\n".join(parts) + "\n"
        f"junctions: {{{junctions}}}\nbonds: [{', '.join(bonds)}]\nsensors: {{{read}}}\n"
    )
    return build_step_model(build_plant(parse_model(text)))


def compare(model: StepModel, slopes: list[tuple[int, ...]], largest: int) -> int:
    """Hold the rank, and that of every set up to a size, against the exact ones; give the rank."""
    seen = reduce([generic_run(model)])
    n = len(seen.parameters)
    assert seen.rank.clear
    assert seen.rank.value == exact_rank(slopes, n, range(n))
    for size in range(1, largest + 1):
        sets = tuple(combinations(range(n), size))
        ranks, doubt = set_ranks(seen, sets)
        assert not doubt.any()
        assert ranks.tolist() == [exact_rank(slopes, n, item) for item in sets]
    return seen.rank.value


@pytest.mark.parametrize("name", ["dc_motor", "dc_motor_current"])
def test_motor(name: str) -> None:
    """The rank of every set of the motor's parameters is the exact one, with and without the current (G20)."""
    model = build_step_model(build_plant(load_model(EXAMPLES / name / "model.yaml")))
    measured = (1,) if name == "dc_motor" else (1, 0)
    slopes = exact_slopes(motor_rates, lambda x, _theta, _u: [x[k] for k in measured], 2, 5, seed=1)
    assert compare(model, slopes, 5) == (3 if name == "dc_motor" else 5)


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_ladder_with_one_sensor_at_its_end(n: int) -> None:
    """From the last voltage alone, as many combinations show as there are stages; each set's rank is the exact one."""
    model = ladder(n, [f"n{n}.e"], seed=n)
    slopes = exact_slopes(ladder_rates, lambda x, _theta, _u: [x[-1]], n, 2 * n, seed=n)
    assert compare(model, slopes, 2) == n


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_ladder_with_sensors_at_both_ends(n: int) -> None:
    """With the first current measured too, every parameter shows; each set's rank is the exact one."""
    model = ladder(n, [f"n{n}.e", "l1.f"], seed=n)
    slopes = exact_slopes(ladder_rates, lambda x, theta, u: [x[-1], (u - x[0]) / theta[0]], n, 2 * n, seed=n)
    assert compare(model, slopes, 2) == 2 * n
