"""The drawing and the plots of the page that `generate --web` writes; no program is needed to look at them."""

import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from faultbond.model.text import load_model
from faultbond.report.browser import BuiltInRecording, render_browser_page
from faultbond.synthesis import browser_module as module
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


WORKER = """onmessage = () => {
  const samples = new Float64Array(200 * 14).map((_, k) => [k / 14 >> 0, 2, 20, 60, k / 1e5, 5e3 + k][k % 14] ?? 1);
  postMessage({ samples: [samples], lines: [], share: 1, over: { code: 0, text: "" } });
};"""
INK = """() => {
  const canvas = document.querySelector("#sensors canvas"), { width, height } = canvas;
  const { data } = canvas.getContext("2d").getImageData(0, 0, width, height), ink = [0, 0];
  for (let k = 0; k < width * height; k++)
    if (data[4 * k + 3] > 40 && data[4 * k + 2] > data[4 * k] + 60) ink[k % width < width * 0.6 ? 0 : 1]++;
  return ink;
}"""  # pixels of what is expected, which is blue, at the left and the right


def test_what_is_played_is_drawn_up_to_now(browser: Any, tmp_path: Path) -> None:
    """Of what the program has said the plots show what had come where the slider is; the values are those of then."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    recording = BuiltInRecording(name="made.csv", content=b"", start=0.0, end=199.0)
    text = render_browser_page(graph, build_spec(build_model(graph)), b"", {}, recording)
    text = re.sub('(id="worker">).*?(</script>)', lambda found: found[1] + WORKER + found[2], text, flags=re.DOTALL)
    file = tmp_path / "page.html"
    file.write_text(text, encoding="utf-8")
    wrong: list[str] = []
    page = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme="light")
    page.on("pageerror", lambda problem: wrong.append(str(problem)))
    page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
    try:
        page.goto(file.as_uri())
        page.select_option("#speed", "Infinity")
        page.click("#begin")
        page.wait_for_selector("body[data-state=over]")
        page.wait_for_timeout(100)
        left, right = page.evaluate(INK)
        assert min(left, right) > 0
        last = page.inner_text("#sensors .u-legend")
        page.eval_on_selector("#position", "slider => { slider.value = 450; slider.dispatchEvent(new Event('input')) }")
        page.wait_for_timeout(200)
        left, right = page.evaluate(INK)
        assert right == 0 < left
        assert page.inner_text("#sensors .u-legend") != last
        assert "Permission is hereby granted" in page.locator("footer pre").text_content()
        assert wrong == []
    finally:
        page.close()


@pytest.mark.skipif(shutil.which("nm") is None or shutil.which("cc") is None, reason="no cc, or no nm")
def test_the_program_of_the_page_needs_no_stream(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With one of these the module asks the page for a system, and does not begin."""
    texts: dict[str, str] = {}
    monkeypatch.setattr(module, "compile_wasm", lambda given, names: texts.update(given) or b"")
    module.browser_module(load_model(EXAMPLES / "rc" / "model.yaml"))
    for name, text in texts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    places = [f"-I{tmp_path / folder}" for folder in ("", "core", "program")]
    command = ["cc", "-O1", "-w", *places, "-c", str(tmp_path / "page.c"), "-o", str(tmp_path / "page.o")]
    subprocess.run(command, check=True)
    told = subprocess.run(["nm", "-u", str(tmp_path / "page.o")], check=True, capture_output=True, text=True).stdout
    asked = set(told.split()[1::2])
    assert {"page_records", "page_samples", "page_remark"} <= asked
    assert not asked & {"stdin", "stdout", "stderr", "fopen"}
