"""The sums of the detector and the alarm: sums by hand, what moves that of the scatter, and where a change began."""

from collections.abc import Sequence
from dataclasses import replace
from math import log, sqrt

import numpy as np
import pytest

from bare_core import CELL, Bare, bare, text_of
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.fit.cusum import LAGS, added, height_of, no_sums
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
CALLS = """
void t_take(State *state, const double *packed, const double *innovations, double *heights)
{
    accumulate(&state->clock, &state->inputs, &state->healthy, &state->sensors, packed, innovations);
    for (int j = 0; j < N_OUTPUTS; j++) heights[j] = statistic(&state->sensors, j);
    row_of(&state->past, state->clock.index)->time = 0.5 * (double)state->clock.index;
}
int64_t t_detect(State *state) { return detect(state); }
int64_t t_slow_error_alarms(State *state) { return slow_error_alarms(&state->clock, state->healthy.lane); }
"""
# With a promise, and a slow error of a sensor, which does not alarm.
PROMISED = CELL.replace("max_faults: 1", "max_faults: 1\ntime_between_false_alarms: 30 d").replace(
    "first.f: 1 %", "i: 1 %"
)
UNKNOWN_FROM = core_settings()["UNKNOWN_FROM"]
SETTINGS, FIRST = text_of(CELL, "")[0].thresholds, 100
BLANKED, GAP = np.inf, -np.inf  # instead of an innovation; nan: missing
Scores = FloatArray | Sequence[float]


def begun(text: str = CELL) -> Bare:
    """A core before sample 100, long after its start."""
    core = bare(CALLS, text)
    core["clock.begun"], core["clock.index"], core["clock.running"] = 0, FIRST, 1
    return core


def fed(core: Bare, scores: Scores, other: float = 0.0) -> FloatArray:
    """Take innovations of the first sensor, in their sd; gives the statistic of both after each, (n, 2)."""
    place, found = core.spec.sample_fields, np.zeros((len(scores), 2))
    for height, score in zip(found, scores, strict=True):
        packed = np.zeros(core.spec.n_sample)
        packed[place["use"]] = [not np.isnan(score), 1.0]
        packed[place["scale"]] = [SETTINGS.blank_factor if score == BLANKED else 1.0, 1.0]
        core["healthy.astray"] = float(score == GAP)
        value = float(score) if np.isfinite(score) else 0.0
        core.call("t_take", packed, np.array([2.0 * value, other, 4.0, 1.0]), height)
        core["clock.index"] += 1
    return found


def sums(core: Bare, name: str) -> FloatArray:
    """Sums of each sensor, (sides or lags, 2)."""
    return np.array(core[f"sensors.{name}"]).reshape(-1, 2)


@pytest.mark.parametrize("usually", [0.0, 1.0])
def test_while_an_input_is_unknown_no_sensor_is_judged(usually: float) -> None:
    """From the second sample on at which one that moves, and usually is told, is not: it may stand elsewhere.

    usually : part of samples at which it is told
    """
    heights = []
    for guessed in (UNKNOWN_FROM - 1.0, UNKNOWN_FROM):
        core = begun()
        core["inputs.held"] = core["inputs.leap"] = 1.0
        core["inputs.habit"], core["inputs.guessed"] = usually, [0.0, guessed]
        heights.append(float(fed(core, [2.0] * 10)[-1, 0]))
    assert heights[0] > 0.0
    assert heights[1] == (0.0 if usually else heights[0])


def heights(scores: Scores) -> FloatArray:
    """The least of the sums of the scatter, which is what counts, after each innovation."""
    core, found = begun(), []
    for score in scores:
        fed(core, [score])
        found.append(sums(core, "scatter")[:, 0].min())
    return np.array(found)


def white(seed: int, n: int, factor: float = 1.0) -> FloatArray:
    """White noise."""
    return np.asarray(factor * np.random.default_rng(seed).standard_normal(n))


def scatter_by_hand(scores: Sequence[float]) -> list[float]:
    """The sums of the scatter after all scores, written down plainly."""
    ratio, clip, found = SETTINGS.scatter_ratio, SETTINGS.cusum_clip, [0.0] * LAGS
    for k, score in enumerate(scores):
        for lag in range(1, min(LAGS, k) + 1):
            square = min((score - scores[k - lag]) ** 2 / 2.0, clip**2)
            found[lag - 1] = max(0.0, found[lag - 1] + 0.5 * (1.0 - 1.0 / ratio**2) * square - log(ratio))
    return found


