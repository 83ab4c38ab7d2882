"""One suspect in words: a parameter, or what is wrong with a sensor or an input; its unit, and how it changed."""

import math
from dataclasses import dataclass

from faultbond.contract.findings import Candidate, Forecast, Suspect
from faultbond.model.graph import BondGraph, Parameter, Unit
from faultbond.report.numbers import (
    Notation,
    change_text,
    clock_text,
    coarse_clock_text,
    duration_text,
    figure,
    pace,
    unit_text,
    with_unit,
)
from faultbond.types import FaultKind

UNDETERMINED = "not determined by the data"
UNDETERMINED_SHARE = 0.9  # of the sd that a faulty value has before the data are seen
SIGNIFICANT = 2.0  # standard deviations
WILD = 0.1  # of its value, or of the nominal, by which a drift may move in a sample
OTHERWISE = 0.05  # a kind with at least this share is told beside the likeliest one
PACE_WORDS = {"s": "second", "min": "minute", "h": "hour", "d": "day"}
KIND_WORDS = {
    FaultKind.STEP: "a step",
    FaultKind.DRIFT: "a drift",
    FaultKind.INTERMITTENT: "a fault that comes and goes",
    FaultKind.BIAS: "a bias",
    FaultKind.GAIN: "a wrong gain",
    FaultKind.STUCK: "one that is stuck",
    FaultKind.NOISE: "a sensor that scatters",
    FaultKind.RAMP: "a ramp that has ended",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class SuspectRow:
    """One suspect of a table row, or the rate of one; all text."""

    component: str  # empty: the line belongs to the one above
    parameter: str
    nominal: str = ""  # empty where there is none
    estimate: str  # value ± sd, or that the data do not determine it
    unit: str
    change: str = ""  # of nominal; empty where that says nothing


def instrument_of(name: str) -> tuple[str, str]:
    """Split `flow.bias` into the instrument and what is wrong with it; both empty for a parameter."""
    signal, dot, word = name.partition(".")
    return (signal, word) if dot else ("", "")


def unit_of(graph: BondGraph, name: str) -> Unit:
    """Give the model file's unit of a suspect; of `flow.bias` the unit of the sensor or input `flow`, of differences.

    A sensor that is stuck is so at a value, to which an offset of the unit belongs.
    """
    signal, word = instrument_of(name)
    if not signal:
        return {item.name: item.unit for item in graph.parameters}.get(name, Unit(""))
    units = {item.name: item.unit for item in graph.inputs} | {item.name: item.unit for item in graph.sensors}
    if signal not in units or word == FaultKind.GAIN.value:
        return Unit("")
    return units[signal] if word == FaultKind.STUCK.value else Unit(units[signal].text, units[signal].factor)


def shown_in(graph: BondGraph, name: str, notation: Notation) -> str:
    """Say in which unit a gain multiplies, where its 0 is not that of SI: of `T.gain` ` in degC`; else empty."""
    signal, word = instrument_of(name)
    units = {item.name: item.unit for item in graph.inputs} | {item.name: item.unit for item in graph.sensors}
    if word != FaultKind.GAIN.value or signal not in units or not units[signal].offset:
        return ""
    return f" in {unit_text(units[signal].text, notation)}"


def instrument_title(graph: BondGraph, name: str) -> str:
    """Name a sensor or an input as such: `flow sensor`, `input u_in`."""
    return f"input {name}" if any(item.name == name for item in graph.inputs) else f"{name} sensor"


def owner_of(graph: BondGraph, suspect: Suspect) -> str:
    """Name what a suspect belongs to: `pipe`, `flow sensor`, `input u_in`."""
    signal, _ = instrument_of(suspect.parameter)
    known = {item.name: item for item in graph.parameters}.get(suspect.parameter)
    if known is not None:
        return owner_title(graph, known)
    return instrument_title(graph, signal) if signal else suspect.component


def owner_title(graph: BondGraph, item: Parameter) -> str:
    """Name what a parameter belongs to: `pipe`, or of a lag `flow sensor`, `input u_in`."""
    return instrument_title(graph, item.owner) if item.name in graph.lags else item.owner


def with_article(owner: str) -> str:
    """Put an article before what reads as words: `the pipe`, `the flow sensor`, but `R` and `tank1`."""
    return f"the {owner}" if " " in owner or (len(owner) > 2 and owner.isalpha() and owner.islower()) else owner


def title_of(graph: BondGraph, suspect: Suspect) -> str:
    """Name a suspect in full: `K1 of pipe`, `bias of flow sensor`."""
    signal, word = instrument_of(suspect.parameter)
    if word == FaultKind.STUCK.value:
        return f"value at which {with_article(owner_of(graph, suspect))} is stuck"
    return f"{word if signal else suspect.parameter} of {owner_of(graph, suspect)}"


def is_undetermined(graph: BondGraph, suspect: Suspect) -> bool:
    """Tell whether the data left the suspect as uncertain as a faulty value is beforehand."""
    if not (math.isfinite(suspect.sd) and math.isfinite(suspect.estimate)):
        return True
    known = {item.name: item for item in graph.parameters}
    parameter = known.get(suspect.parameter)
    return parameter is not None and suspect.sd >= UNDETERMINED_SHARE * parameter.change


def change_of(graph: BondGraph, candidate: Candidate, suspect: Suspect, now: float, notation: Notation) -> str:
    """Say what happened to a suspect of a candidate, as half a sentence.

    Parameters
    ----------
    graph : the plant, for units
    candidate : tells the kind of fault, and whether it is there now
    suspect : one of its suspects
    now : time of the diagnosis, s
    notation : how numbers and units are spelled
    """
    name, unit = suspect.parameter, unit_of(graph, suspect.parameter)
    signal, word = instrument_of(name)
    if suspect.stopped is not None:
        told = f"its record has stood still since {clock_text(suspect.stopped)}, so its meter has stuck"
        return f"{told}, and what acts is not known" if len(candidate.suspects) == 1 else _named(told, signal)
    if is_undetermined(graph, suspect):
        its = f"the {word} of {signal}" if len(candidate.suspects) > 1 else f"its {word}"
        return f"{its if signal else name} is {UNDETERMINED}"
    comes_and_goes = candidate.kind is FaultKind.INTERMITTENT
    passing = f" while the fault is there; it is {'there' if candidate.present else 'gone'} now"
    if signal:
        told = _misreading(graph, suspect, notation) + (passing if comes_and_goes else "")
        return told if len(candidate.suspects) == 1 else _named(told, signal)
    nominal, rate = suspect.nominal or 0.0, suspect.rate or 0.0
    healthy = figure(unit.from_si(nominal)).number(notation)
    estimate = with_unit(unit.from_si(suspect.estimate), unit.text, notation, sd=unit.difference_from_si(suspect.sd))
    change = change_text(nominal, suspect.estimate, suspect.sd)
    bracket = f" ({change})" if change else ""
    unclear = f"{name} may still be {with_unit(unit.from_si(nominal), unit.text, notation)}"
    if candidate.kind is FaultKind.DRIFT and suspect.rate is not None:
        is_moving = abs(rate) >= SIGNIFICANT * (suspect.rate_sd or 0.0)
        if not is_moving and not _is_off(suspect):
            return f"{unclear}, or move at a rate that is not known yet"
        text = f"{name} is {estimate} now{bracket}"
        step = abs(rate) * (graph.sample_time or 0.0)
        if is_moving and step > WILD * max(abs(nominal), abs(suspect.estimate)) > 0.0:  # at an end of its range
            return f"{text}, and moves too fast to be a drift"
        verb = "rises" if rate > 0.0 else "falls"
        moves = f"{verb} by {_rate(unit, suspect, notation)}" if is_moving else "moves at a rate that is not known yet"
        limits = (_limit(unit, suspect, item, now, notation, is_moving=is_moving) for item in suspect.forecasts)
        return "; ".join((f"{text} and {moves}", *filter(None, limits)))
    if comes_and_goes:
        return f"{name} is {estimate}{bracket} instead of {healthy}{passing}"
    if not _is_off(suspect):
        return unclear
    text = f"{name} {'rose' if suspect.estimate > nominal else 'fell'} from {healthy} to {estimate}{bracket}"
    return f"{text} {_course(suspect)}" if suspect.began is not None else text


def _course(suspect: Suspect) -> str:
    """Say over which time a ramp went, and that it has ended, unless its value moves yet."""
    began, ended = suspect.began or 0.0, suspect.ended or 0.0
    took = max(ended - began, 0.0)
    when = f"in about {duration_text(took, digits=2)} up to about {coarse_clock_text(ended, took)}"
    return when if suspect.moved else f"{when}, and has stayed there since"


def _named(told: str, signal: str) -> str:
    """Give what is said of an instrument with its name, where others are at fault too: `flow reads`."""
    return told.replace("it ", f"{signal} ", 1) if told.startswith("it ") else told.replace("its ", f"{signal}'s ", 1)


def _misreading(graph: BondGraph, suspect: Suspect, notation: Notation) -> str:
    """Say what is wrong with a sensor or an input."""
    unit, (_, word) = unit_of(graph, suspect.parameter), instrument_of(suspect.parameter)
    value, sd = unit.from_si(suspect.estimate), unit.difference_from_si(suspect.sd)
    if word == FaultKind.STUCK.value:
        return f"it is stuck at {with_unit(value, unit.text, notation, sd=sd)}"
    if not _is_off(suspect):
        return f"its {word} may still be {'right' if word != FaultKind.BIAS.value else '0'}"
    if word == FaultKind.GAIN.value:
        change = change_text(suspect.nominal or 0.0, suspect.estimate, suspect.sd)
        bracket = f" (gain, {change})" if change else ""
        where = shown_in(graph, suspect.parameter, notation)
        times = f"{figure(value, sd).number(notation)} times"
        acts = f"it acts {times} what is recorded" if _is_input(graph, suspect) else f"it reads {times} the right value"
        verb = "rises" if (suspect.rate or 0.0) > 0.0 else "falls"
        return _moved(suspect, f"{acts}{where}", bracket, verb, unit, notation)
    size = with_unit(abs(value), unit.text, notation, sd=sd)
    if word == FaultKind.NOISE.value:
        times = figure(suspect.estimate / (suspect.nominal or 1.0), digits=2).number(notation)
        return f"it scatters by {size}, {times} times as much as the model file says (noise)"
    high = suspect.estimate > 0.0
    if _is_input(graph, suspect):
        text = f"it acts {size} {'above' if high else 'below'} what is recorded"
    else:
        text = f"it reads {size} too {'high' if high else 'low'}"
    verb = "grows" if (suspect.rate or 0.0) * suspect.estimate > 0.0 else "shrinks"
    return _moved(suspect, text, " (bias)", verb, unit, notation)


def _moved(suspect: Suspect, text: str, bracket: str, verb: str, unit: Unit, notation: Notation) -> str:
    """Add to what an instrument does wrong how it came to that, or how it goes on."""
    if suspect.began is not None:
        return f"{text}{bracket}; it came to that {_course(suspect)}"
    if suspect.rate is None:
        return f"{text}{bracket}"
    if abs(suspect.rate) < SIGNIFICANT * (suspect.rate_sd or 0.0):
        return f"{text} now, and drifts at a rate that is not known yet"
    return f"{text} now, and this {verb} by {_rate(unit, suspect, notation)} (drift)"


def _is_input(graph: BondGraph, suspect: Suspect) -> bool:
    return any(item.name == suspect.component for item in graph.inputs)


def _is_off(suspect: Suspect) -> bool:
    return abs(suspect.estimate - (suspect.nominal or 0.0)) >= SIGNIFICANT * suspect.sd


def _rate(unit: Unit, suspect: Suspect, notation: Notation) -> str:
    """Give how fast a value moves, in a unit of time in which that is a handy number."""
    seconds, name = pace(suspect.rate or 0.0, suspect.estimate)
    rate, sd = (unit.difference_from_si(abs(value or 0.0)) * seconds for value in (suspect.rate, suspect.rate_sd))
    return f"{with_unit(rate, unit.text, notation, sd=sd)} per {PACE_WORDS[name]}"


def _limit(unit: Unit, suspect: Suspect, item: Forecast, now: float, notation: Notation, *, is_moving: bool) -> str:
    """Say when a drift reaches a limit; empty where it is not on the way there."""
    limit = f"the limit of {with_unit(unit.from_si(item.limit), unit.text, notation)}"
    nominal = item.limit if suspect.nominal is None else suspect.nominal
    if (item.limit - nominal) * (item.limit - suspect.estimate) <= 0.0:
        clear = abs(suspect.estimate - item.limit) >= SIGNIFICANT * suspect.sd
        return f"it {'has passed' if clear else 'is at about'} {limit}"
    if item.earliest is None:
        return ""
    if item.time is None or not is_moving:
        return f"it may reach {limit}, not before {coarse_clock_text(item.earliest, item.earliest - now)}"
    width = (item.latest if item.latest is not None else 2.0 * item.time - item.earliest) - item.earliest
    early, median = (coarse_clock_text(moment, width) for moment in (item.earliest, item.time))
    late = "never" if item.latest is None else coarse_clock_text(item.latest, width)
    ahead = duration_text(max(item.time - now, 0.0), digits=2)
    return f"it reaches {limit} in about {ahead}, at {median} ({early} to {late})"


def cure_of_walk(graph: BondGraph, parameter: str) -> str:
    """Say what to do about a parameter that the healthy model moves too far, though it is healthy."""
    declared = any(item.target == parameter for item in graph.wanders)
    wander = ", or its `wander` larger or longer" if declared else ", or that it wanders"
    return (
        f"Declare the accuracy of {parameter} larger{'' if parameter in graph.lags else wander}, or mend what moves it."
    )


def otherwise(candidate: Candidate) -> str:
    """Name the other kinds of fault that it may be, as a sentence; empty where the likeliest one is clear."""
    if any(suspect.stopped is not None for suspect in candidate.suspects):
        return ""
    others = [
        f"{KIND_WORDS[kind]} ({100.0 * share:.0f} %)"
        for kind, share in candidate.kinds
        if kind is not candidate.kind and share >= OTHERWISE
    ]
    return f" Of its kind less is sure: it may also be {' or '.join(others)}." if others else ""


def rows_of(graph: BondGraph, suspect: Suspect, notation: Notation, mark: str = "") -> tuple[SuspectRow, ...]:
    """Give the lines of a table about a suspect: its value, and its rate where it drifts; `mark` leads the first."""
    unit = unit_of(graph, suspect.parameter)
    label = unit_text(unit.text, notation)
    unknown = is_undetermined(graph, suspect)
    estimate = figure(unit.from_si(suspect.estimate), unit.difference_from_si(suspect.sd)).both(notation)
    nominal = suspect.nominal
    first = SuspectRow(
        component=mark + owner_of(graph, suspect),
        parameter=instrument_of(suspect.parameter)[1] or suspect.parameter,
        nominal="" if nominal is None else figure(unit.from_si(nominal)).number(notation),
        estimate=UNDETERMINED if unknown else estimate,
        unit=label,
        change="" if unknown or nominal is None else change_text(nominal, suspect.estimate, suspect.sd),
    )
    if suspect.rate is None or suspect.rate_sd is None or unknown:
        return (first,)
    seconds, name = pace(suspect.rate, suspect.estimate)
    rate, sd = (unit.difference_from_si(value) * seconds for value in (suspect.rate, suspect.rate_sd))
    shown = figure(rate, sd).both(notation)
    return first, SuspectRow(component="", parameter="rate", estimate=shown, unit=f"{label or '1'}/{name}")
