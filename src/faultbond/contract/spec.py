"""The contract between the off-line and the on-line part: `EngineSpec` (what) and `Engine` (how, arrays only).

A *lane* is one filter: the healthy one, or one start of one hypothesis. All lanes run the same code on different
numbers (thesis 4.5; hypotheses are data). The joint vector of a lane is

    z = [plant states | slow errors | parameters in units of their scale | input noise]

and its numbers are one column of an array of shape (n_numbers, n_lanes): z, the packed upper triangle of its
covariance P (row by row), the last solutions of implicit relations, and the log-likelihood.

A *slot lane* (`EngineSpec.slotted`) has two more coordinates before the input noise, the size `d` of one more fault and
its rate `r`, d' = r, r' = -fades_role * r, and, before the likelihood, roles: constants that say on what d acts.

    theta + theta_role * d        u * (obeys_role + input_gain_role * d) + input_role * d
    y = h * (reads_role + gain_role * d) + bias_role * d

Where `keeps_role` is 1 a store keeps its content while d moves its parameter: its state x, an effort or a flow, goes
with theta to the power of its jump. Where `moves_role` is 0, r is no rate but the bias of one more instrument, and acts
as input_beside_role and bias_beside_role say. The noise variance of each sensor is `noise_role` times that declared. So
drifts, faults that come and go, and faults of sensors and inputs, two at once, are data too.
"""

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import combinations
from math import inf
from typing import Protocol

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.types import CheckKind, Hold


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowErrorSpec:
    """An Ornstein-Uhlenbeck error, or what wanders, in engine units (relative ones: 1 = 100 %)."""

    name: str
    sd: float
    memory: float  # seconds
    limit: float  # in its declared sizes, beyond which it alarms; infinite: it never does
    wanders: bool = False  # it is of a parameter
    after: tuple[tuple[int, float], ...] = ()  # (input, sd per SI of change)
    output: int = -1  # sensor to whose reading it adds; -1: none

    @property
    def alarms(self) -> bool:
        """Whether it alarms when it leaves its declared size by far."""
        return self.limit < inf

    @property
    def words(self) -> str:
        """What it is, with the name of what it is of."""
        return f"{'wander' if self.wanders else 'slow error'} of {self.name}"


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterSpec:
    """A parameter as the engine sees it: value = scale * factor; factor is 1 (or 0) at nominal."""

    name: str
    component: str
    nominal: float
    scale: float
    accuracy: float  # in factors
    change: float  # in factors
    lower: float  # in factors
    upper: float  # in factors
    suspect: bool
    unit: str
    unit_factor: float
    limits: tuple[float, ...] = ()  # SI; forecasts say when a drift reaches them
    least: float = -inf  # what a fault may do, in factors; the filters let estimates scatter from lower to upper
    most: float = inf
    healthy_change: float = 0.0  # in factors; 0: not known
    settling: float = 0.0  # seconds, of inputs that a sensor feels at once which feels this at once, too; the longest
    lag: float = 0.0  # time constant, s, of inputs that such a sensor would feel at once without it; the longest

    @property
    def healthy(self) -> float:
        """Factor at nominal: 1, or 0 where the nominal is 0."""
        return 0.0 if self.nominal == 0.0 else 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class InputSpec:
    """An input; the engine gets it in SI."""

    name: str
    noise: float
    settling: float  # seconds
    step: float  # a larger change from row to row is a step, if it is also
    step_part: float  # larger than this part of the largest value seen
    lag: float = 0.0  # time constant, s, where a sensor would feel it at once without it
    suspect: bool = True
    hidden: bool = False  # whether it is none since an unknown input may do all that a fault of it does
    unit: str = ""
    unit_factor: float = 1.0
    unit_offset: float = 0.0  # of its unit, such as 273.15 for degC; where there is one, 0 means nothing
    ranged: bool = False  # whether the model states what it can be, so that nothing else is called wild
    hold: Hold = Hold.LAST  # what it is between two samples
    smooth: bool = False  # whether its noise is that of the record, and what acts is smooth
    healthy_bias: float = 0.0  # by which it seems to be off on healthy data, SI; 0: not known
    factor: int = -1  # the parameter with which alone it acts; -1: none
    term: int = -1  # the parameter that acts as it does; -1: none
    term_part: float = 0.0  # how much of that, in its scales, one of it is, SI
    fitted_range: tuple[float, float] = (-inf, inf)  # where it was in the recordings of a fit, SI
    ends: tuple[float, float] = (-inf, inf)  # between which it can be, SI

    @property
    def linear(self) -> bool:
        """Whether it goes linearly from sample to sample; else it is held."""
        return self.hold is Hold.LINEAR

    @property
    def percent(self) -> bool:
        """Whether it is a percentage, from 0 to 100."""
        return self.unit == "percent"


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputSpec:
    """A sensor; the engine gives and takes SI."""

    name: str
    noise: float
    direct_inputs: tuple[int, ...]  # inputs that reach this output at once, or but for a lag where they have `settling`
    unit: str
    unit_factor: float
    unit_offset: float
    suspect: bool = True
    hidden: bool = False  # as of an input
    ranged: bool = False  # as of an input
    condition: int = -1  # under which it reads as stated, among `EngineSpec.settlings`; -1: always
    lag_states: tuple[int, ...] = ()  # the states by which it lags
    growth: float = 0.0  # of the noise, in that of a reading of 0, per SI of what is expected
    healthy_bias: float = 0.0  # as of an input


