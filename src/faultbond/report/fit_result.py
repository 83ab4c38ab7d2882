"""What a fit found: as records, as text for people, and as a model file."""

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.text import Text

from faultbond.contract.core_settings import core_settings
from faultbond.contract.json_records import Record
from faultbond.contract.samples import Sample
from faultbond.errors import ModelError
from faultbond.fit.healthy_changes import Believed
from faultbond.fit.identification import Fit
from faultbond.fit.outcome import (
    Estimate,
    NoiseFound,
    Silence,
    correlations_of,
    estimates_of,
    faint_of,
    loosened,
    noises_of,
    residual_sizes,
    silences_of,
)
from faultbond.fit.stray import Stray, doubts_of, strays_of
from faultbond.fit.wander import Wander
from faultbond.model.amend import amended, with_correlations
from faultbond.model.correlations import correlation_rows
from faultbond.model.dump import dump_model
from faultbond.model.graph import BondGraph, Correlation, Input, Sensor, SlowError, Unit
from faultbond.model.rewrite import NewParameter, NewSize, parameter_path, rewrite
from faultbond.model.text import parse_model
from faultbond.report.console import headline, lines, table, title, under
from faultbond.report.doubts import doubt_texts, shared_by, stray_records, stray_remark, stray_sentence, stray_texts
from faultbond.report.numbers import (
    MINUS,
    change_text,
    clock_text,
    figure,
    join,
    recording_text,
    rounded_up,
    unit_text,
    with_noun,
)
from faultbond.report.together import closest_texts

