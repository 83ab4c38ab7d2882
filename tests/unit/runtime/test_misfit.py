"""How well each lane explains the data: the detector's sums, lane by lane."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.alarm import accumulated
from faultbond.runtime.misfit import Misfit, add_misfit, begin_again, no_misfit
from faultbond.runtime.packing import trusted
from faultbond.runtime.state import init
from faultbond.simulate import Fault
from made import changed, plant, recorded, run

SPEC = plant("dc_motor_current")[1]
N_Y = len(SPEC.outputs)


def packed(spec: EngineSpec, use: list[float], scale: list[float]) -> FloatArray:
    """A packed sample of which only use and scale count."""
    sample = np.zeros(spec.n_sample)
    sample[spec.sample_fields["use"]], sample[spec.sample_fields["scale"]] = use, scale
    return sample


def test_sums_of_the_healthy_lane_are_those_of_the_detector() -> None:
    """Given the same innovations, missing and blanked values among them, both sums and their begins are the same."""
    generator, state = np.random.default_rng(5), changed(init(SPEC), begun=0)
    start = SPEC.thresholds.warm_up_samples
    misfit = no_misfit(SPEC, 3, start - 1)
    for index in range(start, start + 400):
        shift = 1.5 if index > start + 200 else 0.0
        found = np.concatenate([generator.normal(shift, 2.0, N_Y), generator.uniform(1.0, 6.0, N_Y)])
        blank = SPEC.thresholds.blank_factor
        use, scale = generator.random(N_Y) > 0.2, np.where(generator.random(N_Y) > 0.8, blank, 1.0)
        sample = packed(SPEC, [*use], [*scale])
        state = changed(state, index=index)
        state = replace(state, sensors=accumulated(SPEC, state, sample, found))
        other = generator.normal(size=2 * N_Y) ** 2
        misfit = add_misfit(SPEC, misfit, trusted(SPEC, sample), np.stack([other, found, 2.0 * other], axis=1), index)
        assert misfit.sums[:, :, 1] == pytest.approx(state.sensors.cusum, rel=1e-12, abs=1e-12)
        assert np.array_equal(misfit.since[:, :, 1], state.sensors.cusum_start)
    assert misfit.sums[0, :, 1].max() > SPEC.thresholds.cusum_limit
    assert np.any(misfit.since[:, :, 1] < start + 399)
    assert not np.array_equal(misfit.sums[:, :, 0], misfit.sums[:, :, 1])


def test_a_lane_without_numbers_misfits() -> None:
    """An innovation that is no number counts as one as large as an innovation can count."""
    settings = SPEC.thresholds
    lost = np.full((2 * N_Y, 1), np.nan)
    misfit = add_misfit(SPEC, no_misfit(SPEC, 1, 7), trusted(SPEC, packed(SPEC, [1.0, 1.0], [1.0, 1.0])), lost, 8)
    assert misfit.sums[0, :, 0] == pytest.approx(settings.cusum_clip - settings.cusum_drift)
    assert np.all(misfit.sums[1] == 0.0)
    assert misfit.since[:, :, 0].tolist() == [[7.0, 7.0], [8.0, 8.0]]


def test_a_wild_innovation_counts_so_far() -> None:
    """An innovation of any size adds to one side no more than the clip, and takes as much from the other."""
    settings = SPEC.thresholds
    before = Misfit(sums=np.full((2, N_Y, 1), 10.0), since=np.full((2, N_Y, 1), 3.0))
    wild = np.array([[1e6], [-1e6], [1.0], [1.0]])
    after = add_misfit(SPEC, before, trusted(SPEC, packed(SPEC, [1.0, 1.0], [1.0, 1.0])), wild, 9)
    up, down = 10.0 + settings.cusum_clip - settings.cusum_drift, 10.0 - settings.cusum_clip - settings.cusum_drift
    assert after.sums[:, :, 0] == pytest.approx(np.array([[up, down], [down, up]]))
    assert np.all(after.since == 3.0)


def test_lanes_begun_again_have_empty_sums() -> None:
    """Lanes that are begun again lose their sums, which run from that sample on; the others keep theirs."""
    generator = np.random.default_rng(0)
    before = Misfit(sums=generator.random((2, N_Y, 3)), since=np.full((2, N_Y, 3), 4.0))
    after = begin_again(before, np.array([False, True, False]), 30)
    assert np.all(after.sums[:, :, 1] == 0.0)
    assert np.all(after.since[:, :, 1] == 30.0)
    for kept in (0, 2):
        assert np.array_equal(after.sums[:, :, kept], before.sums[:, :, kept])
        assert np.all(after.since[:, :, kept] == 4.0)


def test_the_true_fault_leaves_nothing_unexplained() -> None:
    """After a change of a resistance the lane that leads has small sums, and that of another parameter has not."""
    _, spec, engine = plant("dc_motor_current")
    state, reports = run(spec, engine, recorded("dc_motor_current", 400, Fault(parameter="R", factor=2.0, start=2.4)))
    diagnosis = [report.diagnosis for report in reports if report.diagnosis][-1]
    assert diagnosis.candidates[0].parameters == ("R",)
    assert diagnosis.unexplained is None
    assert state.bank.misfit.sums.shape == (2, N_Y, state.bank.steps.shape[1] + state.bank.slots.shape[1])
    assert np.sum(state.bank.misfit.sums.max(axis=(0, 1)) > spec.thresholds.cusum_limit) > 10


def test_what_comes_and_goes_stays_contradicted() -> None:
    """A sum that has crossed the limit does not fall again in lanes that come and go; below the limit it does."""
    settings, wild = SPEC.thresholds, np.concatenate([np.full((N_Y, 3), 9.0), np.ones((N_Y, 3))])
    quiet = np.concatenate([np.zeros((N_Y, 3)), np.ones((N_Y, 3))])
    misfit, sample = no_misfit(SPEC, 3, 0), packed(SPEC, [1.0, 1.0], [1.0, 1.0])
    rows = int(settings.cusum_limit / (settings.cusum_clip - settings.cusum_drift)) + 2
    for index in range(rows):
        found = wild.copy()
        found[:N_Y, 2] *= float(index < 3)  # the last lane is contradicted for three samples only
        misfit = add_misfit(SPEC, misfit, trusted(SPEC, sample), found, index, switched=1)
    peak = misfit.sums[0, :, 1].copy()
    assert peak.min() > settings.cusum_limit
    for index in range(rows, rows + 400):
        misfit = add_misfit(SPEC, misfit, trusted(SPEC, sample), quiet, index, switched=1)
    assert np.all(misfit.sums[0, :, 0] == 0.0)
    assert np.array_equal(misfit.sums[0, :, 1], peak)
    assert np.all(misfit.sums[0, :, 2] == 0.0)