@dataclass(frozen=True, slots=True, kw_only=True)
class Instrument:
    """A sensor (`is_output`) or an input that may be at fault; `index` among those of its kind."""

    name: str
    is_output: bool
    index: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckSpec:
    """Something that a person can check, and what it costs; `noise` of a signal and `move` of an input in SI.

    An input with a move of 0 cannot be moved.
    """

    name: str
    kind: CheckKind
    cost: float
    noise: float = 0.0
    move: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Thresholds:
    """Settings of detection and ranking; `check` prints them, docs/method.md explains them."""

    cusum_drift: float = 0.3
    cusum_limit: float = 26.0
    cusum_clip: float = 3.0
    fast_drift: float = 1.0
    fast_limit: float = 1000.0
    scatter_ratio: float = 2.5
    scatter_limit: float = 50.0
    learning_bound: float = 6.0
    bank_bound: float = 20.0
    cost_per_suspect: float = 5.0
    cost_per_sensor: float = 4.0
    group_nats: float = 3.0
    blank_factor: float = 1e4
    warm_up_samples: int = 20
    history_samples: int = 330


@dataclass(frozen=True, slots=True, kw_only=True)
class StateSpec:
    """A plant state and what is known of its start (SI); `start_sd` None: solved from the first samples.

    follows: the input whose lag it is; it then begins about where that is first. -1: none. usual: its size in a plant
    in use at the most, SI; 0: nobody knows, or no sensor would notice it. reach: the same where inputs are known as
    they are in use, else 0.
    """

    name: str
    start_mean: float
    start_sd: float | None
    noise: float  # process noise sd per sample
    drift: float = 0.0  # sd for each sample of a gap: after it a sensor will be off by about its noise
    jumps: tuple[tuple[int, float], ...] = ()  # (parameter, exponent): times factor**exponent where the content stays
    follows: int = -1
    usual: float = 0.0
    reach: float = 0.0


