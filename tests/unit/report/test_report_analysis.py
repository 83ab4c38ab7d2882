"""The text of an analysis: what is counted, what is listed, what is left out and said to be."""

import math
from collections.abc import Callable
from dataclasses import replace
from io import StringIO
from typing import Any, cast

import numpy as np
import pytest
from rich.console import Console

from faultbond.analysis.capability import CapabilityView
from faultbond.analysis.comparison import NO_TIME
from faultbond.analysis.groups import Group, NearGroup
from faultbond.analysis.other_roots import OtherSolutions
from faultbond.analysis.ranks import Rank
from faultbond.analysis.smallest import Effect, SmallestFault
from faultbond.analysis.testable import Judgement, SetVerdict
from faultbond.analysis.twins import Comparison, Twins
from faultbond.diagnosability.isolability import Isolability
from faultbond.model.graph import BondGraph, SlowError
from faultbond.model.text import load_model, parse_model
from faultbond.report.analysis import (
    StructuralTests,
    heat_lines,
    print_input_advice,
    print_smallest,
    print_solutions,
    print_structure,
    print_view,
    smallest_record,
)
from made import EXAMPLES

STORE = """\
name: store
sample_time: 10 s
inputs: {P: {unit: W}, T_a: {unit: degC}}
components:
  heater: {type: Sf, law: f = P}
  water: {type: C, law: q = C1*e, parameters: {C1: 300 kJ/K}}
  wall: {type: R, law: f = U*e, parameters: {U: 2 W/K}}
  room: {type: Se, law: e = T_a}
junctions: {inside: 0, loss: 1}
bonds: [heater -> inside -> water, inside -> loss -> wall, room -> loss]
sensors: {T: {reads: inside.e, unit: degC, noise: 0.1 K}}
"""


def printed(show: Callable[[Console], None]) -> str:
    """What is printed, each run of spaces as one."""
    console = Console(file=StringIO(), width=160)
    show(console)
    return "\n".join(" ".join(line.split()) for line in cast(StringIO, console.file).getvalue().splitlines())


def plant(n: int) -> BondGraph:
    """A network with parameters a0, a1, ..., the first nominally 0."""
    blocks = "\n".join(f"  b{k}: {{law: x{k} = a{k}*u, parameters: {{a{k}: {2 * k + 1}}}}}" for k in range(n))
    total = "+".join(f"x{k}" for k in range(n))
    return parse_model(
        f"name: net\nsample_time: none\ninputs: {{u: {{}}}}\nblocks:\n{blocks}\nsensors: {{y: {{reads: {total}}}}}\n"
    )


def view(
    n: int,
    groups: tuple[Group, ...] = (),
    near: tuple[NearGroup, ...] = (),
    clear: bool = True,
    lasting: tuple[Group, ...] | None = None,
) -> CapabilityView:
    """A view in which all single suspects are testable."""
    rank = Rank(value=n, least=n, kept=1.0, dropped=0.0, clear=clear, low=0.0, high=0.0)
    verdicts = tuple(
        SetVerdict(parameters=(k,), identifiable=True, falsifiable=True, uncertain=False) for k in range(n)
    )
    return CapabilityView(
        judgement=Judgement(rank=rank, verdicts=verdicts),
        groups=groups if lasting is None else lasting,
        sudden_groups=groups,
        near_groups=near,
        names=(*(f"a{k}" for k in range(n)), "y.bias"),
    )


def test_numbers_agree_with_their_nouns() -> None:
    """One combination of the one parameter, two combinations of the two parameters."""
    one, two = (printed(lambda console, n=n: print_view(console, plant(n), view(n), "Title", "")) for n in (1, 2))  # type: ignore[misc]
    assert "shows 1 combination of the one parameter\n" in one + "\n"
    assert "shows 2 combinations of the 2 parameters\n" in two
    assert "groups all testable sets can be told apart" in two
    trusting = replace(plant(2), parameters=tuple(replace(x, suspect=x.name == "a1") for x in plant(2).parameters))
    text = printed(lambda console: print_view(console, trusting, view(2), "Title", ""))
    assert "shows 2 combinations of the 2 parameters, a0 among them, which is trusted\n" in text


def test_a_rank_that_rounding_decides_is_a_guess() -> None:
    """Where the singular values have no gap, the reader is told."""
    text = printed(lambda console: print_view(console, plant(2), view(2, clear=False), "Title", ""))
    assert "2 combinations of the 2 parameters; rounding decides, so this is a guess" in text


def test_groups_that_follow_are_counted_only() -> None:
    """{a0} and {a1} look alike; that {a0, a2} and {a1, a2} do follows, {a0, a2} and {a1, a3} does not."""
    sets = (((0,), (1,)), ((0, 2), (1, 2)), ((0, 2), (1, 3)))
    alike = tuple(Group(sets=item, reason="only a0 + a1 acts") for item in sets)
    near = NearGroup(sets=((2,), (3,)), angle=2.0, reason="nearly")
    text = printed(lambda console: print_view(console, plant(4), view(4, alike, (near,)), "Title", ""))
    assert "cannot be told apart {a0} and {a1}: only a0 + a1 acts" in text
    assert "{a0, a2} and {a1, a3}" in text
    assert "{a0, a2} and {a1, a2}" not in text
    assert "1 larger group of which this follows; --json writes them" in text
    assert "hard to tell apart {a2} and {a3}: nearly" in text


