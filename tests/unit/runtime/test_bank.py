"""The bank of all lanes: steps first, then those with a slot, each with its own sums."""

from functools import cache

import numpy as np
import pytest

from bare_core import Bare, bare
from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.couples import PER_COUPLE, n_coupled
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from faultbond.types import FaultKind
from made import EXAMPLES, Course, plant_in_full, recorded, spec_of, stepped

NAME = "dc_motor_current"
SPEC = spec_of(NAME)
N, PLAN = plan_lanes(SPEC).n_lanes, plan_slots(SPEC)
MOVING = (FaultKind.DRIFT, FaultKind.RAMP)  # of which the one hands on to the other before each sample
SAMPLES = recorded(NAME, 345, Fault(parameter="K", factor=0.6, start=2.4))
CALLS = """
static Work work;
/* Let all lanes begin, or begin again for the last time, at once. */
void t_renew(State *state)
{
    Trail trail;
    prepare_filters(&work.filters);
    trail_of(state, &trail);
    state->job.renewals = N_RENEWALS - 1;
    begin_again(state, &trail, &work.bank);
    work_for(state, INT64_MAX, &work.bank, &work.filters);
}
void t_begin(State *state)
{
    Trail trail;
    prepare_filters(&work.filters);
    trail_of(state, &trail);
    begin_bank(state, &trail, trail.alarm);
    work_for(state, INT64_MAX, &work.bank, &work.filters);
}
void t_advance(State *state, const double *packed)
{
    prepare_filters(&work.filters);
    advance_bank(state, packed, -INFINITY, &work.bank, &work.filters);
}
"""


@cache
def course() -> Course:
    """The motor along its recording."""
    return Course(plant_in_full(NAME)[2], SAMPLES)


def after(rows: int) -> Monitor:
    """The motor after a number of samples; not to be changed."""
    return course().after(rows)


@cache
def alarm() -> int:
    """The sample of the alarm."""
    return int(after(345).number("clock.alarm"))


@cache
def ready() -> int:
    """Samples after which all lanes have begun."""
    return next(k for k in range(alarm() + 1, 345) if after(k).number("job.settled") >= 0)


@cache
def late() -> int:
    """Samples after which lanes have begun twice again."""
    return next(k for k in range(alarm() + 101, 345) if after(k).number("job.kind") == 0)


def sums(of: Monitor | Bare) -> tuple[FloatArray, FloatArray]:
    """Sums of all lanes, (2, n_outputs, n_lanes), and the samples after which they began."""
    shape = (2, len(SPEC.outputs), -1)
    one, two = ((of.numbers(f"bank.{k}") if isinstance(of, Monitor) else of[f"bank.{k}"]) for k in ("sums", "since"))
    return one.reshape(shape).copy(), two.reshape(shape).copy()


def lanes(of: Bare) -> list[FloatArray]:
    """All lanes, steps first."""
    return [of.lane(k) for k in range(N + PLAN.n_lanes)]


def test_sums_begin_when_all_lanes_have_begun() -> None:
    """A bank has no misfit then: what it has seen so far has chosen its onsets."""
    assert 0 < alarm() < ready() - 1 < 250
    found, since = sums(after(ready()))
    assert not np.any(found)
    assert np.all(since == ready() - 1)
    assert np.any(sums(after(ready() + 5))[0])
    assert not np.any(sums(after(ready() - 1))[0])
    assert not np.any(sums(after(alarm()))[1])


def test_a_sample_takes_all_lanes_further() -> None:
    """After a sample steps and lanes with a slot are where their filters are, and the sums of each are its own."""
    before = after(ready() + 1)
    monitor, _ = stepped(before, SAMPLES[ready() + 1])
    packed, place, n_y = monitor.row(ready() + 1)[0].copy(), SPEC.sample_fields, len(SPEC.outputs)
    packed[place["again"]], packed[place["bound"]] = 1.0, SPEC.thresholds.bank_bound
    assert packed[place["use"]].tolist() == [1.0] * n_y
    (old, _), (new, _) = sums(before), sums(monitor)
    alone = [N + k for k, lane in enumerate(PLAN.lanes[: PLAN.switched]) if lane.kind not in MOVING]
    for core, places in ((plant_in_full(NAME)[2], list(range(N))), (plant_in_full(NAME)[2].slot, alone)):
        found, innovations = core.advance(np.array([before.lane(k) for k in places]).T, packed[None, :])
        assert np.array_equal(found.T, np.array([monitor.lane(k) for k in places]))
        limit, drift = SPEC.thresholds.cusum_clip, SPEC.thresholds.cusum_drift
        score = np.clip(innovations[0, :n_y] / np.sqrt(innovations[0, n_y:]), -limit, limit)
        wanted = [np.maximum(old[side][:, places] + sign * score - drift, 0.0) for side, sign in ((0, 1.0), (1, -1.0))]
        assert new[:, :, places] == pytest.approx(np.array(wanted), rel=1e-12, abs=1e-12)
    assert new.shape[2] == N + PLAN.n_lanes + PER_COUPLE * sum(n_coupled(SPEC))


