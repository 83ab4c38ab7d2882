"""Simulated plants for the benchmarks: the recipes of the example folders with other seeds and faults.

Run as a program it prints how long each simulation takes.
"""

import importlib.util
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import cast

from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Fault, Simulation

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

Recipe = Callable[[BondGraph, int, Sequence[Fault], int], Simulation]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A model and what its plant, which is not quite the model, recorded."""

    graph: BondGraph
    recording: Simulation


def case(
    folder: str, seed: int, faults: Sequence[Fault] = (), *, seconds: float, plant: BondGraph | None = None
) -> Case:
    """Simulate an example plant by its own recipe.

    Parameters
    ----------
    folder : name of the example
    seed : of the plant's parameters, its inputs and the noise
    faults : what goes wrong
    seconds : length of the recording
    plant : what is simulated, where it is not the model itself; same parameters, inputs and sensors
    """
    graph = load_model(EXAMPLES / folder / "model.yaml")
    rows = round(seconds / (graph.sample_time or 1.0))
    return Case(graph=graph, recording=_recipe(folder)(plant or graph, seed, faults, rows))


def tank_case(seed: int, faults: Sequence[Fault] = (), *, seconds: float = 4920.0) -> Case:
    """Give a water tank: parameters off by up to 3 %, valves with a lag of 3 s and wrong curves, 82 minutes."""
    return case("tank", seed, faults, seconds=seconds)


def motor_case(seed: int, faults: Sequence[Fault] = (), *, seconds: float = 60.0, current: bool = False) -> Case:
    """Give a DC motor, parameters off by up to 1.5 %, with its current measured if wanted."""
    return case("dc_motor_current" if current else "dc_motor", seed, faults, seconds=seconds)


def rlc_case(seed: int, faults: Sequence[Fault] = (), *, seconds: float = 60.0) -> Case:
    """Give an RLC circuit, parameters off by up to 1.5 %."""
    return case("rlc", seed, faults, seconds=seconds)


def rc_case(seed: int, faults: Sequence[Fault] = (), *, seconds: float = 60.0) -> Case:
    """Give an RC circuit, parameters off by up to 1.5 %."""
    return case("rc", seed, faults, seconds=seconds)


def _recipe(folder: str) -> Recipe:
    return cast(Recipe, recipe_module(folder).record)


def recipe_module(folder: str) -> ModuleType:
    """Load the script that makes an example's recordings; `record` in it makes one."""
    name = f"make_{folder}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, EXAMPLES / folder / f"{name}.py")
        if spec is None or spec.loader is None:
            raise FileNotFoundError(f"examples/{folder}/{name}.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        sys.modules[name] = module
    return sys.modules[name]


def main() -> None:
    """Time each plant once."""
    for name, make, seconds in (
        ("water tank", tank_case, 4920.0),
        ("DC motor", motor_case, 300.0),
        ("RLC circuit", rlc_case, 300.0),
        ("RC circuit", rc_case, 300.0),
    ):
        begin = time.perf_counter()
        made = make(0, (), seconds=seconds)
        taken = time.perf_counter() - begin
        error = made.recording.error
        print(f"{name}: {seconds:.0f} s in {taken:.2f} s, error of the integration {error:.0e}")


if __name__ == "__main__":
    main()
