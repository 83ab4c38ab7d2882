"""A fitted model on trial on healthy recordings, and what it must declare otherwise."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np

from faultbond.analysis.smallest import SmallestFault, smallest_faults
from faultbond.app.engine import build_trial
from faultbond.app.realisations import compiled_detector
from faultbond.contract.samples import Sample
from faultbond.errors import FaultbondError
from faultbond.fit.foothold import Added
from faultbond.fit.healthy_changes import healthy_changes
from faultbond.fit.held_back import Recordings
from faultbond.fit.imperfections import Imperfection
from faultbond.fit.lasting_error import as_noise, lasting_errors
from faultbond.fit.quiet_search import Tell
from faultbond.fit.samples import HealthyRecording, healthy_recording
from faultbond.fit.trial import (
    CALM,
    LOUDEST,
    MONTH,
    ROOM,
    Health,
    alarms_of,
    enough,
    on_trial,
    strayed_on,
    widest_of,
)
from faultbond.model.graph import BondGraph, SlowError
from faultbond.model.text import parse_model
from faultbond.model.validity import without_states
from faultbond.report.fit_result import Fitted
from faultbond.report.quiet_result import amended_text
from faultbond.report.resized import Resized, lowered_text, raised_text, resized_in_turn, widened_text
from faultbond.runtime.core import Core
from faultbond.synthesis.engine import build_model

PATIENCE = 60.0  # s of a processor for the smallest faults of a model; usual plants take 2 to 10
SPARE = 1.05  # times what it takes: a wider accuracy lets a parameter move a little farther
MOST_TIMES = 3  # that a model is raised in turn
LOWERED = (1.0, 0.5, 0.25)  # parts of the way to what recordings say of slow errors, as ratios, that are tried

Smallest = tuple[SmallestFault, ...]
Lasting = tuple[Imperfection, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Attempt:
    """A model with what the search has found, fitted to all recordings and put on trial.

    widened : how many times as large the accuracies of parameters are declared as the data say, by name
    lowered : slow errors that are declared smaller than they were
    """

    text: str
    graph: BondGraph
    core: Core
    records: tuple[HealthyRecording, ...]
    fitted: Fitted
    health: Health
    alarms: dict[str, float]
    widened: dict[str, float] = field(default_factory=dict)
    lowered: tuple[Resized, ...] = ()

    @property
    def quiet(self) -> bool:
        """Whether it keeps its promise, with room for other days, and the monitor itself does not alarm."""
        return self.health.has_room and not self.alarms


def put_on_trial(text: str, fitted: Fitted, read: Recordings, tell: Tell) -> Attempt:
    """Put a model text on trial."""
    tell("putting the model on trial")
    graph = parse_model(text, file=fitted.graph.file)
    core = build_trial(graph)
    records = tuple(healthy_recording(name, points, core) for name, points in read)
    promise = graph.time_between_false_alarms or MONTH
    return Attempt(
        text=text,
        graph=graph,
        core=core,
        records=records,
        fitted=fitted,
        health=on_trial(core, records, promise, factors=()),
        alarms=alarms_of(core, records),
    )


def widened(attempt: Attempt, tell: Tell) -> Attempt:
    """Declare the accuracy of parameters larger that stray from where they start, as little as it takes.

    What a fit says of a parameter is how well all recordings together tell one value of it; how far it is from that in
    each of them, or under other inputs, is what `run` has to be told. As it was where that is more than `widest_of`.
    Those that strayed and in which no fault is sought get more room, as far as they may have it.
    """
    before, times = attempt.widened, dict[str, float]()
    most = {item.name: widest_of(item.suspect) / before.get(item.name, 1.0) for item in attempt.graph.parameters}

    def strayed_with(times: dict[str, float]) -> dict[str, float]:
        graph = parse_model(widened_text(attempt.text, attempt.graph, times), file=attempt.graph.file)
        return strayed_on(build_trial(graph), attempt.records)

    strayed = attempt.health.strayed
    while far := {name: part / ROOM for name, part in strayed.items() if part > ROOM}:
        hopes = not times
        times = {name: times.get(name, 1.0) * far.get(name, 1.0) for name in (*times, *far)}
        times = {name: x * SPARE if name in far else x for name, x in times.items()}
        if any(x > most[name] for name, x in times.items()):
            return attempt
        if hopes:  # a wider accuracy also lets it move farther: some stray however wide it is
            widest = strayed_with({name: most[name] for name in far})
            if any(widest.get(name, 0.0) > ROOM for name in far):
                return attempt
        strayed = strayed_with(times)
    for item in attempt.graph.parameters:
        if not item.suspect and (part := strayed.get(item.name, 0.0)) > CALM:
            times[item.name] = min(times.get(item.name, 1.0) * SPARE * part / CALM, most[item.name])
    if not times:
        return attempt
    text = widened_text(attempt.text, attempt.graph, times)
    wider = put_on_trial(text, attempt.fitted, [(item.name, item.points) for item in attempt.records], tell)
    return replace(wider, widened=before | {name: before.get(name, 1.0) * x for name, x in times.items()})


def raised_until_quiet(attempt: Attempt, promise: float, tell: Tell) -> tuple[Attempt, tuple[Resized, ...], Lasting]:
    """Declare accuracies, noise or slow errors larger, as little as it takes; as it was where nothing is enough.

    Gives also the slow errors of sensors that it takes in place of shorter ones, or of none, where less is declared in
    all with them. Where accuracies must be wider then, parameters move farther, and what is left of the sensors may
    take more; that is raised in turn.
    """
    raised: tuple[Resized, ...] = ()
    lasting: Lasting = ()
    for _ in range(MOST_TIMES):
        further, more, longer = _raised_once(attempt, promise, tell)
        replaced = {item.words for item in longer}
        together = resized_in_turn([item for item in raised if item.what not in replaced], more)
        if any(item.times > LOUDEST for item in together):
            break
        attempt, raised = further, together
        lasting = (*(item for item in lasting if item.words not in replaced), *longer)
        if attempt.quiet or not (more or longer):
            break
    return attempt, raised, lasting


def _raised_once(attempt: Attempt, promise: float, tell: Tell) -> tuple[Attempt, tuple[Resized, ...], Lasting]:
    """Give the first way to declare more that is quiet, by how much that is in all; where none is, that with least."""
    variant = enough(attempt.core, attempt.records, promise)
    ways = [] if variant is not None and variant.accuracy > 1.0 else _with_lasting(attempt, promise, tell)
    if variant is not None:
        ways.append((attempt, *raised_text(attempt.text, attempt.graph, variant), ()))
    tried = []
    for known, text, raised, lasting in sorted(ways, key=lambda way: _loudness(way[1], attempt)):
        read = [(item.name, item.points) for item in attempt.records]
        wider = replace(put_on_trial(text, known.fitted, read, tell), widened=attempt.widened)
        tried.append((widened(wider, tell), raised, lasting))
        if tried[-1][0].quiet:
            return tried[-1]
    return tried[0] if tried else (attempt, (), ())


def _with_lasting(
    attempt: Attempt, promise: float, tell: Tell
) -> list[tuple[Attempt, str, tuple[Resized, ...], Lasting]]:
    """Give the text of a model with slow errors that last, where it takes some, and what must be raised with them.

    Of those that they replace nothing is known any more.
    """
    lasting = lasting_errors(attempt.graph, attempt.health)
    if not lasting:
        return []
    tell(f"asking for slow errors that last: {', '.join(item.words for item, _ in lasting)}")
    new = [Added(what=item, trained=0.0, held=0.0) for item, _ in lasting]
    text = amended_text(attempt.text, attempt.graph, new)
    graph = parse_model(text, file=attempt.graph.file)
    core, replaced = build_trial(graph), {item.place: before for item, before in lasting}
    records = [healthy_recording(item.name, item.points, core) for item in attempt.records]
    noise = [as_noise(item.noise, replaced.get(item.name)) for item in graph.sensors]
    variant = enough(core, records, promise, noise=noise)
    if variant is None:
        return []
    gone = {name for name, before in replaced.items() if before is not None}
    noises = (x for x in attempt.fitted.noises if not (isinstance(x.of, SlowError) and x.name in gone))
    known = replace(attempt, fitted=replace(attempt.fitted, noises=tuple(noises)))
    return [(known, *raised_text(text, graph, variant), tuple(item for item, _ in lasting))]


def _loudness(text: str, attempt: Attempt) -> float:
    """Give how much is declared as noise and slow errors, a sum of logarithms."""
    graph = parse_model(text, file=attempt.graph.file)
    sizes = {item.target: item.sd for item in graph.slow_errors}
    sensors = [hypot(item.noise, sizes.pop(item.name, 0.0)) for item in graph.sensors]
    return float(np.sum(np.log([*sensors, *sizes.values()])))


def lowered_if_quiet(attempt: Attempt, tell: Tell) -> Attempt:
    """Declare slow errors as small as the recordings say, where a quiet model stays so: faults hide behind them.

    Where it does not, half of that way is tried, and a quarter, as ratios.
    """
    if not attempt.quiet:
        return attempt
    for part in LOWERED:
        smaller = _lowered(attempt, part, tell)
        if smaller is None or smaller.quiet:
            return smaller or attempt
    return attempt


def _lowered(attempt: Attempt, part: float, tell: Tell) -> Attempt | None:
    """Put a model on trial with slow errors that are smaller by a part of what the recordings say; None: none is."""
    text, lowered = lowered_text(attempt.text, attempt.graph, attempt.fitted.noises, part)
    if not lowered:
        return None
    tell(f"declaring smaller: {', '.join(item.what for item in lowered)}")
    graph = parse_model(text, file=attempt.graph.file)
    changes = healthy_changes(build_trial(graph), attempt.records)
    fitted = replace(attempt.fitted, graph=graph, healthy_changes=changes)
    text, fitted = fitted.with_healthy_changes(text, graph), replace(fitted, graph=attempt.fitted.graph)
    read = [(item.name, item.points) for item in attempt.records]
    smaller = widened(replace(put_on_trial(text, fitted, read, tell), widened=attempt.widened), tell)
    return replace(smaller, lowered=lowered)


def apart_if_quieter(attempt: Attempt, text: str, tell: Tell) -> Attempt:
    """Leave out how parameters go together where that makes a model quiet, or lets its parameters walk less far.

    What recordings leave open of a sum may be far less than what it moves by, as a model that is not exact lets it.

    text : of the model before what was fitted
    """
    first = widened(attempt, tell)
    if first.quiet or not attempt.fitted.correlations:
        return first
    tell("leaving out how parameters go together")
    fitted = replace(attempt.fitted, apart=True)
    read = [(item.name, item.points) for item in attempt.records]
    apart = widened(put_on_trial(fitted.model_text(text), fitted, read, tell), tell)
    return apart if apart.quiet or apart.health.walk < first.health.walk else first


def known_where_it_walks(attempt: Attempt, text: str, tell: Tell) -> Attempt:
    """Declare the powers and constants that were added as known where they walk: in them no fault is sought.

    They stand for laws that are a little otherwise, and other operation asks for other values of them. As it was where
    that lets nothing walk less far.

    text : of the model before what was fitted
    """
    while attempt.health.walk > ROOM and attempt.health.walker in _terms(attempt):
        known = attempt.fitted.known | {attempt.health.walker}
        tell(f"declaring {attempt.health.walker} as known")
        fitted = replace(attempt.fitted, known=known)
        read = [(item.name, item.points) for item in attempt.records]
        stilled = widened(put_on_trial(fitted.model_text(text), fitted, read, tell), tell)
        if not stilled.health.walk < attempt.health.walk:
            break
        attempt = stilled
    return attempt


def _terms(attempt: Attempt) -> frozenset[str]:
    """Give the parameters that were added in laws, of which no fault is sought, and that are not known exactly."""
    graph = attempt.graph
    lags = {item.lag for item in graph.inputs} | {item.lag for item in graph.sensors}
    trusted = {item.name for item in graph.parameters if not item.suspect and item.accuracy > 0.0}
    return (attempt.fitted.added & trusted) - lags


def smallest_of_each(plants: Sequence[tuple[BondGraph, Core]], records: Sequence[HealthyRecording]) -> list[Smallest]:
    """Give the smallest faults of plants as `analyse --data` does, in the longest recording.

    All of them in a usual run where one cannot be tried in that, so that they can be compared; none where nothing can.
    """
    longest = max(records, key=lambda record: len(record.points))
    for samples in (longest.points, None):
        with suppress(FaultbondError):
            return [_smallest_in(graph, core, samples) for graph, core in plants]
    return [() for _ in plants]


def _smallest_in(graph: BondGraph, core: Core, samples: Sequence[Sample] | None) -> Smallest:
    """Give the smallest faults of a plant in a run, by default a usual one, in which it holds all the time."""
    always = without_states(graph) if samples is None else graph
    core = core if always == graph else build_trial(always)
    detector = compiled_detector(core.spec.thresholds)
    return tuple(smallest_faults(build_model(always), core.spec, core, detector, samples, seconds=PATIENCE))
