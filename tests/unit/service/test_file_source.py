"""Following a file that grows, and replaying one."""

import asyncio
import json
import time
from pathlib import Path

import numpy as np
import pytest

from arriving import COLUMNS, Gathered, gather, gathered, n_rows, subscriber, table, tank_subscriber, text_of
from faultbond.errors import SourceError
from faultbond.io.examples import example
from faultbond.io.recording import read_blocks
from faultbond.service.sources import growing_file as module
from faultbond.service.sources.growing_file import GrowingFile, Replay

ROWS = [(k, 50, 100 + k, 20) for k in range(40)]


@pytest.fixture(autouse=True)
def _soon(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "POLL", 0.01)


def follow(path: Path, steps: list[tuple[int, object]], cursors: dict[str, str] | None = None) -> Gathered:
    """Follow a file, and after so many rows or counts in all do what comes next to it; None ends it."""

    async def play() -> Gathered:
        found, left = Gathered(), list(steps)
        while not left:
            raise AssertionError

        def enough(seen: Gathered) -> bool:
            while left and sum(len(item.rows) for item in seen.arrivals) >= left[0][0]:
                _, act = left.pop(0)
                if act is None:
                    return True
                act()  # type: ignore[operator]
            return False

        return await gather(GrowingFile(path, [subscriber()]), enough, cursors, found)

    return asyncio.run(asyncio.wait_for(play(), 20.0))


def append(path: Path, text: str) -> None:
    """Write behind what is there."""
    with path.open("a") as stream:
        stream.write(text)


def test_a_file_is_followed(tmp_path: Path) -> None:
    """Rows come as they are written, the same to a bit as `run` reads them; half a line waits for its end."""
    path = tmp_path / "plant.csv"
    whole = text_of(ROWS)
    path.write_text(whole[:200])
    n_first = whole[:200].count("\n") - 1
    found = follow(path, [(n_first, lambda: append(path, whole[200:])), (40, None)])
    (expected,) = read_blocks(path, COLUMNS)
    np.testing.assert_array_equal(found.rows(), table(expected))
    assert len(found.arrivals[0].rows) == n_first < 40
    np.testing.assert_array_equal(found.arrivals[-1].rows.line[-1], 41)
    assert found.counts() == {}
    assert found.rows()[3].tolist() == [3.0, 50.0, 103_000.0, 293.15]


def test_reading_goes_on_behind_a_cursor(tmp_path: Path) -> None:
    """What follows a cursor comes, and no row twice, also where rows have no time but their number."""
    path = tmp_path / "plant.csv"
    path.write_text("\n\n" + text_of(ROWS[:7]) + "7,5")
    first = gathered(GrowingFile(path, [subscriber()]), n_rows(7))
    append(path, "0,107,20\n" + "".join(f"{','.join(map(str, row))}\n" for row in ROWS[8:]))
    then = gathered(GrowingFile(path, [subscriber()]), n_rows(33), first.cursors)
    assert then.rows()[:, 0].tolist() == [float(k) for k in range(7, 40)]
    assert then.arrivals[0].rows.line[0] == 11
    assert then.counts() == {}
    assert json.loads(then.cursors["one"])["place"] == path.stat().st_size


def test_a_file_that_is_cut_off_or_written_anew_is_begun_anew(tmp_path: Path) -> None:
    """It is counted, also where the new text is longer than the old, and where half a line was lost."""
    path = tmp_path / "plant.csv"
    path.write_text(text_of(ROWS[:10]) + "10,5")
    longer = text_of([(100 + k, 50, 1, 20) for k in range(30)])
    found = follow(
        path,
        [
            (10, lambda: path.write_text(text_of(ROWS[20:25]))),
            (15, lambda: path.write_text(longer)),
            (45, None),
        ],
    )
    assert found.rows()[:, 0].tolist() == [*range(10), *range(20, 25), *range(100, 130)]
    assert found.counts() == {"begun anew": 2, "unreadable": 1}


def test_a_file_that_is_replaced_is_read_to_its_end_first(tmp_path: Path) -> None:
    """As logs are rotated: the last line needs no end of a line, and no row is lost."""
    path = tmp_path / "plant.csv"
    path.write_text(text_of(ROWS[:10]))

    def rotate() -> None:
        append(path, "10,50,110,20\n11,50,111,20")
        path.rename(tmp_path / "plant.csv.1")
        path.write_text(text_of(ROWS[12:15]))

    found = follow(path, [(10, rotate), (15, None)])
    assert found.rows()[:, 0].tolist() == [*range(15)]
    assert found.counts() == {"begun anew": 1}