@dataclass(frozen=True, kw_only=True)  # no slots: what follows from the fields is worked out once
class EngineSpec:
    """Everything the run time needs to know of a model; names, order, hypotheses, thresholds, hash."""

    model: str
    model_sha256: str
    version: str
    sample_time: float | None  # None: variable
    states: tuple[StateSpec, ...]
    slow_errors: tuple[SlowErrorSpec, ...]
    parameters: tuple[ParameterSpec, ...]
    inputs: tuple[InputSpec, ...]
    outputs: tuple[OutputSpec, ...]
    loops: tuple[float, ...]  # first guesses of implicitly solved signals
    hypotheses: tuple[tuple[int, ...], ...]  # sets of parameter indices
    thresholds: Thresholds
    explain_anything: tuple[tuple[int, ...], ...] = ()  # sets that no data can contradict; not tested
    reserve: tuple[tuple[int, ...], ...] = ()  # testable sets, too many to be tested at once; the likeliest are, later
    checks: tuple[CheckSpec, ...] = ()
    slot: bool = False  # whether lanes have the slot for one more fault
    coupled: bool = False  # whether faults of instruments, and drifts, are tested beside a parameter that changed
    settlings: tuple[float, ...] = ()  # of each condition of `valid_when`, seconds
    condition: int = -1  # of these, under which the model holds; -1: always
    correlations: tuple[tuple[int, int, float], ...] = ()  # of parameters while healthy, in factors; each pair once
    row_time: float | None = None  # seconds between rows, of which those about a sample are averaged; None: none is
    false_alarms: int = 0  # that the model is known to have raised on healthy data

    def __hash__(self) -> int:
        return self._hash

    @cached_property
    def _hash(self) -> int:
        """Hash of all fields: plans are looked up by specification, many times for a ranking."""
        return hash(tuple(getattr(self, field.name) for field in fields(self)))

    @cached_property
    def slotted(self) -> "EngineSpec":
        """The same for lanes with a slot."""
        return replace(self, slot=True)

    @cached_property
    def instruments(self) -> tuple[Instrument, ...]:
        """Sensors, then inputs, that are suspects; their hypotheses follow those of the parameters."""
        outputs = ((k, item.name, True) for k, item in enumerate(self.outputs) if item.suspect)
        inputs = ((k, item.name, False) for k, item in enumerate(self.inputs) if item.suspect)
        return tuple(Instrument(name=name, is_output=out, index=k) for k, name, out in (*outputs, *inputs))

    @property
    def n_begun(self) -> int:
        """Hypotheses that are tested from the alarm on: sets of parameters, and instruments."""
        return len(self.hypotheses) + len(self.instruments)

    @property
    def n_hypotheses(self) -> int:
        """All hypotheses: those tested from the alarm on, in reserve, instruments with a parameter, two instruments."""
        return self.n_begun + len(self.reserve) + len(self.mixed) + len(self.both)

    @cached_property
    def mixed(self) -> tuple[tuple[int, int], ...]:
        """Instrument, among `instruments`, and parameter that may be at fault together."""
        if not self.coupled:
            return ()
        suspects = sorted({index for chosen in (*self.hypotheses, *self.reserve) for index in chosen})
        return tuple((k, index) for k in range(len(self.instruments)) for index in suspects)

    @cached_property
    def both(self) -> tuple[tuple[int, int], ...]:
        """Two instruments, among `instruments`, that may be at fault together."""
        return tuple(combinations(range(len(self.instruments)), 2)) if self.coupled else ()

    @cached_property
    def reserve_costs(self) -> FloatArray:
        """Cost of the suspects of each set in reserve, (n_sets,), nats."""
        return _still(self.thresholds.cost_per_suspect * np.array([float(len(chosen)) for chosen in self.reserve]))

    @cached_property
    def parts(self) -> tuple[str, ...]:
        """What a person can look at, each once: components that own a parameter, inputs, sensors."""
        owners = (item.component for item in self.parameters)
        return tuple(
            dict.fromkeys((*owners, *(item.name for item in self.inputs), *(item.name for item in self.outputs)))
        )

    def checked(self, kind: CheckKind) -> dict[str, CheckSpec]:
        """Give what the model file says of the checks of a kind, by name, in order."""
        return {item.name: item for item in self.checks if item.kind is kind}

    def members(self, hypothesis: int) -> tuple[int, ...]:
        """Give the parameters of a hypothesis; none of an instrument."""
        if hypothesis < len(self.hypotheses):
            return self.hypotheses[hypothesis]
        if hypothesis < self.n_begun:
            return ()
        row = hypothesis - self.n_begun
        if row < len(self.reserve):
            return self.reserve[row]
        mixed = row - len(self.reserve)
        return (self.mixed[mixed][1],) if mixed < len(self.mixed) else ()

    def instruments_in(self, hypothesis: int) -> tuple[Instrument, ...]:
        """Give the sensors and inputs of a hypothesis; none where it has parameters only."""
        row, mixed = hypothesis - len(self.hypotheses), hypothesis - self.n_begun - len(self.reserve)
        if mixed >= len(self.mixed):
            return tuple(self.instruments[k] for k in self.both[mixed - len(self.mixed)])
        if mixed >= 0:
            return (self.instruments[self.mixed[mixed][0]],)
        return (self.instruments[row],) if 0 <= row < len(self.instruments) else ()

    @cached_property
    def n_joint(self) -> int:
        """Length of the joint vector z."""
        return int(self.slot_slice.stop) + len(self.noisy_inputs)

    @cached_property
    def noisy_inputs(self) -> tuple[int, ...]:
        """Indices of inputs with declared noise."""
        return tuple(k for k, item in enumerate(self.inputs) if item.noise > 0.0)

    @cached_property
    def smooth_inputs(self) -> tuple[int, ...]:
        """Which of the inputs with noise are smooth, so that only their records scatter."""
        return tuple(k for k, index in enumerate(self.noisy_inputs) if self.inputs[index].smooth)

    @cached_property
    def input_variance(self) -> FloatArray:
        """Variance of the noise of each input that has some, where it is white, shape (n_noisy,), SI."""
        return _still(np.array([self.inputs[k].noise ** 2 for k in self.noisy_inputs]))

    @cached_property
    def output_noise(self) -> FloatArray:
        """Noise sd of each output, shape (n_outputs,), SI."""
        return _still(np.array([output.noise for output in self.outputs]))

    @cached_property
    def slow_limits(self) -> FloatArray:
        """Limit of each slow error in its declared sd, shape (n_slow_errors,)."""
        return _still(np.array([item.limit for item in self.slow_errors]))

    @cached_property
    def slow_watched(self) -> FloatArray:
        """Time for which each slow error is watched before it may alarm, s, shape (n_slow_errors,)."""
        return _still(np.array([0.0 if item.wanders else item.memory for item in self.slow_errors]))

    @property
    def stated_variances(self) -> FloatArray:
        """Variances of stated starts, (n_states,); contents are stated, so parameters of the stores count too."""
        found = []
        for item in self.states:
            slope = np.zeros(len(self.parameters))
            for j, power in item.jumps:
                slope[j] = item.start_mean * power
            found.append((item.start_sd or 0.0) ** 2 + float(slope @ self.prior @ slope))
        return np.array(found)

    @cached_property
    def prior(self) -> FloatArray:
        """Declared covariance of the healthy parameters, shape (n_parameters, n_parameters), in factors."""
        return _still(covariance_of(np.array([item.accuracy for item in self.parameters]), self.correlations))

    @cached_property
    def slow_sizes(self) -> FloatArray:
        """Declared sd of each slow error, shape (n_slow_errors,)."""
        return _still(np.array([error.sd for error in self.slow_errors]))

    @cached_property
    def n_packed(self) -> int:
        """Length of the packed covariance triangle."""
        return self.n_joint * (self.n_joint + 1) // 2

    @cached_property
    def n_numbers(self) -> int:
        """Numbers per lane."""
        return int(self.loop_slice.stop) + self.n_roles + 1

    @cached_property
    def slow_slice(self) -> slice:
        """Where the slow errors stand in z."""
        return slice(len(self.states), len(self.states) + len(self.slow_errors))

    @cached_property
    def parameter_slice(self) -> slice:
        """Where the parameters stand in z."""
        first = len(self.states) + len(self.slow_errors)
        return slice(first, first + len(self.parameters))

    @cached_property
    def slot_slice(self) -> slice:
        """Where size and rate of the fault in the slot stand in z; empty without a slot."""
        first = self.parameter_slice.stop
        return slice(first, first + 2 * self.slot)

    @cached_property
    def noise_slice(self) -> slice:
        """Where the input noise stands in z."""
        return slice(self.n_joint - len(self.noisy_inputs), self.n_joint)

    @cached_property
    def covariance_slice(self) -> slice:
        """Where the packed covariance stands in a lane."""
        return slice(self.n_joint, self.n_joint + self.n_packed)

    @cached_property
    def loop_slice(self) -> slice:
        """Where the last solutions of implicit relations stand in a lane."""
        first = self.n_joint + self.n_packed
        return slice(first, first + len(self.loops))

    @cached_property
    def role_fields(self) -> dict[str, slice]:
        """Where the roles of the slot stand in a lane, by name.

        theta, input, obeys, input_gain, reads, gain, bias, noise, moves, input_beside, bias_beside; fades, 1/s; keeps:
        whether stores keep their content; ended, took: of a ramp that has come to its end, when it did and after how
        long, s; returns: of a fault that comes and goes the probability that it has been there and gone.
        """
        n_y = len(self.outputs)
        sizes = {
            "theta": len(self.parameters),
            "input": len(self.inputs),
            "obeys": len(self.inputs),
            "input_gain": len(self.inputs),
            "reads": n_y,
            "gain": n_y,
            "bias": n_y,
            "noise": n_y,
            "moves": 1,
            "fades": 1,
            "keeps": 1,
            "input_beside": len(self.inputs),
            "bias_beside": n_y,
            "ended": 1,
            "took": 1,
            "returns": 1,
        }
        return _fields(sizes, self.loop_slice.stop) if self.slot else {}

    @cached_property
    def n_roles(self) -> int:
        """Number of roles."""
        return int(self.role_fields["returns"].stop - self.loop_slice.stop) if self.slot else 0

    def moves_store(self, index: int) -> bool:
        """Tell whether a store has this parameter: its state jumps with a factor of it where its content stays."""
        mine = (place for item in self.states for place, _ in item.jumps)
        return index in mine and self.parameters[index].healthy != 0.0

    @property
    def held(self) -> tuple[int, ...]:
        """Sensors that have a condition of their own: what one of them lags by is followed only where it holds."""
        return tuple(k for k, item in enumerate(self.outputs) if item.condition >= 0)

    @property
    def held_states(self) -> tuple[tuple[int, int], ...]:
        """States by which such sensors lag, each with the number of the sensor among them."""
        return tuple((state, h) for h, k in enumerate(self.held) for state in self.outputs[k].lag_states)

    @cached_property
    def sample_fields(self) -> dict[str, slice]:
        """Layout of one packed sample: dt, inputs, readings and how far they count, what stays, what variances gain."""
        sizes = {
            "dt": 1,  # s since the previous sample
            "u_before": len(self.inputs),  # at the previous sample
            "u": len(self.inputs),
            "y": len(self.outputs),
            "use": len(self.outputs),  # 1: use this value, 0: it is missing
            "scale": len(self.outputs),  # factor on the measurement variance
            "kick": len(self.slow_errors),  # variance added to a slow error
            "gap": len(self.states),  # sd that each state gains, since nobody saw what acted before this sample
            "again": 1,  # 1: update a second time, linearised at the first result
            "bound": 1,  # innovations count up to so many standard deviations; 0: without bound
            "nis": len(self.outputs),  # usual square of a normalised innovation, for likelihoods; 0: as declared, 1
            "run": len(self.outputs),  # and their variance over long runs; less counts as that square, or 1
            "held": len(self.held),  # 1: a sensor does not read as stated, and what it lags by is not followed
            "still": 1,  # 1: the states stay, since the model did not hold before this sample; 2: it does not now
            "fade": len(self.noisy_inputs),  # part of the error of each that is still there, 0 where it is white
            "fresh": len(self.noisy_inputs),  # and variance that it gains
        }
        return _fields(sizes, 0)

    @cached_property
    def n_sample(self) -> int:
        """Length of one packed sample."""
        return int(self.sample_fields["fresh"].stop)


