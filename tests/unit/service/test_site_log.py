"""All assets at work: after any stop the same follows from what the store has, and what fails to be written waits."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.app.plant import find_plant
from faultbond.app.wishes import Wanted
from faultbond.errors import StoreError
from faultbond.service.asset import MOST_UNDOS
from faultbond.service.contract.messages import Action, Arrivals, Deed
from faultbond.service.contract.store import Commit, LogStore
from faultbond.service.site_log import AssetPlan, Done, SiteLog
from faultbond.service.store.opening import open_store
from faultbond.service.store.relational import RelationalStore
from loop_asset import FOUND, MODEL, deed, plant, rows
from memory_store import MemoryStore


def watch(store: Any, every: float = 0.0) -> SiteLog:
    """Watch the loop; `every`: s that pass with each look at the clock."""
    times = iter(np.arange(0.0, 1e9, every)) if every else iter(lambda: 0.0, 1.0)
    return SiteLog([AssetPlan(name="loop", plant=plant())], store, clock=lambda: float(next(times)))


def arrivals(first: int, last: int) -> Arrivals:
    """Give some of the rows."""
    return Arrivals(asset="loop", rows=rows().part(slice(first, last)), arrived=1000.0 + last, cursor=str(last))


def work(watch: SiteLog, *items: Arrivals | Deed) -> list[Done]:
    """Take items and write what came of them."""
    done = watch.take(items)
    watch.settle()
    return done


@pytest.fixture
def stores(tmp_path: Path, place: str) -> Iterator[tuple[RelationalStore, RelationalStore]]:
    """Give two stores, the first in a file, the other in one of each kind."""
    made = [open_store(where, reserve=0) for where in (tmp_path / "one.sqlite", place)]
    yield made[0], made[1]
    for store in made:
        store.close()


def told(store: LogStore) -> list[tuple[str, object]]:
    """Give all records, each with its name."""
    return [(item.id, item.content) for item in store.records()]


def best(watch: SiteLog) -> tuple[str, ...]:
    """Give the suspects of the best candidate."""
    diagnosis = watch.assets["loop"].diagnosis
    assert diagnosis is not None
    return diagnosis.candidates[0].parameters


def played(store: LogStore, seed: int, stops: Sequence[int]) -> SiteLog:
    """Play a day: rows in portions, people in between; at some items the service is killed and begins again."""
    rng = np.random.default_rng(seed)
    now, first, n_items = watch(store, every=20.0), 0, 0
    acts: list[tuple[int, Action]] = [
        (FOUND, Action.ACKNOWLEDGE),
        (FOUND + 60, Action.ACCEPT),
        (FOUND + 130, Action.UNDO),
        (FOUND + 200, Action.REJECT),
        (FOUND + 210, Action.REJECT),
        (FOUND + 230, Action.UNDO),
        (FOUND + 240, Action.UNDO),
        (FOUND + 260, Action.REPAIRED),
    ]
    while first < len(rows()):
        last = min(first + int(rng.integers(1, 90)), len(rows()))
        if acts and last > acts[0][0]:
            last = acts[0][0]
        work(now, arrivals(first, last))
        if acts and last == acts[0][0]:
            _, action = acts.pop(0)
            target = best(now) if action in {Action.ACCEPT, Action.REJECT, Action.REPAIRED} else ()
            assert work(now, deed(action, *target))[0].error is None
        first, n_items = last, n_items + 1
        if n_items in stops:
            now = watch(store, every=20.0)
            assert now.cursors["loop"] == str(first)
    return now


@pytest.mark.parametrize(("seed", "place"), [(0, "sqlite"), (1, "sqlite"), (2, "postgresql")], indirect=["place"])
def test_a_service_that_is_killed_tells_what_one_tells_that_is_not(
    seed: int, stores: tuple[RelationalStore, RelationalStore]
) -> None:
    """Records, their names, deeds and the state at the end are the same, wherever it was stopped."""
    whole, cut = stores
    played(whole, seed, ())
    stops = np.random.default_rng(100 + seed).choice(50, 12, replace=False).tolist()
    last = played(cut, seed, stops)
    assert told(cut) == told(whole)
    assert not list(cut.contested())
    assert [item.action for item in cut.deeds()] == [item.action for item in whole.deeds()]
    kinds = [item.kind for item in whole.records()]
    assert {"detection", "diagnosis", "accepted", "rejected"} <= set(kinds)
    assert kinds.count("accepted") == 2
    again = watch(cut)
    assert again.assets["loop"].checkpoint() == last.assets["loop"].checkpoint()


def test_what_is_taken_back_was_never_decided(stores: tuple[RelationalStore, RelationalStore]) -> None:
    """After an undo the diagnoses are those of a service in which nobody accepted."""
    plain, turned = stores
    left, right = watch(plain), watch(turned)
    cuts = (0, FOUND, FOUND + 100, FOUND + 200)
    for first, last in pairwise(cuts):
        work(left, arrivals(first, last))
    work(right, arrivals(0, FOUND))
    work(right, deed(Action.ACCEPT, *best(right)))
    work(right, arrivals(FOUND, FOUND + 100))
    assert right.assets["loop"].detection is None
    (undone,) = work(right, deed(Action.UNDO))
    work(right, arrivals(FOUND + 100, FOUND + 200))
    assert undone.deed is not None
    assert undone.deed.undone == next(item.number for item in turned.deeds() if item.action is Action.ACCEPT)
    assert right.assets["loop"].detection == left.assets["loop"].detection
    ours, theirs = ([item.content for item in store.records(kinds=["diagnosis"])] for store in (turned, plain))
    assert ours == theirs
    (refused,) = work(right, deed(Action.UNDO))
    assert "no decision that can be taken back" in str(refused.error)


def test_only_the_last_decision_is_taken_back(stores: tuple[RelationalStore, RelationalStore]) -> None:
    """Who names another one, which may be of somebody else, is told which it is; what was decided stays."""
    store, _ = stores
    log = watch(store)
    work(log, arrivals(0, FOUND))
    work(log, deed(Action.ACCEPT, *best(log)))
    (entry,) = store.deeds()
    before = log.assets["loop"].checkpoint()
    (refused,) = work(log, replace(deed(Action.UNDO), undone=entry.number + 1))
    assert f"cannot be taken back now: decisions can be, the last one first, which is {entry.number} (accept)" in str(
        refused.error
    )
    assert log.assets["loop"].checkpoint() == before
    (done,) = work(log, replace(deed(Action.UNDO), undone=entry.number))
    assert done.error is None
    assert log.assets["loop"].detection is not None


def test_decisions_are_taken_back_one_after_the_other(stores: tuple[RelationalStore, RelationalStore]) -> None:
    """The latest first, across a restart, too; in the end it is as where nobody decided, and acknowledged as it was."""
    store, _ = stores
    undecided, log = MemoryStore(), watch(store)
    plain = watch(undecided)
    for first, last in pairwise((0, FOUND, FOUND + 60, FOUND + 90, FOUND + 200)):
        work(plain, arrivals(first, last))
    work(log, arrivals(0, FOUND))
    work(log, deed(Action.REJECT, *best(log)), deed(Action.ACKNOWLEDGE), arrivals(FOUND, FOUND + 60))
    work(log, deed(Action.ACCEPT, *best(log)), arrivals(FOUND + 60, FOUND + 90))
    first, _, second = (item.number for item in store.deeds())
    (early,) = work(log, replace(deed(Action.UNDO), undone=first))
    assert f"the last one first, which is {second} (accept)" in str(early.error)
    for number in (second, first):
        (done,) = work(log, replace(deed(Action.UNDO), undone=number))
        assert done.error is None
        assert done.deed is not None
        assert done.deed.undone == number
        log = watch(store)
    work(log, arrivals(FOUND + 90, FOUND + 200))
    ours, theirs = ([*item.records(kinds=["diagnosis"])][-1].content for item in (store, undecided))
    assert ours == theirs
    assert log.assets["loop"].alarm.acknowledged_by == "anna"
    (refused,) = work(log, deed(Action.UNDO))
    assert f"only the latest {MOST_UNDOS} since the last alarm" in str(refused.error)


def test_a_decision_whose_rows_are_forgotten_stays() -> None:
    """What is passed again must be whole; who asks is told why it cannot be taken back."""
    store = MemoryStore()
    log = watch(store)
    work(log, arrivals(0, FOUND))
    work(log, deed(Action.ACCEPT, *best(log)))
    work(log, arrivals(FOUND, FOUND + 60))
    (kept,) = store.logs.values()
    kept.rows[FOUND + 1] = None
    (refused,) = work(log, deed(Action.UNDO))
    assert "rows since the last decision are forgotten" in str(refused.error)
    assert log.assets["loop"].detection is None


def test_every_record_has_a_name_of_its_own(stores: tuple[RelationalStore, RelationalStore]) -> None:
    """Also of the same sample: after two rejections in a row, and after one was taken back while diagnoses came."""
    store, _ = stores
    now = watch(store)
    work(now, arrivals(0, FOUND))
    first = work(now, deed(Action.REJECT, *best(now)))
    second = work(now, deed(Action.REJECT, *best(now)))
    assert [[record.kind for record in item.outcome.records] for item in first + second] == [
        ["rejected", "diagnosis"]
    ] * 2
    work(now, arrivals(FOUND, FOUND + 100))
    (undone,) = work(now, deed(Action.UNDO))
    assert [record.kind for record in undone.outcome.records].count("diagnosis") > 1
    names = [record.id for item in (*first, *second, undone) for record in item.outcome.records]
    assert len(set(names)) == len(names)
    assert not store.contested()


def test_no_decision_is_taken_back_after_the_next_alarm() -> None:
    """Said to be repaired while the fault is there, it alarms anew; what was decided before is past."""
    now = watch(MemoryStore())
    work(now, arrivals(0, FOUND))
    work(now, deed(Action.REPAIRED, *best(now)))
    assert now.assets["loop"].undos
    work(now, arrivals(FOUND, len(rows())))
    assert now.assets["loop"].detection is not None
    assert not now.assets["loop"].undos


def test_what_is_refused_is_not_in_the_log() -> None:
    """A deed that makes no sense leaves nothing behind, and those around it are done."""
    store = MemoryStore()
    done = work(watch(store), deed(Action.ACKNOWLEDGE), deed(Action.SUPPRESS), deed(Action.SUPPRESS))
    assert [item.error is None for item in done] == [False, True, False]
    assert [item.action for item in store.deeds()] == [Action.SUPPRESS]


class FailingStore(MemoryStore):
    """One whose disk is full for a while."""

    full = False

    def commit(self, parts: Sequence[Commit]) -> None:
        if self.full:
            raise StoreError("the disk is full")
        super().commit(parts)


def test_what_cannot_be_written_waits() -> None:
    """Nothing more is taken until it is; then nothing is missing, and nothing there twice."""
    store, whole = FailingStore(), MemoryStore()
    now, other = watch(store), watch(whole)
    for first, last in ((0, 800), (800, FOUND), (FOUND, 1500)):
        work(other, arrivals(first, last))
        store.full = first == 800
        now.take([arrivals(first, last)])
        if store.full:
            for _ in range(2):
                with pytest.raises(StoreError, match="full"):
                    now.settle()
            with pytest.raises(ValueError, match="has not been settled"):
                now.take([arrivals(last, last + 1)])
            assert store.enrol(next(iter(store.logs.values())).enrolment).rows == 800
            store.full = False
        now.settle()
    assert told(store) == told(whole)


def test_a_checkpoint_that_cannot_be_used_costs_only_time() -> None:
    """Damaged, or of another version: all of the log passes again, to the same state."""
    store = MemoryStore()
    now = watch(store, every=100.0)
    for first in range(0, 1500, 300):
        work(now, arrivals(first, first + 300))
    (log,) = store.logs.values()
    assert log.checkpoints
    before = told(store)
    log.checkpoints[:] = [replace(item, checkpoint=b"\0" * 9) for item in log.checkpoints]
    again = watch(store)
    assert again.assets["loop"].checkpoint() == now.assets["loop"].checkpoint()
    assert again.assets["loop"].alarm == now.assets["loop"].alarm
    assert told(store) == before


def test_it_begins_with_what_is_kept_where_old_rows_are_forgotten_and_no_checkpoint_can_be_used() -> None:
    """As after an update of faultbond: the service starts all the same, from the rows that are there."""
    store = MemoryStore()
    now = watch(store, every=100.0)
    for first in range(0, 800, 200):
        work(now, arrivals(first, first + 200))
    (log,) = store.logs.values()
    log.checkpoints[:] = [replace(item, checkpoint=b"\0" * 9) for item in log.checkpoints]
    log.rows[:100] = [None] * 100
    again = watch(store)
    assert again.assets["loop"].counts.samples == 700
    work(again, arrivals(800, 900))
    assert again.rows("loop") == 900


def test_another_model_begins_a_log_and_says_so(
    stores: tuple[RelationalStore, RelationalStore], caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    """Once; the same model again goes on with its own log, and says nothing."""
    _, store = stores
    work(watch(store), arrivals(0, 100))
    changed = tmp_path / "model.yaml"
    changed.write_text(MODEL.read_text().replace("R: 20 ohm", "R: 21 ohm"))
    other = AssetPlan(name="loop", plant=find_plant(changed, Wanted()))
    log = SiteLog([other], store)
    assert "loop: its model is not that of before" in caplog.text
    assert log.rows("loop") == 0
    caplog.clear()
    assert watch(store).rows("loop") == 100
    assert caplog.text == ""
