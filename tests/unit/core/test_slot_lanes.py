"""Lanes with a slot in the core: how they begin, mix, go on and begin again, next to sums that are slow and plain."""

import ctypes
import shutil
from dataclasses import replace

import numpy as np
import pytest

from bare_core import IN_CPP, OFFERED, aligned, at, compiled, in_c
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.slots import SlotLane, plan_slots
from faultbond.contract.spec import covariance_place, pack, unpack
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import parse_model
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec
from faultbond.types import FaultKind
from lamp_core import lamp

pytestmark = pytest.mark.skipif(find_compiler() is None or shutil.which("g++") is None, reason="no compiler")
CELL = """\
name: cell
sample_time: 0.5 s
max_faults: 1
constants: {C1: 0.1 F}
inputs: {V: {unit: V, settling: 7 s}, W: {unit: A, noise: 5 mA}}
components:
  source: {type: Se, law: e = V}
  more: {type: Sf, law: f = W}
  series: {type: R, parameters: {R1: 10 ohm}}
  cell: {type: C, law: e = q/C1}
  leak: {type: Sf, law: f = L, parameters: {L: {nominal: 0 A, accuracy: 1 mA, change: 50 mA}}}
junctions: {first: 1, node: 0}
bonds: [source -> first, first -> series, first -> node, node -> cell, node -> leak, more -> node]
sensors: {i: {reads: first.f, unit: A, noise: 5 mA}, v: {reads: node.e, unit: V, noise: 10 mV}}
slow_error: {first.f: 1 % over 20 s}
"""
GRAPH = parse_model(CELL)
PLANT = build_plant(GRAPH)
STATED = build_spec(build_step_model(PLANT))
ZEROS, INPUT_ZEROS = (0.03, -0.2), (0.4, -0.1)  # where the unit of each sensor and input has its 0, SI
SPEC = replace(
    STATED,
    outputs=tuple(replace(item, unit_offset=zero) for item, zero in zip(STATED.outputs, ZEROS, strict=True)),
    inputs=tuple(replace(item, unit_offset=zero) for item, zero in zip(STATED.inputs, INPUT_ZEROS, strict=True)),
)
WIDE, PLAN = SPEC.slotted, plan_slots(SPEC)
RAMPED, SWITCHED = PLAN.ramped, PLAN.switched
N, SIZE, RATE = PLAN.n_lanes, WIDE.slot_slice.start, WIDE.slot_slice.start + 1
ENDED, TOOK, RETURNS = (WIDE.role_fields[name].start for name in ("ended", "took", "returns"))
SHARED = [k for k in range(WIDE.n_joint) if k not in (SIZE, RATE)]  # of a wide z, what a plain one holds too
OF_FOUND = (FaultKind.DRIFT, FaultKind.BIAS, FaultKind.GAIN)  # of no sensor: they begin again from what they have found
PEAK = np.array([6.0, 0.0])  # of each input; one that was always zero counts as 1
LATER = ctypes.c_int64(int(core_settings()["AS_MANY"]))  # samples after the alarm: half of a likelihood counts
GROUP = int(core_settings()["GROUP"])  # lanes that stand side by side
CALLS = """
static State state;
static Work work;
static Trail trail;
double *t_numbers(int64_t k)
{
    double *const of[] = {state.bank.slots[0][0], state.past.rows[0].sample, state.normal.rates, state.normal.wander};
    return of[k];
}
int64_t *t_onsets(void) { return state.bank.onset + N_STEPS; }
void t_set(int64_t n, const double *old, int64_t first)
{
    prepare_filters(&work.filters);
    memset(&work.bank, 0xff, sizeof work.bank);
    trail.past = &state.past;
    trail.oldest = N_ROWS - 3;
    trail.n = n;
    trail.alarm = n - 3;
    trail.first = first;
    state.clock.begun = first > 0 ? trail.oldest + first - WARM_UP_SAMPLES : 0;
    trail.old = NULL;
    state.alarm.old = -1;
    if (old) memcpy(state.healthy.snapshots[0], old, sizeof state.healthy.snapshots[0]);
    if (old) trail.old = state.healthy.snapshots[0];
    state.clock.alarm = trail.oldest + trail.alarm;
    state.clock.index = trail.oldest + n - 1;
}
static void work_it(const double *peak)
{
    memcpy(state.job.peak, peak, sizeof state.job.peak);
    work_for(&state, INT64_MAX, &work.bank, &work.filters);
}
void t_begin(int64_t change, const double *peak)
{
    clear_bank(&state);
    begin_bank(&state, &trail, change);
    work_it(peak);
}
void t_renew(const double *peak)
{
    state.job.renewals = 0;
    begin_again(&state, &trail, &work.bank);
    work_it(peak);
}
/* Lanes begun at one onset, and run over all samples. */
void t_begin_at(int64_t onset, const double *peak, double *to)
{
    for (int64_t first = 0; first < RAMPED; first += GROUP) {
        int64_t lane[GROUP];
        for (int64_t l = 0; l < GROUP; l++) lane[l] = first + l < RAMPED ? first + l : first;
        begin_slots(lane, NULL, &trail, onset, peak, state.job.run, &state.job.walk, &work.bank.slots);
        run_slots(state.job.run, &trail, onset, trail.n, onset, &state.job.walk, -1, &state.normal,
                  work.bank.slots.sample, &work.filters.wide);
        for (int64_t l = 0; l < GROUP && first + l < RAMPED; l++)
            for (int64_t i = 0; i < WIDE_NUMBERS; i++) to[i * RAMPED + first + l] = state.job.run[i][l];
    }
}
void t_choose(int64_t *drift, int64_t *begins) { choose_ramps(&state.bank, drift, begins); }
void t_hand_on(int64_t number, double time, double old)
{
    hand_on(&state.bank, SWITCHED, 1, number, time, old, &work.bank.slots);
}
void t_advance(int64_t since, const double *packed, double *innovations, int64_t stride)
{
    advance_slots(&state.bank, N_SLOT_LANES, since, packed, &state.normal, innovations, stride, &work.filters.wide,
                  &work.bank.slots);
}
void t_narrowed(const double *wide, double weight, int64_t parameter, double *plain)
{
    narrow(wide, weight, (int)parameter, plain);
}
"""


