"""What a diagnosis comes to for an operator: a status of NE 107, and a line."""

from dataclasses import replace

import pytest

from fake import kind_of, suspect, tank_graph
from faultbond.contract.findings import Diagnosis, Unexplained
from faultbond.contract.silence import INPUT, SENSOR, Silent
from faultbond.service.asset_status import _silence, _status_of, diagnosis_line
from faultbond.service.contract.messages import Ne107
from faultbond.types import FaultKind

GRAPH = tank_graph()
PIPE = kind_of(suspect(GRAPH, "K1", 1.8, 0.02), (FaultKind.STEP, 1.0), probability=0.4)
FOUND = Diagnosis(time=9.0, candidates=(PIPE,))
AWAY = Unexplained(signal="flow", sd=1.2, since=1.0, until=9.0)


@pytest.mark.parametrize(
    ("diagnosis", "status", "line"),
    [
        (FOUND, Ne107.FAILURE, "pipe"),
        (replace(FOUND, mismatch=0.4), Ne107.FAILURE, "pipe"),
        (replace(FOUND, mismatch=0.5), Ne107.OFF_SPEC, "most likely the model is off; else pipe"),
        (
            replace(FOUND, mismatch=0.5, strained=("K3", "K6")),
            Ne107.OFF_SPEC,
            "K3 and K6 moved far besides, so more may have changed, or the model is off; else pipe",
        ),
        (replace(FOUND, unexplained=AWAY), Ne107.OFF_SPEC, "no fault of the model explains it; nearest comes pipe"),
        (replace(FOUND, within_accuracy=0.6), Ne107.MAINTENANCE_REQUIRED, "nothing has changed beyond what is known"),
    ],
)
def test_what_speaks_against_a_fault_is_said_first(diagnosis: Diagnosis, status: Ne107, line: str) -> None:
    """A model that is likely off, data that nothing explains, a change of no more than is known: none is a failure."""
    assert _status_of(diagnosis) is status
    assert diagnosis_line(GRAPH, diagnosis).startswith(line)


def test_all_that_are_silent_are_named() -> None:
    """Of a few it is said how silent each was."""
    flow = Silent(name="flow", role=SENSOR, values=399, samples=497, since=398.0, until=None)
    level = Silent(name="level", role=SENSOR, values=0, samples=497, since=None, until=None)
    pump = Silent(name="pump", role=INPUT, values=0, samples=497, since=None, until=None)
    told = "the sensor flow gave a value in 399 of 497 samples, none from 398 s on"
    assert _silence((flow,)) == told
    assert _silence((flow, level)) == f"{told}; the sensor level gave no value"
    many = _silence((flow, level, pump, replace(flow, name="speed")))
    named = "the sensor flow, the sensor level, the input pump and the sensor speed"
    assert many == f"{named} gave no value, hardly any, or none for long"
