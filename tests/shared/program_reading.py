"""The reading side of the program as tests use it: compiled for a kind of model, beside Python's reader and grid."""

import ctypes
import subprocess
import sys
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from compiled_once import compiled_once
from faultbond.contract.spec import EngineSpec, InputSpec, OutputSpec, Thresholds
from faultbond.errors import RecordingError
from faultbond.io.grid import Counts, Grid, GridClock, GridPoint
from faultbond.io.recording import Column, Columns, read_blocks
from faultbond.model.graph import TimeColumn, Unit
from faultbond.synthesis.columns_text import columns_text
from faultbond.types import Hold

SOURCE = Path(sys.modules["faultbond"].__path__[0])
HARNESS = Path(__file__).with_suffix(".c")
STRICT = ("-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", "-O1", "-ffp-contract=off")
MOST_POINTS = 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """What is read of a recording for a model."""

    spec: EngineSpec
    columns: Columns

    def grid(self, clock: GridClock | None = None) -> Grid:
        """The grid of a live run."""
        return Grid(
            self.spec.sample_time,
            live=True,
            noise=[item.noise for item in self.spec.outputs],
            clock=clock,
            row_time=self.spec.row_time,
            held=[not item.linear for item in self.spec.inputs],
        )


ONE = Unit("1")


def kind_of(
    inputs: tuple[Column, ...],
    outputs: tuple[Column, ...],
    *,
    sample_time: float | None = 1.0,
    row_time: float | None = None,
    time: TimeColumn | None = None,
    linear: tuple[bool, ...] = (),
) -> Kind:
    """Give a kind of model; its sensors have a noise of 0.5 in SI."""
    linear = linear or (False,) * len(inputs)
    spec = EngineSpec(
        model="m",
        model_sha256="",
        version="1",
        sample_time=sample_time,
        row_time=row_time,
        states=(),
        slow_errors=(),
        parameters=(),
        inputs=tuple(
            InputSpec(
                name=item.header,
                noise=0.0,
                settling=0.0,
                step=0.0,
                step_part=0.0,
                hold=Hold.LINEAR if is_linear else Hold.LAST,
            )
            for item, is_linear in zip(inputs, linear, strict=True)
        ),
        outputs=tuple(
            OutputSpec(name=item.header, noise=0.5, direct_inputs=(), unit="", unit_factor=1.0, unit_offset=0.0)
            for item in outputs
        ),
        loops=(),
        hypotheses=(),
        thresholds=Thresholds(),
    )
    columns = Columns(time=time or TimeColumn(), inputs=inputs, outputs=outputs, sample_time=row_time or sample_time)
    return Kind(spec=spec, columns=columns)


def column(header: str, role: str, unit: Unit = ONE, lower: float = -np.inf, upper: float = np.inf) -> Column:
    """Give a column."""
    return Column(header=header, unit=unit, role=role, lower=lower, upper=upper)


