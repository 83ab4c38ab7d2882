"""The parabola prefilter of method `classic`."""

import numpy as np
import pytest

from faultbond.thesis.online.prefilter import filtered, parabola_weights


@pytest.mark.parametrize(("points", "centre"), [(17, 8), (16, 8), (5, 0), (9, 8), (3, 1)])
def test_a_parabola_passes_unchanged(points: int, centre: int) -> None:
    """Samples of a parabola are given back, wherever the sample stands in its window."""
    place = np.arange(points) - centre
    window = 2.0 - 3.0 * place + 0.25 * place**2
    assert filtered(window.astype(float), centre, 1.0) == pytest.approx(2.0, abs=1e-12)


def test_seventeen_points_leave_a_third_of_the_noise() -> None:
    """The weights of 17 points have the norm that the closed formula for a quadratic smoother gives."""
    m = 8
    centre_weight = 3.0 * (3 * m**2 + 3 * m - 1) / ((2 * m - 1) * (2 * m + 1) * (2 * m + 3))
    weights = parabola_weights(17, 8)
    assert weights[8] == pytest.approx(centre_weight, rel=1e-12)
    assert np.sqrt(weights @ weights) == pytest.approx(np.sqrt(centre_weight), rel=1e-12)  # of a projection


def test_one_point_is_itself() -> None:
    """A window of one sample filters nothing."""
    assert filtered(np.array([3.5]), 0, 0.0) == 3.5


def test_a_sample_outside_the_band_counts_itself() -> None:
    """Just inside the band the parabola is taken, just outside the sample."""
    window = np.zeros(17)
    window[8] = 1.0
    fit = float(parabola_weights(17, 8)[8])
    assert filtered(window, 8, 1.0 - fit + 1e-9) == pytest.approx(fit)
    assert filtered(window, 8, 1.0 - fit - 1e-9) == 1.0
    raised = window + 10.0
    assert filtered(raised, 8, 0.1, relative=True) == pytest.approx(10.0 + fit)
    assert filtered(raised, 8, 0.05, relative=True) == 11.0


def test_missing_samples_are_bridged() -> None:
    """With half of the window there the parabola gives a missing sample too; with less it stays missing."""
    place = np.arange(9) - 4.0
    window = 1.0 + place - 0.5 * place**2
    window[[1, 4, 7]] = np.nan
    assert filtered(window, 4, 1.0) == pytest.approx(1.0, abs=1e-12)
    window[[0, 2]] = np.nan
    assert np.isnan(filtered(window, 4, 1.0))
    window[4] = 7.0
    window[3] = np.nan
    assert filtered(window, 4, 1.0) == 7.0
