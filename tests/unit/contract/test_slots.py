"""What lanes with a slot have in it: kinds of fault, their starts and prior weights, and on what each acts."""

from dataclasses import replace
from math import hypot

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import starts_of
from faultbond.contract.slots import (
    DRIFTING,
    FRESH,
    GAIN,
    INPUT_KINDS,
    NOISES,
    OLD,
    SENSOR_KINDS,
    SHOWING,
    STUCK_AT,
    STUCK_NOISES,
    SWITCHING,
    UNSTEADY,
    SlotLane,
    SlotPlan,
    plan_slots,
)
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import parse_model
from faultbond.synthesis.specify import build_spec
from faultbond.types import FaultKind
from made import spec_of
from plants import pumped_tank

SPEC = spec_of("dc_motor_current")  # R L K J C; sensors omega, i; input V


def lanes_of(plan: SlotPlan, hypothesis: int) -> list[SlotLane]:
    """The lanes of a hypothesis."""
    return [lane for lane in plan.lanes if lane.hypothesis == hypothesis]


def role(spec: EngineSpec, plan: SlotPlan, name: str) -> FloatArray:
    """One role of all lanes, shape (things it acts on, n_lanes)."""
    first, place = spec.slotted.loop_slice.stop, spec.slotted.role_fields[name]
    return plan.roles[place.start - first : place.stop - first]


@pytest.mark.parametrize("name", ["dc_motor_current", "tank", "rc"])
def test_single_parameters_drift_or_come_and_go(name: str) -> None:
    """Sets of one parameter have lanes of a drift, which may end, and of what comes and goes, rarer than a step.

    While the parameter of a store moves, its content may go on, or its effort or flow: there are lanes of both.
    So have they of a step that shows slowly, where a sensor that feels it at once feels an input that settles, too.
    """
    spec = spec_of(name)
    plan = plan_slots(spec)
    for k, chosen in enumerate(spec.hypotheses):
        own = lanes_of(plan, k)
        if len(chosen) > 1:
            assert not own
            continue
        assert {lane.parameter for lane in own} == {chosen[0]}
        drifts = [lane for lane in own if lane.kind is FaultKind.DRIFT]
        pairs = [lane for lane in own if lane.kind is FaultKind.INTERMITTENT]
        ramps = [lane for lane in own if lane.kind is FaultKind.RAMP]
        slow = [lane for lane in own if lane.kind is FaultKind.STEP]
        assert len(drifts) + len(ramps) + len(pairs) + len(slow) == len(own)
        assert {lane.settling for lane in slow} == {spec.parameters[chosen[0]].settling} - {0.0}
        assert not any(lane.lag for lane in own)
        assert sum(np.exp(lane.weight) for lane in slow) == pytest.approx(2.0 * np.exp(SHOWING) if slow else 0.0)
        ways = [False, True] if spec.moves_store(chosen[0]) else [False]
        assert [lane.keeps for lane in ramps] == [lane.keeps for lane in drifts if not lane.old] == ways
        assert not any(lane.keeps for lane in own if lane.old or lane.kind not in {FaultKind.DRIFT, FaultKind.RAMP})
        assert sum(np.exp(lane.weight) for lane in drifts) == pytest.approx(np.exp(DRIFTING))
        assert sum(np.exp(lane.weight) for lane in pairs if lane.acts) == pytest.approx(np.exp(SWITCHING))


def test_what_lags_beside_an_input() -> None:
    """Of the pumped tank the meter of the flow feels the pump as it does its speed; the level feels neither.

    A step that lags is as likely as one at once, and comes to the same sizes.
    """
    graph = parse_model(pumped_tank(speed=", lag: 3 s"))
    spec = build_spec(build_step_model(build_plant(graph)))
    plan = plan_slots(spec)
    late = [lane for lane in plan.lanes if lane.lag]
    assert {(spec.parameters[lane.parameter].name, lane.kind) for lane in late} == {("K", FaultKind.STEP)}
    assert {lane.lag for lane in late} == {3.0}
    assert sum(np.exp(lane.weight) for lane in late) == pytest.approx(1.0)
    usual = [hypot(lane.size_sd, lane.rate_sd) for lane in late]
    assert usual == pytest.approx([GAIN, spec.parameters[late[0].parameter].change])
    fades = role(spec, plan, "fades")[0]
    assert fades == pytest.approx([1.0 / lane.lag if lane.lag else 0.0 for lane in plan.lanes])
    onset = [lane for lane in plan.lanes if lane.input >= 0 and lane.settling]
    assert {lane.settling for lane in onset} == {2.0 * (spec.sample_time or 0.0)}
    assert {lane.kind for lane in onset} == {FaultKind.BIAS, FaultKind.GAIN, FaultKind.STUCK}
    hidden = parse_model(pumped_tank(speed=", lag: 3 s", meter=", lag: 1 s"))  # the meter feels nothing at once
    assert not any(lane.lag for lane in plan_slots(build_spec(build_step_model(build_plant(hidden)))).lanes)


