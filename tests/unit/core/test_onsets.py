"""Which samples are tried as onset, and the trail that they are places of."""

import ctypes
from functools import cache

import numpy as np
import pytest

from bare_core import CELL, Bare, at, bare, compiled, in_c
from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.spec import Thresholds
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import parse_model
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.specify import build_spec

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SETTINGS = core_settings()
DENSE, MOST_BURSTS, EVERY, WALKS, RATIO, SETTLES, OLD = (
    int(SETTINGS[name])
    for name in ("DENSE", "MOST_BURSTS", "WALK_EVERY", "WALKS", "WALK_RATIO", "WALK_SETTLES", "OLD_WINDOW")
)
HISTORY, SMOOTH = Thresholds().history_samples, SETTINGS["SMOOTH"]
SPARE, WANTED, SURE = range(3)  # what is to be done with an onset
PLACES = """
#include "onsets.h"
static Past past;
static Trail trail;
static Search search;
static PlainBlock group, best;
int64_t t_search(int64_t n, int64_t alarm, int64_t change, int64_t likeliest, int64_t first, int64_t *places,
                 int64_t *standing)
{
    trail.n = n;
    trail.alarm = alarm;
    trail.first = first;
    begin_search(&trail, change, likeliest, 0, &search);
    search.least = -1e9;
    memcpy(places, search.place, sizeof search.place);
    memcpy(standing, search.standing, sizeof search.standing);
    return search.n;
}
int64_t t_first(int64_t begun, int64_t oldest, int64_t alarm, int64_t slow)
{
    static Clock clock;
    static Alarm raised;
    static const Beginning beginning = {-1, 0, 0};
    clock.begun = begun;
    raised.slow = slow;
    trail.oldest = oldest;
    trail.alarm = alarm - oldest;
    find_first(&clock, &raised, &beginning, &trail);
    return trail.first;
}
int64_t t_near(const int64_t *places, int64_t *standing)
{
    begin_near(places, &search);
    memcpy(standing, search.standing, sizeof search.standing);
    return search.n;
}
/* Try onsets until there are enough: said[place][lane]; tells how many, which, and the lanes that come out. */
int64_t t_seek(const double *said, double least, int64_t *tried, double *told, int64_t *chosen)
{
    int64_t n = 0, k;
    search.least = least;
    while ((k = next_onset(&search)) >= 0) {
        tried[n++] = search.place[k];
        for (int l = 0; l < GROUP; l++) {
            group[0][l] = (double)search.place[k];
            group[PLAIN_LIKELIHOOD][l] = said[search.place[k] * GROUP + l];
        }
        mix(&search, k, group[PLAIN_LIKELIHOOD], group, PLAIN_NUMBERS, best);
    }
    mean_over_onsets(&search, told);
    for (int l = 0; l < GROUP; l++) {
        chosen[l] = (int64_t)best[0][l];
    }
    return n;
}
/* Samples of the trail at which the model does not hold. */
void t_outside(int64_t first, int64_t end)
{
    for (int64_t k = 0; k < trail.n; k++)
        row_of(&past, trail.oldest + k)->sample[SAMPLE_STILL] = k >= first && k < end ? 2.0 : 0.0;
}
/* Bursts of a trail of this wildness, whose rows go round the end of those that are kept. */
int64_t t_bursts(const double *wildness, int64_t n, int64_t *places)
{
    trail.past = &past;
    trail.oldest = N_ROWS - 3;
    trail.n = n;
    trail.alarm = n - 1;
    for (int64_t k = 0; k < n; k++) row_of(&past, trail.oldest + k)->wildness = wildness[k];
    find_bursts(&trail);
    memcpy(places, trail.bursts, sizeof trail.bursts);
    return trail.n_bursts;
}
"""
STATES = """
static Trail trail;
void t_trail(State *state, double *found)
{
    trail_of(state, &trail);
    found[0] = (double)trail.oldest;
    found[1] = (double)trail.n;
    found[2] = (double)trail.alarm;
    found[3] = trail.old ? trail.old[0] : NAN;
    found[4] = (double)trail.n_bursts;
    for (int k = 0; k < trail.n_bursts; k++) found[5 + k] = (double)trail.bursts[k];
}
void t_wild(State *state, const double *number, const double *wildness)
{
    row_of(&state->past, (int64_t)*number)->wildness = *wildness;
}
void t_wildness(State *state, const double *packed, const double *innovations)
{
    state->inputs.gain = wildness_of(packed, innovations);
}
"""


