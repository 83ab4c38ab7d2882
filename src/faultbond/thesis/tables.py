"""The thesis' tables of static networks: values of parameters that explain observations, and relations of pairs."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import sympy as sp

from faultbond.networks.hypothesis import Hypothesis, advance, equations_of_parameters
from faultbond.networks.polynomial_roots import ExactPoint
from faultbond.networks.static_network import Observation, StaticNetwork, with_healthy

Suspects = tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """Values of suspended parameters that explain observations, exact where they can be; `free`: infinitely many."""

    points: tuple[ExactPoint, ...]
    free: bool

    @property
    def explains(self) -> bool:
        """Whether anything explains the observations."""
        return self.free or bool(self.points)


@dataclass(frozen=True, slots=True, kw_only=True)
class TableRelation:
    """What one observation says of parameters that it cannot determine: `A = 18/B - 4`, unless `B = 0`."""

    suspects: Suspects
    text: str
    unless: tuple[str, ...] = ()


def solve_suspects(network: StaticNetwork, suspects: Suspects, observations: Sequence[Observation]) -> Solved:
    """Give all values of suspended parameters that explain every one of some observations.

    Parameters
    ----------
    network : a network with suspected parameters; its noise is not used
    suspects : the parameters
    observations : what was seen
    """
    held = Hypothesis(suspects=suspects)
    rows: list[Observation] = []
    for seen in observations:
        rows.append(with_healthy(network, seen))
        held = advance(network, held, rows)
    return Solved(points=held.points, free=bool(held.systems))


def table_of_singles(network: StaticNetwork, observations: Sequence[Observation]) -> tuple[dict[str, Solved], ...]:
    """Give for each observation alone the values of each suspect alone: tables 3.3 to 3.5, upper part of 6.1."""
    return tuple({name: solve_suspects(network, (name,), [seen]) for name in network.suspects} for seen in observations)


def table_of_pairs(network: StaticNetwork, observations: Sequence[Observation]) -> tuple[dict[Suspects, Solved], ...]:
    """Give for each two successive observations the values of each two suspects: table 6.2."""
    pairs = list(combinations(network.suspects, 2))
    windows = [observations[k : k + 2] for k in range(len(observations) - 1)]
    return tuple({pair: solve_suspects(network, pair, window) for pair in pairs} for window in windows)


def table_relations(network: StaticNetwork, suspects: Suspects, seen: Observation) -> tuple[TableRelation, ...]:
    """Give what an observation says of suspended parameters: lower part of table 6.1.

    Each equation is solved for the first parameter that stands there linearly.
    """
    cases = equations_of_parameters(network, suspects, with_healthy(network, seen))
    return tuple(_relation(suspects, item) for case in cases for item in case)


def _relation(suspects: Suspects, item: sp.Expr) -> TableRelation:
    for name in suspects:
        symbol = sp.Symbol(name)
        polynomial = sp.Poly(item, symbol)
        if polynomial.degree() == 1:
            slope, constant = polynomial.all_coeffs()
            text = f"{name} = {_text(sp.expand(sp.cancel(-constant / slope)))}"
            singular = tuple(f"{factor} = 0" for factor, _ in sp.factor_list(slope)[1])  # division by zero
            return TableRelation(suspects=suspects, text=text, unless=singular)
    return TableRelation(suspects=suspects, text=f"{_text(sp.expand(item))} = 0")


def _text(expression: sp.Expr) -> str:
    """Write a sum with a term first that is not negative, where there is one."""
    terms = expression.as_ordered_terms()
    negative = [term for term in terms if term.could_extract_minus_sign()]
    first = " + ".join(str(term) for term in terms if term not in negative)
    return (first or "0") + "".join(f" - {-term}" for term in negative)
