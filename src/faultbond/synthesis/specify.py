"""The `EngineSpec` of a model: what the on-line part must know, in array order."""

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version
from math import ceil, inf

import numpy as np

from faultbond.analysis.testable import EXPLAINS_ANYTHING, choose_sets, unseen_instruments
from faultbond.arrays import FloatArray
from faultbond.contract.spec import (
    CheckSpec,
    EngineSpec,
    InputSpec,
    OutputSpec,
    ParameterSpec,
    SlowErrorSpec,
    StateSpec,
    Thresholds,
)
from faultbond.equations.constraint_network import Store
from faultbond.equations.step import StepModel, is_guessed, reference_inputs
from faultbond.model.graph import BondGraph, Input, Parameter, Sensor, SlowError, Validity
from faultbond.synthesis.products import factors_of_inputs, terms_of_inputs
from faultbond.synthesis.promise import cusum_limit, slow_error_limit

VERSION = version("faultbond")
_STEP_PART = 0.01  # of an input's range; a larger change from row to row is a step
_STEP_NOISE = 6.0  # standard deviations of a noisy input that are no step yet
_FACTOR_LOW, _FACTOR_HIGH = 0.02, 50.0  # default range of a parameter, in nominals
_WARM_UP_SAMPLES = 20
_GUESSED = 100.0  # times as large a state may be in use where inputs are guessed at a unit of the model file
_NOTICED = 0.1  # of what it takes for a sensor to be off by its noise
_BOUND_LIMIT = 1.6  # declared sizes of a slow error that is a part of a law, where nothing is promised
_USUAL_LIMIT = 5.0  # of any other
_OUTSIDE = 4.0  # accuracies by which an estimate may leave the range about a healthy value at its end
_SHOWN_WITHIN = 50  # samples
MOST_BEGUN = 300  # sets tested from the alarm on; where there are more, the larger ones wait in reserve
PROCESS_NOISE = 0.02  # sd added to a state each sample, in noises of the sensor that shows it best


def build_spec(model: StepModel) -> EngineSpec:
    """Give the engine's contract for a discrete-time model."""
    plant = model.plant
    graph = plant.graph
    choice, hidden = choose_sets(model), unseen_instruments(model)
    drifts = _drifts(model)
    states = tuple(_state(model, k, float(drifts[k])) for k in range(len(model.states)))
    begun, reserve = _in_turn(choice.sets)
    positions = {item.name: k for k, item in enumerate(graph.inputs)}
    sensors = {item.name: j for j, item in enumerate(graph.sensors)}
    limits = _slow_limits(graph)
    slow = tuple(
        SlowErrorSpec(
            name=error.target,
            sd=error.sd,
            memory=error.memory,
            limit=limit,
            wanders=error.wanders,
            after=tuple((positions[name], each) for name, each in error.by_input.items()),
            output=-1 if error.relative or error.wanders else sensors.get(error.target, -1),
        )
        for error, limit in zip(graph.slow_errors, limits, strict=True)
    )
    conditions, stores = graph.conditions, plant.network.states
    grid, lags = graph.sample_time if graph.sample_time is not None else 1.0, _shown_lags(model)
    return EngineSpec(
        model=graph.name,
        model_sha256=graph.sha256,
        version=VERSION,
        sample_time=graph.sample_time,
        states=states,
        slow_errors=slow,
        parameters=tuple(_parameter(item, *_lateness(model, lags, k)) for k, item in enumerate(graph.parameters)),
        inputs=tuple(
            replace(
                _input(item, lags.get(k, 0.0), acts=item.name in graph.acting_inputs, hidden=item.name in hidden),
                factor=factor,
                term=term,
                term_part=part / graph.parameters[term].scale if term >= 0 else 0.0,
            )
            for k, (item, factor, (term, part)) in enumerate(
                zip(graph.inputs, factors_of_inputs(plant), terms_of_inputs(plant), strict=True)
            )
        ),
        outputs=tuple(
            _output(item, model.felt[k], conditions, stores, hidden=item.name in hidden)
            for k, item in enumerate(graph.sensors)
        ),
        loops=tuple(float(value) for value in model.reference_implicit),
        hypotheses=begun,
        reserve=reserve,
        coupled=graph.max_faults > 1,
        settlings=tuple(item.settling for item in conditions),
        condition=_place(graph.valid_when, conditions),
        row_time=graph.row_time,
        false_alarms=graph.false_alarms,
        correlations=_correlations(graph),
        explain_anything=tuple(chosen for chosen, reason in choice.dropped if reason == EXPLAINS_ANYTHING),
        checks=tuple(
            CheckSpec(name=item.name, kind=item.kind, cost=item.cost, noise=item.noise, move=item.move)
            for item in graph.checks
        ),
        thresholds=_thresholds(graph, grid, shares=2 if any(error.alarms for error in slow) else 1),
    )


