"""Drifts long under way: what the healthy filter learned from them is forgotten, and they begin again."""

from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.slots import INPUT_BIASES, plan_slots
from faultbond.contract.spec import Engine, EngineSpec, covariance_place, unpack
from faultbond.runtime import monitor
from faultbond.runtime.bank import Bank
from faultbond.runtime.slotted import renew_slots, renewed_groups, slot_lanes, unlearned
from faultbond.runtime.state import SNAPSHOT_EVERY, SNAPSHOTS, State, init
from faultbond.runtime.trail import Trail
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.types import FaultKind
from made import TANK_START, changed, plant, run, samples_of


@cache
def drifting(waited: int = 99) -> tuple[EngineSpec, Engine, State]:
    """A tank whose pipe narrows slowly, some time after the alarm; its valve moves."""
    graph, spec, engine = plant("tank")
    time = np.arange(1500.0)
    u = np.stack([np.where(time % 400.0 < 200.0, 80.0, 45.0), np.where(time % 600.0 < 300.0, 65.0, 45.0)], axis=1)
    fault = Fault(parameter="K1", factor=2.5, start=350.0, end=1500.0)
    made = simulate(graph, Inputs(time=time, values=u), [fault], seed=2, start={"tank.q": TANK_START})
    samples = samples_of(time, made.inputs, made.outputs)
    state, used = init(spec), 0
    for used, sample in enumerate(samples):
        state, _ = monitor.step(spec, engine, state, sample)
        if state.clock.alarm >= 0 and used == state.clock.alarm + waited:
            break
    assert state.clock.alarm >= 0
    return spec, engine, state


def trail_of(spec: EngineSpec, engine: Engine, state: State) -> Trail:
    """The trail that the monitor used at the last sample."""
    return monitor._cut_trail(changed(state, index=state.clock.index - 1), state.clock.alarm)[0]


def test_unlearned_parameters_are_as_they_were() -> None:
    """States and slow errors stay, parameters are those of long ago, and nothing ties them to the states."""
    spec, _, state = drifting()
    healthy, old = state.healthy.lane[:, 0], state.healthy.snapshots[0]
    lane, place = unlearned(spec, healthy, old), spec.parameter_slice
    before, past, now = (unpack(spec, item[spec.covariance_slice]) for item in (healthy, old, lane))
    assert np.array_equal(lane[: place.start], healthy[: place.start])
    assert np.array_equal(lane[place], old[place])
    assert np.array_equal(now[place, place], past[place, place])
    others = np.setdiff1d(np.arange(spec.n_joint), np.arange(spec.n_joint)[place])
    assert np.array_equal(now[np.ix_(others, others)], before[np.ix_(others, others)])
    assert not now[place][:, others].any()
    assert np.array_equal(lane[spec.loop_slice.start :], healthy[spec.loop_slice.start :])


def test_only_drifts_under_way_forget_what_was_learned() -> None:
    """Lanes of drifts that may have begun long ago take the old parameters, all others those of the onset."""
    spec, engine, state = drifting()
    plan, trail = plan_slots(spec), trail_of(spec, engine, state)
    lanes = slot_lanes(
        spec, plan, range(plan.switched), trail.lanes[0], trail.samples[:1], state.inputs.peak, trail.old
    )
    assert trail.old is not None
    for k in range(plan.switched):
        item = plan.lanes[k]
        expected = trail.old if item.old else trail.lanes[0]
        assert np.array_equal(lanes[spec.parameter_slice, k], expected[spec.parameter_slice])
        assert item.old <= (item.kind is FaultKind.DRIFT and item.parameter >= 0)
    assert any(item.old for item in plan.lanes)


def test_the_oldest_healthy_lane_is_from_before_the_drift() -> None:
    """A healthy lane is kept every so many samples, and the oldest one has learned nothing from the drift."""
    spec, _, state = drifting()
    old = monitor._oldest(state)
    assert old is not None
    assert np.array_equal(old, state.healthy.snapshots[0])
    drifted = state.healthy.lane[spec.parameter_slice, 0]
    assert np.abs(old[spec.parameter_slice] - 1.0).max() < 0.01 < np.abs(drifted - 1.0).max()
    assert monitor._oldest(changed(state, index=SNAPSHOT_EVERY - 1, begun=0, accepted=-1)) is None


def test_the_ring_of_old_lanes_turns() -> None:
    """When more lanes have been kept than there is room for, the oldest is the one after the newest."""
    _, _, state = drifting()
    numbered = np.repeat(np.arange(SNAPSHOTS, dtype=np.float64)[:, None], state.healthy.snapshots.shape[1], axis=1)
    for kept in (1, SNAPSHOTS, SNAPSHOTS + 1, 2 * SNAPSHOTS + 3):
        index = max(state.clock.begun, state.clock.accepted) + SNAPSHOT_EVERY * kept
        found = monitor._oldest(changed(state, index=index, alarm=-1, snapshots=numbered))
        assert found is not None
        assert found[0] == (0 if kept <= SNAPSHOTS else kept % SNAPSHOTS)


