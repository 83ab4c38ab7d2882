"""Settings of method `classic`, and the places where the thesis' printed formulas do not work.

Each such place is an `Erratum`. By default the reading that works is used; `Settings.printed` names those for which the
printed one is wanted, so that each can be shown. Source: thesis 4.6, 5.3, 5.4, 6.2, 6.6; docs/decisions/011-classic.md.
"""

from dataclasses import dataclass
from enum import Enum


class Erratum(Enum):
    """A printed formula, or a rule of the text, that does not do what the text says of it; the value says which."""

    TRUST = "5.3: P_A = 1/(1 + 10 T/N) freezes the first estimate; 1/(1 + 10 N T) works"
    ACCURACY = "5.3.1: n multiplies P_A, which then goes to 0; P_B = n (1 - 1/(1 + 10 N T)) works"
    WEIGHT = "5.4: W begins at 1/4 just above the limit; (O - limit)/(3 limit) begins at 0"
    PERCENT = "5.4: the error of figure 5.11 is in per cent, the index divides by the output once more"
    LIMIT = "5.4: the limit has no term for model errors; those that blending leaves are added to the noise"
    AVERAGE = "5.4: the average over outputs hides a fault that one output shows; any output alarms"
    STEPS = "5.4: waiting while the index falls does not stop alarms at steps; outputs are left out while they settle"
    SIXTEEN = "7.2.1: sixteen points have no centre; seventeen have"
    BAND = "4.6: a band as wide as the noise lets the worst samples through; three standard deviations work"
    INPUTS = "5.3: states from one sample use no outputs; the other outputs are used as well, as figure 7.13 needs"
    SIGNALS = "6.2: least squares on propagated signals is biased by their noise; blended states serve better"
    RANKING = "6.6: the lowest single always comes before every pair; a size that explains comes first"


WORKING: frozenset[Erratum] = frozenset()
PRINTED: frozenset[Erratum] = frozenset(Erratum)


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Settings of the thesis' algorithms.

    Parameters
    ----------
    printed : places at which the printed formula is used in place of the one that works
    noise : noise/signal ratio N; None: declared noise of each sensor over the rms of what it read so far
    accuracy : index n of the model's accuracy, 0 to 1; None: 1 less the accuracy declared in the model, such as 0.97
    length : points of the parabola, odd; 1: no prefilter
    lengths : points for single signals, by name
    band : half width of the band round the parabola, in standard deviations of the noise
    trust : factor 10 of the blend over time
    forgetting : F = 1 - forgetting * W
    limit : the error index may reach so many times the noise/signal ratio (and the model-error/signal ratio)
    decay : samples after which 37 % of the fall of the limit from 1 is left
    small : outputs below small * noise do not count, those above four times that fully
    patience : samples of a test before its parameters are estimated
    largest : size of the largest sets tested; None: as the model says
    """

    printed: frozenset[Erratum] = WORKING
    noise: float | None = None
    accuracy: float | None = None
    length: int = 17
    lengths: tuple[tuple[str, int], ...] = ()
    band: float = 3.0
    trust: float = 10.0
    forgetting: float = 0.02
    limit: float = 1.5
    decay: float = 95.0
    small: float = 2.0
    patience: int = 5
    largest: int | None = None
