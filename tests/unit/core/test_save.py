"""Saving and restoring: a run goes on as if it had never stopped, and nothing that is damaged is taken."""

import gzip
import os
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from itertools import pairwise
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from cell_course import ACCEPTED, ROWS, cell, course, decide, rows
from faultbond.contract.samples import Report, Reports
from faultbond.errors import RecordingError
from faultbond.runtime.core import at
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.compile import find_compiler
from made import differing

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
NOT_SAVED, OTHER_FORMAT, OTHER_MODEL, DAMAGED = -1, -2, -3, -4
IDLE, STEPS, SLOTS, RAMPS, PAIRS, CLOSER = 105, 84, 90, 95, 97, 113  # rows with no work, or work on such lanes, left
LAST_KEPT = 460  # sample up to which the trail of CLOSER is kept, that begins at sample 1
HEADER = 48  # bytes: mark, format, hash of the model
KEPT, KEPT_ROW = Path(__file__).parents[2] / "golden" / "cell_state.gz", 100
Bytes = NDArray[np.uint8]
NAN, INF = np.nan, np.inf
REFUSED: list[tuple[str, tuple[float, ...]]] = [  # numbers that no run has
    *((f"clock.{name}", (-1, 2**52 + 1, 2**62)) for name in ("index", "detections", "silent")),
    *((f"clock.{name}", (-2, -(2**62))) for name in ("begun", "alarm", "accepted")),
    ("clock.running", (-1, 2)),
    ("clock.quiet", (-1, 3)),
    ("clock.pause", (NAN, INF, -1.0)),
    ("clock.time", (NAN, INF, -INF)),
    *((f"inputs.{name}", (INF, -INF)) for name in ("held", "earlier", "odd")),
    *((f"inputs.{name}", (NAN,)) for name in ("lowest", "highest")),
    *((f"inputs.{name}", (NAN, -1.0, -INF)) for name in ("leap", "since_step")),
    ("inputs.guessed", (NAN, INF, -1.0)),
    ("inputs.habit", (NAN, INF, -0.1, 1.1)),
    ("inputs.odd_since", (-2, 2**53)),
    ("inputs.gain", (NAN, INF, -INF)),
    ("sensors.shown", (NAN,)),
    *((f"sensors.{name}", (NAN, INF, -0.1)) for name in ("spent", "nis", "cusum", "fast", "scatter")),
    *((f"sensors.{name}", (NAN, INF, -1.5, 2.0**53)) for name in ("cusum_start", "scatter_start")),
    ("sensors.before", (INF, -INF)),
    ("healthy.travel", (NAN,)),
    ("healthy.astray", (NAN, -1.0)),
    *((f"healthy.{name}", (NAN, INF, -1.0)) for name in ("windows", "walks", "walk", "walker", "blind")),
    ("healthy.snapshots", (NAN, INF)),
    ("beginning.sample", (-2, 2**53)),
    ("beginning.count", (-1, 2**53)),
    *((name, (-1, 2)) for name in ("beginning.again", "job.search.early")),
    ("bank.sums", (NAN, INF, -1.0)),
    ("bank.since", (NAN, INF, -1.0, 2.0**53)),
    ("bank.rejected", (-1, 2)),
    ("bank.onset", (-1, 2**53)),
    *((f"job.{name}", (-1, 4)) for name in ("kind", "renewals", "pass", "search.standing")),
    *((f"job.{name}", (-2, 2**53)) for name in ("ended", "settled", "onset", "old", "stands_for", "likeliest")),
    *((f"job.{name}", (-1, 2**53)) for name in ("oldest", "end", "spent", "stage", "group", "next", "begins", "began")),
    *((f"job.{name}", (-1, 2**53)) for name in ("n_wanted", "n_singles", "wanted", "lane", "walk.steps")),
    *((f"job.{name}", (-1, 10**3)) for name in ("search.n", "search.place", "search.best")),
    ("job.peak", (NAN, -1.0)),
    ("job.search.fixed", (-1, 2)),
    *((f"normal.{name}", (NAN, INF, -INF)) for name in ("lane", "gain", "offset", "input_offset", "rates")),
    *((f"normal.{name}", (NAN, -1.0)) for name in ("noise", "wander")),
    *((f"alarm.{name}", (NAN, INF)) for name in ("time", "change_time")),
    ("alarm.crossed", (-1, 2)),
    *((f"alarm.{name}", (-2, 10**3)) for name in ("walker", "window", "old")),
    ("alarm.walk", (NAN, INF, -1.0)),
    ("sure.hypothesis", (-2, 2**40)),
    *((f"sure.{name}", (-2, 2**53)) for name in ("since", "clear_since")),
]
EXTREMES = {  # numbers that a run may have
    "clock.index": 2**52,
    "clock.alarm": -1,
    "inputs.held": NAN,
    "inputs.lowest": INF,
    "inputs.leap": INF,
    "inputs.change": NAN,
    "inputs.rival": NAN,
    "sensors.shown": -INF,
    "sensors.cusum_start": -1.0,
    "sensors.before": NAN,
    "healthy.lane": -INF,
    "normal.noise": INF,
    "bank.healthy": NAN,
}


