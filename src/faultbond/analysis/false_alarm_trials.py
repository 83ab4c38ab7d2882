"""What noise alone does to the detector: its innovations and statistics over a run, in many realisations.

The healthy filter is linear about a run (`operation`), so noise of sensors and inputs, and healthy parameters off by
their accuracy, pass its own recursion; slow errors are zero in the plant, since their declared size is a bound; what
wanders does so. The sums are those of the monitor (`runtime.cusum`), of all realisations at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, fields

import numpy as np

from faultbond.analysis.operation import Operation
from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.spec import EngineSpec
from faultbond.errors import RecordingError
from faultbond.fit.cusum import Floats, Sums, added, height_of, no_sums

REALISATIONS = 60  # of noise, per onset
_SEED = 20


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Windows:
    """The stretches after each onset, one row per onset o and sample w.

    rows: (o, w), of the operation. noise: (o, w, m, n_outputs), innovations without fault, in their sd. slow: (o, w, m,
    n_slow), in declared sd. sums: before the onset, axes behind the first (o, m, n_outputs). quiet: (o, m), no alarm
    before it.
    """

    rows: IntArray
    noise: FloatArray
    slow: FloatArray
    sums: Sums
    quiet: BoolArray


def windows_of(spec: EngineSpec, operation: Operation, onsets: list[int], length: int) -> Windows:
    """Run noise through the filter and its statistics without a fault; `onsets` are rows of the operation."""
    generator = np.random.default_rng(_SEED)
    count, shape = len(operation.time), (REALISATIONS, len(spec.outputs))
    error = _first_errors(spec, operation.covariance, generator)
    moving = _Wandering(spec, operation.covariance, error, generator)
    scores, ratios = np.zeros((count, *shape)), np.zeros((count, REALISATIONS, len(alarming(spec))))
    sums, quiet = no_sums(*shape), np.ones(REALISATIONS, dtype=bool)
    before, quiets = {}, {}
    for k in range(count):
        if k:
            error = error @ operation.transition[k].T
            error[:, moving.places] -= moving.moved(np.diag(operation.transition[k])[moving.places], generator)
            fresh = operation.fresh[k]
            error[:, spec.noise_slice] += fresh * generator.standard_normal((REALISATIONS, fresh.size))
            innovation = operation.noise[k] * generator.standard_normal(shape) - error @ operation.slope[k].T
            error = error + innovation @ operation.gain[k].T
            scores[k] = innovation / operation.spread[k]
        ratios[k] = ratios_of(spec, moving.estimates(error), operation.aged[k])
        if k in onsets:
            before[k], quiets[k] = sums, quiet
        if k >= operation.warm:
            sums = added(spec.thresholds, sums, scores[k], operation.counted[k], operation.blanked[k])
            quiet = quiet & ~alarms(spec, sums, ratios[k])
    rows = np.array(onsets)[:, None] + np.arange(length + 1)
    return Windows(
        rows=rows,
        noise=scores[rows],
        slow=ratios[rows],
        sums=Sums(
            **{item.name: np.stack([getattr(before[k], item.name) for k in onsets], axis=1) for item in fields(Sums)}
        ),
        quiet=np.stack([quiets[k] for k in onsets]),
    )


class _Wandering:
    """What wanders in the plant, in all realisations, from a first error of its estimates (m, n_joint)."""

    def __init__(
        self, spec: EngineSpec, covariance: FloatArray, error: FloatArray, generator: np.random.Generator
    ) -> None:
        wanders = np.array([item.wanders for item in spec.slow_errors], dtype=bool)
        self.places = np.arange(spec.n_joint)[spec.slow_slice][wanders]
        self.sizes = spec.slow_sizes[wanders]
        known = np.sqrt(np.maximum(self.sizes**2 - np.diag(covariance)[self.places], 0.0))  # sd of the estimates
        self.values = known * generator.standard_normal((REALISATIONS, known.size)) - error[:, self.places]

    def moved(self, decay: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Take a step in time; give by how much (m, n_wandering) it went elsewhere than to its usual value."""
        by = self.sizes * np.sqrt(1.0 - decay**2) * generator.standard_normal(self.values.shape)
        self.values = decay * self.values + by
        return np.asarray(by)

    def estimates(self, error: FloatArray) -> FloatArray:
        """Give the estimates of all numbers (m, n_joint), of those that do not wander from zero."""
        found = error.copy()
        found[:, self.places] += self.values
        return found


def _first_errors(spec: EngineSpec, covariance: FloatArray, generator: np.random.Generator) -> FloatArray:
    """Draw estimate minus truth, (m, n_joint), as the filter believes it where the true slow errors are zero.

    The estimates of slow errors are not: parameters that are off already stand in them. An error e of a filter that is
    right has cov(e, truth) = -P; so, given slow errors s of declared variance S that are zero, e has the covariance
    P - P_s S^-1 P_s'. Of those that inputs kick S is not known, and they raise no alarm: they are let be.
    """
    still = np.array([not item.wanders and not item.after for item in spec.slow_errors], dtype=bool)
    toward = (covariance[:, spec.slow_slice] / spec.slow_sizes)[:, still]
    known = covariance - toward @ toward.T
    sizes = np.sqrt(np.maximum(np.diag(known), 1e-300))
    values, vectors = np.linalg.eigh(known / np.outer(sizes, sizes))
    root = vectors * np.sqrt(np.maximum(values, 0.0)) @ vectors.T  # symmetric: others turn with the last digit
    return np.asarray(generator.standard_normal((REALISATIONS, spec.n_joint)) @ root * sizes)


def alarming(spec: EngineSpec) -> list[int]:
    """Give the positions of the slow errors that alarm."""
    return [k for k, error in enumerate(spec.slow_errors) if error.alarms]


