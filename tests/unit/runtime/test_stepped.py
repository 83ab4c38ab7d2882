"""The bank: hypotheses do not see each other, onsets are mixed as they should be, and the true fault is found."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import extremes, found_lanes, plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import Engine, EngineSpec, SlowErrorSpec, StateSpec, pack, unpack
from faultbond.runtime.monitor import finish
from faultbond.runtime.start import healthy_lane
from faultbond.runtime.stepped import begin_near, begin_steps, renew_steps, suspect_lanes
from faultbond.runtime.trail import Trail
from faultbond.simulate import Fault
from made import plant, recorded, run

TANK_FAULT = Fault(parameter="K1", factor=3.0, start=230.0)
MOTOR_FAULT = Fault(parameter="K", factor=0.6, start=2.4)


@pytest.mark.parametrize(
    ("name", "fault", "kept"),
    [
        ("tank", TANK_FAULT, (1, 2, 9, 20)),
        ("dc_motor", MOTOR_FAULT, (2,)),
        ("dc_motor_current", MOTOR_FAULT, (24, 3, 7)),
    ],
)
def test_hypotheses_do_not_see_each_other(name: str, fault: Fault, kept: tuple[int, ...]) -> None:
    """Adding, removing or reordering hypotheses changes no other's numbers, to the last bit, over 300 samples."""
    _, spec, engine = plant(name)
    samples = recorded(name, 300, fault)
    less = replace(spec, hypotheses=tuple(spec.hypotheses[k] for k in kept))
    full, reports = run(spec, engine, samples)
    part, part_reports = run(less, engine, samples)
    assert 0 <= full.clock.alarm < 290
    assert part.clock.alarm == full.clock.alarm
    assert np.array_equal(part.healthy.lane, full.healthy.lane)
    for new, old in enumerate(kept):
        here = part.bank.steps[:, plan_lanes(less).hypothesis == new]
        there = full.bank.steps[:, plan_lanes(spec).hypothesis == old]
        assert np.all(np.isfinite(there[-1]))
        assert np.array_equal(here, there)
    shift = len(less.hypotheses) - len(spec.hypotheses)
    pairs = [*enumerate(kept), *((k + shift, k) for k in range(len(spec.hypotheses), spec.n_hypotheses))]
    for new, old in pairs:
        here = part.bank.slots[:, plan_slots(less).hypothesis == new]
        there = full.bank.slots[:, plan_slots(spec).hypothesis == old]
        assert np.array_equal(here, there)
    assert [r.detection for r in part_reports] == [r.detection for r in reports]


@pytest.mark.parametrize(
    ("name", "fault", "wanted"),
    [("tank", TANK_FAULT, 3.0 * 2.41e11), ("dc_motor_current", MOTOR_FAULT, 0.6 * 2.0)],
)
def test_true_fault_is_found(name: str, fault: Fault, wanted: float) -> None:
    """The parameter that changed is the best candidate, with its new value within four standard deviations."""
    _, spec, engine = plant(name)
    state, _ = run(spec, engine, recorded(name, 330, fault))
    diagnosis = finish(spec, state)
    assert diagnosis is not None
    best = diagnosis.candidates[0]
    assert best.parameters == (fault.parameter,)
    assert best.suspects[0].estimate == pytest.approx(wanted, abs=4.0 * best.suspects[0].sd)
    assert best.suspects[0].sd < 0.3 * wanted


def wide_lane(spec: EngineSpec) -> FloatArray:
    """A healthy lane, shape (n_numbers,), in which everything is correlated and no mean is a round number."""
    generator = np.random.default_rng(1)
    lane = healthy_lane(spec, np.full(len(spec.states), 3.0), np.eye(len(spec.states)))[:, 0]
    root = 0.05 * generator.normal(size=(spec.n_joint, spec.n_joint))
    lane[spec.covariance_slice] = pack(root @ root.T + 0.01 * np.eye(spec.n_joint))
    lane[spec.parameter_slice] *= generator.uniform(0.95, 1.05, len(spec.parameters))
    lane[spec.slow_slice] = 0.3
    lane[-1] = -12.5
    return lane


