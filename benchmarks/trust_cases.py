"""What is simulated for the table of trust: plants, and faults of every kind.

Of every second seed the stores keep effort or flow at the fault, not content (`benchmarks.variants`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from itertools import combinations

import numpy as np

from benchmarks.plants import EXAMPLES, case, recipe_module
from benchmarks.variants import effort_or_flow_goes_on
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.simulate import Decide, Effects, Fault, Policy, Simulation, simulate
from faultbond.types import FloatArray

TANK_SECONDS, MOTOR_SECONDS = 4920.0, 60.0
ONSETS = {"tank": (1200.0, 1800.0), "dc_motor": (15.0, 25.0), "dc_motor_current": (15.0, 25.0)}
DRIFT_ONSET, DRIFT_SECONDS = (300.0, 900.0), 3600.0
MOTOR = ("R", "L", "K", "J", "C")
NEVER = float("inf")
LOW, HIGH = 4000.0, 10000.0  # Pa: levels between which the outlet keeps the tank whose valves move
NONE: Mapping[str, float] = {}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Played:
    """One recording and what is true of it.

    suspects : parameters at fault, or the sensor at fault; empty of a healthy plant
    onset : moment of the fault, s
    values : true values at the end of the recording, by parameter, SI
    rate : of a drift, SI per second
    """

    folder: str
    time: FloatArray
    inputs: FloatArray
    outputs: FloatArray
    suspects: frozenset[str] = frozenset()
    onset: float = NEVER
    values: Mapping[str, float]
    rate: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A kind of run: `make` gives the recording of a seed, `looks` are the seconds after the alarm at which one reads.

    opened : seconds since the alarm for which `u_in` has to have been at 60 % or more at the last look
    """

    key: str
    make: Callable[[int], Played]
    looks: tuple[float, ...] = ()
    opened: float = 0.0


@cache
def graph_of(folder: str) -> BondGraph:
    """Give the model of an example."""
    return load_model(EXAMPLES / folder / "model.yaml")


def healthy(folder: str, seconds: float, seed: int) -> Played:
    """Give a run without a fault."""
    return _played(folder, case(folder, seed, seconds=seconds).recording, ())


def roughly_modelled(seed: int) -> Played:
    """Give a healthy tank that is worse modelled than usual by 5 to 3: parameters off by up to 5 %, and the curves."""
    graph, module = graph_of("tank"), recipe_module("tank")
    level = np.random.default_rng([seed, 1]).uniform(0.4, 0.7)
    start = {"tank.q": level * module.PASCAL_PER_METRE / graph.parameter("K3").nominal}
    policy = Policy(time=np.arange(TANK_SECONDS), begin=module.recipe)
    effects = Effects(spread=0.05, lag=3.0, curve={"u_in": 0.05, "u_out": 0.033})
    return _played("tank", simulate(graph, policy, (), seed=seed, effects=effects, start=start), ())


def stepped(folder: str, factors: Sequence[tuple[str, float]], seed: int) -> Played:
    """Give a run in which parameters step."""
    onset = _onset(folder, seed)
    faults = [Fault(parameter=name, factor=factor, start=onset) for name, factor in factors]
    plant = effort_or_flow_goes_on(folder) if seed % 2 else None
    seconds = TANK_SECONDS if folder == "tank" else MOTOR_SECONDS
    recording = case(folder, seed, faults, seconds=seconds, plant=plant).recording
    return replace(_played(folder, recording, [name for name, _ in factors]), onset=onset)


def drifting(seed: int) -> Played:
    """Give a tank whose K1 doubles over an hour, while its valves move; the recording ends when it has."""
    onset = float(np.random.default_rng([seed, 7]).uniform(*DRIFT_ONSET))
    fault = Fault(parameter="K1", factor=2.0, start=onset, end=onset + DRIFT_SECONDS)
    graph, module = graph_of("tank"), recipe_module("tank")
    start = {"tank.q": 0.6 * module.PASCAL_PER_METRE / graph.parameter("K3").nominal}
    policy = Policy(time=np.arange(round(onset + DRIFT_SECONDS) + 1.0), begin=moving_valves)
    recording = simulate(graph, policy, [fault], seed=seed, effects=module.EFFECTS, start=start)
    found = _played("tank", recording, ["K1"])
    return replace(found, onset=onset, rate=0.5 * found.values["K1"] / DRIFT_SECONDS)


