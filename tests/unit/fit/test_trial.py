"""The detector along a recording in one call, and how often it would alarm."""

from dataclasses import replace
from math import erf, log

import numpy as np
import pytest

from bare_core import CELL
from faultbond.app.likelihood import likelihood_engine
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.contract.spec import EngineSpec, Thresholds
from faultbond.equations.plant import build_plant
from faultbond.fit.certainty import long_run_variance
from faultbond.fit.cusum import LAGS, added, no_sums
from faultbond.fit.false_alarms import FARTHEST, HIGHEST, Rate, alarm_rates, climb_time, cusum_time, scatter_time
from faultbond.fit.innovations import LOST, Variant, Watch, take_recording, watch_recording, watch_taken
from faultbond.fit.objective import ways_of
from faultbond.fit.response import A_LITTLE
from faultbond.fit.samples import healthy_recording
from faultbond.fit.session import build_fit, free_parameters
from faultbond.fit.trial import on_trial
from faultbond.io.examples import example
from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.text import load_model, parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.engine import build_core, build_engine, build_model
from made import run


@pytest.mark.parametrize("lost", [{}, {"gap": slice(400, 480)}, {"input": slice(400, 440)}, {"wild": slice(400, 401)}])
def test_it_sees_what_the_monitor_sees(lost: dict[str, slice]) -> None:
    """Sums and slow errors of the tank, with inputs that settle, are those of the monitor sample by sample.

    Of all sums: a sensor scatters for a while, and a promise makes the fast sums count. Also after a gap, while an
    input is missing, and where a reading lies far off all others.
    """
    graph = load_model(example("tank") / "model.yaml")
    built, _ = build_engine(graph)
    spec = replace(built, thresholds=replace(built.thresholds, fast_limit=12.0, cusum_limit=60.0))
    core = build_core(build_plant(graph), spec)
    rows = list(read_rows(example("tank") / "healthy.csv", columns_of(graph)))[:700]
    points = [
        Sample(time=item.time, dt=item.dt, u=item.u, y=item.y if item.index % 97 else np.full(2, np.nan))
        for item in on_grid(rows, Grid(spec.sample_time))
    ]
    noise = np.random.default_rng(4).standard_normal((40, 2)) * 3.0 * spec.output_noise
    points[300:340] = [replace(item, y=item.y + off) for item, off in zip(points[300:340], noise, strict=True)]
    for what, place in lost.items():
        for k in range(place.start, place.stop):
            u = points[k].u if what == "wild" else np.full(2, np.nan)
            y = {"gap": np.full(2, np.nan), "wild": np.array([1e6, 1e9])}.get(what, points[k].y)
            points[k] = replace(points[k], u=u, y=y)
    hardly_else = Variant(noise=1.0 + 1e-12)  # that is watched without the monitor
    seen = watch_recording(core, healthy_recording("tank", points, core), (hardly_else,))[0]
    monitor = Monitor(core, quiet=True)  # while a fault is sought states go less far in a gap
    for k, point in enumerate(points):
        report = monitor.step(point)
        if k > spec.thresholds.warm_up_samples:
            assert report.cusum == pytest.approx(seen.height[k], rel=1e-6, abs=1e-6)
            assert report.slow == pytest.approx(seen.slow[k], rel=1e-6, abs=1e-9)
    assert (seen.climbs[2].max(axis=0) > 1.2 * seen.climbs[:2].max(axis=(0, 1))).all()


def jumping(to: float, noise: str, silent: range = range(0)) -> tuple[Core, list[Sample]]:
    """A cell whose voltage goes far for the first time at sample 100; while `silent` no sensor reads."""
    graph, step = parse_model(CELL.replace("noise: 10 mV", f"noise: {noise}")), 0.5
    voltage = np.r_[np.repeat([2.0, 1.0] * 5, 10), np.full(60, to)]
    time = np.asarray(np.arange(len(voltage)) * step, dtype=np.float64)
    inputs = Inputs(time=time, values=np.stack([voltage, np.full_like(voltage, 0.1)], axis=1))
    made = simulate(graph, inputs, seed=3, start={"cell.q": 1.0})
    return build_engine(graph)[1], [
        Sample(time=step * k, dt=step, u=u, y=np.full(2, np.nan) if k in silent else y)
        for k, (u, y) in enumerate(zip(inputs.values, made.outputs, strict=True))
    ]


