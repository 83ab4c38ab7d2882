"""What is true of a simulated plant and not known to the engine: parameters, faults, imperfections."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from math import inf, isfinite, nan

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.errors import ModelError
from faultbond.io.faults import FaultRequest
from faultbond.model.graph import BondGraph, Input, Parameter, Sensor
from faultbond.types import FaultKind

MOST_RETURNS = 10_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A change of a parameter to `value` (SI) or by `factor` of its healthy value; one of the two is None.

    A step at `start`, or a straight line that begins at `start` and ends at `end`; seconds on the recording's clock.
    With `on` it is there for so many seconds, and with `off` it comes back after that many, again and again.

    The same for what is wrong with a sensor or input, as `flow.bias`, `flow.gain`, `flow.noise`: their healthy values
    are 0, 1 and the declared noise. `flow.stuck` holds the value of `value`, or where that is None the last one.
    """

    parameter: str
    value: float | None = None
    factor: float | None = None
    start: float
    end: float | None = None
    on: float | None = None
    off: float | None = None

    @property
    def instrument(self) -> str:
        """The sensor or input at fault; empty of a parameter."""
        return self.parameter.partition(".")[0] if "." in self.parameter else ""

    @property
    def kind(self) -> str:
        """What is wrong with the instrument: `bias`; empty of a parameter."""
        return self.parameter.partition(".")[2]

    def switches(self, last: float) -> FloatArray:
        """Give the moments up to `last` at which it comes and goes in turn, (n,), s, ascending."""
        if self.on is None:
            return np.array([self.start])
        if self.off is None:
            return np.array([self.start, self.start + self.on])
        period = self.on + self.off
        begins = self.start + period * np.arange(max(int((last - self.start) / period), 0) + 1)
        return np.stack([begins, begins + self.on], axis=1).ravel()


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """Imperfections of a real plant that its model leaves out.

    Parameters
    ----------
    spread : each healthy parameter is its nominal times 1 + spread * U(-1, 1)
    lag : time constant, s, of a first-order lag between an input with a declared settling and what acts
    curve : actuator curve error of the inputs in percent, one number for all or one by name: an opening u acts as
        u (1 + curve sin(2 pi u / 100)), right when shut, half open and fully open
    wander : whether what wanders does so, as far and as long as the model declares; else it stays at its usual value

    Notes
    -----
    On the water tank `curve={"u_in": 0.03, "u_out": 0.02}` puts the flow in wrong by 0.7 % (standard deviation over 82
    minutes of its recipe) and the flow out by 0.9 %, as do 3 % on the valve's resistance term, 1.2 % on the outlet, an
    outflow that depends on the level by 2 %, and a pump that droops by 1 %: 0.7 % and 0.7 %.
    """

    spread: float = 0.0
    lag: float = 0.0
    curve: float | Mapping[str, float] = 0.0
    wander: bool = False

    def curve_of(self, graph: BondGraph) -> dict[str, float]:
        """Give the curve error by input, without those that are zero.

        Raises
        ------
        ModelError
            Where a curve is given for something that is not an input in percent.
        """
        percent = [item.name for item in graph.inputs if item.unit.text == "percent"]
        if not isinstance(self.curve, Mapping):
            return dict.fromkeys(percent, self.curve) if self.curve else {}
        for name in self.curve:
            if name not in percent:
                raise ModelError(
                    f"{graph.file}: a curve error is given for {name}, which is no input in percent; "
                    f"there {'are ' + ', '.join(percent) if percent else 'is none'}"
                )
        return {name: part for name, part in self.curve.items() if part}


def fault_in_si(request: FaultRequest, graph: BondGraph) -> Fault:
    """Give the fault that a user asked for in the model file's unit.

    Raises
    ------
    ModelError
        Where the model has no such parameter, sensor or input.
    """
    signal, dot, kind = request.parameter.partition(".")
    unit = find_instrument(graph, signal).unit if dot else _parameter(graph, request.parameter).unit
    value = request.value
    if value is not None and kind in (FaultKind.BIAS.value, FaultKind.NOISE.value):
        value *= unit.factor  # a difference
    elif value is not None and kind != FaultKind.GAIN.value:
        value = unit.to_si(value)
    return Fault(
        parameter=request.parameter,
        value=value,
        factor=request.factor,
        start=request.start,
        end=request.end,
        on=request.on,
        off=request.off,
    )