def place_of(name: str) -> slice:
    """Where the numbers of a field stand among the bytes."""
    names, counts = list(cell().fields), [field.count for field in cell().fields.values()]
    k = names.index(name)
    first = HEADER + 8 * sum(counts[:k])
    return slice(first, first + 8 * counts[k])


def sealed(saved: Bytes) -> Bytes:
    """The bytes with the checksum that they should have."""
    saved[-8:] = np.frombuffer(np.array(crc32(saved[:-8].tobytes()), dtype="<u8").tobytes(), dtype=np.uint8)
    return saved


def forged(saved: Bytes, values: Mapping[str, float], which: int | None = None) -> Bytes:
    """Bytes with another value of fields by name: of one number of each, or of all."""
    other = saved.copy()
    for name, value in values.items():
        words = other[place_of(name)].view(np.int64 if cell().fields[name].whole else np.float64)
        words[slice(None) if which is None else which] = value
    return sealed(other)


def refused(saved: Bytes) -> int:
    """What the core says to bytes; where it refuses them its state is as it was."""
    monitor = Monitor(cell(), course().saved[30])
    before = monitor._state.copy()
    said = int(cell().library.fb_restore(at(monitor._state), at(saved), len(saved)))
    assert (said == 0) or np.array_equal(monitor._state, before)
    return said


def told(report: Report) -> list[Any]:
    """All that a report says, so that equal lists are equal reports; nan equals nan."""
    numbers = (report.expected, report.variance, report.cusum, report.slow)
    return [report.status, report.wild, report.detection, repr(report.diagnosis), *(item.tobytes() for item in numbers)]


def test_from_any_sample_on_a_restored_run_is_as_if_it_had_never_stopped() -> None:
    """Each sample of a course, taken by a monitor that was just restored, leaves the same bytes and the same report."""
    samples, whole = rows(), course()
    for k in range(ROWS):
        monitor = Monitor(cell(), whole.saved[k])
        assert np.array_equal(monitor.save(), whole.saved[k])
        if k + 1 == ACCEPTED:
            continue  # what is saved next is what a person has accepted
        assert told(monitor.take(samples[k : k + 1]).last) == told(whole.reports[k])
        decide(monitor, k + 1)
        assert np.array_equal(monitor.save(), whole.saved[k + 1])


def test_what_is_decided_after_restoring_is_the_same() -> None:
    """A restored memory is the same to the last byte, spare lanes too; accepting a candidate leaves the same."""
    monitor = Monitor(cell(), course().saved[ACCEPTED - 1])
    monitor.take(rows()[ACCEPTED - 1 : ACCEPTED])
    restored = Monitor(cell(), monitor.save())
    assert np.array_equal(restored._state, monitor._state)
    decide(restored, ACCEPTED)
    assert np.array_equal(restored.save(), course().saved[ACCEPTED])
    assert restored.number("clock.accepted") == ACCEPTED - 1
    assert differing(restored, monitor)