def test_what_only_a_beginning_tells_apart_is_said() -> None:
    """{a0}, {a1} and {a2} are one once they last, {a1} and y's bias always: each is said under its own heading."""
    always = Group(sets=((1,), (3,)), reason="only a1 + y.bias acts")
    lasting = Group(sets=((0,), (1,), (2,)), reason="only a0 + a1 + a2 acts")
    text = printed(lambda console: print_view(console, plant(3), view(3, (always,), lasting=(lasting,)), "Title", ""))
    assert "cannot be told apart {a1} and {y.bias}: only a1 + y.bias acts" in text
    assert "alike but for how they begin {a0}, {a1} and {a2}: only a0 + a1 + a2 acts" in text


def test_what_is_not_listed_is_counted() -> None:
    """Of fourteen near groups twelve are listed; of fourteen sets in one group twelve are named."""
    near = tuple(NearGroup(sets=((k,), (k + 1,)), angle=1.0, reason=f"reason {k}") for k in range(14))
    text = printed(lambda console: print_view(console, plant(15), view(15, (), near), "Title", ""))
    assert "reason 11" in text
    assert "reason 12" not in text
    assert "... and 2 more; --json writes all" in text
    group = Group(sets=tuple((k,) for k in range(14)), reason="all one")
    text = printed(lambda console: print_view(console, plant(15), view(15, (group,)), "Title", ""))
    assert "{a11} and 2 more: all one" in text


def found(detectable: list[bool], isolable: list[list[bool]]) -> dict[str, Isolability]:
    """The same structure in all three readings."""
    item = Isolability(detectable=np.array(detectable), isolable=np.array(isolable))
    return dict.fromkeys(("mixed", "integral", "derivative"), item)


@pytest.mark.parametrize(
    ("detectable", "isolable", "expected"),
    [
        ([False, False], [[0, 0], [0, 0]], ["detectable none"]),
        ([True, False], [[0, 1], [0, 0]], ["detectable all but b"]),
        ([True, True], [[0, 0], [0, 0]], ["detectable all faults", "not isolable within {a, b}"]),
        ([True, True], [[0, 1], [1, 0]], ["not isolable none: each fault can be told from every other"]),
    ],
)
def test_structure_in_words(detectable: list[bool], isolable: list[list[bool]], expected: list[str]) -> None:
    """What is detectable, and what is isolable only where there are two faults that are detectable."""
    facts = found(detectable, isolable)
    text = printed(lambda console: print_structure(console, ("a", "b"), facts, None, ()))
    assert all(words in text for words in expected)
    assert ("not isolable" in text) == (sum(detectable) > 1)


def test_structural_tests_and_sensors_beyond_the_list_are_counted() -> None:
    """Thirteen smallest sets of faults name twelve and one more; six places of sensors name four and two others."""
    tests = StructuralTests(n_sets=1, faults=tuple((f"f{k}",) for k in range(13)))
    sensors = [(f"s{k}", "t") if k else ("s0",) for k in range(6)]
    facts = found([True, True], [[False, True], [True, False]])
    text = printed(lambda console: print_structure(console, ("a", "b"), facts, tests, sensors))
    assert "1 minimal set of equations can be checked" in text
    assert "{f11} and 1 more" in text
    assert "a sensor of s0, or of s1 with t, or of s2 with t, or of s3 with t, or of 2 others" in text
    text = printed(lambda console: print_structure(console, ("a", "b"), facts, tests, sensors[:5]))
    assert "or of s3 with t, or of 1 other\n" in text + "\n"


def test_other_values_and_twins() -> None:
    """A set with other values is listed, one with a continuum too; those alone are counted."""
    solutions = [
        OtherSolutions(parameters=("a0",), true=(1.0,)),
        OtherSolutions(parameters=("a1",), true=(3.0,), others=((6.0,), (9.0,))),
        OtherSolutions(parameters=("a0", "a1"), true=(1.0, 3.0), continuum=True),
        OtherSolutions(parameters=("a2",), true=(5.0,), skipped="no time"),
    ]
    odd = Twins(first=("a0",), second=("a1",), always=False, matches=())
    pair = Twins(first=("a0",), second=("a2",), always=True, matches=())
    comparison = Comparison(found=(pair, odd), compared=2, left_out=1)
    text = printed(lambda console: print_solutions(console, plant(3), solutions, comparison))
    assert "{a1} a1 = 3 a1 = 6" in text
    assert "{a1} a1 = 3 a1 = 9" in text
    assert "{a0, a1} a0 = 1, a1 = 3 infinitely many" in text
    assert "unique 1 of 3 sets: a record leaves one set of values" in text
    assert "not looked at 1 set: no time" in text
    assert "twins whatever {a0} does, {a2} can do as well" in text
    assert "1 other pair of sets looks alike for faults in certain proportions" in text
    assert "1 pair of sets was not compared" in text


