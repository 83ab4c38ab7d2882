"""The monitor sample by sample: blind to what is missing, and alarmed as it should be."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime.monitor import START_SAMPLES, finish, step
from faultbond.runtime.state import Report, State, Status, init
from faultbond.simulate import Fault
from made import changed, differing, plant, recorded, run

TANK_FAULT = Fault(parameter="K1", factor=3.0, start=230.0)
MOTOR_FAULT = Fault(parameter="K", factor=0.6, start=2.4)
FAULTY = [("tank", 260, TANK_FAULT), ("dc_motor_current", 180, MOTOR_FAULT)]


def numbers_of(report: Report) -> list[float]:
    """All numbers of a report in one row."""
    found = [*report.expected, *report.variance, *report.cusum, *report.slow]
    if report.diagnosis is not None:
        for item in report.diagnosis.candidates:
            found += [item.probability, *(value for s in item.suspects for value in (s.estimate, s.sd))]
    return [float(value) for value in found]


def same_reports(one: Sequence[Report], two: Sequence[Report]) -> bool:
    """Whether reports agree to the last bit."""
    return all(
        a.status is b.status
        and a.detection == b.detection
        and np.array_equal(numbers_of(a), numbers_of(b), equal_nan=True)
        for a, b in zip(one, two, strict=True)
    )


def packed_of(state: State) -> FloatArray:
    """What the engine was given for the last sample, shape (1, n_sample)."""
    return np.asarray(state.past.samples[-1:])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_missing_output_is_not_used(bad: float) -> None:
    """A value that is no number leaves the filter as a switched-off one does, and its CUSUM as it was."""
    _, spec, engine = plant("dc_motor_current")
    samples = recorded("dc_motor_current", 100)
    before, _ = run(spec, engine, samples[:80])
    y = samples[80].y.copy()
    y[0] = bad
    after, report = step(spec, engine, before, replace(samples[80], y=y))
    blind = packed_of(step(spec, engine, before, samples[80])[0]).copy()
    blind[:, spec.sample_fields["use"]] = [0.0, 1.0]
    blind[:, spec.sample_fields["y"]][:, 0] = 77.0
    expected, _ = engine.advance(before.healthy.lane, blind)
    assert np.array_equal(after.healthy.lane, expected)
    assert np.array_equal(after.sensors.cusum[:, 0], before.sensors.cusum[:, 0])
    assert np.all(np.isfinite(report.expected))
    assert report.expected[0] == pytest.approx(samples[80].y[0], abs=6.0 * np.sqrt(report.variance[0]))


def test_input_is_held() -> None:
    """A missing input keeps its last value, exactly as if that had been recorded; only, the states are less certain."""
    _, spec, engine = plant("tank")
    samples = list(recorded("tank", 240))
    gaps, held = list(samples), list(samples)
    for k in range(200, 215):
        gaps[k] = replace(samples[k], u=np.array([np.nan, samples[k].u[1]]))
        held[k] = replace(samples[k], u=np.array([samples[199].u[0], samples[k].u[1]]))
    (one, first), (two, second) = run(spec, engine, gaps), run(spec, engine, held)
    assert set(differing(one, two)) & {"held", "since_step", "change"} == set()
    assert same_reports(first[:200], second[:200])
    unsure, sure = (np.array([item.variance for item in found[201:216]]) for found in (first, second))
    assert np.all(unsure > sure)
    calm = replace(samples[0], u=np.array([50.0, 20.0]))
    still = [replace(item, u=calm.u) for item in samples]
    missing = [*still[:200], *(replace(item, u=np.array([np.nan, 20.0])) for item in still[200:215]), *still[215:]]
    never, moved = run(spec, engine, missing), run(spec, engine, still)
    assert same_reports(never[1], moved[1])  # an input that never moved is not expected to


def test_input_acts_from_its_row_on() -> None:
    """The engine predicts with the input of the row before, and reads with that of the row."""
    _, spec, engine = plant("tank")
    place = spec.sample_fields
    samples = recorded("tank", 60)
    state = init(spec)
    for k, sample in enumerate(samples):
        state, _ = step(spec, engine, state, sample)
        packed = packed_of(state)[0]
        assert np.array_equal(packed[place["u"]], sample.u)
        assert np.array_equal(packed[place["u_before"]], samples[max(k - 1, 0)].u)
        assert packed[place["dt"]] == (0.0 if k == 0 else 1.0)


def test_nothing_raises_on_data() -> None:
    """Samples full of holes and wild numbers never raise, and the healthy filter finds its way back."""
    _, spec, engine = plant("dc_motor_current")
    generator = np.random.default_rng(0)
    samples = []
    for sample in recorded("dc_motor_current", 300):
        u, y = sample.u.copy(), sample.y.copy()
        if generator.random() < 0.4:
            u[:] = generator.choice([np.nan, np.inf, -np.inf])
        for k in range(2):
            if generator.random() < 0.4:
                y[k] = generator.choice([np.nan, np.inf, -np.inf])
        samples.append(replace(sample, u=u, y=y))
    state, reports = run(spec, engine, samples)
    assert np.all(np.isfinite(state.healthy.lane))
    assert reports[-1].status is Status.WATCHING
    assert state.clock.alarm < 0
    wild = [replace(item, y=np.full(2, 1e100)) for item in samples[100:103]]
    state, _ = run(spec, engine, [*samples, *wild, *recorded("dc_motor_current", 300)[:100]])
    assert np.all(np.isfinite(state.healthy.lane))


def test_waits_for_every_input() -> None:
    """Until each input has had a value the monitor waits; then it gathers samples, and numbers go on from there."""
    _, spec, engine = plant("tank")
    samples = list(recorded("tank", 60))
    nothing = np.nan
    for k in range(10):
        samples[k] = replace(samples[k], u=np.array([samples[k].u[0] if k > 5 else nothing, nothing]))
    state, reports = run(spec, engine, samples)
    assert [r.status for r in reports[:10]] == [Status.WAITING] * 10
    assert [r.status for r in reports[10:29]] == [Status.STARTING] * 19
    assert {r.status for r in reports[29:]} == {Status.WARMING}
    assert state.clock.begun == 10
    assert state.clock.index == 60
    for report in reports[:29]:
        assert np.all(np.isnan(report.expected))
    late, _ = run(spec, engine, recorded("tank", 60)[10:])
    assert np.array_equal(state.healthy.lane, late.healthy.lane)


@pytest.mark.parametrize(("pressures", "solved", "begun"), [(260, 250, 231), (101, 250, 100), (0, 299, 280)])
def test_of_a_long_wait_for_a_sensor_the_newest_samples_count(pressures: int, solved: int, begun: int) -> None:
    """The start is solved from the newest samples that show each sensor seen; one never seen is given up."""
    _, spec, engine = plant("tank")
    samples = list(recorded("tank", 320))
    for k, sample in enumerate(samples):
        samples[k] = replace(sample, y=np.where([k >= 250, k < pressures], sample.y, np.nan))
    state, reports = run(spec, engine, samples)
    assert [report.status for report in reports].index(Status.WARMING) == solved
    assert state.clock.begun == begun


def test_no_alarm_while_warming_up() -> None:
    """Whatever the first samples hold, no alarm is raised before the warm-up is over; the sums stand at zero."""
    _, spec, engine = plant("dc_motor_current")
    warm = 60
    spec = replace(spec, thresholds=replace(spec.thresholds, warm_up_samples=warm))
    samples = [replace(s, y=s.y + (5.0 if k > 30 else 0.0)) for k, s in enumerate(recorded("dc_motor_current", 120))]
    _, reports = run(spec, engine, samples)
    assert all(report.detection is None for report in reports[:warm])
    assert {report.status for report in reports[START_SAMPLES:warm]} == {Status.WARMING}
    assert all(np.all(report.cusum == 0.0) for report in reports[START_SAMPLES:warm])
    assert reports[warm].status in (Status.WATCHING, Status.DIAGNOSING)


def test_no_false_alarm_on_healthy_data() -> None:
    """A healthy plant raises no alarm and gets no diagnosis."""
    for name in ("tank", "dc_motor_current", "rlc", "rc"):
        _, spec, engine = plant(name)
        state, reports = run(spec, engine, recorded(name, 500))
        assert state.clock.alarm < 0
        assert finish(spec, state) is None
        assert all(r.detection is None and r.diagnosis is None for r in reports)


def page(spec: EngineSpec, before: FloatArray, innovations: FloatArray, packed: FloatArray) -> FloatArray:
    """Two-sided CUSUM by hand."""
    settings, place, n = spec.thresholds, spec.sample_fields, len(spec.outputs)
    after = before.copy()
    for j in range(n):
        if packed[place["use"]][j] == 0.0 or packed[place["scale"]][j] > 1.0:
            continue
        score = float(innovations[j] / innovations[n + j] ** 0.5)
        score = max(-settings.cusum_clip, min(settings.cusum_clip, score))
        after[0, j] = max(0.0, before[0, j] + score - settings.cusum_drift)
        after[1, j] = max(0.0, before[1, j] - score - settings.cusum_drift)
    return after


@pytest.mark.parametrize(("name", "rows", "fault"), FAULTY)
def test_cusum_is_that_of_page(name: str, rows: int, fault: Fault) -> None:
    """The statistics are two one-sided sums of clipped innovations, held while a value is missing or settling."""
    _, spec, engine = plant(name)
    generator = np.random.default_rng(9)
    state, cusum, held = init(spec), np.zeros((2, len(spec.outputs))), 0
    for sample in recorded(name, rows, fault):
        y = np.where(generator.random(sample.y.size) < 0.1, np.nan, sample.y)
        before = state.healthy.lane
        state, report = step(spec, engine, state, replace(sample, y=y))
        if report.status in (Status.WATCHING, Status.DIAGNOSING):
            packed = packed_of(state)
            _, innovations = engine.advance(before, packed)
            held += int(np.sum(packed[0, spec.sample_fields["scale"]] > 1.0))
            cusum = page(spec, cusum, innovations[0, :, 0], packed[0])
            assert state.sensors.cusum == pytest.approx(cusum, rel=1e-12, abs=1e-12)
            assert report.cusum == pytest.approx(cusum.max(axis=0), rel=1e-12, abs=1e-12)
            assert (state.sensors.cusum.max() > spec.thresholds.cusum_limit) <= (state.clock.alarm >= 0)
    assert state.clock.alarm >= 0
    assert held > 0 or name != "tank"


def test_onset_is_the_last_zero_of_the_sum() -> None:
    """Each side of each sum remembers the last sample at which it was zero; the leading one dates the change."""
    _, spec, engine = plant("dc_motor_current")
    state, zeros = init(spec), np.zeros((2, 2))
    for k, sample in enumerate(recorded("dc_motor_current", 180, MOTOR_FAULT)):
        state, report = step(spec, engine, state, sample)
        if report.status in (Status.WATCHING, Status.DIAGNOSING):
            zeros[state.sensors.cusum == 0.0] = k
            grown = state.sensors.cusum > 0.0
            assert np.array_equal(state.sensors.cusum_start[grown & (zeros > 0)], zeros[grown & (zeros > 0)])
        if report.detection is not None:
            side, sensor = np.unravel_index(np.argmax(state.sensors.cusum), state.sensors.cusum.shape)
            assert report.detection.change_time == pytest.approx(0.02 * zeros[side, sensor])
            assert report.detection.change_time == pytest.approx(2.4, abs=0.3)
            assert spec.outputs[sensor].name in report.detection.signals
            assert report.detection.sample == k == state.clock.alarm
            assert report.detection.time == sample.time


@dataclass(frozen=True)
class Disturbed:
    """An engine whose innovations are set from outside; the lanes go on as they are."""

    innovations: FloatArray

    @property
    def title(self) -> str:
        """What it is."""
        return "disturbed"

    @property
    def slot(self) -> "Disturbed":
        """The same: lanes of any length go on as they are."""
        return self

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Leave the lanes."""
        shape = (len(samples), len(self.innovations), lanes.shape[1])
        return lanes.copy(), np.broadcast_to(self.innovations[None, :, None], shape).copy()


