"""What `run` prints."""

from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from fake import counts_of, kind_of, moving, suspect, tank_graph, tank_history, with_last
from faultbond.contract.findings import Candidate, History, Unexplained, Untested
from faultbond.report.terminal import print_diagnosis
from faultbond.report.verdict import RunCounts
from faultbond.types import FaultKind

GRAPH = tank_graph("tank [red]one[/red]")


def printed(history: History, counts: RunCounts) -> str:
    """Give the text for a file."""
    out = StringIO()
    print_diagnosis(Console(file=out), GRAPH, history, engine_title="test engine", counts=counts)
    return out.getvalue()


def test_file_gets_heading_table_and_sentence() -> None:
    """A file gets the same as a terminal, without colours; the text takes 100 columns, the table 112."""
    history = tank_history(GRAPH, samples=4920)
    text = printed(history, counts_of(history))
    assert "Diagnosis" in text
    assert "2.41e11" in text
    assert "Most likely the pipe changed" in " ".join(text.split())
    assert "\x1b" not in text
    lines = text.splitlines()
    first, last = (next(k for k, line in enumerate(lines) if word in line) for word in ("Diagnosis", "... and"))
    assert max(map(len, (*lines[: first + 1], *lines[last:]))) <= 100
    assert max(map(len, lines)) <= 112


def test_what_was_watched_is_stated() -> None:
    """Model, sensors, sample time, engine, samples and defects of the recording are named; markup stays text."""
    history = tank_history(GRAPH, samples=4920)
    text = printed(history, RunCounts(samples=4920, missing=100, duplicate=2))
    for part in ("tank [red]one[/red]", "flow, pressure; every 1 s", "test engine", "4920", "82 min"):
        assert part in text
    assert "100 missing, 2 duplicate" in text
    assert "late" not in text
    worse = printed(history, RunCounts(samples=4920, untimed=1, unused=7, clock_jumps=1, saturated=3, frozen=70))
    assert "1 untimed, 7 unused, 3 saturated, 70 frozen, 1 clock jump" in worse


def test_group_is_marked_and_explained() -> None:
    """Rows that cannot be told from the best carry a mark, and the mark is explained."""
    history = tank_history(GRAPH, samples=1200)
    early = printed(replace(history, diagnoses=history.diagnoses[:3]), RunCounts(samples=1200))
    assert early.count("●") > 2
    assert "not yet distinguishable" in early
    assert "●" not in printed(history, RunCounts(samples=1200))


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


def test_every_line_of_a_row_is_its_own() -> None:
    """Suspects, rates and kinds stand below each other, also where a long unit takes several lines."""
    pair = (suspect(GRAPH, "K7", 1.5, 0.1), suspect(GRAPH, "K4", 0.5, 0.1))
    best = kind_of(moving(GRAPH, "K1", 1.5, 1e8), (FaultKind.DRIFT, 0.7), (FaultKind.STEP, 0.3), probability=0.9)
    history = with_last(
        tank_history(GRAPH, samples=1200), (best, Candidate(suspects=pair, probability=0.1, group=False))
    )
    rows = [line.split() for line in printed(history, RunCounts(samples=1200)).splitlines()]
    assert ["pipe", "drift", "70", "%", "K1", "2.41e11"] in [row[:6] for row in rows]
    assert ["step", "30", "%", "rate"] in [row[:4] for row in rows]
    assert ["+", "outlet", "K4", "2.35e-6"] in [row[:4] for row in rows]


def test_what_nothing_explains_is_no_verdict_on_a_part() -> None:
    """Where the data contradict every candidate, the text leads with that and claims nothing as sure, nor a value."""
    run = with_last(
        tank_history(GRAPH), (Candidate(suspects=(suspect(GRAPH, "K1", 1.5, 0.1),), probability=1.0, group=True),)
    )
    off = Unexplained(signal="flow", sd=3.21, since=3000.0, until=4000.0)
    last = replace(run.diagnoses[-1], unexplained=off)
    text = " ".join(printed(replace(run, diagnoses=(*run.diagnoses[:-1], last)), RunCounts(samples=9)).split())
    verdict = text[text.index("None of the modelled") :]
    assert verdict.startswith(
        "None of the modelled faults explains this: the best fit is still 3.2 standard deviations off in flow between "
        "3000 s and 4000 s, on average. More than 2 faults at once were not tested (`max_faults: 2`), nor "
        "two of which both move or stick, or one scatters or comes and goes. Nearest comes pipe K1."
    )
    assert "sure" not in verdict
    assert "unit change ─" in text  # and no column of percentages
    assert "unit change % ─" in " ".join(printed(run, RunCounts(samples=9)).split())


MANY = "Another 1330 sets were not tested"


@pytest.mark.parametrize(
    ("part", "sure", "told"),
    [
        (None, "+50 %), 99.8 % sure.", ""),
        (0.0004, "+50 %), 99.8 % sure.", f"{MANY}; the truth is among them with at most 0.1 %."),
        (0.19991, "+50 %), at least 79 % sure.", f"{MANY}; the truth is among them with at most 20.0 %."),
        (
            1.0,
            "+50 %), 99.8 % sure among the sets tested.",
            f"{MANY}; how likely it is that the truth is among them cannot be told.",
        ),
    ],
)
def test_sets_too_many_to_be_tested_are_counted(part: float | None, sure: str, told: str) -> None:
    """At most what they may hide is told, and the verdict is less sure by as much; where nothing bounds it, that is."""
    best = kind_of(suspect(GRAPH, "K1", 1.5, 0.1), (FaultKind.STEP, 1.0), probability=0.9985)
    run = with_last(tank_history(GRAPH), (best,))
    left = None if part is None else Untested(sets=1330, probability=part)
    text = printed(replace(run, diagnoses=(replace(run.diagnoses[-1], untested=left),)), RunCounts(samples=9))
    words = " ".join(text.split())
    assert told in words
    assert sure in words
    assert (MANY in words) is (left is not None)
