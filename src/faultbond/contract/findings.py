"""What a run saw, sample by sample, kept for people: the report and the terminal. Not needed by the engine."""

from dataclasses import dataclass
from enum import Enum
from html import escape

from faultbond.arrays import FloatArray
from faultbond.types import CheckKind, FaultKind

MAX_CANDIDATES = 100  # given in a diagnosis
MOST_RIVALS = 8  # of these, that are looked at for what to check next


class Decider(Enum):
    """Who accepted or rejected a candidate; the value is the word in records."""

    PERSON = "person"
    RULE = "rule"


@dataclass(frozen=True, slots=True, kw_only=True)
class Forecast:
    """When a drifting value reaches a limit (SI): early, median and late time (5 %, 50 %, 95 %), s; None: never."""

    limit: float
    time: float | None
    earliest: float | None
    latest: float | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Suspect:
    """One parameter of a candidate set, or what is wrong with a sensor or input, such as `flow.bias`; SI.

    nominal: None where there is none, as of the value at which a sensor is stuck. rate, rate_sd: of a drift, per
    second. began, ended: of a ramp, when it began to move and when it came to stay, s. forecasts: when the drift
    reaches the limits that the model file gives. moved: standard deviations by which the value has moved lately, beyond
    what its variance allows; 0: it has settled. Where it has not, sd covers that. stopped: of an input, since when its
    record stands still though it scattered before, s.
    """

    parameter: str
    component: str
    nominal: float | None
    estimate: float
    sd: float
    rate: float | None = None
    rate_sd: float | None = None
    began: float | None = None
    ended: float | None = None
    forecasts: tuple[Forecast, ...] = ()
    moved: float = 0.0
    stopped: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Candidate:
    """A tested set of suspects with its posterior probability; `group`: cannot be told from the best.

    blocks: suspected parts that have no parameter, such as gates; they behave in a way that is not known.
    kind: the likeliest kind of fault, to which the estimates belong. kinds: the probability of each kind, given that
    this is the set. present: False while a fault that comes and goes is gone. hypothesis: its number in the
    specification, if it has one. lane: number of the filter that tells of it, alike.
    """

    suspects: tuple[Suspect, ...]
    probability: float
    group: bool
    blocks: tuple[str, ...] = ()
    kind: FaultKind = FaultKind.STEP
    kinds: tuple[tuple[FaultKind, float], ...] = ()
    present: bool = True
    hypothesis: int = -1
    lane: int = -1

    @property
    def components(self) -> tuple[str, ...]:
        """Owners of the suspects and suspected blocks, each once."""
        return tuple(dict.fromkeys((*(suspect.component for suspect in self.suspects), *self.blocks)))

    @property
    def parameters(self) -> tuple[str, ...]:
        """Names of the suspects."""
        return tuple(suspect.parameter for suspect in self.suspects)


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """A parameter that the healthy filter has moved farther than its variance allows.

    sd: by how much, in standard deviations of what is usual. from_start: since the start, or what was accepted last, in
    what the declared accuracy allows; else since the onset of the alarm. together: it and others, of which it the
    farthest; sd is that of all.
    """

    parameter: str
    sd: float
    from_start: bool
    together: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Detection:
    """An alarm: raised at `time` (grid point `sample`), estimated onset `change_time`.

    signals: the sensors whose sums crossed; of an alarm that no sum raised, the sensor with the largest.
    walk: what raised an alarm of a slow fault that the healthy filter followed, or of one from the start on.
    """

    time: float
    sample: int
    change_time: float
    signals: tuple[str, ...]
    walk: Walk | None = None

    def _repr_html_(self) -> str:
        told = {"time": f"{self.time:.9g}", "sample": self.sample, "change_time": f"{self.change_time:.9g}"}
        told |= {"signals": ", ".join(self.signals)} | ({"walk": self.walk.parameter} if self.walk is not None else {})
        rows = "".join(f"<tr><th>{name}</th><td>{escape(str(value))}</td></tr>" for name, value in told.items())
        return f"<table>{rows}</table>"


