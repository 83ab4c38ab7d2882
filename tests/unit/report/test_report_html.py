"""The HTML page about a run."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

from fake import TANK_STROKES, counts_of, suspect, tank_graph, tank_history, with_last, wrong
from faultbond.contract.findings import Candidate, History, Unexplained
from faultbond.model.graph import BondGraph
from faultbond.report.html import render_report

GRAPH = tank_graph()
Render = Callable[[BondGraph, History], str]


class Page(HTMLParser):
    """Collects tags with attributes, and the text of headings and scripts."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.open: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts.setdefault(self.open[-1], []).append(data)

    @property
    def data(self) -> dict[str, Any]:
        """The embedded numbers."""
        found: dict[str, Any] = json.loads(self.texts["script"][0])
        return found


def page(history: History, graph: BondGraph = GRAPH) -> Page:
    """Render and parse."""
    return Page(render_report(graph, history, TANK_STROKES, "test engine", "1.2.3", counts_of(history)))


@pytest.fixture(scope="module")
def history() -> History:
    """Give a long run with a fault."""
    return tank_history(GRAPH)


def traces(found: Page, chart: int) -> dict[str, list[float | None]]:
    """Give the lines of a chart by name."""
    return {trace["label"]: trace["y"] for trace in found.data["charts"][chart]["traces"]}


def test_verdict_is_the_headline(history: History) -> None:
    """The page's headline names the component."""
    headline = "".join(page(history).texts["h1"])
    number = "2.41\N{NO-BREAK SPACE}\N{MULTIPLICATION SIGN}\N{NO-BREAK SPACE}10¹¹"
    assert headline.startswith(f"Most likely the pipe changed: K1 rose from {number}")


def test_all_sections_of_a_faulty_run(history: History) -> None:
    """A run with a fault shows diagnosis, graph, signals, inputs, detector, probabilities and estimates."""
    assert page(history).texts["h2"] == [
        "Diagnosis",
        "Bond graph",
        "Measured and expected",
        "Inputs",
        "Detector",
        "Probability of each explanation",
        "Estimates",
    ]


def test_healthy_run_has_neither_diagnosis_nor_colours() -> None:
    """Without a fault the page says so and shows the signals only."""
    found = page(tank_history(GRAPH, fault=False))
    assert "".join(found.texts["h1"]).startswith("No fault found in 4920 samples")
    assert found.texts["h2"] == ["Bond graph", "Measured and expected", "Inputs", "Detector"]
    assert found.data["marks"] == []
    assert not [attributes for _, attributes in found.tags if attributes.get("class") == "legend"]


def test_hostile_name_is_escaped(history: History) -> None:
    """A model whose name is a script, and a sensor that closes one, add no script to the page."""
    plain, evil = page(history), "</script><script>alert(1)</script>"
    sensors = (replace(GRAPH.sensors[0], name=evil), *GRAPH.sensors[1:])
    hostile = page(history, replace(GRAPH, name=evil, sensors=sensors))
    count = [sum(tag == "script" for tag, _ in found.tags) for found in (plain, hostile)]
    assert count[0] == count[1] == 3
    assert evil in "".join(hostile.texts["p"])
    assert evil in hostile.texts["figcaption"][0]
    assert f"CUSUM of {evil}" in traces(hostile, 3)


def test_page_needs_no_network(history: History) -> None:
    """Nothing is loaded from elsewhere: no address in src, href, style or import, and the browser is told so."""
    found = page(history)
    addresses = [
        value for _, attributes in found.tags for name, value in attributes.items() if name in {"src", "href", "action"}
    ]
    assert addresses == []
    assert not re.search(r"@import|url\(", "".join(found.texts["style"]))
    policies = [attributes.get("content") or "" for tag, attributes in found.tags if tag == "meta"]
    assert any(policy.startswith("default-src 'none'") for policy in policies)


