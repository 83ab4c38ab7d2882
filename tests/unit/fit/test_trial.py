"""The detector along a recording in one call, and how often it would alarm."""

from math import erf

import numpy as np
import pytest

from faultbond.fit.certainty import long_run_variance
from faultbond.fit.false_alarms import cusum_time
from faultbond.fit.innovations import watch
from faultbond.fit.likelihood import layout_of
from faultbond.fit.samples import prepare
from faultbond.io.examples import example
from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.text import load_model
from faultbond.runtime.monitor import step
from faultbond.runtime.state import Sample, init
from faultbond.synthesis.engine import build_engine, build_model


def test_it_sees_what_the_monitor_sees() -> None:
    """Sums and slow errors of the tank, with inputs that settle, are those of the monitor sample by sample."""
    graph = load_model(example("tank") / "model.yaml")
    spec, engine = build_engine(graph)
    rows = list(read_rows(example("tank") / "healthy.csv", columns_of(graph)))[:700]
    points = [
        Sample(time=item.time, dt=item.dt, u=item.u, y=item.y if item.index % 97 else np.full(2, np.nan))
        for item in on_grid(rows, Grid(spec.sample_time))
    ]
    layout = layout_of(build_model(graph))
    seen = watch(spec, engine, prepare("tank", points, spec, layout), layout)
    state = init(spec)
    for k, point in enumerate(points):
        state, report = step(spec, engine, state, point)
        if k > spec.thresholds.warm_up_samples:
            assert report.cusum == pytest.approx(seen.cusum[:, k].max(axis=0), rel=1e-6, abs=1e-6)
            assert report.slow == pytest.approx(seen.slow[k], rel=1e-6, abs=1e-9)


def test_the_time_between_false_alarms_is_that_of_white_noise() -> None:
    """The formula gives the mean time of a CUSUM of white noise within a tenth; the true one solves an equation."""
    drift, limit, n = 0.3, 6.0, 1200
    grid = (np.arange(n) + 0.5) * limit / n
    width = limit / n
    density = np.exp(-0.5 * (grid[None, :] - grid[:, None] + drift) ** 2) / np.sqrt(2.0 * np.pi) * width
    from_zero = np.array([0.5 * (1.0 + erf((drift - place) / np.sqrt(2.0))) for place in grid])
    matrix = np.eye(n + 1)
    matrix[1:, 1:] -= density
    matrix[1:, 0] -= from_zero
    matrix[0, 1:] -= np.exp(-0.5 * (grid + drift) ** 2) / np.sqrt(2.0 * np.pi) * width
    matrix[0, 0] -= 0.5 * (1.0 + erf(drift / np.sqrt(2.0)))
    exact = float(np.linalg.solve(matrix, np.ones(n + 1))[0])
    assert cusum_time(-drift, 1.0, limit) == pytest.approx(exact, rel=0.1)


def test_a_mean_makes_it_climb_straight() -> None:
    """With a mean above the drift the CUSUM climbs to its limit at that speed."""
    assert cusum_time(1.0, 0.01, 25.0) == pytest.approx(25.1, rel=0.01)


def test_the_long_run_variance_of_a_moving_average() -> None:
    """Sums of neighbours have a long-run variance of four, white noise of one, per sample."""
    rng = np.random.default_rng(2)
    noise = rng.standard_normal(20001)
    assert long_run_variance(noise[:, None])[0, 0] / 20001 == pytest.approx(1.0, rel=0.1)
    pairs = (noise[1:] + noise[:-1])[:, None]
    assert long_run_variance(pairs)[0, 0] / 20000 == pytest.approx(4.0, rel=0.15)
