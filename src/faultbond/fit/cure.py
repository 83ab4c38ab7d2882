"""What a model lacks where a fit puts parameters far outside their declared accuracies.

A small thing that is missing may move a parameter far that data fix badly: a sensor that comes 1 ms late looks like a
friction, of the bearing behind a stiff shaft. So what is missing is asked for with such parameters held inside what was
declared; there it shows. It is kept where they then stay, and where letting them go would explain hardly more.
"""

from typing import NamedTuple

import numpy as np

from faultbond.fit.foothold import Footing
from faultbond.fit.further import better
from faultbond.fit.ground import worth_a_step
from faultbond.fit.quiet_search import CLOSE, FEWEST, WORTH, Search
from faultbond.fit.stray import strayed_by
from faultbond.fit.unknowns import INSIDE, is_absent


def strayed(search: Search, stand: Footing) -> frozenset[str]:
    """Give the parameters that stand far outside their declared accuracies."""
    found = (item for _, item in search.parameters if item.name not in search.own and not is_absent(item))
    return frozenset(item.name for item in found if abs(strayed_by(item, stand.values[item.name])) > INSIDE)


class Cure(NamedTuple):
    """Where something leads that explains why parameters stray: with these kept inside what was declared, and let go.

    kept : None where nothing explains what was held back about as well as that they were declared wrongly
    let_go : None where that foretells nothing better
    """

    kept: Footing | None = None
    let_go: Footing | None = None


def cured(search: Search, stand: Footing) -> Cure:
    """Give where something leads with which parameters that strayed stay inside their declared accuracies.

    Where they are kept, their declared accuracies count in the search from then on.
    """
    names = strayed(search, stand)
    search.tell(f"asking what else it may be that puts {', '.join(sorted(names))} far from what was declared")
    search.inside, refused, asked = names, dict(search.refused), search.asked_together
    held = search.ground(stand.graph).climbed(stand, is_far=True)
    runs = np.isfinite([held.trained, held.held]).all()  # the plant may have no course with them there
    further = better(search, held) if runs else None
    search.inside, search.refused, search.asked_together = frozenset(), refused, asked
    if further is None:
        return Cure()
    ground, before = search.ground(further.graph), search.believed
    least = worth_a_step(further.trained - stand.trained)
    search.by_then = free = ground.climbed(further, least=least)
    search.believed = before | names
    found = ground.climbed(further, least=least)
    gain = found.held - stand.held
    if gain >= WORTH and free.held - found.held <= max(FEWEST, CLOSE * gain) and not names & strayed(search, found):
        return Cure(kept=found)
    search.believed = before
    search.by_then = free if free.held - stand.held >= WORTH else None
    return Cure(let_go=search.by_then)
