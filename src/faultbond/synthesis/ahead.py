"""How far apart the moments are at which candidates are predicted under a move of an input, for advice."""

import numpy as np

from faultbond.equations.step import StepModel
from faultbond.synthesis.specify import at_reference

AHEAD = 300  # samples that are predicted
LONGEST = 10  # samples between two moments
PART = 0.25  # of the time of a mode, at most, that is still there; so a step in time is as exact as any
GONE = 0.01  # part of a mode that is left when it counts as gone


def ahead_lengths(model: StepModel) -> tuple[int, ...]:
    """Give how many samples lie before each moment, `AHEAD` in all: few at first, more as fast modes die away.

    What swings without end stays as fine as samples are, or finer than a quarter of its time.
    """
    n_x, grid = len(model.states), model.plant.graph.sample_time or 1.0
    slopes = model.rates(*at_reference(model))[1].full()[:, :n_x]
    if not np.isfinite(slopes).all():
        return (1,) * AHEAD
    modes = np.linalg.eigvals(slopes) * grid if n_x else np.zeros(0)
    lengths, passed, length = list[int](), 0, 1
    while passed < AHEAD:
        left = modes[np.exp(np.minimum(modes.real * passed, 0.0)) > GONE]
        fastest = float(np.max(np.abs(left), initial=0.0))
        while length < LONGEST and fastest * (length + 1) <= PART:
            length += 1
        lengths.append(min(length, AHEAD - passed))
        passed += lengths[-1]
    return tuple(lengths)