@cache
def library() -> ctypes.CDLL:
    """The trail of a cell."""
    plant = build_plant(parse_model(CELL))
    text = model_text(build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True))
    return compiled(text + in_c(PLACES))


def onsets(
    alarm: int,
    change: int,
    bursts: tuple[int, ...] = (),
    first: int = 0,
    outside: tuple[int, int] = (0, 0),
    likeliest: int = -1,
) -> dict[int, int]:
    """Onsets of a trail of 330 samples, from a first on, and what is to be done with each.

    outside : from which sample up to before which the model does not hold
    likeliest : where others were likeliest
    """
    places, standing, wild = np.zeros(400, dtype=np.int64), np.zeros(400, dtype=np.int64), np.zeros(330)
    wild[[*bursts]] = 9.0
    library().t_bursts(at(wild), ctypes.c_int64(330), at(places))
    library().t_outside(*map(ctypes.c_int64, outside))
    numbers = (ctypes.c_int64(item) for item in (330, alarm, change, likeliest, first))
    n = library().t_search(*numbers, at(places), at(standing))
    return dict(zip(places[:n].tolist(), standing[:n].tolist(), strict=True))


def sought(said: FloatArray, least: float = -1e9) -> tuple[list[int], FloatArray, IntArray]:
    """Places that are tried where onsets say this, (330, 8); the likelihood of each lane, and its best place."""
    tried, told, chosen = np.zeros(400, dtype=np.int64), np.zeros(8), np.zeros(8, dtype=np.int64)
    n = library().t_seek(at(np.ascontiguousarray(said)), ctypes.c_double(least), at(tried), at(told), at(chosen))
    return tried[:n].tolist(), told, chosen


def bursts(wildness: FloatArray) -> tuple[int, ...]:
    """Places at which samples of this wildness begin a burst."""
    places = np.zeros(MOST_BURSTS, dtype=np.int64)
    n = library().t_bursts(at(wildness), ctypes.c_int64(len(wildness)), at(places))
    return tuple(places[:n].tolist())


def test_no_onset_lies_in_the_warm_up() -> None:
    """But where the alarm comes soon after it, or without a sum; the earliest that may be one is tried."""
    warm = Thresholds().warm_up_samples
    for begun, oldest, alarm, slow, wanted in (
        (7, 7, 7 + 2 * warm, 0, warm),
        (7, 7, 6 + 2 * warm, 0, 1),
        (7, 7, 7 + 5 * warm, 1, 1),
        (7, 12, 7 + 5 * warm, 0, warm - 5),
        (7, 7 + warm, 7 + 5 * warm, 0, 1),
    ):
        assert library().t_first(*map(ctypes.c_int64, (begun, oldest, alarm, slow))) == wanted
    whole, found = onsets(250, 240, bursts=(30,)), onsets(250, 240, bursts=(30,), first=100)
    assert min(found) == min(place for place in whole if place >= 100)
    assert set(found) <= set(whole)
    assert found[min(found)] == WANTED


def test_onsets_are_dense_before_the_alarm_and_few_are_tried_first() -> None:
    """Each of the last samples before the alarm may be tried, sparse ones elsewhere; every fourth is at first."""
    found = onsets(250, 240)
    assert set(range(250 - DENSE, 251)) <= set(found)
    assert {240, 251, 252, 254, 258, 266, 282, 314} <= set(found)
    back = np.array(sorted(250 - place for place in found if place <= 250))
    assert np.all(np.diff(back) <= 0.05 * back[:-1] + 1.0)
    assert np.count_nonzero(back > DENSE) < 50
    assert [place for place, standing in found.items() if standing == SURE] == [240]
    wanted = [place for place, standing in found.items() if standing == WANTED]
    assert {min(found), 250, max(found)} <= set(wanted)
    assert len(wanted) < 0.3 * len(found)
    assert max(onsets(329, 240)) == 329


