"""The verbs of the command line as functions; options are keywords with the same words."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from numbers import Integral, Real
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, TypeAlias

from faultbond.api.frame import Frame
from faultbond.api.plant_model import Model, ModelLike, as_model, written
from faultbond.api.result import Result
from faultbond.api.told import Analysis, FittedModel, Told, printed
from faultbond.app.analysis import analysed, code_of, traced
from faultbond.app.any_run import watch_any
from faultbond.app.decision import accepted_in, rejected_in
from faultbond.app.identification import identified, tried
from faultbond.app.model_check import understood
from faultbond.app.outputs import refuse_outputs
from faultbond.app.section import Show
from faultbond.app.simulation import Simulated, simulated
from faultbond.app.wishes import FitWishes, Imperfections, Wanted, Wishes
from faultbond.contract.findings import Decision
from faultbond.errors import FaultbondError
from faultbond.io.faults import parse_fault
from faultbond.io.files import identity
from faultbond.io.memory_table import MemoryTable, Recording, table_of
from faultbond.io.out import Out, finite, open_out
from faultbond.io.recording import write_recording
from faultbond.model.quantities import duration, quantity, spread
from faultbond.types import SURE, Method

if TYPE_CHECKING:
    from rich.console import Console

PathLike: TypeAlias = str | os.PathLike[str]
QuantityLike: TypeAlias = str | float  # "60 s", or SI
LOWEST_LEVEL = 0.5  # a diagnosis that is less likely than its opposite is accepted by no rule


def run(
    model: ModelLike,
    recording: object,
    *,
    method: str = "bank",
    accept: float | str | None = None,
    state: PathLike | None = None,
    json: PathLike | None = None,
    report: PathLike | None = None,
) -> Result:
    """Watch a recording, detect a fault and diagnose it.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    recording : a path, a data frame, a table of Arrow, or a dict of arrays; of a logic circuit the path of a scenario
    method : `bank` or `classic`
    accept : probability from which a diagnosis is accepted once it has been so sure for a while; `auto`: 0.95
    state : file of a kept run to go on from, if it exists, and to keep this one in
    json : file for the records, as of `--json`
    report : file for the report, a page of HTML

    Raises
    ------
    FaultbondError
        Where something is wrong with the model, the recording or an option.

    Example
    -------
    >>> import faultbond as fb
    >>> tank = fb.example("tank")
    >>> fb.run(tank, tank.recordings["healthy"]).verdict
    'healthy'
    """
    plant = as_model(model)
    wanted = Wanted(method=method_of(method), report=_path(report), accept=level_of(accept), state=_path(state))
    _refuse_outputs(plant, [recording], state=state, report=report, json=json)
    with _records(json) as out:
        found = watch_any(plant.source, recording_of(recording), wanted=wanted, out=out, curves=True)
    result = Result(model=plant, of_run=found)
    if report is not None:
        result.report(report)
    return result


def check(
    model: ModelLike, *, data: object | Sequence[object] | None = None, promise: QuantityLike | None = None
) -> Told:
    """Show what was understood of a model, or on healthy recordings what it gets wrong there.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    data : healthy recording, or a list of some
    promise : with `data`: mean time between false alarms that is wanted, such as "30 day"

    Raises
    ------
    FaultbondError
        Where something is wrong with the model, a recording or an option.

    Example
    -------
    >>> import faultbond as fb
    >>> fb.check(fb.example("tank"))["model"]
    'water tank'
    """
    source = as_model(model).source
    if data is None:
        found = understood(source)
    else:
        found = tried(source, recordings_of(data), promise=None if promise is None else seconds_of(promise, "promise"))
    return Told(record=MappingProxyType(finite(found.record)), text=printed(found.show))


def analyse(
    model: ModelLike,
    *,
    data: object | None = None,
    within: QuantityLike | None = None,
    separate: Sequence[str | Sequence[str]] = (),
    closed: int = 1,
    patience: QuantityLike = 4.0,
    budget: int = 1,
    fewest: bool = False,
    least_noise: bool = False,
) -> Analysis:
    """Tell which faults can be found and told apart, how small, and what would help.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    data : healthy recording: tell also what its inputs allow to see
    within : find the smallest faults within this time, such as "60 s"
    separate : sets of parameters that an input shall tell apart, such as ["K4", "K6,K1"]
    closed : solve sets of up to so many parameters in closed form, 0 to 5
    patience : time for all closed forms together
    budget : so many times the usual time for each search
    fewest, least_noise : take routes with the fewest components, or the least noise, not with the fewest samples

    Raises
    ------
    FaultbondError
        Where something is wrong with the model, the recording or an option.

    Example
    -------
    >>> import faultbond as fb
    >>> found = fb.analyse(fb.example("rc"), closed=0)
    >>> found.detectable["R"], found["sensors"]
    (True, ['V_C'])
    """
    wishes = _wishes(
        data=None if data is None else recording_of(data),
        within=None if within is None else seconds_of(within, "within"),
        separate=tuple(_names(item) for item in separate),
        closed=closed,
        patience=seconds_of(patience, "patience"),
        budget=budget,
        fewest=fewest,
        least_noise=least_noise,
    )
    shows: list[Show] = []
    found = analysed(as_model(model).source, wishes=wishes, tell=shows.append)

    def show(console: "Console") -> None:
        for part in shows:
            part(console)

    return Analysis(record=MappingProxyType(finite(found.record)), text=printed(show))


def code(
    model: ModelLike,
    form: str,
    *,
    closed: int = 1,
    patience: QuantityLike = 4.0,
    fewest: bool = False,
    least_noise: bool = False,
) -> str:
    """Give the closed forms of a plant as text.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    form : `python`, `c` or `latex`
    closed, patience, fewest, least_noise : as of `analyse`

    Raises
    ------
    FaultbondError
        Where something is wrong with the model or an option.
    """
    if form not in ("python", "c", "latex"):
        raise FaultbondError(f"form {form!r}: expected python, c or latex")
    wishes = _wishes(closed=closed, patience=seconds_of(patience, "patience"), fewest=fewest, least_noise=least_noise)
    return code_of(as_model(model).source, form, wishes=wishes)[1]


def trace(model: ModelLike, *names: str) -> Told:
    """Give the thesis' search for the shortest route to some parameters, step by step.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    names : of the parameters

    Raises
    ------
    FaultbondError
        Where something is wrong with the model or a name.
    """
    lines, record = traced(as_model(model).source, _names(names))
    return Told(record=MappingProxyType(finite(record)), text="\n".join(lines))


def fit(
    model: ModelLike,
    recordings: object | Sequence[object],
    *,
    output: PathLike | None = None,
    report: PathLike | None = None,
    until_quiet: bool = False,
    fixed: Sequence[str] = (),
    free: Sequence[str] | None = None,
    per_recording: Sequence[str] = (),
    prior: str = "widened",
    starts: int = 4,
    seed: int = 0,
) -> FittedModel:
    """Find parameters and noise from healthy recordings.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    recordings : healthy recording, or a list of some
    output : model file to write
    report : file for the report, a page of HTML
    until_quiet : add what the recordings call for until they are as quiet as promised
    fixed : parameters that are known
    free : the only parameters to find; None: all
    per_recording : parameters that each recording has for itself
    prior : what declared accuracies count for, `widened`, `declared` or `none`
    starts, seed : of the search

    Raises
    ------
    FaultbondError
        Where something is wrong with the model, a recording or an option.
    """
    if prior not in ("widened", "declared", "none"):
        raise FaultbondError(f"prior {prior!r}: expected widened, declared or none")
    source = as_model(model)
    wishes = FitWishes(
        fixed=_names(fixed) if fixed else (),
        free=None if free is None else _names(free),
        prior=prior,
        starts=_whole(starts, "starts", 1, 100),
        seed=_whole(seed, "seed", 0, None),
        own=_names(per_recording) if per_recording else (),
        until_quiet=until_quiet,
    )
    given = recordings if isinstance(recordings, list | tuple) else [recordings]
    _refuse_outputs(source, given, output=output, report=report)
    found = identified(source.source, recordings_of(recordings), wishes=wishes)
    records = found.records(_path(output))
    fitted = FittedModel(
        record=MappingProxyType(finite(records[0])),
        text=printed(lambda console: found.show(console, _path(output))),
        model=Model(found.text, file=str(output or source.file)),
        found=found,
        quieted=MappingProxyType(finite(records[1])) if len(records) > 1 else None,
    )
    if output is not None:
        written(Path(output), found.text)
    if report is not None:
        fitted.report(report)
    return fitted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """A recording of a simulated plant."""

    model: Model
    found: Simulated

    @property
    def seed(self) -> int:
        """Of the noise."""
        return self.found.seed

    @property
    def held(self) -> int:
        """How many samples lacked an input, whose last value was held."""
        return self.found.held

    @property
    def start(self) -> Mapping[str, float]:
        """Where states began, SI, as given or as solved from the sensors in the inputs."""
        return self.found.start

    def to_frame(self) -> Frame:
        """Give the recording, in the units of the model file."""
        graph = self.found.graph
        units = {graph.time.column or "time": graph.time.unit.text}
        units |= {item.column: item.unit.text for item in graph.inputs}
        units |= {item.column: item.unit.text for item in graph.sensors}
        return Frame(self.found.columns(), units)

    def save(self, path: PathLike) -> None:
        """Write the recording as CSV.

        Raises
        ------
        FaultbondError
            Where it cannot be written.
        """
        try:
            write_recording(Path(path), self.found.columns())
        except OSError as error:
            raise FaultbondError(f"{path}: it cannot be written: {error.strerror or error}.") from error

    def _repr_html_(self) -> str:
        return self.to_frame()._repr_html_()


def simulate(
    model: ModelLike,
    inputs: object,
    *,
    faults: str | Sequence[str] = (),
    seed: int | None = None,
    noise: bool = True,
    start: Mapping[str, QuantityLike] | None = None,
    spread: QuantityLike = 0.0,
    lag: QuantityLike = 0.0,
    curve: QuantityLike = 0.0,
    wander: bool = False,
    output: PathLike | None = None,
) -> Simulation:
    """Make a recording of the plant, healthy or faulty.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    inputs : recording with the time and the inputs
    faults : one or several, such as "K1=x1.85@2460", as of `--fault`
    seed : of the noise; None draws one
    noise : whether sensors and inputs scatter as the model declares
    start : of states, such as {"tank.q": "0.05 m^3"}
    spread : part by which true parameters are off, such as "3 %"
    lag : time by which inputs that settle lag behind
    curve : part by which inputs in percent act wrongly
    wander : whether what the model lets wander does so
    output : CSV file to write

    Raises
    ------
    FaultbondError
        Where something is wrong with the model, the inputs or an option.

    Example
    -------
    >>> import faultbond as fb
    >>> tank = fb.example("tank")
    >>> leak = fb.simulate(tank, tank.recordings["healthy"], faults="K6=x8@2460", seed=1)
    >>> list(leak.to_frame())
    ['time', 'u_in', 'u_out', 'flow', 'pressure']
    """
    plant = as_model(model)
    _refuse_outputs(plant, [inputs], output=output)
    found = simulated(
        plant.source,
        inputs=recording_of(inputs),
        faults=tuple(map(parse_fault, [faults] if isinstance(faults, str) else faults)),
        seed=None if seed is None else _whole(seed, "seed", 0, None),
        noise=noise,
        imperfections=Imperfections(
            spread=_part(spread, "spread"), lag=seconds_of(lag, "lag"), curve=_part(curve, "curve"), wander=wander
        ),
        start={name: _si(value, f"start {name}: ") for name, value in (start or {}).items()},
    )
    simulation = Simulation(model=plant, found=found)
    if output is not None:
        simulation.save(output)
    return simulation


def accept(model: ModelLike, state: PathLike, *names: str, repaired: bool = False) -> Decision:
    """Take a candidate of a kept run as the new normal; without names the best.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    state : file that `run` with `state`, or a `Monitor`, wrote
    names : parameters or components of the candidate, or its sensor or input
    repaired : whether it was the fault and is mended: nominal again

    Raises
    ------
    FaultbondError
        Where there is nothing to accept, or no such candidate.
    """
    return accepted_in(as_model(model).source, Path(state), names, repaired=repaired)[1]


def reject(model: ModelLike, state: PathLike, *names: str) -> Decision:
    """Rule a candidate of a kept run out; the others share its probability.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    state : file that `run` with `state`, or a `Monitor`, wrote
    names : parameters or components of the candidate, or its sensor or input

    Raises
    ------
    FaultbondError
        Where there is nothing to reject, or no such candidate.
    """
    return rejected_in(as_model(model).source, Path(state), names)[1]


def recording_of(recording: object) -> Recording:
    """Give a recording as the verbs take it: a path as text, all else as a table."""
    if isinstance(recording, str | os.PathLike):
        return os.fspath(recording)
    return recording if isinstance(recording, MemoryTable) else table_of(recording)


def recordings_of(given: object) -> tuple[Recording, ...]:
    """Give one recording, or each of a list.

    Raises
    ------
    FaultbondError
        Where the list is empty, or holds a frame twice.
    """
    if not isinstance(given, list | tuple):
        return (recording_of(given),)
    if not given:
        raise FaultbondError("an empty list: give at least one recording")
    if len({id(item) for item in given if not isinstance(item, str)}) < sum(
        not isinstance(item, str) for item in given
    ):
        raise FaultbondError("a recording is given twice; give each once")
    found = enumerate(map(recording_of, given), start=1)
    return tuple(item.numbered(k) if isinstance(item, MemoryTable) and len(given) > 1 else item for k, item in found)


def level_of(accept: float | str | None) -> float | None:
    """Give the probability from which a diagnosis is accepted by rule; None: by none.

    Raises
    ------
    FaultbondError
        Where it is no probability from 0.5 to 1.
    """
    if accept is None:
        return None
    if accept == "auto":
        return SURE
    if not isinstance(accept, Real) or not LOWEST_LEVEL <= accept <= 1.0:
        raise FaultbondError(
            f"accept={accept!r}: expected auto, or a probability from {LOWEST_LEVEL:g} to 1, such as 0.99"
        )
    return float(accept)


def seconds_of(value: QuantityLike, option: str) -> float:
    """Give a time in seconds, of a text with a unit or of a number.

    Raises
    ------
    FaultbondError
        Where it is negative, or no time.
    """
    if isinstance(value, str):
        return duration(value, f"{option}: ")
    if not isinstance(value, Real) or not value >= 0.0:
        raise FaultbondError(f"{option}={value!r}: expected a time, such as '60 s', or seconds")
    return float(value)


@contextmanager
def _records(json: PathLike | None) -> Iterator[Out]:
    """Open the file for the records, if one is asked for; nothing is printed."""
    if json is None:
        yield Out(text=None, json=None)
        return
    with open_out(os.fspath(json), grows=True) as out:
        yield replace(out, text=None)


def _refuse_outputs(
    model: Model,
    recordings: Sequence[object],
    *,
    state: PathLike | None = None,
    output: PathLike | None = None,
    report: PathLike | None = None,
    json: PathLike | None = None,
) -> None:
    """Refuse to write over what is read, as the command line does."""
    read = [(identity(Path(model.file)), "the model")]
    read += [(identity(Path(item)), "a recording") for item in recordings if isinstance(item, str | os.PathLike)]
    written = {"the state": state, "the output": output, "the report": report, "the file of records": json}
    refuse_outputs(read, [(Path(path), what) for what, path in written.items() if path is not None])


def method_of(method: str) -> Method:
    """Give a method by its name.

    Raises
    ------
    FaultbondError
        Where there is none of that name.
    """
    known = [item.value for item in Method]
    if method not in known:
        raise FaultbondError(f"method={method!r}: expected {' or '.join(known)}")
    return Method(method)


def _wishes(
    *,
    closed: int,
    patience: float,
    fewest: bool,
    least_noise: bool,
    data: Recording | None = None,
    within: float | None = None,
    separate: tuple[tuple[str, ...], ...] = (),
    budget: int = 1,
) -> Wishes:
    if fewest and least_noise:
        raise FaultbondError("fewest and least_noise: give one of them")
    preference = "fewest components" if fewest else "least noise" if least_noise else "fewest frames"
    return Wishes(
        data=data,
        within=within,
        separate=separate,
        closed=_whole(closed, "closed", 0, 5),
        patience=patience,
        preference=preference,
        budget=_whole(budget, "budget", 1, 1000),
    )


def _names(given: str | Sequence[str]) -> tuple[str, ...]:
    """Give names, of a text with commas between or of a sequence."""
    if not isinstance(given, str) and not all(isinstance(item, str) for item in given):
        raise FaultbondError(f"{given!r}: expected names, such as ['R', 'L'] or 'R,L'")
    names = tuple(name.strip() for item in ([given] if isinstance(given, str) else given) for name in item.split(","))
    if not all(names) or not names:
        raise FaultbondError(f"{given!r}: expected names, such as ['R', 'L'] or 'R,L'")
    if len(set(names)) < len(names):
        raise FaultbondError(f"{given!r}: a name stands there twice; give each once")
    return names


def _whole(value: int, option: str, least: int, most: int | None) -> int:
    is_whole = isinstance(value, Integral) and not isinstance(value, bool)
    if not is_whole or value < least or (most is not None and value > most):
        raise FaultbondError(f"{option}={value!r}: expected a whole number from {least}{f' to {most}' if most else ''}")
    return int(value)


def _part(value: QuantityLike, option: str) -> float:
    """Give a part of 1, of a text in percent or of a number."""
    if isinstance(value, Real):
        return float(value)
    found = spread(value, f"{option}: ") if isinstance(value, str) else None
    if found is None or not found.is_relative:
        raise FaultbondError(f"{option}={value!r}: expected a percentage, such as '3 %', or a part of 1")
    return found.ratio


def _si(value: QuantityLike, where: str) -> float:
    return quantity(value, where).value if isinstance(value, str) else float(value)


def _path(path: PathLike | None) -> Path | None:
    return None if path is None else Path(path)
