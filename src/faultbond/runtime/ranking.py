"""Ranking: posterior probabilities of the hypotheses, their estimates, and which cannot yet be told apart.

score = likelihood averaged over kinds of fault and starts (in logarithm) - cost per suspect * size; posterior =
exp(score) normalised; hypotheses within 3 nats of the best are one group. Source: Magill, IEEE Trans. Automatic Control
10 (1965).
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from faultbond.runtime.bank import Bank
from faultbond.runtime.estimates import slot_suspects, step_suspects
from faultbond.runtime.history import Candidate, Diagnosis
from faultbond.runtime.lanes import plan_lanes
from faultbond.runtime.slots import plan_slots
from faultbond.spec import EngineSpec
from faultbond.types import FaultKind, FloatArray, IntArray

MAX_CANDIDATES = 100
_LOWEST = -1e300  # likelihood of a lane that is no number
_KINDS = tuple(FaultKind)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaneTable:
    """Of each lane, steps first: its hypothesis, index of its kind among all kinds, prior weight (in logarithm).

    costs: of the suspects of each hypothesis.
    """

    hypothesis: IntArray
    kind: IntArray
    weight: FloatArray
    costs: FloatArray


@lru_cache(maxsize=8)
def lane_table(spec: EngineSpec) -> LaneTable:
    """Give the hypotheses, kinds and weights of all lanes; starts of a hypothesis weigh the same."""
    steps, slots = plan_lanes(spec), plan_slots(spec)
    counts = np.bincount(steps.hypothesis, minlength=len(spec.hypotheses))
    settings = spec.thresholds
    instruments = [
        settings.cost_per_sensor if item.is_output else settings.cost_per_suspect for item in spec.instruments
    ]
    kinds = [_KINDS.index(FaultKind.STEP)] * steps.n_lanes + [_KINDS.index(lane.kind) for lane in slots.lanes]
    return LaneTable(
        hypothesis=np.concatenate([steps.hypothesis, slots.hypothesis]),
        kind=np.array(kinds, dtype=np.intp),
        weight=np.concatenate([-np.log(counts[steps.hypothesis]), slots.weight]),
        costs=np.array([*(settings.cost_per_suspect * steps.sizes), *instruments]),
    )


def by_kind(spec: EngineSpec, likelihoods: FloatArray) -> FloatArray:
    """Give the weighted likelihood, in logarithm, of each hypothesis and kind, shape (n_hypotheses, n_kinds)."""
    table = lane_table(spec)
    total = np.full((spec.n_hypotheses, len(_KINDS)), -np.inf)
    finite = np.where(np.isfinite(likelihoods), likelihoods, _LOWEST)
    np.logaddexp.at(total, (table.hypothesis, table.kind), finite + table.weight)
    return total


def scores(spec: EngineSpec, likelihoods: FloatArray) -> FloatArray:
    """Give the score of each hypothesis, shape (n_hypotheses,), from the log-likelihoods of all lanes."""
    return _scores(spec, by_kind(spec, likelihoods))


def _scores(spec: EngineSpec, kinds: FloatArray) -> FloatArray:
    return np.asarray(np.logaddexp.reduce(kinds, axis=1) - lane_table(spec).costs)


def rank(spec: EngineSpec, time: float, bank: Bank) -> Diagnosis:
    """Give the ranked candidates of a bank, best first."""
    likelihoods = bank.likelihoods
    kinds = by_kind(spec, likelihoods)
    score = _scores(spec, kinds)
    weight = np.exp(score - score.max())
    probability = weight / weight.sum()
    order = np.argsort(-score, kind="stable")[:MAX_CANDIDATES]
    group = score >= score.max() - spec.thresholds.group_nats
    best = best_lanes(spec, likelihoods)
    candidates = tuple(
        _candidate(spec, time, bank, int(best[k]), float(probability[k]), bool(group[k]), kinds[k]) for k in order
    )
    return Diagnosis(time=time, candidates=candidates)


def leading_lane(spec: EngineSpec, bank: Bank) -> int:
    """Give the lane that tells of the best candidate; lanes of steps come first."""
    return int(best_lanes(spec, bank.likelihoods)[np.argmax(scores(spec, bank.likelihoods))])


def best_lanes(spec: EngineSpec, likelihoods: FloatArray) -> IntArray:
    """Give the likeliest lane of each hypothesis among those of its likeliest kind, shape (n_hypotheses,)."""
    table = lane_table(spec)
    leading = np.argmax(by_kind(spec, likelihoods), axis=1)
    finite = np.where(np.isfinite(likelihoods), likelihoods, _LOWEST) + table.weight
    finite = np.where(table.kind == leading[table.hypothesis], finite, -np.inf)
    order = np.lexsort((-finite, table.hypothesis))
    first = np.searchsorted(table.hypothesis[order], np.arange(spec.n_hypotheses))
    return np.asarray(order[first], dtype=np.intp)


def _candidate(
    spec: EngineSpec, time: float, bank: Bank, lane: int, probability: float, group: bool, kinds: FloatArray
) -> Candidate:
    """Give a candidate with the estimates of its best lane."""
    steps = bank.steps.shape[1]
    shares = np.exp(kinds - np.logaddexp.reduce(kinds))
    order = [int(k) for k in np.argsort(-shares, kind="stable") if np.isfinite(kinds[k])]
    hypothesis = int(lane_table(spec).hypothesis[lane])
    if lane < steps:
        suspects, present = step_suspects(spec, bank.steps[:, lane], spec.hypotheses[hypothesis]), True
    else:
        suspects, present = slot_suspects(spec, bank.slots, lane - steps, time)
    return Candidate(
        suspects=suspects,
        probability=probability,
        group=group,
        kind=_KINDS[order[0]],
        kinds=tuple((_KINDS[k], float(shares[k])) for k in order),
        present=present,
        hypothesis=hypothesis,
    )
