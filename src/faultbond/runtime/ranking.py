"""Ranking: posterior probabilities of the hypotheses, their estimates, and which cannot yet be told apart.

score = mean likelihood over the starts (in logarithm) - cost per suspect * size; posterior = exp(score) normalised;
hypotheses within 3 nats of the best are one group. Source: Magill, IEEE Trans. Automatic Control 10 (1965).
"""

import numpy as np

from faultbond.runtime.history import Candidate, Diagnosis, Suspect
from faultbond.runtime.lanes import LanePlan, plan_lanes
from faultbond.spec import EngineSpec
from faultbond.types import FloatArray

MAX_CANDIDATES = 100


def scores(spec: EngineSpec, plan: LanePlan, likelihoods: FloatArray) -> FloatArray:
    """Give the score of each hypothesis, shape (n_hypotheses,), from the log-likelihoods of all lanes."""
    finite = np.where(np.isfinite(likelihoods), likelihoods, -1e300)
    top = np.maximum.reduceat(finite, plan.first)
    weights = np.exp(np.maximum(finite - top[plan.hypothesis], -700.0))
    counts = np.diff(np.append(plan.first, len(finite)))
    mean = top + np.log(np.add.reduceat(weights, plan.first) / counts)
    return np.asarray(mean - spec.thresholds.cost_per_suspect * plan.sizes)


def rank(spec: EngineSpec, time: float, lanes: FloatArray) -> Diagnosis:
    """Give the ranked candidates of a bank, shape (n_numbers, n_lanes), best first."""
    plan = plan_lanes(spec)
    score = scores(spec, plan, lanes[-1])
    weight = np.exp(score - score.max())
    probability = weight / weight.sum()
    order = np.argsort(-score, kind="stable")[:MAX_CANDIDATES]
    candidates = tuple(
        Candidate(
            suspects=_suspects(spec, plan, lanes, int(k)),
            probability=float(probability[k]),
            group=bool(score[k] >= score.max() - spec.thresholds.group_nats),
        )
        for k in order
    )
    return Diagnosis(time=time, candidates=candidates)


def _suspects(spec: EngineSpec, plan: LanePlan, lanes: FloatArray, hypothesis: int) -> tuple[Suspect, ...]:
    """Estimates of the best start."""
    first = plan.first[hypothesis]
    own = slice(first, first + int(np.sum(plan.hypothesis == hypothesis)))
    best = first + int(np.argmax(np.nan_to_num(lanes[-1, own], nan=-np.inf, posinf=-np.inf)))
    suspects = []
    for index in spec.hypotheses[hypothesis]:
        parameter = spec.parameters[index]
        k = spec.parameter_slice.start + index
        diagonal = spec.n_joint + k * spec.n_joint - k * (k - 1) // 2
        suspects.append(
            Suspect(
                parameter=parameter.name,
                component=parameter.component,
                nominal=parameter.nominal,
                estimate=float(parameter.scale * lanes[k, best]),
                sd=float(abs(parameter.scale) * np.sqrt(max(lanes[diagonal, best], 0.0))),
            )
        )
    return tuple(suspects)
