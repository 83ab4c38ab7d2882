"""Data in and out: recordings and the grid of samples, kept runs, the output of the verbs, built-in examples.

In: files, streams and what the command line says. Out: rows and grid points in SI; records, text and files, replaced
as a whole. Read `row_block`, `csv_text`, `recording`, `grid`, `frozen`; `out`, `record_file`, `files`; then `saved`,
`archive`, `typed`; `cache`, `prepared`.
"""

from typing import TYPE_CHECKING

from faultbond.lazy import lazily

if TYPE_CHECKING:
    from faultbond.io.examples import example
    from faultbond.io.faults import FaultRequest, parse_fault
    from faultbond.io.grid import Counts, Grid, GridPoint, Row, on_grid
    from faultbond.io.out import Out
    from faultbond.io.recording import Column, Columns, columns_of, read_rows, write_recording

__all__ = [
    "Column",
    "Columns",
    "Counts",
    "FaultRequest",
    "Grid",
    "GridPoint",
    "Out",
    "Row",
    "columns_of",
    "example",
    "on_grid",
    "parse_fault",
    "read_rows",
    "write_recording",
]

__getattr__ = lazily(
    "faultbond.io",
    {
        "examples": "example",
        "faults": "FaultRequest parse_fault",
        "grid": "Counts Grid GridPoint Row on_grid",
        "out": "Out",
        "recording": "Column Columns columns_of read_rows write_recording",
    },
)