def test_sum_that_grows_from_its_first_sample_begins_there() -> None:
    """A sum that never returns to zero after the warm-up dates the change at the end of the warm-up, not before."""
    _, spec, engine = plant("dc_motor_current")
    state, _ = run(spec, engine, recorded("dc_motor_current", 50))
    state = changed(state, begun=20, cusum=np.zeros((2, 2)), cusum_start=np.zeros((2, 2)), index=40)
    engine = Disturbed(np.array([1.0, 0.0, 1.0, 1.0]))
    sample = recorded("dc_motor_current", 50)[49]
    for k in range(3):
        state, _ = step(spec, engine, state, sample)
        assert state.sensors.cusum[0, 0] == pytest.approx(0.7 * (k + 1))
    assert state.sensors.cusum_start[0, 0] == 39.0


def test_slow_error_beyond_its_size_alarms() -> None:
    """A relative slow error alarms beyond 1.6 of its declared sd, if it may, once watched for as long as its memory."""
    _, long, engine = plant("tank")
    spec, young = (
        replace(long, slow_errors=tuple(replace(error, memory=memory) for error in long.slow_errors))
        for memory in (150.0, 201.0)
    )
    healthy, _ = run(long, engine, recorded("tank", 200))
    assert healthy.clock.alarm < 0
    sample = recorded("tank", 201)[200]
    still = Disturbed(np.array([0.0, 0.0, 1.0, 1.0]))
    assert [error.alarms for error in spec.slow_errors] == [True, True]
    quiet = replace(spec, slow_errors=tuple(replace(error, alarms=False) for error in spec.slow_errors))
    for ratio, expected in ((1.59, False), (1.61, True), (-1.61, True), (-1.59, False)):
        lane = healthy.healthy.lane.copy()
        lane[spec.slow_slice, 0] = [0.0, ratio * spec.slow_errors[1].sd]
        _, report = step(spec, still, changed(healthy, lane=lane), sample)
        assert (report.detection is not None) == expected
        assert report.slow == pytest.approx([0.0, ratio])
        assert step(quiet, still, changed(healthy, lane=lane), sample)[1].detection is None
        assert step(young, still, changed(healthy, lane=lane), sample)[1].detection is None
        early = changed(healthy, lane=lane, begun=healthy.clock.index - 1)
        assert step(spec, still, early, sample)[1].detection is None


