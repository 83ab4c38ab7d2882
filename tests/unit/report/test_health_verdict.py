"""What a trial on healthy data comes to, in a sentence."""

from dataclasses import replace
from io import StringIO
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rich.console import Console

from faultbond.fit.false_alarms import Rate
from faultbond.fit.innovations import LOST
from faultbond.fit.lack_of_fit import Region
from faultbond.fit.trial import FACTORS, DeclarationTrial, Health
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.report.fit_result import Fitted
from faultbond.report.health import _needed_texts, health_verdict, print_health, where_lines
from faultbond.report.quiet_result import Quieted, quiet_verdict

MODEL = """
name: divider
sample_time: 1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 1 kohm}}
  Rc: {type: R, parameters: {Rc: 3 kohm}}
junctions: {a: 1}
bonds: [source -> a -> R, a -> Rc]
sensors: {i: {reads: a.f, unit: mA, noise: 10 uA}}
"""
GRAPH = parse_model(MODEL)
WANDERING = parse_model(MODEL.replace("R: 1 kohm", "R: {nominal: 1 kohm, wander: 6 % over 30 min}"))


def health(*, peak: float = 0.4, between: float = 1e9, walk: float = 0.3) -> Health:
    """Give what a trial brought for which 1e6 s were promised: all is well but what is given."""
    rate = Rate(name="V", kind="sensor", peak=peak, between=between, mean=0.0, spread=1.0, memory=1.0)
    return Health(
        promise=1e6,
        step=1.0,
        records=(),
        watches=(),
        rates=(rate,),
        regions=(),
        moments=(),
        trials=(),
        walk=walk,
        walker="R",
        strayed={},
        late=(),
        early=(),
        mirrored=(),
    )


@pytest.mark.parametrize("mending", [frozenset[str](), frozenset({"noise"})])
def test_only_what_makes_a_difference_has_a_column(mending: frozenset[str]) -> None:
    """Of a first model, which alarms whatever is declared, a table would say nothing but that."""
    tried = [(kind, x) for kind in ("accuracy", "noise") for x in FACTORS]
    trials = tuple(
        DeclarationTrial(kind=kind, factor=x, peak=0.5 if kind in mending and x >= 3.0 else 9.0, between=1e9)
        for kind, x in tried
    )
    console = Console(file=StringIO(), width=120)
    print_health(console, GRAPH, replace(health(peak=9.0), trials=trials))
    told = cast(StringIO, console.file).getvalue()
    assert sum(line.endswith(" alarm") for line in told.splitlines()) == (
        5 if mending else 0
    )  # rows of less than three times
    alone = "accuracies of the parameters: none from 0.25 to 20 times is enough by itself"
    of_all = "of accuracies of the parameters and noise of the sensors none from 0.25 to 20 times is enough by itself"
    assert (alone if mending else f"more than can be declared: {of_all}") in " ".join(told.split())
    assert told.count("accuracies of the parameters") == 1


def test_what_is_far_beyond_a_limit_is_told_as_times() -> None:
    """A percentage of six digits says nothing to anybody, nor does an alarm more often than samples come."""
    console = Console(file=StringIO(), width=120)
    print_health(console, GRAPH, health(peak=663.194, between=0.646, walk=37.0))
    told = cast(StringIO, console.file).getvalue()
    assert "663 times" in told
    assert "66319" not in told
    assert "each sample" in told
    assert "R walks" not in told  # of what is far off everything does
    console = Console(file=StringIO(), width=120)
    print_health(console, GRAPH, health(peak=9.94, between=20.0, walk=1.35))
    told = cast(StringIO, console.file).getvalue()
    assert "994 %" in told
    assert "R walks" in told


def test_of_a_sensor_that_is_wrong_everywhere_two_regions_are_told() -> None:
    """Others that are off less are told, too; what is left out is counted."""
    regions = tuple(
        Region(sensor=name, of="V", low=k, high=k + 1.0, after_step=False, samples=99, mean=9.0 - k, spread=1.0)
        for name, count in (("i", 5), ("j", 3))
        for k in range(count)
    )
    told = [text for _, text in where_lines(WANDERING, replace(health(), regions=regions))]
    assert [text.split()[0] for text in told] == ["i", "i", "j", "j", "and"]
    assert told[-1] == "and 4 more"


def test_false_alarms_that_were_mended_may_go() -> None:
    """Of a model that keeps its promise nothing is to be held against it any more; of another one all is."""
    known = replace(GRAPH, false_alarms=2)
    assert (
        health_verdict(known, health())
        == health_verdict(GRAPH, health()) + " So `false_alarms: 2` of the model may go."
    )
    off = health(peak=1.3, between=1e3)
    assert health_verdict(known, off) == health_verdict(GRAPH, off)


@pytest.mark.parametrize("walk", [0.3, 37.0])
def test_of_a_model_that_is_far_off_nothing_is_to_be_declared_larger(walk: float) -> None:
    """A lag that is left out, or a bond the other way round, is no wide accuracy, whatever has to walk for it."""
    told = health_verdict(GRAPH, health(peak=143.0, between=0.02, walk=walk))
    assert "far off, most in V. `faultbond fit` with `--until-quiet` finds what it leaves out" in told
    assert "accuracy" not in told


