"""The verbs of the command line as functions; options are keywords with the same words."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

from faultbond.api.frame import Frame
from faultbond.api.options import (
    PathLike,
    QuantityLike,
    begun_at,
    file_of,
    level_of,
    method_of,
    names_of,
    part_of,
    path_of,
    recording_of,
    recordings_of,
    refuse_overwriting,
    seconds_of,
    spelled,
    truth_of,
    whole_of,
)
from faultbond.api.plant_model import Model, ModelLike, as_model, written
from faultbond.api.result import Result
from faultbond.api.told import Analysis, FittedModel, Told, printed
from faultbond.app.analysis import analysed, code_of, traced
from faultbond.app.any_run import watch_any
from faultbond.app.browser import generated_page
from faultbond.app.decision import accepted_in, rejected_in
from faultbond.app.fmu import generated_fmu
from faultbond.app.generation import generated
from faultbond.app.identification import identified, tried
from faultbond.app.model_check import understood
from faultbond.app.section import Show
from faultbond.app.simulation import Simulated, simulated
from faultbond.app.wishes import WITHIN, FitWishes, Imperfections, Wanted, Wishes
from faultbond.contract.findings import Decision
from faultbond.errors import FaultbondError
from faultbond.io.faults import parse_fault
from faultbond.io.memory_table import Recording
from faultbond.io.out import Out, finite, open_out
from faultbond.io.recording import write_recording
from faultbond.types import TARGETS

if TYPE_CHECKING:
    from rich.console import Console


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
    wanted = Wanted(
        method=method_of(method),
        report=path_of(report, "report"),
        accept=level_of(accept),
        state=path_of(state, "state"),
    )
    _refuse_outputs(plant, [recording], state=state, report=report, json=json)
    with _records(json) as out:
        found = watch_any(plant.source, recording_of(recording), wanted=wanted, out=out, curves=True)
        if found.stopped is not None:
            raise found.stopped
    result = Result(model=plant, of_run=found)
    if report is not None:
        result.report(report)
    return result


def check(
    model: ModelLike,
    *,
    data: object | Sequence[object] | None = None,
    promise: QuantityLike | None = None,
    settings: bool = False,
) -> Told:
    """Show what was understood of a model, or on healthy recordings what it gets wrong there.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    data : healthy recording, or a list of some
    promise : with `data`: mean time between false alarms that is wanted, such as "30 day"
    settings : whether the text has the numbers of the method too, which no model states

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
    source, settings = as_model(model).source, truth_of(settings, "settings")
    if data is None:
        found = understood(source, settings=settings)
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
        separate=tuple(names_of(item) for item in separate),
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
    lines, record = traced(as_model(model).source, names_of(names))
    return Told(record=MappingProxyType(finite(record)), text="\n".join(lines))


def fit(
    model: ModelLike,
    recordings: object | Sequence[object],
    *,
    output: PathLike | None = None,
    report: PathLike | None = None,
    until_quiet: bool = False,
    within: QuantityLike = WITHIN,
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
    within : how long that may take, such as "1 h"
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
        fixed=names_of(fixed) if fixed else (),
        free=None if free is None else names_of(free),
        prior=prior,
        starts=whole_of(starts, "starts", 1, 100),
        seed=whole_of(seed, "seed", 0, None),
        own=names_of(per_recording) if per_recording else (),
        until_quiet=truth_of(until_quiet, "until_quiet"),
        within=seconds_of(within, "within"),
    )
    given = recordings if isinstance(recordings, list | tuple) else [recordings]
    _refuse_outputs(source, given, output=output, report=report)
    found = identified(source.source, recordings_of(recordings), wishes=wishes)
    if found.failed is not None:
        raise found.failed
    records = found.records(path_of(output, "output"))
    fitted = FittedModel(
        record=MappingProxyType(finite(records[0])),
        text=printed(lambda console: found.show(console, path_of(output, "output"))),
        model=Model(found.text, file=str(output or source.file)),
        found=found,
        quieted=MappingProxyType(finite(records[1])) if len(records) > 1 else None,
    )
    if output is not None:
        written(output, found.text)
    if report is not None:
        fitted.report(report)
    return fitted


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simulation:
    """A recording of a simulated plant."""

    model: Model
    found: Simulated

    def __repr__(self) -> str:
        time = self.found.simulation.time
        span = f", {time[0]:.9g} s to {time[-1]:.9g} s" if len(time) else ""
        return f"<Simulation of {self.model.name!r}: {len(time)} samples{span}, seed {self.seed}>"

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
            write_recording(file_of(path, "path"), self.found.columns())
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
        faults=tuple(map(parse_fault, spelled([faults] if isinstance(faults, str) else faults))),
        seed=None if seed is None else whole_of(seed, "seed", 0, None),
        noise=truth_of(noise, "noise"),
        imperfections=Imperfections(
            spread=part_of(spread, "spread"),
            lag=seconds_of(lag, "lag"),
            curve=part_of(curve, "curve"),
            wander=truth_of(wander, "wander"),
        ),
        start=begun_at(start),
    )
    simulation = Simulation(model=plant, found=found)
    if output is not None:
        simulation.save(output)
    return simulation


