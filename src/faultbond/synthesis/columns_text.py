"""The generated part of what a program reads: columns, units, ranges and the grid of a model as C."""

import math
from collections.abc import Iterable

from faultbond.contract.spec import EngineSpec
from faultbond.io.recording import Column, Columns, ends
from faultbond.model.graph import Unit
from faultbond.synthesis.plan_tables import integers, literal, numbers

SPARE_ROWS = 4  # times the rows that a sample has, by the model file, in which a jump is looked for
LEAST_ROWS = 64  # the same where a sample has few


def columns_text(spec: EngineSpec, columns: Columns) -> str:
    """Give `columns.h`: what a program for a model reads of a recording, for the files of `faultbond/program`.

    The tables have time first, then inputs, then sensors; without a column of time the first entries are spare.

    Parameters
    ----------
    spec : the grid and the noise of the sensors
    columns : headers, units and ranges, in the order of `spec`
    """
    clock = Column(header=columns.time.column or "", unit=columns.time.unit, role="time")
    every = (clock, *columns.inputs, *columns.outputs)
    parts = [
        "/* What is read of a recording: columns, units as factor and offset to SI, ranges, and the grid. */",
        "#ifndef FB_COLUMNS_H",
        "#define FB_COLUMNS_H",
        "#include <math.h>",
        *(f"#define {name} {value}" for name, value in _sizes(spec, columns).items()),
        _texts("COLUMN_HEADER", (item.header for item in every)),
        _texts("COLUMN_SHOWN", (repr(item.header) for item in every)),
        _texts("COLUMN_ROLE", (item.role for item in every)),
        numbers("COLUMN_FACTOR", (item.unit.factor for item in every)),
        numbers("COLUMN_OFFSET", (item.unit.offset for item in every)),
        *_ranges(columns),
        numbers("SENSOR_NOISE", (item.noise for item in spec.outputs)),
        integers("INPUT_HELD", (not item.linear for item in spec.inputs)),
        "#endif",
    ]
    return "\n".join(parts) + "\n"


def _sizes(spec: EngineSpec, columns: Columns) -> dict[str, int | str]:
    """Give what is defined: READ_TIME is 0 without a column of time, 1 with one, 2 where a recording may lack it."""
    clock, step = columns.time, spec.sample_time
    averaged = spec.row_time is not None and step is not None
    rows = math.ceil((step or 0.0) / (spec.row_time or 1.0)) if averaged else 0
    return {
        "N_INPUTS": len(columns.inputs),
        "N_OUTPUTS": len(columns.outputs),
        "READ_TIME": 0 if clock.column is None else 2 if clock.optional else 1,
        "READ_IS_VARIABLE": int(step is None),
        "READ_STEP": literal(step or 0.0),
        "READ_NUMBERED_STEP": literal(columns.sample_time or 1.0),
        "READ_MEANS": int(averaged),
        "READ_ROW_TIME": literal((spec.row_time or 0.0) if averaged else 0.0),
        "MEANS_KEPT": max(SPARE_ROWS * rows, LEAST_ROWS) if averaged else 1,
    }


def _ranges(columns: Columns) -> Iterable[str]:
    """Give the ends of the ranges in SI: what is beyond is absent, of a sensor also what is at them."""
    least, most = zip(ends(columns.inputs, inwards=False), ends(columns.outputs, inwards=True), strict=True)
    yield numbers("COLUMN_LEAST", (-math.inf, *least[0], *least[1]))
    yield numbers("COLUMN_MOST", (math.inf, *most[0], *most[1]))


def _texts(name: str, texts: Iterable[str]) -> str:
    lines = ",\n".join(f"    {_quoted(text)}" for text in texts)
    return f"static const char *const {name}[] = {{\n{lines}}};"


def _quoted(text: str) -> str:
    """Give a text as C, in UTF-8; bytes of other letters, and what C reads in its own way, by their numbers."""
    plain = (chr(byte) if 32 <= byte < 127 and chr(byte) not in '"\\?' else f"\\{byte:03o}" for byte in text.encode())
    return f'"{"".join(plain)}"'
