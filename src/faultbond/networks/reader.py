"""What the sensors of a static network read, as one function of inputs and free values, with slopes."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import casadi as ca
import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.equations.evaluate import evaluate
from faultbond.equations.numeric import Real
from faultbond.errors import StructureError
from faultbond.model.graph import BondGraph
from faultbond.networks.relations import BlockLaw


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reader:
    """Readings as a function: of the free values at the places `chosen`, others at their `nominal`, and of inputs.

    needs: which inputs each reading depends on, (m, n_inputs). nominal: (n_free,), SI. Noises, sd: (m,), (n_inputs,).
    """

    function: ca.Function  # (free, u) -> y, dy/dfree, dy/du
    needs: BoolArray
    free: tuple[str, ...]
    nominal: FloatArray
    chosen: tuple[int, ...]
    output_noise: FloatArray
    input_noise: FloatArray

    def of(self, names: Sequence[str]) -> "Reader":
        """Give the same readings as a function of some of the free values."""
        return replace(self, chosen=tuple(self.free.index(name) for name in names))

    def __call__(self, x: FloatArray, u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Give readings (m, n), slopes by the chosen values (n, m, p) and by the inputs (n, m, n_inputs).

        Parameters
        ----------
        x : chosen values (p,)
        u : inputs (n_inputs, n)
        """
        n, everything = u.shape[1], self.nominal.copy()
        everything[list(self.chosen)] = x
        parts = self.function.map(n)(np.tile(everything[:, None], n), u)
        y, by_x, by_u = (np.asarray(item.full()) for item in parts)
        m = len(self.output_noise)
        by_x, by_u = (item.reshape(m, n, -1).transpose(1, 0, 2) for item in (by_x, by_u))
        return y, by_x[:, :, list(self.chosen)], by_u


def reader(graph: BondGraph, laws: Iterable[BlockLaw], values: Mapping[str, Real], free: Mapping[str, float]) -> Reader:
    """Give the readings of a network as a function.

    Parameters
    ----------
    graph : the model
    laws : those in force, each before its signal is used, where that can be
    values : constants and parameters
    free : parameters, or signals that no law gives, that stay open, with a value for each

    Raises
    ------
    StructureError
        if a signal does not follow: laws in a loop that is not linear, or equations that define no signal.
    """
    symbols = {name: ca.SX.sym(name) for name in (*free, *(item.name for item in graph.inputs))}
    known = {name: ca.SX(float(value)) for name, value in values.items()} | symbols
    _follow(laws, known, graph.file)
    y = ca.vertcat(*(evaluate(item.reads, known) for item in graph.sensors))
    x, u = _column(symbols[name] for name in free), _column(symbols[item.name] for item in graph.inputs)
    by_u = ca.jacobian(y, u)
    return Reader(
        function=ca.Function("readings", [x, u], [y, ca.jacobian(y, x), by_u]),
        needs=np.array(ca.DM(by_u.sparsity(), 1.0).full()) > 0.0,
        free=tuple(free),
        nominal=np.array(list(free.values()), dtype=np.float64),
        chosen=tuple(range(len(free))),
        output_noise=np.array([item.noise for item in graph.sensors]),
        input_noise=np.array([item.noise for item in graph.inputs]),
    )


def _column(symbols: Iterable[ca.SX]) -> ca.SX:
    column = ca.vertcat(*symbols)
    return ca.SX.sym("nothing", 0, 1) if column.is_empty() else column


def _follow(laws: Iterable[BlockLaw], values: dict[str, ca.SX], file: str) -> None:
    """Add the signals that laws define; those in a loop at once, if the loop is linear."""
    loop: list[tuple[str, BlockLaw]] = []
    for law in laws:
        signal = law.signal
        if signal is None:
            raise StructureError(f"{file}: block {law.block}: here a law has to define a signal, as in `y = 2*x`")
        if all(name in values for name in law.uses):
            values[signal] = evaluate(law.right, values)
        else:
            loop.append((signal, law))
    if not loop:
        return
    unknown = {signal: ca.SX.sym(signal) for signal, _ in loop}
    z, all_values = ca.vertcat(*unknown.values()), {**values, **unknown}
    if all(name in all_values for _, law in loop for name in law.uses):
        gap = ca.vertcat(*(unknown[signal] - evaluate(law.right, all_values) for signal, law in loop))
        slopes = ca.jacobian(gap, z)
        if not ca.depends_on(slopes, z):
            solution = ca.solve(slopes, -ca.substitute(gap, z, ca.SX.zeros(z.shape)))
            values.update({signal: solution[k] for k, signal in enumerate(unknown)})
            return
    blocks = ", ".join(dict.fromkeys(law.block for _, law in loop))
    raise StructureError(f"{file}: blocks {blocks} form a loop that is not linear: with noise it cannot be followed")