MOST_NAMED = 4  # readings that were left out
ENOUGH = 10  # samples for each value that is sought
FORMAL = 0.05  # of the noise of a sensor; a slow error as small is declared for the sake of what it does after moves
AT_MOST = 0.999  # of what is declared; a slow error is not found larger
_CLOSE = 0.1  # accuracies by which what is read back from the file may differ, from rounding
HEADER = ("name", "component", "nominal", "estimate ± sd", "unit", "change", "accuracy", "from the data")
WHOLE = ("estimate ± sd", "found ± sd")  # columns that are not folded


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """A fit and the model it belongs to: parameters, noise of the sensors, and what the data do not tell.

    healthy_changes: standard deviations by which parameters seem to change, and instruments to be off, healthy, SI
    strays: parameters that the fit puts far outside what was declared
    apart: whether it is left out how fitted parameters go together, as they do not while healthy
    added: parameters that no file declared, but a search for what is missing
    known: those of them that are declared as known, since what is uncertain of them walks while healthy
    doubt: what an earlier fit found doubtful, as the first line of the model says
    alarms: when the fitted model alarms on the recordings, s, by their names; None: it was not asked
    """

    graph: BondGraph
    found: Fit
    version: str
    estimates: tuple[Estimate, ...]
    noises: tuple[NoiseFound, ...]
    silences: tuple[Silence, ...]
    wanders: tuple[Wander, ...] = ()
    healthy_changes: Mapping[str, float] = field(default_factory=dict)
    strays: tuple[Stray, ...] = ()
    apart: bool = False
    added: frozenset[str] = frozenset()
    known: frozenset[str] = frozenset()
    doubt: str = ""
    alarms: Mapping[str, float] | None = None

    @property
    def wider(self) -> dict[str, float]:
        """How many times wider the accuracies are that the data agree with, of parameters that the file declared."""
        return {name: times for name, times in self.found.contradicted.items() if name not in self.added}

    @property
    def correlations(self) -> tuple[Correlation, ...]:
        """What the model is to declare: as found, and of parameters that were not fitted as it was."""
        order = {item.name: k for k, item in enumerate(self.graph.parameters)}
        fitted = {item.parameter.name for item in self.estimates}
        kept = [item for item in self.graph.correlations if fitted.isdisjoint((item.one, item.other))]
        pairs = {} if self.apart else correlations_of(self.found, self.estimates, self.healthy_changes)
        pairs = {names: value for names, value in pairs.items() if self.known.isdisjoint(names)}
        found = [Correlation(one=one, other=other, value=value) for (one, other), value in pairs.items()]
        return tuple(sorted((*kept, *found), key=lambda item: (order[item.one], order[item.other])))

    def model_text(self, text: str) -> str:
        """Give the text of the model file with what was found.

        Raises
        ------
        ModelError
            Where the text that came out does not read back as the fitted model.
        """
        changed = [item for item in self.noises if item.to_declare != item.declared]  # noise of sensors
        sizes = [NewSize(name=item.name, times=item.to_declare / item.declared) for item in changed]
        what = [*(item.parameter.name for item in self.estimates), *(f"noise of {item.name}" for item in changed)]
        remark = f"{', '.join(Path(item.name).name for item in self.found.records)}: {join(what)}."
        remark += stray_remark(self.strays) or self.doubt
        parameters = [_new_parameter(item, known=item.parameter.name in self.known) for item in self.estimates]
        written = rewrite(text, self.graph, parameters, sizes, remark)
        written = with_correlations(written, correlation_rows(self.correlations))
        read = parse_model(written, file=self.graph.file)
        self._compare(read)
        return self.with_healthy_changes(written, read)

    def with_healthy_changes(self, text: str, graph: BondGraph) -> str:
        """Give the text of a fitted model with what seems to change, and to be off, while healthy."""
        path = {item.name: (*parameter_path(graph, item.name), "healthy_change") for item in graph.parameters}
        section = dict.fromkeys((item.name for item in graph.sensors), "sensors")
        told = [(path[name], size) for name, size in self.declared_changes]
        told += [((section.get(name, "inputs"), name, "healthy_bias"), size) for name, size in self.declared_biases]
        return amended(text, told, graph.file)

    def with_false_alarms(self, text: str) -> str:
        """Give the text of a fitted model with the number of recordings on which it alarms; as it was where unasked."""
        if self.alarms is None or len(self.alarms) == self.graph.false_alarms:
            return text
        return amended(text, [(("false_alarms",), str(len(self.alarms)))], self.graph.file)

    @property
    def believed(self) -> Believed:
        """What was found, beside what the model declares."""
        return Believed(
            values={item.parameter.name: item.value for item in self.estimates},
            accuracies={item.parameter.name: item.accuracy for item in self.estimates},
            noise={item.name: item.to_declare / item.declared for item in self.noises if isinstance(item.of, Sensor)},
        )

    @property
    def moves(self) -> dict[str, float]:
        """By how much parameters and instruments seem to change while healthy, or may be off as one strayed; sd, SI."""
        doubts = doubts_of(self.strays)
        names = dict.fromkeys((*self.healthy_changes, *doubts))
        return {name: max(self.healthy_changes.get(name, 0.0), doubts.get(name, 0.0)) for name in names}

    @property
    def values(self) -> dict[str, float]:
        """The nominal values that the model is to declare, SI."""
        stated = {item.name: item.nominal for item in self.graph.parameters}
        return stated | {item.parameter.name: item.value for item in self.estimates}

    @property
    def declared_changes(self) -> tuple[tuple[str, str], ...]:
        """The parameters that seem to change by more than their accuracy allows them to, and by how much."""
        fitted = {item.parameter.name: (item.accuracy, item.value) for item in self.estimates}
        told, moves, shared = [], self.moves, shared_by(self.doubt)
        for item in self.graph.parameters:
            accuracy, value = fitted.get(item.name, (item.accuracy, item.nominal))
            found, least = moves.get(item.name, 0.0), core_settings()["MOVES_BY"] * accuracy
            others = shared.get(item.name, ())  # where one of them is known now, it is doubtful no longer
            is_doubtful = bool(others) and {item.name, *others} <= fitted.keys()
            found = max(found, item.healthy_change if is_doubtful else 0.0)
            is_asked = item.name in self.healthy_changes or bool(others)
            is_told = found > least or (is_asked and item.healthy_change > least)
            if is_told and item.name not in self.known:
                told.append((item.name, spread_text(max(found, least), item.nominal and value, item.unit)))
        return tuple(told)

    @property
    def declared_biases(self) -> tuple[tuple[str, str], ...]:
        """Sensors and inputs that seem to be off, and by how much; 0 where that was stated, and is found no more."""
        told = []
        instruments: list[Sensor | Input] = [*self.graph.sensors, *self.graph.inputs]
        for item in instruments:
            found = self.healthy_changes.get(item.name, 0.0)
            if found > 0.0 or (item.name in self.healthy_changes and item.healthy_bias > 0.0):
                unit = item.unit.of_differences
                told.append((item.name, _joined(rounded_up(found / unit.factor), unit)))
        return tuple(told)

    def _compare(self, read: BondGraph) -> None:
        """Refuse a text that says anything but what was found."""
        graph, refusal = self.graph, f"{self.graph.file}: what was found cannot be written into it"
        for item in self.estimates:
            back = read.parameter(item.parameter.name)
            value = 0.0 if item.stays_zero else item.value
            surer = back.accuracy < 0.99 * item.accuracy and back.name not in self.known
            if abs(back.nominal - value) > _CLOSE * item.accuracy or surer:
                raise ModelError(f"{graph.file}: what was found of {back.name} cannot be written into it")
        wanted = {item.name: item.to_declare for item in self.noises if isinstance(item.of, Sensor)}
        for sensor in read.sensors:
            if abs(sensor.noise - wanted.get(sensor.name, sensor.noise)) > _CLOSE * sensor.noise:
                raise ModelError(f"{graph.file}: the noise found of {sensor.name} cannot be written into it")
        if correlation_rows(read.correlations) != correlation_rows(self.correlations):
            raise ModelError(f"{graph.file}: what was found to go together cannot be written into it")
        old = ("parameters", "sensors", "slow_errors", "correlations", "defaults")
        if dump_model(replace(read, **{name: getattr(graph, name) for name in old})) != dump_model(graph):
            raise ModelError(f"{refusal} without changing the rest")