def is_gain_on_its_way(lane: SlotLane) -> bool:
    """Whether a lane is of a gain that drifts, or has drifted."""
    return lane.scales and lane.kind in (FaultKind.DRIFT, FaultKind.RAMP)


@pytest.mark.parametrize("name", ["dc_motor_current", "tank", "rc"])
def test_kinds_of_an_instrument(name: str) -> None:
    """A sensor is biased, drifts, has a wrong gain, is stuck, scatters or errs at times; an input does not scatter.

    Those of an input are rarer; what comes and goes has lanes of both, with the weight of one. A ramp that has ended
    has the weight of the drift that it was. A gain that drifts is half as likely as one that is wrong at once.
    """
    spec = spec_of(name)
    plan = plan_slots(spec)
    for k, instrument in enumerate(spec.instruments, len(spec.hypotheses)):
        own, shares = [lane for lane in lanes_of(plan, k) if not is_gain_on_its_way(lane)], dict[FaultKind, float]()
        scaled = [lane for lane in lanes_of(plan, k) if lane.scales]
        assert [lane.kind for lane in scaled] == [FaultKind.GAIN, FaultKind.DRIFT, FaultKind.RAMP]
        assert [lane.weight - scaled[0].weight for lane in scaled] == pytest.approx([0.0, -np.log(2.0), -np.log(2.0)])
        for lane in own:
            index = (lane.output, lane.input) if instrument.is_output else (lane.input, lane.output)
            assert index == (instrument.index, -1)
            shares[lane.kind] = shares.get(lane.kind, 0.0) + lane.acts * float(np.exp(lane.weight))
        assert shares.pop(FaultKind.RAMP) == pytest.approx(shares[FaultKind.DRIFT] / 2.0)
        of_input = {kind: 0.3 * part for kind, part in INPUT_KINDS.items()}
        assert shares == pytest.approx(SENSOR_KINDS if instrument.is_output else of_input)
        for kind in shares:
            assert len({lane.weight for lane in own if lane.kind is kind}) == 1
    assert set(SENSOR_KINDS) == set(FaultKind) - {FaultKind.STEP, FaultKind.RAMP}


def test_instruments_that_are_trusted_have_no_lanes() -> None:
    """A sensor or input that is no suspect has no hypothesis; the numbers of the others go on without a gap."""
    trusting = replace(SPEC, outputs=(replace(SPEC.outputs[0], suspect=False), SPEC.outputs[1]))
    assert [item.name for item in trusting.instruments] == ["i", "V"]
    assert trusting.n_begun == SPEC.n_begun - 1
    plan = plan_slots(trusting)
    assert {lane.output for lane in plan.lanes} == {-1, 1}
    assert set(plan.hypothesis) == {*range(5), len(SPEC.hypotheses), len(SPEC.hypotheses) + 1}


def test_nothing_to_suspect_is_an_empty_plan() -> None:
    """Without single parameters and suspect instruments there are no lanes, and arrays of no columns."""
    sets = tuple(chosen for chosen in SPEC.hypotheses if len(chosen) > 1)
    outputs = tuple(replace(item, suspect=False) for item in SPEC.outputs)
    inputs = tuple(replace(item, suspect=False) for item in SPEC.inputs)
    plan = plan_slots(replace(SPEC, hypotheses=sets, outputs=outputs, inputs=inputs))
    assert (plan.n_lanes, plan.ramped, plan.switched) == (0, 0, 0)
    assert plan.roles.shape == (SPEC.slotted.n_roles, 0)


