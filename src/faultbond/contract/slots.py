"""Which lanes have a slot: drifts, ramps that end, faults that come and go, faults of sensors and inputs.

A lane's roles (see `faultbond.contract.spec`) are constants, so faults of all kinds run through the same code. The
widths and weights of the starts are those of docs/method.md, "Kinds of fault".
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import hypot, log, sqrt

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.contract.lanes import starts_of
from faultbond.contract.spec import EngineSpec, ParameterSpec, pack, unpack
from faultbond.types import FaultKind

DRIFTING, SWITCHING = log(0.5), log(0.2)  # prior weights of a drift, and of a fault that comes and goes, beside a step,
SHOWING = log(0.25)  # and of each step that takes a while to show
FRESH, OLD = (
    20.0,
    2000.0,
)  # samples in which a drift covers a usual fault, or what it has: one that begins now, one under way
UNSTEADY = 0.7  # sd of the rate of a drift under way, in that
BIASES = (10.0, 300.0)  # sd of a sensor's bias, in its noise
GAIN = 0.3  # sd of the relative error of the gain of a sensor or an input
STUCK_NOISES = (1.0,)  # noise variance of a sensor that is stuck, in that declared
STUCK_AT = (1.0, 1000.0)  # sd of where it is stuck about its last reading, in its noise
NOISES = (4.0, 9.0, 25.0, 100.0, 1000.0)  # noise variance of a sensor that scatters, in that declared
_WITHIN = 2.0  # samples in which a fault of an input that lags comes
INPUT_BIASES = (0.05, 0.5)  # sd of an input's bias, in the largest value seen
INPUT_STUCK = (0.02, 0.5)  # sd of where an input is stuck about where it was, alike: there, or at an end
COMMANDED = log(0.3)  # prior weight of the faults of an input, beside the step of a component
INPUT_KINDS = {  # and of each of them
    FaultKind.BIAS: 1.0,
    FaultKind.DRIFT: 0.6,
    FaultKind.GAIN: 0.6,
    FaultKind.STUCK: 0.3,
    FaultKind.INTERMITTENT: 0.2,
}
SENSOR_KINDS = {  # prior weights of the faults of a sensor; a gain is seldom wrong, and hard to tell from the plant
    FaultKind.BIAS: 0.577,
    FaultKind.DRIFT: 0.12,
    FaultKind.GAIN: 0.06,
    FaultKind.STUCK: 0.2,
    FaultKind.NOISE: 0.1,
    FaultKind.INTERMITTENT: 0.1,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SlotLane:
    """What one lane has in its slot, and on what it acts.

    hypothesis : index among the hypotheses of the specification
    parameter, input, output : index of what is at fault, or -1
    acts : False while a fault that comes and goes is gone
    sticks : whether the sensor does not follow the plant, or the input its record, while its fault is there
    scales : whether what the instrument shows, or the record of the input, is multiplied by 1 + size: its gain is wrong
    old : whether the fault has been under way for long, so that the healthy filter has learned from it
    size, size_sd, rate, rate_sd : start; of a parameter in healthy factors (or factors, where the nominal is 0), of a
        sensor in its noise (bias, stuck), of an input in its largest value seen, of a gain relative; the rate per
        sample, or per lag
    settling : time, s, in which what is at fault may come to its size; 0: it is there at once
    lag : time constant, s, with which the rate fades, so that the size comes to rest; 0: it never does
    keeps : whether stores keep their content while their parameter moves; else their effort or flow goes on
    noise : noise variance of the sensor, in that declared
    weight : logarithm of the prior weight
    """

    hypothesis: int
    kind: FaultKind
    parameter: int = -1
    input: int = -1
    output: int = -1
    acts: bool = True
    sticks: bool = False
    scales: bool = False
    old: bool = False
    size: float = 0.0
    size_sd: float = 0.0
    rate: float = 0.0
    rate_sd: float = 0.0
    settling: float = 0.0
    lag: float = 0.0
    keeps: bool = False
    noise: float = 1.0
    weight: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SlotPlan:
    """Lanes with a slot, first those that begin at an onset.

    From `ramped` on these are pairs (it moves, it has come to stay), from `switched` on pairs that need no onset (the
    fault is there, it is gone).

    roles : (n_roles, n_lanes)
    hypothesis, weight : (n_lanes,)
    """

    lanes: tuple[SlotLane, ...]
    roles: FloatArray
    hypothesis: IntArray
    weight: FloatArray
    ramped: int
    switched: int

    @property
    def n_lanes(self) -> int:
        """Number of lanes."""
        return len(self.lanes)


@lru_cache(maxsize=8)
def plan_slots(spec: EngineSpec) -> SlotPlan:
    """Give the lanes with a slot of a specification."""
    singles = [(k, chosen[0]) for k, chosen in enumerate(spec.hypotheses) if len(chosen) == 1]
    found = [lane for k, index in singles for lane in _drifts(spec, index, k)]
    found += [lane for k, index in singles for lane in _changes(spec.parameters[index], index, k)]
    found += [lane for k, index in singles for lane in _settling_steps(spec.parameters[index], index, k)]
    for k, instrument in enumerate(spec.instruments, len(spec.hypotheses)):
        index = instrument.index
        found += _sensor_faults(index, k) if instrument.is_output else _input_faults(index, k, _in_sight(spec, index))
    moving = _first_drifts(found)
    passing = [lane for lane in found if lane.kind is FaultKind.INTERMITTENT]
    from_onset = [lane for lane in found if lane not in moving and lane not in passing]
    ramped = [lane for moves in moving for lane in (moves, replace(moves, kind=FaultKind.RAMP))]
    switched = [lane for there in passing for lane in (there, replace(there, acts=False))]
    lanes = (*from_onset, *ramped, *switched)
    return SlotPlan(
        lanes=lanes,
        roles=np.stack([_roles(spec, lane) for lane in lanes], axis=1)
        if lanes
        else np.zeros((spec.slotted.n_roles, 0)),
        hypothesis=np.array([lane.hypothesis for lane in lanes], dtype=np.intp),
        weight=np.array([lane.weight for lane in lanes], dtype=np.float64),
        ramped=len(from_onset),
        switched=len(from_onset) + len(ramped),
    )


def with_slot(spec: EngineSpec, lane: FloatArray) -> FloatArray:
    """Give a lane (n_numbers,) as one with an empty slot, of `spec.slotted`; its roles are zero."""
    wide = spec.slotted
    own = np.concatenate([np.arange(wide.slot_slice.start), np.arange(wide.slot_slice.stop, wide.n_joint)])
    found, full = np.zeros(wide.n_numbers), np.zeros((wide.n_joint, wide.n_joint))
    found[own] = lane[: spec.n_joint]
    full[np.ix_(own, own)] = unpack(spec, lane[spec.covariance_slice])
    found[wide.covariance_slice], found[wide.loop_slice] = pack(full), lane[spec.loop_slice]
    return found


def _first_drifts(lanes: Sequence[SlotLane]) -> list[SlotLane]:
    """Give the drifts of each hypothesis that begin at the onset: those that may be found to have come to their end."""
    first: dict[tuple[int, bool, bool], SlotLane] = {}
    for lane in lanes:
        if lane.kind is FaultKind.DRIFT:
            first.setdefault((lane.hypothesis, lane.scales, lane.keeps), lane)
    return list(first.values())


def _drifts(spec: EngineSpec, index: int, hypothesis: int) -> Iterator[SlotLane]:
    """Give a drift that begins at the onset, and drifts that have already gone some way.

    Of a store there are two that begin: its content goes on, or its effort or flow.
    """
    item, lane = spec.parameters[index], SlotLane(hypothesis=hypothesis, kind=FaultKind.DRIFT, parameter=index)
    starts = starts_of(item, 1)
    ways = (False, True) if spec.moves_store(index) else (False,)
    fresh = replace(lane, size_sd=item.accuracy, rate_sd=item.change / FRESH, weight=DRIFTING - log(2.0 * len(ways)))
    yield from (replace(fresh, keeps=keeps) for keeps in ways)
    for start in starts:
        yield replace(
            lane,
            size=start.value - item.healthy,
            size_sd=start.sd,
            rate=(start.value - item.healthy) / OLD,
            rate_sd=UNSTEADY * hypot(start.value - item.healthy, start.sd) / OLD,
            old=True,
            weight=DRIFTING - log(2.0 * len(starts)),
        )


def _changes(item: ParameterSpec, index: int, hypothesis: int) -> Iterator[SlotLane]:
    """Give the starts of a change that comes and goes."""
    starts = starts_of(item, 1)
    for start in starts:
        yield SlotLane(
            hypothesis=hypothesis,
            kind=FaultKind.INTERMITTENT,
            parameter=index,
            size=start.value - item.healthy,
            size_sd=start.sd,
            weight=SWITCHING - log(len(starts)),
        )


def _settling_steps(item: ParameterSpec, index: int, hypothesis: int) -> Iterator[SlotLane]:
    """Give steps that a sensor shows as slowly as it does an input: what lags may be the sensor, too.

    Where the lag is known it is that of the step, but how late in its sample one came is not known; and since nobody
    knows what lags, such a step is as likely as one that shows at once.
    """
    lane = SlotLane(hypothesis=hypothesis, kind=FaultKind.STEP, parameter=index)
    usual = dict.fromkeys((min(GAIN, item.change), item.change) if item.healthy else (item.change,))
    for sd in usual if item.settling > 0.0 else ():
        yield replace(lane, size_sd=sd, settling=item.settling, weight=SHOWING)
    for sd in usual if item.lag > 0.0 else ():
        part = sqrt(0.5) * sd
        yield replace(lane, size_sd=part, rate_sd=part, lag=item.lag, weight=-log(len(usual)))


def _in_sight(spec: EngineSpec, index: int) -> float:
    """Give how long an input settles, s, where a sensor feels it at once; 0: none does.

    One that lags does so within two samples: how late in its sample a fault of it came is not known.
    """
    late = _WITHIN * (spec.sample_time or 0.0) if spec.inputs[index].lag > 0.0 else 0.0
    settling = spec.inputs[index].settling if any(index in item.direct_inputs for item in spec.outputs) else 0.0
    return max(late, settling)


def _sensor_faults(index: int, hypothesis: int) -> Iterator[SlotLane]:
    """Give the faults of a sensor; those that come and go read wrongly by as much each time, or show the same."""
    lane = SlotLane(hypothesis=hypothesis, kind=FaultKind.BIAS, output=index)
    stuck = replace(lane, kind=FaultKind.STUCK, sticks=True)
    passing, gain = replace(lane, kind=FaultKind.INTERMITTENT), replace(lane, scales=True)
    found = [
        *(replace(lane, size_sd=sd) for sd in BIASES),
        replace(lane, kind=FaultKind.DRIFT, size_sd=1.0, rate_sd=BIASES[0] / FRESH),
        replace(lane, kind=FaultKind.DRIFT, size_sd=BIASES[0], rate_sd=BIASES[0] / OLD),
        replace(gain, kind=FaultKind.GAIN, size_sd=GAIN),
        *(replace(stuck, size_sd=sd, noise=noise) for sd in STUCK_AT for noise in STUCK_NOISES),
        *(replace(lane, kind=FaultKind.NOISE, noise=noise) for noise in NOISES),
        *(replace(passing, size_sd=sd) for sd in BIASES),
        replace(passing, size_sd=STUCK_AT[-1], sticks=True),
    ]
    counts = Counter(item.kind for item in found)
    for item in found:
        yield replace(item, weight=log(SENSOR_KINDS[item.kind] / counts[item.kind]))
    yield replace(gain, kind=FaultKind.DRIFT, rate_sd=GAIN / FRESH, weight=DRIFTING + log(SENSOR_KINDS[FaultKind.GAIN]))


def _input_faults(index: int, hypothesis: int, settling: float) -> Iterator[SlotLane]:
    """Give the faults of an input; those that begin at an onset come as slowly as it settles."""
    moves = SlotLane(hypothesis=hypothesis, kind=FaultKind.DRIFT, input=index)
    lane = replace(moves, kind=FaultKind.BIAS, settling=settling)
    stuck, gain = replace(lane, kind=FaultKind.STUCK, sticks=True), replace(lane, kind=FaultKind.GAIN, scales=True)
    found = [
        *(replace(lane, size_sd=sd) for sd in INPUT_BIASES),
        replace(moves, rate_sd=INPUT_BIASES[1] / FRESH),
        replace(moves, size_sd=INPUT_BIASES[0], rate_sd=INPUT_BIASES[0] / OLD),
        replace(gain, size_sd=GAIN),
        *(replace(stuck, size_sd=sd) for sd in INPUT_STUCK),
        *(replace(moves, kind=FaultKind.INTERMITTENT, size_sd=sd) for sd in INPUT_BIASES),
    ]
    counts = Counter(item.kind for item in found)
    for item in found:
        yield replace(item, weight=COMMANDED + log(INPUT_KINDS[item.kind] / counts[item.kind]))
    drifting = DRIFTING + log(INPUT_KINDS[FaultKind.GAIN])
    yield replace(moves, scales=True, rate_sd=GAIN / FRESH, weight=COMMANDED + drifting)


def _roles(spec: EngineSpec, lane: SlotLane) -> FloatArray:
    """Give the roles of a lane, shape (n_roles,)."""
    wide = spec.slotted
    first = wide.loop_slice.stop
    place = {name: where.start - first for name, where in wide.role_fields.items()}
    roles = np.zeros(wide.n_roles)
    ones = (("obeys", len(spec.inputs)), ("reads", len(spec.outputs)), ("noise", len(spec.outputs)), ("moves", 1))
    for name, n in ones:
        roles[place[name] : place[name] + n] = 1.0
    roles[place["fades"]] = 1.0 / lane.lag if lane.lag > 0.0 else 0.0
    roles[place["keeps"]] = float(lane.keeps)
    if lane.parameter >= 0:
        roles[place["theta"] + lane.parameter] = float(lane.acts)
    if lane.input >= 0:
        zero = spec.inputs[lane.input].unit_offset
        roles[place["input"] + lane.input] = -zero if lane.scales else float(lane.acts)
        roles[place["input_gain"] + lane.input] = float(lane.scales)
        roles[place["obeys"] + lane.input] = float(not lane.sticks)
    if lane.output >= 0:
        output = spec.outputs[lane.output]
        added = -output.unit_offset if lane.scales else output.noise * (lane.kind in _ADDED)
        roles[place["reads"] + lane.output] = float(not (lane.sticks and lane.acts))
        roles[place["gain"] + lane.output] = float(lane.scales)
        roles[place["bias"] + lane.output] = added * lane.acts
        roles[place["noise"] + lane.output] = lane.noise
    return roles


_ADDED = (FaultKind.BIAS, FaultKind.DRIFT, FaultKind.RAMP, FaultKind.STUCK, FaultKind.INTERMITTENT)
