"""The reading side of the program reads what `run -` reads: the same points, counts and messages."""

import math
import struct
from datetime import UTC, datetime, timedelta, timezone
from fractions import Fraction
from pathlib import Path
from random import Random
from shutil import which

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from faultbond.io.times import finite_number, moment_of, parse_time
from faultbond.model.graph import Unit
from faultbond.synthesis.columns_text import columns_text
from program_reading import KINDS, Kind, Reading, Told, build, program_reads, python_reads

pytestmark = pytest.mark.skipif(which("gcc") is None, reason="needs a C compiler")

OFTEN = settings(deadline=None, suppress_health_check=list(HealthCheck), max_examples=30)
SEEDS, PORTIONS = st.integers(0, 2**40), st.sampled_from([1, 7, 100, 2**16])
DIGITS = st.text("0123456789", max_size=22) | st.sampled_from(["", "0" * 25, "9" * 19, "1" + "0" * 18])
EXPONENTS = (
    st.sampled_from(["", "e", "e+"]) | st.integers(-350, 330).map("E{}".format) | st.integers(-45, 25).map("e{}".format)
)


class Compiled(dict[str, Reading]):
    """The compiled reading side of each kind, made when it is asked for."""

    def __init__(self, folder: Path) -> None:
        super().__init__()
        self._folder = folder

    def __missing__(self, name: str) -> Reading:
        (self._folder / name).mkdir()
        self[name] = Reading(KINDS[name], self._folder / name)
        return self[name]


@pytest.fixture(scope="module")
def readings(tmp_path_factory: pytest.TempPathFactory) -> Compiled:
    """The compiled reading side of each kind."""
    return Compiled(tmp_path_factory.mktemp("reading"))


def assert_same(kind: Kind, c: Told, python: Told) -> None:
    """Means are added in another order than Python's; all else is the same to the last digit."""
    assert c.message == python.message
    if not python.message:
        assert c.counts == python.counts
    if kind.spec.row_time is None:
        np.testing.assert_array_equal(c.points, python.points)
    else:
        np.testing.assert_allclose(c.points, python.points, rtol=1e-12, atol=1e-12)


_ODD = (
    *(
        "",
        " ",
        "nan",
        "inf",
        "-",
        "1e",
        ".",
        "1_0",
        "0x1",
        "1e999",
        "-0",
        "+3.",
        ".5e-3",
        " 7 ",
        "1e-320",
        "2e22",
        "3e+23",
    ),
    *(
        "\u0661\u0662",
        "\u00a02",
        "1;5",
        "\ufffd",
        "1 2",
        "12345678901234567890123",
        "0.1000000000000000055511151231257827",
    ),
)
_STEPS = (*[1.0] * 24, 0.5, 0.25, 0.4, 0.0, 2.0, 3.0, -1.0, -2.5, -30.0, 59.0, 700.0, 1e5, 1e-9, math.nan)


def _quoted(text: str) -> str:
    return '"' + text.replace('"', '""') + '"'


def _value(random: Random) -> str:
    kind = random.randrange(8)
    if kind == 0:
        return random.choice(_ODD)
    if kind == 1:
        value = struct.unpack("d", random.randbytes(8))[0]
        return repr(value) if abs(value) < 1e99 else "1e999"  # squares of larger ones are beyond numpy's numbers
    return repr(random.gauss(0.0, 3.0)) if kind < 4 else f"{random.gauss(0.0, 100.0):.3g}"


def _moment(seconds: float, random: Random) -> str:
    moment = datetime(2026, 1, 2, tzinfo=UTC) + timedelta(seconds=seconds)
    if random.randrange(4) == 0:
        moment = moment.astimezone(timezone(timedelta(hours=random.randrange(-12, 13))))
    text = moment.isoformat(sep=random.choice("T "))
    return text.replace("+00:00", random.choice(["", "Z", "+00:00"]))


