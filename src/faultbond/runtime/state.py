"""What the monitor remembers, takes and gives: numbers only, of fixed size, so that it can be saved at any sample."""

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.allowed import ANYTHING, COUNT, COUNT_OR_NONE, FLAG, POSITIVE, Allowed
from faultbond.runtime.bank import Bank, no_bank
from faultbond.runtime.cusum import no_sums
from faultbond.runtime.trail import Past, past_of

SNAPSHOTS, SNAPSHOT_EVERY = 12, 300  # how many healthy lanes are kept for long, and after how many samples each

ENDLESS = Allowed(least=0.0, infinite=True)
ALLOWED = {  # of the numbers of a saved state, by name; all others are finite
    **dict.fromkeys(("clock.index", "clock.detections", "clock.silent"), COUNT),
    **dict.fromkeys(("clock.begun", "clock.alarm", "clock.accepted", "inputs.odd_since"), COUNT_OR_NONE),
    **dict.fromkeys(("sensors.cusum_start", "sensors.scatter_start"), COUNT_OR_NONE),
    **dict.fromkeys(("clock.running", "bank.rejected"), FLAG),
    **dict.fromkeys(("clock.pause", "inputs.guessed", "bank.misfit.sums"), POSITIVE),
    **dict.fromkeys((f"sensors.{name}" for name in ("spent", "nis", "cusum", "fast", "scatter")), POSITIVE),
    **dict.fromkeys(("inputs.leap", "inputs.since_step", "healthy.astray", "normal.noise", "normal.wander"), ENDLESS),
    **dict.fromkeys(("inputs.lowest", "inputs.highest", "sensors.shown", "healthy.travel"), Allowed(infinite=True)),
    **dict.fromkeys(("inputs.held", "inputs.earlier", "inputs.odd", "sensors.before"), Allowed(nan=True)),
    "inputs.habit": Allowed(least=0.0, most=1.0),
    "bank.misfit.since": COUNT,
    **dict.fromkeys(  # of filters that may have run away
        ("inputs.change", "inputs.rival", "healthy.lane", "past.samples", "past.lanes", "past.wildness"), ANYTHING
    ),
    **dict.fromkeys(("bank.steps", "bank.slots", "bank.healthy"), ANYTHING),
}


