"""Sets that are too many to be tested: at most how likely it is that the truth is among them.

What a set S of the reserve can be worth is bounded from each tested set T within it. Its likelihood is that of T, times
what more suspects A = S - T can add, which is the larger of two things:

- what T's best lane knows of A. The lane has a narrow prior N(m, D) for them and a posterior N(p, P), so the data's
  information is L = 1/P - 1/D, about (p - m), h = (p - m)/P, and with the wide prior N(m, W) of suspects

      log gain = (h' (L + 1/W)^-1 h - log det (I + L W) - h' (L + 1/D)^-1 h + log det (I + L D)) / 2

  exactly so where the plant is linear;
- what is left to explain in T's lane: a sum s of its innovations over n samples is worth n (k + s/n)^2 / 2 nats, if
  these are a shift (k: drift of the sums). What the largest of m healthy sums may well be, log (2 m) / 2k, is worth
  nothing: each passes s with the probability exp (-2 k s), about.

The bound holds if a tested set is near enough to the truth to tell what the others would add. So there is none soon
after the bank was begun or renewed, where nothing explains the data, and where no step of a tested set is in the group:
a drift, or a fault of an instrument, that imitates a large set says nothing about it. A bound of a half and more is
none either. How often it is wrong is measured in docs/method.md.
"""

from functools import lru_cache
from itertools import combinations

import numpy as np

from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.findings import Untested
from faultbond.contract.lanes import extremes, plan_lanes
from faultbond.contract.spec import EngineSpec, covariance_place
from faultbond.runtime.bank import Bank
from faultbond.runtime.growing import factors
from faultbond.runtime.ranking import by_kind, lane_table, scores
from faultbond.types import FaultKind

OPEN = 0.5  # a bound from which on there is none
_STEP = tuple(FaultKind).index(FaultKind.STEP)
_LEAST = 1e-9  # information, in that of the narrow prior

Extensions = tuple[tuple[IntArray, IntArray, IntArray], ...]


def untested(spec: EngineSpec, bank: Bank, index: int, *, bounded: bool) -> Untested | None:
    """Give how many sets of the reserve are neither tested nor rejected, and a bound on their probability; 1: none.

    Parameters
    ----------
    spec : the model
    bank : its lanes; those of rejected sets have no likelihood
    index : number of the sample of now
    bounded : whether there may be a bound at all
    """
    if not spec.reserve:
        return None
    left = bank.rejected[spec.n_begun :] <= 0
    left[bank.grown[bank.grown >= 0].astype(np.intp)] = False
    if not np.any(left):
        return Untested(sets=0, probability=0.0)
    part = _part(spec, bank, index, left) if bounded else 1.0
    return Untested(sets=int(np.sum(left)), probability=part if part < OPEN else 1.0)


def _part(spec: EngineSpec, bank: Bank, index: int, left: BoolArray) -> float:
    """Give the probability that the truth is at most among the sets of the reserve that are left, (n_reserve,)."""
    score = scores(spec, bank)
    steps = by_kind(spec, bank)[:, _STEP] - lane_table(spec).costs
    rest = (most_likelihood(spec, bank, index) - spec.reserve_costs)[left]
    if steps.max() < score.max() - spec.thresholds.group_nats or np.any(np.isinf(rest)):
        return 1.0
    total = np.logaddexp.reduce(rest)
    return float(np.exp(total - np.logaddexp(total, np.logaddexp.reduce(score))))


def most_likelihood(spec: EngineSpec, bank: Bank, index: int) -> FloatArray:
    """Give what the likelihood (in logarithm) of each set of the reserve is at most, (n_reserve,); inf: not known."""
    plan = plan_lanes(spec)
    best, _ = extremes(plan, bank.steps[-1, : plan.n_lanes])
    lanes, left = bank.steps[:, best], _left_to_explain(spec, bank, best, index)
    likelihood = np.where(np.isfinite(lanes[-1]), lanes[-1], -np.inf)
    (mean,), (variance,) = factors(spec, bank.healthy)
    size = np.where([item.healthy for item in spec.parameters], np.abs(mean), 1.0)
    wide = (size * np.array([item.change for item in spec.parameters])) ** 2
    variance = np.maximum(variance, 1e-300)
    scale = np.sqrt(variance)
    most = np.full(len(spec.reserve), -np.inf)
    for rows, bases, more in _extensions(spec):
        off = (lanes[spec.parameter_slice][more, bases[:, None]] - mean[more]) / scale[more]
        places = _places(spec)[more[:, :, None], more[:, None, :]]
        spread = lanes[places, bases[:, None, None]] / (scale[more][:, :, None] * scale[more][:, None, :])
        gain = _gain(off, spread, (wide / variance)[more])
        np.maximum.at(most, rows, likelihood[bases] + np.maximum(gain, left[bases]))
    return np.where(np.isfinite(most), most, np.inf)