@pytest.mark.parametrize("peak", [0.4, 1.3])
def test_a_parameter_that_walks_too_far_is_named_with_its_cure(peak: float) -> None:
    """Neither noise nor a time between false alarms, which may be long, says what is wrong then."""
    assert "keeps the promise" in health_verdict(GRAPH, health())
    told = health_verdict(GRAPH, health(walk=1.35, peak=peak))
    assert "does not keep the promise: the healthy model has to move R as far as for an alarm." in told
    assert "Declare the accuracy of R larger" in told
    assert "every" not in told


def test_what_walks_is_needed_before_the_rest() -> None:
    """Noise as declared is no cure of it; where less noise would do, more is not asked for."""
    told = "R must be let move farther than it is declared to, and besides one of these be larger:"
    assert next(iter(_needed_texts(health(walk=1.35)))) == told
    assert not any(text.startswith("R must") for text in _needed_texts(health()))


@pytest.mark.parametrize(
    ("graph", "cure", "asked"),
    [
        (GRAPH, "or that it wanders,", "is it a constant?"),
        (WANDERING, "or its `wander` larger or longer,", "does it wander farther, or for longer, than declared?"),
    ],
)
def test_what_wanders_already_is_to_wander_more(graph: BondGraph, cure: str, asked: str) -> None:
    """No advice asks for what the model file has."""
    assert cure in health_verdict(graph, health(walk=1.35))
    hints = " ".join(text for _, text in where_lines(graph, health(walk=1.35)))
    assert hints.endswith(f"R walks on healthy data, 135 % of the way to an alarm: {asked}")


@pytest.mark.parametrize(
    ("low", "high", "told"),
    [
        (138.63, 139.21, "138.63 to 139.21 V"),
        (1.0, 5.0, "1 to 5 V"),
        (12.3456, 71.2345, "12.3 to 71.2 V"),
        (7.0, 7.0, "7 to 7 V"),
        (-float("inf"), 7.0, "unknown to 7 V"),
    ],
)
def test_the_ends_of_a_range_differ(low: float, high: float, told: str) -> None:
    """Of a narrow range as many digits are told as show where it is; else three."""
    where = Region(sensor="i", of="V", low=low, high=high, after_step=False, mean=0.6, spread=1.0, samples=50)
    lines = where_lines(GRAPH, replace(health(), regions=(where,)))
    assert lines[0][1] == f"i reads 0.6 sd more than expected where V is {told}"


def test_a_filter_that_is_lost_is_told_first() -> None:
    """With the moment, since what it shows from there on says nothing."""
    record, seen = SimpleNamespace(name="h3.csv", time=np.arange(4.0)), SimpleNamespace(scores=np.zeros((4, 1)))
    seen.scores[2:] = LOST
    found = replace(health(), records=cast("Any", (record,)), watches=cast("Any", (seen,)))
    assert where_lines(GRAPH, found)[0][0] == "lost"
    assert where_lines(GRAPH, found)[0][1].startswith("from 2 s of h3.csv on nothing follows the plant any more")
    seen.scores[:] = 3.0
    assert not [text for title, text in where_lines(GRAPH, found) if title == "lost"]


@pytest.mark.parametrize(("spread", "memory", "is_told"), [(0.01, 1.0, True), (0.3, 1.0, False), (0.0, 0.0, False)])
def test_a_sensor_that_is_let_be_anything_is_named(spread: float, memory: float, is_told: bool) -> None:
    """Quiet it is, and deaf; of one without values nothing is said."""
    rate = Rate(name="V", kind="sensor", peak=0.0, between=1e9, mean=0.0, spread=spread, memory=memory)
    told = [text for title, text in where_lines(GRAPH, replace(health(), rates=(rate,))) if title == "blind"]
    assert [text[:17] for text in told] == ["V scores 0 ± 0.01"] * is_told


def test_what_alarms_by_its_sums_says_so() -> None:
    """Where no parameter walks, it is what it was."""
    assert "does not keep the promise: it alarms on these recordings." in health_verdict(GRAPH, health(peak=1.3))
    assert "a false alarm every" in health_verdict(GRAPH, health(between=1e4))


def test_a_recording_that_is_too_short_is_no_reason_for_another_model() -> None:
    """Where by chance alarms are as rare as was promised, nothing is advised but a longer recording."""
    found = health(between=1e5)
    short = replace(found, rates=tuple(replace(item, longer=20.0) for item in found.rates))
    assert "does not keep the promise: a false alarm every 27.8 h, where 11.6 d are asked." in health_verdict(
        GRAPH, found
    )
    told = health_verdict(GRAPH, short)
    assert told.startswith("The model may keep the promise: a false alarm every 27.8 h, where 11.6 d are asked, but ")
    assert "eclare" not in told


def test_a_model_that_is_not_quiet_says_on_what_it_alarms() -> None:
    """The recordings by name where the monitor alarms on them; else that some statistic would, or how often."""
    found = Quieted(
        fitted=cast("Fitted", SimpleNamespace(graph=GRAPH, values={}, moves={})),
        text="",
        held=(),
        stated=True,
        promise=1e6,
        health=health(peak=1.3, between=1e3),
    )
    start = "The model is not as quiet as promised: "
    alarmed = replace(found, alarms={"h1.csv": 20.0, "h3.csv": 2420.0})
    assert quiet_verdict(alarmed).startswith(f"{start}it alarms on h1.csv and h3.csv. ")
    assert quiet_verdict(found).startswith(f"{start}it alarms on these recordings. ")
    often = replace(found, health=health(between=7200.0))
    assert quiet_verdict(often).startswith(f"{start}a false alarm every 2 h. ")