def with_seen_ranges(text: str, graph: BondGraph, read: Iterable[Sequence[Sample]]) -> str:
    """Give the text of a model file with where each input and sensor is in recordings, which are grid points.

    What lies outside of its `range` is wrong. What has no value stays as it was: a fit refuses it.
    """
    courses = np.array([(*point.u, *point.y) for points in read for point in points])
    told = []
    for k, item in enumerate(graph.instruments):
        seen = courses[(item.lower <= courses[:, k]) & (courses[:, k] <= item.upper) & np.isfinite(courses[:, k]), k]
        if not len(seen):
            continue
        lower, upper = (item.unit.from_si(float(end)) for end in (seen.min(), seen.max()))
        step = 10.0 ** (math.floor(math.log10(max(abs(lower), abs(upper)))) - 2) if lower or upper else 1.0
        ends = (math.floor(lower / step) * step, math.ceil(upper / step) * step)
        value = f"[{', '.join(_joined(f'{end:.6g}', item.unit) for end in ends)}]"
        told.append((("inputs" if k < len(graph.inputs) else "sensors", item.name, "fitted_range"), value))
    return amended(text, told, graph.file)


def fitted_model(graph: BondGraph, found: Fit, version: str, wanders: tuple[Wander, ...] = ()) -> Fitted:
    """Give what a fit means for its model. What says how something lags cannot wander: it is known to no better."""
    moved = {item.parameter: item.size for item in wanders if item.parameter in graph.lags}
    estimates = loosened(estimates_of(found), moved)
    return Fitted(
        graph=graph,
        found=found,
        version=version,
        estimates=estimates,
        strays=strays_of(graph, found, estimates),
        noises=noises_of(found, graph),
        silences=silences_of(found),
        wanders=wanders,
    )


def _new_parameter(item: Estimate, *, known: bool = False) -> NewParameter:
    """Give what is to be written of a parameter; a nominal value of 0 stays where the data agree with it.

    known : whether it is declared as known exactly
    """
    parameter, unit = item.parameter, item.parameter.unit
    if item.stays_zero:
        size = _joined(rounded_up(item.to_declare / unit.factor), unit)
        return NewParameter(name=parameter.name, nominal=_joined("0", unit), others=(("accuracy", size),))
    digits = min(max(math.ceil(math.log10(abs(item.value) / item.accuracy)) + 3, 3), 15) if item.accuracy > 0 else 15
    nominal = _joined(f"{unit.from_si(item.value):.{digits}g}", unit)
    others = [("accuracy", "0 %" if known else _accuracy_text(item, in_unit=abs(item.value) < item.accuracy))]
    if parameter.nominal == 0.0 and math.isinf(parameter.lower) and math.isinf(parameter.upper):
        others.append(("range", "any"))
    return NewParameter(name=parameter.name, nominal=nominal, others=tuple(others))