def test_bursts_are_tried() -> None:
    """Where innovations became wild, and one sample before it; never before the trail."""
    plain, found = onsets(329, 320), onsets(329, 320, (1, 137))
    assert set(found) - set(plain) <= {1, 136, 137}
    assert [place for place, standing in found.items() if standing == SURE] == [1, 136, 137, 320]
    assert min(found) >= 1


def test_where_the_model_holds_again_is_tried() -> None:
    """While it did not hold, as while a pump was off, a fault may have begun."""
    plain, found = onsets(329, 320), onsets(329, 320, outside=(91, 137))
    assert set(found) - set(plain) <= {137}
    assert [place for place, standing in found.items() if standing == SURE] == [137, 320]
    assert onsets(329, 320, outside=(91, 330)) == plain


def exhaustive(said: FloatArray, tried: list[int]) -> FloatArray:
    """The mean likelihood of each lane over all samples from the first onset to the last, straight between."""
    known, places = sorted(tried), np.arange(min(tried), max(tried) + 1)
    straight = np.array([np.interp(places, known, lane) for lane in said[known].T])
    return np.asarray(np.logaddexp.reduce(straight, axis=1) - np.log(HISTORY))


def hills(generator: np.random.Generator, kind: str) -> FloatArray:
    """What onsets say of eight lanes, (330, 8), up to an alarm at place 250."""
    place, said = np.arange(330.0)[:, None], np.full((330, 8), -1e4)
    tops = generator.uniform(150.0, 248.0, 8)
    if kind == "peak":
        said = -generator.uniform(0.2, 0.5, 8) * np.abs(place - generator.uniform(215.0, 248.0, 8))
    elif kind == "broad":
        said = -0.5 * ((place - tops) / generator.uniform(8.0, 20.0, 8)) ** 2
    elif kind == "two":
        said = np.maximum(-0.5 * np.abs(place - tops), -1.0 - 0.5 * np.abs(place - tops + 80.0))
    elif kind == "flat":
        said = np.zeros((330, 8)) + 1e-9 * place
    return np.asarray(said - 300.0 - np.arange(8.0))


@pytest.mark.parametrize("kind", ["peak", "broad", "two", "flat"])
def test_few_onsets_tell_what_all_would(kind: str) -> None:
    """The best that is tried is nearly as likely as the best there is, and the sum of all is known, from few."""
    generator, n = np.random.default_rng(3), []
    for _ in range(20):
        places = np.array([*onsets(250, 200)])
        said = hills(generator, kind)
        tried, told, chosen = sought(said)
        assert 200 in tried
        assert len(tried) == len(set(tried))
        assert np.all(said[chosen, np.arange(8)] >= said[places].max(axis=0) - SMOOTH)
        assert np.array_equal(said[chosen, np.arange(8)], said[tried].max(axis=0))
        if kind != "flat":
            assert told == pytest.approx(exhaustive(said, places.tolist()), abs=0.5)
        n.append(len(tried) / len(places))
    assert np.mean(n) < {"peak": 0.8, "broad": 0.7, "two": 0.9, "flat": 0.4}[kind]


def test_the_mean_is_over_all_samples_between_what_was_tried() -> None:
    """Each sample between two onsets that were tried says what lies straight between what these say."""
    said = np.random.default_rng(5).normal(-50.0, 3.0, (330, 8))
    said[:, 0], said[:, 1] = -20.0, -1e5 * np.arange(330)
    onsets(250, 200)
    tried, told, _ = sought(said)
    assert told == pytest.approx(exhaustive(said, tried), rel=1e-9)


def test_a_jump_at_a_burst_is_found() -> None:
    """A lane that only fits where it begins at the burst has its peak there, however unlikely all about it is."""
    said = np.full((330, 8), -500.0)
    said[[136, 137]] = [[-80.0], [-40.0]]
    onsets(250, 200, (137,))
    _, _, chosen = sought(said)
    assert np.all(chosen == 137)


