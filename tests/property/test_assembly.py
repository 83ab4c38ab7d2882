"""Rows from values that come one by one: nothing is lost, nothing waits for long, and order does not matter."""

import math

from hypothesis import given
from hypothesis import strategies as st

from faultbond.service.sources import assembly as module
from faultbond.service.sources.assembly import Assembly

N = 3
VALUES = st.lists(
    st.tuples(
        st.integers(0, N - 1), st.floats(-1e6, 1e6), st.integers(0, 12).map(lambda k: k / 4), st.floats(0.0, 0.5)
    ),
    max_size=60,
)  # signal, value, source time, s since the value before


def passed(values: list[tuple[int, float, float, float]], assembly: Assembly) -> list[tuple[float, module.RawRow]]:
    """Give all rows, each with the moment at which it goes out."""
    now, found = 0.0, []
    for signal, value, time, wait in values:
        now += wait
        found += [(now, row) for row in assembly.ready(now)]
        assembly.add(signal, value, time, now)
        found += [(now, row) for row in assembly.ready(now)]
    return found + [(now, row) for row in assembly.finish()]


@given(values=VALUES, together=st.sampled_from([0.0, 0.3]))
def test_each_value_is_in_one_row(values: list[tuple[int, float, float, float]], together: float) -> None:
    """As often as it came, in its signal's place, at its time or one that is near enough."""
    rows = [row for _, row in passed(values, Assembly(N, patience=1.0, together=together))]
    left = [(signal, value, time) for signal, value, time, _ in values]
    for moment, cells, *_ in rows:
        for signal, cell in enumerate(cells):
            if not math.isnan(cell):
                fit = [item for item in left if item[:2] == (signal, cell) and abs(item[2] - moment) <= together]
                left.remove(min(fit, key=lambda item: abs(item[2] - moment)))
    assert left == []


@given(
    values=VALUES,
    patience=st.floats(0.0, 2.0),
    hold=st.sampled_from([(), (0,), (0, 1, 2)]),
    settle=st.sampled_from([0.0, 0.2, 5.0]),
)
def test_no_row_waits_longer_than_patience(
    values: list[tuple[int, float, float, float]], patience: float, hold: tuple[int, ...], settle: float
) -> None:
    """Nothing is left whose first value came so long ago, and the last of a row comes no sooner than its first."""
    assembly, now = Assembly(N, hold=hold, patience=patience, settle=settle), 0.0
    for signal, value, time, wait in values:
        now += wait
        assembly.add(signal, value, time, now)
        out = assembly.ready(now)
        assert all(row.came <= now for row in out)
        assert all(now < row.first + patience and row.first <= row.last for row in assembly._rows)


@given(data=st.data(), n_rows=st.integers(1, 8), lost=st.booleans())
def test_the_order_of_arrival_does_not_matter(data: st.DataObject, n_rows: int, *, lost: bool) -> None:
    """Values of the same rows in any order, in time, are the same rows in the order of their times."""
    table = [(float(k), tuple(100.0 * k + s for s in range(N))) for k in range(n_rows)]
    cells = [(signal, value, time) for time, values in table for signal, value in enumerate(values)]
    if lost:
        gone = data.draw(st.sampled_from(cells))
        cells.remove(gone)
        table = [
            (time, tuple(math.nan if (s, v, time) == gone else v for s, v in enumerate(values)))
            for time, values in table
        ]
    assembly, found = Assembly(N, patience=1.0), []
    for signal, value, time in data.draw(st.permutations(cells)):
        assembly.add(signal, value, time, 0.0)
    found = assembly.ready(0.5) + assembly.ready(1.0)
    assert repr([item[:2] for item in found]) == repr(table)


@given(values=VALUES)
def test_the_same_values_give_the_same_rows(values: list[tuple[int, float, float, float]]) -> None:
    """There is no clock in it."""
    one, other = (passed(values, Assembly(N, hold=(1,), patience=0.4, together=0.1)) for _ in range(2))
    assert repr(one) == repr(other)
