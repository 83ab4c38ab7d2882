"""What is not known of healthy parameters goes together: correlations of their accuracies.

Such as two inertias of which recordings show the ratio to 1 %, but their common scale, which lies in a torque, to 5 %.
"""

from collections.abc import Iterable, Mapping, Sequence

from faultbond.errors import ModelError
from faultbond.model.graph import Correlation, Parameter
from faultbond.model.parser import number_text
from faultbond.model.quantities import quantity
from faultbond.model.source import choice, shown
from faultbond.model.spot import Spot

LEAST_LEFT = 1e-9  # of a variance, once all others are known; less is lost in rounding
_STEPS = 30  # of bisection

Pairs = Mapping[tuple[str, str], float]


def read_correlations(place: Spot, parameters: Sequence[Parameter]) -> tuple[Correlation, ...]:
    """Read `correlations`, each pair in the order of the parameters.

    Parameters
    ----------
    place : a table of tables, `{J: {K: 0.96, L: 0.95}}`
    parameters : all of the model

    Raises
    ------
    ModelError
        Where a name is no parameter with an accuracy, a pair stands twice, a number is none between -1 and 1, or no
        numbers can go together as stated.
    """
    known = {item.name: item for item in parameters}
    order = {name: k for k, name in enumerate(known)}
    found: dict[tuple[str, str], Correlation] = {}
    for row in place.things("correlations of", checked=False):
        one = _parameter(row, known)
        for cell in row.things(f"correlation of {one} and", checked=False):
            other = _parameter(cell, known)
            if other == one:
                raise cell.error(": a parameter goes with itself anyway; remove it")
            pair = (one, other) if order[one] < order[other] else (other, one)
            if pair in found:
                raise cell.error(f" is stated twice, before at line {found[pair].line}; remove one")
            found[pair] = Correlation(one=pair[0], other=pair[1], value=_value(cell), line=cell.entry.line)
    stated = tuple(sorted(found.values(), key=lambda item: (order[item.one], order[item.other])))
    _check_together(place, stated)
    return stated


def _parameter(place: Spot, known: Mapping[str, Parameter]) -> str:
    """Give the name that a key is; an error unless it is a parameter that is not known exactly."""
    name = place.entry.key
    if name not in known:
        raise place.error(f": no parameter is called `{shown(name)}`; {choice(name, known)}")
    if known[name].accuracy == 0.0:
        raise place.error(f": {name} has accuracy 0, so it is known exactly; state how well it is known, or remove it")
    return name


def _value(place: Spot) -> float:
    found = quantity(place.text(), place.where())
    if found.measure is not None or not -1.0 < found.number < 1.0:
        raise place.error(f" is a number between -1 and 1, such as `0.9`, not `{shown(place.text())}`")
    return found.number


def _check_together(place: Spot, stated: Sequence[Correlation]) -> None:
    """Refuse numbers of which no uncertainties can be: their matrix is not positive definite."""
    pairs = {(item.one, item.other): item.value for item in stated}
    if is_definite(pairs):
        return
    rest = _contradicting(pairs)
    lines = {item.line for item in stated if (item.one, item.other) in rest}
    words = ", ".join(f"{one} and {other} {number_text(value)}" for (one, other), value in rest.items())
    problem = f"{words} cannot all be; what goes with one thing closely goes with each other"
    where, factor = place.source.at(min(lines)), _largest_factor(rest)
    raise ModelError(f"{where}correlations: {problem}. Correct one, or multiply all by {factor:g}")


def is_definite(pairs: Pairs) -> bool:
    """Tell whether correlations by pairs of names leave something of each variance once all others are known.

    Source: Golub and Van Loan, Matrix Computations, 4th ed., 4.2 (Cholesky).

    Example
    -------
    >>> is_definite({("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): 0.7})
    True
    >>> is_definite({("a", "b"): 0.9, ("b", "c"): 0.9, ("a", "c"): -0.7})
    False
    """
    names = _names(pairs)
    rows = list[list[float]]()
    for i, name in enumerate(names):
        row = list[float]()
        for j in range(i):
            value = pairs.get((name, names[j]), pairs.get((names[j], name), 0.0))
            row.append((value - sum(a * b for a, b in zip(row, rows[j], strict=False))) / rows[j][j])
        left = 1.0 - sum(a * a for a in row)
        if not left > LEAST_LEFT:
            return False
        rows.append([*row, left**0.5])
    return True


def _names(pairs: Pairs) -> list[str]:
    return list(dict.fromkeys(name for pair in pairs for name in pair))


def _contradicting(pairs: Pairs) -> Pairs:
    """Give the pairs of as few parameters as contradict each other."""
    left = pairs
    for name in _names(pairs):
        without = {pair: value for pair, value in left.items() if name not in pair}
        left = left if is_definite(without) else without
    return left


def _largest_factor(pairs: Pairs) -> float:
    """Give by what all are to be multiplied to go together, rounded down."""
    low, high = 0.0, 1.0
    for _ in range(_STEPS):
        middle = (low + high) / 2
        low, high = (middle, high) if is_definite(scaled(pairs, middle)) else (low, middle)
    return int(low * 1000) / 1000


def scaled(pairs: Pairs, factor: float) -> dict[tuple[str, str], float]:
    """Give all correlations times a factor."""
    return {pair: factor * value for pair, value in pairs.items()}


def correlation_rows(correlations: Iterable[Correlation]) -> dict[str, dict[str, str]]:
    """Give correlations as they are written: by the first name, then by the other."""
    rows: dict[str, dict[str, str]] = {}
    for item in correlations:
        rows.setdefault(item.one, {})[item.other] = number_text(item.value)
    return rows