def test_sums_of_the_scatter_are_those_by_hand() -> None:
    """Each sum adds the log-likelihood ratio of one difference, of variance 1 as declared, clipped."""
    core, scores = begun(), white(1, 80, 2.0)
    fed(core, scores)
    assert sums(core, "scatter")[:, 0] == pytest.approx(scatter_by_hand(scores.tolist()), rel=1e-12)
    assert sums(core, "scatter")[:, 0].min() > 1.0
    assert not sums(core, "scatter")[:, 1].any()


def test_slow_and_fast_sums_are_those_of_page() -> None:
    """Two one-sided sums of clipped innovations, less a drift, held while a value is missing or blanked.

    Each side remembers the last sample at which it was zero.
    """
    core, scores = begun(), white(2, 150, 2.0) + np.where(np.arange(150) < 75, 0.2, -0.6)
    scores[20:30:3], scores[31:40:3] = np.nan, BLANKED
    slow, fast, began, highest = np.zeros(2), np.zeros(2), np.full(2, -1.0), 0.0
    for k, score in enumerate(scores):
        fed(core, [score])
        if np.isfinite(score):
            limited = max(-SETTINGS.cusum_clip, min(SETTINGS.cusum_clip, score)) * np.array([1.0, -1.0])
            slow = np.maximum(0.0, slow + limited - SETTINGS.cusum_drift)
            fast = np.maximum(0.0, fast + limited - SETTINGS.fast_drift)
        began[slow == 0.0], highest = FIRST + k, max(highest, fast.max())
        assert sums(core, "cusum")[:, 0] == pytest.approx(slow, rel=1e-12)
        assert sums(core, "fast")[:, 0] == pytest.approx(fast, rel=1e-12)
        assert np.array_equal(sums(core, "cusum_start")[began > 0, 0], began[began > 0])
    assert slow[1] > 20.0
    assert highest > 3.0


