"""How well each lane explains the data: the detector's sums, lane by lane; and slow errors that left their size."""

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.arrays import FloatArray
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec
from faultbond.synthesis.compile import find_compiler
from faultbond.types import FaultKind

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
CALLS = """
static double all[2 * N_OUTPUTS][FB_ROOM(N_LANES)];
int64_t t_lanes(State *state) { (void)state; return N_LANES; }
void t_begin(State *state, const double *index) { begin_misfit(&state->bank, (int64_t)*index); }
void t_again(State *state, const double *lane, const double *index)
{
    begin_misfit_again(&state->bank, (int64_t)*lane, (int64_t)*index);
}
void t_misfit(State *state, const double *packed, const double *innovations)
{
    memcpy(all, innovations, sizeof all);
    add_misfit(&state->bank, &state->inputs, packed, all, state->clock.index);
}
void t_accumulate(State *state, const double *packed, const double *innovations)
{
    accumulate(&state->clock, &state->inputs, &state->healthy, &state->sensors, packed, innovations);
}
/* The first drift comes to stay, of which so much stays what it was; gives its lanes. */
void t_mix(State *state, double *told)
{
    mix_misfit(&state->bank, drift_of(0), stay_of(0), told[0]);
    told[0] = (double)(N_STEPS + drift_of(0));
    told[1] = (double)(N_STEPS + stay_of(0));
}
/* The first pair that takes over a drift of another way of its store; -1: none does. */
int64_t t_strange(State *state)
{
    for (int64_t pair = 0; pair < N_RAMPS; pair++) {
        const int64_t drift = likeliest_drift(&state->bank, pair);
        if (drift < 0 || SLOT_KEEPS[drift] != SLOT_KEEPS[drift_of(pair)]) return pair;
    }
    return -1;
}
int64_t t_slow_error_alarms(State *state) { return slow_error_alarms(&state->clock, state->healthy.lane); }
"""
N_Y = 2


def packed(spec: EngineSpec, use: FloatArray | None = None, scale: FloatArray | None = None) -> FloatArray:
    """A packed sample of which only use and scale count, by default 1."""
    sample = np.zeros(spec.n_sample)
    sample[spec.sample_fields["use"]] = 1.0 if use is None else use
    sample[spec.sample_fields["scale"]] = 1.0 if scale is None else scale
    return sample


def begun(index: int) -> tuple[Bare, int]:
    """A core whose inputs are known, with sums that begin after a sample; and how many lanes it has."""
    core = bare(CALLS)
    core["inputs.held"], core["clock.begun"], core["clock.running"] = 1.0, 0, 1
    core.call("t_begin", np.array([float(index)]))
    return core, core.call("t_lanes")


def add(core: Bare, index: int, sample: FloatArray, innovations: FloatArray) -> None:
    """Take the innovations (2 n_outputs, n_lanes) of a sample."""
    core["clock.index"] = index
    core.call("t_misfit", sample, np.ascontiguousarray(innovations))


def sums(core: Bare) -> tuple[FloatArray, FloatArray]:
    """Sums of all lanes, (2, n_outputs, n_lanes), and the samples after which they began."""
    return core["bank.sums"].reshape(2, N_Y, -1), core["bank.since"].reshape(2, N_Y, -1)


def test_sums_of_the_healthy_lane_are_those_of_the_detector() -> None:
    """Given the same innovations, missing and blanked values among them, both sums and their begins are the same."""
    generator, settings = np.random.default_rng(5), bare(CALLS).spec.thresholds
    start = settings.warm_up_samples
    core, n = begun(start - 1)
    for index in range(start, start + 400):
        shift = 1.5 if index > start + 200 else 0.0
        found = np.concatenate([generator.normal(shift, 2.0, N_Y), generator.uniform(1.0, 6.0, N_Y)])
        use = np.where(generator.random(N_Y) > 0.2, 1.0, 0.0)
        sample = packed(core.spec, use, np.where(generator.random(N_Y) > 0.8, settings.blank_factor, 1.0))
        every = generator.normal(size=(2 * N_Y, n)) ** 2
        every[:, 1] = found
        core["inputs.guessed"] = 0.0 if index % 50 else 1e3  # of an input that is unknown nothing is learned
        core["inputs.leap"], core["inputs.habit"] = 1.0, 1.0
        add(core, index, sample, every)
        core.call("t_accumulate", sample, found)
        (now, since), begins = sums(core), core["sensors.cusum_start"].reshape(2, N_Y)
        assert now[:, :, 1] == pytest.approx(core["sensors.cusum"].reshape(2, N_Y), rel=1e-12, abs=1e-12)
        assert np.array_equal(since[:, :, 1], begins)
    assert now[0, :, 1].max() > settings.cusum_limit
    assert np.any(since[:, :, 1] < start + 399)
    assert not np.array_equal(now[:, :, 0], now[:, :, 1])


def test_a_lane_without_numbers_misfits() -> None:
    """An innovation that is no number counts as one as large as an innovation can count."""
    core, n = begun(7)
    settings = core.spec.thresholds
    add(core, 8, packed(core.spec), np.full((2 * N_Y, n), np.nan))
    now, since = sums(core)
    assert now[0] == pytest.approx(settings.cusum_clip - settings.cusum_drift)
    assert np.all(now[1] == 0.0)
    assert since[:, :, 0].tolist() == [[7.0, 7.0], [8.0, 8.0]]


