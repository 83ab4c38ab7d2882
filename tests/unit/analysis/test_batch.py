"""Many evaluations of one CasADi function."""

import casadi as ca
import numpy as np
import pytest

from faultbond.analysis.batch import Batch
from faultbond.arrays import FloatArray


class Buffer:
    """A buffer of CasADi that notes which arguments and results it is given."""

    def __init__(self, real: object) -> None:
        self.real = real
        self.given: set[tuple[str, int]] = set()

    def set_arg(self, place: int, data: object) -> None:
        """Note and pass on."""
        self.given.add(("argument", place))
        self.real.set_arg(place, data)  # type: ignore[attr-defined]

    def set_res(self, place: int, data: object) -> None:
        """Note and pass on."""
        self.given.add(("result", place))
        self.real.set_res(place, data)  # type: ignore[attr-defined]


@pytest.mark.parametrize("count", [1, 5, 70])
def test_what_is_empty_is_never_pointed_to(count: int) -> None:
    """An array without elements may lie anywhere, even where CasADi works, which it takes for corrupted memory."""
    x, z = ca.SX.sym("x", 2), ca.SX.sym("z", 0)
    batch = Batch(ca.Function("f", [x, z], [ca.sumsqr(x), z, 2 * x]))
    spies = [Buffer(buffer) for _, buffer, _ in batch.blocks]
    batch.blocks = [(n, spy, evaluate) for spy, (n, _, evaluate) in zip(spies, batch.blocks, strict=True)]
    values: FloatArray = np.arange(2.0 * count).reshape(count, 2)
    squares, nothing, twice = batch(values, np.empty((count, 0)))
    assert squares[:, 0, 0] == pytest.approx((values**2).sum(axis=1))
    assert nothing.size == 0
    assert np.array_equal(twice[:, :, 0], 2.0 * values)
    assert set.union(*(spy.given for spy in spies)) == {("argument", 0), ("result", 0), ("result", 2)}
