"""From the error indices of the tested sets to a ranking of all hypotheses: limited testing and reasoning.

A tested set that explains, with error indices no larger than noise and model errors, clears its complement; one that
does not makes it a conflict. A hypothesis is left if every tested set that contains it explains. The ranking weighs
this, the error indices and the size. Source: thesis 6.4 to 6.6, 7.4; docs/decisions/011-classic.md.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.findings import MAX_CANDIDATES, Candidate, Diagnosis, Suspect
from faultbond.contract.spec import EngineSpec
from faultbond.thesis.online.indices import indices_of, limits_of
from faultbond.thesis.online.plan import ClassicPlan
from faultbond.thesis.online.settings import Erratum
from faultbond.thesis.online.state import ClassicState

CLIP = 0.5  # largest error index that counts
ALIKE = 1.0  # noise/signal ratios; hypotheses that differ by less are one group
REFUTED = 4.0  # noise/signal ratios that a hypothesis costs if no tested set that contains it explains
SIZE = 1.5  # noise/signal ratios that each further suspect costs


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reasoning:
    """What the tests say of all hypotheses.

    error : error index of each tested set, averaged over the outputs, (n_tested,)
    explains : whether it explains, (n_tested,)
    cleared : part of the tested sets that contain a hypothesis which explain, (n_hypotheses,); 1: it is left
    hitting : hitting index of each hypothesis, (n_hypotheses,)
    quarter : error index of a hypothesis: the lower quartile of those of the tested sets that contain it, so that one
        of them whose least squares went astray does not count, (n_hypotheses,)
    """

    error: FloatArray
    explains: BoolArray
    cleared: FloatArray
    hitting: FloatArray
    quarter: FloatArray


def noise_of(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> FloatArray:
    """Give the noise/signal ratio N of each output, (n_outputs,): declared noise over the rms of what was read."""
    if plan.settings.noise is not None:
        return np.full(len(spec.outputs), plan.settings.noise)
    usual = np.sqrt(state.squares)
    return np.minimum(np.where(usual > 0.0, spec.output_noise / np.where(usual > 0.0, usual, 1.0), 1.0), 1.0)


def current_limits(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> FloatArray:
    """Give the limit of the error index of each output at the last sample, (n_outputs,)."""
    noise, model = noise_of(spec, plan, state), indices_of(state.spread_sums)
    return limits_of(plan.settings, noise, model, max(state.running, 0))


def hitting_indices(contains: BoolArray, error: FloatArray) -> FloatArray:
    """Give the hitting index of each hypothesis, (n_hypotheses,).

    A hypothesis misses the conflict set of every tested set that contains it, and hits all others.
    contains: (n_hypotheses, n_tested); error: (n_tested,), parts of the signal.

    Source
    ------
    Thesis 6.6; `sets.hitting_index` says the same of one hypothesis.
    """
    clipped = np.minimum(error, CLIP)
    return np.asarray(np.where(contains, clipped, CLIP - clipped).sum(axis=1))


def cleared_parts(contains: BoolArray, explains: BoolArray) -> FloatArray:
    """Give what part of the tested sets that contain a hypothesis explain, (n_hypotheses,); 0 where none contains it.

    With 1 the hypothesis is left. contains: (n_hypotheses, n_tested); explains: (n_tested,).

    Source
    ------
    Thesis 6.4.2; `sets.hypotheses_left` gives the same as sets.
    """
    return np.asarray((contains & explains).sum(axis=1) / np.maximum(contains.sum(axis=1), 1))


def reason(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> Reasoning:
    """Reason from the tested sets about all hypotheses of the model."""
    indices = indices_of(state.sums)[:, 1:]
    error = indices.mean(axis=0)
    limit = current_limits(spec, plan, state)[:, None] / plan.settings.limit
    average = Erratum.AVERAGE in plan.settings.printed
    explains: BoolArray = np.asarray(error <= limit.mean() if average else (indices <= limit).all(axis=0))
    contains = plan.contains
    counts = np.maximum(contains.sum(axis=1), 1)
    order = np.sort(np.where(contains, error, np.inf), axis=1)
    quarter = order[np.arange(len(order)), (counts - 1) // 4] if order.size else np.zeros(len(order))
    return Reasoning(
        error=error,
        explains=explains,
        cleared=cleared_parts(contains, explains),
        hitting=hitting_indices(contains, error),
        quarter=quarter,
    )


def rank(spec: EngineSpec, plan: ClassicPlan, state: ClassicState) -> Diagnosis:
    """Give the hypotheses, best first.

    How bad a hypothesis is, in noise/signal ratios, is its error index and what it takes to believe it. The thesis
    gives no probabilities. The weights here fall by e for each noise/signal ratio.
    """
    found = reason(spec, plan, state)
    noise = max(float(noise_of(spec, plan, state).mean()), 1e-12)
    if Erratum.RANKING in plan.settings.printed:
        penalty = found.hitting / noise
    else:
        sizes = np.array([len(item) for item in spec.hypotheses], dtype=float)
        penalty = found.quarter / noise + SIZE * (sizes - 1.0) + REFUTED * (1.0 - found.cleared)
    penalty = np.where(state.rejected > 0, np.inf, penalty)
    order = np.argsort(penalty, kind="stable")[: min(MAX_CANDIDATES, int(np.isfinite(penalty).sum()))]
    weight = np.exp(np.min(penalty, initial=np.inf) - penalty) if len(order) else penalty
    total = float(weight.sum()) or 1.0
    candidates = tuple(
        Candidate(
            suspects=suspects_of(spec, plan, state, int(k)),
            probability=float(weight[k] / total),
            group=bool(penalty[k] <= penalty[order[0]] + ALIKE),
            hypothesis=int(k),
        )
        for k in order
    )
    return Diagnosis(time=state.time, candidates=candidates)


def suspects_of(spec: EngineSpec, plan: ClassicPlan, state: ClassicState, hypothesis: int) -> tuple[Suspect, ...]:
    """Give the suspects of a hypothesis with the mean of their estimates in all tested sets that contain it.

    Source
    ------
    Thesis 7.4. Ours: the standard deviation has a part from each estimate and one from how they differ.
    """
    chosen = spec.hypotheses[hypothesis]
    lanes = [int(k) + 1 for k in np.flatnonzero(plan.contains[hypothesis])]
    suspects = []
    for index in chosen:
        item = spec.parameters[index]
        slots = [plan.tested[lane - 1].index(index) for lane in lanes]
        values = state.factors[slots, lanes]
        variances = state.covariance[slots, slots, lanes]
        suspects.append(
            Suspect(
                parameter=item.name,
                component=item.component,
                nominal=item.nominal,
                estimate=float(item.scale * values.mean()),
                sd=float(abs(item.scale) * np.sqrt(max(float(variances.mean()), 0.0) + values.var())),
            )
        )
    return tuple(suspects)
