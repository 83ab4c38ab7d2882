"""What a fit found: as records, as text for people, and as a model file."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from rich.console import Console
from rich.text import Text

from faultbond.contract.records import Record
from faultbond.errors import ModelError
from faultbond.fit.identification import Fit
from faultbond.fit.outcome import (
    Estimate,
    NoiseFound,
    Silence,
    estimates_of,
    noises_of,
    residual_sizes,
    silences_of,
)
from faultbond.model.dump import dump_model
from faultbond.model.graph import BondGraph, Sensor, SlowError, Unit
from faultbond.model.rewrite import NewParameter, NewSize, rewrite
from faultbond.model.text import parse_model
from faultbond.report.console import lines, table, title
from faultbond.report.numbers import Notation, change_text, clock_text, duration_text, figure, unit_text
from faultbond.report.terminal import PLAIN_WIDTH
from faultbond.report.verdict import join

_ZERO = 3.0  # standard errors within which a nominal value of 0 is kept
AT_MOST = 0.999  # of what is declared; a slow error is not found larger
_CLOSE = 0.1  # accuracies by which what is read back from the file may differ, from rounding


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """A fit and the model it belongs to."""

    graph: BondGraph
    found: Fit
    version: str

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Parameters that were fitted."""
        return estimates_of(self.found)

    @property
    def noises(self) -> tuple[NoiseFound, ...]:
        """Noise of the sensors."""
        return noises_of(self.found, self.graph)

    @property
    def silences(self) -> tuple[Silence, ...]:
        """What the data do not tell."""
        return silences_of(self.found)

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the recordings."""
        return tuple(item.name for item in self.found.records)

    def model_text(self, text: str) -> str:
        """Give the text of the model file with what was found.

        Raises
        ------
        ModelError
            Where the text that came out does not read back as the fitted model.
        """
        parameters = [_new_parameter(item) for item in self.estimates]
        sizes = [
            NewSize(name=item.name, times=item.to_declare / item.declared, slow=isinstance(item.of, SlowError))
            for item in self.noises
            if item.to_declare != item.declared
        ]
        remark = f"{', '.join(Path(name).name for name in self.recordings)}: {_what(self)}."
        written = rewrite(text, self.graph, parameters, sizes, remark)
        self._compare(parse_model(written, file=self.graph.file))
        return written

    def _compare(self, read: BondGraph) -> None:
        """Refuse a text that says anything but what was found."""
        for item in self.estimates:
            back = read.parameter(item.parameter.name)
            value = 0.0 if _stays_zero(item) else item.value
            if abs(back.nominal - value) > _CLOSE * item.accuracy or back.accuracy < 0.99 * item.accuracy:
                raise ModelError(f"{self.graph.file}: what was found of {back.name} cannot be written into it")
        wanted = {item.name: item.to_declare for item in self.noises if isinstance(item.of, Sensor)}
        for name, size in [(item.name, item.noise) for item in read.sensors]:
            if abs(size - wanted.get(name, size)) > _CLOSE * size:
                raise ModelError(f"{self.graph.file}: the noise found of {name} cannot be written into it")
        same = replace(
            read,
            parameters=self.graph.parameters,
            sensors=self.graph.sensors,
            slow_errors=self.graph.slow_errors,
            defaults=self.graph.defaults,
        )
        if dump_model(same) != dump_model(self.graph):
            raise ModelError(f"{self.graph.file}: what was found cannot be written into it without changing the rest")


def _stays_zero(item: Estimate) -> bool:
    """Whether a nominal value of 0 agrees with the data."""
    return item.parameter.nominal == 0.0 and abs(item.value) <= _ZERO * item.sd


def _new_parameter(item: Estimate) -> NewParameter:
    """Give what is to be written of a parameter; a nominal value of 0 stays where the data agree with it."""
    parameter, unit = item.parameter, item.parameter.unit
    if _stays_zero(item):
        size = math.hypot(item.accuracy, item.value) / unit.factor
        return NewParameter(
            name=parameter.name, nominal=_joined("0", unit), others=(("accuracy", _joined(_up(size), unit)),)
        )
    digits = min(max(math.ceil(math.log10(abs(item.value) / item.accuracy)) + 3, 3), 15) if item.accuracy > 0 else 15
    nominal = _joined(f"{unit.from_si(item.value):.{digits}g}", unit)
    if parameter.nominal == 0.0 or abs(item.value) < item.accuracy:
        accuracy = _joined(_up(item.accuracy / unit.factor), unit)
    else:
        accuracy = f"{_up(100.0 * item.accuracy / abs(item.value))} %"
    changed_range = parameter.nominal == 0.0 and math.isinf(parameter.lower) and math.isinf(parameter.upper)
    others = (("accuracy", accuracy), *((("range", "any"),) if changed_range else ()))
    return NewParameter(name=parameter.name, nominal=nominal, others=others)


def _up(value: float) -> str:
    """Write a standard deviation with two digits, rounded up."""
    place = math.floor(math.log10(value)) - 1 if value > 0.0 else 0
    return f"{math.ceil(value / 10.0**place - 1e-9) * 10.0**place:.2g}"


def _joined(number: str, unit: Unit) -> str:
    return f"{number} {unit.text}".rstrip()


def _what(fitted: Fitted) -> str:
    parameters = [item.parameter.name for item in fitted.estimates]
    noises = [f"noise of {item.name}" for item in fitted.noises if item.to_declare != item.declared]
    return join([*parameters, *noises])


def fit_record(fitted: Fitted, output: Path | None) -> Record:
    """Give the record of a fit; SI."""
    found, graph = fitted.found, fitted.graph
    return {
        "record": "fit",
        "model": graph.name,
        "model_sha256": graph.sha256,
        "version": fitted.version,
        "output": None if output is None else str(output),
        "recordings": [_recording_record(fitted, r) for r in range(len(found.records))],
        "parameters": [_parameter_record(item) for item in fitted.estimates],
        "noise": [
            {"name": item.name, "kind": kind, "declared": item.declared, "found": item.found, "sd": item.sd}
            for item in fitted.noises
            for kind in ("sensor" if isinstance(item.of, Sensor) else "slow_error",)
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
        "alike": [dict(item.changes) for item in fitted.silences],
        "widened": {
            item.name: float(times) for item, times in zip(found.plant.unknowns.parameters, found.widths, strict=True)
        },
        "log_likelihood": found.summit.evaluation.value,
        "log_likelihood_before": found.before,
        "changes": [
            {"parameter": item.parameter, "recording": item.recording, "time": item.time, "statistic": item.statistic}
            for item in found.changes
        ],
        "wild": found.wild,
        "starts": found.starts,
        "reached": found.reached,
        "settled": found.summit.settled,
    }


def _recording_record(fitted: Fitted, number: int) -> Record:
    record = fitted.found.records[number]
    innovation, simulation = residual_sizes(fitted.found)[number]
    sensors = [item.name for item in fitted.graph.sensors]
    return {
        "recording": record.name,
        "samples": len(record.time),
        "readings": record.readings,
        "first": float(record.time[0]),
        "last": float(record.time[-1]),
        "prediction_error": dict(zip(sensors, map(float, innovation), strict=True)),
        "simulation_error": dict(zip(sensors, map(float, simulation), strict=True)),
    }


def _parameter_record(item: Estimate) -> Record:
    return {
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
    }


def print_fit(console: Console, fitted: Fitted, output: Path | None) -> None:
    """Print what a fit found.

    Parameters
    ----------
    console : where to print; one that is no terminal is set to `PLAIN_WIDTH` columns
    fitted : the fit
    output : the model file that was written, if any
    """
    if not console.is_terminal:
        console.width = PLAIN_WIDTH
    graph, found = fitted.graph, fitted.found
    console.print(Text.assemble((graph.name, "bold"), (f"  {graph.file}", "dim")))
    lines(console, list(_data_lines(fitted)))
    if fitted.estimates:
        title(console, "Parameters")
        table(console, HEADER, [parameter_row(item) for item in fitted.estimates])
        lines(console, list(remarks(fitted)))
    title(console, "Noise and what is left")
    table(console, ("sensor", "declared noise", "found ± sd", "unit", "what is left"), list(noise_rows(fitted)))
    lines(console, list(size_lines(fitted)))
    console.print()
    style = "bold green" if found.summit.settled else "bold yellow"
    console.print(Text(verdict(fitted), style=style))
    if output is not None:
        console.print(Text(f"Model written: {output}", style="bold"))


HEADER = ("name", "component", "nominal", "estimate ± sd", "unit", "change", "accuracy", "from the data")


def _data_lines(fitted: Fitted) -> Iterator[tuple[str, str]]:
    found = fitted.found
    for k, record in enumerate(found.records):
        span = duration_text(float(record.time[-1] - record.time[0]))
        yield ("recordings" if k == 0 else ""), f"{record.name}: {len(record.time)} samples, {span}"
    wide = [f"{name} {times:.1f} times" for name, times in found.contradicted.items()]
    if wide:
        yield "accuracies", f"the data contradict those declared and agree with wider ones: {', '.join(wide)}"
    if found.wild:
        yield "left out", f"{found.wild} readings far off all others"
    if found.starts > 1:
        yield "search", f"{found.reached} of {found.starts} starts end at the same values"


def parameter_row(item: Estimate) -> tuple[str, ...]:
    """Give the cells of a parameter, as `HEADER` names them."""
    parameter, unit = item.parameter, item.parameter.unit
    value, sd = unit.from_si(item.value), unit.difference_from_si(item.sd)
    return (
        parameter.name,
        parameter.owner,
        figure(unit.from_si(parameter.nominal)).number(Notation.FILE),
        figure(value, sd).both(Notation.FILE),
        unit_text(unit.text, Notation.FILE),
        change_text(parameter.nominal, item.value, item.sd),
        _accuracy_text(item),
        "at the end of its range" if item.at_end else "yes" if item.determined else "not alone",
    )


def _accuracy_text(item: Estimate) -> str:
    if item.parameter.nominal == 0.0:
        unit = item.parameter.unit
        return _joined(_up(item.accuracy / unit.factor), unit)
    return f"{_up(100.0 * item.accuracy / abs(item.value))} %"


def remarks(fitted: Fitted) -> Iterator[tuple[str, str]]:
    """Say what the parameters' table does not: combinations that do not show, and wider errors."""
    for k, item in enumerate(fitted.silences):
        yield ("looks alike" if k == 0 else ""), silence_text(item)
    if fitted.found.changes:
        first = fitted.found.changes[0]
        names = join(list(dict.fromkeys(item.parameter for item in fitted.found.changes)))
        yield "not steady", f"{names}; most of all {first.parameter}, about {clock_text(first.time)}. Is it healthy?"
    inflated = [item for item in fitted.estimates if item.inflation > 1.1]
    if inflated:
        most = max(item.inflation for item in inflated)
        yield "± sd", f"up to {most:.1f} times that of a right model: the data ask for other values at other times"


