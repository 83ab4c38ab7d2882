"""Where an input or a sensor may be before it is where no recording of a fit had it."""

BEYOND = 0.05  # of its range in these recordings by which it must lie beyond it
LEAST = 0.02  # of its largest value there in its own unit, at least


def familiar_range(fitted: tuple[float, float], zero: float) -> tuple[float, float]:
    """Give the ends within which a value is nothing new, SI.

    Parameters
    ----------
    fitted : where it was in the recordings of the fit, SI; infinite ends: that is not known
    zero : of its unit, SI: 20 degC are 20, not 293
    """
    lower, upper = fitted
    room = max(BEYOND * (upper - lower), LEAST * max(abs(lower - zero), abs(upper - zero)))
    return lower - room, upper + room
