"""A model on healthy recordings: would it alarm, where is it wrong, and what it must declare; records and text."""

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from itertools import islice

from rich.console import Console
from rich.text import Text

from faultbond.contract.json_records import Record
from faultbond.contract.spec import EngineSpec
from faultbond.fit.false_alarms import FARTHEST
from faultbond.fit.lack_of_fit import Region
from faultbond.fit.trial import FACTORS, Health
from faultbond.model.graph import BondGraph, Input, Unit
from faultbond.report.console import headline, lines, table, title, under
from faultbond.report.numbers import MINUS, clock_text, duration_text, figure, join, recording_text, unit_text
from faultbond.report.suspects import cure_of_walk

MOST_REGIONS = 6
MOST_OF_ONE = 2  # regions of a sensor: what one reads wrong shows wherever some input is
MOST_DIGITS = 9  # of the ends of a range
MUCH = 0.8  # of the limit of a walk
MANY = 10.0  # times a limit; more is not told in percent
GROSS = 20.0  # times the limit of an alarm: then what is declared larger is no cure, but the end of all watching
YEAR = 365.25 * 86400.0  # s
CLIMBS = {1: "reads more than expected", -1: "reads less than expected", 0: "scatters more than declared"}
WORDS = {"accuracy": "accuracies of the parameters", "noise": "noise of the sensors", "slow": "slow errors"}


def health_record(graph: BondGraph, spec: EngineSpec, found: Health, slower: float | None = None) -> Record:
    """Give the record of a model on trial; SI. slower: a longer time between samples that would do, s."""
    return {
        "record": "trial",
        "model": graph.name,
        "model_sha256": graph.sha256,
        "version": spec.version,
        "recordings": [
            {
                "recording": item.name,
                "samples": len(item.time),
                "first": float(item.time[0]),
                "last": float(item.time[-1]),
            }
            for item in found.records
        ],
        "promise": found.promise,
        "kept": found.keeps,
        "between_alarms": found.between,
        "peak": found.peak,
        "statistics": [
            {
                "name": item.name,
                "kind": item.kind.replace(" ", "_"),
                "peak": item.peak,
                "between_alarms": item.between,
                "mean": item.mean,
                "spread": item.spread,
                "memory": item.memory,
            }
            for item in found.rates
        ],
        "regions": [asdict(item) | {"of": item.of or None} for item in found.regions],
        "moments": [asdict(item) for item in found.moments],
        "trials": [
            {"kind": item.kind, "factor": item.factor, "peak": item.peak, "between_alarms": item.between}
            for item in found.trials
        ],
        "needed": found.needed,
        "walk": {"of": found.walker or None, "peak": found.walk},
        "late": [asdict(item) for item in found.late],
        "early": [asdict(item) for item in found.early],
        "mirrored": list(found.mirrored),
        "slower": slower,
    }


def print_health(console: Console, graph: BondGraph, found: Health, slower: float | None = None) -> None:
    """Print what came of a trial of a plant; a console that is no terminal gets `console.PLAIN_WIDTH` columns.

    slower: a longer time between samples that would do, s.
    """
    headline(console, graph.name, graph.file)
    lines(console, under("recordings", [recording_text(item.name, item.time) for item in found.records]))
    title(console, "What the detector sees", "scores: 0 ± 1 if all is as declared; peak: an alarm above 100 %")
    rows = []
    for item in found.rates:
        score = f"{item.mean:+.2f} ± {item.spread:.2f}".replace("-", MINUS)
        every = "each sample" if item.between <= (graph.sample_time or 0.0) else spacing_text(item.between)
        rows.append((item.words, score, _times_text(item.peak, "{} %", "{} times"), duration_text(item.memory), every))
    table(console, ("statistic", "score", "peak", "alike for", "false alarm every"), rows)
    title(console, "Where the model is wrong")
    lines(console, where_lines(graph, found) or [("", "nowhere that the detector would mind")])
    if slower is not None and graph.sample_time is not None:
        stated = f"`sample_time: {duration_text(slower)}` with `row_time: {duration_text(graph.sample_time)}`"
        lines(console, [("sampling", f"far faster than anything here moves: {stated} finds slow faults sooner")])
    title(console, "What must be declared", f"for a false alarm every {spacing_text(found.promise)} at most")
    tried = {
        (item.kind, item.factor): "alarm" if item.peak > 1.0 else spacing_text(item.between) for item in found.trials
    }
    kinds = [kind for kind in found.needed if any(tried[kind, x] != "alarm" for x in FACTORS)]
    if kinds:
        header = ("times", *(WORDS[kind] for kind in kinds))
        table(console, header, [(f"{x:g}", *(tried[kind, x] for kind in kinds)) for x in FACTORS])
    lines(console, under("needed", list(_needed_texts(found))))
    console.print()
    console.print(Text(health_verdict(graph, found), style="bold green" if found.keeps else "bold yellow"))


