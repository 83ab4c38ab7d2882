"""The solution of a route: closed forms, one for each root, and what is known about the roots.

A closed form is a list of lines, each a name and its value in samples, parameters and the names before it.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from hashlib import sha256
from pathlib import Path
from typing import Any

from faultbond.algebra.solving.branches import Condition
from faultbond.equations.inversion import substitute
from faultbond.equations.numeric import Real, is_nan, numeric_value
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, walk

VERSION = 2  # of the method; a cached solution of another version is not used
COMPACT_SIZE = 2000


class SolutionKind(Enum):
    """How the targets follow; the value says it in words."""

    LINEAR = "linear"
    QUADRATIC = "quadratic"
    POLYNOMIAL = "polynomial"
    NUMERIC = "numeric"
    UNDETERMINED = "undetermined"


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """`name = value`."""

    name: str
    value: Expression


@dataclass(frozen=True, slots=True, kw_only=True)
class Root:
    """One closed form of all targets: the last lines give them. conditions: where it conditions_hold."""

    lines: tuple[Line, ...]
    conditions: tuple[Condition, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Singular:
    """Where `name`, and what follows from it, has no value: words say for which values of the expression."""

    name: str
    expression: Expression
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Solution:
    """What solving a route gave.

    Parameters
    ----------
    targets : parameters by name, signals by name and frame (`omega_0`)
    kind : linear, quadratic, polynomial; numeric where roots are found by Newton's method only; undetermined where the
        equations leave the targets open, whatever the samples
    degree : number of algebraic roots, complex ones and those of every case included; None where not counted
    real_roots : number of real roots that satisfy all equations, at the nominal plant; where the kind is numeric, those
        that were found; None where not counted
    roots : closed forms, each checked in the original equations; empty where there is none
    singular : where they have no value
    remarks : what was left out, and why there is no closed form
    """

    targets: tuple[str, ...]
    kind: SolutionKind
    degree: int | None
    real_roots: int | None
    roots: tuple[Root, ...] = ()
    singular: tuple[Singular, ...] = ()
    remarks: tuple[str, ...] = ()


def evaluate_root(root: Root, values: Mapping[str, Real]) -> dict[str, Real]:
    """Give every name of a closed form its value, exactly where all values are fractions and roots are of squares.

    Parameters
    ----------
    root : a closed form
    values : parameters and samples by name, and `dt`; nan results where a line has no real value
    """
    known = dict(values)
    for line in root.lines:
        known[line.name] = numeric_value(line.value, known)
    return {line.name: known[line.name] for line in root.lines}


def conditions_hold(root: Root, values: Mapping[str, Real]) -> bool:
    """Whether the conditions of a root hold for its values among others."""
    for condition in root.conditions:
        value = numeric_value(condition.expression, values)
        if not (value > 0 or (value == 0 and not condition.strict)):
            return False
    return True


def solve_samples(solution: Solution, values: Mapping[str, Real]) -> tuple[dict[str, Real], ...]:
    """Give the targets by each closed form whose conditions hold and that has a value."""
    found = []
    for root in solution.roots:
        result = evaluate_root(root, values)
        if conditions_hold(root, {**values, **result}) and not any(is_nan(result[name]) for name in solution.targets):
            found.append({name: result[name] for name in solution.targets})
    return tuple(found)


def closed_form(root: Root, target: str, limit: int = COMPACT_SIZE) -> Expression | None:
    """Give a target in samples and parameters alone; None where that has more parts than the limit."""
    values: dict[str, Expression] = {}
    sizes: dict[str, int] = {}
    for line in root.lines:
        sizes[line.name] = sum(sizes.get(part.text, 1) if isinstance(part, Name) else 1 for part in walk(line.value))
        if sizes[line.name] <= limit:
            values[line.name] = substitute(line.value, values)
    return values.get(target)


def to_record(solution: Solution) -> dict[str, Any]:
    """Give a solution as plain lists and mappings, for a file."""
    return {
        "targets": list(solution.targets),
        "kind": solution.kind.value,
        "degree": solution.degree,
        "real_roots": solution.real_roots,
        "roots": [
            {
                "lines": [[line.name, _listed(line.value)] for line in root.lines],
                "conditions": [[_listed(item.expression), item.strict] for item in root.conditions],
            }
            for root in solution.roots
        ],
        "singular": [[item.name, _listed(item.expression), item.words] for item in solution.singular],
        "remarks": list(solution.remarks),
    }


def from_record(record: Mapping[str, Any]) -> Solution:
    """Give the solution that `to_record` wrote.

    Raises
    ------
    ValueError, KeyError, TypeError
        Where the record is not one of these.
    """
    return Solution(
        targets=tuple(map(str, record["targets"])),
        kind=SolutionKind(record["kind"]),
        degree=record["degree"],
        real_roots=record["real_roots"],
        roots=tuple(
            Root(
                lines=tuple(Line(name=str(name), value=_unlisted(value)) for name, value in root["lines"]),
                conditions=tuple(
                    Condition(expression=_unlisted(value), strict=bool(strict)) for value, strict in root["conditions"]
                ),
            )
            for root in record["roots"]
        ),
        singular=tuple(
            Singular(name=str(name), expression=_unlisted(value), words=str(words))
            for name, value, words in record["singular"]
        ),
        remarks=tuple(map(str, record["remarks"])),
    )


def _listed(expression: Expression) -> Any:
    match expression:
        case Number(value):
            return value
        case Name(text):
            return text
        case Negative(operand):
            return ["-", _listed(operand)]
        case Binary(operator, left, right):
            return [operator, _listed(left), _listed(right)]
        case Call(function, arguments):
            return ["()", function, *map(_listed, arguments)]
    raise ValueError(expression)


def _unlisted(value: Any) -> Expression:
    match value:
        case str():
            return Name(value)
        case int() | float():
            return Number(float(value))
        case ["-", operand]:
            return Negative(_unlisted(operand))
        case ["()", str(function), *arguments]:
            return Call(function, tuple(map(_unlisted, arguments)))
        case [str(operator), left, right]:
            return Binary(operator, _unlisted(left), _unlisted(right))
    raise ValueError("not an expression")


def read_cached(folder: Path, key: str) -> Solution | None:
    """Give the solution kept under a key; None where there is none that can be read."""
    try:
        return from_record(json.loads((folder / f"{key}.json").read_text(encoding="utf-8")))
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def write_cached(folder: Path, key: str, solution: Solution) -> None:
    """Keep a solution under a key; a folder that cannot be written to is no error, it only costs time."""
    try:
        folder.parent.mkdir(mode=0o700, parents=True, exist_ok=True)  # it may hold code, too
        folder.mkdir(mode=0o700, exist_ok=True)
        draft = folder / f"{key}.json.{sha256(repr(solution).encode()).hexdigest()[:12]}"
        draft.write_text(json.dumps(to_record(solution), separators=(",", ":")), encoding="utf-8")
        draft.replace(folder / f"{key}.json")
    except OSError:
        return
