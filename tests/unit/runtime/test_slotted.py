"""Lanes with a slot: how they begin, the onsets they are mixed over, and pairs that come and go."""

from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import WANDER, SlotLane, plan_slots
from faultbond.contract.spec import EngineSpec, SlowErrorSpec, covariance_place, pack, unpack
from faultbond.runtime import slotted
from faultbond.runtime.monitor import finish
from faultbond.runtime.slotted import (
    SWITCHING,
    advance_slots,
    begin_slots,
    interacted,
    shared,
    slot_lanes,
    widened,
)
from faultbond.runtime.start import healthy_lane
from faultbond.runtime.stepped import relinearised
from faultbond.runtime.trail import Trail
from faultbond.simulate import Effects, Fault, Inputs, simulate
from faultbond.synthesis.engine import build_engine
from faultbond.types import FaultKind
from made import TANK_START, plant, recorded, run, samples_of

SPEC = plant("dc_motor_current")[1]
FAULT = Fault(parameter="R", factor=2.0, start=2.4)


def correlated(spec: EngineSpec) -> FloatArray:
    """A healthy lane, shape (n_numbers,), with a covariance that is full and factors that are not 1."""
    generator = np.random.default_rng(1)
    lane = healthy_lane(spec, np.full(len(spec.states), 3.0), np.eye(len(spec.states)))[:, 0]
    root = 0.05 * generator.normal(size=(spec.n_joint, spec.n_joint))
    lane[spec.covariance_slice] = pack(root @ root.T + 0.01 * np.eye(spec.n_joint))
    lane[spec.parameter_slice] *= generator.uniform(0.9, 1.1, len(spec.parameters))
    lane[-1] = -12.5
    return lane


def seen_samples(spec: EngineSpec, y: list[list[float]], dt: float = 0.02) -> FloatArray:
    """Packed samples with these readings; nan is missing."""
    samples, place = np.zeros((len(y), spec.n_sample)), spec.sample_fields
    samples[:, place["dt"]], samples[:, place["scale"]] = dt, 1.0
    samples[:, place["y"]] = np.nan_to_num(np.array(y))
    samples[:, place["use"]] = np.isfinite(np.array(y))
    return samples


def begun(spec: EngineSpec, seen: FloatArray, peak: float = 8.0) -> tuple[tuple[SlotLane, ...], FloatArray]:
    """All lanes of the plan, begun from a healthy lane."""
    plan = plan_slots(spec)
    lanes = slot_lanes(spec, plan, range(plan.n_lanes), correlated(spec), seen, np.full(len(spec.inputs), peak))
    return plan.lanes, lanes


@pytest.mark.parametrize("name", ["dc_motor_current", "tank", "rlc"])
def test_an_empty_slot_changes_nothing_else(name: str) -> None:
    """Mean and covariance stay what they are, in the places that both sorts of lane share; the slot is zero."""
    spec = replace(plant(name)[1], loops=(0.3, -4.0))
    lane, own = correlated(spec), shared(spec)
    wide = widened(spec, lane)
    full = unpack(spec.slotted, wide[spec.slotted.covariance_slice])
    assert np.array_equal(wide[own], lane[: spec.n_joint])
    assert np.array_equal(full[np.ix_(own, own)], unpack(spec, lane[spec.covariance_slice]))
    assert wide[spec.slotted.loop_slice].tolist() == [0.3, -4.0]
    assert not np.any(wide[spec.slotted.slot_slice])
    assert not np.any(full[spec.slotted.slot_slice])
    assert sorted({*own, *range(spec.slotted.slot_slice.start, spec.slotted.slot_slice.stop)}) == list(
        range(spec.slotted.n_joint)
    )


