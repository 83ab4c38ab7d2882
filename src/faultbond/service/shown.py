"""What the page shows of an asset, in names and units of its model file; see `face` for the keys."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Decider, Diagnosis, History
from faultbond.contract.json_records import candidate_content
from faultbond.contract.samples import Status
from faultbond.io.out import finite
from faultbond.model.graph import BondGraph, Unit
from faultbond.report.numbers import NO_BREAK, Notation, join, probability_text, unit_text
from faultbond.report.suspects import SuspectRow
from faultbond.report.verdict import best_group, fault_probabilities, set_name, view_of
from faultbond.runtime.names import candidate_names
from faultbond.service.asset import Asset
from faultbond.service.asset_status import BEGINNING, AssetStatus
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import Action, Curves, Deed, NamedRecord
from faultbond.service.sinks.measures import AssetMeasures

EVENTS = ("detection", "accepted")  # kinds of records that stand in the journal beside what people did
RANKED = 6  # candidates whose probability is drawn over time
_DECIDE = (Action.ACCEPT, Action.REJECT, Action.REPAIRED)


def summary_of(asset: Asset, standing: AssetStatus, *, since: float, now: float) -> Shown:
    """Give the summary of an asset. since: of its status, Unix s; now: the same of this moment."""
    alarm, detection, diagnosis = asset.alarm, asset.detection, asset.diagnosis
    best = diagnosis.candidates[0] if diagnosis is not None and diagnosis.candidates else None
    shown = None
    if alarm.active or alarm.unseen or alarm.is_shelved(now) or alarm.suppressed or alarm.out_of_service:
        shown = {
            "state": alarm.state(now).value,
            "since": alarm.since,
            "time": detection.time if detection else None,
            "acknowledged_by": alarm.acknowledged_by,
            "shelved_until": alarm.shelved_until if alarm.is_shelved(now) else None,
            "signals": list(detection.signals) if detection else [],
            "change_time": detection.change_time if detection else None,
        }
    return {
        "name": asset.name,
        "model": asset.spec.model,
        "status": standing.status.name,
        "status_code": int(standing.status),
        "monitoring": standing.monitoring.value,
        "headline": standing.headline,
        "since": since,
        "time": asset.time,
        "samples": asset.counts.samples,
        "operation": _operation(asset.status),
        "alarm": shown,
        "best": None if best is None else _best(asset.plant.graph, best),
    }


def _best(graph: BondGraph, best: Candidate) -> Shown:
    told = finite(candidate_content(best))
    return {"names": set_name(graph, best), **{key: told[key] for key in ("probability", "components", "parameters")}}


def _operation(status: Status | None) -> str:
    if status is Status.OUTSIDE:
        return "outside"
    return "waiting" if status in BEGINNING else "alarms on"


def asset_of(
    asset: Asset,
    summary: Shown,
    drawing: str,
    journal: Sequence[NamedRecord | Deed],
    counts: Mapping[str, int],
    *,
    absence: str,
    now: float,
) -> Shown:
    """Give all that is shown of an asset.

    journal: records of `EVENTS` and deeds; counts: of its source; absence: why it is not watched now, or empty.
    """
    graph, spec, history = asset.plant.graph, asset.spec, asset.history()
    view = view_of(graph, history, asset.run.counts(), Notation.PRINT)
    diagnosis = view.diagnosis
    told = diagnosis if diagnosis is not None and not view.contradicted else None
    blamed = _blamed(told) if told is not None else {}
    in_use = {item.name: bool(used) for item, used in zip(spec.outputs, asset.run.watcher.in_use, strict=True)}
    decide = _DECIDE if diagnosis is not None and diagnosis.candidates else ()
    take_back = (Action.UNDO,) if asset.undos else ()
    return {
        "summary": summary,
        "drawing": drawing,
        "suspicion": blamed,
        "signals": [_signal(item.name, "sensor", item.unit, in_use[item.name]) for item in graph.sensors]
        + [_signal(item.name, "input", item.unit, in_use=True) for item in graph.inputs],
        "cusum_limit": spec.thresholds.cusum_limit,
        "verdict": f"{absence} {view.verdict}".lstrip() if diagnosis or asset.alarm.active else summary["headline"],
        "rows": _rows(graph, view.rows, diagnosis.candidates if diagnosis else ()),
        "remainder": view.remainder,
        "left_out": view.left_out,
        "several": view.several,
        "contradicted": bool(view.contradicted),
        "checks": [{"what": row.action, "why": f"tells {row.parts}"} for row in view.checks],
        "notes": list(view.notes),
        "events": events_of(journal),
        "ranking": _ranking(graph, history),
        "counts": {
            **{key: n for key, n in (asdict(asset.counts) | {"wild": asset.wild}).items() if n},
            **{k: n for k, n in counts.items() if n},
        },
        "journal": journal_of(item for item in journal if isinstance(item, Deed)),
        "may": [action.value for action in (*asset.alarm.allows(now), *decide, *take_back)],
    }


def measures_of(asset: Asset, summary: Shown, counts: Mapping[str, int], *, arrived: float | None) -> AssetMeasures:
    """Give what is measured of an asset. counts: of its source; arrived: when a sensor gave a value last."""
    last, diagnosis = asset.history(1), asset.diagnosis
    shares = last.cusum[-1] / last.cusum_limit if len(last.cusum) else ()
    return AssetMeasures(
        summary=summary,
        is_active=asset.alarm.active,
        is_unseen=asset.alarm.unseen,
        detector={
            item.name: float(share)
            for item, share in zip(asset.spec.outputs, shares, strict=False)
            if np.isfinite(share)
        },
        suspicion=_blamed(diagnosis) if diagnosis is not None else {},
        arrived=arrived,
        counts={**asdict(asset.counts), **counts},
    )


def _blamed(diagnosis: Diagnosis) -> dict[str, float]:
    """Give the probability that each component, sensor and input is at fault."""
    return {
        name: probability
        for instruments in (True, False)
        for name, probability in fault_probabilities(diagnosis, instruments=instruments).items()
    }


def journal_of(deeds: Iterable[Deed]) -> list[Shown]:
    """Give what people did, newest first."""
    listed = list(deeds)
    undone = {deed.undone: deed.number for deed in listed if deed.undone is not None}
    return [
        {
            "number": deed.number,
            "at": deed.at,
            "who": deed.who,
            "action": deed.action.value,
            "comment": deed.comment,
            "target": list(deed.target),
            "until": deed.until,
            "undone_by": undone.get(deed.number),
        }
        for deed in reversed(listed)
    ]


def events_of(journal: Iterable[NamedRecord | Deed]) -> list[Shown]:
    """Give what happened by itself, newest first: alarms, and what a rule accepted; what people accept is a deed."""
    events, behind = list[Shown](), 0
    for item in journal:
        if isinstance(item, Deed):
            behind = item.number
        elif item.kind == "detection" or item.content["by"] == Decider.RULE.value:
            alarm = item.kind == "detection"
            text = _event_text(item.content)
            events.append(finite({"time": item.time, "text": text, "alarm": alarm, "behind": behind}))
    return events[::-1]


def _event_text(content: Mapping[str, Any]) -> str:
    """Say in a sentence that an alarm was raised, by what, or that it ended, and why."""
    if content["record"] == "accepted" and not content["components"]:
        return "Alarm ended by itself: for long nothing was further off than healthy parts may be."
    if content["record"] == "accepted":
        percent = probability_text(content["probability"])
        return f"Alarm ended: a rule accepted {join(content['components'])} ({percent}{NO_BREAK}%)."
    if content.get("walk"):
        return f"Alarm raised, as {content['walk']['parameter']} had to move too far."
    seen = f", seen in {join(content['signals'])}" if content["signals"] else ""
    return f"Alarm raised{seen}."


def curves_of(graph: BondGraph, curves: Curves | None) -> Shown:
    """Give curves by signal, in its unit; None: empty ones."""
    if curves is None:
        none: Shown = {item.name: [] for item in graph.sensors}
        return {"time": [], "inputs": {}, **dict.fromkeys(("measured", "expected", "sd", "cusum"), none)}
    sensors = {item.name: (k, item.unit) for k, item in enumerate(graph.sensors)}
    return {
        "time": curves.time.tolist(),
        "inputs": {item.name: _listed(item.unit, curves.inputs[:, k]) for k, item in enumerate(graph.inputs)},
        "measured": {name: _listed(unit, curves.measured[:, k]) for name, (k, unit) in sensors.items()},
        "expected": {name: _listed(unit, curves.expected[:, k]) for name, (k, unit) in sensors.items()},
        "sd": {name: _finite(curves.sd[:, k] / unit.factor) for name, (k, unit) in sensors.items()},
        "cusum": {name: _finite(curves.cusum[:, k]) for name, (k, _) in sensors.items()},
    }


def _listed(unit: Unit, values: FloatArray) -> list[float | None]:
    return _finite((values - unit.offset) / unit.factor)


def _finite(values: FloatArray) -> list[float | None]:
    """Give numbers to six digits, as a page draws them, None where there is none."""
    return [float(f"{value:.6g}") if np.isfinite(value) else None for value in values.tolist()]


def _signal(name: str, role: str, unit: Unit, in_use: bool) -> Shown:
    return {"name": name, "role": role, "unit": unit_text(unit.text, Notation.PRINT), "in_use": in_use}


def _rows(graph: BondGraph, rows: Iterable[Any], candidates: Iterable[Candidate]) -> list[Shown]:
    """Give the rows of the table, each with the names by which a person decides about it."""
    return [
        {
            "suspects": [_suspect(suspect) for suspect in row.suspects],
            "kinds": list(row.kinds),
            "probability": row.probability,
            "percent": row.percent,
            "group": row.group,
            "names": set_name(graph, candidate),
            "target": sorted(candidate_names(candidate)),
        }
        for row, candidate in zip(rows, candidates, strict=False)
    ]


def _suspect(row: SuspectRow) -> Shown:
    """Give a suspect with its unit behind each value; a line without a component belongs to the one above."""
    unit = f" {row.unit}" if row.unit else ""
    return {
        "name": row.parameter,
        "component": row.component.removeprefix("+ "),
        "nominal": row.nominal and f"{row.nominal}{unit}",
        "estimate": f"{row.estimate}{unit}",
        "change": row.change,
    }


def _ranking(graph: BondGraph, history: History) -> Shown:
    """Give the probability over time of those that lead now, since the alarm."""
    began = history.open
    told = [item for item in history.diagnoses if began is not None and item.candidates and item.time >= began.time]
    leading = told[-1].candidates[:RANKED] if told else ()
    by_time = [{item.hypothesis: item.probability for item in diagnosis.candidates} for diagnosis in told]
    return {
        "time": [diagnosis.time for diagnosis in told],
        "names": [set_name(graph, item) for item in leading],
        "probability": [[row.get(item.hypothesis, 0.0) for row in by_time] for item in leading],
        "group": len(best_group(told[-1])) if told else 0,
    }
