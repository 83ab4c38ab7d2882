"""How well each lane of the bank explains what came after the alarm: the detector's own sums, for every lane.

A model that explains the plant has white innovations, whatever it is a model of. So a lane whose sums cross the limit
that raises alarms is contradicted by the data, and if the best lane is, none of the modelled faults explains them.
A fault that comes and goes is always right while it is gone; so what has once contradicted it does so from then on.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.contract.spec import EngineSpec
from faultbond.runtime.cusum import climb, clip


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Misfit:
    """Two-sided sums of the innovations of each lane, and the sample after which each began.

    sums, since : (2, n_outputs, n_lanes): up, down
    """

    sums: FloatArray
    since: FloatArray


def no_misfit(spec: EngineSpec, n_lanes: int, index: int) -> Misfit:
    """Give the sums of lanes that begin after sample `index`."""
    shape = (2, len(spec.outputs), n_lanes)
    return Misfit(sums=np.zeros(shape), since=np.full(shape, float(index)))


def add_misfit(
    spec: EngineSpec,
    misfit: Misfit,
    use: BoolArray,
    innovations: FloatArray,
    index: int,
    switched: int | None = None,
) -> Misfit:
    """Give the sums after one more sample.

    Parameters
    ----------
    spec : the model
    misfit : the sums before
    use : bool array, shape (n_outputs,)
        Sensors whose sums go on, as those of the alarm do.
    innovations : float array, shape (2 * n_outputs, n_lanes)
        Of each lane, see `Engine.advance`.
    index : number of the sample
    switched : the first of the lanes whose fault comes and goes; these come last. None: there are none
    """
    settings, n_y = spec.thresholds, len(spec.outputs)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        score = np.nan_to_num(innovations[:n_y] / np.sqrt(innovations[n_y:]), nan=settings.cusum_clip)
    sums = climb(misfit.sums, clip(settings, score), settings.cusum_drift)
    sums = np.where(use[:, None], sums, misfit.sums)
    comes_and_goes = np.arange(score.shape[1]) >= (score.shape[1] if switched is None else switched)
    contradicted = comes_and_goes & (misfit.sums > settings.cusum_limit)
    sums = np.where(contradicted, np.maximum(sums, misfit.sums), sums)
    return Misfit(sums=sums, since=np.where(sums <= 0.0, float(index), misfit.since))


def begin_again(misfit: Misfit, lanes: FloatArray, index: int) -> Misfit:
    """Give the sums with those of some lanes, shape (n_lanes,) of bool, begun anew after sample `index`."""
    return Misfit(sums=np.where(lanes, 0.0, misfit.sums), since=np.where(lanes, float(index), misfit.since))
