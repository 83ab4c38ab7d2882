"""The plants of the table of trust, and what goes wrong with them: one function a kind of run, of a seed.

Of every second seed the stores keep effort or flow at the fault, not content (`benchmarks.shared.plants`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import combinations

import numpy as np

from benchmarks.shared.plants import case, effort_or_flow_goes_on, graph_of, recipe_module, tank_start
from benchmarks.shared.play import engine_of
from faultbond.arrays import FloatArray
from faultbond.contract.lanes import starts_of
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.simulate import Decide, Effects, Fault, Policy, Simulation, simulate
from faultbond.types import FaultKind

TANK_SECONDS, MOTOR_SECONDS = 4920.0, 60.0
ONSETS = {"tank": (1200.0, 1800.0), "dc_motor": (15.0, 25.0), "dc_motor_current": (15.0, 25.0)}
MOVING_AFTER = 3000.0  # s that a tank whose valves move is recorded after the onset
DRIFT_ONSET, DRIFT_SECONDS = (300.0, 900.0), 3600.0
MOTOR = ("R", "L", "K", "J", "C")
NEVER = float("inf")
BOUNDS, SWING = (4000.0, 10000.0), (5000.0, 9000.0)  # Pa: levels between which valves that move keep the tank
BIAS, GAIN, NOISE = 5.0, 1.15, 3.0  # of a sensor: declared sd, factor of the reading, factor of the sd
PASSING, ON, OFF = 10.0, 30, 90  # of a sensor that is wrong at times: in its noise, and for how many samples
INPUT_BIAS = 0.15  # of an input, in its largest value
NONE: Mapping[str, float] = {}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Played:
    """One recording and what is true of it.

    suspects : parameters at fault, or the sensor or input at fault; empty of a healthy plant
    onset : moment of the fault, s
    values : true values at the end of the recording, by parameter, SI
    rate : of a drift, SI per second
    order : numbers of the rows as they arrive on a live stream; None: a file, in order
    stops : moments at which watching is interrupted, s
    """

    folder: str
    time: FloatArray
    inputs: FloatArray
    outputs: FloatArray
    suspects: frozenset[str] = frozenset()
    onset: float = NEVER
    values: Mapping[str, float]
    rate: float = 0.0
    order: tuple[int, ...] | None = None
    stops: tuple[float, ...] = ()


Make = Callable[[int], Played]


@lru_cache(maxsize=4)
def healthy(folder: str, seconds: float, seed: int) -> Played:
    """Give a run without a fault."""
    return _played(folder, case(folder, seed, seconds=seconds).recording, ())


@lru_cache(maxsize=4)
def healthy_moving(seed: int) -> Played:
    """Give a tank without a fault whose valves move."""
    return _played("tank", _moving(both_valves, seed, (), _onset("tank", seed) + MOVING_AFTER), ())


def roughly_modelled(seed: int) -> Played:
    """Give a healthy tank that is worse modelled than usual by 5 to 3: parameters off by up to 5 %, and the curves."""
    start = tank_start(np.random.default_rng([seed, 1]).uniform(0.4, 0.7))
    policy = Policy(time=np.arange(TANK_SECONDS), begin=recipe_module("tank").recipe)
    effects = Effects(spread=0.05, lag=3.0, curve={"u_in": 0.05, "u_out": 0.033})
    return _played("tank", simulate(graph_of("tank"), policy, (), seed=seed, effects=effects, start=start), ())


@lru_cache(maxsize=4)
def stepped(
    folder: str, factors: tuple[tuple[str, float], ...], seed: int, *, after: float | None = None, moving: bool = False
) -> Played:
    """Give a run in which parameters step.

    Parameters
    ----------
    folder : name of the example
    factors : by parameter
    seed : of plant, noise, inputs and onset
    after : seconds that are recorded after the onset; None: as long as a healthy run
    moving : whether the valves of the tank move all the time, instead of as its recipe says
    """
    onset = _onset(folder, seed)
    faults = [Fault(parameter=name, factor=factor, start=onset) for name, factor in factors]
    plant = effort_or_flow_goes_on(folder) if seed % 2 else None
    seconds = onset + after if after is not None else TANK_SECONDS if folder == "tank" else MOTOR_SECONDS
    if moving:
        recording = _moving(both_valves, seed, faults, seconds, plant)
    else:
        recording = case(folder, seed, faults, seconds=seconds, plant=plant).recording
    return replace(_played(folder, recording, [name for name, _ in factors]), onset=onset)


def expected(folder: str, seed: int) -> Played:
    """Give a run in which one parameter, any of them, steps as the model expects."""
    spec, _ = engine_of(folder)
    return stepped(folder, (drawn(spec, np.random.default_rng([seed, 23])),), seed)


def drawn(spec: EngineSpec, generator: np.random.Generator) -> tuple[str, float]:
    """Draw a parameter and its factor from the prior of the hypotheses that name one parameter."""
    singles = [chosen[0] for chosen in spec.hypotheses if len(chosen) == 1]
    parameter = spec.parameters[singles[generator.integers(len(singles))]]
    starts = starts_of(parameter, 1)
    start = starts[generator.integers(len(starts))]
    factor = generator.normal(start.value, start.sd)
    while not parameter.lower < factor < parameter.upper:
        factor = generator.normal(start.value, start.sd)
    return parameter.name, float(factor)


def drifting(seed: int) -> Played:
    """Give a tank whose K1 doubles over an hour, while its inlet moves; the recording ends when it has."""
    onset = float(np.random.default_rng([seed, 7]).uniform(*DRIFT_ONSET))
    fault = Fault(parameter="K1", factor=2.0, start=onset, end=onset + DRIFT_SECONDS)
    recording = _moving(moving_valves, seed, [fault], round(onset + DRIFT_SECONDS) + 1.0)
    found = _played("tank", recording, ["K1"])
    return replace(found, onset=onset, rate=0.5 * found.values["K1"] / DRIFT_SECONDS)


def _moving(
    begin: Callable[[], Decide], seed: int, faults: Sequence[Fault], seconds: float, plant: BondGraph | None = None
) -> Simulation:
    """Simulate the tank with an operation of our own, from 0.6 m on."""
    policy, effects = Policy(time=np.arange(float(round(seconds))), begin=begin), recipe_module("tank").EFFECTS
    return simulate(plant or graph_of("tank"), policy, faults, seed=seed, effects=effects, start=tank_start(0.6))


def moving_valves() -> Decide:
    """Begin an operation whose inlet valve moves every five minutes, while the outlet keeps the level in bounds."""
    draining = False

    def decide(time: float, outputs: FloatArray) -> Sequence[float]:
        nonlocal draining
        draining = _drains(draining, outputs, *BOUNDS)
        return (80.0, 45.0, 70.0, 30.0)[int(time // 300.0) % 4], 65.0 if draining else 35.0

    return decide


def both_valves() -> Decide:
    """Begin an operation with an inlet that moves every five minutes and an outlet that moves every four.

    The level swings, up and down once in about nine minutes.
    """
    draining = False

    def decide(time: float, outputs: FloatArray) -> Sequence[float]:
        nonlocal draining
        draining = _drains(draining, outputs, *SWING)
        inlet, outlet = ((25.0, 10.0), (90.0, 70.0)) if draining else ((80.0, 65.0), (20.0, 40.0))
        return inlet[int(time // 300.0) % 2], outlet[int(time // 240.0) % 2]

    return decide


def _drains(draining: bool, outputs: FloatArray, low: float, high: float) -> bool:
    level = outputs[1]  # Pa; nan at the first row
    return bool(level > high or (draining and not level < low))


def misread(make: Make, sensor: str, kind: FaultKind, seed: int) -> Played:
    """Give a healthy run of which a sensor is wrong from the onset on; the plant is run as if it were not.

    Parameters
    ----------
    make : the healthy run of a seed
    sensor : which one
    kind : BIAS, `BIAS` of its noise too much or too little; GAIN, `GAIN` times the value; NOISE, `NOISE` times the
        noise; STUCK, at what it read last; INTERMITTENT, `PASSING` of its noise too much or too little for `ON`
        samples, then right for `OFF`, again and again
    seed : as everywhere
    """
    found = make(seed)
    onset, sensors = _onset(found.folder, seed), graph_of(found.folder).sensors
    index = [item.name for item in sensors].index(sensor)
    outputs, wrong, sd = found.outputs.copy(), found.time >= onset, sensors[index].noise
    right = outputs[wrong, index]
    generator = np.random.default_rng([seed, 19])
    sign = 1.0 if seed % 4 < 2 else -1.0
    outputs[wrong, index] = {
        FaultKind.BIAS: right + sign * BIAS * sd,
        FaultKind.GAIN: right * GAIN,
        FaultKind.NOISE: right + np.sqrt(NOISE**2 - 1.0) * sd * generator.standard_normal(right.size),
        FaultKind.STUCK: np.full_like(right, outputs[~wrong, index][-1]),
        FaultKind.INTERMITTENT: right + sign * PASSING * sd * (np.arange(right.size) % (ON + OFF) < ON),
    }[kind]
    return replace(found, outputs=outputs, suspects=frozenset({sensor}), onset=onset)


def disobeyed(folder: str, name: str, seconds: float, seed: int) -> Played:
    """Give a run in which, from the onset on, more or less of an input acts than is recorded."""
    plain, onset = healthy(folder, seconds, seed), _onset(folder, seed)
    index = [item.name for item in graph_of(folder).inputs].index(name)
    bias = (1.0 if seed % 4 < 2 else -1.0) * INPUT_BIAS * float(np.max(np.abs(plain.inputs[:, index])))
    fault = Fault(parameter=f"{name}.bias", value=bias, start=onset)
    recording = case(folder, seed, [fault], seconds=seconds).recording
    return replace(_played(folder, recording, ()), suspects=frozenset({name}), onset=onset)


def any_pair(folder: str, alike: bool, seed: int) -> Played:
    """Give a motor of which two parameters step by 1.5 or 2, up or down; `alike`: both in the same direction."""
    generator = np.random.default_rng([seed, 11])
    pairs = list(combinations(MOTOR, 2))
    chosen = pairs[seed % len(pairs)]
    signs = generator.choice([-1.0, 1.0], 2)
    if alike:
        signs[1] = signs[0]
    factors = generator.choice([1.5, 2.0], 2) ** signs
    return stepped(folder, tuple(zip(chosen, (float(f) for f in factors), strict=True)), seed)


def any_triple(folder: str, seed: int) -> Played:
    """Give a motor of which three parameters step by 1.5 or 2, up or down."""
    generator = np.random.default_rng([seed, 13])
    triples = list(combinations(MOTOR, 3))
    factors = generator.choice([1.5, 2.0], 3) ** generator.choice([-1.0, 1.0], 3)
    return stepped(folder, tuple(zip(triples[seed % 10], (float(f) for f in factors), strict=True)), seed)


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
