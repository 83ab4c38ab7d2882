"""Posteriors of the core as it is shipped, against those of the same source with long double numbers."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from benchmarks.trust.precision import ASKED, compare

from faultbond.synthesis.compile import QUICK

pytestmark = [
    pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc"),
    pytest.mark.skipif(np.finfo(np.longdouble).eps >= np.finfo(float).eps, reason="long double is double"),
]


@pytest.mark.parametrize(("name", "n_samples"), [("three_tank", 700), ("dc_motor", 700)])
def test_rounding_does_not_move_posteriors(name: str, n_samples: int, tmp_path: Path) -> None:
    """Through start, alarm, renewals and a diagnosis no posterior of any hypothesis is off by more than 1e-9."""
    found = compare(name, n_samples, tmp_path, QUICK)
    assert len(found.sample) > 5
    assert found.exact.shape == found.shipped.shape
    assert np.allclose(found.exact.sum(axis=1), 1.0, atol=1e-12)
    assert found.largest < ASKED


def test_lost_digits_are_seen(tmp_path: Path) -> None:
    """A build whose constants have seven digits is told from one that rounds as it should."""
    assert compare("dc_motor", 700, tmp_path, QUICK, "-fsingle-precision-constant").largest > ASKED
