"""How fast the detector is put on trial for smallest faults, beside its sums in numpy.

    python -m benchmarks.speed.realisations [--markdown FILE]

Faults of some sizes with 60 realisations of noise, as `analyse` tries them; both are asked the same, in turns in the
same run, and their alarms are compared before they are timed. Processor time; ratios count, since machines differ.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from benchmarks.shared.page import arguments, note, publish
from faultbond.analysis.realisations import Realisations
from faultbond.app.realisations import compiled_detector
from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Thresholds
from faultbond.fit.cusum import added, height_of, no_sums

SAMPLES, ONSETS, REALISATIONS = 300, 4, 60
CASES = ((4, 2), (16, 2), (16, 8))  # faults at a time, and sensors
ROUNDS = 7
HEADER = ("faults", "sensors", "compiled", "numpy", "ratio")


def drawn(n_sensors: int, seed: int = 1) -> Realisations:
    """Give noise of some sensors, without slow errors."""
    shape = (SAMPLES, ONSETS, n_sensors)
    begun = np.zeros((*shape[1:], 12, REALISATIONS))
    begun[:, :, 8:] = np.nan  # no innovations to compare with
    return Realisations(
        noise=np.random.default_rng(seed).standard_normal((*shape, REALISATIONS)),
        slow=np.zeros((SAMPLES, ONSETS, 0, REALISATIONS)),
        limits=np.zeros(0),
        begun=np.concatenate(
            [np.zeros((*shape[1:], 8, REALISATIONS)), np.full((*shape[1:], 4, REALISATIONS), np.nan)], 2
        ),
        counted=np.ones(shape, dtype=bool),
        blanked=np.zeros(shape, dtype=bool),
    )


def in_numpy(settings: Thresholds, given: Realisations, effects: FloatArray, factor: FloatArray) -> BoolArray:
    """Give what alarms by the sums in numpy, of all at once."""
    sums = no_sums(*effects.shape[1:], factor.shape[-1])
    peak = height_of(settings, sums)
    for effect, noise in zip(effects, given.noise, strict=True):
        score = factor[:, :, None, :] * effect[..., None] + noise
        sums = added(settings, sums, score, np.ones(1, dtype=bool))
        peak = np.maximum(peak, height_of(settings, sums))
    return np.asarray(np.any(peak > settings.cusum_limit, axis=2))


def taken(work: Callable[[], object]) -> float:
    """Give the processor time of a piece of work."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def measured(n_faults: int, n_sensors: int) -> tuple[str, ...]:
    """Give a row of the table."""
    settings = replace(Thresholds(), fast_limit=12.0)
    detector, given = compiled_detector(settings), drawn(n_sensors)
    draws, shape = np.random.default_rng(2), (n_faults, ONSETS, n_sensors)
    effects, strayed = (
        np.broadcast_to(draws.normal(0.0, 0.5, shape), (SAMPLES, *shape)),
        np.zeros((SAMPLES, *shape[:2], 0)),
    )
    factor = draws.uniform(0.2, 2.0, (*shape[:2], REALISATIONS))

    def ours() -> BoolArray:
        return detector.alarms(given, effects, strayed, factor)

    def other() -> BoolArray:
        return in_numpy(settings, given, effects, factor)

    if not np.array_equal(ours(), other()):
        raise AssertionError("the two do not agree")
    pairs = np.array([(taken(ours), taken(other)) for _ in range(ROUNDS)])
    compiled, numpy = np.median(pairs, axis=0)
    ratio = np.median(pairs[:, 1] / pairs[:, 0])
    return str(n_faults), str(n_sensors), f"{1e3 * compiled:.3g} ms", f"{1e3 * numpy:.3g} ms", f"{ratio:.0f}"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("How fast the detector is put on trial.", argv)
    publish("speed.realisations", chosen, note(), (HEADER, [measured(*case) for case in CASES]))


if __name__ == "__main__":
    main()