def _accuracy_text(item: Estimate, *, in_unit: bool = False) -> str:
    """Give an accuracy in per cent of the value; in its unit where that is asked for, or nothing is known to be 0."""
    value = 0.0 if in_unit or item.parameter.nominal == 0.0 else item.value
    return spread_text(item.accuracy, value, item.parameter.unit)


def spread_text(size: float, value: float, unit: Unit) -> str:
    """Give a standard deviation, SI, in per cent of a value; in a unit where that is less, or is a temperature."""
    if value and size <= abs(value) and not unit.offset:
        return f"{rounded_up(100.0 * size / abs(value))} %"
    own = unit.of_differences
    return _joined(rounded_up(size / own.factor), own)


def _joined(number: str, unit: Unit) -> str:
    return f"{number} {unit.text}".rstrip()


def fit_record(fitted: Fitted, output: Path | None, *, stopped: bool = False) -> Record:
    """Give the record of a fit; SI. stopped: whether somebody ended it before it was done."""
    found, graph = fitted.found, fitted.graph
    sensors = [item.name for item in graph.sensors]
    recordings = [
        {
            "recording": record.name,
            "samples": len(record.time),
            "readings": record.readings,
            "first": float(record.time[0]),
            "last": float(record.time[-1]),
            "prediction_error": dict(zip(sensors, map(float, innovation), strict=True)),
            "simulation_error": dict(zip(sensors, map(float, simulation), strict=True)),
        }
        for record, (innovation, simulation) in zip(found.records, residual_sizes(found), strict=True)
    ]
    parameters = [
        {
            "name": item.parameter.name,
            "component": item.parameter.owner,
            "nominal": item.parameter.nominal,
            "estimate": item.value,
            "sd": item.sd,
            "sd_from_data_alone": item.alone,
            "inflation": item.inflation,
            "accuracy": item.accuracy,
            "determined": item.determined,
            "at_end_of_range": item.at_end,
            "healthy_change": fitted.healthy_changes.get(item.parameter.name),
        }
        for item in fitted.estimates
    ]
    return {
        "record": "fit",
        "model": graph.name,
        "model_sha256": graph.sha256,
        "version": fitted.version,
        "output": None if output is None else str(output),
        "recordings": recordings,
        "parameters": parameters,
        "noise": [
            {"name": item.name, "kind": kind, "declared": item.declared, "found": item.found, "sd": item.sd}
            for item in fitted.noises
            for kind in ("sensor" if isinstance(item.of, Sensor) else item.of.kind,)
        ],
        "whiteness": [
            {
                "sensor": item.sensor,
                "white": item.white,
                "p": item.p,
                "statistic": item.statistic,
                "lags": item.lags,
                "spread": item.spread,
                "mean": item.mean,
                "correlation": [float(value) for value in item.correlation],
                "words": item.words,
            }
            for item in found.whiteness
        ],
        "biases": [
            {"name": item.name, "kind": kind, "healthy_bias": fitted.healthy_changes[item.name]}
            for kind, items in (("sensor", fitted.graph.sensors), ("input", fitted.graph.inputs))
            for item in items
            if item.name in fitted.healthy_changes
        ],
        "correlations": [{"parameters": [item.one, item.other], "value": item.value} for item in fitted.correlations],
        "alike": [dict(item.changes) for item in fitted.silences],
        "hardly_fixed": [{"parameters": list(names), "sd": sd} for names, sd in faint_of(found)],
        "strayed": stray_records(fitted.strays),
        "widened": {
            item.name: float(times) for item, times in zip(found.plant.unknowns.parameters, found.widths, strict=True)
        },
        "alarms": None if fitted.alarms is None else dict(fitted.alarms),
        "log_likelihood": found.summit.evaluation.value,
        "log_likelihood_before": found.before,
        "changes": [asdict(item) for item in found.changes],
        "wanders": [asdict(item) for item in fitted.wanders],
        "wild": len(found.wild),
        "left_out": [{"recording": name, "time": time, "sensor": sensors[j]} for name, time, j in found.wild],
        "starts": found.starts,
        "reached": found.reached,
        "settled": found.summit.settled,
        "stopped": stopped,
    }