def recording_of(kind: Kind, seed: int, *, with_moments: bool = True) -> bytes:
    """Make a CSV text for a kind, more or less in order."""
    random = Random(seed)  # noqa: S311 - no secret
    clock, unit = kind.columns.time.column, kind.columns.time.unit.factor
    names = [*([clock] if clock else []), *(item.header for item in (*kind.columns.inputs, *kind.columns.outputs))]
    header = [*dict.fromkeys(names), "other"]
    random.shuffle(header)
    if kind.columns.time.optional and random.random() < 0.5:
        header.remove(str(clock))
    delimiter, end = random.choice(",,;\t"), random.choice(["\n", "\n", "\r\n", "\r"])
    is_comma = delimiter != "," and random.random() < 0.5  # marks of numbers: all commas, or nearly all
    step = (kind.spec.row_time or kind.spec.sample_time or 1.0) / unit
    is_iso, is_odd, jumps = random.random() < 0.2 and with_moments, random.random() < 0.4, random.random() < 0.6
    back, time = random.random() < 0.2, random.choice([0.0, 3.7, 1.75e9])
    times, n = [], random.choice([0, 1, 5, 30, 60, 150])
    for k in range(n):
        time += step * (random.choice(_STEPS) if jumps else 1.0)
        time = time if math.isfinite(time) else float(k)
        if back and random.randrange(50) == 0:
            time -= random.choice([3.0, 8.0, 45.0, 1000.0]) * step
        times.append(time)
    if random.random() < 0.3:  # rows in another order
        times = [moment + random.choice([0.0] * 5 + [-2.0, -4.0, 3.0, 7.0]) * step for moment in times]
    if random.random() < 0.4:  # none on time
        times = [moment + random.gauss(0.0, 0.03) * step for moment in times]
    lines = [delimiter.join(_quoted(item) if {delimiter, '"'} & set(item) else item for item in header)]
    before: dict[str, str] = {}
    for time in times:
        fields = []
        for name in header:
            if name == clock:
                text = _moment(time * unit, random) if is_iso and abs(time * unit) < 1e10 else repr(time)
                text = "" if is_odd and random.randrange(30) == 0 else text
            elif name in before and random.random() < (0.3 if is_odd else 0.05):
                text = before[name]
            else:
                text = _value(random) if is_odd else f"{random.gauss(0.0, 8.0):.6g}"
            before[name] = text
            text = text.replace(".", ",") if is_comma and random.randrange(200) else text
            fields.append(_quoted(text) if delimiter in text or (is_odd and random.randrange(20) == 0) else text)
        if is_odd and random.randrange(25) == 0:
            others = [
                fields[:-1],
                [],
                [""],
                [*fields, ""],
                [*fields, "7"],
                [*fields[:-1], '"a\n"'],
                ["1,5", *fields[1:]],
            ]
            fields = random.choice(others if end != "\r" else others[:5])
        lines.append(delimiter.join(fields))
        if random.randrange(40) == 0 and times:  # once more
            lines.append(lines[random.randrange(max(len(lines) - 7, 1), len(lines))] if len(lines) > 1 else "")
    text = (
        random.choice(["", "\ufeff", "\n", "\r\n\n"]) + lines[0] + ("\n" if end == "\r" else end) + end.join(lines[1:])
    )
    return (text + random.choice(["", end])).encode()


def spoilt(text: bytes, seed: int) -> bytes:
    """Spoil a text: bytes that are not text, letters that mean something, and parts of it twice or not at all."""
    random = Random(seed)  # noqa: S311 - no secret
    odd = [
        b'"',
        b"\0",
        b"\xff",
        b"\xe2\x82",
        b"\xc0\xaf",
        b"\xed\xa0\x80",
        b"\r",
        b"\n",
        b",",
        b'""',
        b"\xf0\x9f",
        b"\xe3\x80\x80",
    ]
    for _ in range(random.choice([1, 1, 2, 5])):
        at = random.randrange(min(len(text), random.choice([10, 100, 10**6])) + 1)
        n = random.choice([0, 0, 1, 1, 3, 40])
        new = random.choice([*odd, random.randbytes(random.randrange(4)), text[at : at + 30]])
        text = text[:at] + new + text[at + n :]
    return text


