"""Competition circuits (DXC): the score and the time of every scenario.

`python -m benchmarks.peers.circuits DIR [--json FILE]` takes every circuit XML in DIR that lies beside a folder of
scenarios of the same name. A scenario is scored with all the truth that its file tells; the time has the reading of
both files.

Score of an answer D (a set of diagnoses) against the truth T: the mean of m_utl over all pairs of D and T, divided by
the scenario's normalizationFactor, which is the mean of T against itself. For one diagnosis d and one truth t in a
circuit of f suspects, with n = |d - t| false positives, m = |t - d| false negatives, N = |d|, M = f - N:

    m_utl = 1 - n (N + 1) / (f (n + 1)) - m (M + 1) / (f (m + 1))

An answer that is not the truth may be scored above 1, if it is more alike to all of T than T is to itself.

A truth is disputed where the answer has no more gates than it, yet sets that are not in it: simulation then shows that
these explain what was observed, so the file does not hold all diagnoses of minimum cardinality.
"""

import argparse
import json
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import FaultbondError, StructureError
from faultbond.model.document import is_circuit
from faultbond.model.logic import GateSet, LogicNetwork, Scenario
from faultbond.networks.logic.diagnoses import explains, minimum_diagnoses
from faultbond.networks.logic.dxc import read_circuit, read_scenario

CHUNK = 1024  # rows of the answer scored at once


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """Answer to one scenario, None where there is none, for a `problem`; `score` None where the file tells no truth."""

    circuit: str
    scenario: str
    diagnoses: tuple[GateSet, ...] | None
    truth: tuple[GateSet, ...] | None
    score: float | None
    disputed: bool
    seconds: float
    problem: str = ""

    @property
    def is_equal(self) -> bool:
        """Whether the answer is the truth of the file."""
        return self.truth is not None and self.diagnoses is not None and set(self.diagnoses) == set(self.truth)


def utility(diagnosis: GateSet, truth: GateSet, n_suspects: int) -> float:
    """Give m_utl of one diagnosis against one true one, see above."""
    return float(_utility(len(diagnosis - truth), len(truth - diagnosis), len(diagnosis), n_suspects))


def score(answer: Sequence[GateSet], truth: Sequence[GateSet], n_suspects: int, normalization: float) -> float:
    """Give the score of an answer, see above; that of no answer at all is that of the empty diagnosis.

    Parameters
    ----------
    answer, truth : sets of diagnoses
    n_suspects : number of components that may be faulty
    normalization : score that counts as 1
    """
    columns = {name: index for index, name in enumerate(sorted(set().union(*answer, *truth)))}
    rows, targets = _incidence(answer or [frozenset()], columns), _incidence(truth, columns)
    total = 0.0
    for begin in range(0, len(rows), CHUNK):
        part = rows[begin : begin + CHUNK]
        common = part @ targets.T
        sizes = part.sum(axis=1, keepdims=True)
        total += float(_utility(sizes - common, targets.sum(axis=1) - common, sizes, n_suspects).sum())
    return total / (len(rows) * len(targets)) / normalization


def _utility(
    positives: FloatArray | float, negatives: FloatArray | float, size: FloatArray | float, count: int
) -> FloatArray:
    """Give m_utl by the numbers of false positives and negatives."""
    false_alarm = positives * (size + 1) / (count * (positives + 1))
    return np.asarray(1 - false_alarm - negatives * (count - size + 1) / (count * (negatives + 1)))


def _incidence(diagnoses: Sequence[GateSet], columns: dict[str, int]) -> FloatArray:
    """Give 1 where a diagnosis (row) has a component (column)."""
    matrix = np.zeros((len(diagnoses), len(columns)), dtype=np.float64)
    for row, diagnosis in enumerate(diagnoses):
        matrix[row, [columns[name] for name in diagnosis]] = 1
    return matrix


def measure(circuit: Path, scenario: Path, time_limit: float) -> Result:
    """Read both files, diagnose, and then score the answer; no answer is scored 0."""
    begin = time.perf_counter()
    network, made = read_circuit(circuit), read_scenario(scenario)
    rows = [item.values for item in made.observations]
    answer: tuple[GateSet, ...] | None = None
    problem = ""
    try:
        answer = minimum_diagnoses(network, rows, time_limit=time_limit)
    except StructureError as error:
        problem = str(error)
    seconds = time.perf_counter() - begin
    return Result(
        circuit=circuit.stem,
        scenario=scenario.stem,
        diagnoses=answer,
        truth=made.diagnoses,
        score=score_of(answer, made, len(network.suspects)),
        disputed=answer is not None and is_disputed(answer, network, made),
        seconds=seconds,
        problem=problem,
    )


