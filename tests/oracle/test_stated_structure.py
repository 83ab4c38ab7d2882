"""Random structures, written as model files, against definitions that are tried out one by one."""

import json
import warnings
from collections.abc import Collection, Mapping
from functools import cache
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.shared import published

from faultbond.app.structure_study import structure_sections
from faultbond.app.wishes import Wishes
from faultbond.diagnosability.isolability import Interpretation, isolability
from faultbond.diagnosability.likeness import alike_faults, hidden_faults
from faultbond.diagnosability.placement import sensors_to_detect, sensors_to_isolate
from faultbond.diagnosability.sensor_sets import cost_of, measured, sensor_sets
from faultbond.diagnosability.structural import StructuralModel, stated_structure
from faultbond.equations.matching import match, undetermined
from faultbond.model.structure import Structure
from faultbond.model.text import load_any, parse_any

EXAMPLES = Path(__file__).parents[2] / "examples" / "structures"
SEEDS = range(60)
SECONDS = 1e6  # the search is never cut off


def text_of(model: Mapping[str, list[str]], faults: list[str], sensors: str = "") -> str:
    """A structure of equations by name as a model file."""
    unknowns = dict.fromkeys(word for words in model.values() for word in words if word[0] == "x")
    equations = "\n".join(f"    {name}: [{', '.join(words)}]" for name, words in model.items())
    known = "[y]" if any("y" in words for words in model.values()) else "[]"
    return (
        f"structure:\n  unknowns: [{', '.join(unknowns)}]\n  known: {known}\n  faults: [{', '.join(faults)}]\n"
        f"  equations:\n{equations}\n{sensors}"
    )


@cache
def drawn(seed: int) -> tuple[dict[str, tuple[str, ...]], tuple[str, ...]]:
    """A random structure: up to five unknowns, up to eight equations, some of two faults, a fault of two equations."""
    generator = np.random.default_rng(seed)
    n_variables, faults = int(generator.integers(1, 6)), ("f1", "f2", "f3")
    model: dict[str, tuple[str, ...]] = {}
    for k in range(max(1, n_variables + int(generator.integers(-3, 4)))):
        size = int(generator.integers(1, min(3, n_variables) + 1))
        words = [f"x{v}" for v in sorted(generator.choice(n_variables, size, replace=False))]
        model[f"e{k}"] = (*words, *(["y"] if generator.random() < 0.4 else []))
    for fault in faults:
        for name in generator.choice(list(model), min(len(model), 1 + int(generator.random() < 0.3)), replace=False):
            model[str(name)] = (*model[str(name)], fault)
    return model, faults


def read(seed: int, sensors: str = "") -> Structure:
    """The structure of a seed, by way of a file."""
    model, faults = drawn(seed)
    found = parse_any(text_of({name: list(words) for name, words in model.items()}, list(faults), sensors))
    assert isinstance(found, Structure)
    return found


def rank(rows: Collection[frozenset[str]]) -> int:
    """The most rows that can be given an unknown each: by Hall's theorem, tried for every set of them."""
    listed = list(rows)
    lacking = (
        size - len(frozenset().union(*chosen))
        for size in range(len(listed) + 1)
        for chosen in combinations(listed, size)
    )
    return len(listed) - max(0, *lacking)


def rows_of(seed: int, without: str = "") -> dict[str, frozenset[str]]:
    """The unknowns of each equation, with an equation `f = 0` for each fault but one, and the fault as an unknown."""
    model, faults = drawn(seed)
    rows = {name: frozenset(word for word in words if word != "y") for name, words in model.items()}
    return rows | {f"{fault} = 0": frozenset({fault}) for fault in faults if fault != without}


def checked(rows: Mapping[str, frozenset[str]]) -> set[str]:
    """The equations without which as many unknowns are found: the over-determined part, by its definition."""
    whole = rank(rows.values())
    return {name for name in rows if rank([row for other, row in rows.items() if other != name]) == whole}


@pytest.mark.parametrize("seed", SEEDS)
def test_faults_by_definition(seed: int) -> None:
    """A fault is detectable if its being absent is checked, and isolable from another if it is without that."""
    found = isolability(stated_structure(read(seed)))
    _, faults = drawn(seed)
    detectable = [f"{fault} = 0" in checked(rows_of(seed)) for fault in faults]
    assert found.detectable.tolist() == detectable
    for n, other in enumerate(faults):
        left = checked(rows_of(seed, without=other))
        assert found.isolable[:, n].tolist() == [f"{fault} = 0" in left for fault in faults]