def silence_text(item: Silence) -> str:
    """Say which parameters change together unseen."""
    parts = [
        f"{name} {100 * part:+.0f} %" if abs(part) >= 0.01 else f"{name} {100 * part:+.1f} %"
        for name, part in item.changes
    ]
    text = ", ".join(parts).replace("-", "\N{MINUS SIGN}")
    return f"{text}: the data do not tell" if len(parts) == 1 else f"{text} together: the sensors do not show it"


def noise_rows(fitted: Fitted) -> Iterator[tuple[str, ...]]:
    """Give the cells of each sensor and slow error: name, declared and found size, unit, what is left."""
    tests = {item.sensor: item.words for item in fitted.found.whiteness}
    for item in fitted.noises:
        is_sensor = isinstance(item.of, Sensor)
        unit = _unit_of(item.of)
        declared = figure(item.declared / unit.factor, digits=3).number(Notation.FILE)
        both = figure(item.found / unit.factor, item.sd / unit.factor).both(Notation.FILE)
        if item.found > AT_MOST * item.declared and not is_sensor:
            both = f"{declared} or more"
        elif not item.is_known:
            both = f"less than {figure(2.0 * (item.found + item.sd) / unit.factor, digits=1).number(Notation.FILE)}"
        name = item.name if is_sensor else f"slow error of {item.name}"
        yield name, declared, both, unit_text(unit.text, Notation.FILE), tests[item.name] if is_sensor else ""


def _unit_of(item: Sensor | SlowError) -> Unit:
    """Give the unit in which a size is told: SI where a signal has none."""
    if isinstance(item, Sensor):
        return item.unit
    if item.relative:
        return Unit("%", 0.01)
    return item.unit if item.unit.text else Unit("SI")


def size_lines(fitted: Fitted) -> Iterator[tuple[str, str]]:
    """Say how far model and readings are apart, from sample to sample and over the whole recording."""
    sizes = residual_sizes(fitted.found)
    for label, kind in (("one sample ahead", 0), ("simulated", 1)):
        texts = []
        for k, sensor in enumerate(fitted.graph.sensors):
            size = max(float(item[kind][k]) for item in sizes) / sensor.unit.factor
            texts.append(f"{sensor.name} {_joined(f'{size:.3g}', sensor.unit)}")
        yield label, f"off by {', '.join(texts)} (root of the mean square)"


def verdict(fitted: Fitted) -> str:
    """Say in a sentence what came of it."""
    found = fitted.found
    if not found.summit.settled:
        return "The search did not come to rest; values may still move. State better nominal values or fix some."
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
    return first + second