def check_faults(graph: BondGraph, faults: Sequence[Fault], last: float) -> None:
    """See that each fault can be simulated.

    Parameters
    ----------
    graph : the plant
    faults : what is asked for
    last : time of the last row, s

    Raises
    ------
    ModelError
        Where a parameter or instrument is unknown, a fault has no finite target, or it begins after the last row.
    """
    for fault in faults:
        where = f"{graph.file}: fault of {fault.parameter}"
        _check_target(graph, fault, where)
        if not isfinite(fault.start) or fault.start > last:
            raise ModelError(f"{where}: it begins at {fault.start:g} s, but the last row is at {last:g} s")
        if fault.end is not None and not fault.start <= fault.end < inf:
            raise ModelError(f"{where}: it ends at {fault.end:g} s, before it begins at {fault.start:g} s")
        lengths = [item for item in (fault.on, fault.off) if item is not None]
        if any(not isfinite(item) or item <= 0.0 for item in lengths) or (fault.on is None and fault.off is not None):
            raise ModelError(f"{where}: it comes and goes for lengths of time above 0 s")
        if lengths and fault.end not in (None, fault.start):
            raise ModelError(f"{where}: it either comes and goes or follows a ramp")
        if fault.off is not None and last - fault.start > MOST_RETURNS * sum(lengths):
            raise ModelError(f"{where}: it would come and go more than {MOST_RETURNS} times")


def _check_target(graph: BondGraph, fault: Fault, where: str) -> None:
    """See that a fault has one target that means something."""
    if "." in fault.parameter:
        usual = {"bias": 0.0, "gain": 1.0, "noise": find_instrument(graph, fault.instrument).noise, "stuck": nan}
        if fault.kind not in usual:
            raise ModelError(f"{where}: {name_hint(fault.kind, tuple(usual))}")
        healthy = usual[fault.kind]
        if fault.kind == FaultKind.STUCK.value and fault.factor is None and fault.value is None:
            return  # at the last value
    else:
        healthy = _parameter(graph, fault.parameter).nominal
    target = fault.value if fault.factor is None else fault.factor
    if target is None or not isfinite(target) or (fault.value is None) == (fault.factor is None):
        raise ModelError(f"{where}: give it either a finite value or a finite factor")
    if fault.factor is not None and healthy == 0.0:
        raise ModelError(f"{where}: its healthy value is 0, and a factor changes nothing; give a value")
    if fault.factor is not None and fault.kind == FaultKind.STUCK.value:
        raise ModelError(f"{where}: it is stuck at a value, not at a factor")
    if fault.kind == FaultKind.NOISE.value and target < 0.0:
        raise ModelError(f"{where}: a noise is 0 or more")


def find_instrument(graph: BondGraph, name: str) -> Sensor | Input:
    """Give the sensor or input of that name.

    Raises
    ------
    ModelError
        Where there is none.
    """
    known: dict[str, Sensor | Input] = {item.name: item for item in graph.sensors}
    known |= {item.name: item for item in graph.inputs}
    if name not in known:
        raise ModelError(f"{graph.file}: no sensor or input {name}; {name_hint(name, tuple(known))}")
    return known[name]


def healthy_parameters(graph: BondGraph, spread: float, generator: np.random.Generator | None) -> FloatArray:
    """Give the true parameters of one healthy plant, shape (n_parameters,), SI; nominal without a generator."""
    nominal = np.array([item.nominal for item in graph.parameters], dtype=np.float64)
    if generator is None:
        return nominal
    return nominal * (1.0 + spread * generator.uniform(-1.0, 1.0, nominal.size))


def true_parameters(
    graph: BondGraph, healthy: FloatArray, faults: Sequence[Fault], times: FloatArray, *, after: bool
) -> FloatArray:
    """Give the parameters at some times, faults included.

    Where faults of one parameter overlap, the one that begins last counts, from the value that it finds.

    Parameters
    ----------
    graph : the plant
    healthy : float array, shape (n_parameters,), SI
    faults : in any order
    times : float array, shape (n,), s
    after : at the moment of a step, whether the value is that after it or that before it

    Returns
    -------
    float array, shape (n, n_parameters), SI
    """
    values = np.tile(healthy, (times.size, 1))
    for k, item in enumerate(graph.parameters):
        chosen = [fault for fault in faults if fault.parameter == item.name]
        if chosen:
            values[:, k] = value_over_time(float(healthy[k]), chosen, times, after=after)
    return values