def test_hopeless_lanes_are_not_sought_closely() -> None:
    """Where one lane leads by far, onsets between the first are tried where it moves, and not where others do."""
    generator = np.random.default_rng(4)
    said = hills(generator, "peak")
    said[:, 1:] += generator.normal(0.0, 5.0, (330, 7))
    onsets(250, 200)
    every, _, _ = sought(said)
    said[:, 1:] -= 1000.0
    every_place = [*onsets(250, 200)]
    few, told, _ = sought(said, least=said[:, 0].max() - 40.0)
    assert len(few) < 0.6 * len(every)
    assert told[0] == pytest.approx(exhaustive(said, every_place)[0], abs=0.5)


@pytest.mark.parametrize("change", [100, 245])
def test_a_bad_estimate_of_the_onset_hides_none(change: int) -> None:
    """The likelihood of the right lane rises only near its onset, and the estimate lies far after it, or before.

    There the lane has no hope, and the last onsets say next to nothing. Where others are likely it has.
    """
    said = np.full((330, 8), -340.0)
    place = np.arange(330.0)[:, None]
    said -= 0.001 * place
    said[:, :1] = np.maximum(said[:, :1], -290.0 - 2.0 * np.abs(place - 180.0))
    said[change] += 7.0
    assert onsets(250, change, likeliest=187)[187] == SURE
    tried, _, chosen = sought(said, least=-310.0)
    assert abs(chosen[0] - 180) <= 2
    onsets(250, change)
    few, _, _ = sought(said, least=-310.0)
    assert len(few) < 0.5 * len(tried)
    onsets(250, change)
    _, _, chosen = sought(said)
    assert abs(chosen[0] - 180) <= 2


def test_lanes_that_begin_again_do_so_near_where_they_began() -> None:
    """At the onsets that are nearest, and here and there between them if they are far apart, and nowhere else."""
    every, standing = np.array([*onsets(250, 200)]), np.zeros(400, dtype=np.int64)
    began = np.array([-30, 120, 245, 245, 245, 246, 245, 900])
    library().t_near(at(began), at(standing))
    sure = every[np.flatnonzero(standing[: len(every)] == SURE)]
    nearest = {int(every[np.argmin(np.abs(every - place))]) for place in began}
    assert nearest <= set(sure.tolist())
    assert set(standing[: len(every)].tolist()) == {SPARE, SURE}
    assert len(sure) <= len(nearest) + 3


@pytest.mark.parametrize(("began", "top"), [([120], 20), ([120], 310), ([120, 200], 20), ([200, 120], 310)])
def test_lanes_that_begin_again_look_farther_where_an_end_still_matters(began: list[int], top: int) -> None:
    """Beyond the first and the last that are tried, even where these are less likely than another one by little."""
    standing = np.zeros(400, dtype=np.int64)
    onsets(250, 200)
    library().t_near(at(np.resize(began, 8)), at(standing))
    place, end = np.arange(330.0)[:, None], began[0]
    said = -300.0 - 0.3 * np.abs(place - top) - 0.01 * np.arange(8.0)
    if len(began) > 1:  # at the other end it is likelier
        said = np.maximum(said, said[end] + 5.0 - np.abs(place - began[1]))
    _, _, chosen = sought(said)
    assert np.all(np.abs(chosen - top) <= 20)


def test_bursts_begin_where_innovations_become_wild() -> None:
    """Of a run of wild samples the first counts, what is no number does not, and of many the wildest are kept."""
    wild = np.zeros(200)
    wild[[60, 61, 120, 150]] = 40.0, 45.0, 30.0, np.nan
    assert bursts(wild) == (60, 120)
    wild[:] = 0.0
    places = 10 + 10 * np.arange(12)
    wild[places] = np.array([20, 31, 22, 23, 35, 25, 26, 27, 28, 29, 30, 21])
    kept = sorted(places[np.argsort(wild[places])[-MOST_BURSTS:]].tolist())
    assert bursts(wild) == tuple(kept)
    wild[places] = 20.0 + np.arange(12)
    assert bursts(wild) == tuple(places[-MOST_BURSTS:])


def test_the_first_sample_of_a_trail_begins_no_burst() -> None:
    """What was wild before the trail begins there in no place that a lane could begin at."""
    assert bursts(np.array([9.0, 8.0, 0.0, 9.0, 9.0])) == (1, 3)
    assert bursts(np.array([9.0, 0.0, 0.0])) == ()