@pytest.mark.parametrize("name", ["tank", "dc_motor_current", "rlc"])
def test_suspects_begin_at_their_starts(name: str) -> None:
    """In its lanes a suspect stands at its start, as wide as that and correlated with nothing; the rest is healthy."""
    _, spec, _ = plant(name)
    plan, healthy = plan_lanes(spec), wide_lane(spec)
    lanes, before = suspect_lanes(spec, plan, healthy), unpack(spec, healthy[spec.covariance_slice])
    first, n_x = spec.parameter_slice.start, len(spec.states)
    for lane in range(plan.n_lanes):
        full = unpack(spec, lanes[spec.covariance_slice, lane])
        chosen = np.flatnonzero(plan.suspected[:, lane])
        own = first + chosen
        others = np.setdiff1d(np.arange(spec.n_joint), own)
        for index, k in zip(chosen, own, strict=True):
            item = spec.parameters[index]
            value = np.clip(healthy[k] * plan.values[index, lane], item.lower, item.upper)
            assert lanes[k, lane] == pytest.approx(value, rel=1e-14)
            assert full[k, k] == pytest.approx((plan.sds[index, lane] * healthy[k]) ** 2, rel=1e-12)
            assert not np.any(full[k, others])
        still = others[others >= n_x]
        assert np.array_equal(lanes[still, lane], healthy[still])
        assert np.array_equal(full[np.ix_(still, still)], before[np.ix_(still, still)])
        if not plan.jumps[lane].any():
            assert np.array_equal(full[np.ix_(others, others)], before[np.ix_(others, others)])
            assert np.array_equal(lanes[:n_x, lane], healthy[:n_x])
        sd = np.sqrt(np.diag(full))
        assert np.linalg.eigvalsh(full / np.outer(sd, sd)).min() > 0.0
    rest = spec.n_joint + spec.n_packed
    assert np.array_equal(lanes[rest:], np.repeat(healthy[rest:, None], plan.n_lanes, axis=1))


def content_variance(spec: EngineSpec, lane: FloatArray, exponents: dict[int, float]) -> float:
    """The relative variance, to first order, of the product of elements of z, each to its exponent."""
    full, places = unpack(spec, lane[spec.covariance_slice]), list(exponents)
    slopes = np.array([exponents[k] / lane[k] for k in places])
    return float(slopes @ full[np.ix_(places, places)] @ slopes)


def test_content_goes_on_where_it_is_kept() -> None:
    """Where a store keeps its content, its effort or flow moves against its own parameter, and nothing else moves."""
    _, spec, _ = plant("rlc")
    plan, healthy = plan_lanes(spec), wide_lane(spec)
    lanes = suspect_lanes(spec, plan, healthy)
    names = [item.name for item in spec.parameters]
    for state, (store, owner) in enumerate((("C.e", "C"), ("L.f", "L"))):
        assert spec.states[state].name == store
        index = names.index(owner)
        jumping = np.flatnonzero(plan.jumps[:, state])
        assert len(jumping) > 0
        assert all(plan.suspected[index, lane] for lane in jumping)
        for lane in jumping:
            factor = plan.values[index, lane]
            assert lanes[state, lane] == pytest.approx(healthy[state] / factor, rel=1e-9)
            assert lanes[1 - state, lane] == healthy[1 - state]
            # e = content/factor: as uncertain as the content before, and as the factor (relative sd) makes it
            place = spec.parameter_slice.start + index
            before = content_variance(spec, healthy, {state: 1.0, place: 1.0}) * (healthy[state] / factor) ** 2
            relative = plan.sds[index, lane] * healthy[place] / lanes[place, lane]
            found = unpack(spec, lanes[spec.covariance_slice, lane])[state, state]
            assert found == pytest.approx(before + (lanes[state, lane] * relative) ** 2, rel=1e-9)


