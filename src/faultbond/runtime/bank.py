"""The bank: lanes for every hypothesis, begun at the alarm, and how well each explains what came since.

Steps of parameters run in lanes of `faultbond.runtime.stepped`, all other kinds of fault in lanes with a slot, of
`faultbond.runtime.slotted`.
"""

from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.lanes import extremes, plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime.growing import PER_SET, Tested, extend, factors, grow, n_grown
from faultbond.runtime.misfit import Misfit, add_misfit, begin_again, no_misfit
from faultbond.runtime.slotted import advance_slots, begin_slots, renew_slots
from faultbond.runtime.stepped import advance_steps, begin_steps, renew_all_steps, renew_steps
from faultbond.runtime.trail import Trail


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bank:
    """All lanes.

    steps : (n_numbers, n), those of the hypotheses, then those of sets taken from the reserve
    slots : (n_numbers of slot lanes, m)
    misfit : of both, in this order
    healthy : (n_numbers, 1), the healthy lane before the fault; none where there is no reserve
    grown : (n_grown,), which sets of the reserve have lanes; -1: not yet
    rejected : (n_hypotheses,), 1 where a person has ruled it out
    """

    steps: FloatArray
    slots: FloatArray
    misfit: Misfit
    healthy: FloatArray
    grown: FloatArray
    rejected: FloatArray

    @property
    def likelihoods(self) -> FloatArray:
        """Log-likelihoods of all lanes, (n + m,), steps first."""
        return np.concatenate([self.steps[-1], self.slots[-1]])


def no_bank(spec: EngineSpec) -> Bank:
    """Give a bank of zeros, of the right size."""
    n, m = plan_lanes(spec).n_lanes + PER_SET * n_grown(spec), plan_slots(spec).n_lanes
    return Bank(
        steps=np.zeros((spec.n_numbers, n)),
        slots=np.zeros((spec.slotted.n_numbers, m)),
        misfit=no_misfit(spec, n + m, 0),
        healthy=np.zeros((spec.n_numbers, 1 if spec.reserve else 0)),
        grown=np.full(n_grown(spec), -1.0),
        rejected=np.zeros(spec.n_hypotheses),
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
    later = np.zeros((spec.n_numbers, PER_SET * n_grown(spec)))  # of no weight until the sets are chosen
    slots = begin_slots(spec, engine, trail, change, peak)
    return Bank(
        steps=np.concatenate([steps, later], axis=1),
        slots=slots,
        misfit=no_misfit(spec, steps.shape[1] + later.shape[1] + slots.shape[1], index),
        healthy=trail.lanes[0][:, None].copy() if spec.reserve else np.zeros((spec.n_numbers, 0)),
        grown=np.full(n_grown(spec), -1.0),
        rejected=np.zeros(spec.n_hypotheses),
    )


def advance_bank(spec: EngineSpec, engine: Engine, bank: Bank, packed: FloatArray, use: BoolArray, index: int) -> Bank:
    """Give the bank after one more packed sample, (n_sample,), with the number `index`; `use`: see `add_misfit`."""
    steps, one = advance_steps(spec, engine, bank.steps, packed)
    slots, two = advance_slots(spec, engine, bank.slots, packed)
    innovations = np.concatenate([one, two], axis=1)
    return replace(
        bank,
        steps=steps,
        slots=slots,
        misfit=add_misfit(
            spec, bank.misfit, use, innovations, index, switched=one.shape[1] + plan_slots(spec).switched
        ),
    )


def tested_sets(spec: EngineSpec, bank: Bank) -> Tested:
    """Give the sets of steps that have lanes since the alarm, by their best lanes."""
    plan = plan_lanes(spec)
    own = bank.steps[:, : plan.n_lanes]
    best, _ = extremes(plan, own[-1])
    mean, variance = factors(spec, own[:, best])
    return Tested(sets=spec.hypotheses, likelihood=own[-1, best], mean=mean, variance=variance)


def renew_bank(
    spec: EngineSpec,
    engine: Engine,
    trail: Trail,
    bank: Bank,
    index: int,
    peak: FloatArray,
    *,
    last: bool = False,
) -> Bank:
    """Begin lanes again from what the bank has found, and those of the likeliest sets in reserve that are not rejected.

    Parameters
    ----------
    spec, engine : the model
    trail : the last samples and healthy lanes
    bank : the bank before
    index : number of the sample of now
    peak : float array, shape (n_inputs,)
        Largest size of each input so far, SI.
    last : whether no renewal follows; then all filters of steps begin again
    """
    own, grown = plan_lanes(spec).n_lanes, bank.grown
    steps = bank.steps.copy()
    steps[:, :own] = (renew_all_steps if last else renew_steps)(spec, engine, trail, bank.steps[:, :own])
    if spec.reserve:
        extended = extend(spec, tested_sets(spec, replace(bank, steps=steps)), bank.healthy[:, 0])
        out = bank.rejected[spec.n_begun :] > 0
        extended = replace(extended, likelihood=np.where(out, -np.inf, extended.likelihood))
        kept = np.where(out[bank.grown.astype(np.intp)], -1.0, bank.grown)
        steps[:, own:], grown = grow(spec, engine, trail, extended, bank.steps[:, own:], kept)
    slots = renew_slots(spec, engine, trail, bank.slots, peak)
    renewed = np.concatenate([np.any(steps != bank.steps, axis=0), np.any(slots != bank.slots, axis=0)])
    return replace(bank, steps=steps, slots=slots, misfit=begin_again(bank.misfit, renewed, index), grown=grown)