def test_a_filter_that_has_lost_its_variance_is_far_off_and_no_error(monkeypatch: pytest.MonkeyPatch) -> None:
    """An absurd model has to be told from a quiet one; a root of what is below zero would end the search."""
    core = build_engine(parse_model(CELL))[1]
    rng, n = np.random.default_rng(1), 80
    points = [
        Sample(time=0.5 * k, dt=0.5, u=np.array([2.0, 0.1]), y=np.array([0.1, 1.0]) + 0.01 * rng.standard_normal(2))
        for k in range(n)
    ]
    follow = Core.course

    def course(core: Core, lane: FloatArray, rows: FloatArray, *place: slice) -> tuple[FloatArray, ...]:
        end, numbers, told = follow(core, lane, rows, *place)
        told[40:, 2:] = -1.0
        return end, numbers, told

    monkeypatch.setattr(Core, "course", course)
    recording = healthy_recording("a.csv", points, core)
    seen = watch_recording(core, recording)[0]
    assert np.all(seen.scores[45:] == LOST)
    assert np.all(np.abs(seen.scores[20:35]) < 1e3)
    found = on_trial(core, [recording], 1e6, factors=())
    assert found.lost == (("a.csv", 0.5 * np.flatnonzero(seen.scores[:, 0] == LOST)[0]),)
    assert all(abs(item.mean) < 1e3 for item in found.regions)  # nothing where it is lost tells where the model is off


def test_it_sees_what_an_input_was_while_the_monitor_waited() -> None:
    """An input that goes far for the first time is believed once readings tell; filters beside know it from then on."""
    core, points = jumping(300.0, "10 mV", range(100, 108))
    seen = watch_recording(core, healthy_recording("cell", points, core), (Variant(noise=1.0 + 1e-12),))[0]
    monitor = Monitor(core, quiet=True)
    for k, point in enumerate(points):
        report = monitor.step(point)
        judged = np.isfinite(seen.scores[k])
        assert judged[1] == (k >= 20 and not 100 <= k < 108)
        if k > 108:
            score = (point.y - report.expected) / np.sqrt(report.variance)
            assert seen.scores[k, judged] == pytest.approx(score[judged], rel=1e-6, abs=1e-6)


def test_recordings_side_by_side_are_seen_as_each_alone() -> None:
    """Of other lengths, one with a gap after which the scatter is compared with nothing before it."""
    core, points = jumping(300.0, "10 mV", range(100, 108))
    gap = [replace(item, u=np.full(2, np.nan), y=np.full(2, np.nan)) for item in points[60:75]]
    read = (points, points[:50], [*points[:60], *gap, *points[75:140]])
    taken = [take_recording(core, healthy_recording(str(k), item, core)) for k, item in enumerate(read)]
    assert taken[2].astray.any()
    variants = Variant(), Variant(noise=0.5)
    for one, together in zip(taken, watch_taken(core, taken, variants), strict=True):
        for alone, beside in zip(watch_taken(core, (one,), variants)[0], together, strict=True):
            for name in ("scores", "climbs", "height", "slow", "alone", "ways"):
                assert np.array_equal(getattr(alone, name), getattr(beside, name), equal_nan=True), name


ROOM = """
name: room
sample_time: 10 s
inputs: {power: {unit: W}, outside: {unit: K}}
components:
  heater: {type: Sf, law: f = power}
  room: {type: C, law: q = C*e, parameters: {C: 60 kJ/K}, start: {q: 18 MJ, sd: 1 MJ}}
  wall: {type: R, law: f = K*e, parameters: {K: 100 W/K}}
  ambient: {type: Se, law: e = outside}
junctions: {inside: 0, through: 1}
bonds: [heater -> inside -> room, inside -> through -> wall, through -> ambient]
sensors: {T: {reads: inside.e, unit: K, noise: 0.05 K}}
"""


