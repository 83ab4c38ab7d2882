"""What further unknowns would gain once everything else follows them, from one evaluation where they are zero.

Near a summit the hill is a parabola: of its slope along what is new, what all else would take by moving is no gain, and
of its curvature neither. With everything else as it stands a step as small as a hundredth may only lose, where a climb
gains thousands of nats: an efficiency that is largest somewhere between has made others stand for that.

Source: Rao, Proc. Cambridge Philosophical Society 44 (1948) 50, with nuisance parameters as in Cox and Hinkley,
Theoretical Statistics, 1974, section 9.3.
"""

from collections.abc import Sequence

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.fit.certainty import inverse_of
from faultbond.fit.objective import Evaluation

LEAST_PART = 1e-6  # of what is known of an unknown that is left where all else follows; less is nothing


def score_gains(found: Evaluation, prior: FloatArray, moves: BoolArray, groups: Sequence[Sequence[int]]) -> list[float]:
    """Give for each group of new unknowns what it would gain, nats.

    Parameters
    ----------
    found : where all that is new is zero
    prior : float array, shape (m,), precision of each unknown before the data
    moves : bool array, shape (m,), which of them would follow
    groups : places of what is new
    """
    precision = found.information + np.diag(prior)
    known = inverse_of(precision[np.ix_(moves, moves)])
    return [_group_gain(found.score, precision, known, moves, group) for group in groups]


def _group_gain(
    score: FloatArray, precision: FloatArray, known: FloatArray, moves: BoolArray, group: Sequence[int]
) -> float:
    new = np.asarray(group)
    across, alone = precision[np.ix_(new, moves)], precision[np.ix_(new, new)]
    left = alone - across @ known @ across.T
    if not np.all(np.isfinite(left)) or np.any(np.diag(left) <= LEAST_PART * np.diag(alone)):
        return 0.0
    slope = score[new] - across @ known @ score[moves]
    return 0.5 * float(slope @ inverse_of(left) @ slope)
