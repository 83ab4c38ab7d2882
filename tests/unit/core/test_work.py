"""Work on the bank that is spread over samples: what it does, when it ends, and that stopping it changes nothing."""

from functools import cache

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.samples import Sample
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import Thresholds
from faultbond.model.text import parse_model
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from made import EXAMPLES, plant_in_full, recorded, run, samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
BEGINNING, RENEWING, RENEWING_ALL = 1, 2, 3
NAME, FAULT = "dc_motor_current", Fault(parameter="K", factor=0.6, start=2.4)
ROWS = 470
SETTINGS = core_settings()
DEPTH = Thresholds().history_samples + 2
AWAITED, SPREAD = int(SETTINGS["AWAITED"]), int(SETTINGS["SPREAD"])
FIRST_PART = SETTINGS["FIRST_PART"]
RENEWALS = [int(SETTINGS[f"{name}_RENEWAL"]) for name in ("FIRST", "SECOND", "LAST")]
CALLS = """
static Work work;
/* What the next sample may cost, and what a group may cost beyond it, which begins at an onset. */
void t_portion(State *state, double *found)
{
    found[0] = (double)portion_of(state, &work.bank.slots);
    found[1] = (double)(TO_BEGIN * 2 * WIDE_COST);
}
/* When work may end at the latest: the first of [which renewal, the end of its trail, the alarm]. */
void t_latest(State *state, double *told)
{
    state->job.kind = RENEWING;
    state->job.renewals = (int64_t)told[0];
    state->job.end = (int64_t)told[1];
    state->job.oldest = state->job.end - DEPTH + 1;
    state->clock.alarm = (int64_t)told[2];
    told[0] = (double)latest_end(state);
}
/* Let lanes of steps say something at an onset: [which, what]; gives the place of that, of the likeliest so far, and
   how the onset stands with the lanes that begin next. */
void t_hear(State *state, double *told)
{
    Trail trail;
    Job *job = &state->job;
    const int64_t k = (int64_t)told[0];
    trail_of_job(state, &trail);
    job->stage = SLOTS;
    open_search(job, &trail);
    told[0] = (double)job->search.place[k];
    job->search.standing[k] = TRIED;
    for (int l = 0; l < GROUP; l++) job->search.said[k][l] = told[1];
    hear(job);
    open_search(job, &trail);
    told[1] = (double)job->likeliest;
    told[2] = (double)job->search.standing[k];
}
"""


def samples() -> tuple[Sample, ...]:
    """Samples of the motor, with a fault."""
    return recorded(NAME, ROWS, FAULT)


@cache
def whole() -> tuple[Monitor, ...]:
    """The motor before each sample and after the last; not to be changed."""
    found, core = [Monitor(plant_in_full(NAME)[2])], plant_in_full(NAME)[2]
    for sample in samples():
        found.append(run(core, [sample], found[-1])[0])
    return tuple(found)


def alarm() -> int:
    """Samples up to the alarm."""
    return next(k for k, monitor in enumerate(whole()) if monitor.number("clock.alarm") >= 0)


def lanes(monitor: Monitor) -> list[FloatArray]:
    """All lanes of the bank."""
    return [monitor.lane(k) for k in range(plan_lanes(monitor.spec).n_lanes + plan_slots(monitor.spec).n_lanes)]


def kind(monitor: Monitor) -> int:
    """What is worked on."""
    return int(monitor.number("job.kind"))


def spells(monitors: tuple[Monitor, ...]) -> list[tuple[int, int, int]]:
    """Each work: its kind, and the samples after which it was begun and had ended."""
    found = list[tuple[int, int, int]]()
    for k, monitor in enumerate(monitors):
        if kind(monitor) and (not found or found[-1][2] > 0):
            found.append((kind(monitor), k, 0))
        if not kind(monitor) and found and not found[-1][2]:
            found[-1] = (*found[-1][:2], k)
    return found


def test_work_takes_the_way_from_the_alarm_to_the_last_renewal() -> None:
    """Lanes begin at the alarm and again three times, not before it is time, each within the samples that are kept."""
    found = spells(whole())
    assert [item[0] for item in found] == [BEGINNING, RENEWING, RENEWING, RENEWING_ALL]
    assert found[0][1] == alarm()
    assert 1 < found[0][2] - alarm() <= AWAITED
    for (_, begun, ended), earliest in zip(found[1:], RENEWALS, strict=True):
        assert begun - alarm() >= earliest
        assert 1 < ended - begun <= SPREAD
    for (_, _, ended), (_, begun, _), earliest in zip(found, found[1:], RENEWALS, strict=False):
        assert begun == max(ended + 1, alarm() + earliest)


def test_the_first_diagnosis_comes_when_all_lanes_have_begun() -> None:
    """And none before it; then at every twentieth sample after the alarm."""
    _, reports = run(plant_in_full(NAME)[2], samples())
    due = [k + 1 for k, report in enumerate(reports) if report.diagnosis is not None]
    _, _, ended = spells(whole())[0]
    assert due == [ended, *(k for k in range(alarm() + 20, ROWS + 1, 20) if k > ended)]