def test_the_way_of_an_input_is_the_plants_own_whatever_drives_it() -> None:
    """A heater that is driven against the weather still warms, though readings rise while it falls."""
    graph, n = parse_model(ROOM), 1200
    time = np.linspace(0.0, 10.0 * (n - 1), n)
    outside = 280.0 + 10.0 * np.sin(np.arange(n) / 80.0)
    inputs = Inputs(time=time, values=np.column_stack([2000.0 - 50.0 * (outside - 280.0), outside]))
    y = simulate(graph, inputs, seed=5, start={"room.q": 18e6}).outputs
    assert np.corrcoef(y[:, 0], inputs.values[:, 0])[0, 1] < -0.5
    points = [Sample(time=t, dt=10.0, u=u, y=row) for t, u, row in zip(time.tolist(), inputs.values, y, strict=True)]
    built, core = build_model(graph), build_engine(graph)[1]
    record = healthy_recording("room", points, core)
    (seen,) = watch_recording(core, record, alone=True)
    gain = 0.9 * np.array([1.0 / 100.0, 1.0])  # on the whole, with 600 s until it is there, of 12000 s
    raised = A_LITTLE * inputs.values.max(axis=0)
    assert seen.ways[0] == pytest.approx(gain * raised, rel=0.1)
    plant, records, point = build_fit(built, likelihood_engine(built), core, [("room", points)], free_parameters(graph))
    assert ways_of(plant, records, point)[0] == pytest.approx(gain * raised, rel=0.1)


def test_as_declared_the_heights_are_those_of_the_monitor() -> None:
    """Also of the samples in which it waited to believe an input, where a filter that knows it has others."""
    core, points = jumping(12.0, "0.3 V")
    declared, hardly_else = watch_recording(
        core, healthy_recording("cell", points, core), (Variant(), Variant(noise=1.0 + 1e-12))
    )
    monitor = Monitor(core, quiet=True)
    told = np.array([monitor.step(point).cusum for point in points])
    assert declared.height == pytest.approx(np.nan_to_num(told), rel=1e-12)
    assert np.abs(declared.height - hardly_else.height)[101:110].max() > 0.1


@pytest.mark.parametrize("size", [1.6, 1.8])
def test_the_time_between_false_alarms_of_the_scatter_is_that_of_noise(size: float) -> None:
    """Of noise larger than declared the sum of its scatter alarms as often as the formula says, within a half."""
    settings, rng = Thresholds(), np.random.default_rng(6)
    scores = size * rng.standard_normal(60_000)
    told = scatter_time(settings, [scores], 1)
    sums, taken = no_sums(400), []
    last = np.zeros(400)
    for k in range(1, 40 * round(told)):
        sums = added(settings, sums, size * rng.standard_normal(400), np.array([True]))
        over = sums.scatter[0] > settings.scatter_limit
        taken += list(k - last[over])
        last[over], sums.scatter[0, over] = k, 0.0
    assert len(taken) > 1000
    assert told == pytest.approx(np.mean(taken), rel=0.5)


def test_a_burst_of_scatter_is_an_alarm_on_trial_too() -> None:
    """A recording in which a sensor scatters for a while alarms in a run; the trial says so, and how often at least."""
    graph = load_model(example("tank") / "model.yaml")
    spec, core = build_engine(graph)
    rows = list(read_rows(example("tank") / "healthy.csv", columns_of(graph)))[:1200]
    grid = on_grid(rows, Grid(spec.sample_time))
    points = [Sample(time=item.time, dt=item.dt, u=item.u, y=item.y) for item in grid]
    noise = np.random.default_rng(8).standard_normal((80, 2)) * 4.0 * spec.output_noise * [1.0, 0.0]
    points[800:880] = [replace(item, y=item.y + off) for item, off in zip(points[800:880], noise, strict=True)]
    monitor, _ = run(core, points[:900])
    assert monitor.number("clock.alarm") > 800
    flow, pressure = on_trial(core, [healthy_recording("tank", points, core)]).rates[:2]
    assert flow.peak > 1.0
    assert flow.between <= 1200.0
    assert pressure.peak < 1.0
    assert pressure.between > 1200.0


