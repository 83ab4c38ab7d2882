"""A round of the search: the imperfection that foretells best what was held back, and those that belong beside it.

What each possible imperfection would gain is asked on a grid of sizes and memories with all else as it stands; the best
few are fitted together with everything else; of those that foretell the recordings that were held back about equally
well, the one is kept that leaves the parameters best known. Others of the round that gain beside it what they gain
alone are kept with it.

Source: Rao 1948 and Akaike 1974 in spirit (one term at a time, by likelihood); held-back data as in Stone, J. Royal
Statistical Society B 36 (1974) 111.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from faultbond.errors import StructureError
from faultbond.fit.curves import FOREIGN
from faultbond.fit.delays import HINT, held_late, late_ones, other_holds
from faultbond.fit.evidence import CLOSE_ENOUGH
from faultbond.fit.foothold import Added, Footing, keys_of
from faultbond.fit.ground import NEARLY, Ground
from faultbond.fit.imperfections import Imperfection, Kind, parameter_name, power_of
from faultbond.fit.lags import is_new, late_together
from faultbond.fit.quiet_search import AGAIN, CLOSE, FEWEST, WORTH, Search

TRIED = 3  # of the best of each kind, in each round
STAGES = 4  # of a lag that is asked for where one of a single stage is likely: a dead time is nearer to it
PROMISING = 0.15  # of what the best would gain with all else as it stands; what would gain less is not fitted
WORTHY = 0.1  # of the best gain; what gains as much may be kept with the best
BESIDE = 0.5  # of what others gain alone they gain beside the best where each has a cause of its own
MOST_BESIDE = 5  # kept in a round; of more than `FEW_BESIDE` those that hardly explain the same
FEW_BESIDE = 3
FEWER = {5: 3, 4: 3, 3: 2}  # tried where so many do not go together
SURE = 100.0  # nats; of a curve that is worth as much where fitted, what is held back loses more than too little


def better(search: Search, stand: Footing) -> Footing | None:
    """Give where the best further imperfection leads; None: none foretells what was held back better.

    Where much seems to lag all of that is asked for first, together. On the way `search` knows what is best by then,
    for who has to end before.
    """
    search.by_then = _round(search, stand)
    return search.by_then


def _round(search: Search, stand: Footing) -> Footing | None:
    """Give what `better` gives."""
    if (late := late_together(search, stand)) is not None:
        return late
    if not (tried := worth_fitting(search, stand)):
        return None
    search.tell(f"fitting {', '.join(item.words for _, item, _ in tried)}")
    climbed: list[Footing] = []
    for ground, item, _ in tried:
        least = max([CLOSE_ENOUGH, *(NEARLY * (other.few - stand.few) for other in climbed)])
        climbed.append(ground.climbed(stand, *powers_beside(stand, [item]), item, few=True, least=least))
    gains = [item.held - stand.held if np.isfinite(item.held) else -np.inf for item in climbed]
    most = max(gains, default=-np.inf)
    if not most >= WORTH:
        return None
    plain = plainest([(item.added[-1].what, gain) for item, gain in zip(climbed, gains, strict=True)])
    found = gentlest(stand, [item for item in climbed if item.added[-1].what in {what for what, _ in plain}])
    near = [item for item in found if item.held - stand.held >= most - _as_good(most)]
    best = _own_instead(stand, min(near, key=lambda item: item.unknown), found)
    search.by_then = best
    hidden = [item for item in found if best.added[-1].may_have(item.added[-1], WORTHY)]
    worth = {item.added[-1].what.key for item, gain in zip(climbed, gains, strict=True) if gain >= WORTH}
    worth |= {item.added[-1].what.key for item in hidden}
    for _, what, promised in tried:
        if what.key not in worth:  # in no way in which it was tried
            search.refused[what.key] = max(promised, HINT)
    # What gains as much as the best is likely to explain the same, so it is the last to be tried beside it. Lags, holds
    # and curves are first beside a slow error, which may stand for them.
    slow = best.added[-1].what.is_slow
    order = sorted(found, key=lambda item: (slow and not item.added[-1].what.is_definite, item in near, -item.held))
    others = [item for item in order if item is not best]
    worthy = [item for item in others if item.held - stand.held >= max(WORTH, WORTHY * most) or item in hidden]
    if not slow:  # a slow error also takes what a lag explains that is not there yet
        worthy = [item for item in worthy if not item.added[-1].what.is_slow]
    if (joint := _joint(search, stand, best, worthy)) is not None:
        return joint
    good = {what.key: what for item in near for what in (item.added[-1].what, *item.added[-1].alike)}
    alike = tuple(what for key, what in good.items() if key != best.added[-1].what.key)
    more = _with_powers(stand, [replace(best.added[-1], alike=alike)])
    alone = _without_needless(search, stand, added_together(search, _nearer(stand, best), more), more)
    return alone if alone.held - stand.held >= WORTH else None  # it may have gained by other values of parameters


def held_until(search: Search, stand: Footing) -> Footing | None:
    """Give where it leads that rows hold what acted until then, where sensors clearly move in the very row of an input.

    That is a logger's doing, so it is asked before what the plant may lack, and of all such inputs together. It has no
    number of its own, so it is judged by the recordings that are fitted: while much is missing, a model that
    fits them better is surer, and foretells others worse. None: nothing looks so, or that is no better.
    """
    clear = held_late(stand, search.trained, search.all.model.direct)
    early = [item for item in clear if item.key not in search.refused]
    if not early:
        return None
    search.tell(f"fitting {', '.join(item.words for item in early)}, since sensors move in the very row")
    found = search.ground_with(stand, early).climbed(stand, *early)
    if not found.trained - stand.trained >= FEWEST:
        search.refused |= dict.fromkeys((item.key for item in early), HINT)
        return None
    first, *others = found.added[len(stand.added) :]
    return replace(found, added=(*stand.added, first, *(replace(item, trained=0.0, held=0.0) for item in others)))


def powers_beside(stand: Footing, items: Sequence[Imperfection]) -> list[Imperfection]:
    """Give the powers that are fitted with bows, over the same: nobody knows where these have their ends."""
    powers = (power_of(item) for item in items if item.kind is Kind.BOW)
    return [item for item in powers if parameter_name(item) not in stand.values]


def _with_powers(stand: Footing, more: Sequence[Added]) -> list[Added]:
    """Give what is to be added, behind the first, with the powers of bows that are not there yet."""
    keys = {item.what.key for item in more}
    powers = (item for item in powers_beside(stand, [item.what for item in more]) if item.key not in keys)
    return [more[0], *(Added(what=item, trained=0.0, held=0.0) for item in powers), *more[1:]]


def plainest(asked: Sequence[tuple[Imperfection, float]]) -> list[tuple[Imperfection, float]]:
    """Give what explains something, with its gain, nats, but what is more than another that explains as much."""
    return [
        (item, gain)
        for item, gain in asked
        if not any(item.is_more_than(other) and least >= gain - _as_good(gain) for other, least in asked)
    ]


def gentlest(stand: Footing, found: Sequence[Footing]) -> list[Footing]:
    """Give where things lead; of curves of one parameter that explain about as much the gentlest, the others with it.

    A pressure that healthy data move by a tenth has a power of 2 for a valve that opens a little otherwise than its law
    says: a fault that moves the pressure farther would be told together with a change of the valve.
    """
    kept = list(found)
    curves = [item for item in found if item.added[-1].what.by]
    for place in dict.fromkeys(item.added[-1].what.place for item in curves):
        own = [item for item in curves if item.added[-1].what.place == place]
        most = max(item.held for item in own)
        near = [item for item in own if item.held >= most - _as_good(most - stand.held)]
        if len(near) == 1:
            continue
        best = min(near, key=lambda item: (item.added[-1].what.foreign, _steepness(stand, item)))
        alike = tuple(item.added[-1].what for item in near if item is not best)
        named = replace(best, added=(*best.added[:-1], replace(best.added[-1], alike=alike)))
        kept = [named if item is best else item for item in kept if item is best or item not in near]
    return kept


def _steepness(stand: Footing, found: Footing) -> float:
    """Give how far twice the usual size would move the logarithm of a parameter by the curves that are new."""
    new = (item.what for item in found.added[len(stand.added) :])
    return sum(item.bend.steepness(item.size) for item in new if item.bend)


def _as_good(most: float) -> float:
    """Give by how many nats something may gain less than the most and be as good."""
    return max(FEWEST, CLOSE * most)


def _own_instead(stand: Footing, best: Footing, found: Sequence[Footing]) -> Footing:
    """Give the curve of the same parameter over what its laws speak of, where that explains nearly as much.

    An input that drives a flow is on healthy data as good as the flow; only a fault of the flow tells them apart, and
    is then found too large.
    """
    what, most = best.added[-1].what, _gain(stand, best)
    own = [
        item
        for item in found
        if item.added[-1].what.kind is what.kind
        and item.added[-1].what.place == what.place
        and not item.added[-1].what.foreign
        and FOREIGN * _gain(stand, item) >= most
    ]
    return max(own, key=lambda item: _gain(stand, item)) if what.foreign and own else best


def _gain(stand: Footing, item: Footing) -> float:
    """Give what recordings gain, those fitted and those held back, nats."""
    return item.few - stand.few + item.held - stand.held


def worth_fitting(search: Search, stand: Footing) -> list[tuple[Ground, Imperfection, float]]:
    """Give what is worth to be fitted, each with a plant that may have it and its gain with the rest as it is.

    Slow errors, lags and curves are weighed among their like: a slow error takes at once what a lag does with others
    only. What was tried in vain is tried once more where it promises more than then: something else is there now.
    """
    slow = _likeliest(search, [item for item in search.profile(stand) if item[1] > 0.0])
    hints = {item: gain for item, gain in late_ones(stand, search.trained) if gain > HINT}
    lags = [item for item, gain in hints.items() if is_new(search, stand, item, gain)]
    between = [
        item for item in other_holds(stand, search.trained, search.all.model.direct) if item.key not in search.refused
    ]
    orders = [item for item in lags if item.kind is Kind.ORDER]
    asked = [item for item in (*lags, *between[:1]) if item not in orders[TRIED:]]
    late = _weighed(search, stand, asked)
    search.idle |= {item: hints[item] for item, _, gain in late if item in hints and gain < FEWEST}
    best = {item.key: (item, gain) for _, item, gain in sorted(late, key=lambda one: one[2])}
    likely = _likeliest(search, plainest(list(best.values())))
    long = [item for item, _ in likely if item.kind is Kind.LAG and item.size > search.step]
    staged = _weighed(search, stand, [replace(item, order=STAGES) for item in long[:1]])
    likely += _likeliest(search, [(item, gain) for _, item, gain in staged])
    tried = [(search.ground_with(stand, (item,)), item, gain) for item, gain in plainest(likely)]
    curves = _likeliest(search, plainest(search.curves(stand)))
    bent = [(search.ground_with(stand, [*powers_beside(stand, [item]), item]), item, gain) for item, gain in curves]
    tried = [*bent, *tried]
    if slow:
        shared = search.ground_with(stand, [item for item, _ in slow if item.key not in keys_of(stand.graph)])
        tried = [*((shared, *item) for item in slow), *tried]
    return tried


def _weighed(
    search: Search, stand: Footing, asked: Sequence[Imperfection]
) -> list[tuple[Imperfection, Imperfection, float]]:
    """Give lags and their like as they are asked, as they explain most with all else as it stands, and what that gains.

    The gain in nats.
    """
    grounds = []
    for item in asked:
        with suppress(StructureError):  # a lag may leave the equations without an order in which to solve them
            grounds.append((search.ground_with(stand, (item,)), item))
    return [(item, *ground.best_late(stand, item)) for ground, item in grounds]


def _likeliest(search: Search, asked: Sequence[tuple[Imperfection, float]]) -> list[tuple[Imperfection, float]]:
    """Give what promises most of its like, and more than when it was tried in vain."""
    found = [(item, gain) for item, gain in asked if gain > AGAIN * search.refused.get(item.key, -np.inf)]
    most = max((gain for _, gain in found), default=0.0)
    found = [(item, gain) for item, gain in found if gain >= PROMISING * most]
    return sorted(found, key=lambda item: item[1], reverse=True)[:TRIED]


def _joint(search: Search, stand: Footing, best: Footing, others: Sequence[Footing]) -> Footing | None:
    """Give where the best and others, each of another place, lead together; None: they gain no more than one does.

    What explains the same thing gains together hardly more than alone; that is not added twice. A slow error that
    is best may stand for lags, also one of its own place: they are asked for beside it, and it goes where they gain
    as much without it.
    """
    places = {(best.added[-1].what.place, best.added[-1].what.is_definite)}
    chosen = [best]
    for item in others:
        place = item.added[-1].what.place, item.added[-1].what.is_definite
        is_near = len(chosen) >= FEW_BESIDE and not _is_apart(item.added[-1].what, chosen)
        if len(chosen) < MOST_BESIDE and place not in places and not is_near:
            chosen.append(item)
            places.add(place)
    while len(chosen) > 1:
        more = _with_powers(stand, [item.added[-1] for item in chosen])
        search.tell(f"fitting {', '.join(item.what.words for item in more)} together")
        with suppress(StructureError):
            found = added_together(search, stand, more)
            if _go_together(stand, found, more):
                search.by_then = found
                return _without_needless(search, stand, found, more)
        chosen = chosen[: FEWER.get(len(chosen), 0)]
    return None


def _go_together(stand: Footing, found: Footing, more: Sequence[Added]) -> bool:
    """Tell whether things gain together, as in `found`, what each with a cause of its own gains beside the best.

    Of what is held back; or of all recordings, where what is held back loses little beside the best: while a plant
    still lacks much, each recording asks for other values that make up for it.
    """
    best, *others = more
    slow = best.what.is_slow  # it has much of what lags, holds and curves gain
    asked = sum(WORTH if slow and item.what.is_definite else BESIDE * item.held for item in others)
    held = found.held - stand.held
    if held >= best.held + asked:
        return True
    in_all = best.trained + best.held + BESIDE * sum(item.trained + item.held for item in others)
    return held >= (1.0 - WORTHY) * best.held and found.few - stand.few + held >= in_all


def _is_apart(what: Imperfection, chosen: Sequence[Footing]) -> bool:
    """Tell whether something says what happens, and if that goes with a signal, that nothing chosen goes with it."""
    return what.is_definite and (not what.by or all(item.added[-1].what.by != what.by for item in chosen))


def _without_needless(search: Search, stand: Footing, found: Footing, more: Sequence[Added]) -> Footing:
    """Give a footing without its slow error where lags, holds and curves foretell as much alone, and such a curve.

    A curve is left out to see, but where the hill is so steep that it is clear what would come of that.
    """
    definite = [item for item in more if item.what.is_definite]
    needless = [more[0]] if more[0].what.is_slow and len(definite) == len(more) - 1 else []
    for item in (*needless, *(item for item in more[1:] if item.what.by)):
        others = [known for known in found.added[len(stand.added) :] if known.what.key != item.what.key]
        if not others:
            break
        if found.bent.get(item.what.key, 0.0) >= SURE:
            continue
        search.tell(f"fitting {', '.join(known.what.words for known in others)} without {item.what.words}")
        begin = _nearer(stand, found)
        alone = added_together(search, begin, others, least=WORTH / 3.0, few=not search.few_are_all)
        if found.held - alone.held >= SURE:  # the rest of the way brings no such gain
            continue
        if not search.few_are_all:
            begin = replace(begin, values={name: alone.values[name] for name in begin.values})
            alone = added_together(search, begin, others, least=WORTH / 3.0)
        if found.held - alone.held < WORTH:
            found = alone
    return found


def _nearer(stand: Footing, found: Footing) -> Footing:
    """Give a footing from which a climb begins where another one has led, without what was found on that way."""
    return replace(stand, values={name: found.values[name] for name in stand.values}, starts=found.starts)


def added_together(
    search: Search, stand: Footing, more: Sequence[Added], least: float = CLOSE_ENOUGH, *, few: bool = False
) -> Footing:
    """Give where imperfections lead together, all recordings considered, or few; each with what it gained by itself.

    least: nats that a further step of the climb has to bring.
    """
    items = [item.what for item in more]
    found = search.ground_with(stand, items).climbed(stand, *items, least=least, few=few)
    sizes = {item.what.key: item.what for item in found.added}
    kept = (replace(item, what=sizes[item.what.key]) for item in more)
    return replace(found, added=(*found.added[: len(stand.added)], *kept))
