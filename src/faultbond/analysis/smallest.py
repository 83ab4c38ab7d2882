"""The smallest fault of each parameter and instrument that the detector finds in a given time, at the stated noise.

Derived from the detector itself. The healthy filter is linear about a run of the healthy plant (`operation`), so its
innovations are those of noise plus those of the fault: the first come from many realisations of sensor noise, input
noise and healthy parameters off by their accuracy, put through the filter's own recursion; the second from the
nonlinear plant with the parameter changed, put through the same recursion (`faulty`). Both together pass the CUSUM
and the limit of slow errors. For each realisation the size is found at which the alarm just comes in time; the answer
is the size that is enough for the part of them that is asked for. Slow errors are zero in the plant: their size is a
bound.

The range of a fault ends where its declared range ends, and where the plant has no finite solution any more: what a
real plant would do there the model does not tell.

Source: none in the thesis, which states no size; the statistics are those of `runtime.monitor` (Page 1954).
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isinf, log
from types import MappingProxyType

import numpy as np

from faultbond.analysis.comparison import NO_TIME, Allowance
from faultbond.analysis.false_alarm_trials import REALISATIONS, Bisection, Detector, windows_of
from faultbond.analysis.faulty import FaultCase, Faults, FaultTarget, fault_targets
from faultbond.analysis.operation import Operation, operate, usual_operation
from faultbond.analysis.realisations import CompiledDetector
from faultbond.analysis.sensitivity import BIAS, GAIN
from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.claims import claimed_bias, claimed_parameter
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec
from faultbond.equations.step import StepModel
from faultbond.errors import ModelError, RecordingError
from faultbond.runtime.core import Core

WITHIN_SAMPLES = 300  # default time in which the fault is to be found
CERTAINTY = 0.95
ONSETS = 4
SECONDS = 20.0  # of processor time, for all parameters together; usual plants take 1 to 3, large ones with loops 13
NO_RANGE = "its range leaves no room for a change"
NO_EFFECT = "no sensor shows it"
NO_SOLUTION = "not found before the plant has no finite solution any more"
NO_HOLD = "the least change already takes the plant elsewhere"
TOO_LARGE = "not found however large, within its range"
_LEAST = 1e-3  # part of a size that is enough, below which none is tried at once
_ROUNDS = 24
_CLOSE = 0.03  # relative change of the size below which it is found
_NUMBERS = 2 * 10**7  # of all effects that are looked at together
_FEW = 4  # parameters that are looked at together at least
_SEEN = 1e-6  # noises; an effect below is rounding
_TINY = 1e-9  # factors; where a smaller change does so much, rounding does so too
_BACK = 0.25  # part of a size without a solution that is tried next, where no smaller one is known


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """The largest deviation of one output that a fault causes: SI, and in noise standard deviations."""

    output: str
    size: float
    in_noise: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallestFault:
    """The smallest step of one parameter, or of what is wrong with an instrument, that is found within `within` s.

    parameter : its name; of an instrument `flow.bias`, of an input also `u.gain`
    certainty : part of all cases in which it is found
    value : size of the change, SI: of the two directions the one that needs more; None if neither is ever found
    up, down : size by direction; None: not found however large, within the parameter's range
    effects : of `value`, by output, without noise and while nothing reacts to it
    alike : what else explains a change by `value` about as well at the end of that time, of what was looked at
        together with it
    reason : why there is no `value`; empty if there is one
    claimed : change below which, found or not, it may be that of a healthy plant, and none is claimed; SI, inf: any
    onsets : when it begins in the run that was given, s; empty where none was
    """

    parameter: str
    value: float | None
    up: float | None
    down: float | None
    within: float
    certainty: float
    effects: tuple[Effect, ...]
    alike: tuple[str, ...] = ()
    reason: str = ""
    claimed: float = 0.0
    onsets: tuple[float, ...] = ()

    @property
    def told(self) -> float | None:
        """The change that is found and claimed, SI; None where none is."""
        return None if self.value is None or isinf(self.claimed) else max(self.value, self.claimed)

    @property
    def direction(self) -> str | None:
        """`up` or `down`: where `value` stands."""
        return None if self.value is None else "up" if self.value == self.up else "down"


_TRIALS = (
    Bisection(log(1e6), 11, 0, log(1.5)),
    Bisection(log(10.0), 8, 6, log(1.2)),
    Bisection(log(1.6), 6, 1, _CLOSE),
)
_PATIENCE = 8  # rounds of one trial; the next begins from wherever it is


def smallest_faults(
    model: StepModel,
    spec: EngineSpec,
    engine: Core,
    detector: CompiledDetector,
    samples: Sequence[Sample] | None = None,
    *,
    parameters: Sequence[str] | None = None,
    within: float | None = None,
    onsets: Sequence[float] | None = None,
    certainty: float = CERTAINTY,
    hidden: Mapping[str, str] = MappingProxyType({}),
    seconds: float | None = SECONDS,
) -> Iterator[SmallestFault]:
    """Give the smallest fault of each parameter, some parameters at a time, as they are found.

    Parameters
    ----------
    model, spec, engine : the plant
    detector : its detector, see `app.realisations`
    samples : a run of the healthy plant, on the grid; default one of `operation.usual_runs`
    parameters : names, of a bias `flow.bias`, of a gain `u.gain`; default all suspects, and what may be wrong with the
        instruments that may fail: biases, and of inputs gains
    within : s, default 300 samples
    onsets : times, s, of the samples at which the fault may begin; default four, spread over the run
    certainty : part of the realisations, over all onsets, that is to be found
    hidden : what is told as not found, with the reason: an unknown input may do the same
    seconds : processor time after which no further parameter is begun; None: no limit

    Raises
    ------
    ModelError
        Where a parameter is unknown.
    RecordingError
        Where the run is too short, or noise alone raises the alarm in it.
    StructureError
        Where there is no usual run.
    """
    clock = Allowance(seconds=seconds)
    names = [item.name for item in spec.parameters] + [f"{item.name}{BIAS}" for item in spec.instruments]
    names += [f"{item.name}{GAIN}" for item in spec.instruments if not item.is_output]
    for name in parameters or ():
        if name not in names:
            raise ModelError(f"{spec.model}: no parameter {name}; there are {', '.join(names)}")
    trusted = [item.name for item in spec.parameters if not item.suspect]
    every = dict.fromkeys((*names, *hidden))  # a fault of an instrument that is hidden is not among the former
    asked = [name for name in every if name not in trusted] if parameters is None else parameters
    grid = spec.sample_time or (float(np.median([item.dt for item in samples[1:]])) if samples else 1.0)
    length = max(round(WITHIN_SAMPLES if within is None else within / grid), 1)
    if samples is None:
        operation = usual_operation(model, spec, engine, spec.thresholds.warm_up_samples + 20 + 2 * length)
    else:
        operation = operate(model, spec, engine, samples)
    windows = windows_of(spec, operation, _onset_rows(spec, operation, length, onsets), length)
    trials = Detector(spec, windows, operation.counted[windows.rows], operation.blanked[windows.rows], detector)
    begun = () if samples is None else tuple(operation.time[windows.rows[:, 0]].tolist())
    search = _Search(spec, Faults(model, spec, engine, operation, windows.rows), trials, certainty, begun)
    known = {item.name: item for item in fault_targets(spec, operation)}
    chosen = [known[name] for name in asked if name in known and name not in hidden]
    for name in asked:
        if name in hidden:
            yield SmallestFault(
                parameter=name,
                value=None,
                up=None,
                down=None,
                within=length * grid,
                certainty=certainty,
                effects=(),
                reason=hidden[name],
                onsets=begun,
            )
    together = max(_NUMBERS // (2 * windows.rows.size * REALISATIONS * len(spec.outputs)), _FEW)
    if operation.implicit.shape[1]:  # a step of the plant takes long: rather some of them than none
        together = _FEW
    for first in range(0, len(chosen), together):
        yield from _report(search, chosen[first : first + together], length * grid, clock)


def _onset_rows(spec: EngineSpec, operation: Operation, length: int, onsets: Sequence[float] | None) -> list[int]:
    """Give the rows at which the fault begins."""
    last = len(operation.time) - 1 - length
    first = operation.warm + 1
    if last < first:
        raise RecordingError(
            f"{spec.model}: the run has {len(operation.time)} samples after its start; {first + length + 1} are needed "
            "to say what is found within the time asked for; give a longer recording or less time"
        )
    if onsets is None:
        begin = first + (last - first) // 3  # the filter has learned for a while
        return sorted({round(row) for row in np.linspace(begin, last, ONSETS)})
    rows = [int(np.searchsorted(operation.time, moment - 1e-9)) for moment in onsets]
    if not rows or min(rows) < first or max(rows) > last:
        raise RecordingError(
            f"{spec.model}: a fault may begin from {operation.time[first]:g} s to {operation.time[last]:g} s in this "
            "run; choose onsets between them"
        )
    return rows


@dataclass(slots=True, kw_only=True, eq=False)
class _Progress:
    """How far the search has come, by case: sizes in factors, and the bounds between which the answer lies.

    limits: ends of the ranges. trial: number of the current one; rounds: done of it. found, broken: whether the size is
    the answer; whether the plant has had no solution. wild: whether rounding would do as much. largest: (cases,
    n_outputs), effects of the last size, SI.
    """

    size: FloatArray
    limits: FloatArray
    low: FloatArray
    high: FloatArray
    trial: IntArray
    rounds: IntArray
    found: BoolArray
    broken: BoolArray
    wild: BoolArray
    largest: FloatArray

    @property
    def live(self) -> IntArray:
        """The cases that are not at their end."""
        return np.flatnonzero((self.trial < len(_TRIALS)) & (self.limits > 0.0))


class _Search:
    """Everything that does not depend on the fault, and the search for its size."""

    def __init__(
        self, spec: EngineSpec, faults: Faults, detector: Detector, certainty: float, onsets: tuple[float, ...]
    ) -> None:
        self.spec, self.faults, self.detector, self.certainty = spec, faults, detector, certainty
        self.onsets = onsets

    def run(self, cases: list[FaultCase], clock: Allowance) -> _Progress:
        """Find the sizes: Newton's method, as if all effects grew in proportion, between bounds that are known."""
        n = len(cases)
        limits = [item.most[sign < 0] for item, sign in cases]
        first = [item.first for item, _ in cases]
        progress = _Progress(
            size=np.minimum(first, limits),
            limits=np.array(limits),
            low=np.zeros(n),
            high=np.full(n, np.inf),
            trial=np.zeros(n, dtype=np.intp),
            rounds=np.zeros(n, dtype=np.intp),
            found=np.zeros(n, dtype=bool),
            broken=np.zeros(n, dtype=bool),
            wild=np.zeros(n, dtype=bool),
            largest=np.zeros((n, len(self.spec.outputs))),
        )
        for _ in range(_ROUNDS):
            live = progress.live
            if not len(live) or clock.over():
                break
            self._round(progress, cases, live)
        enough = progress.live[np.isfinite(progress.high[progress.live])]  # that is known, the smallest size is not
        progress.size[enough], progress.found[enough] = progress.high[enough], True
        return progress

    def _round(self, progress: _Progress, cases: list[FaultCase], live: IntArray) -> None:
        """Try the sizes of some cases, and choose the next."""
        now = progress.size[live]
        shift = self.faults.shift([cases[c] for c in live], now)
        factor = np.full(len(live), np.inf)
        for number in np.unique(progress.trial[live[shift.whole]]):
            mine = np.flatnonzero((progress.trial[live] == number) & shift.whole)
            effects = shift.innovations[:, mine], shift.slow[:, mine]
            factor[mine] = self.detector.enough(*effects, _TRIALS[number], self.certainty)
        progress.largest[live[shift.whole]] = shift.largest[shift.whole]
        broken = live[~shift.whole]
        progress.broken[broken] = True
        least = np.where(progress.low[broken] > 0.0, progress.low[broken], _BACK**2 * now[~shift.whole])
        size = np.sqrt(least * now[~shift.whole])
        progress.size[broken] = progress.limits[broken] = np.where(size > _TINY, size, 0.0)
        progress.wild[broken] = size <= _TINY
        self._judge(progress, live[shift.whole], factor[shift.whole], now[shift.whole])
        progress.rounds[live] += 1

    def _judge(self, progress: _Progress, live: IntArray, factor: FloatArray, now: FloatArray) -> None:
        """Take what was found of sizes, and choose the next, or end."""
        close = np.abs(np.log(factor)) < np.array([_TRIALS[number].close for number in progress.trial[live]])
        stuck = (factor > 1.0) & (now >= progress.limits[live])
        progress.low[live] = np.where(factor > 1.0, np.maximum(now, progress.low[live]), progress.low[live])
        progress.high[live] = np.where(factor <= 1.0, np.minimum(now, progress.high[live]), progress.high[live])
        wanted = np.minimum(now * factor, progress.limits[live])
        low, high = progress.low[live], progress.high[live]
        outside = ((wanted <= low) | (wanted >= high)) & np.isfinite(high)
        between = np.sqrt(np.maximum(low, _LEAST * high) * np.where(outside, high, 1.0))
        size = np.where(close | stuck, now, np.where(outside, between, wanted))
        progress.wild[live] = size <= _TINY
        progress.limits[live] = np.where(size <= _TINY, 0.0, progress.limits[live])
        progress.size[live] = size
        last = progress.trial[live] == len(_TRIALS) - 1
        progress.found[live] = last & close
        over = close | stuck | ((progress.rounds[live] >= _PATIENCE - 1) & ~last)
        done = live[over]
        progress.trial[done] += 1
        progress.rounds[done], progress.low[done], progress.high[done] = -1, 0.0, np.inf


