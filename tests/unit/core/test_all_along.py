"""What was off before the samples that are kept: states that go with what the healthy filter has learned."""

from functools import cache

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.model.text import parse_model
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.types import FaultKind
from made import samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
NOISY = CELL.replace("V: {unit: V, settling: 3 s}", "V: {unit: V, noise: 10 mV}")
NOISY = NOISY.replace("W: {unit: A}", "W: {unit: A, lag: 2 s}")
NOISY = NOISY.replace("law: f = W}", "law: f = g*W, parameters: {g: 1}}")
NOISY = NOISY.replace("slow_error: {", "slow_error: {v: 20 mV over 60 s, ")
ADDED = NOISY.replace("law: f = g*W, parameters: {g: 1}", "law: f = W + 2*g, parameters: {g: 4 A}")
CALLS = """
static double group[WIDE_NUMBERS][GROUP];
static SlotMemory slots;
static Trail trail;
void t_restate(State *state, const double *old, double *lane)
{
    (void)state;
    restate(old, lane);
}
/* how: number, mean, variance, and whether it has been so all along */
void t_replace(State *state, const double *how, double *lane)
{
    (void)state;
    replace_number((int64_t)how[0], how[1], how[2], how[3] != 0.0, lane);
}
/* A lane of the plan begun from a healthy one, and as it goes along; one sample was seen, of sensors and inputs. */
void t_slot(State *state, const double *k, const double *plain, const double *values, double *before, double *after)
{
    const double peak[FB_ROOM(N_INPUTS)] = {0.0};
    trail.past = &state->past;
    trail.n = 1;
    for (int j = 0; j < N_OUTPUTS; j++) {
        row_of(&state->past, 0)->sample[SAMPLE_Y + j] = values[j];
        row_of(&state->past, 0)->sample[SAMPLE_USE + j] = 1.0;
    }
    for (int i = 0; i < N_INPUTS; i++) row_of(&state->past, 0)->sample[SAMPLE_U + i] = values[N_OUTPUTS + i];
    prepare_slots(&trail, plain, 1, NULL, &slots);
    begin_slot((int64_t)*k, &trail, peak, &slots.start, group, 3);
    group[AT_SLOT][3] += 0.7; /* as found */
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) before[i] = group[i][3];
    go_along((int64_t)*k, &trail, 1, group, 3);
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) after[i] = group[i][3];
}
/* A trail of the same sample and lane again and again. */
static void in_trail(State *state, const double *plain, const double *values, int64_t n)
{
    trail.past = &state->past;
    trail.oldest = 0;
    trail.n = n;
    for (int64_t k = 0; k < n; k++) {
        Row *row = row_of(&state->past, k);
        memset(row->sample, 0, sizeof row->sample);
        memcpy(row->lane, plain, sizeof row->lane);
        row->sample[SAMPLE_DT] = 0.5;
        for (int j = 0; j < N_OUTPUTS; j++) {
            row->sample[SAMPLE_Y + j] = values[j];
            row->sample[SAMPLE_USE + j] = row->sample[SAMPLE_SCALE + j] = 1.0;
        }
        for (int i = 0; i < N_INPUTS; i++)
            row->sample[SAMPLE_U + i] = row->sample[SAMPLE_U_BEFORE + i] = values[N_OUTPUTS + i];
    }
}
/* By how much the first state goes with the slot of each lane of the plan where it has been off all along, and where it
   begins at the first sample; and whether steps know. */
void t_begun(State *state, const double *plain, const double *values, double *later, double *at_first, double *steps)
{
    static const Beginning beginning = {0, 20, 0};
    static FirstMemory first;
    static Filters filters;
    static Walk walk;
    const double peak[FB_ROOM(N_INPUTS)] = {1.0};
    Start start;
    prepare_filters(&filters);
    in_trail(state, plain, values, 20);
    trail.old = plain;
    trail.all_along = 1;
    trail.beginning = &beginning;
    state->clock.accepted = -1;
    for (int64_t k = 0; k < N_SLOT_LANES; k++) {
        int64_t lane[GROUP];
        for (int l = 0; l < GROUP; l++) lane[l] = k;
        begin_slots(lane, NULL, &trail, 1, peak, group, &walk, &slots);
        later[k] = group[WIDE_PLACE(0, AT_SLOT)][2];
        begin_slots_at_first(lane, &trail, peak, &state->clock, &state->normal, group, &walk, &slots, &first,
                             &filters.plain);
        at_first[k] = group[WIDE_PLACE(0, AT_SLOT)][2];
    }
    state->job.lane[0] = 0;
    planned_or_chosen(state, &trail, 0, &start);
    steps[0] = start.all_along;
}
/* Of a couple of slot k of the plan with a component: by how much the first state goes with either. */
int64_t t_coupled(State *state, const double *k, const double *plain, const double *values, double *found)
{
    static StepMemory steps;
    Job *job = &state->job;
    in_trail(state, plain, values, 2);
    trail.old = plain;
    trail.all_along = 1;
    for (int couple = 0; couple < N_COUPLES; couple++) {
        if (COUPLE_BESIDE[couple] >= 0 || COUPLE_SLOT[couple] != SLOT_HYPOTHESIS[(int64_t)*k]) continue;
        state->bank.coupled[0] = couple;
        state->bank.base[0] = job->bases[0] = (int64_t)*k;
        job->values[0] = 1.3;
        memset(job->lane, 0, sizeof job->lane);
        fill_couples(&state->bank, &trail, 1, plain, job, &steps, &slots);
        found[0] = job->run[WIDE_PLACE(0, AT_SLOT)][1];
        found[1] = job->run[WIDE_PLACE(0, AT_PARAMETERS + COUPLE_PARAMETER[couple])][1];
        return 1;
    }
    return 0;
}
/* Lanes of steps, lane after lane, as they begin at the first sample, and the healthy lane there. */
void t_first(State *state, const double *from, double *start, double *found)
{
    static FirstMemory first;
    static StepMemory steps;
    static Filters filters;
    static PlainBlock plain;
    prepare_filters(&filters);
    trail_of(state, &trail);
    for (int64_t l = 0, lane = (int64_t)*from; l < GROUP; l++, lane++)
        planned_start(lane < N_PLANNED ? lane : 0, &steps.starts[l]);
    begin_steps_at_first(steps.starts, &trail, &state->clock, &state->normal, plain, &steps, &first, &filters.plain);
    memcpy(start, first.lane, sizeof first.lane);
    for (int l = 0; l < GROUP; l++)
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) found[l * PLAIN_NUMBERS + i] = plain[i][l];
}
void t_plan(State *state, const double *k, double *found)
{
    const int64_t lane = (int64_t)*k;
    (void)state;
    found[0] = SLOT_PARAMETER[lane];
    found[1] = SLOT_OUTPUT[lane];
    found[2] = SLOT_KIND[lane];
    found[3] = SLOT_SCALES[lane];
    found[4] = N_SLOT_LANES;
    found[5] = SLOT_ACTS[lane];
    found[6] = SLOT_STICKS[lane];
    found[7] = SLOT_SETTLING[lane];
    found[8] = SLOT_INPUT[lane];
}
"""


