"""What a lane has found: values of its suspects with their standard deviations, in SI."""

from dataclasses import dataclass
from math import log, sqrt

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Forecast, Suspect
from faultbond.contract.slots import SlotLane, plan_slots
from faultbond.contract.spec import EngineSpec, ParameterSpec, covariance_place
from faultbond.runtime.forecast import forecast
from faultbond.types import FaultKind


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Absorbed:
    """What was accepted before, on top of which a lane finds its fault.

    rates : (n_parameters,), factors per second; noise : (n_outputs,), variances in those declared
    """

    rates: FloatArray
    noise: FloatArray


def nothing_absorbed(spec: EngineSpec) -> Absorbed:
    """Give what was accepted where nothing was."""
    return Absorbed(rates=np.zeros(len(spec.parameters)), noise=np.ones(len(spec.outputs)))


def step_suspects(spec: EngineSpec, lane: FloatArray, chosen: tuple[int, ...]) -> tuple[Suspect, ...]:
    """Give the suspects of a lane (n_numbers,) without a slot."""
    suspects = []
    for index in chosen:
        parameter = spec.parameters[index]
        k = spec.parameter_slice.start + index
        suspects.append(
            Suspect(
                parameter=parameter.name,
                component=parameter.component,
                nominal=parameter.nominal,
                estimate=float(parameter.scale * lane[k]),
                sd=float(abs(parameter.scale) * sqrt(max(lane[covariance_place(spec, k, k)], 0.0))),
            )
        )
    return tuple(suspects)


def slot_suspects(
    spec: EngineSpec, slots: FloatArray, lane: int, time: float, absorbed: Absorbed
) -> tuple[tuple[Suspect, ...], bool]:
    """Give the suspect of one of the lanes with a slot (n_numbers, n_lanes), and whether its fault is there now.

    While a fault that comes and goes is gone, its size is that which the lane without it remembers: the other one has
    just been told that the fault is there, and bends the size to that.
    """
    plan = plan_slots(spec)
    item = plan.lanes[lane]
    if item.parameter < 0:
        return (_instrument(spec, slots, lane, item, absorbed),), item.acts
    return (_moved(spec, item, slots[:, lane], time, float(absorbed.rates[item.parameter])),), item.acts


def _moved(spec: EngineSpec, item: SlotLane, lane: FloatArray, time: float, before: float) -> Suspect:
    """Give a parameter that is its healthy value and what the slot adds; `before`: rate at which it moved already."""
    wide, parameter = spec.slotted, spec.parameters[item.parameter]
    k, size = wide.parameter_slice.start + item.parameter, wide.slot_slice.start
    rate, scale = size + 1, parameter.scale
    # The filter itself lets the sum act only up to the ends of the range.
    estimate = float(scale * min(max(lane[k] + lane[size], parameter.lower), parameter.upper))
    variance = (
        lane[covariance_place(wide, k, k)]
        + 2.0 * lane[covariance_place(wide, k, size)]
        + lane[covariance_place(wide, size, size)]
    )
    if item.kind is not FaultKind.DRIFT:
        return Suspect(
            parameter=parameter.name,
            component=parameter.component,
            nominal=parameter.nominal,
            estimate=estimate,
            sd=float(abs(scale) * sqrt(max(variance, 0.0))),
        )
    moving = float(scale * (before + lane[rate]))
    both = lane[covariance_place(wide, k, rate)] + lane[covariance_place(wide, size, rate)]
    spread = tuple(float(value * scale**2) for value in (variance, both, lane[covariance_place(wide, rate, rate)]))
    return Suspect(
        parameter=parameter.name,
        component=parameter.component,
        nominal=parameter.nominal,
        estimate=estimate,
        sd=sqrt(max(spread[0], 0.0)),
        rate=moving,
        rate_sd=sqrt(max(spread[2], 0.0)),
        forecasts=_forecasts(parameter, time, estimate, moving, (spread[0], spread[1], spread[2])),
    )


def _forecasts(
    parameter: ParameterSpec, time: float, value: float, rate: float, covariance: tuple[float, float, float]
) -> tuple[Forecast, ...]:
    healthy = parameter.nominal
    return tuple(forecast(time, limit, value, rate, covariance, healthy) for limit in parameter.limits)


def _instrument(spec: EngineSpec, slots: FloatArray, lane: int, item: SlotLane, absorbed: Absorbed) -> Suspect:
    """Give what is wrong with a sensor or an input."""
    wide, numbers = spec.slotted, slots[:, lane]
    size = wide.slot_slice.start
    name = spec.inputs[item.input].name if item.input >= 0 else spec.outputs[item.output].name
    unit = 1.0 if item.input >= 0 or item.kind is FaultKind.GAIN else spec.outputs[item.output].noise
    value, sd = float(unit * numbers[size]), float(unit * sqrt(max(numbers[covariance_place(wide, size, size)], 0.0)))
    rate = rate_sd = nominal = None
    word = FaultKind.BIAS.value
    match item.kind:
        case _ if item.sticks:
            word = "stuck"
        case FaultKind.BIAS | FaultKind.INTERMITTENT:
            nominal = 0.0
        case FaultKind.DRIFT:
            nominal, rate = 0.0, float(unit * numbers[size + 1])
            rate_sd = float(unit * sqrt(max(numbers[covariance_place(wide, size + 1, size + 1)], 0.0)))
        case FaultKind.GAIN:
            nominal, value, word = 1.0, 1.0 + value, "gain"
        case FaultKind.NOISE:
            nominal, word = unit, "noise"
            value, sd = _scatter(spec, slots, lane, unit * sqrt(float(absorbed.noise[item.output])))
    return Suspect(
        parameter=f"{name}.{word}", component=name, nominal=nominal, estimate=value, sd=sd, rate=rate, rate_sd=rate_sd
    )


def _scatter(spec: EngineSpec, slots: FloatArray, lane: int, known: float) -> tuple[float, float]:
    """Give the noise sd of a sensor and its spread, from how likely each of the noises tried is beside that known.

    Of n readings with mean square s, the log-likelihood of a variance c is -n (log c + s/c) / 2, largest at c = s, and
    sqrt(s) is then known to sqrt(s / 2n). The three noises tried about the best one tell n and s.
    """
    plan = plan_slots(spec)
    chosen = [
        k
        for k, item in enumerate(plan.lanes)
        if item.hypothesis == plan.lanes[lane].hypothesis and item.kind is FaultKind.NOISE
    ]
    likelihood, tried = slots[-1, chosen], np.array([plan.lanes[k].noise for k in chosen])
    finite = np.isfinite(likelihood)
    likelihood, tried = (likelihood[finite], tried[finite]) if finite.sum() > 2 else (np.zeros(len(tried)), tried)
    best = int(np.argmax(likelihood))
    first = min(max(best - 1, 0), len(tried) - 3)
    (at, *others), (base, *more) = tried[first : first + 3], likelihood[first : first + 3]
    slopes = -0.5 * np.array([[log(c / at), 1.0 / c - 1.0 / at] for c in others])
    count, squares = np.linalg.solve(slopes, np.array(more) - base)
    if not (count > 1.0 and squares > 0.0):  # what is no noise, or too short to tell: no finer than those tried lie
        return known * sqrt(tried[best]), known * sqrt(tried[best]) / 3.0
    sd = known * sqrt(min(max(squares / count, 1.0), 4.0 * tried[-1]))
    return sd, sd / sqrt(2.0 * count)
