"""Where lanes of steps begin: suspects at their starts, stores that keep what they hold, and the first sample."""

from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.synthesis.compile import find_compiler
from faultbond.types import FaultKind
from made import EXAMPLES

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
CALLS = """
static StepMemory steps;
static PlainBlock group;
static Filters filters;
static Trail trail;
void t_suspect(State *state, const double *lane, const double *tied, const double *healthy, double *to)
{
    Start start;
    (void)state;
    planned_start((int64_t)*lane, &start);
    start.tied = *tied != 0.0;
    suspect_lane(&start, healthy, to);
}
/* Rows of the past, [n][samples and lanes], and lane 0 begun at one of them. */
void t_begin(State *state, const double *rows, const double *n, const double *onset, double *to)
{
    const int64_t width = N_SAMPLE + PLAIN_NUMBERS;
    prepare_filters(&filters);
    trail.past = &state->past;
    trail.oldest = DEPTH - 2;
    trail.n = (int64_t)*n;
    for (int64_t k = 0; k < trail.n; k++)
        memcpy(row_of(&state->past, trail.oldest + k), rows + k * width, (size_t)width * sizeof *rows);
    for (int64_t l = 0; l < GROUP; l++) planned_start(0, &steps.starts[l]);
    begin_steps(steps.starts, &trail, (int64_t)*onset, &state->normal, group, &steps, &filters.plain);
    run_steps(group, &trail, (int64_t)*onset, trail.n, (int64_t)*onset, &state->normal, steps.sample, &filters.plain);
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) to[k] = group[k][0];
}
/* A lane after the samples from an onset on, which is that of the first sample of all if `early`. */
void t_run(State *state, const double *rows, const double *n, const double *early, double *lane)
{
    static BankMemory bank;
    Job *job = &state->job;
    prepare_filters(&filters);
    trail.past = &state->past;
    trail.oldest = job->oldest = job->next = DEPTH - 2;
    trail.n = (int64_t)*n;
    job->end = job->oldest + trail.n - 1;
    job->pass = NEAR_ONSETS;
    job->onset = job->search.place[0] = 0;
    job->search.early = *early != 0.0;
    for (int64_t k = 0; k < trail.n; k++)
        memcpy(row_of(&state->past, trail.oldest + k)->sample, rows + k * N_SAMPLE, N_SAMPLE * sizeof *rows);
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++)
        for (int64_t l = 0; l < GROUP; l++) job->run[k][l] = lane[k];
    run_group(state, &trail, INT64_MAX / 2, &bank, &filters);
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) lane[k] = job->run[k][0];
}
/* What begins again, `elapsed` s before its lane has this size and rate: the size and rate with which it does. */
int64_t t_again(State *state, const double *now, const double *elapsed, double *begun)
{
    static WideBlock wide;
    double noted[FOUND];
    int64_t slot = 0;
    (void)state;
    while (slot < N_SLOT_LANES && !(SLOT_LAG[slot] > 0.0)) slot++;
    if (slot == N_SLOT_LANES) return -1;
    note_slot(slot, now[0], now[1], 0.3 * *elapsed, noted);
    begin_at_found(slot, noted, 0.7 * *elapsed, wide, 0);
    begun[0] = wide[AT_SLOT][0];
    begun[1] = wide[AT_SLOT + 1][0];
    return 0;
}
int64_t t_worth(State *state, const double *count, const double *again)
{
    state->clock.index = (int64_t)*count - 1;
    for (int64_t k = 0; k < (int64_t)*count; k++) {
        double *sample = row_of(&state->past, k)->sample;
        for (int j = 0; j < N_OUTPUTS; j++) sample[SAMPLE_USE + j] = k + 5 > (int64_t)*count || j == 0;
    }
    return worth_starting_from(state, (int64_t)*count, *again != 0.0);
}
void t_one(State *state, const double *sample, double *lane)
{
    prepare_filters(&filters);
    advance_one(lane, sample, &state->normal, NULL, &filters.plain);
}
"""
PLANTS, START_SAMPLES = ("tank", "rlc"), int(core_settings()["START_SAMPLES"])


@cache
def core(name: str) -> Bare:
    """The core of a plant."""
    text = CELL if name == "cell" else (EXAMPLES / name / "model.yaml").read_text(encoding="utf-8")
    return bare(CALLS, text)


