"""What the observations of a network without time say, as text."""

import io
from dataclasses import replace
from math import inf

import pytest
from rich.console import Console

from faultbond.contract.findings import Candidate, Detection, Diagnosis, Suspect
from faultbond.model.text import parse_model
from faultbond.report.observed import SHOWN_SETS, Observed, print_observed, sets_verdict

PAIR = """
sample_time: none
inputs: {x: {}}
blocks: {a: {law: y = A*x + B, parameters: {A: 1 kPa, B: 1 kPa}}}
sensors: {y: {reads: y}}
"""


def of_blocks(*names: str) -> Candidate:
    """Give a set of blocks."""
    return Candidate(suspects=(), blocks=names, probability=0.5, group=True)


def of_parameter(name: str, estimate: float, sd: float) -> Candidate:
    """Give a parameter with its value."""
    suspect = Suspect(parameter=name, component="a", nominal=1000.0, estimate=estimate, sd=sd)
    return Candidate(suspects=(suspect,), probability=0.5, group=True)


def shown(*candidates: Candidate) -> str:
    """Give the text of a diagnosis."""
    seen = Observed(
        name="pair",
        sensors=("y",),
        rows=3,
        watched=3,
        detection=Detection(time=0.0, sample=0, change_time=0.0, signals=("y",)),
        diagnosis=Diagnosis(time=0.0, candidates=candidates),
        graph=parse_model(PAIR),
    )
    stream = io.StringIO()
    print_observed(Console(file=stream), seen)
    stream.write("--\n")
    print_observed(Console(file=stream), replace(seen, detection=None, diagnosis=None))
    return stream.getvalue()


@pytest.mark.parametrize(
    ("candidates", "expected"),
    [
        ((), "No set of suspects explains these observations"),
        ((of_blocks("X"),), "One suspect explains every observation since then."),
        ((of_blocks("X", "Y"),), "One set of 2 suspects explains every observation since then."),
        ((of_blocks("X"), of_blocks("Y")), "2 suspects explain every observation since then, each alone;"),
        ((of_blocks("X", "Y"), of_blocks("X", "Z")), "2 sets of 2 suspects explain every observation since then,"),
        ((of_parameter("A", 2.0, 0.0), of_parameter("A", -2.0, 0.0)), "since then, with 2 possible values."),
    ],
)
def test_verdict(candidates: tuple[Candidate, ...], expected: str) -> None:
    """Sets are counted, not their solutions."""
    assert expected in sets_verdict(candidates)


def test_values_in_the_unit_of_the_model() -> None:
    """An exact value stands alone, a fitted one with its standard deviation; one of many is called so."""
    text = shown(of_parameter("A", 2500.0, 0.0), of_parameter("B", 3500.0, 100.0), of_parameter("B", 4500.0, inf))
    lines = [" ".join(line.split()) for line in text.splitlines()]
    assert "a A 1 2.5 kPa" in lines
    assert "a B 1 3.50 ± 0.10 kPa" in lines
    assert "a B 1 not determined, such as 4.5 kPa" in lines
    assert "Nothing contradicts the healthy network in 3 observations." in lines


def test_long_lists_are_cut() -> None:
    """Twenty sets are shown and the others counted."""
    sets = [of_blocks(f"g{k}") for k in range(SHOWN_SETS + 1)]
    assert "and 1 more; --json writes all" in shown(*sets)
    assert f"{{g{SHOWN_SETS}}}" not in shown(*sets)
    assert "more" not in shown(*sets[:SHOWN_SETS])
