"""What a model declares otherwise to be quiet: accuracies, noise and slow errors, larger or smaller, in its text."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from faultbond.fit.innovations import Variant
from faultbond.fit.outcome import NoiseFound
from faultbond.model.amend import Path, amended, with_correlations
from faultbond.model.correlations import correlation_rows
from faultbond.model.graph import BondGraph, SlowError
from faultbond.model.rewrite import NewSize, parameter_path, rewrite
from faultbond.model.text import parse_model
from faultbond.report.fit_result import spread_text

SMALLER = 0.9  # times what is declared; a slow error that may be less small than that stays as it is


@dataclass(frozen=True, slots=True, kw_only=True)
class Resized:
    """Something that must be declared larger, or may be declared smaller, and how many times as large."""

    what: str
    times: float


def raised_text(text: str, graph: BondGraph, variant: Variant) -> tuple[str, tuple[Resized, ...]]:
    """Give a model text with accuracies, noise and slow errors so many times as large, and what was raised."""
    noise = variant.noise if isinstance(variant.noise, tuple) else (variant.noise,) * len(graph.sensors)
    raised = [Resized(what=f"noise of {item.name}", times=x) for item, x in zip(graph.sensors, noise, strict=True)]
    sizes = [NewSize(name=item.name, times=x) for item, x in zip(graph.sensors, noise, strict=True) if x != 1.0]
    slow = variant.slow if isinstance(variant.slow, tuple) else (variant.slow,) * len(graph.slow_errors)
    larger = [(item, x) for item, x in zip(graph.slow_errors, slow, strict=True) if x != 1.0]
    sizes += [NewSize(name=item.target, times=x, kind=item.kind) for item, x in larger]
    text = rewrite(text, graph, (), sizes)
    if variant.accuracy != 1.0:
        text = widened_text(text, graph, {item.name: variant.accuracy for item in graph.parameters})
    told = (
        *raised,
        *(
            Resized(what=f"{'wander' if item.wanders else 'slow error'} of {item.target}", times=x)
            for item, x in larger
        ),
        Resized(what="accuracies of the parameters", times=variant.accuracy),
    )
    return text, tuple(item for item in told if item.times != 1.0)


def resized_in_turn(first: Sequence[Resized], then: Sequence[Resized]) -> tuple[Resized, ...]:
    """Give how many times as large each is in the end that was resized, and perhaps once more."""
    times = {item.what: item.times for item in first}
    for item in then:
        times[item.what] = times.get(item.what, 1.0) * item.times
    return tuple(Resized(what=what, times=x) for what, x in times.items())


def lowered_text(
    text: str, graph: BondGraph, noises: Sequence[NoiseFound], part: float = 1.0
) -> tuple[str, tuple[Resized, ...]]:
    """Give a model text with slow errors no larger than the recordings tell, and which became smaller.

    One that grows after inputs stays as it is declared. Others go a part of that way, as a ratio: of 1/4 half is 1/2.
    """
    sizes, told = [], []
    for item in noises:
        times = (item.at_most / item.declared) ** part
        if isinstance(item.of, SlowError) and times < SMALLER and not item.of.after:
            sizes.append(NewSize(name=item.name, times=times, kind=item.of.kind))
            told.append(Resized(what=item.of.words, times=times))
    return rewrite(text, graph, (), sizes), tuple(told)


def widened_text(text: str, graph: BondGraph, times: Mapping[str, float]) -> str:
    """Give a model text in which accuracies are so many times as large, by the name of the parameter."""
    return amended(text, list(_accuracies(graph, times)), graph.file)


def with_stated_accuracies(text: str, stated: BondGraph) -> str:
    """Give a fitted model text in which no parameter is surer than it was stated, and none go together beyond that.

    What has gone farther than was stated of it is known to as much as it has gone: half-way of a search it may stand
    for what is missing elsewhere, and the next fit would else hold it there.
    """
    text = with_correlations(text, correlation_rows(stated.correlations))
    read, times = parse_model(text, file=stated.file), dict[str, float]()
    for item in stated.parameters:
        found = read.parameter(item.name)
        part = abs(found.nominal / item.nominal) if item.nominal else 1.0
        known = max(item.accuracy * part, abs(found.nominal - item.nominal))
        if found.accuracy > 0.0 and known > found.accuracy:
            times[item.name] = known / found.accuracy
    return widened_text(text, read, times)


def _accuracies(graph: BondGraph, times: Mapping[str, float]) -> Iterator[tuple[Path, str]]:
    for item in graph.parameters:
        if item.accuracy > 0.0 and item.name in times:
            wider = times[item.name] * item.accuracy
            yield (*parameter_path(graph, item.name), "accuracy"), spread_text(wider, item.nominal, item.unit)