@pytest.mark.parametrize(("name", "rows", "fault"), FAULTY)
def test_one_alarm_and_regular_diagnoses(name: str, rows: int, fault: Fault) -> None:
    """One detection is raised, with the first diagnosis, then one at least every 60 samples, and one at the end."""
    _, spec, engine = plant(name)
    state, reports = run(spec, engine, recorded(name, rows + 100, fault))
    detections = [k for k, report in enumerate(reports) if report.detection is not None]
    assert detections == [state.clock.alarm]
    diagnoses = [k for k, report in enumerate(reports) if report.diagnosis is not None]
    assert diagnoses[0] == state.clock.alarm
    assert np.max(np.diff([*diagnoses, len(reports)])) <= 60
    last = finish(spec, state)
    assert last is not None
    assert last.time == state.clock.time
    assert sum(item.probability for item in last.candidates) == pytest.approx(1.0)


def settling_pattern(changed: int) -> tuple[EngineSpec, list[FloatArray]]:
    """Factors on the variances of flow and pressure while one input of the tank steps up by 20 %."""
    _, spec, engine = plant("tank")
    (first, *_) = recorded("tank", 60)
    u = first.u.copy()
    state, found = init(spec), []
    for k in range(60):
        if k == 30:
            u = u.copy()
            u[changed] += 20.0
        state, _ = step(spec, engine, state, replace(first, time=float(k), dt=1.0, u=u))
        found.append(packed_of(state)[0, spec.sample_fields["scale"]].copy())
    return spec, found