def test_drifts_begin_again_from_what_was_found() -> None:
    """Only the least likely lane of each drift may change, to a likelier one; a drift that is there gains much."""
    spec, engine, state = drifting(260)
    plan, bank = plan_slots(spec), state.bank
    assert isinstance(bank, Bank)
    renewed = renew_slots(spec, engine, trail_of(spec, engine, state), bank.slots, state.inputs.peak)
    changed = np.flatnonzero(np.any(renewed != bank.slots, axis=0))
    worst = {int(group[np.argmin(bank.slots[-1, group])]) for group in renewed_groups(plan)}
    assert len(changed) > 0
    assert set(changed.tolist()) <= worst
    assert np.all(renewed[-1, changed] > bank.slots[-1, changed])
    names = [item.name for item in spec.parameters]
    (pipe,) = [group for group in renewed_groups(plan) if plan.lanes[group[0]].parameter == names.index("K1")]
    best = renewed[:, pipe[np.argmax(renewed[-1, pipe])]]
    wide, place = spec.slotted, spec.slotted.slot_slice.start
    sds = [np.sqrt(best[covariance_place(wide, k, k)]) for k in (place, place + 1)]
    now = 1.0 + 1.5 * (state.clock.index - 1 - 350.0) / 1150.0
    assert best[spec.parameter_slice][names.index("K1")] + best[place] == pytest.approx(now, abs=3.0 * sds[0])
    assert best[place + 1] == pytest.approx(1.5 / 1150.0, abs=3.0 * sds[1])
    assert sds[0] < 0.3
    assert sds[1] < 0.003


def test_a_lane_that_is_no_number_is_the_first_to_begin_again() -> None:
    """It is neither the best, from which others begin, nor does it keep its place."""
    spec, engine, state = drifting()
    trail, slots = trail_of(spec, engine, state), state.bank.slots.copy()
    lost = np.array([int(group[0]) for group in renewed_groups(plan_slots(spec))])
    slots[:, lost] = np.nan
    renewed = renew_slots(spec, engine, trail, slots, state.inputs.peak)
    assert np.all(np.isfinite(renewed[:, lost]))


def test_a_run_goes_on_bit_for_bit_with_its_old_lanes() -> None:
    """Old lanes are saved and restored with the state."""
    spec, engine, state = drifting()
    restored = State.restore(state.save())
    assert np.array_equal(restored.healthy.snapshots, state.healthy.snapshots)
    assert run(spec, engine, (), restored)[0] is restored


def test_a_drift_is_told_on_top_of_one_that_was_accepted() -> None:
    """A diagnosis gives the rate of the parameter, with what it had been moving at before."""
    spec, _, state = drifting()
    accepted = changed(state, rates=np.linspace(1e-4, 2e-4, len(spec.parameters)))
    found, whole = monitor.conclude(spec, state), monitor.conclude(spec, accepted)
    names = [item.name for item in spec.parameters]
    told = 0
    for one, two in zip(found.candidates, whole.candidates, strict=True):
        before, after = one.suspects[0], two.suspects[0]
        if one.kind is FaultKind.DRIFT and before.parameter in names:
            index = names.index(before.parameter)
            assert before.rate is not None
            assert after.rate is not None
            assert after.rate - before.rate == pytest.approx(
                spec.parameters[index].scale * accepted.normal.rates[index]
            )
            told += 1
    assert told


def test_a_drift_that_may_change_explains_nothing_by_its_fit() -> None:
    """What fits only a drift whose rate may change counts as unexplained; what a steady lane fits as well does not."""
    spec, _, state = drifting()
    n = state.bank.steps.shape[1]
    wanders = np.array([False] * n + [lane.span > 0.0 for lane in plan_slots(spec).lanes])
    slots = state.bank.slots.copy()
    most, limit = state.bank.likelihoods.max(), spec.thresholds.cusum_limit
    for ahead, contradicted, expected in ((5.0, ~wanders, True), (5.0, wanders, False), (50.0, wanders, True)):
        slots[-1, wanders[n:]] = most + ahead
        misfit = np.where(contradicted, 2.0 * limit, 0.0) * np.ones_like(state.bank.misfit.sums)
        found = monitor.conclude(spec, changed(state, slots=slots, misfit=replace(state.bank.misfit, sums=misfit)))
        assert found.candidates[0].kind is FaultKind.DRIFT
        assert (found.unexplained is not None) == expected


@dataclass(frozen=True)
class Recorder:
    """An engine of lanes with a slot that keeps where lanes begin, and how long they run."""

    inner: Engine
    calls: list[tuple[FloatArray, float]] = field(default_factory=list)

    @property
    def title(self) -> str:
        """What it is."""
        return "recorder"

    @property
    def slot(self) -> "Recorder":
        """Itself."""
        return self

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Keep and pass on."""
        self.calls.append((lanes.copy(), float(samples[:, 0].sum())))
        return self.inner.slot.advance(lanes, samples)


def test_a_renewed_lane_leads_to_what_was_found() -> None:
    """Wherever a renewed lane begins, its size and rate there lead to the size that the best lane has now.

    That holds for drifts and for biases of inputs, which begin as wide as the largest value of the input says.
    """
    spec, engine, state = drifting()
    recorder, trail = Recorder(engine), trail_of(spec, engine, state)
    renew_slots(spec, recorder, trail, state.bank.slots, state.inputs.peak)
    size = spec.slotted.slot_slice.start
    plan = plan_slots(spec)
    best = [group[np.argmax(state.bank.slots[-1, group])] for group in renewed_groups(plan)]
    inputs = [k for k, lane in enumerate(best) if plan.lanes[lane].input >= 0]
    assert len(recorder.calls) > 10
    assert [plan.lanes[best[k]].input for k in inputs] == list(range(len(spec.inputs)))
    for lanes, seconds in recorder.calls:
        assert lanes[size + 1] == pytest.approx(state.bank.slots[size + 1, best])
        assert lanes[size] + lanes[size + 1] * seconds == pytest.approx(state.bank.slots[size, best])
        widths = np.sqrt(lanes[covariance_place(spec.slotted, size, size), inputs]) / state.inputs.peak
        assert widths == pytest.approx(max(INPUT_BIASES))
