"""The monitor sample by sample: blind to what is missing, and alarmed as it should be."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.samples import Report, Status
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from made import differing, packed, plant, recorded, run, stepped, with_thresholds

START_SAMPLES = int(core_settings()["START_SAMPLES"])

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


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_missing_output_is_not_used(bad: float) -> None:
    """A value that is no number leaves the filter as a switched-off one does, and its CUSUM as it was."""
    _, spec, core = plant("dc_motor_current")
    samples = recorded("dc_motor_current", 100)
    before, _ = run(core, samples[:80])
    y = samples[80].y.copy()
    y[0] = bad
    after, report = stepped(before, replace(samples[80], y=y))
    blind = packed(stepped(before, samples[80])[0])
    blind[:, spec.sample_fields["use"]] = [0.0, 1.0]
    blind[:, spec.sample_fields["y"]][:, 0] = 77.0
    expected, _ = core.advance(before.numbers("healthy.lane")[:, None], blind)
    assert after.numbers("healthy.lane") == pytest.approx(expected[:, 0], rel=1e-9, abs=1e-13)  # fused products
    assert np.array_equal(after.numbers("sensors.cusum")[::2], before.numbers("sensors.cusum")[::2])
    assert np.all(np.isfinite(report.expected))
    assert report.expected[0] == pytest.approx(samples[80].y[0], abs=6.0 * np.sqrt(report.variance[0]))


def test_input_is_held() -> None:
    """A missing input keeps its last value, exactly as if that had been recorded; only, the states are less certain."""
    core = plant("tank")[2]
    samples = list(recorded("tank", 240))
    gaps, held = list(samples), list(samples)
    for k in range(200, 215):
        gaps[k] = replace(samples[k], u=np.array([np.nan, samples[k].u[1]]))
        held[k] = replace(samples[k], u=np.array([samples[199].u[0], samples[k].u[1]]))
    (one, first), (two, second) = run(core, gaps), run(core, held)
    assert set(differing(one, two)) & {"inputs.held", "inputs.since_step", "inputs.change"} == set()
    assert same_reports(first[:200], second[:200])
    unsure, sure = (np.array([item.variance for item in found[201:216]]) for found in (first, second))
    assert np.all(unsure > sure)
    calm = replace(samples[0], u=np.array([50.0, 20.0]))
    still = [replace(item, u=calm.u) for item in samples]
    missing = [*still[:200], *(replace(item, u=np.array([np.nan, 20.0])) for item in still[200:215]), *still[215:]]
    never, moved = run(core, missing), run(core, still)
    assert same_reports(never[1], moved[1])  # an input that never moved is not expected to


def test_input_acts_from_its_row_on() -> None:
    """The engine predicts with the input of the row before, and reads with that of the row."""
    _, spec, core = plant("tank")
    place = spec.sample_fields
    samples = recorded("tank", 60)
    monitor = Monitor(core)
    for k, sample in enumerate(samples):
        monitor.step(sample)
        row = packed(monitor)[0]
        assert np.array_equal(row[place["u"]], sample.u)
        assert np.array_equal(row[place["u_before"]], samples[max(k - 1, 0)].u)
        assert row[place["dt"]] == (0.0 if k == 0 else 1.0)


def test_nothing_raises_on_data() -> None:
    """Samples full of holes and wild numbers never raise, and the healthy filter finds its way back."""
    core = plant("dc_motor_current")[2]
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
    monitor, reports = run(core, samples)
    assert np.all(np.isfinite(monitor.numbers("healthy.lane")))
    assert reports[-1].status is Status.WATCHING
    assert monitor.number("clock.alarm") < 0
    wild = [replace(item, y=np.full(2, 1e100)) for item in samples[100:103]]
    monitor, _ = run(core, [*samples, *wild, *recorded("dc_motor_current", 300)[:100]])
    assert np.all(np.isfinite(monitor.numbers("healthy.lane")))


def test_waits_for_every_input() -> None:
    """Until each input has had a value the monitor waits; then it gathers samples, and numbers go on from there."""
    core = plant("tank")[2]
    samples = list(recorded("tank", 60))
    nothing = np.nan
    for k in range(10):
        samples[k] = replace(samples[k], u=np.array([samples[k].u[0] if k > 5 else nothing, nothing]))
    monitor, reports = run(core, samples)
    assert [r.status for r in reports[:10]] == [Status.WAITING] * 10
    assert [r.status for r in reports[10:29]] == [Status.STARTING] * 19
    assert {r.status for r in reports[29:]} == {Status.WARMING}
    assert monitor.number("clock.begun") == 10
    assert monitor.number("clock.index") == 60
    for report in reports[:29]:
        assert np.all(np.isnan(report.expected))
    late, _ = run(core, recorded("tank", 60)[10:])
    assert np.array_equal(monitor.numbers("healthy.lane"), late.numbers("healthy.lane"))


@pytest.mark.parametrize(("pressures", "solved", "begun"), [(260, 250, 231), (101, 250, 100), (0, 299, 280)])
def test_of_a_long_wait_for_a_sensor_the_newest_samples_count(pressures: int, solved: int, begun: int) -> None:
    """The start is solved from the newest samples that show each sensor seen; one never seen is given up."""
    core = plant("tank")[2]
    samples = list(recorded("tank", 320))
    for k, sample in enumerate(samples):
        samples[k] = replace(sample, y=np.where([k >= 250, k < pressures], sample.y, np.nan))
    monitor, reports = run(core, samples)
    assert [report.status for report in reports].index(Status.WARMING) == solved
    assert monitor.number("clock.begun") == begun


def test_no_alarm_while_warming_up() -> None:
    """Whatever the first samples hold, no alarm is raised before the warm-up is over; the sums stand at zero."""
    warm = 60
    core = with_thresholds("rc", warm_up_samples=warm)
    samples = [replace(s, y=s.y + (5.0 if k > 30 else 0.0)) for k, s in enumerate(recorded("rc", 120))]
    _, reports = run(core, samples)
    assert all(report.detection is None for report in reports[:warm])
    assert {report.status for report in reports[START_SAMPLES:warm]} == {Status.WARMING}
    assert all(np.all(report.cusum == 0.0) for report in reports[START_SAMPLES:warm])
    assert reports[warm].status in (Status.WATCHING, Status.DIAGNOSING)


def test_no_false_alarm_on_healthy_data() -> None:
    """A healthy plant raises no alarm and gets no diagnosis."""
    for name in ("tank", "dc_motor_current", "rlc", "rc"):
        core = plant(name)[2]
        monitor, reports = run(core, recorded(name, 500))
        assert monitor.number("clock.alarm") < 0
        assert monitor.finish() is None
        assert all(r.detection is None and r.diagnosis is None for r in reports)


def page(spec: EngineSpec, before: FloatArray, innovations: FloatArray, row: FloatArray) -> FloatArray:
    """Two-sided CUSUM by hand."""
    settings, place, n = spec.thresholds, spec.sample_fields, len(spec.outputs)
    after = before.copy()
    for j in range(n):
        if row[place["use"]][j] == 0.0 or row[place["scale"]][j] > 1.0:
            continue
        score = float(innovations[j] / innovations[n + j] ** 0.5)
        score = max(-settings.cusum_clip, min(settings.cusum_clip, score))
        after[0, j] = max(0.0, before[0, j] + score - settings.cusum_drift)
        after[1, j] = max(0.0, before[1, j] - score - settings.cusum_drift)
    return after


@pytest.mark.parametrize(("name", "rows", "fault"), FAULTY)
def test_cusum_is_that_of_page(name: str, rows: int, fault: Fault) -> None:
    """The statistics are two one-sided sums of clipped innovations, held while a value is missing or settling."""
    _, spec, core = plant(name)
    generator = np.random.default_rng(9)
    monitor, cusum, held = Monitor(core), np.zeros((2, len(spec.outputs))), 0
    for sample in recorded(name, rows, fault):
        y = np.where(generator.random(sample.y.size) < 0.1, np.nan, sample.y)
        before = monitor.numbers("healthy.lane")[:, None]
        report = monitor.step(replace(sample, y=y))
        if report.status in (Status.WATCHING, Status.DIAGNOSING):
            row = packed(monitor)
            _, innovations = core.advance(before, row)
            held += int(np.sum(row[0, spec.sample_fields["scale"]] > 1.0))
            cusum = page(spec, cusum, innovations[0, :, 0], row[0])
            assert monitor.numbers("sensors.cusum") == pytest.approx(cusum.ravel(), rel=1e-12, abs=1e-12)
            assert report.cusum == pytest.approx(cusum.max(axis=0), rel=1e-12, abs=1e-12)
            assert (cusum.max() > spec.thresholds.cusum_limit) <= (monitor.number("clock.alarm") >= 0)
    assert monitor.number("clock.alarm") >= 0
    assert held > 0 or name != "tank"


def test_onset_is_the_last_zero_of_the_sum() -> None:
    """Each side of each sum remembers the last sample at which it was zero; the leading one dates the change."""
    _, spec, core = plant("dc_motor_current")
    monitor, zeros = Monitor(core), np.zeros((2, 2))
    for k, sample in enumerate(recorded("dc_motor_current", 180, MOTOR_FAULT)):
        report = monitor.step(sample)
        cusum, began = (monitor.numbers(f"sensors.{name}").reshape(2, 2) for name in ("cusum", "cusum_start"))
        if report.status in (Status.WATCHING, Status.DIAGNOSING):
            zeros[cusum == 0.0] = k
            grown = cusum > 0.0
            assert np.array_equal(began[grown & (zeros > 0)], zeros[grown & (zeros > 0)])
        if report.detection is not None:
            side, sensor = np.unravel_index(np.argmax(cusum), cusum.shape)
            assert report.detection.change_time == pytest.approx(0.02 * zeros[side, sensor])
            assert report.detection.change_time == pytest.approx(2.4, abs=0.3)
            assert spec.outputs[sensor].name in report.detection.signals
            assert report.detection.sample == k == monitor.number("clock.alarm")
            assert report.detection.time == sample.time


@pytest.mark.parametrize(("name", "rows", "fault"), FAULTY)
def test_one_alarm_and_regular_diagnoses(name: str, rows: int, fault: Fault) -> None:
    """One detection is raised, soon the first diagnosis, then one at least every 60 samples, and one at the end."""
    core = plant(name)[2]
    monitor, reports = run(core, recorded(name, rows + 100, fault))
    detections = [k for k, report in enumerate(reports) if report.detection is not None]
    assert detections == [monitor.number("clock.alarm")]
    diagnoses = [k for k, report in enumerate(reports) if report.diagnosis is not None]
    assert 0 <= diagnoses[0] - detections[0] <= core_settings()["AWAITED"] / 3.0  # their onsets are plain
    assert np.max(np.diff([*diagnoses, len(reports)])) <= 60
    last = monitor.finish()
    assert last is not None
    assert last.time == monitor.number("clock.time")
    assert sum(item.probability for item in last.candidates) == pytest.approx(1.0)


@pytest.mark.parametrize(("name", "rows", "fault"), FAULTY)
def test_where_alarms_alone_are_asked_for_no_lane_begins(name: str, rows: int, fault: Fault) -> None:
    """Up to the alarm all is the same to the last bit; of the bank nothing is touched, then or later."""
    core, samples = plant(name)[2], recorded(name, rows, fault)
    _, all_reports = run(core, samples)
    alarm = next(k for k, report in enumerate(all_reports) if report.detection is not None)
    monitor, reports = run(core, samples, Monitor(core, only_alarms=True))
    assert same_reports(reports[: alarm + 1], all_reports[: alarm + 1])
    assert reports[alarm].detection is not None
    assert all(report.diagnosis is None for report in reports)
    bank = [field for field in core.fields if field.startswith(("bank.", "job."))]
    assert bank
    assert not set(bank) & set(differing(monitor, run(core, samples[:alarm])[0]))


def test_expected_is_what_the_model_says() -> None:
    """A report's expectation and variance are those of the filter, whether or not the value is there or settling."""
    _, spec, core = plant("tank")
    samples = recorded("tank", 120)
    monitor, _ = run(core, samples[:100])
    present, there = stepped(monitor, samples[100])
    _, gone = stepped(monitor, replace(samples[100], y=np.full(2, np.nan)))
    _, innovations = core.advance(monitor.numbers("healthy.lane")[:, None], packed(present))
    assert there.expected == pytest.approx(samples[100].y - innovations[0, :2, 0], rel=1e-12)
    assert gone.expected == pytest.approx(there.expected, rel=1e-9)
    assert gone.variance == pytest.approx(there.variance, rel=1e-9)
    after, blanked = stepped(monitor, replace(samples[100], u=samples[100].u + np.array([-20.0, 0.0])))
    row, scale = packed(after), spec.sample_fields["scale"]
    assert row[0, scale].tolist() == [spec.thresholds.blank_factor, 1.0]
    row[0, scale] = 1.0
    _, innovations = core.advance(monitor.numbers("healthy.lane")[:, None], row)
    assert blanked.expected == pytest.approx(samples[100].y - innovations[0, :2, 0], rel=1e-9)
    assert blanked.variance == pytest.approx(innovations[0, 2:, 0], rel=1e-9)
