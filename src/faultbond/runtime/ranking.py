"""Ranking: posterior probabilities of the hypotheses, their estimates, and which cannot yet be told apart.

score = likelihood averaged over kinds of fault and starts (in logarithm) - cost per suspect * size; posterior =
exp(score) normalised; hypotheses within 3 nats of the best are one group. Source: Magill, IEEE Trans. Automatic Control
10 (1965).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.findings import Candidate, Diagnosis
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.bank import Bank
from faultbond.runtime.estimates import Absorbed, nothing_absorbed, slot_suspects, step_suspects
from faultbond.runtime.growing import PER_SET
from faultbond.runtime.stepped import LOWEST
from faultbond.types import FaultKind

MAX_CANDIDATES = 100
_KINDS = tuple(FaultKind)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneTable:
    """Of each lane, steps first: its hypothesis, index of its kind among all kinds, prior weight (in logarithm).

    Of lanes (n_lanes,); costs (n_hypotheses,) of the suspects of each hypothesis, nats.
    """

    hypothesis: IntArray
    kind: IntArray
    weight: FloatArray
    costs: FloatArray


def table_of(spec: EngineSpec, bank: Bank) -> LaneTable:
    """Give the table of a bank."""
    return lane_table(spec, tuple(int(k) for k in bank.grown))


@lru_cache(maxsize=8)
def lane_table(spec: EngineSpec, grown: tuple[int, ...] = ()) -> LaneTable:
    """Give the hypotheses, kinds and weights of all lanes; starts of a hypothesis weigh the same.

    grown: which sets of the reserve have lanes, -1: not yet.
    """
    steps, slots = plan_lanes(spec), plan_slots(spec)
    counts = np.bincount(steps.hypothesis, minlength=len(spec.hypotheses))
    later = np.repeat(np.array(grown, dtype=np.intp), PER_SET)
    none = np.where(later < 0, -np.inf, -np.log(PER_SET))
    settings = spec.thresholds
    instruments = [
        settings.cost_per_sensor if item.is_output else settings.cost_per_suspect for item in spec.instruments
    ]
    kinds = [_KINDS.index(FaultKind.STEP)] * (steps.n_lanes + len(later))
    kinds += [_KINDS.index(lane.kind) for lane in slots.lanes]
    return LaneTable(
        hypothesis=np.concatenate([steps.hypothesis, spec.n_begun + np.maximum(later, 0), slots.hypothesis]),
        kind=np.array(kinds, dtype=np.intp),
        weight=np.concatenate([-np.log(counts[steps.hypothesis]), none, slots.weight]),
        costs=np.array([*(settings.cost_per_suspect * steps.sizes), *instruments, *spec.reserve_costs]),
    )


def by_kind(spec: EngineSpec, bank: Bank) -> FloatArray:
    """Give the weighted likelihood, in logarithm, of each hypothesis and kind, shape (n_hypotheses, n_kinds)."""
    table = table_of(spec, bank)
    total = np.full((spec.n_hypotheses, len(_KINDS)), -np.inf)
    np.logaddexp.at(total, (table.hypothesis, table.kind), _weighted(table, bank))
    return total


def _weighted(table: LaneTable, bank: Bank) -> FloatArray:
    likelihoods = bank.likelihoods
    return np.asarray(np.where(np.isfinite(likelihoods), likelihoods, LOWEST) + table.weight)


def scores(spec: EngineSpec, bank: Bank) -> FloatArray:
    """Give the score of each hypothesis, shape (n_hypotheses,); -inf of those that have no lanes."""
    return _scores(spec, by_kind(spec, bank))


def _scores(spec: EngineSpec, kinds: FloatArray) -> FloatArray:
    return np.asarray(np.logaddexp.reduce(kinds, axis=1) - lane_table(spec).costs)


def rank(spec: EngineSpec, time: float, bank: Bank, absorbed: Absorbed | None = None) -> Diagnosis:
    """Give the ranked candidates of a bank, best first; `absorbed`: what was accepted before."""
    absorbed = nothing_absorbed(spec) if absorbed is None else absorbed
    kinds = by_kind(spec, bank)
    score = _scores(spec, kinds)
    weight = np.exp(score - score.max())
    probability = weight / weight.sum()
    order = [int(k) for k in np.argsort(-score, kind="stable") if score[k] > -np.inf][:MAX_CANDIDATES]
    group = score >= score.max() - spec.thresholds.group_nats
    best = best_lanes(spec, bank)
    candidates = tuple(
        _candidate(spec, time, bank, int(best[k]), float(probability[k]), bool(group[k]), kinds[k], absorbed)
        for k in order
    )
    return Diagnosis(time=time, candidates=candidates)


def leading_lane(spec: EngineSpec, bank: Bank) -> int:
    """Give the lane that tells of the best candidate; lanes of steps come first."""
    return int(best_lanes(spec, bank)[np.argmax(scores(spec, bank))])


def best_lanes(spec: EngineSpec, bank: Bank) -> IntArray:
    """Give the likeliest lane of each hypothesis among those of its likeliest kind, shape (n_hypotheses,).

    What stands for a hypothesis that has no lanes means nothing.
    """
    table = table_of(spec, bank)
    leading = np.argmax(by_kind(spec, bank), axis=1)
    weighted = np.where(table.kind == leading[table.hypothesis], _weighted(table, bank), -np.inf)
    order = np.lexsort((-weighted, table.hypothesis))
    first = np.searchsorted(table.hypothesis[order], np.arange(spec.n_hypotheses))
    return np.asarray(order[np.minimum(first, len(order) - 1)], dtype=np.intp)


def _candidate(
    spec: EngineSpec,
    time: float,
    bank: Bank,
    lane: int,
    probability: float,
    group: bool,
    kinds: FloatArray,
    absorbed: Absorbed,
) -> Candidate:
    """Give a candidate with the estimates of its best lane."""
    steps = bank.steps.shape[1]
    shares = np.exp(kinds - kinds.max())  # so that they add up even where rejected lanes have lost all scale
    shares = shares / shares.sum()
    order = [int(k) for k in np.argsort(-shares, kind="stable") if np.isfinite(kinds[k])]
    hypothesis = int(table_of(spec, bank).hypothesis[lane])
    if lane < steps:
        suspects, present = step_suspects(spec, bank.steps[:, lane], spec.members(hypothesis)), True
    else:
        suspects, present = slot_suspects(spec, bank.slots, lane - steps, time, absorbed)
    return Candidate(
        suspects=suspects,
        probability=probability,
        group=group,
        kind=_KINDS[order[0]],
        kinds=tuple((_KINDS[k], float(shares[k])) for k in order),
        present=present,
        hypothesis=hypothesis,
    )
