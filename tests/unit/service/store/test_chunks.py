"""Rows and curves come back from bytes as they were, and bytes that are not whole are refused."""

import re
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from faultbond.errors import StoreError
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Curves
from faultbond.service.store import chunks
from faultbond.service.store.chunks import pack_curves, pack_rows, unpack_curves, unpack_rows
from stored import some_curves, some_rows

SIZES = st.tuples(st.integers(0, 20), st.integers(0, 3), st.integers(0, 3))


@given(st.data(), SIZES, st.booleans())
def test_rows_come_back_to_the_last_bit(data: st.DataObject, sizes: tuple[int, int, int], dense: bool) -> None:
    """Any numbers, infinite ones and every kind of nan among them, have the same bits afterwards."""
    n, n_u, n_y = sizes
    numbers = [data.draw(arrays(np.uint64, shape)).view(np.float64) for shape in ((n, 1), (n, n_u), (n, n_y))]
    line = data.draw(arrays(np.int64, n)).astype(np.intp)
    milliseconds = st.integers(-(10**13), 10**13).map(lambda count: count / 1e3) | st.just(np.nan)
    rows = RowBlock(
        time=numbers[0][:, 0],
        u=numbers[1],
        y=numbers[2],
        saturated=np.arange(n),
        line=line,
        quality=data.draw(st.none() | arrays(np.uint8, (n, n_u + n_y))),
        arrived=data.draw(st.none() | arrays(np.float64, n, elements=milliseconds)),
    )
    found = unpack_rows(pack_rows(rows, dense=dense), "rows")
    for item in fields(RowBlock):
        one, other = getattr(found, item.name), getattr(rows, item.name)
        if other is None:
            assert one is None
            continue
        assert one.dtype == other.dtype
        assert one.shape == other.shape
        assert np.ascontiguousarray(one).tobytes() == np.ascontiguousarray(other).tobytes(), item.name


@pytest.mark.parametrize("dense", [True, False])
def test_curves_come_back_to_seven_digits(dense: bool) -> None:
    """Times are exact, values as far as they can be seen; nan stays, and what is too large is infinite."""
    curves = some_curves(1_700_000_000, 500)
    curves.cusum[3, 0] = 1e300
    found = unpack_curves(pack_curves(curves, dense=dense), "curves")
    assert found.time.tobytes() == curves.time.tobytes()
    assert np.isinf(found.cusum[3, 0])
    for item in fields(Curves)[1:]:
        values = getattr(curves, item.name).copy()
        values[values == 1e300] = np.inf
        np.testing.assert_allclose(getattr(found, item.name), values, rtol=6e-8)
        assert getattr(found, item.name).dtype == np.float64


@pytest.mark.parametrize("dense", [True, False])
def test_every_bit_counts(dense: bool) -> None:
    """A bit that is turned, anywhere, and every length that is too short, is seen."""
    data = pack_rows(some_rows(0, 5), dense=dense)
    for place in range(8 * len(data)):
        wrong = bytearray(data)
        wrong[place // 8] ^= 1 << place % 8
        with pytest.raises(StoreError, match=r"^rows 1 to 5 of 'pump': (damaged on the disk|of format)"):
            unpack_rows(bytes(wrong), "rows 1 to 5 of 'pump'")
    for length in range(len(data)):
        with pytest.raises(StoreError, match="damaged on the disk"):
            unpack_rows(data[:length], "rows")


def test_kinds_and_formats(monkeypatch: pytest.MonkeyPatch) -> None:
    """Curves are no rows, and bytes of a later format say so."""
    with pytest.raises(StoreError, match="they are of another kind"):
        unpack_rows(pack_curves(some_curves(0, 2), dense=False), "rows")
    with pytest.raises(StoreError, match="they are of another kind"):
        unpack_curves(pack_rows(some_rows(0, 2), dense=True), "curves")
    monkeypatch.setattr(chunks, "VERSION", 2)
    later = pack_rows(some_rows(0, 2), dense=False)
    monkeypatch.undo()
    with pytest.raises(StoreError, match=re.escape("rows: of format 2, and this faultbond reads 1.")):
        unpack_rows(later, "rows")


def test_bytes_do_not_depend_on_the_machine() -> None:
    """The head and the numbers stand as the format says, whatever the processor."""
    data = pack_rows(some_rows(2, 1, n_inputs=1, n_outputs=0), dense=False)
    assert data[:16] == b"fb\x01\x00" + b"\x01\0\0\0" * 2 + b"\0\0\0\0"
    assert data[20:28] == b"\0\0\0\0\0\0\0\x40"  # 2.0
    assert data[36:] == b"\x02\0\0\0" + (2001).to_bytes(8, "little")
