"""A fleet gives each asset, to the last bit, what a monitor of its own gives it."""

from collections.abc import Sequence
from functools import cache
from itertools import pairwise
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from compiled_once import compiled_once
from driven import CORE, graph_of, made, text_of
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Samples
from faultbond.contract.spec import EngineSpec
from faultbond.errors import FaultbondError
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core, load_core
from faultbond.runtime.fleet import AssetEvent, EventKind, Fleet
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault
from faultbond.synthesis.compile import TIDY, find_compiler, required_compiler
from faultbond.synthesis.engine import build_engine
from made import differing
from plants import LAMP

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
ROWS, N_ASSETS, FAULTY = 520, 11, (1, 9)  # one faulty asset among the first eight, which are side by side, one behind
FAULTS = {
    "dc_motor_current": ("K", 0.6, 1.5),
    "tied": ("K", 0.6, 1.5),
    "tank": ("K6", 20.0, 300.0),
    "loop": ("R2", 1.6, 30.0),
    "variable": ("R2", 1.6, 30.0),
    "linear": ("R2", 1.6, 30.0),
    "smooth": ("R2", 1.6, 30.0),
    "no input": ("R1", 3.0, 300.0),
    "no state": ("R1", 1.5, 30.0),
    "ladder": ("R1", 3.0, 300.0),
}
# Of the motor, such that the sums alarm and no sample does.
SMALL = (Fault(parameter="K", factor=1.1, start=4.0), Fault(parameter="J", factor=0.95, start=4.0))
Grid = tuple[FloatArray, FloatArray, FloatArray]  # times, inputs and readings of all assets


@cache
def built(name: str) -> tuple[EngineSpec, Core]:
    """The core of a plant; `variable` is the lamp with rows at any time."""
    return build_engine(parse_model(LAMP) if name == "variable" else graph_of(name), fleets=True)


@cache
def grid(name: str) -> Grid:
    """Samples of assets, two of them faulty, each of them with noise of its own and rough in its own way."""
    plant, (parameter, factor, start) = ("loop" if name == "variable" else name), FAULTS[name]
    fault = Fault(parameter=parameter, factor=factor, start=start)
    time, u, y = of_runs(plant, [fault if a in FAULTY else None for a in range(N_ASSETS)], ROWS)
    generator = np.random.default_rng(7)
    y += 0.3 * built(name)[0].output_noise * generator.standard_normal(y.shape)
    y[2][generator.random(y[2].shape) < 0.1] = np.nan
    for values in (u, y):
        values[3, 250:290] = np.nan  # a gap
        values[7, :30] = np.nan  # a late beginning
    y[6, 320:323] = 100.0 * y[6, 320:323] + 1.0  # wild
    y[8, 400:] = np.nan  # silent from then on
    y[9, 330], y[10, 340] = 1e300, 5e-324
    if u.shape[2]:
        u[4, 300:304] = np.nan
        u[5, 310] = 1e3 * u[5, 310] + 1.0
    if name == "variable":
        there = generator.random(ROWS) < 0.9
        there[200:230] = False
        time, u, y = time[there], u[:, there], y[:, there]
    return time, u, y


def watched(core: Core, samples: Samples, asset: int, accept_at: int | None = None) -> tuple[Monitor, list[AssetEvent]]:
    """A monitor of one asset after its samples, and what it said; perhaps its best candidate is accepted."""
    monitor, events, taken = Monitor(core), [], 0
    while taken < len(samples):
        end = len(samples) if accept_at is None or taken >= accept_at else accept_at
        reports = monitor.take(samples[taken:end])
        lost = np.flatnonzero(reports.status == 5)
        events += [AssetEvent(asset=asset, sample=taken + int(k), kind=EventKind.LOSS) for k in lost]
        taken += len(reports)
        if reports.detection is not None:
            told = reports.detection
            events.append(AssetEvent(asset=asset, sample=taken - 1, kind=EventKind.DETECTION, detection=told))
        if reports.diagnosis is not None:
            cause = reports.diagnosis
            events.append(AssetEvent(asset=asset, sample=taken - 1, kind=EventKind.DIAGNOSIS, diagnosis=cause))
        if taken == accept_at:
            monitor.accept(monitor.conclude().candidates[0].hypothesis)
    return monitor, events


