"""What `run` prints."""

from dataclasses import replace
from io import StringIO

from fake import counts_of, tank_graph, tank_history
from rich.console import Console

from faultbond.report.terminal import print_diagnosis
from faultbond.report.verdict import Counts
from faultbond.runtime.history import History

GRAPH = tank_graph("tank [red]one[/red]")


def printed(history: History, counts: Counts) -> str:
    """Give the text for a file."""
    out = StringIO()
    print_diagnosis(Console(file=out), GRAPH, history, engine_title="test engine", counts=counts)
    return out.getvalue()


def test_file_gets_heading_table_and_sentence() -> None:
    """A file gets the same as a terminal, without colours and at most 100 columns wide."""
    history = tank_history(GRAPH, samples=4920)
    text = printed(history, counts_of(history))
    assert "Diagnosis" in text
    assert "2.41e11" in text
    assert "Most likely the pipe changed" in " ".join(text.split())
    assert "\x1b" not in text
    assert max(map(len, text.splitlines())) <= 100


def test_what_was_watched_is_stated() -> None:
    """Model, sensors, sample time, engine, samples and defects of the recording are named; markup stays text."""
    history = tank_history(GRAPH, samples=4920)
    text = printed(history, Counts(samples=4920, missing=100, duplicate=2))
    for part in ("tank [red]one[/red]", "flow, pressure; every 1 s", "test engine", "4920", "82 min"):
        assert part in text
    assert "100 missing, 2 duplicate" in text
    assert "late" not in text


def test_group_is_marked_and_explained() -> None:
    """Rows that cannot be told from the best carry a mark, and the mark is explained."""
    history = tank_history(GRAPH, samples=1200)
    early = printed(replace(history, diagnoses=history.diagnoses[:3]), Counts(samples=1200))
    assert early.count("●") > 2
    assert "not yet distinguishable" in early
    assert "●" not in printed(history, Counts(samples=1200))


def test_healthy_run_has_no_table() -> None:
    """Without a fault there is a sentence and no table."""
    history = tank_history(GRAPH, fault=False)
    text = printed(history, counts_of(history))
    assert "No fault found in 4920 samples" in text
    assert "Diagnosis" not in text


def test_terminal_keeps_its_width() -> None:
    """A real terminal is not resized."""
    console = Console(file=StringIO(), force_terminal=True, width=73)
    history = tank_history(GRAPH, samples=1200)
    print_diagnosis(console, GRAPH, history, engine_title="test engine", counts=counts_of(history))
    assert console.width == 73


def test_sets_that_are_not_tested_are_named() -> None:
    """Below the table stands what would explain anything; a healthy run says nothing of it."""
    for history, shown in ((tank_history(GRAPH, samples=4920), True), (tank_history(GRAPH, fault=False), False)):
        out = StringIO()
        counts = counts_of(history)
        print_diagnosis(Console(file=out), GRAPH, history, engine_title="e", counts=counts, untested="{K1, K4}")
        assert ("Not tested, since each would explain anything: {K1, K4}." in out.getvalue()) is shown
