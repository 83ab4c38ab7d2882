"""A model that was made quiet: what was added and raised, what it cost, what was not mended; text, record, file."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from rich.console import Console
from rich.text import Text

from faultbond.analysis.smallest import SmallestFault
from faultbond.contract.json_records import Record
from faultbond.fit.bend import Bend
from faultbond.fit.foothold import Added
from faultbond.fit.imperfections import (
    CURVES,
    KIND_HOLDS,
    TERMS,
    Imperfection,
    Kind,
    lag_of,
    parameter_name,
    with_imperfections,
)
from faultbond.fit.trial import Health
from faultbond.model.amend import Path, amended
from faultbond.model.dump import law_text, scalar_text
from faultbond.model.expression import Binary, Name, Number, powers, without_factor
from faultbond.model.graph import BondGraph, SlowError, Unit
from faultbond.model.parser import to_text
from faultbond.model.rewrite import MARK, parameter_path
from faultbond.report.analysis import begun_lines, heat_lines
from faultbond.report.console import lines, table, title, under
from faultbond.report.doubts import stray_records
from faultbond.report.fit_result import Fitted
from faultbond.report.health import spacing_text, where_lines
from faultbond.report.numbers import (
    MINUS,
    clock_text,
    duration_text,
    figure,
    join,
    rounded_up,
    share_text,
    short,
    unit_text,
)
from faultbond.report.resized import Resized
from faultbond.report.suspects import unit_of

MOST_LEFT = 3  # places that are named as worth a look
TOLD = 3.0  # nats; what gains less is no place to look at
DEAF = 0.5  # of a value; a part that has to change by more is hardly watched
OUT_OF_TIME = "up before the search had come to its end: `fit` this model again, or give it longer by `--within`"
DEAFER = 2.0  # times what had to change before, where that was as much


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quieted:
    """What came of a fit until quiet.

    text : of the model file; held : recordings, or parts, that were held back; stated : whether the model as given
    promises a time between false alarms, and promise : that time, else the one that was written; before, health : the
    model as given and as it is now, on trial, None where the search was stopped before; alarms : when the monitor
    itself alarms still, by recording; asked : whether that is known of what was not on trial; lasting : slow errors of
    sensors without which more would have been raised; left : what the last round would have added, with what it would
    gain on the recordings that are fitted; out_of_time : whether the search was to go on, and had no more time; stopped
    : the signal that ended it; failed : the error that did
    """

    fitted: Fitted
    text: str
    held: tuple[str, ...]
    stated: bool
    promise: float
    added: tuple[Added, ...] = ()
    lasting: tuple[Imperfection, ...] = ()
    raised: tuple[Resized, ...] = ()
    lowered: tuple[Resized, ...] = ()
    before: Health | None = None
    health: Health | None = None
    alarms: dict[str, float] = field(default_factory=dict)
    asked: bool = False
    rounds: int = 0
    left: tuple[tuple[Imperfection, float], ...] = ()
    smallest_before: tuple[SmallestFault, ...] = ()
    smallest_after: tuple[SmallestFault, ...] = ()
    out_of_time: bool = False
    stopped: int | None = None
    failed: Exception | None = None

    @property
    def unfinished(self) -> bool:
        """Whether the search ended before it was done."""
        return self.stopped is not None or self.failed is not None

    @property
    def quiet(self) -> bool:
        """Whether the recordings are as quiet as promised; not where nobody has asked."""
        return self.health is not None and self.health.keeps and not self.alarms

    @property
    def half(self) -> dict[str, float]:
        """Half of each parameter, and of what is nominally 0 of its `change`, SI."""
        changes = {item.name: item.change for item in self.fitted.graph.parameters}
        return {name: DEAF * (abs(value) or changes[name]) for name, value in self.fitted.values.items()}

    @property
    def deaf(self) -> tuple[str, ...]:
        """Parameters of which no change by less than half is found or claimed, and clearly smaller ones were before."""
        most, half = {}, self.half
        for item in self.smallest_before:
            if item.value is not None and item.parameter in half:
                is_watched = item.value <= half[item.parameter]
                most[item.parameter] = half[item.parameter] if is_watched else DEAFER * item.value
        return tuple(
            name for name, value in self.smallest_claimed.items() if name in most and not _is_below(value, most[name])
        )

    @property
    def little_use(self) -> bool:
        """Whether it is deaf to half of the parameters that were asked, or to more."""
        asked = {item.parameter for item in self.smallest_after} & self.half.keys()
        return 2 * len(self.deaf) >= len(asked) > 0

    @property
    def smallest_claimed(self) -> dict[str, float | None]:
        """The smallest fault of each suspect that is found now, and claimed: more than it may do while healthy."""
        return {item.parameter: item.told for item in self.smallest_after}


def _is_below(value: float | None, most: float) -> bool:
    return value is not None and value <= most


def amended_text(text: str, graph: BondGraph, added: Sequence[Added]) -> str:
    """Give a model text with imperfections."""
    whole = with_imperfections(graph, tuple(item.what for item in added))
    terms = [item.what for item in added if item.what.kind in TERMS]
    beside = (lag_of(item.what) for item in added if item.what.kind is Kind.RATE_LIMIT)
    lags = (item for item in beside if not graph.input(item.place).lag)  # unless one was found by itself
    others = (item.what for item in added if item.what.kind not in TERMS)
    entries = dict(_entry(graph, whole, item) for item in (*lags, *others))
    powers = [(parameter_path(whole, parameter_name(item)), _term(whole, item)) for item in terms]
    return amended(text, [*entries.items(), *_changed_laws(graph, whole), *powers], graph.file)


def _changed_laws(graph: BondGraph, whole: BondGraph) -> Iterator[tuple[Path, str]]:
    """Give where laws and sensors that have become others stand in a model file, and what stands there."""
    section = "blocks" if graph.is_block_network else "components"
    for one, other in zip(graph.components, whole.components, strict=True):
        if one.laws != other.laws:
            yield (section, one.name, "law"), law_text(other)
    for known, new in zip(graph.sensors, whole.sensors, strict=True):
        if known.reads != new.reads:
            yield ("sensors", known.name, "reads"), scalar_text(to_text(new.reads))


def _term(whole: BondGraph, item: Imperfection) -> str:
    """Give what stands in a model file for the parameter of a term.

    whole : the plant with all that was added
    """
    size, unit = _sized(whole, item)
    words = [f"{text} {'' if unit == '1' else unit}".rstrip() for text in (f"{size:.4g}", rounded_up(abs(size)))]
    return f"{{nominal: {words[0]}, accuracy: {words[1]}, range: any, suspect: no}}"


def _entry(graph: BondGraph, whole: BondGraph, item: Imperfection) -> tuple[Path, str]:
    """Give where an imperfection stands in a model file, and what stands there.

    whole : the plant with all that was added
    """
    section = "sensors" if item.is_sensor else "inputs"
    if item.kind is Kind.LAG:
        stages = f"order: {item.order}, " if item.order > 1 else ""
        return (section, item.place, "lag"), f"{{value: {item.size:.3g} s, {stages}accuracy: 10 %}}"
    if item.kind is Kind.ORDER:
        return (section, item.place, "lag", "order"), f"{item.size:g}"
    if item.kind is Kind.RATE_LIMIT:
        size, unit = _sized(graph, item)
        return (section, item.place, "rate_limit"), f"{{value: {size:.3g} {unit}, accuracy: 10 %}}"
    if item.kind in KIND_HOLDS:
        return (section, item.place, "hold"), KIND_HOLDS[item.kind].value
    words = _size_words(graph, item)
    if item.kind is Kind.INPUT_NOISE:  # of a row, where it was found of a mean of some
        size, unit = _sized(graph, item)
        of_row = f"{rounded_up(size * math.sqrt(graph.rows_per_sample))} {unit}".rstrip()
        return (section, item.place, "noise"), of_row
    if item.kind is Kind.WANDER:
        return (*parameter_path(graph, item.place), "wander"), f"{words} over {_memory_words(item.memory)}"
    error = next(
        known for known in whole.slow_errors if (known.target, known.relative) == (item.place, item.is_relative)
    )
    return ("slow_error", item.place), _error_words(graph, error, replace(item, after=""))


def _error_words(graph: BondGraph, error: SlowError, item: Imperfection) -> str:
    """Give what stands in a model file for a slow error, perhaps one that is larger after inputs have moved."""
    kind = Kind.RELATIVE if error.relative else Kind.ABSOLUTE
    words = f"{_size_words(graph, replace(item, kind=kind, size=error.sd))} over {_memory_words(error.memory)}"
    if not error.after:
        return words
    moves = [replace(item, kind=Kind.TRANSIENT, after=name, size=x) for name, x in error.by_input.items()]
    sizes = [_size_words(graph, move) for move in moves]
    return f"{{size: {words}, after: [{', '.join(error.after)}], each: [{', '.join(sizes)}]}}"


def _memory_words(memory: float) -> str:
    return f"{float(f'{memory:.2g}'):g} s"


def _size_words(graph: BondGraph, item: Imperfection) -> str:
    """Give a size as it stands in a model file, a little larger rather than smaller."""
    size, unit = _sized(graph, item)
    return f"{rounded_up(size)} {'' if unit == '1' else unit}".rstrip()


def _sized(graph: BondGraph, item: Imperfection) -> tuple[float, str]:
    """Give a size in the unit of what it is of, and the unit; SI of a signal of which no unit is declared."""
    if item.kind is Kind.TRANSIENT:
        return _growth(graph, item)
    if item.kind in CURVES:
        return item.size, "1"
    if item.kind in (Kind.RELATIVE, Kind.WANDER):
        return 100.0 * item.size, "%"
    if item.kind is Kind.LAG:
        return item.size, "s"
    if item.kind is Kind.ORDER:
        return item.size, ""
    if item.kind is Kind.RATE_LIMIT:
        rate = graph.input(item.place).unit.rate
        return item.size / rate.factor, rate.text
    known = {one.name: one.unit for one in graph.sensors} | {one.name: one.unit for one in graph.inputs}
    declared = {one.target: one.unit for one in graph.slow_errors if not one.relative}
    unit = known.get(item.place) or declared.get(item.place) or Unit("")
    if not unit.text:
        unit = Unit(dict(graph.signal_units).get(item.place, ""))
    own = unit.of_differences
    return item.size / own.factor, own.text


def _growth(graph: BondGraph, item: Imperfection) -> tuple[float, str]:
    """Give the size of a transient error: in the unit of the sensor for each of the input, and that unit."""
    size, own = _sized(graph, replace(item, kind=Kind.ABSOLUTE))
    moved = graph.input(item.after).unit.of_differences
    return size * moved.factor, f"{own or 1}/{_in_brackets(moved.text)}" if moved.text else own


def _in_brackets(unit: str) -> str:
    return f"({unit})" if re.search(r"[*/ ]", unit) else unit


def quiet_record(found: Quieted) -> Record:
    """Give the record of a fit until quiet; SI."""
    before, health = found.before, found.health
    return {
        "record": "quiet",
        "quiet": found.quiet,
        "held_back": list(found.held),
        "rounds": found.rounds,
        "out_of_time": found.out_of_time,
        "stopped": found.unfinished,
        "added": [
            {
                "kind": item.what.kind.value,
                "of": item.what.place,
                "over": item.what.by or None,
                "after": item.what.after or None,
                "size": None if item.what.kind in KIND_HOLDS else item.what.size,
                "memory": item.what.memory if item.what.is_slow else None,
                "order": item.what.order if item.what.kind is Kind.LAG else None,
                "gain": item.trained,
                "gain_held_back": item.held,
                "alike": [
                    {"kind": other.kind.value, "of": other.place, "over": other.by or None} for other in item.alike
                ],
            }
            for item in found.added
        ],
        "lasting": [{"of": item.place, "size": item.size, "memory": item.memory} for item in found.lasting],
        "raised": [{"what": item.what, "times": item.times} for item in found.raised],
        "lowered": [{"what": item.what, "times": item.times} for item in found.lowered],
        "promise": found.promise,
        "between_alarms_before": None if before is None else before.between,
        "between_alarms": None if health is None else health.between,
        "peak_before": None if before is None else before.peak,
        "peak": None if health is None else health.peak,
        "walk": None if health is None else health.walk,
        "alarms": found.alarms,
        "strayed": stray_records(found.fitted.strays),
        "smallest_before": {item.parameter: item.value for item in found.smallest_before},
        "deaf": list(found.deaf),
        "smallest": found.smallest_claimed,
        "left": [{"kind": item.kind.value, "of": item.place, "gain": gain} for item, gain in found.left],
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class QuietPart:
    """A part of what is told of a fit until quiet: a table, which may be empty, and lines with their labels."""

    title: str
    note: str = ""
    header: tuple[str, ...] = ()
    rows: tuple[tuple[str, ...], ...] = ()
    lines: tuple[tuple[str, str], ...] = ()


def quiet_parts(graph: BondGraph, found: Quieted) -> tuple[QuietPart, ...]:
    """Give what was done to a model, what it cost, and what could not be mended.

    graph: the model as it was given
    """
    texts = [
        f"{' or '.join(x.words for x in item.alike)}, in place of {item.what.words}"
        for item in found.added
        if item.alike
    ]
    so_far = " so far" if found.unfinished or found.out_of_time else ""
    ended = ": the time was up" if found.out_of_time else ""
    nothing = f"nothing{so_far} that foretells what was held back better{ended}"
    told = under("as good", texts) if found.added else [("", nothing)]
    told += under("beside", _beside_words(found.added))
    told += under("curves", [_curve_words(graph, item.what) for item in found.added if item.what.by])
    told += under("trusted", _trusted_words(found))
    told += under("lasting", _lasting_words(graph, found.lasting))
    for label, sizes in (("raised", found.raised), ("lowered", found.lowered)):
        told += under(label, [f"{item.what} {item.times:.2g} times as large" for item in sizes])
    if found.out_of_time:
        told.append(("time", OUT_OF_TIME))
    if not found.stated:
        promise = f"time_between_false_alarms: {duration_text(found.promise)}; the model stated none"
        told.append(("promise", promise))
    parts = [
        QuietPart(
            title="What the recordings call for",
            note=f"judged by {join(found.held)}, held back",
            header=("added", "of", "size", "unit", "over", "gain, nats", "held back"),
            rows=tuple(_added_row(graph, item) for item in found.added),
            lines=tuple(told),
        )
    ]
    if found.smallest_after:
        cost = QuietPart(
            title="What it costs",
            note=_within(found.smallest_after),
            header=("suspect", "smallest fault before", "now", "unit"),
            rows=tuple(_cost_rows(found)),
            lines=(
                *begun_lines(
                    [item for item in found.smallest_after if item.value is None], " of the longest recording"
                ),
                *heat_lines(found.fitted.graph, [item.parameter for item in found.smallest_after]),
                *_deaf_lines(found),
            ),
        )
        parts.append(cost)
    if found.health is not None and (not found.quiet or found.raised or not found.health.has_room):
        left = "Nearest to an alarm" if found.quiet else "What could not be mended"
        parts.append(QuietPart(title=left, lines=tuple(_left_lines(found, found.health))))
    return tuple(parts)


def _lasting_words(graph: BondGraph, lasting: Sequence[Imperfection]) -> list[str]:
    """Say which slow errors were declared as long as what alarmed, with their sizes before they were raised."""
    sizes = [f"{item.place} {_size_text(graph, item)}" for item in lasting]
    return [f"slow errors of sensors, as long as what alarmed: {join(sizes)}"] if sizes else []


def _size_text(graph: BondGraph, item: Imperfection) -> str:
    size, unit = _sized(graph, item)
    return f"{short(size)} {unit_text(unit)} over {duration_text(item.memory, digits=2)}"


def _curve_words(graph: BondGraph, item: Imperfection) -> str:
    """Say in words how a parameter goes with something, and where it has the value that is told.

    graph : the model as it was given
    """
    bend, power = item.bend, f"{item.size:.3g}".replace("-", MINUS)
    assert bend is not None  # noqa: S101 - of a curve
    if bend.by == Binary("/", Name(bend.name), Name(item.place)) and item.size < 1.0:
        return _other_power(graph, item, bend)
    given = {known.name: known.unit for known in graph.inputs}
    unit = given.get(item.by) or graph.signal_unit(item.by)
    usual = f"{short(unit.from_si(bend.usual))} {unit_text(unit.text)}".rstrip()
    if not bend.least:
        return f"{item.place} is exp({power} {item.by}/{usual}) times what it is where {item.by} is 0"
    size = f"the size of {item.by}" if bend.signed else item.by
    if bend.bowed:
        other = math.expm1(item.size * math.log(2.0) ** 2)
        than = f"{short(100.0 * abs(other))} % {'larger' if other > 0.0 else 'smaller'}"
        return f"{item.place} is {than} where {size} is half of {usual}, or twice, than where it is that"
    laws = (law.right for part in graph.components if item.place in part.parameters for law in part.laws)
    stated = {
        known.value for law in laws for base, known in powers(law) if base == bend.by and isinstance(known, Number)
    }
    whole = "".join(f", so with {known + item.size:.3g} where it has {known:g}" for known in stated)
    return (
        f"{item.place} goes with {size} to the power {power}, beside what its law says{whole}; "
        f"its value is that at {usual}"
    )


def _other_power(graph: BondGraph, item: Imperfection, bend: Bend) -> str:
    """Say of a curve over what a law is for, such as the pressure of `e = K*f*abs(f)`, with which power that goes."""
    laws = (law.right for part in graph.components if item.place in part.parameters for law in part.laws)
    rest = next((one for right in laws if (one := without_factor(right, item.place))), None)
    usual, words = short(bend.usual), "what its law says" if rest is None else to_text(rest)
    return (
        f"{bend.name} goes with {words} to the power {1.0 / (1.0 - item.size):.3g}, by its law to 1; "
        f"{item.place} has its value where that is {usual}"
    )


def told_in_file(found: Quieted) -> str:
    """Give the model text with what was added and raised in its first line, which tells of the fit."""
    first, line_end, rest = found.text.partition("\n")
    if not first.startswith(MARK):
        return found.text
    added = [item.what.words for item in found.added]
    raised = [f"{item.what} {item.times:.2g} times" for item in found.raised]
    if added:
        first += f" Added: {join(added)}."
    if raised:
        first += f" Larger than found: {join(raised)}."
    return first + line_end + rest


def print_quiet(console: Console, graph: BondGraph, found: Quieted) -> None:
    """Print what was done to a model, and what it cost.

    graph: the model as it was given
    """
    for part in quiet_parts(graph, found):
        title(console, part.title, part.note)
        if part.rows:
            table(console, part.header, part.rows)
        lines(console, list(part.lines))
    console.print()
    style = "bold green" if found.quiet and not found.fitted.strays and not found.deaf else "bold yellow"
    console.print(Text(quiet_verdict(found), style=style))


def _trusted_words(found: Quieted) -> list[str]:
    """Say of which lags that were added no fault is sought, and how one is."""
    late = (lag_of(item.what) if item.what.kind is Kind.RATE_LIMIT else item.what for item in found.added)
    lags = [parameter_name(item) for item in late if item.kind is Kind.LAG]
    lags = [name for name in lags if name in found.fitted.added]
    if not lags:
        return []
    them = "it" if len(lags) == 1 else "them"
    return [f"{join(lags)}: no fault is sought in {them}, unless the model says `suspect: yes` there"]


def _beside_words(added: Sequence[Added]) -> list[str]:
    """Say of what lost where it was tried alone why it is there."""
    lost = [item.what.words for item in added if item.held < 0.0 and item.what.kind not in KIND_HOLDS]
    return [f"{join(lost)}: foretells worse by itself, and better beside what was added with it"] * bool(lost)


def _added_row(graph: BondGraph, item: Added) -> tuple[str, ...]:
    size, unit = _sized(graph, item.what)
    memory = duration_text(item.what.memory) if item.what.is_slow else ""
    number, words = figure(size, digits=3).number(), unit_text(unit)
    if item.what.kind in KIND_HOLDS:
        number = words = ""
    stages = f" in {item.what.order} stages" if item.what.order > 1 else ""
    gains = tuple(f"{gain:+.0f}".replace("-", MINUS) for gain in (item.trained, item.held))
    if not item.trained and not item.held:
        gains = "with its bow" if item.what.kind is Kind.CURVE else "with the one above", ""
    return (
        item.what.kind.value + stages,
        item.what.key[1],
        number,
        words,
        memory,
        *gains,
    )


def _within(found: Sequence[SmallestFault]) -> str:
    return f"found within {duration_text(found[0].within)}, in {100 * found[0].certainty:.0f} of 100 cases"


def _cost_rows(found: Quieted) -> Iterator[tuple[str, ...]]:
    before = {item.parameter: item for item in found.smallest_before}
    graph = found.fitted.graph
    nominals = {item.name: abs(item.nominal) for item in graph.parameters}
    for item in found.smallest_after:
        unit, nominal = unit_of(graph, item.parameter), nominals.get(item.parameter)
        first, texts = before.get(item.parameter), []
        sizes = (None if first is None else first.value), found.smallest_claimed[item.parameter]
        for one, size in zip((first, item), sizes, strict=True):
            if size is None:
                texts.append("never claimed" if one and one.value is not None else (one and one.reason) or "not found")
                continue
            part = f" ({share_text(size / nominal)})" if nominal else ""
            texts.append(figure(unit.difference_from_si(size), digits=3).number() + part)
        yield item.parameter, *texts, unit_text(unit.text)


def _deaf_lines(found: Quieted) -> list[tuple[str, str]]:
    """Say which faults are hardly found any more, and what would bring them back."""
    if not found.deaf:
        return []
    slow = [item.what.place for item in found.added if item.what.is_slow]
    what = f"what is missing in the laws at {join(slow)}" if slow else "what is missing in the model"
    half, smallest = found.half, {item.parameter: item.value for item in found.smallest_after}
    hidden = [name for name in found.deaf if not _is_below(smallest[name], half[name])]
    moving = [name for name in found.deaf if name not in hidden]
    shown = f"{join(hidden)}: only changes by more than half show through all that the model may do while healthy"
    known = f"{join(moving)}: seen to move so far while healthy (`healthy_change`) that smaller changes are not claimed"
    told = "; ".join([shown] * bool(hidden) + [known] * bool(moving))
    return [("deaf to", f"{told}. Find {what}, or record what acts there as an input, and fit again")]


def _left_lines(found: Quieted, health: Health) -> Iterator[tuple[str, str]]:
    """Say where the model is wrong still, and which places would gain."""
    yield from where_lines(found.fitted.graph, health)
    yield from under("alarms", [f"at {clock_text(time)} of {name}" for name, time in found.alarms.items()])
    places = [item.place for item, gain in found.left if gain > TOLD]
    if places:
        yield (
            "look at",
            f"{join(list(dict.fromkeys(places))[:MOST_LEFT])}: there the recordings gain most from an error",
        )


def _by_then_words(found: Quieted) -> str:
    """Say what is known of a model that was not put on trial."""
    by_then = "The model is as it was by then, its accuracies as stated, or as far as it has gone"
    if found.alarms:
        return f"{by_then}. It alarms on {join([*found.alarms])}, so `run` claims no fault by it (`false_alarms`)."
    if not found.asked:
        return f"{by_then}, and nobody knows yet how quiet: ask `faultbond check --data`."
    return (
        f"{by_then}. With these it does not alarm on the recordings themselves; how often it would on others, and how "
        "large a fault has to be, tells `faultbond check --data`."
    )


def quiet_verdict(found: Quieted) -> str:
    """Say in a sentence or two what came of it."""
    health = found.health
    if health is None:
        return f"The search was stopped before its end. {_by_then_words(found)}"
    if found.unfinished:
        return f"The search was stopped before its end. {quiet_verdict(replace(found, stopped=None, failed=None))}"
    between = spacing_text(health.between)
    hidden = f" At {join([item.name for item in health.blind])} faults hide." if health.blind else ""
    deaf = f" The model is deaf to faults of {join(found.deaf)}.{hidden}" if found.deaf else hidden
    if found.quiet and not health.has_room:
        nearest = max(health.peak, health.walk)
        return (
            f"The recordings are as quiet as promised, with little to spare: {100 * nearest:.0f} % of the way to an "
            f"alarm. A recording of another day may alarm.{deaf}"
        )
    if found.quiet:
        quiet = f"The recordings are as quiet as promised: a false alarm every {between}, as far as they tell."
        return f"Quiet, but of little use.{deaf} {quiet}" if found.little_use else quiet + deaf
    now = f"a false alarm every {between}"
    if found.alarms or health.peak > 1.0:
        now = f"it alarms on {join([*found.alarms]) or 'these recordings'}"
    return (
        f"The model is not as quiet as promised: {now}. Fit what was written once more, as it is: with what was found "
        "more may be seen. If that adds nothing, mend it where it is wrong."
    )
