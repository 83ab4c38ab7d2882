"""`fit --until-quiet`: what a model leaves out is added until healthy recordings are as quiet as promised."""

from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import inf, isfinite
from time import monotonic

from faultbond.app.attempt import (
    Attempt,
    apart_if_quieter,
    known_where_it_walks,
    lowered_if_quiet,
    put_on_trial,
    raised_until_quiet,
    smallest_of_each,
)
from faultbond.app.deadline import Deadline
from faultbond.app.engine import build_trial
from faultbond.app.likelihood import begun_likelihood, likelihood_engine
from faultbond.app.signals import Stopped, last_of
from faultbond.app.wishes import FitWishes
from faultbond.equations.step import StepModel
from faultbond.errors import FaultbondError
from faultbond.fit.ascent import Finish
from faultbond.fit.coarse_step import as_declared, coarsest
from faultbond.fit.cure import Cure, cured, strayed
from faultbond.fit.evidence import begun_likeliest
from faultbond.fit.foothold import Footing, as_fitted, as_found, begun_as_found, values_of, with_values
from faultbond.fit.further import better, held_until
from faultbond.fit.ground import COARSE
from faultbond.fit.healthy_changes import healthy_changes
from faultbond.fit.held_back import Recordings, parted
from faultbond.fit.identification import Fit, Halted, Prior, Reached, fit_at, fit_plant
from faultbond.fit.lags import of_an_input
from faultbond.fit.objective import FitPoint, FittedPlant
from faultbond.fit.offset import centred
from faultbond.fit.quiet_search import ROUNDS, WORTH, Search, Tell
from faultbond.fit.samples import HealthyRecording, healthy_recording
from faultbond.fit.session import begin_at, build_fit, free_parameters, likelier_begin
from faultbond.fit.trial import MONTH, ROOM, alarms_of, on_trial, stays_below
from faultbond.model.amend import amended
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.report.doubts import earlier_doubt
from faultbond.report.fit_result import Fitted, fitted_model, not_shown, unsteady
from faultbond.report.numbers import duration_text
from faultbond.report.quiet_result import Quieted, amended_text
from faultbond.report.resized import Resized, with_stated_accuracies
from faultbond.synthesis.engine import build_model

LEAST = 60  # samples of a part of the recordings
SETTLED = 0.01  # nats that a further step would bring to a fit: a tenth of a standard error or so
TAKES = (5.0, 20.0)  # times as long as the first fit a search takes; measured, see docs/fitting.md
LONG = 300.0  # s; of a search that may take longer it is told how long
FIRST, SEARCH, FITTED = 0.2, 0.55, 0.65  # parts of its time by which the first fit, the search, and the last fit end
AGREEING = 2  # starts of the first fit that end at the same values; no further one is tried
AS_GOOD = 0.01  # part of what these have gained, within which they are the same to a search, which has more to gain

ByThen = Callable[[], Quieted]  # what was found, worked out where somebody asks for it


def fit_until_quiet(
    text: str, graph: BondGraph, read: Recordings, wishes: FitWishes, tell: Tell, warn: Tell
) -> Quieted:
    """Fit a model and add what the recordings call for until they are quiet, or somebody stops the search.

    Who stops it gets what was found by then: no further step is begun. So does who meets an error on the way.

    tell, warn : are told what is being done, and what may be a reason to stop

    Raises
    ------
    NoVerdictError
        Where the recordings are too short for a part of them to be held back.
    Stopped
        Where somebody stops it before the first climb has ended.
    """
    found, ended = last_of(_steps(text, graph, read, wishes, tell, warn))
    if isinstance(ended, Stopped):
        tell("working out what was found by then")
        return replace(_by_then(found(), graph, read), stopped=ended.number)
    return found() if ended is None else replace(_by_then(found(), graph, read), failed=ended)


