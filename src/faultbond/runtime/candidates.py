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
_NUMBERS = ("n_kinds", "kinds", "shares", "n_suspects", "probability", "group", "present", "hypothesis", "lane")
_NAMING = ("parameter", "input", "output", "word")
_OF_SUSPECT = (
    *_NAMING,
    *("nominal", "estimate", "sd", "rate", "rate_sd", "began", "ended"),
    *("moved", "stopped", "n_forecasts"),
)
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
    elsewhere, strained = (
        tuple(spec.parameters[int(k)].name for k in found[name][: int(found[f"n_{name}"])])
        for name in ("elsewhere", "strained")
    )
    return Diagnosis(
        time=float(found["time"]),
        candidates=candidates_of(spec, found["candidates"][: int(found["n_candidates"])]),
        unexplained=unexplained,
        untested=untested,
        within_accuracy=float(found["within_accuracy"]),
        mismatch=float(found["mismatch"]),
        superseded=Superseded(components=tuple(parts), until=float(found["superseded_until"])) if parts else None,
        elsewhere=elsewhere,
        strained=strained,
        over=bool(found["is_over"]),
    )


def candidate_of(spec: EngineSpec, found: Any) -> Candidate:
    """Give a candidate; `found` is a record of `Core.candidate`."""
    return candidates_of(spec, found[None])[0]


def candidates_of(spec: EngineSpec, found: Any) -> tuple[Candidate, ...]:
    """Give candidates; `found` are records of `Core.candidate`, (n,).

    Whole columns are read at once: a record of numpy takes as long for each of its numbers.
    """
    of = {name: found[name].tolist() for name in _NUMBERS}
    kinds = [
        tuple((_KINDS[k], share) for k, share in zip(numbers[:count], shares, strict=False))
        for count, numbers, shares in zip(of["n_kinds"], of["kinds"], of["shares"], strict=True)
    ]
    suspects = _suspects_of(spec, found["suspects"], of["n_suspects"])
    return tuple(
        Candidate(
            suspects=suspects[k],
            probability=of["probability"][k],
            group=bool(of["group"][k]),
            kind=kinds[k][0][0],
            kinds=kinds[k],
            present=bool(of["present"][k]),
            hypothesis=of["hypothesis"][k],
            lane=of["lane"][k],
        )
        for k in range(len(found))
    )


def advice_of(spec: EngineSpec, found: Any, diagnosis: Any) -> tuple[Advice, ...]:
    """Give advice; `found` is a record of `Core.advice`, `diagnosis` that of `Core.diagnosis` which it is for."""
    rivals = _components_of(spec, diagnosis["candidates"][: int(found["n_rivals"])])
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


def _components_of(spec: EngineSpec, found: Any) -> list[tuple[str, ...]]:
    """Give the components of candidates as `Candidate.components` does; all else of them takes ten times as long."""
    suspects, counts = found["suspects"], found["n_suspects"].tolist()
    rows = zip(*(suspects[name].tolist() for name in _NAMING), counts, strict=True)
    return [
        tuple(dict.fromkeys(_named(spec, *of)[1] for of in zip(indices[:n], inputs, outputs, words, strict=False)))
        for indices, inputs, outputs, words, n in rows
    ]


def _suspects_of(spec: EngineSpec, found: Any, counts: Sequence[int]) -> list[tuple[Suspect, ...]]:
    """Give the suspects of candidates; `found` (n, most), of which the first `counts` of each are some."""
    rows = [
        [*zip(*columns, strict=True)] for columns in zip(*(found[name].tolist() for name in _OF_SUSPECT), strict=True)
    ]
    return [
        tuple(_suspect(spec, rows[k][j], found["forecasts"][k, j, : rows[k][j][-1]]) for j in range(count))
        for k, count in enumerate(counts)
    ]


def _suspect(spec: EngineSpec, of: tuple[Any, ...], forecasts: Any) -> Suspect:
    """Give a suspect by its numbers, in the order of `_OF_SUSPECT`."""
    index, k, j, word, nominal, estimate, sd, rate, rate_sd, began, ended, moved, stopped, _ = of
    name, component = _named(spec, index, k, j, word)
    return Suspect(
        parameter=name,
        component=component,
        nominal=_number(nominal),
        estimate=estimate,
        sd=sd,
        rate=_number(rate),
        rate_sd=_number(rate_sd),
        began=_number(began),
        ended=_number(ended),
        moved=moved,
        stopped=_number(stopped),
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


def _named(spec: EngineSpec, index: int, k: int, j: int, word: int) -> tuple[str, str]:
    """Give the name of a suspect and that of its component: of a parameter, else of an input k or of a sensor j."""
    if index >= 0:
        return spec.parameters[index].name, spec.parameters[index].component
    component = spec.inputs[k].name if k >= 0 else spec.outputs[j].name
    return f"{component}.{WORDS[word]}", component


def _number(value: Any) -> float | None:
    """Give a number; None where there is none."""
    return None if isnan(value) else float(value)
