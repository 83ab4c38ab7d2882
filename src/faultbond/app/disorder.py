"""Rows that are out of order in time: so many came too late to be used that what is left says little of the plant."""

from faultbond.errors import RecordingError
from faultbond.io.grid import Grid
from faultbond.io.memory_table import Recording

FEW = 20  # of so many rows one may be dropped


def disorder_of(grid: Grid) -> str:
    """Say that too many rows came too late to be used; empty where they did not."""
    if grid.n_dropped * FEW <= grid.n_rows:
        return ""
    return f"{grid.n_dropped} of {grid.n_rows} rows came too late to be used; sort the rows by time"


def refuse_disorder(grid: Grid, recording: Recording) -> None:
    """Refuse a recording of which too many rows came too late to be used.

    Raises
    ------
    RecordingError
        Where they are more than a twentieth.
    """
    problem = disorder_of(grid)
    if problem:
        raise RecordingError(f"{recording}: {problem}, or check the column of `time`.")
