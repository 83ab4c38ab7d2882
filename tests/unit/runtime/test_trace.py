"""What a run leaves behind for people."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from faultbond.contract.findings import (
    Advice,
    Candidate,
    Decider,
    Decision,
    Detection,
    Diagnosis,
    Suspect,
    Unexplained,
)
from faultbond.contract.samples import STATUSES, Reports, Samples, Status
from faultbond.contract.spec import EngineSpec, InputSpec, OutputSpec, SlowErrorSpec, Thresholds
from faultbond.runtime.trace import LASTING, LEAST, MAX_DIAGNOSES, MAX_EVENTS, MOST_SHOWN, Trace
from faultbond.types import CheckKind

SPEC = EngineSpec(
    model="m",
    model_sha256="",
    version="0",
    sample_time=1.0,
    states=(),
    slow_errors=(
        SlowErrorSpec(name="line.f", sd=0.02, memory=600.0, limit=1.6),
        SlowErrorSpec(name="level", sd=0.002, memory=40.0, limit=np.inf),
    ),
    parameters=(),
    inputs=(InputSpec(name="u", noise=0.0, settling=0.0, step=1.0, step_part=0.0),),
    outputs=tuple(
        OutputSpec(name=name, noise=1.0, direct_inputs=(), unit="", unit_factor=1.0, unit_offset=0.0)
        for name in ("flow", "level")
    ),
    loops=(),
    hypotheses=(),
    thresholds=Thresholds(),
)
ADVICE = (Advice(kind=CheckKind.COMPONENT, target="pipe", gain=0.9, cost=1.0, separates=()),)


def samples(first: int, last: int) -> Samples:
    """Give samples, the last left out, whose values tell their numbers."""
    k = np.arange(float(first), last)
    missing = np.full(k.shape, np.nan)
    return Samples(time=k, dt=np.ones(k.shape), u=k[:, None] + 0.5, y=np.column_stack([k + 0.1, missing]))


def sample(k: int) -> Samples:
    """Give one of them."""
    return samples(k, k + 1)


def reports(first: int, last: int, detection: Detection | None = None, diagnosis: Diagnosis | None = None) -> Reports:
    """Give reports whose values tell their numbers, with what was found at the last."""
    k = np.arange(float(first), last)
    return Reports(
        status=np.full(k.shape, STATUSES.index(Status.WATCHING)),
        wild=np.zeros(k.shape, dtype=np.intp),
        expected=np.column_stack([k + 0.2, k + 0.3]),
        variance=np.tile([4.0, 9.0], (len(k), 1)),
        cusum=np.column_stack([k + 0.4, k + 0.6]),
        slow=np.column_stack([k + 0.7, k + 0.8]),
        left_out=np.zeros((len(k), 2), dtype=bool),
        detection=detection,
        diagnosis=diagnosis,
    )


def report(k: int, detection: Detection | None = None, diagnosis: Diagnosis | None = None) -> Reports:
    """Give one of them."""
    return reports(k, k + 1, detection, diagnosis)


def diagnosis(k: int) -> Diagnosis:
    """Give a diagnosis of a time."""
    return Diagnosis(time=float(k), candidates=())


def test_columns_stand_in_their_places() -> None:
    """Every value comes back in the field and the row where it belongs; only slow errors that can alarm are kept."""
    trace = Trace(SPEC)
    for k in range(3):
        trace.add(sample(k), report(k))
    history = trace.history()
    rows = np.arange(3.0)
    assert history.time == pytest.approx(rows)
    assert history.measured[:, 0] == pytest.approx(rows + 0.1)
    assert np.isnan(history.measured[:, 1]).all()
    assert history.expected == pytest.approx(np.column_stack([rows + 0.2, rows + 0.3]))
    assert history.expected_sd == pytest.approx(np.tile([2.0, 3.0], (3, 1)))
    assert history.inputs[:, 0] == pytest.approx(rows + 0.5)
    assert history.cusum == pytest.approx(np.column_stack([rows + 0.4, rows + 0.6]))
    assert history.slow[:, 0] == pytest.approx(rows + 0.7)
    assert history.slow_names == ("slow error of line.f",)
    assert (history.cusum_limit, history.slow_limits.tolist()) == (26.0, [1.6])


def test_what_lags_stands_beside_its_sample() -> None:
    """What a late method expects is moved to the sample that it is of, the statistic is not; the end is open."""
    trace = Trace(SPEC, lag=2)
    for k in range(5):
        trace.add(sample(k), report(k))
    history = trace.history()
    assert history.expected[:3, 0] == pytest.approx([2.2, 3.2, 4.2])
    assert np.isnan(history.expected[3:]).all()
    assert np.isnan(history.expected_sd[3:]).all()
    assert history.cusum[:, 0] == pytest.approx(np.arange(5) + 0.4)
    short = Trace(SPEC, lag=9)
    short.add(sample(0), report(0))
    assert np.isnan(short.history().expected).all()


def test_arrays_are_frozen_and_a_run_goes_on() -> None:
    """A history does not change when more samples come, and nobody can write into it."""
    trace = Trace(SPEC)
    trace.add(sample(0), report(0))
    history = trace.history()
    trace.add(sample(1), report(1))
    assert history.time.shape == (1,)
    with pytest.raises(ValueError, match="read-only"):
        history.cusum[0, 0] = 1.0


def test_detections_and_diagnoses_are_kept_in_order() -> None:
    """The alarm, the diagnoses and the one given last are all there, none of them twice."""
    trace = Trace(SPEC)
    detection = Detection(time=1.0, sample=1, change_time=0.0, signals=("flow",))
    trace.add(sample(0), report(0))
    trace.add(sample(1), report(1, detection, diagnosis(1)))
    trace.conclude(diagnosis(2))
    history = trace.history()
    assert history.detections == (detection,)
    assert [item.time for item in history.diagnoses] == [1.0, 2.0]


@pytest.mark.parametrize(("newest", "most"), [(None, MAX_DIAGNOSES), (10, MOST_SHOWN)])
def test_diagnoses_of_a_long_run_are_thinned(newest: int | None, most: int) -> None:
    """However long a run is, a bounded number of evenly spaced diagnoses is kept, the last one always."""
    trace = Trace(SPEC, newest=newest)
    for k in range(4 * most + 3):
        trace.conclude(diagnosis(k))
    times = [item.time for item in trace.history().diagnoses]
    assert most / 2 < len(times) <= most + 1
    assert times[0] == 0.0
    assert times[-1] == 4 * most + 2
    assert len(set(np.diff(times[:-1]))) == 1


def test_a_run_without_end_keeps_what_is_of_now() -> None:
    """Diagnoses since the last alarm, however many came before, and the newest alarms and decisions."""
    trace = Trace(SPEC, newest=10)
    alarms = [
        Detection(time=float(k), sample=k, change_time=float(k), signals=("flow",)) for k in range(2 * MAX_EVENTS)
    ]
    for k, alarm in enumerate(alarms):
        trace.add(sample(k), report(k, alarm))
        assert trace.history().diagnoses == ()
        for n in range(10):
            trace.conclude(diagnosis(k + n))
        decision = Decision(time=float(k), candidate=said(k, "K1", None).candidates[0], by=Decider.RULE)
        trace.reject(decision)
        trace.accept(decision)
    history = trace.history()
    assert [item.time - alarms[-1].time for item in history.diagnoses] == list(range(10))
    assert history.detections == tuple(alarms[-MAX_EVENTS:])
    assert len(history.accepted) == len(history.rejected) == MAX_EVENTS
    assert history.accepted[-1] == decision


def test_of_earlier_diagnoses_what_a_curve_shows_is_kept() -> None:
    """Of a run without end; the last one is whole, and a run that ends keeps all."""
    shares = (0.9, 2 * LEAST, LEAST, 0.9 * LEAST, 0.0)
    ranked = tuple(replace(said(0, f"K{n}", None).candidates[0], probability=p) for n, p in enumerate(shares))
    for newest, kept in ((10, 3), (None, 5)):
        trace = Trace(SPEC, newest=newest)
        for k in range(3):
            trace.conclude(Diagnosis(time=float(k), candidates=ranked, advice=ADVICE))
        first, second, last = trace.history().diagnoses
        assert first.candidates == second.candidates == ranked[:kept]
        assert first.advice == (() if newest else ADVICE)
        assert last.candidates == ranked
        assert last.advice == ADVICE


def test_without_curves_memory_is_fixed() -> None:
    """Without curves the first and the last sample and the last diagnosis remain."""
    trace = Trace(SPEC, curves=False)
    for k in range(100):
        trace.add(sample(k), report(k, diagnosis=diagnosis(k)))
    history = trace.history()
    assert history.time.tolist() == [0.0, 99.0]
    assert [item.time for item in history.diagnoses] == [99.0]


def test_an_empty_run() -> None:
    """Without a sample the arrays are empty and have their columns."""
    history = Trace(SPEC).history()
    assert history.time.shape == (0,)
    assert history.measured.shape == (0, 2)


def test_what_is_open_does_not_depend_on_the_clock() -> None:
    """After the clock was set back, an alarm is of another fault than that accepted before, though its time is less."""
    trace, first, second = (
        Trace(SPEC),
        *(Detection(time=t, sample=1, change_time=t, signals=()) for t in (3600.0, 60.0)),
    )
    trace.add(sample(1), report(1, detection=first))
    assert trace.history().open == first
    candidate = Candidate(suspects=(), probability=1.0, group=True)
    trace.accept(Decision(time=3700.0, candidate=candidate, by=Decider.RULE))
    assert trace.history().open is None
    trace.add(sample(2), report(2, detection=second))
    assert trace.history().open == second


@pytest.mark.parametrize("curves", [True, False])
@pytest.mark.parametrize("edges", [(0, 7), (0, 1, 7), (0, 2, 3, 7)])
def test_blocks_leave_what_samples_leave(edges: tuple[int, ...], curves: bool) -> None:
    """Samples that come in blocks are kept as those that come one by one."""
    one, other = Trace(SPEC, curves=curves), Trace(SPEC, curves=curves)
    for k in range(7):
        one.add(sample(k), report(k))
    for first, last in pairwise(edges):
        other.add(samples(first, last), reports(first, last))
    for name in ("time", "measured", "expected", "expected_sd", "inputs", "cusum", "slow"):
        kept = getattr(one.history(), name)
        assert np.array_equal(getattr(other.history(), name), kept, equal_nan=True)
        assert len(kept) == (7 if curves else 2)


def said(k: int, name: str, sd: float | None, until: int | None = None) -> Diagnosis:
    """A diagnosis of sample k: this leads, and is so far off the flow, if it is, until then or now."""
    leads = Candidate(
        suspects=(Suspect(parameter=name, component=name, nominal=1.0, estimate=2.0, sd=0.1),),
        probability=1.0,
        group=True,
    )
    off = (
        None
        if sd is None
        else Unexplained(signal="flow", sd=sd, since=k - 9.0, until=float(k if until is None else until))
    )
    return Diagnosis(time=float(k), candidates=(leads,), unexplained=off)


def missed_by(*told: Diagnosis, curves: bool = True) -> Unexplained | None:
    """What the last of these did not explain for a while."""
    trace = Trace(SPEC, curves=curves)
    trace.add(sample(0), reports(0, 1, detection=Detection(time=0.0, sample=0, change_time=0.0, signals=("flow",))))
    for item in told:
        trace.conclude(item)
    trace.add(sample(1), reports(1, 2))
    return trace.history().missed


@pytest.mark.parametrize("curves", [False, True])
def test_what_did_not_fit_for_a_while_is_kept(*, curves: bool) -> None:
    """From when to when, and the most of it, of what leads at the end; whether or not curves are kept."""
    sizes = [1.0, 3.0, 2.0, *[1.0] * (LASTING - 3)]
    while_ = [said(10 + k, "K1", sd) for k, sd in enumerate(sizes)]
    before, after = said(5, "K1", None), said(50, "K1", None)
    found = Unexplained(signal="flow", sd=3.0, since=1.0, until=9.0 + LASTING)
    assert missed_by(before, *while_, after, curves=curves) == found
    assert missed_by(before, *while_[1:], after, curves=curves) is None  # a moment
    assert missed_by(*while_, after, curves=curves) is None  # it never fitted before
    assert missed_by(before, *while_, said(50, "K2", None), curves=curves) is None  # something else leads
    stale = [said(10 + k, "K1", 1.0, until=9) for k in range(2 * LASTING)]
    assert missed_by(before, *stale, after, curves=curves) is None  # it is told of what was


def test_a_new_alarm_begins_anew() -> None:
    """What did not fit before belongs to a fault that is known by now."""
    trace = Trace(SPEC)
    trace.add(sample(0), reports(0, 1, diagnosis=said(0, "K1", None)))
    for k in range(1, 2 * LASTING):
        trace.conclude(said(k, "K1", 1.0))
    trace.conclude(said(50, "K1", None))
    assert trace.history().missed is not None
    trace.add(
        sample(51), reports(51, 52, detection=Detection(time=51.0, sample=51, change_time=51.0, signals=("flow",)))
    )
    trace.conclude(said(52, "K1", None))
    assert trace.history().missed is None
