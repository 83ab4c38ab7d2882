"""What is said against a verdict, or beside it: why no candidate is claimed, how sure the best is, what else may be."""

import math
from collections.abc import Iterator, Sequence

from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import Detection, Diagnosis, History, Superseded, Unexplained
from faultbond.model.graph import BondGraph, Input
from faultbond.report.numbers import certainty_text, clock_text, figure, join, probability_text, with_noun
from faultbond.report.suspects import cure_of_walk
from faultbond.types import FaultKind, TimeGrid

NEGLIGIBLE = 0.001  # probability that is not worth a word
CONTRADICTED = "The data contradict them all: their order tells which comes nearest, and none is likely."
EVENLY = "each percentage above has an even share of that in it."
LITTLE_SEEN = 500  # samples: an alarm that comes earlier may as well tell that the model never fitted


def reason_for_none(graph: BondGraph, diagnosis: Diagnosis, began: Detection) -> str:
    """Say why no candidate is claimed of what began with this alarm; empty where one is."""
    if diagnosis.superseded is not None:
        return superseded_sentence(diagnosis.superseded)
    if diagnosis.strained:
        return _strained_sentence(diagnosis)
    if diagnosis.mismatch:  # it is never less likely than all sets together
        return _off_sentence(graph, diagnosis, began)
    if diagnosis.unexplained is not None:
        return " ".join([unexplained_sentence(diagnosis.unexplained), *_not_asked(graph)])
    if diagnosis.within_accuracy <= diagnosis.candidates[0].probability:
        return ""
    sure = certainty_text(diagnosis.within_accuracy)
    return (
        "Something was otherwise, but nothing is further off than healthy parts may be (`accuracy`, `healthy_change`, "
        f"`healthy_bias`), {sure}: no fault is claimed."
    )


def _off_sentence(graph: BondGraph, diagnosis: Diagnosis, began: Detection) -> str:
    """Say that most likely the model is off, why, and what to do about it."""
    most, walk = f"Most likely the model is off ({probability_text(diagnosis.mismatch)} %)", began.walk
    tested = {name for item in diagnosis.candidates for name in item.parameters}
    if diagnosis.elsewhere:
        names, alone = join(diagnosis.elsewhere), len(diagnosis.elsewhere) == 1
        off = "is far from where it is declared" if alone else "are far from where they are declared"
        if all(graph.parameter(name).suspect for name in diagnosis.elsewhere):  # what no run with the model shows
            told = f"Most likely nothing that was tested changed ({probability_text(diagnosis.mismatch)} %)"
            return f"{told}: {names}, which {'was' if alone else 'were'} not, {off}."
        told = f"{most}: no suspect changed, but {names}, which {'counts' if alone else 'count'} as healthy, {off}."
        return f"{told} Of what may fail say `suspect: yes`; else mend what moves {'it' if alone else 'them'}."
    if walk is not None and walk.parameter not in tested and has_walked(graph, diagnosis):
        told = f"{most}: {walk.parameter}, which counts as healthy, had to move too far."
        return f"{told} {cure_of_walk(graph, walk.parameter)}"
    if walk is not None and has_walked(graph, diagnosis):
        return (
            f"{walk.parameter} had to move too far while an input was where no recording of the fit had it. A law "
            f"that is off there does that as well as a fault ({probability_text(diagnosis.mismatch)} %): no fault is "
            "claimed."
        )
    return (
        f"{most}: {known_alarms(graph)}. `faultbond fit` with `--until-quiet` and healthy recordings finds what it "
        "leaves out."
    )


def has_walked(graph: BondGraph, diagnosis: Diagnosis) -> bool:
    """Whether a model is held to be off since what counts as healthy had to move, not for its false alarms."""
    return diagnosis.mismatch > graph.false_alarms / (graph.false_alarms + 1.0) + 1e-9