class Status(Enum):
    """What the monitor is doing; the value is the message."""

    WAITING = "waiting for a first value of every input"
    STARTING = "gathering samples to solve the start"
    WARMING = "learning the parameters; alarms are off"
    WATCHING = "watching"
    DIAGNOSING = "a fault was detected; the bank is running"
    LOST = "the healthy filter lost the plant; it starts anew"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """One grid point: `time` and `dt` since the one before (s), `u` (n_inputs,), `y` (n_outputs,); SI; nan: missing."""

    time: float
    dt: float
    u: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """What one sample brought. Arrays are per output; `slow` is per slow error, in declared sd.

    wild : values that were refused, or cut, since they lie far beyond all that was seen
    """

    status: Status
    expected: FloatArray
    variance: FloatArray
    cusum: FloatArray
    slow: FloatArray
    wild: int = 0
    detection: Detection | None = None
    diagnosis: Diagnosis | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Clock:
    """Where the run stands, in samples; -1: not yet."""

    index: int = 0  # samples seen
    begun: int = -1  # first sample with a value of every input
    running: int = 0  # 1 once the filter runs
    alarm: int = -1  # sample of the alarm
    detections: int = 0  # alarms so far
    accepted: int = -1  # sample at which a diagnosis was accepted last
    silent: int = 0  # samples without any value, up to this one
    pause: float = 0.0  # usual number of them before a sample with one; where rows are the grid, usual s between rows
    time: float = 0.0  # s


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InputMemory:
    """What is known of the inputs, (n_inputs,) each, SI."""

    held: FloatArray  # last values
    earlier: FloatArray  # those of the sample before
    lowest: FloatArray  # least value that was seen; inf: none yet
    highest: FloatArray
    leap: FloatArray  # usual change from one sample to the next, root of a mean of squares
    guessed: FloatArray  # samples since each was told
    habit: FloatArray  # part of the samples with any value in which each is told
    since_step: FloatArray  # s since the last step
    change: FloatArray  # change that is still felt
    odd: FloatArray  # value that was refused at the last sample; nan: none was
    odd_since: int  # sample at which the first of these was refused
    rival: FloatArray  # (n_numbers, 1): the healthy filter as it is if they are real,
    gain: float  # and by how much the readings have spoken for it, a difference of sums of squares in sd

    @property
    def peak(self) -> FloatArray:
        """Largest size of each input; 0 where none was seen."""
        return np.where(self.lowest <= self.highest, np.maximum(np.abs(self.lowest), np.abs(self.highest)), 0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SensorMemory:
    """What is known of the sensors, and the sums of the detector, see `faultbond.runtime.cusum.Sums`."""

    shown: FloatArray  # (2, n_outputs): least and greatest reading, SI
    spent: FloatArray  # (n_outputs,): patience with wild values that is used up
    nis: FloatArray  # (n_outputs,): usual square of a normalised innovation while healthy; 1: as declared
    cusum: FloatArray  # (2, n_outputs): slow sums, up and down
    cusum_start: FloatArray  # (2, n_outputs): sample at which each began to grow
    fast: FloatArray  # (2, n_outputs): sums with the larger drift
    scatter: FloatArray  # (LAGS, n_outputs): sums of the scatter
    scatter_start: FloatArray
    before: FloatArray  # (LAGS, n_outputs): last innovations in their sd, the newest first


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Healthy:
    """The healthy filter."""

    lane: FloatArray  # (n_numbers, 1)
    travel: FloatArray  # (2, n_states): least and greatest value of each state
    astray: FloatArray  # (n_states,): sd that is left of a gap
    snapshots: FloatArray  # (SNAPSHOTS, n_numbers): the lane every so many samples, in turn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Normal:
    """What was accepted as the new normal.

    A sensor's reading is `gain` times the true one plus `offset`, with `noise` times the declared variance (inf: it is
    no longer used); `input_offset` is added to an input (SI), and parameters move on at `rates` (factors per second),
    give or take `wander`.
    """

    lane: FloatArray  # (n_numbers, 1): the one that was accepted last
    gain: FloatArray  # (n_outputs,)
    offset: FloatArray
    noise: FloatArray
    input_offset: FloatArray  # (n_inputs,)
    rates: FloatArray  # (n_parameters,)
    wander: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class State:
    """All that the monitor remembers."""

    clock: Clock
    inputs: InputMemory
    sensors: SensorMemory
    healthy: Healthy
    past: Past
    bank: Bank
    normal: Normal

    def save(self) -> dict[str, FloatArray]:
        """Give all numbers by name, such as `clock.index`, for `numpy.savez`."""
        return dict(_named(self, ""))

    @staticmethod
    def restore(saved: Mapping[str, FloatArray]) -> "State":
        """Give the state that `save` wrote."""
        state: State = _restored(State, saved, "")
        return state


def _named(part: Any, place: str) -> list[tuple[str, FloatArray]]:
    """Give the numbers of a part of the state, by name."""
    if isinstance(part, Past):
        columns = {"samples": part.samples, "lanes": part.lanes, "times": part.times, "wildness": part.wildness}
        return [(place + name, values.copy()) for name, values in columns.items()]
    found: list[tuple[str, FloatArray]] = []
    for field in fields(part):
        value = getattr(part, field.name)
        inner = is_dataclass(value)
        found += _named(value, f"{place}{field.name}.") if inner else [(place + field.name, np.asarray(value, float))]
    return found


def _restored(kind: Any, saved: Mapping[str, FloatArray], place: str) -> Any:
    """Give a part of the state of a kind with the saved numbers, those that are no arrays as what they are."""
    if kind is Past:
        columns = [saved[place + name] for name in ("samples", "lanes")]
        columns += [saved[place + name][:, None] for name in ("times", "wildness")]
        return past_of(np.concatenate(columns, axis=1), int(saved["clock.index"]) - 1, columns[0].shape[1])
    found: dict[str, Any] = {}
    for field in fields(kind):
        name = place + field.name
        if is_dataclass(field.type):
            found[field.name] = _restored(field.type, saved, f"{name}.")
        else:
            found[field.name] = field.type(saved[name]) if field.type in (int, float) else np.asarray(saved[name])
    return kind(**found)


def allowed_of(spec: EngineSpec) -> dict[str, Allowed]:
    """Give what the numbers of a saved state may be, by name; all others are finite."""
    return ALLOWED | {"bank.grown": Allowed(least=-1.0, most=len(spec.reserve) - 1.0, whole=True)}


def init(spec: EngineSpec, t0: float = 0.0) -> State:
    """Give the state before the first sample, at time `t0` (s)."""
    n_u, n_y, n_p, n_x = len(spec.inputs), len(spec.outputs), len(spec.parameters), len(spec.states)
    depth, width = spec.thresholds.history_samples + 2, spec.n_sample + spec.n_numbers + 2
    nowhere = np.array([[np.inf], [-np.inf]])
    return State(
        clock=Clock(time=t0),
        inputs=InputMemory(
            held=np.full(n_u, np.nan),
            earlier=np.full(n_u, np.nan),
            lowest=np.full(n_u, np.inf),
            highest=np.full(n_u, -np.inf),
            leap=np.zeros(n_u),
            guessed=np.zeros(n_u),
            habit=np.ones(n_u),
            since_step=np.full(n_u, np.inf),
            change=np.zeros(n_u),
            odd=np.full(n_u, np.nan),
            odd_since=-1,
            rival=np.zeros((spec.n_numbers, 1)),
            gain=0.0,
        ),
        sensors=SensorMemory(
            shown=nowhere * np.ones(n_y), spent=np.zeros(n_y), nis=np.ones(n_y), **no_detector_sums(n_y)
        ),
        healthy=Healthy(
            lane=np.zeros((spec.n_numbers, 1)),
            travel=nowhere * np.ones(n_x),
            astray=np.zeros(n_x),
            snapshots=np.zeros((SNAPSHOTS, spec.n_numbers)),
        ),
        past=past_of(np.zeros((depth, width)), -1, spec.n_sample),
        bank=no_bank(spec),
        normal=Normal(
            lane=np.zeros((spec.n_numbers, 1)),
            gain=np.ones(n_y),
            offset=np.zeros(n_y),
            noise=np.ones(n_y),
            input_offset=np.zeros(n_u),
            rates=np.zeros(n_p),
            wander=np.zeros(n_p),
        ),
    )


def no_detector_sums(n_outputs: int, last: int = 0) -> dict[str, FloatArray]:
    """Give the sums of `Sensors` as they begin after sample `last`."""
    none = no_sums(n_outputs)
    return {
        "cusum": none.slow,
        "cusum_start": np.full_like(none.slow, last),
        "fast": none.fast,
        "scatter": none.scatter,
        "scatter_start": np.full_like(none.scatter, last),
        "before": none.before,
    }
