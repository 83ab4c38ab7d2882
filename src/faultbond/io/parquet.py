"""Recordings in Parquet files."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

from faultbond.errors import RecordingError
from faultbond.io.csv_text import reading


def is_parquet(path: Path) -> bool:
    """Whether a file says that it is Parquet, by its name or its first bytes."""
    if path.suffix.lower() in (".parquet", ".pq"):
        return True
    if not path.is_file():  # what is read of a pipe is gone
        return False
    with reading(str(path)), path.open("rb") as stream:
        return stream.read(4) == b"PAR1"


def parquet_records(
    path: Path, wanted: Callable[[Sequence[str]], Sequence[str]]
) -> Iterator[tuple[int, Sequence[object]]]:
    """Give (row, fields) of a Parquet file, header first.

    Parameters
    ----------
    path : of the file
    wanted : gives the columns to load, of all that there are; fields of others are None

    Raises
    ------
    RecordingError
        Where pyarrow is missing, or this is no such file.
    """
    try:
        import pyarrow  # noqa: PLC0415 - optional
        import pyarrow.parquet  # noqa: PLC0415 - optional
    except ImportError as error:
        raise RecordingError(
            f"{path}: reading Parquet needs pyarrow. Install it with: pip install 'faultbond[parquet]'"
        ) from error
    with reading(str(path)):
        try:
            file = pyarrow.parquet.ParquetFile(path)
            found = file.schema_arrow.names
            yield 0, found
            names = wanted(found)
            number = 0
            for batch in file.iter_batches(columns=names):
                by_name = {name: _python_values(batch.column(name), pyarrow) for name in names}
                nothing = [None] * batch.num_rows
                for fields in zip(*(by_name.get(name, nothing) for name in found), strict=True):
                    number += 1
                    yield number, fields
        except (pyarrow.ArrowException, OverflowError, ValueError) as error:  # the latter of values beyond Python's
            reason = str(error).partition("\n")[0]
            raise RecordingError(f"{path}: this is not a Parquet file that can be read ({reason}).") from error


def _python_values(column: Any, pyarrow: ModuleType) -> list[object]:
    """Give a Parquet column as Python objects; times are cut to microseconds, which `datetime` can hold."""
    if pyarrow.types.is_timestamp(column.type):
        column = column.cast(pyarrow.timestamp("us", tz=column.type.tz), safe=False)
    return list(column.to_pylist())
