"""What came of an analysis, from the exit code of the command line and from what it wrote."""

import html
import json
import re
import signal
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import nan
from pathlib import Path
from typing import Any

from faultbond.errors import one_line
from faultbond.report.byte_size import size_text
from faultbond.report.numbers import change_text, duration_text, probability_text
from faultbond.service.contract.offline import JobResult
from faultbond.service.offline.child import ERRORS, WORDS
from faultbond.service.offline.job import JobState
from faultbond.service.offline.limits import OfflineLimits

FILES = {JobResult.REPORT: "report.html", JobResult.RECORDS: "records.jsonl", JobResult.ANALYSIS: "analysis.txt"}
VERDICTS = {0: "healthy", 1: "fault", 4: "none"}  # by the exit code of `run`
NAMED = 12  # candidates that are shown
HEAD, TAIL, FEW = 2**20, 2**23, 2**14  # bytes that are read of a report, of records, and of what was said
LONGEST = 1000  # characters of a sentence
_HEADLINE = re.compile(r"<h1>(.*?)</h1>", re.DOTALL)
_NO_MEMORY = re.compile(
    r"MemoryError|annot allocate memory|out of memory|bad_alloc|memory exhausted|[Uu]nable to allocate"
    r"|error return without exception set|NULL without setting an exception|Failed to launch worker thread"
    r"|can't start new thread|emory allocation|failed to map segment|rtual memory"
)
_NO_ROOM = "File too large"


@dataclass(frozen=True, slots=True, kw_only=True)
class JobOutcome:
    """What came of it; see `job.Job`.

    candidates: `names`, `components`, `kind`, `probability`, `percent`, `group`, `change`. remarks: what else was said.
    """

    state: JobState
    said: str
    verdict: str = ""
    candidates: tuple[Mapping[str, Any], ...] = ()
    remarks: tuple[str, ...] = ()


def outcome_of(code: int | None, out: Path, limits: OfflineLimits) -> JobOutcome:
    """Give what came of `run`.

    Parameters
    ----------
    code : its exit code; None where its time was over
    out : folder of what it wrote
    limits : it was under
    """
    errors = [one_line(line).removeprefix("faultbond: ")[:LONGEST] for line in _told(out / ERRORS).splitlines()]
    stopped = _limit(code, "\n".join(errors), limits)
    if stopped:
        return JobOutcome(state=JobState.STOPPED, said=stopped)
    if code not in VERDICTS:
        return JobOutcome(state=JobState.FAILED, said=errors[-1] if errors else f"It ended with exit code {code}.")
    return JobOutcome(
        state=JobState.DONE,
        said=_headline(out / FILES[JobResult.REPORT]) or (errors[-1] if errors else ""),
        verdict=VERDICTS[code],
        candidates=tuple(_candidates(out / FILES[JobResult.RECORDS])),
        remarks=tuple(errors),
    )


def remark_on_analysis(code: int | None, out: Path, limits: OfflineLimits) -> str:
    """Give why `analyse` gave nothing, and keep what it said as a result; empty where it did give something."""
    if code in (0, 4):
        (out / WORDS).replace(out / FILES[JobResult.ANALYSIS])
        return ""
    errors = _told(out / ERRORS)
    lines = [one_line(line) for line in errors.splitlines()] or [f"it ended with exit code {code}"]
    return f"analyse: {_limit(code, errors, limits) or lines[-1]}"[:LONGEST]


def results_in(out: Path) -> tuple[JobResult, ...]:
    """Give what there is to be had."""
    return tuple(what for what, name in FILES.items() if (out / name).is_file() and (out / name).stat().st_size)


def _limit(code: int | None, errors: str, limits: OfflineLimits) -> str:
    """Give which limit ended it, in a sentence; empty: none did."""
    if code is None:
        return f"It took longer than {duration_text(limits.seconds)}, and was stopped."
    if code == -signal.SIGXCPU or "CPU time limit exceeded" in errors:  # of the run, or of its compiler
        return f"It took more than {duration_text(limits.processor)} of a processor, and was stopped."
    if code == -signal.SIGXFSZ or _NO_ROOM in errors:  # of which a verdict may stand, but not what there is of it
        return f"A file that it wrote grew beyond {size_text(limits.results)}, and it was stopped."
    if code in (0, 1, 4):
        return ""
    if _NO_MEMORY.search(errors):
        return f"It took more memory than the {size_text(limits.memory)} of a process, and was stopped."
    if code == -signal.SIGKILL:
        return "The system ended it, as where the machine is short of memory."
    return ""


def _headline(report: Path) -> str:
    """Give the verdict of a report."""
    try:
        with report.open("rb") as stream:
            found = _HEADLINE.search(stream.read(HEAD).decode(errors="replace"))
    except OSError:
        return ""
    return one_line(html.unescape(re.sub(r"<[^>]*>", "", found[1])))[:LONGEST] if found else ""


def _candidates(records: Path) -> Iterator[Mapping[str, Any]]:
    """Give the candidates of the last diagnosis, the likeliest first."""
    last: Mapping[str, Any] = {}
    for line in _told(records, TAIL).splitlines():
        if line.startswith('{"record": "diagnosis"') and line.endswith("}"):
            last = json.loads(line)
    for item in list(last.get("candidates", ()))[:NAMED]:
        values = item.get("parameters", {})
        changes = (
            change_text(*(nan if part.get(key) is None else part[key] for key in ("nominal", "estimate", "sd")))
            for part in values.values()
        )
        yield {
            "names": list(values),
            "components": list(item.get("components", ())),
            "kind": item.get("kind") or "",
            "probability": item["probability"],
            "percent": "" if last.get("unexplained") else probability_text(item["probability"]),
            "group": bool(item.get("group")),
            "change": ", ".join(filter(None, changes)),
        }


def _told(file: Path, most: int = FEW) -> str:
    """Give the end of a text."""
    try:
        with file.open("rb") as stream:
            size = stream.seek(0, 2)
            stream.seek(max(size - most, 0))
            return stream.read().decode(errors="replace")
    except OSError:
        return ""
