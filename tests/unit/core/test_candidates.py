"""The ranking of the core next to plain sums: posterior, estimates, forecasts."""

from dataclasses import replace
from itertools import combinations
from math import inf, log, nan, sqrt
from statistics import NormalDist
from typing import Any

import numpy as np
import pytest

from bare_core import IN_CPP
from diagnosed import KINDS, RESERVE, SPEC, Diagnosed, raised, share_of, slot_of
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import MAX_CANDIDATES
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import covariance_place
from faultbond.runtime.candidates import diagnosis_of
from faultbond.types import FaultKind

WIDE, SLOTS, STEPS = SPEC.slotted, plan_slots(SPEC), plan_lanes(SPEC)
FIRST = SPEC.parameter_slice.start
SIZE = WIDE.slot_slice.start
SETTINGS = SPEC.thresholds
STEP, RAMP, BIAS, GAIN = map(KINDS.index, (FaultKind.STEP, FaultKind.RAMP, FaultKind.BIAS, FaultKind.GAIN))
WIDER = sqrt(1.0 / share_of(400))  # standard deviations, in those of the filter: 400 samples after the alarm


@pytest.fixture
def state() -> Diagnosed:
    """A state with an alarm, whose parameters are far from healthy."""
    found = Diagnosed()
    found.far_off()
    return found


def lanes_of(grown: FloatArray) -> list[tuple[int, int, float]]:
    """Hypothesis, kind and prior weight of each lane; those of no set weigh nothing."""
    counts = np.bincount(STEPS.hypothesis)
    found = [(int(k), STEP, -log(counts[k])) for k in STEPS.hypothesis]
    found += [(SPEC.n_begun + int(k), STEP, -log(3.0) if k >= 0 else -inf) for k in np.repeat(grown, 3)]
    return found + [(item.hypothesis, KINDS.index(item.kind), item.weight) for item in SLOTS.lanes]


def gains(n: int) -> list[bool]:
    """Tell of n lanes which look for a wrong gain."""
    own = [item.scales for item in SLOTS.lanes]
    return [False] * (n - len(own)) + own


def mixed(seed: int, state: Diagnosed, level: float = 0.0, spread: float = 8.0) -> FloatArray:
    """Write likelihoods of all lanes, some no numbers; give their sums, weighted, by hypothesis and kind.

    The likelihoods scatter about `level`; the sums are those of a level of 0.
    """
    generator = np.random.default_rng(seed)
    values = generator.normal(level, spread, state.n_steps + state.n_slots)
    values[generator.random(len(values)) < 0.05] = nan
    values[generator.random(len(values)) < 0.05] = inf
    state["bank.grown"] = np.where(np.arange(len(RESERVE)) < 5, (3 * np.arange(len(RESERVE))) % len(RESERVE), -1)
    state.likelihoods(values)
    total, changes = np.zeros((SPEC.n_hypotheses, len(KINDS))), np.full((SPEC.n_hypotheses, len(KINDS)), -inf)
    finite = np.where(np.isfinite(values), values, -inf)
    for value, (hypothesis, kind, weight) in zip(finite, lanes_of(state["bank.grown"]), strict=True):
        if weight > -inf:
            changes[hypothesis, kind] = max(changes[hypothesis, kind], value)
    share, scaled = share_of(int(state["clock.index"][0] - state["clock.alarm"][0])), gains(len(values))
    for value, (hypothesis, kind, weight), scales in zip(values, lanes_of(state["bank.grown"]), scaled, strict=True):
        simpler = STEP if hypothesis < len(SPEC.hypotheses) else GAIN if scales else BIAS
        told = simpler if kind == RAMP and not value >= changes[hypothesis, simpler] + 2.0 else kind
        total[hypothesis, told] += np.exp((value - level) * share + weight) if np.isfinite(value) else 0.0
    return total


