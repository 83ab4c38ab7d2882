"""Collects what a run sees, sample by sample, into a `History`."""

from array import array
from collections import deque
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Decision, Detection, Diagnosis, History, Unexplained
from faultbond.contract.samples import STATUSES, Reports, Samples, Status
from faultbond.contract.spec import EngineSpec

LASTING = 5  # diagnoses that did not explain the data, from which on that is more than a moment
MAX_DIAGNOSES = 500  # kept; of a longer run every second one, then every fourth, and so on
MOST_SHOWN = 120  # the same of a run without end, since its last alarm
MAX_EVENTS = 100  # alarms, and decisions of each kind, kept of a run without end
LEAST = 5e-3  # probability of candidates that are kept of its earlier diagnoses; below, a curve shows nothing


class Misfits:
    """What candidates did not explain for a while, though they had explained the data before.

    A while is `LASTING` diagnoses and more of which each says so of what is read then.
    """

    def __init__(self) -> None:
        self._fitted = set[tuple[str, ...]]()
        self._found: dict[tuple[str, ...], tuple[int, Unexplained]] = {}

    def take(self, diagnosis: Diagnosis) -> None:
        """Take what is said now."""
        if not diagnosis.candidates:
            return
        best, now = diagnosis.candidates[0].parameters, diagnosis.unexplained
        if now is None:
            self._fitted.add(best)
        elif best in self._fitted and now.until == diagnosis.time:
            count, before = self._found.get(best, (0, now))
            worst = max(before, now, key=lambda item: item.sd)
            self._found[best] = count + 1, replace(worst, since=before.since, until=now.until)

    def of(self, diagnosis: Diagnosis) -> Unexplained | None:
        """Give the while in which the best candidate did not fit, and by how much at most; None: it always did."""
        best = diagnosis.candidates[0].parameters if diagnosis.candidates else ()
        count, found = self._found.get(best, (0, None))
        return found if count >= LASTING else None


