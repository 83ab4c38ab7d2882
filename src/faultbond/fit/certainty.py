"""How sure the estimates are: standard errors that hold although residuals are not white, and what data do not tell.

The inverse of information and prior is the covariance if the model is right. If it is not, scores of samples near each
other are alike, and the covariance is that of the sandwich, with the long-run variance of the scores between the two
inverses. The larger of the two holds.

Source: White, Econometrica 50 (1982) 1 (sandwich); Newey and West, Econometrica 55 (1987) 703 (long-run variance);
Andrews, Econometrica 59 (1991) 817 (its bandwidth).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.fit.objective import Scored

UNSURE = 1.0 / 3.0  # of a parameter (of `change` where it is about 0); one known less well is not determined
IGNORANT = 1e3  # accuracies; as wide is the prior with which the data are asked alone
INVOLVED = 0.05  # of the largest part in a combination
LINKED = 0.15  # of the largest part; a smaller one does not tie a parameter to the others
SHOWN = 0.1  # the largest change in a combination
ALIKE = 1e-6  # part by which sizes of changes may differ by rounding
PARTNER, SEVERAL = 0.3, 3  # of the largest part; parameters that only a scale in common moves together
MOST_BANDWIDTH = 0.2  # of a recording


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Certainty:
    """Of the unknowns without the starts, in their own units (logarithms, factors).

    covariance (n, n): with the prior; inflation (n,): standard errors by the sandwich in those of a right model, at
    least 1; alone (n,): sd from the data alone, inflated; silent: combinations of parameters that do not show, rows;
    faint (n_combinations, n_theta): those of several parameters that the data fix, but less well than is declared,
    in accuracies, of length 1, times their sd from the data alone.
    """

    covariance: FloatArray
    inflation: FloatArray
    alone: FloatArray
    silent: FloatArray
    faint: FloatArray

    @property
    def sd(self) -> FloatArray:
        """Standard errors, (n,)."""
        return np.asarray(np.sqrt(np.diag(self.covariance)) * self.inflation)

    @property
    def determined(self) -> BoolArray:
        """Whether the data alone fix an unknown, (n,)."""
        return np.asarray(self.alone <= UNSURE)


def certainty_of(
    information: FloatArray, prior: FloatArray, courses: Sequence[Scored], n: int, n_theta: int, accuracies: FloatArray
) -> Certainty:
    """Give how sure the unknowns are.

    Parameters
    ----------
    information : (m, m), of all unknowns and starts
    prior : (m,), sd before the data
    courses : of each recording, with its scores
    n, n_theta : number of unknowns without the starts, and of parameters
    accuracies : (n_theta,), declared accuracies in units of the unknowns
    """
    inverse = inverse_of(information + np.diag(prior**-2.0))
    meat, first = np.diag(prior**-2.0), n
    for item in courses:  # the long-run variance of the summed scores
        last = first + item.scores.shape[1] - n
        places = [*range(n), *range(first, last)]
        meat[np.ix_(places, places)] += long_run_variance(item.scores)
        first = last
    sandwich = inverse @ meat @ inverse
    plain = np.maximum(np.diag(inverse), 1e-300)
    inflation = np.sqrt(np.maximum(np.diag(sandwich) / plain, 1.0))[:n]
    wide = np.concatenate([IGNORANT * accuracies, prior[n_theta:]])
    data = inverse_of(information + np.diag(wide**-2.0))
    alone = np.sqrt(np.maximum(np.diag(data), 0.0))[:n] * inflation
    return Certainty(
        covariance=inverse[:n, :n],
        inflation=inflation,
        alone=alone,
        silent=_silent(data[:n_theta, :n_theta]),
        faint=_faint(data[:n_theta, :n_theta] * np.outer(inflation, inflation)[:n_theta, :n_theta], accuracies),
    )


def inverse_of(matrix: FloatArray) -> FloatArray:
    """Invert a positive matrix (n, n) whose entries differ by many orders of magnitude; gives (n, n).

    Of one that is not finite, as where a plant has no course, it is not either.
    """
    if not np.all(np.isfinite(matrix)):
        return np.full_like(matrix, np.nan)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scaled = matrix * np.outer(scale, scale)
    return np.asarray(np.linalg.pinv(scaled, rcond=1e-14, hermitian=True) * np.outer(scale, scale))


def long_run_variance(scores: FloatArray, most: float = MOST_BANDWIDTH) -> FloatArray:
    """Give the variance of the sum of scores (N, m), (m, m), by Bartlett's weights with Andrews' bandwidth.

    Parameters
    ----------
    scores : float array, shape (N, m)
    most : largest bandwidth, in parts of N
    """
    count, m = scores.shape
    centred = scores - scores.mean(axis=0)
    width = 0  # lags that count: from the correlation of each score at lag 1, as of a process of first order
    if count >= 4:
        power = np.sum(centred**2, axis=0)
        root = np.clip(np.sum(centred[1:] * centred[:-1], axis=0) / np.where(power > 0.0, power, 1.0), -0.97, 0.97)
        alpha = float(np.max(4.0 * root**2 / (1.0 - root**2) ** 2, initial=0.0))
        width = int(min(np.ceil(1.1447 * (alpha * count) ** (1.0 / 3.0)), min(MOST_BANDWIDTH, most) * count))
    scale = np.maximum(np.sqrt(np.mean(centred**2, axis=0)), 1e-300)
    unit = centred / scale
    found = unit.T @ unit
    for lag in range(1, width + 1):
        cross = unit[lag:].T @ unit[:-lag]
        found += (1.0 - lag / (width + 1.0)) * (cross + cross.T)
    return np.asarray(found * np.outer(scale, scale)) if m else np.zeros((0, 0))


def together(information: FloatArray, prior: FloatArray, n_theta: int) -> BoolArray:
    """Give which parameters the data cannot tell apart, (n_theta, n_theta), each with itself.

    A scale that several have in common ties none of them: where some are off beside the others, the fewest are.

    Parameters
    ----------
    information : (m, m), of all unknowns and starts, parameters first
    prior : (n,), sd before the data of unknowns without the starts, wide
    n_theta : number of parameters
    """
    weight = np.zeros(len(information))
    weight[: len(prior)] = prior**-2.0
    covariance = inverse_of(information + np.diag(weight))[:n_theta, :n_theta]
    silent = np.abs(_silent(covariance))
    rows = silent[np.sum(silent > PARTNER * SHOWN, axis=1) < SEVERAL] > LINKED * SHOWN
    linked: BoolArray = np.eye(n_theta, dtype=bool)
    for row in rows:
        linked |= np.outer(row, row)
    for _ in range(n_theta):
        linked = linked @ linked
    return linked


def _silent(covariance: FloatArray) -> FloatArray:
    """Give combinations of parameters that the data do not fix, each with a parameter that no other has, rows.

    Scaled so that the largest part is `SHOWN`.
    """
    if not len(covariance):
        return np.zeros((0, 0))
    values, vectors = np.linalg.eigh(covariance)
    rows = vectors[:, np.sqrt(np.maximum(values, 0.0)) > UNSURE].T
    rows = _echelon(rows)
    size = np.max(np.abs(rows), axis=1, initial=0.0, keepdims=True)
    rows = SHOWN * rows / np.where(size > 0.0, size, 1.0)
    return np.asarray(np.where(np.abs(rows) >= INVOLVED * SHOWN, rows, 0.0))


def _faint(covariance: FloatArray, accuracies: FloatArray) -> FloatArray:
    """Give combinations of at least `SEVERAL` parameters that the data fix less well than declared, rows."""
    if not len(covariance):
        return np.zeros((0, 0))
    values, vectors = np.linalg.eigh(covariance / np.outer(accuracies, accuracies))
    rows = vectors.T * np.sqrt(np.maximum(values, 0.0))[:, None]
    size = np.max(np.abs(rows), axis=1, keepdims=True)
    several = np.sum(np.abs(rows) > PARTNER * size, axis=1) >= SEVERAL
    fixed = np.max(np.abs(rows) * accuracies, axis=1) <= UNSURE
    return np.asarray(rows[(values > 1.0) & several & fixed])


def _echelon(rows: FloatArray) -> FloatArray:
    """Give other vectors of the same space, each with a column of its own; pivots are the largest entries left.

    Of entries that are as large but for rounding it is the first, so that a combination is told with the same sign.
    """
    rows, used = rows.copy(), list[int]()
    for k in range(len(rows)):
        size = np.abs(rows[k:])
        size[:, used] = 0.0
        place = np.unravel_index(int(np.argmax(size >= (1.0 - ALIKE) * size.max())), size.shape)
        pick, column = k + int(place[0]), int(place[1])
        rows[[k, pick]] = rows[[pick, k]]
        rows[k] /= rows[k, column]
        for other in range(len(rows)):
            if other != k:
                rows[other] -= rows[other, column] * rows[k]
        used.append(column)
    return rows
