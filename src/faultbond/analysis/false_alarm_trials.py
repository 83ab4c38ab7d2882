"""What noise alone does to the detector: its innovations and statistics over a run, in many realisations.

The healthy filter is linear about a run (`operation`), so noise of sensors and inputs, and healthy parameters off by
their accuracy, pass its own recursion; slow errors are zero in the plant, since their declared size is a bound; what
wanders does so. The sums are those of the monitor (`fit.cusum`, `core/sums.h`), of all realisations at once.
"""

from dataclasses import dataclass, fields, replace

import numpy as np

from faultbond.analysis.operation import Operation
from faultbond.analysis.realisations import CompiledDetector, Realisations
from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.spec import EngineSpec
from faultbond.errors import RecordingError
from faultbond.fit.cusum import Sums, added, height_of, no_sums

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

    `counted`, `blanked`: (o, w, n_outputs), whether the sums take the value, or forget those before. `detector`: with
    the limits of `spec`.

    Raises
    ------
    RecordingError
        Where noise alone always alarms before.
    """

    def __init__(
        self, spec: EngineSpec, windows: Windows, counted: BoolArray, blanked: BoolArray, detector: CompiledDetector
    ) -> None:
        self.compiled, self.quiet = detector, windows.quiet
        self.noisy = Realisations(
            noise=windows.noise.transpose(1, 0, 3, 2),
            slow=windows.slow.transpose(1, 0, 3, 2),
            limits=spec.slow_limits[alarming(spec)],
            begun=_begun(windows.sums),
            counted=counted.transpose(1, 0, 2),
            blanked=blanked.transpose(1, 0, 2),
        )
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
        quiet = self.quiet[:, :: trial.every] if trial.every else np.ones((len(self.quiet), 1), dtype=bool)
        given = _some(self.noisy, trial.every) if trial.every else _silent(self.noisy)
        if not quiet.any():
            quiet, given = self.quiet, self.noisy
        low = np.full((innovations.shape[1], *quiet.shape), -trial.reach)
        high = -low
        for _ in range(trial.steps):
            middle = (low + high) / 2
            found = self.compiled.alarms(given, innovations, slow, np.exp(middle))
            low, high = np.where(found, low, middle), np.where(found, middle, high)
        beyond = np.exp(trial.reach) if trial.every else np.inf
        needed = np.where(high >= trial.reach, beyond, np.exp((low + high) / 2))
        counted = np.flatnonzero(quiet)
        ordered = np.sort(needed.reshape(len(needed), -1)[:, counted], axis=1)
        return np.asarray(ordered[:, min(int(certainty * len(counted)), len(counted) - 1)])


def _begun(sums: Sums) -> FloatArray:
    """Give sums, axes behind the first (o, m, n_outputs), as (o, n_outputs, n_sums, m)."""
    return np.concatenate([sums.slow, sums.fast, sums.scatter, sums.before]).transpose(1, 3, 0, 2)


def _some(given: Realisations, every: int) -> Realisations:
    """Give one in so many of them."""
    return replace(
        given,
        noise=given.noise[..., ::every],
        slow=given.slow[..., ::every],
        begun=given.begun[..., ::every],
    )


def _silent(given: Realisations) -> Realisations:
    """Give one realisation of them, without noise."""
    n = given.begun.shape[1]
    return replace(
        given,
        noise=np.zeros_like(given.noise[..., :1]),
        slow=np.zeros_like(given.slow[..., :1]),
        begun=np.broadcast_to(_begun(no_sums(1, 1, n)), (*given.begun.shape[:3], 1)),
    )