def test_direct_output_is_blanked_after_a_step() -> None:
    """After a step of the inlet valve the flow hardly counts for its settling time of 12 s; the pressure still does."""
    spec, found = settling_pattern(0)
    blank = spec.thresholds.blank_factor
    flow, pressure = np.array(found).T
    assert np.array_equal(np.flatnonzero(flow == blank), np.arange(30, 42))
    assert set(np.unique(flow)) == {1.0, blank}
    assert set(np.unique(pressure)) == {1.0}


def test_other_inputs_blank_nothing() -> None:
    """A step of the outlet, which reaches no sensor directly, leaves both sensors as they are."""
    _, found = settling_pattern(1)
    assert np.all(np.array(found) == 1.0)


def test_change_of_an_input_kicks_the_slow_error_that_follows_it() -> None:
    """A step by D adds, over a while, the variance (each * D)^2 to a slow error that follows the input, once."""
    _, spec, engine = plant("tank")
    error = replace(spec.slow_errors[0], after=((0, 0.001),))
    spec = replace(spec, slow_errors=(error, spec.slow_errors[1]))
    (first, *_) = recorded("tank", 60)
    state, kicks = init(spec), []
    for k in range(260):
        u = first.u + np.array([10.0 if k >= 30 else 0.0, 0.0])
        state, _ = step(spec, engine, state, replace(first, time=float(k), dt=1.0, u=u))
        kicks.append(packed_of(state)[0, spec.sample_fields["kick"]].copy())
    total = np.sum(kicks, axis=0)
    assert not np.any(kicks[:30])
    assert total[1] == 0.0
    assert total[0] == pytest.approx((0.001 * 10.0) ** 2, rel=1e-6)


