"""One suspect in words."""

from dataclasses import replace

import pytest

from fake import kind_of, moving, suspect, tank_graph, wrong
from faultbond.contract.findings import Candidate, Forecast, Suspect
from faultbond.fit.wander import Wander
from faultbond.model.graph import Unit
from faultbond.model.text import parse_model
from faultbond.report.fit_result import _wander_text
from faultbond.report.numbers import Notation
from faultbond.report.suspects import (
    change_of,
    cure_of_walk,
    otherwise,
    owner_of,
    rows_of,
    shown_in,
    title_of,
    unit_of,
    with_article,
)
from faultbond.types import FaultKind
from plants import pumped_tank

GRAPH = tank_graph()  # flow in l/min, pressure in kPa, inputs in percent
NOW = 3000.0


def said(found: Suspect, kind: FaultKind, there: bool = True, notation: Notation = Notation.FILE) -> str:
    """Give what is said of a suspect of one kind."""
    return change_of(GRAPH, kind_of(found, (kind, 1.0), there=there), found, NOW, notation)


def limit(time: float | None, earliest: float | None, latest: float | None, value: float = 4.8e11) -> Forecast:
    """Give a forecast for a limit of K1."""
    return Forecast(limit=value, time=time, earliest=earliest, latest=latest)


@pytest.mark.parametrize(
    ("found", "kind", "text"),
    [
        (wrong("flow.bias", 0.0, 1e-3 / 60.0, 2e-5 / 60.0), FaultKind.BIAS, "it reads 1.000 l/min too high (bias)"),
        (wrong("pressure.bias", 0.0, -500.0, 60.0), FaultKind.BIAS, "it reads 0.50 kPa too low (bias)"),
        (wrong("pressure.bias", 0.0, -100.0, 60.0), FaultKind.BIAS, "its bias may still be 0"),
        (wrong("flow.gain", 1.0, 1.1, 0.005), FaultKind.GAIN, "it reads 1.100 times the right value (gain, +10.0 %)"),
        (wrong("flow.gain", 1.0, 1.1, 0.1), FaultKind.GAIN, "its gain may still be right"),
        (wrong("u_in.gain", 1.0, 1.25, 0.005), FaultKind.GAIN, "it acts 1.250 times what is recorded (gain, +25 %)"),
        (wrong("pressure.stuck", None, 9115.0, 4.0), FaultKind.STUCK, "it is stuck at 9.115 kPa"),
        (
            wrong("pressure.noise", 180.0, 540.0, 50.0),
            FaultKind.NOISE,
            "it scatters by 0.54 kPa, 3 times as much as the model file says (noise)",
        ),
        (wrong("u_in.bias", 0.0, 4.5, 0.4), FaultKind.BIAS, "it acts 4.5 percent above what is recorded (bias)"),
        (wrong("u_in.bias", 0.0, -4.5, 0.4), FaultKind.BIAS, "it acts 4.5 percent below what is recorded (bias)"),
        (wrong("flow.bias", 0.0, 1.0, float("nan")), FaultKind.BIAS, "its bias is not determined by the data"),
    ],
)
def test_instruments(found: Suspect, kind: FaultKind, text: str) -> None:
    """What is wrong with a sensor or an input is said in its own unit, and whether that is much."""
    assert said(found, kind) == text


def test_a_sensor_that_drifts() -> None:
    """The bias of now is told with the rate in a handy unit of time, and whether it grows."""
    bias = replace(wrong("pressure.bias", 0.0, 500.0, 20.0), rate=1.0, rate_sd=0.04)
    grows = said(bias, FaultKind.DRIFT)
    assert grows == "it reads 0.500 kPa too high now, and this grows by 0.0600 kPa per minute (drift)"
    assert "this shrinks by" in said(replace(bias, rate=-1.0), FaultKind.DRIFT)
    assert "too low now, and this grows by" in said(replace(bias, estimate=-500.0, rate=-1.0), FaultKind.DRIFT)
    assert said(replace(bias, rate_sd=0.9), FaultKind.DRIFT).endswith("drifts at a rate that is not known yet")
    gain = replace(wrong("u_in.gain", 1.0, 0.8, 0.01), rate=-1e-4, rate_sd=1e-6)
    assert said(gain, FaultKind.DRIFT).endswith(
        "0.800 times what is recorded now, and this falls by 0.360 per hour (drift)"
    )
    assert said(replace(gain, rate=1e-4), FaultKind.DRIFT).endswith("and this rises by 0.360 per hour (drift)")


def test_a_fault_that_comes_and_goes() -> None:
    """The value while the fault is there is told, and whether it is there now."""
    leak = suspect(GRAPH, "K6", 8.0, 0.1)
    text = said(leak, FaultKind.INTERMITTENT, there=False)
    assert text == "K6 is 8.32e-5 m^3/s (+700 %) instead of 1.04e-5 while the fault is there; it is gone now"
    assert said(leak, FaultKind.INTERMITTENT).endswith("it is there now")
    loose = said(wrong("pressure.stuck", None, 0.0, 5.0), FaultKind.INTERMITTENT, there=False)
    assert loose == "it is stuck at 0.000 kPa while the fault is there; it is gone now"
    away = said(wrong("u_in.bias", 0.0, -4.5, 0.4), FaultKind.INTERMITTENT)
    assert away == "it acts 4.5 percent below what is recorded (bias) while the fault is there; it is there now"


