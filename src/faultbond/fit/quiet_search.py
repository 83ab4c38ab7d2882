"""Which imperfections healthy recordings call for: the fewest, each by likelihood, judged by what was held back.

Round by round: what each possible imperfection would gain is asked on a grid of sizes and memories with all else as it
stands; the best few are fitted together with everything else; of those that foretell the recordings that were held back
about equally well, the one is kept that leaves the parameters best known. A round that foretells nothing better is the
last.

Source: Rao 1948 and Akaike 1974 in spirit (one term at a time, by likelihood); held-back data as in Stone, J. Royal
Statistical Society B 36 (1974) 111.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.contract.spec import Engine
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.errors import NoVerdictError, StructureError
from faultbond.fit.ascent import Summit, ascend
from faultbond.fit.certainty import inverse_of
from faultbond.fit.evidence import all_known, foretold, joint_courses, likelihoods
from faultbond.fit.identification import FEW_WILD, WIDE, WILD, Fit
from faultbond.fit.imperfections import (
    UNTRIED,
    Imperfection,
    Kind,
    kind_of,
    lag_name,
    law_signals,
    memory_place,
    possible,
    size_place,
    with_imperfections,
)
from faultbond.fit.likelihood import build_begin, known_starts, layout_of, nominal_q
from faultbond.fit.objective import FitPoint, FittedPlant, Scored, score_recording
from faultbond.fit.outcome import LEAST_ACCURACY
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.unknowns import unknowns_of
from faultbond.model.expression import Name
from faultbond.model.graph import BondGraph, Check, Parameter
from faultbond.types import CheckKind

WORTH = 3.0  # nats by which held-back recordings must be foretold better
FEWEST = 5.0  # nats, and
CLOSE = 0.03  # part of the best gain: so much less is about as good
TRIED = 3  # of the best, in each round
ROUNDS = 8
TURNS = 15  # steps of a climb that compares
SIZES = (0.003, 0.01, 0.03, 0.1, 0.3)  # parts of a value, or of the usual size of a signal
NOISES = (0.3, 1.0, 3.0)  # of a sensor's noise
MEMORIES = (3.0, 20.0, 120.0, 600.0)  # samples
LARGER = (3.0, 10.0, 30.0)  # times the largest size tried, where that is the best
MOST_PART = 0.5  # a relative error is not larger
LONGEST = 0.25  # of a recording: what stays longer is a parameter, not an error that comes and goes
LAGS = (0.5, 1.0, 2.0, 4.0, 8.0, 16.0, 32.0)  # samples
LAG_GRID = 4.0  # samples: a lag for which one step of the integration is enough
LEAST_LAG = 0.2  # samples
LAGS_TRIED = 2
RESTLESS = 0.5  # of the rows, in which an input moves that is no command in steps
SIZED = (Kind.RELATIVE, Kind.ABSOLUTE, Kind.WANDER, Kind.INPUT_NOISE)
HINT = 5.0  # nats that a lag must seem to explain to be tried
BEHIND = 6  # samples
MOST_SAMPLES = 6000  # with which sizes are compared
HELD = 3  # one recording of so many is held back, and the last part of so many where there is one

Build = Callable[[StepModel], Engine]
Tell = Callable[[str], None]
Recordings = Sequence[tuple[str, Sequence[Sample]]]  # names and grid points


@dataclass(frozen=True, slots=True, kw_only=True)
class Added:
    """An imperfection that was added, and how many nats the recordings gain, those fitted and those held back.

    alike : others that explain about as much
    """

    what: Imperfection
    trained: float
    held: float
    alike: tuple[Imperfection, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Footing:
    """Where the search stands.

    graph : noise of sensors and imperfections as found; values : of the parameters by name, SI
    starts : of the recordings that are fitted, by the name of the state or of a recording's own parameter
    innovations, expected : of the recordings that are fitted, (N, n_outputs) each; in standard deviations, and SI
    trained, held : logarithms of the likelihood of recordings fitted and held back
    unknown : mean logarithm of the standard errors of the parameters
    """

    graph: BondGraph
    values: Mapping[str, float]
    starts: Mapping[str, FloatArray]
    trained: float = 0.0
    held: float = 0.0
    unknown: float = 0.0
    innovations: tuple[FloatArray, ...] = ()
    expected: tuple[FloatArray, ...] = ()
    added: tuple[Added, ...] = ()


def as_found(stand: Footing) -> BondGraph:
    """Give the plant with parameters and imperfections as they stand, about as sure as a fit to all would be."""
    parameters = []
    for item in stand.graph.parameters:
        value = stand.values[item.name]
        sure = replace(item, nominal=value, accuracy=min(LEAST_ACCURACY * abs(value), item.accuracy))
        parameters.append(item if item.nominal == 0.0 or value == 0.0 else sure)
    return replace(stand.graph, parameters=tuple(parameters))


def parted(read: Recordings, least: int) -> tuple[Recordings, Recordings]:
    """Give recordings to fit and to hold back: the last of them, or the last part of one.

    Raises
    ------
    NoVerdictError
        Where a part has fewer than `least` samples.
    """
    if len(read) > 1:
        count = max(len(read) // HELD, 1)
        fitted, held = tuple(read[:-count]), tuple(read[-count:])
    else:
        ((name, points),) = read
        last = len(points) - len(points) // HELD
        after = [replace(points[last], dt=0.0), *points[last + 1 :]] if last < len(points) else []
        fitted, held = ((name, points[:last]),), ((f"the last third of {name}", after),)
    for name, points in (*fitted, *held):
        if len(points) < least:
            raise NoVerdictError(
                f"{name}: {len(points)} samples; at least {least} are needed where a part is held back to judge by; "
                "give a longer recording, or several"
            )
    return fitted, held


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
        self.longest = LONGEST * min(float(np.ptp(item.time)) for item in self.trained)
        signals = law_signals(model)
        self.possible = possible(graph, signals, len(model.states))
        self.refused: set[tuple[Kind, str]] = set()  # lags and holds that were tried in vain
        self.asked: list[tuple[Imperfection, float]] = []  # at the last round, with what each would gain
        checks = tuple(Check(name=name, kind=CheckKind.SIGNAL, reads=Name(name)) for name in signals)
        everything = replace(with_imperfections(graph, self.possible), checks=checks)
        self.signals = signals
        tell("building a filter with all that may be missing")
        self.all = self._ground(everything)

    def _ground(self, graph: BondGraph) -> "_Ground":
        model = build_step_model(build_plant(graph))
        return _Ground(self, graph, model, self.build(model))

    def first(self, found: Fit) -> Footing:
        """Give where a fit of the plant as it stands leads."""
        ground, plant = self._ground(self.graph), found.plant
        q = plant.unknowns.fill(plant.base, found.summit.point.values)[0]
        n_p, n_y = plant.layout.n_p, plant.layout.n_y
        columns = zip(ground.columns, found.summit.point.starts.T, strict=True)
        stand = Footing(
            graph=_with_noise(self.graph, np.exp(q[n_p : n_p + n_y])),
            values={item.name: x * item.scale for item, x in zip(self.graph.parameters, q[:n_p].tolist(), strict=True)},
            starts=dict(columns),
        )
        self._leave_out_wild(ground, stand)
        return ground.climbed(stand)

    def _leave_out_wild(self, ground: "_Ground", stand: Footing) -> None:
        """Leave out readings of what is held back that lie far off, if they are few, as the fit has left out others."""
        q = ground.q_of(stand)
        seen = ground.seen(self.held, ground.begin_of(self.held, self.begin_held), q)
        far = [np.abs(item.standardised) > WILD for item in seen]
        if sum(int(item.sum()) for item in far) <= FEW_WILD * sum(item.readings for item in self.held):
            self.held = tuple(item.without(wild) for item, wild in zip(self.held, far, strict=True))

    def better(self, stand: Footing) -> Footing | None:
        """Give where the best further imperfection leads; None: none foretells what was held back better."""
        slow = [item for item, gain in self.profile(stand) if gain > 0.0][:TRIED]
        lags = [item for item, gain in self.lags(stand) if gain > HINT][:LAGS_TRIED] + self.holds(stand)[:1]
        if not slow and not lags:
            return None
        self.tell(f"fitting {', '.join(item.words for item in (*slow, *lags))}")
        untried = tuple(replace(item, size=UNTRIED) for item in slow if item.key not in _keys(stand.graph))
        found = []
        for some in (slow, *([item] for item in lags)):
            with suppress(StructureError):  # a lag may leave the equations without an order in which to solve them
                found += self._climbed(stand, some, untried)
        gained = [item.held - stand.held if np.isfinite(item.held) else -np.inf for item in found]
        most = max(gained, default=-np.inf)
        if not most >= WORTH:
            return None
        self.refused |= {item.added[-1].what.key for item, gain in zip(found, gained, strict=True) if gain < WORTH}
        near = [item for item, gain in zip(found, gained, strict=True) if gain >= most - max(FEWEST, CLOSE * most)]
        best = min(near, key=lambda item: item.unknown)
        alike = tuple(item.added[-1].what for item in near if item is not best)
        return replace(best, added=(*best.added[:-1], replace(best.added[-1], alike=alike)))

    def _climbed(
        self, stand: Footing, some: Sequence[Imperfection], untried: tuple[Imperfection, ...]
    ) -> list[Footing]:
        """Give where each of some imperfections leads that one plant can hold side by side."""
        if not some:
            return []
        lag = some[0].kind in (Kind.LAG, Kind.HOLD)
        added = (replace(some[0], size=LAG_GRID * self.step),) if lag else untried
        ground = self._ground(with_imperfections(stand.graph, added))
        begun = [ground.best_lag(stand, item) if item.kind is Kind.LAG else item for item in some]
        return [ground.climbed(stand, item) for item in begun]

    def lags(self, stand: Footing) -> list[tuple[Imperfection, float]]:
        """Give inputs and sensors that seem to lag, with about how many nats that explains, the best first.

        What lags by T is behind by about T times its rate: errors go with the last changes of what is expected of a
        sensor, or of an input.
        """
        taken = set(stand.values)
        found = []
        for k, sensor in enumerate(self.graph.sensors):
            parts = zip(stand.innovations, stand.expected, strict=True)
            gain = sum(_explained(off[:, k], _changes(expected[:, k])) for off, expected in parts)
            found.append((Imperfection(kind=Kind.LAG, place=sensor.name, is_sensor=True), gain))
        for k, item in enumerate(self.graph.inputs):
            parts = zip(stand.innovations, (record.u[:, k] for record in self.trained), strict=True)
            gain = sum(_explained(column, _changes(u)) for off, u in parts for column in off.T)
            found.append((Imperfection(kind=Kind.LAG, place=item.name), gain))
        free = [item for item in found if lag_name(item[0]) not in taken and item[0].key not in self.refused]
        return sorted(free, key=lambda item: item[1], reverse=True)

    def holds(self, stand: Footing) -> list[Imperfection]:
        """Give inputs that move all the time and may go on between two rows, the likeliest first."""
        found = []
        for k, item in enumerate(stand.graph.inputs):
            courses = [record.u[:, k] for record in self.trained]
            moves = float(np.mean(np.concatenate([np.diff(u) != 0.0 for u in courses])))
            parts = zip(stand.innovations, courses, strict=True)
            gain = sum(_explained(column, _changes(u)) for off, u in parts for column in off.T)
            if not item.linear and moves > RESTLESS and gain > HINT:
                found.append((gain, Imperfection(kind=Kind.HOLD, place=item.name)))
        best = sorted(found, key=lambda one: one[0], reverse=True)
        return [item for _, item in best if item.key not in self.refused]

    def profile(self, stand: Footing) -> list[tuple[Imperfection, float]]:
        """Give what each imperfection would gain at its best size with all else as it stands, the best first."""
        self.tell("asking what each imperfection would gain")
        record = _shortened(self.trained[0])
        q, start = self.all.q_of(stand), self.all.starts_of(stand)[:1]
        plant = self.all.plant(q)
        now = float(likelihoods(plant, [record], start, q[None])[0])
        usual = self.all.usual(record, start[0], q)
        added = {item.what.place for item in stand.added}
        asked = [(item, self._sizes(stand, item, usual)) for item in self.possible if item.place not in added]
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
            declared = np.array([self.all.with_one(q, item) for item in tried])
            gains = likelihoods(plant, [record], start, declared) - now
            for item, gain in zip(tried, gains.tolist(), strict=True):
                if item.key not in best or gain > best[item.key][1]:
                    best[item.key] = item, gain
            at_end = [(item, sizes) for item, sizes in asked if sizes and best[item.key][0].size == sizes[-1]]
            asked = [
                (item, tuple(sizes[-1] * times for times in LARGER))
                for item, sizes in at_end
                if item.kind is Kind.ABSOLUTE and best[item.key][1] > 0.0
            ]
        self.asked = sorted(best.values(), key=lambda item: item[1], reverse=True)
        return self.asked

    def _sizes(self, stand: Footing, item: Imperfection, usual: dict[str, float]) -> tuple[float, ...]:
        if item.kind is Kind.WANDER:
            return SIZES
        if item.kind is Kind.RELATIVE:
            return SIZES if usual.get(item.place, 0.0) > 0.0 else ()
        if item.is_sensor:
            noise = next(known.noise for known in stand.graph.sensors if known.name == item.place)
            return tuple(part * noise for part in NOISES)
        if item.kind is Kind.INPUT_NOISE:
            k = [known.name for known in self.graph.inputs].index(item.place)
            spread = float(np.std(np.concatenate([record.u[:, k] for record in self.trained])))
            return tuple(part * spread for part in SIZES[:3] if spread > 0.0)
        return tuple(part * usual[item.place] for part in SIZES if usual.get(item.place, 0.0) > 0.0)

    def _memories(self, item: Imperfection) -> tuple[float, ...]:
        if not item.is_slow:
            return (item.memory,)
        fit = tuple(count * self.step for count in MEMORIES if count * self.step <= self.longest)
        return fit or (self.longest,)


class _Ground:
    """A plant in which some imperfections are open, as the likelihood takes it."""

    def __init__(self, search: Search, graph: BondGraph, model: StepModel, engine: Engine) -> None:
        self.search, self.graph, self.model, self.engine = search, graph, model, engine
        self.layout = layout_of(model)
        self.begin, known = build_begin(model), known_starts(model)
        self.free = tuple(k for k in range(self.layout.n_x) if k not in known)
        self.own = tuple((k, item) for k, item in enumerate(graph.parameters) if item.name in search.own)
        self.columns = (*(model.states[k] for k in self.free), *(item.name for _, item in self.own))

    def begin_of(self, records: Sequence[HealthyRecording], begin: FitPoint) -> FitPoint:
        """Give where recordings begin; what lags begins about where that is which it follows."""
        known = {name: k for k, name in enumerate(self.search.columns)}
        starts, sizes = np.zeros((2, len(records), len(self.columns)))
        inputs = {f"{item.name}.lagged": k for k, item in enumerate(self.graph.inputs)}
        sensors = {f"{item.name}.lagged": k for k, item in enumerate(self.graph.sensors)}
        for column, name in enumerate(self.columns):
            for r, record in enumerate(records):
                if name in known:
                    first, size = begin.starts[r, known[name]], begin.sizes[r, known[name]]
                else:
                    course = record.u[:, inputs[name]] if name in inputs else record.y[:, sensors[name]]
                    course = course[np.isfinite(course)]
                    first, size = course[0], max(float(np.std(course)), 1e-9)
                starts[r, column], sizes[r, column] = first, size
        return FitPoint(values=begin.values, starts=starts, sizes=sizes)

    def starts_of(self, stand: Footing) -> FloatArray:
        """Give the starts of the recordings that are fitted as they stand, (n_records, n_own)."""
        begin = self.begin_of(self.search.trained, self.search.begin).starts
        for column, name in enumerate(self.columns):
            if name in stand.starts:
                begin[:, column] = stand.starts[name]
        return begin

    def seen(self, records: Sequence[HealthyRecording], begin: FitPoint, q: FloatArray) -> list[Scored]:
        """Give what recordings show with all numbers known but where they start."""
        plant = self.plant(q)
        summit = foretold(plant, records, begin, q)
        return [score_recording(all_known(plant, q), item, summit.point, r) for r, item in enumerate(records)]

    def best_lag(self, stand: Footing, item: Imperfection) -> Imperfection:
        """Give a lag as long as it explains most with all else as it stands."""
        times = [count * self.search.step for count in LAGS if count * self.search.step <= self.search.longest]
        times = times or [self.search.step]
        q, starts = self.q_of(stand), self.starts_of(stand)
        tried = np.array([self.with_one(q, replace(item, size=time)) for time in times])
        gains = likelihoods(self.plant(q), self.search.trained, starts, tried)
        return replace(item, size=times[int(np.argmax(gains))])

    def q_of(self, stand: Footing) -> FloatArray:
        """Give q with everything as it stands, (n_q,); what is not part of it is next to nothing."""
        q, layout = nominal_q(self.model), self.layout
        for k, item in enumerate(self.graph.parameters):
            q[k] = stand.values.get(item.name, item.nominal) / item.scale
        slow = {(item.target, item.relative): item for item in stand.graph.slow_errors}
        first = layout.first_noise + layout.n_y
        q[layout.first_noise : first] = np.log([item.noise for item in stand.graph.sensors])
        for k, error in enumerate(self.graph.slow_errors):
            known = slow.get((error.target, error.relative), replace(error, sd=UNTRIED))
            q[first + k], q[layout.first_memory + k] = np.log(known.sd), np.log(known.memory)
        for k, number in enumerate(self.model.noisy, start=first + layout.n_b):
            q[k] = np.log(max(stand.graph.inputs[number].noise, UNTRIED))
        return q

    def with_one(self, q: FloatArray, item: Imperfection) -> FloatArray:
        """Give q with one imperfection of a size."""
        changed = q.copy()
        if item.kind is Kind.HOLD:
            return changed
        place = size_place(self.graph, self.layout, item)
        if item.kind is Kind.LAG:
            changed[place] = item.size / self.graph.parameters[place].scale
            return changed
        changed[place] = np.log(item.size)
        if item.is_slow:
            changed[memory_place(self.graph, self.layout, item)] = np.log(item.memory)
        return changed

    def plant(self, q: FloatArray, opened: Sequence[Imperfection] = ()) -> FittedPlant:
        """Give the plant about q; parameters, noise of sensors, declared slow errors and what is opened are unknown."""
        search, layout = self.search, self.layout
        base = nominal_q(self.model)
        base[layout.n_p :] = q[layout.n_p :]
        lags = {lag_name(item) for item in opened if item.kind is Kind.LAG}
        sizes = {size_place(self.graph, layout, item): item for item in opened if item.kind in SIZED}
        memories = {memory_place(self.graph, layout, item): item for item in opened if item.is_slow}
        declared = range(layout.first_noise, layout.first_noise + layout.n_y + len(search.graph.slow_errors))
        noises = tuple(sorted({*declared, *sizes, *memories}))
        names = {item.name for _, item in search.parameters} - set(search.own) | lags
        parameters = tuple((k, item) for k, item in enumerate(self.graph.parameters) if item.name in names)
        unknowns = unknowns_of(layout, base, parameters, noises, grow=True)
        lower, upper = unknowns.lower.copy(), unknowns.upper.copy()
        for k, (_, item) in enumerate(parameters):
            if item.name in lags:
                ends = np.log(np.array([LEAST_LAG * search.step, search.longest]) / item.nominal)
                lower[k], upper[k] = ends[0], max(ends)
        for k, place in enumerate(noises, start=unknowns.n_theta):
            if place in memories:
                lower[k], upper[k] = np.log(search.step), np.log(max(search.longest, search.step))
            elif place in sizes:
                upper[k] = np.log(MOST_PART) if sizes[place].kind in (Kind.RELATIVE, Kind.WANDER) else upper[k]
            elif place >= layout.first_noise + layout.n_y:
                upper[k] = base[place]
        return FittedPlant(
            sensors=tuple(item.name for item in self.graph.sensors),
            layout=layout,
            engine=_Padded(self.engine, layout.n_sample),
            begin=self.begin,
            base=base,
            implicit=self.model.reference_implicit,
            unknowns=replace(unknowns, lower=lower, upper=upper),
            free=self.free,
            own=tuple((k, item.accuracy / abs(item.scale)) for k, item in self.own),
        )

    def climbed(self, stand: Footing, more: Imperfection | None = None) -> Footing:
        """Give where a climb leads that begins where it stands, with one more imperfection or none."""
        search = self.search
        opened = [*(item.what for item in stand.added), *([] if more is None else [more])]
        q = self.q_of(stand) if more is None else self.with_one(self.q_of(stand), more)
        plant = self.plant(q, opened)
        unknowns = plant.unknowns
        values = np.clip(_values(plant, q), unknowns.lower, unknowns.upper)
        known = self.begin_of(search.trained, search.begin)
        begin = replace(known, values=values, starts=self.starts_of(stand))
        summit = ascend(plant, search.trained, begin, unknowns.widened(WIDE), anchor=known.starts, turns=TURNS)
        found = unknowns.fill(plant.base, summit.point.values)[0]
        ahead = foretold(plant, search.held, self.begin_of(search.held, search.begin_held), found)
        stood = self._stood(stand, opened, found, summit, ahead.evaluation.value)
        if more is None:
            return stood
        last = next(item for item in _found(self, found, opened) if item.key == more.key)
        gained = Added(what=last, trained=stood.trained - stand.trained, held=stood.held - stand.held)
        return replace(stood, added=(*stood.added, gained))

    def _stood(
        self, stand: Footing, opened: Sequence[Imperfection], q: FloatArray, summit: Summit, held: float
    ) -> Footing:
        layout, search = self.layout, self.search
        noise = np.exp(q[layout.n_p : layout.n_p + layout.n_y])
        sizes = _found(self, q, opened)
        n = len(summit.point.values)
        wide = np.concatenate([np.full(n, WIDE), np.full(summit.point.starts.size, WIDE)])
        spread = np.diag(inverse_of(summit.evaluation.information + np.diag(wide**-2.0)))
        n_theta = len([item for item in search.parameters if item[1].name not in search.own])
        unknown = float(np.mean(np.log(np.maximum(spread[:n_theta], 1e-300)))) / 2.0 if n_theta else 0.0
        by_key = {item.key: item for item in sizes}
        plant, values = self.plant(q), {}
        for item, factor in zip(self.graph.parameters, q[: layout.n_p].tolist(), strict=True):
            values[item.name] = factor * item.scale
        seen = [
            score_recording(all_known(plant, q), item, replace(summit.point, values=np.zeros(0)), r)
            for r, item in enumerate(search.trained)
        ]
        return Footing(
            graph=with_imperfections(_with_noise(stand.graph, noise), sizes),
            values=values,
            starts=dict(zip(self.columns, summit.point.starts.T, strict=True)),
            innovations=tuple(item.standardised for item in seen),
            expected=tuple(record.y - item.innovations for record, item in zip(search.trained, seen, strict=True)),
            trained=summit.evaluation.value,
            held=held if np.isfinite(summit.evaluation.value) else -np.inf,
            unknown=unknown,
            added=tuple(replace(item, what=by_key[item.what.key]) for item in stand.added),
        )

    def usual(self, record: HealthyRecording, start: FloatArray, q: FloatArray) -> dict[str, float]:
        """Give the usual size of each signal of a law: root of the mean square, SI."""
        n_u = self.layout.n_u
        rows = joint_courses(self.plant(q), record, start, q)
        by_hand, implicit = self.model.by_hand, self.model.reference_implicit
        with np.errstate(all="ignore"):
            found = [by_hand(row[n_u:], row[:n_u], implicit).full()[:, 0] for row in rows]
            sizes = np.sqrt(np.mean(np.square(found), axis=0))
        return {name: float(size) for name, size in zip(self.search.signals, sizes, strict=True) if np.isfinite(size)}


class _Padded:
    """An engine that takes samples of a plant with fewer slow errors: nothing is added to those behind."""

    def __init__(self, engine: Engine, n_sample: int) -> None:
        self.engine, self.n_sample = engine, n_sample

    @property
    def title(self) -> str:
        return self.engine.title

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes over a block of samples; see `Engine.advance`."""
        missing = self.n_sample - samples.shape[1]
        return self.engine.advance(lanes, np.pad(samples, ((0, 0), (0, missing))) if missing else samples)