def _by_then(now: Quieted, stated: BondGraph, read: Recordings) -> Quieted:
    """Give what was found where somebody stops the search.

    Before a trial nobody knows whether accuracies as the data tell them are wide enough, so that they stay as stated:
    who goes on from there is else told that parameters are far outside of what a search had said half-way. On which
    recordings it alarms is asked, though: `run` is not to claim faults by a model that is known to.
    """
    if now.health is not None:
        return now
    text = with_stated_accuracies(now.text, stated)
    with suppress(FaultbondError):  # what ended it may be that nothing can be compiled any more
        alarms = alarms_with(text, stated.file, read)
        text = replace(now.fitted, alarms=alarms).with_false_alarms(text)
        return replace(now, text=text, alarms=alarms, asked=True)
    return replace(now, text=text)


def alarms_with(text: str, file: str, read: Recordings) -> dict[str, float]:
    """Give when the detector alarms on healthy recordings, s, by their names, with the text of a model."""
    core = build_trial(parse_model(text, file=file))
    return alarms_of(core, [healthy_recording(name, points, core) for name, points in read])


def _steps(
    text: str, graph: BondGraph, read: Recordings, wishes: FitWishes, tell: Tell, warn: Tell
) -> Iterator[ByThen]:
    """Give what is found by and by, each time what works out all that there is to tell by then."""
    deadline = Deadline(tell, wishes.within)
    stated = graph.time_between_false_alarms is not None
    text, graph = promising(text, graph)
    promise = graph.time_between_false_alarms or MONTH
    fitted, held = parted(read, LEAST)
    tell("building the engine")
    core, model = build_trial(graph), build_model(graph)
    likelihood = likelihood_engine(model)
    parameters = free_parameters(graph, wishes.fixed, wishes.free, wishes.own)
    plant, records, begin = build_fit(model, likelihood, core, fitted, parameters, wishes.own)
    _, records_held, begin_held = build_fit(model, likelihood, core, held, parameters, wishes.own)
    names = tuple(name for name, _ in held)

    def first(found: Fit) -> Quieted:
        fitted = replace(fitted_model(graph, found, core.spec.version), doubt=earlier_doubt(text))
        return Quieted(fitted=fitted, text=fitted.model_text(text), held=names, stated=stated, promise=promise)

    started = monotonic()
    fit = partial(
        fit_plant,
        prior=Prior(wishes.prior),
        agreeing=AGREEING,
        near=AS_GOOD,
        finish=Finish(SETTLED, COARSE, partial(deadline.has, FIRST)),
        seed=wishes.seed,
        tell=tell,
    )
    try:
        found, fewer = _fitted_first(plant, records, begin, model, wishes.starts, fit)
    except Halted as halted:
        yield _known(first(halted.fit()))
        raise
    now = first(found)
    yield _known(now)
    for told in not_shown(now.fitted):
        warn(f"{told}. If you know one, stop here (Ctrl-C) and begin again: the search leaves that as it is")
    for told in unsteady(now.fitted):
        most = "most likely the model lacks something there, which is looked for"
        warn(f"{told}: {most}. If the plant was not healthy then, stop here (Ctrl-C) and leave that out")
    if told := forecast(monotonic() - started, wishes.within):
        warn(told)
    tell("putting the first model on trial")
    now = replace(now, before=on_trial(core, (*records, *records_held), promise, factors=()))
    recorded = (found.records, records_held), (begin, begin_held)
    search = Search(graph, begun_likelihood, fewer, deadline, parameters, wishes.own, *recorded)
    attempt, now = yield from _searched(search, search.first(found), now, text, graph, read, wishes, deadline)
    now = replace(now, left=tuple(item for item in search.asked if item[1] > 0.0))
    raised: tuple[Resized, ...] = ()
    if not attempt.quiet:
        tell("raising what must be declared larger")
        attempt, raised, lasting = raised_until_quiet(attempt, promise, tell)
        now = replace(_tried(now, attempt, raised), lasting=lasting)
        yield _known(now)
    if deadline.has(1.0):
        attempt = lowered_if_quiet(attempt, tell)
    now = _tried(now, attempt, raised)
    yield _known(now)
    tell("working out the smallest faults before and after")
    before, after = smallest_of_each([(graph, core), (attempt.graph, attempt.core)], attempt.records)
    yield _known(replace(now, smallest_before=before, smallest_after=after))


