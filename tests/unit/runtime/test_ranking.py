"""Ranking of hypotheses from the numbers of their lanes."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, pack
from faultbond.runtime.bank import Bank, no_bank
from faultbond.runtime.ranking import MAX_CANDIDATES, leading_lane, rank, scores
from faultbond.types import FaultKind
from made import plant

SPEC = plant("dc_motor_current")[1]  # 25 sets of up to three suspects; two sensors and an input
STEPS, SLOTS = plan_lanes(SPEC).n_lanes, plan_slots(SPEC).n_lanes
LOST = np.full(SLOTS, -np.inf)  # where only steps matter


def bank_with(spec: EngineSpec, likelihoods: FloatArray) -> Bank:
    """A bank with these log-likelihoods, whose numbers tell the lane: factors and variances."""
    slots = lanes_with(spec.slotted, likelihoods[plan_lanes(spec).n_lanes :])
    slots[spec.slotted.loop_slice.stop : -1] = plan_slots(spec).roles
    steps = lanes_with(spec, likelihoods[: plan_lanes(spec).n_lanes])
    return replace(no_bank(spec), steps=steps, slots=slots)


def lanes_with(spec: EngineSpec, likelihoods: FloatArray) -> FloatArray:
    """Lanes with these log-likelihoods, whose parameter factors and variances tell the lane."""
    lanes = np.zeros((spec.n_numbers, len(likelihoods)))
    for lane in range(len(likelihoods)):
        factors = 1.0 + 0.01 * lane + 0.1 * np.arange(len(spec.parameters))
        lanes[spec.parameter_slice, lane] = factors
        variances = np.zeros(spec.n_joint)
        variances[spec.parameter_slice] = (0.001 * (1 + lane) + 0.0001 * np.arange(len(spec.parameters))) ** 2
        lanes[spec.covariance_slice, lane] = pack(np.diag(variances))
    lanes[-1] = likelihoods
    return lanes


def by_hand(spec: EngineSpec, likelihoods: FloatArray) -> list[float]:
    """Score of each hypothesis: logarithm of its likelihood, less the cost of its suspects.

    The likelihood is the mean over the starts of steps, and that of each other lane times its prior weight.
    """
    steps, slots, found = plan_lanes(spec), plan_slots(spec), []
    top, n = likelihoods.max(), steps.n_lanes
    prices = spec.thresholds
    costs = [prices.cost_per_suspect * len(chosen) for chosen in spec.hypotheses]
    costs += [prices.cost_per_sensor if item.is_output else prices.cost_per_suspect for item in spec.instruments]
    for k, cost in enumerate(costs):
        mean = np.mean(np.exp(likelihoods[:n][steps.hypothesis == k] - top)) if k < len(spec.hypotheses) else 0.0
        for lane, likelihood in zip(slots.lanes, likelihoods[n:], strict=True):
            mean += np.exp(lane.weight + likelihood - top) if lane.hypothesis == k else 0.0
        found.append(float(np.log(mean) + top - cost))
    return found


def named(spec: EngineSpec) -> dict[tuple[str, ...], int]:
    """Number of the hypothesis with these components at fault."""
    sets = [tuple(spec.parameters[index].component for index in chosen) for chosen in spec.hypotheses]
    return {names: k for k, names in enumerate([*sets, *((item.name,) for item in spec.instruments)])}


@given(st.integers(0, 10**6), st.floats(0.1, 200.0))
@settings(max_examples=40, deadline=None)
def test_probabilities_and_groups(seed: int, spread: float) -> None:
    """Probabilities are as the exponents of the scores and add up to 1; the group is within three nats."""
    likelihoods = np.random.default_rng(seed).normal(-5000.0, spread, STEPS + SLOTS)
    diagnosis = rank(SPEC, 7.0, bank_with(SPEC, likelihoods))
    with np.errstate(divide="ignore"):
        expected, index = by_hand(SPEC, likelihoods), named(SPEC)
    assert diagnosis.time == 7.0
    assert len(diagnosis.candidates) == SPEC.n_hypotheses == len(SPEC.hypotheses) + 3
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0, rel=1e-12)
    assert [item.probability for item in diagnosis.candidates] == sorted(
        (item.probability for item in diagnosis.candidates), reverse=True
    )
    best = max(expected)
    total = sum(np.exp(value - best) for value in expected)
    for item in diagnosis.candidates:
        score = expected[index[item.components]]
        assert item.probability == pytest.approx(np.exp(score - best) / total, rel=1e-6, abs=1e-12)
        if abs(best - score - 3.0) > 1e-6:
            assert item.group == (best - score < 3.0)


def test_estimate_is_that_of_the_best_start() -> None:
    """The estimate and its sd are those of the start with the greatest likelihood, in SI."""
    plan = plan_lanes(SPEC)
    likelihoods = np.random.default_rng(3).normal(-100.0, 20.0, plan.n_lanes)
    index = named(SPEC)
    for item in rank(SPEC, 0.0, bank_with(SPEC, np.append(likelihoods, LOST))).candidates:
        k = index[item.components]
        if k >= len(SPEC.hypotheses):
            assert item.probability == 0.0
            continue
        assert item.kind is FaultKind.STEP
        own = np.flatnonzero(plan.hypothesis == k)
        lane = own[np.argmax(likelihoods[own])]
        for suspect, place in zip(item.suspects, SPEC.hypotheses[k], strict=True):
            nominal = SPEC.parameters[place].nominal
            assert suspect.component == SPEC.parameters[place].component
            assert suspect.nominal == nominal
            assert suspect.estimate == pytest.approx(nominal * (1.0 + 0.01 * lane + 0.1 * place), rel=1e-12)
            assert suspect.sd == pytest.approx(nominal * (0.001 * (1 + lane) + 0.0001 * place), rel=1e-9)


@given(st.integers(0, 10**6), st.floats(0.1, 20.0))
@settings(max_examples=30, deadline=None)
def test_kinds_of_a_set(seed: int, spread: float) -> None:
    """Kinds share the probability of their set as their lanes are likely; the likeliest gives the estimate."""
    likelihoods = np.random.default_rng(seed).normal(-300.0, spread, STEPS + SLOTS)
    bank, plan, index = bank_with(SPEC, likelihoods), plan_lanes(SPEC), named(SPEC)
    weights = [*(-np.log(np.sum(plan.hypothesis == k)) for k in plan.hypothesis), *plan_slots(SPEC).weight]
    kinds = [*[FaultKind.STEP] * STEPS, *(lane.kind for lane in plan_slots(SPEC).lanes)]
    sets = [*plan.hypothesis, *plan_slots(SPEC).hypothesis]
    for item in rank(SPEC, 0.0, bank).candidates:
        own = [lane for lane, k in enumerate(sets) if k == index[item.components]]
        parts = dict.fromkeys((kinds[lane] for lane in own), 0.0)
        for lane in own:
            parts[kinds[lane]] += float(np.exp(likelihoods[lane] + weights[lane] + 300.0))
        total = sum(parts.values())
        assert dict(item.kinds) == pytest.approx({kind: part / total for kind, part in parts.items()}, rel=1e-6)
        assert [share for _, share in item.kinds] == sorted((share for _, share in item.kinds), reverse=True)
        assert item.kind is item.kinds[0][0]
    best = rank(SPEC, 0.0, bank).candidates[0]
    own = [k for k in range(STEPS + SLOTS) if sets[k] == index[best.components] and kinds[k] is best.kind]
    assert leading_lane(SPEC, bank) == max(own, key=lambda lane: likelihoods[lane] + weights[lane])


def test_lost_lanes_do_not_count() -> None:
    """A start whose likelihood is no number adds nothing to its hypothesis and is not the one that is reported."""
    plan = plan_lanes(SPEC)
    likelihoods = np.full(plan.n_lanes, -100.0)
    own = np.flatnonzero(plan.hypothesis == 2)
    lost = np.append(likelihoods, LOST)
    lost[own[0]] = np.nan
    lost[own[1]] = -np.inf
    found = scores(SPEC, bank_with(SPEC, lost))
    assert np.all(np.isfinite(found))
    assert found[2] == pytest.approx(-100.0 + np.log((len(own) - 2) / len(own)) - 5.0)
    bank = bank_with(SPEC, lost)
    bank.steps[:-1, own[0]] = np.nan
    assert all(np.isfinite(s.estimate) for item in rank(SPEC, 0.0, bank).candidates for s in item.suspects)


def test_a_hypothesis_without_any_number_is_last() -> None:
    """A hypothesis all of whose starts are lost has probability zero, and the others share the rest."""
    likelihoods = np.full(STEPS + SLOTS, -100.0)
    likelihoods[:STEPS][plan_lanes(SPEC).hypothesis == 0] = np.nan
    likelihoods[STEPS:][plan_slots(SPEC).hypothesis == 0] = np.nan
    diagnosis = rank(SPEC, 0.0, bank_with(SPEC, likelihoods))
    assert diagnosis.candidates[-1].probability == 0.0
    assert diagnosis.candidates[-1].parameters == (SPEC.parameters[SPEC.hypotheses[0][0]].name,)
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0)
    assert diagnosis.candidates[-2].probability > 0.0
    for item in diagnosis.candidates:
        assert sum(share for _, share in item.kinds) == pytest.approx(1.0)


def test_smaller_sets_win_a_tie() -> None:
    """Where two sets explain the data alike, the smaller one is more probable by the cost of one suspect."""
    found = scores(SPEC, bank_with(SPEC, np.append(np.zeros(STEPS), LOST)))
    by_size = {len(chosen): value for chosen, value in zip(SPEC.hypotheses, found, strict=False)}
    assert by_size[1] - by_size[2] == pytest.approx(SPEC.thresholds.cost_per_suspect)
    assert by_size[2] - by_size[3] == pytest.approx(SPEC.thresholds.cost_per_suspect)


def test_an_instrument_that_explains_as_well_weighs_by_its_cost() -> None:
    """Where all lanes say the same, a sensor is as probable as its cost says, an input 0.3 times as a parameter.

    Lanes of what comes and goes are left out: they are what each hypothesis has besides.
    """
    likelihoods = np.zeros(STEPS + SLOTS)
    rare = [lane.hypothesis < len(SPEC.hypotheses) for lane in plan_slots(SPEC).lanes]
    rare = [out or lane.kind is FaultKind.INTERMITTENT for out, lane in zip(rare, plan_slots(SPEC).lanes, strict=True)]
    likelihoods[STEPS:][rare] = -np.inf
    found = scores(SPEC, bank_with(SPEC, likelihoods))
    more = SPEC.thresholds.cost_per_suspect - SPEC.thresholds.cost_per_sensor
    assert found[len(SPEC.hypotheses) :] == pytest.approx([found[0] + more, found[0] + more, found[0] + np.log(0.3)])


def test_at_most_a_hundred_candidates() -> None:
    """Of more than a hundred sets the best hundred are given, with probabilities that count all sets."""
    sets = tuple(SPEC.hypotheses[k % 5] for k in range(MAX_CANDIDATES + 20))
    spec = replace(SPEC, hypotheses=sets)
    likelihoods = np.append(np.zeros(plan_lanes(spec).n_lanes), np.full(plan_slots(spec).n_lanes, -np.inf))
    diagnosis = rank(spec, 0.0, bank_with(spec, likelihoods))
    assert len(diagnosis.candidates) == MAX_CANDIDATES
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(MAX_CANDIDATES / len(sets))