@pytest.mark.parametrize("name", KINDS)
def test_points_and_counts_are_those_of_python(name: str, readings: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any recording, in any portions."""
    reading, kind = readings[name], KINDS[name]

    @OFTEN
    @given(SEEDS, PORTIONS)
    def check(seed: int, most: int) -> None:
        text = recording_of(kind, seed)
        assert_same(kind, reading.read(text, most), python_reads(kind, text, most, monkeypatch))

    check()


@pytest.mark.parametrize("name", ["plain", "units", "numbered"])
def test_spoilt_texts_are_read_or_refused_as_by_python(
    name: str, readings: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Any bytes: never a crash, and the same message."""
    reading, kind = readings[name], KINDS[name]

    @OFTEN
    @given(SEEDS, PORTIONS)
    def check(seed: int, most: int) -> None:
        text = spoilt(recording_of(kind, seed, with_moments=False), seed)
        assert_same(kind, reading.read(text, most), python_reads(kind, text, most, monkeypatch))

    check()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (b"", "it is empty"),
        (b"\xef\xbb", "it is empty"),
        (b"\n\r\n\n", "it is empty"),
        (b" , ,\n1,2,3\n", "it is empty"),
        (b"time,u,y,z\n", "no row below the header"),
        (b"time,u,y,z\n\n\r\n", "no row below the header"),
        (b"0,1,2,3\n", "the first row holds numbers"),
        (b"time,u,y,z,y\n0,1,2,3,4\n", "appears 2 times"),
        (b"Time,u,y,z\n0,1,2,3\n", "Did you mean 'Time'?"),
        (b"t,u,y,z\n0,1,2,3\n", "Name it in the model file"),
        (b"'time,u,y,z\n0,1,2,3\n", "Did you mean ''time'?"),
        (b"a" * 90 + b",b" * 30 + b"\n1\n", " and 11 more"),
        (b'time,u,y,z\n0,1,"2,5",3\n1,1,2,3\n', ":2: 'y' is '2,5'. Decimal commas? Write numbers with a point."),
        (b'time,u,y,z\n1,1," -2,5e+3 ",3\n', "'y' is '-2,5e+3'"),
        (b"time;u;y;z\n0;1.5; 1,234 ;3\n", ":2: 'y' is '1,234' and 'u' is '1.5'. Decimal commas or points? Write all"),
        (b"time\tu\ty\tz\n0.5\t1\t2,5\t3\n", ":2: 'y' is '2,5' and 'time' is '0.5'. Decimal commas or points?"),
        (b"time,u,y,z\n1,1,2,3,4\n2,1,2,3\n", ":2: this row has 5 fields, the header 4."),
        (b'time,u,y,z\n0,1,2,3\n"1' + b"\n" * 120 + b'",2,3,4\n', ":3: a quotation mark is opened here"),
        (b"time,u,y,z\n1,2,3,\0\n2,1,2,3\n", ":2: this is not text in UTF-8."),
        (b"PAR1\xff\xfe\xff\xff\n", ":1: this is not text in UTF-8."),
        (b"time,u,y,z\n0,1,2,3\n1," + b"7" * 140_000 + b",3,4\n", "field larger than field limit (131072)"),
        (b'time,u,y,z\n0,1,2,3\n"' + b"7" * 140_000 + b'",2,3,4\n', "field larger than field limit (131072)"),
        (
            b"time,u,y,z\n0,1,2,3\n1,2,3,4" + b"," * 200_000 + b"\n1,2,3,4\n",
            ":3: a line of more than 200,000 characters",
        ),
        (b"time,u,y,z\n0,1,2,3\n1,2,3,4" + b"," * 300_000, ":3: a line of more than 200,000 characters"),
        (b"7" * 300_000, ":1: a line of more than 200,000 characters"),
        (b"time,u,y,z\r\r", "no row below the header"),
        (b"time,u,y,z\n" + b"".join(b"%d,1,2,3\n" % (1000 * k) for k in range(30)), "line 13: the time jumps from"),
    ],
)
def test_what_is_no_recording_is_said_as_by_python(
    text: bytes, said: str, readings: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each error has the text that `run` has, and points before it come before it."""
    c, python = readings["plain"].read(text, 5000), python_reads(KINDS["plain"], text, 5000, monkeypatch)
    assert said in c.message
    assert c.message == python.message
    np.testing.assert_array_equal(c.points, python.points)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        (b"2;1;2,5;3.5", "standard input:4: 'y' is '2,5' and 'z' is '3.5'. Decimal commas or points? Write all"),
        (b"2;1;2;3;4;5", "standard input:4: this row has 6 fields, the header 4."),
        (b"2;1;\0;3", "standard input:4: this is not text in UTF-8."),
        (b'2;"1\n2";3;\0', "standard input:5: this is not text in UTF-8."),
    ],
)
def test_a_record_that_is_no_row_is_passed_over_and_counted(
    row: bytes, said: str, readings: Compiled, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """But not the first one. The points are those without it; it is told once, however many follow."""
    lines = [b"time;u;y;z", *(b"%d;1;2;3" % k for k in range(6)), b""]
    with_it = b"\n".join([*lines[:3], row, *lines[4:5], row, *lines[6:]])
    without = b"\n".join([*lines[:3], *lines[4:5], *lines[6:]])
    c, python = readings["plain"].read(with_it, 5000), python_reads(KINDS["plain"], with_it, 5000, monkeypatch)
    told = capfd.readouterr().err.splitlines()
    assert [line.startswith(f"faultbond: {said}") for line in told] == [True]
    assert told[0].endswith("The line is passed over.")
    assert_same(KINDS["plain"], c, python)
    assert (c.message, c.counts.untimed) == ("", 2)
    np.testing.assert_array_equal(c.points, python_reads(KINDS["plain"], without, 5000, monkeypatch).points)


def test_a_comma_between_other_separators_is_the_decimal_mark(
    readings: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a spreadsheet writes it where half of the world lives, the day of a date first; two commas are no number."""
    rows = "31.5.2026 10:00:0{k},25;{k},5;-,5e1; 7 ;1,2,3\n"
    text = ("time;u;y;z;other\n" + "".join(rows.format(k=k) for k in range(8))).encode()
    plain = text.replace(b"31.5.2026 ", b"2026-05-31T").replace(b",5;-,5e1", b".5;-5").replace(b",", b".")
    c, python = readings["plain"].read(text, 5000), python_reads(KINDS["plain"], text, 5000, monkeypatch)
    assert_same(KINDS["plain"], c, python)
    assert len(c.points) == 8
    np.testing.assert_array_equal(c.points, readings["plain"].read(plain, 5000).points)
    two = readings["plain"].read(text.replace(b"3,5;", b"3,5,5;"), 5000)
    assert two.counts.missing == c.counts.missing + 1


def test_text_in_place_of_numbers_is_told_once_for_each_column(
    readings: Compiled, capfd: pytest.CaptureFixture[str]
) -> None:
    """As `run` tells it at the end; what loggers write for no value is not told."""
    rows = b"0,nan,,inf\n1,NULL, null ,-Infinity\n2,1,bad \xc3\xa9,3.2 bar\n3,On,x,1e999\nnow,1,2,3\n4,1,2,3\n"
    readings["plain"].read(b"time,u,y,z\n" + rows, 5000)
    assert capfd.readouterr().err.splitlines() == [
        "faultbond: column 'y' (sensor y), line 4: 'bad é' is no number; it counts as missing.",
        "faultbond: column 'z' (sensor z), line 4: '3.2 bar' is no number; it counts as missing.",
        "faultbond: column 'u' (input u), line 5: 'On' is no number, write 1 or 0 for it; it counts as missing.",
        "faultbond: column 'time', line 6: 'now' is no time; its row is not used.",
    ]


@pytest.mark.parametrize(
    ("header", "said"),
    [
        (b"time,u,y,z", "no column 'u2' (input u2); found: time, u, y, z. Name it in the model file"),
        (b"time,u,U2,y,z", "Did you mean 'U2'?"),
    ],
)
def test_a_column_that_is_read_is_not_meant_by_another(
    header: bytes, said: str, readings: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What resembles a missing column and has a reader of its own is not proposed for it."""
    text = header + b"\n" + b",".join([b"0"] * header.count(b",")) + b",0\n"
    c, python = readings["means"].read(text, 5000), python_reads(KINDS["means"], text, 5000, monkeypatch)
    assert said in c.message
    assert c.message == python.message


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("most", [100, 2**16])
def test_lines_end_as_on_any_system(end: str, most: int, readings: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """However the bytes arrive, and however long the text is."""
    rows = (f"{k},{k % 7},{k % 11},{k / 3!r}" for k in range(12_000))
    text = end.join(["time,u,y,z", *rows]).encode()
    c, python = readings["plain"].read(text, most), python_reads(KINDS["plain"], text, most, monkeypatch)
    assert_same(KINDS["plain"], c, python)
    np.testing.assert_array_equal(c.points[:, 1], np.arange(12_000))


def test_rows_that_come_too_seldom_for_means_are_refused(readings: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """They have more noise than the model file says."""
    text = b"time,u,u2,y,z\n" + b"".join(b"%r,1,2,3,4\n" % (0.5 * k) for k in range(40))
    c, python = readings["means"].read(text), python_reads(KINDS["means"], text, 100, monkeypatch)
    assert c.message == python.message
    assert c.message.startswith("line 21: the rows come every 0.5 s")


def test_a_reading_that_jumps_in_a_sample_is_left_out(readings: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """Once its scatter is known; a held input acts until the next sample, a linear one about it."""
    random, lines = Random(3), ["time,u,u2,y,z"]  # noqa: S311 - no secret
    for k in range(1200):
        time = 0.125 * k - (100.0 if k > 900 else 0.0)
        y = random.gauss(0.0, 0.1) + 5.0 * (k > 802) + 1.0 * (k > 847)  # the first jump is not learned as scatter
        lines.append(f"{time},{k},{k},{y!r},{random.gauss(0.0, 1.0)!r}")
    lines[200], lines[202] = lines[202], lines[200]  # before and behind the begin of a sample
    text = "\n".join(lines).encode()
    c = readings["means"].read(text, 64)
    assert_same(KINDS["means"], c, python_reads(KINDS["means"], text, 64, monkeypatch))
    assert list(c.points[np.isnan(c.points[:, 6]), 1]) == [100.0, 106.0]
    assert list(c.points[50, 4:6]) == [403.5, 399.5]
    assert c.counts.clock_jumps == 1


def test_frozen_sensors_are_counted(readings: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those that have shown a step much smaller than their noise."""
    y = ["1", "1.1", *["1.2"] * 80, "1.3", *["2"] * 59, "3"]
    text = ("time,u,y,z\n" + "".join(f"{k},0,{value},7\n" for k, value in enumerate(y))).encode()
    c = readings["plain"].read(text)
    assert_same(KINDS["plain"], c, python_reads(KINDS["plain"], text, 10**6, monkeypatch))
    assert c.counts.frozen == 80


@pytest.mark.parametrize("name", ["plain", "means", "numbered", "variable"])
def test_a_run_goes_on_where_another_one_ended(name: str, readings: Compiled, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a later recording, with all of the first one again, or with any other one."""
    reading, kind = readings[name], KINDS[name]

    @settings(OFTEN, max_examples=15)
    @given(SEEDS)
    @example(930)  # the clock of means is set back to the very time at which the grid of before began
    def check(seed: int) -> None:
        first = recording_of(kind, seed)
        head, lines = first.splitlines(keepends=True)[0], first.splitlines(keepends=True)
        later = [first, recording_of(kind, seed + 1), head + b"".join(lines[len(lines) // 2 :])][seed % 3]
        c, python = reading.read(first), python_reads(kind, first, 10**6, monkeypatch)
        assert (c.clock is None) == (python.clock is None)
        if c.clock is not None and not c.message:
            assert_same(
                kind, reading.read(later, before=c.clock), python_reads(kind, later, 10**6, monkeypatch, python.clock)
            )

    check()


def test_where_the_clock_is_set_after_a_gap_the_usual_interval_is_remembered(
    readings: Compiled, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Too few rows since the gap tell another one."""
    times = [*range(20), *range(10**6, 10**6 + 3), *range(100, 115)]
    text = b"time,u,y\n" + b"".join(b"%d,%d,2\n" % (2 * time, k) for k, time in enumerate(times))
    c = readings["variable"].read(text)
    assert_same(KINDS["variable"], c, python_reads(KINDS["variable"], text, 10**6, monkeypatch))
    assert list(c.points[c.points[:, 3] == 1.0, 2]) == [2.0, 2.0]


def test_a_run_that_is_stopped_gives_what_was_held_back(readings: Compiled) -> None:
    """A line that has not come to its end is dropped, and a row that waited for another comes."""
    text = b"time,u,y,z\n" + b"".join(b"%d,1,2,3\n" % k for k in [*range(20), 22]) + b"23,1,2,"
    assert len(readings["plain"].read(text, stops=True).points) == 23
    stopped = readings["plain"].read(b"time,u,y,z\n", stops=True)
    assert (stopped.message, len(stopped.points)) == ("", 0)


def test_numbers_are_those_of_python(readings: Compiled) -> None:
    """Each text is the double nearest to it, or none, as float() says."""
    plain = readings["plain"]

    @settings(OFTEN, max_examples=600)
    @given(
        st.one_of(
            st.floats().map(repr),
            st.builds("{}{}.{}{}".format, st.sampled_from(["", "-", "+"]), DIGITS, DIGITS, EXPONENTS),
            st.text("0123456789.eE+-_ \t\v\u00a0\u0663\u3000naif\x1c\u00b2", max_size=12),
        )
    )
    def check(text: str) -> None:
        found, wanted = plain.number(text.encode()), finite_number(text)
        assert repr(found) == repr(wanted)

    check()


def test_hard_roundings_are_those_of_python(readings: Compiled) -> None:
    """Numbers beside the middle between two doubles, of 17 to 25 digits."""
    random, plain = Random(1), readings["plain"]  # noqa: S311 - no secret
    for _ in range(4000):
        value = random.random() * 10.0 ** random.randrange(-30, 20)
        middle = Fraction(value) / 2 + Fraction(math.nextafter(value, math.inf)) / 2
        digits = random.randrange(16, 26)
        power = math.floor(math.log10(value)) - digits + 1
        text = f"{round(middle * Fraction(10) ** -power)}e{power}"
        assert plain.number(text.encode()) == float(text), text


def test_moments_are_those_of_python(readings: Compiled) -> None:
    """Dates, times of day and zones as recordings have them; lists of days are not read."""
    plain = readings["plain"]

    @settings(OFTEN, max_examples=300)
    @given(
        st.datetimes(timezones=st.none() | st.integers(-1439, 1439).map(lambda m: timezone(timedelta(minutes=m)))),
        st.sampled_from(["auto", "hours", "minutes", "seconds", "milliseconds", "microseconds"]),
        st.sampled_from("T _-"),
        st.sampled_from(["long", "short", "day first", "day first, two digits"]),
        st.sampled_from(["", "x", " ", "5", ":", "Z", "+1"]),
    )
    def check(moment: datetime, precision: str, between: str, form: str, more: str) -> None:
        text = moment.isoformat(sep=between, timespec=precision)
        if form == "short":
            text = text[:10].replace("-", "") + text[10:].replace(":", "")
        elif form != "long":
            day, month = (
                (moment.day, moment.month) if form == "day first" else (f"{moment.day:02}", f"{moment.month:02}")
            )
            text = f"{day}.{month}.{moment.year:04}{text[10:]}"
        text = f" {text}{more}"
        try:
            wanted = parse_time(text)
        except ValueError:
            wanted = math.nan
        np.testing.assert_equal(plain.moment(text.encode()), wanted)

    check()


@pytest.mark.parametrize("year", [1, 1970, 2015, 2020, 2026, 9998])
def test_weeks_are_those_of_python(year: int, readings: Compiled) -> None:
    """Weeks of a year and their days, in both spellings, and none where there is no such week or day."""
    for week in (0, 1, 9, 52, 53, 54):
        for day in ("", "-1", "-7", "-8", "3", "-3T10:11+01:00"):
            for text in (f"{year:04}-W{week:02}{day}", f"{year:04}W{week:02}{day}"):
                try:
                    wanted = parse_time(text)
                except ValueError:
                    wanted = math.nan
                np.testing.assert_equal(readings["plain"].moment(text.encode()), wanted, text)


@pytest.mark.parametrize(
    "text",
    [
        *("2026-02-29", "1900-02-29", "2024-02-29T24:00", "2024-13-01", "0000-01-01", "2024-1-01"),
        *("29.2.2026", "1.13.2024", "31.05.26", "31.5.20261", "031.5.2026", "1.5.", "31/05/2026", "5.31.2026"),
    ],
)
def test_days_that_are_none_are_no_moments(text: str, readings: Compiled) -> None:
    """As 29 February of most years."""
    assert math.isnan(readings["plain"].moment(text.encode()))
    assert math.isnan(moment_of(text, Unit("s")))
    assert readings["plain"].moment(b"2000-02-29") == readings["plain"].moment(b"29.2.2000") == 951782400.0


@pytest.mark.parametrize(
    ("name", "compiler", "options"),
    [
        ("means", "gcc", ("-std=c99", "-O0", "-g", "-fsanitize=address,undefined", "-fno-sanitize-recover")),
        ("units", "g++", ("-std=c++17", "-x", "c++", "-O2")),
        ("plain", "gcc", ("-std=c99", "-DCSV_ROOM=4096", "-O0", "-g", "-fsanitize=address,undefined")),
    ],
)
def test_it_is_c_and_cplusplus_without_undefined_behaviour(
    name: str, compiler: str, options: tuple[str, ...], readings: Compiled, tmp_path: Path
) -> None:
    """All compilers are silent, and what they make reads texts, spoilt ones too, in the same way."""
    if which(compiler) is None:
        pytest.skip(f"needs {compiler}")
    kind = KINDS[name]
    program = build(kind, tmp_path, compiler, ("-DAS_PROGRAM", *options))
    texts = [recording_of(kind, seed) for seed in range(25)]
    texts += [spoilt(text, seed) for seed, text in enumerate(texts)]
    if "4096" in "".join(options):
        texts = [text for text in texts if b'"' not in text]  # a record that is quoted may be longer than that
    for text, told in zip(texts, program_reads(kind, program, texts), strict=True):
        assert_same(kind, told, readings[name].read(text))


def test_headers_of_any_letters_are_written_as_c(readings: Compiled) -> None:
    """Quotation marks and letters of other scripts among them."""
    text = columns_text(KINDS["units"].spec, KINDS["units"].columns)
    assert '"p\'\\042\\303\\251"' in text
    assert "COLUMN_LEAST[] = {(-INFINITY), (-5e-06), 263.1500003731" in text