class Core:
    """The core at one width of lanes, with arrays that look into its memory.

    slots : (n_blocks, n_numbers, GROUP); normal: rates and wander of parameters; rows: of the past
    """

    def __init__(self, width: int) -> None:
        text = core_text(SPEC, build_step_model(PLANT, all_inputs=True)) + in_c(CALLS)
        language = IN_CPP if width == 1 else ()
        self.library = compiled(text, f"-DFB_LANES={width}", *language, offered=(*OFFERED, "fb_advance_wide"))
        self.library.t_numbers.restype = self.library.t_onsets.restype = ctypes.c_void_p
        self.library.fb_work_size.restype = ctypes.c_int64
        n_rows = SPEC.thresholds.history_samples + 2 + int(core_settings()["SPREAD"])
        width = SPEC.n_sample + SPEC.n_numbers + 2
        shapes = ((-(-N // GROUP), WIDE.n_numbers, GROUP), (n_rows, width), (2,), (2,))
        self.slots, self.rows, self.rates, self.wander = (self._view(k, *shape) for k, shape in enumerate(shapes))
        self.onsets = np.ctypeslib.as_array(ctypes.cast(self.library.t_onsets(), ctypes.POINTER(ctypes.c_int64)), (N,))
        self.rates[:], self.wander[:] = 0.0, 0.0

    def _view(self, k: int, *shape: int) -> FloatArray:
        return np.ctypeslib.as_array(ctypes.cast(self.library.t_numbers(k), ctypes.POINTER(ctypes.c_double)), shape)

    def put(
        self, of: tuple[FloatArray, FloatArray], old: FloatArray | None, lanes: FloatArray | None = None, first: int = 0
    ) -> None:
        """Set the trail, the lane of long ago, and all lanes; numbers of samples go round the end of the rows.

        first : place up to which the plant warms up
        """
        places = (len(self.rows) - 3 + np.arange(len(of[0]))) % len(self.rows)
        self.rows[places, : SPEC.n_sample], self.rows[places, SPEC.n_sample : -2] = of
        self.rows[places, -2] = 100.0 + np.arange(len(of[0]))  # s
        self.library.t_set(ctypes.c_int64(len(of[0])), at(old), ctypes.c_int64(first))
        if lanes is not None:
            first = (N - 1) // GROUP * GROUP  # of the last block, which is filled up with it
            filled = lanes[:, [*range(N), *[first] * (-N % GROUP)]]
            self.slots[:] = filled.reshape(len(lanes), -1, GROUP).transpose(1, 0, 2)

    def lanes(self) -> FloatArray:
        """All lanes, (n_numbers, n_lanes); those that fill up the last block repeat its first."""
        every = self.slots.transpose(1, 0, 2).reshape(WIDE.n_numbers, -1)
        assert all(np.array_equal(extra, self.slots[-1, :, 0], equal_nan=True) for extra in every[:, N:].T)
        return every[:, :N].copy()

    def advanced(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Wide lanes (n_numbers, n) after samples, and the last innovations, by the filter alone."""
        n, now = lanes.shape[1], np.resize(lanes.T, (-(-lanes.shape[1] // 8) * 8, len(lanes))).T.copy()
        found, first = np.zeros((2 * len(SPEC.outputs), now.shape[1])), WIDE.parameter_slice.start
        room = aligned(self.library.fb_work_size())
        for sample in samples.copy():
            sample[SPEC.sample_fields["again"]], sample[SPEC.sample_fields["bound"]] = 1.0, SPEC.thresholds.bank_bound
            for k in range(2):
                now[first + k] += self.rates[k] * sample[0]
                now[covariance_place(WIDE, first + k, first + k)] += (self.wander[k] * sample[0]) ** 2
            counts = (ctypes.c_int64(now.shape[1]), ctypes.c_int64(1))
            self.library.fb_advance_wide(*counts, *map(at, (sample, now, found, room)))
        return now[:, :n], found[:, :n]


@pytest.fixture(params=[1, 8])
def core(request: pytest.FixtureRequest) -> Core:
    """The core at one width in C++, at the other in C, in which nothing drifts by itself."""
    return Core(request.param)


def plain_lane(seed: int) -> FloatArray:
    """A healthy lane, shape (n_numbers,), with a covariance that is full."""
    generator, n = np.random.default_rng(seed), SPEC.n_joint
    root = generator.normal(size=(n, n)) * 0.02
    z = [0.3, 0.005, generator.uniform(0.9, 1.1), generator.normal(0.0, 1e-3), 0.001]
    return np.array([*z, *pack(root @ root.T + 1e-4 * np.eye(n)), generator.normal(-5.0, 3.0)])


def trail(n: int) -> tuple[FloatArray, FloatArray]:
    """Samples and healthy lanes of `n` moments; some values are missing, at the first moment all of one sensor."""
    generator, place = np.random.default_rng(n), SPEC.sample_fields
    samples = np.zeros((n, SPEC.n_sample))
    samples[:, place["dt"]], samples[:, place["scale"]] = 0.5, 1.0
    samples[:, place["fresh"]] = SPEC.input_variance
    samples[:, place["u"]] = generator.uniform([2.9, -0.01], [3.1, 0.01], (n, 2))
    samples[1:, place["u_before"]] = samples[:-1, place["u"]]
    samples[:, place["y"]] = generator.normal([0.0, 3.0], [0.01, 0.05], (n, 2))
    samples[:, place["use"]] = generator.random((n, 2)) > 0.2
    samples[:4, place["use"]] = [1.0, 0.0]
    return samples, np.array([plain_lane(k) for k in range(n)])


def begun(k: int, place: int, n_seen: int, of: tuple[FloatArray, FloatArray], old: FloatArray | None) -> FloatArray:
    """Lane k of the plan (n_numbers,), begun from the healthy lane at a place, by matrices."""
    (samples, lanes), item, own = of, PLAN.lanes[k], SPEC.parameter_slice
    z, full = lanes[place, : SPEC.n_joint].copy(), unpack(SPEC, lanes[place, SPEC.covariance_slice])
    unit = 1.0
    if item.parameter == 0:
        unit = z[own][item.parameter]
    elif item.input >= 0 and not item.scales:
        unit = [6.0, 1.0][item.input]
    if item.old and old is not None:
        full[own, own] += np.outer(z[own] - old[own], z[own] - old[own])
        z[own] = old[own]
    lane, wide = np.zeros(WIDE.n_numbers), np.zeros((WIDE.n_joint, WIDE.n_joint))
    lane[SHARED], wide[np.ix_(SHARED, SHARED)], lane[-1] = z, full, lanes[place, -1]
    lane[SIZE], lane[RATE] = item.size * unit, item.rate * unit / 0.5
    wide[SIZE, SIZE], wide[RATE, RATE] = (item.size_sd * unit) ** 2, (item.rate_sd * unit / 0.5) ** 2
    role = {name: lane[where] for name, where in WIDE.role_fields.items()}
    role["reads"][:] = role["noise"][:] = role["obeys"][:] = role["moves"][:] = 1.0
    if item.parameter >= 0:
        role["theta"][item.parameter] = item.acts
    if item.input >= 0:
        role["input"][item.input], role["obeys"][item.input] = item.acts, not item.sticks
        if item.scales:
            role["input"][item.input], role["input_gain"][item.input] = -SPEC.inputs[item.input].unit_offset, 1.0
        lane[SIZE] = samples[n_seen - 1, SPEC.sample_fields["u"]][item.input] if item.sticks else lane[SIZE]
    if item.output >= 0:
        j, noise = item.output, SPEC.outputs[item.output].noise
        role["noise"][j], role["gain"][j] = item.noise, item.scales
        role["reads"][j] = not (item.sticks and item.acts)
        role["bias"][j] = noise * (item.acts and not item.scales and item.kind is not FaultKind.NOISE)
        role["bias"][j] -= SPEC.outputs[j].unit_offset * role["gain"][j]
        seen = [row[SPEC.sample_fields["y"]][j] for row in samples[:n_seen] if row[SPEC.sample_fields["use"]][j]]
        lane[SIZE] = ([0.0, *seen][-1] / noise) if item.sticks else lane[SIZE]
    lane[WIDE.covariance_slice] = pack(wide)
    return lane


def is_of_same(one: SlotLane, two: SlotLane) -> bool:
    """Whether both look for a fault of the same suspect, of an instrument both for one of its gain, or none."""
    return (one.hypothesis, one.scales) == (two.hypothesis, two.scales)


def likeliest_beside(drift: int, likelihoods: FloatArray) -> int:
    """The likeliest lane that looks for the same as a pair and does not stick; log-likelihoods (n_lanes,)."""
    own = [k for k, item in enumerate(PLAN.lanes[:SWITCHED]) if is_of_same(item, PLAN.lanes[drift]) and not item.sticks]
    return max(own, key=lambda k: float(likelihoods[k]))


def mixture(likelihoods: FloatArray) -> FloatArray:
    """The mean over all samples of likelihoods (n_onsets, n) of lanes."""
    return np.asarray(np.logaddexp.reduce(likelihoods, axis=0) - np.log(SPEC.thresholds.history_samples))


def merged(one: FloatArray, two: FloatArray, first: float, second: float) -> FloatArray:
    """A lane (n_numbers,) with mean and covariance of one and another, of such log-weights; the roles of the first."""
    n, lane, total = WIDE.n_joint, one.copy(), np.logaddexp(first, second)
    p, q = np.exp(first - total), np.exp(second - total)
    q = 0.0 if p == 1.0 else q
    full = [unpack(WIDE, part[WIDE.covariance_slice]) for part in (one, two)]
    lane[:n] = p * one[:n] + q * two[:n]
    middle = p * full[0] + q * full[1] + p * q * np.outer(one[:n] - two[:n], one[:n] - two[:n])
    lane[WIDE.covariance_slice], lane[-1] = pack(middle), total
    return lane


def switching(place: int, n: int = 34) -> float:
    """How probable it is that a fault comes or goes at a place of a trail of n samples, whose last but two alarms."""
    return float((1.0 / 300.0) ** (1.0 + max(place - (n - 3), 0) / core_settings()["AS_MANY"]))


def interacted(lanes: FloatArray, switching: float = 1.0 / 300.0) -> FloatArray:
    """Pairs (n_numbers, 2 n), in which once in 300 samples the fault comes or goes; what goes has been there."""
    stay, come, found = np.log1p(-switching), np.log(switching), []
    for k in range(lanes.shape[1]):
        own, other = lanes[:, k].copy(), lanes[:, k ^ 1]
        found.append(merged(own, other, own[-1] + stay, other[-1] + come))
        kept = np.exp(own[-1] + stay - found[-1][-1])
        found[-1][RETURNS] = kept * own[RETURNS] + (1.0 - kept) * (1.0 if k % 2 else other[RETURNS])
    return np.array(found).T


OLD = 30.0  # s; when what has been under way for long was not there yet


def ended(
    moves: FloatArray, stays: FloatArray, age: int, time: float, extra: float = 0.0, old: float | None = None
) -> FloatArray:
    """A drift of so many samples and what it comes to, both (n_numbers,), after it may have come to its end.

    What was there by half at once took no time, nor what would have begun long before `old`, a time, where it began.
    """
    rate, variance = moves[RATE], moves[covariance_place(WIDE, RATE, RATE)]
    ends = (
        max(rate**2 / (rate**2 + 4.0 * variance) * 0.5 / (age + 10.0), 1e-300) if moves[SIZE] * rate > 0.0 else 1e-300
    )
    come = moves[-1] + np.log(ends) + extra
    stay, goes = merged(stays, moves, stays[-1], come), moves.copy()
    kept, took = np.exp(stays[-1] - stay[-1]), moves[SIZE] / rate if moves[SIZE] * rate > 0.0 else 0.0
    longest = 2.0 * 0.5 * age if old is None else time - old
    took = took if took < longest else 0.0
    stay[ENDED], stay[TOOK] = kept * stays[ENDED] + (1.0 - kept) * time, kept * stays[TOOK] + (1.0 - kept) * took
    full = unpack(WIDE, stay[WIDE.covariance_slice])
    stay[RATE], full[RATE], full[:, RATE] = 0.0, 0.0, 0.0
    stay[WIDE.covariance_slice] = pack(full)
    goes[-1] += np.log1p(-ends)
    return np.array([goes, stay])


def ramps(core: "Core", onset: int, of: tuple[FloatArray, FloatArray], old: FloatArray | None) -> FloatArray:
    """All pairs of the plan that begin to move at an onset, after all samples."""
    now = np.array([begun(k, onset - 1, onset, of, old) for k in range(RAMPED, SWITCHED)]).T
    now[-1, 1::2] = -1e300
    for place in range(onset, len(of[0])):
        both = [ended(now[:, k], now[:, k + 1], place - onset, 100.0 + place) for k in range(0, now.shape[1], 2)]
        now, _ = core.advanced(np.concatenate(both).T, of[0][place, None])
    return now


def close(found: FloatArray, wanted: FloatArray) -> bool:
    """Whether lanes agree but for rounding: to 1e-9 of each number, or of the sds that a covariance is of."""
    sizes = 1e-3 * np.abs(wanted).max(axis=1, keepdims=True) * np.ones_like(wanted)
    for k, lane in enumerate(wanted.T):
        full = unpack(WIDE, lane[WIDE.covariance_slice])
        sd = np.sqrt(np.diag(full))
        sizes[WIDE.covariance_slice, k] = np.maximum(sizes[WIDE.covariance_slice, k], pack(np.outer(sd, sd)))
    return bool(np.all(np.abs(found - wanted) <= 1e-9 * (np.abs(wanted) + sizes)))


def test_the_plan_has_what_the_tests_are_about() -> None:
    """Pairs straddle blocks, being behind an odd number of lanes, and an input settles in sight of a sensor."""
    assert (SWITCHED % 2, (N - SWITCHED) // 2 % 8) == (1, 1)
    assert [item.direct_inputs for item in SPEC.outputs] == [(0,), ()]
    old = {(item.kind, item.parameter >= 0) for item in PLAN.lanes if item.old}
    assert old == {(FaultKind.DRIFT, True)}  # of drifts under way what the plant has learned is in doubt
    assert any(item.kind is FaultKind.DRIFT and item.parameter >= 0 and not item.old for item in PLAN.lanes)
    assert {(item.kind, item.input) for item in PLAN.lanes if item.settling} == {
        (FaultKind.STEP, -1), (FaultKind.BIAS, 0), (FaultKind.GAIN, 0), (FaultKind.STUCK, 0)
    }  # fmt: skip


def dense(core: Core, onset: int, of: tuple[FloatArray, FloatArray], old: FloatArray | None) -> FloatArray:
    """All lanes of the plan that begin alone at an onset, after all samples."""
    place, n = covariance_place(WIDE, SIZE, SIZE), len(of[0])
    lanes = np.array([begun(k, onset - 1, onset, of, old) for k in range(RAMPED)]).T
    end, _ = core.advanced(lanes, of[0][onset:])
    own = [k for k in range(RAMPED) if PLAN.lanes[k].settling]  # comes up in 12 steps over 7 s, 14 samples
    steps, now = np.array_split(of[0][onset:][:14], min(12, n - onset)), lanes[:, own]
    more, now[place] = now[place] / len(steps), 0.0
    for rows in steps:
        now[place] += more
        now, _ = core.advanced(now, rows)
    end[:, own], _ = core.advanced(now, of[0][onset + 14 :])
    return end


@pytest.mark.parametrize("old", [None, plain_lane(99)], ids=["young", "old"])
@pytest.mark.parametrize("drift", [0.0, 0.01])
def test_lanes_begin_at_their_best_onset_and_pairs_at_the_oldest_sample(
    core: Core, old: FloatArray | None, drift: float
) -> None:
    """Each is that of its best onset, as likely as all are on the mean; pairs mix before each sample."""
    of = trail(34)
    core.put(of, old)
    core.rates[0], core.wander[0] = drift, 0.5 * drift
    for onset in (3, 23, 31):
        found = np.zeros((WIDE.n_numbers, RAMPED))
        core.library.t_begin_at(ctypes.c_int64(onset), at(PEAK), at(found))
        assert close(found, dense(core, onset, of, old))
    core.library.t_begin(ctypes.c_int64(20), at(PEAK))
    found, every = core.lanes(), np.array([dense(core, onset, of, old) for onset in range(1, 34)])
    began = core.onsets[:RAMPED] - (len(core.rows) - 3)
    best = every[began - 1, :, np.arange(RAMPED)].T
    assert close(found[:-1, :RAMPED], best[:-1])
    leads = every[:, -1].max(axis=0) > every[:, -1].max() - 20.0  # of others on this made-up trail it moves too wildly
    assert len({PLAN.lanes[k].kind for k in np.flatnonzero(leads)}) == 6
    assert found[-1, :RAMPED][leads] == pytest.approx(mixture(every[:, -1, leads]), abs=1e-3)
    every = np.array([ramps(core, onset, of, old) for onset in range(1, 34)])
    began = core.onsets[RAMPED:SWITCHED] - (len(core.rows) - 3)
    best = every[began - 1, :, np.arange(SWITCHED - RAMPED)].T
    both, share = np.logaddexp(every[:, -1, ::2], every[:, -1, 1::2]), best[-1, ::2] - best[-1, 1::2]
    assert np.array_equal(began[::2], began[1::2])
    assert close(found[:-1, RAMPED:SWITCHED], best[:-1])
    assert found[-1, RAMPED:SWITCHED:2] - found[-1, RAMPED + 1 : SWITCHED : 2] == pytest.approx(share, abs=1e-6)
    total = np.logaddexp(found[-1, RAMPED:SWITCHED:2], found[-1, RAMPED + 1 : SWITCHED : 2])
    at_best = mixture(np.logaddexp(best[-1, ::2], best[-1, 1::2])[None])
    assert np.all((total > at_best - 1e-6) & (total < mixture(both) + 1.0))
    now = np.array([begun(k, 0, 1, of, None) for k in range(SWITCHED, N)]).T
    now[-1, ::2] = -np.inf
    for place, sample in enumerate(of[0][1:], 1):
        now, _ = core.advanced(interacted(now, switching(place)), sample[None, :])
    assert close(core.lanes()[:, SWITCHED:], now)


def test_what_comes_while_the_plant_warms_up_has_to_gain_more(core: Core) -> None:
    """No lane begins then, and what comes or goes as one of a pair is 20 nats less likely."""
    of, first = trail(34), 8
    core.put(of, None, first=first)
    core.library.t_begin(ctypes.c_int64(20), at(PEAK))
    began = core.onsets[:SWITCHED] - (len(core.rows) - 3)
    assert began.min() >= first
    now = np.array([begun(k, 0, 1, of, None) for k in range(SWITCHED, N)]).T
    now[-1, ::2] = -np.inf
    for place in range(1, 34):
        now, _ = core.advanced(
            interacted(now, np.exp(-20.0) if place < first else switching(place)), of[0][place, None]
        )
    assert close(core.lanes()[:, SWITCHED:], now)


def test_lanes_go_on_and_pairs_are_judged_as_one(core: Core) -> None:
    """A sample goes into every lane; both lanes of a pair have the innovations of their mixture.

    Where half of a likelihood counts, what comes or goes is twice as many nats less likely, so that all of that counts.
    """
    of, n_y, found = trail(24), len(SPEC.outputs), np.full((4, N + 3), 7.0)
    lanes = np.array([begun(k, k % 20, 3, of, None) for k in range(N)]).T
    core.rates[0], core.wander[0] = 0.01, 0.002
    core.put(of, None, lanes)
    core.library.t_advance(LATER, at(of[0][-1]), at(found), ctypes.c_int64(N + 3))
    ready = np.concatenate([lanes[:, :SWITCHED], interacted(lanes[:, SWITCHED:], (1.0 / 300.0) ** 2)], axis=1)
    after, wanted = core.advanced(ready, of[0][-1:])
    for k in range(SWITCHED, N, 2):
        weights = np.exp(ready[-1, k : k + 2] - np.logaddexp(*ready[-1, k : k + 2]))
        error, variance = wanted[:n_y, k : k + 2], wanted[n_y:, k : k + 2]
        mean = error @ weights
        wanted[:, k : k + 2] = np.array([*mean, *((variance + error**2) @ weights - mean**2)])[:, None]
    assert close(core.lanes(), after)
    assert np.allclose(found[:, :N], wanted, rtol=1e-9, atol=1e-12)
    assert np.all(found[:, N:] == 7.0)


def test_a_lane_that_is_no_number_spoils_no_other(core: Core) -> None:
    """Where one lane of a pair has run away, the other goes on as it was, and takes its place at the next sample."""
    of, innovations = trail(24), np.zeros((4, N))
    lanes = np.array([begun(k, 5, 3, of, None) for k in range(N)]).T
    lanes[: WIDE.loop_slice.stop, SWITCHED], lanes[-1, SWITCHED], lanes[-1, 2] = np.inf, np.nan, np.nan
    core.put(of, None, lanes)
    core.library.t_advance(LATER, at(of[0][-1]), at(innovations), ctypes.c_int64(N))
    found, (alone, _) = core.lanes(), core.advanced(lanes[:, SWITCHED + 1, None], of[0][-1:])
    assert np.all(np.isfinite(np.delete(found, 2, axis=1)))
    assert found[:-1, SWITCHED + 1] == pytest.approx(alone[:-1, 0], rel=1e-12)


@pytest.mark.parametrize("likelier", [False, True])
def test_what_may_be_in_a_couple_begins_again(core: Core, likelier: bool) -> None:
    """Of drifts, and biases and gains of inputs, the least likely lane becomes one that begins with what was found.

    That is size and rate of the likeliest. Of all other kinds the likeliest begins as at first. Either is kept if it is
    likelier. Pairs of what moves and what has come to stay begin as they did first, where they are then likelier; as
    many as stand side by side.
    """
    of, old = trail(30), plain_lane(99)
    lanes = np.array([begun(k, 20, 3, of, None) for k in range(N)]).T
    lanes[SIZE], lanes[RATE], lanes[-1] = np.random.default_rng(4).normal(0.0, [[0.3], [0.01], [5.0]], (3, N))
    lanes[-1] += -1e4 if likelier else 1e4
    lanes[-1, 1] = np.nan  # one of the first drift
    core.put(of, old, lanes)
    core.onsets[:] = len(core.rows) - 3 + 20
    core.library.t_renew(at(PEAK))
    wanted, found = lanes.copy(), core.lanes()
    every = np.array([ramps(core, onset, of, old) for onset in range(1, 30)])
    anew = [k for k in range(RAMPED, SWITCHED, 2) if not np.array_equal(found[:, k + 1], lanes[:, k + 1])]
    every_pair = list(range(RAMPED, SWITCHED, 2))
    assert len(anew) == (GROUP if likelier else 0) < len(every_pair)
    for k in anew:
        pair, onsets = slice(k, k + 2), core.onsets[k : k + 2] - (len(core.rows) - 3)
        at_onset = every[onsets[0] - 1, :, k - RAMPED : k - RAMPED + 2]
        assert onsets[0] == onsets[1]
        assert close(found[:-1, pair], at_onset[:-1])
        assert found[-1, k] - found[-1, k + 1] == pytest.approx(at_onset[-1, 0] - at_onset[-1, 1], abs=1e-6)
        both = np.logaddexp(*every[:, -1, k - RAMPED : k - RAMPED + 2].T)
        assert np.logaddexp(*found[-1, pair]) <= mixture(both) + 1.0
        wanted[:, pair] = found[:, pair]
    groups: dict[tuple[int, FaultKind, bool], list[int]] = {}
    for k, item in enumerate(PLAN.lanes[:SWITCHED]):
        if item.kind not in (FaultKind.NOISE, FaultKind.RAMP):
            groups.setdefault((item.hypothesis, item.kind, item.scales), []).append(k)
    first = [dense(core, onset, of, old) for onset in range(1, 30)]
    for group in groups.values():
        likelihood = np.nan_to_num(lanes[-1, group], nan=-np.inf)
        best, worst = group[int(np.argmax(likelihood))], group[int(np.argmin(likelihood))]
        of_found = PLAN.lanes[best].output < 0 and PLAN.lanes[best].kind in OF_FOUND
        if not of_found:
            group[:] = [best]
            worst = best
        widest = max(group, key=lambda k: PLAN.lanes[k].size_sd)
        spread, ends = widest if PLAN.lanes[worst].kind is FaultKind.BIAS else worst, []
        for onset in range(1, 30):
            lane = begun(spread, onset - 1, onset, of, old)
            if of_found:
                lane[SIZE], lane[RATE] = lanes[SIZE, best] - lanes[RATE, best] * 0.5 * (30 - onset), lanes[RATE, best]
            as_first = not of_found and best < RAMPED
            ends.append(first[onset - 1][:, best] if as_first else core.advanced(lane[:, None], of[0][onset:])[0][:, 0])
        if worst not in anew and (likelier or worst == 1):
            wanted[:, worst] = ends[core.onsets[worst] - (len(core.rows) - 3) - 1]
            wanted[-1, worst] = core.lanes()[-1, worst]
            assert wanted[-1, worst] <= mixture(np.array(ends)[:, -1]) + 1.0
    assert close(np.delete(core.lanes(), 1, axis=1), np.delete(wanted, 1, axis=1))
    assert np.array_equal(np.isfinite(core.lanes()[-1]), np.isfinite(wanted[-1]))
    changed = {k for k in range(N) if not np.array_equal(core.lanes()[:, k], lanes[:, k])} - set(anew)
    worst_of = [min(group, key=lambda k: np.nan_to_num(lanes[-1, k], nan=-np.inf)) for group in groups.values()]
    assert [len(changed & set(group)) for group in groups.values()] == [
        int(worst not in anew and (likelier or worst == 1)) for worst in worst_of
    ]
    assert {worst in anew for worst in worst_of} == {False, likelier}


def test_pairs_beside_the_likeliest_lanes_begin_again(core: Core) -> None:
    """Of an instrument those of its bias and of its gain each by what was found of that; each from where that began."""
    lanes = np.array([begun(k, 5, 3, trail(24), None) for k in range(N)]).T
    lanes[-1] = np.random.default_rng(7).normal(-20.0, 3.0, N)
    core.put(trail(24), None, lanes)
    core.onsets[:] = 10 + np.arange(N)
    chosen, begins = np.zeros((2, GROUP), dtype=np.int64)
    core.library.t_choose(at(chosen), at(begins))
    instruments = [k for k in range(RAMPED, SWITCHED, 2) if PLAN.lanes[k].parameter < 0]
    order = sorted(instruments, key=lambda k: -lanes[-1, likeliest_beside(k, lanes[-1])])
    own = [place for place in range(GROUP) if chosen[place] in instruments]
    assert 0 < len(own) < len(instruments)
    assert [chosen[place] for place in own] == order[: len(own)]
    assert [begins[place] for place in own] == [10 + likeliest_beside(int(chosen[place]), lanes[-1]) for place in own]


def test_the_likeliest_drift_hands_on_what_it_knows(core: Core) -> None:
    """What has come to stay becomes the mixture of what it was and of the likeliest drift of its suspect, that ends."""
    of, generator = trail(24), np.random.default_rng(7)
    lanes = np.array([begun(k, k % 20, 3, of, None) for k in range(N)]).T
    lanes[SIZE], lanes[RATE] = generator.normal(0.0, [[0.3], [0.01]], (2, N))
    lanes[RATE, RAMPED + 1 : SWITCHED : 2] = 0.0
    lanes[-1] = generator.normal(-20.0, 6.0, N)
    lanes[-1, RAMPED] = np.nan  # a drift that is no number hands on nothing
    core.put(of, None, lanes)
    core.onsets[:] = 10 + np.arange(N)
    core.library.t_hand_on(ctypes.c_int64(200), ctypes.c_double(55.0), ctypes.c_double(OLD))
    wanted, lengths = lanes.copy(), list[tuple[bool, bool]]()
    for stay in range(RAMPED + 1, SWITCHED, 2):
        drifts = [
            k
            for k, item in enumerate(PLAN.lanes[:SWITCHED])
            if item.kind is FaultKind.DRIFT and is_of_same(item, PLAN.lanes[stay])
        ]
        best = max(drifts, key=lambda k: np.nan_to_num(lanes[-1, k], nan=-np.inf) + PLAN.weight[k])
        extra = PLAN.weight[best] - PLAN.weight[stay]
        since = OLD if PLAN.lanes[best].old else None
        wanted[:, stay] = ended(lanes[:, best], lanes[:, stay], 190 - best, 55.0, extra, since)[1]
        lengths.append((since is None, wanted[TOOK, stay] > 0.0))
        for k in set(drifts) - {RAMPED}:
            wanted[-1, k] = ended(lanes[:, k], lanes[:, stay], 190 - k, 55.0)[0][-1]
    left = [k for k in range(N) if k != RAMPED]
    assert close(core.lanes()[:, left], wanted[:, left])
    assert np.any(wanted[ENDED, RAMPED:SWITCHED] > 1.0)
    assert {(True, True), (True, False)} <= set(lengths)


@pytest.mark.parametrize("parameter", [-1, 0, 1])
def test_a_lane_without_its_slot(core: Core, parameter: int) -> None:
    """What the slot adds to a parameter becomes part of it, and of its covariance: T z and T P T'."""
    lane, found = np.zeros(WIDE.n_numbers), np.zeros(SPEC.n_numbers)
    root, take = np.random.default_rng(4).normal(size=(WIDE.n_joint, WIDE.n_joint)), np.eye(WIDE.n_joint)[SHARED]
    lane[: WIDE.n_joint], lane[WIDE.covariance_slice], lane[-1] = root[0], pack(root @ root.T), -3.0
    if parameter >= 0:
        take[SPEC.parameter_slice.start + parameter, SIZE] = 0.7
    core.library.t_narrowed(at(lane), ctypes.c_double(0.7), ctypes.c_int64(parameter), at(found))
    wanted = [*(take @ root[0]), *pack(take @ root @ root.T @ take.T), -3.0]
    assert found == pytest.approx(np.array(wanted), rel=1e-12, abs=1e-12)


def test_an_empty_slot_changes_nothing_else() -> None:
    """Mean, covariance and implicit signals stay; the slot is zero, and without it the lane is as before."""
    core, spec = lamp(), lamp().spec
    own = [k for k in range(spec.slotted.n_joint) if k not in range(*spec.slotted.slot_slice.indices(99))]
    plain, wide = np.random.default_rng(2).normal(size=spec.n_numbers), np.ones(spec.slotted.n_numbers)
    core.call("t_widen", plain, wide)
    full = unpack(spec.slotted, wide[spec.slotted.covariance_slice])
    assert len(spec.loops) == 1
    assert np.array_equal(wide[own], plain[: spec.n_joint])
    assert np.array_equal(full[np.ix_(own, own)], unpack(spec, plain[spec.covariance_slice]))
    assert np.array_equal(wide[spec.slotted.loop_slice], plain[spec.loop_slice])
    assert wide[-1] == plain[-1]
    assert not np.any(wide[spec.slotted.slot_slice])
    assert not np.any(full[spec.slotted.slot_slice])
    assert not np.any(wide[spec.slotted.loop_slice.stop : -1])
    back = np.zeros_like(plain)
    core.call("t_narrow", wide, back)
    assert np.array_equal(back, plain)


def test_rates_on_a_grid_without_a_step() -> None:
    """Where the sample time varies, a rate per sample is one per mean time between samples; per second at the least."""
    found = np.zeros(1)
    for steps, wanted in (([0.0, 0.5, 0.25], 0.25), ([0.0, 0.0], 1.0)):
        lamp().call("t_usual_step", np.array(steps), np.array([float(len(steps))]), found)
        assert found[0] == pytest.approx(wanted)
