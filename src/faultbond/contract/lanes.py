"""How the hypotheses of the bank are laid out in lanes: one lane per start value of each suspect.

A store whose own parameter changes may keep its content (charge, volume, momentum) or its effort or flow (a level, a
speed); both happen and both are tried, as further starts.

A faulty parameter keeps a linear factor, since its logarithm overshoots. Single starts fail for parameters
that act by their inverse, so each suspect starts from several sizes, and the likelihoods of the starts are averaged.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.spec import EngineSpec, ParameterSpec

FIRST_START = 0.45  # the lowest start, in healthy values; each next one is twice as large
START_SPREAD = 0.35  # sd of a start, in starts
REACH = 1.3  # starts lie within this many `change` of nominal, or LEAST_REACH if that is more
LEAST_REACH = 0.56
MANY_LANES = 2500  # with more, pairs are tested coarsely too
COARSE_FROM = 3  # sets of this size and more use only the two inner starts of each suspect


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneStart:
    """One start of a suspect: `value` times the healthy factor (plus it where the nominal is 0), and its sd alike."""

    value: float
    sd: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LanePlan:
    """Lanes of a bank."""

    hypothesis: IntArray  # (n_lanes,)
    suspected: BoolArray  # (n_parameters, n_lanes)
    values: FloatArray  # (n_parameters, n_lanes): starts of the suspects, see `LaneStart`
    sds: FloatArray  # (n_parameters, n_lanes)
    jumps: BoolArray  # (n_lanes, n_states): the stored content goes on at the change, else the effort (C) or flow (I)
    first: IntArray  # (n_hypotheses,): first lane of each
    sizes: FloatArray  # (n_hypotheses,): suspects in each
    tied: bool = False  # whether a jump is bound to the factor of its suspect, as it may where that is nearly known

    @property
    def n_lanes(self) -> int:
        """Number of lanes."""
        return len(self.hypothesis)


def starts_of(parameter: ParameterSpec, size: int, coarse_from: int = COARSE_FROM) -> tuple[LaneStart, ...]:
    """Give the starts of a suspect in a set of `size` suspects; sets of `coarse_from` and more get the inner two."""
    change = parameter.change
    if parameter.healthy == 0.0:
        third = change / 3.0
        values = [0.0, *(v for v in (third, -third) if parameter.lower <= v <= parameter.upper)]
        return tuple(LaneStart(value=value, sd=change) for value in values)
    values, value = [], FIRST_START
    while abs(value - 1.0) <= max(REACH * change, LEAST_REACH) + 1e-9:
        values.append(value)
        value *= 2.0
    if size >= coarse_from:
        values = values[1:3]
    return tuple(LaneStart(value=value, sd=min(START_SPREAD * value, max(change, 0.05))) for value in values)


@lru_cache(maxsize=8)
def plan_lanes(spec: EngineSpec) -> LanePlan:
    """Give the lane plan of a specification: fine starts where that is affordable, else coarse ones for pairs too."""
    fine = _plan(spec, COARSE_FROM)
    return fine if fine.n_lanes <= MANY_LANES else _plan(spec, 2)


def _plan(spec: EngineSpec, coarse_from: int) -> LanePlan:
    hypothesis: list[int] = []
    starts: list[tuple[tuple[int, LaneStart], ...]] = []
    first: list[int] = []
    jumps: list[tuple[bool, ...]] = []
    for k, chosen in enumerate(spec.hypotheses):
        first.append(len(starts))
        options = [
            [(index, start) for start in starts_of(spec.parameters[index], len(chosen), coarse_from)]
            for index in chosen
        ]
        mine = [frozenset(index for index, _ in state.jumps if index in chosen) for state in spec.states]
        kinds = sorted({moving for moving in mine if moving}, key=sorted)  # stores of the same suspects go together
        for combination in product(*options):
            for choice in product([False, True], repeat=len(kinds)):
                hypothesis.append(k)
                starts.append(tuple(combination))
                jumps.append(tuple(bool(moving) and choice[kinds.index(moving)] for moving in mine))
    values = np.ones((len(spec.parameters), len(starts)))
    sds = np.zeros_like(values)
    for lane, pairs in enumerate(starts):
        for index, start in pairs:
            values[index, lane], sds[index, lane] = start.value, start.sd
    return LanePlan(
        hypothesis=np.array(hypothesis, dtype=np.intp),
        suspected=sds > 0.0,
        values=values,
        sds=sds,
        jumps=np.array(jumps, dtype=bool).reshape(len(starts), len(spec.states)),
        first=np.array(first, dtype=np.intp),
        sizes=np.array([len(chosen) for chosen in spec.hypotheses], dtype=float),
    )


def extremes(plan: LanePlan, likelihoods: FloatArray) -> tuple[IntArray, IntArray]:
    """Give the likeliest and the least likely lane of each hypothesis, shape (n_hypotheses,) each."""
    finite = np.where(np.isfinite(likelihoods), likelihoods, -np.inf)
    ends = np.append(plan.first, plan.n_lanes)[1:]  # also where there is no hypothesis
    best = [first + int(np.argmax(finite[first:end])) for first, end in zip(plan.first, ends, strict=True)]
    worst = [first + int(np.argmin(finite[first:end])) for first, end in zip(plan.first, ends, strict=True)]
    return np.array(best, dtype=np.intp), np.array(worst, dtype=np.intp)


def found_lanes(spec: EngineSpec, plan: LanePlan, bank: FloatArray, best: IntArray, healthy: FloatArray) -> LanePlan:
    """Give a plan of one lane per hypothesis that starts at the estimates of its best lane.

    `healthy` (n_parameters,): factors of the healthy plant, to which starts are relative.
    """
    estimates = bank[spec.parameter_slice][:, best]
    suspected = plan.suspected[:, best]
    changes = np.array([max(item.change, 0.05) for item in spec.parameters])[:, None]
    additive = np.array([item.healthy == 0.0 for item in spec.parameters])[:, None]
    reference = np.where((healthy == 0.0) & ~additive[:, 0], 1.0, healthy)[:, None]
    starts = np.where(additive, estimates - reference, estimates / np.where(additive, 1.0, reference))
    least = np.where(additive, np.array([item.accuracy for item in spec.parameters])[:, None], 0.0)
    sds = np.clip(START_SPREAD * np.abs(starts), np.minimum(least, changes), changes)
    return LanePlan(
        hypothesis=np.arange(len(best), dtype=np.intp),
        suspected=suspected,
        values=np.where(suspected, starts, 1.0),
        sds=np.where(suspected, sds, 0.0),
        jumps=plan.jumps[best],
        first=np.arange(len(best), dtype=np.intp),
        sizes=plan.sizes[plan.hypothesis[best]],
        tied=True,
    )
