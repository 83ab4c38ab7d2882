"""The whole service killed again and again while a recording grows and people do things."""

import random
import tempfile
import threading
import time
from pathlib import Path
from typing import Any

import httpx

from benchmarks.service.served import Served
from benchmarks.shared.page import Row
from faultbond.io.examples import example
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Deed
from faultbond.service.store.opening import open_store

KILLS = 100
PACE = 50.0  # rows of the tank in a second
SPAN = 3.0  # s that the service lives at most after it answers
LAST = 2.0  # s in which the last rows are surely taken
SEED = 7
CONFLICT, UNAVAILABLE = 409, 503  # statuses of HTTP


class Growing:
    """A recording that grows; again and again that of the tank with a fault, with times that go on."""

    def __init__(self, path: Path) -> None:
        head, *self._lines = (example("tank") / "fault_pipe.csv").read_text(encoding="utf-8").splitlines()
        path.write_text(head + "\n", encoding="utf-8")
        self._path, self._over = path, threading.Event()
        self._thread = threading.Thread(target=self._grow)
        self.written = 0

    def __enter__(self) -> "Growing":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _grow(self) -> None:
        begin = time.monotonic()
        with self._path.open("a", encoding="utf-8") as file:
            while not self._over.wait(0.05):
                due = int(PACE * (time.monotonic() - begin))
                for k in range(self.written, due):
                    _, _, rest = self._lines[k % len(self._lines)].partition(",")
                    file.write(f"{k},{rest}\n")
                file.flush()
                self.written = due


class People:
    """Somebody who does things all the while, and remembers what was acknowledged to him."""

    def __init__(self, service: Served) -> None:
        self._service, self._over = service, threading.Event()
        self._thread = threading.Thread(target=self._act)
        self.entries: list[dict[str, Any]] = []

    def __enter__(self) -> "People":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def _act(self) -> None:
        k = 0
        while not self._over.wait(0.05):
            action = ("suppress", "unsuppress")[k % 2]
            try:
                self.entries.append(self._service.do("tank", action, comment=f"number {k}"))
            except httpx.HTTPStatusError as error:
                if error.response.status_code == UNAVAILABLE:  # it is not written, or not yet
                    continue
                if error.response.status_code != CONFLICT:  # it is so already: the answer was lost with the service
                    raise
            except httpx.HTTPError:
                continue
            k += 1


def _take_all(service: Served, written: int) -> None:
    """Wait until a service has taken all rows; the last few are no samples yet, so it gets a while for them."""
    service.until(lambda told: told["assets"][0]["samples"] >= written - 5)
    time.sleep(LAST)


def _length(item: RowBlock | Deed) -> int:
    return len(item.time) if isinstance(item, RowBlock) else 0


def rows(kills: int = KILLS) -> list[Row]:
    """Measure, and give lines of the table."""
    rng = random.Random(SEED)  # noqa: S311 - moments of a trial
    took = list[float]()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = example("tank") / "model.yaml"
        words = (str(model), "--store", "kept.sqlite", "--source", "file:live.csv")
        with Served(folder, *words) as service, People(service) as people:
            with Growing(folder / "live.csv") as growing:
                for _ in range(kills):
                    time.sleep(rng.uniform(0.0, SPAN))
                    service.kill()
                    took.append(service.start())
            _take_all(service, growing.written)
            acknowledged = list(people.entries)
        with Served(folder, *words[:2], "whole.sqlite", *words[3:]) as other:
            _take_all(other, growing.written)
        kept, whole = (open_store(folder / name, writes=False) for name in ("kept.sqlite", "whole.sqlite"))
        known = {deed.number: deed.comment for deed in kept.deeds()}
        lost = sum(known.get(entry["number"]) != entry["comment"] for entry in acknowledged)
        ours, theirs = ([(item.id, item.content) for item in store.records()] for store in (kept, whole))
        twice = len(ours) - len({told for told, _ in ours}) + len(list(kept.contested()))
        same = ours == theirs
        n_rows = [sum(map(_length, store.log_between("tank"))) for store in (kept, whole)]
        for store in (kept, whole):
            store.close()
    return [
        Row(
            figure=f"killed {kills} times while rows come ({n_rows[0]}) and people act ({len(acknowledged)} times): "
            "acknowledged deeds lost, rows lost, ids twice",
            asked="0, 0, 0",
            got=f"{lost}, {n_rows[1] - n_rows[0]}, {twice}",
            met=lost == 0 and n_rows[0] == n_rows[1] and twice == 0,
        ),
        Row(
            figure=f"the same: its {len(theirs)} records are those of a service that nobody killed",
            asked="all",
            got="all" if same else f"{sum(item in theirs for item in ours)} of {len(ours)}",
            met=same,
        ),
        Row(
            figure="the same: from the start of the program until it answers",
            asked="5 s",
            got=f"{max(took):.1f} s at the most, half of them {sorted(took)[len(took) // 2]:.1f} s",
            met=max(took) < 5.0,
        ),
    ]
