"""Rows that are averaged for the samples that they are nearest to, and models whose noise is that of such means."""

import math
from pathlib import Path

import numpy as np
import pytest

from faultbond.errors import ModelError, RecordingError
from faultbond.io.grid import Grid, GridPoint, Row, blocks_of_points
from faultbond.io.row_block import block_of_rows
from faultbond.model.dump import dump_model
from faultbond.model.row_means import of_rows
from faultbond.model.text import parse_model

TANK = (Path(__file__).parents[3] / "examples" / "tank" / "model.yaml").read_text()
FAST = TANK.replace("sample_time: 1 s", "sample_time: 1 s\nrow_time: 0.1 s")


def rows(n: int = 60, *, step: float = 0.1, seed: int = 3) -> list[Row]:
    """Rows of one input and two sensors, with values absent here and there."""
    draws = np.random.default_rng(seed)
    values = draws.standard_normal((n, 3))
    values[draws.random((n, 3)) < 0.1] = math.nan
    return [Row(time=100.0 + k * step, u=values[k, :1], y=values[k, 1:], line=k + 2) for k in range(n)]


def pushed(grid: Grid, given: list[Row]) -> list[GridPoint]:
    """All points of some rows."""
    return [*(point for row in given for point in grid.push(row)), *grid.finish()]


def means(given: list[Row]) -> dict[int, np.ndarray]:
    """By the number of the sample the means of what is there, worked out the slow way."""
    found: dict[int, list[np.ndarray]] = {}
    for row in given:
        found.setdefault(math.floor(row.time - 100.0 + 0.5), []).append(np.array([*row.u, *row.y]))
    return {k: np.array([np.nanmean(column) for column in np.array(found[k]).T]) for k in found}


def test_each_sample_is_the_mean_of_the_rows_about_it() -> None:
    """Of each column, without what is absent; and nothing is counted as not used."""
    grid = Grid(1.0, row_time=0.1)
    points, expected = pushed(grid, rows()), means(rows())
    assert [point.time for point in points] == [100.0 + k for k in sorted(expected)]
    for k, point in enumerate(points):
        assert [*point.u, *point.y] == pytest.approx(list(expected[k]))
    assert (grid.counts.unused, grid.counts.missing) == (0, 0)


@pytest.mark.parametrize("live", [False, True])
def test_blocks_of_rows_give_the_same(live: bool) -> None:
    """However many rows come together."""
    given, one = rows(400), Grid(1.0, row_time=0.1, live=live)
    expected = pushed(one, given)
    for size in (1, 7, 130, 400):
        grid = Grid(1.0, row_time=0.1, live=live)
        parts = [block_of_rows(given[k : k + size]) for k in range(0, len(given), size)]
        found = [point for part in parts for block in grid.push_block(part) for point in block.points()]
        found += [point for block in blocks_of_points(grid.finish()) for point in block.points()]
        assert [point.time for point in found] == [point.time for point in expected]
        assert np.array([point.y for point in found]) == pytest.approx(
            np.array([point.y for point in expected]), nan_ok=True
        )
        assert grid.counts == one.counts


@pytest.mark.parametrize("size", [1, 7, 400])
def test_an_input_that_is_held_is_the_mean_up_to_the_next_sample(size: int) -> None:
    """So a store that is stepped from sample to sample is where its rows take it, and not half a sample late."""
    draws = np.random.default_rng(5)
    flow = np.repeat(draws.uniform(0.0, 2.0, 40), 10)[3:393]  # it jumps between the samples
    level = np.concatenate([[0.0], np.cumsum(0.1 * flow)[:-1]])
    given = [
        Row(time=0.1 * k, u=np.array([u, u]), y=np.array([x])) for k, (u, x) in enumerate(zip(flow, level, strict=True))
    ]
    grid, points = Grid(1.0, row_time=0.1, held=[True, False]), list[GridPoint]()
    for k in range(0, len(given), size):
        points += [point for block in grid.push_block(block_of_rows(given[k : k + size])) for point in block.points()]
    points += grid.finish()
    assert [point.time for point in points] == pytest.approx(range(40))
    stepped = np.concatenate([[0.0], np.cumsum([point.u[0] for point in points])])[: len(points)]
    assert stepped[:39] == pytest.approx(level[::10])
    for k, point in enumerate(points[:39]):
        assert point.u[0] == pytest.approx(flow[10 * k : 10 * k + 10].mean())
        assert point.u[1] == pytest.approx(flow[max(10 * k - 5, 0) : 10 * k + 5].mean())


def test_only_what_lags_is_held_where_rows_are_averaged() -> None:
    """What sensors feel at once is what acts about the sample, so another input goes linearly whatever is stated."""
    for text, linear in (("hold: last", True), ("hold: last, lag: 3 s", False), ("lag: 3 s", True)):
        graph = parse_model(FAST.replace("settling: 12 s}\n  u_out", f"settling: 12 s, {text}}}\n  u_out"))
        assert (graph.inputs[0].linear, graph.inputs[1].linear) == (linear, True)
        assert parse_model(dump_model(graph)).inputs == graph.inputs


def test_a_live_sample_is_there_when_the_next_begins() -> None:
    """With the first row that is nearer to the next one."""
    grid = Grid(1.0, row_time=0.1, live=True)
    given = rows(30)
    assert [point for row in given[:5] for point in grid.push(row)] == []
    assert [point.time for point in grid.push(given[5])] == [100.0]


