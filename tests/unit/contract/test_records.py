"""The records of a run."""

import json
from dataclasses import replace

from faultbond.contract.findings import Candidate, Detection, Diagnosis, Forecast, Suspect, Unexplained, Walk
from faultbond.contract.json_records import detection_record, diagnosis_record, end_record, run_record
from faultbond.contract.silence import Silent
from faultbond.simulate import Fault
from faultbond.types import FaultKind, Method
from made import plant, recorded, run


def test_the_first_record() -> None:
    """It names the model, its hash, the method, the version and the sample time."""
    assert run_record(
        model="circuit",
        model_sha256="ab" * 32,
        method=Method.BANK,
        version="0.1.0",
        sample_time=0.5,
        explain_anything=[("R", "C")],
    ) == {
        "record": "run",
        "model": "circuit",
        "model_sha256": "ab" * 32,
        "method": "bank",
        "version": "0.1.0",
        "sample_time": 0.5,
        "explain_anything": [["R", "C"]],
        "continues": None,
    }


def test_a_detection() -> None:
    """It has the time of the alarm, its sample, the onset and the signals as a list."""
    detection = Detection(time=12.5, sample=25, change_time=10.0, signals=("V_C",))
    assert detection_record(detection) == {
        "record": "detection",
        "time": 12.5,
        "sample": 25,
        "change_time": 10.0,
        "signals": ["V_C"],
    }
    walked = replace(detection, walk=Walk(parameter="R", sd=3.6, from_start=True))
    assert detection_record(walked)["walk"] == {"parameter": "R", "sd": 3.6, "from_start": True, "together": False}


def test_a_diagnosis() -> None:
    """Each candidate has its components, each once, and its parameters with nominal, estimate and sd in SI."""
    pair = tuple(Suspect(parameter=n, component="K", nominal=2.0, estimate=3.0, sd=0.1) for n in ("K1", "K2"))
    found = Candidate(suspects=pair, probability=0.75, group=True, kinds=((FaultKind.STEP, 1.0),))
    numbers = {"nominal": 2.0, "estimate": 3.0, "sd": 0.1}
    assert diagnosis_record(Diagnosis(time=20.0, candidates=(found,))) == {
        "record": "diagnosis",
        "time": 20.0,
        "candidates": [
            {
                "components": ["K"],
                "parameters": {"K1": numbers, "K2": numbers},
                "probability": 0.75,
                "group": True,
                "kind": "step",
                "kinds": {"step": 1.0},
                "present": True,
            }
        ],
        "unexplained": None,
        "advice": [],
        "untested": None,
        "within_accuracy": 0.0,
        "mismatch": 0.0,
    }


def candidates(*found: Candidate) -> list[dict[str, object]]:
    """Give the members of a diagnosis record as a program reads them."""
    record = json.loads(json.dumps(diagnosis_record(Diagnosis(time=20.0, candidates=found))))
    listed: list[dict[str, object]] = record["candidates"]
    return listed


def test_a_drift_has_its_rate_and_forecasts() -> None:
    """Only a value that moves has a rate; a limit that is never reached has no latest time."""
    limit = Forecast(limit=4.0, time=90.0, earliest=50.0, latest=None)
    moving = Suspect(
        parameter="K1", component="K", nominal=2.0, estimate=3.0, sd=0.1, rate=0.01, rate_sd=0.002, forecasts=(limit,)
    )
    kinds = ((FaultKind.DRIFT, 0.9), (FaultKind.STEP, 0.1))
    record = candidates(Candidate(suspects=(moving,), probability=1.0, group=True, kind=FaultKind.DRIFT, kinds=kinds))
    assert record[0]["kind"] == "drift"
    assert record[0]["kinds"] == {"drift": 0.9, "step": 0.1}
    assert record[0]["parameters"] == {
        "K1": {
            "nominal": 2.0,
            "estimate": 3.0,
            "sd": 0.1,
            "rate": 0.01,
            "rate_sd": 0.002,
            "forecasts": [{"limit": 4.0, "time": 90.0, "earliest": 50.0, "latest": None}],
        }
    }


def test_a_fault_of_a_sensor() -> None:
    """Its component is the sensor; where there is no healthy value to compare with, nominal is null."""
    stuck = Suspect(parameter="V_C.stuck", component="V_C", nominal=None, estimate=3.0, sd=0.1)
    kinds = ((FaultKind.STUCK, 1.0),)
    record = candidates(Candidate(suspects=(stuck,), probability=1.0, group=True, kind=FaultKind.STUCK, kinds=kinds))
    assert record[0]["components"] == ["V_C"]
    assert record[0]["parameters"] == {"V_C.stuck": {"nominal": None, "estimate": 3.0, "sd": 0.1}}


def test_a_network_without_time_has_no_kinds() -> None:
    """Kinds of fault differ in time; a network without time knows none."""
    record = candidates(Candidate(suspects=(), blocks=("A",), probability=1.0, group=True))
    assert (record[0]["kind"], record[0]["kinds"]) == (None, {})


def test_what_no_fault_explains_is_in_the_diagnosis() -> None:
    """Signal, size in standard deviations and the time over which the best candidate is off."""
    off = Unexplained(signal="V_C", sd=3.5, since=12.0, until=19.0)
    record = diagnosis_record(Diagnosis(time=20.0, candidates=(), unexplained=off))
    assert record["unexplained"] == {"signal": "V_C", "sd": 3.5, "since": 12.0, "until": 19.0}


def test_the_last_record() -> None:
    """It has all counts, and no time where there was no sample."""
    counts = {"samples": 9, "watched": 4, "detections": 1, "missing": 3, "late": 2, "duplicate": 1}
    more = {"untimed": 5, "unused": 6, "clock_jumps": 7, "saturated": 8, "frozen": 10, "wild": 11}
    more |= {"outside": 12, "sensors_outside": 13, "dropped": 14}
    silent = Silent(name="V_C", role="sensor", values=2, samples=9, since=1.0, until=None)
    told = end_record(time=4.0, silent=[silent], **counts, **more)
    of_sensor = {"name": "V_C", "role": "sensor", "values": 2, "since": 1.0, "until": None}
    assert told == {"record": "end", "time": 4.0} | counts | more | {"silent": [of_sensor]}
    none = dict.fromkeys(more, 0)
    assert end_record(time=4.0, silent=(), **counts) == {"record": "end", "time": 4.0} | counts | none | {"silent": []}
    assert end_record(time=None, silent=(), **counts)["time"] is None


def test_probabilities_of_all_tested_sets_sum_to_one() -> None:
    """The diagnosis of a run gives every set, best first, with probabilities and shares of kinds that sum to 1."""
    _, spec, core = plant("rc")
    found = run(core, recorded("rc", 300, Fault(parameter="C", factor=1.6, start=4.0)))[0].finish()
    assert found is not None
    record = json.loads(json.dumps(diagnosis_record(found)))
    probabilities = [candidate["probability"] for candidate in record["candidates"]]
    assert len(probabilities) == spec.n_hypotheses
    assert probabilities == sorted(probabilities, reverse=True)
    assert abs(sum(probabilities) - 1.0) < 1e-12
    assert all(abs(sum(candidate["kinds"].values()) - 1.0) < 1e-12 for candidate in record["candidates"])
    assert all(candidate["kind"] == next(iter(candidate["kinds"])) for candidate in record["candidates"])
    assert record["candidates"][0]["group"] is True