@pytest.mark.parametrize("seed", SEEDS)
def test_reasons_by_definition(seed: int) -> None:
    """Faults without a reason are those that show, and groups are those that no test tells apart."""
    model = stated_structure(read(seed))
    found = isolability(model)
    assert [item.fault for item in hidden_faults(model)] == np.flatnonzero(~found.detectable).tolist()
    pairs = {pair for item in alike_faults(model) for pair in combinations(item.faults, 2)}
    shown = np.flatnonzero(found.detectable)
    assert pairs == {(f, g) for f, g in combinations(shown.tolist(), 2) if not found.isolable[f, g]}
    for group in alike_faults(model):
        for left_out in group.equations:
            rows = {k: row for k, row in enumerate(model.equations) if k != left_out}
            others = checked({str(k): frozenset(map(str, row)) for k, row in rows.items()})
            assert not others & {str(k) for k in group.equations}
        assert len(group.variables) == len(group.equations) - 1


@pytest.mark.parametrize("seed", SEEDS)
def test_tests_by_definition(seed: int) -> None:
    """The minimal tests of the record are the smallest sets of equations that are more than their unknowns."""
    structure = read(seed)
    model = stated_structure(structure)
    rows = {model.equation_name(k): frozenset(map(str, row)) for k, row in enumerate(model.equations)}
    dependent: list[set[str]] = []
    for size in range(1, len(rows) + 1):
        for chosen in combinations(rows, size):
            if not any(other <= {*chosen} for other in dependent) and rank([rows[name] for name in chosen]) < size:
                dependent.append({*chosen})
    record: Any = dict(structure_sections(structure, Wishes()))["tests"]().record
    assert sorted(map(sorted, dependent)) == sorted(sorted(item["equations"]) for item in record["sets"])
    assert record["tests"]["mso"] == len(dependent)
    entered = {model.fault_names[k]: model.equation_name(equation) for k, equation in enumerate(model.faults)}
    for item in record["sets"]:
        assert item["faults"] == [fault for fault, equation in entered.items() if equation in item["equations"]]
    seen = {frozenset(item["faults"]) for item in record["sets"]} - {frozenset()}
    smallest = {item for item in seen if not any(other < item for other in seen)}
    assert smallest <= {frozenset(item) for item in record["tests"]["mtes"]} <= seen


def goal(model: StructuralModel, sensors: Collection[int], *, isolate: bool) -> np.ndarray:
    """What sensors make of the faults of a model."""
    found = isolability(measured(model, tuple(sensors)))
    return np.vstack([found.detectable, found.isolable if isolate else found.detectable[None]])


@pytest.mark.parametrize("isolate", [False, True], ids=["detect", "isolate"])
@pytest.mark.parametrize("seed", SEEDS)
def test_sensors_by_definition(seed: int, isolate: bool) -> None:
    """The sets of sensors are the smallest ones that give what all sensors give, and the first is the cheapest."""
    model = stated_structure(read(seed))
    places = places_of(model)
    costs = {place: float(cost) for place, cost in zip(places, (20, 1, 2, 1, 20), strict=False)}
    whole = goal(model, places, isolate=isolate)
    enough: list[tuple[int, ...]] = []
    for size in range(len(places) + 1):
        for chosen in combinations(places, size):
            if (
                not any({*other} <= {*chosen} for other in enough)
                and (goal(model, chosen, isolate=isolate) == whole).all()
            ):
                enough.append(chosen)
    found = sensor_sets(model, costs, isolate=isolate, seconds=SECONDS)
    assert found.cheapest
    assert {*found.sets} <= {*enough}
    assert {item for item in enough if len(item) <= found.searched} <= {*found.sets}
    least = min(cost_of(item, costs) for item in enough)
    assert cost_of(found.sets[0], costs) == least
    if not leaves_open(model):  # all of them, however many sensors they have
        search = sensors_to_isolate if isolate else sensors_to_detect
        assert {*search(model, places)} == {*enough}
    hasty = sensor_sets(model, costs, isolate=isolate, seconds=0.0)
    assert all((goal(model, item, isolate=isolate) == whole).all() for item in hasty.sets)
    assert {*hasty.sets} <= {*enough}
    assert (cost_of(hasty.sets[0], costs) == least) >= hasty.cheapest


def places_of(model: StructuralModel) -> list[int]:
    """The unknowns that can be measured: all but faults of several equations."""
    return [k for k, name in enumerate(model.variable_names) if name[0] == "x"]


def leaves_open(model: StructuralModel) -> bool:
    """Whether a model leaves variables open."""
    return bool(undetermined(model.equations, model.n_variables, match(model.equations, model.n_variables)))


