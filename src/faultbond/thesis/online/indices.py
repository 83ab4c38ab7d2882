"""Blend of states, error index and its limit: the formulas of thesis 5.3 and 5.4, as they work or as printed."""

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.thesis.online.settings import Erratum, Settings


def trust_in_samples(settings: Settings, noise: float, accuracy: float, samples: int) -> float:
    """Give P_A, the share of the states that several samples give; the rest is P_B.

    Parameters
    ----------
    settings : which formula
    noise : noise/signal ratio N
    accuracy : index n of the model's accuracy
    samples : T, number of samples since monitoring began

    Source
    ------
    Thesis 5.3 (1/(1 + 10 T/N)) and 5.3.1 (n times that). Working readings: 1/(1 + 10 N T), and n belongs to P_B, so
    that 1 - n is left in the end.
    """
    if Erratum.TRUST in settings.printed:
        falling = 1.0 / (1.0 + settings.trust * samples / max(noise, 1e-12))
    else:
        falling = 1.0 / (1.0 + settings.trust * noise * samples)
    if Erratum.ACCURACY in settings.printed:
        return accuracy * falling
    return 1.0 - accuracy * (1.0 - falling)


def weights_of(settings: Settings, size: FloatArray, small: FloatArray) -> FloatArray:
    """Give W, the weight of each output for its size, shape (n_outputs,).

    Parameters
    ----------
    settings : which formula
    size : |O|, shape (n_outputs,), SI
    small : the limit below which an output does not count, shape (n_outputs,), SI

    Source
    ------
    Thesis 5.4. Working reading: (O - limit)/(3 limit) between limit and 4 limit, which begins at 0.
    """
    unit = np.where(small > 0.0, small, 1.0)
    if Erratum.WEIGHT in settings.printed:
        rising = 1.0 - (4.0 * small - size) / (4.0 * unit)
    else:
        rising = (size - small) / (3.0 * unit)
    inside = np.where(size < 4.0 * small, np.minimum(rising, 1.0), 1.0)
    return np.where(small > 0.0, np.where(size < small, 0.0, inside), 1.0)


def add_error(
    settings: Settings, sums: FloatArray, measured: FloatArray, error: FloatArray, weight: FloatArray
) -> FloatArray:
    """Take one sample into the two sums of the error index.

    Parameters
    ----------
    settings : forgetting, and which formula
    sums : numerator and denominator, shape (2, n_outputs, n_lanes), SI
    measured : O, shape (n_outputs,), SI
    error : E, absolute error of each output, shape (n_outputs, n_lanes), SI
    weight : W, shape (n_outputs,); 0: the sample changes nothing

    Source
    ------
    Thesis 5.4, the fraction of sums, recursively: F = 1 - 0.02 W.
    """
    size = np.abs(measured)[:, None]
    if Erratum.PERCENT in settings.printed:
        error = np.where(size > 0.0, error / size, 0.0)
    kept = (1.0 - settings.forgetting * weight)[:, None]
    fresh = np.stack([error, np.broadcast_to(size, error.shape)]) * weight[:, None]
    return np.asarray(kept * sums + fresh)


def indices_of(sums: FloatArray) -> FloatArray:
    """Give the error index, a part of the output, of sums (2, n_outputs, n_lanes); 0 as long as nothing counted."""
    return np.where(sums[1] > 0.0, sums[0] / np.where(sums[1] > 0.0, sums[1], 1.0), 0.0)


def limits_of(settings: Settings, noise: FloatArray, model: FloatArray, samples: int) -> FloatArray:
    """Give the limit of the error index of each output, shape (n_outputs,), a part of the output.

    Parameters
    ----------
    settings : factor, decay, and which formula
    noise : noise/signal ratio of each output, shape (n_outputs,)
    model : error/signal ratio of each output that the declared accuracy of the model leaves, shape (n_outputs,)
    samples : T, number of samples since monitoring began

    Source
    ------
    Thesis 5.4: falls from 100 % to 1 1/2 times the noise/signal ratio; the course is not stated, ours is exponential.
    Working reading: noise and model errors together, since mixing states does not correct every output.
    """
    ratio = noise if Erratum.LIMIT in settings.printed else noise + model
    final = np.minimum(settings.limit * ratio, 1.0)
    return np.asarray(final + (1.0 - final) * np.exp(-samples / settings.decay))


def exceeds(settings: Settings, index: FloatArray, before: FloatArray, limit: FloatArray) -> BoolArray:
    """Tell which outputs call for an alarm: above the limit and not decreasing (thesis 5.4).

    Parameters
    ----------
    settings : whether outputs are averaged
    index, before : error index now and one sample earlier, shape (n_outputs,), parts of the output
    limit : shape (n_outputs,), parts of the output

    Source
    ------
    Thesis 5.4, where the indices of all outputs are averaged. Working reading: any output.
    """
    if Erratum.AVERAGE in settings.printed:
        mean, was = index.mean(), before.mean()
        return np.full(index.shape, bool(mean > limit.mean() and mean >= was))
    return np.asarray((index > limit) & (index >= before))
