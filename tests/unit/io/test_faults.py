"""Faults as they are written on the command line."""

import pytest

from faultbond.errors import FaultbondError
from faultbond.io.faults import FaultRequest, parse_fault


@pytest.mark.parametrize(
    ("text", "value", "factor", "start", "end"),
    [
        ("K1=4.45e11@2460", 4.45e11, None, 2460.0, 2460.0),
        ("K1=x1.85@2460..3660", None, 1.85, 2460.0, 3660.0),
        ("K1=-3@0.5", -3.0, None, 0.5, 0.5),
        ("K1=x0@-5..-2.5", None, 0.0, -5.0, -2.5),
        (" K_1 = x 2 @ 10 .. 20 ", None, 2.0, 10.0, 20.0),
        ("K1=2@1970-01-01T00:01:00Z..1970-01-01T00:02:00", 2.0, None, 60.0, 120.0),
    ],
)
def test_forms(text: str, value: float | None, factor: float | None, start: float, end: float) -> None:
    """A value or a factor, at a time or along a ramp, in seconds or ISO 8601."""
    name = "K_1" if "_" in text else "K1"
    assert parse_fault(text) == FaultRequest(parameter=name, value=value, factor=factor, start=start, end=end)


@pytest.mark.parametrize(
    ("text", "name", "value", "factor"),
    [
        ("flow.bias=1.4e-5@1500", "flow.bias", 1.4e-5, None),
        ("flow.gain=x1.1@1500", "flow.gain", None, 1.1),
        ("flow.stuck@1500", "flow.stuck", None, None),
        (" flow.stuck = 0 @ 1500 ", "flow.stuck", 0.0, None),
        ("u_in.noise=x3@1500", "u_in.noise", None, 3.0),
    ],
)
def test_faults_of_instruments(text: str, name: str, value: float | None, factor: float | None) -> None:
    """What is wrong with a sensor or input follows its name and a dot; a stuck one needs no value."""
    found = parse_fault(text)
    assert found == FaultRequest(parameter=name, value=value, factor=factor, start=1500.0, end=1500.0)


@pytest.mark.parametrize(
    ("text", "on", "off"), [("K6=x8@1500,300/600", 300.0, 600.0), ("flow.stuck@1500, 20", 20.0, None)]
)
def test_faults_that_come_and_go(text: str, on: float, off: float | None) -> None:
    """Behind a comma stand the seconds for which it is there, and behind a slash those for which it is gone."""
    found = parse_fault(text)
    assert (found.start, found.end, found.on, found.off) == (1500.0, 1500.0, on, off)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "expected NAME=VALUE@TIME"),
        ("K1", "expected NAME=VALUE@TIME"),
        ("K1=5", "expected NAME=VALUE@TIME"),
        ("1K=5@3", "expected NAME=VALUE@TIME"),
        ("K1=5@", "expected NAME=VALUE@TIME"),
        ("K1=five@3", "'five' is not a number"),
        ("K1=nan@3", "'nan' is not a number"),
        ("K1=xx2@3", "'x2' is not a number"),
        ("K1=2x@3", "'2x' is not a number. Give the value in the model's unit, or x2 for a factor"),
        ("K1=5@noon", "'noon' is not a time"),
        ("K1=5@3..inf", "'inf' is not a time"),
        ("K1=5@30..20", "ends before it starts"),
        ("flow.bias@3", "expected NAME=VALUE@TIME"),
        ("flow.bias=@3", "expected NAME=VALUE@TIME"),
        ("flow.bais=5@3", "'bais' is no fault of a sensor or input. Those are bias, gain, stuck, noise"),
        ("flow.drift=5@3", "Those are bias, gain, stuck, noise; a drift is a bias that grows, .bias=VALUE@FROM..TO"),
        ("flow.=5@3", "'' is no fault of a sensor or input"),
        ("K1=5@30..40,5/5", "comes and goes has one TIME"),
        ("K1=5@30,0/5", "'0' is not a length of time"),
        ("K1=5@30,5/x", "'x' is not a length of time"),
        ("K1=5@30,5/-1", "'-1' is not a length of time"),
    ],
)
def test_mistakes(text: str, message: str) -> None:
    """What is no fault is quoted, with what was expected."""
    with pytest.raises(FaultbondError, match=message) as caught:
        parse_fault(text)
    assert repr(text) in str(caught.value)