@settings(max_examples=25, deadline=None)
@given(cuts=st.lists(st.integers(1, ROWS - 1), max_size=12))
def test_blocks_cut_anywhere_give_the_reports_of_single_samples(cuts: list[int]) -> None:
    """Whatever the blocks, each ends early where something is found, and all reports are those of single samples."""
    samples, whole, monitor = rows(), course(), Monitor(cell())
    for first, end in pairwise(sorted({0, 120, ACCEPTED, ROWS, *cuts})):
        decide(monitor, first)
        place = first
        while place < end:
            reports = monitor.take(samples[place:end])
            assert 1 <= len(reports) <= end - place
            singles = whole.reports[place : place + len(reports)]
            assert_equal(reports, singles)
            assert [k for k, item in enumerate(singles[:-1]) if item.detection or item.diagnosis] == []
            place += len(reports)
    assert np.array_equal(monitor.save(), whole.saved[-1])


def assert_equal(reports: Reports, singles: Sequence[Report]) -> None:
    """Reports of a block are those of single samples, to the last bit."""
    assert told(reports.last) == told(singles[-1])
    for k, single in enumerate(singles):
        assert (list(type(single.status)).index(single.status), single.wild) == (reports.status[k], reports.wild[k])
        for name in ("expected", "variance", "cusum", "slow"):
            assert getattr(reports, name)[k].tobytes() == getattr(single, name).tobytes()


@pytest.mark.parametrize("row", [150, 280])
@pytest.mark.parametrize("lanes", [1, 4])
def test_a_core_with_other_lanes_side_by_side_goes_on(lanes: int, row: int) -> None:
    """Bytes of a core with eight lanes at a time are those of any other, which goes on with the same digits."""
    other, whole = Monitor(cell(lanes), course().saved[row]), course()
    assert other.core.sizes["work"] < cell().sizes["work"]
    assert np.array_equal(other.save(), whole.saved[row])
    for k in range(row, row + 40):
        assert told(other.take(rows()[k : k + 1]).last) == told(whole.reports[k])
    assert np.array_equal(other.save(), whole.saved[row + 40])


def test_bytes_cut_short_or_too_many_are_refused() -> None:
    """A file that ends too early, or goes on, is refused, wherever that is."""
    saved = np.concatenate([course().saved[150], np.zeros(9, dtype=np.uint8)])
    size = len(saved) - 9
    for length in (0, 7, 8, 15, 16, 17, HEADER - 1, HEADER, HEADER + 8, 4096, size - 8, size - 1, size + 1, size + 8):
        assert refused(saved[:length].copy()) == (NOT_SAVED if length < 16 else DAMAGED), length
    assert refused(saved[:size].copy()) == 0


