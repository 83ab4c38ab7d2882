"""Laws that are off by a constant beside their slow error.

Of a curve that is not quite that of the law, changes of what goes in show the slope, and what is left is a constant. A
slow error that stands for it is never about zero: to be quiet it has to be so large that it hides faults.
"""

from dataclasses import replace

from faultbond.fit.delays import HINT
from faultbond.fit.foothold import Footing
from faultbond.fit.imperfections import Imperfection, Kind, parameter_name
from faultbond.fit.quiet_search import WORTH, Search

SIZES = (-6.0, -3.0, -1.5, 1.5, 3.0, 6.0)  # times the slow error


def centred(search: Search, stand: Footing) -> Footing | None:
    """Give where the likeliest offset of a law leads that foretells what was held back better; None: none does."""
    search.tell("asking whether a law is off by a constant")
    for offset in likely_offsets(search, stand):
        search.tell(f"fitting {offset.words}")
        found = search.ground_with(stand, (offset,)).climbed(stand, offset)
        if found.held - stand.held >= WORTH:
            return found
        search.refused.add(offset.key)
    return None


def likely_offsets(search: Search, stand: Footing) -> list[Imperfection]:
    """Give the laws with a slow error that seem to be off by a constant too, by about how much, the likeliest first."""
    usual, gains_of = search.asking(stand)
    tried = []
    for error in stand.graph.slow_errors:
        if error.target not in search.laws or error.is_sensor or error.wanders:
            continue
        offset = Imperfection(kind=Kind.OFFSET, place=error.target, law=search.laws[error.target])
        if parameter_name(offset) in stand.values or offset.key in search.refused:
            continue
        sd = error.sd * usual.get(error.target, 0.0) if error.relative else error.sd
        tried += [replace(offset, size=times * sd) for times in SIZES if sd > 0.0]
    if not tried:
        return []
    best: dict[str, tuple[float, Imperfection]] = {}
    for offset, gain in zip(tried, gains_of(tried), strict=True):
        if gain > max(HINT, best[offset.place][0] if offset.place in best else HINT):
            best[offset.place] = gain, offset
    return [offset for _, offset in sorted(best.values(), key=lambda item: item[0], reverse=True)]