def _left_to_explain(spec: EngineSpec, bank: Bank, lanes: IntArray, index: int) -> FloatArray:
    """Give what the sums of lanes leave to be explained, nats, shape (n,)."""
    drift = spec.thresholds.cusum_drift
    sums = bank.misfit.sums[:, :, lanes]
    usual = np.log(2.0 * sums.shape[0] * sums.shape[1]) / (2.0 * drift)
    length = np.maximum(index - bank.misfit.since[:, :, lanes], 1.0)
    worth = np.where(sums > usual, 0.5 * length * (drift + sums / length) ** 2, 0.0)
    return np.asarray(worth.max(axis=0).sum(axis=0))


def _gain(off: FloatArray, spread: FloatArray, wide: FloatArray) -> FloatArray:
    """Give what more suspects would add to the likelihood of tested sets; in units in which their narrow prior is 1.

    Parameters
    ----------
    off : float array, shape (n, r)
        Posterior means less prior means.
    spread : float array, shape (n, r, r)
        Posterior covariances.
    wide : float array, shape (n, r)
        Variances of the wide prior.
    """
    usable = np.asarray(np.isfinite(spread).all(axis=(1, 2)) & np.isfinite(off).all(axis=1))
    values, vectors = np.linalg.eigh(np.where(usable[:, None, None], spread, np.eye(off.shape[1])))
    values = np.clip(values, 1e-12, 1.0 - _LEAST)
    told = np.einsum("nij,ni->nj", vectors, np.where(usable[:, None], off, 0.0)) / values
    known = 1.0 / values - 1.0
    narrow = 0.5 * np.sum(told**2 * values + np.log(values), axis=1)
    matrix = np.einsum("nij,nj,nkj->nik", vectors, known, vectors)
    matrix[:, range(off.shape[1]), range(off.shape[1])] += 1.0 / wide
    vector = np.einsum("nij,nj->ni", vectors, told)
    broad = np.sum(vector * np.linalg.solve(matrix, vector[:, :, None])[:, :, 0], axis=1)
    size = np.linalg.slogdet(matrix)[1] + np.sum(np.log(wide), axis=1)
    return np.where(usable, 0.5 * (broad - size) - narrow, -np.inf)


@lru_cache(maxsize=8)
def _extensions(spec: EngineSpec) -> Extensions:
    """Give how sets of the reserve follow from the largest tested sets within them, by the number of suspects added.

    Of each such number: the rows in the reserve (n,), the tested sets (n,), and what these lack (n, number).
    """
    place = {chosen: k for k, chosen in enumerate(spec.hypotheses)}
    found: dict[int, list[tuple[int, int, list[int]]]] = {}
    for row, chosen in enumerate(spec.reserve):
        for more in range(1, len(chosen)):
            parts = [part for part in combinations(chosen, len(chosen) - more) if part in place]
            if parts:
                found.setdefault(more, []).extend((row, place[part], sorted(set(chosen) - {*part})) for part in parts)
                break
    return tuple(
        (np.array(rows, dtype=np.intp), np.array(bases, dtype=np.intp), np.array(added, dtype=np.intp))
        for rows, bases, added in (zip(*items, strict=True) for items in found.values())
    )


@lru_cache(maxsize=8)
def _places(spec: EngineSpec) -> IntArray:
    """Give where the covariance of two parameters stands in a lane, (n_parameters, n_parameters)."""
    first, n = spec.parameter_slice.start, len(spec.parameters)
    return np.array(
        [[covariance_place(spec, first + min(i, j), first + max(i, j)) for j in range(n)] for i in range(n)],
        dtype=np.intp,
    )