def _in_turn(sets: tuple[tuple[int, ...], ...]) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """Part the sets in those tested from the alarm on, small ones first, and those in reserve."""
    sizes = sorted({len(chosen) for chosen in sets})
    most = max((size for size in sizes if sum(len(chosen) <= size for chosen in sets) <= MOST_BEGUN), default=1)
    begun = tuple(chosen for chosen in sets if len(chosen) <= max(most, min(sizes, default=1)))
    return begun, tuple(chosen for chosen in sets if chosen not in set(begun))


def _slow_limits(graph: BondGraph) -> tuple[float, ...]:
    """Give the limit of each slow error in its declared sizes, infinite where it never alarms.

    What grows after an input has changed never does, nor an unknown input. The size of a part of a law is a bound; any
    other one is usual, and larger errors come. With a promise each has the same share of half of it.
    """
    parameters, promise = {item.name for item in graph.parameters}, graph.time_between_false_alarms
    alarms = [item.target in parameters if item.wanders else not item.after for item in graph.slow_errors]

    def limit(item: SlowError) -> float:
        if promise is not None:
            return slow_error_limit(promise, item.memory, 2 * sum(alarms))
        return _BOUND_LIMIT if item.relative and not item.is_sensor and not item.wanders else _USUAL_LIMIT

    return tuple(limit(item) if may else inf for item, may in zip(graph.slow_errors, alarms, strict=True))


def _thresholds(graph: BondGraph, grid: float, shares: int) -> Thresholds:
    """Give the settings of the detector; its limits follow from a promise, if the model file makes one."""
    usual = Thresholds(warm_up_samples=max(_WARM_UP_SAMPLES, ceil(graph.warm_up / grid - 1e-9)))
    promise = graph.time_between_false_alarms
    if promise is None:
        return usual
    return replace(
        usual,
        cusum_limit=cusum_limit(promise, grid, len(graph.sensors), usual.cusum_drift, 2 * shares),
        fast_limit=cusum_limit(promise, grid, len(graph.sensors), usual.fast_drift, 2 * shares),
    )


def _state(model: StepModel, k: int, drift: float) -> StateSpec:
    """Give a state, its start in the engine's coordinate, and how it jumps where its content stays.

    From e(q, theta): d ln e / d ln theta at constant content q, at the reference state; exact for linear stores.
    """
    plant = model.plant
    graph = plant.graph
    start = {item.name: item.start for item in graph.components}.get(plant.network.states[k].component or "")
    source = plant.network.states[k].source
    nominal = np.array([item.nominal for item in graph.parameters])
    usual = model.contents(model.reference_state, nominal).full()[:, 0]
    content = usual.copy()
    content[k] = start.mean if start is not None else usual[k]
    by_content = float(model.coordinates.jacobian()(content, nominal, 0)[0][k, k])
    moved = content.copy()
    moved[k] = content[k] or usual[k] or 1.0  # of an empty store nothing jumps
    at, by_theta = float(model.coordinates(moved, nominal)[k]), model.coordinates.jacobian()(moved, nominal, 0)[1]
    exponents = by_theta.full()[k] * nominal / at if at and len(nominal) else np.zeros(len(nominal))
    usually, guessed = abs(float(model.reference_state[k])), any(map(is_guessed, graph.inputs))
    usually = usually if usually > _NOTICED * drift else 0.0  # where nothing flows at the reference, rounding is left
    return StateSpec(
        name=model.states[k],
        start_mean=float(model.coordinates(content, nominal)[k]) if start is not None else 0.0,
        start_sd=abs(by_content) * start.sd if start is not None else None,
        noise=_process_noise(model, k),
        drift=drift,
        jumps=tuple((j, float(power)) for j, power in enumerate(exponents) if np.isfinite(power) and power != 0.0),
        follows=[item.name for item in graph.inputs].index(source) if source else -1,
        usual=_GUESSED * usually if guessed else usually,
        reach=0.0 if guessed else usually,
    )