def _fitted_first(
    plant: FittedPlant,
    records: Sequence[HealthyRecording],
    begin: FitPoint,
    model: StepModel,
    starts: int,
    fit: Callable[..., Fit],
) -> tuple[Fit, int]:
    """Fit a plant as it stands, and tell in how many times fewer parts a search may take its steps from there.

    The fit takes as few itself where they are enough where it begins. Where they are not where it has led, what it says
    is said with all: a search begins with a climb.
    """
    fewer = coarsest(plant, records, begin, model, begun_likelihood)
    rough = replace(plant, engine=begun_likelihood(model, fewer)()) if fewer > 1 else plant
    found = fit(rough, records, begin, starts=starts)
    fine = replace(found.plant, engine=plant.engine)
    enough = coarsest(fine, found.records, as_declared(found), model, begun_likelihood)
    if enough < fewer:
        reached = Reached(found.summit, found.reached, found.starts)
        found = fit_at(fine, found.records, begin, found.summit.point, found.prior, reached)
    return found, enough


def forecast(first: float, within: float) -> str:
    """Say how long a search may take, by the seconds of its first fit, and what ends it; nothing of a short one."""
    least, most = (times * first for times in TAKES)
    if most < LONG:
        return ""
    took, *about = (duration_text(seconds, digits=2) for seconds in (first, least, most))
    told = (
        f"the first fit took {took}; the search for what is missing usually takes {' to '.join(about)} from here. "
        "Fewer or shorter recordings and a longer `sample_time` make it shorter; Ctrl-C ends it with what was found"
    )
    if not isfinite(within):
        return told
    ends = duration_text(SEARCH * within, digits=2)
    return f"{told}; {ends} after its begin it ends by itself, and what was found is made quiet (`--within` moves that)"


def _tried(now: Quieted, attempt: Attempt, raised: tuple[Resized, ...] = ()) -> Quieted:
    """Give what is found with a model that was put on trial."""
    wider = (Resized(what=f"accuracy of {name}", times=x) for name, x in attempt.widened.items())
    return replace(
        now,
        fitted=attempt.fitted,
        text=replace(attempt.fitted, alarms=attempt.alarms).with_false_alarms(attempt.text),
        health=attempt.health,
        alarms=attempt.alarms,
        raised=(*raised, *wider),
        lowered=attempt.lowered,
    )


def promising(text: str, graph: BondGraph) -> tuple[str, BondGraph]:
    """Give a model that promises a time between false alarms: its own, else a month.

    A model that promises none has limits for slow errors that stay much as they are, and none could keep the promise by
    which it is judged here.
    """
    if graph.time_between_false_alarms is not None:
        return text, graph
    text = amended(text, [(("time_between_false_alarms",), f"{MONTH / 86400.0:.0f} d")], graph.file)
    return text, parse_model(text, file=graph.file)


