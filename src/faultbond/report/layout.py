"""Places of nodes on a grid, so that a bond graph is drawn without overlaps; deterministic.

Two stages: stress majorisation spreads the nodes by their distance in the graph, then every node gets a grid cell of
its own and moves from cell to cell while that makes the drawing better: short bonds along rows and columns, no
crossing, no bond over a node. Source: Gansner, Koren, North, Graph drawing by stress majorization, GD 2004 (stage 1);
stage 2 is ours.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, shortest_path

from faultbond.arrays import BoolArray, FloatArray

Cells = NDArray[np.int64]

STRESS_ROUNDS = 300
PASSES = 12  # over all nodes, at most
REACH = 2  # cells around a neighbour that are tried
CROSSING = 12.0
COVERED = 40.0  # a bond runs over a node
BACKWARDS = 0.15  # power that flows to the left, per cell
COMPACT = 0.02  # per squared distance from the centre
LONGEST_ROW = 11.0  # bonds; longer plants are folded
THIN = 3.0  # bonds beside the longest path
SLANT = 1.0  # on top of the squared length
DISTANCE_APART = 3.0  # of nodes that are not connected


def place(nodes: Sequence[str], bonds: Iterable[tuple[str, str]]) -> dict[str, tuple[int, int]]:
    """Give each node a grid cell (column, row) of its own; the first column and row are 0.

    Parameters
    ----------
    nodes : names, each once
    bonds : pairs of names, (tail, head)
    """
    index = {name: k for k, name in enumerate(nodes)}
    edges = np.array([(index[a], index[b]) for a, b in bonds], dtype=np.int64).reshape(-1, 2)
    if not nodes:
        return {}
    apart = np.asarray(shortest_path(_adjacency(len(nodes), edges), directed=False, unweighted=True))
    known = apart[np.isfinite(apart)]
    apart = np.where(np.isfinite(apart), apart, known.max() + DISTANCE_APART)
    spread = _furrow(apart)
    if spread is None:
        spread = _turned(_stress_positions(apart), edges)
    cells = _rearranged(_snapped(spread, edges), edges)
    columns, rows = (np.unique(cells[:, axis], return_inverse=True)[1] for axis in (0, 1))  # none of them empty
    return {name: (int(columns[k]), int(rows[k])) for name, k in index.items()}


def _adjacency(size: int, edges: Cells) -> csr_array:
    """Give the graph as a matrix, shape (size, size), from edges (n_bonds, 2)."""
    return csr_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(size, size))


def _stress_positions(ideal: FloatArray) -> FloatArray:
    """Spread nodes in the plane so that their distances come near the ideal ones, both (size, size); (size, 2).

    The first guess is the plane in which they lie best (classical scaling), with a seeded jitter that parts equal ones.
    """
    size = len(ideal)
    centring = np.eye(size) - 1.0 / size
    values, vectors = np.linalg.eigh(-0.5 * centring @ ideal**2 @ centring)
    plane = np.zeros((size, 2))
    largest = np.argsort(-values, kind="stable")[:2]
    plane[:, : len(largest)] = vectors[:, largest] * np.sqrt(np.maximum(values[largest], 0.0))
    points = plane + 0.3 * np.random.default_rng(1).normal(size=plane.shape)
    weight = np.zeros_like(ideal)
    weight[ideal > 0.0] = ideal[ideal > 0.0] ** -2.0
    solver = np.linalg.pinv(np.diag(weight.sum(axis=1)) - weight)
    for _ in range(STRESS_ROUNDS if size > 1 else 0):
        apart = np.linalg.norm(points[:, None] - points[None, :], axis=2)
        pull = -weight * ideal / np.maximum(apart, 1e-9)
        np.fill_diagonal(pull, 0.0)
        np.fill_diagonal(pull, -pull.sum(axis=1))
        points = solver @ (pull @ points)
    return points


def _turned(points: FloatArray, edges: Cells) -> FloatArray:
    """Turn the longest extent into the rows, and mirror so that power flows to the right."""
    centred = points - points.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    turned = centred @ axes.T if axes.shape == (2, 2) else centred
    rightwards = (turned[edges[:, 1], 0] - turned[edges[:, 0], 0]).sum()
    mirrored: FloatArray = turned * np.array([-1.0 if rightwards < 0.0 else 1.0, 1.0])
    return mirrored


def _furrow(apart: FloatArray) -> FloatArray | None:
    """Lay a long, thin graph along its longest path, folded into bands to and fro; None for any other graph.

    Parameters
    ----------
    apart : float array, shape (n_nodes, n_nodes); bonds between any two nodes
    """
    start, end = np.unravel_index(int(np.argmax(apart)), apart.shape)
    longest = float(apart[start, end])
    along = (apart[start] - apart[end] + longest) / 2.0
    off = np.ceil((apart[start] + apart[end] - longest) / 2.0)
    if longest <= LONGEST_ROW or off.max() > THIN:
        return None
    side = np.zeros(len(apart))
    for count, node in enumerate(np.argsort(off, kind="stable")):
        before = np.flatnonzero((apart[node] == 1.0) & (off < off[node]))
        inherited = side[before[0]] if len(before) else 0.0
        side[node] = inherited if inherited or not off[node] else (1.0, -1.0)[count % 2]
    bands = int(np.ceil(longest / LONGEST_ROW))
    length = (longest + 1.0) / bands
    band = np.floor(along / length)
    inside = along - band * length
    column = np.where(band % 2 == 1, length - 1.0 - inside, inside)
    return np.column_stack([column, side * off + band * (2.0 * off.max() + 1.0)])


def _snapped(points: FloatArray, edges: Cells) -> Cells:
    """Give each node the free cell nearest to its point; nodes with most bonds choose first."""
    order = np.argsort(-np.bincount(edges.ravel(), minlength=len(points)), kind="stable")
    size = int(np.ceil(np.abs(points).max())) + len(points)
    axis = np.arange(-size, size + 1)
    free = np.array(np.meshgrid(axis, axis)).reshape(2, -1).T
    cells = np.zeros((len(points), 2), dtype=np.int64)
    for node in order:
        best = int(np.argmin(((free - points[node]) ** 2).sum(axis=1)))
        cells[node] = free[best]
        free = np.delete(free, best, axis=0)
    return cells


def _rearranged(cells: Cells, edges: Cells) -> Cells:
    """Move nodes, and whole branches, to better cells until nothing helps."""
    branches, clutter = _branches(len(cells), edges), dict[int, float]()
    for _ in range(PASSES):
        before = cells.copy()
        clutter.clear()
        for node in range(len(cells)):
            after = _move_node(cells, edges, node, clutter)
            if after is not cells:
                clutter.clear()
            cells = after
        for branch in branches:
            cells = _move_branch(cells, edges, branch)
        if np.array_equal(before, cells):
            break
    return cells


def _cost(cells: Cells, edges: Cells, moved: BoolArray | None = None) -> float:
    """Judge a drawing; small is good.

    Parameters
    ----------
    cells : int array, shape (n_nodes, 2); column and row
    edges : int array, shape (n_bonds, 2); indices of tail and head
    moved : judge only what depends on these nodes, which is enough to compare two places for them; None: all
    """
    if moved is None:
        moved = np.ones(len(cells), dtype=bool)
    return _stretch(cells, edges, moved) + _clutter(cells, edges, moved)


def _stretch(cells: Cells, edges: Cells, moved: BoolArray) -> float:
    """Judge how far apart nodes are; see `_cost`, which is never less."""
    touching = moved[edges[:, 0]] | moved[edges[:, 1]]
    tail, head = cells[edges[touching, 0]], cells[edges[touching, 1]]
    step = np.abs(head - tail)
    length = (step.sum(axis=1) ** 2 + SLANT * (step.min(axis=1) > 0)).sum()
    backwards = BACKWARDS * np.maximum(tail - head, 0)[:, 0].sum()
    extent = COMPACT * ((cells - cells.mean(axis=0)) ** 2 * np.array([1.0, 1.6])).sum()
    return float(length + backwards + extent)


def _clutter(cells: Cells, edges: Cells, moved: BoolArray) -> float:
    """Judge crossings, and bonds over nodes; see `_cost`. This takes long."""
    touching = moved[edges[:, 0]] | moved[edges[:, 1]]
    covered = _covered(cells, edges[touching], np.arange(len(cells)))
    if not touching.all():
        covered += _covered(cells, edges[~touching], np.flatnonzero(moved))
    a, b = (cells[edges[touching, end]][:, None] for end in (0, 1))
    c, d = (cells[edges[:, end]][None, :] for end in (0, 1))
    apart = _side(a, b, c) * _side(a, b, d) < 0
    crossings = int((apart & (_side(c, d, a) * _side(c, d, b) < 0)).sum())
    return CROSSING * crossings + COVERED * covered


def _side(a: Cells, b: Cells, point: Cells) -> Cells:
    """Give on which side of the line a-b a point lies: -1, 0 or 1."""
    along, off = b - a, point - a
    turned: Cells = np.sign(along[..., 0] * off[..., 1] - along[..., 1] * off[..., 0])
    return turned


def _covered(cells: Cells, edges: Cells, nodes: Cells) -> int:
    """Count those of the nodes that a bond not their own runs over or close by."""
    tail, along = cells[edges[:, 0]][:, None], (cells[edges[:, 1]] - cells[edges[:, 0]])[:, None]
    off = cells[nodes][None, :] - tail
    square = np.maximum((along**2).sum(axis=2), 1)
    share = np.clip((off * along).sum(axis=2) / square, 0.0, 1.0)
    near = ((off - share[..., None] * along) ** 2).sum(axis=2) < 0.3
    own = (nodes == edges[:, :1]) | (nodes == edges[:, 1:])
    return int((near & ~own).sum())


def _move_node(cells: Cells, edges: Cells, node: int, clutter: dict[int, float]) -> Cells:
    """Try all cells near the neighbours; an occupied one is tried as an exchange.

    clutter: of nodes as they stand, as far as it is known; what is asked of more of them is added
    """
    touching = edges[(edges == node).any(axis=1)]
    best, gain = cells, -1e-9
    window = np.arange(-REACH, REACH + 1)
    around = np.array(np.meshgrid(window, window)).reshape(2, -1).T
    tried = {tuple(cells[node])}
    for neighbour in touching[touching != node]:
        for column, row in cells[neighbour] + around:
            if (column, row) in tried:
                continue
            tried.add((column, row))
            trial = cells.copy()
            trial[(cells == (column, row)).all(axis=1)] = cells[node]
            trial[node] = column, row
            moved = (trial != cells).any(axis=1)
            most = 1e-9  # of clutter that can go
            for k in np.flatnonzero(moved).tolist():
                if k not in clutter:
                    clutter[k] = _clutter(cells, edges, np.arange(len(cells)) == k)
                most += clutter[k]
            if _stretch(trial, edges, moved) - _stretch(cells, edges, moved) - most >= gain:
                continue
            if (change := _cost(trial, edges, moved) - _cost(cells, edges, moved)) < gain:
                best, gain = trial, change
    return best


def _branches(size: int, edges: Cells) -> list[BoolArray]:
    """Give the smaller side of every bond that splits the graph when cut, where it has several nodes."""
    found = []
    for k, (tail, head) in enumerate(edges):
        _, parts = connected_components(_adjacency(size, np.delete(edges, k, axis=0)), directed=False)
        if parts[tail] != parts[head]:
            inside: BoolArray = parts == parts[head]
            side = inside if 2 * inside.sum() <= size else ~inside
            if side.sum() > 1:
                found.append(side)
    return found


def _move_branch(cells: Cells, edges: Cells, branch: BoolArray) -> Cells:
    """Try to shift a branch by one cell."""
    best, lowest = cells, _cost(cells, edges)
    for step in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        trial = cells.copy()
        trial[branch] += step
        if len(np.unique(trial, axis=0)) == len(trial) and (found := _cost(trial, edges)) < lowest - 1e-9:
            best, lowest = trial, found
    return best