def test_pairs_come_last_and_differ_only_in_whether_the_fault_is_there() -> None:
    """From `switched` on, lanes are pairs of the same fault, there and gone; none is before."""
    plan = plan_slots(SPEC)
    assert all(lane.kind is not FaultKind.INTERMITTENT for lane in plan.lanes[: plan.switched])
    there, gone = plan.lanes[plan.switched :: 2], plan.lanes[plan.switched + 1 :: 2]
    assert len(there) == len(gone) > 0
    for one, two in zip(there, gone, strict=True):
        assert (one.kind, one.acts, two.acts) == (FaultKind.INTERMITTENT, True, False)
        assert replace(two, acts=True) == one


def test_ramps_are_the_first_drift_of_each_suspect_and_what_it_comes_to() -> None:
    """From `ramped` on, lanes are pairs of a drift from the onset and what has come to stay.

    Each suspect has one, of a store one whose content goes on, too; an instrument one of its bias and one of its gain.
    """
    plan = plan_slots(SPEC)
    moves, stays = plan.lanes[plan.ramped : plan.switched : 2], plan.lanes[plan.ramped + 1 : plan.switched : 2]
    every = {(lane.hypothesis, lane.scales, lane.keeps) for lane in plan.lanes}
    assert sorted((lane.hypothesis, lane.scales, lane.keeps) for lane in moves) == sorted(every)
    for one, two in zip(moves, stays, strict=True):
        assert (one.kind, two.kind, one.old) == (FaultKind.DRIFT, FaultKind.RAMP, False)
        assert replace(two, kind=FaultKind.DRIFT) == one
    assert all(lane.kind is not FaultKind.RAMP for lane in plan.lanes[: plan.ramped])


def test_starts_of_parameters_are_those_of_steps() -> None:
    """A fault that comes and goes begins at the starts of a step, as what it adds; so does a drift under way."""
    plan = plan_slots(SPEC)
    for k, item in enumerate(SPEC.parameters):
        wanted = [(start.value - 1.0, start.sd) for start in starts_of(item, 1)]
        own = lanes_of(plan, SPEC.hypotheses.index((k,)))
        pairs = [(lane.size, lane.size_sd) for lane in own if lane.kind is FaultKind.INTERMITTENT and lane.acts]
        drifts = [lane for lane in own if lane.kind is FaultKind.DRIFT]
        old, fresh = [lane for lane in drifts if lane.old], next(lane for lane in drifts if not lane.old)
        assert pairs == wanted
        assert [(lane.size, lane.size_sd) for lane in old] == wanted
        assert (fresh.size, fresh.size_sd) == (0.0, item.accuracy)
        assert (fresh.rate, fresh.rate_sd) == (0.0, item.change / FRESH)
        assert [lane.rate for lane in old] == [size / OLD for size, _ in wanted]
        assert [lane.rate_sd for lane in old] == pytest.approx([UNSTEADY * np.hypot(*start) / OLD for start in wanted])
        assert all(lane.rate_sd == 0.0 for lane in own if lane.kind is FaultKind.INTERMITTENT)


def test_starts_where_the_nominal_is_zero() -> None:
    """A parameter that is healthy at 0 begins at its starts themselves, which add to 0."""
    leak = replace(SPEC.parameters[0], nominal=0.0, change=3.0, lower=0.0)
    spec = replace(SPEC, parameters=(leak, *SPEC.parameters[1:]))
    pairs = [lane for lane in lanes_of(plan_slots(spec), 0) if lane.kind is FaultKind.INTERMITTENT and lane.acts]
    assert [(lane.size, lane.size_sd) for lane in pairs] == [(0.0, 3.0), (1.0, 3.0)]


def test_a_parameter_is_acted_on_while_its_fault_is_there() -> None:
    """The size adds to the factor of the parameter at fault and to nothing else; to nothing while the fault is gone."""
    plan = plan_slots(SPEC)
    theta = role(SPEC, plan, "theta")
    for k, lane in enumerate(plan.lanes):
        wanted = np.zeros(len(SPEC.parameters))
        if lane.parameter >= 0:
            wanted[lane.parameter] = float(lane.acts)
        assert np.array_equal(theta[:, k], wanted)


