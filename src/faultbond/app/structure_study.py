"""The sections of an analysis of a structure: equations without laws."""

from collections.abc import Iterator, Sequence
from contextlib import suppress

import numpy as np

from faultbond.app.section import Section, Work
from faultbond.app.wishes import Wishes
from faultbond.diagnosability.isolability import Interpretation, checked_equations, isolability
from faultbond.diagnosability.likeness import alike_faults, hidden_faults
from faultbond.diagnosability.overdetermined import EquationSet, minimal_sets, minimal_supports, signatures
from faultbond.diagnosability.sensor_sets import measured, sensor_sets
from faultbond.diagnosability.structural import StructuralModel, stated_structure
from faultbond.equations.matching import decompose
from faultbond.errors import ModelError, StructureError
from faultbond.model.structure import Structure
from faultbond.report import structure as report

MOST_TESTS = 20_000  # minimal sets of equations that are looked for
MOST_WAYS = 500  # of which the direction of time is looked at
SENSOR_SECONDS = 5.0  # for each of the two searches for sensors


def structure_sections(structure: Structure, wishes: Wishes) -> Iterator[tuple[str, Work]]:
    """Give the title of each section and how it is worked out, in order."""
    model = stated_structure(structure)
    yield "what the equations determine", lambda: _parts(model)
    if model.faults:
        yield "which faults show", lambda: _faults(model)
    yield "tests", lambda: _tests(model, wishes.budget)
    if model.faults and structure.further_sensors:
        yield "further sensors", lambda: _sensors(structure, model, wishes.budget)


def check_wishes(structure: Structure, wishes: Wishes) -> None:
    """Refuse what needs laws.

    Raises
    ------
    ModelError
        Where it is asked for.
    """
    usual = Wishes()
    for option in ("data", "within", "separate", "closed", "patience", "preference"):
        if getattr(wishes, option) != getattr(usual, option):
            words = {"preference": f"--{wishes.preference.replace(' ', '-').replace('-components', '')}"}
            word = words.get(option, f"--{option}")
            raise ModelError(f"{structure.file}: {word} asks for values, and a structure has no laws; leave it out")


def _parts(model: StructuralModel) -> Section:
    parts = decompose(model.equations, model.n_variables)
    return Section(
        record=report.parts_record(model, parts), show=lambda console: report.print_parts(console, model, parts)
    )


def _faults(model: StructuralModel) -> Section:
    kinds = tuple(Interpretation) if model.differentials else (Interpretation.MIXED,)
    view = report.FaultView(
        by_causality={kind: isolability(model, kind) for kind in kinds},
        alike=alike_faults(model),
        hidden=hidden_faults(model),
    )
    return Section(
        record=report.faults_record(model, view), show=lambda console: report.print_fault_view(console, model, view)
    )


def _tests(model: StructuralModel, budget: int) -> Section:
    limit = MOST_TESTS * budget
    minimal: tuple[report.MinimalTest, ...] | None = None
    smallest: tuple[tuple[int, ...], ...] | None = None
    with suppress(StructureError):  # too many; those that differ in their faults are fewer
        sets = sorted(minimal_sets(model.equations, model.n_variables, limit=limit), key=lambda item: (len(item), item))
        seen = _seen(model, sets)
        first = {faults: k for k, faults in reversed([*enumerate(seen)])}  # the smallest of all that see the same
        looked_at = sorted(range(len(sets)), key=lambda k: (first[seen[k]] != k, k))[: MOST_WAYS * budget]
        ways = {k: _ways(model, sets[k]) for k in looked_at}
        minimal = tuple(map(report.MinimalTest, sets, seen, map(ways.get, range(len(sets)))))
    with suppress(StructureError):
        supports = _seen(model, minimal_supports(model.equations, model.n_variables, model.faults, limit=limit))
        smallest = tuple(sorted(supports, key=lambda faults: (len(faults), faults)))
    found = report.FoundTests(minimal=minimal, smallest=smallest, limit=limit)
    return Section(
        record=report.tests_record(model, found), show=lambda console: report.print_tests(console, model, found)
    )


def _seen(model: StructuralModel, sets: Sequence[EquationSet]) -> tuple[tuple[int, ...], ...]:
    """Give the faults that enter each set of equations."""
    return tuple(tuple(np.flatnonzero(row).tolist()) for row in signatures(sets, model.faults))


def _ways(model: StructuralModel, test: EquationSet) -> tuple[Interpretation, ...]:
    """Give the directions of time of which one alone does for a test."""
    return tuple(kind for kind in report.ONE_WAY if checked_equations(model, kind, test))


def _sensors(structure: Structure, model: StructuralModel, budget: int) -> Section:
    place = {name: k for k, name in enumerate(model.variable_names)}
    costs = {place[item.signal]: item.cost for item in structure.further_sensors}
    faulty = tuple(place[item.signal] for item in structure.further_sensors if item.suspect)
    seconds = SENSOR_SECONDS * budget
    full = measured(model, tuple(costs))
    view = report.SensorView(
        detect=sensor_sets(model, costs, isolate=False, seconds=seconds),
        isolate=sensor_sets(model, costs, faulty=faulty, isolate=True, seconds=seconds),
        costs=costs,
        hidden=hidden_faults(full),
        alike=alike_faults(full),
    )
    return Section(
        record=report.further_record(full, view),
        show=lambda console: report.print_further(console, structure, full, view),
    )
