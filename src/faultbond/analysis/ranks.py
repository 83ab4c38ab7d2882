"""Ranks of sensitivities, and of the part of them that belongs to a set of parameters.

What the start can explain is taken away first, since the start is not known. Rows are scaled by output, columns to
unit length before that projection, so that rounding is of the order 1e-15 in all columns and exact zeros can be told
from small numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.analysis.sensitivity import Sensitivity
from faultbond.types import BoolArray, FloatArray

_SURELY_KEPT = 1e-7  # of the largest singular value
_SURELY_DROPPED = 1e-12
_CLEAR = 1e3  # ratio of two neighbours between which a rank is told
_BORDER = 30.0  # a value nearer to the border than this factor is uncertain
_ROUNDING = 1e-16
_BLOCK = 4096  # sets in one batch


@dataclass(frozen=True, slots=True, kw_only=True)
class Rank:
    """A numerical rank: the smallest singular value kept, the largest dropped (relative to the largest of all).

    clear: the two lie so far apart that the rank is certain; else `value` is the largest that it may be and `least`
    the smallest. border: a singular value above it counts.
    """

    value: int
    least: int
    kept: float
    dropped: float
    clear: bool
    border: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reduced:
    """Sensitivities without what the start explains, compressed.

    matrix: (rank, n_parameters), read-only; inner products of its columns are those of the full columns.
    lengths: (n_parameters,), length of the full columns with rows divided by `units` of the outputs.
    """

    parameters: tuple[str, ...]
    matrix: FloatArray
    lengths: FloatArray
    rank: Rank


def reduce(sensitivity: Sensitivity, units: FloatArray | None = None) -> Reduced:
    """Take away what the start explains, and compress.

    Parameters
    ----------
    sensitivity : one run
    units : float array, shape (n_outputs,), SI; None takes the largest sensitivity of each output
    """
    return reduce_runs([sensitivity], units)


def reduce_runs(runs: Sequence[Sensitivity], units: FloatArray | None = None) -> Reduced:
    """Do the same for several runs with the same parameters, each from a start of its own.

    Parameters
    ----------
    runs : at least one
    units : float array, shape (n_outputs,), SI; None takes the largest sensitivity of each output
    """
    if units is None:
        units = np.max([np.abs(run.by_theta).max(axis=(0, 2), initial=0.0) for run in runs], axis=0)
        units = np.where(units > 0, units, 1.0)
    parts, lengths = [], np.zeros(len(runs[0].parameters))
    for run in runs:
        columns = _rows(run.by_theta, units)
        lengths = np.hypot(lengths, np.linalg.norm(columns, axis=0))
        parts.append(_without(columns, _rows(run.by_start, units)))
    lengths = np.where(lengths > 0, lengths, 1.0)
    full = np.vstack(parts) / lengths
    _, values, right = np.linalg.svd(np.linalg.qr(full, mode="r"))
    rank = told_rank(values)
    matrix = values[: rank.value, None] * right[: rank.value]
    matrix.setflags(write=False)
    lengths.setflags(write=False)
    return Reduced(parameters=runs[0].parameters, matrix=matrix, lengths=lengths, rank=rank)


def _rows(array: FloatArray, units: FloatArray) -> FloatArray:
    return np.asarray((array / units[:, None]).reshape(-1, array.shape[2]))


def _without(columns: FloatArray, start: FloatArray) -> FloatArray:
    """Take away the part of the columns in the span of `start`; twice, for rounding."""
    lengths = np.linalg.norm(start, axis=0)
    start = start[:, lengths > 0] / lengths[lengths > 0]
    if not start.size:
        return columns
    base = np.linalg.svd(start, full_matrices=False)[0]
    for _ in range(2):
        columns = columns - base @ (base.T @ columns)
    return columns


def told_rank(values: FloatArray) -> Rank:
    """Tell the rank from singular values in falling order: at the widest gap in the range where rounding may be."""
    top = float(values[0]) if len(values) else 0.0
    if not top > 0.0:
        return Rank(value=0, least=0, kept=0.0, dropped=0.0, clear=True, border=_SURELY_KEPT)
    parts = np.append(values / top, 0.0)
    lower, upper = int(np.sum(parts > _SURELY_KEPT)), int(np.sum(parts > _SURELY_DROPPED))
    ratios = parts[lower - 1 : upper] / np.maximum(parts[lower : upper + 1], _ROUNDING)
    best = int(np.argmax(ratios))
    clear = lower == upper or float(ratios[best]) >= _CLEAR
    value = lower + best if clear else upper
    kept, dropped = float(parts[value - 1]), float(parts[value])
    border = float(np.sqrt(kept * max(dropped, _ROUNDING)))
    least = value if clear else lower
    return Rank(value=value, least=least, kept=kept, dropped=dropped, clear=clear, border=top * border)


def smallest_values(reduced: Reduced, sets: Sequence[tuple[int, ...]]) -> FloatArray:
    """Give the smallest singular value of the columns of each set, shape (n_sets,); the sets have one size."""
    size = len(sets[0]) if sets else 0
    if not sets or size > reduced.matrix.shape[0]:
        return np.zeros(len(sets))
    found = []
    for first in range(0, len(sets), _BLOCK):
        columns = reduced.matrix[:, np.array(sets[first : first + _BLOCK])]  # (rank, n_sets, size)
        found.append(np.linalg.svd(columns.transpose(1, 0, 2), compute_uv=False)[:, -1])
    return np.concatenate(found)


def near_border(reduced: Reduced, values: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Give where a value may count, and where that is not certain."""
    border = reduced.rank.border
    return values > border / _BORDER, (values > border / _BORDER) & (values < border * _BORDER)