class Trace:
    """Takes samples and reports in order; about a hundred bytes are kept of each sample.

    Parameters
    ----------
    spec : the model
    curves : False keeps only the first and the last sample and the last diagnosis, in memory of fixed size
    lag : samples by which what a report expects is of an earlier sample
    newest : of a run without end, how many samples are kept at least, and twice as many at most, with diagnoses since
        the last alarm; None: all are
    """

    def __init__(self, spec: EngineSpec, *, curves: bool = True, lag: int = 0, newest: int | None = None) -> None:
        self._spec = spec
        self._lag, self._newest = lag, newest
        self._curves = curves
        self._slow = np.array([error.alarms for error in spec.slow_errors], dtype=bool)
        n_y, n_u = len(spec.outputs), len(spec.inputs)
        self._ends = np.cumsum([1, n_y, n_y, n_y, n_u, n_y])
        self._width = int(self._ends[-1]) + int(self._slow.sum())
        self._numbers = array("d")  # one row per sample, grown in place
        most = None if newest is None else MAX_EVENTS
        self._detections = deque[Detection](maxlen=most)
        self._accepted, self._rejected = deque[Decision](maxlen=most), deque[Decision](maxlen=most)
        self._open: Detection | None = None
        self.status: Status | None = None  # at the newest sample
        self._forget_diagnoses()

    def _forget_diagnoses(self) -> None:
        self._diagnoses: list[Diagnosis] = []  # before the last one
        self._last: Diagnosis | None = None
        self._passed, self._stride = 0, 1  # how many there were; one of how many is kept
        self._misfits = Misfits()  # since the last alarm

    def add(self, samples: Samples, reports: Reports) -> None:
        """Take samples, one at least, and what a method said of them."""
        columns = (
            samples.time[:, None],
            samples.y,
            reports.expected,
            reports.variance,
            samples.u,
            reports.cusum,
            reports.slow[:, self._slow],
        )
        rows = np.concatenate(columns, axis=1, dtype=np.float64)
        if not self._curves and len(self._numbers):
            del self._numbers[self._width :]
            rows = rows[-1:]
        elif not self._curves and len(rows) > 1:
            rows = rows[[0, -1]]
        self._numbers.frombytes(rows.tobytes())
        self.status = STATUSES[reports.status[-1]]
        if self._newest is not None and len(self._numbers) > 2 * self._newest * self._width:
            del self._numbers[: -self._newest * self._width]
        if reports.detection is not None:
            self._detections.append(reports.detection)
            self._open = reports.detection
            if self._newest is None:
                self._misfits = Misfits()
            else:
                self._forget_diagnoses()
        if reports.diagnosis is not None:
            self.conclude(reports.diagnosis)

    def conclude(self, diagnosis: Diagnosis) -> None:
        """Take a diagnosis; that given last is always kept."""
        self._keep_last()
        self._last = diagnosis
        self._misfits.take(diagnosis)
        self._passed += 1

    def _keep_last(self) -> None:
        """Keep the diagnosis that another one follows, if it is one of those that are kept."""
        if self._last is None or not self._curves or (self._passed - 1) % self._stride:
            return
        self._diagnoses.append(self._last if self._newest is None else _leading(self._last))
        if len(self._diagnoses) > (MAX_DIAGNOSES if self._newest is None else MOST_SHOWN):
            del self._diagnoses[1::2]
            self._stride *= 2

    def before(
        self, detections: Sequence[Detection], accepted: Sequence[Decision], rejected: Sequence[Decision]
    ) -> None:
        """Take what is known from a run that this one goes on from."""
        self._detections += detections
        self._open = detections[-1] if detections else None
        self._accepted += accepted
        self._rejected += rejected

    def accept(self, accepted: Decision) -> None:
        """Take what became the healthy model."""
        self._accepted.append(accepted)
        self._open = None

    def reject(self, rejected: Decision) -> None:
        """Take what a person ruled out."""
        self._rejected.append(rejected)

    def history(self, newest: int | None = None) -> History:
        """Give all that was kept, or of the samples the newest `newest`."""
        first = 0 if newest is None else max(len(self._numbers) - newest * self._width, 0)
        rows = np.array(self._numbers[first:]).reshape(-1, self._width)
        time, measured, expected, variance, inputs, cusum, slow = np.split(rows, self._ends, axis=1)
        expected, variance = (_earlier(values, self._lag) for values in (expected, variance))
        settings = self._spec.thresholds
        return History(
            time=_frozen(time[:, 0]),
            measured=_frozen(measured),
            expected=_frozen(expected),
            expected_sd=_frozen(np.sqrt(np.maximum(variance, 0.0))),
            inputs=_frozen(inputs),
            cusum=_frozen(cusum),
            slow=_frozen(slow),
            cusum_limit=settings.cusum_limit,
            slow_limits=self._spec.slow_limits[self._slow],
            slow_names=tuple(error.words for error in self._spec.slow_errors if error.alarms),
            detections=tuple(self._detections),
            diagnoses=(*self._diagnoses, *(() if self._last is None else (self._last,))),
            accepted=tuple(self._accepted),
            rejected=tuple(self._rejected),
            open=self._open,
            missed=None if self._last is None else self._misfits.of(self._last),
        )


def _leading(diagnosis: Diagnosis) -> Diagnosis:
    """Give a diagnosis without candidates that no curve shows, and without advice, which is of now."""
    shown = tuple(item for item in diagnosis.candidates if item.probability >= LEAST)
    return replace(diagnosis, candidates=shown, advice=())


def _earlier(values: FloatArray, lag: int) -> FloatArray:
    """Move rows to those `lag` before; the last ones are nan."""
    moved = np.full_like(values, np.nan)
    moved[: max(len(values) - lag, 0)] = values[lag:]
    return moved


def _frozen(values: FloatArray) -> FloatArray:
    copy = np.ascontiguousarray(values)
    copy.setflags(write=False)
    return copy
