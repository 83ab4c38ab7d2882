"""Posteriors of the core as it is shipped, against those of the same source with long double numbers."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from benchmarks.trust.precision import ASKED, compare, posteriors

from faultbond.synthesis.compile import FLAGS, QUICK

pytestmark = [
    pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc"),
    pytest.mark.skipif(bool(np.finfo(np.longdouble).eps >= np.finfo(float).eps), reason="long double is double"),
]


def test_rounding_does_not_move_posteriors(tmp_path: Path) -> None:
    """No posterior is off by more than 1e-9, from the start to a diagnosis; with constants of 7 digits some are."""
    found = compare("dc_motor", 620, tmp_path, *QUICK)
    assert len(found.sample) > 5
    assert np.allclose(found.exact.sum(axis=1), 1.0, atol=1e-12)
    assert found.largest < ASKED
    lost = posteriors(tmp_path, (*FLAGS, *QUICK, "-fsingle-precision-constant"), found.exact.shape[1])
    assert np.abs(lost[: len(found.sample), 1:] - found.exact).max() > ASKED