def generate(
    model: ModelLike,
    output: PathLike,
    *,
    target: str | None = None,
    fmu: int | None = None,
    web: bool = False,
    recording: PathLike | None = None,
    lanes_at_most: int | None = None,
    watch_only: bool = False,
) -> Told:
    """Write a program and a library in C, an FMU, or a page of a browser, that watch the plant and need nothing else.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    output : folder to write, or file of the FMU, or of the page
    target : what its Makefile builds for if it is not told; None: the machine on which it is built
    fmu : write an FMU by version 2 or 3 of the standard, not a folder
    web : write a page that plays recordings, not a folder
    recording : CSV that the page has inside; None: the first `fault_*.csv` beside the model, if there is one
    lanes_at_most : test no more hypotheses than fit in so many filters, those of the lowest cost first; None: all
    watch_only : raise alarms, and name no fault

    Raises
    ------
    FaultbondError
        Where something is wrong with the model or an option, or the folder holds something else.
    """
    source, folder = as_model(model).source, file_of(output, "output")
    most = None if lanes_at_most is None else whole_of(lanes_at_most, "lanes_at_most", 1, None)
    watch_only = truth_of(watch_only, "watch_only")
    if fmu is not None and target is not None:
        raise FaultbondError("target: the library in an FMU is for this machine; others compile its sources")
    if target is not None and target not in TARGETS:
        raise FaultbondError(f"target={target!r}: no such target; one of {', '.join(TARGETS)}")
    if web and (fmu is not None or target is not None):
        raise FaultbondError("web: it writes a page; give it, or fmu or target")
    if recording is not None and not web:
        raise FaultbondError("recording: only a page, web=True, has a recording inside")
    if web:
        inside = path_of(recording, "recording")
        found = generated_page(source, output=folder, recording=inside, lanes_at_most=most, watch_only=watch_only)
    elif fmu is None:
        chosen = target or TARGETS[0]
        found = generated(source, output=folder, target=chosen, lanes_at_most=most, watch_only=watch_only)
    else:
        fmi = whole_of(fmu, "fmu", 2, 3)
        found = generated_fmu(source, fmi=fmi, output=folder, lanes_at_most=most, watch_only=watch_only)
    return Told(record=MappingProxyType(finite(found.record)), text="\n".join(found.lines))


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
    return accepted_in(
        as_model(model).source, file_of(state, "state"), spelled(names), repaired=truth_of(repaired, "repaired")
    )[1]


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
    return rejected_in(as_model(model).source, file_of(state, "state"), spelled(names))[1]


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
    files = [(item, "a recording") for item in recordings if isinstance(item, str | os.PathLike)]
    written = {"the state": state, "the output": output, "the report": report, "the file of records": json}
    refuse_overwriting([(model.file, "the model"), *files], written)


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
    fewest, least_noise = truth_of(fewest, "fewest"), truth_of(least_noise, "least_noise")
    if fewest and least_noise:
        raise FaultbondError("fewest and least_noise: give one of them")
    preference = "fewest components" if fewest else "least noise" if least_noise else "fewest frames"
    return Wishes(
        data=data,
        within=within,
        separate=separate,
        closed=whole_of(closed, "closed", 0, 5),
        patience=patience,
        preference=preference,
        budget=whole_of(budget, "budget", 1, 1000),
    )