def seen_of(spec: EngineSpec, scores: FloatArray, height: FloatArray) -> Watch:
    """What the detector would have seen of scores and heights, (N, n_outputs) each."""
    nothing = np.zeros_like(scores)
    return Watch(
        scores=scores,
        climbs=np.array([nothing, nothing, nothing]),
        height=height,
        slow=np.zeros((len(scores), len(spec.slow_errors))),
        walk=0.0,
        walker=-1,
        strayed=np.zeros(len(spec.parameters)),
        alone=scores,
        ways=np.zeros((len(spec.outputs), len(spec.inputs))),
    )


def test_the_time_of_a_sensor_is_that_of_its_scatter_too() -> None:
    """Scores that only scatter, whose sums therefore stay low, alarm as often as that of the scatter."""
    built = build_engine(load_model(example("tank") / "model.yaml"))[0]
    noise = np.random.default_rng(3).standard_normal((4001, len(built.outputs)))
    scores = 1.3 * np.diff(noise, axis=0)
    rate = alarm_rates(built, [seen_of(built, scores, np.zeros_like(scores))], 2.0)[0]
    told = max(scatter_time(built.thresholds, [scores[:, 0]], lag) for lag in range(1, LAGS + 1))
    assert rate.between == pytest.approx(2.0 * told, rel=0.01)


def test_the_time_of_a_sensor_is_that_of_its_highest_climbs_too() -> None:
    """Of scores that are small but for bursts; of all recordings together."""
    built = build_engine(load_model(example("tank") / "model.yaml"))[0]
    drift, limit = built.thresholds.cusum_drift, built.thresholds.cusum_limit
    scores = np.column_stack([bursts(6000, np.random.default_rng(k)) for k in range(len(built.outputs))])
    heights = np.column_stack([climbs(item, drift) for item in scores.T])
    found = alarm_rates(built, [seen_of(built, scores[:n], heights[:n]) for n in (6000, 4000)], 2.0)
    told = [climb_time([item[:6000], item[:4000]], limit) for item in heights.T]
    assert [item.between for item in found[: len(told)]] == pytest.approx([2.0 * time for time in told])


def test_how_much_rarer_alarms_may_be_than_a_short_recording_says() -> None:
    """Of white noise as declared nearly always so much, of noise a third larger hardly ever: it is too much."""
    built = build_engine(load_model(example("tank") / "model.yaml"))[0]

    def rate(size: float, count: int, seed: int) -> Rate:
        scores = size * np.random.default_rng(seed).standard_normal((count, len(built.outputs)))
        heights = np.column_stack([climbs(item, built.thresholds.cusum_drift) for item in scores.T])
        return alarm_rates(built, [seen_of(built, scores, heights)], 2.0)[0]

    true = rate(1.0, 400_000, 1).between
    for size, least, most in ((1.0, 0.93, 1.0), (1.33, 0.0, 0.2)):
        found = [rate(size, 4000, seed) for seed in range(100, 200)]
        assert least <= np.mean([item.between * item.longer >= true for item in found]) <= most
    assert rate(1.0, 400_000, 1).longer < 0.1 * rate(1.0, 4000, 1).longer


def test_gains_that_hardly_fall() -> None:
    """Scores whose scatter gains nothing on average have a time, not an endless search."""
    high = np.sqrt((1.0 + log(2.5)) / (0.25 * (1.0 - 2.5**-2)))
    low = np.sqrt((log(2.5) - 1.0 - 1e-8 + 1.0) / (0.25 * (1.0 - 2.5**-2)))
    steps = np.array([high, low] * 50) * np.array([1.0, -1.0, -1.0, 1.0] * 25)
    assert scatter_time(Thresholds(), [np.cumsum(steps)], 1) > 0.0