def print_fit(console: Console, fitted: Fitted, output: Path | None) -> None:
    """Print what a fit found; a console that is no terminal gets `console.PLAIN_WIDTH` columns.

    output: the model file that was written, if any.
    """
    graph, found = fitted.graph, fitted.found
    headline(console, graph.name, graph.file)
    data = under("recordings", [recording_text(item.name, item.time) for item in found.records])
    if wide := [f"{name} {times:.1f} times" for name, times in fitted.wider.items()]:
        told = f"the data contradict those declared and agree with wider ones: {', '.join(wide)}"
        data.append(("accuracies", told))
    if found.wild:
        data.append(("left out", _left_out_text(fitted)))
    if found.starts > 1:
        data.append(("search", f"{found.reached} of {found.starts} starts end at the same values"))
    lines(console, data)
    if fitted.estimates:
        title(console, "Parameters")
        table(console, HEADER, parameter_rows(fitted), whole=WHOLE)
        lines(console, remarks(fitted))
    rows = fitted.graph.rows_per_sample
    title(console, "Noise and what is left", f"noise of means of {rows} rows" if rows > 1 else "")
    header = ("sensor", "declared noise", "found ± sd", "unit", "what is left")
    table(console, header, list(noise_rows(fitted)), whole=WHOLE)
    lines(console, list(size_lines(fitted)))
    console.print()
    style = "bold green" if found.summit.settled else "bold yellow"
    console.print(Text(fit_verdict(fitted), style=style))
    for sentence in doubt_sentences(fitted):
        console.print(Text(sentence, style="bold yellow"))
    if output is not None:
        console.print(Text(f"Model written: {output}", style="bold"))


def _left_out_text(fitted: Fitted) -> str:
    """Say which readings were left out: the first ones by sensor, time and recording."""
    wild, sensors = fitted.found.wild, fitted.graph.sensors
    several = len(fitted.found.records) > 1
    named = [
        f"{sensors[j].name} at {clock_text(time)}" + (f" of {Path(name).name}" if several else "")
        for name, time, j in wild[:MOST_NAMED]
    ]
    more = [f"{len(wild) - MOST_NAMED} more"] if len(wild) > MOST_NAMED else []
    return f"{with_noun(len(wild), 'reading')} far off all others: {join([*named, *more])}"


def parameter_rows(fitted: Fitted) -> list[tuple[str, ...]]:
    """Give the cells of each parameter, as `HEADER` names them."""
    return [_parameter_row(item, is_added=item.parameter.name in fitted.added) for item in fitted.estimates]


def _parameter_row(item: Estimate, *, is_added: bool) -> tuple[str, ...]:
    parameter, unit = item.parameter, item.parameter.unit
    value, sd = unit.from_si(item.value), unit.difference_from_si(item.sd)
    change = change_text(parameter.nominal, item.value, item.sd)
    if unit.offset:  # a per cent of a temperature says nothing
        change = f"{item.value - parameter.nominal:+.3g} K".replace("-", MINUS)
    return (
        parameter.name,
        parameter.owner,
        "added" if is_added else figure(unit.from_si(parameter.nominal)).number(),
        figure(value, sd).both(),
        unit_text(unit.text),
        "" if is_added else change,
        _accuracy_text(item),
        "at the end of its range" if item.at_end else "yes" if item.determined else "not alone",
    )


