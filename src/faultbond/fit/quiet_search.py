"""Which imperfections healthy recordings call for: the fewest, each by likelihood, judged by what was held back.

Round by round (`fit/further.py`), until one foretells nothing better. Here is what the rounds ask of a plant: what
would something gain with all else as it stands, and where does a fit lead that begins there.

A parameter that a fit puts far outside its declared accuracy is a sign of a wrong model before it is one of a wrong
number: what is missing is asked for with it held inside, and is kept where it explains the data about as well.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.errors import StructureError
from faultbond.fit.ascent import START_PRIOR, Summit, ascend
from faultbond.fit.certainty import inverse_of
from faultbond.fit.curves import likeliest_curves, movers_of, possible_curves
from faultbond.fit.delays import in_a_loop
from faultbond.fit.evidence import CLOSE_ENOUGH, all_known, evidence_of, foretold, joint_courses, likelihoods
from faultbond.fit.foothold import Added, Footing, in_time, keys_of, values_at, with_noise, with_orders
from faultbond.fit.identification import FEW_WILD, WIDE, WILD, Fit, fit_at
from faultbond.fit.imperfections import (
    CURVES,
    FORMS,
    UNTRIED,
    Imperfection,
    Kind,
    found_in,
    lag_of,
    law_signals,
    laws_of_signals,
    memory_place,
    parameter_name,
    possible,
    power_of,
    signals_behind,
    size_place,
    with_imperfections,
    without_curve,
    without_lag,
    without_slow_error,
)
from faultbond.fit.likelihood import Likelihood, build_begin, felt_moves, known_starts, layout_of, nominal_q
from faultbond.fit.objective import FitPoint, FittedPlant, Scored, evaluate_likelihood, score_recordings, ways_of
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.score import score_gains
from faultbond.fit.stray import INSIDE
from faultbond.fit.unknowns import Unknowns, unknowns_of
from faultbond.model.expression import Name
from faultbond.model.graph import BondGraph, Check, Parameter
from faultbond.types import CheckKind

SPENT = 0.5  # nats; what gains less explains nothing any more
WORTH = 3.0  # nats by which held-back recordings must be foretold better
FEWEST = 5.0  # nats, and
CLOSE = 0.03  # part of the best gain: so much less is about as good
ROUNDS = 8
TURNS = 15  # steps of a climb that compares
NEARLY = 0.01  # part of what such a climb has gained, that the next step may bring where it ends
SIZES = (0.003, 0.01, 0.03, 0.1, 0.3)  # parts of a value, or of the usual size of a signal
NOISES = (0.3, 1.0, 3.0)  # of a sensor's noise
MEMORIES = (3.0, 20.0, 120.0, 600.0)  # samples
LARGER = (3.0, 10.0, 30.0)  # times the largest size tried, where that is the best
MOST_PART = 0.5  # a relative error is not larger
LONGEST = 0.25  # of a recording: what stays longer is a parameter, not an error that comes and goes
LAGS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # samples
RATES = (0.003, 0.006, 0.012, 0.025, 0.05, 0.1, 0.2, 0.5)  # parts of the largest move of an input, in a sample
LAGS_LEFT = (0.1, 0.3, 0.7)  # parts of the lag that has stood for a highest rate, or of ten samples
LAG_GRID = 2.0  # samples: a lag for which one step of the integration is enough
LEAST_LAG = 0.2  # samples
NO_LAG = 1.01 * LEAST_LAG  # samples: a lag that would rather be none
AGAIN = 2.0  # times what it promised before; what was tried in vain and promises more is tried once more
MOVES = (0.3, 1.0, 3.0, 10.0)  # of a sensor's noise, after an input has moved as far as it usually does
SIZED = (Kind.RELATIVE, Kind.ABSOLUTE, Kind.WANDER, Kind.TRANSIENT, Kind.INPUT_NOISE)
MOST_POWER = 6.0  # of a curve; laws have no higher ones
MOST_SAMPLES = 6000  # with which sizes are compared
FEW_SAMPLES = 8000  # of the recordings with which imperfections are compared; what is kept is fitted to all

Tell = Callable[[str], None]
Build = Callable[
    [StepModel], Callable[[], Likelihood]
]  # begins to build what runs filters, and gives what waits for it


class Search:
    """What stays the same while imperfections are looked for."""

    def __init__(
        self,
        graph: BondGraph,
        build: Build,
        tell: Tell,
        parameters: tuple[tuple[int, Parameter], ...],
        own: tuple[str, ...],
        records: tuple[Sequence[HealthyRecording], Sequence[HealthyRecording]],
        begins: tuple[FitPoint, FitPoint],
    ) -> None:
        self.graph, self.build, self.tell = graph, build, tell
        self.parameters, self.own = parameters, own
        self.trained, self.held = records
        self.begin, self.begin_held = begins
        model = build_step_model(build_plant(graph))
        known = known_starts(model)
        free = (name for k, name in enumerate(model.states) if k not in known)
        self.columns = (*free, *(item.name for item in graph.parameters if item.name in own))
        steps = np.concatenate([np.diff(item.time) for item in (*self.trained, *self.held)])
        self.step = float(np.median(steps))
        ends = np.cumsum([len(item.time) for item in self.trained])
        self.few = self.trained[: int(np.searchsorted(ends, FEW_SAMPLES)) + 1]
        self.longest = LONGEST * min(float(np.ptp(item.time)) for item in self.trained)
        signals = law_signals(model)
        self.behind = {name: left for name, left in signals_behind(model).items() if name in signals}
        asked = {*signals, *self.behind.values()}
        self.laws = {name: law for name, law in laws_of_signals(model).items() if name in asked}
        self.possible = possible(graph, signals, len(model.states))
        self.refused: dict[tuple[Kind, str], float] = {}  # what was tried in vain, and the nats it seemed to gain then
        self.idle: dict[Imperfection, float] = {}  # lags that gained nothing, and what they seemed to gain then
        self.asked: list[tuple[Imperfection, float]] = []  # at the last round, with what each would gain
        self.inside: frozenset[str] = frozenset()  # parameters that are kept from straying
        self.believed: frozenset[str] = frozenset()  # those of which it is known what made them stray
        self.signals = {name: Name(name) for name in (*signals, *self.behind.values())} | movers_of(model)
        tell("building a filter with all that may be missing")
        self.all = self._with_all(graph)

    def _with_all(self, graph: BondGraph) -> "Ground":
        """Give a plant in which all that may be missing is open, for likelihoods alone."""
        checks = tuple(Check(name=text, kind=CheckKind.SIGNAL, reads=one) for text, one in self.signals.items())
        offsets = (Imperfection(kind=Kind.OFFSET, place=name, size=0.0, law=law) for name, law in self.laws.items())
        opened = with_imperfections(graph, (*self.possible, *offsets))
        return self.ground(replace(opened, checks=checks))

    def ground(self, graph: BondGraph) -> "Ground":
        """Give a plant as the likelihood takes it."""
        model = build_step_model(build_plant(graph))
        return Ground(self, graph, model, self.build(model))

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

    def _leave_out_wild(self, ground: "Ground", stand: Footing) -> None:
        """Leave out readings of what is held back that lie far off, if they are few, as the fit has left out others."""
        q = ground.q_of(stand)
        seen = foretold(ground.plant(q), self.held, ground.begin_of(self.held, self.begin_held), q)
        far = [np.abs(item.standardised) > WILD for item in seen]
        if sum(int(item.sum()) for item in far) <= FEW_WILD * sum(item.readings for item in self.held):
            self.held = tuple(item.without(wild) for item, wild in zip(self.held, far, strict=True))

    def lasting(self, stand: Footing) -> Footing:
        """Give a footing without lags that have come down to the least, and what is of no use, if that is as good.

        What was added with them or later explains what they did. Data say nothing of a lag so short, so errors of any
        kind would move it.
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
            return stand
        self.refused |= {item.what.key: np.inf for item in gone if not item.what.is_slow}
        return alone

    def _spent_lags(self, stand: Footing) -> list[Added]:
        own = {item.name for item in self.graph.parameters}
        added = [item for item in stand.added if item.what.kind is Kind.LAG and parameter_name(item.what) not in own]
        others = {item.what.place for item in stand.added if item.what.kind in (Kind.ORDER, Kind.RATE_LIMIT)}
        return [item for item in added if item.what.size <= NO_LAG * self.step and item.what.place not in others]

    def _spent(self, stand: Footing) -> list[Added]:
        """Give slow errors that the model does not declare, and curves, each of which the recordings would not miss."""
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
            spent += [item for item, gain in zip(curves, gained, strict=True) if gain > -WORTH]
        return spent

    def ground_with(self, stand: Footing, more: Sequence[Imperfection]) -> "Ground":
        """Give a plant that may have further imperfections."""
        opened = tuple(_opened(item, LAG_GRID * self.step) for item in more)
        return self.ground(with_imperfections(stand.graph, opened))

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
        asked = [(item, self._sizes(stand, item, usual)) for item in free]
        best: dict[tuple[Kind, str], tuple[Imperfection, float]] = {}
        while asked:
            tried = [
                replace(item, size=size, memory=memory)
                for item, sizes in asked
                for size in sizes
                for memory in self._memories(item)
            ]
            if not tried:
                break
            for item, gain in zip(tried, gains_of(tried), strict=True):
                if item.key not in best or gain > best[item.key][1]:
                    best[item.key] = item, gain
            at_end = [(item, sizes) for item, sizes in asked if sizes and best[item.key][0].size == sizes[-1]]
            asked = [
                (item, tuple(sizes[-1] * times for times in LARGER))
                for item, sizes in at_end
                if item.kind in (Kind.ABSOLUTE, Kind.TRANSIENT) and best[item.key][1] > 0.0
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
            gains = self.ground_with(stand, new).curve_gains(stand, new) if new else []
            return likeliest_curves(zip(new, gains, strict=True))
        return []

    def asking(self, stand: Footing) -> tuple[dict[str, float], Callable[[Sequence[Imperfection]], list[float]]]:
        """Give the usual size of each signal, and what tells what imperfections would gain with all else as it is."""
        if in_time(stand.graph) != in_time(self.all.graph):  # what lags by now is to be no error any more
            self.all = self._with_all(stand.graph)
        record = _shortened(self.trained[0])
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


class Ground:
    """A plant in which some imperfections are open, as the likelihood takes it."""

    def __init__(self, search: Search, graph: BondGraph, model: StepModel, built: Callable[[], Likelihood]) -> None:
        self.search, self.graph, self.model = search, graph, model
        self._built = built
        self._engine: Likelihood | None = None
        self.layout = layout_of(model)
        self.begin, known = build_begin(model), known_starts(model)
        self.free = tuple(k for k in range(self.layout.n_x) if k not in known)
        self.own = tuple((k, item) for k, item in enumerate(graph.parameters) if item.name in search.own)
        self.columns = (*(model.states[k] for k in self.free), *(item.name for _, item in self.own))

    @property
    def engine(self) -> Likelihood:
        """What runs its likelihood, as soon as that is built."""
        if self._engine is None:
            self._engine = self._built()
        return self._engine

    def begin_of(self, records: Sequence[HealthyRecording], begin: FitPoint) -> FitPoint:
        """Give where recordings begin; what lags begins about where that is which it follows."""
        known = {name: k for k, name in enumerate(self.search.columns)}
        starts, sizes = np.zeros((2, len(records), len(self.columns)))
        owners = {item.name: item.owner for item in self.model.plant.network.states if item.lag}
        inputs = {item.name: k for k, item in enumerate(self.graph.inputs)}
        sensors = {item.name: k for k, item in enumerate(self.graph.sensors)}
        for column, name in enumerate(self.columns):
            for r, record in enumerate(records):
                if name in known:
                    first, size = begin.starts[r, known[name]], begin.sizes[r, known[name]]
                else:
                    owner = owners[name]
                    course = record.u[:, inputs[owner]] if owner in inputs else record.y[:, sensors[owner]]
                    course = course[np.isfinite(course)]
                    first, size = course[0], max(float(np.std(course)), 1e-9)
                starts[r, column], sizes[r, column] = first, size
        return FitPoint(values=begin.values, starts=starts, sizes=sizes)

    def point_of(
        self, plant: FittedPlant, q: FloatArray, stand: Footing, records: Sequence[HealthyRecording]
    ) -> FitPoint:
        """Give where a plant about q (n_q,) stands, within the ends of its unknowns; for the first of the records."""
        values = np.clip(values_at(plant, q), plant.unknowns.lower, plant.unknowns.upper)
        begin = self.begin_of(records, self.search.begin)
        return replace(begin, values=values, starts=self.starts_of(stand)[: len(records)])

    def starts_of(self, stand: Footing) -> FloatArray:
        """Give the starts of the recordings that are fitted as they stand, (n_records, n_own)."""
        begin = self.begin_of(self.search.trained, self.search.begin).starts
        for column, name in enumerate(self.columns):
            if name in stand.starts:
                begin[:, column] = stand.starts[name]
        return begin

    def best_late(self, stand: Footing, item: Imperfection) -> tuple[Imperfection, float]:
        """Give a lag, a rate limit or a form with what explains most with all else as it stands, and the gain, nats."""
        tried = [item]
        if item.kind is Kind.LAG:
            times = [count * self.search.step for count in LAGS if count * self.search.step <= self.search.longest]
            tried = [replace(item, size=size) for size in times or [self.search.step]]
        if item.kind is Kind.RATE_LIMIT:
            lag = stand.graph.input(item.place).lag
            times = [part * stand.values[lag] if lag else 10.0 * part * self.search.step for part in LAGS_LEFT]
            tried = [replace(item, size=part * item.size, memory=time) for part in RATES for time in times]
        gains = self.gains_of(stand, tried)
        best = int(np.argmax(gains))
        return tried[best], float(gains[best])

    def gains_of(self, stand: Footing, tried: Sequence[Imperfection]) -> FloatArray:
        """Give what each of some imperfections would gain, nats, with all else as it stands, (n,)."""
        q, starts = self.q_of(stand), self.starts_of(stand)[: len(self.search.few)]
        declared = np.array([self.with_one(q, item) for item in tried])
        return likelihoods(self.plant(q), self.search.few, starts, declared) - stand.few

    def curve_gains(self, stand: Footing, new: Sequence[Imperfection]) -> list[float]:
        """Give what each of some curves would gain, nats, once all else that is fitted has followed it.

        A bow has the power of the same beside it. What stands at an end of where it may be stays there.
        """
        q, records = self.q_of(stand), self.search.few
        plant = self.plant(q, [*(item.what for item in stand.added), *new])
        unknowns, point = plant.unknowns, self.point_of(plant, q, stand, records)
        values, found = point.values, evaluate_likelihood(plant, records, point)
        places = {item.name: k for k, item in enumerate(unknowns.parameters)}
        at = {parameter_name(item): places[parameter_name(item)] for item in new}
        sd = np.full(len(found.score), START_PRIOR)
        sd[: len(values)] = unknowns.widened(self.widths(unknowns))
        moves = np.ones(len(sd), dtype=bool)
        moves[: len(values)] = (unknowns.lower < values) & (values < unknowns.upper)
        sd[list(at.values())], moves[list(at.values())] = np.inf, False
        beside = ([item, power_of(item)] if item.kind is Kind.BOW else [item] for item in new)
        groups = [[at[name] for name in map(parameter_name, each) if name in at] for each in beside]
        return score_gains(found, sd**-2.0, moves, groups)

    def q_of(self, stand: Footing) -> FloatArray:
        """Give q with everything as it stands, (n_q,); what is not part of it is next to nothing."""
        q, layout = nominal_q(self.model), self.layout
        for k, item in enumerate(self.graph.parameters):
            q[k] = stand.values.get(item.name, item.nominal) / item.scale
        slow = {(item.target, item.relative): item for item in stand.graph.slow_errors}
        first = layout.first_noise + layout.n_y
        q[layout.first_noise : first] = np.log([item.noise for item in stand.graph.sensors])
        for k, error in enumerate(self.graph.slow_errors):
            key = error.target, error.relative
            known = slow.get(key, replace(error, sd=UNTRIED))
            q[first + k], q[layout.first_memory + k] = np.log(stand.slow.get(key, known.sd)), np.log(known.memory)
        for place, (k, name) in enumerate(felt_moves(self.graph), start=layout.first_each):
            error = self.graph.slow_errors[k]
            stood = slow.get((error.target, error.relative))
            q[place] = np.log(stood.by_input.get(name, UNTRIED) if stood else UNTRIED)
        for k, number in enumerate(self.model.noisy, start=first + layout.n_b):
            q[k] = np.log(max(stand.graph.inputs[number].noise, UNTRIED))
        return q

    def with_one(self, q: FloatArray, item: Imperfection) -> FloatArray:
        """Give q (n_q,) with one imperfection of a size."""
        changed = q.copy()
        if item.kind in FORMS:
            return changed
        place = size_place(self.graph, self.layout, item)
        if item.is_parameter:
            changed[place] = item.size / self.graph.parameters[place].scale
            if item.kind is Kind.RATE_LIMIT:
                lag = size_place(self.graph, self.layout, lag_of(item))
                changed[lag] = item.memory / self.graph.parameters[lag].scale
            return changed
        changed[place] = np.log(item.size)
        if item.is_slow:
            changed[memory_place(self.graph, self.layout, item)] = np.log(item.memory)
        return changed

    def plant(self, q: FloatArray, opened: Sequence[Imperfection] = ()) -> FittedPlant:
        """Give the plant about q (n_q,).

        Parameters, noise of sensors, slow errors, at most as large as declared, and what is opened are unknown.
        """
        search, layout = self.search, self.layout
        base, slow = nominal_q(self.model), layout.first_noise + layout.n_y
        base[layout.n_p :] = q[layout.n_p :]
        declared = range(slow, slow + len(search.graph.slow_errors))
        base[declared] = np.log([item.sd for item in search.graph.slow_errors])
        beside = (lag_of(item) for item in opened if item.kind is Kind.RATE_LIMIT)
        named = [(parameter_name(item), item.kind) for item in (*opened, *beside) if item.is_parameter]
        lags, curves = ({name for name, kind in named if kind in wanted} for wanted in ((Kind.LAG,), CURVES))
        further = {name for name, _ in named}
        sizes = {size_place(self.graph, layout, item): item for item in opened if item.kind in SIZED}
        memories = {memory_place(self.graph, layout, item): item for item in opened if item.is_slow}
        noises = tuple(sorted({*range(layout.first_noise, slow), *declared, *sizes, *memories}))
        names = {item.name for _, item in search.parameters} - set(search.own) | further
        parameters = tuple((k, item) for k, item in enumerate(self.graph.parameters) if item.name in names)
        unknowns = unknowns_of(layout, base, parameters, noises, grow=True)
        lower, upper = unknowns.lower.copy(), unknowns.upper.copy()
        for k, (_, item) in enumerate(parameters):
            if item.name in lags:
                ends = np.log(np.array([LEAST_LAG * search.step, search.longest]) / item.nominal)
                lower[k], upper[k] = ends[0], max(ends)
            if item.name in curves:
                lower[k], upper[k] = sorted((-MOST_POWER / item.scale, MOST_POWER / item.scale))
        for k, place in enumerate(noises, start=unknowns.n_theta):
            if place in memories:
                lower[k], upper[k] = np.log(search.step), np.log(max(search.longest, search.step))
            elif place in sizes:
                upper[k] = np.log(MOST_PART) if sizes[place].kind in (Kind.RELATIVE, Kind.WANDER) else upper[k]
            elif place >= slow:
                upper[k] = base[place]
        for k, (_, item) in enumerate(parameters):
            if item.name in search.inside:
                reach = INSIDE * unknowns.prior[k]
                lower[k] = max(lower[k], unknowns.nominal[k] - reach)
                upper[k] = min(upper[k], unknowns.nominal[k] + reach)
        return FittedPlant(
            sensors=tuple(item.name for item in self.graph.sensors),
            layout=layout,
            engine=self.engine,
            begin=self.begin,
            base=base,
            unknowns=replace(unknowns, lower=lower, upper=upper),
            free=self.free,
            own=tuple((k, item.accuracy / abs(item.scale)) for k, item in self.own),
        )

    def widths(self, unknowns: Unknowns) -> FloatArray:
        """Give how many times as wide accuracies count, (n_theta,): little, but of parameters that are believed."""
        near = self.search.believed | self.search.inside
        return np.array([1.0 if item.name in near else WIDE for item in unknowns.parameters])

    def climbed(self, stand: Footing, *more: Imperfection, few: bool = False) -> Footing:
        """Give where a climb leads that begins where it stands, with further imperfections; perhaps for few records."""
        search = self.search
        records = search.few if few else search.trained
        opened = [*(item.what for item in stand.added), *more]
        q = self.q_of(stand)
        for item in more:
            q = self.with_one(q, item)
        plant = self.plant(q, opened)
        unknowns, begin = plant.unknowns, self.point_of(plant, q, stand, records)
        anchor = self.begin_of(records, search.begin).starts
        wide = unknowns.widened(self.widths(unknowns))
        part = NEARLY if few else 0.0
        summit = ascend(plant, records, begin, wide, anchor=anchor, turns=TURNS, settled=CLOSE_ENOUGH, part=part)
        found = unknowns.fill(plant.base, summit.point.values)[0]
        ahead = foretold(plant, search.held, self.begin_of(search.held, search.begin_held), found)
        stood = self._stood(stand, opened, found, summit, evidence_of(ahead))
        seen = score_recordings(all_known(plant, found), records, replace(summit.point, values=np.zeros(0)))
        stood = replace(stood, few=evidence_of(seen[: len(search.few)]))
        stood = stood if few else self._seen(stood, found, summit, seen)
        keys = {item.key for item in more}
        gains = stood.few - stand.few, stood.held - stand.held
        last = (item for item in found_in(self.graph, self.layout, found, opened) if item.key in keys)
        gained = (Added(what=item, trained=gains[0], held=gains[1]) for item in last)
        return replace(stood, added=(*stood.added, *gained))

    def _stood(
        self, stand: Footing, opened: Sequence[Imperfection], q: FloatArray, summit: Summit, held: float
    ) -> Footing:
        layout, search = self.layout, self.search
        noise = np.exp(q[layout.n_p : layout.n_p + layout.n_y])
        sizes = found_in(self.graph, self.layout, q, opened)
        n = len(summit.point.values)
        wide = np.concatenate([np.full(n, WIDE), np.full(summit.point.starts.size, WIDE)])
        spread = np.diag(inverse_of(summit.evaluation.information + np.diag(wide**-2.0)))
        n_theta = len([item for item in search.parameters if item[1].name not in search.own])
        unknown = float(np.mean(np.log(np.maximum(spread[:n_theta], 1e-300)))) / 2.0 if n_theta else 0.0
        by_key = {item.key: item for item in sizes}
        errors = enumerate(search.graph.slow_errors, start=layout.first_noise + layout.n_y)
        values = {}
        for item, factor in zip(self.graph.parameters, q[: layout.n_p].tolist(), strict=True):
            values[item.name] = factor * item.scale
        return Footing(
            graph=with_imperfections(with_noise(stand.graph, noise), sizes),
            values=values,
            slow={(item.target, item.relative): float(np.exp(q[k])) for k, item in errors},
            starts=dict(zip(self.columns, summit.point.starts.T, strict=True)),
            trained=summit.evaluation.value,
            held=held if np.isfinite(summit.evaluation.value) else -np.inf,
            unknown=unknown,
            added=tuple(replace(item, what=by_key[item.what.key]) for item in stand.added),
        )

    def _seen(self, stood: Footing, q: FloatArray, summit: Summit, seen: Sequence[Scored]) -> Footing:
        """Give a footing with what each recording shows there."""
        plant, trained = self.plant(q), self.search.trained
        begin = self.begin_of(trained, self.search.begin)
        values = np.clip(values_at(plant, q), plant.unknowns.lower, plant.unknowns.upper)
        return replace(
            stood,
            innovations=tuple(item.standardised for item in seen),
            expected=tuple(x.y - item.innovations for x, item in zip(trained, seen, strict=True)),
            ways=ways_of(all_known(plant, q), self.search.few, replace(summit.point, values=np.zeros(0))),
            fit=partial(fit_at, replace(plant, base=q), trained, begin, replace(summit.point, values=values)),
        )

    def usual(self, record: HealthyRecording, start: FloatArray, q: FloatArray) -> dict[str, float]:
        """Give the usual size of each signal of a law, its root of the mean square, SI; start (n_own,), q (n_q,)."""
        with np.errstate(all="ignore"):
            signals = self.signals_at(joint_courses(self.plant(q), record, start, q))
            sizes = {name: float(np.sqrt(np.mean(np.square(course)))) for name, course in signals.items()}
        return {name: size for name, size in sizes.items() if np.isfinite(size)}

    def signals_at(self, rows: FloatArray) -> dict[str, FloatArray]:
        """Give the signals of laws, and what these may go with, at moments (n_moments, n_u + n_v), SI, (n_moments,)."""
        n_u, by_hand, implicit = self.layout.n_u, self.model.by_hand, self.model.reference_implicit
        with np.errstate(all="ignore"):
            found = np.array([by_hand(row[n_u:], row[:n_u], implicit).full()[:, 0] for row in rows])
        return dict(zip(self.search.signals, found.T, strict=True))


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


def _shortened(record: HealthyRecording) -> HealthyRecording:
    part = slice(0, MOST_SAMPLES)
    return replace(record, time=record.time[part], u=record.u[part], samples=record.samples[part], use=record.use[part])
