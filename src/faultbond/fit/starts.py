"""Where the search begins: the starts of the recordings, solved as the monitor does."""

from collections.abc import Sequence

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.fit.objective import FittedPlant, Point
from faultbond.fit.samples import Record
from faultbond.fit.scoring import START_PRIOR
from faultbond.runtime.monitor import START_SAMPLES
from faultbond.runtime.start import solve_start

_LEAST_PART = 1e-4  # of a start's size, in which it is found at least


def begin_at(plant: FittedPlant, records: Sequence[Record], spec: EngineSpec, engine: Engine) -> Point:
    """Give the nominal plant with the starts that the first samples of each recording show.

    Parameters
    ----------
    plant, records : what is fitted to what
    spec, engine : of the same model, as the monitor runs it
    """
    values = plant.unknowns.nominal.copy()
    free, n_free = list(plant.free), len(plant.free)
    starts, sizes = np.zeros((len(records), plant.n_own)), np.ones((len(records), plant.n_own))
    starts[:, n_free:] = plant.base[[place for place, _ in plant.own]]
    sizes[:, n_free:] = [sd / START_PRIOR for _, sd in plant.own]
    for r, record in enumerate(records):
        if not free:
            break
        mean, covariance = solve_start(spec, engine, _packed(record, plant, spec))
        sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))[free]
        starts[r, :n_free] = mean[free]
        size = np.maximum(sd, _LEAST_PART * np.abs(mean[free]))
        sizes[r, :n_free] = np.where(np.isfinite(size) & (size > 0.0), size, 1.0)
    return Point(values=values, starts=starts, sizes=sizes)


def _packed(record: Record, plant: FittedPlant, spec: EngineSpec) -> FloatArray:
    """Give the first samples as the engine takes them."""
    own, place = plant.layout.sample_fields, spec.sample_fields
    used = np.flatnonzero(record.use.any(axis=1))
    last = int(used[min(START_SAMPLES, len(used)) - 1]) + 1 if len(used) else START_SAMPLES
    first = record.samples[:last]
    packed = np.zeros((len(first), spec.n_sample))
    for name in ("dt", "u_before", "u", "y", "use", "kick"):
        packed[:, place[name]] = first[:, own[name]]
    packed[:, place["scale"]] = 1.0
    return packed
