"""What to check next, in words."""

from dataclasses import replace
from html.parser import HTMLParser
from io import StringIO

from rich.console import Console

from fake import TANK_STROKES, counts_of, suspect, tank_graph, tank_history, with_last, wrong
from faultbond.contract.findings import Advice, Candidate, Diagnosis, History
from faultbond.report.checks import SHOWN_CHECKS, action, check_rows, partition
from faultbond.report.html import render_report
from faultbond.report.numbers import Notation
from faultbond.report.terminal import print_diagnosis
from faultbond.report.verdict import verdict_sentence
from faultbond.types import CheckKind

GRAPH = tank_graph()
GROUPS: tuple[tuple[tuple[str, ...], ...], ...] = ((("pipe",),), (("flow",), ("pipe", "leak")))
LOOK = Advice(kind=CheckKind.COMPONENT, target="pipe", gain=0.9, cost=1.0, separates=GROUPS)
MOVE = Advice(kind=CheckKind.INPUT, target="u_in", gain=0.8, cost=1.0, separates=GROUPS, value=60.0, within=300.0)


def advised(*advice: Advice) -> History:
    """Give a run that ends with two candidates and this advice."""
    group = (
        Candidate(suspects=(suspect(GRAPH, "K1", 1.5, 0.1),), probability=0.6, group=True),
        Candidate(suspects=(wrong("flow.bias", 0.0, 1e-5, 1e-6),), probability=0.4, group=True),
    )
    run = with_last(tank_history(GRAPH, samples=1200), group)
    return replace(run, diagnoses=(*run.diagnoses[:-1], replace(run.diagnoses[-1], advice=advice)))


def test_actions() -> None:
    """A part is looked at, an instrument checked, an input moved in its unit, a signal measured."""
    assert action(GRAPH, LOOK, Notation.FILE) == "look at the pipe"
    assert action(GRAPH, replace(LOOK, target="flow"), Notation.FILE) == "check the flow sensor"
    assert action(GRAPH, replace(LOOK, target="u_in"), Notation.FILE) == "check the input u_in"
    assert action(GRAPH, MOVE, Notation.FILE) == "move u_in to 60 percent and wait 5 min"
    assert action(GRAPH, MOVE, Notation.PRINT) == "move u_in to 60 % and wait 5 min"
    level = replace(LOOK, kind=CheckKind.SIGNAL, target="level")
    assert action(GRAPH, level, Notation.FILE) == "measure level by hand"


def test_what_a_check_parts() -> None:
    """Groups that would be left are set against each other, sets by their parts."""
    assert partition(GRAPH, LOOK) == "pipe from flow sensor or pipe with leak"
    twice = replace(LOOK, separates=((("pipe",),), (("pump",), ("pump",), ("flow",))))  # by two parameters of the pump
    assert partition(GRAPH, twice) == "pipe from pump or flow sensor"


def test_costs_are_told_where_they_differ() -> None:
    """Only a few checks are listed, and a cost only where it tells something."""
    told = Diagnosis(time=0.0, candidates=(), advice=(LOOK,) * 9)
    assert len(check_rows(GRAPH, told, Notation.FILE)) == SHOWN_CHECKS
    assert {row.cost for row in check_rows(GRAPH, told, Notation.FILE)} == {""}
    dear = replace(told, advice=(LOOK, replace(MOVE, cost=2.5)))
    assert [row.cost for row in check_rows(GRAPH, dear, Notation.FILE)] == ["1", "2.5"]
    assert check_rows(GRAPH, dear, Notation.FILE)[0].gain == "0.90 bits"


def test_terminal_and_verdict_name_the_best_check() -> None:
    """The checks stand below the table, the best one in the verdict; without advice there is no such part."""
    for run, shown in ((advised(MOVE, LOOK), True), (advised(), False)):
        out = StringIO()
        print_diagnosis(Console(file=out), GRAPH, run, engine_title="e", counts=counts_of(run))
        assert ("What to check next" in out.getvalue()) is shown
        assert ("move u_in to 60 percent and wait 5 min: tells pipe from" in out.getvalue()) is shown
        verdict = verdict_sentence(GRAPH, run, counts_of(run), Notation.FILE)
        assert verdict.endswith("Best next: move u_in to 60 percent and wait 5 min.") is shown
        assert ("more data, or a change of input" in verdict) is not shown


class Text(HTMLParser):
    """Collects the text of headings and cells."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open = ""
        self.found: dict[str, list[str]] = {}
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.open = tag

    def handle_data(self, data: str) -> None:
        self.found.setdefault(self.open, []).append(data.strip())


def test_page_has_a_table_of_checks() -> None:
    """The page lists what to do; without advice the heading is left out."""
    for run, shown in ((advised(MOVE, LOOK), True), (advised(), False)):
        page = Text(render_report(GRAPH, run, TANK_STROKES, "e", "1", counts_of(run)))
        assert ("What to check next" in page.found["h2"]) is shown
        assert ("move u_in to 60 % and wait 5 min" in page.found["td"]) is shown