def spacing_text(seconds: float) -> str:
    """Give a time between false alarms."""
    if not math.isfinite(seconds) or seconds >= min(1e3 * YEAR, FARTHEST):
        return "1000 years or more"
    return f"{seconds / YEAR:.0f} years" if seconds >= 2 * YEAR else duration_text(seconds)


def where_lines(graph: BondGraph, found: Health) -> list[tuple[str, str]]:
    """Say in which regions and at which moments the sensors are off."""
    units = {item.name: item.unit for item in graph.inputs} | {item.name: item.unit for item in graph.sensors}
    worst = list(islice(_few_of_each(found.regions), MOST_REGIONS))
    told = under("regions", [_region_text(item, units) for item in worst])
    if len(found.regions) > len(worst):
        told.append(("", f"and {len(found.regions) - len(worst)} more"))
    moments = []
    for item in found.moments:
        where = f" of {item.recording}" if len(found.records) > 1 else ""
        reads = f"{item.sensor} {CLIMBS[item.side]}"
        height = _way_text(item.height)
        begin, end = clock_text(item.begin), clock_text(item.end)
        when = begin if begin == end else f"{begin} to {end}"
        moments.append(f"{when}{where}: {reads}, {height}")
    blind = [
        f"{item.name} scores 0 ± {item.spread:.2f}: it is let be nearly anything, so faults hide there; declare noise, "
        "slow errors or accuracies smaller"
        for item in found.blind
    ]
    lost = [
        f"from {clock_text(time)} of {name} on nothing follows the plant any more, since the filter's variances are "
        "lost there; what is told is of the time before"
        for name, time in found.lost
    ]
    return (
        under("lost", lost)
        + under("blind", blind)
        + told
        + under("moments", moments)
        + under("hints", list(_hints(graph, found)))
    )


def _few_of_each(regions: Sequence[Region]) -> Iterator[Region]:
    """Give the first regions of each sensor, in their order."""
    seen = Counter[str]()
    for item in regions:
        seen[item.sensor] += 1
        if seen[item.sensor] <= MOST_OF_ONE:
            yield item


def _hints(graph: BondGraph, found: Health) -> Iterator[str]:
    """Say what the errors look like."""
    for name in found.mirrored:
        yield f"{name} moves the other way round than expected: is a bond, or a sign in a law, turned round?"
    for item in found.late:
        if item.sensor not in found.mirrored:
            by = f", by about {duration_text(item.by)}" if item.by is not None else ""
            ways = f"{_longer(graph, item.of)} or {_longer(graph, item.sensor)}"
            yield f"{item.sensor} follows changes of {item.of} later than the model says{by}: {ways}?"
    for early in found.early:
        if early.sensor not in found.mirrored:
            ways = f"a row hold what acted until then (`hold: next` of {early.of}), or is it read a moment later?"
            yield f"{early.sensor} moves in the very row in which {early.of} does: does {ways}"
    if found.walk > MUCH and found.peak <= GROSS:  # of a model that is far off everything walks
        asked = "is it a constant?"
        if any(item.target == found.walker for item in graph.wanders):
            asked = "does it wander farther, or for longer, than declared?"
        yield f"{found.walker} walks on healthy data, {_way_text(found.walk)}: {asked}"


def _way_text(peak: float) -> str:
    return _times_text(peak, "{} % of the way to an alarm", "{} times as far as to an alarm")


def _times_text(peak: float, percent: str, times: str) -> str:
    """Give how far something is on the way to an alarm: in percent, or as times where that is a long number."""
    return percent.format(f"{100 * peak:.0f}") if peak < MANY else times.format(f"{peak:.3g}")


def _longer(graph: BondGraph, name: str) -> str:
    """Name the lag of an input or a sensor that may be what is missing."""
    known = next(item for item in graph.instruments if item.name == name)
    if not known.lag:
        return f"a `lag:` {'or a `rate_limit:` ' if isinstance(known, Input) else ''}of {name}"
    longer = f"a longer `lag:` of {name} than {duration_text(graph.parameter(known.lag).nominal)}"
    is_free = isinstance(known, Input) and not known.rate_limit
    return f"{longer}, a `rate_limit:` of it" if is_free else longer