def _process_noise(model: StepModel, k: int) -> float:
    """Give the process noise of a state per sample: a small part of the noise of the sensor that shows it best.

    It stands for what no model knows; a state that no sensor reads directly gets none. Nor does what an input with a
    lag has come to, which is known by record and lag: where the reference is a plant at rest, as a gate between two
    levels of 1 m, hardly a sensor shows it, and what would move one by its noise made those blind that feel the gate.
    """
    if model.plant.network.states[k].source:
        return 0.0
    slope = np.abs(model.measure(*at_reference(model))[1].full()[:, k])
    shown = [sensor.noise / slope[j] for j, sensor in enumerate(model.plant.graph.sensors) if slope[j] > 0]
    return float(PROCESS_NOISE * min(shown)) if shown else 0.0


def at_reference(model: StepModel) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give v (n_v,), u (n_inputs,) and z (n_implicit,) of the model at the reference."""
    n_x = len(model.states)
    joint = np.zeros(model.v.numel())
    joint[:n_x] = model.reference_state
    first = n_x + model.plant.b.numel()
    for j, item in enumerate(model.plant.graph.parameters):
        joint[first + j] = item.nominal / model.scales[j]
    return joint, reference_inputs(model.plant), model.reference_implicit


def _drifts(model: StepModel) -> FloatArray:
    """Give for each state the change that moves some sensor by its noise, within so many samples; 0 if none shows it.

    A gap in a recording lets each state wander by about this much a sample: inputs may have changed meanwhile. What an
    input with a lag has come to does so by no more than the reference input.
    """
    n_x, place = len(model.states), at_reference(model)
    dt = model.plant.graph.sample_time or 1.0
    rates, slope = model.rates(*place)[1].full()[:, :n_x], model.measure(*place)[1].full()[:, :n_x]
    step = np.linalg.pinv(np.eye(n_x) - dt * rates)  # implicit Euler
    row = slope / np.array([sensor.noise for sensor in model.plant.graph.sensors])[:, None]
    effects = np.zeros(n_x)
    for _ in range(_SHOWN_WITHIN):
        effects = np.maximum(effects, np.abs(row).max(axis=0, initial=0.0))
        row = row @ step
    drifts = np.divide(1.0, effects, out=np.zeros(n_x), where=effects > 0.0)
    usual = dict(zip((item.name for item in model.plant.graph.inputs), np.abs(place[1]).tolist(), strict=True))
    most = [usual.get(store.source, np.inf) for store in model.plant.network.states]
    return np.minimum(drifts, most)


def _parameter(item: Parameter, settling: float, lag: float) -> ParameterSpec:
    size = abs(item.scale)
    lower, upper = least, most = sorted((item.lower / item.scale, item.upper / item.scale))
    healthy, reach = (0.0 if item.nominal == 0.0 else 1.0), _OUTSIDE * item.accuracy / size
    if item.nominal != 0.0:  # keep a division by the parameter away from zero
        lower = _FACTOR_LOW if lower == 0.0 else lower
        upper = min(upper, _FACTOR_HIGH) if np.isinf(upper) and lower >= 0 else upper
        reach = min(reach, 1.0 - _FACTOR_LOW)
    # A range is meant for faults: an estimate may scatter about a healthy value that lies at its end.
    lower, upper = min(lower, healthy - reach), max(upper, healthy + reach)
    return ParameterSpec(
        name=item.name,
        component=item.owner,
        nominal=item.nominal,
        scale=item.scale,
        accuracy=item.accuracy / size,
        change=item.change / size,
        lower=lower,
        upper=upper,
        suspect=item.suspect,
        unit=item.unit.text,
        unit_factor=item.unit.factor,
        limits=item.limits,
        least=least,
        most=most,
        healthy_change=item.healthy_change / size,
        settling=settling,
        lag=lag,
    )


def _shown_lags(model: StepModel) -> dict[int, float]:
    """Give the inputs that a sensor would feel at once if they did not lag, and their lags, s."""
    graph = model.plant.graph
    nominal = {item.name: item.nominal for item in graph.parameters}
    return {k: nominal[graph.inputs[k].lag] for lagged in model.lagged for k in lagged}


def _lateness(model: StepModel, lags: dict[int, float], parameter: int) -> tuple[float, float]:
    """Give how long an input settles, and lags, of which a sensor tells as it does of this parameter, s; 0: none does.

    Who states a lag of an input may know only that a sensor shows its moves late. What makes it late may be the plant,
    or the sensor, and a change of the parameter shows as late.
    """
    inputs, settling, lag = model.plant.graph.inputs, 0.0, 0.0
    for felt, lagged, parts in zip(model.felt, model.lagged, model.of_parts, strict=True):
        if parameter in parts:
            settling = max([settling, *(inputs[k].settling for k in felt)])
            lag = max([lag, *(lags[k] for k in lagged)])
    return settling, lag


def _correlations(graph: BondGraph) -> tuple[tuple[int, int, float], ...]:
    """Give the correlations of factors; that of a negative value falls while the value rises."""
    signs = [-1.0 if item.scale < 0.0 else 1.0 for item in graph.parameters]
    return tuple((one, other, signs[one] * signs[other] * value) for one, other, value in graph.correlated)


def _place(stated: Validity | None, conditions: tuple[Validity, ...]) -> int:
    """Give the place of a condition; -1 where none is stated."""
    return -1 if stated is None else conditions.index(stated)


def _input(item: Input, lag: float, *, acts: bool, hidden: bool) -> InputSpec:
    """Give an input; one that no law names only says in which state the plant is, and may take any value."""
    percent = item.unit.text == "percent"
    noise = _STEP_NOISE * item.noise
    found = InputSpec(
        name=item.name,
        noise=item.noise,
        settling=item.settling,
        step=max(100.0 * _STEP_PART if percent else 0.0, noise),
        step_part=0.0 if percent else _STEP_PART,
        lag=lag,
        suspect=item.suspect and not hidden,
        hidden=item.suspect and hidden,
        unit=item.unit.text,
        unit_factor=item.unit.factor,
        unit_offset=item.unit.offset,
        ranged=not acts or bool(np.isfinite(item.lower) and np.isfinite(item.upper)),
        hold=item.hold,
        smooth=item.smooth,
        healthy_bias=item.healthy_bias,
        ends=(item.lower, item.upper),
    )
    return found if item.fitted_range is None else replace(found, fitted_range=item.fitted_range)


def _output(
    item: Sensor, direct: tuple[int, ...], conditions: tuple[Validity, ...], stores: Sequence[Store], *, hidden: bool
) -> OutputSpec:
    return OutputSpec(
        name=item.name,
        noise=item.noise,
        direct_inputs=direct,
        unit=item.unit.text,
        unit_factor=item.unit.factor,
        unit_offset=item.unit.offset,
        suspect=item.suspect and not hidden,
        hidden=item.suspect and hidden,
        ranged=bool(np.isfinite(item.lower) and np.isfinite(item.upper)),
        condition=_place(item.valid_when, conditions),
        lag_states=tuple(k for k, store in enumerate(stores) if item.lag and store.owner == item.name),
        growth=item.growth,
        healthy_bias=item.healthy_bias,
    )