def values_of(plant: FittedPlant, stand: Footing) -> FloatArray:
    """Give the unknowns (n,) of another fit of the same plant, with parameters as they stand."""
    q = plant.base.copy()
    for place, item in zip(plant.unknowns.places, plant.unknowns.parameters, strict=False):
        q[place] = stand.values.get(item.name, item.nominal) / item.scale
    return np.clip(_values(plant, q), plant.unknowns.lower, plant.unknowns.upper)


def _values(plant: FittedPlant, q: FloatArray) -> FloatArray:
    """Give the unknowns at q."""
    unknowns, n = plant.unknowns, plant.unknowns.n_theta
    values = np.array(q[unknowns.places])
    logs = unknowns.logarithmic[:n]
    values[:n] = np.where(logs, np.log(np.maximum(values[:n], 1e-300)), values[:n])
    return values


def _found(ground: _Ground, q: FloatArray, opened: Sequence[Imperfection]) -> tuple[Imperfection, ...]:
    """Give imperfections with the sizes and memories of q."""
    found = []
    for item in opened:
        if item.kind is Kind.HOLD:
            found.append(item)
            continue
        place = size_place(ground.graph, ground.layout, item)
        if item.kind is Kind.LAG:
            found.append(replace(item, size=float(q[place] * ground.graph.parameters[place].scale)))
            continue
        size = float(np.exp(q[place]))
        memory = float(np.exp(q[memory_place(ground.graph, ground.layout, item)])) if item.is_slow else item.memory
        found.append(replace(item, size=size, memory=memory))
    return tuple(found)


