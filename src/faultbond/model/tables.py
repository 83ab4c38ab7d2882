"""Measured curves: the points of a table, from the model file or from a CSV file beside it."""

import csv
import math
from collections.abc import Iterable, Iterator
from itertools import pairwise
from pathlib import Path

from faultbond.model.expression import TABLE, Call, Expression, walk
from faultbond.model.graph import Curve
from faultbond.model.head import Head
from faultbond.model.keys import BETWEEN, BEYOND, TABLE_KEYS
from faultbond.model.quantities import NO_UNIT
from faultbond.model.source import closest, shown
from faultbond.model.spot import Spot
from faultbond.model.units import Measure, measure

MOST_POINTS = 200
_LARGEST = 1e100  # SI

Measures = tuple[Measure | None, Measure | None]  # of both axes; None: no unit was written


def read_tables(head: Head, fields: dict[str, Spot]) -> tuple[tuple[Curve, ...], dict[str, Measures]]:
    """Give the tables of a model, and the measures of their axes by name.

    Raises
    ------
    ModelError
        at the first one that is no curve.
    """
    if "tables" not in fields:
        return (), {}
    if head.static:
        problem = (
            ": with `sample_time: none` laws are solved exactly, and a curve is not; write it as a law, or remove it"
        )
        raise fields["tables"].error(problem)
    found, measures = [], dict[str, Measures]()
    for place in fields["tables"].things("table"):
        own = place.fields(TABLE_KEYS)
        axes = (_unit(own.get("x")), _unit(own.get("y")))
        found.append(_table(head, place, own, axes))
        measures[place.name] = axes
    return tuple(found), measures


def table_calls(expression: Expression) -> Iterator[str]:
    """Give the names of the tables that an expression looks into."""
    for part in walk(expression):
        if isinstance(part, Call) and part.function.startswith(TABLE):
            yield part.function.removeprefix(TABLE)


def check_tables(known: Iterable[Curve], used: Iterable[tuple[Expression, Spot]], source: Spot) -> None:
    """Refuse a table that is not there, and one that nobody looks into.

    Parameters
    ----------
    known : the tables
    used : all expressions, each with a place for messages
    source : the place of the model

    Raises
    ------
    ModelError
        at the first of them.
    """
    names = {item.name: item for item in known}
    seen = set[str]()
    for expression, place in used:
        for name in table_calls(expression):
            seen.add(name)
            if name not in names:
                near = closest(name, names) or "state its points under `tables`"
                raise place.error(f"no table `{shown(name)}`; {near}")
    for name, item in names.items():
        if name not in seen:
            problem = f"no law and no sensor looks into it; write `table(x, {name})`, or remove it"
            raise source.source.error(item.line, f"table {name}: {problem}")


def _unit(place: Spot | None) -> Measure | None:
    return None if place is None else measure(place.text(), place.where(": "))


def _table(head: Head, place: Spot, fields: dict[str, Spot], axes: Measures) -> Curve:
    if ("points" in fields) == ("file" in fields):
        raise place.error(": state either `points: [[x, y], ..]` or `file: curve.csv`")
    rows = _points(fields["points"]) if "points" in fields else _rows(fields["file"], Path(head.source.label).parent)
    where = fields["points"] if "points" in fields else fields["file"]
    if not 2 <= len(rows) <= MOST_POINTS:
        raise where.error(f" has {len(rows)} point{'s'[: len(rows) != 1]}; a table has 2 to {MOST_POINTS}")
    x, y = (tuple((axis.unit if axis else NO_UNIT).to_si(row[k]) for row in rows) for k, axis in enumerate(axes))
    if any(after <= before for before, after in pairwise(x)):
        k = next(k for k in range(len(x) - 1) if x[k + 1] <= x[k])
        problem = f": x must grow from point to point, but {rows[k + 1][0]:g} follows {rows[k][0]:g}; sort the points"
        raise where.error(problem)
    for key, known in (("between", BETWEEN), ("beyond", BEYOND)):
        if key not in fields:
            head.defaults.missing(TABLE_KEYS, key, place.name)
        elif fields[key].text() not in known:
            raise fields[key].error(f" is `{known[0]}` or `{known[1]}`, not `{shown(fields[key].text())}`")
    return Curve(
        name=place.name,
        x=x,
        y=y,
        x_unit=axes[0].unit if axes[0] else NO_UNIT,
        y_unit=axes[1].unit if axes[1] else NO_UNIT,
        monotone="between" in fields and fields["between"].text() == BETWEEN[1],
        continues="beyond" in fields and fields["beyond"].text() == BEYOND[1],
        file=fields["file"].text() if "file" in fields else "",
        line=place.line,
    )


def _points(place: Spot) -> list[tuple[float, float]]:
    """Give the points that stand in the model file."""
    found = []
    for item in place.items():
        pair = [part.text() for part in item.items()]
        if len(pair) != 2:
            raise item.error(f": a point is `[x, y]`, and this has {len(pair)} numbers")
        found.append((_number(pair[0], item), _number(pair[1], item)))
    return found


def _rows(place: Spot, folder: Path) -> list[tuple[float, float]]:
    """Give the points of a CSV file: the first two columns, below a header if the first row is no numbers."""
    name = place.text()
    if Path(name).name != name:
        raise place.error(f": `{shown(name)}` lies elsewhere; name a file beside the model file")
    try:
        text = (folder / name).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "it is no UTF-8 text"
        raise place.error(
            f": `{shown(name)}` cannot be read: {reason}; name a CSV file beside the model file"
        ) from None
    found = []
    for number, row in enumerate(csv.reader(text.splitlines())):
        cells = [cell.strip() for cell in row]
        if not any(cells) or (number == 0 and not _is_number(cells[0])):
            continue
        if len(cells) < 2:
            raise place.error(
                f": row {number + 1} of `{shown(name)}` has one column; give x and y, with a comma between"
            )
        found.append((_number(cells[0], place), _number(cells[1], place)))
    return found


def _is_number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def _number(text: str, place: Spot) -> float:
    if not (text.isascii() and _is_number(text) and abs(float(text)) < _LARGEST):
        raise place.error(f": `{shown(text)}` is no number; units of the points stand under `x` and `y` of the table")
    return float(text)
