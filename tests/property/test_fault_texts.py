"""Faults as text, when they are there, and what instruments show: for inputs that nobody thought of."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.io.faults import OF_INSTRUMENTS, FaultRequest, parse_fault
from faultbond.model.expression import Name
from faultbond.model.graph import Sensor, Unit
from faultbond.simulate.instruments import instruments
from faultbond.simulate.truth import Fault, is_there

NUMBERS = st.floats(-1e9, 1e9, allow_nan=False)
LENGTHS = st.floats(0.01, 1e6)
NAMES = st.from_regex(r"[A-Za-z][A-Za-z0-9_]{0,8}", fullmatch=True)
SENSORS = tuple(Sensor(name=name, column=name, unit=Unit("V"), reads=Name("x.e"), noise=0.5) for name in ("a", "b"))


def text_of(request: FaultRequest) -> str:
    """Write a fault as a user would."""
    amount = "" if request.value is None else f"={request.value!r}"
    amount += "" if request.factor is None else f"=x{request.factor!r}"
    ramp = f"..{request.end!r}" if request.end != request.start else ""
    on = "" if request.on is None else f",{request.on!r}"
    off = "" if request.off is None else f"/{request.off!r}"
    return f"{request.parameter}{amount}@{request.start!r}{ramp}{on}{off}"


@st.composite
def requests(draw: st.DrawFn) -> FaultRequest:
    """Give any fault that can be written."""
    kind = draw(st.sampled_from(["", *OF_INSTRUMENTS]))
    forms = ["value", "factor", *(["none"] if kind == "stuck" else [])]
    form, amount, start = draw(st.sampled_from(forms)), draw(NUMBERS), draw(NUMBERS)
    shape = draw(st.sampled_from(["step", "ramp", "once", "again"]))
    return FaultRequest(
        parameter=draw(NAMES) + (f".{kind}" if kind else ""),
        value=amount if form == "value" else None,
        factor=amount if form == "factor" else None,
        start=start,
        end=start + draw(LENGTHS) if shape == "ramp" else start,
        on=draw(LENGTHS) if shape in ("once", "again") else None,
        off=draw(LENGTHS) if shape == "again" else None,
    )


@given(requests())
def test_what_is_written_is_read(request: FaultRequest) -> None:
    """Every fault survives being written and read."""
    assert parse_fault(text_of(request)) == request


@given(st.floats(-100, 100), st.floats(0.1, 50), st.floats(0.1, 50), st.lists(st.floats(-200, 500), max_size=20))
def test_it_is_there_in_its_share_of_the_time(start: float, on: float, off: float, times: list[float]) -> None:
    """Away from the moments of change it is there where the phase says so; at them the two sides differ."""
    fault = Fault(parameter="K", value=1.0, start=start, on=on, off=off)
    moments = np.array(times, dtype=float)
    phase = (moments - start) % (on + off)
    clear = np.minimum(np.minimum(phase, np.abs(phase - on)), on + off - phase) > 1e-6
    for after in (True, False):
        found = is_there(fault, moments, after=after)
        np.testing.assert_array_equal(found[clear], ((moments >= start) & (phase < on))[clear])
    switches = fault.switches(start + 3 * (on + off))
    assert np.all(is_there(fault, switches, after=True) != is_there(fault, switches, after=False))


@st.composite
def faults(draw: st.DrawFn) -> Fault:
    """Give a fault of one of two sensors within 30 s."""
    kind = draw(st.sampled_from(OF_INSTRUMENTS))
    start = draw(st.floats(-5, 35))
    on = draw(st.none() | st.floats(0.3, 20))
    return Fault(
        parameter=f"{draw(st.sampled_from('ab'))}.{kind}",
        value=draw(st.none() | st.floats(0, 9)) if kind == "stuck" else draw(st.floats(0, 9)),
        start=start,
        end=None if on is not None else draw(st.none() | st.floats(start, start + 20)),
        on=on,
        off=None if on is None else draw(st.none() | st.floats(0.3, 20)),
    )


@given(st.lists(faults(), max_size=4), st.integers(0, 10**6))
@settings(max_examples=60, deadline=None)
def test_row_by_row_shows_the_same(found: list[Fault], seed: int) -> None:
    """All rows at once and one row after the other give the same, and without a fault readings with noise."""
    generator = np.random.default_rng(seed)
    values, draws = generator.normal(size=(2, 30, 2))
    shown = instruments(SENSORS, found, np.arange(30.0))
    rows = np.full((30, 2), np.nan)
    for row in range(30):
        rows[row] = shown.show_row(row, values[row], draws[row], rows)
    together = shown.show(values, draws)
    np.testing.assert_array_equal(together, rows)
    healthy = [k for k, name in enumerate("ab") if all(fault.instrument != name for fault in found)]
    np.testing.assert_array_equal(together[:, healthy], (values + 0.5 * draws)[:, healthy])