def test_both_searches_are_met() -> None:
    """The seeds hold models that determine every variable and lack sensors, and models that leave some open."""
    models = [stated_structure(read(seed)) for seed in SEEDS]
    lacking = [
        item for item in models if (goal(item, (), isolate=True) != goal(item, places_of(item), isolate=True)).any()
    ]
    n_open = sum(map(leaves_open, lacking))
    assert n_open >= 10
    assert len(lacking) - n_open >= 10


def tells_all(model: StructuralModel, sensors: tuple[int, ...], whole: np.ndarray) -> bool:
    """Whether sensors that can fail tell what is asked of the model, and themselves from everything."""
    found, n_faults = isolability(measured(model, sensors, faulty=sensors)), len(model.faults)
    own, others = found.isolable[n_faults:], found.isolable[:n_faults, n_faults:]
    first = np.vstack([found.detectable[:n_faults], found.isolable[:n_faults, :n_faults]])
    told = (own.sum(axis=1) == len(found.detectable) - 1).all() and (others == found.detectable[:n_faults, None]).all()
    return bool((first == whole).all() and told)


def test_sensors_that_can_fail() -> None:
    """With sensors that can fail, up to two of each unknown, the smallest sets also tell these from all others."""
    met = 0
    for model in [stated_structure(read(seed)) for seed in SEEDS]:
        places = places_of(model)
        whole = goal(model, places * 2, isolate=True)
        if leaves_open(model) or (goal(model, (), isolate=True) == whole).all():
            continue
        enough: list[tuple[int, ...]] = []
        for chosen in [item for size in (1, 2, 3) for item in combinations(sorted(places * 2), size)]:
            smaller = any(all(chosen.count(v) >= other.count(v) for v in other) for other in enough)
            if not smaller and tells_all(model, chosen, whole):
                enough.append(chosen)
        found = sensor_sets(model, dict.fromkeys(places, 1.0), faulty=places, isolate=True, seconds=SECONDS)
        assert found.cheapest
        up_to = min(3, found.searched)
        assert {item for item in enough if len(item) <= up_to} == {item for item in found.sets if len(item) <= up_to}
        met += 1
    assert met >= 10


def contents(model: StructuralModel) -> list[tuple[set[str], set[str]]]:
    """The unknowns and the faults of each equation, by name; a rate is called d and its quantity."""
    rates = {rate: f"d{model.variable_name(quantity)}" for _, rate, quantity in model.differentials}
    return [
        (
            {rates.get(variable, model.variable_name(variable)) for variable in row},
            {model.fault_names[n] for n, equation in enumerate(model.faults) if equation == k},
        )
        for k, row in enumerate(model.equations)
    ]


@pytest.mark.parametrize(
    ("file", "table"), [("three_tanks", published.THREE_TANK), ("electric_motor", published.ELECTRIC_MOTOR)]
)
def test_examples_are_as_published(file: str, table: str) -> None:
    """The example files, one of lists and one of laws, are the published structures."""
    structure = load_any(EXAMPLES / f"{file}.yaml")
    assert isinstance(structure, Structure)
    assert contents(stated_structure(structure)) == contents(published.structure(table))


TOOLBOX = {  # a model as the fault diagnosis toolbox takes it
    "x": ["dI", "dw", "I", "w", "T", "Tm", "Tl"],
    "f": ["fR", "fi", "fw", "fT"],
    "z": ["V", "yi", "yw", "yT"],
    "parameters": ["Ka", "b", "R", "J", "L"],
    "rels": [
        "-V + I*(R + fR) + L*dI + Ka*I*w",
        "-Tm + Ka*I**2",
        "-J*dw + T - b*w",
        "-T + Tm - Tl",
        "-yi + I + fi",
        "-yw + w + fw",
        "-yT + T + fT",
        ["dI", "I", "diff"],
        ["dw", "w", "diff"],
    ],
}


def test_the_electric_motor_of_the_manual() -> None:
    """Read as it stands there, the motor is the published structure, and the toolbox says the same of it."""
    text = {"unknowns": TOOLBOX["x"], "known": TOOLBOX["z"], "faults": TOOLBOX["f"]}
    text |= {"parameters": TOOLBOX["parameters"], "equations": TOOLBOX["rels"]}
    structure = parse_any(json.dumps({"structure": text}))
    assert isinstance(structure, Structure)
    model, known = stated_structure(structure), published.structure(published.ELECTRIC_MOTOR)
    assert contents(model) == contents(known)
    assert (model.fault_names, model.faults) == (known.fault_names, known.faults)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the toolbox and of what it imports
        models = pytest.importorskip("faultdiagnosistoolbox.models")
        theirs = models.electric_motor
        for kind, word in ((Interpretation.MIXED, "mixed"), (Interpretation.INTEGRAL, "int")):
            assert np.array_equal(isolability(model, kind).isolable, theirs.IsolabilityAnalysis(causality=word) == 0)