@cache
def core() -> Bare:
    """A core: a noisy input, one that lags and acts with a parameter alone, slow errors of a signal and of a sensor."""
    return bare(CALLS, NOISY)


def drawn(spec: EngineSpec, seed: int, root: FloatArray | None = None) -> FloatArray:
    """A healthy lane, (n_numbers,), in which everything is correlated; root: of its covariance."""
    generator, lane = np.random.default_rng(seed), np.zeros(spec.n_numbers)
    lane[: spec.n_joint] = generator.uniform(0.5, 2.0, spec.n_joint)
    root = 0.1 * generator.normal(size=(spec.n_joint, spec.n_joint)) if root is None else root
    lane[spec.covariance_slice] = pack(root @ root.T)
    lane[-1] = -12.5
    return lane


def parts(spec: EngineSpec) -> tuple[IntArray, IntArray]:
    """Places of what is learned, and of all else."""
    learned = np.arange(spec.slow_slice.start, spec.parameter_slice.stop)
    return learned, np.setdiff1d(np.arange(spec.n_joint), learned)


def old_lane(spec: EngineSpec, usual: FloatArray) -> FloatArray:
    """What is kept for long: a lane, the usual squares of walks, and the time."""
    return np.concatenate([drawn(spec, 8), usual, [0.0, 0.0]])


