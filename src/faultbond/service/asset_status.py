"""How an asset stands: its status by NAMUR NE 107, whether it is watched at all, and a sentence."""

from collections.abc import Sequence
from dataclasses import dataclass

from faultbond.contract.findings import Diagnosis
from faultbond.contract.samples import Status
from faultbond.contract.silence import Silent
from faultbond.model.graph import BondGraph
from faultbond.report.numbers import clock_text, duration_text, join, probability_text
from faultbond.report.verdict import best_group, set_name
from faultbond.service.asset import Asset
from faultbond.service.contract.messages import Monitoring, Ne107
from faultbond.types import FaultKind

BEGINNING = frozenset({None, Status.WAITING, Status.STARTING, Status.WARMING, Status.LOST})
NAMED = 3  # candidates that a sentence names, and signals of which it says how silent they were
PATIENCE = 10.0  # samples, and s, without a value of any sensor after which there are no data
MISSED = 3.0  # times the usual time between values of sensors that come more rarely than that
LIKELY = 0.5
NO_VALUE = "what came last has no usable value of any sensor"


@dataclass(frozen=True, slots=True, kw_only=True)
class AssetStatus:
    """Status, monitoring and a sentence. absence: its beginning, why nothing is watched now; empty: something is."""

    status: Ne107
    monitoring: Monitoring
    headline: str
    absence: str = ""


def patience(asset: Asset, pace: float = 0.0) -> float:
    """Give the time without a value of any sensor after which an asset has no data, s; they come every `pace` s."""
    return max(PATIENCE * max(asset.spec.sample_time or 1.0, 1.0), MISSED * pace)


def asset_status(
    asset: Asset,
    *,
    silence: float | None,
    pace: float = 0.0,
    trouble: str = "",
    stale: str = "",
    is_empty: bool = False,
    unwatched: str | None = None,
) -> AssetStatus:
    """Tell how an asset stands.

    Parameters
    ----------
    asset : the asset
    silence : s since a sensor of it gave a value; None: none has
    pace : s between such values, usually
    trouble : why its source gives nothing, a sentence; empty: nothing is known of that
    stale : why what its source gave last is of the past, a sentence; empty: it is of now
    is_empty : whether the rows that came last have no value of any sensor
    unwatched : why nothing watches it any more, a sentence, empty where the service was stopped; None: it is watched
    """
    monitoring = _monitoring(asset, None if stale else silence, pace, stopped=unwatched is not None)
    healthy, told = _of_the_plant(asset, monitoring)
    of_before = f" {told}" if healthy is not Ne107.NORMAL else ""  # without data nothing is as the model expects
    if monitoring is Monitoring.STOPPED:
        absence = _because("Not watched", unwatched or "")
    elif monitoring is Monitoring.NO_DATA:
        never = "yet" if asset.time is None else "since the service began"
        absent = f"No data {never if silence is None else f'for {duration_text(silence, digits=2)}'}"
        absence = _because(absent, trouble or stale or (NO_VALUE if is_empty else ""))
    else:
        absence = ""
    if absence:
        return AssetStatus(
            status=Ne107.CHECK_FUNCTION, monitoring=monitoring, headline=f"{absence}{of_before}", absence=absence
        )
    if asset.alarm.out_of_service:
        return AssetStatus(status=Ne107.CHECK_FUNCTION, monitoring=monitoring, headline=f"Out of service. {told}")
    return AssetStatus(status=healthy, monitoring=monitoring, headline=told)


def _because(fact: str, reason: str) -> str:
    """Give a sentence, with its reason where there is one."""
    return f"{fact}: {reason.rstrip('.')}." if reason else f"{fact}."


def _monitoring(asset: Asset, silence: float | None, pace: float, *, stopped: bool) -> Monitoring:
    if stopped:
        return Monitoring.STOPPED
    if silence is None or silence > patience(asset, pace):
        return Monitoring.NO_DATA
    return Monitoring.INITIALISING if asset.status in BEGINNING else Monitoring.RUNNING


def _of_the_plant(asset: Asset, monitoring: Monitoring) -> tuple[Ne107, str]:
    """Give the status and the sentence that the last samples call for."""
    detection = asset.detection
    if detection is not None:
        diagnosis = asset.diagnosis
        at = f"Alarm at {clock_text(detection.time)}"
        if diagnosis is None or not diagnosis.candidates:
            return Ne107.FAILURE, f"{at}; there is no diagnosis yet."
        return _status_of(diagnosis), f"{at}: {diagnosis_line(asset.plant.graph, diagnosis)}"
    if asset.status is Status.OUTSIDE:
        return Ne107.CHECK_FUNCTION, "The model does not hold in this operation; nothing is judged."
    if monitoring is Monitoring.INITIALISING:
        return Ne107.CHECK_FUNCTION, f"Not judged yet: {(asset.status or Status.WAITING).value}."
    silent = asset.run.silent
    if silent and monitoring is Monitoring.RUNNING:
        return Ne107.MAINTENANCE_REQUIRED, f"{_silence(silent)}; all else is as the model expects."
    return Ne107.NORMAL, "As the model expects."


def _silence(silent: Sequence[Silent]) -> str:
    """Name all that are silent, and say of a few how silent each was."""
    if len(silent) <= NAMED:
        return "; ".join(item.fact(clock_text) for item in silent)
    names = join([f"the {item.role} {item.name}" for item in silent])
    return f"{names} gave no value, hardly any, or none for long"


def _status_of(diagnosis: Diagnosis) -> Ne107:
    """Give the status that a diagnosis calls for.

    What no hypothesis explains is out of specification of the model; what drifts still works, and so does a plant of
    which nothing is off by more than is known.
    """
    best = diagnosis.candidates[0]
    if diagnosis.unexplained is not None or diagnosis.mismatch >= LIKELY:
        return Ne107.OFF_SPEC
    if diagnosis.within_accuracy > LIKELY or all(item.kind is FaultKind.DRIFT for item in best_group(diagnosis)):
        return Ne107.MAINTENANCE_REQUIRED
    return Ne107.FAILURE if best.probability > 0.0 else Ne107.OFF_SPEC


def diagnosis_line(graph: BondGraph, diagnosis: Diagnosis) -> str:
    """Say in a line what a diagnosis comes to."""
    group = best_group(diagnosis)
    named = [f"{set_name(graph, item)} ({probability_text(item.probability)} %)" for item in group[:NAMED]]
    more = f" or one of {len(group) - NAMED} more" if len(group) > NAMED else ""
    told = f"{' or '.join(named)}{more}"
    if diagnosis.unexplained is not None:
        return f"no fault of the model explains it; nearest comes {told}."
    if diagnosis.superseded is not None:
        before = diagnosis.superseded.components
        was = "were" if len(before) > 1 else "was"
        return f"{join(before)} {was} sure before, so more may have changed; else {told}."
    if diagnosis.strained:
        return (
            f"{join(diagnosis.strained)} moved far besides, so more may have changed, or the model is off; else {told}."
        )
    if diagnosis.mismatch >= LIKELY:
        return f"most likely the model is off; else {told}."
    if diagnosis.within_accuracy > LIKELY:
        return f"nothing has changed beyond what is known; else {told}."
    return f"{told}."
