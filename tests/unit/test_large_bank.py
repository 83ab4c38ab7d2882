"""How late samples are worked on when some take longer than the time between them."""

import numpy as np
import pytest
from benchmarks.speed.large_bank import waits


def test_samples_wait_for_the_work_before_them() -> None:
    """One slow sample makes those behind it late, ever less, until the work has caught up."""
    taken = np.array([0.02, 0.35, 0.02, 0.02, 0.02, 0.02, 0.02])
    assert waits(taken, 0.1) == pytest.approx([0.02, 0.35, 0.27, 0.19, 0.11, 0.03, 0.02])


def test_work_that_never_catches_up() -> None:
    """Where each sample takes longer than the time between two, the delay grows without end."""
    late = waits(np.full(50, 0.15), 0.1)
    assert late == pytest.approx(0.15 + 0.05 * np.arange(50))
