"""A plant in which some imperfections are open: where a search stands in it, what these gain, where a climb leads."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Protocol

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from faultbond.fit.ascent import START_PRIOR, Finish, Summit, ascend, spread_noise
from faultbond.fit.certainty import inverse_of
from faultbond.fit.evidence import CLOSE_ENOUGH, all_known, evidence_of, foretold, joint_courses, likelihoods
from faultbond.fit.foothold import Added, Footing, values_at, with_noise
from faultbond.fit.identification import WIDE, fit_at
from faultbond.fit.imperfections import (
    CURVES,
    FORMS,
    UNTRIED,
    Imperfection,
    Kind,
    found_in,
    lag_of,
    memory_place,
    parameter_name,
    power_of,
    size_place,
    with_imperfections,
)
from faultbond.fit.likelihood import Likelihood, build_begin, felt_moves, known_starts, layout_of, nominal_q
from faultbond.fit.objective import (
    FitPoint,
    FittedPlant,
    Scored,
    evaluate_likelihood,
    likelihood_value,
    score_recordings,
    ways_of,
)
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.score import score_gains
from faultbond.fit.unknowns import INSIDE, Unknowns, unknowns_of
from faultbond.model.expression import Expression
from faultbond.model.graph import BondGraph, Parameter

TURNS = 15  # steps of a climb that compares
NEARLY = 0.01  # part of what such a climb has gained, that the next step may bring where it ends
NEARER = 1e-3  # the same of a climb of all recordings, from where the search goes on
COARSE = 1e-4  # the same of the first fit: no model is right in which something is missing
MOST_PART = 0.5  # a relative error is not larger
LAGS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # samples
RATES = (0.003, 0.006, 0.012, 0.025, 0.05, 0.1, 0.2, 0.5)  # parts of the largest move of an input, in a sample
LAGS_LEFT = (0.1, 0.3, 0.7)  # parts of the lag that has stood for a highest rate, or of ten samples
LEAST_LAG = 0.2  # samples
SIZED = (Kind.RELATIVE, Kind.ABSOLUTE, Kind.WANDER, Kind.TRANSIENT, Kind.INPUT_NOISE)
MOST_POWER = 6.0  # of a curve; laws have no higher ones


def worth_a_step(gained: float) -> float:
    """Give how many nats a further step has to bring where a round has gained so many, beside which less is little."""
    return max(CLOSE_ENOUGH, NEARER * gained)


class Setting(Protocol):
    """What all plants of a search have in common.

    graph : as the model file has it
    parameters, own : its unknown ones with their places, and of these the names of those of each recording alone
    trained, few, held : recordings that are fitted, those of them that compare, and those that were held back
    begin, begin_held, columns : where these begin, and the names of what each has for itself
    step, longest : between samples, and an error that comes and goes, s
    signals : of laws, and what parameters may go with
    inside, believed : parameters that are kept from straying, and those of which it is known what made them
    """

    graph: BondGraph
    parameters: tuple[tuple[int, Parameter], ...]
    own: tuple[str, ...]
    trained: Sequence[HealthyRecording]
    few: Sequence[HealthyRecording]
    held: Sequence[HealthyRecording]
    begin: FitPoint
    begin_held: FitPoint
    columns: tuple[str, ...]
    step: float
    longest: float
    signals: dict[str, Expression]
    inside: frozenset[str]
    believed: frozenset[str]


class Ground:
    """A plant in which some imperfections are open, as the likelihood takes it."""

    def __init__(self, search: Setting, graph: BondGraph, model: StepModel, built: Callable[[], Likelihood]) -> None:
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
        """Give a lag, a rate limit or a form with what explains most with all else as it stands, and the gain, nats.

        Of a lag that is what it would gain once all else follows, if that is more: where others have made room for it,
        as a hose that is too soft for a drive that is slow, even the shortest loses at first.
        """
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
        if item.kind is not Kind.LAG:
            return tried[best], float(gains[best])
        follows = float(gains[0]) + self.gains_once_all_follows(stand, tried[:1])[0]
        return tried[best if gains[best] > 0.0 else 0], max(follows, float(gains[best]))

    def gains_of(self, stand: Footing, tried: Sequence[Imperfection]) -> FloatArray:
        """Give what each of some imperfections would gain, nats, with all else as it stands, (n,)."""
        q, starts = self.q_of(stand), self.starts_of(stand)[: len(self.search.few)]
        declared = np.array([self.with_one(q, item) for item in tried])
        return likelihoods(self.plant(q), self.search.few, starts, declared) - stand.few

    def gains_once_all_follows(self, stand: Footing, new: Sequence[Imperfection]) -> list[float]:
        """Give what each of some curves, or lags, would gain, nats, once all else that is fitted has followed it.

        A bow has the power of the same beside it. What stands at an end of where it may be stays there.
        """
        q, records = self._with_more(stand, new), self.search.few
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

    def _with_more(self, stand: Footing, more: Sequence[Imperfection]) -> FloatArray:
        """Give q (n_q,) where it stands, with further imperfections of their sizes."""
        q = self.q_of(stand)
        for item in more:
            q = self.with_one(q, item)
        return q

    def climbed(
        self,
        stand: Footing,
        *more: Imperfection,
        few: bool = False,
        least: float = CLOSE_ENOUGH,
        is_far: bool = False,
    ) -> Footing:
        """Give where a climb leads that begins where it stands, with further imperfections; perhaps for few records.

        least: nats that a further step has to bring. is_far: whether it begins far from there, as where parameters are
        held inside what was declared, so with noise as large as that leaves unexplained.

        Curves begin straight where that is higher: what they are found as, other values had made room for.
        """
        search = self.search
        records = search.few if few else search.trained
        opened = [*(item.what for item in stand.added), *more]
        q = self._with_more(stand, more)
        plant = self.plant(q, opened)
        unknowns, begin = plant.unknowns, self.point_of(plant, q, stand, records)
        if any(item.kind in CURVES and item.size for item in more):
            straight = self._with_more(
                stand, [replace(item, size=0.0) if item.kind in CURVES else item for item in more]
            )
            begins = [begin, self.point_of(plant, straight, stand, records)]
            begin = max(begins, key=lambda point: likelihood_value(plant, records, point))
        if is_far:
            begin = spread_noise(plant, records, begin)
        anchor = self.begin_of(records, search.begin).starts
        wide = unknowns.widened(self.widths(unknowns))
        finish = Finish(least, NEARLY if few else NEARER)
        summit = ascend(plant, records, begin, wide, anchor=anchor, turns=TURNS, finish=finish)
        found = unknowns.fill(plant.base, summit.point.values)[0]
        ahead = foretold(plant, search.held, self.begin_of(search.held, search.begin_held), found)
        stood = self._stood(stand, opened, unknowns, found, summit, evidence_of(ahead))
        seen = score_recordings(all_known(plant, found), records, replace(summit.point, values=np.zeros(0)))
        parts = zip(seen, search.few, strict=False)  # of these as many samples as compare
        stood = replace(stood, few=evidence_of([item.part(len(record.time)) for item, record in parts]))
        stood = stood if few else self._seen(stood, found, summit, seen)
        keys = {item.key for item in more}
        gains = stood.few - stand.few, stood.held - stand.held
        last = (item for item in found_in(self.graph, self.layout, found, opened) if item.key in keys)
        gained = (Added(what=item, trained=gains[0], held=gains[1]) for item in last)
        return replace(stood, added=(*stood.added, *gained))

    def _stood(
        self,
        stand: Footing,
        opened: Sequence[Imperfection],
        unknowns: Unknowns,
        q: FloatArray,
        summit: Summit,
        held: float,
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
        places = {item.name: k for k, item in enumerate(unknowns.parameters)}
        curves = [(item.key, places[parameter_name(item)]) for item in opened if item.kind in CURVES]
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
            settled=summit.settled,
            bent={key: 0.5 * float(summit.point.values[k] ** 2 / spread[k]) for key, k in curves},
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
