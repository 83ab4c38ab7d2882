"""What untested sets may hide: a bound on their probability, and when there is none."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Diagnosis, Untested
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.monitor import Monitor
from faultbond.runtime.names import find_hypothesis
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from made import Course, changed, run, samples_of
from motor_sets import FEW, GRAPH, TRIPLES, WAITING, WHOLE, core_of

OPEN = 0.5  # a bound from which on there is none


@cache
def recording(faults: tuple[Fault, ...], seed: int, rows: int = 420) -> tuple[Sample, ...]:
    """The motor with faults at 3 s."""
    time = np.asarray(np.arange(rows) * 0.02, dtype=np.float64)
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
    """All diagnoses of a run in which no set of the reserve is tested."""
    reports = run(core_of(spec), recording(faults, 3))[1]
    return tuple(item.diagnosis for item in reports if item.diagnosis is not None)


@pytest.mark.parametrize("faults", [ONE, TWO, THREE])
@pytest.mark.parametrize("spec", [WAITING, FEW])
def test_what_is_hidden_stays_below_the_bound(spec: EngineSpec, faults: tuple[Fault, ...]) -> None:
    """Where all sets are tested, those that are not tested here never have more than the bound, whatever is true.

    There is a bound if the truth is tested, and none if it is not.
    """
    size, bounds = len(spec.hypotheses[-1]), []
    every = {item.time: item for item in diagnosed(WHOLE, faults)}
    pairs = [(item, every[item.time]) for item in diagnosed(spec, faults) if item.time in every]
    for told, true in pairs:
        assert told.untested is not None
        bounds.append(told.untested.probability)
        assert sum(item.probability for item in true.candidates if len(item.parameters) > size) <= bounds[-1] + 1e-9
    assert len(bounds) > 5
    assert (min(bounds) < OPEN) is (len(faults) <= size)


@cache
def course(spec: EngineSpec) -> Course:
    """The monitor along a run with one fault."""
    return Course(core_of(spec), recording(ONE, 3))


def ended(spec: EngineSpec, last: int = 420) -> Monitor:
    """The monitor at its end, or before it; not to be changed."""
    return course(spec).after(last)


def hidden(monitor: Monitor) -> Untested | None:
    """What is told of sets that are not tested."""
    diagnosis = monitor.finish()
    assert diagnosis is not None
    return diagnosis.untested


def test_after_each_renewal_there_is_no_bound_for_a_while() -> None:
    """Lanes that began just now have no sums that could tell how far off they are; later renewals count less."""
    along, seen = Course(core_of(WAITING), recording(ONE, 3, 640)), set[tuple[bool, bool]]()
    alarm = int(along.after(640).number("clock.alarm"))
    for later in range(15, 440, 10):
        monitor = along.after(alarm + later)
        since = monitor.number("clock.index") - monitor.number("job.settled")
        young = monitor.number("job.renewals") < 2
        untested = hidden(monitor)
        assert untested is not None
        if monitor.number("job.settled") >= 0:
            assert (untested.probability < 1.0) is (since > (60 if young else 30))
            seen.add((young, untested.probability < 1.0))
    assert seen >= {(True, False), (False, False), (False, True)}


def test_rejected_sets_hide_nothing() -> None:
    """Sets that contain a rejected one are not counted any more; where all are rejected, nothing is hidden."""
    monitor = ended(WAITING).copy()
    monitor.reject(find_hypothesis(WAITING, ["C"]))
    untested = hidden(monitor)
    assert untested is not None
    assert untested.sets == len([item for item in TRIPLES if 4 not in item]) == 4
    gone = np.zeros(WAITING.n_hypotheses)
    gone[WAITING.n_begun :] = 1.0
    assert hidden(changed(ended(WAITING), rejected=gone)) == Untested(sets=0, probability=0.0)
    assert hidden(ended(WHOLE)) is None