def test_how_wild_a_sample_is() -> None:
    """As its largest innovation that is there, in its sd; of a filter that has run away nobody knows."""
    core = bare(STATES)
    packed, found = np.zeros(core.spec.n_sample), []
    packed[core.spec.sample_fields["use"]] = 1.0, 1.0
    for off in ((-8.0, 3.0, 4.0, 1.0), (2.0, 5.0, 4.0, 1.0), (np.nan, 5.0, 4.0, 1.0), (2.0, np.inf, 4.0, 1.0)):
        core.call("t_wildness", packed, np.array(off))
        found.append(core["inputs.gain"][0])
    assert found == pytest.approx([4.0, 5.0, np.nan, np.inf], nan_ok=True)
    packed[core.spec.sample_fields["use"]] = 0.0, 1.0
    core.call("t_wildness", packed, np.array([np.nan, 5.0, 4.0, 1.0]))
    assert core["inputs.gain"][0] == 5.0


def running(**clock: int) -> Bare:
    """A core whose clock stands so."""
    core = bare(STATES)
    for name, value in {"begun": 0, "running": 1, **clock}.items():
        core[f"clock.{name}"] = value
    return core


def trail_of(core: Bare) -> FloatArray:
    """The number of its oldest sample, samples, place of the alarm, number of the old lane; bursts."""
    found = np.full(5 + MOST_BURSTS, np.nan)
    core.call("t_trail", found)
    return found[: 5 + int(found[4])]


def test_a_trail_knows_where_the_alarm_was() -> None:
    """It has samples of after the alarm too, but looks for bursts before it only; its length has an end."""
    core = running(index=900, alarm=850)
    for number in (700, 850, 870):
        core.call("t_wild", np.array([float(number)]), np.array([8.0]))
    kept = core.spec.thresholds.history_samples + 2
    oldest = 901 - kept
    assert trail_of(core)[[0, 1, 2, 4, 5, 6]].tolist() == [oldest, kept, 850 - oldest, 2, 700 - oldest, 850 - oldest]
    core["clock.alarm"] = -1
    assert trail_of(core)[[0, 1, 2, 4]].tolist() == [oldest, kept, kept - 1, 3]


@pytest.mark.parametrize("name", ["begun", "accepted"])
def test_a_trail_begins_with_the_run_or_what_was_accepted(name: str) -> None:
    """What was before is of another plant."""
    assert trail_of(running(index=900, **{name: 850}))[:3].tolist() == [850, 51, 50]


def numbered(**clock: int) -> Bare:
    """The same with lanes that are kept for long, each with its number."""
    core = running(**clock)
    core["healthy.snapshots"] = np.repeat(
        np.arange(2.0 * WALKS + 1.0), core.spec.n_numbers + len(core.spec.parameters) + 2
    )
    return core


def oldest_kept(index: int, first: int) -> float:
    """Which lane is the oldest of the longest window, up to the one that counts, of which one was kept."""
    for window in range(OLD, -1, -1):
        length = EVERY * RATIO**window
        kept = [number for number in range(index // length + 1) if first <= number * length < index]
        if kept:
            return float(2 * window + kept[-2:][0] % 2)
    return float("nan")


@pytest.mark.parametrize("accepted", [-1, 400])
def test_the_lane_of_long_ago_is_the_oldest_of_the_longest_window(accepted: int) -> None:
    """Of each window the last two are there, from a while after the start, or after what was accepted."""
    for index in (150, 300, 500, 700, 701, 1300, 2800, 5400, 5401, 20_000):
        core = numbered(index=index, accepted=accepted)
        expected = oldest_kept(index, max(0, accepted) + SETTLES)
        assert trail_of(core)[3] == pytest.approx(expected, nan_ok=True), index


def test_no_lane_of_after_the_alarm_is_an_old_one() -> None:
    """After an alarm none is kept any more, and the old one is that which there was at the alarm."""
    for index in (1000, 4000):
        assert trail_of(numbered(index=index, alarm=900))[3] == trail_of(numbered(index=900))[3]


def test_the_lane_from_before_a_walk_is_the_old_one() -> None:
    """Where a walk that began before the trail raised the alarm."""
    core = numbered(index=4000, alarm=3900)
    core["alarm.old"] = 2 * WALKS
    assert trail_of(core)[3] == 2.0 * WALKS
