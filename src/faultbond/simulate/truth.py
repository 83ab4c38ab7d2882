"""What is true of a simulated plant and not known to the engine: parameters, faults, imperfections."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from math import inf, isfinite

import numpy as np

from faultbond.errors import ModelError
from faultbond.io.faults import FaultRequest
from faultbond.model.graph import BondGraph, Parameter
from faultbond.types import FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """A change of a parameter to `value` (SI) or by `factor` of its healthy value; one of the two is None.

    A step at `start`, or a straight line that begins at `start` and ends at `end`; seconds on the recording's clock.
    """

    parameter: str
    value: float | None = None
    factor: float | None = None
    start: float
    end: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """Imperfections of a real plant that its model leaves out.

    Parameters
    ----------
    spread : each healthy parameter is its nominal times 1 + spread * U(-1, 1)
    lag : time constant, s, of a first-order lag between an input with a declared settling and what acts
    curve : actuator curve error of the inputs in percent, one number for all or one by name: an opening u acts as
        u (1 + curve sin(2 pi u / 100)), right when shut, half open and fully open

    Notes
    -----
    On the water tank `curve={"u_in": 0.03, "u_out": 0.02}` puts the flow in wrong by 0.7 % (standard deviation over 82
    minutes of its recipe) and the flow out by 0.9 %, as do 3 % on the valve's resistance term, 1.2 % on the outlet, an
    outflow that depends on the level by 2 %, and a pump that droops by 1 %: 0.7 % and 0.7 %.
    """

    spread: float = 0.0
    lag: float = 0.0
    curve: float | Mapping[str, float] = 0.0

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
        Where the model has no such parameter.
    """
    unit = _parameter(graph, request.parameter).unit
    return Fault(
        parameter=request.parameter,
        value=None if request.value is None else unit.to_si(request.value),
        factor=request.factor,
        start=request.start,
        end=request.end,
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
        Where a parameter is unknown, a fault has no finite target, or it begins after the last row.
    """
    for fault in faults:
        item = _parameter(graph, fault.parameter)
        where = f"{graph.file}: fault of {fault.parameter}"
        target = fault.value if fault.factor is None else fault.factor
        if target is None or not isfinite(target) or (fault.value is None) == (fault.factor is None):
            raise ModelError(f"{where}: give it either a finite value or a finite factor")
        if fault.factor is not None and item.nominal == 0.0:
            raise ModelError(f"{where}: its nominal is 0, and a factor changes nothing; give a value")
        if not isfinite(fault.start) or fault.start > last:
            raise ModelError(f"{where}: it begins at {fault.start:g} s, but the last row is at {last:g} s")
        if fault.end is not None and not fault.start <= fault.end < inf:
            raise ModelError(f"{where}: it ends at {fault.end:g} s, before it begins at {fault.start:g} s")


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
    index = {item.name: k for k, item in enumerate(graph.parameters)}
    ordered = sorted(faults, key=lambda fault: fault.start)
    for number, fault in enumerate(ordered):
        k = index[fault.parameter]
        moment = np.array([fault.start])
        before = true_parameters(graph, healthy, ordered[:number], moment, after=False)[0, k]
        target = fault.value if fault.value is not None else (fault.factor or 0.0) * healthy[k]
        width = 0.0 if fault.end is None else fault.end - fault.start
        part = np.clip((times - fault.start) / width, 0.0, 1.0) if width > 0 else np.ones(times.size)
        active = times >= fault.start if after else times > fault.start
        values[active, k] = (before + part * (target - before))[active]
    return values


def closest(name: str, known: Sequence[str]) -> str:
    """Give the end of a message about an unknown name: the closest one that exists, or all."""
    near = get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean {near[0]}?" if near else f"there {'is ' + ', '.join(known) if known else 'is none'}"


def _parameter(graph: BondGraph, name: str) -> Parameter:
    known = {item.name: item for item in graph.parameters}
    if name not in known:
        raise ModelError(f"{graph.file}: no parameter {name}; {closest(name, tuple(known))}")
    return known[name]
