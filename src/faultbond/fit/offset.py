"""Laws that are off by a constant beside their slow error.

Of a curve that is not quite that of the law, changes of what goes in show the slope, and what is left is a constant. A
slow error that stands for it is never about zero: to be quiet it has to be so large that it hides faults.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.fit.curves import bendable_parameters
from faultbond.fit.delays import HINT
from faultbond.fit.evidence import joint_courses
from faultbond.fit.foothold import Footing
from faultbond.fit.further import plainest, powers_beside
from faultbond.fit.imperfections import Imperfection, Kind, kind_of, parameter_name
from faultbond.fit.quiet_search import AGAIN, WORTH, Search
from faultbond.model.graph import SlowError

SIZES = (-6.0, -3.0, -1.5, 1.5, 3.0, 6.0)  # times the slow error
TRIED = 2  # offsets that are fitted in a round


def centred(search: Search, stand: Footing) -> Footing | None:
    """Give where the likeliest offset of a law leads that foretells what was held back better; None: none does.

    A constant may stand for a parameter of that law that goes with something, so that is asked for, too: of a pump
    whose pressure goes with the speed to the power 1.9, and by its law with the square, either is a gain.
    """
    search.tell("asking whether a law is off by a constant")
    for offset, promised in likely_offsets(search, stand)[:TRIED]:
        search.tell(f"fitting {offset.words}")
        found = search.ground_with(stand, (offset,)).climbed(stand, offset)
        if found.held - stand.held >= WORTH:
            rivals = [found, *_curves_instead(search, stand, offset)]
            return max(rivals, key=lambda item: item.held)
        search.refused[offset.key] = promised
    return None


def _curves_instead(search: Search, stand: Footing, offset: Imperfection) -> Iterator[Footing]:
    """Give where the likeliest curve of a parameter of the law leads, if one promises a gain."""
    acting = {item.parameter for item in bendable_parameters(search.all.model) if offset.place in item.acts_on}
    promised = [item for item in plainest(search.curves(stand)) if item[0].place in acting and item[1] > HINT]
    for curve, _ in promised[:1]:
        search.tell(f"fitting {curve.words}")
        more = [*powers_beside(stand, [curve]), curve]
        yield search.ground_with(stand, more).climbed(stand, *more)


def likely_offsets(search: Search, stand: Footing) -> list[tuple[Imperfection, float]]:
    """Give the laws with a slow error that seem to be off by a constant too, by about how much, the likeliest first.

    Each with what it seems to gain, nats: with all else as it stands, or as much as it costs that the slow error is
    about something else than zero in all recordings, if that is more: values of parameters that stand for the constant
    hide the former. What was tried in vain has to promise more than then.
    """
    usual, gains_of = search.asking(stand)
    averages = averages_of(search, stand)
    promised: list[tuple[Imperfection, float]] = []
    tried: list[Imperfection] = []
    for error in stand.graph.slow_errors:
        place = search.behind.get(error.target, error.target)
        if place not in search.laws or error.is_sensor or error.wanders:
            continue
        offset = Imperfection(kind=Kind.OFFSET, place=place, law=search.laws[place])
        if parameter_name(offset) in stand.values:
            continue
        unit = _unit(error, place, usual)  # of the slow error, in what the law gives as it is written
        means = averages[kind_of(error), error.target]
        mean, sd = float(np.mean(means)), stand.slow.get((error.target, error.relative), error.sd)
        promised.append((replace(offset, size=mean * unit), 0.5 * len(means) * (mean / sd) ** 2))
        tried += [replace(offset, size=times * error.sd * unit) for times in SIZES]
    gains = gains_of(tried) if tried else []
    best: dict[str, tuple[Imperfection, float]] = {}
    for offset, gain in (*promised, *zip(tried, gains, strict=True)):
        least = max(HINT, AGAIN * search.refused.get(offset.key, 0.0))
        if gain > best.get(offset.place, (offset, least))[1] and offset.size != 0.0:
            best[offset.place] = offset, float(gain)
    return sorted(best.values(), key=lambda item: item[1], reverse=True)


def averages_of(search: Search, stand: Footing) -> dict[tuple[Kind, str], FloatArray]:
    """Give each slow error on average in each recording that is fitted, (n_records,), in its unit."""
    q, layout = search.all.q_of(stand), search.all.layout
    plant, starts = search.all.plant(q), search.all.starts_of(stand)
    rows = [joint_courses(plant, record, start, q) for record, start in zip(search.trained, starts, strict=True)]
    first = layout.n_u + layout.n_x
    means = np.array([row[:, first : first + layout.n_b].mean(axis=0) for row in rows])
    return {(kind_of(item), item.target): means[:, k] for k, item in enumerate(search.all.graph.slow_errors)}


def _unit(error: SlowError, place: str, usual: Mapping[str, float]) -> float:
    """Give how much of what a law gives as it is written a slow error of 1 is.

    Of a law that is solved for what stands on its right: what is more on one side is less on the other, in parts.
    """
    if place == error.target:
        return usual.get(place, 0.0) if error.relative else 1.0
    return -usual.get(place, 0.0) / (1.0 if error.relative else usual.get(error.target, np.inf))