def test_the_time_between_false_alarms_is_that_of_white_noise() -> None:
    """The formula gives the mean time of a CUSUM of white noise within a tenth; the true one solves an equation."""
    drift, limit, n = 0.3, 6.0, 1200
    grid = (np.arange(n) + 0.5) * limit / n
    width = limit / n
    density = np.exp(-0.5 * (grid[None, :] - grid[:, None] + drift) ** 2) / np.sqrt(2.0 * np.pi) * width
    from_zero = np.array([0.5 * (1.0 + erf((drift - place) / np.sqrt(2.0))) for place in grid])
    matrix = np.eye(n + 1)
    matrix[1:, 1:] -= density
    matrix[1:, 0] -= from_zero
    matrix[0, 1:] -= np.exp(-0.5 * (grid + drift) ** 2) / np.sqrt(2.0 * np.pi) * width
    matrix[0, 0] -= 0.5 * (1.0 + erf(drift / np.sqrt(2.0)))
    exact = float(np.linalg.solve(matrix, np.ones(n + 1))[0])
    assert cusum_time(-drift, 1.0, limit) == pytest.approx(exact, rel=0.1)


def climbs(scores: FloatArray, drift: float) -> FloatArray:
    """Give the heights of the one-sided sum of scores (N,)."""
    height, found = 0.0, np.zeros(len(scores))
    for k, score in enumerate(scores):
        height = max(height + score - drift, 0.0)
        found[k] = height
    return found


def bursts(n: int, generator: np.random.Generator) -> FloatArray:
    """Give scores (n,) that are small, but for a while after each move of an input, which is larger some times."""
    sizes = np.repeat(generator.exponential(0.35, n // 300 + 1), 300)[:n]
    return 0.3 * generator.standard_normal(n) + sizes * np.exp(-(np.arange(n) % 300) / 15.0)


@pytest.mark.parametrize("seed", range(4))
def test_highest_climbs_tell_how_rare_higher_ones_are(seed: int) -> None:
    """Of white noise as mean and variance do; of a model that is wrong for a while these tell of far too long."""
    drift, limit, generator = 0.25, 11.0, np.random.default_rng(seed)
    white = [generator.standard_normal(5000) for _ in range(4)]
    told = climb_time([climbs(item, drift) for item in white], limit)
    assert abs(log(told / cusum_time(-drift, 1.0, limit))) < log(4.0)

    few, many = bursts(20_000, generator), bursts(600_000, generator)
    high, begun = climbs(many, drift), 0
    for start in range(0, len(many), 300):
        begun += bool(np.any(high[start : start + 300] > limit))
    true = len(many) / begun
    assert abs(log(climb_time([climbs(few, drift)], limit) / true)) < log(10.0)
    variance = float(long_run_variance((few - few.mean())[:, None])[0, 0]) / len(few)
    assert cusum_time(float(few.mean()) - drift, variance, limit) > 100.0 * true


def test_few_climbs_tell_nothing() -> None:
    """Not of how rare higher ones are; nor do none."""
    height = np.tile([0.0, 1.0], 2 * HIGHEST - 1)
    assert climb_time([height], 2.0) == FARTHEST
    assert climb_time([np.zeros(50)], 2.0) == FARTHEST
    assert climb_time([height, height], 1.0) == pytest.approx(len(height) * 2 / HIGHEST)


def test_a_mean_makes_it_climb_straight() -> None:
    """With a mean above the drift the CUSUM climbs to its limit at that speed."""
    assert cusum_time(1.0, 0.01, 25.0) == pytest.approx(25.1, rel=0.01)


def test_the_long_run_variance_of_a_moving_average() -> None:
    """Sums of neighbours have a long-run variance of four, white noise of one, per sample."""
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(20001)
    assert long_run_variance(noise[:, None])[0, 0] / 20001 == pytest.approx(1.0, rel=0.1)
    pairs = (noise[1:] + noise[:-1])[:, None]
    assert long_run_variance(pairs)[0, 0] / 20000 == pytest.approx(4.0, rel=0.15)
