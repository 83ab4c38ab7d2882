"""Rows on standard input."""

import asyncio
import os
import threading
import time

import numpy as np
import pytest

from arriving import gather, gathered, n_rows, subscriber, text_of
from faultbond.errors import SourceError
from faultbond.service.sources.standard_input import StandardInput

ROWS = [(k, 50, 100 + k, 20) for k in range(200)]


def test_rows_come_while_the_stream_is_open() -> None:
    """They do not wait for the end, and at the end a last line without its end is a row, too."""
    reading, writing = os.pipe()
    text = text_of(ROWS).removesuffix("\n").encode()

    async def play() -> None:
        source = StandardInput([subscriber("one"), subscriber("two")], reading)
        os.write(writing, text[:300])
        first = await gather(source, lambda seen: len(seen.of("two")) > 0)
        assert len(first.rows("one")) == text[:300].count(b"\n") - 1
        os.write(writing, text[300:])
        os.close(writing)
        rest = await gather(source)
        whole = np.concatenate([first.rows("one"), rest.rows("one")])
        assert whole[:, 0].tolist() == [*range(200)]
        np.testing.assert_array_equal(whole, np.concatenate([first.rows("two"), rest.rows("two")]))
        assert all(item.cursor == "" for item in rest.arrivals)

    asyncio.run(asyncio.wait_for(play(), 10.0))
    os.close(reading)


def test_giving_up_ends_soon_and_loses_nothing() -> None:
    """Who waits for a silent stream can be cancelled; what came meanwhile is there when it is opened again."""
    reading, writing = os.pipe()

    async def play() -> float:
        source = StandardInput([subscriber()], reading)
        task = asyncio.create_task(gather(source))
        await asyncio.sleep(0.05)
        task.cancel()
        os.write(writing, text_of(ROWS).encode())
        os.close(writing)
        begun = time.monotonic()
        with pytest.raises(asyncio.CancelledError):
            await task
        ended = time.monotonic() - begun
        assert len((await gather(source, n_rows(200))).rows()) == 200
        return ended

    assert asyncio.run(asyncio.wait_for(play(), 10.0)) < 0.2
    os.close(reading)


def test_many_rows_go_out_together() -> None:
    """What comes within a tenth of a second is one batch, however small the pieces."""
    reading, writing = os.pipe()

    def write() -> None:
        for piece in text_of(ROWS).encode().splitlines(keepends=True):
            os.write(writing, piece)
            time.sleep(0.002)
        os.close(writing)

    thread = threading.Thread(target=write)
    thread.start()
    found = gathered(StandardInput([subscriber()], reading))
    thread.join()
    os.close(reading)
    assert len(found.rows()) == 200
    assert 2 <= len(found.arrivals) <= 12


@pytest.mark.parametrize(("text", "message"), [("", "it is empty"), ("a,b\n1,2\n", "no column 'time'")])
def test_a_stream_without_a_header_is_told(text: str, message: str) -> None:
    """In words that say what was expected."""
    reading, writing = os.pipe()
    os.write(writing, text.encode())
    os.close(writing)
    with pytest.raises(SourceError, match=f"standard input: {message}"):
        gathered(StandardInput([subscriber()], reading))
    os.close(reading)