def test_sums_in_python_are_those_of_the_core() -> None:
    """What asks for the smallest fault and foretells false alarms takes the same sums, sample by sample."""
    generator = np.random.default_rng(6)
    for text in (CELL, PROMISED):
        core, plain, highest = begun(text), no_sums(2), 0.0
        settings = core.spec.thresholds
        for k in range(600):
            score = float(generator.standard_normal() * (4.0 if 200 < k < 260 else 1.3) + 0.4 * (k // 100 % 2))
            score = float(generator.choice([score, np.nan, BLANKED, GAP], p=[0.88, 0.06, 0.03, 0.03]))
            other = float(generator.standard_normal() + 0.2)
            height = fed(core, [score], other)[0]
            gap, blanked = score == GAP, score == BLANKED
            if gap:
                score, plain = 0.0, replace(plain, before=np.full((LAGS, 2), np.nan))
            use, forget = np.array([np.isfinite(score), True]), np.array([blanked or gap, gap])
            plain = added(settings, plain, np.array([score if np.isfinite(score) else 0.0, other]), use, forget)
            for name, values in (("cusum", plain.slow), ("fast", plain.fast), ("scatter", plain.scatter)):
                assert sums(core, name) == pytest.approx(values, rel=1e-12, abs=1e-12)
            assert sums(core, "before") == pytest.approx(plain.before, nan_ok=True, rel=1e-12)
            assert height == pytest.approx(height_of(settings, plain), rel=1e-12, abs=1e-12)
            highest = max(highest, plain.scatter.min(axis=0)[0])
        assert highest > 10.0


@pytest.mark.parametrize(("factor", "within"), [(2.0, 250), (3.0, 110), (5.0, 70)])
def test_more_noise_crosses(factor: float, within: int) -> None:
    """White innovations twice as large as declared reach the limit within 250 samples, larger ones earlier."""
    for seed in range(3):
        noise = factor * np.random.default_rng([seed, 2]).standard_normal(within)
        assert heights(noise).max() > SETTINGS.scatter_limit


def test_noise_as_declared_stays_low() -> None:
    """White innovations as declared, and half as large again, stay far from the limit."""
    noise = white(3, 3000)
    assert heights(noise).max() < 0.2 * SETTINGS.scatter_limit
    assert heights(1.4 * noise).max() < 0.5 * SETTINGS.scatter_limit


@pytest.mark.parametrize("period", [2, 3, 4])
def test_an_oscillation_is_no_noise(period: int) -> None:
    """Innovations that swing by several sd, and return after up to four samples, add nothing."""
    swing = 2.5 * np.cos(2.0 * np.pi * np.arange(600) / period)
    assert heights(swing + white(4, 600, 0.5)).max() < 0.1 * SETTINGS.scatter_limit


def test_a_bias_and_a_slow_error_are_no_noise() -> None:
    """A step, a ramp and a slow wave of the innovations add less than what one wild value may."""
    time = np.arange(600)
    for course in (np.where(time < 300, 0.0, 40.0), 0.01 * time, 2.5 * np.sin(time / 20.0)):
        assert heights(course + white(5, 600)).max() < 0.2 * SETTINGS.scatter_limit


def test_a_few_wild_values_are_no_noise() -> None:
    """Five wild values in a row, or one in twenty, do not reach half of the limit."""
    row, now_and_then = white(6, 1000), white(6, 1000)
    row[500:505] += np.array([50.0, -50.0, 50.0, 50.0, -50.0])
    now_and_then[::20] += 50.0
    assert heights(row).max() < 0.5 * SETTINGS.scatter_limit
    assert heights(now_and_then).max() < 0.5 * SETTINGS.scatter_limit


def test_rounded_and_stuck_readings_are_no_noise() -> None:
    """Innovations of readings rounded to 3 sd, that go to and fro between two values or stand still, add nothing."""
    slow = np.cumsum(white(7, 800, 0.05))
    toggled = np.where(np.arange(800) % 2, 3.0, 0.0)
    for readings in (3.0 * np.round(slow / 3.0) - slow, toggled):
        assert heights(readings).max() < 0.1 * SETTINGS.scatter_limit
    assert heights(np.full(800, 2.0)).max() == 0.0


def test_missing_values_are_passed_over() -> None:
    """Values that are missing change nothing, so that a sensor that reads rarely is watched all the same."""
    scores, often, rarely = white(8, 60, 2.0), begun(), begun()
    fed(often, scores)
    fed(rarely, np.column_stack([scores, np.full((60, 2), np.nan)]).ravel())
    for name in ("scatter", "before", "cusum", "fast"):
        assert np.array_equal(sums(rarely, name)[:, 0], sums(often, name)[:, 0])


@pytest.mark.parametrize("what", [BLANKED, GAP])
def test_nothing_is_compared_across_a_step_or_a_gap(what: float) -> None:
    """After a blanked value, and after a gap, the sums keep their heights and the comparison begins anew."""
    core = begun()
    fed(core, white(9, 60, 2.0))
    before = sums(core, "scatter")[:, 0]
    assert before.min() > 5.0
    for score in (what, 9.0):
        fed(core, [score])
        assert np.array_equal(sums(core, "scatter")[:, 0], before)
        assert np.isnan(sums(core, "before")[score == 9.0 :, 0]).all()


@pytest.mark.parametrize("variance", [np.nan, 0.0, -1.0])
def test_a_score_that_is_no_number_leaves_all_sums_as_they_are(variance: float) -> None:
    """One innovation without a variance neither blinds the detector nor raises an alarm; the other sensor counts."""
    core = begun()
    fed(core, white(9, 20) + 1.0, 1.0)
    names = ("cusum", "fast", "scatter", "before")
    before, packed = {name: sums(core, name) for name in names}, np.zeros(core.spec.n_sample)
    packed[core.spec.sample_fields["use"]] = packed[core.spec.sample_fields["scale"]] = 1.0
    core.call("t_take", packed, np.array([1.0, 1.0, variance, 1.0]), np.zeros(2))
    for name in names:
        assert np.array_equal(sums(core, name)[:, 0], before[name][:, 0])
        assert np.isfinite(sums(core, name)).all()
    assert sums(core, "cusum")[0, 1] > before["cusum"][0, 1]
    assert sums(core, "before")[0, 1] == 1.0


def test_the_onset_of_an_alarm_of_the_scatter() -> None:
    """It names the sensor, and begins where the first of the sums left 0."""
    core = begun()
    fed(core, white(10, 50, 0.1))
    height = fed(core, white(11, 90, 4.0))[-1, 0]
    core["sensors.cusum"] = core["sensors.fast"] = 0.0
    least = sums(core, "scatter")[:, 0].min()
    assert height == pytest.approx(SETTINGS.cusum_limit * least / SETTINGS.scatter_limit)
    core["clock.index"] -= 1  # it is asked at the last sample
    change = core.call("t_detect")
    assert FIRST + 45 <= change <= FIRST + 52
    assert core["alarm.crossed"].tolist() == [1, 0]
    assert core["alarm.change_time"].tolist() == [0.5 * change]


def test_a_sum_that_grows_from_its_first_sample_begins_there() -> None:
    """A sum that never was zero after the warm-up dates the change at the end of the warm-up, not before."""
    core = begun()
    core["clock.begun"], core["clock.index"], core["clock.accepted"] = 20, 40, -1
    for k in range(3):
        fed(core, [1.0])
        assert sums(core, "cusum")[0, 0] == pytest.approx(0.7 * (k + 1))
    assert sums(core, "cusum_start")[0, 0] == 20 + SETTINGS.warm_up_samples - 1


@pytest.mark.parametrize("accepted", [-1, 120])
def test_a_change_is_of_after_what_was_accepted(accepted: int) -> None:
    """The largest sum tells after which sample it grew; not before what was accepted, nor before what is kept."""
    core = begun()
    core["clock.accepted"] = accepted
    fed(core, [*[-9.0] * 10, *[3.0] * 20], 0.8)
    core["clock.index"] -= 1
    assert core.call("t_detect") == (FIRST + 9 if accepted < 0 else 121)
    assert core["alarm.crossed"].tolist() == [1, 0]
    core["sensors.cusum_start"] = 0.0
    core["clock.index"] = 1000
    assert core.call("t_detect") == 1000 - SETTINGS.history_samples


def test_a_fast_sum_alarms_where_it_has_a_limit() -> None:
    """Where a time between false alarms is promised, a few large innovations are enough; without one it takes ten."""
    for text in (PROMISED, CELL):
        core, count = begun(text), 0
        limits = core.spec.thresholds
        slow, fast = (
            limit / (3.0 - drift)
            for limit, drift in ((limits.cusum_limit, limits.cusum_drift), (limits.fast_limit, limits.fast_drift))
        )
        needed, change = int(min(slow, fast)) + 1, -1
        while change < 0:
            height = fed(core, [3.0])[0, 0]
            core["clock.index"] -= 1
            change, count = core.call("t_detect"), count + 1
            core["clock.index"] += 1
            assert (height > limits.cusum_limit) == (change >= 0)
        assert count == needed
        assert (fast < slow) == (text == PROMISED)
    assert needed == 10


def test_a_slow_error_beyond_its_size_alarms() -> None:
    """Beyond its limit in declared sd, once watched for as long as its memory since the start or what was accepted.

    Of a part of a law that is 1.6 where nothing is promised.
    """
    for text in (CELL, PROMISED):
        core = begun(text)
        place, error = core.spec.slow_slice.start, core.spec.slow_errors[0]
        assert (error.memory, error.alarms) == (20.0, True)
        limit = float(core.spec.slow_limits[0])
        assert (limit == 1.6) == (text == CELL)
        for ratio, beyond in (
            (limit - 0.01, False),
            (limit + 0.01, True),
            (-limit - 0.01, True),
            (0.01 - limit, False),
        ):
            core["healthy.lane"][place] = ratio * error.sd
            for since, watched in ((39, False), (40, True)):  # samples of 0.5 s
                core["clock.begun"], core["clock.accepted"] = core["clock.index"] - since, -1
                assert core.call("t_slow_error_alarms") == (beyond and watched)
                assert (core.call("t_detect") >= 0) == (beyond and watched)
                core["clock.begun"], core["clock.accepted"] = 0, core["clock.index"] - since
                assert core.call("t_slow_error_alarms") == (beyond and watched)


def test_the_usual_square_is_a_mean_that_is_slow_and_bounded() -> None:
    """Noise that is declared too large is learned over thousands of samples, to a quarter at least; not in an alarm."""
    core, nis = begun(), 1.0
    for k, score in enumerate(white(12, 3000, sqrt(0.1))):
        fed(core, [score])
        square = min(score**2, SETTINGS.cusum_clip**2)
        nis = min(max(nis + (square - nis) / min(1000 + FIRST + k, 10000), 0.25), 4.0)
        assert core["sensors.nis"][0] == pytest.approx(nis, rel=1e-12)
    assert 0.25 <= nis < 0.4
    core["clock.alarm"] = core["clock.index"]
    fed(core, [3.0] * 5)
    assert core["sensors.nis"][0] == pytest.approx(nis, rel=1e-12)