@pytest.mark.parametrize("later", [0, 1, 4])
def test_portions_change_nothing_but_when_it_ends(later: int) -> None:
    """Where a diagnosis is asked for while lanes begin, these are, bit for bit, those that are spread over samples."""
    _, _, ended = spells(whole())[0]
    monitor = whole()[alarm() + later].copy()
    assert kind(monitor) == BEGINNING
    assert monitor.conclude().candidates
    assert kind(monitor) == 0
    assert monitor.number("job.settled") == alarm() + later - 1
    monitor, _ = run(monitor.core, samples()[alarm() + later : ended], monitor)
    assert ended - alarm() < RENEWALS[0]
    for k in range(ended, alarm() + RENEWALS[0]):
        for one, two in zip(lanes(monitor), lanes(whole()[k]), strict=True):
            assert np.array_equal(one, two, equal_nan=True)
        assert np.array_equal(monitor.numbers("bank.onset"), whole()[k].numbers("bank.onset"))
        monitor, _ = run(monitor.core, samples()[k : k + 1], monitor)


@cache
def portions() -> Bare:
    """The motor's core with the call of these tests."""
    return bare(CALLS, (EXAMPLES / NAME / "model.yaml").read_text(encoding="utf-8"))


def test_no_sample_works_for_more_than_its_portion() -> None:
    """But for what cannot be divided; and it works for all of it, unless the work ends."""
    asked = 0
    for before, after in zip(whole(), whole()[1:], strict=False):
        if not kind(before):
            continue
        portions().restore(before.save())
        found = np.zeros(2)
        portions().call("t_portion", found)
        spent = after.number("job.spent") - before.number("job.spent")
        assert spent <= found.sum()
        assert spent >= found[0] or not kind(after)
        asked += 1
    assert asked > 20


def test_the_onset_that_is_likeliest_so_far_is_tried_by_all_that_begin_next() -> None:
    """And by the next, until another is likelier: where the detector's estimate is bad the right lanes have no hope."""
    required = 2.0
    portions().restore(whole()[alarm() + 1].save())
    for which, what, kept in ((9, 1e6, 9), (6, 2e6, 6), (10, 1e6, 6)):
        told = np.array([which, what, -1.0])
        portions().call("t_hear", told)
        assert (told[1] == told[0], told[2] == required) == (which == kept, which == kept)


def test_portions_are_even() -> None:
    """Where much begins again while time is short, no sample does much more work than the mean one.

    Of a leak of the tank, the first renewal and the second have to end while samples about the alarm are kept. What
    they will cost is known from the work before.
    """
    monitor, spent = Monitor(plant_in_full("tank")[2]), dict[int, list[float]]()
    for sample in recorded("tank", 1300, Fault(parameter="K6", factor=6.0, start=700.0)):
        before = monitor.number("job.spent")
        monitor.push(sample)
        if kind(monitor) == RENEWING and monitor.number("job.spent") > before:
            spent.setdefault(int(monitor.number("job.renewals")), []).append(monitor.number("job.spent") - before)
    assert sorted(spent) == [1, 2]
    assert max(map(max, spent.values())) < 2.6 * np.mean(spent[1] + spent[2])


@pytest.mark.parametrize(
    ("which", "end", "latest"),
    [
        (1, 96, 96 + int(FIRST_PART * (DEPTH - 2 - 96))),
        (2, 96 + SPREAD, DEPTH - 2),
        (2, DEPTH - 2 - SPREAD // 2, DEPTH - 2),
        (2, DEPTH - 1 - SPREAD // 2, DEPTH - 1 + SPREAD // 2),  # too late to hurry
        (3, 96 + SPREAD, 96 + 2 * SPREAD),
    ],
)
def test_slow_work_leaves_the_next_its_samples(which: int, end: int, latest: int) -> None:
    """It ends while its samples are kept, and those about the alarm, if the bank is to begin again after it."""
    told = np.array([which, 1000.0 + end, 1000.0])
    portions().restore(whole()[alarm()].save())
    portions().call("t_latest", told)
    assert told[0] == 1000 + latest


def test_a_plant_that_is_sampled_slowly_is_diagnosed_at_its_alarm() -> None:
    """Where a minute passes between samples there is time for all work at once; in half a second not."""
    slow = CELL.replace("0.5 s", "60 s").replace("1 F", "120 F").replace("3 s", "360 s").replace("20 s", "2400 s")
    waits = []
    for text, dt in ((CELL, 0.5), (slow, 60.0)):
        graph = parse_model(text)
        assert graph.sample_time == dt
        time: FloatArray = np.asarray(dt * np.arange(160), dtype=np.float64)
        u = np.repeat(np.random.default_rng(4).uniform([1.0, 0.1], [4.0, 0.4], (8, 2)), 20, axis=0)
        made = simulate(graph, Inputs(time=time, values=u), [Fault(parameter="C1", factor=0.6, start=80 * dt)], seed=5)
        _, reports = run(build_engine(graph)[1], samples_of(time, made.inputs, made.outputs))
        alarm = next(k for k, report in enumerate(reports) if report.detection is not None)
        waits.append(next(k for k, report in enumerate(reports) if report.diagnosis is not None) - alarm)
    assert waits[0] > 5
    assert waits[1] == 0


def resumed(monitor: Monitor) -> Monitor:
    """One that was saved and restored."""
    return Monitor(monitor.core, monitor.save())


def test_work_that_is_saved_and_restored_goes_on_as_if_never_stopped() -> None:
    """At each sample of every kind of work, to the last byte; after the last renewal too."""
    stopped, kinds = whole()[alarm() - 1], set[int]()
    for k in range(alarm() - 1, ROWS):
        stopped, _ = run(stopped.core, samples()[k : k + 1], resumed(stopped))
        assert np.array_equal(stopped.save(), whole()[k + 1].save())
        kinds.add(kind(stopped))
    assert kinds == {0, BEGINNING, RENEWING, RENEWING_ALL}