def test_a_wild_innovation_counts_so_far() -> None:
    """An innovation of any size adds to one side no more than the clip, and takes as much from the other."""
    core, n = begun(3)
    settings = core.spec.thresholds
    core["bank.sums"] = 10.0
    add(core, 9, packed(core.spec), np.repeat([[1e6], [-1e6], [1.0], [1.0]], n, axis=1))
    up, down = 10.0 + settings.cusum_clip - settings.cusum_drift, 10.0 - settings.cusum_clip - settings.cusum_drift
    now, since = sums(core)
    assert now[:, :, 0] == pytest.approx(np.array([[up, down], [down, up]]))
    assert np.all(since == 3.0)


def test_lanes_begun_again_have_empty_sums() -> None:
    """Lanes that are begun again lose their sums, which run from that sample on; the others keep theirs."""
    core, n = begun(4)
    core["bank.sums"] = np.random.default_rng(0).random((2, N_Y, n))
    before = sums(core)[0].copy()
    core.call("t_again", np.array([1.0]), np.array([30.0]))
    now, since = sums(core)
    assert np.all(now[:, :, 1] == 0.0)
    assert np.all(since[:, :, 1] == 30.0)
    kept = np.arange(n) != 1
    assert np.array_equal(now[:, :, kept], before[:, :, kept])
    assert np.all(since[:, :, kept] == 4.0)


def test_what_comes_and_goes_stays_contradicted() -> None:
    """A sum above the limit does not fall again in lanes that come and go or scatter; below the limit it does."""
    core, n = begun(0)
    settings, plan = core.spec.thresholds, plan_slots(core.spec)
    pairs = n - (plan.n_lanes - plan.switched)
    assert 0 < pairs < n - 1
    first = n - plan.n_lanes
    scatters = [first + k for k, item in enumerate(plan.lanes) if item.kind is FaultKind.NOISE]
    falls = sorted({*range(pairs)} - {*scatters})
    assert 0 < len(scatters) < len(falls)
    quiet = np.repeat([[0.0], [0.0], [1.0], [1.0]], n, axis=1)
    rows = int(settings.cusum_limit / (settings.cusum_clip - settings.cusum_drift)) + 2
    for index in range(rows):
        wild = quiet.copy()
        wild[:N_Y] = 9.0
        wild[:N_Y, -1] *= float(index < 3)  # the last lane is contradicted for three samples only
        add(core, index, packed(core.spec), wild)
    peak = sums(core)[0][0, :, pairs][:, None].copy()
    assert peak.min() > settings.cusum_limit
    for index in range(rows, rows + 400):
        add(core, index, packed(core.spec), quiet)
    now, _ = sums(core)
    assert np.all(now[0][:, falls] == 0.0)
    assert np.all(now[0, :, pairs:-1] == peak)
    assert np.all(now[0][:, scatters] == peak)
    assert np.all(now[0, :, -1] == 0.0)


@pytest.mark.parametrize(("pause", "alarms"), [(0.3, False), (0.5, True)])
def test_slow_errors_are_watched_by_the_clock(pause: float, alarms: bool) -> None:
    """Where rows are the grid, a slow error alarms after its memory in seconds, not after as many rows."""
    core = bare(CALLS, CELL.replace("sample_time: 0.5 s", "sample_time: variable"))
    (slow,) = core.spec.slow_errors
    assert slow.memory == 20.0
    core["clock.begun"], core["clock.index"], core["clock.pause"] = 0, 50, pause
    lane = np.zeros(core.spec.n_numbers)
    lane[core.spec.slow_slice] = 1.01 * slow.limit * slow.sd
    core["healthy.lane"] = lane
    assert core.call("t_slow_error_alarms") == alarms
    core["healthy.lane"] = 0.9 * lane
    assert not core.call("t_slow_error_alarms")
    core["healthy.lane"], core["clock.accepted"] = lane, 20
    assert not core.call("t_slow_error_alarms")


@pytest.mark.parametrize("kept", [0.0, 0.25, 0.75, 1.0])
def test_what_has_come_to_stay_is_judged_as_what_it_was(kept: float) -> None:
    """Its sums are those of both, as likely as it is that it stayed; they began with those of the likelier one."""
    core, n = begun(3)
    generator = np.random.default_rng(8)
    for index in range(4, 30):  # scores that drive sums away from 0
        innovations = np.concatenate([generator.normal(1.0, 1.0, (N_Y, n)), np.ones((N_Y, n))])
        add(core, index, packed(core.spec), innovations)
    before, began = (item.copy() for item in sums(core))
    lanes = np.array([kept, 0.0])
    core.call("t_mix", lanes)
    drift, stay = map(int, lanes)
    after, begins = sums(core)
    assert np.any(before[:, :, drift] != before[:, :, stay])
    assert after[:, :, stay] == pytest.approx(kept * before[:, :, stay] + (1.0 - kept) * before[:, :, drift])
    assert np.array_equal(begins[:, :, stay], began[:, :, stay if kept > 0.5 else drift])
    others = np.arange(before.shape[2]) != stay
    assert np.array_equal(after[:, :, others], before[:, :, others])


def test_each_way_of_a_store_comes_to_stay_by_itself() -> None:
    """What has come to stay with its content takes over no drift without, which stands beside it, nor the other way."""
    core, _ = begun(3)
    assert any(lane.keeps for lane in plan_slots(core.spec).lanes)
    assert core.call("t_strange") == -1