def test_gaps_stay_gaps(history: History) -> None:
    """Samples that are not a number are null, not zero and not left out, in the unit of the model file."""
    short = replace(history, measured=history.measured.copy())
    short.measured[50, 0] = np.nan
    kept = page(replace(short, **{name: getattr(short, name)[:3000] for name in ARRAYS}, diagnoses=()))
    flow, pressure = traces(kept, 0)["measured"], traces(kept, 1)["measured"]
    assert flow[49] is not None
    assert flow[50] is None
    assert pressure[1200:1300] == [None] * 100
    assert pressure[0] == pytest.approx(history.measured[0, 1] / 1000.0, rel=1e-5)


ARRAYS = ("time", "measured", "expected", "expected_sd", "inputs", "cusum", "slow")


def test_group_of_several_shows_each(history: History) -> None:
    """Explanations that cannot be told apart are all marked, and each gets its own chart."""
    group = tuple(
        Candidate(suspects=(suspect(GRAPH, name, 1.5, 0.1),), probability=p, group=True)
        for name, p in (("K4", 0.6), ("K2", 0.4))
    )
    found = page(with_last(history, group))
    assert "".join(found.texts["h1"]).startswith("Cannot yet be told apart")
    assert found.texts["span"].count("●") == 2
    assert found.texts["figcaption"][-2:] == ["K4 of outlet", "K2 of orifice"]


def test_instruments_stand_below_the_drawing(history: History) -> None:
    """Sensors and inputs are named with their probability, and none is claimed where nothing explains the data."""
    found = (
        Candidate(suspects=(wrong("flow.bias", 0.0, 1e-5, 1e-6),), probability=0.75, group=True),
        Candidate(suspects=(suspect(GRAPH, "K1", 1.5, 0.1),), probability=0.25, group=True),
    )
    run = with_last(history, found)
    items = [text.strip() for text in page(run).texts["li"] if text.strip()]
    assert items == ["flow sensor", "pressure sensor", "input u_in", "input u_out"]
    assert "75.0 %" in page(run).texts["b"]
    off = Unexplained(signal="flow", sd=3.0, since=4000.0, until=4900.0)
    doubtful = replace(run, diagnoses=(*run.diagnoses[:-1], replace(run.diagnoses[-1], unexplained=off)))
    assert "li" not in page(doubtful).texts
    assert "probability of a change" not in "".join(page(doubtful).texts["text"])
    assert "probability of a change" in "".join(page(run).texts["text"])


def test_marks_and_limit(history: History) -> None:
    """Onset and alarm are marked at their times, and the detector's limit is a line at 1."""
    data = page(history).data
    assert data["marks"] == [{"x": 2469, "label": "onset"}, {"x": 2736, "label": "alarm"}]
    assert data["charts"][3]["levels"] == [[1, "limit"]]


def test_axes_carry_model_units(history: History) -> None:
    """Every axis has the unit of the model file, with a power of ten where numbers would be long."""
    units = [chart["unit"] for chart in page(history).data["charts"]]
    assert units == ["l/min", "kPa", "%", "", "%", "10¹¹ Pa·s²/m⁶"]


def test_probabilities_sum_to_one(history: History) -> None:
    """The drawn lines with all others make 100 % at every diagnosis."""
    lines = traces(page(history), 4)
    assert len(lines) == 7
    assert np.sum(np.array(list(lines.values())), axis=0) == pytest.approx(100.0, abs=1e-3)


def test_long_recordings_stay_small() -> None:
    """A recording of 200,000 samples gives less than 3 MB and at most some 4000 points per trace."""
    text = render_report(
        GRAPH, run := tank_history(GRAPH, samples=200_000), TANK_STROKES, "test engine", "1.2.3", counts_of(run)
    )
    assert len(text.encode()) < 3_000_000
    assert max(len(chart["x"]) for chart in Page(text).data["charts"]) < 5000


def test_unix_clock_is_exact() -> None:
    """On a clock of Unix seconds the page knows it, and times keep their fractions."""
    data = page(tank_history(GRAPH, samples=1200, start=1.71e9)).data
    assert data["calendar"] is True
    assert data["start"] == 1.71e9
    assert data["charts"][0]["x"][:3] == [0, 1, 2]
