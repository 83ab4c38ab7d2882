"""What every plant of a stranger has that its model leaves out: actuators and sensors that lag, play, wandering.

A rig is stepped by Runge and Kutta's method, sample by sample; nothing of faultbond is used.
"""

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from zlib import crc32

import numpy as np

from faultbond.arrays import FloatArray

Values = Sequence[float]
Parameters = Mapping[str, float]
Command = Callable[[float, Values], Values]  # time and the readings of the row before: the inputs in their order


class Form(Enum):
    """What a fault does to its target."""

    SHIFT = "shift"  # adds to a reading, to what an input does, or to a parameter that is 0 while healthy
    FACTOR = "factor"  # changes a parameter by a part of its value
    STUCK = "stuck"  # an actuator stays where it is, a meter at what it shows
    LAG = "lag"  # an actuator becomes slower by a factor, a meter gets a time constant of so many samples


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A fault of one thing: its size grows from 0 at `start` to `size` at `end`, s; at once where these are alike.

    size : part of a parameter's value, factor or samples of a lag, or in the unit of the recording
    """

    target: str
    form: Form
    size: float = 0.0
    start: float
    end: float

    def part(self, time: FloatArray) -> FloatArray:
        """Give how much of it is there, 0 to 1, at times of shape (n,)."""
        length = max(self.end - self.start, 1e-9)
        return np.clip((time - self.start) / length, 0.0, 1.0) * (time >= self.start)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A reading: sd of its noise, what it is rounded to, its time constant in s; `si`: SI per unit."""

    noise: float
    quantum: float = 0.0
    lag: float = 0.0
    si: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Input:
    """A command whose actuator lags and has play; or, with `noise`, a measurement that the model takes as given."""

    lag: float = 0.0
    play: float = 0.0
    noise: float = 0.0
    quantum: float = 0.0
    measured: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """A plant. `begin` gives the states at the start and the operation, both drawn.

    rate : of the states, from states, acting inputs and parameters; reads : what sensors would show, from the same
    wander : by parameter, the sd of its wandering as a part of it, and its memory in s
    """

    name: str
    step: float
    rows: int
    substeps: int
    parameters: Mapping[str, float]
    wander: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    inputs: Mapping[str, Input]
    sensors: Mapping[str, Sensor]
    begin: Callable[[np.random.Generator], tuple[Values, Command]]
    rate: Callable[[Values, Values, Parameters], Values]
    reads: Callable[[Values, Values, Parameters], Values]

    @property
    def seconds(self) -> float:
        """How long a recording is."""
        return self.step * self.rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """Columns with their names, each of shape (rows,)."""

    columns: Mapping[str, FloatArray]

    def write(self, path: Path) -> None:
        """Write CSV."""
        with path.open("w", encoding="utf-8", newline="") as stream:
            table = csv.writer(stream)
            table.writerow(self.columns)
            table.writerows([f"{value:.8g}" for value in row] for row in zip(*self.columns.values(), strict=True))


def record(rig: Rig, changes: Sequence[Change], seed: int) -> Recording:
    """Simulate a rig with its faults; the seed draws operation, surroundings, wandering and noise."""
    generator = np.random.default_rng([seed, crc32(rig.name.encode())])
    time = moments(rig.rows, rig.step)
    x, command = rig.begin(generator)
    parameters = _courses(rig, changes, time, generator)
    actuators = [_Actuator(item, [c for c in changes if c.target == n], rig.step) for n, item in rig.inputs.items()]
    followers = [_Follower(item.lag, rig.step) for item in rig.sensors.values()]
    offsets = [_offset(name, changes, time) for name in rig.sensors]
    noise = [item.noise * generator.standard_normal(rig.rows) for item in rig.sensors.values()]
    quanta = [item.quantum for item in rig.sensors.values()]
    told, read = np.zeros((rig.rows, len(rig.inputs))), np.zeros((rig.rows, len(rig.sensors)))
    readings: Values = [float("nan")] * len(rig.sensors)
    for k, moment in enumerate(time):
        p = {name: float(course[k]) for name, course in parameters.items()}
        wanted = command(float(moment), readings)
        acting = [item.follow(float(moment), value) for item, value in zip(actuators, wanted, strict=True)]
        shown = [item.follow(value) for item, value in zip(followers, rig.reads(x, acting, p), strict=True)]
        readings = [
            _rounded(value + offset[k] + scatter[k], quantum)
            for value, offset, scatter, quantum in zip(shown, offsets, noise, quanta, strict=True)
        ]
        told[k], read[k] = wanted, readings
        x = _stepped(rig, x, acting, p)
    for index, (name, item) in enumerate(rig.inputs.items()):
        if item.measured:  # its instrument is wrong, not what acts
            wrong = item.noise * generator.standard_normal(rig.rows) + _offset(name, changes, time)
            meter = _metered(told[:, index] + wrong, [c for c in changes if c.target == name], time)
            told[:, index] = [_rounded(float(value), item.quantum) for value in meter]
    inputs = dict(zip(rig.inputs, told.T, strict=True))
    return Recording(columns={"time": time, **inputs, **dict(zip(rig.sensors, read.T, strict=True))})