def test_a_ramp_that_has_ended() -> None:
    """From what to what, over which time, and that it has stopped; of an instrument too."""
    pipe, valve = suspect(GRAPH, "K2", 1.5, 0.02), wrong("u_in.bias", 0.0, -4.5, 0.4)
    assert said(replace(pipe, began=1502.2, ended=1560.4), FaultKind.RAMP) == (
        "K2 rose from 5.08e11 to 7.62e11 Pa*s^2/m^6 (+50 %) in about 58 s up to about 1560 s, and has stayed there "
        "since"
    )
    gain = replace(wrong("flow.gain", 1.0, 1.1, 0.005), began=1502.2, ended=1560.4)
    assert said(gain, FaultKind.RAMP) == (
        "it reads 1.100 times the right value (gain, +10.0 %); it came to that in about 58 s up to about 1560 s, and "
        "has stayed there since"
    )
    assert said(replace(valve, began=1502.2, ended=1560.4), FaultKind.RAMP) == (
        "it acts 4.5 percent below what is recorded (bias); it came to that in about 58 s up to about 1560 s, "
        "and has stayed there since"
    )
    assert said(replace(valve, began=1502.2, ended=1560.4, moved=5.0), FaultKind.RAMP) == (
        "it acts 4.5 percent below what is recorded (bias); it came to that in about 58 s up to about 1560 s"
    )


def test_a_drift_and_when_its_limit_is_reached() -> None:
    """Value of now, rate in a handy unit of time, and the limit with its time, all rounded to what is known."""
    ahead = limit(4213.7, 3611.2, 5333.3)
    assert said(moving(GRAPH, "K1", 1.82, 7.5e7, ahead), FaultKind.DRIFT) == (
        "K1 is 4.39e11 Pa*s^2/m^6 now (+82 %) and rises by 4.5e9 Pa*s^2/m^6 per minute; it reaches the limit of 4.8e11 "
        "Pa*s^2/m^6 in about 20 min, at 4200 s (3600 s to 5300 s)"
    )
    assert "falls by" in said(moving(GRAPH, "K1", 0.5, -7.5e7), FaultKind.DRIFT)
    slow = replace(moving(GRAPH, "K1", 1.82, 7.5e7), rate_sd=7e7)
    assert said(slow, FaultKind.DRIFT).endswith("moves at a rate that is not known yet")
    unsure = replace(moving(GRAPH, "K1", 1.82, 7.5e7, ahead), rate_sd=7e7)
    assert said(unsure, FaultKind.DRIFT).endswith("it may reach the limit of 4.8e11 Pa*s^2/m^6, not before 3610 s")
    neither = replace(moving(GRAPH, "K1", 1.01, 7.5e7), rate_sd=7e7)
    assert said(neither, FaultKind.DRIFT) == (
        "K1 may still be 2.41e11 Pa*s^2/m^6, or move at a rate that is not known yet"
    )


def test_a_drift_that_has_nowhere_to_go() -> None:
    """A value at the end of its range, that would move by a tenth of its nominal in each sample, has no rate told."""
    found = said(moving(GRAPH, "K1", 0.02, -3e10), FaultKind.DRIFT)
    assert found.startswith("K1 is 5e9 Pa*s^2/m^6 now (")
    assert found.endswith("), and moves too fast to be a drift")
    assert "falls by" in said(moving(GRAPH, "K1", 0.02, -2e10), FaultKind.DRIFT)
    unsure = replace(moving(GRAPH, "K1", 0.02, -3e10), rate_sd=5e10)
    assert said(unsure, FaultKind.DRIFT).endswith("moves at a rate that is not known yet")


@pytest.mark.parametrize(
    ("factor", "forecast", "text"),
    [
        (1.82, limit(4200.0, 3600.0, None), "at 4200 s (3600 s to never)"),
        (1.82, limit(None, 3600.0, None), "it may reach the limit of 4.8e11 Pa*s^2/m^6, not before 3600 s"),
        (1.82, limit(None, None, None), ""),
        (2.4, limit(None, None, None), "it has passed the limit of 4.8e11 Pa*s^2/m^6"),
        (2.0, limit(None, None, None), "it is at about the limit of 4.8e11 Pa*s^2/m^6"),
        (0.5, limit(None, None, None, 1.5e11), "it has passed the limit of 1.5e11 Pa*s^2/m^6"),
    ],
)
def test_limits_that_are_near_far_or_passed(factor: float, forecast: Forecast, text: str) -> None:
    """A limit that lies behind is called passed, one that is not ahead is not spoken of."""
    found = said(moving(GRAPH, "K1", factor, 7.5e7, forecast), FaultKind.DRIFT)
    assert text in found
    assert text or found.endswith("per minute")