SPEC_CLASSES = (EngineSpec, StateSpec, SlowErrorSpec, ParameterSpec, InputSpec, OutputSpec, CheckSpec, Thresholds)


class Engine(Protocol):
    """Runs lanes over samples. Pure: the arguments are not changed."""

    @property
    def title(self) -> str:
        """What it is, in words, for the user."""

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes over a block of samples.

        Parameters
        ----------
        lanes : float array, shape (n_numbers, n_lanes)
        samples : float array, shape (n_samples, n_sample); layout `EngineSpec.sample_fields`, SI

        Returns
        -------
        lanes : float array, shape (n_numbers, n_lanes)
        innovations : float array, shape (n_samples, 2 * n_outputs, n_lanes)
            Per sample: measured minus predicted output for each output, then the variance of each of these
            differences; SI.
        """


def _fields(sizes: dict[str, int], first: int) -> dict[str, slice]:
    """Give the place of each field, one after the other."""
    fields = {}
    for name, size in sizes.items():
        fields[name] = slice(first, first + size)
        first += size
    return fields


def covariance_of(sds: FloatArray, correlations: Iterable[tuple[int, int, float]]) -> FloatArray:
    """Give the covariance (n, n) of standard deviations (n,) and correlations of some pairs of them."""
    together = np.eye(len(sds))
    for one, other, value in correlations:
        together[one, other] = together[other, one] = value
    return np.asarray(together * np.outer(sds, sds))


def root_of(sds: FloatArray, correlations: Iterable[tuple[int, int, float]]) -> FloatArray:
    """Give a lower triangle L (n, n) whose L L' is that covariance; a standard deviation may be 0."""
    return np.asarray(sds[:, None] * np.linalg.cholesky(covariance_of(np.ones(len(sds)), correlations)))


def _still(array: FloatArray) -> FloatArray:
    """Make an array read-only: a frozen class does not freeze what it holds."""
    array.setflags(write=False)
    return array


def unpack(spec: EngineSpec, packed: FloatArray) -> FloatArray:
    """Give the full symmetric covariance, shape (n_joint, n_joint), of one packed triangle."""
    rows, columns = np.triu_indices(spec.n_joint)
    full = np.zeros((spec.n_joint, spec.n_joint))
    full[rows, columns] = packed
    full[columns, rows] = packed
    return full


def pack(full: FloatArray) -> FloatArray:
    """Give the upper triangle (n_packed,) of a symmetric matrix (n_joint, n_joint), row by row."""
    return full[np.triu_indices(full.shape[0])]


def covariance_place(spec: EngineSpec, i: int, j: int) -> int:
    """Give the place in a lane of the covariance of i and j >= i."""
    return spec.n_joint + i * spec.n_joint - i * (i - 1) // 2 + j - i
