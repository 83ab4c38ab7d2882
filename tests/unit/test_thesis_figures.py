"""Charts, figures and runs behind the page on the thesis."""

import re

import numpy as np
import pytest
from benchmarks.thesis import chapter5 as circuit
from benchmarks.thesis import chapter6 as exact
from benchmarks.thesis.chart import LEFT, POINTS, TOP, WIDTH, Curve, Panel, draw
from benchmarks.thesis.page import Figure, row

X = np.array([0.0, 1.0, 2.0])


def picture(curve: Curve, low: float | None = None, high: float | None = None) -> str:
    """Draw one panel."""
    return draw([Panel("a < b", (curve,), low=low, high=high)])


def test_a_curve_fills_its_frame() -> None:
    """The first and last point stand at the edges; the SVG is the same each time."""
    drawn = picture(Curve("y", X, X))
    assert f"M{LEFT:.1f} " in drawn
    assert f"L{LEFT + WIDTH:.1f} {TOP:.1f}" in drawn
    assert "a &lt; b" in drawn
    assert drawn == picture(Curve("y", X, X))


def test_a_gap_is_a_gap() -> None:
    """Where there is no value the line is broken."""
    y = np.array([0.0, 1.0, np.nan, 1.0, 2.0])
    drawn = picture(Curve("y", np.arange(5.0), y))
    assert len(re.findall(r'd="M[^"]*M', drawn)) == 1


def test_a_value_beyond_the_scale_stays_in_the_frame() -> None:
    """It is drawn along the edge."""
    drawn = picture(Curve("y", X, np.array([0.0, 50.0, 1.0])), low=0.0, high=1.0)
    assert f"{LEFT + WIDTH / 2:.1f} {TOP:.1f}L" in drawn


def test_long_curves_are_thinned_and_keep_their_peaks() -> None:
    """Of many points few are drawn, the highest among them."""
    y = np.zeros(10_000)
    y[4321] = 1.0
    drawn = picture(Curve("y", np.arange(10_000.0), y))
    assert drawn.count("L") < 2 * POINTS
    assert f" {TOP:.1f}" in re.findall(r'd="(M[^"]*L[^"]*)"', drawn)[0]


def test_a_figure_has_number_picture_and_table() -> None:
    """All stand in its text, under a heading that begins with the number."""
    panel = Panel("y", (Curve("y", X, X),))
    figure = Figure("9.12", "nothing", "9.1", panels=(panel,), rows=(row("y | 2", "2", same=True),))
    assert figure.text.startswith(
        "### Figure 9.12: nothing\n\nThesis 9.1.\n\n![nothing](images/thesis/figure_9_12.svg)"
    )
    assert "| y | 2 | 2 | - | same |" in figure.text


def test_the_circuit_obeys_its_laws() -> None:
    """The states that errors are counted from are those of the plant: without noise the output is V_I - V_C."""
    made = circuit.recording()
    states = circuit.true_states(made)
    assert states.shape == (made.time.size, 2)
    resistor = circuit.true_output(made) / 20.0
    charging = np.gradient(0.05 * states[:, 0], made.time)
    assert np.allclose(charging[2:-2], (resistor + states[:, 1])[2:-2], atol=0.02)


@pytest.mark.parametrize("name", ["R", "L"])
def test_the_formulas_of_6_2_are_exact_for_backward_euler(name: str) -> None:
    """R, which changed, is found at every sample; L, which did not, takes other values all the time."""
    found = exact.needed(name)
    found = found[np.isfinite(found)]
    if name == "R":
        assert np.quantile(np.abs(found - exact.FAULTY), 0.95) < 1e-6
    else:
        assert np.ptp(np.quantile(found, [0.1, 0.9])) > 1.0