def moments(rows: int, step: float) -> FloatArray:
    """Give the times of all rows, s."""
    return np.linspace(0.0, step * (rows - 1), rows)


def wandering(time: FloatArray, memory: float, generator: np.random.Generator) -> FloatArray:
    """Give a course of sd 1 that forgets with a time constant, at times of shape (n,)."""
    keep = np.exp(-(time[1] - time[0]) / memory)
    white = generator.standard_normal(time.size)
    course = np.empty(time.size)
    course[0] = white[0]
    for k in range(1, time.size):
        course[k] = keep * course[k - 1] + np.sqrt(1.0 - keep**2) * white[k]
    return course


def levels(
    generator: np.random.Generator, low: float, high: float, hold: tuple[float, float], seconds: float
) -> Callable[[float], float]:
    """Give a signal that steps to another level between `low` and `high` after a while, drawn within `hold`, s."""
    count = int(seconds / hold[0]) + 2
    edges = np.cumsum(generator.uniform(*hold, count))
    heights = generator.uniform(low, high, count + 1)
    return lambda time: float(heights[np.searchsorted(edges, time, side="right")])


def _courses(
    rig: Rig, changes: Sequence[Change], time: FloatArray, generator: np.random.Generator
) -> dict[str, FloatArray]:
    courses = {}
    for name, value in rig.parameters.items():
        course = np.full(time.size, value)
        if name in rig.wander:
            part, memory = rig.wander[name]
            course = course * (1.0 + part * wandering(time, memory, generator))
        for item in (c for c in changes if c.target == name):
            amount = item.size * item.part(time)
            course = course * (1.0 + amount) if item.form is Form.FACTOR else course + amount
        courses[name] = course
    return courses


def _offset(name: str, changes: Sequence[Change], time: FloatArray) -> FloatArray:
    shifts = (c for c in changes if c.target == name and c.form is Form.SHIFT)
    return sum((c.size * c.part(time) for c in shifts), np.zeros(time.size))


def _metered(values: FloatArray, changes: Sequence[Change], time: FloatArray) -> FloatArray:
    """Give what a meter shows that stays where it is, or lags, from some moment on; values of shape (n,)."""
    shown = values.copy()
    for item in (c for c in changes if c.form in {Form.STUCK, Form.LAG}):
        keep = 1.0 if item.form is Form.STUCK else np.exp(-1.0 / item.size)
        for k in range(max(int(np.searchsorted(time, item.start)), 1), time.size):
            shown[k] = keep * shown[k - 1] + (1.0 - keep) * values[k]
    return shown


def _rounded(value: float, quantum: float) -> float:
    return round(value / quantum) * quantum if quantum else float(value)


def _stepped(rig: Rig, x: Values, u: Values, p: Parameters) -> Values:
    h = rig.step / rig.substeps
    for _ in range(rig.substeps):
        k1 = rig.rate(x, u, p)
        k2 = rig.rate([a + 0.5 * h * b for a, b in zip(x, k1, strict=True)], u, p)
        k3 = rig.rate([a + 0.5 * h * b for a, b in zip(x, k2, strict=True)], u, p)
        k4 = rig.rate([a + h * b for a, b in zip(x, k3, strict=True)], u, p)
        x = [v + h / 6.0 * (a + 2.0 * b + 2.0 * c + d) for v, a, b, c, d in zip(x, k1, k2, k3, k4, strict=True)]
    return x


class _Follower:
    """A lag of first order."""

    def __init__(self, lag: float, step: float) -> None:
        self.lag, self.step = lag, step
        self.value: float | None = None

    def follow(self, target: float) -> float:
        part = 1.0 if self.lag <= 0.0 or self.value is None else 1.0 - np.exp(-self.step / self.lag)
        self.value = target if self.value is None else self.value + part * (target - self.value)
        return float(self.value)


class _Actuator:
    """What an input does: its play, its lag, and its faults."""

    def __init__(self, item: Input, changes: Sequence[Change], step: float) -> None:
        self.item, self.changes = item, () if item.measured else changes
        self.follower, self.held, self.last = _Follower(item.lag, step), float("nan"), float("nan")

    def follow(self, time: float, wanted: float) -> float:
        target = wanted
        for change in self.changes:
            part = float(change.part(np.array([time]))[0])
            if change.form is Form.STUCK and part:
                return self.last
            if change.form is Form.LAG and part:
                self.follower.lag = self.item.lag * change.size
            elif change.form is Form.SHIFT:
                target += part * change.size
        if not abs(target - self.held) <= self.item.play:
            self.held = target
        self.last = self.follower.follow(self.held)
        return self.last