def of_runs(name: str, faults: Sequence[Fault | None], rows: int) -> Grid:
    """Samples of assets, each with a fault or none."""
    runs = [made(name, rows, fault, seed=2) for fault in faults]
    time = np.array([item.time for item in runs[0]])
    u, y = (np.array([[getattr(item, key) for item in run] for run in runs]) for key in ("u", "y"))
    return time, u, y


def samples_of(data: Grid, asset: int) -> Samples:
    """The samples of one asset."""
    time, u, y = data
    return Samples(time=time, dt=np.diff(time, prepend=time[0]), u=u[asset], y=y[asset])


@cache
def alone(name: str) -> tuple[tuple[bytes, ...], tuple[AssetEvent, ...]]:
    """What each asset's own monitor remembers at the end, and all that they said, in a fleet's order."""
    found = [watched(built(name)[1], samples_of(grid(name), asset), asset) for asset in range(N_ASSETS)]
    return tuple(remembered(monitor) for monitor, _ in found), in_order([e for _, said in found for e in said])


def remembered(monitor: Monitor) -> bytes:
    """All that a monitor remembers of use: every field, and the samples of its trail; a fleet keeps no older ones.

    A sensor that does not count is left out of a sum in one and added with a weight of 0 in the other, so 0 may be -0.
    """
    index = int(monitor.number("clock.index"))
    rows = range(max(0, index - monitor.spec.thresholds.history_samples - 2), index)
    parts = [*map(monitor.numbers, monitor.core.fields), *(part for k in rows for part in monitor.row(k))]
    return b"".join((part + 0).tobytes() for part in parts)


def in_order(events: Sequence[AssetEvent]) -> tuple[AssetEvent, ...]:
    """Events by sample, then by asset, then by kind."""
    return tuple(sorted(events, key=lambda event: (event.sample, event.asset, tuple(EventKind).index(event.kind))))


def taken(fleet: Fleet, data: Grid, ends: Sequence[int] = ()) -> tuple[AssetEvent, ...]:
    """Let a fleet take samples in blocks that end so."""
    time, u, y = data
    bounds = [0, *sorted(ends), len(time)]
    parts = [slice(*pair) for pair in pairwise(bounds)]
    return tuple(event for part in parts for event in fleet.block(time[part], u[:, part], y[:, part]))


@pytest.mark.parametrize("name", FAULTS)
def test_each_asset_gets_what_its_own_monitor_gives(name: str) -> None:
    """Detections, diagnoses and losses are the same, and what is remembered, trail and all, is to the last bit."""
    fleet = Fleet(built(name)[1], N_ASSETS)
    saved, events = alone(name)
    assert repr(taken(fleet, grid(name))) == repr(events)
    assert [a for a in range(N_ASSETS) if remembered(fleet.copy(a)) != saved[a]] == []
    assert fleet.in_alarm
    assert len(fleet.monitors) < N_ASSETS or name == "variable"  # there the rows that are absent are losses


@given(ends=st.lists(st.integers(1, ROWS - 1), max_size=6, unique=True), threads=st.integers(1, 3))
@settings(max_examples=4, deadline=None)
def test_neither_blocks_nor_threads_change_anything(ends: list[int], threads: int) -> None:
    """Events and what is remembered do not depend on where blocks end, nor on how many threads there are."""
    name = "dc_motor_current"
    fleet = Fleet(built(name)[1], N_ASSETS, threads=threads)
    saved, events = alone(name)
    assert repr(taken(fleet, grid(name), ends)) == repr(events)
    assert all(remembered(fleet.copy(a)) == saved[a] for a in range(N_ASSETS))


@given(order=st.permutations(range(N_ASSETS)))
@settings(max_examples=3, deadline=None)
def test_assets_in_another_order_get_the_same(order: list[int]) -> None:
    """Permuting assets permutes events."""
    name = "dc_motor_current"
    time, u, y = grid(name)
    events = taken(Fleet(built(name)[1], N_ASSETS), (time, u[order], y[order]))
    named = [
        AssetEvent(asset=order[e.asset], sample=e.sample, kind=e.kind, detection=e.detection, diagnosis=e.diagnosis)
        for e in events
    ]
    assert repr(in_order(named)) == repr(alone(name)[1])


def test_sample_by_sample_is_as_in_one_block() -> None:
    """A fleet in real time, one sample a call, says the same."""
    name = "no input"
    fleet = Fleet(built(name)[1], N_ASSETS)
    assert repr(taken(fleet, grid(name), range(1, ROWS))) == repr(alone(name)[1])