@pytest.mark.parametrize("zero", [0.0, 273.15])
def test_roles_of_each_kind_of_fault_of_an_input(zero: float) -> None:
    """The size adds to what acts, of a gain in what is recorded in its own unit; one that is stuck obeys no more."""
    spec = replace(SPEC, inputs=(replace(SPEC.inputs[0], unit_offset=zero),))
    plan, recorded, size = plan_slots(spec), zero + 3.0, 0.5
    added, gain, obeys = (role(spec, plan, name)[0] for name in ("input", "input_gain", "obeys"))
    for k, lane in enumerate(plan.lanes):
        acts = recorded * (obeys[k] + gain[k] * size) + added[k] * size
        if lane.input < 0 or not lane.acts:
            assert acts == recorded
        elif lane.kind is FaultKind.GAIN or is_gain_on_its_way(lane):
            assert acts - zero == pytest.approx(1.5 * (recorded - zero), rel=1e-12)
        else:
            assert acts == (0.0 if lane.sticks else recorded) + size
    assert {lane.kind for lane in plan.lanes if lane.input == 0} == {*INPUT_KINDS, FaultKind.RAMP}


SENSOR_ROLES = {  # reads, gain, bias in noise, noise variance in that declared
    FaultKind.BIAS: (1.0, 0.0, 1.0, [1.0, 1.0]),
    FaultKind.DRIFT: (1.0, 0.0, 1.0, [1.0, 1.0]),
    FaultKind.RAMP: (1.0, 0.0, 1.0, [1.0]),
    FaultKind.GAIN: (1.0, 1.0, 0.0, [1.0]),
    FaultKind.STUCK: (0.0, 0.0, 1.0, [*STUCK_NOISES] * len(STUCK_AT)),
    FaultKind.NOISE: (1.0, 0.0, 0.0, [*NOISES]),
}


def test_roles_of_each_kind_of_fault_of_a_sensor() -> None:
    """Each kind acts on its own sensor as its name says, and leaves the other sensors healthy."""
    plan = plan_slots(SPEC)
    numbers = {name: role(SPEC, plan, name) for name in ("reads", "gain", "bias", "noise")}
    for output, item in enumerate(SPEC.outputs):
        for kind, (reads, gain, bias, noises) in SENSOR_ROLES.items():
            of_kind = [k for k, lane in enumerate(plan.lanes) if lane.output == output and lane.kind is kind]
            moving = [k for k in of_kind if is_gain_on_its_way(plan.lanes[k])]
            assert numbers["gain"][output, moving] == pytest.approx(1.0)
            assert numbers["bias"][output, moving] == pytest.approx(0.0)
            own = [k for k in of_kind if k not in moving]
            assert numbers["reads"][output, own] == pytest.approx(reads)
            assert numbers["gain"][output, own] == pytest.approx(gain)
            assert numbers["bias"][output, own] == pytest.approx(bias * item.noise)
            assert numbers["noise"][output, own].tolist() == noises
        pairs = [
            k for k, lane in enumerate(plan.lanes) if lane.output == output and lane.kind is FaultKind.INTERMITTENT
        ]
        assert numbers["reads"][output, pairs].tolist() == [1.0, 1.0, 1.0, 1.0, 0.0, 1.0]  # biased twice, stuck
        assert numbers["bias"][output, pairs] == pytest.approx(item.noise * np.array([1.0, 0.0] * 3))
        assert np.all(numbers["gain"][output, pairs] == 0.0)
        assert np.all(numbers["noise"][output, pairs] == 1.0)
        others = [k for k, lane in enumerate(plan.lanes) if lane.output != output]
        for name, healthy in (("reads", 1.0), ("gain", 0.0), ("bias", 0.0), ("noise", 1.0)):
            assert np.all(numbers[name][output, others] == healthy)


def test_what_moves_has_a_rate() -> None:
    """Only drifts, and what they come to, have an uncertain rate; only noise has neither."""
    for lane in plan_slots(SPEC).lanes:
        assert (lane.rate_sd > 0.0) == (lane.kind in (FaultKind.DRIFT, FaultKind.RAMP))
        assert (max(lane.size_sd, lane.rate_sd) > 0.0) == (lane.kind is not FaultKind.NOISE)
