"""Many evaluations of one CasADi function, between arrays and without CasADi's matrices."""

from typing import Any

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray

_BLOCKS = (64, 16, 4, 1)  # evaluations in one call


class Batch:
    """A CasADi function of columns, evaluated for many arguments."""

    def __init__(self, function: ca.Function) -> None:
        if not all(function.sparsity_out(k).is_dense() for k in range(function.n_out())):
            symbols = function.sx_in()
            function = ca.Function(function.name(), symbols, [ca.densify(item) for item in function.call(symbols)])
        self.function = function  # the buffer's methods take one argument less than CasADi's types say
        self.blocks: list[tuple[int, Any, Any]] = [
            (n, *(function.map(n) if n > 1 else function).buffer()) for n in _BLOCKS
        ]

    def __call__(self, *arguments: FloatArray) -> list[FloatArray]:
        """Give results (n, rows, columns) for arguments (n, size)."""
        arguments = tuple(np.ascontiguousarray(argument) for argument in arguments)
        count, done = len(arguments[0]), 0
        shapes = [self.function.size_out(k)[::-1] for k in range(self.function.n_out())]
        results = [np.empty((count, *shape)) for shape in shapes]
        for n, buffer, evaluate in self.blocks:
            while count - done >= n:
                for k, argument in enumerate(arguments):
                    if argument.size:  # an empty one is anywhere in memory, even where CasADi works; null it may be
                        buffer.set_arg(k, argument[done : done + n].data)
                for k, result in enumerate(results):
                    if result.size:
                        buffer.set_res(k, result[done : done + n].data)
                evaluate()
                done += n
        return [result.transpose(0, 2, 1) for result in results]