def _with_noise(graph: BondGraph, noise: FloatArray) -> BondGraph:
    sensors = zip(graph.sensors, noise.tolist(), strict=True)
    return replace(graph, sensors=tuple(replace(item, noise=sd) for item, sd in sensors))


def _keys(graph: BondGraph) -> set[tuple[Kind, str]]:
    noisy = {(Kind.INPUT_NOISE, item.name) for item in graph.inputs if item.noise > 0.0}
    return noisy | {(kind_of(item), item.target) for item in graph.slow_errors}


def _changes(course: FloatArray) -> FloatArray:
    """Give the last changes of something, (N, n), the newest first."""
    change = np.diff(course, prepend=course[:1])
    return np.column_stack([np.concatenate([np.zeros(lag), change[: len(change) - lag]]) for lag in range(BEHIND)])


def _explained(off: FloatArray, changes: FloatArray) -> float:
    """Give how many nats it is worth that errors (N,), in standard deviations, go with changes (N, n)."""
    here = np.isfinite(off) & np.isfinite(changes).all(axis=1)
    scale = changes[here].std(axis=0) if here.any() else np.zeros(1)
    if here.sum() <= 2 * BEHIND or not np.all(scale > 0.0):
        return 0.0
    columns, values = changes[here] / scale, off[here]
    left = values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0]
    return float(0.5 * here.sum() * np.log(max(np.sum(values**2), 1e-300) / max(np.sum(left**2), 1e-300)))


def _shortened(record: HealthyRecording) -> HealthyRecording:
    part = slice(0, MOST_SAMPLES)
    return replace(record, time=record.time[part], u=record.u[part], samples=record.samples[part], use=record.use[part])
