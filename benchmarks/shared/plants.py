"""Simulated plants for the benchmarks: the recipes of the example folders with other seeds and faults.

`simulate` keeps the content of a store: a capacitor whose capacitance drops keeps its charge, so its voltage jumps. Of
a tank whose area is misjudged, or a rotor that was always heavier than thought, the level and the speed go on instead.
For those plants the changing parameter is taken out of the store and scales what flows into it, so that for the tank

    dP/dt = K3 (inflow - outflow - leak)

and P is continuous whatever K3 does. As long as no store's parameter changes, both forms record the same.
"""

import importlib.util
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import cast

from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model
from faultbond.simulate import Fault, Simulation

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"

Recipe = Callable[[BondGraph, int, Sequence[Fault], int], Simulation]
Edits = tuple[tuple[str, str], ...]

_COIL: Edits = (
    (
        "L: {type: I, parameters: {L: 2.5 H}}",
        "L: {type: TF, law: [f1 = f2, e2 = L_0/L*e1], parameters: {L: 2.5 H}}\n  coil: {type: I, law: p = L_0*f}",
    ),
    ("armature -> L,", "armature -> L -> coil,"),
)
_ROTOR: Edits = (
    (
        "J: {type: I, parameters: {J: 1.5 kg*m^2}}",
        "J: {type: TF, law: [f1 = f2, e2 = J_0/J*e1], parameters: {J: 1.5 kg*m^2}}\n  rotor: {type: I, law: p = J_0*f}",
    ),
    ("shaft -> J,", "shaft -> J -> rotor,"),
)
_MOTOR: Edits = (*_COIL, *_ROTOR, ("\ninputs:", "\nconstants: {L_0: 2.5 H, J_0: 1.5 kg*m^2}\ninputs:"))
EDITS: dict[str, Edits] = {
    "tank": (
        (
            "tank:    {type: C, law: e = K3*q, parameters: {K3: 1.30e5 Pa/m^3}}",
            "scale: {type: TF, law: [e1 = e2, f2 = K3/K3_0*f1], parameters: {K3: 1.30e5 Pa/m^3}}\n"
            "  tank: {type: C, law: e = K3_0*q}",
        ),
        ("vessel -> tank", "vessel -> scale -> tank"),
        ("\nconstants: {", "\nconstants: {K3_0: 1.30e5 Pa/m^3, "),
    ),
    "dc_motor": _MOTOR,
    "dc_motor_current": _MOTOR,
    "rlc": (
        (
            "C: {type: C, parameters: {C: 50 mF}}",
            "C: {type: TF, law: [e1 = e2, f2 = C_0/C*f1], parameters: {C: 50 mF}}\n  plates: {type: C, law: q = C_0*e}",
        ),
        ("loop -> C,", "loop -> C -> plates,"),
        ("\ninputs:", "\nconstants: {C_0: 50 mF}\ninputs:"),
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Case:
    """A model and what its plant, which is not quite the model, recorded."""

    graph: BondGraph
    recording: Simulation


@cache
def graph_of(folder: str) -> BondGraph:
    """Give the model of an example."""
    return load_model(EXAMPLES / folder / "model.yaml")


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
    graph, recipe = graph_of(folder), cast(Recipe, recipe_module(folder).record)
    rows = round(seconds / (graph.sample_time or 1.0))
    return Case(graph=graph, recording=recipe(plant or graph, seed, faults, rows))


def tank_case(seed: int, faults: Sequence[Fault] = (), *, seconds: float = 4920.0) -> Case:
    """Give a water tank: parameters off by up to 3 %, valves with a lag of 3 s and wrong curves, 82 minutes."""
    return case("tank", seed, faults, seconds=seconds)


def tank_start(level: float) -> dict[str, float]:
    """Give the start of a water tank that is filled up to a level, m."""
    return {"tank.q": level * recipe_module("tank").PASCAL_PER_METRE / graph_of("tank").parameter("K3").nominal}


def motor_case(seed: int, faults: Sequence[Fault] = (), *, seconds: float = 60.0, current: bool = False) -> Case:
    """Give a DC motor, parameters off by up to 1.5 %, with its current measured if wanted."""
    return case("dc_motor_current" if current else "dc_motor", seed, faults, seconds=seconds)


def rlc_case(seed: int, faults: Sequence[Fault] = (), *, seconds: float = 60.0) -> Case:
    """Give an RLC circuit, parameters off by up to 1.5 %."""
    return case("rlc", seed, faults, seconds=seconds)


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


@cache
def effort_or_flow_goes_on(folder: str) -> BondGraph:
    """Give the plant of an example, changed so that its stores keep effort (C) or flow (I) when a parameter changes.

    Raises
    ------
    LookupError
        Where the model file no longer reads as the edits expect.
    """
    text = (EXAMPLES / folder / "model.yaml").read_text(encoding="utf-8")
    for old, new in EDITS[folder]:
        if text.count(old) != 1:
            raise LookupError(f"examples/{folder}/model.yaml: {old!r} is there {text.count(old)} times, not once")
        text = text.replace(old, new)
    return parse_model(text, file=f"{folder}, effort or flow goes on")
