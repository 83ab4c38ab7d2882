"""What the records of a run are worth against the truth."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

from benchmarks.trust.play import Claim
from benchmarks.trust.strangers.faults import Fault
from benchmarks.trust.strangers.rig import Form

SURE = 0.95
FAR_SD, FAR_PART = 4.0, 0.25  # a value is wrong that is off by more than both
LATE = 200  # samples after the alarm from which claims have to hold

Record = Mapping[str, Any]  # a line of `faultbond run --json`


class Verdict(Enum):
    """What became of a run, at its end."""

    QUIET = "quiet"  # healthy, and no alarm
    EARLY = "false alarm"  # healthy, or before the fault
    FIRST = "first"
    GROUP = "in the group"
    UNEXPLAINED = "unexplained"  # another one first, and said not to explain the data
    OTHER = "another"
    MISSED = "missed"


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """One run. `kind` is empty where it is healthy; delay : s from the fault to the alarm, None where there is none.

    named : what came first at the end, with its probability; wrong_name, wrong_value : more than 95 % sure, not called
    unexplained, and another set, or a value far off
    """

    plant: str
    seed: int
    kind: str
    truth: tuple[str, ...]
    verdict: Verdict
    delay: float | None = None
    named: tuple[str, ...] = ()
    probability: float = 0.0
    wrong_name: bool = False
    wrong_value: bool = False
    claims: tuple[Claim, ...] = ()


def judged(plant: str, seed: int, fault: Fault | None, records: Sequence[Record], step: float) -> Outcome:
    """Judge a run; `fault` is None where it is healthy, `step` the time of a sample in s."""
    alarm = next((item["time"] for item in records if item["record"] == "detection"), None)
    diagnoses = [item for item in records if item["record"] == "diagnosis"]
    if fault is None:
        verdict = Verdict.QUIET if alarm is None else Verdict.EARLY
        return Outcome(plant=plant, seed=seed, kind="", truth=(), verdict=verdict)
    kind, truth = fault.kind.value, tuple(sorted(fault.truth))
    if alarm is None:
        return Outcome(plant=plant, seed=seed, kind=kind, truth=truth, verdict=Verdict.MISSED)
    if alarm < fault.onset:
        return Outcome(plant=plant, seed=seed, kind=kind, truth=truth, verdict=Verdict.EARLY)
    last = diagnoses[-1]
    best = last["candidates"][0]
    right, sure = names_of(best) == set(truth), best["probability"] > SURE and last["unexplained"] is None
    explained = [item for item in diagnoses if item["unexplained"] is None and item["time"] >= alarm + LATE * step]
    return Outcome(
        plant=plant,
        seed=seed,
        kind=kind,
        truth=truth,
        verdict=_verdict(last, set(truth)),
        delay=alarm - fault.onset,
        named=tuple(best["parameters"]),
        probability=best["probability"],
        wrong_name=sure and not right,
        wrong_value=sure and right and any(far_off(name, item, fault) for name, item in best["parameters"].items()),
        claims=tuple(_claim(item, set(truth), alarm) for item in explained),
    )


def names_of(candidate: Record) -> set[str]:
    """Give what a candidate names, an instrument whatever its kind of fault."""
    return {name.partition(".")[0] for name in candidate["parameters"]}


def far_off(suspect: str, found: Record, fault: Fault) -> bool:
    """Tell whether the value of a true suspect is wrong; a gain, noise or stuck value of an instrument is not asked."""
    name, _, word = suspect.partition(".")
    form, size = fault.truth[name]
    if size is None or word not in {"", "bias"} or found["sd"] is None:
        return False
    true = found["nominal"] * (1.0 + size) if form is Form.FACTOR else found["nominal"] + size
    error = abs(found["estimate"] - true)
    return bool(error > FAR_SD * found["sd"] and error > FAR_PART * abs(true))


def _verdict(diagnosis: Record, truth: set[str]) -> Verdict:
    candidates = diagnosis["candidates"]
    if names_of(candidates[0]) == truth:
        return Verdict.FIRST
    if any(item["group"] and names_of(item) == truth for item in candidates):
        return Verdict.GROUP
    return Verdict.OTHER if diagnosis["unexplained"] is None else Verdict.UNEXPLAINED


def _claim(diagnosis: Record, truth: set[str], alarm: float) -> Claim:
    candidates = diagnosis["candidates"]
    sets = [names_of(item) for item in candidates]
    place = sets.index(truth) if truth in sets else len(sets)
    return Claim(
        after=diagnosis["time"] - alarm,
        best=candidates[0]["probability"],
        right=place == 0,
        rank=place + 1,
        group=place < len(sets) and candidates[place]["group"],
        size=sum(item["group"] for item in candidates),
        error=float("inf"),
        kind="",
    )