def test_a_cursor_of_another_file_begins_anew(tmp_path: Path) -> None:
    """A cursor that does not fit what is there is told as a count, and all of it is read."""
    path = tmp_path / "plant.csv"
    path.write_text(text_of(ROWS))
    first = gathered(GrowingFile(path, [subscriber()]), n_rows(40))
    for text in (text_of([(k, 1, 2, 3) for k in range(50)]), text_of(ROWS[:3])):
        path.write_text(text)
        n = text.count("\n") - 1
        then = gathered(GrowingFile(path, [subscriber()]), n_rows(n), first.cursors)
        assert len(then.rows()) == n
        assert then.counts() == {"begun anew": 1}
    assert gathered(GrowingFile(path, [subscriber()]), n_rows(3), {"one": "?"}).counts() == {"begun anew": 1}


def test_what_is_no_row_is_counted(tmp_path: Path) -> None:
    """Decimal commas and surplus fields are passed over and counted; a value that is none is nan in its row."""
    path = tmp_path / "plant.csv"
    path.write_text('time,u,y,z\n0,1,2,3\n1,"1,5",2,3\n2,1,2,3,4\n3,,x,3\n')
    found = gathered(GrowingFile(path, [subscriber()]), n_rows(2))
    np.testing.assert_array_equal(found.rows()[1], [3.0, np.nan, np.nan, 276.15])
    assert found.counts() == {"unreadable": 2}


def test_no_file_and_no_column_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that is not there, one that has gone, or lacks a column, is lost, in words that name it."""
    path = tmp_path / "plant.csv"
    with pytest.raises(SourceError, match=r"plant\.csv: cannot be read: No such file"):
        gathered(GrowingFile(path, [subscriber()]))
    path.write_text("time,u,y\n1,2,3\n")
    with pytest.raises(SourceError, match="no column 'z' \\(sensor z\\)"):
        gathered(GrowingFile(path, [subscriber()]))
    path.write_text(text_of(ROWS))
    monkeypatch.setattr(module, "GONE", 0.05)
    with pytest.raises(SourceError, match="the file is gone"):
        follow(path, [(40, path.unlink), (41, None)])


def test_assets_read_one_file_by_their_own_columns(tmp_path: Path) -> None:
    """Each has its rows and its cursor."""
    path = tmp_path / "plant.csv"
    path.write_text(text_of([(*row, 5) for row in ROWS], "time,u,y,z,w"))
    source = GrowingFile(path, [subscriber("one"), subscriber("two")])
    found = gathered(source, lambda seen: n_rows(40, "one")(seen) and n_rows(40, "two")(seen))
    np.testing.assert_array_equal(found.rows("one"), found.rows("two"))
    assert set(found.cursors) == {"one", "two"}


def test_a_replay_gives_what_run_reads() -> None:
    """As fast as it can, all rows of the tank's recording come to a bit, and behind a cursor the rest of them."""
    path = example("tank") / "fault_pipe.csv"
    item = tank_subscriber()
    source = Replay(path, [item], np.inf)
    found = gathered(source)
    expected = np.concatenate([table(block) for block in read_blocks(path, item.columns)])
    np.testing.assert_array_equal(found.rows("tank"), expected)
    half = gathered(source, n_rows(1000, "tank"))
    rest = gathered(source, cursors=half.cursors)
    np.testing.assert_array_equal(np.concatenate([half.rows("tank"), rest.rows("tank")]), expected)
    assert gathered(source, cursors=found.cursors).arrivals == []


def test_a_replay_keeps_its_time(tmp_path: Path) -> None:
    """Rows are due by their times over the speed; steps back, and rows without a time, take none."""
    path = tmp_path / "plant.csv"
    times = ["100", "102", "", "104", "50", "52"]  # the clock is set back by 54 s
    path.write_text(text_of([(moment, 1, 2, 3) for moment in times]))
    begun, seen = time.monotonic(), list[tuple[float, int]]()

    def note(found: Gathered) -> bool:
        seen.append((time.monotonic() - begun, sum(len(item.rows) for item in found.arrivals)))
        return False

    gathered(Replay(path, [subscriber()], 10.0), note)
    assert [number for _, number in seen] == [1, 3, 5, 6]
    moments = [moment for moment, _ in seen]
    assert moments[1] >= 0.2
    assert moments[2] >= 0.4
    assert 0.6 <= moments[3] < 2.0


def test_a_replay_tells_what_is_wrong(tmp_path: Path) -> None:
    """As `run` does, with the line, after the rows before it."""
    path = tmp_path / "plant.csv"
    path.write_text("time,u,y,z\n0,1,2,3\n1,1,2,3,4\n")
    found = Gathered()
    with pytest.raises(SourceError, match=r"plant\.csv:3: this row has 5 fields"):
        asyncio.run(asyncio.wait_for(gather(Replay(path, [subscriber()], np.inf), into=found), 10.0))
    assert len(found.rows()) == 1