def test_rows_that_are_late_or_repeated_do_not_spoil_a_mean() -> None:
    """They are counted as without means; a copy of a grid goes its own way."""
    given = rows()
    grid, usual = Grid(1.0, row_time=0.1), Grid(1.0, row_time=0.1)
    mixed = [*given[:30], given[29], given[3], *given[30:]]
    found, expected = pushed(grid, mixed), pushed(usual, given)
    assert np.array([point.y for point in found]) == pytest.approx(
        np.array([point.y for point in expected]), nan_ok=True
    )
    assert (grid.counts.late, grid.counts.unused, grid.counts.samples) == (1, 2, usual.counts.samples)
    first = Grid(1.0, row_time=0.1)
    for row in given[:17]:
        list(first.push(row))
    other = first.copy()
    for row in given[17:19]:
        list(other.push(row))
    rest = [point.y for point in pushed(first, given[17:])]
    assert np.array(rest)[-3:] == pytest.approx(np.array([point.y for point in expected])[-3:])


def test_a_clock_that_is_set_back_to_where_samples_began_loses_none() -> None:
    """What waits for the mean of an input that is held is given, though samples begin at the same time as before."""
    first, second = (
        [Row(time=0.1 * k, u=np.ones(1), y=np.array([more + k])) for k in range(400)] for more in (0.0, 1000.0)
    )
    grid = Grid(1.0, row_time=0.1, held=[True], live=True)
    y = [point.y[0] for point in pushed(grid, [*first, *second])]
    assert y[41:] == pytest.approx([1000.0 + value for value in y[:41]])
    assert (grid.counts.clock_jumps, grid.counts.samples) == (1, 82)


def test_a_reading_that_jumps_within_a_sample_is_left_out() -> None:
    """Its mean would be one that the plant never had; a slope, noise, and the input are as they are."""
    draws, n = np.random.default_rng(5), 600
    y = np.column_stack([draws.standard_normal(n), np.arange(n) * 3.0, np.zeros(n)])
    y[303:, :2] += 8.0
    given = [Row(time=100.0 + k * 0.1, u=np.array([float(k >= 303)]), y=y[k], line=k + 2) for k in range(n)]
    points = pushed(Grid(1.0, row_time=0.1), given)
    assert [k for k, point in enumerate(points) if math.isnan(point.y[0])] == [30]
    assert [k for k, point in enumerate(points) if math.isnan(point.y[2])] == []
    assert sum(math.isnan(point.y[1]) for point in points) <= 1
    assert points[30].u[0] == pytest.approx(0.2)
    many = [Row(time=0.1 * k, u=np.zeros(1), y=draws.standard_normal(1)) for k in range(30000)]
    assert sum(math.isnan(point.y[0]) for point in pushed(Grid(1.0, row_time=0.1), many)) < 6


@pytest.mark.parametrize("still", [5, 3000])
def test_what_was_still_at_first_is_not_taken_for_jumps(still: int) -> None:
    """A rounded reading that shows one value for a while, and then goes to and fro, is used from soon after on."""
    y = 20.0 + np.round(np.random.default_rng(8).normal(0.0, 0.07, 6000), 1)
    y[:still] = 20.0
    given = [Row(time=2.0 * k, u=np.zeros(1), y=y[k : k + 1], line=k + 2) for k in range(len(y))]
    points = pushed(Grid(10.0, row_time=2.0), given)
    assert sum(math.isnan(point.y[0]) for point in points) < 40


def test_rows_that_come_too_seldom_are_refused() -> None:
    """Their means would have more noise than the model says."""
    with pytest.raises(RecordingError, match=r"^line 21: the rows come every 1 s, but by the model file every 0\.1 s"):
        pushed(Grid(1.0, row_time=0.1), rows(step=1.0))


def test_noise_is_stated_of_a_row_and_taken_of_a_mean() -> None:
    """A file says what a reading scatters by; its text keeps that, and a simulation has it."""
    graph, plain = parse_model(FAST), parse_model(TANK)
    assert graph.sensors[0].noise == pytest.approx(plain.sensors[0].noise / math.sqrt(10.0))
    assert [item.linear for item in graph.inputs] == [True, True]
    again = parse_model(graph.text)
    assert again.text == graph.text
    assert again.sensors[0].noise == pytest.approx(graph.sensors[0].noise, rel=1e-12)
    by_rows = of_rows(graph)
    assert (by_rows.sample_time, by_rows.row_time) == (0.1, None)
    assert by_rows.sensors[1].noise == pytest.approx(180.0)
    held = parse_model(FAST.replace("u_in:  {", "u_in:  {hold: last, lag: 3 s, "))
    assert [item.linear for item in parse_model(held.text).inputs] == [False, True]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            FAST.replace("row_time: 0.1 s", "row_time: 0.6 s"),
            "row_time must be above 0, and half of sample_time or less: 0.5 s",
        ),
        (FAST.replace("row_time: 0.1 s", "row_time: 0 s"), "must be above 0"),
        (FAST.replace("sample_time: 1 s", "sample_time: variable"), "samples of a fixed sample_time"),
    ],
)
def test_a_time_between_rows_that_cannot_be_is_refused(text: str, message: str) -> None:
    """It is at most half of the time between samples, which is fixed."""
    with pytest.raises(ModelError, match=message):
        parse_model(text)
