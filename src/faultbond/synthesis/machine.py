"""The engine without a compiler: CasADi's virtual machine runs the same graph."""

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class VirtualMachine:
    """Engine that interprets the filter graph, all lanes at once per sample."""

    function: ca.Function
    slot_engine: "VirtualMachine | None" = None

    @property
    def title(self) -> str:
        """What it is, in words."""
        return "CasADi virtual machine (no C compiler used)"

    @property
    def slot(self) -> "VirtualMachine":
        """The engine of lanes with a slot; itself, if it is that."""
        return self.slot_engine or self

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes over a block of samples; see `Engine.advance`."""
        n = lanes.shape[1]
        if n == 0:  # CasADi takes no columns for one
            return lanes.copy(), np.empty((samples.shape[0], self.function.numel_out(1), 0))
        innovations = np.empty((samples.shape[0], self.function.numel_out(1), n))
        current, held = np.array(lanes.T, dtype=np.float64, order="C"), np.empty((n, samples.shape[1]))
        following, found = np.empty_like(current), np.empty((n, innovations.shape[1]))
        mapped = self.function.map(n) if n > 1 else self.function
        buffer: Any  # its methods take one argument less than CasADi's types say
        buffer, call = mapped.buffer()  # CasADi's matrices would take longer than the filter
        for k, (argument, result) in enumerate(((current, following), (held, found))):
            buffer.set_arg(k, argument.data)
            buffer.set_res(k, result.data)
        for t, sample in enumerate(samples):
            held[:] = sample
            call()
            current[:], innovations[t] = following, found.T
        return np.ascontiguousarray(current.T), innovations