def test_small_faults_are_found_though_no_sample_surprises() -> None:
    """An alarm of sums alone, at a sample that is else as usual, comes when it comes for a monitor."""
    name = "dc_motor_current"
    core, data = built(name)[1], of_runs(name, (None, *SMALL), 260)
    said = [watched(core, samples_of(data, asset), asset)[1] for asset in range(len(data[1]))]
    assert [bool(events) for events in said] == [False, *(True for _ in SMALL)]
    assert repr(taken(Fleet(core, len(said)), data)) == repr(in_order([event for events in said for event in events]))


def test_whether_an_input_left_its_value_each_asset_is_told_by_its_own_readings() -> None:
    """A reading of one asset that is far off has nothing to do with what is recorded of another at that sample."""
    core, at = built("loop")[1], 331
    time, u, y = of_runs("loop", (None, None), 400)
    u[1, at, 0] += 4.0
    y[0, at, 1] += 15.0 * built("loop")[0].output_noise[1]
    monitor, _ = watched(core, samples_of((time, u, y), 1), 1)
    fleet = Fleet(core, 2)
    assert taken(fleet, (time, u, y)) == ()
    assert remembered(fleet.copy(1)) == remembered(monitor)


def test_healthy_assets_are_watched_side_by_side_as_soon_as_they_are_warm() -> None:
    """The last sample that an asset takes by itself is that at which it becomes warm; the next five are as usual."""
    spec, core = built("dc_motor_current")
    data = time, u, y = of_runs("dc_motor_current", (None, None), 120)
    monitor, _ = watched(core, samples_of(data, 0), 0)
    warm = int(monitor.number("clock.begun")) + spec.thresholds.warm_up_samples
    fleet, n = Fleet(core, 2), warm + 5
    assert taken(fleet, (time[:n], u[:, :n], y[:, :n])) == ()
    place = core.fields["clock.index"].offset
    (alone,) = fleet._works[0][place : place + 8].view(np.int64)  # how many samples the asset had seen
    assert alone == warm


@pytest.mark.parametrize("hypothesis", ["parameter", "sensor"])
def test_an_asset_comes_back_after_a_diagnosis_was_accepted(hypothesis: str) -> None:
    """Some hundred samples later it is watched side by side again, and its next fault is found as by a monitor."""
    _, core = built("dc_motor_current")
    rows, accept_at, asset = 1900, 400, 3
    time, *_ = grid("dc_motor_current")
    fault = Fault(parameter="R", factor=2.0, start=32.0)
    second = made("dc_motor_current", rows, fault, seed=9)
    u, y = (np.array([getattr(item, key) for item in second]) for key in ("u", "y"))
    if hypothesis == "sensor":
        y[200:, 0] += 12.0 * built("dc_motor_current")[0].output_noise[0]
    else:
        first = made("dc_motor_current", rows, Fault(parameter="K", factor=0.6, start=3.0), seed=9)
        y[:1500] = np.array([item.y for item in first])[:1500]
    time = np.array([item.time for item in second])
    others = np.repeat(u[None], 5, axis=0), np.repeat(y[None], 5, axis=0)
    for a in range(5):
        if a != asset:
            others[1][a] = np.array([item.y for item in made("dc_motor_current", rows, seed=9)])
    data = time, *others
    monitor, events = watched(core, samples_of(data, asset), asset, accept_at)
    fleet, was_back = Fleet(core, 5), False
    said = [*fleet.block(time[:accept_at], data[1][:, :accept_at], data[2][:, :accept_at])]
    assert fleet.in_alarm == (asset,)
    fleet.accept(asset, fleet.conclude(asset).candidates[0].hypothesis)
    for begin in range(accept_at, rows, 100):
        part = slice(begin, min(begin + 100, rows))
        said += fleet.block(time[part], data[1][:, part], data[2][:, part])
        was_back |= asset not in fleet.monitors
    assert was_back
    assert sum(event.kind is EventKind.DETECTION for event in events) >= 2
    assert repr([event for event in said if event.asset == asset]) == repr(list(in_order(events)))
    assert fleet.copy(asset).number("clock.index") == monitor.number("clock.index")


