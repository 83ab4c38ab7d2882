"""Linear equations of SX graphs, solved by Gaussian elimination that skips structural zeros.

The pivot is the first entry of a column that is not structurally zero; the matrices met here (I - h J, slopes of
passive loops) need no more.
"""

from dataclasses import dataclass

import casadi as ca

SparseRow = dict[int, ca.SX]  # entries that are not structurally zero, by column


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Triangle:
    """A matrix brought to triangular form: what was done to its rows, in order, and what they became.

    moves: (place, source, factor); `factor` times the source row was taken off, or without a factor both were swapped.
    """

    moves: tuple[tuple[int, int, ca.SX | None], ...]
    rows: tuple[SparseRow, ...]


def eliminate(matrix: ca.SX, right: ca.SX) -> ca.SX:
    """Solve matrix @ solution = right. Shapes (n, n), (n, m) -> (n, m)."""
    return back(triangle(matrix), right)


def triangle(matrix: ca.SX) -> Triangle:
    """Bring a matrix (n, n) to triangular form."""
    n = matrix.shape[0]
    rows = [_entries(row) for row in _rows(matrix)]
    moves: list[tuple[int, int, ca.SX | None]] = []
    for k in range(n):
        pivot = next((i for i in range(k, n) if k in rows[i]), k)
        if pivot != k:
            rows[k], rows[pivot] = rows[pivot], rows[k]
            moves.append((k, pivot, None))
        for i in range(k + 1, n):
            if k in rows[i]:
                factor = rows[i][k] / rows[k][k]
                rows[i] = _less(rows[i], factor, rows[k], k)
                moves.append((i, k, factor))
    return Triangle(moves=tuple(moves), rows=tuple(rows))


def back(found: Triangle, right: ca.SX) -> ca.SX:
    """Solve for a right side, shape (n, m), whole rows at a time."""
    n, m = right.shape
    rows = _rows(right)
    for place, source, factor in found.moves:
        if factor is None:
            rows[place], rows[source] = rows[source], rows[place]
        else:
            rows[place] = rows[place] - factor * rows[source]
    for k in reversed(range(n)):
        total = rows[k]
        for j, entry in sorted(found.rows[k].items()):
            if j > k:
                total = total - entry * rows[j]
        rows[k] = ca.sparsify(total) / found.rows[k].get(k, ca.SX(0))
    return ca.vertcat(*rows) if n else ca.SX(0, m)


def _rows(matrix: ca.SX) -> list[ca.SX]:
    return list(ca.vertsplit(ca.sparsify(matrix))) if matrix.shape[0] else []


def _entries(row: ca.SX) -> SparseRow:
    return {j: row.nz[k] for k, j in enumerate(row.sparsity().get_col())}


def _less(row: SparseRow, factor: ca.SX, source: SparseRow, done: int) -> SparseRow:
    """Take a multiple of another row off, to the right of a column that becomes zero."""
    found = {j: entry for j, entry in row.items() if j > done}
    for j, entry in source.items():
        if j > done:
            found[j] = found.get(j, ca.SX(0)) - factor * entry
    return {j: entry for j, entry in found.items() if not entry.is_zero()}
