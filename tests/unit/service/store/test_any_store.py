"""Any sequence of commits, new starts and reads gives what the slow store in memory gives."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from tempfile import mkdtemp
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule, run_state_machine_as_test

from faultbond.errors import StoreError
from faultbond.service.contract.messages import Action, AuditEntry, Curves, Deed, NamedRecord
from faultbond.service.contract.store import Commit
from faultbond.service.store import relational, tail
from faultbond.service.store.opening import open_store
from memory_store import MemoryStore
from postgres import PostgresServer
from stored import enrolment, flat, some_curves, some_rows

ASSETS, MODELS = ("pump", "tänk"), ("a" * 64, "b" * 64)
MOMENTS = st.one_of(st.none(), st.integers(-2, 60).map(float))
VALUES: st.SearchStrategy[object] = st.one_of(st.floats(allow_nan=False), st.text(max_size=3))
CONTENT = st.dictionaries(st.text(max_size=3), VALUES, max_size=2)


@contextmanager
def small_chunks(large: int = 6, overview: int = 4) -> Iterator[None]:
    """Let few rows make a large chunk, and few pages be read at once, so that tests come past all of it."""
    with (
        patch.object(tail, "LARGE", large),
        patch.object(relational, "LARGE", large),
        patch.object(tail, "MANY", 2),
        patch.object(relational, "LEAST_EFFORT", 1),
        patch.object(tail, "OVERVIEW", overview),
        patch.object(relational, "OVERVIEW", overview),
        patch.object(tail, "_AT_ONCE", 2),
        patch.object(relational, "PAGE", 3),
    ):
        yield


def assert_same_curves(one: Curves | None, other: Curves | None) -> None:
    """Two curves are of the same points."""
    assert (one is None) == (other is None)
    if one is not None and other is not None:
        for item in fields(Curves):
            np.testing.assert_array_equal(getattr(one, item.name), getattr(other, item.name), item.name)


class AnySequence(RuleBasedStateMachine):
    """Does the same with a store and with the slow one, and compares what they give."""

    def __init__(self, place: str) -> None:
        super().__init__()
        self.place = place
        self.patches = small_chunks()
        self.patches.__enter__()
        self.heard: list[str] = []
        self.slow = MemoryStore()
        self.open()

    def open(self) -> None:
        self.store = open_store(self.place, tell=self.heard.append, reserve=0)

    def teardown(self) -> None:
        self.store.close()
        self.patches.__exit__(None, None, None)

    @initialize()
    def begin(self) -> None:
        self.enrol(ASSETS[0], MODELS[0])

    @rule(asset=st.sampled_from(ASSETS), model=st.sampled_from(MODELS))
    def enrol(self, asset: str, model: str) -> None:
        new = enrolment(asset, model, n_inputs=1 + MODELS.index(model))
        stand = self.store.enrol(new)
        assert stand == self.slow.enrol(new)

    @rule(data=st.data(), size=st.integers(1, 3))
    def commit(self, data: st.DataObject, size: int) -> None:
        grown: dict[str, tuple[int, int]] = {}
        parts = [self.part(data, grown) for _ in range(size)]
        outcomes = []
        for store in (self.store, self.slow):
            try:
                store.commit(parts)
                outcomes.append("")
            except StoreError:
                outcomes.append("refused")
        assert outcomes[0] == outcomes[1]
        assert len({line for line in self.heard if "another content" in line}) <= len(self.slow.contested)

    def part(self, data: st.DataObject, grown: dict[str, tuple[int, int]]) -> Commit:
        """What one asset is given; `grown`: rows and points of assets that the parts before have given."""
        draw = data.draw
        asset = draw(st.sampled_from(ASSETS))
        model = self.slow.newest.get(asset, MODELS[0])
        log = self.slow.logs.get((asset, model))
        n_u = 1 + MODELS.index(model)
        n, n_points = grown.get(asset) or ((len(log.rows), len(log.points)) if log else (0, 0))
        count = draw(st.one_of(st.none(), st.integers(0, 9)))
        rows = None if count is None else some_rows(n, count, n_inputs=n_u)
        if rows is not None and draw(st.booleans()):
            rows.time[: draw(st.integers(0, 9))] = np.nan
        points = draw(st.one_of(st.none(), st.integers(0, 15)))
        grown[asset] = (n + (count or 0), n_points + (points or 0))
        records = [
            NamedRecord(
                id=f"{asset}{model[0]}{sample}",
                asset=asset,
                sample=sample,
                time=float(sample),
                kind=draw(st.sampled_from(["detection", "diagnosis"])),
                content=draw(CONTENT),
            )
            for sample in draw(st.lists(st.integers(n, n + 5), max_size=3))
        ]
        behind = n + (count or 0) + (draw(st.integers(0, 30)) == 0)
        deeds = [
            Deed(
                asset=asset,
                action=draw(st.sampled_from(Action)),
                at=draw(st.floats(0, 1e9)),
                who=draw(st.text(max_size=3)),
                rows=behind,
                comment=draw(st.text(max_size=3)),
                target=tuple(draw(st.lists(st.text(max_size=2), max_size=2))),
                until=draw(st.one_of(st.none(), st.floats(0, 1e9))),
                undone=draw(st.one_of(st.none(), st.integers(1, 3))),
            )
            for _ in range(draw(st.integers(0, 2)))
        ]
        return Commit(
            asset=asset,
            rows=rows,
            arrived=draw(st.integers(0, 50).map(float)),
            cursor=draw(st.text(max_size=3)),
            curves=None if points is None else some_curves(n_points, points, n_inputs=n_u),
            records=tuple(records),
            deeds=tuple(deeds),
            checkpoint=draw(st.one_of(st.none(), st.binary(max_size=8))),
        )

    @rule()
    def reopen(self) -> None:
        self.store.close()
        self.open()

    @rule(older_than=st.integers(0, 60).map(float))
    def retain(self, older_than: float) -> None:
        """Rows that may stay are those that share a chunk with one that has to."""
        before = {key: ([*log.rows], [*log.points]) for key, log in self.slow.logs.items()}
        gone = self.store.retain(older_than=older_than).rows
        self.slow.forget_rows(older_than=older_than)  # diagnoses go with the rows that do
        newest = {**self.slow.newest}
        for (asset, model), log in self.slow.logs.items():
            self.store.enrol(log.enrolment)  # curves are given of the newest log alone
            rows, points = before[asset, model]
            kept = flat(self.store.log_between(asset, model_sha256=model))
            lines = {item[-1] for item in kept if isinstance(item, tuple)}
            assert all(row is None or row[1].line in lines for row in log.rows)
            log.rows = [row if row is not None and row[1].line in lines else None for row in rows]
            gone -= sum(row is not None for row in rows) - sum(row is not None for row in log.rows)
            found = self.store.curves(asset)
            times = set() if found is None else {float(time) for time in found.time}
            assert all(point is None or float(point[1].time[0]) in times for point in log.points)
            log.points = [point if point is not None and float(point[1].time[0]) in times else None for point in points]
        assert gone == 0
        self.slow.forget_diagnoses()
        for key in newest.items():
            self.store.enrol(self.slow.logs[key].enrolment)

    @rule(asset=st.sampled_from(ASSETS), begin=MOMENTS, end=MOMENTS, model=st.sampled_from((None, *MODELS)))
    def read_period(self, asset: str, begin: float | None, end: float | None, model: str | None) -> None:
        for store in (self.store, self.slow):
            if (asset, model or self.slow.newest.get(asset)) not in self.slow.logs:
                with pytest.raises(StoreError, match="there is no asset"):
                    list(store.log_between(asset, begin, end, model))
                return
        found, expected = (flat(store.log_between(asset, begin, end, model)) for store in (self.store, self.slow))
        assert found == expected
        for of, kinds, newest in ((asset, (), None), (None, (), None), (asset, ("detection", "accepted"), 2)):
            wanted: dict[str, Any] = {"kinds": kinds, "begin": begin, "end": end, "newest": newest}
            assert list(self.store.journal(of, **wanted)) == list(self.slow.journal(of, **wanted))

    @rule(asset=st.sampled_from(ASSETS), rows=st.integers(0, 40), deeds=st.integers(0, 4))
    def read_behind(self, asset: str, rows: int, deeds: int) -> None:
        """What is behind any place of a log comes, unless some of it is forgotten, which is told."""
        found = []
        for store in (self.store, self.slow):
            try:
                found.append(flat(store.log_after(asset, rows, deeds)))
            except StoreError:
                found.append(["refused"])
        assert found[0] == found[1]

    @rule(
        asset=st.sampled_from((*ASSETS, None, "nobody")),
        kinds=st.sampled_from(((), ("detection",), ("detection", "diagnosis"))),
        begin=MOMENTS,
        end=MOMENTS,
        newest=st.one_of(st.none(), st.integers(0, 7)),
    )
    def read_records(
        self, asset: str | None, kinds: tuple[str, ...], begin: float | None, end: float | None, newest: int | None
    ) -> None:
        found, expected = (
            list(store.records(asset, kinds=kinds, begin=begin, end=end, newest=newest))
            for store in (self.store, self.slow)
        )
        assert found == expected
        assert list(self.store.deeds(asset, newest=newest)) == list(self.slow.deeds(asset, newest=newest))

    @rule(name=st.sampled_from(("scada", "tickets")), steps=st.integers(0, 3), most=st.integers(1, 4))
    def read_on(self, name: str, steps: int, most: int) -> None:
        """A reader goes on behind what it had, also after a new start."""
        assert self.store.reader(name) == self.slow.reader(name)
        for _ in range(steps):
            place = self.slow.reader(name)[0]
            found = self.store.records_behind(place, most)
            assert found == self.slow.records_behind(place, most)
            for store in (self.store, self.slow):
                store.advance(name, found[-1][0] if found else place)

    @rule(at=st.floats(0, 1e9), who=st.text(max_size=3), about=CONTENT)
    def note(self, at: float, who: str, about: dict[str, object]) -> None:
        """What is noted comes back in order, in a store that has never been noted in, too."""
        assert list(self.store.audit()) == list(self.slow.audit())
        for store in (self.store, self.slow):
            store.note(AuditEntry(at=at, who=who, what="upload", about=about))
        assert list(self.store.audit()) == list(self.slow.audit())

    @rule(asset=st.sampled_from(ASSETS), begin=MOMENTS, end=MOMENTS)
    def read_curves(self, asset: str, begin: float | None, end: float | None) -> None:
        assert_same_curves(self.store.curves(asset, begin, end), self.slow.curves(asset, begin, end))

    @rule(asset=st.sampled_from(ASSETS), begin=MOMENTS, end=MOMENTS, most=st.integers(2, 12))
    def read_few_points(self, asset: str, begin: float | None, end: float | None, most: int) -> None:
        found, whole = self.store.curves(asset, begin, end, most), self.slow.curves(asset, begin, end)
        assert (found is None) == (whole is None)
        if found is None or whole is None:
            return
        assert len(found) <= most
        if len(whole) <= most:
            assert_same_curves(found, whole)
        for name in ("inputs", "measured", "cusum"):
            for reduce in (np.fmin, np.fmax):
                np.testing.assert_array_equal(reduce.reduce(getattr(found, name)), reduce.reduce(getattr(whole, name)))

    @invariant()
    def logs_go_on(self) -> None:
        """What follows the checkpoint is there, as it came, and so is every record and deed, once."""
        for asset in self.slow.newest:
            stand = self.slow.enrol(self.slow.logs[asset, self.slow.newest[asset]].enrolment)
            behind = (stand.checkpoint_rows, stand.checkpoint_deeds)
            assert flat(self.store.log_after(asset, *behind)) == flat(self.slow.log_after(asset, *behind))
        assert self.store.contested() == self.slow.contested
        ids = [item.id for item in self.store.records()]
        assert len(set(ids)) == len(ids)

    @invariant()
    def enrolments_are_kept(self) -> None:
        found = list(self.store.enrolments())
        assert {(item.asset, item.model_sha256) for item in found} == self.slow.logs.keys()


COURSES = settings(max_examples=30, stateful_step_count=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])


def test_any_sequence_in_a_file(tmp_path: Path) -> None:
    """A store in a file of SQLite."""

    class InFile(AnySequence):
        def __init__(self) -> None:
            super().__init__(f"{mkdtemp(dir=tmp_path)}/plant.db")

    run_state_machine_as_test(InFile, settings=COURSES)


def test_any_sequence_in_a_server(postgres: PostgresServer) -> None:
    """A store in a server of PostgreSQL."""

    class InServer(AnySequence):
        def __init__(self) -> None:
            super().__init__(postgres.url())

    run_state_machine_as_test(InServer, settings=COURSES)