@pytest.mark.parametrize(("level", "spread"), [(0.0, 0.1), (0.0, 8.0), (-5000.0, 8.0), (-5000.0, 60.0)])
@pytest.mark.parametrize("seed", range(4))
def test_the_posterior_is_the_weighted_mean_likelihood_by_its_cost(
    state: Diagnosed, seed: int, level: float, spread: float
) -> None:
    """Probabilities, order, groups, kinds: those of sums over lanes, with parts raised; what has no lanes is none."""
    total = mixed(seed, state, level, spread)
    costs = [SETTINGS.cost_per_suspect * len(SPEC.members(k)) for k in range(SPEC.n_hypotheses)]
    for k, item in enumerate(SPEC.instruments, len(SPEC.hypotheses)):
        costs[k] = SETTINGS.cost_per_sensor if item.is_output else SETTINGS.cost_per_suspect
    evidence = raised(total.sum(axis=1) * np.exp(-np.array(costs)))
    found = state.diagnose()
    rows = found["candidates"][: found["n_candidates"]]
    assert len(rows) == SPEC.n_begun + 5
    assert list(rows["hypothesis"]) == [k for k in np.argsort(-evidence, kind="stable") if evidence[k] > 0.0]
    assert rows["probability"] == pytest.approx(evidence[rows["hypothesis"]] / evidence.sum(), rel=1e-9)
    assert list(rows["group"]) == list(rows["probability"] >= rows["probability"][0] * np.exp(-SETTINGS.group_nats))
    tried = {(hypothesis, kind) for hypothesis, kind, weight in lanes_of(state["bank.grown"]) if weight > -inf}
    for row in rows:
        own = total[row["hypothesis"]]
        order = [int(k) for k in np.argsort(-own, kind="stable") if (row["hypothesis"], k) in tried]
        order = [k for k in order if k != RAMP or own[RAMP] > 0.0]  # it may be told as what is simpler
        assert list(row["kinds"][: row["n_kinds"]]) == order
        assert row["shares"][: row["n_kinds"]] == pytest.approx(own[order] / own.sum(), rel=1e-9)


@pytest.mark.parametrize("after", [0, 100, 5000, 10_000, 80_000])
def test_what_fits_a_little_better_does_so_for_a_while_only(state: Diagnosed, after: int) -> None:
    """A hypothesis of two that gains 0.01 nats a sample over a part of it does not outweigh its cost, however long."""
    pair = next(k for k in range(len(SPEC.hypotheses)) if len(SPEC.members(k)) == 2)
    single = next(k for k in range(len(SPEC.hypotheses)) if SPEC.members(k) == SPEC.members(pair)[:1])
    values = np.full(state.n_steps + state.n_slots, -1e6)
    for k, gained in ((single, 0.0), (pair, 0.01 * after)):
        values[np.flatnonzero(STEPS.hypothesis == k)] = gained
    state["clock.index"] = state["clock.alarm"] + after
    state.likelihoods(values)
    one, two = (state.diagnose()["candidates"][k] for k in (0, 1))
    gain = 0.01 * after * share_of(after) - SETTINGS.cost_per_suspect
    first, second = (pair, single) if gain > 0.0 else (single, pair)
    assert (one["hypothesis"], two["hypothesis"]) == (first, second)
    ahead = min(gain, core_settings()["LEFT_OF_IT"])  # of which a model's errors may be all
    assert one["probability"] / two["probability"] == pytest.approx(np.exp(abs(ahead)), rel=1e-6)