def test_the_slot_begins_uncorrelated_and_the_rest_is_healthy() -> None:
    """Lanes begin with the healthy mean and covariance, the roles of the plan, and a slot correlated with nothing."""
    wide, healthy, own = SPEC.slotted, correlated(SPEC), shared(SPEC)
    plan = plan_slots(SPEC)
    items, lanes = begun(SPEC, seen_samples(SPEC, [[1.0, 2.0]]))
    wander = wide.role_fields["wander"].start - wide.loop_slice.stop
    assert np.array_equal(
        np.delete(lanes[wide.loop_slice.stop : -1], wander, axis=0), np.delete(plan.roles, wander, axis=0)
    )
    for item, lane in zip(items, lanes.T, strict=True):
        rate = lane[covariance_place(wide, wide.slot_slice.start + 1, wide.slot_slice.start + 1)]
        expected = WANDER * rate / (item.span * (SPEC.sample_time or 1.0)) if item.span else 0.0
        assert lane[wide.role_fields["wander"]] == pytest.approx(expected, rel=1e-12)
    assert lanes.shape == (wide.n_numbers, len(items))
    for lane in lanes.T:
        full = unpack(wide, lane[wide.covariance_slice])
        assert np.array_equal(lane[own], healthy[: SPEC.n_joint])
        assert np.array_equal(full[np.ix_(own, own)], unpack(SPEC, healthy[SPEC.covariance_slice]))
        slot = full[wide.slot_slice]
        assert np.count_nonzero(slot - np.diag(np.diag(full))[wide.slot_slice]) == 0


def test_units_of_the_start() -> None:
    """A parameter's size is in healthy factors, a sensor's in its noise, an input's in its peak; rates per sample."""
    wide, healthy = SPEC.slotted, correlated(SPEC)
    items, lanes = begun(SPEC, seen_samples(SPEC, [[1.0, 2.0]]), peak=8.0)
    size, rate = wide.slot_slice.start, wide.slot_slice.start + 1
    for k, item in enumerate(items):
        unit = healthy[SPEC.parameter_slice][item.parameter] if item.parameter >= 0 else 1.0
        unit = 8.0 if item.input >= 0 else unit
        if not item.sticks:
            assert lanes[size, k] == pytest.approx(item.size * unit, rel=1e-14)
        assert lanes[rate, k] == 0.0
        sd = np.sqrt([lanes[covariance_place(wide, place, place), k] for place in (size, rate)])
        assert sd == pytest.approx([item.size_sd * unit, item.rate_sd * unit / 0.02], rel=1e-12)


def test_an_input_that_was_always_zero_has_a_size_all_the_same() -> None:
    """Where an input has been zero so far, its bias is taken as wide as one unit."""
    items, lanes = begun(SPEC, seen_samples(SPEC, [[1.0, 2.0]]), peak=0.0)
    size = SPEC.slotted.slot_slice.start
    for k, item in enumerate(items):
        if item.input >= 0:
            assert np.sqrt(lanes[covariance_place(SPEC.slotted, size, size), k]) == pytest.approx(item.size_sd)


def test_rates_on_a_grid_without_a_step() -> None:
    """Where the sample time varies, a rate per sample is one per mean time between samples; per second at the least."""
    spec = replace(SPEC, sample_time=None)
    rate = spec.slotted.slot_slice.start + 1
    for dt, wanted in ((0.5, 0.5), (0.0, 1.0)):
        items, lanes = begun(spec, seen_samples(spec, [[1.0, 2.0]] * 3, dt=dt))
        for k, item in enumerate(items):
            if item.output >= 0:
                sd = np.sqrt(lanes[covariance_place(spec.slotted, rate, rate), k])
                assert sd == pytest.approx(item.rate_sd / wanted)


def test_a_stuck_sensor_begins_at_its_last_value() -> None:
    """A sensor is stuck about the last value that it gave before the onset, or about 0 if it never gave one."""
    size = SPEC.slotted.slot_slice.start
    seen = seen_samples(SPEC, [[1.0, np.nan], [2.0, np.nan], [np.nan, np.nan]])
    items, lanes = begun(SPEC, seen)
    for k, item in enumerate(items):
        if item.sticks:
            wanted = [2.0, 0.0][item.output] / SPEC.outputs[item.output].noise
            assert lanes[size, k] == pytest.approx(wanted)


