"""Drifts that were accepted: parameters that move on by themselves, in every lane and whenever samples are passed."""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import Engine, EngineSpec, covariance_place


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drifting:
    """An engine in whose lanes parameters move on.

    spec : layout of the lanes
    engine : the engine without drifts
    rates, wander : (n_parameters,), factors per second; how far they are off, alike
    """

    spec: EngineSpec
    engine: Engine
    rates: FloatArray
    wander: FloatArray

    @property
    def title(self) -> str:
        """What it is, in words."""
        return self.engine.title

    @property
    def slot(self) -> "Drifting":
        """The engine of lanes with a slot."""
        return Drifting(spec=self.spec.slotted, engine=self.engine.slot, rates=self.rates, wander=self.wander)

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes (n_numbers, n_lanes) over a block of samples (n_samples, n_sample); see `Engine.advance`."""
        current, found = self.engine.advance(lanes, samples[:0])
        innovations = [found]
        for sample in samples:
            current, found = self.engine.advance(self._moved(current, float(sample[0])), sample[None, :])
            innovations.append(found)
        return current, np.concatenate(innovations)

    def _moved(self, lanes: FloatArray, dt: float) -> FloatArray:
        """Give lanes after `dt` seconds of drift."""
        moved, first = lanes.copy(), self.spec.parameter_slice.start
        moved[self.spec.parameter_slice] += self.rates[:, None] * dt
        for k in np.flatnonzero(self.wander):
            moved[covariance_place(self.spec, first + int(k), first + int(k))] += (self.wander[k] * dt) ** 2
        return moved


def drifting(spec: EngineSpec, engine: Engine, rates: FloatArray, wander: FloatArray) -> Engine:
    """Give the engine, with drifts if there are any; `rates`, `wander` (n_parameters,): see `Drifting`."""
    return Drifting(spec=spec, engine=engine, rates=rates, wander=wander) if np.any(rates) else engine
