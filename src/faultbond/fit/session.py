"""From a model and its recordings to what a fit needs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from faultbond.contract.core_settings import core_settings
from faultbond.contract.samples import Sample
from faultbond.equations.step import StepModel
from faultbond.errors import ModelError
from faultbond.fit.ascent import START_PRIOR
from faultbond.fit.likelihood import Likelihood, build_begin, known_starts, layout_of, nominal_q
from faultbond.fit.objective import FitPoint, FittedPlant, likelihood_value
from faultbond.fit.samples import HealthyRecording, healthy_recording, judged_parts
from faultbond.fit.unknowns import unknowns_of
from faultbond.model.graph import BondGraph, Parameter
from faultbond.model.source import closest
from faultbond.runtime.core import Core

_LEAST_PART = 1e-4  # of a start's size, in which it is found at least


def free_parameters(
    graph: BondGraph, fixed: Sequence[str] = (), free: Sequence[str] | None = None, own: Sequence[str] = ()
) -> tuple[tuple[int, Parameter], ...]:
    """Give the parameters to be found, with their places.

    Parameters
    ----------
    graph : the plant
    fixed : parameters that are known
    free : the only ones to be found; None: all that are not fixed and whose accuracy is not 0
    own : found for each recording by itself

    Raises
    ------
    ModelError
        Where a name is no parameter, stands in both lists, or a parameter with accuracy 0 is to be found.
    """
    known = {item.name: item for item in graph.parameters}
    for name in (*fixed, *(free or ()), *own):
        if name not in known:
            near = closest(name, known) or f"it has {', '.join(known) or 'none'}"
            raise ModelError(f"{graph.file}: no parameter `{name}`; {near}")
        if name in fixed and name in (*(free or ()), *own):
            raise ModelError(f"parameter {name} is both fixed and free; name it once")
    for name in (*(free or ()), *own):
        if known[name].accuracy <= 0.0:
            raise ModelError(f"parameter {name} has accuracy 0, so it is known exactly; state how well it is known")
    wanted = {*free, *own} if free is not None else {name for name, item in known.items() if item.accuracy > 0.0}
    return tuple((k, item) for k, item in enumerate(graph.parameters) if item.name in wanted - set(fixed))


def build_fit(
    model: StepModel,
    likelihood: Likelihood,
    core: Core,
    recordings: Sequence[tuple[str, Sequence[Sample]]],
    parameters: tuple[tuple[int, Parameter], ...],
    own: tuple[str, ...] = (),
) -> tuple[FittedPlant, tuple[HealthyRecording, ...], FitPoint]:
    """Give the plant, its recordings, and where the search begins.

    Parameters
    ----------
    model : the plant in discrete time
    likelihood : runs its filters
    core : of the same model, as the monitor runs it
    recordings : names and grid points
    parameters : those to be found, with their places; noise of sensors and sizes of slow errors are found beside
    own : names of those that each recording has for itself; each part of it where the model does not hold all the time
    """
    layout, base, known = layout_of(model), nominal_q(model), known_starts(model)
    noises = tuple(range(layout.first_noise, layout.first_noise + layout.n_y + layout.n_b))
    plant = FittedPlant(
        sensors=tuple(item.name for item in model.plant.graph.sensors),
        layout=layout,
        engine=likelihood,
        begin=build_begin(model),
        base=base,
        unknowns=unknowns_of(layout, base, tuple(item for item in parameters if item[1].name not in own), noises),
        free=tuple(k for k in range(layout.n_x) if k not in known),
        own=tuple((k, item.accuracy / abs(item.scale)) for k, item in parameters if item.name in own),
    )
    parts = (part for name, points in recordings for part in judged_parts(name, points, core))
    records = tuple(healthy_recording(name, points, core) for name, points in parts)
    return plant, records, begin_at(plant, records, core)


def begin_at(plant: FittedPlant, records: Sequence[HealthyRecording], core: Core) -> FitPoint:
    """Give the nominal plant with the starts that the first samples of each recording show.

    Parameters
    ----------
    plant, records : what is fitted to what
    core : of the same model, as the monitor runs it
    """
    values = plant.unknowns.nominal.copy()
    free, n_free = list(plant.free), len(plant.free)
    starts, sizes = np.zeros((len(records), plant.n_own)), np.ones((len(records), plant.n_own))
    starts[:, n_free:] = plant.base[[place for place, _ in plant.own]]
    sizes[:, n_free:] = [sd / START_PRIOR for _, sd in plant.own]
    first = int(core_settings()["START_SAMPLES"])
    for r, record in enumerate(records):
        if not free:
            break
        used = np.flatnonzero(record.use.any(axis=1))
        last = int(used[min(first, len(used)) - 1]) + 1 if len(used) else first
        mean, covariance = core.solve_start(record.packed[:last])
        sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))[free]
        starts[r, :n_free] = mean[free]
        size = np.maximum(sd, _LEAST_PART * np.abs(mean[free]))
        sizes[r, :n_free] = np.where(np.isfinite(size) & (size > 0.0), size, 1.0)
    return FitPoint(values=values, starts=starts, sizes=sizes)


def likelier_begin(
    plant: FittedPlant, records: Sequence[HealthyRecording], begin: FitPoint, other: FitPoint
) -> FitPoint:
    """Give the values of `begin` with the starts that it or another has for each recording, whichever are likelier.

    Behind a sensor that lags long the first samples hardly show a state: by a lag of two minutes that a search had
    found so far a winding at 300 K began at 69 K, from where the plant had no finite course.
    """
    starts, sizes = begin.starts.copy(), begin.sizes.copy()
    for r, record in enumerate(records):
        rows = [(item.starts[r], item.sizes[r]) for item in (begin, other)]
        points = [replace(begin, starts=start[None], sizes=size[None]) for start, size in rows]
        values = [likelihood_value(plant, (record,), point) for point in points]
        starts[r], sizes[r] = rows[int(np.argmax(values))]
    return replace(begin, starts=starts, sizes=sizes)
