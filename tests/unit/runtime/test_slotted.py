"""Lanes with a slot at work: models with few of them or none, and the bias of an input that lags."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Effects, Fault, Inputs, simulate
from faultbond.synthesis.engine import build_core
from faultbond.types import FaultKind
from made import TANK_START, graph_of, plant, recorded, run, samples_of, spec_of

FAULT = Fault(parameter="R", factor=2.0, start=2.4)


@cache
def ended(spec: EngineSpec) -> Monitor:
    """The motor with other hypotheses, so long after a fault that all have begun."""
    graph = graph_of("dc_motor_current")
    return run(build_core(build_plant(graph), spec), recorded("dc_motor_current", 345, FAULT))[0]


def with_sets(*sets: tuple[int, ...]) -> EngineSpec:
    """The motor with these sets only."""
    return replace(spec_of("dc_motor_current"), hypotheses=sets)


def test_without_lanes_nothing_is_done() -> None:
    """A model without single sets and suspect instruments has no lane with a slot; its only set explains the data."""
    spec = with_sets((0, 1))
    outputs = tuple(replace(item, suspect=False) for item in spec.outputs)
    spec = replace(spec, outputs=outputs, inputs=tuple(replace(item, suspect=False) for item in spec.inputs))
    monitor = ended(spec)
    assert monitor.number("clock.alarm") >= 0
    assert plan_slots(spec).n_lanes == 0
    (only,) = monitor.conclude().candidates
    assert (only.components, only.probability) == (("R", "L"), 1.0)
    assert np.all(np.isfinite(monitor.lane(0)))


@pytest.mark.parametrize("sets", [(), ((0, 1),)])
def test_only_instruments_have_a_slot(sets: tuple[tuple[int, ...], ...]) -> None:
    """Without single sets, or without any set, the instruments are told apart all the same."""
    diagnosis = ended(with_sets(*sets)).conclude()
    parameters = {index for chosen in sets for index in chosen}
    assert len(diagnosis.candidates) == len(sets) + 3 + 3 * len(parameters) + 3  # and each two instruments
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0)
    named = {item.components for item in diagnosis.candidates}
    assert {("omega",), ("i",), ("V",)} <= named


def test_a_valve_that_opens_less_than_told_is_found_though_it_lags() -> None:
    """A bias of an input that comes up through a lag is in the group, with its size within four standard deviations.

    A valve that wears that much while it would come to rest looks alike.
    """
    graph, _, core = plant("tank")
    time = np.arange(700.0)
    u = np.stack([np.where(time < 480.0, 60.0, 75.0), np.full(time.size, 40.0)], axis=1)
    fault = Fault(parameter="u_in.bias", value=-10.0, start=300.0)
    start, effects = {"tank.q": TANK_START}, Effects(lag=3.0)
    made = simulate(graph, Inputs(time=time, values=u), [fault], seed=3, effects=effects, start=start)
    diagnosis = run(core, samples_of(made.time, made.inputs, made.outputs))[0].finish()
    assert diagnosis is not None
    best = next(item for item in diagnosis.candidates if item.parameters == ("u_in.bias",))
    assert best.group
    assert best.kind in (FaultKind.BIAS, FaultKind.RAMP)
    assert {item.parameters for item in diagnosis.candidates if item.group} <= {("u_in.bias",), ("K7",)}
    assert best.suspects[0].estimate == pytest.approx(-10.0, abs=4.0 * best.suspects[0].sd)
    assert best.suspects[0].sd < 1.0
