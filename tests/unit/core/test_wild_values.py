"""Wild readings and inputs in the core: what is refused, what is cut, what is believed at last."""

from collections.abc import Sequence

import numpy as np
import pytest

from bare_core import CELL, FOLLOWING, Bare, bare
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.contract.spec import covariance_place
from faultbond.model.text import parse_model
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
CALLS = """
static Filters filters;
static SampleMemory memory;
static double earlier[FB_ROOM(N_INPUTS)], innovations[2 * N_OUTPUTS];
int64_t t_admit(State *state, const Sample *sample, double *packed)
{
    prepare_filters(&filters);
    return admit(state, sample, earlier, packed, &memory, &filters.plain);
}
int64_t t_advance(State *state, const double *packed)
{
    advance_one(state->healthy.lane, packed, &state->normal, innovations, &filters.plain);
    return state->clock.index++;
}
int64_t t_without_spike(State *state, double *packed)
{
    return without_spike(state, earlier, packed, &memory, &filters);
}
int64_t t_is_surprising(State *state, const double *packed, const double *off)
{
    return is_surprising(&state->sensors, packed, off);
}
int64_t t_judge(State *state, const double *off, double *packed)
{
    return judge(&state->clock, &state->sensors, off, packed);
}
void t_see(State *state, const double *packed) { see(&state->sensors, packed); }
void t_doubt(State *state, const double *apart, double *packed)
{
    keep_version(state, &memory.real);
    memory.real.lane[0] += *apart;
    memcpy(memory.other, packed, sizeof memory.other);
    doubt_past(state, &memory.real, memory.other, packed, &memory.trial, &filters.plain);
}
int64_t t_alarm(State *state, const double *likelihood)
{
    state->clock.alarm = 7;
    state->sure.since = 5;
    for (int64_t k = 0; k < N_STEPS; k++) *number_of_step(&state->bank, k, PLAIN_LIKELIHOOD) = NAN;
    for (int64_t k = 0; k < N_SLOT_LANES; k++) *number_of_slot(&state->bank, k, WIDE_LIKELIHOOD) = NAN;
    *number_of_step(&state->bank, 1, PLAIN_LIKELIHOOD) = *likelihood;
    lose(state);
    return state->clock.alarm;
}
int64_t t_alarm_of_slot(State *state)
{
    state->clock.alarm = 7;
    for (int64_t k = 0; k < N_STEPS; k++) *number_of_step(&state->bank, k, PLAIN_LIKELIHOOD) = NAN;
    for (int64_t k = 0; k < N_SLOT_LANES; k++)
        *number_of_slot(&state->bank, k, WIDE_LIKELIHOOD) = SLOT_STICKS[k] ? -12.0 : NAN;
    lose(state);
    return state->clock.alarm;
}
void t_score(State *state, const double *one, const double *other) { state->inputs.gain = score_of(one, other, 0); }
void t_drift(State *state, const double *moves, double *found)
{
    state->normal.rates[0] = moves[0];
    state->normal.wander[0] = moves[1];
    lanes lane[PLAIN_NUMBERS];
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) lane[k] = broadcast(state->healthy.lane[k]);
    drift_on(&state->normal, moves[2], lane, PLAIN_JOINT);
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) found[k] = first_of(lane[k]);
}
void t_forget(State *state, double *change)
{
    static Told told;
    forget_inputs(state, &told);
    memcpy(change, told.inputs.change, sizeof told.inputs.change);
}
void t_said(State *state, const double *pair) { state->inputs.gain = said_for_second(pair[0], pair[1]); }
"""
GRAPH, DT, RANGED = (
    parse_model(CELL),
    0.5,
    CELL.replace("unit: V, noise: 10 mV", "unit: V, noise: 10 mV, range: [-1 kV, 1 kV]"),
)
NAN, BEFORE = np.nan, np.repeat([2.0, 1.0] * 5, 10)  # voltages at the begin


