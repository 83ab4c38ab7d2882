"""The bank: lanes for every hypothesis, begun at the alarm, and how well each explains what came since.

Steps of parameters run in lanes of `faultbond.runtime.stepped`, all other kinds of fault in lanes with a slot, of
`faultbond.runtime.slotted`.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.runtime.lanes import plan_lanes
from faultbond.runtime.misfit import Misfit, add_misfit, begin_again, no_misfit
from faultbond.runtime.slots import plan_slots
from faultbond.runtime.slotted import advance_slots, begin_slots
from faultbond.runtime.stepped import Trail, advance_steps, begin_steps, renew_steps
from faultbond.spec import Engine, EngineSpec
from faultbond.types import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bank:
    """All lanes: `steps` (n_numbers, n), `slots` (n_numbers of slot lanes, m); `misfit` of both, in this order."""

    steps: FloatArray
    slots: FloatArray
    misfit: Misfit

    @property
    def likelihoods(self) -> FloatArray:
        """Log-likelihoods of all lanes, steps first."""
        return np.concatenate([self.steps[-1], self.slots[-1]])


def no_bank(spec: EngineSpec) -> Bank:
    """Give a bank of zeros, of the right size."""
    n, m = plan_lanes(spec).n_lanes, plan_slots(spec).n_lanes
    return Bank(
        steps=np.zeros((spec.n_numbers, n)),
        slots=np.zeros((spec.slotted.n_numbers, m)),
        misfit=no_misfit(spec, n + m, 0),
    )


def begin_bank(spec: EngineSpec, engine: Engine, trail: Trail, change: int, peak: FloatArray, index: int) -> Bank:
    """Give the bank, having seen all samples of the trail.

    Parameters
    ----------
    spec, engine : the model
    trail : Trail
        Its last sample is that of the alarm.
    change : int
        Index in the trail of the onset that the detector estimates; one of the onsets tried.
    peak : float array, shape (n_inputs,)
        Largest size of each input so far, SI.
    index : int
        Number of the sample of the alarm.
    """
    steps = begin_steps(spec, engine, trail, change)
    slots = begin_slots(spec, engine, trail, change, peak)
    return Bank(steps=steps, slots=slots, misfit=no_misfit(spec, steps.shape[1] + slots.shape[1], index))


def advance_bank(spec: EngineSpec, engine: Engine, bank: Bank, packed: FloatArray, index: int) -> Bank:
    """Give the bank after one more packed sample, shape (n_sample,), with the number `index`."""
    steps, one = advance_steps(spec, engine, bank.steps, packed)
    slots, two = advance_slots(spec, engine, bank.slots, packed)
    innovations = np.concatenate([one, two], axis=1)
    return Bank(steps=steps, slots=slots, misfit=add_misfit(spec, bank.misfit, packed, innovations, index))


def renew_bank(spec: EngineSpec, engine: Engine, trail: Trail, bank: Bank, index: int) -> Bank:
    """Begin lanes of steps again from what the bank has found; see `renew_steps`."""
    steps = renew_steps(spec, engine, trail, bank.steps)
    renewed = np.zeros(bank.misfit.sums.shape[2], dtype=bool)
    renewed[: steps.shape[1]] = np.any(steps != bank.steps, axis=0)
    return Bank(steps=steps, slots=bank.slots, misfit=begin_again(bank.misfit, renewed, index))