def driven_by_parameters(graph: BondGraph) -> BondGraph:
    """Give a plant whose unknown inputs are parameters, behind the others, so that they may move in time."""
    driven = tuple(
        Parameter(
            name=item.name,
            owner=item.name,
            nominal=item.value,
            unit=item.unit,
            accuracy=0.0,
            change=1.0,
            lower=-inf,
            upper=inf,
            suspect=False,
        )
        for item in graph.unknown_inputs
    )
    return replace(graph, parameters=(*graph.parameters, *driven), constants=graph.fixed)


def wandering_parameters(
    graph: BondGraph, rows: FloatArray, values: FloatArray, times: FloatArray, paths: FloatArray
) -> FloatArray:
    """Give the parameters at some times, where those that wander do so.

    Parameters
    ----------
    graph : the plant
    rows : float array, shape (n_rows,), s; between them what wanders goes on a straight line
    values : float array, shape (n, n_parameters), SI, at their usual values
    times : float array, shape (n,), s
    paths : float array, shape (n_rows, n_wanders), as `wander_paths` gives them

    Returns
    -------
    float array, shape (n, n_parameters), SI
    """
    found, places = values.copy(), {item.name: k for k, item in enumerate(graph.parameters)}
    for item, path in zip(graph.wanders, paths.T, strict=True):
        by, column = np.interp(times, rows, path), found[:, places[item.target]]
        nominal = graph.parameters[places[item.target]].nominal
        found[:, places[item.target]] = column + (nominal * by if item.relative else by)
    return found


def wander_paths(graph: BondGraph, rows: FloatArray, generator: np.random.Generator | None) -> FloatArray:
    """Draw how far each thing that wanders is off at some times `rows` (n,), s; zero without a generator.

    Returns
    -------
    float array, shape (n, n_wanders), of relative ones in parts, else SI, in the order of `graph.wanders`
    """
    found = np.zeros((rows.size, len(graph.wanders)))
    if generator is None:
        return found
    draws = generator.standard_normal(found.shape)
    for k, item in enumerate(graph.wanders):
        decay = np.exp(-np.diff(rows, prepend=-inf) / item.memory)
        for row in range(rows.size):
            before = found[row - 1, k] if row else 0.0
            found[row, k] = decay[row] * before + item.sd * np.sqrt(1.0 - decay[row] ** 2) * draws[row, k]
    return found


def value_over_time(healthy: float, faults: Sequence[Fault], times: FloatArray, *, after: bool) -> FloatArray:
    """Give one value at `times`, (n,), s, as the faults change it from its healthy one, (n,), SI."""
    values = np.full(times.size, healthy)
    ordered = sorted(faults, key=lambda fault: fault.start)
    for number, fault in enumerate(ordered):
        before = value_over_time(healthy, ordered[:number], np.array([fault.start]), after=False)[0]
        target = fault.value if fault.value is not None else (fault.factor or 0.0) * healthy
        width = 0.0 if fault.end is None else fault.end - fault.start
        with np.errstate(over="ignore"):  # a width of next to nothing is a step
            part = np.clip((times - fault.start) / width, 0.0, 1.0) if width > 0 else np.ones(times.size)
        active = is_there(fault, times, after=after)
        values[active] = (before + part * (target - before))[active]
    return values


def is_there(fault: Fault, times: FloatArray, *, after: bool) -> BoolArray:
    """Tell at which times, shape (n,), a fault is there; `after`: right after a moment at which it comes or goes."""
    switches = fault.switches(float(np.max(times, initial=fault.start)))
    return np.asarray(np.searchsorted(switches, times, side="right" if after else "left") % 2 == 1)


def name_hint(name: str, known: Sequence[str]) -> str:
    """Give the end of a message about an unknown name: the closest one that exists, or all."""
    near = get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"there {'is ' + ', '.join(known) if known else 'is none'}"


def _parameter(graph: BondGraph, name: str) -> Parameter:
    known = {item.name: item for item in graph.parameters}
    if name not in known:
        instruments = [item.name for item in graph.sensors] + [item.name for item in graph.inputs]
        hint = (
            f"say what is wrong with it, such as {name}.bias" if name in instruments else name_hint(name, tuple(known))
        )
        raise ModelError(f"{graph.file}: no parameter {name}; {hint}")
    return known[name]