def test_every_word_at_the_head_is_read() -> None:
    """Another mark is no state, another format of another version, another hash of another model; each bit counts."""
    saved = course().saved[150]
    for bit in range(8 * HEADER):
        other = saved.copy()
        other[bit // 8] ^= 1 << bit % 8
        expected = NOT_SAVED if bit < 64 else OTHER_FORMAT if bit < 128 else OTHER_MODEL
        assert refused(sealed(other)) == expected


def test_a_bit_that_flipped_anywhere_is_seen() -> None:
    """One wrong bit among all numbers, or in the checksum, is damage."""
    saved, generator = course().saved[150], np.random.default_rng(7)
    inside = generator.integers(8 * HEADER, 8 * (len(saved) - 8), 150)
    for bit in (*inside.tolist(), *range(8 * (len(saved) - 8), 8 * len(saved))):
        other = saved.copy()
        other[bit // 8] ^= 1 << bit % 8
        assert refused(other) == DAMAGED, bit
    assert refused(saved) == 0


@pytest.mark.parametrize(("name", "values"), REFUSED)
def test_numbers_that_no_run_has_are_refused(name: str, values: tuple[float, ...]) -> None:
    """Counts and flags are whole and in reach, sums are not negative, and what a run keeps finite is finite."""
    saved = course().saved[150]
    for value in values:
        for which in (0, -1):
            assert refused(forged(saved, {name: value}, which)) == DAMAGED, value


@pytest.mark.parametrize(("name", "value"), EXTREMES.items())
def test_numbers_that_a_run_may_have_are_taken(name: str, value: float) -> None:
    """Nothing seen yet, a sensor out of use, a filter that has run away: all that is restored as it was saved."""
    saved = forged(course().saved[150], {name: value})
    assert np.array_equal(Monitor(cell(), saved).save(), saved)


@pytest.mark.parametrize(
    "numbers",
    [
        {"clock.begun": 151},
        {"clock.alarm": 150},  # the sample that comes next
        {"clock.accepted": 150, "clock.alarm": -1, "job.ended": -1, "job.settled": -1},
        {"clock.accepted": 83},  # after the alarm
        {"clock.index": 302, "clock.begun": 1, "clock.running": 0, "clock.alarm": -1},
        {"clock.index": 10**9, "clock.begun": 0, "clock.running": 0, "clock.alarm": -1},
    ],
)
def test_samples_out_of_order_are_refused(numbers: dict[str, int]) -> None:
    """Nothing happened after the last sample, no diagnosis is of after its alarm, and no start waits for ever."""
    assert refused(forged(course().saved[150], numbers)) == DAMAGED


@pytest.mark.parametrize(
    ("row", "which", "numbers"),
    [
        *((row, None, {"clock.alarm": -1}) for row in (STEPS, SLOTS, RAMPS, PAIRS, CLOSER)),
        (STEPS, None, {"clock.alarm": 83}),  # after the end of the trail
        (STEPS, None, {"job.end": 84}),
        (STEPS, None, {"job.end": 0, "clock.alarm": 0}),
        (STEPS, None, {"job.oldest": 83}),
        (CLOSER, None, {"clock.index": 500, "job.end": 499}),  # a trail longer than what is kept
        (CLOSER, None, {"clock.index": LAST_KEPT + 1}),  # samples of the trail are no longer kept
        *((STEPS, None, {"job.settled": value, "job.ended": value}) for value in (0, 82)),
        (STEPS, None, {"job.renewals": 1}),
        *((CLOSER, None, {name: -1}) for name in ("job.settled", "job.ended")),
        (CLOSER, None, {"job.renewals": 0}),
        (CLOSER, None, {"job.ended": 114}),
        (IDLE, None, {"job.settled": -1}),
        *((STEPS, None, {"job.stage": stage}) for stage in (4, 5)),
        (STEPS, 7, {"job.lane": 12}),  # a lane with a slot
        (SLOTS, 0, {"job.lane": 68}),  # one of a pair that comes and goes
        *((RAMPS, 0, {"job.lane": lane}) for lane in (45, 47, 68)),  # one that begins alone, comes to stay, or goes
        (PAIRS, None, {"job.pass": 1}),
        *((STEPS, None, {"job.search.n": n}) for n in (0, 2)),
        (STEPS, None, {"job.search.standing": 0}),
        (STEPS, 5, {"job.search.place": 1}),  # not in order
        (STEPS, 54, {"job.search.place": 83}),
        (STEPS, None, {"job.onset": 56}),
        *((STEPS, None, {"job.next": value}) for value in (0, 83)),
        *((PAIRS, None, {"job.next": value}) for value in (1, 98)),
        (STEPS, None, {"job.n_singles": 13}),
        (STEPS, None, {"job.n_wanted": 11}),
        (STEPS, None, {"job.n_wanted": 13}),
        (IDLE, 3, {"job.walk.samples": 5}),
        *((CLOSER, 2, {"job.walk.steps": steps}) for steps in (7, 0)),  # more than its samples, or none for these
    ],
)
def test_work_that_contradicts_itself_is_refused(row: int, which: int | None, numbers: dict[str, int]) -> None:
    """What work says of lanes, onsets and samples are places in tables: each is within what it is a place of."""
    assert refused(course().saved[row]) == 0
    assert refused(forged(course().saved[row], numbers, which)) == DAMAGED


def test_no_diagnosis_is_of_before_the_first_sample() -> None:
    """A state that has seen no sample is in no alarm, though all that work says is in order."""
    saved = course().saved[IDLE + 45]
    alarm = {"clock.begun": 0, "clock.alarm": 0, "clock.accepted": -1, "job.ended": 0, "job.settled": 0}
    assert refused(forged(saved, {"clock.index": 1, **alarm})) == 0
    assert refused(forged(saved, {"clock.index": 0, **alarm})) == DAMAGED


def test_samples_at_the_edge_of_order_are_taken() -> None:
    """What happened at the last sample, at the alarm, or while a start was still gathered is in order."""
    edge = {"clock.begun": 150, "clock.alarm": 149, "clock.accepted": 149}
    assert refused(forged(course().saved[150], edge)) == 0
    gathering = {"clock.index": 301, "clock.begun": 1, "clock.running": 0, "clock.alarm": -1}
    assert refused(forged(course().saved[150], gathering)) == 0
    assert refused(forged(course().saved[CLOSER], {"clock.index": LAST_KEPT})) == 0  # slow work on a short trail


def test_the_time_of_a_kept_sample_is_a_number() -> None:
    """Onsets are told by the times of samples that are kept, so these are finite; their filter may have run away."""
    spec, saved = cell().spec, course().saved[150]
    first, width = place_of("settled.until").stop, spec.n_sample + spec.n_numbers + 2
    for row in (0, 41, spec.thresholds.history_samples + 1):
        for number, expected in ((width - 2, DAMAGED), (width - 1, 0), (width - 3, 0), (0, 0)):
            other = saved.copy()
            other[first:].view(np.float64)[row * width + number] = INF
            assert refused(sealed(other)) == expected


def test_whatever_a_state_holds_it_is_refused_or_the_run_goes_on() -> None:
    """Any numbers in any field, with a checksum that is right, are no crash: a run goes on to a diagnosis."""
    generator, taken = np.random.default_rng(5), 0
    wrong = (NAN, INF, -INF, -1.5, -1e300, 1e300, 1e15, 2.0**40, 0.0)
    for name, field in cell().fields.items():
        for value in (-1, 0, 2**40, 2**52) if field.whole else wrong:
            saved = course().saved[150].copy()
            words = saved[place_of(name)].view(np.int64 if field.whole else np.float64)
            words[generator.random(len(words)) < 0.5] = value
            try:
                monitor = Monitor(cell(), sealed(saved))
            except RecordingError as error:
                assert str(error) == "the saved state is damaged. Delete its file to begin anew."  # noqa: PT017 - not all are refused
                continue
            taken += 1
            place = 150
            while place < 156:
                place += len(monitor.take(rows()[place:156]))
            if monitor.finish() is None:
                assert monitor.number("clock.alarm") < 0
    assert taken > 100


@pytest.mark.parametrize(
    ("damage", "match"),
    [
        (lambda saved: saved[:5], "no state of faultbond"),
        (lambda saved: np.concatenate([saved[:8], saved[:8], saved[16:]]), "by another version of faultbond. Delete"),
        (lambda saved: np.concatenate([saved[:16], saved[8:16], saved[24:]]), "or is of another model. Delete"),
        (lambda saved: saved[:-1], "is damaged. Delete"),
    ],
)
def test_what_is_refused_is_said(damage: Callable[[Bytes], Bytes], match: str) -> None:
    """A monitor says in one line what is wrong with what it is given."""
    with pytest.raises(RecordingError, match=match):
        Monitor(cell(), damage(course().saved[150]))


@pytest.mark.skipif(not version("casadi").startswith("3.8"), reason="another CasADi may order operations differently")
def test_bytes_that_were_kept_are_still_read() -> None:
    """A state that was kept as a file is restored, holds what it held, and goes on to the same diagnosis."""
    if os.environ.get("FAULTBOND_GOLDEN") == "rewrite":
        KEPT.write_bytes(gzip.compress(course().saved[KEPT_ROW].tobytes(), mtime=0))
    kept = np.frombuffer(gzip.decompress(KEPT.read_bytes()), dtype=np.uint8)
    monitor, whole = Monitor(cell(), kept), Monitor(cell(), course().saved[KEPT_ROW])
    assert np.array_equal(monitor.save(), kept)
    assert [monitor.number(f"clock.{name}") for name in ("index", "begun", "alarm", "accepted")] == [100, 1, 82, -1]
    assert monitor.number("alarm.time") == 41.0
    for name in cell().fields:
        assert monitor.numbers(name) == pytest.approx(whole.numbers(name), rel=1e-6, abs=1e-9, nan_ok=True), name
    for k in range(KEPT_ROW, KEPT_ROW + 50):
        report = monitor.take(rows()[k : k + 1]).last
        assert report.expected == pytest.approx(course().reports[k].expected, rel=1e-6)
    best = monitor.conclude().candidates[0]
    assert (best.components, best.kind.value) == (("cell",), "step")
    assert best.suspects[0].estimate == pytest.approx(0.6, rel=0.02)