def remarks(fitted: Fitted) -> list[tuple[str, str]]:
    """Say what the parameters' table does not: combinations that do not show, and wider errors."""
    told = under("doubtful", stray_texts(fitted.strays) or doubt_texts(fitted.doubt))
    samples, unknown = sum(len(item.time) for item in fitted.found.records), len(fitted.estimates) + len(fitted.noises)
    if samples < ENOUGH * unknown:
        told.append(
            ("short", f"{samples} samples for {unknown} values: what is found is little more than what was declared")
        )
    told += under("looks alike", [_silence_text(item) for item in fitted.silences])
    told += under("hardly shows", _faint_texts(fitted))
    found = {
        item.parameter.name: replace(item.parameter, nominal=item.value, accuracy=item.to_declare)
        for item in fitted.estimates
    }
    told += under(
        "go together",
        closest_texts({**{item.name: item for item in fitted.graph.parameters}, **found}, fitted.correlations),
    )
    if fitted.found.changes:
        first = fitted.found.changes[0]
        names = join(list(dict.fromkeys(item.parameter for item in fitted.found.changes)))
        named = f"; most of all {first.parameter}" if names != first.parameter else ", most of all"
        question = "" if first.parameter in fitted.added else ". Is it healthy?"
        told.append(("not steady", f"{names}{named} {_least_steady(fitted)}{question}"))
    told += under("wanders", [_wander_text(item, fitted.graph.lags) for item in fitted.wanders])
    moves = [f"{name} {size}" for name, size in fitted.declared_changes]
    if moves:
        told.append(("seems to move", f"{join(moves)} (sd) on healthy data; a fault must change them by more"))
    biases = [f"{name} by {size}" for name, size in fitted.declared_biases if fitted.moves.get(name, 0.0) > 0.0]
    if biases:
        told.append(("seems off", f"{join(biases)} (sd) on healthy data; a fault must bias them by more"))
    most = max((item.inflation for item in fitted.estimates), default=0.0)
    if most > 1.1:
        wider = f"up to {most:.1f} times that of a right model: the data ask for other values at other times"
        told.append(("± sd", wider))
    return told


def _faint_texts(fitted: Fitted) -> list[str]:
    return [
        f"{join(list(names))}: moved together they show to {100 * sd:.2g} % only, less well than declared; what is "
        "declared decides. Name with --fixed what is known exactly"
        for names, sd in faint_of(fitted.found)
    ]


def _least_steady(fitted: Fitted) -> str:
    """Say about when the parameter that stays least the same is another."""
    first, many = fitted.found.changes[0], len(fitted.found.records) > 1
    return f"about {clock_text(first.time)}{f' of {Path(first.recording).name}' if many else ''}"


def unsteady(fitted: Fitted) -> list[str]:
    """Say which parameter stays least the same, and where; nothing where all do."""
    return [f"{item.parameter} seems to change {_least_steady(fitted)}" for item in fitted.found.changes[:1]]


def not_shown(fitted: Fitted) -> list[str]:
    """Say what the data do not show of parameters together, which whoever knows one of them may fix before all else."""
    told = [_silence_text(item) for item in fitted.silences if len(item.changes) > 1]
    return [*told, *_faint_texts(fitted)]


def _wander_text(item: Wander, lags: Collection[str]) -> str:
    """Say what a parameter that seems to wander is to declare; what says how something lags cannot wander."""
    if item.parameter in lags:
        return (
            f"{item.parameter}, as it seems, by {100 * item.size:.2g} %: no one value does for all that was recorded. "
            f"A lag is a constant to the model, so its accuracy says so ({item.gain:.0f} nats)"
        )
    length, unit = next((pair for pair in ((3600.0, "h"), (60.0, "min")) if item.memory >= 2.0 * pair[0]), (1.0, "s"))
    declared = f"{100 * item.size:.2g} % over {figure(item.memory / length, digits=2).number()} {unit}"
    return (
        f"{item.parameter}, as it seems: no one value does for all that was recorded. If that is its nature, declare "
        f"`wander: {declared}` and fit again ({item.gain:.0f} nats)"
    )


def _silence_text(item: Silence) -> str:
    """Say which parameters change together unseen."""
    parts = [f"{name} {100 * part:+.{0 if abs(part) >= 0.01 else 1}f} %" for name, part in item.changes]
    text = ", ".join(parts).replace("-", MINUS)
    if len(parts) == 1:
        return f"{text}: the data do not tell"
    return f"{text} together: the sensors do not show it. State the accuracy of one, or name it with --fixed if exact"


