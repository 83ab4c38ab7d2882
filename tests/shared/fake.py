"""Made-up plants and runs for tests of the report: the tank and the DC motor, no engine needed."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Detection, Diagnosis, Forecast, History, Suspect
from faultbond.model.expression import Name, Number
from faultbond.model.graph import (
    Bond,
    BondGraph,
    Component,
    Input,
    Junction,
    Parameter,
    Relation,
    Sensor,
    TimeColumn,
    Unit,
)
from faultbond.report.verdict import RunCounts
from faultbond.types import ElementType, FaultKind, JunctionType, TimeGrid

TANK = {
    "pump": ("Se", "K8", 64650.0, "Pa"),
    "pipe": ("R", "K1", 2.41e11, "Pa*s^2/m^6"),
    "orifice": ("R", "K2", 5.08e11, "Pa*s^2/m^6"),
    "valve": ("R", "K7", 255.0, "Pa^0.5*s/m^3/percent^2"),
    "tank": ("C", "K3", 1.30e5, "Pa/m^3"),
    "outlet": ("Sf", "K4", 2.35e-6, "m^3/s/percent"),
    "leak": ("Sf", "K6", 1.04e-5, "m^3/s"),
}
TANK_CHAINS = (
    "pump line pipe",
    "line orifice",
    "line valve",
    "line vessel tank",
    "vessel outlet",
    "vessel leak",
)
TANK_STROKES = dict(enumerate(("line", "pipe", "line", "line", "line", "vessel", "outlet", "leak")))

MOTOR = {
    "source": ("Se", "", 0.0, ""),
    "R": ("R", "R", 3.0, "ohm"),
    "L": ("I", "L", 2.5, "H"),
    "K": ("GY", "K", 2.0, "V*s/rad"),
    "J": ("I", "J", 1.5, "kg*m^2"),
    "C": ("R", "C", 0.4, "N*m*s/rad"),
}
MOTOR_CHAINS = ("source armature R", "armature L", "armature K shaft J", "shaft C")
MOTOR_STROKES = dict(enumerate(("armature", "armature", "L", "armature", "shaft", "J", "shaft")))


def make_graph(
    name: str,
    parts: dict[str, tuple[str, str, float, str]],
    chains: tuple[str, ...],
    junctions: dict[str, str],
    sensors: tuple[tuple[str, Unit, float], ...],
    inputs: tuple[str, ...] = (),
) -> BondGraph:
    """Build a graph from chains of names; laws are placeholders."""
    bonds = [Bond(tail=a, head=b) for chain in chains for a, b in pairwise(chain.split())]
    law = Relation(left=Name("x.e"), right=Number(0.0))
    parameters = [
        Parameter(
            name=parameter,
            owner=part,
            nominal=nominal,
            unit=Unit(unit),
            accuracy=0.03 * nominal,
            change=(10.0 if part == "leak" else 2.0) * nominal,
            lower=0.0,
            upper=float("inf"),
        )
        for part, (_, parameter, nominal, unit) in parts.items()
        if parameter
    ]
    return BondGraph(
        name=name,
        grid=TimeGrid.FIXED,
        sample_time=1.0,
        max_faults=2,
        warm_up=20.0,
        time=TimeColumn(),
        parameters=tuple(parameters),
        constants=(),
        inputs=tuple(Input(name=item, column=item, unit=Unit("percent")) for item in inputs),
        components=tuple(
            Component(name=part, type=ElementType(kind), laws=(law,), parameters=(parameter,) if parameter else ())
            for part, (kind, parameter, _, _) in parts.items()
        ),
        junctions=tuple(Junction(name=item, type=JunctionType(kind)) for item, kind in junctions.items()),
        bonds=tuple(bonds),
        sensors=tuple(
            Sensor(name=item, column=item, unit=unit, reads=Name("x.e"), noise=noise) for item, unit, noise in sensors
        ),
        slow_errors=(),
    )


def tank_graph(name: str = "water tank") -> BondGraph:
    """Give the tank; the pressure sensor reads kPa so that units matter."""
    sensors = (("flow", Unit("l/min", 1e-3 / 60.0), 2.8e-6), ("pressure", Unit("kPa", 1e3), 180.0))
    return make_graph(name, TANK, TANK_CHAINS, {"line": "1", "vessel": "0"}, sensors, ("u_in", "u_out"))


def motor_graph() -> BondGraph:
    """Give the DC motor."""
    sensors = (("omega", Unit("rad/s"), 0.06),)
    return make_graph("DC motor", MOTOR, MOTOR_CHAINS, {"armature": "1", "shaft": "1"}, sensors, ("V",))


def suspect(graph: BondGraph, name: str, factor: float, relative_sd: float) -> Suspect:
    """Give a suspect whose estimate is a multiple of its nominal value."""
    parameter = graph.parameter(name)
    return Suspect(
        parameter=name,
        component=parameter.owner,
        nominal=parameter.nominal,
        estimate=factor * parameter.nominal,
        sd=relative_sd * parameter.nominal,
    )


def moving(graph: BondGraph, name: str, factor: float, rate: float, *forecasts: Forecast) -> Suspect:
    """Give a suspect that drifts at a rate, SI per second, known to a tenth."""
    return replace(suspect(graph, name, factor, 0.02), rate=rate, rate_sd=0.1 * abs(rate), forecasts=forecasts)


def wrong(name: str, nominal: float | None, estimate: float, sd: float) -> Suspect:
    """Give a suspect such as `flow.bias`."""
    return Suspect(parameter=name, component=name.split(".", maxsplit=1)[0], nominal=nominal, estimate=estimate, sd=sd)


def kind_of(
    found: Suspect, *kinds: tuple[FaultKind, float], probability: float = 0.995, there: bool = True
) -> Candidate:
    """Give a candidate of one suspect with its kinds, the likeliest first."""
    return Candidate(
        suspects=(found,), probability=probability, group=True, kind=kinds[0][0], kinds=kinds, present=there
    )


def tank_diagnosis(graph: BondGraph, time: float, after: float) -> Diagnosis:
    """Give a diagnosis that grows surer of K1 with the time `after` the alarm."""
    sure = 1.0 / (1.0 + np.exp(min(after / 90.0, 60.0) - 1.2))  # how much others still get
    factor = 1.85 + 0.5 * sure * np.sin(after / 60.0)
    sets: list[tuple[tuple[Suspect, ...], float]] = [
        ((suspect(graph, "K1", factor, 0.03 + 0.5 * sure),), 1.0 - sure),
        ((suspect(graph, "K2", 1.3, 0.2),), 0.40 * sure),
        ((suspect(graph, "K7", 1.6, 0.2), suspect(graph, "K4", 0.9, 0.05)), 0.25 * sure),
        ((suspect(graph, "K8", 0.8, 0.05),), 0.15 * sure),
    ]
    small = [(a, b) for a in ("K1", "K2", "K3") for b in ("K4", "K6", "K7", "K8")]
    for k, pair in enumerate(small):
        sets.append((tuple(suspect(graph, name, 1.1, 2.0) for name in pair), 0.2 * sure / (k + 1) / 3.1032))
    total = sum(weight for _, weight in sets)
    sets.sort(key=lambda item: -item[1])
    best = sets[0][1]
    return Diagnosis(
        time=time,
        candidates=tuple(
            Candidate(suspects=members, probability=float(weight / total), group=bool(weight > best * np.exp(-3.0)))
            for members, weight in sets
        ),
    )


def smooth(generator: np.random.Generator, size: int, memory: int) -> FloatArray:
    """Give slow noise of unit size."""
    kernel = np.exp(-np.arange(5 * memory) / memory)
    noise = np.convolve(generator.normal(size=size + 5 * memory), kernel, "full")[5 * memory : 5 * memory + size]
    return np.asarray(noise / noise.std(), dtype=np.float64)


def tank_history(graph: BondGraph, *, samples: int = 4920, fault: bool = True, start: float = 0.0) -> History:
    """Give a run of the tank: K1 rises at half time, the alarm comes 276 samples later; a gap of 100 samples."""
    generator = np.random.default_rng(7)
    clock = np.arange(samples, dtype=float)
    onset, alarm = samples // 2, samples // 2 + 276
    broken = (clock > onset) & fault
    u_in = 40.0 + 40.0 * (np.floor(clock / 700.0) % 2)
    u_out = 20.0 + 15.0 * (np.floor(clock / 900.0) % 3)
    flow = 1.2e-4 + 1.0e-6 * u_in + 4e-6 * smooth(generator, samples, 60)
    pressure = 9000.0 + 2500.0 * np.sin(clock / 800.0) + 100.0 * smooth(generator, samples, 200)
    expected = np.column_stack([flow, pressure])
    measured = expected + generator.normal(size=(samples, 2)) * np.array([2.8e-6, 180.0])
    measured[broken, 0] -= 1.4e-5
    measured[1200:1300, 1] = np.nan
    cusum = np.abs(generator.normal(size=(samples, 2))) * 3.0
    cusum[:, 0] += np.where(broken, np.minimum((clock - onset) * 25.0 / 276.0, 60.0), 0.0)
    slow = np.column_stack(
        [smooth(generator, samples, 300) * 0.5 + 1.3 * broken, smooth(generator, samples, 300) * 0.4]
    )
    detections = (Detection(time=start + alarm, sample=alarm, change_time=start + onset + 9, signals=("flow",)),)
    times = [float(alarm + after) for after in range(0, samples - alarm, 30)] if fault else []
    return History(
        time=clock + start,
        measured=measured,
        expected=expected,
        expected_sd=np.tile([3.5e-6, 230.0], (samples, 1)),
        inputs=np.column_stack([u_in, u_out]),
        cusum=cusum,
        slow=slow,
        cusum_limit=25.0,
        slow_limits=np.array([1.6, 1.6]),
        slow_names=("slow error of line.f", "slow error of outlet.f"),
        detections=detections if fault else (),
        open=detections[0] if fault else None,
        diagnoses=tuple(tank_diagnosis(graph, start + time, time - alarm) for time in times),
    )


def with_last(history: History, candidates: tuple[Candidate, ...]) -> History:
    """Give the same run with another last diagnosis."""
    last = Diagnosis(time=float(history.time[-1]), candidates=candidates)
    return replace(history, diagnoses=(*history.diagnoses, last))


def counts_of(history: History) -> RunCounts:
    """Give counts that fit a made-up run."""
    return RunCounts(samples=len(history.time), missing=int(np.isnan(history.measured).any(axis=1).sum()))
