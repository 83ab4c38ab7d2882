"""How fast structural diagnosis is, side by side with the fault diagnosis toolbox, whose core is written in C.

    python -m benchmarks.speed.structure [--markdown FILE]

Processor time, both in turns in the same run; results are compared before they are timed. Without the toolbox only our
own times are shown. Ratios count, since machines differ.
"""

import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from benchmarks.shared import published
from benchmarks.shared.page import arguments, note, publish
from faultbond.diagnosability.isolability import Interpretation, isolability
from faultbond.diagnosability.overdetermined import minimal_sets, minimal_supports
from faultbond.diagnosability.structural import StructuralModel

with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of the toolbox and of what it imports
    try:
        import faultdiagnosistoolbox as toolbox
        from scipy.sparse import csc_matrix
    except ImportError:
        toolbox = None

ROUNDS = 25
SAMPLE = 2e-3  # s of processor time that one reading takes at least
ISOLABILITY_ASKED, SETS_ASKED = 3.0, 10.0  # times as long as the toolbox
CAUSALITIES = {Interpretation.MIXED: "mixed", Interpretation.INTEGRAL: "int", Interpretation.DERIVATIVE: "der"}
SEED = 100


Row = tuple[str, ...]  # work, model, result, our time and the toolbox', their ratio, and what is asked of it


def random_model(n_equations: int = 100, n_sensors: int = 8, n_states: int = 14, n_faults: int = 11) -> StructuralModel:
    """Give a model of as many equations as asked: laws of a few variables each, stores, and sensors."""
    generator = np.random.default_rng(SEED)
    n_variables = n_equations - n_sensors
    determined = (
        *range(0, 2 * n_states, 2),
        *range(2 * n_states, n_variables),
    )  # rates, and what is no stored quantity
    laws = [{k, *generator.choice(n_variables, generator.integers(1, 4)).tolist()} for k in determined]
    sensors = [{v} for v in generator.choice(n_variables, n_sensors, replace=False).tolist()]
    algebraic = [tuple(sorted(row)) for row in (*laws, *sensors)]
    return StructuralModel(
        equations=(*algebraic, *((2 * k, 2 * k + 1) for k in range(n_states))),
        n_variables=n_variables,
        faults=tuple(generator.choice(len(algebraic), n_faults, replace=False).tolist()),
        differentials=tuple((len(algebraic) + k, 2 * k, 2 * k + 1) for k in range(n_states)),
    )


def incidence(model: StructuralModel) -> Any:
    """Give the toolbox' matrix of equations and variables: 1, for a stored quantity 2, for its rate 3."""
    table = np.zeros((len(model.equations), model.n_variables), dtype=np.int64)
    for equation, variables in enumerate(model.equations):
        table[equation, list(variables)] = 1
    for equation, rate, quantity in model.differentials:
        table[equation, rate], table[equation, quantity] = 3, 2
    return table


def peer(model: StructuralModel) -> Any:
    """Give the model as one of the toolbox."""
    faults = np.zeros((len(model.equations), len(model.faults)), dtype=np.int64)
    faults[list(model.faults), range(len(model.faults))] = 1
    known = np.zeros((len(model.equations), 1), dtype=np.int64)
    return toolbox.DiagnosisModel({"type": "MatrixStruc", "X": incidence(model), "F": faults, "Z": known})


def isolability_row(name: str, model: StructuralModel, interpretation: Interpretation) -> Row:
    """Time the isolability matrix."""
    found = isolability(model, interpretation)
    theirs = None
    if toolbox is not None:
        theirs = partial(peer(model).IsolabilityAnalysis, causality=CAUSALITIES[interpretation])
        _agree(np.array_equal(theirs() == 0, found.isolable), name)
    what, asked = f"{np.sum(~found.isolable)} pairs alike", interpretation is Interpretation.MIXED
    times = timed(lambda: isolability(model, interpretation), theirs, ISOLABILITY_ASKED if asked else None)
    return f"isolability, {interpretation.value}", name, what, *times


def sets_row(name: str, model: StructuralModel, *, asked: float | None) -> Row:
    """Time all MSO sets; the toolbox' C function alone, on a matrix made before."""
    found = minimal_sets(model.equations, model.n_variables)
    theirs = None
    if toolbox is not None:
        theirs = partial(toolbox.dmperm.dmpermlib.MSO, csc_matrix(incidence(model)))
        _agree(len(theirs()) == len(found), name)
    times = timed(lambda: minimal_sets(model.equations, model.n_variables), theirs, asked)
    return "all MSO sets", name, f"{len(found)} sets", *times


def supports_row(name: str, model: StructuralModel) -> Row:
    """Time all MTES sets."""
    found = minimal_supports(model.equations, model.n_variables, model.faults)
    theirs = None
    if toolbox is not None:
        theirs = peer(model).MTES
        _agree(len(theirs()) == len(found), name)
    times = timed(lambda: minimal_supports(model.equations, model.n_variables, model.faults), theirs, None)
    return "all MTES sets", name, f"{len(found)} sets", *times


def timed(ours: Callable[[], object], theirs: Callable[[], object] | None, asked: float | None) -> Row:
    """Give the median processor times of two calls that take turns, their ratio, and the one that is asked for."""
    works = [work for work in (ours, theirs) if work is not None]
    repeats = [max(1, int(SAMPLE / _reading(work, 1))) for work in works]
    readings = [[_reading(work, count) for work, count in zip(works, repeats, strict=True)] for _ in range(ROUNDS)]
    one, *other = np.median(np.array(readings), axis=0).tolist()
    ratio = (_milli(other[0]), f"{one / other[0]:.2f}") if other else ("-", "-")
    return _milli(one), *ratio, "-" if asked is None else f"at most {asked:g}"


def _reading(work: Callable[[], object], count: int) -> float:
    begin = time.process_time()
    for _ in range(count):
        work()
    return max(time.process_time() - begin, 1e-9) / count


def _agree(same: bool, name: str) -> None:
    if not same:
        raise RuntimeError(f"{name}: the toolbox has another result")


def measure() -> list[Row]:
    """Measure everything."""
    tank, three = published.structure(published.WATER_TANK), published.structure(published.THREE_TANK)
    engine = published.structure(published.ENGINE)
    models = {"water tank": tank, "engine, 94 equations": engine, "random, 100 equations": random_model()}
    return [
        *(isolability_row(name, model, kind) for kind in Interpretation for name, model in models.items()),
        sets_row("water tank", tank, asked=SETS_ASKED),
        sets_row("three tanks", three, asked=SETS_ASKED),
        sets_row("engine, 94 equations", engine, asked=None),
        *(supports_row(name, model) for name, model in (("water tank", tank), ("engine, 94 equations", engine))),
    ]


HEADER = ("work", "model", "result", "faultbond", "toolbox", "ratio", "asked")


def _milli(seconds: float) -> str:
    return f"{1e3 * seconds:.3f} ms" if seconds < 0.01 else f"{1e3 * seconds:.0f} ms"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    publish("speed.structure", arguments("How fast structural diagnosis is.", argv), note(), (HEADER, measure()))


if __name__ == "__main__":
    main()
