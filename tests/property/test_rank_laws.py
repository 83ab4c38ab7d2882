"""Laws of ranks and verdicts on random circuits."""

import json
from typing import Any

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.analysis.groups import groups
from faultbond.analysis.ranks import reduce, set_ranks
from faultbond.analysis.sensor_advice import restricted
from faultbond.analysis.testable import generic_run, judge, sets_to_test
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.model.text import parse_model

Mapping = dict[str, Any]
UNITS = {"R": "ohm", "C": "F", "I": "H"}
FEW = settings(max_examples=10, deadline=None)


@st.composite
def circuits(draw: st.DrawFn) -> Mapping:
    """A ladder of series and shunt elements of moderate sizes behind a source, with one to three sensors."""
    n = draw(st.integers(1, 3))
    parts: Mapping = {"source": {"type": "Se", "law": "e = V"}}
    junctions: Mapping = {}
    bonds, signals, before = [], [], "source"
    for k in range(n):
        junctions |= {f"l{k}": "1", f"n{k}": "0"}
        series, shunt = draw(st.sampled_from(["R", "RI"])), draw(st.sampled_from(["C", "CR"]))
        bonds += [f"{before} -> l{k} -> n{k}"]
        for place, elements in ((f"l{k}", series), (f"n{k}", shunt)):
            for element in elements:
                name = f"{element}{len(parts)}"
                value = draw(st.floats(0.5, 2.0))
                parts[name] = {"type": element, "parameters": {f"P{len(parts)}": f"{value:.4g} {UNITS[element]}"}}
                bonds.append(f"{place} -> {name}")
        signals += [(f"l{k}.f", "A"), (f"n{k}.e", "V")]
        before = f"n{k}"
    read = draw(st.lists(st.sampled_from(signals), min_size=1, max_size=3, unique=True))
    sensors = {f"s{k}": {"reads": name, "unit": unit, "noise": f"1e-3 {unit}"} for k, (name, unit) in enumerate(read)}
    plant: Mapping = {"name": "circuit", "sample_time": "0.5 s", "max_faults": "2", "inputs": {"V": {"unit": "V"}}}
    return plant | {"components": parts, "junctions": junctions, "bonds": bonds, "sensors": sensors}


def built(plant: Mapping) -> StepModel:
    """The model of a mapping."""
    return build_step_model(build_plant(parse_model(json.dumps(plant))))


def told(plant: Mapping) -> tuple[int, set[frozenset[str]], set[frozenset[frozenset[str]]]]:
    """Rank, sets to test and groups, by name."""
    model = built(plant)
    names = [item.name for item in model.plant.graph.parameters]
    seen = reduce([generic_run(model)])
    assert seen.rank.clear
    sets = sets_to_test(judge(seen, range(len(names)), 2)).sets
    by_name = {chosen: frozenset(names[k] for k in chosen) for chosen in sets}
    alike = {frozenset(by_name[chosen] for chosen in group.sets) for group in groups(seen, sets)}
    return seen.rank.value, set(by_name.values()), alike


@FEW
@given(plant=circuits(), data=st.data())
def test_order_does_not_matter(plant: Mapping, data: st.DataObject) -> None:
    """Ranks, sets to test and groups do not depend on the order in which a model states its things."""
    other = dict(plant)
    for key in ("components", "junctions", "sensors"):
        other[key] = {name: plant[key][name] for name in data.draw(st.permutations(sorted(plant[key])))}
    other["bonds"] = data.draw(st.permutations(plant["bonds"]))
    assert told(other) == told(plant)


@FEW
@given(plant=circuits())
def test_a_sensor_more_never_lowers_a_rank(plant: Mapping) -> None:
    """With a sensor more, the rank of all parameters and that of each pair are at least as large."""
    run = generic_run(built(plant))
    n = len(run.parameters)
    pairs = [(i, j) for i in range(n) for j in range(i)]
    before, ranks_before = 0, np.zeros(len(pairs), dtype=np.intp)
    for number in range(1, len(run.outputs) + 1):
        seen = reduce([restricted(run, range(number))])
        assert seen.rank.clear
        assert seen.rank.value >= before
        ranks, _ = set_ranks(seen, pairs)
        assert np.all(ranks >= ranks_before)
        before, ranks_before = seen.rank.value, ranks


@FEW
@given(plant=circuits())
def test_verdicts_follow_their_definitions(plant: Mapping) -> None:
    """A part of an identifiable set is identifiable, of a falsifiable one falsifiable."""
    run = generic_run(built(plant))
    seen = reduce([run])
    verdicts = {item.parameters: item for item in judge(seen, range(len(run.parameters)), 3).verdicts}
    for chosen, verdict in verdicts.items():
        parts = [verdicts[chosen[:k] + chosen[k + 1 :]] for k in range(len(chosen)) if len(chosen) > 1]
        assert not verdict.identifiable or all(part.identifiable for part in parts)
        assert not verdict.falsifiable or all(part.falsifiable for part in parts)
        assert not verdict.testable or len(chosen) < seen.rank.value
