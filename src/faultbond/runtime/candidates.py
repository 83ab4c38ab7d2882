"""What the core found, with names: its numbers as the data that people and reports are told by."""

from collections.abc import Sequence
from math import isnan
from typing import Any

from faultbond.contract.findings import (
    Advice,
    Candidate,
    Diagnosis,
    Forecast,
    Superseded,
    Suspect,
    Unexplained,
    Untested,
)
from faultbond.contract.spec import EngineSpec
from faultbond.types import CheckKind, FaultKind

_KINDS = tuple(FaultKind)
WORDS = ("", "bias", "stuck", "gain", "noise")  # what is wrong with a sensor or an input, as `found.h` numbers it


def diagnosis_of(spec: EngineSpec, found: Any) -> Diagnosis:
    """Give a diagnosis; `found` is a record of `Core.diagnosis`."""
    unexplained = untested = None
    if found["is_unexplained"]:
        unexplained = Unexplained(
            signal=spec.outputs[int(found["signal"])].name,
            sd=float(found["unexplained_sd"]),
            since=float(found["since"]),
            until=float(found["until"]),
        )
    if found["has_untested"]:
        untested = Untested(sets=int(found["untested_sets"]), probability=float(found["untested_probability"]))
    parts = [spec.parts[int(k)] for k in found["superseded"][: int(found["n_superseded"])]]
    elsewhere = found["elsewhere"][: int(found["n_elsewhere"])]
    return Diagnosis(
        time=float(found["time"]),
        candidates=tuple(candidate_of(spec, item) for item in found["candidates"][: int(found["n_candidates"])]),
        unexplained=unexplained,
        untested=untested,
        within_accuracy=float(found["within_accuracy"]),
        mismatch=float(found["mismatch"]),
        superseded=Superseded(components=tuple(parts), until=float(found["superseded_until"])) if parts else None,
        elsewhere=tuple(spec.parameters[int(k)].name for k in elsewhere),
    )


def candidate_of(spec: EngineSpec, found: Any) -> Candidate:
    """Give a candidate; `found` is a record of `Core.candidate`."""
    count = int(found["n_kinds"])
    kinds = tuple((_KINDS[k], float(share)) for k, share in zip(found["kinds"][:count], found["shares"], strict=False))
    return Candidate(
        suspects=tuple(_suspect(spec, item) for item in found["suspects"][: int(found["n_suspects"])]),
        probability=float(found["probability"]),
        group=bool(found["group"]),
        kind=kinds[0][0],
        kinds=kinds,
        present=bool(found["present"]),
        hypothesis=int(found["hypothesis"]),
        lane=int(found["lane"]),
    )


def advice_of(spec: EngineSpec, found: Any, diagnosis: Any) -> tuple[Advice, ...]:
    """Give advice; `found` is a record of `Core.advice`, `diagnosis` that of `Core.diagnosis` which it is for."""
    rivals = [candidate_of(spec, item).components for item in diagnosis["candidates"][: int(found["n_rivals"])]]
    return tuple(_advice(spec, item, rivals) for item in found["checks"][: int(found["n_checks"])])


def _advice(spec: EngineSpec, found: Any, rivals: Sequence[tuple[str, ...]]) -> Advice:
    kind, groups = tuple(CheckKind)[int(found["kind"])], found["group"][: len(rivals)]
    targets = {
        CheckKind.COMPONENT: spec.parts,
        CheckKind.INPUT: tuple(item.name for item in spec.inputs),
        CheckKind.SIGNAL: tuple(spec.checked(CheckKind.SIGNAL)),
    }
    return Advice(
        kind=kind,
        target=targets[kind][int(found["target"])],
        gain=float(found["gain"]),
        cost=float(found["cost"]),
        separates=tuple(
            tuple(names for names, group in zip(rivals, groups, strict=True) if group == k)
            for k in range(int(found["n_groups"]))
        ),
        value=_number(found["value"]),
        within=_number(found["within"]),
    )


def _suspect(spec: EngineSpec, found: Any) -> Suspect:
    index = int(found["parameter"])
    if index >= 0:
        name, component = spec.parameters[index].name, spec.parameters[index].component
    else:
        k, j = int(found["input"]), int(found["output"])
        component = spec.inputs[k].name if k >= 0 else spec.outputs[j].name
        name = f"{component}.{WORDS[int(found['word'])]}"
    forecasts = found["forecasts"][: int(found["n_forecasts"])]
    return Suspect(
        parameter=name,
        component=component,
        nominal=_number(found["nominal"]),
        estimate=float(found["estimate"]),
        sd=float(found["sd"]),
        rate=_number(found["rate"]),
        rate_sd=_number(found["rate_sd"]),
        began=_number(found["began"]),
        ended=_number(found["ended"]),
        moved=float(found["moved"]),
        stopped=_number(found["stopped"]),
        forecasts=tuple(
            Forecast(
                limit=float(item["limit"]),
                time=_number(item["time"]),
                earliest=_number(item["earliest"]),
                latest=_number(item["latest"]),
            )
            for item in forecasts
        ),
    )


def _number(value: Any) -> float | None:
    """Give a number; None where there is none."""
    return None if isnan(value) else float(value)
