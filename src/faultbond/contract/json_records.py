"""The records of a run: what a program reads, as plain mappings ready for JSON; SI units, percent stays percent."""

from collections.abc import Sequence
from dataclasses import asdict

from faultbond.contract.findings import (
    Advice,
    Candidate,
    Decision,
    Detection,
    Diagnosis,
    Forecast,
    Superseded,
    Suspect,
    Unexplained,
    Untested,
)
from faultbond.contract.silence import Silent
from faultbond.types import Method

Record = dict[str, object]


def run_record(
    *,
    model: str,
    model_sha256: str,
    method: Method,
    version: str,
    sample_time: float | None,
    explain_anything: Sequence[Sequence[str]] = (),
    continues: float | None = None,
) -> Record:
    """Give the first record: what is run on what; no sample time where rows come as they come, or have no time.

    explain_anything: sets of parameters that are not tested, since no data could contradict them. continues: last time
    of the run from which this one goes on.
    """
    return {
        "record": "run",
        "model": model,
        "model_sha256": model_sha256,
        "method": method.value,
        "version": version,
        "sample_time": sample_time,
        "explain_anything": [list(names) for names in explain_anything],
        "continues": continues,
    }


def detection_record(detection: Detection) -> Record:
    """Give the record of an alarm; `walk` only where that raised it."""
    record: Record = {
        "record": "detection",
        "time": detection.time,
        "sample": detection.sample,
        "change_time": detection.change_time,
        "signals": list(detection.signals),
    }
    walk = detection.walk
    if walk is not None:
        record["walk"] = asdict(walk)
    return record


def diagnosis_record(diagnosis: Diagnosis, *, outside: bool = False) -> Record:
    """Give the record of a diagnosis, best candidate first; `outside` only where the model does not hold then."""
    return {
        "record": "diagnosis",
        "time": diagnosis.time,
        "candidates": [candidate_content(candidate) for candidate in diagnosis.candidates],
        "unexplained": None if diagnosis.unexplained is None else _unexplained(diagnosis.unexplained),
        "advice": [_advice(item) for item in diagnosis.advice],
        "untested": None if diagnosis.untested is None else _untested(diagnosis.untested),
        "within_accuracy": diagnosis.within_accuracy if diagnosis.candidates else None,
        "mismatch": diagnosis.mismatch,
        **({} if diagnosis.superseded is None else {"superseded": _superseded(diagnosis.superseded)}),
        **({"elsewhere": list(diagnosis.elsewhere)} if diagnosis.elsewhere else {}),
        **({"strained": list(diagnosis.strained)} if diagnosis.strained else {}),
        **({"outside": True} if outside else {}),
    }


def _superseded(superseded: Superseded) -> Record:
    return {"components": list(superseded.components), "until": superseded.until}


def _untested(untested: Untested) -> Record:
    return {"sets": untested.sets, "probability": untested.probability}


def _advice(advice: Advice) -> Record:
    return {
        "check": advice.kind.value,
        "target": advice.target,
        "gain": advice.gain,
        "cost": advice.cost,
        "value": advice.value,
        "within": advice.within,
        "separates": [[list(components) for components in group] for group in advice.separates],
    }


def decision_record(accepted: Decision, *, rejected: bool = False) -> Record:
    """Give the record of a candidate that was accepted, or rejected, and by whom."""
    told = candidate_content(accepted.candidate)
    return {
        "record": "rejected" if rejected else "accepted",
        "time": accepted.time,
        **{key: told[key] for key in ("components", "parameters", "probability", "kind")},
        "by": accepted.by.value,
        **({} if rejected else {"repaired": accepted.repaired}),
    }


def end_record(
    *,
    time: float | None,
    samples: int,
    watched: int,
    detections: int,
    missing: int,
    late: int,
    duplicate: int,
    untimed: int = 0,
    unused: int = 0,
    clock_jumps: int = 0,
    saturated: int = 0,
    frozen: int = 0,
    wild: int = 0,
    outside: int = 0,
    sensors_outside: int = 0,
    dropped: int = 0,
    silent: Sequence[Silent] = (),
) -> Record:
    """Give the last record.

    Parameters
    ----------
    time : last grid point, s; None where there was none
    samples : grid points passed
    watched : grid points with a measured value at which the alarms were on; 0: the run has no verdict
    detections : alarms raised
    missing : grid points at which a needed value was absent
    late, duplicate, untimed : rows that came too late, or twice, or whose time cannot be read
    unused : rows whose grid point is served by another row
    clock_jumps : grid points at which a run goes on after a change of the clock or a long gap
    saturated, frozen : values at an end of their range, or of a sensor that stays the same
    wild : values far beyond all that was seen, which the plant does not follow
    outside : grid points at which the model does not hold, by `valid_when`
    sensors_outside : readings at others that are not judged, since their sensor does not hold
    dropped : rows of this run that came too late to be used
    silent : sensors and inputs that gave no value in this run, hardly any, or none for long
    """
    return {
        "record": "end",
        "time": time,
        "samples": samples,
        "watched": watched,
        "detections": detections,
        "missing": missing,
        "late": late,
        "duplicate": duplicate,
        "untimed": untimed,
        "unused": unused,
        "clock_jumps": clock_jumps,
        "saturated": saturated,
        "frozen": frozen,
        "wild": wild,
        "outside": outside,
        "sensors_outside": sensors_outside,
        "dropped": dropped,
        "silent": [
            {"name": item.name, "role": item.role, "values": item.values, "since": item.since, "until": item.until}
            for item in silent
        ],
    }


def candidate_content(candidate: Candidate) -> Record:
    """Give what a diagnosis tells of a candidate."""
    return {
        "components": list(candidate.components),
        "parameters": {suspect.parameter: _suspect(suspect) for suspect in candidate.suspects},
        "probability": candidate.probability,
        "group": candidate.group,
        "kind": candidate.kind.value if candidate.kinds else None,
        "kinds": {kind.value: share for kind, share in candidate.kinds},
        "present": candidate.present,
    }


def _suspect(suspect: Suspect) -> Record:
    """Give the value of a suspect; a rate where it drifts, times where it has come to stay, `moved` where it moves.

    Of an input whose record stands still also when it `stopped`.
    """
    value: Record = {"nominal": suspect.nominal, "estimate": suspect.estimate, "sd": suspect.sd}
    if suspect.moved:
        value["moved"] = suspect.moved
    if suspect.began is not None:
        value |= {"began": suspect.began, "ended": suspect.ended}
    if suspect.stopped is not None:
        value["stopped"] = suspect.stopped
    if suspect.rate is None:
        return value
    forecasts = [_forecast(item) for item in suspect.forecasts]
    return value | {"rate": suspect.rate, "rate_sd": suspect.rate_sd, "forecasts": forecasts}


def _forecast(item: Forecast) -> Record:
    return {"limit": item.limit, "time": item.time, "earliest": item.earliest, "latest": item.latest}


def _unexplained(found: Unexplained) -> Record:
    return {"signal": found.signal, "sd": found.sd, "since": found.since, "until": found.until}