def wide_lane(spec: EngineSpec, seed: int = 1) -> FloatArray:
    """A healthy lane, shape (n_numbers,), in which everything is correlated and no mean is a round number."""
    generator, lane = np.random.default_rng(seed), np.zeros(spec.n_numbers)
    lane[: len(spec.states)] = 3.0
    root = 0.05 * generator.normal(size=(spec.n_joint, spec.n_joint))
    lane[spec.covariance_slice] = pack(root @ root.T + 0.01 * np.eye(spec.n_joint))
    lane[spec.parameter_slice] = [item.healthy for item in spec.parameters]
    lane[spec.parameter_slice] *= generator.uniform(0.95, 1.05, len(spec.parameters))
    lane[spec.slow_slice] = 0.3
    lane[-1] = -12.5
    return lane


def suspect_lanes(core: Bare, healthy: FloatArray, *, tied: bool = False) -> FloatArray:
    """All lanes of the plan from a healthy one, (n_lanes, n_numbers)."""
    lanes = np.zeros((plan_lanes(core.spec).n_lanes, core.spec.n_numbers))
    for k, lane in enumerate(lanes):
        core.call("t_suspect", np.array([float(k)]), np.array([float(tied)]), healthy, lane)
    return lanes


def is_positive(full: FloatArray) -> bool:
    """Whether a covariance is positive definite."""
    sd = np.sqrt(np.diag(full))
    return bool(np.linalg.eigvalsh(full / np.outer(sd, sd)).min() > 0.0)


@pytest.mark.parametrize("name", PLANTS)
def test_suspects_begin_at_their_starts(name: str) -> None:
    """In its lanes a suspect stands at its start, as wide as that and correlated with nothing; the rest is healthy."""
    spec = core(name).spec
    plan, healthy = plan_lanes(spec), wide_lane(spec)
    lanes, before = suspect_lanes(core(name), healthy), unpack(spec, healthy[spec.covariance_slice])
    first, n_x = spec.parameter_slice.start, len(spec.states)
    for lane, z in enumerate(lanes):
        full = unpack(spec, z[spec.covariance_slice])
        chosen = np.flatnonzero(plan.suspected[:, lane])
        own = first + chosen
        others = np.setdiff1d(np.arange(spec.n_joint), own)
        for index, k in zip(chosen, own, strict=True):
            item = spec.parameters[index]
            value = np.clip(healthy[k] * plan.values[index, lane], item.lower, item.upper)
            assert z[k] == pytest.approx(value, rel=1e-14)
            assert full[k, k] == pytest.approx((plan.sds[index, lane] * healthy[k]) ** 2, rel=1e-12)
            assert not np.any(full[k, others])
        still = others[others >= n_x]
        assert np.array_equal(z[still], healthy[still])
        assert np.array_equal(full[np.ix_(still, still)], before[np.ix_(still, still)])
        if not plan.jumps[lane].any():
            assert np.array_equal(full[np.ix_(others, others)], before[np.ix_(others, others)])
            assert np.array_equal(z[:n_x], healthy[:n_x])
        assert is_positive(full)
        assert np.array_equal(z[spec.n_joint + spec.n_packed :], healthy[spec.n_joint + spec.n_packed :])


def content_variance(spec: EngineSpec, lane: FloatArray, exponents: dict[int, float]) -> float:
    """The relative variance, to first order, of the product of elements of z, each to its exponent."""
    full, places = unpack(spec, lane[spec.covariance_slice]), list(exponents)
    slopes = np.array([exponents[k] / lane[k] for k in places])
    return float(slopes @ full[np.ix_(places, places)] @ slopes)


