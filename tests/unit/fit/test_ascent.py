"""The climb to the most probable values."""

import numpy as np
import pytest

from faultbond.fit.ascent import as_bent


def test_a_precision_bends_as_steps_have_seen() -> None:
    """Along the last step it is what that saw, it stays symmetric and positive, and n steps tell all of a parabola."""
    rng = np.random.default_rng(5)
    root, expected = rng.standard_normal((2, 4, 4))
    hill, precision = root @ root.T + np.eye(4), expected @ expected.T + np.eye(4)
    steps = list(np.linalg.eigh(hill)[1].T)  # which know nothing of each other
    seen = [(step, hill @ step) for step in steps]
    for count in range(1, 5):
        bent = as_bent(precision, seen[:count])
        assert bent == pytest.approx(bent.T)
        assert np.linalg.eigvalsh(bent).min() > 0.0
        assert bent @ steps[count - 1] == pytest.approx(hill @ steps[count - 1])
    assert bent == pytest.approx(hill)


def test_a_hill_that_bends_upwards_tells_nothing() -> None:
    """A step after which the slope has risen, or hardly fallen, leaves the precision as it was; so does no step."""
    precision, step = np.diag([1.0, 2.0]), np.array([1.0, 0.5])
    for fell in (-step, 1e-3 * step, np.zeros(2)):
        assert np.array_equal(as_bent(precision, [(step, fell)]), precision)
    assert np.array_equal(as_bent(precision, [(np.zeros(2), np.zeros(2))]), precision)
