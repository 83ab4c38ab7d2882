"""How fast structural diagnosis is, side by side with the fault diagnosis toolbox, whose core is written in C.

    python -m benchmarks.speed.structure [--json FILE] [--markdown FILE]

Processor time, both in turns in the same run; results are compared before they are timed. Without the toolbox only our
own times are shown. Ratios count, since machines differ.
"""

import argparse
import json
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.shared import published
from benchmarks.shared.page import as_markdown, as_text, machine, today, write_part
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A piece of work: medians of our processor time and the toolbox', s, and the ratio that is asked for."""

    work: str
    model: str
    result: str
    ours: float
    toolbox: float | None
    asked: float | None = None

    @property
    def ratio(self) -> float | None:
        """Our time in times the toolbox'."""
        return None if self.toolbox is None else self.ours / self.toolbox


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
    ours, other = timed(lambda: isolability(model, interpretation), theirs)
    return Row(
        work=f"isolability, {interpretation.value}",
        model=name,
        result=f"{np.sum(~found.isolable)} pairs alike",
        ours=ours,
        toolbox=other,
        asked=ISOLABILITY_ASKED if interpretation is Interpretation.MIXED else None,
    )


def sets_row(name: str, model: StructuralModel, *, asked: float | None) -> Row:
    """Time all MSO sets; the toolbox' C function alone, on a matrix made before."""
    found = minimal_sets(model.equations, model.n_variables)
    theirs = None
    if toolbox is not None:
        theirs = partial(toolbox.dmperm.dmpermlib.MSO, csc_matrix(incidence(model)))
        _agree(len(theirs()) == len(found), name)
    ours, other = timed(lambda: minimal_sets(model.equations, model.n_variables), theirs)
    return Row(work="all MSO sets", model=name, result=f"{len(found)} sets", ours=ours, toolbox=other, asked=asked)


def supports_row(name: str, model: StructuralModel) -> Row:
    """Time all MTES sets."""
    found = minimal_supports(model.equations, model.n_variables, model.faults)
    theirs = None
    if toolbox is not None:
        theirs = peer(model).MTES
        _agree(len(theirs()) == len(found), name)
    ours, other = timed(lambda: minimal_supports(model.equations, model.n_variables, model.faults), theirs)
    return Row(work="all MTES sets", model=name, result=f"{len(found)} sets", ours=ours, toolbox=other)


def timed(ours: Callable[[], object], theirs: Callable[[], object] | None) -> tuple[float, float | None]:
    """Give the median processor time of a call, s; the two take turns."""
    works = [work for work in (ours, theirs) if work is not None]
    repeats = [max(1, int(SAMPLE / _reading(work, 1))) for work in works]
    readings = [[_reading(work, count) for work, count in zip(works, repeats, strict=True)] for _ in range(ROUNDS)]
    medians = np.median(np.array(readings), axis=0)
    return float(medians[0]), float(medians[1]) if len(works) == 2 else None


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


def _cells(row: Row) -> tuple[str, ...]:
    return (
        row.work,
        row.model,
        row.result,
        _milli(row.ours),
        "-" if row.toolbox is None else _milli(row.toolbox),
        "-" if row.ratio is None else f"{row.ratio:.2f}",
        "-" if row.asked is None else f"at most {row.asked:g}",
    )


def _milli(seconds: float) -> str:
    return f"{1e3 * seconds:.3f} ms" if seconds < 0.01 else f"{1e3 * seconds:.0f} ms"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="How fast structural diagnosis is.")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write all numbers to FILE, in seconds")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the table into the page FILE")
    chosen = parser.parse_args(argv)
    rows = measure()
    cells = [_cells(row) for row in rows]
    note = f"{today()}; {machine()}"
    print(f"{as_text(HEADER, cells)}\n\n{note}")
    if chosen.json is not None:
        report = {"note": note, "rows": [asdict(row) | {"ratio": row.ratio} for row in rows]}
        chosen.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if chosen.markdown is not None:
        text = f"`python -m benchmarks.speed.structure`\n\n{note}.\n\n{as_markdown(HEADER, cells)}"
        write_part(chosen.markdown, "structure", text)


if __name__ == "__main__":
    main()
