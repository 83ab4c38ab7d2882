"""The smallest fault of each parameter that the detector finds within a given time, at the stated noise and accuracy.

Derived from the detector itself. The healthy filter is linear about a run of the healthy plant (`operation`), so its
innovations are those of noise plus those of the fault: the first come from many realisations of sensor noise, input
noise and healthy parameters off by their accuracy, put through the filter's own recursion; the second from the
nonlinear plant with the parameter changed, put through the same recursion. Both together pass the detector's two
statistics. For each realisation the size is found at which the alarm just comes in time; the answer is the size that is
enough for the part of them that is asked for. Slow errors are zero in the plant: their declared size is a bound.

Source: none in the thesis, which states no size; the statistics are those of `runtime.monitor` (Page 1954).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import log

import casadi as ca
import numpy as np

from faultbond.analysis.alarms import Windows, accumulated, alarming, alarms, ratios_of, windows_of
from faultbond.analysis.operation import Operation, advance_function, generic_samples, operate
from faultbond.dynamics.step import StepModel
from faultbond.errors import ModelError, RecordingError
from faultbond.runtime.monitor import Sample
from faultbond.spec import Engine, EngineSpec
from faultbond.types import BoolArray, FloatArray

WITHIN_SAMPLES = 300  # default time in which the fault is to be found
CERTAINTY = 0.95
ONSETS = 4
_LINEAR = 0.05  # first size tried, in accuracies
_LEAST = 1e-3  # and at least so much, in factors
_ROUNDS = 16
_NEAR = log(1.3)  # a size so near is looked at with all realisations
_EVERY = 6  # of the realisations are enough before
_CLOSE = 0.03  # relative change of the size below which it is found
_CHUNK = 4  # parameters looked for together
_ABSURD = 1e9  # noises; an output that is not a number is so far off


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """The largest deviation of one output that a fault causes: SI, and in noise standard deviations."""

    output: str
    size: float
    in_noise: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SmallestFault:
    """The smallest step of one parameter that is found with `certainty` within `within` seconds.

    value : size of the change, SI: of the two directions the one that needs more; None if neither is ever found
    up, down : size by direction; None: not found however large, within the parameter's range
    effects : of `value`, by output, without noise and while nothing reacts to it
    """

    parameter: str
    value: float | None
    up: float | None
    down: float | None
    within: float
    certainty: float
    effects: tuple[Effect, ...]

    @property
    def direction(self) -> str | None:
        """`up` or `down`: where `value` stands."""
        return None if self.value is None else "up" if self.value == self.up else "down"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Shift:
    """What faults of some size (cases c) do: innovations (c, o, w, n_outputs), slow errors (c, o, w, n_slow).

    outputs: (c, o, w, n_outputs), SI.
    """

    noise: FloatArray
    slow: FloatArray
    outputs: FloatArray


def smallest_faults(
    model: StepModel,
    spec: EngineSpec,
    engine: Engine,
    samples: Sequence[Sample] | None = None,
    *,
    parameters: Sequence[str] | None = None,
    within: float | None = None,
    onsets: Sequence[float] | None = None,
    certainty: float = CERTAINTY,
) -> Iterator[SmallestFault]:
    """Give the smallest fault of each parameter, a few parameters at a time, as they are found.

    Parameters
    ----------
    model, spec, engine : the plant
    samples : a run of the healthy plant, on the grid; default the generic run of `operation.generic_samples`
    parameters : names; default all suspects
    within : s, default 300 samples
    onsets : times, s, of the samples at which the fault may begin; default four, spread over the run
    certainty : part of the realisations, over all onsets, that is to be found

    Raises
    ------
    ModelError
        Where a parameter is unknown.
    RecordingError
        Where the run is too short, or noise alone raises the alarm in it.
    """
    chosen = _chosen(spec, parameters)
    grid = spec.sample_time or (float(np.median([item.dt for item in samples[1:]])) if samples else 1.0)
    length = max(round(WITHIN_SAMPLES if within is None else within / grid), 1)
    if samples is None:
        warm = spec.thresholds.warm_up_samples
        samples = generic_samples(model, spec, warm + 20 + 2 * length)
    operation = operate(model, spec, engine, samples)
    windows = windows_of(spec, operation, _onset_rows(spec, operation, length, onsets), length)
    search = _Search(model, spec, operation, windows, certainty)
    for first in range(0, len(chosen), _CHUNK):
        yield from _report(spec, search, chosen[first : first + _CHUNK], length * grid, certainty)


def _chosen(spec: EngineSpec, parameters: Sequence[str] | None) -> list[int]:
    names = [item.name for item in spec.parameters]
    if parameters is None:
        return [k for k, item in enumerate(spec.parameters) if item.suspect]
    for name in parameters:
        if name not in names:
            raise ModelError(f"{spec.model}: no parameter {name}; there are {', '.join(names)}")
    return [names.index(name) for name in parameters]


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


@dataclass(frozen=True, slots=True)
class _Trial:
    """How the factor of a size is bisected: its logarithm within +-reach, in steps; with all realisations or some."""

    reach: float
    steps: int
    all: bool


_COARSE, _FINE = _Trial(log(1e6), 10, False), _Trial(log(4.0), 7, True)


class _Search:
    """Everything that does not depend on the fault, and the search for its size."""

    def __init__(
        self, model: StepModel, spec: EngineSpec, operation: Operation, windows: Windows, certainty: float
    ) -> None:
        self.model = model
        self.spec = spec
        self.operation = operation
        self.windows = windows
        self.certainty = certainty
        self.advance = advance_function(model)

    def sizes(self, cases: list[tuple[int, int]]) -> tuple[FloatArray, FloatArray]:
        """Give the sizes, in factors, inf where nothing is found, and the largest effects (c, n_outputs), SI.

        Newton's method on the size, as if all effects grew in proportion, between bounds that are known.

        Parameters
        ----------
        cases : (parameter, sign of the change)
        """
        limits = np.array([self._limit(k, sign) for k, sign in cases])
        size = np.minimum([max(_LINEAR * self.spec.parameters[k].accuracy, _LEAST) for k, _ in cases], limits)
        low, high = np.zeros(len(cases)), np.full(len(cases), np.inf)
        effects = np.zeros((len(cases), len(self.spec.outputs)))
        live, trial = np.flatnonzero(limits > 0), _COARSE
        for number in range(_ROUNDS):
            if not len(live):
                break
            now = size[live]
            shift = self.shift([cases[c] for c in live], now)
            factor = self._enough(shift, trial)
            effects[live] = np.max(np.abs(shift.outputs), axis=(1, 2))
            low[live] = np.where(factor > 1, now, low[live])
            high[live] = np.where(factor <= 1, now, high[live])
            stuck = (factor > 1) & (now >= limits[live])
            close = np.abs(np.log(factor)) < (_CLOSE if trial.all else _NEAR)
            size[live] = np.where(close, now, self._next(now * factor, low[live], high[live], limits[live]))
            if trial.all:
                live = live[~stuck & ~close]
            elif bool(np.all(stuck | close)) or number >= _ROUNDS // 2:
                trial, low, high = _FINE, np.zeros_like(low), np.full_like(high, np.inf)
        size = np.where(np.isin(np.arange(len(cases)), live), high, size)  # enough is known, the smallest is not
        return np.where((size >= limits) & ~np.isfinite(high), np.inf, size), effects

    def _next(self, wanted: FloatArray, low: FloatArray, high: FloatArray, limits: FloatArray) -> FloatArray:
        """Give the next size to try: the wanted one, or one between the bounds."""
        wanted = np.minimum(wanted, limits)
        outside = ((wanted <= low) | (wanted >= high)) & np.isfinite(high)
        return np.where(outside, np.sqrt(np.maximum(low, _LEAST * high) * np.where(outside, high, 1.0)), wanted)

    def _limit(self, k: int, sign: int) -> float:
        item = self.spec.parameters[k]
        return max(item.upper - item.healthy if sign > 0 else item.healthy - item.lower, 0.0)

    def shift(self, cases: list[tuple[int, int]], size: FloatArray) -> _Shift:
        """Give what faults of these sizes do to outputs, innovations and slow errors."""
        outputs = self._outputs(cases, size)
        spec, operation, rows = self.spec, self.operation, self.windows.rows
        error = np.zeros((len(rows), len(cases), spec.n_joint))
        innovations, slow = np.zeros_like(outputs), np.zeros((*outputs.shape[:3], len(alarming(spec))))
        most = spec.thresholds.learning_bound or np.inf
        for w in range(rows.shape[1]):
            k = rows[:, w]
            if w:
                error = error @ operation.transition[k].transpose(0, 2, 1)
                error[..., spec.noise_slice] = 0.0
            spread = operation.spread[k][:, None, :]
            deviation = outputs[:, :, w].transpose(1, 0, 2) - error @ operation.slope[k].transpose(0, 2, 1)
            learned = np.clip(deviation, -most * spread, most * spread)
            error = error + learned @ operation.gain[k].transpose(0, 2, 1)
            innovations[:, :, w] = (deviation / spread).transpose(1, 0, 2)
            slow[:, :, w] = ratios_of(spec, error).transpose(1, 0, 2)
        return _Shift(noise=innovations, slow=slow, outputs=outputs)

    def _outputs(self, cases: list[tuple[int, int]], size: FloatArray) -> FloatArray:
        """Give faulty minus healthy outputs of the plant from each onset on, (c, o, w, n_outputs), SI."""
        operation, rows, n_cases = self.operation, self.windows.rows, len(cases)
        healthy = operation.mean[rows[:, 0]].copy()
        healthy[:, self.spec.noise_slice] = 0.0
        v = np.stack(
            [healthy, *(self._changed(healthy, k, sign * d) for (k, sign), d in zip(cases, size, strict=True))]
        )
        v = v.reshape(-1, self.spec.n_joint).T
        z = np.tile(operation.implicit[rows[:, 0]], (n_cases + 1, 1)).T
        read, go_on = self.model.measure.map(v.shape[1]), self.advance.map(v.shape[1])
        seen = np.zeros((rows.shape[1], n_cases + 1, len(rows), len(self.spec.outputs)))
        for w in range(rows.shape[1]):
            k = rows[:, w]
            u = np.tile(operation.u[k], (n_cases + 1, 1)).T
            if w:
                before = np.tile(operation.u_before[k], (n_cases + 1, 1)).T
                v, z, y = (_full(item) for item in go_on(v, z, before, u, np.tile(operation.dt[k], n_cases + 1)[None]))
            else:
                y = _full(read(v, u, z)[0])
            seen[w] = y.T.reshape(seen.shape[1:])
        wrong = self.spec.output_noise * _ABSURD
        moved = np.moveaxis(seen[:, 1:] - seen[:, :1], 0, 2)
        return np.clip(np.where(np.isfinite(moved), moved, wrong), -wrong, wrong)

    def _changed(self, healthy: FloatArray, parameter: int, change: float) -> FloatArray:
        """Give joint vectors after a step of a parameter; stores keep their contents."""
        n_x, place = len(self.spec.states), self.spec.parameter_slice
        scales = self.model.scales
        changed = healthy.copy()
        item = self.spec.parameters[parameter]
        moved = changed[:, place.start + parameter] + change
        changed[:, place.start + parameter] = np.clip(moved, item.lower, item.upper)
        for row, (old, new) in enumerate(zip(healthy, changed, strict=True)):
            content = self.model.contents(old[:n_x], old[place] * scales)
            changed[row, :n_x] = _full(self.model.coordinates(content, new[place] * scales)).reshape(-1)
        return changed

    def _enough(self, shift: _Shift, trial: _Trial) -> FloatArray:
        """Give by how much each fault must grow, all else in proportion, to be found as often as asked.

        Bisection for each realisation, in logarithms, within exp(-reach)..exp(reach); inf beyond.
        """
        quiet = self.windows.quiet[:, :: 1 if trial.all else _EVERY]
        low = np.full((shift.noise.shape[0], *quiet.shape), -trial.reach)
        high = -low
        for _ in range(trial.steps):
            middle = (low + high) / 2
            found = self._found(shift, np.exp(middle))
            low, high = np.where(found, low, middle), np.where(found, middle, high)
        needed = np.where(high >= trial.reach, np.inf, np.exp((low + high) / 2))
        counted = np.flatnonzero(quiet)
        if not len(counted):
            raise RecordingError(
                f"{self.spec.model}: in this run noise alone raises the alarm before any fault; "
                "check the noise and the slow errors that the model declares"
            )
        ordered = np.sort(needed.reshape(len(needed), -1)[:, counted], axis=1)
        return np.asarray(ordered[:, min(int(self.certainty * len(counted)), len(counted) - 1)])

    def _found(self, shift: _Shift, factor: FloatArray) -> BoolArray:
        """Give whether a fault `factor` times as large (c, o, m) raises the alarm in time in each realisation."""
        spec, windows = self.spec, self.windows
        every = windows.quiet.shape[1] // factor.shape[2]
        cusum = np.repeat(windows.cusum[:, None, :, ::every], len(factor), axis=1)
        peak, slowest = cusum.copy(), np.zeros((*factor.shape, shift.slow.shape[-1]))
        larger = factor[..., None]
        for w in range(windows.rows.shape[1]):
            counted = self.operation.counted[windows.rows[:, w]][:, None, :]
            score = windows.noise[:, w, ::every] + larger * shift.noise[:, :, w, None, :]
            cusum = accumulated(spec, cusum, score, counted)
            np.maximum(peak, cusum, out=peak)
            if slowest.size:
                ratios = windows.slow[:, w, ::every] + larger * shift.slow[:, :, w, None, :]
                np.maximum(slowest, np.abs(ratios), out=slowest)
        return alarms(spec, peak, slowest)


def _full(value: ca.DM) -> FloatArray:
    return np.asarray(value.full(), dtype=np.float64)


def _report(
    spec: EngineSpec, search: _Search, chosen: list[int], within: float, certainty: float
) -> Iterator[SmallestFault]:
    cases = [(k, sign) for k in chosen for sign in (1, -1)]
    sizes, effects = search.sizes(cases)
    for number, k in enumerate(chosen):
        item, both = spec.parameters[k], sizes[2 * number : 2 * number + 2]
        up, down = (float(size * abs(item.scale)) if np.isfinite(size) else None for size in both)
        if item.scale < 0:
            up, down = down, up
        finite = [2 * number + j for j in (0, 1) if np.isfinite(both[j])]
        worst = max(finite, key=lambda case: sizes[case], default=None)
        yield SmallestFault(
            parameter=item.name,
            value=None if worst is None else float(sizes[worst] * abs(item.scale)),
            up=up,
            down=down,
            within=within,
            certainty=certainty,
            effects=() if worst is None else _effects(spec, effects[worst]),
        )


def _effects(spec: EngineSpec, largest: FloatArray) -> tuple[Effect, ...]:
    return tuple(
        Effect(output=item.name, size=float(size), in_noise=float(size / item.noise))
        for item, size in zip(spec.outputs, largest, strict=True)
    )