def known_alarms(graph: BondGraph) -> str:
    """Say that a model is known to alarm on healthy data, and by which key of it that is known."""
    return f"it is known to alarm on healthy data (`false_alarms: {graph.false_alarms}`)"


def superseded_sentence(before: Superseded) -> str:
    """Say that something else was sure before, what that may mean, and how faults are found that come one by one."""
    what, until = join(before.components), clock_text(before.until)
    was, does = ("were", "do") if len(before.components) > 1 else ("was", "does")
    return (
        f"Up to {until} {what} {was} sure to be at fault, and {does} not explain what came then. Either something else "
        "changed besides, or that was wrong: no fault is claimed. Faults that come one after the other are told one by "
        "one where the first is accepted, as `--accept auto` does."
    )


def _strained_sentence(diagnosis: Diagnosis) -> str:
    """Say that the likeliest hypothesis takes along what it leaves healthy, and what that may mean."""
    names, alone = join(diagnosis.strained), len(diagnosis.strained) == 1
    was, counts, that = ("it was", "counts", "it") if alone else ("they were", "count", "they")
    return (
        f"What comes nearest explains the data only with {names} far from where {was}, which {counts} as healthy then. "
        f"Either {that} changed besides, at another time, or the model is off there "
        f"({probability_text(diagnosis.mismatch)} %): no fault is claimed."
    )


def unexplained_sentence(found: Unexplained) -> str:
    """Say that no candidate fits, and where the best one is off."""
    size, since, until = figure(found.sd, digits=2).number(), clock_text(found.since), clock_text(found.until)
    deviations = "standard deviation" if size == "1" else "standard deviations"
    when = f"at {since}" if since == until else f"between {since} and {until}, on average"
    return (
        f"None of the modelled faults explains this: the best fit is still {size} {deviations} off in "
        f"{found.signal} {when}."
    )


def _not_asked(graph: BondGraph) -> Iterator[str]:
    """Say what was not tested and may explain the data: more faults at once, an actuator or a meter that is slow."""
    if _could_be_more(graph):
        many = "one fault at once was" if graph.max_faults == 1 else f"{graph.max_faults} faults at once were"
        pairs = (
            ", nor two of which both move or stick, or one scatters or comes and goes" if graph.max_faults > 1 else ""
        )
        yield f"More than {many} not tested (`max_faults: {graph.max_faults}`){pairs}."
    slow = [item for item in graph.inputs if item.suspect and _may_be_slow(graph, item)]
    if slow:
        yield f"{_inputs_not_asked(slow)}."
    late = [item.name for item in graph.sensors if item.suspect and item.lag and not graph.parameter(item.lag).suspect]
    if late:
        yield f"{_not_asked_of(late, 'read', ['lag'])}."


def _inputs_not_asked(slow: Sequence[Input]) -> str:
    """Say that it was not asked whether inputs have become slower, and how it is."""
    keys = dict.fromkeys("rate_limit" if item.rate_limit else "lag" for item in slow)
    return _not_asked_of([item.name for item in slow], "act", list(keys))


def _not_asked_of(names: list[str], does: str, keys: list[str]) -> str:
    """Say it of instruments that do something, and which keys of the model ask it."""
    has, by = "has" if len(names) == 1 else "have", join([f"`{key}`" for key in keys])
    return f"It was not tested whether {join(names)} {has} become slower to {does} ({by} with `suspect: yes`)"


def _slow_sentence(graph: BondGraph, diagnosis: Diagnosis) -> str:
    """Say that an input that is off at times may be a slow one: it is off after each of its moves, and right again."""
    best = diagnosis.candidates[0]
    at_fault = {item.component for item in best.suspects} if best.kind is FaultKind.INTERMITTENT else set()
    slow = [item for item in graph.inputs if item.name in at_fault and _may_be_slow(graph, item)]
    if not slow or diagnosis.mismatch or diagnosis.unexplained is not None:
        return ""
    return f"{_inputs_not_asked(slow)}, which is off after each move and right again."


