"""A recording in memory: columns by header, of a dict of arrays, a data frame, or a table of Arrow."""

import math
from collections.abc import Callable, Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import BoolArray, FloatArray
from faultbond.errors import RecordingError
from faultbond.io.arrow import ArrowTable
from faultbond.io.times import WITH_COMMA, finite_number, moment_of
from faultbond.model.graph import Unit

LOGIC = "logic"  # the unit of what is true or false


class MemoryTable:
    """Columns of equal length, each copied when it is asked for.

    Parameters
    ----------
    title : what messages call it
    names : of the columns
    column : gives the column at a place, (n_rows,)
    """

    def __init__(self, title: str, names: Sequence[str], column: Callable[[int], NDArray[Any]]) -> None:
        self.title, self.names, self._column = title, tuple(names), column

    def __str__(self) -> str:
        return self.title

    def numbered(self, number: int) -> "MemoryTable":
        """Give the same with a number in its title, as one of several."""
        return MemoryTable(f"{self.title} {number}", self.names, self._column)

    def column(self, name: str) -> NDArray[Any]:
        """Give a column, (n_rows,).

        Raises
        ------
        RecordingError
            Where it is no row of single values.
        """
        found = self._column(self.names.index(name))
        if found.ndim != 1:
            shape = "one value" if found.ndim == 0 else f"an array of shape {found.shape}"
            raise RecordingError(f"{self}: column {name!r} is {shape}. Give one value for each row.")
        return found

    def texts(self, name: str, without: BoolArray) -> list[tuple[int, str]]:
        """Give the texts among the rows (n_rows,) of a column that have no number, each with its row, from 1."""
        values = self.column(name)
        if values.dtype.kind not in "OU":
            return []
        return [(int(k) + 1, str(values[k])) for k in np.flatnonzero(without) if isinstance(values[k], str)]

    def numbers(self, name: str, role: str, unit: Unit) -> FloatArray:
        """Give a column in SI, (n_rows,), nan where there is no value.

        Parameters
        ----------
        name : of the column
        role : what it is, for messages, such as `sensor flow`
        unit : of what it holds

        Raises
        ------
        RecordingError
            Where it holds no numbers, or such with decimal commas.
        """
        values = self.column(name)
        if values.dtype.kind in "iuf" or (values.dtype.kind == "b" and unit.text == LOGIC):
            found = values.astype(np.float64)
        elif values.dtype.kind in "OUS":
            found = np.array([finite_number(value) for value in values], dtype=np.float64)
            self._refuse(name, role, values, found)
        else:
            kinds = {"M": "times", "m": "durations", "c": "complex numbers", "b": "truth values"}
            what = kinds.get(values.dtype.kind, str(values.dtype))
            raise RecordingError(f"{self}: column {name!r} ({role}) holds {what}. Numbers are expected.")
        found[~np.isfinite(found)] = math.nan
        return np.asarray(unit.factor * found + unit.offset)

    def moments(self, name: str, role: str, unit: Unit) -> FloatArray:
        """Give the times of the rows, (n_rows,), s; Unix seconds of dates. Arguments and errors as of `numbers`."""
        values = self.column(name)
        if values.dtype.kind in "Mm":
            parts = values.astype(f"{values.dtype.kind}8[us]")
            return np.where(np.isnat(parts), math.nan, parts.astype(np.int64) / 1e6)
        if values.dtype.kind not in "OUS":
            return self.numbers(name, role, unit)
        found = np.array([moment_of(value, unit) for value in values], dtype=np.float64)
        self._refuse(name, role, values, found)
        return found

    def _refuse(self, name: str, role: str, values: NDArray[Any], found: FloatArray) -> None:
        """Refuse what is no value where somebody has put one; single texts among numbers are missing, as in a file."""
        strange = [value for value, number in zip(values, found, strict=True) if math.isnan(number)]
        for value in strange:
            if isinstance(value, str) and WITH_COMMA.fullmatch(value):
                advice = "Decimal commas? Write numbers with a point."
                raise RecordingError(f"{self}: {name!r} is {value.strip()!r}. {advice}")
            if isinstance(value, list | tuple | dict | set | np.ndarray | date) and str(value) != "NaT":
                what = f"column {name!r} ({role}) holds a {type(value).__name__.lower()}"
                raise RecordingError(f"{self}: {what}. Give one number for each row.")
        text = next((value for value in strange if isinstance(value, str) and value.strip()), None)
        if text is not None and len(strange) == len(found):
            advice = "Give seconds, or dates as 2026-05-31 10:00:00." if role == "time" else "Give numbers."
            raise RecordingError(f"{self}: column {name!r} ({role}) holds text, such as {text[:40]!r}. {advice}")


Recording: TypeAlias = str | Path | MemoryTable  # a path, `-` for standard input, or what is in memory


def table_of(frame: object) -> MemoryTable:
    """Give what somebody has in memory as a recording.

    Parameters
    ----------
    frame : a mapping from headers to columns, a data frame that has columns with `to_numpy`, such as those of pandas
        and polars, or what has `__arrow_c_stream__`

    Raises
    ------
    RecordingError
        Where it is nothing of that kind.
    """
    if isinstance(frame, Mapping):
        names = [str(name) for name in frame]
        values = list(frame.values())
        return MemoryTable("the recording", names, lambda place: _array(values[place]))
    if hasattr(frame, "columns") and hasattr(frame, "to_numpy") and hasattr(frame, "__getitem__"):
        return _of_frame(frame)
    if hasattr(frame, "__arrow_c_stream__"):
        arrow = ArrowTable(frame)
        return MemoryTable("the table", arrow.names, arrow.column)
    advice = (
        "its `to_frame()`"
        if hasattr(frame, "to_frame")
        else "a path, a data frame, an Arrow table, or a dict of arrays"
    )
    raise RecordingError(f"{type(frame).__name__}: this is no recording. Give {advice}.")


def _of_frame(frame: Any) -> MemoryTable:
    """Give a data frame, and where its index has a name, that as a column, too."""
    names = list(frame.columns)
    index = getattr(getattr(frame, "index", None), "name", None)
    further = [index] if index is not None and index not in names else []

    def column(place: int) -> NDArray[Any]:
        return _array(frame.index if place == len(names) else frame[names[place]])

    return MemoryTable("the frame", [str(name) for name in (*names, *further)], column)


def _array(values: Any) -> NDArray[Any]:
    """Give a column as an array; a list of objects of several kinds is one of objects."""
    if hasattr(values, "to_numpy"):
        return np.asarray(values.to_numpy())
    try:
        found = np.asarray(values)
    except ValueError:  # lists of several lengths in it
        return np.asarray([None], dtype=object)
    mixed = found.dtype.kind in "US" and not isinstance(values, np.ndarray)
    return np.array(list(values), dtype=object) if mixed and np.ndim(values) == 1 else found