def _searched(
    search: Search,
    stand: Footing,
    now: Quieted,
    text: str,
    graph: BondGraph,
    read: Recordings,
    wishes: FitWishes,
    deadline: Deadline,
) -> Generator[ByThen, None, tuple[Attempt, Quieted]]:
    """Add one thing after the other until it is quiet, or nothing gains; return the model on trial, and what is found.

    Yields what is found after each step. Where the time is up in a round, the best that it had by then is added.
    """
    tried: Attempt | None = None
    prior = Prior(wishes.prior)
    may_stray = (item.name for item in graph.parameters) if prior is Prior.NONE else ()
    asked = dict.fromkeys(may_stray, inf)
    for rounds in range(ROUNDS + 1):
        better, may_go_on = None, rounds < ROUNDS and deadline.has(SEARCH)
        search.by_then = None
        if _seems_quiet(stand, read, deadline):
            again = partial(_cured_again, search, stand, asked)
            better = deadline.in_time(SEARCH, again) if may_go_on else None
            if better is None:
                tried, now = yield from _attempt(stand, now, text, graph, read, wishes, search.believed, deadline)
                if tried.quiet:
                    return tried, now
        if rounds < ROUNDS and not may_go_on:
            deadline("no further round begins: the time is up")
        if better is None and may_go_on:
            deadline(f"looking for what is missing, round {rounds + 1} of at most {ROUNDS}")
            better = deadline.in_time(SEARCH, partial(_next, search, stand, asked))
        if better is None:
            if (best := search.by_then) is not None and best.held - stand.held >= WORTH:
                best = search.without_spent_lags(best)
                deadline(f"added, as the best by then: {_added_words(stand, best)}")
                stand, tried, now = best, None, replace(now, added=best.added, rounds=rounds + 1)
            break
        deadline(f"added: {_added_words(stand, better)}")
        settled = partial(_settled, search, better, better.trained - stand.trained)
        stand, tried = deadline.in_time(SEARCH, settled) or better, None
        stand = deadline.in_time(SEARCH, partial(search.coarsened, stand)) or stand
        now = replace(now, added=stand.added, rounds=rounds + 1)
        yield partial(_as_it_stands, stand, now, text, graph, prior)
    now = replace(now, out_of_time=rounds < ROUNDS and not deadline.has(SEARCH))
    if tried is not None:
        return tried, now
    return (yield from _attempt(stand, now, text, graph, read, wishes, search.believed, deadline))


def _settled(search: Search, stand: Footing, gained: float) -> Footing:
    """Give where what was added, so many nats, leads once what is of no use is gone, and a climb has come to rest."""
    return of_an_input(search, search.at_rest(search.lasting(stand), gained))


def _added_words(stand: Footing, better: Footing) -> str:
    """Say what was added, and by what that was judged, with its gain."""
    new = ", ".join(item.what.words for item in better.added[len(stand.added) :])
    if (gain := better.held - stand.held) > 0.0:
        return f"{new}; what was held back gains {gain:.0f} nats"
    return f"{new}; what is fitted gains {better.trained - stand.trained:.0f} nats"


def _as_it_stands(stand: Footing, now: Quieted, text: str, graph: BondGraph, prior: Prior) -> Quieted:
    """Give what is found with a model as the search has it, neither fitted to all recordings nor put on trial."""
    with_added = amended_text(text, graph, stand.added)
    fitted = _fitted(parse_model(with_added, file=graph.file), graph, stand.fit(prior), now)
    written = fitted.model_text(with_added)
    return replace(now, fitted=fitted, text=written, raised=(), lowered=(), health=None, alarms={})


def _known(now: Quieted) -> ByThen:
    return lambda: now


def _fitted(graph: BondGraph, stated: BondGraph, found: Fit, now: Quieted) -> Fitted:
    """Give what a fit means for a plant with what was added to the one that was stated."""
    fitted, added = fitted_model(graph, found, now.fitted.version), _further(graph, stated)
    strays = tuple(item for item in fitted.strays if item.parameter.name not in added)  # nobody declared these
    return replace(fitted, added=added, strays=strays, doubt=now.fitted.doubt)


def _further(graph: BondGraph, stated: BondGraph) -> frozenset[str]:
    """Give the parameters that were added to a plant."""
    return frozenset(item.name for item in graph.parameters) - {item.name for item in stated.parameters}


