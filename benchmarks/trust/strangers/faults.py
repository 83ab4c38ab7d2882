"""One table of all faults: which kinds there are, in which order seeds take them, and what of each plant is struck.

A seed draws what is struck, when, and by how much; which kind of fault it has goes round.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from zlib import crc32

import numpy as np

from benchmarks.trust.strangers.rig import Change, Form, Rig


class Kind(Enum):
    """The kinds of fault, as rows of the tables."""

    STEP = "component: step"
    RAMP = "component: ramp, then stays"
    FOULING = "component: slowly, to the end"
    FIRST = "component: from the first sample"
    SENSOR_STEP = "sensor: step"
    SENSOR_RAMP = "sensor: ramp, then stays"
    SENSOR_DRIFT = "sensor: drift, to the end"
    INPUT_DRIFT = "input: drift, to the end"
    INPUT_STUCK = "input: stays where it is"
    INPUT_LAG = "input: lag grown"
    MIXED = "component and sensor"
    COMPONENTS = "two components"
    SENSORS = "two sensors"


ORDER = (  # of the seeds: the first eight have one of each sort
    Kind.STEP,
    Kind.SENSOR_RAMP,
    Kind.RAMP,
    Kind.INPUT_STUCK,
    Kind.SENSOR_STEP,
    Kind.FOULING,
    Kind.MIXED,
    Kind.FIRST,
    Kind.SENSOR_DRIFT,
    Kind.STEP,
    Kind.RAMP,
    Kind.INPUT_DRIFT,
    Kind.COMPONENTS,
    Kind.FOULING,
    Kind.INPUT_LAG,
    Kind.SENSOR_RAMP,
    Kind.RAMP,
    Kind.SENSORS,
    Kind.FIRST,
    Kind.SENSOR_STEP,
)
ONSET, RAMP = (0.3, 0.45), (0.015, 0.1)  # when it begins, how long a ramp takes: parts of the recording
SCATTER = (0.8, 1.25)  # of sizes
MEASURED = -1.0  # an instrument that reads too much: what acts is less than the record


@dataclass(frozen=True, slots=True, kw_only=True)
class Struck:
    """What may fail of a plant, each with a usual size.

    components : part of the value by which it changes, or `added`, the change itself, of what is 0 while healthy
    sensors, inputs : in the unit of the recording; either way
    lags : of inputs, the factor by which an actuator becomes slower, or the time constant of a meter in samples
    """

    components: Mapping[str, float]
    added: Mapping[str, float]
    sensors: Mapping[str, float]
    inputs: Mapping[str, float]
    lags: Mapping[str, float]


STRUCK = {
    "heat_exchanger": Struck(
        components={"K_h": -0.15, "K_c": -0.15, "UA": -0.25},
        added={},
        sensors={"F_h": 1.0, "F_c": 1.0, "T_ho": 1.2, "T_co": 1.2},
        inputs={"u_h": 8.0, "u_c": 8.0, "T_hi": 1.5, "T_ci": 1.5},
        lags={"u_h": 12.0, "u_c": 12.0},
    ),
    "pump_skid": Struck(
        components={"H": -0.1, "K_pipe": 0.4, "Kv": -0.2, "K_out": -0.2},
        added={"leak": 1.2e-4},
        sensors={"P": 4.0, "Q": 3.0, "L1": 4.0, "L2": 4.0},
        inputs={"n": 5.0, "v": 8.0},
        lags={"n": 15.0, "v": 10.0},
    ),
    "two_mass_drive": Struck(
        components={"Kt": -0.15, "J2": 0.4, "k": -0.35, "Tc": 0.8, "b1": 1.5},
        added={},
        sensors={"w1": 0.8, "w2": 0.8},
        inputs={"i": 0.4},
        lags={"i": 12.0},
    ),
    "battery_cell": Struck(
        components={"Q": -0.2, "R0": 0.25, "R1": 0.5, "hA": -0.35},
        added={},
        sensors={"V": 0.03, "T": 1.5},
        inputs={"I": 3.0, "T_air": 3.0},
        lags={"I": 20.0},
    ),
    "air_handling": Struck(
        components={"K_f": -0.15, "K_d": -0.25, "Q_v": -0.2, "UA": 0.3, "gain": 1.5},
        added={},
        sensors={"F": 0.07, "T_m": 1.5, "T_s": 1.5, "T_z": 1.5},
        inputs={"u_d": 8.0, "u_v": 8.0, "u_f": 8.0, "T_o": 2.5},
        lags={"u_d": 10.0, "u_v": 10.0},
    ),
    "three_tanks": Struck(
        components={"P1": -0.15, "P2": -0.15, "a13": -0.25, "a32": -0.25, "a20": -0.2},
        added={"leak1": 6e-6, "leak3": 6e-6},
        sensors={"h1": 2.0, "h3": 2.0, "h2": 2.0},
        inputs={"u1": 6.0, "u2": 6.0},
        lags={"u1": 8.0, "u2": 8.0},
    ),
}
TO_TUNE = ("heat_exchanger", "pump_skid", "two_mass_drive")  # the other three are only reported


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """What is wrong in a run. onset : when the first of it begins, s.

    truth : what a diagnosis should name, with its form and size in SI; a size of None is not asked for
    """

    kind: Kind
    changes: tuple[Change, ...]
    truth: Mapping[str, tuple[Form, float | None]]
    onset: float


def fault_of(rig: Rig, seed: int) -> Fault:
    """Give the fault of a seed."""
    kind = ORDER[seed % len(ORDER)]
    generator = np.random.default_rng([seed, crc32(rig.name.encode()), 41])
    start = 0.0 if kind is Kind.FIRST else generator.uniform(*ONSET) * rig.seconds
    changes = tuple(_change(rig, kind, group, start, generator) for group in _groups(rig, kind, generator))
    truth = {change.target: (change.form, _asked(rig, change)) for change in changes}
    return Fault(kind=kind, changes=changes, truth=truth, onset=start)


def _groups(rig: Rig, kind: Kind, generator: np.random.Generator) -> list[tuple[str, Form, float]]:
    """Draw what is struck, with the form and the usual size."""
    struck = STRUCK[rig.name]
    components = [(name, Form.FACTOR, size) for name, size in struck.components.items()]
    components += [(name, Form.SHIFT, size) for name, size in struck.added.items()]
    sensors = [(name, Form.SHIFT, size) for name, size in struck.sensors.items()]
    if kind in {Kind.MIXED, Kind.COMPONENTS, Kind.SENSORS}:
        second = sensors if kind is Kind.SENSORS else components
        first = components if kind is Kind.COMPONENTS else sensors
        one = first[generator.integers(len(first))]
        others = [item for item in second if item[0] != one[0]]
        return [one, others[generator.integers(len(others))]]
    inputs = [(name, Form.SHIFT, size) for name, size in struck.inputs.items()]
    stuck = [(name, Form.STUCK, 0.0) for name in rig.inputs]
    lags = [(name, Form.LAG, factor) for name, factor in struck.lags.items()]
    sort = kind.value.partition(":")[0]
    chosen = {"component": components, "sensor": sensors, "input": inputs}[sort]
    if kind is Kind.INPUT_STUCK:
        chosen = stuck
    elif kind is Kind.INPUT_LAG:
        chosen = lags
    return [chosen[generator.integers(len(chosen))]]


def _change(
    rig: Rig, kind: Kind, struck: tuple[str, Form, float], start: float, generator: np.random.Generator
) -> Change:
    target, form, usual = struck
    size = usual * float(generator.uniform(*SCATTER)) if form is not Form.LAG else usual
    if target not in rig.parameters and form is Form.SHIFT:
        size *= float(generator.choice([-1.0, 1.0]))
    end = start
    if kind in {Kind.RAMP, Kind.SENSOR_RAMP}:
        end = start + float(generator.uniform(*RAMP)) * rig.seconds
    elif kind in {Kind.FOULING, Kind.SENSOR_DRIFT, Kind.INPUT_DRIFT}:
        end = rig.seconds
    return Change(target=target, form=form, size=size, start=start, end=end)


def _asked(rig: Rig, change: Change) -> float | None:
    if change.form in {Form.STUCK, Form.LAG}:
        return None
    if change.target in rig.sensors:
        return change.size * rig.sensors[change.target].si
    if change.target in rig.inputs and rig.inputs[change.target].measured:
        return MEASURED * change.size
    return change.size
