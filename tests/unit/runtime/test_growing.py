"""Sets that are not tested at once: those that the data ask for get lanes of their own, and are found."""

from dataclasses import replace
from functools import cache
from itertools import combinations

import numpy as np
import pytest

from faultbond.contract.reserve import GROWN, n_grown
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_core
from made import differing, graph_of, run, samples_of, spec_of

MOTOR = spec_of("dc_motor_current")
SINGLES = tuple((k,) for k in range(5))
PAIRS = tuple(combinations(range(5), 2))
SPEC = replace(MOTOR, hypotheses=SINGLES, reserve=(*PAIRS, (0, 1, 2)))
FAULTS = (Fault(parameter="R", factor=2.0, start=3.0), Fault(parameter="J", factor=1.5, start=3.0))


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
    made = simulate(graph_of("dc_motor_current"), Inputs(time=time, values=voltage[:, None]), FAULTS, seed=12)
    return samples_of(time, made.inputs, made.outputs)


@cache
def core(spec: EngineSpec = SPEC) -> Core:
    """The core of the motor with these sets."""
    return build_core(build_plant(graph_of("dc_motor_current")), spec)


@cache
def ended() -> Monitor:
    """The monitor at the end."""
    return run(core(), recording())[0]


ALARMED = 25  # samples after the alarm, before anything is renewed


def middle() -> Monitor:
    """The monitor soon after the alarm."""
    return run(core(), recording()[: int(ended().number("clock.alarm")) + ALARMED])[0]


def test_the_true_set_is_found_in_the_reserve() -> None:
    """Two faults at once, of which no pair was begun at the alarm: the pair is grown, is first, and has its values."""
    diagnosis = ended().conclude()
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
    """Until the bank is renewed, sets of the reserve are no candidates, and it is told how many they are."""
    monitor = middle()
    diagnosis = monitor.conclude()
    assert np.all(monitor.numbers("bank.grown") == -1.0)
    assert {item.hypothesis for item in diagnosis.candidates} == set(range(SPEC.n_begun))
    assert diagnosis.untested is not None
    assert diagnosis.untested.sets == len(SPEC.reserve)


def test_once_all_are_tested_nothing_is_hidden() -> None:
    """When every set of the reserve has lanes, none is left that could hide anything."""
    diagnosis = ended().conclude()
    assert diagnosis.untested is not None
    assert (diagnosis.untested.sets, diagnosis.untested.probability) == (0, 0.0)
    assert sorted(ended().numbers("bank.grown")) == list(range(len(SPEC.reserve)))


def test_a_reserve_is_saved_too() -> None:
    """Saved and restored before and after sets are chosen, the run goes on to the same end, to the last bit."""
    begun = middle()
    later, _ = run(core(), recording()[int(begun.number("clock.index")) :][:30], begun)
    assert np.all(later.numbers("bank.grown") >= 0.0)
    for monitor in (begun, later):
        restored = Monitor(core(), monitor.save())
        assert not differing(restored, monitor)
        again, _ = run(core(), recording()[int(monitor.number("clock.index")) :], restored)
        assert not differing(again, ended())


def test_a_grown_set_is_as_good_as_one_begun_at_the_alarm() -> None:
    """From the first renewal on, and after each further one, the pair is first, with the estimates it has if begun."""
    whole = replace(MOTOR, hypotheses=(*SINGLES, *PAIRS))
    alarm = int(ended().number("clock.alarm"))
    monitors = [run(core(spec), recording()[: alarm + 35])[0] for spec in (whole, SPEC)]
    for last in (alarm + 98, alarm + 110, alarm + 210):
        found = []
        for monitor in monitors:
            for sample in recording()[int(monitor.number("clock.index")) : last]:
                monitor.step(sample)
            found.append(monitor.conclude().candidates[0])
        assert all(item.components == ("R", "J") for item in found)
        for one, two in zip(found[0].suspects, found[1].suspects, strict=True):
            assert one.estimate == pytest.approx(two.estimate, abs=0.25 * one.sd)
            assert one.sd == pytest.approx(two.sd, rel=0.2)