def test_a_lane_that_rests_lacks_all_that_it_lacked(state: Diagnosed) -> None:
    """A hypothesis whose lanes rest, 100 nats behind, does not come nearer with time."""
    values = np.full(state.n_steps + state.n_slots, -1e6)
    behind = STEPS.n_lanes - 1
    values[0], values[behind] = 0.0, -100.0
    state["clock.index"] = state["clock.alarm"] + 9000
    state.likelihoods(values)
    near = state.diagnose()["candidates"][1].copy()
    rests = state["bank.rests"].copy()
    rests[behind // int(core_settings()["GROUP"])] = 1
    state["bank.rests"] = rests
    far = state.diagnose()["candidates"][1]
    assert near["hypothesis"] == far["hypothesis"] == STEPS.hypothesis[behind]
    assert near["probability"] > 1e-8
    assert far["probability"] < 1e-40


def test_of_what_is_equally_likely_the_first_comes_first(state: Diagnosed) -> None:
    """Where no lane is any number, candidates, kinds and lanes stand in their order, and all are in one group."""
    state.likelihoods(np.full(state.n_steps + state.n_slots, nan))
    for k, lane in enumerate(np.flatnonzero(STEPS.hypothesis == 2)):
        state.lane("step", int(lane))[FIRST + 2] = 1.0 + k
    found = state.diagnose()
    assert found["candidates"][2]["suspects"][0]["estimate"] == SPEC.parameters[2].scale
    rows = found["candidates"][: found["n_candidates"]]
    assert list(rows["hypothesis"]) == list(range(SPEC.n_begun))
    assert rows["group"].all()
    assert [list(row["kinds"][: row["n_kinds"]]) for row in rows] == [
        sorted({kind for h, kind, weight in lanes_of(state["bank.grown"]) if h == k and weight > -inf})
        for k in range(SPEC.n_begun)
    ]


def test_estimates_are_those_of_the_best_lane_of_the_best_kind(state: Diagnosed) -> None:
    """A lane that is likelier, but of a kind that is less likely in all, says how uncertain they are; all in SI."""
    own = np.flatnonzero(STEPS.hypothesis == 1)
    values = np.full(state.n_steps + state.n_slots, -1000.0)
    values[own], values[own[2]] = 49.9, 50.0
    drifting = state.n_steps + slot_of(hypothesis=1, kind=FaultKind.DRIFT)
    values[drifting] = 50.3
    place = FIRST + 1
    state.only(drifting)
    other = state.diagnose()["candidates"][0]["suspects"][0].copy()
    state.likelihoods(values)
    state.lane("step", int(own[2]))[place] = 1.7
    state.lane("step", int(own[2]))[covariance_place(SPEC, place, place)] = 0.04
    best = state.diagnose()["candidates"][0]
    assert (best["hypothesis"], best["present"], best["n_suspects"]) == (1, 1, 1)
    suspect = best["suspects"][0]
    assert (suspect["parameter"], suspect["input"], suspect["output"], suspect["word"]) == (1, -1, -1, 0)
    scale = SPEC.parameters[1].scale
    assert best["lane"] == own[2]
    assert suspect["estimate"] == pytest.approx(1.7 * scale)
    step, drift = best["shares"][:2]
    off = np.hypot(other["sd"], other["estimate"] - suspect["estimate"])
    assert 0.05 < drift < step
    assert suspect["sd"] == pytest.approx(
        np.sqrt((step * (WIDER * 0.2 * scale) ** 2 + drift * off**2) / (step + drift))
    )
    assert suspect["nominal"] == SPEC.parameters[1].nominal
    assert np.isnan([suspect["rate"], suspect["rate_sd"]]).all()


def test_what_is_lost_does_not_count(state: Diagnosed) -> None:
    """A lane whose likelihood is no number adds nothing and is not told; all of whose are none has no probability."""
    state.likelihoods(np.full(state.n_steps + state.n_slots, -100.0))
    own, gone = (np.flatnonzero(STEPS.hypothesis == k) for k in (2, 0))
    before = state.diagnose()["candidates"].copy()
    share = float(before[before["hypothesis"] == 2][0]["probability"])
    state.write("step", int(own[0]), np.full(SPEC.n_numbers, nan))
    state.lane("step", int(own[1]))[SPEC.n_numbers - 1] = -inf
    for place in gone:
        state.write("step", int(place), np.full(SPEC.n_numbers, nan))
    for lane, item in enumerate(SLOTS.lanes):
        if item.hypothesis == 0:
            state.write("slot", lane, np.full(WIDE.n_numbers, nan))
    found = state.diagnose()
    rows = found["candidates"][: found["n_candidates"]]
    assert (rows[-1]["hypothesis"], rows[-1]["probability"]) == (0, 0.0)
    assert rows[-2]["probability"] > 0.0
    assert rows["probability"].sum() == pytest.approx(1.0)
    assert [sum(row["shares"][: row["n_kinds"]]) for row in rows] == pytest.approx([1.0] * len(rows))
    (row,) = rows[rows["hypothesis"] == 2]
    left = {FaultKind.STEP: {int(k): 1.0 / len(own) for k in own[2:]}}  # by kind: weights of the lanes that are left
    for lane, item in enumerate(SLOTS.lanes, state.n_steps):
        if item.hypothesis == 2:
            left.setdefault(item.kind, {})[lane] = float(np.exp(item.weight))
    of_kind, leading = {kind: sum(lanes.values()) for kind, lanes in left.items()}, KINDS[row["kinds"][0]]
    assert of_kind[leading] == pytest.approx(max(of_kind.values()), rel=1e-9)  # two may be equal but for rounding
    assert left[leading][int(row["lane"])] == max(left[leading].values())
    assert np.isfinite(row["suspects"][0]["estimate"])
    weight = sum(np.exp(item.weight) for item in SLOTS.lanes if item.hypothesis == 2)
    lost = float(before[before["hypothesis"] == 0][0]["probability"])
    part = (1.0 - 2.0 / len(own) + weight) / (1.0 + weight)
    assert row["probability"] == pytest.approx(share * part / (1.0 - lost - share * (1.0 - part)))


@pytest.mark.parametrize("first", [0, 50, 110])
def test_at_most_a_hundred_candidates(first: int) -> None:
    """Of more than a hundred sets the best hundred are given, with probabilities that count all sets."""
    sets = tuple(combinations(range(len(SPEC.parameters)), 2)) * 20
    spec, better = replace(SPEC, hypotheses=sets, reserve=()), range(first, first + 10)
    state = Diagnosed(spec)
    state.far_off()
    values = np.full(state.n_steps + state.n_slots, -inf)
    values[: state.n_steps] = np.where(np.isin(plan_lanes(spec).hypothesis, better), 3.0, 0.0)
    state.likelihoods(values)
    found = diagnosis_of(spec, state.diagnose()).candidates
    others = [k for k in range(len(sets)) if k not in better]
    assert [item.hypothesis for item in found] == [*better, *others[: MAX_CANDIDATES - 10]]
    better_by = np.exp(3.0 * share_of(400))
    total = 10.0 * better_by + len(sets) - 10.0
    assert [item.probability for item in found] == pytest.approx([better_by / total] * 10 + [1.0 / total] * 90)


def drifting(state: Diagnosed, value: float, rate: float, variances: tuple[float, float]) -> Any:
    """The suspect of a drift of the first parameter, in factors; variances of value and rate."""
    lane = slot_of(parameter=0, kind=FaultKind.DRIFT)
    state.only(state.n_steps + lane)
    numbers = state.lane("slot", lane)
    numbers[FIRST], numbers[SIZE], numbers[SIZE + 1] = 1.0, value - 1.0, rate
    numbers[covariance_place(WIDE, SIZE, SIZE)], numbers[covariance_place(WIDE, SIZE + 1, SIZE + 1)] = variances
    return state.diagnose()["candidates"][0]["suspects"][0]


def test_a_drift_reaches_its_limit_on_a_straight_line(state: Diagnosed) -> None:
    """From 12 ohm at 0.01 ohm/s to 5 ohm: never; to 20 ohm: in 800 s, sooner and later by the sd of the value."""
    state["clock.time"] = 1000.0
    suspect = drifting(state, 1.2, 0.001, (0.01**2, 0.0))
    assert (suspect["estimate"], suspect["rate"], suspect["sd"]) == pytest.approx((12.0, 0.01, 0.1 * WIDER))
    assert suspect["n_forecasts"] == 2
    low, high = suspect["forecasts"]
    assert (low["limit"], high["limit"]) == (5.0, 20.0)
    assert np.isnan([low["time"], low["earliest"], low["latest"]]).all()
    off = NormalDist().inv_cdf(0.95) * 0.1 * WIDER / 0.01
    assert tuple(high)[1:] == pytest.approx((1800.0, 1800.0 - off, 1800.0 + off), rel=1e-12)


def test_a_drift_is_that_of_the_parameter_and_the_slot(state: Diagnosed) -> None:
    """Values, rates and covariances are those of the sum of both, within what the parameter can be."""
    state["normal.rates"] = 3e-4
    lane, places = state.lane("slot", slot_of(parameter=0, kind=FaultKind.DRIFT)), (FIRST, SIZE, SIZE + 1)
    root = 0.02 * np.random.default_rng(2).normal(size=(3, 3))
    full = root @ root.T
    for i, row in enumerate(places):
        for j, column in enumerate(places[i:], i):
            lane[covariance_place(WIDE, row, column)] = full[i, j]
    one, both = np.array([1.0, 1.0, 0.0]), SPEC.parameters[0].scale
    for value in (0.9, 1.1 * SPEC.parameters[0].upper):
        suspect = drifting(state, value, 0.1, (full[1, 1], full[2, 2]))
        assert suspect["estimate"] == pytest.approx(both * min(value, SPEC.parameters[0].upper))
        assert suspect["rate"] == pytest.approx(both * (0.1 + 3e-4))
        assert suspect["sd"] == pytest.approx(WIDER * both * sqrt(one @ full @ one))
        assert suspect["rate_sd"] == pytest.approx(WIDER * both * sqrt(full[2, 2]))
    suspect = drifting(state, 0.9, 0.1, (full[1, 1], full[2, 2]))
    low, high = suspect["forecasts"]
    t = high["earliest"] - state["clock.time"][0]
    at = np.array([1.0, 1.0, t])
    score = (suspect["estimate"] + suspect["rate"] * t - high["limit"]) / (WIDER * both * sqrt(at @ full @ at))
    assert NormalDist().cdf(score) == pytest.approx(0.05, rel=1e-6)
    assert np.isnan(low["earliest"])


def test_a_rate_that_is_hardly_known_reaches_the_limit_early_or_late(state: Diagnosed) -> None:
    """From two sd on a rate is one; where the limit lies behind, it is reached now."""
    sd, off = 0.001, NormalDist().inv_cdf(0.95) * WIDER * 0.001
    high = drifting(state, 1.2, 0.0025, (0.0, sd**2))["forecasts"][1]
    assert tuple(high)[1:] == pytest.approx((0.8 / 0.0025, 0.8 / (0.0025 + off), 0.8 / (0.0025 - off)), rel=1e-12)
    assert drifting(state, 2.5, 0.0025, (1e-8, 1e-8))["forecasts"][1]["latest"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("off", [1.99, 2.01])
def test_a_drift_whose_rate_may_be_nought_is_a_step(state: Diagnosed, off: float) -> None:
    """Below two sd of it, and it is told without rate and forecast then; of an instrument it is a bias."""
    suspect = drifting(state, 1.2, 0.001 * off, (0.01**2, 0.001**2))
    best = state.diagnose()["candidates"][0]
    assert KINDS[best["kinds"][0]] is (FaultKind.DRIFT if off > 2.0 else FaultKind.STEP)
    assert (suspect["n_forecasts"], np.isnan(suspect["rate"])) == ((2, False) if off > 2.0 else (0, True))
    assert (suspect["estimate"], suspect["sd"]) == pytest.approx((12.0, 0.1 * WIDER))
    lane = slot_of(output=0, kind=FaultKind.DRIFT)
    state.only(state.n_steps + lane)
    numbers = state.lane("slot", lane)
    numbers[SIZE + 1], numbers[covariance_place(WIDE, SIZE + 1, SIZE + 1)] = off, 1.0
    best = state.diagnose()["candidates"][0]
    assert KINDS[best["kinds"][0]] is (FaultKind.DRIFT if off > 2.0 else FaultKind.BIAS)


@pytest.mark.parametrize("more", [1.9, 2.1])
def test_a_ramp_that_is_hardly_likelier_than_a_step_is_one(state: Diagnosed, more: float) -> None:
    """It has no times then; its lane may still tell the value."""
    ramp, values = slot_of(hypothesis=1, kind=FaultKind.RAMP), np.full(state.n_steps + state.n_slots, -1000.0)
    values[np.flatnonzero(STEPS.hypothesis == 1)], values[state.n_steps + ramp] = 40.0, 40.0 + more
    state.likelihoods(values)
    best = state.diagnose()["candidates"][0]
    kinds = dict(zip([KINDS[k] for k in best["kinds"][: best["n_kinds"]]], best["shares"], strict=False))
    assert best["hypothesis"] == 1
    assert (kinds.get(FaultKind.RAMP, 0.0) > 0.1) == (more > 2.0)
    assert (kinds[FaultKind.STEP] > 0.99) == (more < 2.0)
    leads = KINDS[best["kinds"][0]] is FaultKind.RAMP
    assert np.isnan(best["suspects"][0]["began"]) == (not leads)


@pytest.mark.parametrize(("took", "since"), [(30.0, -30.0), (200.0, -200.0)])
def test_what_raised_an_alarm_had_begun_by_then(state: Diagnosed, took: float, since: float) -> None:
    """A ramp that ended 100 s after the alarm, and seems to have taken 30 s, began no later than the alarm."""
    ramp, alarm = slot_of(hypothesis=1, kind=FaultKind.RAMP), 500.0
    state.only(state.n_steps + ramp)
    state["alarm.time"] = alarm
    numbers, roles = state.lane("slot", ramp), WIDE.role_fields
    numbers[roles["ended"].start], numbers[roles["took"].start] = alarm + 100.0, took
    suspect = state.diagnose()["candidates"][0]["suspects"][0]
    assert suspect["ended"] == alarm + 100.0
    assert suspect["began"] == min(alarm + 100.0 + since, alarm)


def test_the_noise_of_a_sensor_is_where_its_likelihood_is_largest(state: Diagnosed) -> None:
    """Of n readings with mean square s, each noise tried has n (-log c - s/c) / 2; they tell sqrt(s), to sqrt(s/2n)."""
    lanes = [k for k, item in enumerate(SLOTS.lanes) if item.output == 1 and item.kind is FaultKind.NOISE]
    state["normal.noise"], state["sensors.nis"] = [1.0, 4.0], [1.0, 2.25]
    state.only(state.n_steps + lanes[0])
    for lane in lanes:
        c = SLOTS.lanes[lane].noise
        state.lane("slot", lane)[WIDE.n_numbers - 1] = 300.0 * (-log(c) - 12.0 / c) / 2.0 + 900.0
    suspect = state.diagnose()["candidates"][0]["suspects"][0]
    sd = SPEC.outputs[1].noise * 2.0 * 1.5 * sqrt(12.0)
    assert (suspect["output"], suspect["word"], suspect["nominal"]) == (1, 4, SPEC.outputs[1].noise)
    assert (suspect["estimate"], suspect["sd"]) == pytest.approx((sd, WIDER * sd / sqrt(600.0)))


def test_words_of_instruments(state: Diagnosed) -> None:
    """What is wrong with an instrument has a word, a healthy value, and the unit of its reading; 1.1 of a gain."""
    noise = SPEC.outputs[0].noise
    expected = {
        slot_of(output=0, kind=FaultKind.BIAS): (1, 0.0, 0.1 * noise),
        slot_of(output=0, kind=FaultKind.DRIFT): (1, 0.0, 0.1 * noise),
        slot_of(output=0, kind=FaultKind.INTERMITTENT, sticks=False, acts=False): (1, 0.0, 0.1 * noise),
        slot_of(output=0, kind=FaultKind.INTERMITTENT, sticks=True): (2, nan, 0.1 * noise),
        slot_of(output=0, kind=FaultKind.STUCK): (2, nan, 0.1 * noise),
        slot_of(output=0, kind=FaultKind.GAIN): (3, 1.0, 1.1),
        slot_of(input=0, kind=FaultKind.BIAS): (1, 0.0, 0.1),
    }
    for lane, (word, nominal, estimate) in expected.items():
        state.only(state.n_steps + lane)
        state.lane("slot", lane)[SIZE] = 0.1
        best = state.diagnose()["candidates"][0]
        suspect = best["suspects"][0]
        assert best["present"] == SLOTS.lanes[lane].acts
        assert (suspect["parameter"], suspect["output"]) == (-1, SLOTS.lanes[lane].output)
        assert (suspect["word"], suspect["nominal"], suspect["estimate"]) == pytest.approx(
            (word, nominal, estimate), nan_ok=True
        )
        assert np.isnan(suspect["rate"]) == (SLOTS.lanes[lane].kind is not FaultKind.DRIFT)


@pytest.mark.parametrize("options", [("-DFB_LANES=1",), ("-DFB_LANES=4", *IN_CPP)])
def test_every_width_has_the_same_digits(options: tuple[str, ...]) -> None:
    """Lanes stand elsewhere, and nothing else differs, in C and in C++."""
    one, other = Diagnosed(), Diagnosed(SPEC, *options)
    for state in (one, other):
        mixed(5, state)
    assert one.diagnose().tobytes() == other.diagnose().tobytes()


def test_without_candidates_nothing_is_unexplained() -> None:
    """Where parameters alone are suspects, and all lanes are far out of their ranges, no lane is asked for more."""
    outputs = tuple(replace(item, suspect=False) for item in SPEC.outputs)
    inputs = tuple(replace(item, suspect=False) for item in SPEC.inputs)
    parameters = tuple(replace(item, least=0.5, most=2.0) for item in SPEC.parameters)
    state = Diagnosed(replace(SPEC, outputs=outputs, inputs=inputs, parameters=parameters))
    for what, count in (("step", state.n_steps), ("slot", state.n_slots)):
        for lane in range(count):
            for place in range(FIRST, FIRST + len(parameters)):
                state.lane(what, lane)[place] = 1e200
    state["bank.sums"] = 10.0 * SETTINGS.cusum_limit
    found = state.diagnose()
    assert (found["n_candidates"], found["is_unexplained"]) == (0, 0)


def test_the_lanes_of_a_couple_weigh_together_what_one_slot_does() -> None:
    """However many it has: a couple is as likely as its parts cost, and as the kind of its instrument's fault is."""
    spec = replace(SPEC, coupled=True)
    state, slots, couple = Diagnosed(spec), plan_slots(spec).lanes, spec.mixed.index((0, 0))
    slot = next(k for k, item in enumerate(slots) if item.output == 0 and item.kind is FaultKind.BIAS)
    values = np.full(state.n_steps + state.n_slots, -1000.0)
    values[np.flatnonzero(STEPS.hypothesis == 1)] = 0.0
    state.far_off()
    state.likelihoods(values)
    state["bank.coupled"][0] = couple
    for lane in range(0, len(state["bank.base"]), len(state["bank.coupled"])):  # those of the first row
        state["bank.base"][lane] = slot
        for place in (FIRST, SIZE):
            state.lane("slot", state.n_slots + lane)[place] = 1e3
    first, second = state.diagnose()["candidates"][:2]
    assert (first["hypothesis"], second["hypothesis"]) == (1, spec.n_begun + len(RESERVE) + couple)
    weight = slots[slot].weight - SETTINGS.cost_per_sensor
    assert second["probability"] / first["probability"] == pytest.approx(np.exp(weight), rel=1e-6)
