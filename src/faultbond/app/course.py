"""A run in progress: points pass through a method, the records come out, and what was found is kept."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from math import nan
from time import monotonic
from typing import TypeAlias

import numpy as np

from faultbond.app.disorder import disorder_of
from faultbond.app.method_face import Watcher
from faultbond.app.presence import Presence
from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import Candidate, Decider, Decision, Detection, Diagnosis
from faultbond.contract.json_records import Record, decision_record, detection_record, diagnosis_record, end_record
from faultbond.contract.samples import STATUSES, Reports, Samples, Status
from faultbond.contract.silence import INPUT, SENSOR, Silent
from faultbond.errors import FaultbondError
from faultbond.io.grid import Counts, Grid, PointBlock
from faultbond.io.out import Out
from faultbond.io.saved import FoundSoFar, Saved
from faultbond.runtime.trace import Trace
from faultbond.types import Method, Verdict

Finding: TypeAlias = Detection | Diagnosis | Decision
PACED = 50  # samples, of fewer nothing is said of how long they take
TOLD = 5  # of what was accepted in runs before, the last ones are told again
_ALARMS_ON = np.array([status in (Status.WATCHING, Status.DIAGNOSING) for status in STATUSES])
_WAITING, _LOST, _OUTSIDE = (STATUSES.index(status) for status in (Status.WAITING, Status.LOST, Status.OUTSIDE))


@dataclass(frozen=True, slots=True, kw_only=True)
class Following:
    """How a run is followed.

    level: probability from which a diagnosis is accepted by rule; None: a person accepts. hear: is given what is found.
    document: path and text of the model file, to be kept with the run.
    """

    out: Out
    trace: Trace | None = None
    level: float | None = None
    hear: Callable[[Finding], None] | None = None
    document: tuple[str, str] | None = None


class Course:
    """Takes the points of a run in order.

    Parameters
    ----------
    watcher : the method
    grid : that the points come from
    following : records, curves and the rule
    before : the run that this one goes on from
    """

    def __init__(self, watcher: Watcher, grid: Grid, following: Following, before: Saved | None = None) -> None:
        self._watcher = watcher
        self._grid = grid
        self._out, self._trace, self._level = following.out, following.trace, following.level
        self._document = following.document
        self._hear = following.hear or (lambda _: None)
        self._began = before
        self.found = before.found if before is not None else FoundSoFar()
        self._inputs = Presence([item.name for item in watcher.spec.inputs], INPUT)
        self._sensors = Presence([item.name for item in watcher.spec.outputs], SENSOR)
        self._told, self._lost = -1, 0
        self._took, self._alarmed = 0.0, 0  # s that samples of an alarm took, and how many these were
        self.sample = before.clock.last_index if before is not None else -1  # grid point that was taken last
        self._time = before.clock.last_time if before is not None else nan
        if self._trace is not None:
            detections = () if self.found.open is None else (self.found.open,)
            self._trace.before(detections, self.found.accepted[-TOLD:], self.found.rejected)

    def take(self, points: PointBlock, *, to_alarm: bool = False) -> int:
        """Pass points on in order, and write what the method says to them; give how many there were.

        to_alarm: none after a point at which there is an alarm that nothing was accepted for yet.
        """
        samples = Samples(time=points.time, dt=points.dt, u=points.u, y=points.y)
        resumes, first = np.flatnonzero(points.resumes), 0
        while first < len(points):
            if points.resumes[first]:
                self._watcher.resume()
            later = resumes[resumes > first]
            began, is_alarm = monotonic(), self.found.open is not None
            reports = self._watcher.take(samples[first : int(later[0]) if len(later) else len(points)])
            done = first + len(reports)
            if is_alarm:
                self._took, self._alarmed = self._took + monotonic() - began, self._alarmed + len(reports)
            self._take(samples[first:done], reports, int(points.index[done - 1]))
            first = done
            if to_alarm and self.found.open is not None:
                break
        return first

    def _take(self, samples: Samples, reports: Reports, last: int) -> None:
        """Take what the method says to some samples, the last of which is the grid point `last`."""
        self._time, self.sample = float(samples.time[-1]), last
        self._count(samples, reports)
        if self._trace is not None:
            self._trace.add(samples, reports)
        if reports.detection is not None:
            self._detected(reports.detection)
        if reports.diagnosis is not None:
            self._diagnosed(reports.diagnosis, last, outside=bool(reports.status[-1] == _OUTSIDE))

    def heed(self, other: FoundSoFar) -> None:
        """Decide as a person did, in its file, of this run as it was when it was written; `other`: found there."""
        if self.found.open is None or other.detections != self.found.detections:
            return  # what was decided of is past
        if other.open not in (None, self.found.open):
            return  # of another run
        gone = suppress(FaultbondError)  # a candidate that is not among the listed ones any more
        if len(other.accepted) > len(self.found.accepted):
            with gone:
                told = other.accepted[-1]
                self._accept(told.candidate.hypothesis, self._time, Decider.PERSON, repaired=told.repaired)
            return
        known = {item.candidate.hypothesis for item in self.found.rejected}
        for item in other.rejected:
            if item.candidate.hypothesis not in known:
                with gone:
                    self._reject(item.candidate.hypothesis)

    def finish(self) -> None:
        """Write the last diagnosis and the end."""
        last = self._watcher.finish() if self._told != self._grid.counts.samples - 1 else None
        if last is not None:
            self._out.record(diagnosis_record(last))
            self._hear(last)
            if self._trace is not None:
                self._trace.conclude(last)
        self._out.record(self.end)

    @property
    def end(self) -> Record:
        """The record of the end, as if it were now."""
        counts = self._grid.counts
        return end_record(
            time=self._time if counts.samples else None,
            watched=self.found.watched,
            detections=self.found.detections,
            wild=self.found.wild,
            outside=self.found.outside,
            sensors_outside=self.found.sensors_outside,
            dropped=self._grid.n_dropped,
            silent=self.silent,
            **asdict(counts),
        )

    @property
    def diagnosis(self) -> Diagnosis | None:
        """What the candidates are now, after a detection for which nothing was accepted yet."""
        return self._watcher.finish() if self.found.open is not None else None

    def accept(self, hypothesis: int, *, repaired: bool = False) -> Decision:
        """Take a hypothesis as the new healthy model, or as repaired, as a person did."""
        self._accept(hypothesis, self._time, Decider.PERSON, repaired=repaired)
        return self.found.accepted[-1]

    def reject(self, hypothesis: int) -> Decision:
        """Rule a hypothesis out, as a person did."""
        self._reject(hypothesis)
        return self.found.rejected[-1]

    def saved(self, method: Method) -> Saved | None:
        """Give the run so that it can go on; None before its first point."""
        clock, spec = self._grid.clock, self._watcher.spec
        if clock is None:
            return None
        return Saved(
            model=spec.model,
            model_sha256=spec.model_sha256,
            version=spec.version,
            method=method,
            numbers=self._watcher.save(),
            clock=clock,
            found=self.found,
            document=self._document,
        )

    @property
    def counts(self) -> Counts:
        """What has been passed since this run began."""
        now = self._grid.counts
        if self._began is None:
            return now
        before = self._began.clock.counts
        return Counts(**{name: getattr(now, name) - getattr(before, name) for name in Counts.__slots__})

    @property
    def pace(self) -> float | None:
        """How long a sample takes while there is an alarm, s of this machine; None of too few to say."""
        return self._took / self._alarmed if self._alarmed >= PACED else None

    @property
    def wild(self) -> int:
        """How many values were refused since this run began."""
        return self.found.wild - (self._began.found.wild if self._began is not None else 0)

    @property
    def outside(self) -> int:
        """At how many points the model did not hold since this run began."""
        return self.found.outside - (self._began.found.outside if self._began is not None else 0)

    @property
    def sensors_outside(self) -> int:
        """How many readings were not judged since this run began, since their sensors did not hold."""
        return self.found.sensors_outside - (self._began.found.sensors_outside if self._began is not None else 0)

    @property
    def silent(self) -> tuple[Silent, ...]:
        """Sensors, then inputs, that gave no value in this run, hardly any, or none for long."""
        most = int(self._sensors.values.max(initial=0))
        return (*self._sensors.silent(most), *self._inputs.silent(most))

    @property
    def disorder(self) -> str:
        """Say that too many rows of this run came too late to be used; empty where they did not."""
        return disorder_of(self._grid)

    @property
    def verdict(self) -> Verdict:
        """Whether there was a detection in this run, or stood open at its beginning; else whether it could judge."""
        before = self._began.found if self._began is not None else FoundSoFar()
        if before.open is not None or (self.found.detections > before.detections and not self.disorder):
            return Verdict.FAULT
        return Verdict.NONE if self.no_verdict() else Verdict.HEALTHY

    def no_verdict(self) -> str:
        """Say why this run says nothing about the plant; empty where it does."""
        spec, began = self._watcher.spec, self._began
        if self.disorder:
            return self.disorder
        if self.found.watched > (began.found.watched if began is not None else 0):
            return ""
        samples = self._grid.counts.samples
        if self.found.waiting == samples:
            absent = next(item.name for item, n in zip(spec.inputs, self._inputs.values, strict=True) if not n)
            return f"no row has a value of the input {absent}"
        holds = samples - self.found.waiting - self.found.outside
        if self.found.outside and holds <= self._watcher.asleep:
            of = f"{holds} of {samples} sample{'s' * (samples != 1)}"
            off = self._watcher.asleep
            return f"the model holds, by `valid_when`, in {of}, and the alarms are off for the first {off}"
        if holds <= self._watcher.asleep:
            off = self._watcher.asleep
            many = f"{samples} sample{'s' * (samples != 1)}"
            return f"the recording ended after {many}, and the alarms are off for the first {off}"
        if self._lost:
            return "the filter lost the plant again and again; check units, noise and accuracies in the model file"
        silent = [item.name for item, n in zip(spec.outputs, self._sensors.values, strict=True) if not n]
        if silent and not self._sensors.values.any():
            which = f"the sensor {silent[0]}" if len(silent) == 1 else f"any sensor, such as {silent[0]}"
            return f"no row has a value of {which}; check the column"
        if silent:
            return f"no row has a value of the sensor {silent[0]}, and the start still waited for one"
        return "no row has a value of a sensor that is in use once the alarms are on"

    def _count(self, samples: Samples, reports: Reports) -> None:
        read, status = np.isfinite(samples.y), reports.status
        self._note_presence(np.isfinite(samples.u), read, samples.time)
        self._lost += int(np.sum(status == _LOST))
        judged, outside = read & self._watcher.in_use & ~reports.left_out, status == _OUTSIDE
        self.found = self.found.with_counts(
            watched=int(np.sum(_ALARMS_ON[status] & judged.any(axis=1))),
            waiting=int(np.sum(status == _WAITING)),
            wild=int(np.sum(reports.wild)),
            outside=int(np.sum(outside)),
            sensors_outside=int(np.sum(reports.left_out[~outside] & read[~outside])),
        )

    def _note_presence(self, moved: BoolArray, read: BoolArray, time: FloatArray) -> None:
        """Note which inputs and sensors have values in samples that have any."""
        if not (read.all() or moved.all()):  # else each sample has one
            chosen = moved.any(axis=1) | read.any(axis=1)
            moved, read, time = moved[chosen], read[chosen], time[chosen]
        self._inputs.add(moved, time)
        self._sensors.add(read, time)

    def _detected(self, detection: Detection) -> None:
        self.found = self.found.with_detection(detection)
        self._out.record(detection_record(detection))
        self._hear(detection)

    def _diagnosed(self, diagnosis: Diagnosis, sample: int, *, outside: bool) -> None:
        """Write a diagnosis, and accept its best candidate if it has been sure for long enough.

        outside: the model does not hold now, so that nothing new is known.
        """
        if self._out.has_records:  # a long text, for which a program that asks for results has no use
            self._out.record(diagnosis_record(diagnosis, outside=outside))
        self._hear(diagnosis)
        self._told = sample
        if diagnosis.over:
            nothing = Candidate(suspects=(), probability=diagnosis.within_accuracy, group=True)
            self._tell_accepted(Decision(time=diagnosis.time, candidate=nothing, by=Decider.RULE))
            return
        if self._level is None or outside:
            return
        hypothesis = self._watcher.sure(self._level)
        if hypothesis is not None:
            self._accept(hypothesis, diagnosis.time, Decider.RULE)

    def _accept(self, hypothesis: int, time: float, by: Decider, *, repaired: bool = False) -> None:
        candidate = self._watcher.accept(hypothesis, repaired=repaired)
        self._tell_accepted(Decision(time=time, candidate=candidate, by=by, repaired=repaired))

    def _tell_accepted(self, accepted: Decision) -> None:
        self.found = self.found.with_accepted(accepted)
        self._out.record(decision_record(accepted))
        self._hear(accepted)
        if self._trace is not None:
            self._trace.accept(accepted)

    def _reject(self, hypothesis: int) -> None:
        rejected = Decision(time=self._time, candidate=self._watcher.reject(hypothesis), by=Decider.PERSON)
        self.found = self.found.with_rejected(rejected)
        self._out.record(decision_record(rejected, rejected=True))
        if self._trace is not None:
            self._trace.reject(rejected)