def rows(v: FloatArray, feels: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """What is told of the inputs, the voltages `v` and a current, and readings of a plant that `feels` others."""
    time, plant = np.asarray(DT * np.arange(len(v)), dtype=np.float64), v if feels is None else feels
    made = simulate(
        GRAPH, Inputs(time=time, values=np.stack([plant, np.full_like(v, 0.1)], axis=1)), seed=3, start={"cell.q": 1.0}
    )
    return np.stack([v, np.full_like(v, 0.1)], axis=1), made.outputs


def begun(text: str = CELL) -> Bare:
    """A core after its start; it has seen voltages from 1 to 2."""
    core = bare(CALLS, text)
    core.begin(np.array([1.0]))
    u, y = rows(BEFORE)
    took(core, u, y)
    return core


def took(core: Bare, u: FloatArray, y: FloatArray) -> tuple[list[int], list[FloatArray]]:
    """Take samples; gives how many inputs were wild at each, and the packed ones."""
    wild, samples = [], []
    for each_u, each_y in zip(u, y, strict=True):
        packed = np.zeros(core.spec.n_sample)
        wild.append(core.call("t_admit", np.array([0.0, DT, *each_u, *each_y]), packed))
        core.call("t_advance", packed)
        samples.append(packed)
    return wild, samples


def goes_on(told: Sequence[float], felt: Sequence[float]) -> tuple[Bare, list[int], list[FloatArray], float]:
    """Take voltages that are told, and others that are felt, after the begin; gives the charge in the plant too."""
    u, y = rows(np.r_[BEFORE, told], np.r_[BEFORE, felt])
    core = begun()
    wild, samples = took(core, u[100:], y[100:])
    return core, wild, samples, float(y[-1, 1])


def test_an_input_that_is_wild_for_some_samples_is_held() -> None:
    """Each wild value is counted once, is no part of the range, and what feels it at once is not judged."""
    for length in (1, 2, 12):
        core, wild, samples, _ = goes_on([*[500.0] * length, *[2.0] * 30], [2.0] * (length + 30))
        assert sum(wild) == length
        assert core["inputs.highest"][0] == pytest.approx(2.0)
        place = core.spec.sample_fields["u"]
        assert max(packed[place][0] for packed in samples) == pytest.approx(2.0)
        blank = np.array(samples)[:, core.spec.sample_fields["scale"]] == core.spec.thresholds.blank_factor
        assert blank[:length, 0].all()
        assert not blank[:, 1].any()
        assert np.isnan(core["inputs.odd"]).all()


def test_an_input_that_really_goes_far_is_believed_and_the_filter_is_as_if_it_always_had() -> None:
    """After the readings told, the filter is the one that knew such voltages from the start, and nothing was wild."""
    core, wild, _, charge = goes_on([300.0] * 40, [300.0] * 40)
    assert sum(wild) == 0
    assert core["inputs.held"][0] == core["inputs.highest"][0] == 300.0
    assert core["healthy.lane"][0] == pytest.approx(charge, rel=0.01)
    knows = begun()
    knows["inputs.highest"] = (1e3, 1.0)
    u, y = rows(np.r_[BEFORE, [300.0] * 40])
    took(knows, u[100:], y[100:])
    assert core["healthy.lane"][0] == pytest.approx(knows["healthy.lane"][0], rel=1e-3)


def test_an_error_that_follows_an_input_feels_what_is_believed_at_last_and_nothing_of_a_past_that_is_read_anew() -> (
    None
):
    """Of a voltage that really went to 300 V as much as if that had been known; of what was forgotten nothing."""
    u, y = rows(np.r_[BEFORE, [300.0] * 15])
    core, knows = begun(FOLLOWING), begun(FOLLOWING)
    knows["inputs.highest"] = (1e3, 1.0)
    for item in (core, knows):
        took(item, u[100:], y[100:])
    assert core["inputs.held"][0] == 300.0
    assert knows["inputs.change"][0] > 10.0
    assert core["inputs.change"][0] == pytest.approx(knows["inputs.change"][0], rel=0.1)  # one sample later
    felt = np.full(2, NAN)
    core.call("t_forget", felt)
    assert felt.tolist() == [0.0, 0.0]


def test_while_readings_do_not_tell_an_input_waits() -> None:
    """Without readings the filter that believes it runs beside; after twenty samples it is believed."""
    u, _ = rows(np.full(30, 300.0))
    core, nothing = begun(), np.full((30, 2), NAN)
    core["inputs.leap"], core["inputs.since_step"] = 0.0, np.inf  # nothing else blanks what feels it
    packed = took(core, u[:1], nothing[:1])[1][0]
    assert packed[core.spec.sample_fields["scale"]].tolist() == [core.spec.thresholds.blank_factor, 1.0]
    core["inputs.gain"] = 5.0
    took(core, u[1:10], nothing[1:10])
    assert core["inputs.held"][0] == pytest.approx(1.0)
    assert core["inputs.odd"][0] == 300.0
    assert core["clock.index"][0] - core["inputs.odd_since"][0] == 10
    assert core["inputs.gain"] == 5.0
    assert core["inputs.rival"][0] - core["healthy.lane"][0] == pytest.approx(299.0 * (1.0 - np.exp(-0.45)), rel=0.01)
    rival = core["inputs.rival"][0]
    took(core, u[10:20], nothing[10:20])
    assert np.isfinite(core["inputs.odd"][0])
    took(core, u[20:21], nothing[20:21])
    assert np.isnan(core["inputs.odd"][0])
    assert core["inputs.held"][0] == 300.0
    assert core["healthy.lane"][0] > rival


def test_what_an_input_was_while_it_waited_is_kept_as_believed() -> None:
    """Lanes begin at an alarm from samples as they were; a filter that follows them is the healthy one."""
    voltage = np.r_[BEFORE, np.full(40, 300.0)]
    u, y = rows(voltage)
    told = np.isin(np.arange(len(y)), np.arange(100, 108), invert=True)
    y = np.where(told[:, None], y, NAN)
    core = build_engine(GRAPH)[1]
    monitor = Monitor(core, quiet=True)
    waited = []
    for k, (each_u, each_y) in enumerate(zip(u, y, strict=True)):
        monitor.push(Sample(time=DT * k, dt=DT, u=each_u, y=each_y))
        waited += [k] if np.isfinite(monitor.numbers("inputs.odd")[0]) else []
    assert waited == list(range(100, 108))
    place, lane = core.spec.sample_fields["u"], monitor.row(100)[1]
    for k in range(101, 140):
        packed, kept = monitor.row(k)
        assert packed[place][0] == 300.0
        lane = core.advance(lane[:, None], packed[None])[0][:, 0]
        assert lane == pytest.approx(kept, rel=1e-9, abs=1e-12)


def test_an_input_that_came_back_unseen_leaves_the_states_in_doubt() -> None:
    """Where no reading tells whether it was real, it was wild, and the states may be where either past leads."""
    core = begun()
    u, nothing = rows(np.array([300.0, 300.0, 300.0, 1.0]))[0], np.full((4, 2), NAN)
    wild, samples = took(core, u, nothing)
    assert wild == [0, 0, 0, 3]
    apart = samples[-1][core.spec.sample_fields["gap"]][0]
    assert apart == pytest.approx(299.0 * (1.0 - np.exp(-3 * DT / 10.0)), rel=0.02)
    assert core["inputs.highest"][0] == 2.0


def test_an_input_that_is_wild_once_and_then_missing_is_never_believed() -> None:
    """One that usually is told waits for as long as others, and is refused then."""
    core = begun()
    u = np.stack([np.r_[300.0, [NAN] * 25], np.full(26, 0.1)], axis=1)
    wild, _ = took(core, u, np.full((26, 2), NAN))
    assert wild == [0] * 20 + [20] + [0] * 5
    assert core["inputs.highest"][0] == 2.0


def test_nothing_within_a_range_that_is_stated_is_wild() -> None:
    """An input whose range the model states is believed at once, as is one of which nothing was seen."""
    u, y = rows(np.r_[[2.0] * 20, [300.0] * 5])
    core = begun(CELL.replace("settling: 3 s", "settling: 3 s, range: [-1 kV, 1 kV]"))
    assert sum(took(core, u, y)[0]) == 0
    assert core["inputs.held"][0] == 300.0
    fresh = bare(CALLS)
    fresh.begin(np.array([1.0]))
    took(fresh, u[-1:], y[-1:])
    assert fresh["inputs.held"][0] == 300.0


@pytest.mark.parametrize("felt", [True, False])
def test_a_value_that_an_input_has_for_one_sample_is_taken_out_unless_it_is_felt(felt: bool) -> None:
    """The readings tell whether a voltage that left its value for one sample has acted."""
    told, plant = np.r_[BEFORE, 1.0, 3.9, 1.0], np.r_[BEFORE, 1.0, 3.9 if felt else 1.0, 1.0]
    u, y = rows(told, plant)
    core = begun()
    took(core, u[100:102], y[100:102])
    packed = np.zeros(core.spec.n_sample)
    core.call("t_admit", np.array([0.0, DT, *u[102], *y[102]]), packed)
    smooth, place = packed.copy(), core.spec.sample_fields["u_before"]
    assert core.call("t_without_spike", smooth) == (not felt)
    assert smooth[place].tolist() == [3.9 if felt else 1.0, 0.1]
    assert np.array_equal(np.delete(smooth, place), np.delete(packed, place))


def test_what_readings_say_for_one_of_two_pasts() -> None:
    """The difference of squares; what lies farther than twenty sd off, or is no number, counts as twenty."""
    core = bare(CALLS)
    for pair, expected in (((3.0, -1.0), 8.0), ((1e9, 0.0), 400.0), ((NAN, 2.0), 396.0), ((1.0, np.inf), -399.0)):
        core.call("t_said", np.array(pair))
        assert core["inputs.gain"] == expected


def judged(core: Bare, y: float, off: float, use: float = 1.0, variance: float = 1.0) -> tuple[int, float, float]:
    """Judge a reading of the second sensor that lies so many sd off: whether it is wild, its use and value then."""
    packed, place = np.zeros(core.spec.n_sample), core.spec.sample_fields
    packed[place["y"]], packed[place["use"]] = (0.0, y), (1.0, use)
    count = core.call("t_judge", np.array([0.0, off, 1.0, variance]), packed)
    return count, float(packed[place["use"]][1]), float(packed[place["y"]][1])


def known(text: str = CELL) -> Bare:
    """A core that is warm, and whose second sensor has shown 2 to 4."""
    core = bare(CALLS, text)
    core["clock.begun"], core["clock.index"] = 0, core.spec.thresholds.warm_up_samples
    core["sensors.shown"] = (0.0, 2.0, 0.0, 4.0)
    return core


def test_a_reading_is_wild_if_it_surprises_and_lies_far_from_all_that_was_shown() -> None:
    """Three widths beyond what was shown, and twenty sd off; of a sensor without a range."""
    assert judged(known(), 10.1, 20.1) == (1, 0.0, 0.0)
    assert judged(known(), -4.1, -20.1) == (1, 0.0, 0.0)
    for y, off in ((9.9, 1e9), (-3.9, 1e9), (1e9, 19.9), (1e9, NAN)):
        assert judged(known(), y, off) == (0, 1.0, y)
    assert judged(known(), 1e9, 1e9, 0.0) == (0, 0.0, 1e9)
    assert judged(known(), 1e9, 1e9, variance=NAN) == (0, 1.0, 1e9)
    assert judged(known(RANGED), 1e9, 1e9) == (0, 1.0, 1e9)
    fresh = known()
    fresh["sensors.shown"] = np.repeat([np.inf, -np.inf], 2)
    assert judged(fresh, 1e9, 1e9) == (0, 1.0, 1e9)
    early = known()
    early["clock.index"] -= 1
    assert judged(early, 3.0, 20.1) == (1, 0.0, 0.0)
    still = known()
    still["sensors.shown"] = (0.0, 2.0, 0.0, 2.0)  # at least a hundred sd of its noise wide
    assert judged(still, 5.1, 1e9) == (1, 0.0, 0.0)
    assert judged(still, 4.9, 1e9) == (0, 1.0, 4.9)


def test_what_goes_on_is_cut_and_let_in() -> None:
    """Five wild readings are refused; then they count, up to ten widths; one more is refused after fifty good ones."""
    core = known()
    assert [judged(core, 1e9, 1e9) for _ in range(6)] == [(1, 0.0, 0.0)] * 5 + [(1, 1.0, 24.0)]
    assert core["sensors.shown"].tolist() == [0.0, 2.0, 0.0, 4.0]
    assert [judged(core, 3.0, 0.0) for _ in range(49)] == [(0, 1.0, 3.0)] * 49
    assert core["sensors.spent"][1] == pytest.approx(5.0 - 49 / 50)
    assert judged(core, -1e9, 1e9)[1] == 1.0
    judged(core, 3.0, 0.0)
    judged(core, 3.0, 0.0)
    assert judged(core, -1e9, 1e9) == (1, 0.0, 0.0)
    assert judged(core, 20.0, 1e9) == (1, 1.0, 20.0)  # within ten widths, so it is shown
    assert core["sensors.shown"].tolist() == [0.0, 2.0, 0.0, 20.0]
    for _ in range(300):
        judged(core, 3.0, 0.0)
    assert core["sensors.spent"].tolist() == [0.0, 0.0]


def test_what_the_sensors_show_and_what_surprises() -> None:
    """Readings that are there widen the range; four sd surprise, as does all while patience is spent."""
    core, place = known(), bare(CALLS).spec.sample_fields
    packed = np.zeros(core.spec.n_sample)
    packed[place["y"]], packed[place["use"]] = (-7.0, 9.0), (1.0, 0.0)
    core.call("t_see", packed)
    assert core["sensors.shown"].tolist() == [-7.0, 2.0, 0.0, 4.0]
    for off, expected in (((3.9, 9.0), 0), ((-4.1, 0.0), 1), ((NAN, 0.0), 0)):
        assert core.call("t_is_surprising", packed, np.array([*off, 1.0, 1.0])) == expected
    core["sensors.spent"] = (0.0, 0.02)
    assert core.call("t_is_surprising", packed, np.array([0.0, 0.0, 1.0, 1.0])) == 1


@pytest.mark.parametrize(
    ("one", "other", "score"),
    [
        ((6.0, 4.0), (0.0, 1.0), 3.0),
        ((6.0, 0.9e8), (0.0, 1.0), 6.0 / np.sqrt(0.9e8)),
        ((6.0, 1.1e8), (0.0, 1.0), NAN),
        ((6.0, 1.1e8), (0.0, 2.0), 6.0 / np.sqrt(1.1e8)),
        ((1e162, np.inf), (0.0, 1.0), NAN),
        ((1e162, np.inf), (0.0, np.inf), NAN),
        ((NAN, 1.0), (0.0, 1.0), NAN),
        ((6.0, NAN), (0.0, 1.0), NAN),
        ((6.0, 4.0), (NAN, NAN), 3.0),
    ],
)
def test_a_past_that_expects_any_reading_is_not_borne_out_by_one(
    one: tuple[float, float], other: tuple[float, float], score: float
) -> None:
    """An innovation is told in sd, unless its past is 10^4 times as uncertain as the other, or without end."""
    core = bare(CALLS)
    pairs = [np.array([pair[0], 0.0, pair[1], 1.0]) for pair in (one, other)]
    core.call("t_score", *pairs)
    assert core["inputs.gain"][0] == pytest.approx(score, nan_ok=True)


def test_a_past_beyond_all_sense_leaves_no_doubt() -> None:
    """States may be where the other past has them, up to a hundred times as far as they go, unless that is absurd."""
    core = begun()
    place = core.spec.sample_fields["gap"]
    core["healthy.travel"], core["healthy.lane"][0] = (0.0, 6.0), 2.0

    def doubted(apart: float) -> float:
        packed = np.zeros(core.spec.n_sample)
        core.call("t_doubt", np.array([apart]), packed)
        return float(packed[place][0])

    assert doubted(5.0) == pytest.approx(5.0, rel=0.1)
    assert doubted(2e3) == pytest.approx(600.0)
    assert doubted(5e4) == pytest.approx(600.0)
    for apart in (7e4, -7e4, 1e67, 1e300, np.inf, NAN):
        assert doubted(apart) == 0.0


def test_an_alarm_of_which_nothing_is_left_ends() -> None:
    """With the filter all lanes may run away, and then nothing can be told of the alarm any more."""
    assert bare(CALLS).call("t_alarm", np.array([-12.0])) == 7
    for likelihood in (NAN, -np.inf):
        core = bare(CALLS)
        core["clock.detections"] = 1
        assert core.call("t_alarm", np.array([likelihood])) == -1
        assert core["clock.detections"][0] == 1
        assert core["sure.since"][0] == -1
        assert not core.lane(1).any()
    assert bare(CALLS).call("t_alarm_of_slot") == 7  # that a sensor sticks may be all that is left


def drifted(rate: float, wander: float, dt: float, start: float = 1.0, sd: float = 0.1) -> tuple[float, float]:
    """A parameter and its variance after a time in which it drifts."""
    core = begun()
    place = core.spec.parameter_slice.start
    spread = covariance_place(core.spec, place, place)
    core["healthy.lane"][[place, spread]] = start, sd**2
    lane = np.zeros(core.spec.n_numbers)
    core.call("t_drift", np.array([rate, wander, dt]), lane)
    rest = np.delete(np.arange(len(lane)), [place, spread])
    assert np.array_equal(lane[rest], core["healthy.lane"][rest])
    return float(lane[place]), float(lane[spread])


def test_a_drift_is_followed_as_far_as_a_parameter_goes() -> None:
    """Over a sample it moves by its rate, and is less certain by that; over no gap farther than its range, or 10."""
    assert drifted(1e-3, 5e-4, 0.5) == (1.0 + 1e-3 * 0.5, 0.1**2 + (5e-4 * 0.5) ** 2)
    assert drifted(4.0, 2.0, 1e9) == pytest.approx((11.0, 0.1**2 + 5.0**2))
    assert drifted(4.0, 2.0, 1e9, start=45.0) == pytest.approx((50.0, 0.1**2 + 5.0**2))
    assert drifted(-4.0, 2.0, 1e9) == pytest.approx((0.02, 0.1**2 + 5.0**2))
    assert drifted(0.0, 0.3, 1e300) == pytest.approx((1.0, 10.0**2))
    assert drifted(4.0, 2.0, 1e9, sd=9.9) == pytest.approx((11.0, 10.0**2))
    assert drifted(1e-3, 2.0, 0.5, sd=60.0) == (1.0 + 1e-3 * 0.5, 60.0**2)
    assert drifted(0.0, 0.0, 1e9) == (1.0, 0.1**2)
