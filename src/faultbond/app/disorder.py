"""Rows whose times are out of order, or alike: so many are of no use that what is left says little of the plant."""

from faultbond.errors import RecordingError
from faultbond.io.grid import Grid
from faultbond.io.memory_table import Recording

FEW = 20  # of so many rows one may be dropped


def disorder_of(grid: Grid) -> str:
    """Say that too many rows came too late to be used, or have the time of another row; empty where they have not."""
    if grid.repeats_times:
        return (
            f"{grid.n_again} of {grid.n_rows} rows have the time of another row, as where times are cut to whole "
            "seconds; write times with all their digits, or, of rows at even steps, state `time: none` in the model "
            "file"
        )
    if grid.n_dropped * FEW <= grid.n_rows:
        return ""
    return f"{grid.n_dropped} of {grid.n_rows} rows came too late to be used; sort the rows by time"


def refuse_disorder(grid: Grid, recording: Recording) -> None:
    """Refuse a recording of which too many rows came too late to be used, or have the time of another row.

    Raises
    ------
    RecordingError
        Where they are more than a twentieth, or more than half.
    """
    problem = disorder_of(grid)
    if problem:
        raise RecordingError(
            f"{recording}: {problem}{'' if grid.repeats_times else ', or check the column of `time`'}."
        )
