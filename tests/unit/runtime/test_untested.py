"""What untested sets may hide: a bound on their evidence, and when there is none."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest
from test_growing import evidence, linear

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Diagnosis, Untested
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import EngineSpec, pack
from faultbond.runtime import untested as hidden
from faultbond.runtime.accepting import find_hypothesis, reject
from faultbond.runtime.bank import Bank, no_bank
from faultbond.runtime.monitor import finish
from faultbond.runtime.ranking import scores
from faultbond.runtime.state import Sample, State
from faultbond.runtime.untested import most_likelihood, untested
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from made import plant, run, samples_of

GRAPH, MOTOR, ENGINE = plant("dc_motor_current")
SINGLES = tuple((k,) for k in range(5))
PAIRS, TRIPLES = tuple(combinations(range(5), 2)), tuple(combinations(range(5), 3))
WHOLE = replace(MOTOR, hypotheses=(*SINGLES, *PAIRS, *TRIPLES))
WAITING = replace(MOTOR, hypotheses=(*SINGLES, *PAIRS), reserve=TRIPLES)
FEW = replace(MOTOR, hypotheses=SINGLES, reserve=(*PAIRS, *TRIPLES))


@pytest.fixture(autouse=True)
def _nothing_grows(monkeypatch: pytest.MonkeyPatch) -> None:
    """Keep all of a reserve untested."""
    monkeypatch.setattr("faultbond.runtime.growing.GROWN", 0)


@cache
def three_faults() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """The linear plant of the growing tests, with three faults."""
    slopes, _, healthy, narrow, wide = linear()
    y = slopes @ np.array([0.4, -0.35, 0.02, -0.3, 0.01]) + np.random.default_rng(8).normal(size=len(slopes))
    return slopes, y, healthy, narrow, wide


def known(spec: EngineSpec) -> Bank:
    """A bank whose lanes know of this plant what its tested sets would."""
    slopes, y, healthy, narrow, wide = three_faults()
    bank = no_bank(spec)
    steps = bank.steps.copy()
    plan = plan_lanes(spec)
    for k, chosen in enumerate(spec.hypotheses):
        likelihood, mean, _ = evidence(slopes, y, np.where(np.isin(np.arange(5), chosen), wide, narrow))
        prior = np.diag(np.where(np.isin(np.arange(5), chosen), wide, narrow) ** 2)
        full = np.eye(spec.n_joint)
        full[spec.parameter_slice, spec.parameter_slice] = np.linalg.inv(np.linalg.inv(prior) + slopes.T @ slopes)
        lanes = np.flatnonzero(plan.hypothesis == k)
        steps[spec.parameter_slice, lanes[0]] = mean + healthy[spec.parameter_slice]
        steps[spec.covariance_slice, lanes[0]] = pack(full)
        steps[-1, lanes] = -np.inf
        steps[-1, lanes[0]] = likelihood
    return replace(bank, steps=steps, healthy=healthy[:, None])


@pytest.mark.parametrize("spec", [WAITING, FEW])
def test_where_the_plant_is_linear_the_bound_is_reached(spec: EngineSpec) -> None:
    """Of sets with one and with two more suspects than are tested, the evidence is that of the set itself.

    It is less than that of the tested set where the data say nothing of the others; then the bound is the latter.
    """
    slopes, y, _, narrow, wide = three_faults()
    most = most_likelihood(spec, known(spec), 100)
    exact = {
        chosen: evidence(slopes, y, np.where(np.isin(np.arange(5), chosen), wide, narrow))[0]
        for chosen in (*SINGLES, *PAIRS, *TRIPLES)
    }
    reached = 0
    for bound, chosen in zip(most, spec.reserve, strict=True):
        size = max(len(item) for item in spec.hypotheses)
        parts = [exact[part] for part in combinations(chosen, size)]
        assert bound == pytest.approx(max(exact[chosen], *parts), abs=1e-6)
        reached += exact[chosen] > max(parts)
    assert 0 < reached < len(spec.reserve)


def test_what_is_left_to_explain_counts() -> None:
    """A sum of 6 in 10 samples is a shift of 0.9 sd, worth 10 * 0.9^2 / 2 nats; one that chance makes is worth none."""
    bank = known(WAITING)
    plain = most_likelihood(WAITING, bank, 100)
    sums, since = bank.misfit.sums.copy(), np.full_like(bank.misfit.since, 90.0)
    sums[0, 1, :] = 6.0
    sums[1, 1, :] = 3.5
    sums[:, 0, :] = 3.4  # the largest of four sums is more with a probability of a half
    more = most_likelihood(WAITING, replace(bank, misfit=replace(bank.misfit, sums=sums, since=since)), 100)
    base = np.array([max(bank.steps[-1, plan_lanes(WAITING).first[5 + k]] for k in held(row)) for row in TRIPLES])
    assert more == pytest.approx(np.maximum(plain, base + 10 * 0.9**2 / 2), abs=1e-6)


def held(triple: tuple[int, ...]) -> list[int]:
    """The pairs in a triple, by number."""
    return [k for k, pair in enumerate(PAIRS) if set(pair) < set(triple)]


def test_a_lane_that_is_no_number_bounds_nothing() -> None:
    """A tested set without a likelihood or covariance is passed over; where none is left, nothing is known."""
    bank = known(WAITING)
    plain, steps = most_likelihood(WAITING, bank, 100), bank.steps.copy()
    first = plan_lanes(WAITING).first
    steps[:, first[5 + held(TRIPLES[0])[0]]] = np.nan
    assert np.all(most_likelihood(WAITING, replace(bank, steps=steps), 100) <= plain + 1e-9)
    for k in held(TRIPLES[0]):
        steps[:, first[5 + k]] = np.nan
    broken = most_likelihood(WAITING, replace(bank, steps=steps), 100)
    assert np.flatnonzero(np.isinf(broken)).tolist() == [0]
    assert untested(WAITING, replace(bank, steps=steps), 100, bounded=True) == Untested(
        sets=len(TRIPLES), probability=1.0
    )


@cache
def recording(faults: tuple[Fault, ...], seed: int) -> tuple[Sample, ...]:
    """The motor with faults at 3 s."""
    time = np.asarray(np.arange(420) * 0.02, dtype=np.float64)
    voltage = random_steps(time, np.random.default_rng(seed), low=2, high=12, shortest=0.5, longest=1.5)
    made = simulate(GRAPH, Inputs(time=time, values=voltage[:, None]), faults, seed=seed)
    return samples_of(time, made.inputs, made.outputs)


def fault(name: str, factor: float) -> Fault:
    """A parameter that changes."""
    return Fault(parameter=name, factor=factor, start=3.0)


ONE, TWO = (fault("R", 1.5),), (fault("R", 1.5), fault("J", 1.25))
THREE = (fault("R", 2.0), fault("J", 1.5), fault("K", 0.8))


@cache
def diagnosed(spec: EngineSpec, faults: tuple[Fault, ...]) -> tuple[Diagnosis, ...]:
    """All diagnoses of a run."""
    return tuple(item.diagnosis for item in run(spec, ENGINE, recording(faults, 3))[1] if item.diagnosis is not None)


@pytest.mark.parametrize("faults", [ONE, TWO, THREE])
@pytest.mark.parametrize("spec", [WAITING, FEW])
def test_what_is_hidden_stays_below_the_bound(spec: EngineSpec, faults: tuple[Fault, ...]) -> None:
    """Where all sets are tested, those that are not tested here never have more than the bound, whatever is true.

    There is a bound if the truth is tested, and none if it is not.
    """
    size, bounds = len(spec.hypotheses[-1]), []
    for told, true in zip(diagnosed(spec, faults), diagnosed(WHOLE, faults), strict=True):
        assert told.untested is not None
        bounds.append(told.untested.probability)
        assert sum(item.probability for item in true.candidates if len(item.parameters) > size) <= bounds[-1] + 1e-9
    assert len(bounds) > 5
    assert (min(bounds) < hidden.OPEN) is (len(faults) <= size)


@cache
def ended(spec: EngineSpec, last: int = 420) -> State:
    """The state at the end of a run with one fault."""
    return run(spec, ENGINE, recording(ONE, 3)[:last])[0]


def test_after_each_renewal_there_is_no_bound_for_a_while() -> None:
    """Lanes that began just now have no sums that could tell how far off they are."""
    alarm = ended(WAITING).clock.alarm
    for later, bounded in ((25, False), (55, False), (70, True), (125, False), (140, True)):
        diagnosis = finish(WAITING, ended(WAITING, alarm + later))
        assert diagnosis is not None
        assert diagnosis.untested is not None
        assert (diagnosis.untested.probability < 1.0) is bounded


def test_where_no_step_is_in_the_group_there_is_no_bound() -> None:
    """A sensor that leads by more than a group's width says nothing of large sets."""
    state = ended(WAITING)
    bank = state.bank
    known_part = untested(WAITING, bank, state.clock.index, bounded=True)
    slots = bank.slots.copy()
    slots[-1] = scores(WAITING, bank).max() + 30.0
    assert known_part is not None
    assert known_part.probability < hidden.OPEN
    assert untested(WAITING, replace(bank, slots=slots), state.clock.index, bounded=True) == Untested(
        sets=len(TRIPLES), probability=1.0
    )


def test_rejected_sets_hide_nothing() -> None:
    """Sets that contain a rejected one are not counted any more; where all are rejected, nothing is hidden."""
    state, _ = reject(WAITING, ended(WAITING), find_hypothesis(WAITING, ["C"]))
    diagnosis = finish(WAITING, state)
    assert diagnosis is not None
    assert diagnosis.untested is not None
    assert diagnosis.untested.sets == len([item for item in TRIPLES if 4 not in item]) == 4
    gone = np.zeros(WAITING.n_hypotheses)
    gone[WAITING.n_begun :] = 1.0
    assert untested(WAITING, replace(state.bank, rejected=gone), state.clock.index, bounded=True) == Untested(
        sets=0, probability=0.0
    )
    assert untested(WHOLE, ended(WHOLE).bank, state.clock.index, bounded=True) is None