@dataclass(frozen=True)
class Lossy:
    """An engine that loses its numbers where an output is 13."""

    inner: Engine
    spec: EngineSpec

    @property
    def title(self) -> str:
        """What it is."""
        return "lossy"

    @property
    def slot(self) -> Engine:
        """Lanes with a slot are not lost."""
        return self.inner.slot

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Run the inner engine, and lose everything now and then."""
        following, innovations = self.inner.advance(lanes, samples)
        return following * (np.nan if np.any(samples[:, self.spec.sample_fields["y"]] == 13.0) else 1.0), innovations


def test_lost_filter_starts_anew() -> None:
    """A healthy filter that has lost its numbers says so, and begins again with the samples that follow."""
    _, spec, engine = plant("dc_motor_current")
    samples = list(recorded("dc_motor_current", 200))
    samples[120] = replace(samples[120], y=np.array([13.0, 0.0]))
    state, reports = run(spec, Lossy(engine, spec), samples)
    assert reports[120].status is Status.LOST
    assert [report.status for report in reports[121 : 121 + START_SAMPLES - 1]] == [Status.STARTING] * 19
    assert np.all(np.isfinite(state.healthy.lane))
    assert reports[-1].status is Status.WATCHING
    assert state.clock.alarm < 0
    assert state.clock.begun == 121


def test_expected_is_what_the_model_says() -> None:
    """A report's expectation and variance are those of the filter, whether or not the value is there or settling."""
    _, spec, engine = plant("tank")
    samples = recorded("tank", 120)
    state, _ = run(spec, engine, samples[:100])
    present, there = step(spec, engine, state, samples[100])
    missing = replace(samples[100], y=np.full(2, np.nan))
    _, gone = step(spec, engine, state, missing)
    packed = packed_of(present)
    _, innovations = engine.advance(state.healthy.lane, packed)
    assert there.expected == pytest.approx(samples[100].y - innovations[0, :2, 0], rel=1e-12)
    assert gone.expected == pytest.approx(there.expected, rel=1e-9)
    assert gone.variance == pytest.approx(there.variance, rel=1e-9)
    moved = replace(samples[100], u=samples[100].u + np.array([-20.0, 0.0]))
    plain = replace(spec, thresholds=replace(spec.thresholds, blank_factor=1.0))
    blanked, open_ = (step(item, engine, state, moved)[1] for item in (spec, plain))
    assert blanked.expected == pytest.approx(open_.expected, rel=1e-9)
    assert blanked.variance == pytest.approx(open_.variance, rel=1e-9)


def test_fast_sum_alarms_where_it_has_a_limit() -> None:
    """With a limit of 8 five samples of 3 sd raise the alarm, four do not; without one it takes ten."""
    _, spec, engine = plant("dc_motor_current")
    healthy, _ = run(spec, engine, recorded("dc_motor_current", 50))
    calm = changed(healthy, cusum=np.zeros((2, 2)), fast=np.zeros((2, 2)))
    wild = Disturbed(np.array([3.0, 0.0, 1.0, 1.0]))
    promised = replace(spec, thresholds=replace(spec.thresholds, fast_limit=8.0))
    sample = recorded("dc_motor_current", 50)[49]
    for chosen, needed in ((promised, 5), (spec, 10)):
        state, count = calm, 0
        while state.clock.alarm < 0:
            state, report = step(chosen, wild, state, sample)
            count += 1
            assert (report.cusum[0] > spec.thresholds.cusum_limit) == (state.clock.alarm >= 0)
        assert count == needed