@dataclass(frozen=True, slots=True, kw_only=True)
class Unexplained:
    """Where the best candidate does not fit: `signal` is off by `sd` standard deviations from `since` to `until`, s."""

    signal: str
    sd: float
    since: float
    until: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """One thing to do that would tell candidates apart.

    kind, target: a component, sensor or input to look at, an input to move, or a signal to measure by hand
    gain: bits of information about which candidate is right, as expected now. cost: as the model file states it
    separates: the components of the candidates that would still be together, group by group
    value: SI value to which the input is to be moved; None of other checks. within: s until the answer is there
    """

    kind: CheckKind
    target: str
    gain: float
    cost: float
    separates: tuple[tuple[tuple[str, ...], ...], ...]
    value: float | None = None
    within: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Untested:
    """Sets that were not tested: how many, and at most how likely it is that one is the true one; 1: no bound."""

    sets: int
    probability: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Superseded:
    """Components that were sure to be at fault until `until`, s, for so long that a person may have accepted them."""

    components: tuple[str, ...]
    until: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnosis:
    """Ranked candidates at a time, best first.

    unexplained: that none of the modelled faults explains the data. advice: what to do next, the best for its cost
    first. untested: what else it could be; None where all sets are tested. within_accuracy: probability that nothing is
    at fault but what the declared accuracy allows; of that each tested set has an even share. mismatch: probability
    that the model is off, where the alarm came by a parameter that no tested set has, or the model has alarmed on
    healthy data before. superseded: what was sure before, and is none of the likeliest any more, or did not explain the
    data since; then something else may have changed later, which is part of `mismatch`. elsewhere: parameters that
    count as healthy and are far from where they are declared, while no suspect changed, which is part of it, too.
    strained: parameters that the first candidate leaves healthy, and has to move far, part of it as well: they changed
    besides, or the model is off there. over: whether it is the last one, since the alarm is over by itself: for long
    nothing has been at fault.
    """

    time: float
    candidates: tuple[Candidate, ...]
    unexplained: Unexplained | None = None
    advice: tuple[Advice, ...] = ()
    untested: Untested | None = None
    within_accuracy: float = 0.0
    mismatch: float = 0.0
    superseded: Superseded | None = None
    elsewhere: tuple[str, ...] = ()
    strained: tuple[str, ...] = ()
    over: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """A candidate, as it stood when it was accepted or rejected at `time`.

    Accepted, it became the healthy model, and alarms since then are of other faults; or it was the fault, and was
    `repaired`, so that it is as the model file says again, and all else as known before it. Rejected, it is out until
    the next alarm. Without suspects it was accepted by rule that nothing is at fault, with the probability of that.
    """

    time: float
    candidate: Candidate
    by: Decider
    repaired: bool = False

    @property
    def is_of_nothing(self) -> bool:
        """Whether it says that nothing is at fault: the alarm is over by itself."""
        return not self.candidate.components


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class History:
    """Traces of one run for plotting, SI, one row per grid point.

    time (T,); measured, expected, expected_sd (T, n_outputs), nan where missing; inputs (T, n_inputs).
    cusum (T, n_outputs): larger side of the CUSUM of each sensor, limit `cusum_limit`.
    slow (T, n_slow): those slow errors that can alarm, in units of their declared sd; slow_limits (n_slow,), alike.
    After the detection `expected` goes on as the healthy model sees the plant, after `accepted` as the new one does.
    detections, diagnoses, accepted, rejected: all records in order. Of a run that went on from another one there are
    also the last few that were accepted before, and the last detection if it was still open, with what was rejected.
    open: the detection for which nothing was accepted yet; by order, not by time, since clocks are set back.
    missed: a while in which the best candidate did not explain the data, after it had done so; sd is the largest.
    """

    time: FloatArray
    measured: FloatArray
    expected: FloatArray
    expected_sd: FloatArray
    inputs: FloatArray
    cusum: FloatArray
    slow: FloatArray
    cusum_limit: float
    slow_limits: FloatArray
    slow_names: tuple[str, ...]
    detections: tuple[Detection, ...]
    diagnoses: tuple[Diagnosis, ...]
    accepted: tuple[Decision, ...] = ()
    rejected: tuple[Decision, ...] = ()
    open: Detection | None = None
    missed: Unexplained | None = None