def restated(spec: EngineSpec, lane: FloatArray, old: FloatArray, usual: FloatArray) -> tuple[FloatArray, FloatArray]:
    """A lane's joint law given what is learned, mixed over what that was before; dense: z and its covariance."""
    learned, others = parts(spec)
    full, theta, n_slow = unpack(spec, lane[spec.covariance_slice]), spec.parameter_slice, len(spec.slow_errors)
    mean, prior = np.zeros(len(learned)), np.zeros((len(learned), len(learned)))
    mean[n_slow:] = old[theta]
    prior[:n_slow, :n_slow] = np.diag([item.sd**2 for item in spec.slow_errors])
    wider = np.sqrt(np.maximum(usual, 1.0))
    before = unpack(spec, old[: spec.n_numbers][spec.covariance_slice])[theta, theta]
    prior[n_slow:, n_slow:] = before * np.outer(wider, wider)
    by = full[np.ix_(others, learned)] @ np.linalg.pinv(full[np.ix_(learned, learned)])
    left = full[np.ix_(others, others)] - by @ full[np.ix_(learned, others)]
    expected, z = np.zeros_like(full), lane[: spec.n_joint].copy()
    away = by @ (mean - lane[learned])  # what is off may be none of what is learned
    expected[np.ix_(others, others)] = left + by @ prior @ by.T + np.outer(away, away)
    expected[np.ix_(others, learned)] = by @ prior
    expected[np.ix_(learned, others)] = prior @ by.T
    expected[np.ix_(learned, learned)] = prior
    z[others] += away
    z[learned] = mean
    return z, expected


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("known", [False, True])
def test_states_go_with_what_parameters_were(seed: int, known: bool) -> None:
    """As a dense oracle has it, also where a parameter is known exactly; and the same where lanes begin again."""
    spec = core().spec
    root = 0.1 * np.random.default_rng(seed).normal(size=(spec.n_joint, spec.n_joint))
    root[spec.parameter_slice.start + 1] *= not known
    usual = np.linspace(0.5, 4.0, len(spec.parameters))
    lane, old = drawn(spec, seed, root), old_lane(spec, usual)
    assert len(spec.slow_errors) == 2
    assert len(parts(spec)[1]) > len(spec.states)
    z, expected = restated(spec, lane, old, usual)
    core().call("t_restate", old, lane)
    np.testing.assert_allclose(unpack(spec, lane[spec.covariance_slice]), expected, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(lane[: spec.n_joint], z, rtol=1e-8)
    assert lane[-1] == -12.5
    again = lane.copy()
    core().call("t_restate", old, again)
    np.testing.assert_allclose(again, lane, rtol=1e-7, atol=1e-9)


def test_a_parameter_that_another_one_tells_moves_nothing_more() -> None:
    """What is left of it once the other is given is rounding error, and is not divided by."""
    spec = core().spec
    root = 0.1 * np.random.default_rng(5).normal(size=(spec.n_joint, spec.n_joint))
    root[spec.parameter_slice.start + 1] = root[spec.parameter_slice.start]
    lane = drawn(spec, 1, root)
    core().call("t_restate", old_lane(spec, np.ones(len(spec.parameters))), lane)
    assert np.max(np.abs(lane[: spec.n_joint])) < 100.0
    assert np.linalg.eigvalsh(unpack(spec, lane[spec.covariance_slice])).min() > -1e-12


def test_suspects_that_were_off_all_along_move_the_states() -> None:
    """States have the law that they have given the suspect, mixed over its start; at a change they stay."""
    spec = core().spec
    k = spec.parameter_slice.start + 1
    learned, others = parts(spec)
    for all_along in (True, False):
        lane = drawn(spec, 3)
        full, z = unpack(spec, lane[spec.covariance_slice]), lane[: spec.n_joint].copy()
        core().call("t_replace", np.array([k, 2.5, 0.04, all_along], dtype=np.float64), lane)
        by = full[others, k] / full[k, k] * all_along
        expected = full.copy()
        expected[:, k] = expected[k, :] = 0.0
        expected[np.ix_(others, others)] += np.outer(by, by) * (0.04 - full[k, k])
        expected[others, k] = expected[k, others] = by * 0.04
        expected[k, k] = 0.04
        z[others] += by * (2.5 - z[k])
        z[k] = 2.5
        np.testing.assert_allclose(unpack(spec, lane[spec.covariance_slice]), expected, atol=1e-12)
        np.testing.assert_allclose(lane[: spec.n_joint], z, rtol=1e-12)
        assert len(learned) == 6


def plan(k: int, asked: Bare | None = None) -> dict[str, int]:
    """What a lane of the plan is of."""
    names = ("parameter", "output", "kind", "scales", "n", "acts", "sticks", "settling", "input")
    found = np.zeros(len(names))
    (asked or core()).call("t_plan", np.array([float(k)]), found)
    return dict(zip(names, found.astype(int).tolist(), strict=True))


@pytest.mark.parametrize("text", [NOISY, ADDED])
def test_slots_go_along_with_what_they_are_like(text: str) -> None:
    """The slot of a parameter moves states as that does, of a sensor as its slow error, of an input as its factor.

    Or as the parameter that acts as it does, by how much of that one of it is.
    """
    asked = core() if text == NOISY else bare(CALLS, text)
    spec = asked.spec
    assert (spec.inputs[1].factor >= 0, spec.inputs[1].term_part) == ((True, 0.0) if text == NOISY else (False, 0.125))
    names, slow = ([item.name for item in items] for items in (spec.outputs, spec.slow_errors))
    kinds = list(FaultKind)
    readings, seen, follows = (
        np.array([3.0, 2.0, 1.7, 4.0]),
        set(),
        [item.name for item in spec.states].index("W.lagged"),
    )
    at_slot, n_x, n_wide = spec.parameter_slice.stop, len(spec.states), spec.slotted.n_joint
    for k in range(plan(0, asked)["n"]):
        own, plain = plan(k, asked), drawn(spec, 4)
        before, after = np.zeros(spec.slotted.n_numbers), np.zeros(spec.slotted.n_numbers)
        asked.call("t_slot", np.array([float(k)]), plain, readings, before, after)
        size, variance = before[at_slot], unpack(spec.slotted, before[spec.slotted.covariance_slice])[at_slot, at_slot]
        place, each, kind = None, 1.0, kinds[own["kind"]]
        if own["parameter"] >= 0:
            place = spec.parameter_slice.start + own["parameter"]
        elif own["output"] == names.index("v") and kind is not FaultKind.NOISE:
            place, scales = n_x + slow.index("v"), bool(own["scales"])
            each = readings[own["output"]] if scales else spec.outputs[own["output"]].noise
        elif own["input"] == 1:
            place = spec.parameter_slice.start + [item.name for item in spec.parameters].index("g")
            each = (readings[3] if own["scales"] else 1.0) * (before[place] / readings[3] if text == NOISY else 0.125)
        if own["sticks"] or own["settling"] or not own["acts"] or kind is FaultKind.NOISE:
            place = None
        if place is None:
            assert np.array_equal(before, after)
            continue
        seen.add(kind)
        full = unpack(spec.slotted, before[spec.slotted.covariance_slice])
        by = each * full[:, place] / full[place, place]
        by[n_x : at_slot + 2] = 0.0
        if own["input"] == 1:
            by[follows] += readings[3] if own["scales"] else 1.0
        expected, z = full + variance * np.outer(by, by), before[:n_wide] + by * size
        expected[at_slot] += by * variance
        expected[:, at_slot] += by * variance
        np.testing.assert_allclose(unpack(spec.slotted, after[spec.slotted.covariance_slice]), expected, atol=1e-10)
        np.testing.assert_allclose(after[:n_wide], z, rtol=1e-10)
        assert np.array_equal(after[spec.slotted.covariance_slice.stop :], before[spec.slotted.covariance_slice.stop :])
    assert {FaultKind.BIAS, FaultKind.GAIN, FaultKind.DRIFT} <= seen


def test_lanes_go_along_wherever_they_begin() -> None:
    """At the first sample those of parameters and inputs: a start without its sensor knows nothing of its fault."""
    spec, n = core().spec, plan(0)["n"]
    later, at_first, steps = np.zeros(n), np.zeros(n), np.zeros(1)
    core().call("t_begun", drawn(spec, 4), np.array([3.0, 2.0, 1.7, 4.0]), later, at_first, steps)
    assert steps[0] == 1.0
    v, seen = [item.name for item in spec.outputs].index("v"), set()
    for k in range(n):
        own = plan(k)
        if own["sticks"] or own["settling"] or not own["acts"] or list(FaultKind)[own["kind"]] is not FaultKind.BIAS:
            continue
        acts = own["output"] == v or own["input"] == 1
        assert (later[k] != 0.0) == acts
        assert (at_first[k] != 0.0) == (own["input"] == 1)
        seen.add((own["output"], own["input"]))
    assert {(v, -1), (-1, 1)} <= seen


def test_couples_go_along() -> None:
    """Beside a component that was off all along, and with which the states go, they go with a sensor too."""
    pairs = bare(CALLS, NOISY.replace("max_faults: 1", "max_faults: 2"))
    n, found = np.zeros(9), np.zeros(2)
    pairs.call("t_plan", np.zeros(1), n)
    v, tried = [item.name for item in pairs.spec.outputs].index("v"), 0
    for k in range(int(n[4])):
        own = np.zeros(9)
        pairs.call("t_plan", np.array([float(k)]), own)
        if own[1] != v or list(FaultKind)[int(own[2])] is not FaultKind.BIAS or own[6]:
            continue
        lane, values = drawn(pairs.spec, 4), np.array([3.0, 2.0, 1.7, 4.0])
        tried += pairs.call("t_coupled", np.array([float(k)]), lane, values, found)
        assert found[0] != 0.0
        assert found[1] != 0.0
    assert tried > 0


def test_steps_from_the_first_sample_on_go_with_its_start() -> None:
    """The start goes with a suspect as its covariance says; a store whose content jumps has no lane there."""
    model = parse_model(NOISY)
    monitor, time = Monitor(build_engine(model)[1]), np.linspace(0.0, 19.5, 40)
    values = np.stack([np.where(time < 8.0, 5.0, 9.0), np.full(40, 0.3)], axis=1)
    made = simulate(model, Inputs(time=time, values=values), seed=2)
    for sample in samples_of(time, made.inputs, made.outputs):
        monitor.step(sample)
    bare_core = core()
    spec, plan_of_steps = bare_core.spec, plan_lanes(bare_core.spec)
    bare_core.restore(monitor.save())
    start, found, n = np.zeros(spec.n_numbers), np.zeros((8, spec.n_numbers)), plan_of_steps.n_lanes
    lanes, (_, others), moved, jumping = [], parts(spec), 0.0, 0
    for first in range(0, n, 8):
        bare_core.call("t_first", np.array([float(first)]), start, found)
        lanes += list(found.copy())
    full = unpack(spec, start[spec.covariance_slice])
    for number, lane in enumerate(lanes[:n]):
        (chosen,) = np.flatnonzero(plan_of_steps.suspected[:, number])
        k = spec.parameter_slice.start + chosen
        if plan_of_steps.jumps[number].any():
            assert lane[-1] == -1e300
            jumping += 1
            continue
        away = full[others, k] / full[k, k] * (plan_of_steps.values[chosen, number] - 1.0) * start[k]
        np.testing.assert_allclose(lane[others] - start[others], away, rtol=1e-9, atol=1e-12)
        moved = max(moved, float(np.max(np.abs(away))))
        assert lane[-1] == start[-1] == 0.0
    assert moved > 1e-3
    assert jumping > 0