def test_content_goes_on_where_it_is_kept() -> None:
    """Where a store keeps its content, its effort or flow moves against its own parameter, and nothing else moves."""
    spec = core("rlc").spec
    plan, healthy = plan_lanes(spec), wide_lane(spec)
    lanes = suspect_lanes(core("rlc"), healthy)
    names = [item.name for item in spec.parameters]
    for state, (store, owner) in enumerate((("C.e", "C"), ("L.f", "L"))):
        assert spec.states[state].name == store
        index = names.index(owner)
        jumping = np.flatnonzero(plan.jumps[:, state])
        assert len(jumping) > 0
        assert all(plan.suspected[index, lane] for lane in jumping)
        for lane in jumping:
            factor = plan.values[index, lane]
            assert lanes[lane, state] == pytest.approx(healthy[state] / factor, rel=1e-9)
            assert lanes[lane, 1 - state] == healthy[1 - state]
            # e = content/factor: as uncertain as the content before, and as the factor (relative sd) makes it
            place = spec.parameter_slice.start + index
            before = content_variance(spec, healthy, {state: 1.0, place: 1.0}) * (healthy[state] / factor) ** 2
            relative = plan.sds[index, lane] * healthy[place] / lanes[lane, place]
            found = unpack(spec, lanes[lane, spec.covariance_slice])[state, state]
            assert found == pytest.approx(before + (lanes[lane, state] * relative) ** 2, rel=1e-9)


def jumps(spec: EngineSpec) -> Iterator[tuple[int, int, dict[int, float]]]:
    """State and lane of each store that jumps, and the exponents of what it holds by place in z."""
    plan, first = plan_lanes(spec), spec.parameter_slice.start
    for state, item in enumerate(spec.states):
        for lane in np.flatnonzero(plan.jumps[:, state]):
            own = {first + k: -exponent for k, exponent in item.jumps if plan.suspected[k, lane]}
            yield state, int(lane), own


@pytest.mark.parametrize("clipped", [False, True])
@pytest.mark.parametrize("name", PLANTS)
def test_a_tied_jump_keeps_the_content(name: str, clipped: bool) -> None:
    """Begun from what was found, a store holds what it held, as uncertain as before and not bound to the factor.

    Also where a parameter cannot go as far as its start says.
    """
    spec = core(name).spec
    healthy, checked, bound = wide_lane(spec), 0, 0
    if clipped:
        healthy[spec.parameter_slice] *= [item.upper / item.healthy / 1.2 for item in spec.parameters]
    lanes = suspect_lanes(core(name), healthy, tied=True)
    for state, k, own in jumps(spec):
        lane, exponents, slopes = lanes[k], {state: 1.0} | own, np.zeros(spec.n_joint)
        full = unpack(spec, lane[spec.covariance_slice])
        slopes[list(exponents)] = [exponent / lane[place] for place, exponent in exponents.items()]
        content, held = (np.prod([z[place] ** e for place, e in exponents.items()]) for z in (lane, healthy))
        assert content == pytest.approx(held, rel=1e-9)
        sds = np.sqrt(np.diag(full))[list(own)] / lane[list(own)]
        assert full[list(own)] @ slopes / (sds * lane[list(own)]) == pytest.approx(0.0, abs=1e-9 * sds.max())
        known = content_variance(spec, healthy, exponents)
        assert content_variance(spec, lane, exponents) == pytest.approx(known, rel=1e-9, abs=1e-12 * sds.max() ** 2)
        assert is_positive(full)
        checked += 1
        bound += any(lane[place] == spec.parameters[place - spec.parameter_slice.start].upper for place in own)
    assert checked > 5
    assert (bound > 2) == clipped


def test_which_faults_come_up_slowly() -> None:
    """Those of an input that settles in sight of a sensor, and steps of what that feels as soon; none of the circuit.

    The meter at the inlet of the tank feels the pump, its speed and what is between; the outlet feels the level first.
    """
    tank = core("tank").spec
    slow = [item for item in plan_slots(tank).lanes if item.settling]
    steps = {tank.parameters[item.parameter].name for item in slow if item.kind is FaultKind.STEP}
    assert all(item.settling > 0.0 for item in tank.inputs)
    assert {item.settling for item in slow} == {tank.inputs[0].settling}
    assert steps == {"K1", "K2", "K7", "K8"} == {item.name for item in tank.parameters if item.settling}
    faults = [(item.kind, item.input) for item in slow if item.kind is not FaultKind.STEP]
    assert sorted(faults, key=str) == sorted(
        ((kind, 0) for kind in 2 * [FaultKind.BIAS, FaultKind.STUCK] + [FaultKind.GAIN]), key=str
    )
    assert not any(item.settling for item in plan_slots(core("rlc").spec).lanes)