def _may_be_slow(graph: BondGraph, item: Input) -> bool:
    """Whether an input takes a while to act, and that it takes longer is no hypothesis."""
    timing = item.rate_limit or item.lag
    return not graph.parameter(timing).suspect if timing else item.settling > 0.0


def certainty(graph: BondGraph, diagnosis: Diagnosis) -> str:
    """Say how sure the best candidate is, sets that were not tested included; empty where nothing is a chance.

    Where it has as many suspects as the model lets be at fault, it is sure of that alone: of one more it was not asked.
    """
    best, left = diagnosis.candidates[0], diagnosis.untested
    if not best.kinds:  # the method `classic` knows an order only
        return ""
    is_largest = len(best.suspects) >= graph.max_faults and _could_be_more(graph)
    things = "only one thing is" if graph.max_faults == 1 else f"no more than {graph.max_faults} things are"
    sure, alone = certainty_text(best.probability), f" if {things} at fault" if is_largest else ""
    if left is None or not left.sets:
        return f", {sure}{alone}"
    if left.probability >= 1.0:
        return f", {sure} among the sets tested{alone}"
    least = certainty_text(best.probability * (1.0 - left.probability))
    return f", {sure}{alone}" if least == sure else f", at least {least}{alone}"


def _could_be_more(graph: BondGraph) -> bool:
    """Whether there are sets of more suspects than the model lets be at fault at a time: none of them was tested."""
    stated = [
        *(x.suspect for x in graph.parameters),
        *(x.suspect for x in graph.sensors),
        *(x.suspect for x in graph.inputs),
    ]
    return sum(stated) > graph.max_faults


def course_sentences(graph: BondGraph, history: History, diagnosis: Diagnosis | None) -> tuple[str, ...]:
    """Say what the way to a diagnosis, made last in a run, means for it; nothing without one."""
    began = history.open
    if diagnosis is None or began is None:
        return ()
    is_of_now = began in history.detections  # not of a run before this one
    early = _early_sentence(graph, diagnosis, began) if is_of_now else ""
    gone, slow = _gone_sentence(diagnosis, began), _slow_sentence(graph, diagnosis)
    missed = _missed_sentence(history.missed, diagnosis)
    told = early, gone, missed, slow, _model_sentence(graph, diagnosis, began)
    return tuple(filter(None, told))


def _early_sentence(graph: BondGraph, diagnosis: Diagnosis, began: Detection) -> str:
    """Say that the alarm was a short while ago, so that the verdict may change; empty where it was not.

    Nothing is said by a method that knows no probabilities, nor where samples are not evenly spaced.
    """
    if not diagnosis.candidates[0].kinds or not graph.sample_time:
        return ""
    since, last = round((diagnosis.time - began.time) / graph.sample_time), int(core_settings()["LAST_RENEWAL"])
    if since >= last:
        return ""
    return f"This is early, {with_noun(since, 'sample')} after the alarm: up to {last} it may still change."


def _gone_sentence(diagnosis: Diagnosis, began: Detection) -> str:
    """Say that a fault that is gone did not raise the alarm, but what was off all along; or may not be gone.

    From what was off all along the healthy model has learned: errors that it knows may stand for a part of it.
    """
    walk = began.walk
    if walk is None or not walk.from_start or diagnosis.mismatch or diagnosis.unexplained is not None:
        return ""
    best = diagnosis.candidates[0]
    if best.present:
        return ""
    if walk.parameter in best.parameters:
        return (
            f"Yet the alarm came since {walk.parameter} had to be moved from the start on: the model may have taken a "
            "part of the fault for healthy, so whether it is gone is not certain."
        )
    return (
        f"The alarm came since {walk.parameter} had to be moved too far from the start on; a fault that is gone does "
        "not explain that. The model may be off as well: `faultbond check` with `--data` and a healthy recording says "
        "where."
    )


