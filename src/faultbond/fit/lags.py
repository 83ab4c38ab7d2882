"""Lags of many sensors at once, and one input that comes behind in place of all sensors that follow it."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from faultbond.errors import StructureError
from faultbond.fit.delays import HINT, late_ones
from faultbond.fit.evidence import likelihoods
from faultbond.fit.foothold import Added, Footing
from faultbond.fit.ground import LEAST_LAG
from faultbond.fit.imperfections import Imperfection, Kind, parameter_name, without_lag
from faultbond.fit.quiet_search import AGAIN, CLOSE, FEWEST, NO_LAG, WORTH, Search

MANY = 3  # lags of sensors that are asked for together,
SEVERAL = 2  # and of inputs beside them
NEXT_TO_NONE = 0.01  # samples: a lag that is none
NEARLY_ALL = 0.9  # of what the lags of sensors explain, that the lag of an input in their place has to
ALIKE = 1.3  # times the shortest, up to which lags are about alike


def is_new(search: Search, stand: Footing, lag: Imperfection, hint: float) -> bool:
    """Tell whether a lag or its like is to be asked for, that seems to gain by so many nats.

    A highest rate, of any command, is so until it is in vain; what has gained nothing where less spoke for it is not.
    """
    new = lag.kind is Kind.ORDER or parameter_name(lag) not in stand.values
    most = 0.0 if lag.kind is Kind.RATE_LIMIT else np.inf
    is_idle = hint <= AGAIN * search.idle.get(lag, -np.inf)
    return new and not is_idle and not search.refused.get(lag.key, -np.inf) >= most


def late_together(search: Search, stand: Footing) -> Footing | None:
    """Give where the lags of all sensors that seem to lag lead together, where many do; None: few do, or no better.

    Sensors that all come behind are the first thing that a model of a quick plant leaves out, and one by one they cost
    a round for a few of them. A lag that is none comes down to the least there is, and goes. Inputs are asked beside
    them, from there.
    """
    hints = [item for item in late_ones(stand, search.trained) if item[0].kind is Kind.LAG]
    new = [item for item, gain in hints if gain > HINT and is_new(search, stand, item, gain)]
    lags = [replace(item, size=search.step) for item in new if item.is_sensor]
    if len(lags) < MANY or search.asked_together >= {item.key for item in lags}:
        return None
    search.asked_together |= {item.key for item in lags}
    search.tell(f"fitting {', '.join(item.words for item in lags)} together, since many seem to lag")
    found = _together(search, stand, stand, lags)
    if found is None or not found.held - stand.held >= WORTH:
        return None
    search.by_then = found
    return _with_inputs(search, stand, found, [item for item in new if not item.is_sensor]) or found


def _with_inputs(search: Search, stand: Footing, late: Footing, inputs: Sequence[Imperfection]) -> Footing | None:
    """Give where lags of several inputs lead that have a part of those of all sensors; None: sensors alone are as good.

    On a linear plant all inputs that come behind are as all sensors that do, by as much. So where all inputs have what
    the sensors have in common a climb begins about as high, and from there each finds its own: a valve is slower than
    a pump. Of one input that tells nothing.
    """
    if len(inputs) < SEVERAL:
        return None
    sensors = [item.what for item in late.added[len(stand.added) :]]
    shared = min(item.size for item in sensors)
    left = [replace(item, size=max(item.size - shared, LEAST_LAG * search.step)) for item in sensors]
    lags = [*left, *(replace(item, size=shared) for item in inputs)]
    search.tell(f"fitting {', '.join(item.words for item in inputs)} beside them")
    begin = replace(stand, values={name: late.values[name] for name in stand.values})
    found = _together(search, stand, begin, lags)
    if found is None:
        return None
    more = len(found.added) - len(late.added)
    return found if found.held - late.held >= WORTH * max(more, 1) else None


def _together(search: Search, stand: Footing, begin: Footing, lags: Sequence[Imperfection]) -> Footing | None:
    """Give where lags lead together from a footing, those gone of which nothing is left; None: nowhere higher.

    All of what they gain is told of the first.
    """
    with suppress(StructureError):  # a lag may leave the equations without an order in which to solve them
        near = search.ground_with(begin, lags).climbed(begin, *lags, few=not search.few_are_all)
        lasting = [item.what for item in near.added[len(stand.added) :] if item.what.size > NO_LAG * search.step]
        gained, held = near.few - stand.few, near.held - stand.held
        if not lasting or not gained >= FEWEST or not held > -gained:  # what is held back loses more: no use to go on
            return None
        begin = replace(stand, values={name: near.values[name] for name in stand.values})
        is_found = search.few_are_all and len(lasting) == len(lags)
        found = near if is_found else search.ground_with(begin, lasting).climbed(begin, *lasting)
        return replace(found, added=(*stand.added, *_told_of_first(found.added[len(stand.added) :])))
    return None


def _told_of_first(added: Sequence[Added]) -> list[Added]:
    """Give what was added together, with what all of it gains told of the first."""
    first, *others = added
    return [first, *(replace(item, trained=0.0, held=0.0) for item in others)]


def of_an_input(search: Search, stand: Footing) -> Footing:
    """Give a footing with the lag of one input in place of those of several sensors, where that explains as much.

    An input that comes behind is on the sensors of a linear plant as if all of these did, about alike.
    """
    own = {item.name for item in search.graph.parameters}
    late = [item for item in stand.added if item.what.kind is Kind.LAG and parameter_name(item.what) not in own]
    late = [item for item in late if item.what.is_sensor and item.what.order == 1]
    sizes = [item.what.size for item in late]
    if len(late) < 2 or max(sizes) > ALIKE * min(sizes):
        return stand
    inputs = [
        Imperfection(kind=Kind.LAG, place=item.name, size=float(np.median(sizes)))
        for item in stand.graph.inputs
        if not item.lag
    ]
    base = replace(stand, added=tuple(item for item in stand.added if item not in late))
    for item in late:
        base = replace(base, graph=without_lag(base.graph, item.what))
    gained = sum(item.trained for item in late), sum(item.held for item in late)
    for lag in _as_likely(search, stand, [item.what for item in late], inputs):
        search.tell(f"fitting {lag.words} in place of {', '.join(item.what.words for item in late)}")
        with suppress(StructureError):
            found = search.ground_with(base, [lag]).climbed(base, lag)
            if found.held >= stand.held - max(WORTH, CLOSE * gained[1]):
                (new,) = found.added[len(base.added) :]
                return replace(found, added=(*base.added, replace(new, trained=gained[0], held=gained[1])))
    return stand


def _as_likely(
    search: Search, stand: Footing, late: Sequence[Imperfection], inputs: Sequence[Imperfection]
) -> list[Imperfection]:
    """Give the lags of inputs each of which explains, in place of those of sensors, nearly all that these explain.

    With all else as it stands, which costs nothing beside a climb.
    """
    with suppress(StructureError):
        ground = search.ground_with(stand, inputs)
        none = ground.q_of(stand)
        for item in (*late, *inputs):
            none = ground.with_one(none, replace(item, size=NEXT_TO_NONE * search.step))
        tried = np.array([none, *(ground.with_one(none, item) for item in inputs)])
        starts = ground.starts_of(stand)[: len(search.few)]
        without, *found = likelihoods(ground.plant(none), search.few, starts, tried).tolist()
        least = without + NEARLY_ALL * (stand.few - without)
        return [item for item, value in zip(inputs, found, strict=True) if value >= least]
    return []