@pytest.mark.parametrize("clipped", [False, True])
@pytest.mark.parametrize("name", ["tank", "dc_motor_current", "rlc"])
def test_a_tied_jump_keeps_the_content(name: str, clipped: bool) -> None:
    """Begun from what was found, a store holds what it held, as uncertain as before and not bound to the factor.

    Also where a parameter cannot go as far as its start says.
    """
    _, spec, _ = plant(name)
    if clipped:
        narrow = tuple(replace(item, lower=0.8 * item.healthy, upper=1.2 * item.healthy) for item in spec.parameters)
        spec = replace(spec, parameters=narrow)
    plan, healthy = replace(plan_lanes(spec), tied=True), wide_lane(spec)
    lanes, checked = suspect_lanes(spec, plan, healthy), 0
    for state, item in enumerate(spec.states):
        for lane in np.flatnonzero(plan.jumps[:, state]):
            full = unpack(spec, lanes[spec.covariance_slice, lane])
            own = {spec.parameter_slice.start + k: -exponent for k, exponent in item.jumps if plan.suspected[k, lane]}
            exponents = {state: 1.0} | own
            slopes = np.zeros(spec.n_joint)
            slopes[list(exponents)] = [exponent / lanes[k, lane] for k, exponent in exponents.items()]
            content, held = (np.prod([z[k] ** e for k, e in exponents.items()]) for z in (lanes[:, lane], healthy))
            assert content == pytest.approx(held, rel=1e-9)
            assert full[list(own)] @ slopes == pytest.approx(0.0, abs=1e-12)
            known = content_variance(spec, healthy, exponents)
            assert content_variance(spec, lanes[:, lane], exponents) == pytest.approx(known, rel=1e-9)
            sd = np.sqrt(np.diag(full))
            assert np.linalg.eigvalsh(full / np.outer(sd, sd)).min() > 0.0
            checked += 1
    assert checked > 5


@dataclass(frozen=True)
class Counter:
    """An engine that counts the lanes it gets, and makes the fewer ones of a second beginning as likely as told."""

    inner: Engine
    likelihood: float = 0.0
    lanes: list[int] = field(default_factory=list)

    @property
    def title(self) -> str:
        """What it is."""
        return "counter"

    @property
    def slot(self) -> "Counter":
        """Itself."""
        return self

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Count and pass on."""
        following, innovations = self.inner.advance(lanes, samples)
        self.lanes.append(lanes.shape[1])
        if lanes.shape[1] < self.lanes[0]:
            following[-1] += self.likelihood
        return following, innovations


@pytest.mark.parametrize("likelihood", [0.0, -1e4])
def test_lanes_that_jump_begin_twice(likelihood: float) -> None:
    """The second time only they begin; they stay so, unless that made them far less likely."""
    _, spec, engine = plant("tank")
    state, _ = run(spec, engine, recorded("tank", 330, TANK_FAULT))
    plan, first = plan_lanes(spec), state.past.place(0)
    trail = Trail(samples=state.past.samples[first:][:40], lanes=state.past.lanes[first:][:40], alarm=20)
    starts = found_lanes(
        spec,
        plan,
        state.bank.steps,
        extremes(plan, state.bank.steps[-1])[0],
        state.healthy.lane[spec.parameter_slice, 0],
    )
    starts = replace(starts, jumps=starts.jumps | starts.suspected[[j for x in spec.states for j, _ in x.jumps]].T)
    jumping = np.any(starts.jumps, axis=1)
    counter = Counter(engine, likelihood)
    once, twice = begin_steps(spec, engine, trail, 20, starts), begin_near(spec, counter, trail, starts)
    assert set(counter.lanes) == {1, starts.n_lanes, int(np.sum(jumping))}
    assert len(set(counter.lanes)) == 3
    assert np.array_equal(once[:, ~jumping], twice[:, ~jumping])
    assert np.array_equal(once[:, jumping], twice[:, jumping]) == (likelihood < 0.0)


def test_renewed_filters_are_tied() -> None:
    """Wide starts are not bound to their jumps, those from what was found are."""
    _, spec, engine = plant("tank")
    state, _ = run(spec, engine, recorded("tank", 330, TANK_FAULT))
    plan = plan_lanes(spec)
    found = found_lanes(
        spec,
        plan,
        state.bank.steps,
        extremes(plan, state.bank.steps[-1])[0],
        state.healthy.lane[spec.parameter_slice, 0],
    )
    assert (plan.tied, found.tied) == (False, True)


@dataclass(frozen=True)
class ToyEngine:
    """An engine that adds, at each sample, its output times the lane's first factor to the likelihood."""

    spec: EngineSpec

    @property
    def title(self) -> str:
        """What it is."""
        return "toy"

    @property
    def slot(self) -> "ToyEngine":
        """The same for lanes with a slot."""
        return ToyEngine(self.spec.slotted)

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Add up."""
        place, following = self.spec.sample_fields, lanes.copy()
        for sample in samples:
            following[-1] += sample[place["use"]] * sample[place["y"]] * lanes[self.spec.parameter_slice.start]
            following[0] += sample[place["dt"]]
        return following, np.zeros((len(samples), 2, lanes.shape[1]))


def test_onsets_are_mixed() -> None:
    """A lane's likelihood is the mean over its onsets: healthy up to the onset, then its own; the best goes on."""
    _, rc, _ = plant("rc")
    slow = SlowErrorSpec(name="V_C", sd=0.5, memory=10.0, alarms=False)
    toy = replace(rc, states=(StateSpec(name="x", start_mean=0.0, start_sd=1.0, noise=0.0),), slow_errors=(slow,))
    engine, n, generator = ToyEngine(toy), 9, np.random.default_rng(4)
    place = toy.sample_fields
    samples = np.zeros((n, toy.n_sample))
    samples[:, place["dt"]], samples[:, place["use"]] = 1.0, 1.0
    samples[:, place["y"]] = generator.normal(0.0, 3.0, (n, 1))
    y = samples[:, place["y"]][:, 0]
    healthy = np.repeat(wide_lane(toy)[:, None], n, axis=1).T
    healthy[:, -1] = generator.normal(0.0, 5.0, n)  # likelihood of the healthy plant up to each sample
    healthy[:, 0] = np.arange(n)
    found = begin_steps(toy, engine, Trail(samples=samples, lanes=healthy), 3)
    plan = plan_lanes(toy)
    for lane in range(plan.n_lanes):
        trials = []
        for onset in range(1, n):
            k = toy.parameter_slice.start
            factor = healthy[onset - 1, k] * plan.values[0, lane]
            trials.append(healthy[onset - 1, -1] + factor * y[onset:].sum())
        mean = np.log(np.sum(np.exp(trials)) / toy.thresholds.history_samples)
        assert found[-1, lane] == pytest.approx(mean, rel=1e-12)
        best = 1 + int(np.argmax(trials))
        assert found[0, lane] == pytest.approx(healthy[best - 1, 0] + 1.0 + (n - 1 - best))  # no time passes twice
    full = unpack(toy, found[toy.covariance_slice, 0])
    assert found[toy.slow_slice, 0] == 0.0  # slow errors are begun anew
    assert full[1] == pytest.approx([0.0, 0.25, *[0.0] * (toy.n_joint - 2)])