def test_an_asset_comes_back_after_its_alarm_was_over() -> None:
    """By itself, since nothing was at fault: some hundred samples later it is watched side by side again."""
    _, core = built("dc_motor_current")
    rows, asset = 1800, 2
    time, u, y = of_runs("dc_motor_current", [None] * 4, rows)
    y[asset, 400:460, 0] += 1.5 * built("dc_motor_current")[0].output_noise[0]
    monitor, events = watched(core, samples_of((time, u, y), asset), asset)
    assert any(event.diagnosis is not None and event.diagnosis.over for event in events)
    fleet = Fleet(core, 4)
    said, alarmed = list(fleet.block(time[:1000], u[:, :1000], y[:, :1000])), fleet.in_alarm
    for begin in range(1000, rows, 100):
        part = slice(begin, begin + 100)
        said += fleet.block(time[part], u[:, part], y[:, part])
    assert (alarmed, fleet.in_alarm, dict(fleet.monitors)) == ((asset,), (), {})
    assert repr([event for event in said if event.asset == asset]) == repr(list(in_order(events)))
    assert {name.partition(".")[0] for name in differing(fleet.copy(asset), monitor)} == {
        "alarm"
    }  # which one was the last


def test_two_fleets_of_one_core_know_nothing_of_each_other() -> None:
    """Assets that leave two fleets at the same time, each in a thread of its own, are as where they leave alone."""
    core, fleets, found = built("loop")[1], [], [0, 0]
    for seed in (2, 5):
        run = made("loop", 700, seed=seed)
        u, y = (np.repeat([[getattr(item, key) for item in run]], 4, axis=0) for key in ("u", "y"))
        fleets.append(Fleet(core, 4))
        fleets[-1].block(np.array([item.time for item in run]), u, y)
    expected = [remembered(fleet.copy(0)) for fleet in fleets]

    def leave(k: int) -> None:
        found[k] = sum(remembered(fleets[k].copy(0)) == expected[k] for _ in range(60))

    threads = [Thread(target=leave, args=(k,)) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [60, 60]


@pytest.mark.parametrize("width", [1, 2, 4])
def test_any_number_of_assets_side_by_side(width: int, tmp_path: Path) -> None:
    """The core as one text, for other widths, gives each asset what that text's own monitor gives."""
    spec, text = text_of("dc_motor_current")
    threads = (Path(str(CORE)) / "threads.c").read_text(encoding="utf-8")
    flags = (
        "-Og",
        TIDY,
        "-march=native",
        "-ffp-contract=off",
        "-shared",
        "-fPIC",
        "-w",
        "-pthread",
        "-DFB_FLEETS",
        f"-DFB_LANES={width}",
    )
    library = compiled_once(f"{text}\n{threads}", tmp_path / "core.so", [*required_compiler(), *flags, f"-I{CORE}"])
    core = load_core(library, spec, "cc")
    time, u, y = (values[:330] if values.ndim == 1 else values[:, :330] for values in grid("dc_motor_current"))
    fleet = Fleet(core, N_ASSETS, threads=2)
    events = taken(fleet, (time, u, y))
    own = [watched(core, samples_of((time, u, y), asset), asset) for asset in range(N_ASSETS)]
    assert repr(events) == repr(in_order([event for _, said in own for event in said]))
    assert all(remembered(fleet.copy(a)) == remembered(own[a][0]) for a in range(N_ASSETS))


def test_what_a_fleet_refuses() -> None:
    """Arrays of other shapes, no assets, assets that are not there, and decisions where there is no alarm."""
    core = built("dc_motor_current")[1]
    fleet = Fleet(core, 2)
    with pytest.raises(ValueError, match=r"shapes .* are expected"):
        fleet.block(np.zeros(3), np.zeros((2, 3, 1)), np.zeros((2, 4, 2)))
    with pytest.raises(ValueError, match="at least one of each"):
        Fleet(core, 0)
    with pytest.raises(IndexError, match="assets 0 to 1"):
        fleet.copy(2)
    for call in (fleet.conclude, lambda asset: fleet.accept(asset, 0), lambda asset: fleet.reject(asset, 0)):
        with pytest.raises(FaultbondError, match="asset 1 is not in alarm"):
            call(1)
    assert fleet.block(np.zeros(0), np.zeros((2, 0, 1)), np.zeros((2, 0, 2))) == ()


def test_a_quiet_fleet_raises_no_alarm() -> None:
    """As a quiet monitor."""
    assert taken(Fleet(built("dc_motor_current")[1], N_ASSETS, quiet=True), grid("dc_motor_current")) == ()