def moving_valves() -> Decide:
    """Begin an operation whose inlet valve moves every five minutes, while the outlet keeps the level in bounds."""
    draining = False

    def decide(time: float, outputs: FloatArray) -> Sequence[float]:
        nonlocal draining
        level = outputs[1]  # Pa; nan at the first row
        draining = level > HIGH or (draining and not level < LOW)
        return (80.0, 45.0, 70.0, 30.0)[int(time // 300.0) % 4], 65.0 if draining else 35.0

    return decide


def biased(folder: str, sensor: str, sds: float, seed: int) -> Played:
    """Give a run in which a sensor reads `sds` of its noise too much, or too little, from the onset on."""
    graph, onset = graph_of(folder), _onset(folder, seed)
    found = healthy(folder, TANK_SECONDS if folder == "tank" else MOTOR_SECONDS, seed)
    index = [item.name for item in graph.sensors].index(sensor)
    outputs = found.outputs.copy()
    sign = 1.0 if seed % 4 < 2 else -1.0
    outputs[found.time >= onset, index] += sign * sds * graph.sensors[index].noise
    return replace(found, outputs=outputs, suspects=frozenset({sensor}), onset=onset)


def any_pair(folder: str, alike: bool, seed: int) -> Played:
    """Give a motor of which two parameters step by 1.5 or 2, up or down; `alike`: both in the same direction."""
    generator = np.random.default_rng([seed, 11])
    pairs = list(combinations(MOTOR, 2))
    chosen = pairs[seed % len(pairs)]
    signs = generator.choice([-1.0, 1.0], 2)
    if alike:
        signs[1] = signs[0]
    factors = generator.choice([1.5, 2.0], 2) ** signs
    return stepped(folder, list(zip(chosen, (float(f) for f in factors), strict=True)), seed)


def any_triple(folder: str, seed: int) -> Played:
    """Give a motor of which three parameters step by 1.5 or 2, up or down."""
    generator = np.random.default_rng([seed, 13])
    triples = list(combinations(MOTOR, 3))
    factors = generator.choice([1.5, 2.0], 3) ** generator.choice([-1.0, 1.0], 3)
    return stepped(folder, list(zip(triples[seed % 10], (float(f) for f in factors), strict=True)), seed)


def with_missing(make: Callable[[int], Played], part: float, seed: int) -> Played:
    """Give a run in which a part of all values is missing."""
    found = make(seed)
    generator = np.random.default_rng([seed, 17])
    inputs, outputs = found.inputs.copy(), found.outputs.copy()
    inputs[generator.random(inputs.shape) < part] = np.nan
    outputs[generator.random(outputs.shape) < part] = np.nan
    inputs[0] = found.inputs[0]
    return replace(found, inputs=inputs, outputs=outputs)


def _onset(folder: str, seed: int) -> float:
    return float(np.random.default_rng([seed, 7]).uniform(*ONSETS[folder]))


def _played(folder: str, recording: Simulation, suspects: Sequence[str]) -> Played:
    names = [item.name for item in graph_of(folder).parameters]
    return Played(
        folder=folder,
        time=recording.time,
        inputs=recording.inputs,
        outputs=recording.outputs,
        suspects=frozenset(suspects),
        values={name: float(recording.parameters[-1, names.index(name)]) for name in suspects},
    )


_LEAK, _PIPE = ("K6", 8.37), ("K1", 1.85)  # the leak: 8.7e-5 m3/s
SMALL_LEAK = 1.0 + 1.0e-5 / 1.04e-5  # 0.010 l/s more
_TANK_LOOKS, _MOTOR_LOOKS = (120.0, 300.0, 600.0), (2.0, 5.0, 10.0, 20.0)
_SETS: dict[str, tuple[tuple[str, float], ...]] = {
    "K1": (_PIPE,),
    "K6": (_LEAK,),
    "K1+K6": (_PIPE, _LEAK),
    "K1+K4": (_PIPE, ("K4", 1.2)),
    "K2": (("K2", 1.2),),
    "K3": (("K3", 1.2),),
    "K4": (("K4", 1.2),),
    "K7": (("K7", 1.2),),
    "K8": (("K8", 0.85),),
}
SMALL = ("K2", "K3", "K4", "K7", "K8")


def _cases() -> list[Case]:
    found = [
        Case(key="tank.healthy", make=partial(healthy, "tank", TANK_SECONDS)),
        Case(key="tank.rough", make=roughly_modelled),
        Case(key="motor.healthy", make=partial(healthy, "dc_motor", 300.0)),
        Case(key="current.healthy", make=partial(healthy, "dc_motor_current", 300.0)),
    ]
    found += [
        Case(key=f"tank.{key}", make=partial(stepped, "tank", factors), looks=_TANK_LOOKS, opened=300.0)
        for key, factors in _SETS.items()
    ]
    found.append(Case(key="small.K6", make=partial(stepped, "tank", [("K6", SMALL_LEAK)])))
    found += [
        Case(key=f"small.{name}.{word}", make=partial(stepped, "tank", [(name, factor)]))
        for name in SMALL
        for word, factor in (("up", 1.1), ("down", 0.9))
    ]
    found += [
        Case(key=f"motor.{name}.{word}", make=partial(stepped, "dc_motor", [(name, factor)]), looks=_MOTOR_LOOKS)
        for name in MOTOR
        for word, factor in (("up", 1.5), ("down", 1.0 / 1.5))
    ]
    found += [
        Case(key="motor.pairs.alike", make=partial(any_pair, "dc_motor", True), looks=_MOTOR_LOOKS),
        Case(key="motor.pairs.any", make=partial(any_pair, "dc_motor", False), looks=_MOTOR_LOOKS),
        Case(key="current.triples", make=partial(any_triple, "dc_motor_current"), looks=_MOTOR_LOOKS),
        Case(key="bias.flow", make=partial(biased, "tank", "flow", 5.0), looks=_TANK_LOOKS),
        Case(key="bias.pressure", make=partial(biased, "tank", "pressure", 5.0), looks=_TANK_LOOKS),
        Case(key="bias.omega", make=partial(biased, "dc_motor", "omega", 5.0), looks=_MOTOR_LOOKS),
        Case(key="bias.current.omega", make=partial(biased, "dc_motor_current", "omega", 5.0), looks=_MOTOR_LOOKS),
        Case(key="bias.current.i", make=partial(biased, "dc_motor_current", "i", 5.0), looks=_MOTOR_LOOKS),
        Case(key="drift.K1", make=drifting, looks=(NEVER,)),
        Case(key="missing.K6", make=partial(with_missing, partial(stepped, "tank", (_LEAK,)), 0.05), looks=_TANK_LOOKS),
        Case(
            key="missing.R",
            make=partial(with_missing, partial(stepped, "dc_motor", [("R", 2.0)]), 0.05),
            looks=_MOTOR_LOOKS,
        ),
    ]
    return found


CASES = {item.key: item for item in _cases()}