@dataclass(frozen=True)
class ToyEngine:
    """An engine that adds, at each sample, what a lane's parameter role and size say to the likelihood."""

    spec: EngineSpec

    @property
    def title(self) -> str:
        """What it is."""
        return "toy"

    @property
    def slot(self) -> "ToyEngine":
        """Itself: only lanes with a slot are asked for."""
        return self

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Add up."""
        wide, place, following = self.spec.slotted, self.spec.sample_fields, lanes.copy()
        acts = lanes[wide.role_fields["theta"]].sum(axis=0)
        for sample in samples:
            following[-1] += sample[place["y"]][0] * (acts + 0.1 * lanes[wide.slot_slice.start])
        return following, np.zeros((len(samples), 2 * len(self.spec.outputs), lanes.shape[1]))


def toy_trail(spec: EngineSpec, n: int) -> Trail:
    """A trail of random readings, over healthy lanes of random likelihoods."""
    generator = np.random.default_rng(4)
    samples = seen_samples(spec, generator.normal(0.0, 1.5, (n, len(spec.outputs))).tolist())
    lanes = np.repeat(correlated(spec)[:, None], n, axis=1).T
    lanes[:, spec.parameter_slice] *= generator.uniform(0.8, 1.2, (n, len(spec.parameters)))
    lanes[:, -1] = generator.normal(0.0, 2.0, n)
    return Trail(samples=samples, lanes=lanes)


def test_lanes_from_onsets_are_mixed() -> None:
    """A drift's or an instrument's likelihood is the mean over its onsets: healthy before, its own from there on."""
    trail = toy_trail(SPEC, 9)
    plan, wide = plan_slots(SPEC), SPEC.slotted
    found = begin_slots(SPEC, ToyEngine(SPEC), trail, 3, np.array([8.0]))
    y = trail.samples[:, SPEC.sample_fields["y"]][:, 0]
    for k, item in enumerate(plan.lanes[: plan.switched]):
        trials = []
        for onset in range(1, 9):
            factors = trail.lanes[onset - 1, SPEC.parameter_slice]
            unit = factors[item.parameter] if item.parameter >= 0 else 1.0
            size = item.size * unit
            if item.kind is FaultKind.STUCK:
                size = trail.samples[onset - 1, SPEC.sample_fields["y"]][item.output] / SPEC.outputs[item.output].noise
            gain = y[onset:].sum() * (float(item.parameter >= 0) + 0.1 * size)
            trials.append(trail.lanes[onset - 1, -1] + gain)
        wanted = np.log(np.sum(np.exp(trials)) / SPEC.thresholds.history_samples)
        assert found[-1, k] == pytest.approx(wanted, rel=1e-12)
    roles = np.delete(found[wide.loop_slice.stop : -1], wide.role_fields["wander"].start - wide.loop_slice.stop, axis=0)
    assert np.array_equal(roles, np.delete(plan.roles, -1, axis=0))


def test_pairs_come_and_go_over_the_whole_trail() -> None:
    """A fault that comes and goes is healthy at the oldest sample; then every row of modes counts as it is likely."""
    trail = toy_trail(SPEC, 7)
    plan, y = plan_slots(SPEC), trail.samples[1:, SPEC.sample_fields["y"]][:, 0]
    found = begin_slots(SPEC, ToyEngine(SPEC), trail, 3, np.array([8.0]))
    unit = trail.lanes[0][SPEC.parameter_slice]
    for k in range(plan.switched, plan.n_lanes, 2):
        item = plan.lanes[k]
        size, total = item.size * unit[item.parameter], np.zeros(2)
        if item.sticks:
            size = trail.samples[0, SPEC.sample_fields["y"]][item.output] / SPEC.outputs[item.output].noise
        for modes in product((0, 1), repeat=len(y)):  # 0: the fault is there
            switched = sum(one != two for one, two in zip((1, *modes), modes, strict=False))
            weight = SWITCHING**switched * (1.0 - SWITCHING) ** (len(y) - switched)
            acts = [float(mode == 0 and item.parameter >= 0) for mode in modes]
            gain = sum(value * (there + 0.1 * size) for value, there in zip(y, acts, strict=True))
            total[modes[-1]] += weight * np.exp(gain)
        assert found[-1, k : k + 2] == pytest.approx(trail.lanes[0, -1] + np.log(total), rel=1e-9)


def test_slow_errors_are_begun_anew() -> None:
    """What slow errors have taken up of the fault by the alarm is forgotten in all lanes with a slot."""
    slow = SlowErrorSpec(name="omega", sd=0.5, memory=10.0, alarms=False)
    spec = replace(SPEC, slow_errors=(slow,))
    trail = toy_trail(spec, 5)
    trail.lanes[:, spec.slow_slice] = 0.3
    found = begin_slots(spec, ToyEngine(spec), trail, 3, np.array([8.0]))
    wanted = np.zeros(spec.slotted.n_joint)
    wanted[spec.slow_slice] = slow.sd**2
    for lane in found.T:
        full = unpack(spec.slotted, lane[spec.slotted.covariance_slice])
        assert lane[spec.slow_slice] == 0.0
        assert full[spec.slow_slice][0] == pytest.approx(wanted, rel=1e-12)


def test_without_lanes_nothing_is_done() -> None:
    """A model without single sets and suspect instruments has lanes of no columns, before the alarm and after it."""
    outputs = tuple(replace(item, suspect=False) for item in SPEC.outputs)
    inputs = tuple(replace(item, suspect=False) for item in SPEC.inputs)
    spec = replace(SPEC, hypotheses=((0, 1),), outputs=outputs, inputs=inputs)
    state, _ = run(spec, plant("dc_motor_current")[2], recorded("dc_motor_current", 200, FAULT))
    assert state.clock.alarm >= 0
    assert state.bank.slots.shape == (spec.slotted.n_numbers, 0)
    lanes, innovations = advance_slots(spec, ToyEngine(spec), state.bank.slots, np.zeros(spec.n_sample))
    assert lanes.shape == (spec.slotted.n_numbers, 0)
    assert innovations.shape == (2 * len(spec.outputs), 0)


def test_the_bank_goes_on_as_it_began() -> None:
    """Pairs taken one sample further are those begun on a trail that is one sample longer."""
    _, spec, engine = plant("dc_motor")
    state, _ = run(spec, engine, recorded("dc_motor", 200, FAULT))
    rows = slice(state.past.place(state.clock.begun), None)
    trail = Trail(samples=state.past.samples[rows], lanes=state.past.lanes[rows])
    shorter = Trail(samples=trail.samples[:-1], lanes=trail.lanes[:-1])
    long, short = (begin_slots(spec, engine, item, 118, state.inputs.peak) for item in (trail, shorter))
    further, innovations = advance_slots(spec, engine, short, trail.samples[-1])
    pairs = slice(plan_slots(spec).switched, None)
    assert np.array_equal(further[:, pairs], long[:, pairs])
    assert innovations.shape == (2 * len(spec.outputs), further.shape[1])
    assert np.all(np.isfinite(long))
    for lane in long.T:
        full = unpack(spec.slotted, lane[spec.slotted.covariance_slice])
        sd = np.sqrt(np.diag(full))
        live = sd > 0.0  # the rate of what does not move is known
        assert np.linalg.eigvalsh((full / np.outer(sd + ~live, sd + ~live))[np.ix_(live, live)]).min() > 0.0


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize("sets", [(), ((0, 1),)])
def test_only_instruments_have_a_slot(sets: tuple[tuple[int, ...], ...], *, compiled: bool) -> None:
    """Without single sets, or without any set, the instruments are told apart all the same, on either engine."""
    graph = plant("dc_motor_current")[0]
    _, engine = build_engine(graph, compiled=compiled)
    short = replace(SPEC.thresholds, history_samples=12)  # the interpreter is slow
    spec = replace(SPEC, hypotheses=sets, thresholds=short)
    state, _ = run(spec, engine, recorded("dc_motor_current", 165, FAULT))
    diagnosis = finish(spec, state)
    assert diagnosis is not None
    assert len(diagnosis.candidates) == len(sets) + 3
    assert state.bank.steps.shape[1] == plan_lanes(spec).n_lanes
    assert sum(item.probability for item in diagnosis.candidates) == pytest.approx(1.0)


def test_both_lanes_of_a_pair_have_the_innovations_of_their_mixture() -> None:
    """While a fault is gone, the lane in which it is there does not count as one that misfits: the mixture does."""
    _, spec, engine = plant("dc_motor_current")
    state, _ = run(spec, engine, recorded("dc_motor_current", 200, FAULT))
    packed, first = state.past.samples[state.past.place(150)], plan_slots(spec).switched
    _, found = advance_slots(spec, engine, state.bank.slots, packed)
    ready = interacted(spec, state.bank.slots[:, first:])
    _, apart = engine.slot.advance(ready, relinearised(spec, packed[None, :]))
    n_y = len(spec.outputs)
    for k in range(0, ready.shape[1], 2):
        weights = np.exp(ready[-1, k : k + 2] - np.logaddexp(*ready[-1, k : k + 2]))
        error, variance = apart[0, :n_y, k : k + 2], apart[0, n_y:, k : k + 2]
        mean = error @ weights
        spread = (variance + error**2) @ weights - mean**2
        for lane in (first + k, first + k + 1):
            assert found[:n_y, lane] == pytest.approx(mean, rel=1e-9, abs=1e-12)
            assert found[n_y:, lane] == pytest.approx(spread, rel=1e-6)


def test_which_biases_come_up_slowly() -> None:
    """Those of inputs that settle in sight of a sensor: the inlet of the tank, not its outlet; none of the motor."""
    spec = plant("tank")[1]
    lanes = plan_slots(spec).lanes
    (own,) = slotted._settling(spec, plan_slots(spec)).values()
    assert list(slotted._settling(spec, plan_slots(spec))) == [12.0]
    assert [lanes[k].input for k in own] == [0, 0]
    assert [lane.input for lane in lanes if lane.input >= 0 and lane.kind is FaultKind.BIAS] == [0, 0, 1, 1]
    assert slotted._settling(SPEC, plan_slots(SPEC)) == {}


@pytest.mark.parametrize("rows", [1, 2, 5, 12, 13, 40])
def test_a_bias_that_comes_up_ends_as_wide_as_its_start(rows: int) -> None:
    """Without measurements the size is as uncertain at the end as its start says, however many samples there are."""
    _, spec, engine = plant("tank")
    wide, plan = spec.slotted, plan_slots(spec)
    samples = seen_samples(spec, [[np.nan] * 2] * rows, dt=1.0)
    samples[:, spec.sample_fields["u"]] = samples[:, spec.sample_fields["u_before"]] = (50.0, 40.0)
    (own,) = slotted._settling(spec, plan).values()
    lanes = slot_lanes(spec, plan, own, correlated(spec), samples, np.full(2, 60.0))
    size = wide.slot_slice.start
    place = covariance_place(wide, size, size)
    found = slotted._settled(spec, engine, lanes, relinearised(spec, samples), 12.0)
    assert found[place] == pytest.approx(lanes[place], rel=1e-9)
    assert found[size] == pytest.approx(0.0, abs=1e-12)


def test_a_valve_that_opens_less_than_told_is_found_though_it_lags() -> None:
    """A bias of an input that comes up through a lag is first, with its size within four standard deviations."""
    graph, spec, engine = plant("tank")
    time = np.arange(700.0)
    u = np.stack([np.where(time < 480.0, 60.0, 75.0), np.full(time.size, 40.0)], axis=1)
    fault = Fault(parameter="u_in.bias", value=-10.0, start=300.0)
    start, effects = {"tank.q": TANK_START}, Effects(lag=3.0)
    made = simulate(graph, Inputs(time=time, values=u), [fault], seed=3, effects=effects, start=start)
    state, _ = run(spec, engine, samples_of(made.time, made.inputs, made.outputs))
    diagnosis = finish(spec, state)
    assert diagnosis is not None
    best = diagnosis.candidates[0]
    assert (best.parameters, best.kind) == (("u_in.bias",), FaultKind.BIAS)
    assert best.suspects[0].estimate == pytest.approx(-10.0, abs=4.0 * best.suspects[0].sd)
    assert best.suspects[0].sd < 1.0