def _report(search: _Search, chosen: list[FaultTarget], within: float, clock: Allowance) -> Iterator[SmallestFault]:
    spec = search.spec
    progress = search.run([(item, sign) for item in chosen for sign in (1, -1)], clock)
    sizes = np.where(progress.found, progress.size, np.inf)
    worst = [_worst(progress, 2 * number) for number in range(len(chosen))]
    alike = _alike(search, [(chosen[c // 2], 1 - 2 * (c % 2)) for c in worst if c is not None], sizes, worst)
    for number, item in enumerate(chosen):
        both = slice(2 * number, 2 * number + 2)
        up, down = (float(size * abs(item.scale)) if np.isfinite(size) else None for size in sizes[both])
        if item.scale < 0:
            up, down = down, up
        case = worst[number]
        largest = () if case is None else zip(spec.outputs, progress.largest[case].tolist(), strict=True)
        yield SmallestFault(
            parameter=item.name,
            value=None if case is None else float(sizes[case] * abs(item.scale)),
            up=up,
            down=down,
            within=within,
            certainty=search.certainty,
            effects=tuple(Effect(output=of.name, size=size, in_noise=size / of.noise) for of, size in largest),
            alike=alike.get(item.name, ()),
            reason=_reason(spec, progress, both) if case is None else "",
            claimed=_claimed(spec, item),
            onsets=search.onsets,
        )


def _claimed(spec: EngineSpec, target: FaultTarget) -> float:
    if target.parameter >= 0:
        return claimed_parameter(spec, target.parameter)
    if target.is_gain:
        return claimed_bias(spec, target.input, is_output=False, largest=target.largest) / target.largest
    is_output = target.output >= 0
    return claimed_bias(spec, max(target.output, target.input), is_output=is_output, largest=target.largest)


def _worst(progress: _Progress, first: int) -> int | None:
    """Give of two cases, up and down, the one that is found and needs more; None if none is found."""
    found = [case for case in (first, first + 1) if progress.found[case]]
    return max(found, key=lambda case: progress.size[case], default=None)


def _alike(
    search: _Search, cases: list[FaultCase], sizes: FloatArray, worst: Sequence[int | None]
) -> dict[str, tuple[str, ...]]:
    """Give for each case the others that explain it, at another size, to within `group_nats`, after most onsets.

    Innovations are white and their sd is one, so half the square of what is left is the log-likelihood that is lost.
    """
    if not cases:
        return {}
    found = search.faults.shift(cases, np.array([sizes[case] for case in worst if case is not None]))
    effects = found.innovations.transpose(2, 1, 0, 3).reshape(found.innovations.shape[2], len(cases), -1)
    products = effects @ effects.transpose(0, 2, 1)
    squares = np.diagonal(products, axis1=1, axis2=2)
    left = squares[:, :, None] - products**2 / np.maximum(squares, _TINY)[:, None, :]
    close = np.median(left, axis=0) / 2.0 < search.spec.thresholds.group_nats
    names = [item.name for item, _ in cases]
    return {
        name: tuple(other for k, other in enumerate(names) if close[row, k] and k != row and found.whole[k])
        for row, name in enumerate(names)
    }


def _reason(spec: EngineSpec, progress: _Progress, both: slice) -> str:
    """Say why neither direction is found."""
    if progress.wild[both].any():
        return NO_HOLD
    if progress.broken[both].any():
        return NO_SOLUTION
    if not (progress.limits[both] > 0.0).any():
        return NO_RANGE
    if len(np.intersect1d(progress.live, np.arange(both.start, both.stop))):
        return NO_TIME
    return TOO_LARGE if (progress.largest[both] > _SEEN * spec.output_noise).any() else NO_EFFECT
