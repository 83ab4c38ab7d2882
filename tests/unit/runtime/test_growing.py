"""Sets that are not tested at once: their evidence in closed form, and lanes for the likeliest."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.runtime import growing
from faultbond.runtime.growing import GROWN, PER_SET, extend, factors, grow, n_grown
from faultbond.runtime.monitor import finish
from faultbond.runtime.ranking import scores
from faultbond.runtime.start import healthy_lane
from faultbond.runtime.state import Sample, State
from faultbond.runtime.trail import Trail
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from made import differing, plant, run, samples_of

_, MOTOR, ENGINE = plant("dc_motor_current")
SINGLES = tuple((k,) for k in range(5))
PAIRS = tuple(combinations(range(5), 2))
SPEC = replace(MOTOR, hypotheses=SINGLES, reserve=(*PAIRS, (0, 1, 2)))
FAULTS = (Fault(parameter="R", factor=2.0, start=3.0), Fault(parameter="J", factor=1.5, start=3.0))


def evidence(slopes: FloatArray, y: FloatArray, sds: FloatArray) -> tuple[float, FloatArray, FloatArray]:
    """Log-density of readings y = slopes @ d + unit noise with d ~ N(0, sds^2); mean and variance of d given y."""
    spread = slopes @ np.diag(sds**2) @ slopes.T + np.eye(len(y))
    gain = np.diag(sds**2) @ slopes.T @ np.linalg.inv(spread)
    _, size = np.linalg.slogdet(2.0 * np.pi * spread)
    rest = np.diag(sds**2) - gain @ slopes @ np.diag(sds**2)
    return float(-0.5 * (y @ np.linalg.solve(spread, y) + size)), gain @ y, np.diag(rest)


@cache
def linear() -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """A linear plant with two faults: slopes, readings, a healthy lane, narrow and wide sds of the factors."""
    generator = np.random.default_rng(6)
    healthy = healthy_lane(SPEC, np.zeros(2), np.eye(2))[:, 0]
    healthy[SPEC.parameter_slice] = generator.uniform(0.9, 1.1, 5)
    narrow = np.array([item.accuracy for item in SPEC.parameters])
    wide = healthy[SPEC.parameter_slice] * np.array([item.change for item in SPEC.parameters])
    slopes = generator.normal(0.0, 8.0, (15, 5))
    truth = np.array([0.4, 0.01, -0.02, -0.3, 0.0])
    return slopes, slopes @ truth + generator.normal(size=15), healthy, narrow, wide


def known_singles() -> growing.Tested:
    """What lanes of single sets would know of the linear plant."""
    slopes, y, healthy, narrow, wide = linear()
    found = [evidence(slopes, y, np.where(np.arange(5) == k, wide, narrow)) for k in range(5)]
    return growing.Tested(
        sets=SINGLES,
        likelihood=np.array([item[0] for item in found]),
        mean=np.array([item[1] for item in found]) + healthy[SPEC.parameter_slice],
        variance=np.array([item[2] for item in found]),
    )


def test_factors_are_those_of_the_lanes() -> None:
    """Means and variances of parameters are read from lanes."""
    healthy = linear()[2]
    (mean,), (variance,) = factors(SPEC, healthy[:, None])
    assert np.array_equal(mean, healthy[SPEC.parameter_slice])
    assert variance == pytest.approx(np.array([item.accuracy for item in SPEC.parameters]) ** 2)


def test_the_closed_form_is_exact_where_the_plant_is_linear() -> None:
    """The likelihood of a pair, from lanes that have one of the two, is the evidence of the pair itself."""
    slopes, y, healthy, narrow, wide = linear()
    found = extend(SPEC, known_singles(), healthy)
    for row, chosen in enumerate(PAIRS):
        exact, _, _ = evidence(slopes, y, np.where(np.isin(np.arange(5), chosen), wide, narrow))
        assert found.likelihood[row] == pytest.approx(exact, abs=1e-6)


def test_the_value_of_a_further_suspect_is_what_the_data_say_alone() -> None:
    """In a set of the reserve the new suspect has the value without any prior; the others that of the lane."""
    slopes, y, healthy, narrow, wide = linear()
    every = known_singles()
    alone = growing.Tested(
        sets=SINGLES[:1], likelihood=every.likelihood[:1], mean=every.mean[:1], variance=every.variance[:1]
    )
    values = extend(SPEC, alone, healthy).values[PAIRS.index((0, 3))]
    free = np.array([wide[0], narrow[1], narrow[2], 1e4, narrow[4]])
    assert values[3] == pytest.approx(healthy[SPEC.parameter_slice][3] + evidence(slopes, y, free)[1][3], rel=1e-5)
    assert np.array_equal(values[[0, 1, 2, 4]], every.mean[0, [0, 1, 2, 4]])


def test_a_set_that_extends_no_tested_one_is_not_told() -> None:
    """A set of three beside tested sets of one has no likelihood, and the healthy values."""
    healthy = linear()[2]
    found = extend(SPEC, known_singles(), healthy)
    assert found.likelihood[-1] == -np.inf
    assert np.array_equal(found.values[-1], healthy[SPEC.parameter_slice])


def test_no_more_grow_than_can_be_tested() -> None:
    """Of a large reserve only the likeliest are tested; of a small one all."""
    assert n_grown(SPEC) == len(PAIRS) + 1
    assert n_grown(replace(SPEC, reserve=PAIRS * 10)) == GROWN
    assert n_grown(MOTOR) == 0


@cache
def recording() -> tuple[Sample, ...]:
    """The motor with two faults at once."""
    time = np.asarray(np.arange(480) * 0.02, dtype=np.float64)
    voltage = random_steps(time, np.random.default_rng(6), low=2, high=12, shortest=0.5, longest=1.5)
    made = simulate(plant("dc_motor_current")[0], Inputs(time=time, values=voltage[:, None]), FAULTS, seed=12)
    return samples_of(time, made.inputs, made.outputs)


@cache
def ended(spec: EngineSpec) -> State:
    """The state at the end."""
    return run(spec, ENGINE, recording())[0]


def test_the_true_set_is_found_in_the_reserve() -> None:
    """Two faults at once, of which no pair was begun at the alarm: the pair is grown, is first, and has its values."""
    state = ended(SPEC)
    diagnosis = finish(SPEC, state)
    assert diagnosis is not None
    best = diagnosis.candidates[0]
    assert best.components == ("R", "J")
    assert best.hypothesis == SPEC.n_begun + PAIRS.index((0, 3))
    assert best.probability > 0.9
    assert SPEC.members(best.hypothesis) == (0, 3)
    for suspect, value in zip(best.suspects, (6.0, 2.25), strict=True):
        assert suspect.estimate == pytest.approx(value, abs=4.0 * suspect.sd)
        assert suspect.sd < 0.1 * value
    assert diagnosis.unexplained is None


def test_before_they_are_chosen_sets_of_the_reserve_do_not_count() -> None:
    """Until the bank is renewed, sets of the reserve have no score, and it is told how many they are."""
    state, _ = run(SPEC, ENGINE, recording()[: ended(SPEC).clock.alarm + 25])
    diagnosis = finish(SPEC, state)
    assert diagnosis is not None
    assert np.all(state.bank.grown == -1.0)
    assert np.all(scores(SPEC, state.bank)[SPEC.n_begun :] == -np.inf)
    assert {item.hypothesis for item in diagnosis.candidates} == set(range(SPEC.n_begun))
    assert diagnosis.untested is not None
    assert diagnosis.untested.sets == len(SPEC.reserve)


def test_once_all_are_tested_nothing_is_hidden() -> None:
    """When every set of the reserve has lanes, none is left that could hide anything."""
    state = ended(SPEC)
    diagnosis = finish(SPEC, state)
    assert diagnosis is not None
    assert diagnosis.untested is not None
    assert (diagnosis.untested.sets, diagnosis.untested.probability) == (0, 0.0)
    assert sorted(state.bank.grown) == list(range(len(SPEC.reserve)))
    assert state.bank.steps.shape[1] == run_width(SPEC)


def run_width(spec: EngineSpec) -> int:
    """Lanes of steps of the singles, and of all that can grow."""
    alone = replace(spec, reserve=())
    return int(ended(alone).bank.steps.shape[1]) + PER_SET * n_grown(spec)


def test_a_reserve_is_saved_too() -> None:
    """Saved and restored before sets are chosen, the run goes on to the same end, to the last bit."""
    whole = ended(SPEC)
    middle, _ = run(SPEC, ENGINE, recording()[: whole.clock.alarm + 25])
    restored = State.restore({key: value.copy() for key, value in middle.save().items()})
    again, _ = run(SPEC, ENGINE, recording()[whole.clock.alarm + 25 :], restored)
    assert not differing(again, whole)


def test_the_likeliest_sets_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Sets are chosen by likelihood less the cost of their suspects."""
    monkeypatch.setattr(growing, "GROWN", 3)
    state, _ = run(SPEC, ENGINE, recording()[: ended(SPEC).clock.alarm + 1])
    rows = slice(state.past.place(state.clock.alarm - 20), None)
    trail = Trail(samples=state.past.samples[rows], lanes=state.past.lanes[rows])
    likelihood = np.full(len(SPEC.reserve), -99.0)
    likelihood[[2, 7, 4, 10]] = [-50.0, -40.0, -45.0, -46.5]  # the last is the set of three
    values = np.tile(trail.lanes[0, SPEC.parameter_slice], (len(SPEC.reserve), 1))
    none = np.full((SPEC.n_numbers, 3 * PER_SET), np.nan)
    lanes, chosen = grow(SPEC, ENGINE, trail, growing.Extended(likelihood=likelihood, values=values), none, -np.ones(3))
    assert chosen.tolist() == [7, 4, 2]
    likelihood[10] = -44.0
    _, chosen = grow(SPEC, ENGINE, trail, growing.Extended(likelihood=likelihood, values=values), none, -np.ones(3))
    assert chosen.tolist() == [7, 4, 10]
    assert lanes.shape == (SPEC.n_numbers, 3 * PER_SET)
    assert np.all(np.isfinite(lanes))


def test_a_grown_set_is_as_good_as_one_begun_at_the_alarm() -> None:
    """From the first renewal on, and after each further one, the pair is first, with the estimates it has if begun."""
    whole = replace(MOTOR, hypotheses=(*SINGLES, *PAIRS))
    alarm = ended(SPEC).clock.alarm
    states = [run(spec, ENGINE, recording()[: alarm + 35])[0] for spec in (whole, SPEC)]
    for last in (alarm + 98, alarm + 110, alarm + 210):
        found = []
        for k, spec in enumerate((whole, SPEC)):
            states[k], _ = run(spec, ENGINE, recording()[states[k].clock.index : last], states[k])
            diagnosis = finish(spec, states[k])
            assert diagnosis is not None
            found.append(diagnosis.candidates[0])
        assert all(item.components == ("R", "J") for item in found)
        for one, two in zip(found[0].suspects, found[1].suspects, strict=True):
            assert one.estimate == pytest.approx(two.estimate, abs=0.25 * one.sd)
            assert one.sd == pytest.approx(two.sd, rel=0.2)
