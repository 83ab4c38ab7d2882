"""Where a search for imperfections stands: the plant as it is by now, and what was added to it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.fit.identification import Fit, Prior
from faultbond.fit.imperfections import Imperfection, Kind, kind_of, parameter_name
from faultbond.fit.objective import FitPoint, FittedPlant
from faultbond.fit.outcome import LEAST_ACCURACY
from faultbond.model.graph import BondGraph
from faultbond.types import Hold


@dataclass(frozen=True, slots=True, kw_only=True)
class Added:
    """An imperfection that was added, and how many nats the recordings gain, those fitted and those held back.

    alike : others that explain about as much
    """

    what: Imperfection
    trained: float
    held: float
    alike: tuple[Imperfection, ...] = ()

    def may_have(self, other: "Added", part: float) -> bool:
        """Tell whether a slow error may have what a lag or a curve explains, which gains `part` as much where fitted.

        That may foretell little by itself: without the slow error, other values stand in for what it lacks. What loses
        more where it was not fitted than it gains where it was is nothing of this plant.
        """
        if not self.what.is_slow or not other.what.is_definite:
            return False
        return other.trained >= part * self.trained and other.held > -other.trained


def as_fitted(added: Sequence[Added], values: Mapping[str, float]) -> tuple[Added, ...]:
    """Give what was added with the sizes that a fit has found since, where these are parameters; values by name, SI."""
    sizes = ((item, values.get(parameter_name(item.what)) if item.what.is_parameter else None) for item in added)
    return tuple(item if size is None else replace(item, what=replace(item.what, size=size)) for item, size in sizes)


def _not_fitted(prior: Prior) -> Fit:
    raise LookupError(f"no climb has led there, so nothing is known of it with {prior}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Footing:
    """Where the search stands.

    graph : noise of sensors and imperfections as found; values : of the parameters by name, SI
    slow : how large slow errors are found that the model declares, by what they are of and whether they are parts of
    it; in `graph` they are as declared
    starts : of the recordings that are fitted, by the name of the state or of a recording's own parameter
    innovations, expected : of the recordings that are fitted, (N, n_outputs) each; in standard deviations, and SI
    ways : how far each output moves on the whole where an input is a little larger, (n_outputs, n_inputs), SI
    trained, few, held : logarithms of the likelihood of recordings fitted, of the few that compare, and held back
    unknown : mean logarithm of the standard errors of the parameters
    settled : whether the climb that led there had come to rest
    bent : of each curve that was sought, what the recordings that are fitted would lose without it, nats, if the hill
    were as it looks from its top (Wald's test)
    fit : gives what the recordings that are fitted say of it, with all that was added as it stands
    """

    graph: BondGraph
    values: Mapping[str, float]
    starts: Mapping[str, FloatArray]
    slow: Mapping[tuple[str, bool], float] = field(default_factory=dict)
    trained: float = 0.0
    few: float = 0.0
    held: float = 0.0
    unknown: float = 0.0
    settled: bool = True
    bent: Mapping[tuple[Kind, str], float] = field(default_factory=dict)
    innovations: tuple[FloatArray, ...] = ()
    expected: tuple[FloatArray, ...] = ()
    ways: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    fit: Callable[[Prior], Fit] = _not_fitted
    added: tuple[Added, ...] = ()


def with_orders(added: Sequence[Added]) -> tuple[Added, ...]:
    """Give what was added with the order of a lag that was added, too, as part of that."""
    orders = {item.what.place: item for item in added if item.what.kind is Kind.ORDER}
    lags = {item.what.place for item in added if item.what.kind is Kind.LAG}
    kept = (item for item in added if item.what.kind is not Kind.ORDER or item.what.place not in lags)
    return tuple(_in_stages(item, orders.get(item.what.place)) for item in kept)


def _in_stages(item: Added, order: Added | None) -> Added:
    if order is None or item.what.kind is not Kind.LAG:
        return item
    what = replace(item.what, order=round(order.what.size))
    return replace(item, what=what, trained=item.trained + order.trained, held=item.held + order.held)


def as_found(stand: Footing) -> BondGraph:
    """Give the plant with parameters and imperfections as they stand, about as sure as a fit to all would be."""
    return with_values(stand.graph, stand.values)


def with_values(graph: BondGraph, values: Mapping[str, float]) -> BondGraph:
    """Give a plant whose parameters have values, SI, by their names, about as sure as a fit to all would be."""
    parameters = []
    for item in graph.parameters:
        value = values.get(item.name, item.nominal)
        sure = replace(item, nominal=value, accuracy=min(LEAST_ACCURACY * abs(value), item.accuracy))
        parameters.append(item if item.nominal == 0.0 or value == 0.0 else sure)
    return replace(graph, parameters=tuple(parameters))


def in_time(graph: BondGraph) -> tuple[tuple[str | int | Hold, ...], ...]:
    """Give what of a plant lags, in how many stages, how fast it moves, and how inputs go on between rows."""
    inputs = ((item.lag, item.order, item.rate_limit, item.hold) for item in graph.inputs)
    return (*inputs, *((item.lag, item.order) for item in graph.sensors))


def with_noise(graph: BondGraph, noise: FloatArray) -> BondGraph:
    """Give a plant whose sensors have a noise (n_sensors,), SI."""
    sensors = zip(graph.sensors, noise.tolist(), strict=True)
    return replace(graph, sensors=tuple(replace(item, noise=sd) for item, sd in sensors))


def keys_of(graph: BondGraph) -> set[tuple[Kind, str]]:
    """Give what a plant declares as slow errors and as noise of inputs."""
    noisy = {(Kind.INPUT_NOISE, item.name) for item in graph.inputs if item.noise > 0.0}
    passing = {(Kind.TRANSIENT, f"{item.target} after {name}") for item in graph.slow_errors for name in item.after}
    return noisy | passing | {(kind_of(item), item.target) for item in graph.slow_errors}


def values_of(plant: FittedPlant, graph: BondGraph, stand: Footing) -> FloatArray:
    """Give the unknowns (n,) of another fit of a plant with what was added, with all that it seeks as it stands."""
    q, layout = plant.base.copy(), plant.layout
    for place, item in zip(plant.unknowns.places, plant.unknowns.parameters, strict=False):
        q[place] = stand.values.get(item.name, item.nominal) / item.scale
    first = layout.first_noise + layout.n_y
    q[layout.first_noise : first] = np.log([item.noise for item in stand.graph.sensors])
    for k, error in enumerate(graph.slow_errors, start=first):
        q[k] = np.log(stand.slow.get((error.target, error.relative), error.sd))
    return np.clip(values_at(plant, q), plant.unknowns.lower, plant.unknowns.upper)


def begun_as_found(begin: FitPoint, columns: Sequence[str], stand: Footing) -> FitPoint:
    """Give where a fit begins with the starts that a search has found for those that it fitted, the first recordings.

    columns : names of the states, and of a recording's own parameters, that are found
    """
    starts = begin.starts.copy()
    for column, name in enumerate(columns):
        found = stand.starts.get(name, starts[:0, column])
        starts[: len(found), column] = found
    return replace(begin, starts=starts)


def values_at(plant: FittedPlant, q: FloatArray) -> FloatArray:
    """Give the unknowns (n,) at q (n_q,)."""
    unknowns, n = plant.unknowns, plant.unknowns.n_theta
    values = np.array(q[unknowns.places])
    logs = unknowns.logarithmic[:n]
    values[:n] = np.where(logs, np.log(np.maximum(values[:n], 1e-300)), values[:n])
    return values
