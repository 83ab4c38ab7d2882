"""Which imperfections healthy recordings call for: the fewest, each by likelihood, judged by what was held back.

Round by round (`fit/further.py`), until one foretells nothing better. Here is what the rounds ask of a plant: what
would something gain with all else as it stands, and where does a fit lead that begins there.

A parameter that a fit puts far outside its declared accuracy is a sign of a wrong model before it is one of a wrong
number: what is missing is asked for with it held inside, and is kept where it explains the data about as well.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import StructureError
from faultbond.fit.coarse_step import Begin, coarsest
from faultbond.fit.curves import likeliest_curves, movers_of, possible_curves
from faultbond.fit.delays import in_a_loop
from faultbond.fit.evidence import all_known, foretold, joint_courses, likelihoods
from faultbond.fit.foothold import Added, Footing, in_time, keys_of, with_noise, with_orders
from faultbond.fit.ground import LEAST_LAG, NEARLY, Ground, worth_a_step
from faultbond.fit.identification import FEW_WILD, WILD, Fit
from faultbond.fit.imperfections import (
    CURVES,
    UNTRIED,
    Imperfection,
    Kind,
    law_signals,
    laws_of_signals,
    parameter_name,
    possible,
    signals_behind,
    with_imperfections,
    without_curve,
    without_lag,
    without_slow_error,
)
from faultbond.fit.likelihood import known_starts
from faultbond.fit.objective import FitPoint
from faultbond.fit.samples import HealthyRecording
from faultbond.model.expression import Expression, Name
from faultbond.model.graph import BondGraph, Check, Parameter
from faultbond.types import CheckKind

SPENT = 0.5  # nats; what gains less explains nothing any more
WORTH = 3.0  # nats by which held-back recordings must be foretold better
FEWEST = 5.0  # nats, and
CLOSE = 0.03  # part of the best gain: so much less is about as good
ROUNDS = 8
FURTHER = 3  # climbs at most from where one had not come to rest
SIZES = (0.003, 0.01, 0.03, 0.1, 0.3)  # parts of a value, or of the usual size of a signal
NOISES = (0.3, 1.0, 3.0)  # of a sensor's noise
MEMORIES = (3.0, 20.0, 120.0, 600.0)  # samples
LARGER = (3.0, 10.0, 30.0)  # times the largest size tried, where that is the best
LONGEST = 0.25  # of a recording: what stays longer is a parameter, not an error that comes and goes
LAG_GRID = 2.0  # samples: a lag for which one step of the integration is enough
NO_LAG = 1.01 * LEAST_LAG  # samples: a lag that would rather be none
NOTHING = 0.02  # samples: a lag that does nothing
AGAIN = 2.0  # times what it promised before; what was tried in vain and promises more is tried once more
MOVES = (0.3, 1.0, 3.0, 10.0)  # of a sensor's noise, after an input has moved as far as it usually does
MOST_SAMPLES, LEAST_SAMPLES = 6000, 2000  # with which sizes are compared, and where many numbers are followed
FOLLOWED = 30  # states and errors that may be followed through all of these: what a sample takes grows with them
FULLY = 15  # imperfections that are asked for at sizes and memories about their best
LEAST_LAST = 0.1  # of the samples that compare; a shorter part of a recording tells little
FEW_SAMPLES = 16000  # of the recordings with which imperfections are compared; what is kept is fitted to all

Tell = Callable[[str], None]


class Search:
    """What stays the same while imperfections are looked for."""

    def __init__(
        self,
        graph: BondGraph,
        build: Begin,
        fewer: int,
        tell: Tell,
        parameters: tuple[tuple[int, Parameter], ...],
        own: tuple[str, ...],
        records: tuple[Sequence[HealthyRecording], Sequence[HealthyRecording]],
        begins: tuple[FitPoint, FitPoint],
    ) -> None:
        self.graph, self.build, self.tell = graph, build, tell
        self.fewer = fewer  # in how many times fewer parts steps are taken
        self.parameters, self.own = parameters, own
        self.trained, self.held = records
        self.begin, self.begin_held = begins
        model = build_step_model(build_plant(graph))
        known = known_starts(model)
        free = (name for k, name in enumerate(model.states) if k not in known)
        self.columns = (*free, *(item.name for item in graph.parameters if item.name in own))
        steps = np.concatenate([np.diff(item.time) for item in (*self.trained, *self.held)])
        self.step = float(np.median(steps))
        self.few: Sequence[HealthyRecording] = first_of(self.trained, FEW_SAMPLES)
        self.few_are_all = [len(item.time) for item in self.few] == [len(item.time) for item in self.trained]
        self.longest = LONGEST * min(float(np.ptp(item.time)) for item in self.trained)
        signals = law_signals(model)
        self.behind = {name: left for name, left in signals_behind(model).items() if name in signals}
        asked = {*signals, *self.behind.values()}
        self.laws = {name: law for name, law in laws_of_signals(model).items() if name in asked}
        self.possible = possible(graph, signals, len(model.states))
        self.refused: dict[tuple[Kind, str], float] = {}  # what was tried in vain, and the nats it seemed to gain then
        self.asked_together: frozenset[tuple[Kind, str]] = frozenset()  # lags that were asked for all at once
        self.missed: set[tuple[Kind, str]] = set()  # what was left out to see, and was missed
        self.idle: dict[Imperfection, float] = {}  # lags that gained nothing, and what they seemed to gain then
        self.asked: list[tuple[Imperfection, float]] = []  # at the last round, with what each would gain
        self.by_then: Footing | None = None  # where a round that is under way leads if it ends now
        self.inside: frozenset[str] = frozenset()  # parameters that are kept from straying
        self.believed: frozenset[str] = frozenset()  # those of which it is known what made them stray
        names = (*signals, *self.behind.values())
        self.signals: dict[str, Expression] = {name: Name(name) for name in names} | movers_of(model)
        tell("building a filter with all that may be missing")
        self.all = self._with_all(graph)

    def _with_all(self, graph: BondGraph) -> Ground:
        """Give a plant in which all that may be missing is open, for likelihoods alone."""
        checks = tuple(Check(name=text, kind=CheckKind.SIGNAL, reads=one) for text, one in self.signals.items())
        offsets = (Imperfection(kind=Kind.OFFSET, place=name, size=0.0, law=law) for name, law in self.laws.items())
        opened = with_imperfections(graph, (*self.possible, *offsets))
        return self.ground(replace(opened, checks=checks))

    def ground(self, graph: BondGraph) -> Ground:
        """Give a plant as the likelihood takes it."""
        model = build_step_model(build_plant(graph))
        return Ground(self, graph, model, self.build(model, self.fewer))

    def first(self, found: Fit) -> Footing:
        """Give where a fit of the plant as it stands leads."""
        ground, plant = self.ground(self.graph), found.plant
        q = plant.unknowns.fill(plant.base, found.summit.point.values)[0]
        n_p, n_y = plant.layout.n_p, plant.layout.n_y
        columns = zip(ground.columns, found.summit.point.starts.T, strict=True)
        stand = Footing(
            graph=with_noise(self.graph, np.exp(q[n_p : n_p + n_y])),
            values={item.name: x * item.scale for item, x in zip(self.graph.parameters, q[:n_p].tolist(), strict=True)},
            starts=dict(columns),
        )
        self._leave_out_wild(ground, stand)
        return ground.climbed(stand)

    def _leave_out_wild(self, ground: Ground, stand: Footing) -> None:
        """Leave out readings of what is held back that lie far off, if they are few, as the fit has left out others."""
        q = ground.q_of(stand)
        seen = foretold(ground.plant(q), self.held, ground.begin_of(self.held, self.begin_held), q)
        far = [np.abs(item.standardised) > WILD for item in seen]
        if sum(int(item.sum()) for item in far) <= FEW_WILD * sum(item.readings for item in self.held):
            self.held = tuple(item.without(wild) for item, wild in zip(self.held, far, strict=True))

    def coarsened(self, stand: Footing) -> Footing:
        """Take steps in fewer parts from now on if that is enough where it stands; give that footing as it is then.

        What was added may have led away from where it was not, as from a place where flows turn round.
        """
        ground = self.ground(stand.graph)
        q, noise = ground.q_of(stand), [item.noise for item in self.graph.sensors]
        q[ground.layout.first_noise : ground.layout.first_noise + ground.layout.n_y] = np.log(noise)
        plant = all_known(ground.plant(q), q)
        point = ground.point_of(plant, q, stand, self.trained)
        fewer = coarsest(plant, self.trained, point, ground.model, self.build, self.fewer)
        if fewer == self.fewer:
            return stand
        self.fewer = fewer
        self.all = self._with_all(stand.graph)
        return self.ground(stand.graph).climbed(stand)

    def at_rest(self, stand: Footing, gained: float) -> Footing:
        """Give where it leads to climb on from a footing to which a climb has led that had not come to rest.

        Else what the next thing seems to gain is what all others still gain, and each one tried climbs that way again.
        What is little beside what the last thing gained, nats, is so beside the next, too, while a plant lacks much.
        """
        least, enough = worth_a_step(gained), max(FEWEST, NEARLY * gained)
        for _ in range(FURTHER):
            if stand.settled:
                break
            self.tell("climbing on")
            further = self.ground(stand.graph).climbed(stand, least=least)
            more = further.trained - stand.trained
            stand = further if more > 0.0 else stand
            if not more >= enough:
                break
        return stand

    def lasting(self, stand: Footing) -> Footing:
        """Give a footing without lags that have come down to the least, and what is of no use, if that is as good.

        What was added with them or later explains what they did. Data say nothing of a lag so short, so errors of any
        kind would move it; one that does nothing goes with all else as it stands where a climb leads elsewhere.
        """
        if any(item.what.kind is Kind.ORDER for item in stand.added):
            stand = replace(stand, added=with_orders(stand.added))
        gone = [*self._spent_lags(stand), *self._spent(stand)]
        if not gone:
            return stand
        self.tell(f"fitting without {', '.join(item.what.words for item in gone)}, of which nothing is left")
        graph = stand.graph
        for item in gone:
            graph = _without(graph, item.what)
        kept = tuple(item for item in stand.added if item not in gone)
        alone = self.ground(graph).climbed(replace(stand, graph=graph, added=kept))
        if not stand.held - alone.held < WORTH:
            nothing = self._spent_lags(stand, NOTHING)
            self.missed |= {item.what.key for item in gone if item not in nothing}
            self.refused |= {item.what.key: np.inf for item in nothing}
            return self.without_spent_lags(stand, NOTHING) if nothing else stand
        self.refused |= {item.what.key: np.inf for item in gone if not item.what.is_slow}
        return alone

    def without_spent_lags(self, stand: Footing, most: float = NO_LAG) -> Footing:
        """Give a footing without lags that have come down to the least, or so many samples, all else as it stands."""
        gone, graph = self._spent_lags(stand, most), stand.graph
        for item in gone:
            graph = _without(graph, item.what)
        return replace(stand, graph=graph, added=tuple(item for item in stand.added if item not in gone))

    def _spent_lags(self, stand: Footing, most: float = NO_LAG) -> list[Added]:
        own = {item.name for item in self.graph.parameters}
        added = [item for item in stand.added if item.what.kind is Kind.LAG and parameter_name(item.what) not in own]
        others = {item.what.place for item in stand.added if item.what.kind in (Kind.ORDER, Kind.RATE_LIMIT)}
        return [item for item in added if item.what.size <= most * self.step and item.what.place not in others]

    def _spent(self, stand: Footing) -> list[Added]:
        """Give slow errors that the model does not declare, and curves, each of which the recordings would not miss.

        With all else as it stands; and curves that they would not miss once all else follows, as a bow and its power
        that make up for each other.
        """
        own = keys_of(self.graph)
        slow = [item for item in stand.added if item.what.is_slow and item.what.key not in own]
        curves = [item for item in stand.added if item.what.kind in CURVES]
        if not curves and len(slow) < 2:  # what was added last is of use
            return []
        gains = self.asking(stand)[1]([replace(item.what, size=UNTRIED) for item in slow])
        spent = [item for item, gain in zip(slow, gains, strict=True) if gain > -SPENT]
        if curves:
            straight = [replace(item.what, size=0.0) for item in curves]
            gained = self.ground(stand.graph).gains_of(stand, straight).tolist()
            follows = [np.inf if x.what.key in self.missed else stand.bent.get(x.what.key, np.inf) for x in curves]
            lost = zip(curves, gained, follows, strict=True)
            spent += [item for item, gain, loss in lost if gain > -WORTH or loss < WORTH]
        return spent

    def ground_with(self, stand: Footing, more: Sequence[Imperfection]) -> Ground:
        """Give a plant that may have further imperfections.

        Raises
        ------
        StructureError
            Where the equations cannot be solved in an order, or another state comes in place of one, of whose start
            nothing is known: a mass that goes with a load is followed by its momentum, and once that lags by its speed.
        """
        opened = tuple(_opened(item, LAG_GRID * self.step) for item in more)
        ground = self.ground(with_imperfections(stand.graph, opened))
        lagging = {item.name for item in ground.model.plant.network.states if item.lag}
        if others := set(ground.columns) - set(self.columns) - lagging:
            raise StructureError(f"{stand.graph.name}: no start is known of {', '.join(sorted(others))}")
        return ground

    def profile(self, stand: Footing) -> list[tuple[Imperfection, float]]:
        """Give what each imperfection would gain at its best size with all else as it stands, the best first."""
        self.tell("asking what each imperfection would gain")
        usual, gains_of = self.asking(stand)
        known = {item.what.key for item in stand.added}
        added = {item.what.place for item in stand.added if item.what.kind not in (*CURVES, Kind.TRANSIENT)}
        loops = in_a_loop(stand, self.trained, self.all.model.direct)
        free = (
            x
            for x in self.possible
            if x.key not in known
            and (x.kind is Kind.TRANSIENT or x.place not in added)
            and (x.place, x.after) not in loops
        )
        asked = [(item, self._sizes(stand, item, usual), self._memories(item)) for item in free]
        best = _best_of([(item, x[1::2] or x, t[1::2] or t) for item, x, t in asked], gains_of)
        likely = sorted(best, key=lambda key: best[key][1], reverse=True)[:FULLY]  # the others hardly matter
        about = ((item, best[item.key][0], x, t) for item, x, t in asked if item.key in likely)
        asked = [(item, _next_to(found.size, x), _next_to(found.memory, t)) for item, found, x, t in about]
        while asked:
            best |= {
                key: one for key, one in _best_of(asked, gains_of).items() if key not in best or one[1] > best[key][1]
            }
            asked = [
                (item, tuple(x[-1] * times for times in LARGER), t)
                for item, x, t in asked
                if x and best[item.key][0].size == x[-1] and best[item.key][1] > 0.0
                if item.kind in (Kind.ABSOLUTE, Kind.TRANSIENT)
            ]
        self.asked = sorted(best.values(), key=lambda item: item[1], reverse=True)
        return self.asked

    def curves(self, stand: Footing) -> list[tuple[Imperfection, float]]:
        """Give curves that a plant may have, with what each would gain, nats, the likeliest first."""
        self.tell("asking what parameters may go with")
        q, starts = self.all.q_of(stand), self.all.starts_of(stand)
        rows = [joint_courses(self.all.plant(q), *item, q) for item in zip(self.trained, starts, strict=True)]
        off = {item.target for item in stand.graph.slow_errors}
        possible = possible_curves(self.all.model, self.all.signals_at(np.concatenate(rows)), off)
        own = {item.name for item in self.graph.parameters}
        new = [item for item in possible if item.place in own and parameter_name(item) not in stand.values]
        with suppress(StructureError):  # the equations may be left without an order in which to solve them
            gains = self.ground_with(stand, new).gains_once_all_follows(stand, new) if new else []
            return likeliest_curves(zip(new, gains, strict=True))
        return []

    def asking(self, stand: Footing) -> tuple[dict[str, float], Callable[[Sequence[Imperfection]], list[float]]]:
        """Give the usual size of each signal, and what tells what imperfections would gain with all else as it is."""
        if in_time(stand.graph) != in_time(self.all.graph):  # what lags by now is to be no error any more
            self.all = self._with_all(stand.graph)
        many = max(LEAST_SAMPLES, MOST_SAMPLES * FOLLOWED // max(FOLLOWED, self.all.layout.n_mean))
        (record,) = first_of(self.trained[:1], many)
        q, start = self.all.q_of(stand), self.all.starts_of(stand)[:1]
        plant = self.all.plant(q)
        now = float(likelihoods(plant, [record], start, q[None])[0])

        def gains_of(tried: Sequence[Imperfection]) -> list[float]:
            declared = np.array([self.all.with_one(q, item) for item in tried])
            return [gain - now for gain in likelihoods(plant, [record], start, declared).tolist()]

        return self.all.usual(record, start[0], q), gains_of

    def _sizes(self, stand: Footing, item: Imperfection, usual: dict[str, float]) -> tuple[float, ...]:
        if item.kind is Kind.WANDER:
            return SIZES
        if item.kind is Kind.RELATIVE:
            return SIZES if usual.get(item.place, 0.0) > 0.0 else ()
        if item.is_sensor:
            noise = next(known.noise for known in stand.graph.sensors if known.name == item.place)
            if item.kind is Kind.TRANSIENT:
                spread = self._spread(item.after)
                return tuple(part * noise / spread for part in MOVES if spread > 0.0)
            return tuple(part * noise for part in NOISES)
        if item.kind is Kind.INPUT_NOISE:
            spread = self._spread(item.place)
            return tuple(part * spread for part in SIZES[:3] if spread > 0.0)
        return tuple(part * usual[item.place] for part in SIZES if usual.get(item.place, 0.0) > 0.0)

    def _spread(self, name: str) -> float:
        """Give how far an input is from its mean, sd, SI."""
        k = [known.name for known in self.graph.inputs].index(name)
        return float(np.std(np.concatenate([record.u[:, k] for record in self.trained])))

    def _memories(self, item: Imperfection) -> tuple[float, ...]:
        if not item.is_slow:
            return (item.memory,)
        fit = tuple(count * self.step for count in MEMORIES if count * self.step <= self.longest)
        return fit or (self.longest,)


def _best_of(
    asked: Sequence[tuple[Imperfection, Sequence[float], Sequence[float]]],
    gains_of: Callable[[Sequence[Imperfection]], list[float]],
) -> dict[tuple[Kind, str], tuple[Imperfection, float]]:
    """Give each imperfection with the one of its sizes and memories that gains most, and what that gains, nats."""
    tried = [replace(item, size=x, memory=t) for item, sizes, memories in asked for x in sizes for t in memories]
    best: dict[tuple[Kind, str], tuple[Imperfection, float]] = {}
    for item, gain in zip(tried, gains_of(tried) if tried else (), strict=True):
        if item.key not in best or gain > best[item.key][1]:
            best[item.key] = item, gain
    return best


def _without(graph: BondGraph, item: Imperfection) -> BondGraph:
    take = without_slow_error if item.is_slow else without_curve if item.kind in CURVES else without_lag
    return take(graph, item)


def _opened(item: Imperfection, lag: float) -> Imperfection:
    """Give an imperfection as a possibility, next to nothing; a lag with a time for which steps are easy."""
    if item.kind is Kind.RATE_LIMIT:
        return replace(item, memory=lag)
    if item.kind in (Kind.OFFSET, Kind.ORDER):
        return item
    return replace(item, size={Kind.LAG: lag, **dict.fromkeys(CURVES, 0.0)}.get(item.kind, UNTRIED))


def _next_to(found: float, tried: Sequence[float]) -> tuple[float, ...]:
    """Give the sizes, or memories, next to one that was found, and that."""
    k = list(tried).index(found)
    return tuple(tried[max(k - 1, 0) : k + 2])


def first_of(records: Sequence[HealthyRecording], most: int) -> tuple[HealthyRecording, ...]:
    """Give so many samples of recordings at most: the first ones, of the last one a part if that is no short one."""
    found: list[HealthyRecording] = []
    for record in records:
        left = most - sum(len(item.time) for item in found)
        if not found or left >= LEAST_LAST * most:
            found.append(record.part(left) if left < len(record.time) else record)
    return tuple(found)