def test_other_kinds_are_told_when_they_are_likely() -> None:
    """A kind with at least a twentieth of the probability is named beside the likeliest one."""
    found = suspect(GRAPH, "K1", 1.5, 0.1)
    open_case = kind_of(found, (FaultKind.STEP, 0.61), (FaultKind.DRIFT, 0.35), (FaultKind.INTERMITTENT, 0.04))
    assert otherwise(open_case) == " Of its kind less is sure: it may also be a drift (35 %)."
    assert otherwise(kind_of(found, (FaultKind.STEP, 0.96), (FaultKind.DRIFT, 0.04))) == ""
    assert "a drift (5 %)" in otherwise(kind_of(found, (FaultKind.STEP, 0.95), (FaultKind.DRIFT, 0.05)))
    assert otherwise(Candidate(suspects=(found,), probability=1.0, group=True)) == ""


def test_units_of_instruments() -> None:
    """A bias is a difference, a sensor is stuck at a value, a gain has no unit."""
    warm = Unit("degC", 1.0, 273.15)
    graph = replace(GRAPH, sensors=(replace(GRAPH.sensors[0], name="T", unit=warm), *GRAPH.sensors[1:]))
    assert unit_of(graph, "T.bias") == Unit("degC", 1.0)
    assert unit_of(graph, "T.noise") == Unit("degC", 1.0)
    assert unit_of(graph, "T.stuck") == warm
    assert unit_of(graph, "T.gain") == Unit("")
    assert [shown_in(graph, name, Notation.PRINT) for name in ("T.gain", "T.bias", "u_in.gain", "K1")] == [
        " in degC",
        "",
        "",
        "",
    ]
    found = wrong("T.gain", 1.0, 1.1, 0.005)
    told = change_of(graph, kind_of(found, (FaultKind.GAIN, 1.0)), found, 0.0, Notation.PRINT)
    assert told == "it reads 1.100 times the right value in degC (gain, +10.0 %)"
    assert unit_of(graph, "u_in.bias").text == "percent"
    assert unit_of(graph, "nobody.bias") == Unit("")


def test_names_of_instruments() -> None:
    """A sensor and an input are named as such, so that they are not taken for a component."""
    assert owner_of(GRAPH, wrong("flow.bias", 0.0, 1.0, 0.1)) == "flow sensor"
    assert title_of(GRAPH, wrong("u_in.bias", 0.0, 1.0, 0.1)) == "bias of input u_in"
    assert title_of(GRAPH, suspect(GRAPH, "K1", 1.5, 0.1)) == "K1 of pipe"


def test_articles_stand_before_words_only() -> None:
    """A component with a word for a name gets an article, a letter or a number of the plant does not."""
    assert [with_article(name) for name in ("pipe", "R", "tank1", "flow sensor", "leak_a", "K7")] == [
        "the pipe",
        "R",
        "tank1",
        "the flow sensor",
        "leak_a",
        "K7",
    ]


def test_rows_of_a_drift_and_of_a_stuck_sensor() -> None:
    """A rate has a line of its own, in a unit of time that suits it; without a nominal value there is no change."""
    value, rate = rows_of(GRAPH, moving(GRAPH, "K1", 1.82, 8e7), Notation.FILE, "+ ")
    assert (value.component, value.parameter, value.change) == ("+ pipe", "K1", "+82 %")
    assert (rate.component, rate.parameter, rate.estimate) == ("", "rate", "4.8e9 ± 0.5e9")
    assert rate.unit == "Pa*s^2/m^6/min"
    (stuck,) = rows_of(GRAPH, wrong("pressure.stuck", None, 9115.0, 4.0), Notation.FILE)
    assert (stuck.component, stuck.parameter, stuck.nominal) == ("pressure sensor", "stuck", "")
    assert (stuck.estimate, stuck.unit, stuck.change) == ("9.115 ± 0.004", "kPa", "")


def test_what_lags_cannot_wander() -> None:
    """The cure of a parameter that moves too far is one that the model file takes: of a lag its accuracy alone."""
    graph = parse_model(pumped_tank(speed=", lag: 3 s"))
    assert cure_of_walk(graph, "K") == "Declare the accuracy of K larger, or that it wanders, or mend what moves it."
    assert cure_of_walk(graph, "u_lag") == "Declare the accuracy of u_lag larger, or mend what moves it."
    wanders = [Wander(parameter=name, size=0.16, memory=20.0, gain=165.0) for name in ("K", "u_lag")]
    texts = [_wander_text(item, graph.lags) for item in wanders]
    assert "declare `wander: 16 % over 20 s` and fit again (165 nats)" in texts[0]
    assert "u_lag, as it seems, by 16 %: " in texts[1]
    assert "its accuracy says so (165 nats)" in texts[1]
