"""A small table: a dict of arrays that knows its units, and that data frames are made of."""

from collections.abc import Mapping
from html import escape
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import FaultbondError

SHOWN = 5  # rows at each end


class Frame(dict[str, FloatArray]):
    """Columns of equal length by header, each (n_rows,), not to be written to.

    `pandas.DataFrame(frame)`, `polars.DataFrame(frame)` and `pyarrow.table(frame)` take it as it is; where pyarrow is
    installed, so does whatever speaks the Arrow PyCapsule protocol.

    Parameters
    ----------
    columns : by header
    units : of the columns, as the model file writes them

    Example
    -------
    >>> frame = Frame({"time": np.arange(3.0)}, {"time": "s"})
    >>> len(frame["time"]), frame.units["time"]
    (3, 's')
    """

    def __init__(self, columns: Mapping[str, FloatArray], units: Mapping[str, str]) -> None:
        super().__init__({name: _still(values) for name, values in columns.items()})
        self.units = dict(units)

    @property
    def n_rows(self) -> int:
        """How many rows there are."""
        return len(next(iter(self.values()), ()))

    def to_pandas(self) -> Any:
        """Give a data frame of pandas.

        Raises
        ------
        FaultbondError
            Where pandas is not installed.
        """
        try:
            import pandas  # noqa: PLC0415 - optional
        except ImportError as error:
            raise _absent("pandas") from error
        return pandas.DataFrame({name: values.copy() for name, values in self.items()})

    def to_polars(self) -> Any:
        """Give a data frame of polars.

        Raises
        ------
        FaultbondError
            Where polars is not installed.
        """
        try:
            import polars  # noqa: PLC0415 - optional
        except ImportError as error:
            raise _absent("polars") from error
        return polars.DataFrame(dict(self))

    def to_arrow(self) -> Any:
        """Give a table of pyarrow.

        Raises
        ------
        FaultbondError
            Where pyarrow is not installed.
        """
        try:
            import pyarrow  # noqa: PLC0415 - optional
        except ImportError as error:
            raise _absent("pyarrow") from error
        return pyarrow.table(dict(self))

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        return self.to_arrow().__arrow_c_stream__(requested_schema)

    def __repr__(self) -> str:
        named = ", ".join(f"{name} ({self.units.get(name, '')})" for name in self)
        return f"<Frame of {self.n_rows} rows: {named}>"

    def _repr_html_(self) -> str:
        rows = [*range(self.n_rows)]
        shown = rows if len(rows) <= 2 * SHOWN else [*rows[:SHOWN], None, *rows[-SHOWN:]]
        head = "".join(f"<th>{escape(name)}<br><small>{escape(self.units.get(name, ''))}</small></th>" for name in self)
        cells = (
            "".join(f"<td>{'...' if row is None else format(values[row], '.6g')}</td>" for values in self.values())
            for row in shown
        )
        body = "".join(f"<tr>{row}</tr>" for row in cells)
        return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table><p>{self.n_rows} rows</p>"


def _absent(library: str) -> FaultbondError:
    return FaultbondError(f"{library} is not installed. Install it with: pip install {library}")


def _still(values: FloatArray) -> FloatArray:
    copy = np.array(values, dtype=np.float64)
    copy.setflags(write=False)
    return copy