def restored(monitor: Monitor) -> Bare:
    """The core with calls of these tests, in the state of a monitor that waits for the next sample."""
    core = bare(CALLS, (EXAMPLES / NAME / "model.yaml").read_text(encoding="utf-8"))
    core.restore(monitor.save())
    core["clock.index"] -= 1
    return core


def test_only_lanes_that_begin_again_lose_their_sums() -> None:
    """Renewed lanes have empty sums from that sample on; of noise, and of what comes and goes, none is."""
    core = restored(after(late()))
    core["bank.sums"] += 0.5
    before, (old, began) = lanes(core), sums(core)
    core.call("t_renew")
    pairs = zip(before, lanes(core), strict=True)
    differs: BoolArray = np.array([not np.array_equal(one, two, equal_nan=True) for one, two in pairs])
    (new, now), planned = sums(core), len(differs)
    old, began, new, now = (item[:, :, :planned] for item in (old, began, new, now))
    lost: BoolArray = np.any(new != old, axis=(0, 1))
    assert not np.any(differs & ~lost)
    assert (lost & ~differs).sum() < 5  # a lane may begin again with the very digits that it had
    assert lost[:N].sum() > 0
    assert 0 < lost[N:].sum() < PLAN.n_lanes
    renewable = [k < PLAN.switched and item.kind is not FaultKind.NOISE for k, item in enumerate(PLAN.lanes)]
    assert not np.any(lost[N:] & ~np.array(renewable))
    assert not np.any(new[:, :, lost])
    assert np.all(now[:, :, lost] == late() - 1)
    assert np.array_equal(now[:, :, ~lost], began[:, :, ~lost])


def test_where_nobody_works_on_the_bank_lanes_go_on() -> None:
    """While no work is left, a sample takes all lanes of steps on, and while lanes begin again most of them."""
    monitor, place, still = after(ready()), SPEC.sample_fields, 0
    for index in range(ready(), alarm() + 60):
        before = np.array([monitor.lane(k) for k in range(N)]).T
        monitor, _ = stepped(monitor, SAMPLES[index])
        packed = monitor.row(index)[0].copy()
        packed[place["again"]], packed[place["bound"]] = 1.0, SPEC.thresholds.bank_bound
        passed = plant_in_full(NAME)[2].advance(before, packed[None, :])[0].T
        same = np.array([np.array_equal(one, monitor.lane(k)) for k, one in enumerate(passed)])
        still += not same.all()
        assert same.all() or monitor.number("job.renewals") == 1
        assert same.mean() > 0.5
    assert still > 0


@pytest.mark.parametrize("call", ["t_begin", "t_advance", "t_renew"])
def test_parameters_that_were_accepted_as_drifting_move_on_in_the_bank(call: str) -> None:
    """At the alarm, at each sample and at each new beginning lanes are passed over samples as the healthy one is."""
    found = []
    for rate in (0.0, 0.05):
        core = restored(after(late()))
        core["normal.rates"] = rate * (np.arange(len(SPEC.parameters)) == 0)
        packed = after(late() + 1).row(late())[0].copy()
        packed[SPEC.sample_fields["use"]] = 0.0
        core.call(call, *{"t_advance": [packed]}.get(call, []))
        found.append(np.array([lane[SPEC.parameter_slice.start] for lane in lanes(core)]))
    moved = found[1] - found[0]
    if call == "t_advance":
        assert moved == pytest.approx(0.05 * SAMPLES[1].dt, rel=1e-6)
    else:
        places = np.arange(N) if call == "t_begin" else np.arange(0)
        assert np.all(moved[places] != 0.0)
        assert np.any(moved[:N] != 0.0)
        assert np.any(moved[N:] != 0.0)


def test_what_comes_and_goes_is_not_weighed_by_samples_at_which_the_model_did_not_hold() -> None:
    """How seldom it does goes by the part of a likelihood that counts, and so by the samples that are judged."""
    found = []
    for earlier, outside in ((0, 0), (2000, 2000), (2000, 0)):
        core = restored(after(late()))
        core["clock.index"] += earlier
        core["clock.begun"] += earlier
        core["alarm.outside"] = outside
        core.call("t_advance", after(late() + 1).row(late())[0])
        pairs = slice(N + PLAN.switched, N + PLAN.n_lanes)
        found.append(np.array([lane[-1] for lane in lanes(core)[pairs]]))
    assert np.array_equal(found[0], found[1])
    assert not np.array_equal(found[0], found[2])