def score_of(answer: Sequence[GateSet] | None, scenario: Scenario, n_suspects: int) -> float | None:
    """Give the score against the truth of the file, None where it has none."""
    truth = scenario.diagnoses
    if not truth:
        return None
    best = scenario.normalization or score(truth, truth, n_suspects, 1.0)
    return 0.0 if answer is None else score(answer, truth, n_suspects, best)


def is_disputed(answer: Sequence[GateSet], network: LogicNetwork, scenario: Scenario) -> bool:
    """Whether answers that are not in the truth, and have no more gates, explain what was observed.

    Not where there are too many ways to try.
    """
    truth = set(scenario.diagnoses or ())
    size = min(map(len, truth), default=-1)
    rows = [item.values for item in scenario.observations]
    others = [item for item in answer if item not in truth and len(item) <= size]
    with suppress(StructureError):
        return bool(others) and all(explains(network, item, rows) for item in others)
    return False


def circuits_in(folder: Path) -> Iterator[tuple[Path, list[Path]]]:
    """Give each circuit with its scenarios, in order of name."""
    for circuit in sorted(path for path in folder.iterdir() if is_circuit(path)):
        if circuit.with_suffix("").is_dir():
            yield circuit, sorted(circuit.with_suffix("").glob("*.scn"))


def run_scenarios(circuit: Path, scenarios: Sequence[Path], time_limit: float) -> Iterator[Result]:
    """Give the result of each scenario that can be read; say which cannot."""
    for scenario in scenarios:
        try:
            result = measure(circuit, scenario, time_limit)
        except FaultbondError as problem:
            print(f"left out: {problem}", file=sys.stderr)
            continue
        if result.diagnoses is None:
            print(f"{scenario}: no answer: {result.problem}", file=sys.stderr)
        yield result


def record_of(result: Result) -> dict[str, object]:
    """Give what is written of a scenario."""
    kept = {name: getattr(result, name) for name in ("circuit", "scenario", "score", "disputed", "seconds")}
    return kept | {"diagnoses": None if result.diagnoses is None else [sorted(item) for item in result.diagnoses]}


def line_of(title: str, results: Sequence[Result]) -> str:
    """Give the line of the table for some results."""
    scores = [result.score for result in results if result.score is not None]
    equal = sum(result.is_equal for result in results)
    disputed = sum(result.disputed for result in results)
    mean = f"{sum(scores) / len(scores):.3f}" if scores else "-"
    agreed = [result.score for result in results if result.score is not None and not result.disputed]
    undisputed = f"{sum(agreed) / len(agreed):.3f}" if agreed else "-"
    worst = f"{max(result.seconds for result in results):.3f} s" if results else "-"
    return f"{title:<12}{len(results):>9}{mean:>8}{equal:>8}{disputed:>10}{undisputed:>12}{worst:>10}"


def main() -> None:
    """Score a folder."""
    parser = argparse.ArgumentParser(description="Score of the diagnoses of competition circuits.")
    parser.add_argument("folder", type=Path, help="circuits NAME.xml beside folders NAME of scenarios")
    parser.add_argument("--json", type=Path, help="file for the diagnoses of every scenario")
    parser.add_argument("--time-limit", type=float, default=60.0, help="seconds for a scenario (default 60)")
    arguments = parser.parse_args()
    if not arguments.folder.is_dir():
        parser.error(f"{arguments.folder} is no folder")
    everything: list[Result] = []
    print(f"{'circuit':<12}{'scenarios':>9}{'score':>8}{'equal':>8}{'disputed':>10}{'undisputed':>12}{'worst':>10}")
    for circuit, scenarios in circuits_in(arguments.folder):
        results = list(run_scenarios(circuit, scenarios, arguments.time_limit))
        print(line_of(circuit.stem, results), flush=True)
        everything += results
    print(line_of("all", everything))
    if any(result.disputed for result in everything):
        print("disputed: the file's truth leaves out sets that explain the observation with no more gates")
    if arguments.json is not None:
        arguments.json.write_text(json.dumps([record_of(result) for result in everything]) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