def _missed_sentence(found: Unexplained | None, diagnosis: Diagnosis) -> str:
    """Say when the best candidate, that had explained the data before, did not for a while; empty where it always did.

    Something else may have changed then, and what a model may be off by has made up for it since.
    """
    if found is None or diagnosis.unexplained is not None or diagnosis.superseded is not None or diagnosis.mismatch:
        return ""
    size, since, until = figure(found.sd, digits=2).number(), clock_text(found.since), clock_text(found.until)
    return (
        f"Between {since} and {until} {found.signal} was off all the same, by up to {size} standard deviations: "
        f"something else may have changed then. To see what, run with `--state` up to {since}, accept this fault "
        "(`faultbond accept`), and go on from there."
    )


def _model_sentence(graph: BondGraph, diagnosis: Diagnosis, began: Detection) -> str:
    """Say what to do about a model that was never fitted, if the plant is healthy after all; empty else.

    It is said where something speaks for that: nothing explains the data, or the alarm came before the model had been
    seen to fit for long.
    """
    was_fitted = any(item.fitted_range is not None for item in graph.instruments)
    is_soon = began.sample < LITTLE_SEEN
    speaks = is_soon or diagnosis.unexplained is not None
    other_words = diagnosis.mismatch > 0.0 and not diagnosis.strained  # for a parameter that walks
    if was_fitted or other_words or not speaks or graph.grid is TimeGrid.NONE:
        return ""
    seen = f"The alarm came after {with_noun(began.sample, 'sample')}. " if is_soon else ""
    return (
        f"{seen}If nothing is wrong with the plant, the model leaves something out: `faultbond fit` with "
        "`--until-quiet` and healthy recordings finds what."
    )


def beside(diagnosis: Diagnosis) -> str:
    """Say what may be true beside the candidates."""
    told = (mismatch_sentence(diagnosis), within_sentence(diagnosis), untested_sentence(diagnosis))
    return " ".join(filter(None, told))


def mismatch_sentence(diagnosis: Diagnosis) -> str:
    """Say how likely it is that the model is off, beside the percentages of sets; empty where nothing tells of that.

    And how likely the first is if the model is right, which those percentages hide. Where nothing explains the data no
    percentages are shown.
    """
    off = diagnosis.mismatch
    if not off or diagnosis.unexplained is not None:
        return ""
    later = diagnosis.superseded is not None
    more = "more changed, later, or " if later else "more changed, or " if diagnosis.strained else ""
    told = f"With {probability_text(off)} % {more}the model is off: {EVENLY}"
    if off < 1.0 and len(diagnosis.candidates) > 1:
        right = (diagnosis.candidates[0].probability - even_share(diagnosis)) / (1.0 - off)
        told = f"{told} If it is right after all, the first is at {probability_text(right)} %."
    return told


def even_share(diagnosis: Diagnosis) -> float:
    """Give what each tested set has in its probability of what tells none from another; no more than the least has."""
    tested = [item.probability for item in diagnosis.candidates if item.probability > 0.0]
    return min([*tested, (diagnosis.mismatch + diagnosis.within_accuracy) / max(len(tested), 1)])


def within_sentence(diagnosis: Diagnosis) -> str:
    """Say how likely it is that nothing is at fault but what the declared accuracy allows; empty where it hardly is."""
    if diagnosis.within_accuracy < NEGLIGIBLE or diagnosis.unexplained is not None:
        return ""
    percent = probability_text(diagnosis.within_accuracy)
    return f"With {percent} % nothing that is tested changed by more than it may while healthy: {EVENLY}"


def untested_sentence(diagnosis: Diagnosis) -> str:
    """Say how many sets were not tested, and what that may hide; empty where all were tested."""
    left = diagnosis.untested
    if left is None or not left.sets:
        return ""
    many = f"Another {left.sets} sets were not tested"
    if left.probability >= 1.0:
        return f"{many}; how likely it is that the truth is among them cannot be told."
    return f"{many}; the truth is among them with at most {math.ceil(1000.0 * left.probability - 1e-9) / 10.0:.1f} %."
