"""A writer that is killed at any moment loses nothing that was acknowledged, and writes nothing twice.

FAULTBOND_KILLS=100 kills it so often.
"""

import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultbond.service.store.opening import open_store
from faultbond.service.store.relational import RelationalStore
from stored import deed, enrolment, flat, row_bits, some_rows, told

KILLS = int(os.environ.get("FAULTBOND_KILLS", "5"))
ASSETS = ("a0", "a1", "a2")
WRITER = Path(__file__).with_name("killed_writer.py")


def killed(place: str, seed: int, after: float) -> list[int]:
    """Let a writer write until it is killed, so many seconds after its first commit; give what it had acknowledged."""
    command = [sys.executable, str(WRITER), place, str(len(ASSETS)), str(seed)]
    finds = {"PYTHONPATH": os.pathsep.join(sys.path)}  # what tests share
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=os.environ | finds) as writer:
        assert writer.stdout is not None
        lines = [writer.stdout.readline()]
        time.sleep(after)
        writer.send_signal(signal.SIGKILL)
        lines += writer.stdout.readlines()
    whole = [line for line in lines if line.endswith("\n")]
    return [int(word) for word in whole[-1].split()]


@pytest.mark.skipif(sys.platform == "win32", reason="there is no SIGKILL")
def test_nothing_acknowledged_is_lost(place: str) -> None:
    """After each kill rows, records, deeds and cursor are those of one commit, the last acknowledged or the next."""
    random = np.random.default_rng(7)
    for kill in range(KILLS):
        acknowledged = killed(place, kill, random.uniform(0.0, 0.25))
        heard: list[str] = []
        store = open_store(place, tell=heard.append, reserve=0)
        if "://" not in place:
            assert store._database.rows("PRAGMA integrity_check") == [("ok",)]
        for asset, least in zip(ASSETS, acknowledged, strict=True):
            check(store, asset, least)
        ids = [item.id for item in store.records()]
        assert len(set(ids)) == len(ids)
        assert heard == []
        assert store.contested() == []
        store.close()


def check(store: RelationalStore, asset: str, least: int) -> None:
    """All of an asset's log agrees with how many rows it has, and these are those that were acknowledged or more."""
    stand = store.enrol(enrolment(asset))
    assert least <= stand.rows <= least + 60
    assert stand.cursor == str(stand.rows)
    assert stand.checkpoint == str(stand.checkpoint_rows).encode() * 2000
    log = flat(store.log_after(asset, stand.checkpoint_rows, stand.checkpoint_deeds))
    rows = [item for item in log if isinstance(item, tuple)]
    wanted = some_rows(stand.checkpoint_rows, stand.rows - stand.checkpoint_rows)
    assert rows == [row_bits(wanted, k) for k in range(len(wanted))]
    expected = [told(asset, k) for k in range(0, stand.rows, 10)]
    assert list(store.records(asset)) == expected
    deeds = list(store.deeds(asset))
    assert deeds
    assert deeds == [replace(deed(asset, item.rows), number=item.number) for item in deeds]
    assert [item.rows for item in deeds] == sorted({item.rows for item in deeds})
    newest = store.curves(asset)
    assert newest is not None
    assert newest.time[-1] == stand.rows - 1