def _next(search: Search, stand: Footing, asked: dict[str, float]) -> Footing | None:
    """Give where the next thing leads: what rows hold, why parameters stray, a law's offset, else what foretells best.

    What was asked for with parameters kept from straying would mostly be found again with them let go.
    """
    if (rows := held_until(search, stand)) is not None:
        return rows
    cure = _cured(search, stand, asked)
    return (
        cure.kept
        or centred(search, stand)
        or cure.let_go
        or better(search, stand)
        or _cured_again(search, stand, asked)
    )


def _cured_again(search: Search, stand: Footing, asked: dict[str, float]) -> Footing | None:
    """Give where what explains why parameters stray leads that were asked before something was added."""
    return _cured(search, stand, asked, again=True).kept


def _cured(search: Search, stand: Footing, asked: dict[str, float], *, again: bool = False) -> Cure:
    """Give where what explains why parameters stray leads, asked once, or `again` if something was added since.

    What is missing elsewhere hides it, so it is asked again at the end.

    asked : what each parameter was asked beside, things that were added; filled in
    """
    number = len(stand.added)
    names = [name for name in strayed(search, stand) if asked.get(name, -1) < (number if again else 0)]
    asked |= dict.fromkeys(names, number)
    return cured(search, stand) if names else Cure()


def _seems_quiet(stand: Footing, read: Recordings, tell: Tell) -> bool:
    """Tell whether the recordings would be quiet with everything as it stands, which costs less than to try."""
    tell("asking whether that is quiet")
    core = build_trial(as_found(stand))
    records = [healthy_recording(name, points, core) for name, points in reversed(read)]  # first what was held back
    return stays_below(core, records, ROOM)


def _attempt(
    stand: Footing,
    now: Quieted,
    text: str,
    graph: BondGraph,
    read: Recordings,
    wishes: FitWishes,
    believed: frozenset[str],
    deadline: Deadline,
) -> Generator[ByThen, None, tuple[Attempt, Quieted]]:
    """Write what was found into the model, fit that to all recordings, and put it on trial.

    believed : parameters whose declared accuracies count, since it was found what made them stray
    """
    what = "fitting all recordings"
    deadline(what)
    with_added = amended_text(text, graph, stand.added)
    first = parse_model(with_added, file=graph.file)
    core, model = build_trial(first), build_model(first)
    free = None if wishes.free is None else (*wishes.free, *sorted(_further(first, graph)))
    parameters = free_parameters(first, wishes.fixed, free, wishes.own)
    found_core = build_trial(with_values(first, stand.values))  # by which first samples show what nobody measures
    plant, records, begin = build_fit(model, likelihood_engine(model), found_core, read, parameters, wishes.own)
    begin = replace(begin, values=values_of(plant, first, stand))
    own = (item.name for _, item in parameters if item.name in wishes.own)
    columns = (*(model.states[k] for k in plant.free), *own)
    begin = likelier_begin(plant, records, begin, begun_as_found(begin_at(plant, records, core), columns, stand))
    begin = begun_likeliest(plant, records, begin)
    found = fit_plant(
        plant,
        records,
        begin,
        prior=Prior(wishes.prior),
        believed=believed,
        starts=1,
        finish=Finish(SETTLED, in_time=partial(deadline.has, FITTED)),
        shaken=False,  # the search has climbed there
        seed=wishes.seed,
        tell=lambda step: deadline(f"{what}: {step}"),
    )
    fitted = _fitted(first, graph, found, now)
    now = replace(
        now,
        fitted=fitted,
        text=fitted.model_text(with_added),
        added=as_fitted(now.added, fitted.values),
        raised=(),
        lowered=(),
        health=None,
        alarms={},
    )
    yield _known(now)
    deadline("asking how far parameters seem to move while healthy")
    fitted = replace(fitted, healthy_changes=healthy_changes(core, found.records, fitted.believed))
    attempt = put_on_trial(fitted.model_text(with_added), fitted, read, deadline)
    attempt = known_where_it_walks(apart_if_quieter(attempt, with_added, deadline), with_added, deadline)
    now = _tried(now, attempt)
    yield _known(now)
    return attempt, now
