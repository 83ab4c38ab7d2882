"""The whole service on a disk that others fill: while it watches, at a start, and until there is room again."""

import tempfile
import time
from pathlib import Path
from typing import Any

import httpx

from benchmarks.service.kills import Growing, People
from benchmarks.service.served import Served
from benchmarks.shared.disk import fill, mounted
from benchmarks.shared.page import Row
from faultbond.io.examples import example
from faultbond.service.store.opening import open_store

SIZE = "80m"  # of the disk; the reserve is had where twice its 32 MB are free
FULL = 60.0  # s


def _told(service: Served) -> dict[str, Any]:
    """Give what the page tells, with the answer of /health."""
    return service.until(lambda told: True) | {"health": httpx.get(f"{service.address}/health", timeout=30.0)}


def _watched(service: Served, disk: Path, growing: Growing) -> tuple[dict[str, bool], float]:
    """Fill the disk, start the service on it anew, and free it; give what was told, and s until all came."""
    seen = dict.fromkeys(("almost full", "full", "on the page", "asset", "page answers", "recovers"), False)
    fill(disk / "first")
    begin = time.monotonic()
    while time.monotonic() - begin < FULL / 2:
        told = _told(service)
        texts = " ".join(told["troubles"])
        seen["almost full"] |= "almost full" in texts and told["health"].status_code == httpx.codes.SERVICE_UNAVAILABLE
        if seen["almost full"]:
            fill(disk / f"more{time.monotonic()}")  # what the reserve gave
        seen["full"] |= "store" in told["health"].json()["parts"] and not told["health"].json()["parts"]["store"]["ok"]
        seen["on the page"] |= "the disk is full" in texts
        asset = told["assets"][0]
        seen["asset"] |= asset["status"] == "CHECK_FUNCTION" and "the disk is full" in asset["headline"]
        time.sleep(0.5)
    seen["page answers"] = httpx.get(f"{service.address}/api/v1/assets/tank", timeout=30.0).is_success
    service.kill()
    service.begin()
    time.sleep(FULL / 2)
    for ballast in [*disk.iterdir()]:
        if not ballast.name.startswith("kept"):
            ballast.unlink()
    begin = time.monotonic()
    service.until(lambda told: told["assets"][0]["samples"] >= growing.written - 60)
    took = time.monotonic() - begin
    service.until(lambda told: not told["troubles"], longest=10.0)
    seen["recovers"] = httpx.get(f"{service.address}/health", timeout=30.0).is_success
    return seen, took


def rows() -> list[Row]:
    """Measure, and give lines of the table."""
    with tempfile.TemporaryDirectory() as name, mounted(Path(name) / "disk", SIZE) as disk:
        if disk is None:
            return []
        folder = Path(name)
        words = (str(example("tank") / "model.yaml"), "--store", str(disk / "kept.sqlite"), "--source", "file:live.csv")
        with Served(folder, *words) as service, People(service) as people:
            with Growing(folder / "live.csv") as growing:
                service.until(lambda told: told["assets"][0]["samples"] > 300)
                seen, took = _watched(service, disk, growing)
                time.sleep(5.0)
            service.until(lambda told: told["assets"][0]["samples"] >= growing.written - 5)
            acknowledged = list(people.entries)
        with Served(folder, words[0], "--store", "whole.sqlite", *words[3:]) as other:
            other.until(lambda told: told["assets"][0]["samples"] >= growing.written - 5)
        kept, whole = open_store(disk / "kept.sqlite", writes=False), open_store(folder / "whole.sqlite", writes=False)
        known = {deed.number: deed.comment for deed in kept.deeds()}
        lost = sum(known.get(entry["number"]) != entry["comment"] for entry in acknowledged)
        ours, theirs = ([(item.id, item.content) for item in store.records()] for store in (kept, whole))
        reserve = (disk / "kept.sqlite.reserve").stat().st_size >> 20
        for store in (kept, whole):
            store.close()
    missing = [what for what, is_so in seen.items() if not is_so]
    return [
        Row(
            figure=f"a disk that is full for {FULL:.0f} s, in which the service is killed and started: told on the "
            "page, at the asset and by /health, almost full and full",
            asked="yes",
            got=f"not: {', '.join(missing)}" if missing else "yes",
            met=not missing,
        ),
        Row(
            figure=f"the same: of {len(acknowledged)} acknowledged deeds lost; records that are not those of a service "
            f"with room ({len(theirs)})",
            asked="0, 0",
            got=f"{lost}, {len(set(map(str, ours)) ^ set(map(str, theirs)))}",
            met=lost == 0 and ours == theirs,
        ),
        Row(
            figure="the same: from the moment at which there is room until all that came meanwhile is watched",
            asked="",
            got=f"{took:.0f} s; {reserve} MB are in reserve again",
            met=None,
        ),
    ]
