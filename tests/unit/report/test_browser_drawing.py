"""The drawing of the page that `generate --web` writes, on a narrow screen; no program is needed to look at it."""

from pathlib import Path
from typing import Any

import pytest

from faultbond.model.text import load_model
from faultbond.report.browser import render_browser_page
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).parents[3] / "examples"
LETTERS = (
    "parseFloat(getComputedStyle(graph).fontSize) * graph.getBoundingClientRect().width / graph.viewBox.baseVal.width"
)


@pytest.mark.parametrize("name", ["tank", "dc_motor", "three_tank"])
def test_a_drawing_can_be_read_on_a_phone(browser: Any, name: str, tmp_path: Path) -> None:
    """It shrinks to its box while its letters have 9 px; what is wider has a shadow where it goes on."""
    graph = load_model(EXAMPLES / name / "model.yaml")
    file = tmp_path / "page.html"
    file.write_text(render_browser_page(graph, build_spec(build_model(graph)), b"", {}, None), encoding="utf-8")
    page = browser.new_page(viewport={"width": 360, "height": 740})
    try:
        page.goto(file.as_uri())
        size = page.evaluate(f"(() => {{ const graph = document.querySelector('#drawing svg'); return {LETTERS}; }})()")
        assert size == pytest.approx(9.1, abs=0.2)  # none of these three fits on 318 px
        shown = page.evaluate("getComputedStyle(document.getElementById('drawing')).backgroundAttachment")
        assert shown == "local, local, scroll, scroll"
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        page.set_viewport_size({"width": 1400, "height": 740})
        box = page.evaluate(
            "(({ clientWidth, scrollWidth }) => [clientWidth, scrollWidth])(document.getElementById('drawing'))"
        )
        assert name == "three_tank" or box[0] == box[1]
    finally:
        page.close()
