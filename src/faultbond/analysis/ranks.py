"""Ranks of sensitivities, and of the part of them that belongs to a set of parameters.

What the start can explain is taken away first, since the start is not known. Rows are scaled by output, columns to
unit length before that projection, so that rounding is of the order 1e-15 in all columns and exact zeros can be told
from small numbers.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.analysis.sensitivity import Sensitivity, still
from faultbond.arrays import BoolArray, FloatArray, IntArray

_SURELY_KEPT = 1e-7  # of the largest singular value
_KEPT = 1e-10  # rounding is never larger
_SURELY_DROPPED = 1e-12
_CLEAR = 1e3  # ratio of two neighbours between which a rank is told
_BORDER = 30.0  # a value nearer to the border than this factor is uncertain
_ROUNDING = 1e-16
BLOCK = 2**21  # numbers in one batch


@dataclass(frozen=True, slots=True, kw_only=True)
class Rank:
    """A numerical rank: the smallest singular value kept, the largest dropped (relative to the largest of all).

    clear: the two lie so far apart that the rank is certain; else singular values fall into rounding without a gap,
    `least` of them are surely not zero, and `value` is the number of columns.
    low, high: a singular value of some of the columns below `low` is zero, one above `high` is not; between: uncertain.
    """

    value: int
    least: int
    kept: float
    dropped: float
    clear: bool
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReducedSensitivities:
    """Sensitivities without what the start explains; arrays are read-only.

    columns: (n_rows, n_parameters); row_outputs: (n_rows,), the output that a row belongs to. The full columns have
    length 1 before the start is taken away, and `lengths` (n_parameters,) with the rows in `units` of the outputs.
    matrix: (rank, n_parameters), compressed: inner products of its columns are those of `columns`, or are in noises.
    steps: (n_parameters,), the change of each parameter that is meant, SI; relative: (n_parameters,), whether it is the
    parameter's own value.
    """

    outputs: tuple[str, ...]
    parameters: tuple[str, ...]
    steps: FloatArray
    relative: BoolArray
    columns: FloatArray
    row_outputs: IntArray
    lengths: FloatArray
    matrix: FloatArray
    rank: Rank


def reduce(runs: Sequence[Sensitivity], units: FloatArray | None = None) -> ReducedSensitivities:
    """Take away what the start, and unknown inputs, explain, and compress.

    Parameters
    ----------
    runs : at least one; all with the same parameters, each from a start of its own
    units : float array, shape (n_outputs,), SI; None, or 0 for an output, takes the largest sensitivity of the output
    """
    largest = np.max([np.abs(run.by_theta).max(axis=(0, 2), initial=0.0) for run in runs], axis=0)
    units = largest if units is None else np.where(units > 0, units, largest)
    units = np.where(units > 0, units, 1.0)
    full = [_rows(run.by_theta, units) for run in runs]
    lengths = np.linalg.norm(np.vstack(full), axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    parts = [_without(part / lengths, _rows(run.by_free, units)) for part, run in zip(full, runs, strict=True)]
    columns = np.vstack(parts)
    outputs = np.concatenate([np.tile(np.arange(len(units)), len(run.times)) for run in runs])
    values, right = np.zeros(0), np.zeros((0, columns.shape[1]))
    if columns.size:
        _, values, right = np.linalg.svd(np.linalg.qr(columns, mode="r"))
    rank = told_rank(values)
    n = min(rank.value, len(values))
    return ReducedSensitivities(
        outputs=runs[0].outputs,
        parameters=runs[0].parameters,
        steps=runs[0].steps,
        relative=runs[0].steps == runs[0].theta,
        columns=still(columns),
        row_outputs=outputs,
        lengths=still(lengths),
        matrix=still(values[:n, None] * right[:n]),
        rank=rank,
    )


def above_noise(reduced: ReducedSensitivities, sizes: FloatArray, least: float = 3.0) -> ReducedSensitivities:
    """Count as zero what noise hides: a singular value is the effect of changes of `sizes` in noises of the outputs.

    Parameters
    ----------
    reduced : with the noise of the outputs as their units
    sizes : float array, shape (n_parameters,); changes in units of `reduced.steps`
    least : noises, of the whole record, that an effect must have to be seen
    """
    scale = reduced.lengths * np.abs(sizes)
    values = np.linalg.svd(reduced.matrix * scale, compute_uv=False)
    seen = int(np.sum(values > least))
    top = float(values[0]) if len(values) and values[0] > 0 else 1.0
    kept, dropped = (float(values[seen - 1]) if seen else 0.0), (float(values[seen]) if seen < len(values) else 0.0)
    rank = Rank(value=seen, least=seen, kept=kept / top, dropped=dropped / top, clear=True, low=least, high=least)
    return replace(reduced, matrix=still(reduced.matrix * scale), rank=rank)


def _rows(array: FloatArray, units: FloatArray) -> FloatArray:
    return np.asarray((array / units[:, None]).reshape(array.shape[0] * array.shape[1], array.shape[2]))


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
    """Tell the rank from singular values (n,) in falling order: at the widest gap where rounding may be."""
    top = float(values[0]) if len(values) else 0.0
    if not top > 0.0:
        return Rank(value=0, least=0, kept=0.0, dropped=0.0, clear=True, low=_SURELY_KEPT, high=_SURELY_KEPT)
    parts = np.append(values / top, 0.0)
    lower, first, upper = (int(np.sum(parts > part)) for part in (_SURELY_KEPT, _KEPT, _SURELY_DROPPED))
    ratios = parts[first - 1 : upper] / np.maximum(parts[first : upper + 1], _ROUNDING)
    best = first + int(np.argmax(ratios))
    clear = lower == upper or float(ratios[best - first]) >= _CLEAR
    value = best if clear else lower
    kept, dropped = float(parts[value - 1]), float(parts[value])
    border = top * (float(np.sqrt(kept * max(dropped, _ROUNDING))) if clear else _SURELY_DROPPED * _BORDER)
    return Rank(
        value=value if clear else len(values),
        least=value,
        kept=kept,
        dropped=dropped,
        clear=clear,
        low=border / _BORDER,
        high=border * _BORDER,
    )


def set_ranks(reduced: ReducedSensitivities, sets: Sequence[tuple[int, ...]]) -> tuple[IntArray, BoolArray]:
    """Give the ranks (n_sets,) of the columns of sets of one size, and whether they are in doubt.

    Where it is in doubt, the rank is the largest that it may be.
    """
    if not sets:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=bool)
    values = np.concatenate([_singular_values(_orthogonal(part)[1]) for part in _blocks(reduced, sets)])
    rank = reduced.rank
    return np.sum(values > rank.low, axis=1), np.any((values > rank.low) & (values <= rank.high), axis=1)


def bases(reduced: ReducedSensitivities, sets: Sequence[tuple[int, ...]]) -> FloatArray:
    """Give an orthonormal basis of the span of each set, shape (n_sets, rank, size); the sets are identifiable."""
    found = []
    for part in _blocks(reduced, sets):
        lengths = np.linalg.norm(part, axis=1, keepdims=True)
        found.append(_orthogonal(part / np.where(lengths > 0, lengths, 1.0))[0])
    return np.concatenate(found)


def _orthogonal(part: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Give Q and R of many small matrices, shape (n, rank, size), at once; a column of Q is zero where nothing is left.

    Gram-Schmidt, twice for each column, which is enough: what the second time shortens by half is rounding.
    Source: Parlett, The Symmetric Eigenvalue Problem (1980), 6.9.
    """
    n, _, size = part.shape
    q, r = np.zeros_like(part), np.zeros((n, size, size))
    for k in range(size):
        column = part[:, :, k].copy()
        before = length = np.linalg.norm(column, axis=1)
        for _ in range(2 if k else 0):
            share = np.einsum("nij,ni->nj", q[:, :, :k], column)
            column -= np.einsum("nij,nj->ni", q[:, :, :k], share)
            r[:, :k, k] += share
            before, length = length, np.linalg.norm(column, axis=1)
        r[:, k, k] = length
        left = length > 0.5 * before
        q[:, :, k] = np.where(left, 1.0, 0.0)[:, None] * column / np.where(left, length, 1.0)[:, None]
    return q, r


def _singular_values(r: FloatArray) -> FloatArray:
    """Give the singular values of triangular matrices, shape (n, size, size), in falling order."""
    size = r.shape[1]
    if size == 1:
        return r[:, :, 0]
    if size > 2:
        return np.asarray(np.linalg.svd(r, compute_uv=False))
    first, off, last = r[:, 0, 0], r[:, 0, 1], r[:, 1, 1]
    largest = 0.5 * (np.hypot(first + last, off) + np.hypot(first - last, off))
    return np.stack([largest, first * last / np.where(largest > 0, largest, 1.0)], axis=1)


def _blocks(reduced: ReducedSensitivities, sets: Sequence[tuple[int, ...]]) -> Iterator[FloatArray]:
    """Give the columns of the sets, shape (n, rank, size), some sets at a time."""
    height, size = reduced.matrix.shape[0], len(sets[0])
    step = max(1, BLOCK // max(1, height * size))
    for first in range(0, len(sets), step):
        yield reduced.matrix[:, np.array(sets[first : first + step])].transpose(1, 0, 2)
