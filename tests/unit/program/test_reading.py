"""The reading side of the program reads what `run -` reads: the same points, counts and messages."""

import math
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from faultbond.io.times import finite_number, parse_time
from program_reading import KINDS, Kind, Reading, Told, python_reads

pytestmark = pytest.mark.skipif("not __import__('shutil').which('gcc')", reason="needs a C compiler")

OFTEN = settings(
    deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow], max_examples=120
)


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Reading]:
    """The compiled reading side of each kind."""
    return {name: Reading(kind, tmp_path_factory.mktemp(name)) for name, kind in KINDS.items()}


def assert_same(kind: Kind, c: Told, python: Told) -> None:
    """Means are added in another order than Python's; all else is the same to the last digit."""
    assert c.message == python.message
    if not python.message:
        assert c.counts == python.counts
    if kind.spec.row_time is None:
        np.testing.assert_array_equal(c.points, python.points)
    else:
        np.testing.assert_allclose(c.points, python.points, rtol=1e-12, atol=1e-12)


_ODD = st.sampled_from(
    ["", " ", "nan", "inf", "-", "1e", ".", "1_0", "0x1", "1e999", "-0", "+3.", ".5e-3", " 7 ", "١٢", "\u00a02", "1;5", "\ufffd", "1\x1c"]
)
_VALUE = st.one_of(
    st.floats(-10, 10).map(lambda value: f"{value:.3g}"),
    st.floats(allow_nan=False, allow_infinity=False).map(repr),
    st.integers(-3, 300).map(str),
    _ODD,
)
_STEP = st.sampled_from([1.0] * 12 + [0.5, 0.25, 0.4, 0.0, 2.0, 3.0, -1.0, -2.5, -30.0, 59.0, 700.0, 1e5, 1e-9, math.nan])
_QUOTES = st.sampled_from([False] * 8 + [True])


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


@st.composite
def recordings(draw: st.DrawFn, kind: Kind) -> bytes:
    """A CSV text for a kind, more or less in order."""
    clock = kind.columns.time.column
    names = dict.fromkeys([*([clock] if clock else []), *(c.header for c in (*kind.columns.inputs, *kind.columns.outputs))])
    header = draw(st.permutations([*names, "other"]))
    if kind.columns.time.optional and draw(st.booleans()):
        header.remove(clock)
    delimiter = draw(st.sampled_from([",", ",", ";", "\t"]))
    end = draw(st.sampled_from(["\n", "\n", "\r\n", "\r"]))
    unit = kind.columns.time.unit.factor
    step = (kind.spec.row_time or kind.spec.sample_time or 1.0) / unit
    is_iso, is_odd = draw(st.booleans()) and draw(st.booleans()), draw(st.booleans())
    first_end = "\n" if end == "\r" else end
    lines, time = [delimiter.join(_quoted(n) if delimiter in n or '"' in n else n for n in header) + first_end], 0.0
    held: dict[str, str] = {}
    for _ in range(draw(st.integers(0, 60))):
        jump = draw(_STEP) if is_odd else 1.0
        time = time + step * jump if jump == jump else time
        fields = []
        for name in header:
            if name == clock and is_iso:
                text = (datetime(2026, 1, 2, tzinfo=UTC) + timedelta(seconds=time * unit)).isoformat()
            elif name == clock:
                text = "" if jump != jump else repr(time)
            elif is_odd and name in held and draw(st.booleans()):
                text = held[name]
            else:
                text = draw(_VALUE) if is_odd else f"{draw(st.integers(-1000, 1000)) / 64}"
            held[name] = text
            fields.append(_quoted(text) if draw(_QUOTES) or delimiter in text else text)
        if is_odd and draw(st.integers(0, 20)) == 0:
            fields = draw(st.sampled_from([fields[:-1], [], [""], [*fields, ""], [*fields, "7"], [*fields[:-1], '"a\n"']]))
        lines.append(delimiter.join(fields) + end)
    text = draw(st.sampled_from(["", "\ufeff", "\n", "\r\n\n"])) + "".join(lines)
    return text.encode()[: None if draw(st.booleans()) else -1]


@pytest.mark.parametrize("name", KINDS)
def test_points_and_counts_are_those_of_python(
    name: str, readings: dict[str, Reading], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any recording, in any portions."""
    reading, kind = readings[name], KINDS[name]

    @OFTEN
    @given(recordings(kind), st.sampled_from([1, 7, 100, 2**16]))
    def check(text: bytes, most: int) -> None:
        assert_same(kind, reading.read(text, most), python_reads(kind, text, most, monkeypatch))

    check()