def ratios_of(spec: EngineSpec, joint: FloatArray, aged: BoolArray) -> FloatArray:
    """Give the alarming slow errors (..., n_alarming) of joint vectors (..., n_joint), in declared sd.

    aged: (..., n_slow_errors), whether each may alarm; one that may not counts as zero.
    """
    places = alarming(spec)
    return np.asarray(np.where(aged, joint[..., spec.slow_slice], 0.0)[..., places] / spec.slow_sizes[places])


def alarms(spec: EngineSpec, sums: Sums, ratios: FloatArray) -> BoolArray:
    """Give whether a statistic has crossed its limit, (...,).

    The sums are of innovations (..., n_outputs); ratios (..., n_alarming) are slow errors in declared sd.
    """
    crossed = np.any(height_of(spec.thresholds, sums) > spec.thresholds.cusum_limit, axis=-1)
    return np.asarray(crossed | np.any(np.abs(ratios) > spec.slow_limits[alarming(spec)], axis=-1))


@dataclass(frozen=True, slots=True)
class Bisection:
    """How the factor is bisected by which effects must grow: its logarithm within +-reach, in steps.

    every: of the realisations one in so many counts; 0: none, it is done without noise. close: a logarithm below which
    the next trial, or the end, has come.
    """

    reach: float
    steps: int
    every: int
    close: float


class Detector:
    """The statistics of the detector after each onset, with noise, for faults of any size.

    `counted`, `blanked`: (o, w, n_outputs), whether the sums take the value, or forget those before. Single precision:
    as good for noise, and faster.

    Raises
    ------
    RecordingError
        Where noise alone always alarms before.
    """

    def __init__(self, spec: EngineSpec, windows: Windows, counted: BoolArray, blanked: BoolArray) -> None:
        self.spec, self.quiet = spec, windows.quiet
        self.noise = windows.noise.transpose(1, 0, 3, 2).astype(np.float32)  # (w, o, n_outputs, m): m is looked at most
        self.slow = windows.slow.transpose(1, 0, 3, 2).astype(np.float32)
        self.sums = _each(windows.sums, lambda item: item.transpose(0, 1, 3, 2).astype(np.float32))
        self.limits = spec.slow_limits[alarming(spec)][:, None]
        self.counted, self.blanked = counted.transpose(1, 0, 2), blanked.transpose(1, 0, 2)
        if not windows.quiet.any():
            raise RecordingError(
                f"{spec.model}: in this run noise alone raises the alarm before any fault; "
                "check the noise and the slow errors that the model declares"
            )

    def enough(self, innovations: FloatArray, slow: FloatArray, trial: Bisection, certainty: float) -> FloatArray:
        """Give by how much each fault must grow, all else in proportion, to be found as often as asked.

        Bisection for each realisation, in logarithms, within exp(-reach)..exp(reach); inf beyond without noise.

        Parameters
        ----------
        innovations : float array, shape (w, c, o, n_outputs); of the fault alone, in their sd
        slow : float array, shape (w, c, o, n_slow); alarming slow errors, in declared sd
        trial : how it is done
        certainty : part of the realisations, over all onsets, that is to be found
        """
        some = slice(None, None, trial.every or 1) if trial.every else slice(0, 1)
        quiet = self.quiet[:, some] if trial.every else np.ones((len(self.quiet), 1), dtype=bool)
        if not quiet.any():
            some, quiet = slice(None), self.quiet
        low = np.full((innovations.shape[1], *quiet.shape), -trial.reach)
        high = -low
        effects = innovations.astype(np.float32), slow.astype(np.float32)
        for _ in range(trial.steps):
            middle = (low + high) / 2
            found = self._found(*effects, np.exp(middle), some, noisy=trial.every > 0)
            low, high = np.where(found, low, middle), np.where(found, middle, high)
        beyond = np.exp(trial.reach) if trial.every else np.inf
        needed = np.where(high >= trial.reach, beyond, np.exp((low + high) / 2))
        counted = np.flatnonzero(quiet)
        ordered = np.sort(needed.reshape(len(needed), -1)[:, counted], axis=1)
        return np.asarray(ordered[:, min(int(certainty * len(counted)), len(counted) - 1)])

    def _found(self, innovations: Floats, slow: Floats, factor: FloatArray, some: slice, *, noisy: bool) -> BoolArray:
        """Give whether a fault `factor` times as large (c, o, m) raises the alarm in time in each realisation."""
        settings, larger = self.spec.thresholds, factor.astype(np.float32)[:, :, None, :]
        shape = (*larger.shape[:2], innovations.shape[-1], larger.shape[3])
        sums = _each(no_sums(*shape), lambda item: item.astype(np.float32))
        if noisy:
            sums = _each(self.sums, lambda item: np.broadcast_to(item[:, None, :, :, some], (len(item), *shape)))
        peak, slowest = height_of(settings, sums), np.zeros((*shape[:2], slow.shape[-1], shape[3]), np.float32)
        for w in range(len(innovations)):
            score, ratios = larger * innovations[w, ..., None], larger * slow[w, ..., None]
            if noisy:
                score, ratios = score + self.noise[w, :, :, some], ratios + self.slow[w, :, :, some]
            sums = added(settings, sums, score, self.counted[w, :, :, None], self.blanked[w, :, :, None])
            peak = np.maximum(peak, height_of(settings, sums))
            slowest = np.maximum(slowest, np.abs(ratios))
        crossed = np.any(peak > settings.cusum_limit, axis=2)
        return np.asarray(crossed | np.any(slowest > self.limits, axis=2))


def _each(sums: Sums, change: Callable[[Floats], Floats]) -> Sums:
    """Change all sums alike."""
    return Sums(**{field.name: change(getattr(sums, field.name)) for field in fields(Sums)})