def test_bank_has_seen_every_sample() -> None:
    """Begun on a trail, all lanes are finite, positive and of one age: more data of the trail change all of them."""
    _, spec, engine = plant("dc_motor")
    samples = recorded("dc_motor", 200, MOTOR_FAULT)
    state, _ = run(spec, engine, samples)
    rows = slice(state.past.place(state.clock.begun), None)
    trail = Trail(samples=state.past.samples[rows], lanes=state.past.lanes[rows])
    kept = trail.samples.copy(), trail.lanes.copy()
    bank = begin_steps(spec, engine, trail, 118)
    assert np.array_equal(trail.samples, kept[0])
    assert np.array_equal(trail.lanes, kept[1])
    shorter = begin_steps(spec, engine, Trail(samples=trail.samples[:-1], lanes=trail.lanes[:-1]), 118)
    assert np.all(np.isfinite(bank))
    assert np.all(bank[-1] != shorter[-1])
    for lane in bank.T:
        full = unpack(spec, lane[spec.covariance_slice])
        sd = np.sqrt(np.diag(full))
        assert np.linalg.eigvalsh(full / np.outer(sd, sd)).min() > 0.0


def test_renewal_replaces_the_least_likely_lane_only() -> None:
    """Begun again, each hypothesis gains at most one lane, which is likelier than the one whose place it takes."""
    _, spec, engine = plant("dc_motor")
    samples = recorded("dc_motor", 200, MOTOR_FAULT)
    state, _ = run(spec, engine, samples)
    rows = slice(state.past.place(state.clock.begun), None)
    trail = Trail(samples=state.past.samples[rows], lanes=state.past.lanes[rows])
    bank = begin_steps(spec, engine, trail, 118)
    renewed = renew_steps(spec, engine, replace(trail, alarm=state.clock.alarm - state.clock.begun), bank)
    plan = plan_lanes(spec)
    changed = np.flatnonzero(np.any(renewed != bank, axis=0))
    assert len(changed) > 0
    assert len(set(plan.hypothesis[changed])) == len(changed)
    _, worst = extremes(plan, bank[-1])
    assert set(changed) <= set(worst)
    assert np.all(renewed[-1, changed] > bank[-1, changed])
