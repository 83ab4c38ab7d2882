"""The records of a run."""

import json

import numpy as np

from faultbond.runtime.history import Candidate, Detection, Diagnosis, Suspect
from faultbond.runtime.lanes import plan_lanes
from faultbond.runtime.ranking import rank
from faultbond.runtime.records import detection_record, diagnosis_record, end_record, run_record
from faultbond.spec import EngineSpec, InputSpec, OutputSpec, ParameterSpec, StateSpec, Thresholds
from faultbond.types import Method


def parameter(name: str, owner: str) -> ParameterSpec:
    """Give a parameter of nominal 2 in units of 1e3."""
    return ParameterSpec(
        name=name,
        component=owner,
        nominal=2.0,
        scale=2.0,
        accuracy=0.03,
        change=2.0,
        lower=0.02,
        upper=50.0,
        suspect=True,
        unit="kohm",
        unit_factor=1e3,
    )


SPEC = EngineSpec(
    model="circuit",
    model_sha256="ab" * 32,
    version="0.1.0",
    sample_time=0.5,
    states=(StateSpec(name="C.q", start_mean=0.0, start_sd=1.0, noise=0.0),),
    slow_errors=(),
    parameters=(parameter("R", "R"), parameter("C", "C")),
    inputs=(InputSpec(name="V", noise=0.0, settling=0.0, step=1.0, step_part=0.0),),
    outputs=(OutputSpec(name="V_C", noise=0.1, direct_inputs=(), unit="V", unit_factor=1.0, unit_offset=0.0),),
    loops=(),
    hypotheses=((0,), (1,), (0, 1)),
    thresholds=Thresholds(),
)


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


def test_a_diagnosis() -> None:
    """Each candidate has its components, each once, and its parameters with nominal, estimate and sd in SI."""
    pair = tuple(Suspect(parameter=n, component="K", nominal=2.0, estimate=3.0, sd=0.1) for n in ("K1", "K2"))
    diagnosis = Diagnosis(time=20.0, candidates=(Candidate(suspects=pair, probability=0.75, group=True),))
    numbers = {"nominal": 2.0, "estimate": 3.0, "sd": 0.1}
    assert diagnosis_record(diagnosis) == {
        "record": "diagnosis",
        "time": 20.0,
        "candidates": [
            {"components": ["K"], "parameters": {"K1": numbers, "K2": numbers}, "probability": 0.75, "group": True}
        ],
    }


def test_the_last_record() -> None:
    """It has all counts, and no time where there was no sample."""
    counts = {"samples": 9, "watched": 4, "detections": 1, "missing": 3, "late": 2, "duplicate": 1}
    assert end_record(time=4.0, **counts) == {"record": "end", "time": 4.0} | counts
    assert end_record(time=None, **counts)["time"] is None


def test_probabilities_of_all_tested_sets_sum_to_one() -> None:
    """A ranked bank gives every set, best first, with probabilities that sum to 1 and a group that has the best."""
    lanes = np.zeros((SPEC.n_numbers, plan_lanes(SPEC).n_lanes))
    lanes[-1] = np.linspace(-9.0, -3.0, lanes.shape[1])
    record = json.loads(json.dumps(diagnosis_record(rank(SPEC, 1.0, lanes))))
    probabilities = [candidate["probability"] for candidate in record["candidates"]]
    assert len(probabilities) == len(SPEC.hypotheses)
    assert probabilities == sorted(probabilities, reverse=True)
    assert sum(probabilities) == 1.0 or abs(sum(probabilities) - 1.0) < 1e-12
    assert record["candidates"][0]["group"] is True
