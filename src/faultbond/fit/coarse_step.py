"""In how many times fewer parts a search may take steps: what that moves, beside the noise declared of the sensors.

Source: docs/decisions/004-discrete-step.md.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from faultbond.equations.step import StepModel
from faultbond.fit.identification import Fit
from faultbond.fit.likelihood import Likelihood
from faultbond.fit.objective import FitPoint, FittedPlant, innovations_of
from faultbond.fit.samples import HealthyRecording

LITTLE = 5.0  # nats
FEWER = (4, 2)  # times fewer parts that are tried

# Begins to build filters of a plant that take a step in so many times fewer parts; gives what waits for them.
Begin = Callable[[StepModel, int], Callable[[], Likelihood]]


def coarsest(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    point: FitPoint,
    model: StepModel,
    begin: Begin,
    now: int = 1,
) -> int:
    """Give in how many times fewer parts steps of a plant may be taken in a search.

    Parameters
    ----------
    plant, records, point : what is compared, with the noise that is declared of the sensors
    model : of the plant
    begin : builds coarser filters
    now : in how many times fewer parts the filters of the plant take steps; what it is if no coarser ones are enough
    """
    asked = [k for k in FEWER if k > now and ceil(model.substeps / k) < ceil(model.substeps / (k // 2))]
    begun = [(k, begin(model, k)) for k in asked]
    return next((k for k, built in begun if is_enough(plant, records, point, built())), now)


def is_enough(plant: FittedPlant, records: Sequence[HealthyRecording], point: FitPoint, coarse: Likelihood) -> bool:
    """Tell whether nothing could gain much by explaining what coarser steps move, be sensors as good as declared.

    coarse : filters of the plant that take a step in fewer parts
    """
    rough, moved = replace(plant, engine=coarse), 0.0
    for number, record in enumerate(records):
        (e, s), (e_rough, _) = (innovations_of(item, record, point, number) for item in (plant, rough))
        moved += 0.5 * float(np.sum((e_rough - e) ** 2 / s))
    return moved <= LITTLE  # not where the plant has no course


def as_declared(found: Fit) -> FitPoint:
    """Give where a fit has led, with noise and slow errors as they are declared."""
    unknowns, point = found.plant.unknowns, found.summit.point
    values = np.concatenate([point.values[: unknowns.n_theta], unknowns.nominal[unknowns.n_theta :]])
    return replace(point, values=values)
