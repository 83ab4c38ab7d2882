"""Which parameters a fit asks whether they wander."""

from importlib import import_module
from math import nan
from typing import Any

import pytest

from faultbond.fit.imperfections import Imperfection
from made import graph_of

wander = import_module("faultbond.fit.wander")  # by its name, since `fit` is a function in the package


@pytest.mark.parametrize("gain", [nan, 0.0])
def test_what_gains_nothing_that_is_a_number_does_not_wander(gain: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a plant has no finite course with the values of a fit, no step from there has a gain."""

    class Ground:
        """Where every climb ends where it began."""

        chosen = ()
        smallest = None

        def __init__(self, *_: Any) -> None:
            self.asked = 0

        def likeliest(self, left: list[Imperfection]) -> Imperfection:
            """Give the first."""
            return left[0]

        def climb(self, _: Imperfection) -> float:
            """Gain what is asked for, once."""
            self.asked += 1
            assert self.asked == 1
            return gain

    monkeypatch.setattr(wander, "_Ground", Ground)
    monkeypatch.setattr(wander, "unsteady_of", lambda _: ["R", "C"])
    assert wander.wanders_of(graph_of("rc"), None, None, lambda _: None) == ()