KINDS = {
    "plain": kind_of((column("u", "input u"),), (column("y", "sensor y"), column("z", "sensor z"))),
    "units": kind_of(
        (column("heater", "input heater", Unit("kW", 1000.0), 0.0, 5000.0),),
        (
            column("warm water", "sensor T", Unit("degC", 1.0, 273.15), 263.15, 373.15),
            column("p'\"\u00e9", "sensor p", Unit("bar", 1e5)),
        ),
        sample_time=0.5,
        time=TimeColumn(column="clock", unit=Unit("min", 60.0)),
    ),
    "variable": kind_of((column("u", "input u"),), (column("y", "sensor y"),), sample_time=None),
    "means": kind_of(
        (column("u", "input u"), column("u2", "input u2")),
        (column("y", "sensor y"), column("z", "sensor z")),
        row_time=0.125,
        linear=(False, True),
    ),
    "linear": kind_of(
        (column("u", "input u"),), (column("y", "sensor y"), column("z", "sensor z")), row_time=0.25, linear=(True,)
    ),
    "numbered": kind_of((), (column("y", "sensor y"),), sample_time=0.25, time=TimeColumn(column=None)),
    "optional": kind_of(
        (column("y", "input u"),), (column("y", "sensor y"),), time=TimeColumn(column="time", optional=True)
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Told:
    """What was read. points (n_points, 4 + n_inputs + n_outputs): index, time, dt, resumes, u, y."""

    points: Any
    counts: Counts
    message: str
    clock: Any = None


def _numbers(kind: Kind) -> tuple[int, int]:
    n_u, n_y = len(kind.columns.inputs), len(kind.columns.outputs)
    return max(n_u, 1), max(n_y, 1)


def _point_type(kind: Kind) -> np.dtype[Any]:
    n_u, n_y = _numbers(kind)
    fields = [("index", "i8"), ("time", "f8"), ("dt", "f8"), ("u", "f8", n_u), ("y", "f8", n_y), ("resumes", "i8")]
    return np.dtype(fields)


class Outcome(ctypes.Structure):
    """As in the harness."""

    _fields_ = (
        ("n_points", ctypes.c_int64),
        ("has_failed", ctypes.c_int64),
        ("has_clock", ctypes.c_int64),
        ("counts", ctypes.c_int64 * 9),
        ("message", ctypes.c_char * 6144),
    )


def told_of(kind: Kind, outcome: Outcome, points: Any, clock: Any = None) -> Told:
    """Give what the harness told as Python tells it."""
    n_u, n_y = len(kind.columns.inputs), len(kind.columns.outputs)
    table = np.column_stack(
        [
            points["index"],
            points["time"],
            points["dt"],
            points["resumes"],
            points["u"][:, :n_u],
            points["y"][:, :n_y],
        ]
    )
    message = outcome.message.decode() if outcome.has_failed else ""
    return Told(
        points=table,
        counts=Counts(**dict(zip(Counts.__slots__, outcome.counts, strict=True))),
        message=message,
        clock=clock,
    )


class Reading:
    """The compiled reading side of a kind."""

    def __init__(self, kind: Kind, folder: Path) -> None:
        self.kind = kind
        self._library = ctypes.CDLL(str(build(kind, folder, "gcc", ("-std=c99", "-shared", "-fPIC"))))
        self._library.number_of.restype = self._library.moment_of.restype = ctypes.c_double
        assert self._library.size_of_point() == _point_type(kind).itemsize
        assert self._library.size_of_outcome() == ctypes.sizeof(Outcome)

    def read(self, text: bytes, most: int = 2**16, *, before: Any = None, stops: bool = False) -> Told:
        """Read a text in portions of at most so many bytes."""
        points = np.zeros(MOST_POINTS, dtype=_point_type(self.kind))
        outcome, clock = Outcome(), ctypes.create_string_buffer(self._library.size_of_clock())
        given, n, size = points.ctypes.data_as(ctypes.c_void_p), ctypes.c_size_t(len(text)), ctypes.c_size_t(most)
        room = ctypes.c_size_t(MOST_POINTS)
        self._library.read_text(text, n, size, int(stops), before, given, room, clock, ctypes.byref(outcome))
        after = clock if outcome.has_clock else None
        return told_of(self.kind, outcome, points[: outcome.n_points], after)

    def number(self, text: bytes) -> float:
        """Read a number."""
        return float(self._library.number_of(text))

    def moment(self, text: bytes) -> float:
        """Read a moment."""
        return float(self._library.moment_of(ctypes.create_string_buffer(text)))


def build(kind: Kind, folder: Path, compiler: str, options: tuple[str, ...]) -> Path:
    """Compile the harness for a kind of model."""
    command = [compiler, *STRICT, *options, f"-I{SOURCE / 'core'}", f"-I{SOURCE / 'program'}"]
    headers = {"columns.h": columns_text(kind.spec, kind.columns)}
    return compiled_once(HARNESS.read_text(encoding="utf-8"), folder / f"reading_{compiler}", command, headers)


def program_reads(kind: Kind, program: Path, texts: list[bytes], most: int = 777) -> list[Told]:
    """Let the harness as a program read texts, one after the other."""
    given = b"".join(len(text).to_bytes(4, "little") + most.to_bytes(4, "little") + text for text in texts)
    done = subprocess.run([str(program)], input=given, capture_output=True, check=False)
    assert done.returncode == 0
    assert all(line.startswith(b"faultbond: ") for line in done.stderr.splitlines()), done.stderr  # of no sanitizer
    told, at, point = [], 0, _point_type(kind)
    while at < len(done.stdout):
        outcome = Outcome.from_buffer_copy(done.stdout, at)
        at += ctypes.sizeof(Outcome)
        told.append(told_of(kind, outcome, np.frombuffer(done.stdout, point, outcome.n_points, at)))
        at += outcome.n_points * point.itemsize
    return told


class _Portions(BytesIO):
    """A stream that gives a part of what is asked for."""

    def __init__(self, text: bytes, most: int) -> None:
        super().__init__(text)
        self._most, self._state = most, 1

    def read1(self, size: int | None = -1, /) -> bytes:
        self._state = (self._state * 1664525 + 1013904223) % 2**32
        return super().read(min(size if size and size > 0 else self._most, 1 + (self._state >> 8) % self._most))


def python_reads(
    kind: Kind, text: bytes, most: int, monkeypatch: pytest.MonkeyPatch, clock: GridClock | None = None
) -> Told:
    """Read a text as `run -` does."""
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdin", SimpleNamespace(buffer=_Portions(text, most)))
        return _python_reads(kind, clock)


def _python_reads(kind: Kind, clock: GridClock | None) -> Told:
    grid, message = kind.grid(clock), ""
    points: list[GridPoint] = []
    columns = kind.columns
    if clock is not None:
        columns = replace(columns, first_time=clock.last_time + (columns.sample_time or 1.0))
    try:
        for rows in read_blocks("-", columns):
            parts = [rows] if kind.spec.row_time is None else [rows.part(slice(k, k + 1)) for k in range(len(rows))]
            for part in parts:
                for block in grid.push_block(part):
                    points.extend(block.points())
        points.extend(grid.finish())
    except RecordingError as error:
        message = str(error)
    table = np.array([[p.index, p.time, p.dt, p.resumes, *p.u, *p.y] for p in points], dtype=np.float64)
    width = 4 + len(kind.columns.inputs) + len(kind.columns.outputs)
    return Told(points=table.reshape(-1, width), counts=grid.counts, message=message, clock=grid.clock)
