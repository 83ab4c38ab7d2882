"""The compiled detector with many realisations of noise: the same alarms as by its sums in numpy, sample by sample."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.analysis.realisations import Realisations
from faultbond.app.realisations import compiled_detector
from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import Thresholds
from faultbond.fit.cusum import added, height_of, no_sums

W, C, N, J, S, M = 60, 3, 2, 2, 1, 21  # samples, faults, onsets, sensors, slow errors, realisations
PROMISED = replace(Thresholds(), fast_limit=12.0, cusum_limit=40.0)


def realisations(seed: int) -> Realisations:
    """Noise, sums that have begun in some realisations, and samples that do not count, or are blanked."""
    draws = np.random.default_rng(seed)
    begun = np.zeros((N, J, 12, M))
    begun[:, :, :4] = draws.uniform(0.0, 5.0, (N, J, 4, M))
    begun[:, :, 8:] = np.where(draws.random((N, J, 4, M)) < 0.5, np.nan, draws.standard_normal((N, J, 4, M)))
    return Realisations(
        noise=draws.standard_normal((W, N, J, M)),
        slow=draws.standard_normal((W, N, S, M)),
        limits=np.array([4.0]),
        begun=begun,
        counted=draws.random((W, N, J)) < 0.9,
        blanked=draws.random((W, N, J)) < 0.1,
    )


def alarms_by_hand(
    settings: Thresholds, given: Realisations, effects: FloatArray, strayed: FloatArray, factor: FloatArray
) -> BoolArray:
    """The same by the sums in numpy, of one fault and onset after the other."""
    found = np.zeros((C, N, M), dtype=bool)
    for c, o in np.ndindex(C, N):
        start = given.begun[o].transpose(1, 0, 2)
        sums = replace(no_sums(J, M), slow=start[:2], fast=start[2:4], scatter=start[4:8], before=start[8:])
        found[c, o] = (height_of(settings, sums) > settings.cusum_limit).any(axis=0)
        for w in range(W):
            score = factor[c, o] * effects[w, c, o][:, None] + given.noise[w, o]
            sums = added(settings, sums, score, given.counted[w, o][:, None], given.blanked[w, o][:, None])
            found[c, o] |= (height_of(settings, sums) > settings.cusum_limit).any(axis=0)
            ratio = factor[c, o] * strayed[w, c, o][:, None] + given.slow[w, o]
            found[c, o] |= (np.abs(ratio) > given.limits[:, None]).any(axis=0)
    return found


@pytest.mark.parametrize("settings", [Thresholds(), PROMISED])
@pytest.mark.parametrize("shape", ["step", "burst", "slow", "wild"])
def test_alarms_are_those_of_the_sums_in_numpy(shape: str, settings: Thresholds) -> None:
    """Of shifts, scatter, slow errors, and effects that are no numbers; some realisations alarm, some do not."""
    detector, draws = compiled_detector(settings), np.random.default_rng(3)
    effects, strayed = np.full((W, C, N, J), 0.4), np.zeros((W, C, N, S))
    if shape == "burst":
        effects = draws.choice([-3.0, 3.0], effects.shape)
    if shape == "slow":
        effects, strayed = 0.0 * effects, np.full((W, C, N, S), 1.0)
    if shape == "wild":
        effects[draws.random(effects.shape) < 0.2] = np.nan
    for seed in range(5):
        given, factor = realisations(seed), np.exp(draws.uniform(-1.5, 1.5, (C, N, M)))
        found = detector.alarms(given, effects, strayed, factor)
        assert np.array_equal(found, alarms_by_hand(settings, given, effects, strayed, factor))
        assert 0.02 < found.mean() < 0.98
