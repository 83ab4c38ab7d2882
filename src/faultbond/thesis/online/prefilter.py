"""The prefilter: a parabola fitted to the samples about one, and a band round it outside which the sample counts.

Source: thesis 4.6. Ours: any number of points may be missing, and the band is in standard deviations of the noise.
"""

from functools import lru_cache

import numpy as np

from faultbond.arrays import FloatArray


@lru_cache(maxsize=64)
def parabola_weights(points: int, centre: int) -> FloatArray:
    """Give the weights by which samples add up to the value of their least squares parabola.

    Parameters
    ----------
    points : number of samples, one after the other
    centre : place among them of the sample whose value is sought

    Returns
    -------
    float array, shape (points,), oldest first
    """
    place = np.arange(points) - float(centre)
    weights: FloatArray = np.linalg.pinv(np.vander(place, min(3, points)))[-1]
    weights.setflags(write=False)
    return weights


def filtered(window: FloatArray, centre: int, band: float, *, relative: bool = False) -> float:
    """Give the value of the sample in the middle of a window.

    Parameters
    ----------
    window : float array, shape (points,), SI, oldest first; nan where missing
    centre : place of the sample
    band : SI; a sample farther from the parabola counts itself
    relative : whether the band is a part of the parabola's value

    Returns
    -------
    float
        nan where the sample is missing and fewer than half of the window are there
    """
    present = np.isfinite(window)
    if present.all():
        fit = float(parabola_weights(len(window), centre) @ window)
    elif 2 * int(present.sum()) < len(window) or present.sum() < 3:
        return float(window[centre])
    else:
        place = np.flatnonzero(present) - float(centre)
        fit = float(np.linalg.lstsq(np.vander(place, 3), window[present], rcond=None)[0][-1])
    own = float(window[centre])
    return own if abs(own - fit) > band * (abs(fit) if relative else 1.0) else fit
