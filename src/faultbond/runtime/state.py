"""What the monitor remembers, takes and gives: numbers only, of fixed size, so that it can be saved at any sample."""

from dataclasses import dataclass, fields
from enum import Enum
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.allowed import ANYTHING, COUNT, COUNT_OR_NONE, FLAG, POSITIVE, Allowed
from faultbond.runtime.bank import Bank, no_bank
from faultbond.runtime.cusum import no_sums
from faultbond.runtime.misfit import Misfit

Changes = dict[str, Any]  # fields of the state, by name
SNAPSHOTS, SNAPSHOT_EVERY = 12, 300  # how many healthy lanes are kept for long, and after how many samples each
_COUNTS = ("index", "begun", "running", "alarm", "detections", "accepted", "silent", "odd_since")


ENDLESS = Allowed(least=0.0, infinite=True)
ALLOWED = {
    **dict.fromkeys(("index", "detections", "silent"), COUNT),
    **dict.fromkeys(("begun", "alarm", "accepted", "cusum_start", "odd_since"), COUNT_OR_NONE),
    **dict.fromkeys(("running", "rejected"), FLAG),
    **dict.fromkeys(("pause", "guessed", "spent", "cusum", "fast", "misfit"), POSITIVE),
    **dict.fromkeys(("leap", "astray", "since_step", "reading_noise", "wander"), ENDLESS),
    **dict.fromkeys(("lowest", "highest", "travel", "shown"), Allowed(infinite=True)),
    **dict.fromkeys(("held", "earlier", "odd", "scatter"), Allowed(nan=True)),
    "habit": Allowed(least=0.0, most=1.0),
    "nis": POSITIVE,
    "misfit_since": COUNT,
    **dict.fromkeys(  # of filters that may have run away
        ("change", "lane", "rival", "trail_samples", "trail_lanes", "steps", "slots", "healthy"), ANYTHING
    ),
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
class State:
    """Numbers only, of fixed size; -1: not yet.

    What was accepted as the new normal: a sensor's reading is `reading_gain` times the true one plus `reading_offset`,
    with `reading_noise` times the declared variance (inf: it is no longer used); `input_offset` is added to an input
    (SI), and parameters move on at `rates` (factors per second), give or take `wander`.
    """

    index: int  # samples seen
    begun: int  # first sample with a value of every input
    running: int  # 1 once the filter runs
    alarm: int  # sample of the alarm
    detections: int  # alarms so far
    accepted: int  # sample at which a diagnosis was accepted last
    silent: int  # samples without any value, up to this one
    pause: float  # usual number of them before a sample with one; where rows are the grid, usual seconds between rows
    time: float
    held: FloatArray  # last input values
    earlier: FloatArray  # those of the sample before
    lowest: FloatArray  # least value of each input that was seen; inf: none yet
    highest: FloatArray
    nis: FloatArray  # usual square of a normalised innovation of each output while healthy; 1: as declared
    leap: FloatArray  # usual change of each input from one sample to the next, root of a mean of squares
    guessed: FloatArray  # samples since each input was told
    odd: FloatArray  # value of each input that was refused at the last sample; nan: none was
    odd_since: int  # sample at which the first of these was refused
    rival: FloatArray  # the healthy filter as it is if they are real,
    gain: float  # and by how much the readings have spoken for it, a difference of sums of squares in sd
    shown: FloatArray  # (2, n_outputs): least and greatest reading of each sensor
    spent: FloatArray  # (n_outputs,): patience with wild values that is used up
    habit: FloatArray  # part of the samples with any value in which each input is told
    travel: FloatArray  # (2, n_states): least and greatest value of each state
    astray: FloatArray  # sd of each state that is left of a gap
    since_step: FloatArray  # s since the last step of each input
    change: FloatArray  # change of each input that is still felt
    lane: FloatArray  # healthy filter
    cusum: FloatArray  # (2, n_outputs): up, down
    cusum_start: FloatArray  # (2, n_outputs): sample at which the run began
    fast: FloatArray  # (2, n_outputs): sums with the larger drift
    scatter: FloatArray  # (3, LAGS, n_outputs): sums of the scatter, where they began, last innovations in their sd
    trail_samples: FloatArray
    trail_lanes: FloatArray
    trail_times: FloatArray
    snapshots: FloatArray  # (n, n_numbers): the healthy lane every so many samples, in turn
    steps: FloatArray  # lanes of the bank
    slots: FloatArray
    misfit: FloatArray
    misfit_since: FloatArray
    healthy: FloatArray
    grown: FloatArray
    rejected: FloatArray  # (n_hypotheses,): 1 where a person has ruled it out
    normal: FloatArray  # (n_numbers, 1): the lane that was accepted last
    reading_gain: FloatArray
    reading_offset: FloatArray
    reading_noise: FloatArray
    input_offset: FloatArray
    rates: FloatArray
    wander: FloatArray

    @property
    def peak(self) -> FloatArray:
        """Largest size of each input; 0 where none was seen."""
        return np.where(self.lowest <= self.highest, np.maximum(np.abs(self.lowest), np.abs(self.highest)), 0.0)

    @property
    def bank(self) -> Bank:
        """The bank."""
        return Bank(
            steps=self.steps,
            slots=self.slots,
            misfit=Misfit(sums=self.misfit, since=self.misfit_since),
            healthy=self.healthy,
            grown=self.grown,
        )

    def save(self) -> dict[str, FloatArray]:
        """Give all numbers by name, for `numpy.savez`."""
        return {field.name: np.asarray(getattr(self, field.name), dtype=float) for field in fields(self)}

    @staticmethod
    def restore(saved: dict[str, FloatArray]) -> "State":
        """Give the state that `save` wrote."""
        numbers: dict[str, Any] = {name: int(saved[name]) for name in _COUNTS}
        numbers |= {name: float(saved[name]) for name in ("time", "pause", "gain")}
        return State(**({name: np.asarray(saved[name]) for name in saved} | numbers))


def allowed_of(spec: EngineSpec) -> dict[str, Allowed]:
    """Give what the numbers of a state may be, by name; all others are finite."""
    return ALLOWED | {"grown": Allowed(least=-1.0, most=len(spec.reserve) - 1.0, whole=True)}


def init(spec: EngineSpec, t0: float = 0.0) -> State:
    """Give the state before the first sample, at time `t0` (s)."""
    n_u, n_y, depth = len(spec.inputs), len(spec.outputs), _depth(spec)
    return State(
        index=0,
        begun=-1,
        running=0,
        alarm=-1,
        detections=0,
        accepted=-1,
        silent=0,
        pause=0.0,
        time=t0,
        held=np.full(n_u, np.nan),
        earlier=np.full(n_u, np.nan),
        lowest=np.full(n_u, np.inf),
        highest=np.full(n_u, -np.inf),
        nis=np.ones(n_y),
        leap=np.zeros(n_u),
        guessed=np.zeros(n_u),
        odd=np.full(n_u, np.nan),
        odd_since=-1,
        rival=np.zeros((spec.n_numbers, 1)),
        gain=0.0,
        shown=np.array([[np.inf], [-np.inf]]) * np.ones(n_y),
        spent=np.zeros(n_y),
        habit=np.ones(n_u),
        travel=np.array([[np.inf], [-np.inf]]) * np.ones(len(spec.states)),
        astray=np.zeros(len(spec.states)),
        since_step=np.full(n_u, np.inf),
        change=np.zeros(n_u),
        lane=np.zeros((spec.n_numbers, 1)),
        cusum=np.zeros((2, n_y)),
        cusum_start=np.zeros((2, n_y)),
        fast=np.zeros((2, n_y)),
        scatter=no_scatter(n_y),
        trail_samples=np.zeros((depth, spec.n_sample)),
        trail_lanes=np.zeros((depth, spec.n_numbers)),
        trail_times=np.zeros(depth),
        snapshots=np.zeros((SNAPSHOTS, spec.n_numbers)),
        rejected=np.zeros(spec.n_hypotheses),
        normal=np.zeros((spec.n_numbers, 1)),
        reading_gain=np.ones(n_y),
        reading_offset=np.zeros(n_y),
        reading_noise=np.ones(n_y),
        input_offset=np.zeros(n_u),
        rates=np.zeros(len(spec.parameters)),
        wander=np.zeros(len(spec.parameters)),
        **bank_fields(no_bank(spec)),
    )


def no_scatter(n_outputs: int, last: int = 0) -> FloatArray:
    """Give the sums of the scatter as they begin after sample `last`; there are no innovations yet (nan)."""
    none = no_sums(n_outputs)
    return np.array([none.scatter, np.full_like(none.scatter, last), none.before])


def bank_fields(bank: Bank) -> Changes:
    """Give a bank as fields of the state."""
    return {
        "steps": bank.steps,
        "slots": bank.slots,
        "misfit": bank.misfit.sums,
        "misfit_since": bank.misfit.since,
        "healthy": bank.healthy,
        "grown": bank.grown,
    }


def _depth(spec: EngineSpec) -> int:
    return spec.thresholds.history_samples + 2