def _region_text(item: Region, units: dict[str, Unit]) -> str:
    what = []
    if abs(item.mean) > 0.1:
        what.append(f"reads {abs(item.mean):.2g} sd {'more' if item.mean > 0 else 'less'} than expected")
    if item.spread > 1.2:
        what.append(f"scatters {item.spread:.2g} times as much as declared")
    text = f"{item.sensor} {' and '.join(what)}"
    if not item.of:
        return f"{text}, all the time"
    if item.after_step:
        return f"{text} soon after a step of {item.of}"
    unit = units[item.of]
    low, high = _ends(unit.from_si(item.low), unit.from_si(item.high))
    return f"{text} where {item.of} is {low} to {high} {unit_text(unit.text)}".rstrip()


def _ends(low: float, high: float) -> tuple[str, str]:
    """Give the ends of a range with three digits, or with two of how wide it is where that is more: 138.6 to 139.2."""
    wide, digits = abs(high - low), 3
    if math.isfinite(wide) and wide > 0.0:
        digits = 2 + math.floor(math.log10(max(abs(low), abs(high)))) - math.floor(math.log10(wide))
    low_text, high_text = (figure(end, digits=min(max(digits, 3), MOST_DIGITS)).number() for end in (low, high))
    return low_text, high_text


def _needed_texts(found: Health) -> Iterator[str]:
    if found.needed and not any(found.needed.values()):
        kinds = join([WORDS[kind] for kind in found.needed])
        tried = f"none from {FACTORS[0]:g} to {FACTORS[-1]:g} times is enough by itself"
        yield f"more than can be declared: of {kinds} {tried}"
        return
    if found.walk > 1.0:
        yield f"{found.walker} must be let move farther than it is declared to, and besides one of these be larger:"
    for kind, factor in found.needed.items():
        if factor is None:
            yield f"{WORDS[kind]}: none from {FACTORS[0]:g} to {FACTORS[-1]:g} times is enough by itself"
        elif factor == 1.0:
            yield f"{WORDS[kind]}: as declared"
        elif factor < 1.0:
            yield f"{WORDS[kind]}: as declared; {factor:g} times that would be enough"
        else:
            yield f"{WORDS[kind]}: {factor:g} times those declared"


def health_verdict(graph: BondGraph, found: Health) -> str:
    """Say in a sentence what came of it."""
    if found.keeps:
        often = spacing_text(found.between)
        kept = f"The model keeps the promise: a false alarm every {often}, as far as these recordings tell."
        known = f" So `false_alarms: {graph.false_alarms}` of the model may go." if graph.false_alarms else ""
        return kept + known
    if found.peak > GROSS:
        worst = max(found.rates, key=lambda item: item.peak).name
        return (
            f"The model does not keep the promise: it is far off, most in {worst}. `faultbond fit` with "
            "`--until-quiet` finds what it leaves out; what that cannot mend is a unit, a sign or a bond's direction."
        )
    if found.walk > 1.0:  # what else is declared is no cure of that
        far = f"the healthy model has to move {found.walker} as far as for an alarm"
        return f"The model does not keep the promise: {far}. {cure_of_walk(graph, found.walker)}"
    asked = spacing_text(found.promise)
    every = f"a false alarm every {spacing_text(found.between)}, where {asked} are asked"
    now = "it alarms on these recordings" if found.peak > 1.0 else every
    factors = {kind: factor for kind, factor in found.needed.items() if factor and factor != 1.0}
    ways = [f"{WORDS[kind]} {factor:g} times as large" for kind, factor in factors.items() if factor > 1.0]
    ways += [f"{WORDS[kind]} {factor:g} times those declared" for kind, factor in factors.items() if factor < 1.0]
    mend = "Mend the model where it is wrong, or declare slow errors there."
    advice = f"Declare {' or '.join(ways)}." if ways else mend
    if found.peak <= 1.0 and found.at_most >= found.promise:
        short = "but these recordings are too short to tell"
        longer = "A longer healthy recording would; until then nothing speaks for another model."
        return f"The model may keep the promise: {every}, {short}. {longer}"
    return f"The model does not keep the promise: {now}. {advice}"
