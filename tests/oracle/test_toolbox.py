"""Structural diagnosis against the fault diagnosis toolbox of Linköping University, where it is installed.

Published models and random ones, from the same tables. The toolbox' isolability matrix has ones where faults cannot be
told apart. It crashes on models without redundancy and on empty rows and columns, so random models have neither.
"""

import warnings
from functools import cache
from typing import Any

import numpy as np
import pytest
from benchmarks.shared import published

from faultbond.diagnosability.classes import redundancy
from faultbond.diagnosability.isolability import Interpretation, isolability
from faultbond.diagnosability.overdetermined import minimal_sets, minimal_supports, signatures
from faultbond.diagnosability.placement import sensors_to_detect, sensors_to_isolate
from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import decompose
from low_index import low_index

pytestmark = pytest.mark.filterwarnings("ignore")

CAUSALITIES = {Interpretation.MIXED: "mixed", Interpretation.INTEGRAL: "int", Interpretation.DERIVATIVE: "der"}
PUBLISHED = {
    "water tank": published.WATER_TANK,
    "three tank": published.THREE_TANK,
    "electric motor": published.ELECTRIC_MOTOR,
    "induction motor": published.INDUCTION_MOTOR,
    "Commault": published.COMMAULT,
    "engine": published.ENGINE,
}
SEEDS = range(25)


@cache
def toolbox() -> Any:
    """The toolbox, which takes seconds to import: of all that collect this file, one runs it."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the toolbox and of what it imports
        return pytest.importorskip("faultdiagnosistoolbox")


def drawn(seed: int) -> StructuralModel:
    """A random model with redundancy and up to three states; every variable occurs."""
    generator = np.random.default_rng(seed)
    while True:
        n_states, n_others = int(generator.integers(4)), int(generator.integers(1, 5))
        n_variables = 2 * n_states + n_others
        n_algebraic = n_variables - n_states + int(generator.integers(1, 5))
        sizes = np.minimum(generator.choice([1, 2, 2, 3], n_algebraic), n_variables)
        algebraic = [tuple(sorted(generator.choice(n_variables, size, replace=False).tolist())) for size in sizes]
        equations = (*algebraic, *((2 * k, 2 * k + 1) for k in range(n_states)))
        if len({v for row in equations for v in row}) == n_variables and redundancy(equations, n_variables):
            return StructuralModel(
                equations=equations,
                n_variables=n_variables,
                faults=tuple(generator.choice(n_algebraic, min(4, n_algebraic), replace=False).tolist()),
                differentials=tuple((n_algebraic + k, 2 * k, 2 * k + 1) for k in range(n_states)),
            )


MODELS = {
    **{name: published.structure(table) for name, table in PUBLISHED.items()},
    **{str(k): drawn(k) for k in SEEDS},
}
every_model = pytest.mark.parametrize("name", MODELS)


def peer(model: StructuralModel) -> Any:
    """The same model in the toolbox: 1 for a variable, 2 for a stored quantity, 3 for its rate."""
    variables = np.zeros((len(model.equations), model.n_variables), dtype=np.int64)
    for equation, row in enumerate(model.equations):
        variables[equation, list(row)] = 1
    for equation, rate, quantity in model.differentials:
        variables[equation, rate], variables[equation, quantity] = 3, 2
    faults = np.zeros((len(model.equations), len(model.faults)), dtype=np.int64)
    faults[list(model.faults), range(len(model.faults))] = 1
    known = np.zeros((len(model.equations), 1), dtype=np.int64)
    names = [f"x{k}" for k in range(model.n_variables)]
    return toolbox().DiagnosisModel(
        {
            "type": "MatrixStruc",
            "X": variables,
            "F": faults,
            "Z": known,
            "x": names,
            "f": [str(k) for k in range(len(model.faults))],
        }
    )


def as_sets(found: Any) -> list[tuple[int, ...]]:
    """Sets of the toolbox in our order."""
    return sorted(tuple(sorted(int(equation) for equation in item)) for item in found)


@every_model
def test_parts(name: str) -> None:
    """The parts of Dulmage and Mendelsohn are the same."""
    model = MODELS[name]
    ours, theirs = decompose(model.equations, model.n_variables), peer(model).GetDMParts()
    assert ours.over.equations == tuple(theirs.Mp.row)
    assert ours.over.variables == tuple(theirs.Mp.col)
    assert ours.just.equations == tuple(sorted(theirs.M0eqs))
    assert ours.under.variables == tuple(theirs.Mm.col)


@every_model
@pytest.mark.parametrize("interpretation", Interpretation)
def test_isolability(name: str, interpretation: Interpretation) -> None:
    """Detectability and isolability are the same in each causality."""
    model, causality = MODELS[name], CAUSALITIES[interpretation]
    found, theirs = isolability(model, interpretation), peer(model)
    assert np.array_equal(found.isolable, theirs.IsolabilityAnalysis(causality=causality) == 0)
    detectable, _ = theirs.DetectabilityAnalysis(causality=causality)
    assert sorted(int(fault) for fault in detectable) == np.flatnonzero(found.detectable).tolist()


@every_model
def test_minimal_sets(name: str) -> None:
    """The MSO sets are the same, and so are their fault signatures and which of them are of low index."""
    model, theirs = MODELS[name], peer(MODELS[name])
    sets = minimal_sets(model.equations, model.n_variables)
    assert list(sets) == as_sets(theirs.MSO())
    some = [np.array(item) for item in sets[:50]]
    assert np.array_equal(signatures(sets[:50], model.faults), theirs.FSM(some) == 1)
    assert [low_index(model, item) for item in sets[:50]] == [bool(theirs.IsLowIndex(item)) for item in some]


@every_model
def test_minimal_supports(name: str) -> None:
    """The MTES sets are the same."""
    model = MODELS[name]
    ours = minimal_supports(model.equations, model.n_variables, model.faults)
    assert list(ours) == as_sets(peer(model).MTES())


@pytest.mark.parametrize("faulty", [False, True], ids=["sound sensors", "faulty sensors"])
def test_placement(faulty: bool) -> None:
    """The smallest sensor sets are the same, also where the new sensors can fail."""
    model = published.structure(published.FIVE_STATES)
    states = [model.variable_names.index(f"x{k + 1}") for k in range(5)]
    theirs = peer(model)
    theirs.PossibleSensorLocations(states)
    theirs.SensorLocationsWithFaults(states if faulty else None)
    assert sorted(sensors_to_detect(model, states)) == as_sets(theirs.SensorPlacementDetectability()[1])
    ours = sensors_to_isolate(model, states, faulty=states if faulty else ())
    assert sorted(ours) == as_sets(theirs.SensorPlacementIsolability()[1])


def test_placement_of_commault() -> None:
    """The smallest sensor sets for Commault's example are the same."""
    model = published.structure(published.COMMAULT)
    assert sorted(sensors_to_isolate(model)) == as_sets(peer(model).SensorPlacementIsolability()[1])