def test_many_other_values_are_cut_and_counted() -> None:
    """Of fifteen lines twelve are printed and three counted."""
    values = tuple((float(k),) for k in range(10, 25))
    many = [OtherSolutions(parameters=("a0",), true=(1.0,), others=values)]
    empty = Comparison(found=(), compared=0, left_out=0)
    text = printed(lambda console: print_solutions(console, plant(1), many, empty))
    assert "a0 = 21" in text
    assert "a0 = 22" not in text
    assert "more 3 lines as above; --json writes all" in text


def test_nothing_to_look_at_is_said() -> None:
    """Where data fix the values of no set there is nothing to count."""
    empty = Comparison(found=(), compared=0, left_out=0)
    text = printed(lambda console: print_solutions(console, plant(1), [], empty))
    assert "there is no set whose values data fix" in text
    assert "unique" not in text


def test_effects_that_rounding_leaves_are_none() -> None:
    """An effect of 1e-15 noises is not printed; a fault that is never found says why."""

    def fault(name: str, value: float | None, reason: str = "", claimed: float = 0.0) -> SmallestFault:
        effects = (Effect(output="y", size=1.0, in_noise=2.5), Effect(output="z", size=0.0, in_noise=1.4e-15))
        return SmallestFault(
            parameter=name,
            value=value,
            up=value,
            down=value,
            within=60.0,
            certainty=0.95,
            effects=effects,
            reason=reason,
            claimed=claimed,
        )

    found = [fault("a0", 0.5, claimed=0.4), fault("a1", None, "too small", claimed=0.7), fault("a2", None, NO_TIME)]
    text = printed(lambda console: print_smallest(console, plant(3), found, {"u": 1.0}))
    assert "within 60 s, in 95 of 100 cases" in text
    assert "a0 0.5 50 % y 2.5" in text
    assert "z 0" not in text
    assert "a1 not found too small" in text
    assert f"a2 not looked for {NO_TIME}" in text
    assert "these are of a plant that is as the model says" in text
    assert "inputs u about 1, since nobody says where: give `--data REC`" in text
    assert "claimed" not in text
    larger = [fault("a0", 0.5, claimed=0.7), fault("a1", 0.5, claimed=math.inf), fault("a2", 0.6, claimed=3.5)]
    text = printed(lambda console: print_smallest(console, plant(3), larger, {}))
    assert "claimed a0 and a2 from 70 % on; a1 never. A smaller change may be that of a healthy part" in text
    assert "begun" not in text
    at = [replace(item, onsets=(20.0, 45.5)) for item in larger]
    assert "begun at 20 s and 45.5 s: what does nothing in 60 s after" in printed(
        lambda console: print_smallest(console, plant(3), at, {})
    )
    records: Any = smallest_record(at)["smallest_fault"]
    assert records["a1"]["onsets"] == [20.0, 45.5]
    assert [item["claimed"] for item in records.values()] == [0.7, None, 3.5]
    imperfect = replace(plant(3), slow_errors=(SlowError(target="y", sd=1.0, relative=False, memory=1.0),))
    assert "these are" not in printed(lambda console: print_smallest(console, imperfect, found, {}))


def test_nothing_is_said_of_smallest_faults_without_any() -> None:
    """A plant of which no fault was tried gets no heading."""
    assert printed(lambda console: print_smallest(console, plant(1), [], {})) == ""


def test_of_heat_capacities_it_is_told_what_a_smallest_fault_is() -> None:
    """Only stores of heat, which counts from 0 K: neither walls nor tanks."""
    store = parse_model(STORE)
    ((names, text),) = heat_lines(store, ["U", "C1", "T.bias"])
    assert names == "C1"
    assert text.startswith("a jump, at which the heat stays; it counts from 0 K")
    assert heat_lines(store, ["U"]) == []
    from_usual = STORE.replace("q = C1*e", "q = C1*(e - T0)").replace("inputs:", "constants: {T0: 20 degC}\ninputs:")
    assert heat_lines(parse_model(from_usual), ["U", "C1"]) == []
    by_mass = STORE.replace("q = C1*e", "q = C1*share*e").replace("inputs:", "constants: {share: 0.7}\ninputs:")
    assert [names for names, _ in heat_lines(parse_model(by_mass), ["U", "C1"])] == ["C1"]
    assert heat_lines(load_model(EXAMPLES / "tank" / "model.yaml"), ["K3", "K1"]) == []


@pytest.mark.parametrize(
    ("alike", "told"), [(True, "differs enough in a record"), (False, "no two suspects look alike")]
)
def test_where_no_input_is_to_be_moved_it_is_said_why(alike: bool, told: str) -> None:
    """Either nothing looks alike, or what does so in direction is far enough apart."""
    text = printed(lambda console: print_input_advice(console, [], "at rest", alike=alike))
    assert told in text
    assert "so no move of an input is needed" in text