def noise_rows(fitted: Fitted) -> Iterator[tuple[str, ...]]:
    """Give the cells of each sensor and slow error: name, declared and found size, unit, what is left."""
    tests = {item.sensor: item.words for item in fitted.found.whiteness}
    noise = {item.name: item.noise for item in fitted.graph.sensors}
    for item in fitted.noises:
        is_sensor = isinstance(item.of, Sensor)
        unit = item.of.unit
        if isinstance(item.of, SlowError) and item.of.after and item.declared < FORMAL * noise.get(item.of.target, 0.0):
            continue  # it is there after moves alone
        if isinstance(item.of, SlowError):
            stated = unit if unit.text else fitted.graph.signal_unit(item.of.target)
            unit = Unit("%", 0.01) if item.of.relative else stated
        declared = figure(item.declared / unit.factor, digits=3).number()
        both = figure(item.found / unit.factor, item.sd / unit.factor).both()
        if item.found > AT_MOST * item.declared and not is_sensor:
            both = f"{declared} or more"
        elif not item.is_known:
            both = f"less than {figure(item.at_most / unit.factor, digits=1).number()}"
        name = item.of.name if isinstance(item.of, Sensor) else item.of.words
        at = ", at 0" if isinstance(item.of, Sensor) and item.of.part else ""
        yield name, declared, both, unit_text(unit.text) + at, tests[item.name] if is_sensor else ""


def size_lines(fitted: Fitted) -> Iterator[tuple[str, str]]:
    """Say how far model and readings are apart, from sample to sample and over the whole recording."""
    sizes = residual_sizes(fitted.found)
    vague = [item.name for item in fitted.graph.components if item.start is not None and item.start.sd > 0.0]
    where = f"; begun exactly at the stated start of {join(vague)}" if vague else ""
    for label, kind in (("one sample ahead", 0), ("simulated", 1)):
        texts = []
        for k, sensor in enumerate(fitted.graph.sensors):
            size = max(float(item[kind][k]) for item in sizes) / sensor.unit.factor
            texts.append(f"{sensor.name} {_joined(f'{size:.3g}', sensor.unit)}")
        yield label, f"off by {', '.join(texts)} (root of the mean square){where if kind else ''}"


def doubt_sentences(fitted: Fitted) -> list[str]:
    """Say why what was found is not to be trusted yet, and what to do about it."""
    told = [stray_sentence(fitted.strays)] if fitted.strays else []
    if fitted.alarms:
        begin = {item.name: float(item.time[0]) for item in fitted.found.records}
        soonest, time = min(fitted.alarms.items(), key=lambda item: item[1] - begin[item[0]])
        told.append(
            f"It alarms on {len(fitted.alarms)} of {with_noun(len(begin), 'healthy recording')}, soonest on {soonest} "
            f"at {clock_text(time)}: what it says of a plant is most likely of what it leaves out. "
            "`--until-quiet` finds that."
        )
    return told


def fit_verdict(fitted: Fitted) -> str:
    """Say in a sentence what came of it."""
    found = fitted.found
    if not found.summit.settled:
        return (
            "The search did not come to rest; values may still move. Fit what was written once more; where that does "
            "not come to rest either, state better nominal values or fix some."
        )
    bad = [item.parameter.name for item in fitted.estimates if not item.determined]
    good = [item.parameter.name for item in fitted.estimates if item.determined]
    slow = [item.sensor for item in found.whiteness if not item.white]
    parts = []
    if good:
        parts.append(f"The data fix {join(good)}")
    if bad:
        alone = "themselves" if len(bad) > 1 else "itself"
        parts.append(f"{'but not' if good else 'The data do not fix'} {join(bad)} by {alone}")
    first = ", ".join(parts) + "." if parts else "Noise alone was fitted."
    second = (
        f" What is left of {join(slow)} is not white: see `faultbond check --data`."
        if slow
        else " What is left is white."
    )
    is_quiet = fitted.alarms is not None and not fitted.alarms
    third = " It alarms on no recording; how often it will, `faultbond check --data` says." if is_quiet else ""
    return first + second + third