def test_no_time_passes_twice_at_the_onset() -> None:
    """Half of the way of a fault that came at the sample before; all that is healthy is as well known as before it.

    What a gap or a kick adds at the onset is added once, before its readings.
    """
    cell = core("cell")
    spec, n, onset, n_x = cell.spec, 9, 4, len(cell.spec.states)
    place, generator = spec.sample_fields, np.random.default_rng(4)
    samples, lanes = np.zeros((n, spec.n_sample)), np.array([wide_lane(spec, k) for k in range(n)])
    samples[:, place["dt"]], samples[:, place["use"]], samples[:, place["scale"]] = 0.5, 1.0, 1.0
    samples[:, place["fresh"]] = spec.input_variance
    samples[:, place["u"]] = samples[:, place["u_before"]] = [3.0, 0.1]
    samples[:, place["y"]] = generator.normal(0.5, 1.0, (n, 2))
    samples[onset, place["kick"]], samples[onset, place["gap"]] = 0.02, 0.3
    found = np.zeros(spec.n_numbers)
    rows = np.ascontiguousarray(np.concatenate([samples, lanes], axis=1))
    cell.call("t_begin", rows, np.array([float(n)]), np.array([float(onset)]), found)
    later = lanes[onset - 1].copy()
    samples[:, place["again"]], samples[:, place["bound"]] = 1.0, spec.thresholds.bank_bound
    blind = samples[onset].copy()
    blind[place["use"]] = 0.0
    early = suspect_lanes(cell, later)[0]
    cell.call("t_one", blind, early)
    cell.call("t_one", blind, later)
    expected, half = suspect_lanes(cell, later)[0], np.zeros(spec.n_joint)
    half[:n_x] = 0.5 * (early[:n_x] - expected[:n_x])
    expected[: spec.n_joint] += half
    expected[spec.covariance_slice] += pack(np.outer(half, half))
    expected[-1] = lanes[onset - 1, -1]
    samples[onset, place["dt"]] = 0.0
    samples[onset, place["kick"]] = samples[onset, place["gap"]] = 0.0
    for sample in samples[onset:]:
        cell.call("t_one", sample, expected)
    assert found == pytest.approx(expected, rel=1e-8, abs=1e-12)


def test_time_passes_before_the_first_sample_of_all_as_for_the_healthy_filter() -> None:
    """A lane that is begun before it has not taken its length yet, one that is begun at another onset has."""
    cell = core("cell")
    spec, n = cell.spec, 3
    place, samples = spec.sample_fields, np.zeros((n, spec.n_sample))
    samples[:, place["dt"]], samples[:, place["use"]], samples[:, place["scale"]] = 0.5, 1.0, 1.0
    samples[:, place["fresh"]] = spec.input_variance
    samples[:, place["u"]] = samples[:, place["u_before"]] = [3.0, 0.1]
    for early in (0.0, 1.0):
        found, expected = wide_lane(spec), wide_lane(spec)
        cell.call("t_run", samples, np.array([float(n)]), np.array([early]), found)
        taken = samples.copy()
        taken[:, place["again"]], taken[:, place["bound"]] = 1.0, spec.thresholds.bank_bound
        taken[0, place["dt"]] *= early
        for sample in taken:
            cell.call("t_one", sample, expected)
        assert found == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize(("again", "worth"), [(0.0, 200), (1.0, START_SAMPLES)])
def test_a_stated_start_counts_where_the_filter_begins_only(again: float, worth: int) -> None:
    """Of a filter that begins anew only the last samples are worth it, from where a sensor reads that was silent."""
    stated = CELL.replace("{C1: 1 F}}", "{C1: 1 F}, start: {q: 1 C, sd: 0.1 C}}")
    assert bare(CALLS, stated).call("t_worth", np.array([200.0]), np.array([again])) == worth


@pytest.mark.parametrize("elapsed", [0.5, 2.0, 30.0])
def test_a_step_that_lags_begins_again_with_the_rate_that_leads_to_where_it_is(elapsed: float) -> None:
    """The rate fades: after t it is exp(-t/T) of the first one, and the size 1 - exp(-t/T) of that times T."""
    lag, first = 2.0, 0.7
    lagging = bare(CALLS, CELL.replace("settling: 3 s", f"lag: {lag} s"))
    left, begun = np.exp(-elapsed / lag), np.zeros(2)
    now = np.array([first * lag * (1.0 - left), first * left])
    assert lagging.call("t_again", now, np.array([elapsed]), begun) == 0
    assert begun == pytest.approx([0.0, first])
