"""Whether a search may take steps in fewer parts: what that moves, beside the noise that is declared of the sensors.

Source: docs/decisions/004-discrete-step.md.
"""

from dataclasses import replace

import numpy as np

from faultbond.fit.identification import Fit
from faultbond.fit.likelihood import Likelihood
from faultbond.fit.objective import innovations_of

LITTLE = 5.0  # nats


def is_enough(found: Fit, coarse: Likelihood) -> bool:
    """Tell whether nothing could gain much by explaining what coarser steps move, be sensors as good as declared.

    coarse : filters of the fitted plant that take a step in fewer parts
    """
    unknowns, point = found.plant.unknowns, found.summit.point
    values = np.concatenate([point.values[: unknowns.n_theta], unknowns.nominal[unknowns.n_theta :]])
    point, rough = replace(point, values=values), replace(found.plant, engine=coarse)
    moved = 0.0
    for number, record in enumerate(found.records):
        (e, s), (e_rough, _) = (innovations_of(plant, record, point, number) for plant in (found.plant, rough))
        moved += 0.5 * float(np.sum((e_rough - e) ** 2 / s))
    return moved <= LITTLE  # not where the plant has no course
